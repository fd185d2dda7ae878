"""What an unseen run says of a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from selector.diagnosis import workflow
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.confirmation import (
    carries_little,
    confirmation,
    confirmed,
    held_out_faults,
    not_ruinous,
    only_cancels,
    only_where_carried,
)
from selector.diagnosis.evidence.naming import as_carried, named_effect
from selector.diagnosis.evidence.recalibration import contradicted, recalibrated
from selector.diagnosis.evidence.response import bench_of
from selector.diagnosis.evidence.search import search
from selector.diagnosis.evidence.size import or_parameters
from selector.diagnosis.mismatch.omnibus import of_whole_record
from selector.diagnosis.workflow import _is_sure, _named, _named_clearly, _State, diagnosis
from tests.diagnosis.made import RUNS, comparison, late_run

N = 3 * 600
EFFECTS = tuple(effect_of(name) for name in ("thermal.memory", "thermal.instant_speed"))


@pytest.fixture(scope="module")
def slow():
    """The heat once more, behind a long lag."""
    made = comparison({"Z": np.zeros(N)})
    return np.concatenate([lfilter([0.01], [1.0, -0.99], part) for part in made.simulated["Z"].reshape(3, -1)])


def found(slow, unseen, size=8.0):
    """What is found where the unseen run has so many times the slow course of the fitted ones, `size` × the noise."""
    noise = np.random.default_rng(5).standard_normal(N)
    times = np.repeat([1.0, 1.0, unseen], N // 3)
    course = size * slow / np.std(slow)
    made = comparison({"Z": noise + times * course})
    benches = {"Z": bench_of(made, "Z", EFFECTS)[0]}
    return made, search(benches, false_alarm=0.02, seed=0)


def test_a_name_that_holds_in_the_unseen_run_gains_there_and_stays(slow):
    made, result = found(slow, 1.0)
    assert list(not_ruinous(made, result).named) == ["thermal.memory"]
    held = confirmation(result, "thermal.memory")
    assert held.gain > 0.5 * held.energy
    assert not held.refutes


def test_what_is_far_smaller_there_is_suspected_and_stays(slow):
    made, result = found(slow, 0.4)
    assert confirmation(result, "thermal.memory").refutes
    assert list(not_ruinous(made, result).named) == ["thermal.memory"]


def test_physics_that_is_of_quite_another_size_there_is_suspected_and_stays(slow):
    """With the size of the fitted runs it leaves four times as much of the unseen one as nothing at all does."""
    made, result = found(slow, 0.2, 40.0)
    assert list(not_ruinous(made, result).named) == ["thermal.memory"]
    assert confirmed(made, result, "thermal.memory").suspected


def test_what_is_ruined_there_and_explains_the_half_of_the_fitted_runs_is_none(slow):
    made, result = found(slow, 0.0, 1.4)
    assert list(result.named) == ["thermal.memory"]
    assert not not_ruinous(made, result).named


def test_a_name_that_ruins_the_unseen_run_is_none(slow):
    made, result = found(slow, -0.6)
    assert list(result.named) == ["thermal.memory"]
    assert confirmation(result, "thermal.memory").refutes
    assert not not_ruinous(made, result).named


@pytest.mark.parametrize(("misfit", "is_kept"), [(2.0, True), (1.0, False)])
def test_where_more_is_left_than_noise_only_its_shape_may_be_what_ruins_the_unseen_run(slow, misfit, is_kept):
    made, result = found(slow, 1.0)
    bench, own = result.benches["Z"], result.named["thermal.memory"]["Z"]
    of = bench.candidates[own]
    columns = of.variant.columns * np.where(bench.fitted, 1.0, -5.0)[:, None]
    other = replace(of, variant=replace(of.variant, columns=columns), first=len(bench.scales))
    more = replace(bench, candidates=(*bench.candidates, other), scales=np.r_[bench.scales, bench.scales[of.columns]])
    named = {"thermal.memory": {"Z": len(bench.candidates)}}
    ruined = replace(result, benches={"Z": more}, named=named, misfit={"Z": misfit})
    kept = not_ruinous(made, ruined).named
    assert list(kept) == (["thermal.memory"] if is_kept else [])
    assert all(of["Z"] != len(bench.candidates) for of in kept.values())


@pytest.mark.parametrize(
    ("id_", "rivals", "of_movement", "is_like"),
    [
        ("thermal.memory", (), 0.1, True),
        ("thermal.memory", (), 0.4, False),
        ("thermal.ambient", (), 0.1, False),
        ("thermal.ambient", ("thermal.interaction",), 0.1, True),
        ("thermal.ambient", ("thermal.interaction",), 0.4, False),
    ],
)
def test_what_wrong_parameters_do_as_well_is_half_sure_and_says_so(slow, id_, rivals, of_movement, is_like):
    made, result = found(slow, 1.0)
    moved = np.std(made.recorded["Z"][~made.held_out])
    course = of_movement * moved * slow / np.std(slow[~made.held_out])
    effect = replace(named_effect(made, result, "thermal.memory"), id=id_, confidence=0.9, courses={"Z": course})
    effect = replace(effect, cannot_be_told_from=rivals)
    [told] = or_parameters(made, result, [effect])
    assert told.confidence == (0.5 if is_like else 0.9)
    assert ("few per cent off" in told.statement) == is_like
    of_one_run = replace(effect, id="data.drift", acts=("r2", 0.0, None))
    assert list(or_parameters(made, result, [of_one_run])) == [of_one_run]


@pytest.mark.parametrize(
    ("id_", "share", "channel", "confidence"),
    [
        ("thermal.ambient", 0.2, "Z", 0.5),
        ("thermal.ambient", 0.8, "Z", 0.9),
        ("thermal.ambient", 0.2, "Y", 0.9),
        ("data.drift", 0.2, "Z", 0.9),
    ],
)
def test_what_explains_less_beside_what_wrong_parameters_do_is_no_surer(slow, id_, share, channel, confidence):
    made, result = found(slow, 1.0)
    course = 0.1 * np.std(made.recorded["Z"][~made.held_out]) * slow / np.std(slow[~made.held_out])
    like = replace(named_effect(made, result, "thermal.memory"), confidence=0.9, courses={"Z": course}, share=0.5)
    beside = replace(like, id=id_, share=share, channels=(channel,), acts=("r2", 0.0, None))
    told = list(or_parameters(made, result, [like, beside]))
    assert [one.confidence for one in told] == [0.5, confidence]
    assert "few per cent off" not in told[1].statement


@pytest.mark.parametrize(
    ("unseen", "of_movement", "share", "size", "is_none"),
    [
        (0.0, 0.1, 0.2, 8.0, True),
        (1.0, 0.1, 0.2, 8.0, False),
        (0.0, 0.1, 0.3, 8.0, False),
        (0.0, 0.4, 0.2, 8.0, False),
        # beside noise of five times its size: unseen rows gain 1.5 %, or next to nothing
        (1.0, 0.1, 0.024, 0.2, False),
        (0.8, 0.1, 0.024, 0.2, True),
        (1.0, 0.1, 0.2, 0.2, True),
    ],
)
def test_what_wrong_parameters_do_as_well_makes_unseen_rows_better_or_is_none(
    slow, unseen, of_movement, share, size, is_none
):
    made, result = found(slow, unseen, size)
    moved = np.std(made.recorded["Z"][~made.held_out])
    course = of_movement * moved * slow / np.std(slow[~made.held_out])
    effect = replace(named_effect(made, result, "thermal.memory"), courses={"Z": course}, share=share)
    assert carries_little(made, result, effect, is_doubted=False) == is_none


def test_a_lag_in_the_place_of_the_course_is_as_large_as_what_recalibration_does_not_do(slow):
    made, result = found(slow, 1.0)
    moved = np.std(made.recorded["Z"][~made.held_out])
    course = moved * slow / np.std(slow[~made.held_out])
    effect = replace(named_effect(made, result, "thermal.memory"), confidence=0.9, courses={"Z": course})
    for beyond, confidence in ((0.05, 0.5), (0.2, 0.9)):
        share = (beyond * moved) ** 2 / result.benches["Z"].mean_square([])
        [told] = or_parameters(made, result, [replace(effect, share=share)])
        assert told.confidence == confidence


def test_what_is_several_times_the_mismatch_only_cancels_a_gain(slow):
    made, result = found(slow, 1.0)
    effect = named_effect(made, result, "thermal.memory")
    assert not only_cancels(effect, result)
    bench = result.benches["Z"]
    mismatch = np.sqrt(np.mean(bench.target[bench.fitted] ** 2))
    larger = {"Z": 4.0 * mismatch / np.std(effect.courses["Z"][bench.fitted]) * effect.courses["Z"]}
    assert only_cancels(replace(effect, courses=larger), result)


def test_a_name_that_unseen_rows_chose_is_as_sure_as_what_it_carries_up_to_a_half(slow):
    made, result = found(slow, 1.0)
    unsure = replace(named_effect(made, result, "thermal.memory"), confidence=0.01)
    assert as_carried(unsure, result).confidence == 0.01
    chosen = replace(result, ahead={unsure.id: 1.0}, closed={unsure.id: Quantity(0.6, "1", 0.4, 0.7)})
    assert as_carried(unsure, chosen).confidence == 0.4
    assert as_carried(replace(unsure, suspected=True), chosen).confidence == 0.2
    most = replace(chosen, closed={unsure.id: Quantity(0.9, "1", 0.8, 1.0)})
    assert as_carried(unsure, most).confidence == 0.5


@pytest.mark.parametrize(("surely_carried", "sure"), [(0.9, 0.94), (0.0, 0.5)])
def test_a_name_beside_structure_that_is_left_is_as_sure_as_what_it_surely_carries(slow, surely_carried, sure):
    course, wave = 8.0 * slow / np.std(slow), 8.0 * np.sin(np.arange(N) / 25.0)
    made = comparison({"Z": np.random.default_rng(5).standard_normal(N) + course + wave})
    result = search({"Z": bench_of(made, "Z", EFFECTS)[0]}, false_alarm=0.02, seed=0)
    carried = {id_: Quantity(0.95, "1", surely_carried, 1.0) for id_ in result.named}
    effect = named_effect(made, replace(result, misfit={"Z": 2.0}, closed=carried), "thermal.memory")
    assert effect.confidence == pytest.approx(sure, abs=0.02)


@pytest.mark.parametrize(("surely_closed", "sure"), [(0.2, 0.5), (0.6, 0.6), (0.95, 0.75)])
def test_a_doubted_name_is_as_sure_as_what_it_surely_closes_from_a_half_to_three_quarters(slow, surely_closed, sure):
    made, result = found(slow, 1.0)
    doubted = replace(result, doubted=frozenset(result.named))
    closed = {id_: Quantity(0.95, "1", surely_closed, 1.0) for id_ in result.named}
    effect = named_effect(made, replace(doubted, closed=closed), "thermal.memory")
    assert effect.share > 0.75
    assert effect.confidence == pytest.approx(sure)
    assert named_effect(made, doubted, "thermal.memory").confidence == 0.5


@pytest.mark.parametrize(("unseen", "sure"), [(1.0, 0.96), (0.9, 0.75)])
def test_what_explains_little_is_sure_where_unseen_rows_gain_most_of_what_they_ought_to(slow, unseen, sure):
    """It is 0.4 of the noise: the unseen rows gain 40 or 26 of the 58 that the size of the fitted ones promises."""
    made, result = found(slow, unseen, 0.4)
    effect = confirmed(made, result, "thermal.memory")
    assert effect.share < 0.1
    assert not effect.suspected
    assert not result.closed
    assert effect.confidence == pytest.approx(sure, abs=0.01)


@pytest.mark.parametrize(("surely_closed", "sure"), [(None, 0.75), (0.2, 0.75), (0.3, 0.96)])
def test_what_explains_little_is_surer_than_three_quarters_only_where_unseen_rows_bear_it_out(
    slow, surely_closed, sure
):
    made, result = found(slow, 1.0, 0.4)
    if surely_closed is not None:
        result = replace(result, closed={"thermal.memory": Quantity(0.95, "1", surely_closed, 1.0)})
    effect = named_effect(made, result, "thermal.memory")
    assert effect.share < 0.1
    assert effect.confidence == pytest.approx(sure, abs=0.01)


def test_nothing_is_said_where_nothing_was_seen(slow):
    _, result = found(slow, 1.0)
    bench = result.benches["Z"]
    blind = replace(bench, target=np.where(bench.unseen, np.nan, bench.target))
    held = confirmation(replace(result, benches={"Z": blind}), "thermal.memory")
    assert held.energy == 0.0
    assert not held.refutes


@pytest.mark.parametrize("goes_on", [True, False])
def test_a_fault_that_began_in_the_last_fitted_run_goes_on_or_not_as_the_unseen_run_has_it(goes_on):
    made = comparison({"Z": np.random.default_rng(8).standard_normal(N)})
    level = np.repeat([0.0, 9.0, 9.0 * goes_on], N // 3)
    made = replace(made, recorded={**made.recorded, "Z": made.recorded["Z"] + level})
    answer = diagnosis(made, effects=[effect_of(name) for name in ("data.zero", "data.gain", "thermal.instant_speed")])
    (named,) = answer.effects
    assert named.id == "data.zero"
    assert named.parameters["zero"].value == pytest.approx(9.0, abs=0.3)
    assert ("from run r2 on" in named.statement) == goes_on
    assert answer.fit["Z"].heldout.rmse_after == pytest.approx(1.0, abs=0.1)  # the noise


@pytest.mark.parametrize("goes_on", [True, False])
def test_a_jump_within_the_last_fitted_run_goes_on_or_not_as_the_unseen_run_has_it(goes_on):
    made = comparison({"Z": np.random.default_rng(8).standard_normal(N)})
    level = np.where(np.arange(N) >= (N // 3) * (2 if not goes_on else 3), 0.0, 0.6) * (np.arange(N) >= N // 2)
    made = replace(made, recorded={**made.recorded, "Z": made.recorded["Z"] + level})
    answer = diagnosis(made, effects=[effect_of(name) for name in ("data.zero", "data.step", "thermal.instant_speed")])
    (named,) = answer.effects
    assert named.id == "data.step"
    assert not named.suspected
    assert ("in all later runs" in named.statement) == goes_on


@pytest.mark.parametrize("size", [3.0, -3.0])
def test_which_of_two_runs_is_off_is_said_by_the_unseen_one(size):
    """The simulation is 5 off in all runs, so that the run with the fault may be the one that is nearer to it."""
    made = comparison({"Z": np.random.default_rng(8).standard_normal(N)})
    level = np.repeat([5.0, 5.0 + size, 5.0], N // 3)
    made = replace(made, recorded={**made.recorded, "Z": made.recorded["Z"] + level})
    (named,) = diagnosis(made, effects=[effect_of("data.zero")]).effects
    assert "in run r2" in named.statement
    assert named.parameters["zero"].value == pytest.approx(size, abs=0.3)


def test_what_is_sure_and_refuted_by_the_unseen_run_is_not_called_nothing(slow):
    """The unseen run has the opposite of what the fitted ones surely have: it is something, and not that effect."""
    noise = np.random.default_rng(5).standard_normal(N)
    course = np.repeat([1.0, 1.0, -1.0], N // 3) * 0.35 * slow / np.std(slow)
    answer = diagnosis(comparison({"Z": noise + course}), effects=EFFECTS)
    assert answer.verdict == "unexplained"
    assert not answer.effects


def test_a_fault_of_an_unseen_run_has_no_words_of_what_correcting_it_gains():
    """The errors of an answer are those of the model, which knows nothing of a fault found in the unseen run alone."""
    made = comparison({"Z": np.random.default_rng(8).standard_normal(N)})
    made = replace(made, recorded={**made.recorded, "Z": made.recorded["Z"] + np.repeat([0.0, 0.0, 9.0], N // 3)})
    answer = diagnosis(made, effects=[effect_of("data.zero")])
    assert [(one.id, one.is_fitted) for one in answer.effects] == [("data.zero", False)]
    assert "corrected" not in answer.headline


def test_runs_that_ask_for_other_calibrations_are_not_noise():
    """Both fitted runs are 9 too high; the unseen one, which the simulation has right, is made worse by an offset."""
    made = comparison({"Z": np.random.default_rng(8).standard_normal(N)})
    made = replace(made, recorded={**made.recorded, "Z": made.recorded["Z"] + np.repeat([9.0, 9.0, 0.0], N // 3)})
    assert diagnosis(made, effects=[effect_of("thermal.instant_speed")]).verdict == "unexplained"


@pytest.mark.parametrize(("off", "is_told"), [(0.0, False), (3.0, False), (10.0, True)])
def test_unseen_rows_that_are_ten_times_as_far_off_contradict_the_fitted_ones(off, is_told):
    noise = np.random.default_rng(5).standard_normal(N)
    noise[2 * N // 3 :] += off
    bench = bench_of(comparison({"Z": noise}), "Z", EFFECTS)[0]
    again = recalibrated(bench, [], noise[bench.fitted], "um", seed=0)
    assert again.p_value > 0.01
    assert bool(contradicted(bench, again)) == is_told


@pytest.mark.parametrize(("unseen", "is_seen"), [(1.0, True), (0.3, False)])
def test_physics_is_seen_only_where_unseen_rows_gain_by_it(slow, unseen, is_seen):
    noise = np.random.default_rng(5).standard_normal((2, N))
    course = 8.0 * slow / np.std(slow)
    made = comparison({"Z": noise[0] + course, "Y": noise[1] + np.repeat([1.0, 1.0, unseen], N // 3) * course})
    result = search({name: bench_of(made, name, EFFECTS)[0] for name in ("Z", "Y")}, false_alarm=0.02, seed=0)
    effect = replace(named_effect(made, result, "thermal.memory"), channel="Z")
    assert set(effect.channels) == set(effect.courses) == {"Z", "Y"}
    kept = only_where_carried(effect, result)
    assert set(kept.channels) == set(kept.courses) == ({"Z", "Y"} if is_seen else {"Z"})
    assert only_where_carried(replace(effect, id="data.step"), result).channels == effect.channels


@pytest.mark.parametrize(("there", "waves", "is_told"), [(0.5, 2.5, True), (1.0, 2.5, False), (1.0, 0.0, False)])
def test_a_calibration_of_the_fitted_runs_that_gains_nothing_in_the_unseen_one_is_told(there, waves, is_told):
    """The gain is off by as much as the fitted runs say, or by half of that; beside it something waves, or nothing."""
    made = comparison({"Z": np.zeros(N)})
    unseen, heat = made.held_out, made.simulated["Z"]
    off = 6.0 * heat / np.std(heat) * np.where(unseen, there, 1.0)
    course = off + waves * np.sqrt(2.0) * np.sin(2.0 * np.pi * np.arange(N) / 170.0)
    noise = 0.5 * np.random.default_rng(8).standard_normal(N)
    bench = bench_of(comparison({"Z": course + noise}), "Z", EFFECTS)[0]
    again = recalibrated(bench, [], noise[bench.rows], "um", seed=0)
    assert again.share > 0.7
    assert bool(contradicted(bench, again)) == is_told


def test_a_frozen_reading_is_one_although_another_one_stands_in_the_unseen_run():
    made = comparison({"Z": 0.05 * np.random.default_rng(4).standard_normal(N)}, resolution=0.1)
    recorded = made.recorded["Z"].copy()
    for first, last in ((750, 880), (1390, 1600)):
        recorded[first:last] = recorded[first]
    (effect,) = diagnosis(replace(made, recorded=made.recorded | {"Z": recorded})).effects
    assert effect.id == "data.stuck"
    assert effect.confidence > 0.9


def late_step(size, seed, *, noisier=1.0):
    """White noise, a step in the unseen run alone, and that run so many times noisier."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(N) * np.repeat([1.0, 1.0, noisier], N // 3)
    return comparison({"Z": noise + size * (np.arange(N) >= 1450)})


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_step_in_the_unseen_run_alone_is_a_fault_and_no_switch(seed):
    answer = diagnosis(late_step(2.0, seed))
    assert [effect.id for effect in answer.effects] == ["data.step"]
    assert answer.verdict == "data-fault"
    assert not answer.findings


