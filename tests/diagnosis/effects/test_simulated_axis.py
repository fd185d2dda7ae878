"""The simulation's own courses tell its equations, and with them what a push does to an axis that friction holds."""

from __future__ import annotations

import numpy as np
import pytest

from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.effects.drive._forces import held_back, leads
from selector.diagnosis.shapes.axis import MOST_SUBSTEPS, motion, pushed, simulated_axis
from selector.diagnosis.shapes.force_response import ClosedLoop, closed_loop, felt, passed
from tests.diagnosis.effects.drive_axis import PAIRS, VISCOUS_ONLY, WITH_FRICTION, Noise, compared, replace

QUIET = Noise(0.0, 0.0, 0.0)


@pytest.mark.parametrize("control", [{}, {"proportional": 30.0, "reset_s": 0.05, "coulomb": 300.0}, {"on_table": True}])
def test_force_and_error_tell_control_and_friction(control):
    axis = replace(WITH_FRICTION, **control)
    found = simulated_axis(compared(axis, axis, seed=1), "X")
    mass = axis.motor_kg + axis.table_kg
    gain = axis.speed_gain / mass
    c2, c1, c0 = found.control
    assert c2 == pytest.approx(gain, rel=0.1)
    assert c1 == pytest.approx(gain * (axis.proportional + 1.0 / axis.reset_s), rel=0.1)
    assert c0 == pytest.approx(gain * axis.proportional / axis.reset_s, rel=0.1)
    # the screw, bent by the table's force, as an error of the table by force per whole mass
    yields = 0.0 if axis.on_table else mass / axis.stiffness
    assert found.yield_s2 == pytest.approx(yields, rel=0.05)
    assert found.dry_m_per_s2 == pytest.approx(axis.coulomb / mass, rel=0.05)
    assert found.viscous_per_s == pytest.approx(axis.viscous / mass, rel=0.1)
    assert 0.0 <= found.lag_s < 3e-3
    assert found.poles_per_s.real.max() < 0.0


def test_an_axis_without_simulated_error_or_force_tells_nothing():
    whole = compared(WITH_FRICTION, WITH_FRICTION, seed=1)
    for missing in ("E", "I"):
        kept = {name: course for name, course in whole.simulated.items() if name != missing}
        assert simulated_axis(replace(whole, simulated=kept, responses=tuple(kept)), "X") is None


def _explained(course: np.ndarray, shape: np.ndarray, runs: np.ndarray) -> float:
    columns = np.column_stack([shape, *(runs == k for k in np.unique(runs))])
    left = course - columns @ np.linalg.lstsq(columns, course, rcond=None)[0]
    return 1.0 - float(left @ left) / float(((course - course.mean()) ** 2).sum())


@pytest.mark.parametrize(("start", "least"), [(VISCOUS_ONLY, 0.97), (replace(WITH_FRICTION, coulomb=300.0), 0.97)])
def test_a_heavier_table_is_what_a_push_of_inertia_makes_of_the_axis(start, least):
    comparison = compared(replace(start, table_kg=360.0), start, seed=2, noise=QUIET)
    axis = simulated_axis(comparison, "X")
    push = -motion(comparison, "X").acceleration_m_per_s2
    answer = pushed(comparison, axis, push, axis.yield_s2)
    for name, shape in (("E", answer.motion[0]), ("I", answer.countered)):
        assert _explained(comparison.difference(name), shape, comparison.run_index) > least


def test_dry_friction_holds_an_axis_at_rest_against_a_small_push():
    start = replace(WITH_FRICTION, coulomb=300.0)
    comparison = compared(start, start, seed=2, noise=QUIET)
    axis = simulated_axis(comparison, "X")
    free = type(axis)(**{**vars(axis), "dry_m_per_s2": 0.0})
    at_rest = motion(comparison, "X").sense == 0.0
    push = np.where(at_rest & (np.sin(60.0 * comparison.time_s) > 0.0), 0.01, 0.0)
    held, loose = (np.abs(pushed(comparison, one, push).motion[0][at_rest]).mean() for one in (axis, free))
    # 300 N over some µm is stiffer than the control, 600 kg times c₁
    assert held < 0.5 * loose


def test_a_constant_push_is_countered_in_full_where_the_axis_slides():
    comparison = compared(VISCOUS_ONLY, VISCOUS_ONLY, seed=1, noise=QUIET)
    axis = simulated_axis(comparison, "X")
    answer = pushed(comparison, axis, np.ones(len(comparison.time_s)))
    late = comparison.time_s > 2.0
    assert answer.countered[late] == pytest.approx(1.0, abs=1e-6)
    assert np.abs(answer.motion[0][late]).max() < 1e-6 * np.abs(answer.motion[0]).max()


@pytest.mark.parametrize("winds_up", [True, False])
def test_a_limit_holds_what_the_control_asks_for_and_is_made_good(winds_up):
    comparison = compared(WITH_FRICTION, WITH_FRICTION, seed=1, noise=QUIET)
    axis = simulated_axis(comparison, "X")
    asked = np.exp(-(((comparison.time_s - 1.0) / 0.05) ** 2))
    lacking, behind = held_back(comparison, axis, asked, 1.5, winds_up=winds_up)
    assert not lacking.any()
    assert not behind.any()
    lacking, behind = held_back(comparison, axis, asked, 0.8, winds_up=winds_up)
    # what lacks comes behind the lag, and never more than the limit takes away
    over = asked > 0.8
    assert -0.2 - 1e-9 <= lacking[over].min() < -0.1
    assert behind.min() < 0.0
    # forgotten with the slowest pole, near 40 1/s, unless friction holds the axis where it was left
    assert np.abs(lacking[comparison.time_s > 2.0]).max() < 1e-2


