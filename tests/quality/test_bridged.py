"""Single lost readings are taken from their neighbours; what is longer stays lost."""

import numpy as np
import pandas as pd
import pytest

from selector.quality import bridged
from selector.recording import Channel, Recording

MINUTES = np.arange(120) * 60.0
WARMING = 20.0 + 8.0 * (1.0 - np.exp(-MINUTES / 2400.0))


def recording(lost: dict[str, list[int]], time_s: np.ndarray = MINUTES) -> Recording:
    table = pd.DataFrame({"T1": WARMING, "T2": WARMING + 1.0, "Z": 5.0 * (WARMING - 20.0)}, index=time_s)
    for name, rows in lost.items():
        table.iloc[rows, table.columns.get_loc(name)] = np.nan
    channels = [
        Channel("T1", "temperature", "degC"),
        Channel("T2", "temperature", "degC"),
        Channel("Z", "displacement", "um"),
    ]
    return Recording.from_runs({"a": table, "b": table}, channels)


def test_up_to_two_in_a_row_are_bridged_within_the_curve():
    found, told = bridged(recording({"T1": [10, 40, 41, 80]}))
    assert found.values("b", ["T1"])[:, 0] == pytest.approx(WARMING, abs=2e-3)
    assert [(one.id, one.where.channel) for one in told] == [("readings-lost", "T1")]
    assert told[0].evidence["share"] == pytest.approx(4 / 120)


@pytest.mark.parametrize("rows", [[0], [0, 1]])
def test_a_start_is_on_the_line_through_what_follows(rows):
    found, _ = bridged(recording({"T1": rows}))
    assert found.values("a", ["T1"])[: len(rows), 0] == pytest.approx(WARMING[rows], abs=0.02)


@pytest.mark.parametrize("rows", [[50, 51, 52], [0, 1, 2], [119], [118, 119]])
def test_what_is_longer_or_at_the_end_stays_lost(rows):
    given = recording({"T2": rows})
    found, told = bridged(given)
    assert np.isnan(found.values("a", ["T2"])[rows, 0]).all()
    assert not told


def test_a_pause_is_not_bridged():
    found, _ = bridged(recording({"T1": [60]}, np.where(np.arange(120) < 60, MINUTES, MINUTES + 1800.0)))
    assert np.isnan(found.values("a", ["T1"])[60, 0])


def test_a_sensor_that_loses_more_than_a_tenth_and_a_gauge_stay_as_they_are():
    given = recording({"T1": list(range(5, 110, 8)), "Z": [30]})
    found, told = bridged(given)
    assert found is given
    assert not told
