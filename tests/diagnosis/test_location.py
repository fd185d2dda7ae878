"""The windows in which something acts."""

from __future__ import annotations

import numpy as np
import pytest

from selector.diagnosis.mismatch.location import active_windows
from tests.diagnosis.made import STEP_S, coloured, comparison, door, residuals

N = 400
WINDOWS = (((100, 180), (260, 320)), ((50, 150),), ((200, 330),))
COURSE = np.concatenate([door(N, windows) for windows in WINDOWS])


def with_noise(course, seed=2, kind="white"):
    rng = np.random.default_rng(seed)
    return comparison({"Z": course + coloured(kind, 3 * N, rng), "Y": coloured(kind, 3 * N, rng)})


def overlap(places, truth):
    """Rows in both / rows in either."""
    seen = np.zeros(3 * N, dtype=bool)
    for place in places:
        start = ("r1", "r2", "r3").index(place.run) * N
        seen[start + round(place.from_s / STEP_S) : start + round(place.to_s / STEP_S) + 1] = True
    return (seen & truth).sum() / (seen | truth).sum()


@pytest.mark.parametrize(("strength", "least"), [(np.inf, 0.95), (6.0, 0.6), (3.0, 0.5)])
def test_windows_of_what_goes_on_and_off(strength, least):
    # Without noise only the edges' rows can differ. Recalibration has taken an offset and a part of the simulation for
    # the effect, so that the rest stands off zero between the windows; noise moves edges by some ten rows of 80.
    if np.isfinite(strength):
        of = with_noise(strength * COURSE)
        course = residuals(of)[0]["Z"]
    else:
        of, course = with_noise(COURSE), COURSE
    assert overlap(active_windows(of, "Z", course), np.abs(COURSE) >= 0.25) > least


def test_what_always_acts_acts_in_whole_runs():
    of = with_noise(np.zeros(3 * N))
    places = active_windows(of, "Z", np.tile(1.0 + 0.1 * np.sin(np.arange(N) / 30.0), 3))
    assert [(place.run, place.from_s, place.to_s) for place in places] == [
        (run, 0.0, (N - 1) * STEP_S) for run in ("r1", "r2", "r3")
    ]
    assert places[0].regime is None


def test_the_regime_stands_in_words_of_the_channel_that_tells_it():
    of = with_noise(np.zeros(3 * N))
    course = np.where(of.recorded["n"] > 1500.0, of.recorded["n"] / 1000.0, 0.0)
    assert {place.regime for place in active_windows(of, "Z", course)} == {"spindle_speed > 1500 rpm"}


def test_shares_of_all_windows_add_up():
    of = with_noise(COURSE)
    places = active_windows(of, "Z", COURSE)
    assert sum(place.share for place in places) == pytest.approx(1.0, abs=1e-9)  # rounding of a few sums
