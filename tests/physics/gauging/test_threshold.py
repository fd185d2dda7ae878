"""Thresholds of a linear gauge: its mean course against a solver, its noise against quadrature, what cannot be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

from selector.errors import InputError
from selector.physics.gauging.transducer import (
    Grinding,
    LinearGauge,
    Noise,
    Relay,
    Stage,
    removal_rate_um_per_s,
    stage_thresholds_v,
    threshold_v,
    voltage_rate_sd_v_per_s,
    voltage_variance_v2,
    wear_share,
)
from tests.physics.gauging.mean_course import mean_allowance_um, mean_voltage_v

GAUGE = LinearGauge(-0.012, 2.4, 0.15)


@pytest.mark.parametrize("lag_s", [0.0, 0.05, 0.15, 0.15 * (1 + 1e-9), 2.0])
def test_mean_voltage_is_that_of_a_solver(lag_s):
    start_v, rate, start_rate = 1.7, 4.0, 20.0

    def slope(t: float, y: np.ndarray) -> list[float]:
        seen = float(mean_allowance_um(t, 40.0, rate, lag_s=lag_s, start_rate=start_rate))
        return [(GAUGE.gain_v_per_um * seen + GAUGE.bias_v - y[0]) / GAUGE.time_constant_s]

    time = np.linspace(0.0, 3.0, 31)
    solved = integrate.solve_ivp(slope, (0.0, 3.0), [start_v], t_eval=time, rtol=1e-11, atol=1e-12, method="DOP853")
    found = mean_voltage_v(GAUGE, time, 40.0, rate, start_v=start_v, lag_s=lag_s, start_rate=start_rate)
    # the solver's tolerance, added up over its steps
    np.testing.assert_allclose(found, solved.y[0], rtol=0, atol=1e-9)


def test_removal_follows_its_lag():
    time = np.linspace(0.0, 4.0, 4001)
    fallen = mean_allowance_um(time, 40.0, 4.0, lag_s=0.5, start_rate=0.0)
    removal = -np.gradient(fallen, time, edge_order=2)
    # lag·r' + r = a, by differences of second order: h²/lag² of the rate
    np.testing.assert_allclose(0.5 * np.gradient(removal, time)[5:-5] + removal[5:-5], 4.0, atol=1e-4)


def test_the_voltage_is_late_by_its_time_constant():
    """G eq. 21: K·(m0 − a·t + a·T_Φ) + bias once the transient has died."""
    time = np.array([5.0, 6.0])
    expected = GAUGE.bias_v + GAUGE.gain_v_per_um * (40.0 - 4.0 * time + 4.0 * GAUGE.time_constant_s)
    # exp(−5/0.15) of the start is left
    np.testing.assert_allclose(mean_voltage_v(GAUGE, time, 40.0, 4.0), expected, rtol=1e-13)


@given(
    until=st.floats(-50, 50), rate=st.floats(0.1, 50), filter_s=st.floats(1e-3, 1.0), gain=st.floats(-1.0, -1e-3),
    delay_s=st.floats(0.0, 0.5),
)  # fmt: skip
def test_the_command_acts_at_the_size_wanted(until, rate, filter_s, gain, delay_s):
    """G eq. 22 and 23: where the mean voltage meets the threshold, the delay is still to come."""
    gauge = LinearGauge(gain, 1.0, filter_s)
    start = until + rate * (delay_s + 60.0 * filter_s)
    end = (start - until) / rate
    met = float(mean_voltage_v(gauge, end - delay_s, start, rate))
    # exp(−60) of the transient, and the rounding of numbers of this size
    assert met == pytest.approx(threshold_v(gauge, until, rate, delay_s), abs=1e-11 * abs(gain) * (abs(start) + 1e3))


def test_thresholds_of_stages_take_delay_wear_and_the_run_on_of_the_last():
    grinding = Grinding(100.0, (Stage(22.0, 30.0), Stage(4.4, 2.0)), wheel_wear=0.1, lag_s=0.3)
    first, last = stage_thresholds_v((GAUGE, GAUGE), grinding, Relay(0.02))
    assert first == pytest.approx(threshold_v(GAUGE, 30.0, 20.0, 0.02), rel=1e-14)
    assert last == pytest.approx(threshold_v(GAUGE, 2.0, 4.0, 0.32), rel=1e-14)
    assert first < last  # the voltage rises while the allowance falls


def test_variance_is_the_integral_of_the_spectrum():
    """G eq. 25 and what follows from eq. 24, against D·β/π/(β² + ω²) through the filter."""
    noise = Noise(0.7, 30.0)

    def density(omega: float, power: int) -> float:
        spectrum = noise.sd_um**2 * noise.rate_per_s / math.pi / (noise.rate_per_s**2 + omega**2)
        return omega**power * GAUGE.gain_v_per_um**2 * spectrum / (1 + (omega * GAUGE.time_constant_s) ** 2)

    variance, of_rate = (2 * integrate.quad(density, 0, np.inf, args=(power,), epsabs=1e-14)[0] for power in (0, 2))
    # as exact as the quadrature
    assert voltage_variance_v2(GAUGE, noise) == pytest.approx(variance, rel=1e-8)
    assert voltage_rate_sd_v_per_s(GAUGE, noise) == pytest.approx(math.sqrt(of_rate), rel=1e-6)


def test_wear_grows_until_the_wheel_is_dressed():
    grinding = Grinding(50.0, (Stage(5.0, 0.0),), wheel_wear=0.05, wear_growth_per_part=0.1, dress_every=4)
    shares = [wear_share(grinding, part) for part in range(6)]
    np.testing.assert_allclose(shares, 0.05 * 1.1 ** np.array([0, 1, 2, 3, 0, 1]), rtol=1e-12)
    assert removal_rate_um_per_s(10.5, 0.05) == pytest.approx(10.0, rel=1e-15)
    with pytest.raises(InputError, match=r"part 1001\b") as refused:
        wear_share(replace(grinding, dress_every=0), 1000)
    assert refused.value.where == "wear_growth_per_part"


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.nan, math.inf])
def test_a_feed_that_removes_nothing_is_refused(wrong):
    with pytest.raises(InputError, match="feed_um_per_s"):
        Stage(wrong, 0.0)