def test_play_that_lies_on_a_flank_before_the_first_motion():
    effect = next(one for one in catalogue() if one.id == "drive.backlash")
    truth, model = PAIRS["drive.backlash"]
    comparison = compared(truth, model, seed=1, noise=QUIET)
    found = {round(v.shape["start"].value): v.columns[:, 0] for v in effect.variants(comparison, "E")}
    before = comparison.time_s < 0.1
    moved = {start: column[~before] for start, column in found.items()}
    assert set(found) == {-1, 0, 1}
    assert not found[0][before].any()
    # the other flank is left at the first touch: a jump more
    assert found[1][before] == pytest.approx(-found[-1][before])
    assert np.abs(np.diff(moved[1])).sum() < np.abs(np.diff(moved[-1])).sum()


@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_what_is_missing_has_a_positive_coefficient_in_force_and_error_alike(turned):
    comparison = compared(*PAIRS["drive.viscous"], seed=1, noise=QUIET)
    # turned: an error that is command less position
    simulated = comparison.simulated | {"E": turned * comparison.simulated["E"]}
    recorded = comparison.recorded | {"E": turned * comparison.recorded["E"]}
    seen = replace(comparison, simulated=simulated, recorded=recorded)
    speed = motion(seen, "X").velocity_m_per_s
    for name in ("E", "I"):
        assert passed(seen, name, speed)[0] @ seen.difference(name) > 0.0


@pytest.mark.parametrize("name", ["E", "I"])
def test_what_a_force_is_felt_as_is_what_it_does_backwards(name):
    comparison = compared(VISCOUS_ONLY, VISCOUS_ONLY, seed=1, noise=QUIET)
    random = np.random.default_rng(0)
    force, course = (np.convolve(random.standard_normal(len(comparison.time_s)), np.ones(9), "same") for _ in "ab")
    axis = simulated_axis(comparison, "X")
    answer = pushed(comparison, axis, force)
    done = answer.countered if name == "I" else answer.motion[0]
    # the adjoint of a filter: equal products, but for the first sample of each run, which moves nothing
    assert felt(comparison, name, course) @ force == pytest.approx(course @ done, rel=0.02)


def test_a_ripple_that_the_loop_turns_with_speed_is_found_at_its_lead():
    truth, model = PAIRS["drive.ripple"]
    for seed in (1, 2, 3):
        found = leads(compared(truth, model, seed=seed), "X", of_force=True)
        assert min(abs(lead / truth.ripple_lead - 1.0) for lead in found) < 0.02
        assert len(found) <= 9


def test_a_current_alone_tells_the_loop_unless_it_is_worked_out_from_the_motion():
    whole = compared(VISCOUS_ONLY, VISCOUS_ONLY, seed=1)
    alone = replace(whole, simulated={"I": whole.simulated["I"]}, responses=("I",))
    loop = closed_loop(alone, "X")
    # no error is simulated: the quick poles show in the force, a slow reset hardly
    told = np.abs(np.roots(closed_loop(whole, "X").polynomial))
    assert loop.misfit < 0.1
    assert np.abs(np.roots(loop.polynomial)).max() == pytest.approx(told.max(), rel=0.5)
    moving = motion(alone, "X")
    worked_out = 0.9 * moving.acceleration_m_per_s2 + 2.4 * moving.velocity_m_per_s
    assert closed_loop(replace(alone, simulated={"I": worked_out}), "X") is None


def test_what_is_far_quicker_than_the_samples_costs_no_more_than_they_can_show():
    comparison = compared(WITH_FRICTION, WITH_FRICTION, seed=1, noise=QUIET)
    axis, period = simulated_axis(comparison, "X"), comparison.period_s
    assert axis.is_shown(period)
    # a control without reset, whose lag of 5 ps made 5e8 steps of every sample
    quick = replace(axis, control=(*axis.control[:2], 0.0), lag_s=5e-12)
    assert not quick.is_shown(period)
    stiff = replace(axis, dry_m_per_s2=1e12)
    assert quick.substeps(period) == stiff.substeps(period) == MOST_SUBSTEPS
    push = np.sin(20.0 * comparison.time_s)
    held, loose = (np.abs(pushed(comparison, one, push).motion[0]).max() for one in (stiff, axis))
    assert held < 1e-3 * loose
    for found in held_back(comparison, stiff, push, 0.8, winds_up=False):
        assert np.isfinite(found).all()
    fast = ClosedLoop((1.0, 1e9, 1e15), 0.0)
    for found in held_back(comparison, fast, push, 0.8, winds_up=True):
        assert np.isfinite(found).all()


def test_a_run_in_pieces_is_the_run(monkeypatch):
    comparison = compared(WITH_FRICTION, WITH_FRICTION, seed=1, noise=QUIET)
    axis, push = simulated_axis(comparison, "X"), np.sin(20.0 * comparison.time_s)
    whole = pushed(comparison, axis, push), held_back(comparison, axis, push, 0.8, winds_up=True)
    monkeypatch.setattr("selector.diagnosis.shapes.axis._PIECE_ROWS", 333)
    parts = pushed(comparison, axis, push), held_back(comparison, axis, push, 0.8, winds_up=True)
    np.testing.assert_array_equal(parts[0].motion, whole[0].motion)
    np.testing.assert_array_equal(parts[0].countered, whole[0].countered)
    np.testing.assert_array_equal(parts[1], whole[1])
