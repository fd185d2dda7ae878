"""What is left out or refused before anything is compared: codes, exchanged runs, simulations of a part of a run."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.workflow import diagnosis
from selector.errors import InputError, OptionError
from selector.recording import Channel, Recording

N, STEP_S = 300, 60.0
TIME = np.arange(N) * STEP_S
CHANNELS = (
    Channel("n", "spindle_speed", "rpm"),
    Channel("T1", "temperature", "degC"),
    Channel("Z", "displacement", "um"),
)
RUNS = ("r1", "r2", "r3", "r4")


def warm(run):
    """Growth of a spindle that runs at speeds of its own in every run [µm], and the speed [r/min]."""
    speed = np.repeat(np.random.default_rng(100 + run).choice([0.0, 1500.0, 3000.0], N // 30), 30)
    heat = np.zeros(N)
    for k in range(1, N):
        heat[k] = heat[k - 1] + 0.03 * (speed[k] / 100.0 - heat[k - 1])
    return heat, speed


def recorded(noise=0.3, change=None):
    tables = {}
    for k, run in enumerate(RUNS):
        heat, speed = warm(k)
        random = np.random.default_rng(k)
        temperature = np.round(20.0 + heat / 3.0 + random.normal(scale=0.05, size=N), 1)
        table = pd.DataFrame(
            {"n": speed, "T1": temperature, "Z": np.round(heat + random.normal(scale=noise, size=N), 2)},
            index=pd.Index(TIME),
        )
        if change is not None:
            change(run, table)
        tables[run] = table
    return Recording.from_runs(tables, CHANNELS)


def simulated(of=(0, 1, 2, 3), rows=N, gain=1.0):
    tables = {
        run: pd.DataFrame({"Z": gain * warm(k)[0][:rows]}, index=pd.Index(TIME[:rows]))
        for run, k in zip(RUNS, of, strict=True)
    }
    return Recording.from_runs(tables, CHANNELS[2:])


def ids(findings):
    return [finding.id for finding in findings]


def test_codes_of_broken_sensors_are_no_readings():
    rows = np.arange(N) % 37 == 5

    def breaks(run, table):
        table.loc[rows, "Z"] = -999.0
        if run == "r2":
            table.loc[TIME[50:60], "T1"] = 850.0

    comparison = comparison_of(recorded(change=breaks), simulated())
    untouched = comparison_of(recorded(), simulated())
    assert np.array_equal(np.isnan(comparison.recorded["Z"]), np.tile(rows, 4))
    left_out = np.isnan(comparison.recorded["T1"])
    assert np.array_equal(np.flatnonzero(left_out), N + np.arange(50, 60))
    for name, out in (("Z", np.tile(rows, 4)), ("T1", left_out)):
        assert np.array_equal(comparison.recorded[name][~out], untouched.recorded[name][~out])
    assert sorted(ids(comparison.findings)) == ["sensor-break"] * 5
    assert comparison.findings[0].action == "leave-out-stretch"
    assert untouched.findings == ()
    # 999 µm once in 37 samples buried everything
    answer = diagnosis(comparison)
    assert answer.verdict == "nothing-missing"
    assert answer.findings == comparison.findings


def test_a_response_that_is_mostly_codes_is_not_compared():
    def breaks(run, table):
        table.loc[TIME[80:], "Z"] = -999.0

    with pytest.raises(InputError, match="recorded value"):
        comparison_of(recorded(change=breaks), simulated())


def test_simulated_runs_under_each_others_names_are_refused():
    with pytest.raises(InputError) as told:
        comparison_of(recorded(), simulated((0, 2, 3, 1)))
    # simulated, recorded
    pairs = r"\b(r\d) of the simulation .*?\b(r\d)\b"
    assert set(re.findall(pairs, told.value.found)) == {("r4", "r2"), ("r2", "r3"), ("r3", "r4")}
    with pytest.raises(InputError, match=r"\br2 of the simulation .*\br1\b"):
        comparison_of(recorded(), simulated((1, 0, 2, 3), gain=0.6))


def test_exchanged_runs_are_a_warning_where_noise_leaves_a_doubt():
    spread = np.std(warm(1)[0])
    comparison = comparison_of(recorded(noise=0.3 * spread), simulated((0, 2, 1, 3)))
    (finding,) = comparison.findings
    assert finding.id == "runs-exchanged"
    assert finding.evidence["fits"] == {"r2": "r3", "r3": "r2"}
    assert 3.0 < finding.evidence["times_smaller"] < 10.0


@pytest.mark.parametrize("noise", [0.3, 30.0])
def test_runs_that_stand_right_or_cannot_be_told_apart_are_left_alone(noise):
    assert comparison_of(recorded(noise=noise), simulated()).findings == ()
    # upside down is a sign, not another run
    assert comparison_of(recorded(noise=noise), simulated(gain=-1.0)).findings == ()
    assert "runs-exchanged" not in ids(comparison_of(recorded(noise=noise), simulated((2, 2, 2, 2))).findings)


def test_what_a_simulation_covers_is_told():
    comparison = comparison_of(recorded(), simulated(rows=90))
    assert [(f.id, f.where.run, f.evidence["share"]) for f in comparison.findings] == [
        ("partly-simulated", run, 0.3) for run in RUNS
    ]
    assert comparison_of(recorded(), simulated(rows=270)).findings == ()
    with pytest.raises(InputError, match="27 of 300") as told:
        comparison_of(recorded(), simulated(rows=27))
    assert "--simulation-time-unit" in told.value.advice


@pytest.mark.parametrize("factor", [60.0, 1e3, 3600.0])
def test_a_simulation_in_another_unit_of_time_is_refused(factor):
    tables = {run: pd.DataFrame({"Z": warm(k)[0]}, index=pd.Index(factor * TIME)) for k, run in enumerate(RUNS)}
    with pytest.raises(InputError, match=rf"\b{factor:g} times"):
        comparison_of(recorded(), Recording.from_runs(tables, CHANNELS[2:]))
    # one long run among others is a longer programme
    tables |= {run: pd.DataFrame({"Z": warm(k)[0]}, index=pd.Index(TIME)) for k, run in enumerate(RUNS[:3])}
    comparison_of(recorded(), Recording.from_runs(tables, CHANNELS[2:]))


def test_what_would_have_been_missed_is_told_in_words():
    found = diagnosis(comparison_of(recorded(), simulated()))
    told = {one.id: one.note for one in found.detectable}
    assert told["data.drift"].startswith("speed at which the reading runs away: ")
    assert told["data.zero"].startswith("what is read where nothing is: ")
    assert not [note for note in told.values() if "_" in note]


@pytest.mark.parametrize("rows", [1, 2, 3, 5, 39])
def test_a_comparison_that_was_put_together_of_few_rows_is_refused(rows):
    time_s, draw = 60.0 * np.arange(rows + 2), np.random.default_rng(1)
    recorded, simulated = draw.normal(size=(2, rows + 2))
    channel = Channel("Z", "displacement", "um")
    given = Comparison(
        ("r",),
        (0, rows + 2),
        time_s,
        (channel,),
        {"Z": recorded},
        {"Z": simulated},
        ("Z",),
        np.arange(rows + 2) >= rows,
    )
    with pytest.raises(InputError, match=f"Z has {rows} samples"):
        diagnosis(given)


def test_a_copy_of_a_run_proves_nothing_and_is_left_out():
    time_s, draw = 60.0 * np.arange(120), np.random.default_rng(2)
    tables = {}
    for run in ("r1", "r2", "r3"):
        course = np.cumsum(draw.normal(size=120))
        tables[run] = pd.DataFrame({"Z": course + draw.normal(0, 0.1, 120), "sim": 0.8 * course}, index=time_s)
    tables["r4"] = tables["r3"]
    channel = Channel("Z", "displacement", "um")
    given, simulated = (
        Recording.from_runs({run: of[[name]].set_axis(["Z"], axis=1) for run, of in tables.items()}, [channel])
        for name in ("Z", "sim")
    )
    found = comparison_of(given, simulated)
    assert found.runs == ("r1", "r2", "r3")
    assert found.held_out.tolist() == [False] * 240 + [True] * 120
    assert [one.where.run for one in found.findings if one.id == "same-file-twice"] == ["r4"]
    with pytest.raises(OptionError, match=r"'r4' \(Run r4 is run r3, or a part of it: .*\)") as refused:
        comparison_of(given, simulated, holdout="r4")
    assert refused.value.expected == "last, a run (r1, r2, r3), or a share above 0 and up to 0.8"
