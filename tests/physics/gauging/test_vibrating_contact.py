"""The gauge in time: against SciPy, closed forms and energy; what cannot go on is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import RK45
from scipy.optimize import brentq

from selector.errors import InputError
from selector.physics.gauging import _swing
from selector.physics.gauging.characteristic import GaugeState, contact_force_n, simulate_transducer
from selector.physics.gauging.transducer import Contact, Generator, Probe
from tests.physics.gauging.examples import TRANSDUCER
from tests.physics.gauging.slow_swing import slow_swing

NO_COIL = replace(TRANSDUCER, generator=replace(TRANSDUCER.generator, time_constant_s=0.0))
MOTION_IN_COIL = replace(TRANSDUCER.electromagnet, motion_in_coil=True)
#: Flux²/(2·µ0·area) with poles of 7 cm²: takes the probe from 105 to 101 Hz.
PULLING = replace(TRANSDUCER.generator, pull_n=0.5)
GAUGES = {
    "as it is": TRANSDUCER,
    "no time constant of the coil": NO_COIL,
    "spring": replace(TRANSDUCER, contact=Contact(2e6, 1.0, 30.0)),
    "blunt tip": replace(TRANSDUCER, contact=Contact(3e13, 2.2, 5.0)),
    "undamped contact": replace(TRANSDUCER, contact=replace(TRANSDUCER.contact, damping_s_per_m=0.0)),
    "even pull": replace(TRANSDUCER, electromagnet=replace(TRANSDUCER.electromagnet, gap_m=None, force_n_per_a2=20.0)),
    "motion in the coil": replace(TRANSDUCER, electromagnet=MOTION_IN_COIL),
    "permanent magnet that pulls": replace(TRANSDUCER, generator=PULLING),
    "both, no time constant": replace(
        TRANSDUCER, electromagnet=MOTION_IN_COIL, generator=replace(PULLING, time_constant_s=0.0)
    ),
}


@pytest.mark.parametrize("name", GAUGES)
def test_is_what_scipy_finds_and_errors_fall_with_the_tolerance(name):
    gauge, rate_um_per_s = GAUGES[name], -500.0
    time = np.linspace(0.0, 0.06, 1201)
    allowance = 60.0 + rate_um_per_s * time
    slow = slow_swing(
        gauge, time, lambda t: (gauge.rest_gap_m - 1e-6 * (60.0 + rate_um_per_s * t), -1e-6 * rate_um_per_s), (0.0,) * 5
    )
    errors = []
    for tolerance in (1e-6, 1e-8, 1e-10):
        motion = simulate_transducer(gauge, allowance, time, relative_tolerance=tolerance)
        courses = (motion.probe_m, motion.probe_m_per_s, motion.generator_v, motion.smoothed_v)
        errors.append([np.abs(ours - his).max() for ours, his in zip(courses, slow, strict=False)])
        # the current is a formula; 3e-13 A is the error of SciPy's at rtol 1e-12. Or it is a state of 0.2 A
        is_state = gauge.electromagnet.motion_in_coil
        np.testing.assert_allclose(motion.current_a, slow[4], atol=2.0 * tolerance if is_state else 3e-13)
    assert (motion.contact_n > 0.1).sum() > 3, "the tip has to touch for this to say anything"
    # 1e-8 of a swing of 1.7e-4 m, 0.1 m/s, 4 V, summed up over 6 periods with touches: seen 1.5e-11 m, 4e-8 m/s, 3e-6 V
    # (the speed's error times 60 V·s/m, where the coil does not smooth it), 8e-9 V
    assert (np.array(errors[1]) < [5e-11, 1e-7, 6e-6, 2e-8]).all()
    # a hundredth of the tolerance, a hundredth of the error; 60 because tolerance steers steps and not their sum
    fallen = np.array(errors[:-1]) / np.array(errors[1:])
    assert (fallen > 20).all()
    assert (fallen < 400).all()


def test_steps_grow_with_the_fifth_root_of_the_tolerance():
    counts = []
    for tolerance in (1e-6, 1e-11):
        p = _swing_parameters(tolerance)
        counter = np.array([0, 0, 10**6, 0])
        _swing.rounds(
            np.array([0.0, 0.0, 0.0, 0.0]), p, counter, np.array([1e-5, 0.0, 0.0]), 1.5e-4, 0.01, np.empty((30, 7))
        )
        counts.append(counter[_swing.STEPS])
    # ten times as many steps for a 1e5-th of the error is order 5; up to a third more steps is what touches cost
    assert counts[1] / counts[0] < 13.0


def _swing_parameters(tolerance):
    from selector.physics.gauging.transducer import packed

    return packed(TRANSDUCER, tolerance)


def test_coefficients_are_those_of_dormand_and_prince():
    np.testing.assert_array_equal(_swing.A, RK45.A[1:, :])
    np.testing.assert_array_equal(_swing.B, RK45.B)
    np.testing.assert_array_equal(_swing.C, RK45.C[1:])
    # fractions, each rounded once or twice
    np.testing.assert_allclose(_swing.E, RK45.E, rtol=1e-14)


def test_a_linear_gauge_out_of_reach_swings_as_its_formula_says():
    """No gap of the magnet, a long one of the generator: sines all the way."""
    magnet = replace(TRANSDUCER.electromagnet, gap_m=None)
    generator = Generator(turns=2000.0, flux_wb=3.0, gap_m=100.0, time_constant_s=2e-3)
    gauge = replace(TRANSDUCER, electromagnet=magnet, generator=generator)
    probe, w = gauge.probe, 4 * math.pi * magnet.frequency_hz
    current = magnet.voltage_v / math.hypot(magnet.resistance_ohm, w / 2 * magnet.inductance_h)
    push = magnet.force_n_per_a2 * current**2 / 2
    dynamic = probe.stiffness_n_per_m - probe.mass_kg * w**2 + 1j * w * probe.damping_ns_per_m
    lag = math.atan2(w / 2 * magnet.inductance_h, magnet.resistance_ohm)
    time = np.linspace(0.0, 2.0, 4001)
    motion = simulate_transducer(gauge, -1e5, time)
    late = time > 1.5
    # i² = I²/2·(1 − cos(2ω0·t − 2φ))
    swing = -(push / dynamic * np.exp(1j * (w * time - 2 * lag))).real + push / probe.stiffness_n_per_m
    # what is left of switching on is exp(−67·1.5) of it; steps of 1e-8 add up over the memory of the probe
    np.testing.assert_allclose(motion.probe_m[late], swing[late], atol=3e-11)
    volts = generator.turns * generator.flux_wb / generator.gap_m * w * abs(push / dynamic)
    coil = math.hypot(1.0, w * generator.time_constant_s)
    # the gap of 100 m bends the flux by 2·1.8e-4/100
    whole = (time > 1.5) & (time <= 2.0)
    assert math.sqrt(2 * (motion.generator_v[whole] ** 2).mean()) == pytest.approx(volts / coil, rel=1e-5)
    # whole periods; a filter that has run for 20 of its time constants
    assert motion.smoothed_v[time > 1.9][:-1].mean() == pytest.approx(2 / math.pi * volts / coil, rel=1e-5)
    assert not motion.contact_n.any()


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
def test_an_impact_gives_back_what_hunt_and_crossley_say(exponent):
    """ln((1 + λv)/(1 − λv')) = λ(v + v'), from ∫ v/(1 + λv) dv = 0 over the impact, whatever stiffness and exponent."""
    damping, hits = 20.0, 0.1
    gauge = replace(
        TRANSDUCER,
        electromagnet=replace(TRANSDUCER.electromagnet, voltage_v=1e-6),
        probe=Probe(mass_kg=0.03, stiffness_n_per_m=1e-6, damping_ns_per_m=1e-9),
        contact=Contact(1e9 if exponent < 2 else 1e13, exponent, damping),
    )
    start = GaugeState(probe_m=gauge.rest_gap_m - 1e-5, probe_m_per_s=hits, current_a=0.0)
    back = simulate_transducer(gauge, 0.0, np.linspace(0.0, 0.01, 11), start=start).probe_m_per_s[-1]
    left = brentq(lambda v: math.log((1 + damping * hits) / (1 - damping * v)) - damping * (hits + v), 1e-6, 0.0499999)
    # steps of 1e-8, some twenty of them within the impact
    assert back == pytest.approx(-left, rel=1e-6)


@settings(max_examples=30)
@given(
    exponent=st.sampled_from([1.0, 1.5, 2.2]),
    contact_damping=st.floats(0.0, 100.0),
    damping=st.floats(1e-6, 10.0),
    gap_um=st.floats(-100.0, 200.0),
    place_um=st.floats(-150.0, 0.0),
    speed=st.floats(-0.15, 0.15),
)
@example(exponent=1.0, contact_damping=0.0, damping=1.0, gap_um=0.0, place_um=-59.0, speed=-0.0013354809419749702)
@example(exponent=1.0, contact_damping=0.0, damping=2.0, gap_um=-52.0, place_um=-120.0, speed=-0.00390625)
def test_probe_and_contact_make_no_energy_and_the_contact_never_pulls(
    exponent, contact_damping, damping, gap_um, place_um, speed
):
    stiffness = {1.0: 2e6, 1.5: 9.5e9, 2.2: 3e13}[exponent]
    gauge = replace(
        TRANSDUCER,
        electromagnet=replace(TRANSDUCER.electromagnet, voltage_v=1e-4),
        probe=replace(TRANSDUCER.probe, damping_ns_per_m=damping),
        contact=Contact(stiffness, exponent, contact_damping),
        rest_gap_m=1e-6 * gap_um,
    )
    # left to itself before the surface
    start = GaugeState(1e-6 * (min(gap_um, 0.0) + place_um), speed, 0.0)
    motion = simulate_transducer(gauge, 0.0, np.linspace(0.0, 0.05, 2001), start=start)
    overlap = np.maximum(motion.probe_m - gauge.rest_gap_m, 0.0)
    energy = (
        gauge.probe.mass_kg / 2 * motion.probe_m_per_s**2
        + gauge.probe.stiffness_n_per_m / 2 * motion.probe_m**2
        + stiffness * overlap ** (exponent + 1) / (exponent + 1)
    )
    # 1e-12 m of error, as tolerated in a step, against some 50 N at the bottom of an impact; a swing has 1e-4 J
    assert (np.diff(energy) <= 2e-6 * energy[0] + 1e-12).all()
    assert (motion.contact_n >= 0).all()
    # below 0 nothing but the error of a step in which the rectified voltage turns over: 5e-6 and 1.1e-5 in the examples
    assert (motion.smoothed_v > -3e-5 * motion.smoothed_v.max() - 1e-12).all()


@pytest.mark.parametrize("name", ["as it is", "motion in the coil"])
def test_goes_on_from_where_it_was(name):
    time = np.linspace(0.3, 0.5, 401)
    allowance = 30.0 * np.sin(20.0 * time)
    whole = simulate_transducer(GAUGES[name], allowance, time)
    first = simulate_transducer(GAUGES[name], allowance[:201], time[:201])
    second = simulate_transducer(GAUGES[name], allowance[200:], time[200:], start=first.state(-1))
    for name, scale in (("current_a", 0.2), ("probe_m", 2e-4), ("generator_v", 4.0), ("smoothed_v", 3.0)):
        # the same but for steps of 1e-8 that lie differently
        np.testing.assert_allclose(getattr(second, name), getattr(whole, name)[200:], atol=1e-6 * scale, err_msg=name)


def test_a_held_probe_does_not_change_the_current():
    gauge = GAUGES["motion in the coil"]
    stiff = replace(gauge, probe=replace(gauge.probe, stiffness_n_per_m=1e9))
    time = np.linspace(0.0, 0.1, 1001)
    held = simulate_transducer(stiff, 0.0, time, start=GaugeState())
    even = simulate_transducer(replace(stiff, electromagnet=TRANSDUCER.electromagnet), 0.0, time, start=GaugeState())
    # 1 N moves it by 1 nm: dL/dz · 1 nm is 3e-8 H of 0.12 H, of a current of 0.22 A
    np.testing.assert_allclose(held.current_a, even.current_a, atol=1e-7)


def test_a_coil_switched_on_long_ago_has_no_transient():
    time = np.linspace(0.0, 0.02, 201)
    long_ago = simulate_transducer(TRANSDUCER, 0.0, time, start=GaugeState()).current_a
    # a whole period of the supply
    assert long_ago[-1] == pytest.approx(long_ago[0], abs=1e-12)
    just_now = simulate_transducer(TRANSDUCER, 0.0, time).current_a
    assert just_now[0] == 0.0
    # L/R is 0.8 ms
    assert abs(just_now[-1] - long_ago[-1]) < 1e-9


def test_more_allowance_is_a_workpiece_that_is_nearer():
    time = np.linspace(0.0, 0.5, 2001)
    near, far = (simulate_transducer(TRANSDUCER, x, time) for x in (60.0, 10.0))
    # the tip goes a few micrometres into the surface, which is at rest_gap_m − allowance
    assert 110e-6 < near.probe_m.max() < 115e-6
    assert 160e-6 < far.probe_m.max() < 165e-6
    assert near.smoothed_v[-1] < far.smoothed_v[-1]


def test_a_workpiece_that_pushes_the_probe_back_holds_it():
    """Allowance beyond rest_gap_m: the probe rests on the surface, pressed by its spring."""
    time = np.linspace(0.0, 1.0, 2001)
    motion = simulate_transducer(TRANSDUCER, 270.0, time)
    late = time > 0.8
    assert (motion.contact_n[late] > 0).all()
    # spring at −100 µm plus the mean pull, a few micrometres of contact more; the mean of the pull changes it by 10 %
    assert motion.contact_n[late].mean() == pytest.approx(13000 * 100e-6 + 0.41, rel=0.1)
    assert motion.smoothed_v[-1] < 0.01


@pytest.mark.parametrize(
    ("changed", "where"),
    [
        ({"electromagnet": replace(TRANSDUCER.electromagnet, gap_m=1.5e-4)}, "electromagnet.gap_m"),
        ({"generator": replace(TRANSDUCER.generator, gap_m=1.8e-4)}, "generator.gap_m"),
        ({"generator": replace(TRANSDUCER.generator, time_constant_s=1e-10)}, "transducer"),
    ],
)
def test_what_cannot_go_on_is_refused_by_name(changed, where):
    with pytest.raises(InputError) as refused:
        simulate_transducer(replace(TRANSDUCER, **changed), -1000.0, np.linspace(0.0, 0.1, 3))
    assert refused.value.where == where


def test_the_force_of_a_contact_that_leaves_fast_is_0_and_not_a_pull():
    force = contact_force_n(TRANSDUCER.contact, np.array([1e-6, 1e-6, -1e-6]), np.array([0.0, -1.0, 0.1]))
    # 9.5e9 · 1e-9
    np.testing.assert_allclose(force, [9.5, 0.0, 0.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("made", "where", "expected"),
    [
        (lambda: replace(MOTION_IN_COIL, gap_m=None), "gap_m", "gap_m"),
        # 2 · 17 N/A² · 1.5 mm
        (lambda: replace(MOTION_IN_COIL, inductance_h=0.0509), "inductance_h", "2·force_n_per_a2·gap_m"),
        # 13000 N/m · 1 mm / 2
        (lambda: replace(TRANSDUCER, generator=replace(PULLING, pull_n=6.5)), "generator.pull_n", "less than 6.5 N"),
    ],
)
def test_feedback_that_cannot_be_is_refused_by_name(made, where, expected):
    with pytest.raises(InputError) as refused:
        made()
    assert refused.value.where == where
    assert expected in refused.value.expected


def test_a_contact_that_is_infinitely_stiff_where_it_begins_is_refused():
    with pytest.raises(InputError, match="exponent"):
        Contact(1e6, 0.9)
