from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.drive.parts.catalogue import Guide, thc6350_x_axis
from selector.physics.drive.parts.stiffness import (
    axial_load_n,
    axial_stiffness_n_per_m,
    dry_friction,
    equivalent_damping_ns_per_m,
    guide_damping_course_ns_per_m,
    parameter_course,
    published_axial_stiffness_n_per_m,
)
from selector.physics.drive.trajectory import Reference

PARTS = thc6350_x_axis()


def sine(amplitude_m: float = 0.1, frequency_hz: float = 1.0, force_n: np.ndarray | None = None) -> Reference:
    time = np.arange(1001) * 1e-3
    omega = 2 * np.pi * frequency_hz
    return Reference(
        1e-3,
        amplitude_m * np.sin(omega * time),
        amplitude_m * omega * np.cos(omega * time),
        -amplitude_m * omega**2 * np.sin(omega * time),
        force_n,
    )


@given(st.floats(1e-3, 10.0), st.floats(-2.0, 2.0))
def test_energy_of_a_cycle_is_that_of_dry_friction(amplitude, mean_share):
    coulomb, mean = 250.0, mean_share * amplitude
    angle = (np.arange(20_000) + 0.5) * 2 * np.pi / 20_000
    vibration = amplitude * np.cos(angle)
    # work of friction on the vibration, over a cycle of the angle
    dry = np.mean(coulomb * np.sign(mean + vibration) * vibration)
    found = equivalent_damping_ns_per_m(coulomb, speed_amplitude_m_per_s=amplitude, mean_speed_m_per_s=mean)
    # midpoint rule over 20 000 points with jumps: 1/20 000 of the largest power
    assert float(found) * np.mean(vibration**2) == pytest.approx(dry, abs=2e-4 * coulomb * amplitude)


def test_equivalent_damping_of_the_source_and_none_without_reversal():
    assert equivalent_damping_ns_per_m(100.0, speed_amplitude_m_per_s=0.5) == pytest.approx(400 / (np.pi * 0.5))
    assert equivalent_damping_ns_per_m(100.0, speed_amplitude_m_per_s=0.5, mean_speed_m_per_s=0.5) == 0.0
    assert equivalent_damping_ns_per_m(100.0, speed_amplitude_m_per_s=0.5, mean_speed_m_per_s=-3.0) == 0.0


def test_dry_friction_of_guide_and_screw():
    friction = dry_friction(PARTS)
    assert friction.coulomb_n == pytest.approx(0.004 * (1000 * 9.80665 + 2 * 4 * 4000) + 4 * 20)
    assert friction.screw_coulomb_nm == pytest.approx(1.2 + 2 * 0.3)
    one_end = replace(PARTS, screw=replace(PARTS.screw, both_ends=False))
    assert dry_friction(one_end).screw_coulomb_nm == pytest.approx(1.2 + 0.3)
    frictionless = replace(PARTS, guide=Guide(0.0, 4, 4000.0, 0.0, 0.0))
    assert dry_friction(frictionless).coulomb_n == 0.0


def test_load_is_inertia_friction_and_outside_force():
    reference = sine(force_n=np.full(1001, 700.0))
    load, coulomb = axial_load_n(PARTS, reference), dry_friction(PARTS).coulomb_n
    assert load[0] == pytest.approx(600 * 0.2 * np.pi + coulomb - 700)
    assert load[250] == pytest.approx(
        -1000 * 0.1 * (2 * np.pi) ** 2 + np.sign(reference.speed_m_per_s[250]) * coulomb - 700
    )


def test_readings_of_the_damping():
    reference, coulomb = sine(), dry_friction(PARTS).coulomb_n
    speed = np.abs(reference.speed_m_per_s)
    fast = speed > 0.02
    instant, cycle, vibration = (
        guide_damping_course_ns_per_m(PARTS, reference, damping=reading) - 600.0
        for reading in ("instant", "cycle", "vibration")
    )
    np.testing.assert_allclose(instant[fast] * speed[fast], coulomb, rtol=1e-12)
    np.testing.assert_allclose(cycle, instant * 4 / np.pi, rtol=1e-12)
    assert (vibration[fast] == 0).all()
    assert vibration[~fast].max() == pytest.approx(4 * coulomb / (np.pi * 0.02), rel=1e-2)
    assert np.isfinite(instant).all()
    assert instant.max() == pytest.approx(coulomb / 0.02)


def test_course_follows_position_speed_and_acceleration():
    reference = sine()
    course = parameter_course(PARTS, reference)
    load = axial_load_n(PARTS, reference)
    np.testing.assert_array_equal(
        course.axial_stiffness_n_per_m, axial_stiffness_n_per_m(PARTS, position_m=reference.position_m, load_n=load)
    )
    published = parameter_course(PARTS, reference, stiffness="published", damping="cycle")
    np.testing.assert_array_equal(
        published.axial_stiffness_n_per_m,
        published_axial_stiffness_n_per_m(PARTS, position_m=reference.position_m, load_n=load),
    )
    assert course.period_s == reference.period_s
    assert course.guide_damping_ns_per_m is not None


def test_a_reference_that_leaves_the_screw_is_refused():
    with pytest.raises(InputError) as refused:
        parameter_course(PARTS, sine(amplitude_m=0.7))
    assert refused.value.where == "position of the table"
    assert "from -0.7 to 0.7 m" in refused.value.found
