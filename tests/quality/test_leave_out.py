"""What is left out is exactly what the findings name."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.errors import RecordingError
from selector.findings import Finding, Where
from selector.quality import inspect, stretches, without_faults
from tests.quality.workshop import plain_recording, plain_tables


@pytest.fixture(scope="module")
def recording():
    return plain_recording(plain_tables(runs=3, samples=100))


def acting(action, **where):
    return Finding("test", "error", "", Where(**where), {}, "", action)


def missing(recording):
    return {
        (run, name): np.flatnonzero(np.isnan(recording.values(run, [name])[:, 0])).tolist()
        for run in recording.runs
        for name in recording.names
        if np.isnan(recording.values(run, [name])).any()
    }


def test_nothing_happens_without_an_action(recording):
    findings = [acting("none", channel="T1", run="r1"), acting("none")]
    assert without_faults(recording, findings) is recording
    assert without_faults(recording, []) is recording


def test_a_stretch_of_a_channel_includes_both_ends(recording):
    after = without_faults(recording, [acting("leave-out-stretch", channel="T1", run="r2", from_s=200.0, to_s=260.0)])
    assert missing(after) == {("r2", "T1"): [10, 11, 12, 13]}


def test_a_stretch_without_channel_or_ends_is_wide(recording):
    after = without_faults(recording, [acting("leave-out-stretch", run="r1", from_s=1900.0)])
    assert missing(after) == {("r1", name): [95, 96, 97, 98, 99] for name in recording.names}
    after = without_faults(recording, [acting("leave-out-stretch", channel="Z", to_s=20.0)])
    assert missing(after) == {(run, "Z"): [0, 1] for run in recording.runs}


def test_listed_windows_leave_what_lies_between(recording):
    finding = Finding(
        "spike",
        "warning",
        "",
        Where("T1", "r1", 100.0, 400.0),
        {"windows_s": [[100.0, 100.0], [380.0, 400.0]]},
        "",
        "leave-out-stretch",
    )
    assert stretches(finding) == [(100.0, 100.0), (380.0, 400.0)]
    assert missing(without_faults(recording, [finding])) == {("r1", "T1"): [5, 19, 20]}


def test_a_run_goes_and_the_rest_stays(recording):
    after = without_faults(recording, [acting("leave-out-run", run="r2")])
    assert after.runs == ("r1", "r3")
    for run in after.runs:
        np.testing.assert_array_equal(after.values(run, after.names), recording.values(run, recording.names))
        np.testing.assert_array_equal(after.time_s(run), recording.time_s(run))


def test_a_channel_goes_from_one_run_or_from_all(recording):
    one = without_faults(recording, [acting("leave-out-channel", channel="T2", run="r3")])
    assert missing(one) == {("r3", "T2"): list(range(100))}
    every = without_faults(recording, [acting("leave-out-channel", channel="T2", run=run) for run in recording.runs])
    unnamed = without_faults(recording, [acting("leave-out-channel", channel="T2")])
    for after in (every, unnamed):
        assert after.names == tuple(name for name in recording.names if name != "T2")
        assert missing(after) == {}


def test_a_channel_left_out_of_every_run_that_stays_is_removed(recording):
    findings = [acting("leave-out-run", run="r1")]
    findings += [acting("leave-out-channel", channel="T2", run=run) for run in ("r2", "r3")]
    assert "T2" not in without_faults(recording, findings).names


def test_nothing_left_is_said(recording):
    with pytest.raises(RecordingError, match="nothing of 3 run"):
        without_faults(recording, [acting("leave-out-run", run=run) for run in recording.runs])


def test_the_original_and_its_provenance_are_untouched():
    tables = plain_tables(runs=2)
    tables["r1"].iloc[100:110, 1] = 850.0
    recording = plain_recording(tables)
    before = recording.frame.copy()
    findings = inspect(recording)
    after = without_faults(recording, findings)
    pd.testing.assert_frame_equal(recording.frame, before)
    assert after.provenance == recording.provenance
    assert missing(after) == {("r1", "T1"): list(range(100, 110))}


def test_what_is_left_has_no_fault_any_more():
    tables = plain_tables()
    tables["r1"].iloc[100:110, 1] = 850.0
    tables["r2"].iloc[300:400, 3] = tables["r2"].iloc[300, 3]
    tables["r4"].loc[5000:, "T5"] -= 1.5
    tables["r3"]["Z"] /= 1000
    recording = plain_recording(tables)
    findings = inspect(recording)
    assert {f.id for f in findings if f.action != "none"} == {"sensor-break", "stuck", "step", "wrong-unit"}
    assert not [f.statement for f in inspect(without_faults(recording, findings)) if f.action != "none"]
