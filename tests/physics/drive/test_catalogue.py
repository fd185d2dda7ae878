from __future__ import annotations

import math
from dataclasses import replace

import pytest

from selector.errors import InputError
from selector.physics.drive.parts.axis import Axis
from selector.physics.drive.parts.catalogue import (
    Bearings,
    Coupling,
    Guide,
    Motor,
    Nut,
    Screw,
    Table,
    thc6350_servo,
    thc6350_x_axis,
)
from selector.physics.drive.parts.stiffness import (
    axial_stiffness_n_per_m,
    dry_friction,
    three_mass_mechanics,
    torsional_stiffness_nm_per_rad,
)
from selector.physics.drive.stability import loop_figures, stability, stability_findings


@pytest.mark.parametrize(
    ("part", "key", "value"),
    [
        (Motor, "inertia_kg_m2", 0.0),
        (Motor, "torque_constant_nm_per_a", -1.0),
        (Coupling, "stiffness_nm_per_rad", 0.0),
        (Screw, "lead_mm", 0.0),
        (Screw, "diameter_mm", -40.0),
        (Screw, "root_diameter_mm", 41.0),
        (Screw, "origin_mm", 1200.0),
        (Screw, "length_mm", math.inf),
        (Nut, "contact_angle_deg", 0.0),
        (Nut, "contact_angle_deg", 90.0),
        (Nut, "turns", 0.0),
        (Nut, "preload_n", 0.0),
        (Nut, "conformity", 0.5),
        (Bearings, "balls", 0),
        (Bearings, "contact_angle_deg", 90.0),
        (Bearings, "pitch_circle_mm", 10.0),
        (Guide, "friction_coefficient", -0.1),
        (Table, "mass_kg", -1.0),
    ],
)
def test_parts_that_cannot_be_are_refused_with_their_key(part, key, value):
    with pytest.raises(InputError) as error:
        part(**{key: value})
    assert error.value.where == key
    assert error.value.found == f"{value:g}"


def test_a_rigidity_needs_its_preload():
    with pytest.raises(InputError, match="rigidity_preload_n"):
        Nut(rigidity_n_per_um=500.0, rigidity_preload_n=None)
    with pytest.raises(InputError, match="rigidity_preload_n"):
        Bearings(rigidity_preload_n=500.0)


def test_default_machine_can_do_what_its_figures_ask_for():
    parts, servo = thc6350_x_axis(), thc6350_servo()
    mechanics = three_mass_mechanics(parts)
    # r = 100·sin 2πt mm: 0.628 m/s, 3.95 m/s²
    speed, acceleration = 0.1 * 2 * math.pi, 0.1 * (2 * math.pi) ** 2
    radius = mechanics.travel_per_motion
    turning = mechanics.motor_inertia_kg_m2 + mechanics.screw_inertia_kg_m2
    friction = dry_friction(parts)
    torque = (
        turning * acceleration / radius
        + radius * (mechanics.table_mass_kg * acceleration + friction.coulomb_n)
        + friction.screw_coulomb_nm
    )
    assert speed / radius * 60 / (2 * math.pi) < parts.motor.top_speed_rpm
    assert torque < parts.motor.peak_torque_nm
    assert servo.command_limit is not None
    assert servo.command_limit * servo.actuator_gain == pytest.approx(parts.motor.peak_torque_nm)
    # ballscrew catalogues allow 90 000 mm·r/min for ground screws
    assert parts.screw.diameter_mm * speed / radius * 60 / (2 * math.pi) < 90_000


@pytest.mark.parametrize("sample_s", [0.0, 2.5e-4])
@pytest.mark.parametrize("position_m", [-0.375, 0.0, 0.375])
def test_default_servo_has_margin_along_the_travel(position_m, sample_s):
    servo = replace(thc6350_servo(), sample_s=sample_s, delay_s=sample_s)
    parts = thc6350_x_axis()
    there = replace(
        three_mass_mechanics(parts),
        torsional_stiffness_nm_per_rad=torsional_stiffness_nm_per_rad(parts, position_m=position_m),
        axial_stiffness_n_per_m=float(axial_stiffness_n_per_m(parts, position_m=position_m)),
    )
    axis = Axis(there, servo)
    figures = loop_figures(axis)
    assert stability(axis).stable
    assert not list(stability_findings(axis, "X"))
    assert figures.gain_margin_db > 12.0
    assert figures.phase_margin_deg > 60.0
