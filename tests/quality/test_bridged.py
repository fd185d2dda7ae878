"""Single lost readings are taken from their neighbours; what is longer stays lost."""

import numpy as np
import pandas as pd
import pytest

from selector.quality import bridged, usable
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
    given = recording({"T1": [10, 40, 41, 80]})
    found, told = bridged(given, given)
    assert found.values("b", ["T1"])[:, 0] == pytest.approx(WARMING, abs=2e-3)
    assert [(one.id, one.where.channel) for one in told] == [("readings-lost", "T1")]
    assert np.isnan(given.values("b", ["T1"])[[10, 40, 41, 80], 0]).all()  # what was given is not changed
    assert told[0].evidence["share"] == pytest.approx(4 / 120)


@pytest.mark.parametrize("rows", [[50, 51, 52], [0], [0, 1], [119], [118, 119]])
def test_what_is_longer_or_at_the_end_stays_lost(rows):
    given = recording({"T2": rows})
    found, told = bridged(given, given)
    assert np.isnan(found.values("a", ["T2"])[rows, 0]).all()
    assert not told


def test_a_pause_is_not_bridged():
    given = recording({"T1": [60]}, np.where(np.arange(120) < 60, MINUTES, MINUTES + 1800.0))
    found, _ = bridged(given, given)
    assert np.isnan(found.values("a", ["T1"])[60, 0])


def test_a_sensor_that_loses_more_than_a_tenth_and_a_gauge_stay_as_they_are():
    given = recording({"T1": list(range(5, 110, 8)), "Z": [30]})
    found, told = bridged(given, given)
    assert found is given
    assert not told


def test_what_was_left_out_stays_out_and_an_outage_keeps_no_single_reading_from_being_bridged():
    given = recording({"T1": [10, 30, *range(60, 90)]})
    left_out = recording({"T1": [10, 20, 30, *range(60, 90)]})
    found = bridged(left_out, given)[0].values("a", ["T1"])[:, 0]
    assert np.isfinite(found[[10, 30]]).all()
    assert np.isnan(found[[20, *range(60, 90)]]).all()


def test_what_a_study_uses_is_bridged_without_what_was_left_out_and_all_of_it_is_told():
    given = recording({"T1": [10, 30], "T2": [40]})
    used, told = usable(given)
    assert used.runs == ("a",)
    assert np.isfinite(used.values("a", ["T1", "T2"])).all()
    assert {(one.id, one.where.run or one.where.channel) for one in told} >= {
        ("same-file-twice", "b"),
        ("readings-lost", "T1"),
        ("readings-lost", "T2"),
    }
