"""What decides among sets that are about as good, and how far the error of few runs is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from selector.models.moments import HeldOut
from selector.recording import Recording
from selector.selection import Options, Selection, select
from selector.selection.candidates import SensorSet
from selector.selection.choice import Trial, _is_equal, _margin_um, _safest
from selector.selection.doubts import _few_runs, _proof_findings
from selector.selection.finding_table import FEW_RUNS
from selector.selection.library import Shape
from selector.selection.options import Question
from selector.selection.result import MOST_TOLD_FACTOR, RunProof
from selector.selection.workflow import _best_plan, _poorest_of
from selector.telling.selected.account import gain_table
from selector.telling.selected.advice import advice
from tests.selection.machines import machine

QUESTION = Question(Options(), ("T1", "T2"), ("Z",), (), (0.4,))


def trial(sensors: str, rmse_um: float) -> Trial:
    error = np.array([rmse_um])
    return Trial(SensorSet(tuple(sensors), "all sensors"), Shape(), len(sensors), error**2, rmse_um, error, np.nan)


KNOWN = {
    "ab": (3.0, 400.0, True),
    "cd": (2.0, 90.0, False),
    "ef": (1.5, 4.0, False),
    "gh": (1.2, 5.0, False),
    "ij": (1.0, 1.2, True),
    "kl": (0.0, np.inf, False),
}
"""Worst fault and VIF of sets, and whether alike sensors work against each other."""


class Bench:
    def faults(self, sensors, shape, alike):
        fault, _, opposed = KNOWN["".join(sensors)]
        return fault, opposed

    def largest_vif(self, sensors, shape):
        return KNOWN["".join(sensors)][1]


def test_fault_vif_and_sign_decide_among_equals_and_then_the_error():
    sets = [trial("ab", 1.00), trial("cd", 1.01), trial("ef", 1.02), trial("gh", 1.03)]
    assert ["".join(one.set.sensors) for one in _safest(sets, Bench())] == ["ef", "gh"]
    assert _safest(sets[:1], Bench()) == sets[:1]
    # a sign does not outweigh any risk
    assert ["".join(one.set.sensors) for one in _safest([trial("cd", 1.0), trial("ij", 1.01)], Bench())] == ["ij"]
    assert ["".join(one.set.sensors) for one in _safest([trial("ij", 1.0), trial("kl", 1.01)], Bench())] == ["kl"]
    # without another way the pair of opposite signs stands
    assert _safest([sets[0], sets[0]], Bench()) == [sets[0], sets[0]]


def test_the_margin_is_the_noise_of_the_gauge_or_what_was_asked_for():
    assert _margin_um(QUESTION, np.array([10.0])) == pytest.approx([0.4])
    assert _margin_um(QUESTION, np.array([1.0])) == pytest.approx([0.1])  # never more than a tenth of the error
    asked = replace(QUESTION, options=Options(within=0.03))
    best = trial("ab", 1.0)
    assert _is_equal(QUESTION, trial("cd", 1.09), best)
    assert not _is_equal(QUESTION, trial("cd", 1.11), best)
    assert not _is_equal(asked, trial("cd", 1.04), best)
    assert _is_equal(asked, trial("cd", 1.029), best)


def test_a_sensor_that_gains_less_than_the_noise_is_not_taken():
    """Five sensors for 0.04 µm under a noise of 0.4 µm."""
    errors = {("linear", 4): np.array([1.04]), ("linear", 5): np.array([1.00])}
    assert _poorest_of(errors, "linear", np.array([0.4])) == ("linear", 4)
    assert _poorest_of(errors, "linear", np.array([0.01])) == ("linear", 5)
    errors["linear", 4] = np.array([1.2])
    assert _poorest_of(errors, "linear", np.array([0.4])) == ("linear", 5)


@pytest.mark.parametrize(("memory", "taken"), [((0.5, 0.6, 0.4), "memory"), ((0.01, 1.3, 1.2), "linear")])
def test_memory_has_to_gain_on_the_runs_and_not_on_one_of_them(memory, taken):
    n = np.array([100.0, 100.0, 100.0])
    unseen = {
        ("linear", 1): HeldOut(100.0 * np.array([[1.0], [1.1], [0.9]]), n),
        ("memory", 1): HeldOut(100.0 * np.array(memory)[:, None], n),
    }
    assert _best_plan(QUESTION, unseen, np.array([5.0]))[1] == (taken, 1)


def warm(source: Recording) -> Recording:
    """The same from another state in every run: a sensor is off at the start by what it rises by."""
    runs = {}
    for k, run in enumerate(source.runs):
        frame = source.frame.loc[run].copy()
        frame["T1"] += 5.0 * (k % 2)
        runs[run] = frame
    return Recording.from_runs(runs, source.channels)


def test_how_far_the_error_of_few_runs_is_known_is_told_with_it():
    six, three, two = machine(n_runs=6), machine(n_runs=3), machine(n_runs=2)
    options = Options(responses=("Z",), max_sensors=2)
    assert FEW_RUNS not in {one.id for one in select(six, options).findings}
    for source, spread, begin in ((two, 0.25, False), (three, 0.25, False), (warm(six), 0.35, True)):
        found = select(source, options)
        (told,) = [one for one in found.findings if one.id == FEW_RUNS]
        logs = np.log([part.rmse_um for part in found.proof.per_response["Z"]])
        n = len(logs)
        # Student's interval; the usual spread counts three degrees of freedom beside those of the runs
        variance = (3 * spread**2 + ((logs - logs.mean()) ** 2).sum()) / (n + 2)
        # of two each is predicted by the other alone: they count as two in a row
        factor = np.exp(stats.t.interval(0.95, n + 2, scale=2.2 * np.sqrt(variance / (n if n > 2 else 1.5)))[1])
        assert told.evidence["factor"] == pytest.approx(factor)
        low, high = told.evidence["between_um"]["Z"]
        assert low * factor == pytest.approx(found.proof.rmse_um("Z"), rel=0.01)
        assert high == pytest.approx(found.proof.rmse_um("Z") * factor, rel=0.01)
        assert ("begin" in told.statement) == begin
        assert f"factor of {factor:.1f}" in advice(found)[1][0]


def clocked(source: Recording, pauses_in_lengths: float) -> Recording:
    """The same with clocks: a run, and a pause of so many of its lengths."""
    length_s = float(source.time_s(source.runs[0])[-1])
    step_s = (1.0 + pauses_in_lengths) * length_s + 10.0
    began = datetime(2026, 3, 2)
    starts = {run: {"start": (began + timedelta(seconds=k * step_s)).isoformat()} for k, run in enumerate(source.runs)}
    return replace(source, provenance={"runs": starts})


def test_runs_in_a_row_count_half_whether_or_not_memory_is_offered():
    six = machine(n_runs=6)
    apart, known, in_a_row = (
        select(one, Options(responses=("Z",), max_sensors=2)) for one in (six, clocked(six, 2.0), clocked(six, 0.5))
    )
    assert known.known.in_a_row == 0
    assert known.known.factor == apart.known.factor
    assert FEW_RUNS not in {one.id for one in known.findings}
    assert in_a_row.known.in_a_row == 5
    assert np.log(in_a_row.known.factor) == pytest.approx(np.log(apart.known.factor) * np.sqrt(6.0 / 3.5))
    (told,) = [one for one in in_a_row.findings if one.id == FEW_RUNS]
    assert "another season" in told.statement
    assert "weeks later" in told.suggestion


def test_what_many_runs_in_a_row_do_not_tell_is_said_however_well_their_error_is_known():
    found = select(clocked(machine(n_runs=6), 0.0), Options(responses=("Z",), max_sensors=2))
    many = replace(found, known=replace(found.known, runs=40, in_a_row=39, factor=1.2, factors={"Z": 1.2}))
    (told,) = _few_runs(many)
    assert "another season" in told.statement
    assert not list(_few_runs(replace(many, known=replace(many.known, in_a_row=19))))


def test_of_conditions_only_those_count_half_that_begin_where_another_condition_ended():
    six = clocked(machine(n_runs=6), 0.0)
    kinds = dict(zip(six.runs, ("winter", "winter", "spring", "spring", "summer", "summer"), strict=True))
    found = select(six, Options(responses=("Z",), max_sensors=2, conditions=kinds))
    assert (found.known.runs, found.known.in_a_row) == (3, 2)


def proof_of(found: Selection, errors: Sequence[tuple[float, float]]) -> Selection:
    """A selection whose parts have these errors, with the model and without it [µm]."""
    parts = tuple(
        RunProof(f"r{k}", (), left, left, 0.0, before, before, 100) for k, (left, before) in enumerate(errors)
    )
    none = float(np.sqrt(np.mean([before**2 for _, before in errors])))
    proof = replace(found.proof, per_response={"Z": parts}, baselines_um={"Z": {"none": none, "mean": 2.0 * none}})
    return replace(found, proof=proof)


@pytest.mark.parametrize(
    ("errors", "is_useless"),
    [
        # 9.0 for 9.6 µm, of which one run has all and others lose
        (((10.0, 14.0), (9.0, 8.0), (8.0, 7.5), (9.0, 7.0)), True),
        # what every run gains is a gain, though one moves ten times as far as the others
        (((10.0, 100.0), (3.0, 8.0), (3.0, 9.0), (2.0, 7.0)), False),
        (((6.0, 14.0), (5.0, 12.0), (8.0, 7.5), (4.0, 11.0)), False),
    ],
)
def test_a_gain_that_is_no_larger_than_its_scatter_is_none(errors, is_useless):
    found = proof_of(select(machine(n_runs=4), Options(responses=("Z",), max_sensors=2)), errors)
    assert found.proof.rmse_um("Z") < found.proof.baselines_um["Z"]["none"]
    surveyed = SimpleNamespace(runs=("r0", "r1", "r2", "r3"), is_one_record=False)
    told = [one for one in _proof_findings(found, surveyed, 1) if one.id == "no-better-than-nothing"]
    assert bool(told) == is_useless
    if told:
        assert "scatter" in told[0].statement
        verdict, said = advice(replace(found, findings=(*told,)))
        assert verdict == "bad"
        assert "scatter" in said[1]


def test_starts_count_where_a_model_counts_from_nothing_too():
    """With absolute readings a machine that begins warm was taken for a cold one: its datum has no starts."""
    options = Options(responses=("Z",), max_sensors=2, reference="absolute")
    assert select(warm(machine(n_runs=6)), options).known.is_warm
    assert not select(machine(n_runs=6), options).known.is_warm


def test_each_response_is_known_as_its_own_runs_tell():
    source = machine(n_runs=5, second=lambda u: 3.0 * u["column"])
    runs = {run: source.frame.loc[run].copy() for run in source.runs}
    # one run in which something else moves Y only
    runs[source.runs[1]]["Y"] += np.linspace(0.0, 20.0, len(runs[source.runs[1]]))
    known = select(Recording.from_runs(runs, source.channels), Options(max_sensors=2)).known
    assert known.factor == known.factor_of("Y") > 1.5 * known.factor_of("Z")


def test_of_runs_that_differ_too_much_nothing_is_told():
    source = machine(n_runs=3)
    runs = {run: source.frame.loc[run].copy() for run in source.runs}
    runs[source.runs[1]]["Z"] += np.linspace(0.0, 40.0, len(runs[source.runs[1]]))
    found = select(Recording.from_runs(runs, source.channels), Options(responses=("Z",), max_sensors=2))
    assert found.known.factor > MOST_TOLD_FACTOR
    (told,) = [one for one in found.findings if one.id == FEW_RUNS]
    assert "cannot be told from so few runs" in told.statement
    assert told.evidence["between_um"] == {"Z": None}
    assert "known to a factor" not in advice(found)[1][0] + told.statement
    assert "cannot be told" in gain_table(found).rows[0]


def test_what_cannot_be_told_of_one_response_is_told_of_the_other():
    source = machine(n_runs=3, second=lambda u: 12.0 * u["spindle"])
    found = select(source, Options(max_sensors=2))
    found = replace(found, known=replace(found.known, factor=5.0, factors={"Z": 2.0, "Y": 5.0}))
    (told,) = _few_runs(found)
    error = found.proof.rmse_um("Z")
    assert told.evidence["between_um"] == {"Z": pytest.approx((error / 2.0, error * 2.0)), "Y": None}
    assert "known to a factor of 2:" in told.statement
    assert "; that of Y cannot be told from so few" in told.statement
    rows = {row[0]: row for row in gain_table(found).rows}
    assert "cannot be told" in rows["Y"]
    assert "cannot be told" not in rows["Z"]
    assert "known to a factor of 2.0, Y: how far off on further ones cannot be told from 3" in advice(found)[1][0]
    sure = replace(found, known=replace(found.known, factor=1.02, factors={"Z": 1.01, "Y": 1.02}))
    assert "known to a factor of 1.02)" in advice(sure)[1][0]


def test_runs_of_few_samples_are_known_less_well_by_what_a_sample_tells():
    whole = machine(n_runs=4, n=240)
    runs = {run: whole.frame.loc[run].iloc[[0, 90, 170, 239]] for run in whole.runs}
    found = select(Recording.from_runs(runs, whole.channels), Options(max_sensors=1))
    errors = np.array([part.rmse_um for part in found.proof.per_response["Z"]])
    logs = np.log(np.maximum(errors, 0.3 * np.sqrt(np.mean(errors**2))))
    # a usual spread counts for three runs more, and a run of 4 samples is no long one (docs/how-to/few-runs.md)
    variance = (3 * (0.25**2 + 1 / 8 - 1 / 40) + 3 * logs.var(ddof=1)) / 6
    assert found.known.factor == pytest.approx(np.exp(stats.t.ppf(0.975, 6) * 2.2 * np.sqrt(variance / 4)), rel=1e-9)
