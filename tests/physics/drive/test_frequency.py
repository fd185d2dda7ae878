from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from selector.errors import InputError
from selector.physics.drive.closed_loop import loop_poles
from selector.physics.drive.parts.axis import Axis, RigidMechanics, Servo
from selector.physics.drive.parts.catalogue import thc6350_servo, thc6350_x_axis
from selector.physics.drive.parts.stiffness import axial_compliance, three_mass_mechanics
from selector.physics.drive.stability import _near_crossover, frequency_response, frozen, loop_figures, stability
from selector.physics.drive.trajectory import ParameterCourse
from tests.physics.drive.loops import by_impedances, opened_position_loop

AXIS = Axis(three_mass_mechanics(thc6350_x_axis()), thc6350_servo())


def test_a_loop_of_first_order_has_the_bandwidth_of_its_gain():
    # a velocity loop of 1e4 1/s is none to a position loop of 40 1/s: 1/(1 + s/40)
    figures = loop_figures(Axis(RigidMechanics(1.0), Servo(40.0, 1e4)))
    # 40/1e4 is the share by which it is not of first order
    assert figures.bandwidth_hz == pytest.approx(40 / (2 * math.pi), rel=5e-3)
    assert (figures.peak, figures.peak_hz) == (1.0, 0.0)
    assert figures.phase_margin_deg == pytest.approx(90.0, abs=0.5)
    assert figures.gain_margin_db == math.inf


def test_resonance_of_a_loop_of_second_order():
    # s² + 2·ζ·ω·s + ω²: velocity gain 2ζω, position gain ω/2ζ
    omega, zeta = 100.0, 0.2
    figures = loop_figures(Axis(RigidMechanics(1.0), Servo(omega / (2 * zeta), 2 * zeta * omega)))
    # peak 1/(2ζ√(1−ζ²)) at ω√(1−2ζ²); the bandwidth in closed form; grid of 4000 over some eight decades
    assert figures.peak == pytest.approx(1 / (2 * zeta * math.sqrt(1 - zeta**2)), rel=1e-4)
    assert figures.peak_hz == pytest.approx(omega * math.sqrt(1 - 2 * zeta**2) / (2 * math.pi), rel=1e-2)
    root = math.sqrt(1 - 2 * zeta**2 + math.sqrt(4 * zeta**4 - 4 * zeta**2 + 2))
    assert figures.bandwidth_hz == pytest.approx(omega * root / (2 * math.pi), rel=1e-4)


@pytest.mark.parametrize("sample_s", [0.0, 5e-4])
def test_gain_margin_is_the_factor_that_makes_it_unstable(sample_s):
    import control  # with all of matplotlib

    axis = replace(AXIS, servo=replace(thc6350_servo(), sample_s=sample_s, delay_s=sample_s))
    figures, limits = loop_figures(axis), stability(axis).gain_limits
    assert figures.gain_margin_db == pytest.approx(20 * math.log10(limits["position_gain_per_s"]), rel=1e-12)
    whole = control.ss(*opened_position_loop(axis), 0.0, sample_s)
    if sample_s > 0:
        # its polynomials are too inexact in z: from its own response
        rad = np.geomspace(1.0, 0.99 * math.pi / sample_s, 4000)
        whole = control.frd(whole(np.exp(1j * rad * sample_s)), rad, smooth=True)
    told = control.stability_margins(whole)
    assert figures.gain_margin_db == pytest.approx(20 * math.log10(told[0]), abs=0.01)
    assert figures.phase_margin_deg == pytest.approx(told[1], abs=0.02)


@pytest.mark.parametrize(("gain_per_s", "crossings"), [(0.1, 0), (5.0, 1), (40.0, 3)])
def test_frequencies_near_the_crossings_give_the_phase_margin_of_all(gain_per_s, crossings):
    import control

    rad = np.geomspace(1.0, 1e4, 4000)
    s = 1j * rad
    # a resonance at 300/s, 25 times as high as what it stands on
    response = gain_per_s / s * 300.0**2 / (s**2 + 2 * 0.02 * 300.0 * s + 300.0**2)
    assert np.count_nonzero(np.diff(np.abs(response) > 1.0)) == crossings
    near = _near_crossover(response)
    assert np.count_nonzero(near) < 400
    whole, told = (
        control.stability_margins(control.frd(response[chosen], rad[chosen], smooth=True))
        for chosen in (slice(None), near)
    )
    # margin and frequency: but for rounding
    assert (told[1], told[4]) == pytest.approx((whole[1], whole[4]), rel=1e-12, nan_ok=True)


@pytest.mark.parametrize("sample_s", [0.0, 1e-3])
def test_a_loop_that_no_position_gain_makes_unstable_has_no_gain_margin(sample_s):
    # of second order where it is continuous: its phase stays above −180°
    figures = loop_figures(Axis(RigidMechanics(100.0, 200.0), Servo(60.0, 2e4, sample_s=sample_s)))
    limit = stability(Axis(RigidMechanics(100.0, 200.0), Servo(60.0, 2e4, sample_s=sample_s))).gain_limits
    if sample_s == 0:
        assert figures.gain_margin_db == math.inf
        assert limit["position_gain_per_s"] is None
    else:
        assert figures.gain_margin_db == pytest.approx(20 * math.log10(limit["position_gain_per_s"]))


