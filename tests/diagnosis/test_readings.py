"""Responses that were read seldom, and numbers beyond all measure."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.workflow import diagnosis
from selector.errors import InputError
from selector.recording import Channel, Recording

CHANNELS = [
    Channel("Z", "displacement", "um"),
    Channel("Y", "displacement", "um"),
    Channel("T1", "temperature", "degC"),
]
N = 400


def pair(change, n=N):
    """Three runs of Z, Y and T1 with 0.3 µm of noise, changed run by run before they are compared."""
    time = np.arange(n) * 60.0
    heat = 1.0 - np.exp(-time / 3000.0)
    simulated = {"Z": 20.0 * heat, "Y": 8.0 * heat}
    runs = {}
    for k, run in enumerate(("a", "b", "c")):
        random = np.random.default_rng(k)
        recorded = {name: course + random.normal(scale=0.3, size=n) for name, course in simulated.items()}
        recorded["T1"] = 20.0 + 9.0 * heat
        change(recorded)
        runs[run] = pd.DataFrame(recorded, index=pd.Index(time))
    simulation = Recording.from_runs({run: pd.DataFrame(simulated, index=pd.Index(time)) for run in runs}, CHANNELS[:2])
    return Recording.from_runs(runs, CHANNELS), simulation


def blank_but_every(count, *names):
    def change(recorded):
        for name in names:
            recorded[name][np.arange(len(recorded[name])) % count != 0] = np.nan

    return change


@pytest.mark.parametrize("count", [5, 10])
@pytest.mark.parametrize("names", [("Z",), ("Z", "Y")])
def test_a_response_of_a_slower_logger_is_compared_at_its_readings(count, names):
    comparison = comparison_of(*pair(blank_but_every(count, *names)))
    assert comparison.responses == ("Z", "Y")
    assert comparison.runs == ("a", "b", "c")
    assert comparison.period_s == count * 60.0
    assert np.isfinite(comparison.recorded["Z"]).all()
    told = [finding for finding in comparison.findings if finding.id == "read-seldom"]
    assert [finding.level for finding in told] == ["warning" if len(names) == 1 else "info"]
    found = diagnosis(comparison, seed=0)
    assert found.verdict == "nothing-missing"
    # noise of 0.3 µm in 3 · 400 / count rows
    assert found.fit["Z"].heldout.rmse_before == pytest.approx(0.3, rel=0.35)


def test_a_response_that_would_cost_the_others_too_much_is_left_out():
    recording, simulation = pair(blank_but_every(20, "Z"), n=1000)
    comparison = comparison_of(recording, simulation)
    assert comparison.responses == ("Y",)
    assert comparison.period_s == 60.0
    assert any(f.id == "not-compared" and "--response Z" in f.suggestion for f in comparison.findings)
    assert comparison_of(recording, simulation, responses=["Z"]).period_s == 1200.0


def test_up_to_three_rows_without_a_reading_change_nothing():
    comparison = comparison_of(*pair(blank_but_every(3, "Z")))
    assert comparison.period_s == 60.0
    assert comparison.findings == ()


def test_readings_in_pieces_too_short_to_have_a_past_are_no_basis():
    def pieces(recorded):
        # 6 readings, then a hole of 30
        recorded["Z"][np.arange(N) % 36 >= 6] = np.nan

    with pytest.raises(InputError, match="without a hole"):
        comparison_of(*pair(pieces), responses=["Z"])


@pytest.mark.parametrize("value", [1e300, -1e160, 1e31])
def test_numbers_beyond_measure_are_no_readings(value):
    def one(recorded):
        recorded["Z"][100] = value

    recording, simulation = pair(one)
    comparison = comparison_of(recording, simulation)
    assert comparison.responses == ("Z", "Y")
    assert np.isnan(comparison.recorded["Z"][100])
    assert np.isfinite(comparison.recorded["Z"]).sum() == 3 * N - 3
    assert diagnosis(comparison, seed=0).verdict == "nothing-missing"


def test_simulated_numbers_beyond_measure_are_told():
    def every(recorded):
        pass

    recording, simulation = pair(every)
    values = {run: simulation.frame.loc[run].copy() for run in simulation.runs}
    values["b"].iloc[7, 0] = 1e200
    comparison = comparison_of(recording, Recording.from_runs(values, CHANNELS[:2]))
    told = next(finding for finding in comparison.findings if finding.id == "beyond-measure")
    assert (told.where.channel, told.where.run, told.evidence["value"]) == ("Z", "b", 1e200)
    assert np.isfinite(comparison.simulated["Z"]).sum() == 3 * N - 1


@pytest.mark.parametrize("factor", [1e-200, 1e200])
def test_a_course_of_such_numbers_is_refused(factor):
    def all_of_z(recorded):
        recorded["Z"] *= factor

    with pytest.raises(InputError, match="Z"):
        comparison_of(*pair(all_of_z), responses=["Z"])
