"""When a search stops early, and how far its result may then be from the optimum."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from selector.models._subset_tree import PROOF_TOLERANCE

Cancel = threading.Event | Callable[[], bool]

CHUNK_WORK = 30_000_000
"""Multiplications between two looks at the clock and at `cancel`: about 0.02 s."""


def is_set(cancel: Cancel | None) -> bool:
    """Whether the user wants to stop."""
    if cancel is None:
        return False
    return cancel.is_set() if isinstance(cancel, threading.Event) else bool(cancel())


def relative_gap(best: float, bound: float) -> float:
    """How far the best RSS may be above the optimum, as a share of it: 0 where proved, 1 where nothing is known."""
    if bound >= best * (1.0 - PROOF_TOLERANCE) - 1e-14:
        return 0.0
    return 1.0 if not np.isfinite(best) else float((best - max(bound, 0.0)) / best)