def test_a_fault_of_a_noisier_unseen_run_is_no_surer_than_the_part_of_it_that_it_explains():
    made = late_step(0.6, 3, noisier=1.27)
    result = search({"Z": bench_of(made, "Z", EFFECTS)[0]}, false_alarm=0.02, seed=0)
    steps = [effect_of("data.step")]
    (step,) = held_out_faults(made, result, steps, false_alarm=0.02, seed=0)
    assert step.confidence < 0.5


def test_a_fault_of_one_fitted_run_is_no_name_for_its_share_alone(slow):
    made, result = found(slow, 1.0)
    state = _State(made, None, search=result)  # type: ignore[arg-type]
    guess = replace(named_effect(made, result, "thermal.memory"), confidence=0.01, share=0.3)
    assert _is_sure(guess, state, 0.3)
    assert not _is_sure(replace(guess, acts=("r1", 0.0, None)), state, 0.3)


def test_a_fault_in_the_wrong_one_of_two_runs_is_put_into_the_one_that_unseen_rows_bear_out():
    """Recalibration delays both: the second is late by half, and the first early by as much."""
    made = late_run(1, 8, 0.35)
    bench, _ = bench_of(made, "Z", [effect_of("data.clock")])
    result = search({"Z": bench}, false_alarm=0.02, seed=0)
    runs = [one.variant.run for one in bench.candidates]
    assert runs[result.named["data.clock"]["Z"]] == "r2"
    mistaken = replace(result, named={"data.clock": {"Z": runs.index("r1")}})
    named = not_ruinous(made, mistaken).named
    assert runs[named["data.clock"]["Z"]] == "r2"


