"""What a rise is counted from: the level at the start of a run, and gauges that were zeroed."""

from __future__ import annotations

import numpy as np
import pytest

from selector.models.design import datum_of, gauge_start, start_reading, start_readings
from selector.quality.completeness import START_SAMPLES
from tests.models.runs import InPieces, recording


def start_errors(signal, noise, n_seeds=400):
    """Errors of the start level, and what is claimed of them, for one signal in noise."""
    t = np.arange(60) * 10.0
    found = []
    for seed in range(n_seeds):
        rng = np.random.default_rng(seed)
        found.append(start_reading(t, signal(t) + rng.normal(0, noise, 60)))
    levels, claimed = np.array(found).T
    return levels - signal(np.zeros(1))[0], claimed


def test_a_noise_free_run_starts_with_its_first_sample():
    t = np.arange(40) * 10.0
    # second differences of this curve look like noise of 0.005 K, and no more than that may be lost
    assert start_reading(t, 20.0 + 5 * (1 - np.exp(-t / 200)))[0] == pytest.approx(20.0, abs=0.005)
    assert start_reading(t, np.full(40, 20.0)) == (20.0, 0.0)


SIGNALS = {
    "constant": lambda t: 20.0 + 0 * t,
    "slow line": lambda t: 20.0 + 0.002 * t,
    "warming": lambda t: 20.0 + 3.0 * (1 - np.exp(-t / 900.0)),
    "fast cooling": lambda t: 20.0 - 6.0 * (1 - np.exp(-t / 300.0)),
    "over at once": lambda t: 20.0 + 1.0 * (1 - np.exp(-t / 100.0)),
    "very fast": lambda t: 20.0 + 100.0 * (1 - np.exp(-t / 100.0)),
}


@pytest.mark.parametrize("signal", SIGNALS.values(), ids=SIGNALS)
def test_the_start_is_better_than_one_sample_whatever_the_run_does(signal):
    """One sample errs by 0.1. A level run mistaken for level, or a bend for a line, could cost more than that."""
    error, claimed = start_errors(signal, 0.1)
    assert np.sqrt(np.mean(error**2)) < 0.105  # over 400 seeds the error is known to 4 %
    assert abs(error.mean()) < 0.045  # the whole error is mostly scatter
    # a gauge counts as not zeroed from four claimed errors on: that must stay rare
    assert np.mean(np.abs(error) > 4 * claimed) < 0.03


@pytest.mark.parametrize("name", ["constant", "slow line", "warming"])
def test_the_noise_is_averaged_where_the_run_moves_slowly(name):
    error, _ = start_errors(SIGNALS[name], 0.1)
    assert np.sqrt(np.mean(error**2)) < 0.07  # a line through 30 samples could give 0.037


def test_quantised_readings_are_averaged_too():
    errors = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        level, claimed = start_reading(np.arange(60.0), np.round(20.03 + rng.normal(0, 0.05, 60), 1))
        errors.append(level - 20.03)
        assert 0 < claimed < 0.2
    assert np.sqrt(np.mean(np.square(errors))) < 0.05  # noise and rounding of one sample: √(0.05² + 0.1²/12) = 0.058


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_few_samples(n):
    level, error = start_reading(np.arange(float(n)), np.arange(n) + 5.0)
    assert np.isnan(error)
    assert np.isnan(level) if n == 0 else level == 5.0


def test_missing_samples_are_passed_over():
    t = np.arange(40.0)
    x = np.r_[np.nan, np.nan, np.full(38, 7.0)]
    assert start_reading(t, x)[0] == 7.0
    assert np.isnan(start_reading(t, np.full(40, np.nan))[0])


@pytest.mark.parametrize(
    ("level", "standard_error", "expected"),
    [(0.3, 0.1, 0.0), (-0.79, 0.1, 0.0), (0.9, 0.1, 0.9), (12.0, 0.1, 12.0), (0.3, np.nan, 0.3), (np.nan, 0.1, 0.0)],
)
def test_a_gauge_that_was_zeroed_has_no_offset(level, standard_error, expected):
    assert gauge_start(level, standard_error) == expected


