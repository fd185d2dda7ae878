"""One long record is the runs that it consists of: cut at pauses, or where the spindle turns after a long rest."""

import numpy as np
import pandas as pd
import pytest

from selector.models.run_before import in_parts
from selector.recording import PARTS, Channel, Recording, at_pauses, restarts
from selector.selection import Options, select
from selector.selection.exploration import Exploration

HOUR = 60
CHANNELS = (
    Channel("n", "spindle_speed", "rpm"),
    Channel("T1", "temperature", "degC"),
    Channel("Z", "displacement", "um", axis="Z"),
)


def record(speed, channels=CHANNELS, runs=("long",)):
    time = 60.0 * np.arange(len(speed))
    table = {"n": speed, "T1": 20 + 1e-3 * time, "Z": 1e-2 * time}
    frame = pd.DataFrame({one.name: table[one.name] for one in channels}, index=pd.Index(time, name="time_s"))
    return Recording.from_runs(dict.fromkeys(runs, frame), channels, {"machine": "M"})


def days(*hours):
    """Hours turning and standing by turns, standing first; a sample a minute."""
    return np.concatenate([np.full(round(HOUR * h), 3000.0 * (k % 2)) for k, h in enumerate(hours)])


def test_every_warming_after_a_rest_begins_a_run_with_its_last_sample_at_rest():
    whole = record(days(0.2, 4, 4, 4, 4, 4, 4))
    parts = in_parts(whole)

    assert parts.runs == ("long 1", "long 2", "long 3")
    assert [(part, run) for part, (run, _) in parts.provenance[PARTS].items()] == [
        (part, "long") for part in parts.runs
    ]
    assert sum(len(parts.time_s(run)) for run in parts.runs) == len(whole.time_s("long"))
    for run in parts.runs[1:]:
        assert parts.time_s(run)[0] == 0.0
        assert parts.values(run, ["n"])[:2, 0].tolist() == [0.0, 3000.0]
    readings = np.concatenate([parts.values(run, ["T1", "Z"]) for run in parts.runs])
    assert np.array_equal(readings, whole.values("long", ["T1", "Z"]))


@pytest.mark.parametrize(
    "hours",
    [(0.2, 4, 4, 4, 4), (0.2, 4, 0.3, 4, 0.3, 4, 0.3, 4), (0.2, 12, 1, 12, 1, 12), (0.2, 20)],
    ids=["two parts prove less than stretches", "breaks", "short beside what turned before", "one warming"],
)
def test_what_makes_too_few_parts_stays_as_it_is(hours):
    whole = record(days(*hours))
    assert in_parts(whole) is whole


@pytest.mark.parametrize("channels", [CHANNELS, CHANNELS[1:]], ids=["with a speed", "without"])
@pytest.mark.parametrize(("pauses_h", "expected"), [((16, 63), 3), ((16,), 2), ((0.5, 0.5), 1)])
def test_days_in_one_file_are_cut_where_no_rows_are(channels, pauses_h, expected):
    minutes = np.arange(3 * 8 * HOUR)
    # the gauge is set to zero every morning; the spindle turns into the first pause
    table = {"n": np.where(minutes % 480 < 10, 0.0, 3000.0), "T1": 20.0 + minutes % 480, "Z": 0.1 * (minutes % 480)}
    later = sum((60.0 * HOUR * hours * (minutes >= 480 * (k + 1)) for k, hours in enumerate(pauses_h)), np.zeros(1))
    index = pd.Index(60.0 * minutes + later, name="time_s")
    frame = pd.DataFrame({one.name: table[one.name] for one in channels}, index=index)
    whole = Recording.from_runs({"week": frame}, channels, {})
    parts = in_parts(whole)

    assert len(parts.runs) == expected
    assert (parts is whole) == (expected == 1)
    assert all(parts.values(run, ["Z"])[0, 0] == 0.0 for run in parts.runs)


