"""Which runs and sensors are used at all; nothing is left out in silence."""

from __future__ import annotations

import dataclasses
import shlex

import numpy as np
import pytest

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.models.design import datum_of
from selector.quality import inspect
from selector.selection import Options, select
from selector.selection.options import question_of
from selector.selection.survey import _samples_lost, survey
from selector.telling.selected.advice import advice
from tests.models.runs import InPieces, recording
from tests.selection.machines import found_ids, machine, one_finding


def surveyed(source, **options):
    question = question_of(source, Options(**options))
    return survey(source, question, datum_of(source, question.sensors, question.responses, "rise"))


def changed(source, change):
    """The recording with `change(run, values)` applied to each run's dictionary of samples."""
    runs = {}
    for run in source.runs:
        values = {name: source.values(run, [name])[:, 0].copy() for name in source.names}
        change(run, values)
        runs[run] = (source.time_s(run), values)
    return recording(runs)


def lose(name, share, seed=0):
    rng = np.random.default_rng(seed)

    def change(_run, values):
        late = rng.random(len(values[name])) < share
        late[:20] = False
        values[name][late] = np.nan

    return change


def test_counts_what_is_there():
    source = machine(n_runs=3, n=100)
    found = surveyed(source)
    assert found.runs == ("day1", "day2", "day3")
    assert found.n_samples == 300
    assert found.period_s == 30.0
    assert found.duration_s == 99 * 30.0
    assert found.question.sensors == ("T1", "T2", "T3", "T4", "T5", "T6", "T7")
    assert found.findings == ()


def test_does_not_depend_on_how_runs_are_cut():
    source = changed(machine(n_runs=3, n=100), lose("T5", 0.2))
    whole, cut = surveyed(source), surveyed(InPieces(source, 13))
    assert dataclasses.replace(cut, findings=()) == dataclasses.replace(whole, findings=())
    assert [(f.id, f.where) for f in cut.findings] == [(f.id, f.where) for f in whole.findings]
    # the sums behind the evidence are formed in another order
    assert cut.findings[0].evidence == pytest.approx(whole.findings[0].evidence, rel=1e-9)


def test_a_constant_sensor_is_no_candidate():
    source = changed(machine(n_runs=3, n=100), lambda _run, values: values.update(T7=np.full(100, 20.0)))
    found = surveyed(source)
    assert "T7" not in found.question.sensors
    (finding,) = found.findings
    assert (finding.id, finding.where.channel, finding.action) == ("constant-sensor", "T7", "leave-out-channel")
    assert "20 °C" in finding.statement
    with pytest.raises(OptionError, match="T7 always reads 20 °C"):
        surveyed(source, must=("T7",))


def test_a_dead_sensor_is_no_candidate():
    source = changed(machine(n_runs=3, n=100), lambda _run, values: values.update(T7=np.full(100, np.nan)))
    found = surveyed(source)
    assert "T7" not in found.question.sensors
    assert found.findings[0].id == "sensor-missing"


def test_a_sensor_without_readings_points_to_what_left_them_out():
    source = changed(machine(n_runs=3, n=100), lambda _run, values: values.update(T7=np.full(100, np.nan)))
    at = Where("T7", "day1")
    unit = Finding("wrong-unit", "warning", "", at, {"mistake": "°C taken for K"})
    gone = Finding("out-of-range", "error", "", at, {}, "", "leave-out-stretch")
    told = (
        ((), "has no reading where the displacement is known"),
        ((gone,), "out-of-range"),
        ((unit, gone), "as its unit looks wrong (°C taken for K)"),
    )
    for before, words in told:
        finding = one_finding(select(source, findings=before), "sensor-missing")
        assert words in finding.statement
        assert ("wiring" in finding.suggestion) is (not before)


def test_a_dead_sensor_is_told_once_and_counted():
    source = changed(machine(n_runs=3, n=100), lambda _run, values: values.update(T7=np.full(100, 20.0)))
    found = select(source, findings=inspect(source))
    about = [one for one in found.findings if one.where.channel == "T7"]
    assert [one.id for one in about] == ["constant-sensor"]
    assert "wiring" in about[0].suggestion
    said = " ".join(advice(found)[1][1:])
    assert "of 6 usable" in said
    assert "left out: T7" in said


