"""What holds in every test: time that Hypothesis may take, and what the collector of garbage looks at."""

from __future__ import annotations

import gc

from hypothesis import HealthCheck, settings

# No test depends on how quick the machine is.
settings.register_profile(
    "unhurried", deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow]
)  # fmt: skip
settings.load_profile("unhurried")


def pytest_collection_finish() -> None:
    """Some 650 000 objects of modules and tests live to the end: without this every full collection visits them."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000)