def test_every_run_is_cut_at_its_pauses_and_parts_know_when_they_began():
    times = {"a": [0.0, 60.0, 120.0, 9000.0, 9060.0], "a 1": [60.0, 120.0, 180.0]}
    tables = {
        run: pd.DataFrame({"T1": time_s, "Z": time_s}, index=pd.Index(time_s, name="time_s"))
        for run, time_s in times.items()
    }
    known = {"runs": {"a": {"file": "a.csv", "start": "2026-03-29T23:00:00+00:00"}, "a 1": {"start": None}}}
    parts = at_pauses(Recording.from_runs(tables, CHANNELS[1:], known))

    assert parts.runs == ("a 1'", "a 2", "a 1")
    assert parts.provenance[PARTS] == {"a 1'": ("a", 0.0), "a 2": ("a", 9000.0)}
    assert parts.time_s("a 2").tolist() == [0.0, 60.0]
    assert parts.values("a 2", ["Z"])[:, 0].tolist() == [9000.0, 9060.0]
    assert parts.time_s("a 1").tolist() == times["a 1"]
    assert parts.provenance["runs"]["a 2"] == {"file": "a.csv", "start": "2026-03-30T01:30:00+00:00"}
    assert at_pauses(parts) is parts


def test_only_one_run_with_a_speed_is_cut_at_rests():
    course = days(0.2, 4, 4, 4, 4, 4, 4)
    two, silent = record(course, runs=("a", "b")), record(course, channels=CHANNELS[1:])
    assert in_parts(two) is two
    assert in_parts(silent) is silent


def test_a_speed_that_is_missing_is_the_one_before():
    course = days(0.2, 4, 4, 4, 4, 4, 4)
    gaps = course.copy()
    gaps[30:200] = np.nan
    assert [len(in_parts(record(gaps)).time_s(run)) for run in ("long 1", "long 2", "long 3")] == [
        len(in_parts(record(course)).time_s(run)) for run in ("long 1", "long 2", "long 3")
    ]


def test_rests_count_against_what_turned_before_them():
    rests = np.array([True, False, True, False, True, False])
    assert restarts(rests, 3600.0 * np.array([1, 8, 1, 8, 5, 8])) == [0]
    assert restarts(rests, 3600.0 * np.array([1, 8, 1, 8, 6, 8])) == [0, 4]
    assert restarts(rests, 3600.0 * np.array([1, 2, 1, 2, 1, 8])) == [0, 2, 4]


def test_a_selection_from_one_record_is_proved_on_its_parts():
    rng = np.random.default_rng(3)
    speed = days(0.2, *[4] * 10)
    time = 60.0 * np.arange(len(speed))
    warm = np.zeros((len(speed), 3))
    for k, (tau_s, gain) in enumerate(((1500.0, 8.0), (6000.0, 5.0), (20000.0, 3.0))):
        for i in range(1, len(speed)):
            warm[i, k] = warm[i - 1, k] + 60.0 / tau_s * (
                gain * speed[i] / 3000.0 * rng.uniform(0.9, 1.1) - warm[i - 1, k]
            )
    channels = (*(Channel(f"T{k}", "temperature", "degC") for k in (1, 2, 3)), CHANNELS[0], CHANNELS[2])
    courses = {f"T{k + 1}": 20 + warm[:, k] + 0.02 * rng.standard_normal(len(speed)) for k in range(3)}
    courses |= {"n": speed, "Z": 2.0 * warm[:, 0] - 3.0 * warm[:, 1] + 0.2 * rng.standard_normal(len(speed))}
    whole = Recording.from_runs({"long": pd.DataFrame(courses, index=pd.Index(time, name="time_s"))}, channels)

    found = select(whole, Options(responses=("Z",)))
    one_run = next(one for one in found.findings if one.id == "one-run-only")
    assert [part.name for part in found.proof.per_response["Z"]] == [f"long {k}" for k in range(1, 6)]
    assert one_run.evidence == {"runs": 1, "parts": 5}
    assert found.proof.rmse_um("Z") < 0.3
    assert found.statsmodels_results("Z", whole).nobs == len(speed)
    assert Exploration.of(whole, Options(responses=("Z",))).parts == "run"
