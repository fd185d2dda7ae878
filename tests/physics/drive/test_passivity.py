"""No friction, contact or damping makes energy: an axis that is left to itself never gains any."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.physics.drive.parts.axis import (
    AxialCompliance,
    Axis,
    AxisState,
    Friction,
    LuGre,
    RigidMechanics,
    ThreeMassMechanics,
    Transmission,
    passive_bristle_damping_ns_per_m,
    passive_fading_speed_m_per_s,
)
from selector.physics.drive.simulation import simulate_axis
from tests.physics.drive.axes import THREE, still
from tests.physics.drive.energies import stored_energy_j

STEP_S = 2e-5
# no table of pitch errors, corners a millimetre apart, and corners at which a screw turns to and fro
TABLES = tuple(
    {
        "pitch_position_m": tuple(apart_m * np.arange(-5, 6)),
        "pitch_error_m": tuple(2e-3 * apart_m * np.random.default_rng(0).normal(size=11)),
    }
    if apart_m > 0
    else {}
    for apart_m in (0.0, 1e-3, 1e-6)
)
part = st.floats(0.0, 1.0)


@st.composite
def mechanics(draw) -> ThreeMassMechanics:
    """Within a factor of 3 of a usual axis, damped or not; the fastest vibration below 15 000 rad/s."""
    scale = st.floats(-1.0, 1.0).map(lambda x: 3.0**x)
    names = (
        "motor_inertia_kg_m2",
        "screw_inertia_kg_m2",
        "table_mass_kg",
        "torsional_stiffness_nm_per_rad",
        "axial_stiffness_n_per_m",
    )
    dampings = (
        "screw_damping_nms_per_rad",
        "guide_damping_ns_per_m",
        "torsional_damping_nms_per_rad",
        "axial_damping_ns_per_m",
    )
    values = {name: getattr(THREE, name) * draw(scale) for name in names}
    values |= {name: getattr(THREE, name) * draw(st.sampled_from((0.0, 1.0, 3.0))) for name in dampings}
    return replace(THREE, **values)


@st.composite
def dry_friction(draw) -> Friction:
    coulomb, other = draw(st.floats(0.0, 500.0)), draw(st.floats(0.0, 500.0))
    return Friction(
        coulomb,
        other,
        coulomb * (1 + draw(part)),
        other * (1 + draw(part)),
        stribeck_speed_m_per_s=draw(st.floats(1e-3, 0.05)),
        stribeck_exponent=draw(st.sampled_from((1.0, 2.0))),
        screw_coulomb_nm=draw(st.sampled_from((0.0, 0.5, 2.0))),
    )


@st.composite
def states(draw, axis: Axis) -> AxisState:
    """Springs strained by some µm, speeds up to 0.1 m/s."""
    travel = axis.mechanics.travel_per_motion
    wide = st.floats(-1.0, 1.0)
    speed = 0.1 * draw(wide)
    return AxisState(
        motor=2e-3 * draw(wide),
        motor_speed=(speed + 0.02 * draw(wide)) / travel,
        screw=0.0,
        screw_speed=(speed + 0.02 * draw(wide)) / travel,
        table_m=3e-5 * draw(wide),
        table_speed_m_per_s=speed,
    )


def gained(axis: Axis, start: AxisState, step_s: float = STEP_S) -> tuple[float, float]:
    """Largest rise of the stored energy from one sample to a later one, and the energy at first [J]."""
    energy = stored_energy_j(axis, simulate_axis(axis, still(1e-4, 0.05), step_s=step_s, start=start))
    return float((energy - np.minimum.accumulate(energy)).max()), float(energy[0])


# Runge–Kutta 4 loses energy where forces are linear, (ω·h)⁶/72 of it a step; friction, contact and bristles curve the
# forces, with local errors of (ω·h)⁵/120 at ω·h of 0.05 for what swings against them: some 1e-9 of the energy.
SLACK = 1e-8
# rounding of positions in springs that are as good as at rest
NOTHING_J = 1e-15


@given(data=st.data())
@settings(max_examples=30)
def test_dry_friction_contact_and_damping(data):
    transmission = Transmission(
        backlash_m=data.draw(st.sampled_from((0.0, 1e-6, 2e-5))),
        pitch_amplitude_m=data.draw(st.sampled_from((0.0, 1e-5))),
        pitch_slope=data.draw(st.sampled_from((0.0, 1e-4))),
        **data.draw(st.sampled_from(TABLES)),
    )
    axis = Axis(data.draw(mechanics()), friction=data.draw(dry_friction()), transmission=transmission)
    rise, first = gained(axis, data.draw(states(axis)))
    assert rise <= SLACK * first + NOTHING_J


@given(data=st.data())
@settings(max_examples=30)
def test_a_spring_that_depends_on_load_and_place(data):
    force = np.linspace(-20000.0, 20000.0, 81)
    joints = force / 3e8 + 2e-6 * np.tanh(force / 3000.0)
    compliance = AxialCompliance(force, joints, 2e8, 1.0, 0.3, both_ends=data.draw(st.booleans()))
    axis = Axis(data.draw(mechanics()), friction=data.draw(dry_friction()), compliance=compliance)
    rise, first = gained(axis, data.draw(states(axis)))
    # corners of the polygon are not located: order 2 there, 1e-7 to 1e-6 of the energy at most in 2000 draws
    assert rise <= 3e-6 * first + NOTHING_J


def bristly(data, damping: float, fading: float) -> Axis:
    coulomb = data.draw(st.floats(20.0, 500.0))
    lugre = LuGre(10.0 ** data.draw(st.floats(5.5, 8.0)), damping, fading)
    return Axis(data.draw(mechanics()), friction=Friction(coulomb, lugre=lugre))


@given(data=st.data())
@settings(max_examples=20)
def test_bristles_without_stribeck_effect_whatever_their_damping(data):
    """|z| ≤ C/σ0 makes the power of friction ≥ |v|·C − σ0·z·z' ≥ 0 at any σ1."""
    axis = bristly(data, damping=data.draw(st.floats(1.0, 1e5)), fading=data.draw(st.sampled_from((0.0, 1e-3, 0.05))))
    rise, first = gained(axis, data.draw(states(axis)))
    assert rise <= SLACK * first + NOTHING_J


