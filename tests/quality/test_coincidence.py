"""What excuses a jump: an event elsewhere, not the bends that every warming machine has."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.quality import inspect
from tests.quality.workshop import plain_recording, plain_tables


def _stepped(column: str, run: str, at: int, height: float) -> tuple[str, ...]:
    """What is done about a step planted in plain tables; their speed changes at samples 46, 360 to 418, and 576."""
    tables = plain_tables(3)
    values = tables[run][column].to_numpy().copy()
    values[at:] += height
    tables[run][column] = values
    found = inspect(plain_recording(tables))
    return tuple(f.action for f in found if f.id == "step" and f.where.channel == column and f.where.run == run)


@pytest.mark.parametrize(("column", "height"), [("Z", 10.0), ("Z", 40.0), ("T4", 3.0), ("T4", 8.0)])
def test_smooth_bends_of_other_channels_excuse_no_step(column: str, height: float) -> None:
    cases = [(run, at) for run in ("r1", "r2", "r3") for at in (80, 100, 250, 600)]
    assert [_stepped(column, run, at, height) for run, at in cases] == [("leave-out-stretch",)] * len(cases)


def _two_courses(kink_k_per_sample: float, speed: bool) -> pd.DataFrame:
    rng = np.random.default_rng(3)
    count, at = 400, 200
    time = 20.0 * np.arange(count)
    later = np.maximum(np.arange(count) - at, 0)
    table = {
        "T1": 20 + 0.03 * np.arange(count) + 2.0 * (later > 0) + rng.normal(0, 0.03, count),
        "T2": 20 + kink_k_per_sample * np.minimum(later, 25) + rng.normal(0, 0.03, count),
        "T3": 20 + 0.005 * np.arange(count) + rng.normal(0, 0.03, count),
        "Z": 0.02 * np.arange(count) + rng.normal(0, 0.3, count),
    }
    if speed:
        table["n"] = np.full(count, 1000.0)
    return pd.DataFrame(table, index=time)


@pytest.mark.parametrize(
    ("kink_k_per_sample", "action"),
    # T1 jumps by 0.15 of its span; after two samples T2 has gone 0.08 of its own
    [(0.12, "none"), (0.0, "leave-out-stretch")],
)
def test_only_a_kink_as_large_as_the_jump_excuses_it(kink_k_per_sample: float, action: str) -> None:
    found = inspect(plain_recording({"r1": _two_courses(kink_k_per_sample, speed=True)}))
    assert [f.action for f in found if f.id == "step" and f.where.channel == "T1"] == [action]


def test_beside_a_constant_speed_a_kink_does_not_excuse_a_gauge() -> None:
    table = _two_courses(0.12, speed=True)
    table["T1"] = table["T1"] - 2.0 * (np.arange(400) > 200)
    table["Z"] += 30.0 * (np.arange(400) > 200)
    found = [f for f in inspect(plain_recording({"r1": table})) if f.id == "step" and f.where.channel == "Z"]
    assert [f.action for f in found] == ["leave-out-stretch"]
