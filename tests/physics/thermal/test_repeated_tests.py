"""Tests repeated by the prediction that was learnt from them: what is exact comes out exactly, the rest is fitted."""

from __future__ import annotations

import numpy as np
import pytest

from selector.physics.thermal.modes.modes import ModalModel, SpeedLaw
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.answer import modal_repeats, piecewise_repeats
from selector.physics.thermal.prediction.piecewise import characteristics
from tests.physics.thermal.segments import of_segments

NOISE_UM = 0.2
TIME_S = np.arange(0.0, 8 * 3600.0 + 1, 60.0)
TURNS = of_segments((240, 2000.0), (240, 0.0))


def machine() -> ModalModel:
    """Two modes, two displacements, a gain that grows with the speed."""
    gains = np.array([[[10.0, -3.0], [30.0, 8.0]]])
    return ModalModel(("Z", "Y"), np.array([900.0, 7200.0]), gains, SpeedLaw((1.2,), 2000.0), 2000.0, np.zeros(2))


def recorded(run: str, displacement_um, speed_rpm=None, ambient_degc=None) -> ThermalTest:
    speed = TURNS.speed_at(TIME_S) if speed_rpm is None else speed_rpm
    return ThermalTest(run, TIME_S, speed, displacement_um, ambient_degc)


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, NOISE_UM, (len(TIME_S), 2))


def test_a_cold_test_is_repeated_up_to_its_zero_and_the_noise():
    true = machine().displacement_um(TURNS, TIME_S)
    (one,) = modal_repeats([recorded("a", true + np.array([5.0, -2.0]) + noise(1))], machine())
    assert one.run == "a"
    np.testing.assert_array_equal(one.time_s, TIME_S)
    # a mean of 481 samples of 0.2 µm is known to 0.009 µm: 4 of its standard errors
    np.testing.assert_allclose(one.predicted_um - true, np.broadcast_to([5.0, -2.0], true.shape), atol=0.04)
    # the standard error of a standard deviation of 481 samples is 3.2 %: 4 of them
    np.testing.assert_allclose(one.rmse_um, NOISE_UM, rtol=0.13)


def test_what_is_left_of_an_earlier_run_is_fitted_where_the_run_is_said_to_be_warm():
    start = np.array([[0.4], [0.9]])
    true = machine().displacement_um(TURNS, TIME_S, start)
    test = recorded("warm", true + noise(2))
    (cold,) = modal_repeats([test], machine())
    (warm,) = modal_repeats([test], machine(), warm=["warm"])
    assert cold.rmse_um[0] > 10 * NOISE_UM
    np.testing.assert_allclose(warm.rmse_um, NOISE_UM, rtol=0.13)  # as above
    # five free numbers of 481 samples leave 0.2·√(5/481) = 0.02 µm rms: 4 times that
    assert np.sqrt(np.mean((warm.predicted_um - true) ** 2)) < 0.08


def test_missing_readings_stay_missing_and_do_not_count():
    measured = machine().displacement_um(TURNS, TIME_S) + noise(3)
    measured[100:200, 0] = np.nan
    (one,) = modal_repeats([recorded("a", measured)], machine())
    assert np.isnan(one.measured_um[150, 0])
    assert np.isfinite(one.predicted_um).all()
    np.testing.assert_allclose(one.rmse_um, NOISE_UM, rtol=0.15)  # fewer samples than above


def test_a_jittering_speed_is_no_change_of_speed():
    turning = TURNS.speed_at(TIME_S)
    speed = np.abs(turning + (turning > 0) * np.random.default_rng(4).normal(0.0, 4.0, len(TIME_S)))
    true = machine().displacement_um(TURNS, TIME_S)
    test = recorded("a", true + noise(5), speed)
    for one in (*modal_repeats([test], machine()), *piecewise_repeats([test], characteristics([test], ("Z", "Y")))):
        # Y turns back, which pieces cannot follow; a wrong speed would cost Z micrometres
        assert one.rmse_um[0] < 1.5 * NOISE_UM
        assert one.speed_rpm.max() < 2000.0 * 1.02


def test_pieces_repeat_what_they_were_cut_from_and_leave_out_what_they_cannot():
    true = machine().displacement_um(TURNS, TIME_S)
    idle = recorded("idle", noise(6), np.zeros(len(TIME_S)))
    tests = [recorded("a", true + noise(7)), idle]
    repeats = list(piecewise_repeats(tests, characteristics(tests, ("Z", "Y"))))
    assert [one.run for one in repeats] == ["a"]
    # Z only grows while it heats, and its cooling begins where the heating ended
    assert repeats[0].rmse_um[0] == pytest.approx(NOISE_UM, rel=0.3)