@given(data=st.data())
@settings(max_examples=20)
def test_bristles_with_stribeck_effect_that_fade_or_lean_on_viscous_friction(data):
    """At the largest damping that is said to be passive."""
    coulomb, other = data.draw(st.floats(20.0, 500.0)), data.draw(st.floats(20.0, 500.0))
    static, opposite = coulomb * (1 + data.draw(part)), other * (1 + data.draw(part))
    lugre = LuGre(10.0 ** data.draw(st.floats(5.5, 8.0)), 1.0)
    masses = data.draw(mechanics())
    if data.draw(st.booleans()):
        masses = replace(masses, guide_damping_ns_per_m=data.draw(st.floats(10.0, 1e4)))
    else:
        lugre = replace(lugre, fading_speed_m_per_s=data.draw(st.floats(1e-3, 0.1)))
    axis = Axis(masses, friction=Friction(coulomb, other, static, opposite, lugre=lugre))
    # bristles that are damped more than 1e5 N·s/m are those of no guide, and as good as a wall
    lugre = replace(lugre, damping_ns_per_m=min(passive_bristle_damping_ns_per_m(axis), 1e5))
    axis = replace(axis, friction=replace(axis.friction, lugre=lugre))
    rise, first = gained(axis, data.draw(states(axis)))
    assert rise <= SLACK * first + NOTHING_J


def test_the_largest_passive_damping():
    axis = Axis(RigidMechanics(100.0, 200.0), friction=Friction(20.0, static_n=60.0, lugre=LuGre(1e6, 2e4)))
    # 200·20/(60 − 20), and 4·√(2e)·20 over the fading speed if that is more
    assert passive_bristle_damping_ns_per_m(axis) == pytest.approx(100.0)
    assert passive_fading_speed_m_per_s(axis) == pytest.approx(4 * math.sqrt(2 * math.e) * 20.0 / 2e4)
    faded = replace(axis.friction, lugre=LuGre(1e6, 2e4, 0.02))
    assert passive_bristle_damping_ns_per_m(replace(axis, friction=faded)) == pytest.approx(
        200 * math.sqrt(2 * math.e) * 20
    )
    assert passive_bristle_damping_ns_per_m(replace(axis, friction=replace(axis.friction, static_n=20.0))) == math.inf
    # one direction that slides more easily than the other breaks away
    uneven = replace(axis.friction, coulomb_negative_n=10.0)
    assert passive_bristle_damping_ns_per_m(replace(axis, friction=uneven)) == pytest.approx(200.0 * 10.0 / 50.0)


def test_the_condition_is_needed():
    """A damping σ1 far above both bounds: bristles that stand at breakaway are let go at speed, and push."""
    friction = Friction(10.0, static_n=40.0, stribeck_speed_m_per_s=1e-3, lugre=LuGre(1e5, 1e4))
    start = AxisState(motor_speed=0.02, bristle_m=40.0 / 1e5)
    axis = Axis(RigidMechanics(1000.0), friction=friction)
    rise, first = gained(axis, start)
    assert rise > 1e-3 * first
    assert passive_bristle_damping_ns_per_m(axis) == 0
    lugre = replace(friction.lugre, fading_speed_m_per_s=passive_fading_speed_m_per_s(axis))
    faded = replace(friction, lugre=lugre)
    assert gained(replace(axis, friction=faded), start)[0] <= SLACK * first


def test_energy_of_a_linear_spring_and_of_its_polygon_are_the_same():
    force = np.linspace(-2e4, 2e4, 9)
    straight = AxialCompliance(force, force / 2e8, 4e7, 1.0, 0.5, both_ends=True)
    # shaft(0.5) = 0.25/4e7 = 1/1.6e8
    stiffness = 1.0 / (1 / 2e8 + 1 / 1.6e8)
    axis = Axis(replace(THREE, axial_stiffness_n_per_m=stiffness))
    start = AxisState(screw=0.02, table_m=0.0)
    motion = simulate_axis(axis, still(1e-4, 1e-4), step_s=1e-4, start=start)
    for one in (start.screw, 1e3 * start.screw, -start.screw):
        moved = replace(motion, screw=np.full(2, one), table_m=np.zeros(2))
        known = stored_energy_j(axis, moved)
        assert stored_energy_j(replace(axis, compliance=straight), moved) == pytest.approx(known, rel=1e-13)
