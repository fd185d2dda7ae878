"""Swings that last: the same as running long enough, whatever the damping; impacts that repeat late or never."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from selector.physics.gauging.characteristic import simulate_transducer, steady_swing
from selector.physics.gauging.transducer import Smoothing, Transducer
from tests.physics.gauging.examples import TRANSDUCER
from tests.physics.gauging.slow_swing import slow_swing
from tests.physics.gauging.test_vibrating_contact import GAUGES

ROUND_S = 0.01


def tuned(ratio: float, quality: float) -> Transducer:
    """The example with an even pull, a natural frequency of so many times 100 Hz, and a free amplitude of 170 µm."""
    magnet, mass, swing = TRANSDUCER.electromagnet, TRANSDUCER.probe.mass_kg, 200 * math.pi
    stiffness = mass * (ratio * swing) ** 2
    damping = math.sqrt(mass * stiffness) / quality
    push = 170e-6 * math.hypot(stiffness - mass * swing**2, damping * swing)
    current = magnet.voltage_v / math.hypot(magnet.resistance_ohm, swing / 2 * magnet.inductance_h)
    return replace(
        TRANSDUCER,
        electromagnet=replace(magnet, gap_m=None, force_n_per_a2=2 * push / current**2),
        probe=replace(TRANSDUCER.probe, stiffness_n_per_m=stiffness, damping_ns_per_m=damping),
        rest_gap_m=push / stiffness + 130e-6,
    )


#: The same swings behind another filter: they are found once for both.
QUICKER = replace(TRANSDUCER, smoothing=Smoothing(TRANSDUCER.smoothing.time_constant_s / 5))


@pytest.mark.parametrize(
    "gauge", [TRANSDUCER, QUICKER, GAUGES["motion in the coil"], GAUGES["permanent magnet that pulls"]]
)
@pytest.mark.parametrize("allowance", [-60.0, 0.0, 80.0, 140.0])
def test_is_what_the_gauge_comes_to_by_itself(gauge, allowance):
    before = simulate_transducer(gauge, allowance, [0.0, 3.0 - ROUND_S])
    last = simulate_transducer(gauge, allowance, np.linspace(3.0 - ROUND_S, 3.0, 80 * 256 + 1), start=before.state(-1))
    swing = steady_swing(gauge, allowance)
    assert swing.rounds == 1
    # e^−30 of the filter's transient is left; steps of 1e-8
    assert last.smoothed_v[:-1].mean() == pytest.approx(swing.voltage_v, rel=1e-6)
    # of 256 samples a round, which are the same moments of it
    course = last.smoothed_v[::80]
    assert course.max() - course[:-1].mean() == pytest.approx(swing.crest_v, rel=1e-6)
    # turning points by cubics over steps, which are shortest where the tip turns fast
    assert np.ptp(last.probe_m) * 1e6 == pytest.approx(swing.stroke_um, abs=1e-3)
    assert last.probe_m[-1] == pytest.approx(swing.state.probe_m, abs=1e-10)
    # a whole period of the supply ends with the same current as it begins, half of one with the opposite
    if swing.state.current_a is not None:
        assert last.current_a[[0, -1]] == pytest.approx([-swing.state.current_a, swing.state.current_a], abs=1e-8)


@pytest.mark.parametrize("name", ["motion in the coil", "permanent magnet that pulls", "both, no time constant"])
def test_free_swing_of_a_gauge_with_feedback_is_that_of_scipy(name):
    gauge = GAUGES[name]
    time = np.linspace(0.48, 0.5, 20001)
    free = slow_swing(gauge, np.concatenate([[0.0], time]), lambda t: (1.0, 0.0), (0.0,) * 5)[0, 1:]
    swing = steady_swing(gauge, None)
    # half a second is 33 times what a free swing fades by 1/e in; the highest of 10 000 samples a swing
    assert np.ptp(free) * 1e6 == pytest.approx(swing.stroke_um, rel=1e-6)
    assert free.max() * 1e6 == pytest.approx(swing.highest_um, rel=1e-6)
    if name == "motion in the coil":
        # against 337.883 µm without, by the same integration
        assert swing.stroke_um / steady_swing(TRANSDUCER, None).stroke_um - 1.0 == pytest.approx(-0.0431, abs=5e-5)


@pytest.mark.parametrize("gauge", [TRANSDUCER, GAUGES["both, no time constant"]])
def test_goes_on_as_it_is(gauge):
    swing = steady_swing(gauge, 20.0)
    motion = simulate_transducer(gauge, 20.0, np.linspace(0.0, ROUND_S, 3), start=swing.state)
    # it counts as repeating from 3e-7 of 1.7e-4 m on
    assert motion.probe_m[-1] == pytest.approx(motion.probe_m[0], abs=1e-10)
    assert motion.generator_v[-1] == pytest.approx(motion.generator_v[0], abs=1e-6)


def test_out_of_reach_is_a_workpiece_far_away():
    free, far = steady_swing(TRANSDUCER, None), steady_swing(TRANSDUCER, -1e4)
    assert free.allowance_um == math.inf
    assert (free.voltage_v, free.stroke_um) == pytest.approx((far.voltage_v, far.stroke_um), rel=1e-9)


@pytest.mark.parametrize("quality", [50.0, 1000.0])
def test_a_lightly_damped_probe_comes_to_its_swing_too(quality):
    """By rounds alone it would take 1000 of them to fade to 4 %."""
    gauge = tuned(1.0, quality)
    swing = steady_swing(gauge, None)
    # closed form; the fixed point is known to 3e-8 of the swing, over the distance of the slope of a round from 1
    assert swing.stroke_um == pytest.approx(340.0, rel=3e-8 * quality + 1e-7)


def test_a_slow_coil_gives_a_voltage_without_mean():
    gauge = replace(TRANSDUCER, generator=replace(TRANSDUCER.generator, time_constant_s=0.5))
    swing = steady_swing(gauge, 0.0)
    time = np.linspace(0.0, ROUND_S, 4001)
    motion = simulate_transducer(gauge, 0.0, time, start=swing.state)
    # 50 rounds of a time constant: what errors of 3e-8 of the swing make of its mean
    assert abs(motion.generator_v[:-1].mean()) < 1e-4 * np.abs(motion.generator_v).max()
    assert np.abs(motion.generator_v[:-1]).mean() == pytest.approx(swing.voltage_v, rel=1e-5)


def test_impacts_repeat_every_other_round_or_never():
    """Excited below the resonance, hard and with little loss: touches that are left out, and chaos."""
    gauge = tuned(1.1, 25.0)
    found = {}
    for allowance in np.linspace(-35.0, 120.0, 40):
        swing = steady_swing(gauge, float(allowance))
        found.setdefault(swing.rounds, swing)
    assert {1, 2, 0} <= set(found)
    twice = found[2]
    motion = simulate_transducer(gauge, twice.allowance_um, np.linspace(0.0, 2 * ROUND_S, 5), start=twice.state)
    # after two rounds it is where it was, after one it is not; 3e-7 of 1.7e-4 m counts as none
    assert motion.probe_m[4] == pytest.approx(motion.probe_m[0], abs=3e-10)
    assert max(abs(motion.probe_m[2] - motion.probe_m[0]) / 170e-6,
               abs(motion.probe_m_per_s[2] - motion.probe_m_per_s[0]) / 0.1) > 1e-4  # fmt: skip
    chaos = found[0]
    assert 0.0 < chaos.voltage_sd_v < 0.1 * chaos.voltage_v
    again = steady_swing(gauge, chaos.allowance_um, start=chaos.state)
    # two stretches of one irregular course: within 5 standard errors of their difference
    assert abs(again.voltage_v - chaos.voltage_v) < 5 * math.hypot(again.voltage_sd_v, chaos.voltage_sd_v)