def test_what_is_little_and_suspected_beside_a_name_that_is_none_is_none_either(slow, monkeypatch):
    made, result = found(slow, 1.0)
    gone = named_effect(made, result, "thermal.memory")
    beside = replace(gone, id="data.step", share=0.05, suspected=True)
    monkeypatch.setattr(workflow, "carries_little", lambda *args, is_doubted: args[2].id == "thermal.memory")
    monkeypatch.setattr(workflow, "_doubts", lambda state: ())
    state = _State(made, None, search=result)  # type: ignore[arg-type]
    for other, is_kept in (
        (beside, False),
        (replace(beside, suspected=False), True),
        (replace(beside, share=0.2), True),
        (replace(beside, channel="X"), True),
    ):
        kept = _named_clearly(replace(state, effects=(gone, other))).effects
        assert kept == ((other,) if is_kept else ())
    assert _named_clearly(replace(state, effects=(beside,))).effects == (beside,)


@pytest.mark.parametrize(("closed", "is_something"), [(0.6, True), (0.1, False), (None, False)])
def test_a_name_that_unseen_rows_bear_out_leaves_something_unexplained_where_it_is_doubted(
    slow, monkeypatch, closed, is_something
):
    made, result = found(slow, 1.0)
    gap = None if closed is None else Quantity(0.8, "1", closed, 1.0)
    result = replace(result, closed={} if gap is None else {"thermal.memory": gap})
    wanders = of_whole_record("slow", made, "Z", 1.0, 1e-6)
    monkeypatch.setattr(workflow, "carries_little", lambda *args, is_doubted: False)
    monkeypatch.setattr(workflow, "_doubts", lambda state: [wanders])
    monkeypatch.setattr(workflow, "_stands", lambda *args: False)
    one = named_effect(made, result, "thermal.memory")
    after = _named_clearly(_State(made, None, search=result, effects=(one,)))  # type: ignore[arg-type]
    assert after.effects == ()
    assert list(after.structures) == ([wanders] if is_something else [])


@pytest.mark.parametrize(
    ("second", "runs", "sure"),
    [("thermal.interaction", 1, 0.5), ("thermal.interaction", 2, 0.9), ("data.stuck", 1, 0.9)],
)
def test_two_names_of_physics_in_one_run_are_half_sure_as_it_does_not_tell_structure(
    slow, monkeypatch, second, runs, sure
):
    made, result = found(slow, 1.0)
    made = replace(made, runs=RUNS[:runs], starts=(0, N) if runs == 1 else (0, N // 3, N))
    both = ("thermal.memory", second)
    result = replace(result, named=dict.fromkeys(both, result.named["thermal.memory"]), misfit={"Z": 1.0})
    one = replace(named_effect(*found(slow, 1.0), "thermal.memory"), confidence=0.9)
    monkeypatch.setattr(workflow, "confirmed", lambda comparison, found, id_: replace(one, id=id_))
    monkeypatch.setattr(workflow.naming, "as_carried", lambda effect, found: effect)
    monkeypatch.setattr(workflow, "_is_sure", lambda effect, state, largest: True)
    state = _State(made, None, search=result)  # type: ignore[arg-type]
    assert [(effect.id, effect.confidence) for effect in _named(state).effects] == [(id_, sure) for id_ in both]