def two_runs():
    rng = np.random.default_rng(3)
    t = np.arange(200.0)
    made = {}
    for run, (start, offset) in {"a": (20.0, 0.0), "b": (24.0, 37.0)}.items():
        made[run] = (
            t,
            {
                "T1": start + 5 * (1 - np.exp(-t / 80)) + rng.normal(0, 0.05, 200),
                "T2": np.where(t < START_SAMPLES, np.nan, start + 1.0),
                "Z": offset + 30 * (1 - np.exp(-t / 80)) + rng.normal(0, 0.2, 200),
                "n": np.full(200, 3000.0),
            },
        )
    return recording(made)


@pytest.mark.parametrize("size", [1, 3, 50])
def test_starts_do_not_depend_on_how_a_run_is_cut(size):
    whole = two_runs()
    names = ("T1", "T2", "Z")
    cut, expected = start_readings(InPieces(whole, size), names), start_readings(whole, names)
    for run in whole.runs:
        for name in names:
            assert cut[run][name] == pytest.approx(expected[run][name], rel=1e-15, nan_ok=True)


def test_a_channel_that_comes_late_has_no_start():
    starts = start_readings(two_runs(), ("T1", "T2"))
    assert np.isnan(starts["a"]["T2"]).all()
    assert starts["a"]["T1"][0] == pytest.approx(20.0, abs=0.2)


def test_datum_of_rises_and_of_absolute_readings():
    source = two_runs()
    datum = datum_of(source, ("T1", "T2"), ("Z",), "rise")
    assert datum.level("b", "T1") == pytest.approx(24.0, abs=0.2)
    assert datum.level("a", "Z") == 0.0  # zeroed: its noise must not enter
    assert datum.level("b", "Z") == pytest.approx(37.0, abs=0.8)
    assert datum.level("a", "n") == 0.0  # a speed is never a rise
    assert np.isnan(datum.level("a", "T2"))
    absolute = datum_of(source, ("T1", "T2"), ("Z",), "absolute")
    assert absolute.level("b", "T1") == absolute.level("b", "Z") == 0.0


def read_now_and_then(first=0, offset_um=25.0):
    """A gauge that is read five times in a run of eight hours in which the machine moves by 40 µm."""
    rng = np.random.default_rng(8)
    t = 300.0 * np.arange(96)
    z = offset_um + 20.0 * (1.0 - np.cos(t / 3000.0)) + rng.normal(0.0, 0.3, 96)
    seen = np.full(96, np.nan)
    at = [first, 42, 43, 57, 73]
    seen[at] = z[at]
    return t, seen


def test_movement_between_readings_is_no_noise_of_the_gauge():
    t, seen = read_now_and_then()
    level, error = start_reading(t, seen)
    # from all five readings the noise would be 4 µm, and 25 µm could not be told from a gauge that was zeroed
    assert gauge_start(level, error) == seen[0]


def test_readings_after_a_gap_do_not_move_the_start():
    t = np.arange(0.0, 7200.0, 60.0)
    x = 20.0 + 6.0 * (1.0 - np.exp(-t / 1800.0)) + np.random.default_rng(4).normal(0.0, 0.05, len(t))
    few = np.where((t < 600.0) | (t > 3600.0), x, np.nan)
    assert start_reading(t, few) == start_reading(t[:10], x[:10])


@pytest.mark.parametrize(("step_s", "late", "has_start"), [(1.0, 14, True), (60.0, 14, True), (300.0, 2, True),
                                                           (300.0, 12, False), (60.0, 16, False)])  # fmt: skip
def test_a_reading_long_after_the_start_is_none(step_s, late, has_start):
    t = step_s * np.arange(60.0)
    source = recording({"r": (t, {"T1": np.where(np.arange(60) < late, np.nan, 20.0)})})
    assert np.isfinite(start_readings(source, ("T1",))["r"]["T1"][0]) == has_start
