"""What leaves its siblings for another reason than a broken sensor is told, and nothing is left out for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.quality import inspect
from selector.readers import read
from selector.recording import Channel, Recording
from tests.quality.workshop import plain_recording, plain_tables

VMC37 = Path(__file__).parents[2] / "fixtures" / "vmc37"


@pytest.fixture(scope="module")
def vmc37() -> Recording:
    return read([VMC37]).recording


# r5 has coolant and starts warm, r7 coolant, r8 an open gate; no channel says so. The data are clean.
@pytest.mark.parametrize(
    "numbers",
    [
        *[(3, 4, 5), (4, 5, 6), (2, 3, 4, 5), (3, 4, 5, 6), (1, 2, 3, 4, 5), (4, 5, 6, 7, 8), (1, 2, 3, 4, 5, 6)],
        *[(2, 3, 4, 5, 6, 7, 8), (1, 2, 6, 7), (1, 2, 4, 6, 8), (1, 2, 3, 5)],
    ],
)
def test_clean_runs_of_another_kind_lose_nothing(vmc37, numbers):
    tables = {f"r{k}": vmc37.frame.loc[f"r{k}"] for k in numbers}
    findings = inspect(Recording.from_runs(tables, vmc37.channels))
    assert [f for f in findings if f.action != "none" or f.level == "error"] == []


def drifting(**tables_of):
    """T2 of run r2 creeps away by 5 K: enough to act, if nothing else explains it."""
    tables = plain_tables(**tables_of)
    tables["r2"]["T2"] -= 5.0 * np.clip((tables["r2"].index - 4000) / 3000, 0, 1)
    return tables


def verdict(tables):
    (found,) = [f for f in inspect(plain_recording(tables)) if f.id == "drifts-from-group"]
    assert (found.where.channel, found.where.run) == ("T2", "r2")
    return found


def test_a_large_departure_that_nothing_else_explains_is_left_out():
    found = verdict(drifting())
    assert (found.level, found.action) == ("error", "leave-out-stretch")


def test_not_in_a_run_that_starts_warm():
    tables = drifting()
    tables["r2"][["T3", "T4"]] += 4.0
    found = verdict(tables)
    assert (found.level, found.action) == ("warning", "none")
    assert "start" in found.suggestion


def test_not_in_a_run_with_a_switch_on_for_longer():
    tables = drifting()
    for name, table in tables.items():
        table["coolant"] = (table.index > (3000 if name == "r2" else 13_000)).astype(float)
    channels = [*plain_recording(plain_tables()).channels]
    recording = Recording.from_runs(tables, [*channels, Channel("coolant", "state", "1")])
    (found,) = [f for f in inspect(recording) if f.id == "drifts-from-group"]
    assert (found.level, found.action) == ("warning", "none")
    assert "coolant" in found.suggestion


def test_not_where_the_siblings_are_beyond_what_the_other_runs_cover():
    tables = drifting()
    thermal = [name for name in tables["r2"] if name.startswith("T") and name != "Tamb"]
    for name in ("r1", "r3", "r4"):  # the other runs heat half as much
        start = tables[name][thermal].iloc[:20].mean()
        tables[name][thermal] = start + 0.5 * (tables[name][thermal] - start)
    found = verdict(tables)
    assert (found.level, found.action) == ("warning", "none")
    assert "other runs" in found.suggestion


def test_not_when_it_is_small():
    tables = plain_tables()
    tables["r2"]["T2"] -= 2.3 * np.clip((tables["r2"].index - 4000) / 3000, 0, 1)
    found = verdict(tables)
    assert (found.level, found.action) == ("warning", "none")
    assert "source" in found.suggestion


def test_without_a_thermometer_a_long_way_is_no_wrong_unit():
    time_s, draw = 10.0 * np.arange(300), np.random.default_rng(2)
    way = pd.DataFrame({"Z": 4e4 * np.sin(time_s / 200.0) + draw.standard_normal(300)}, index=time_s)
    cold = way.assign(T=20.0 + 0.05 * draw.standard_normal(300))
    axis, sensor = Channel("Z", "displacement", "um"), Channel("T", "temperature", "degC")
    assert "wrong-unit" not in {one.id for one in inspect(Recording.from_runs({"r1": way}, [axis]))}
    assert "wrong-unit" in {one.id for one in inspect(Recording.from_runs({"r1": cold}, [axis, sensor]))}
