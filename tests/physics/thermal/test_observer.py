"""A day that leaves its plan, against a machine whose course is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.physics.thermal.modes.modes import ModalModel, SpeedLaw
from selector.physics.thermal.prediction.observer import FAR_OFF, DayReadings, Stop, as_run, observed
from tests.physics.thermal.segments import of_segments

NAMES = ("Z", "nose", "motor")
#: Two modes: the nose follows the fast one, the motor both, Z mostly the slow one.
MODEL = ModalModel(
    NAMES, np.array([600.0, 4800.0]), np.array([[[12.0, 5.0, 4.0], [30.0, 2.0, 6.0]]]), SpeedLaw((1.2,), 2000.0),
    2000.0, np.zeros(2),
)  # fmt: skip
PLAN = of_segments((60, 1000), (60, 2000), (30, 0), (90, 1500))
NOISE_K = np.array([0.05, 0.05])


def day(stops=(), until_s=PLAN.end_s, seed=1, noise_k=0.05):
    """Readings, once a minute, of a day with these stops; and the true displacement at those times."""
    time_s = np.arange(0.0, until_s + 1.0, 60.0)
    true = MODEL.displacement_um(as_run(PLAN, stops, until_s + 60.0), time_s)
    read = 20.0 + true[:, 1:] + noise_k * np.random.default_rng(seed).standard_normal((len(time_s), 2))
    return DayReadings(NAMES[1:], time_s, read, {}), true[:, 0]


def followed(readings):
    return observed(MODEL.displacement_um, PLAN, NAMES, readings, NOISE_K, np.array([0.03, 0.03]))


def rms(seen, true):
    return float(np.sqrt(np.mean((seen.displacement_um[: len(true), 0] - true) ** 2)))


@pytest.mark.parametrize("delays", [False, True])
def test_speeds_of_a_day_with_a_stop(delays):
    stopped = as_run(PLAN, [Stop(1800.0, 5400.0, delays)], 5 * 3600.0)
    for minute in range(300):
        planned = minute if minute < 30 or not delays else minute - 60
        speed = 0.0 if 30 <= minute < 90 or planned >= 240 else float(PLAN.speed_at(np.array([60.0 * planned]))[0])
        assert stopped.speed_at(np.array([60.0 * minute]))[0] == speed, minute


def test_a_stop_that_lasts_stands():
    assert as_run(PLAN, [Stop(1800.0)], 9000.0).speed_at(np.array([1799.0, 1801.0, 8999.0])).tolist() == [1000.0, 0, 0]


@pytest.mark.parametrize(("from_min", "minutes", "delays"), [(20.3, 25, False), (75.7, 40, True), (170.2, 33, True)])
def test_a_stop_is_found_and_followed(from_min, minutes, delays):
    stop = Stop(60 * from_min, 60.0 * (from_min + minutes), delays)
    readings, true = day([stop])
    seen = followed(readings)
    (found,) = seen.stops
    # readings are a minute apart, and are off by a third of what the nose falls in a minute
    assert found.from_s == pytest.approx(stop.from_s, abs=120.0)
    assert found.to_s == pytest.approx(stop.to_s, abs=120.0)
    alone = MODEL.displacement_um(PLAN, readings.time_s)[:, 0] - true
    assert rms(seen, true) < 0.1 * np.sqrt(np.mean(alone**2))


def test_a_plan_that_goes_on_later_is_told_from_one_by_the_clock_and_foreseen():
    readings, _ = day([Stop(4500.0, 6000.0, True)], until_s=12_000.0)
    seen = followed(readings)
    assert [one.delays for one in seen.stops] == [True]
    length_s = seen.stops[0].to_s - seen.stops[0].from_s
    assert seen.time_s[-1] == pytest.approx(PLAN.end_s + length_s)
    later = as_run(PLAN, [Stop(4500.0, 6000.0, True)], PLAN.end_s + 1800.0)
    ahead = seen.time_s > seen.read_until_s
    true = MODEL.displacement_um(later, seen.time_s[ahead])[:, 0]
    # a stop that is 10 s too long leaves 10 s of heating out, 0.2 µm at most
    assert np.abs(seen.displacement_um[ahead, 0] - true).max() < 0.3


@pytest.mark.parametrize("seed", range(6))
def test_a_plan_is_not_said_to_go_on_later_before_that_makes_a_difference(seed):
    # after the stop one speed follows until the readings end: by the clock and later are the same so far, but for
    # rounding, which is another on every processor
    readings, _ = day([Stop(900.0, 2400.0, True)], until_s=3500.0, seed=seed)
    (found,) = followed(readings).stops
    assert not found.delays


def test_where_nothing_happened_nothing_is_found():
    for seed in range(3):
        readings, true = day(seed=seed)
        seen = followed(readings)
        assert seen.stops == ()
        assert rms(seen, true) < 0.05
        assert seen.misfit == pytest.approx(1.0, abs=0.3)  # of 480 readings: ± 0.13, twice


def test_a_machine_that_stands_when_the_readings_end_is_foreseen_to_stand():
    readings, _ = day([Stop(4000.0)], until_s=6000.0)
    seen = followed(readings)
    assert [one.to_s for one in seen.stops] == [None]
    assert (np.diff(seen.displacement_um[seen.time_s > 6000.0, 0]) < 0).all()


def test_what_is_told_at_a_reading_uses_no_later_one():
    readings, _ = day([Stop(4500.0, 6600.0)])
    half = len(readings.time_s) // 2
    first = DayReadings(readings.thermometers, readings.time_s[:half], readings.temperature_degc[:half], {})
    np.testing.assert_array_equal(
        followed(first).displacement_um[:half], followed(readings).displacement_um[:half]
    )  # the same bits


def test_a_slow_drift_of_a_thermometer_makes_no_stop():
    readings, true = day()
    drifting = readings.temperature_degc + np.outer(np.linspace(0.0, 0.15, len(readings.time_s)), [1.0, -1.0])
    seen = followed(replace(readings, temperature_degc=drifting))
    assert seen.stops == ()
    assert rms(seen, true) < 0.1


def test_missing_readings_and_samples_that_are_dense():
    stop = Stop(4500.0, 6600.0, True)
    readings, true = day([stop])
    gaps = readings.temperature_degc.copy()
    gaps[40:50], gaps[::7, 1] = np.nan, np.nan
    seen = followed(replace(readings, temperature_degc=gaps))
    assert [one.delays for one in seen.stops] == [True]
    assert rms(seen, true) < 0.3
    time_s = np.arange(0.0, PLAN.end_s + 1.0, 5.0)
    dense = DayReadings(
        NAMES[1:],
        time_s,
        np.column_stack([np.interp(time_s, readings.time_s, one) for one in readings.temperature_degc.T]),
        {},
    )
    assert len(dense.steps[0]) == len(readings.time_s)
    assert len(followed(dense).stops) == 1


def test_another_speed_is_no_stop_and_is_told_by_the_misfit():
    readings, _ = day(until_s=7200.0)
    seen = followed(replace(readings, temperature_degc=20.0 + 1.5 * (readings.temperature_degc - 20.0)))
    assert seen.misfit > FAR_OFF


def test_errors_against_a_gauge_of_the_day():
    readings, true = day([Stop(4500.0, 6600.0)])
    seen = followed(replace(readings, measured_um={"Z": true + 5.0}))
    plan, by_readings = seen.errors_um["Z"]
    alone = MODEL.displacement_um(PLAN, readings.time_s)[:, 0] - true
    assert plan == pytest.approx(float(np.sqrt(np.mean(alone**2))), rel=1e-9)
    assert by_readings == pytest.approx(rms(seen, true), rel=0.05)  # the last minute is beyond the plan


def test_a_gauge_that_was_silent_all_day_makes_no_error():
    readings, true = day()
    assert followed(replace(readings, measured_um={"Z": np.full_like(true, np.nan)})).errors_um == {}
