"""A screw that its own friction warms: heat by an energy balance, growth by its closed form, circles by causes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import integrate

from selector.errors import ModelFileError
from selector.physics.drive.drive_model import drive_model
from selector.physics.drive.drive_summary import drive_summary, warm_summaries
from selector.physics.drive.file.model_file import checked_model_file
from selector.physics.drive.parts.screw_heat import STEEL_PER_K, ScrewHeat, screw_friction_w
from selector.physics.simulation_kind import RunSettings, simulation_kinds
from selector.telling.simulated import account_of
from selector.telling.simulated.result import SimulationResult

AXIS: dict[str, Any] = {
    "mechanics": {
        "kind": "three-mass",
        "motor_inertia_kg_m2": 2e-3,
        "screw_inertia_kg_m2": 3e-3,
        "table_mass_kg": 200.0,
        "lead_m": 0.01,
        "torsional_stiffness_nm_per_rad": 2e4,
        "axial_stiffness_n_per_m": 2e8,
        "screw_damping_nms_per_rad": 0.004,
        "guide_damping_ns_per_m": 400.0,
    },
    "friction": {"coulomb_n": 80.0, "screw_coulomb_nm": 0.4, "nut_efficiency": 0.85},
    "servo": {"position_gain_per_s": 40.0, "velocity_gain": 6.0, "velocity_integral_gain": 200.0, "feedback": "motor"},
    "screw_heat": {"heat_capacity_j_per_k": 3000.0, "loss_w_per_k": 6.0, "fixed_bearing_m": -0.3},
}
MOVES = {
    "kind": "moves",
    "targets_mm": [200.0, 0.0],
    "feed_mm_per_min": 12000.0,
    "acceleration_m_per_s2": 4.0,
    "dwell_s": 0.4,
}


def file_of(axis: dict[str, Any], **sections: Any) -> dict[str, Any]:
    values = {"model": {"kind": "drive", "name": "warm"}, "motion": MOVES, "axes": {"X": axis}}
    return values | sections


def warmed(values: dict[str, Any]) -> Any:
    model = drive_model(checked_model_file(values, where="test"))
    cold = model.simulation()
    summary = drive_summary(model, cold)
    return cold, summary, warm_summaries(model, cold, summary.friction_w)


def told_of(values: dict[str, Any]) -> dict[str, Any]:
    kind = simulation_kinds()["drive"]
    done = kind.planned(drive_model(checked_model_file(values, where="test")), "run", RunSettings())
    summary = kind.summary(done, lambda *_: None)
    return account_of(SimulationResult("drive", done, summary, (), Path(__file__)), drawn=True).data["drive"]


def test_heat_is_what_the_motor_gives_and_nothing_else_takes():
    # undamped springs end as they began, at rest: what the guide does not take warms the screw
    (run,) = (
        one["X"] for one in drive_model(checked_model_file(file_of(AXIS), where="test")).simulation().axes.values()
    )
    motion, mechanics = run.motion, AXIS["mechanics"]
    driven = integrate.simpson(motion.actuator_force * motion.motor_speed, x=motion.time_s)
    speed = motion.table_speed_m_per_s
    guide = motion.friction_n * speed + mechanics["guide_damping_ns_per_m"] * speed**2
    spent = integrate.simpson(guide, x=motion.time_s)
    mean_w = (driven - spent) / np.ptp(motion.time_s)
    assert screw_friction_w(run.axis, motion) == pytest.approx(mean_w, rel=0.01)


def test_the_rise_solves_its_equation():
    heat = ScrewHeat(3000.0, 6.0, share=0.7)
    solved = integrate.solve_ivp(
        lambda _, t: (0.7 * 25.0 - 6.0 * t) / 3000.0, (0.0, 900.0), [0.0], rtol=1e-10, atol=1e-12
    )
    assert heat.rise_k(25.0, 900.0) == pytest.approx(float(solved.y[0, -1]), rel=1e-8)


@pytest.mark.parametrize(("feedback", "grows"), [("motor", True), ("table", False)])
def test_the_table_is_moved_by_the_growth_from_the_fixed_bearing_unless_a_scale_sees_it(feedback, grows):
    axis = AXIS | {"servo": AXIS["servo"] | {"feedback": feedback}}
    _, _, warm = warmed(file_of(axis, run={"warm_after_min": [60.0]}))
    rise_k = warm[0].rise_k["X"]
    farthest_m = 0.2 + 0.3
    assert rise_k > 3.0
    expected = STEEL_PER_K * rise_k * farthest_m if grows else 0.0
    # a scale leaves the growth of the lag: of 5 mm at 200 mm/s a ten thousandth
    assert warm[0].added_m["X"] == pytest.approx(expected, abs=1e-6)


def test_a_circle_has_another_scale_by_the_growth_of_one_screw():
    motion = {"kind": "circle", "radius_mm": 100.0, "feeds_mm_per_min": [5000.0]}
    plain = {name: section for name, section in AXIS.items() if name != "screw_heat"}
    values = file_of(AXIS, motion=motion) | {"axes": {"X": AXIS, "Y": plain}}
    _, cold, (_, warm) = warmed(values)
    assert list(warm.rise_k) == ["X"]
    scales = [one.causes.through_feeds["scale mismatch"].value for one in (cold, warm.summary)]
    assert scales[1] - scales[0] == pytest.approx(1e6 * STEEL_PER_K * warm.rise_k["X"], rel=0.02)


def test_it_is_told_with_its_numbers_and_only_where_asked():
    told = told_of(file_of(AXIS))
    assert [one["after_min"] for one in told["warm"]["after"]] == [10.0, 60.0]
    last = told["warm"]["after"][-1]
    friction_w = told["warm"]["friction_w"]["X"]
    assert last["rise_k"]["X"] == pytest.approx(friction_w / 6.0, rel=1e-3)
    assert last["axes"][0]["runs"][0]["max"] > told["axes"][0]["runs"][0]["max"]
    assert "warm" not in last
    plain = {name: section for name, section in AXIS.items() if name != "screw_heat"}
    assert "warm" not in told_of(file_of(plain))


def test_one_mass_has_no_screw():
    axis = {"mechanics": {"kind": "rigid", "mass_kg": 100.0}, "servo": AXIS["servo"], "screw_heat": AXIS["screw_heat"]}
    with pytest.raises(ModelFileError) as refused:
        checked_model_file(file_of(axis), where="test")
    assert "screw_heat" in refused.value.where