def test_poles_are_where_the_loop_is_minus_one():
    servo = replace(thc6350_servo(), velocity_feedforward=0.5)
    axis = Axis(replace(AXIS.mechanics, torsional_damping_nms_per_rad=0.4, axial_damping_ns_per_m=2e4), servo)
    poles = loop_poles(axis)
    # three masses, and the integral of the speed error
    assert len(poles) == 7
    at_poles, beside = (np.abs(by_impedances(axis, poles * factor)[1]) for factor in (1.0, 1.001))
    # eigenvalues of a matrix with entries from 1e-3 to 1e11 keep about nine digits
    assert (at_poles < 1e-4 * beside).all()


def test_an_integral_of_next_to_nothing_does_not_make_a_resonance():
    figures = loop_figures(Axis(RigidMechanics(100.0, 200.0), Servo(60.0, 2e4, 1e-5, sample_s=1e-3)))
    assert (figures.peak, figures.peak_hz) == (1.0, 0.0)


@pytest.mark.parametrize("sample_s", [0.0, 5e-4])
def test_bandwidth_is_where_the_amplitude_is_3_db_down(sample_s):
    axis = replace(AXIS, servo=replace(thc6350_servo(), sample_s=sample_s))
    figures = loop_figures(axis)
    # straight line between points 0.3 % apart
    assert abs(frequency_response(axis, figures.bandwidth_hz)) == pytest.approx(math.sqrt(0.5), rel=1e-5)
    assert abs(frequency_response(axis, 1e-3)) == pytest.approx(1.0, abs=1e-6)


def test_sampled_margin_by_the_definition():
    servo = replace(thc6350_servo(), sample_s=5e-4, delay_s=7e-4, position_gain_per_s=120.0, velocity_gain=4.0)
    axis = replace(AXIS, servo=servo)
    figures, (A, B, C) = loop_figures(axis), opened_position_loop(axis)

    def opened(frequency_hz: float) -> complex:
        z = np.exp(2j * np.pi * frequency_hz * 5e-4)
        return complex((C @ np.linalg.solve(z * np.eye(len(A)) - A, B))[0, 0])

    hz = np.geomspace(0.5, 999.0, 4000)
    answers = np.array([opened(one) for one in hz])
    (crossover,) = np.flatnonzero(np.diff(np.abs(answers) > 1.0))
    at_phase = opened(brentq(lambda one: abs(opened(one)) - 1.0, *hz[crossover : crossover + 2]))
    # the product interpolates between points 0.3 % apart
    assert figures.phase_margin_deg == pytest.approx(math.degrees(np.angle(-at_phase)), abs=0.05)
    turned = np.flatnonzero(np.diff(answers.imag > 0.0) & (answers.real[:-1] < 0.0))
    at_gain = [opened(brentq(lambda one: opened(one).imag, *hz[k : k + 2])).real for k in turned]
    assert figures.gain_margin_db == pytest.approx(min((-20 * math.log10(-one) for one in at_gain), key=abs), rel=1e-6)


def test_feedforward_is_part_of_the_response():
    servo = replace(thc6350_servo(), velocity_feedforward=1.0, acceleration_feedforward=0.5)
    axis, hz = replace(AXIS, servo=servo), np.array([0.3, 4.0, 33.0])
    expected = by_impedances(axis, 2j * np.pi * hz)[0]
    np.testing.assert_allclose(frequency_response(axis, hz), expected, rtol=1e-8)
    # the same with quick samples, which see their reference's derivatives exactly; delay of half a sample
    quick = replace(axis, servo=replace(servo, sample_s=1e-5))
    np.testing.assert_allclose(frequency_response(quick, hz), expected, rtol=2e-3)


def test_an_unstable_loop_has_no_figures():
    axis = replace(AXIS, servo=replace(thc6350_servo(), position_gain_per_s=2000.0))
    figures = loop_figures(axis)
    assert math.isnan(figures.bandwidth_hz)
    assert math.isnan(figures.gain_margin_db)


def test_frozen_takes_the_parameters_of_the_instant():
    course = ParameterCourse(0.1, np.array([1e8, 2e8, 4e8]), np.array([100.0, 300.0, 500.0]))
    axis = replace(AXIS, compliance=axial_compliance(thc6350_x_axis()))
    at = frozen(axis, course, 0.15)
    assert at.mechanics.axial_stiffness_n_per_m == pytest.approx(3e8)
    assert at.mechanics.guide_damping_ns_per_m == pytest.approx(400.0)
    assert at.compliance is None
    figures = [loop_figures(frozen(axis, course, instant)) for instant in (0.0, 0.15)]
    assert figures[1] == loop_figures(at)
    # a softer axis is nearer to swinging
    assert figures[0].gain_margin_db < figures[1].gain_margin_db
    rigid = Axis(RigidMechanics(1.0), Servo(40.0, 1e4))
    assert frozen(rigid, replace(course, axial_stiffness_n_per_m=None), 0.2).mechanics == RigidMechanics(1.0, 500.0)
    with pytest.raises(InputError, match="rigid"):
        frozen(rigid, course, 0.0)
    with pytest.raises(InputError, match="instant"):
        frozen(axis, course, 0.3)