def test_a_patchy_sensor_that_others_can_stand_in_for_costs_no_samples():
    def copy(_run, values):
        values["T2"] = values["T1"] * 0.8 + np.random.default_rng(1).normal(0, 0.01, len(values["T1"]))

    source = changed(changed(machine(n_runs=3, n=100), copy), lose("T2", 0.3))
    found = surveyed(source)
    assert "T2" not in found.question.sensors
    assert one_finding(found, "sensor-missing").where.channel == "T2"
    kept = surveyed(source, must=("T2",))
    assert "T2" in kept.question.sensors
    assert one_finding(kept, "samples-lost").action == "leave-out-stretch"


def test_a_sensor_with_small_gaps_is_worth_them_although_others_come_near():
    def copy(run, values):
        values["T2"] = values["T1"] * 0.8 + np.random.default_rng(1).normal(0, 0.01, len(values["T1"]))
        values["T2"][20:30] = np.nan if run == "day2" else values["T2"][20:30]

    found = surveyed(changed(machine(n_runs=3, n=100), copy))
    assert "T2" in found.question.sensors
    assert one_finding(found, "samples-lost").evidence["explained_by_others"] > 0.998


def test_a_patchy_sensor_that_nothing_stands_in_for_is_kept_and_costs_its_gaps():
    source = changed(machine(n_runs=3, n=100), lose("T4", 0.1))
    # T5 has the noise of 0.15 K; what it says of T4 is not all there is
    found = surveyed(source)
    assert "T4" in found.question.sensors
    lost = one_finding(found, "samples-lost")
    assert lost.where.channel == "T4"
    assert 0.05 < lost.evidence["missing_share"] < 0.15


def test_the_option_that_is_advised_can_be_typed_as_it_stands():
    said = _samples_lost("Column top", 0.05, 0.9).suggestion
    assert shlex.split(said.partition(";")[0])[-2:] == ["--never", "Column top"]


def test_a_run_without_displacement_is_left_out_and_told():
    def change(run, values):
        if run == "day2":
            values["Z"][:] = np.nan

    found = surveyed(changed(machine(n_runs=3, n=100), change))
    assert found.runs == ("day1", "day3")
    assert one_finding(found, "run-without-displacement").where.run == "day2"


def test_a_sensor_that_rests_on_one_day_is_used():
    def change(run, values):
        if run == "day1":
            values["T6"][:] = 20.0

    selection = select(changed(machine(n_runs=2, n=100), change))
    assert "T6" in selection.sensors
    assert "T1" in selection.chosen


def test_a_displacement_that_rests_on_some_days_is_modelled():
    def change(run, values):
        if run in ("day1", "day2"):
            for name in values:
                values[name][:] = values[name][0]

    assert "Z" in select(changed(machine(n_runs=4, n=100), change)).models


def test_copies_of_a_sensor_are_told_and_only_one_is_chosen():
    def change(_run, values):
        values["T2"] = values["T1"] * 1.8 + 32.0

    selection = select(changed(machine(n_runs=4, n=120), change))
    assert "duplicate-sensors" in found_ids(selection)
    assert len({"T1", "T2"} & set(selection.chosen)) == 1
    assert selection.proof.rmse_um("Z") < 0.7


def test_a_run_counts_for_every_set_whose_sensors_are_good_in_it():
    """T7 is dead in two of seven runs and not needed; T1 is needed and dead in another, which proves nothing."""
    dead = {"day4": "T1", "day6": "T7", "day7": "T7"}

    def change(run, values):
        if run in dead:
            values[dead[run]][:] = np.nan

    selection = select(changed(machine(n_runs=7), change), Options(must=("T1",), never=("T2", "T3")))
    assert "T7" not in selection.chosen
    parts = selection.proof.per_response["Z"]
    assert {part.name for part in parts} == {f"day{i}" for i in (1, 2, 3, 5, 6, 7)}
    assert selection.proof.not_covered == {"day4": ("T1",)}
    none = np.sqrt(np.average([p.before_rmse_um**2 for p in parts], weights=[p.n_samples for p in parts]))
    assert selection.proof.baselines_um["Z"]["none"] == pytest.approx(none)
    assert one_finding(selection, "runs-not-proved").evidence["lacking"] == {"day4": ("T1",)}
    assert "6 of 7 runs" in advice(selection)[1][0]
    # what proves is not learnt from: a displacement that is wrong there changes nothing but its own error
    alone = select(
        changed(machine(n_runs=7), lambda run, values: (change(run, values), _shift(run, values))),
        Options(must=("T1",), never=("T2", "T3")),
    )
    before, after = (
        {part.name: part.rmse_um for part in one.proof.per_response["Z"]}["day7"] for one in (selection, alone)
    )
    assert after > 5.0 * before


def _shift(run, values):
    if run == "day7":
        values["Z"] += np.linspace(0.0, 30.0, len(values["Z"]))
