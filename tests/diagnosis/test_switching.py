"""What an unrecorded switch does is located and told; noise, rounding and recorded commands are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from selector.diagnosis.mismatch.switching import switched, told_of_switches
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel
from tests.diagnosis.made import STEP_S, comparison

N = 400
WINDOWS = ((60, 150), (260, 330), (470, 600), (690, 740), (900, 1000))
TRUE = [row - 1.0 for pair in WINDOWS for row in pair]


def moment(change):
    """In rows of the comparison."""
    return N * ("r1", "r2", "r3").index(change.run) + change.at_s / STEP_S


def rng(seed):
    return np.random.default_rng(seed)


def level(windows=WINDOWS):
    on = np.zeros(3 * N)
    for first, last in windows:
        on[first:last] = 1.0
    return on


def followed(lag_s):
    """The level as a body with one time constant follows it, from rest in every run."""
    kept = np.exp(-STEP_S / lag_s)
    return np.concatenate([lfilter([1.0 - kept], [1.0, -kept], part) for part in level().reshape(3, N)])


def found_in(of, resolution=0.0):
    base = np.column_stack([np.ones(3 * N), of.simulated["Z"]])
    return switched(of, "Z", of.difference("Z"), base, resolution)


def noise(kind, seed):
    draw = rng(seed).standard_normal(3 * N)
    if kind == "sudden":
        return rng(seed).standard_t(2, 3 * N)
    if kind == "walk":
        return 0.2 * np.cumsum(draw)
    if kind == "sine":
        return 3.0 * np.sin(np.arange(3 * N) / 37.0 + seed) + 0.5 * draw
    if kind == "bursts":
        size = np.ones(3 * N)
        for first in rng(seed).integers(0, 3 * N, 8):
            size[first : first + 30] = 6.0
        return size * draw
    return np.asarray(lfilter([np.sqrt(1.0 - kind**2)], [1.0, -kind], rng(seed).standard_normal(3 * N + 500)))[500:]


@pytest.mark.parametrize("seed", range(3))
def test_moments_and_sizes_of_a_switch_that_acts_at_once(seed):
    found = found_in(comparison({"Z": 4.0 * level() + 0.5 * rng(seed).standard_normal(3 * N)}))
    assert found is not None
    assert found.lags_s == ()
    assert [moment(change) for change in found.changes] == pytest.approx(TRUE, abs=1)
    assert [change.size for change in found.changes] == pytest.approx([4.0, -4.0] * len(WINDOWS), abs=0.5)
    # away from what holds longest it is on, and a fitted course has the noise of its levels only
    assert np.abs(found.course - 4.0 * level()).max() < 4.5
    assert np.sqrt(np.mean((found.course - 4.0 * level()) ** 2)) < 0.5


@pytest.mark.parametrize("lag_s", [300.0, 900.0])
def test_a_switch_behind_a_time_constant(lag_s):
    found = found_in(comparison({"Z": 10.0 * followed(lag_s) + 0.1 * rng(4).standard_normal(3 * N)}))
    assert found is not None
    assert [moment(change) for change in found.changes] == pytest.approx(TRUE, abs=1)
    assert np.sqrt(np.mean((found.course - 10.0 * followed(lag_s)) ** 2)) < 0.3
    # two lags in a row may stand for one of their sum
    assert sum(found.lags_s) == pytest.approx(lag_s, rel=0.35)


@pytest.mark.parametrize("kind", [0.5, 0.9, 0.98, "walk", "sudden", "sine", "bursts"])
def test_noise_is_no_switch(kind):
    assert [found_in(comparison({"Z": noise(kind, seed)})) for seed in range(6)] == [None] * 6


def test_a_slow_course_that_is_rounded_is_no_switch():
    for seed in range(6):
        time = np.arange(3 * N)
        course = time / N + np.sin(time / 150.0 + seed) + 0.1 * rng(seed).standard_normal(3 * N)
        assert found_in(comparison({"Z": course}, resolution=1.0), resolution=1.0) is None


def test_what_a_recorded_state_tells_is_none():
    of = comparison({"Z": 4.0 * level() + 0.5 * rng(0).standard_normal(3 * N)})
    assert found_in(of) is not None
    recorded = {**of.recorded, "coolant": level()}
    assert found_in(replace(of, recorded=recorded, channels=(*of.channels, Channel("coolant", "state", "1")))) is None


def test_the_answer_says_when_and_names_nothing():
    for seed, size in ((0, 4.0), (1, 20.0), (2, 2.0)):
        found = diagnosis(comparison({"Z": size * level() + 0.5 * rng(seed).standard_normal(3 * N)}))
        assert (found.verdict, found.effects) == ("unexplained", ())
        (told,) = [one for one in found.findings if one.id == "unrecorded-switch"]
        assert len(told.evidence["changes"]) == 2 * len(WINDOWS)
        assert {change["run"] for change in told.evidence["changes"]} == {"r1", "r2", "r3"}
        assert "switch" in found.headline
        on = np.zeros(3 * N, dtype=bool)
        for place in found.where:
            rows = found.comparison.run_index == found.comparison.runs.index(place.run)
            on |= rows & (found.comparison.time_s >= place.from_s) & (found.comparison.time_s <= place.to_s)
        assert np.sum(on & (level() > 0)) / np.sum(on | (level() > 0)) > 0.97


def test_one_step_of_a_sensor_stays_one():
    step = np.zeros(3 * N)
    step[500 : 2 * N] = 6.0
    found = diagnosis(comparison({"Z": step + 0.5 * rng(3).standard_normal(3 * N)}))
    assert [effect.id for effect in found.effects] == ["data.step"]
    assert "unrecorded-switch" not in [one.id for one in found.findings]


def test_moments_of_a_short_record_are_told_in_seconds():
    of = comparison({"Z": 4.0 * level() + 0.5 * rng(0).standard_normal(3 * N)})
    of = replace(of, time_s=of.time_s / (1000.0 * STEP_S))
    (told,) = told_of_switches(of, {"Z": found_in(of)})
    assert "r1 0.0595 s, r1 0.149 s" in told.statement
    assert "h:min:s" not in told.statement


@pytest.mark.parametrize(("lag_s", "gap"), [(300.0, 8), (900.0, 8), (300.0, 27)])
def test_time_goes_on_where_readings_lack(lag_s, gap):
    of = comparison({"Z": 10.0 * followed(lag_s) + 0.1 * rng(4).standard_normal(3 * N)})
    recorded = of.recorded["Z"].copy()
    for first in range(20, 3 * N, 90):
        recorded[first : first + gap] = np.nan
    found = found_in(replace(of, recorded={**of.recorded, "Z": recorded}))
    assert found is not None
    assert [moment(change) for change in found.changes] == pytest.approx(TRUE, abs=gap)
    assert all(
        abs(moment(change) - at) <= change.within_s / STEP_S for change, at in zip(found.changes, TRUE, strict=True)
    )
