"""Drift and tilt after ISO 230-3, against values computed by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.physics.thermal.drift_quantities import drift_quantities
from selector.recording import Channel, Recording

PROBES = {
    "X1": (0.1, 0.0, 0.0),
    "X2": (0.1, 0.0, 0.2),
    "Y1": (0.0, 0.1, 0.0),
    "Y2": (0.0, 0.1, 0.2),
    "Z": (0.0, 0.0, -0.05),
}


def probe(name, place) -> Channel:
    return Channel(name, "displacement", "um", None, name[0], place)


def recording(courses, *, time_s, speed=None, feed=None, places=True) -> Recording:
    channels = [
        Channel(name, "displacement", "um", None, name[0], PROBES[name] if places else None) for name in courses
    ]
    frame = pd.DataFrame(courses, index=pd.Index(time_s, name="time_s"))
    for name, role, unit, values in (("n", "spindle_speed", "rpm", speed), ("F", "feed_rate", "mm/min", feed)):
        if values is not None:
            channels.append(Channel(name, role, unit))
            frame[name] = values
    return Recording.from_runs({"r1": frame}, channels)


def five_probes(time_s, **more) -> Recording:
    hours = np.asarray(time_s) / 3600.0
    courses = {"X1": 2 * hours, "X2": 5 * hours, "Y1": -1 * hours, "Y2": -2 * hours, "Z": 40 * (1 - np.exp(-hours))}
    return recording(courses, time_s=time_s, **more)


def test_five_probes_of_a_spindle_test():
    time_s = np.arange(0.0, 4 * 3600.0 + 1, 60.0)
    (found,) = drift_quantities(five_probes(time_s, speed=np.full(len(time_s), 3000.0)))
    assert (found.run, found.test, found.begin_s, found.duration_s) == ("r1", "spindle", 0.0, 14400.0)
    told = {drift.name: drift for drift in found.drifts}
    assert list(told) == ["X1", "X2", "Y1", "Y2", "Z", "A", "B"]
    by_hand = {
        "X1": (2.0, 8.0), "X2": (5.0, 20.0), "Y1": (1.0, 4.0), "Y2": (2.0, 8.0),
        "Z": (40 * (1 - np.exp(-1)), 40 * (1 - np.exp(-4))),
        # 3 µm and 1 µm an hour over 0.2 m
        "B": (15.0, 60.0), "A": (5.0, 20.0),
    }  # fmt: skip
    for name, (first, whole) in by_hand.items():
        # sums of a few floats
        assert (told[name].first_hour, told[name].whole) == pytest.approx((first, whole), rel=1e-12)
    assert (told["A"].unit, told["A"].of) == ("um/m", ("Y1", "Y2"))


def test_a_rotation_is_right_handed_before_its_range_is_taken():
    from selector.physics.thermal.drift_quantities import _rotations

    found = {name: factor for name, *_, factor in _rotations(list(five_probes([0.0, 1.0]).channels))}
    # B > 0 moves what is higher towards +X; A > 0 moves what is higher towards −Y
    assert found == {"B": pytest.approx(5.0), "A": pytest.approx(-5.0)}


def test_the_test_begins_with_the_motion_and_counts_the_cooling():
    time_s = np.arange(0.0, 3 * 3600.0 + 1, 600.0)
    speed = np.where((time_s >= 1800) & (time_s < 7200), 1000.0, 0.0)
    z = np.where(time_s < 1800, time_s, np.where(time_s < 7200, 0.01 * (time_s - 1800), 0.0))
    (found,) = drift_quantities(recording({"Z": z}, time_s=time_s, speed=speed))
    assert (found.test, found.begin_s, found.duration_s) == ("spindle", 1800.0, 9000.0)
    # the wander before it does not count: 36 µm in its first hour, 48 µm at its last sample before it stops
    assert (found.drifts[0].first_hour, found.drifts[0].whole) == pytest.approx((36.0, 48.0))


def test_kinds_of_tests():
    time_s = np.arange(0.0, 7201.0, 600.0)
    still, on = np.zeros(len(time_s)), np.ones(len(time_s))
    kinds = {
        "environment": {"speed": still, "feed": still}, "spindle": {"speed": on, "feed": still},
        "axes": {"speed": still, "feed": -on}, "unknown": {},
    }  # fmt: skip
    for kind, moved in kinds.items():
        assert drift_quantities(five_probes(time_s, **moved))[0].test == kind
    # a speed that another run has says nothing of this one
    assert drift_quantities(five_probes(time_s, speed=np.nan * on))[0].test == "unknown"


def test_a_short_test_has_no_first_hour_and_missing_readings_are_passed_over():
    time_s = np.arange(0.0, 1801.0, 600.0)
    found = drift_quantities(recording({"Z": [np.nan, 1.0, 4.0, np.nan], "X1": [np.nan] * 4}, time_s=time_s))[0]
    assert [(drift.first_hour, drift.whole) for drift in found.drifts] == [(None, 3.0), (None, None)]


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ((0.1, 0.0, 0.0), "one place"),
        ((0.1, 0.0, 1e-4), "too near"),
        ((0.1, 0.2, 0.2), "askew"),
        ((0.5, 0.0, 0.0), "behind"),
    ],
)
def test_probes_that_tell_no_rotation(place, why):
    frame = pd.DataFrame({"X1": [0.0, 1.0], "X2": [0.0, 2.0]}, index=pd.Index([0.0, 60.0], name="time_s"))
    channels = [
        Channel("X1", "displacement", "um", None, "X", (0.1, 0.0, 0.0)),
        Channel("X2", "displacement", "um", None, "X", place),
    ]
    found = drift_quantities(Recording.from_runs({"r1": frame}, channels))[0]
    assert [drift.name for drift in found.drifts] == ["X1", "X2"], why


def test_of_three_probes_the_widest_pair_counts():
    index = pd.Index([0.0, 60.0], name="time_s")
    frame = pd.DataFrame({"X1": [0.0, 1.0], "X2": [0.0, 2.0], "X3": [0.0, 7.0]}, index=index)
    channels = [probe(name, (0.1, 0.0, z)) for name, z in (("X1", 0.1), ("X2", 0.2), ("X3", 0.4))]
    (*_, rotation) = drift_quantities(Recording.from_runs({"r1": frame}, channels))[0].drifts
    # 6 µm over 0.3 m
    assert (rotation.name, rotation.of, rotation.whole) == ("B", ("X1", "X3"), pytest.approx(20.0))


def test_places_and_axes_must_be_known():
    unplaced = drift_quantities(five_probes([0.0, 1.0], places=False))[0].drifts
    assert [(one.name, one.unit) for one in unplaced[5:]] == [("X2−X1", "um"), ("Y2−Y1", "um")]
    frame = pd.DataFrame({"T": [1.0, 2.0]}, index=pd.Index([0.0, 1.0], name="time_s"))
    assert drift_quantities(Recording.from_runs({"r1": frame}, [Channel("T", "temperature", "degC")])) == ()
