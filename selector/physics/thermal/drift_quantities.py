"""How far did the tool point drift and tilt: the quantities of a thermal test after ISO 230-3, from any recording.

Of every displacement channel the range (largest minus smallest reading) within the first 60 minutes and within the
whole test; of two channels of one axis at two places also the rotation between them. A range has no sign. A rotation
counts right-handed about its axis, before its range is taken: two X probes along Z give B, two Y probes along Z give A.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np

from selector.recording import Channel, Recording
from selector.types import Vector

FIRST_S = 3600.0
PARALLEL = 0.02  #: Part of the distance of two probes by which they may be off the line along one axis (about 1°).
LEAST_DISTANCE_M = 1e-3
Test = Literal["environment", "spindle", "axes", "unknown"]

_AXES = ("X", "Y", "Z")
_ROTATIONS = ("A", "B", "C")
_NAMED = re.compile(r"([XYZ])\d?")


@dataclass(frozen=True)
class Drift:
    """One quantity of one run."""

    #: Channel; A, B, C for a rotation about X, Y, Z; X2−X1 for what two probes of an axis read apart, where their
    #: places are not known
    name: str
    of: tuple[str, ...]  #: The channels that it is made of
    unit: Literal["um", "um/m"]  #: {"um", "um/m"}: µm/m is µrad
    #: first_hour and whole: Range within the first 60 min and within the whole test; None if it ended sooner, or
    #: nothing was read
    first_hour: float | None
    whole: float | None


@dataclass(frozen=True)
class RunDrift:
    """The quantities of one run."""

    run: str
    #: {"environment", "spindle", "axes", "unknown"}: What moved: nothing; the spindle; an axis, with or without the
    #: spindle; or no channel says it
    test: Test
    #: Where the test begins [s from the start of the run]: at the first sample with motion, else with the run
    begin_s: float
    duration_s: float  #: From there to the last sample [s]; a cooling after the motion counts
    drifts: tuple[Drift, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**vars(self), "drifts": [{**vars(drift), "of": list(drift.of)} for drift in self.drifts]}


def drift_quantities(recording: Recording) -> tuple[RunDrift, ...]:
    """The quantities of every run; empty without a displacement channel.

    Readings are taken as they are: noise widens a range. Missing ones are passed over.
    """
    probes = [channel for channel in recording.channels if channel.role == "displacement"]
    if not probes:
        return ()
    return tuple(_of_run(recording, run, probes) for run in recording.runs)


def _of_run(recording: Recording, run: str, probes: list[Channel]) -> RunDrift:
    time_s = recording.time_s(run)
    test, begin = _test(recording, run)
    time_s, values = time_s[begin:], recording.values(run, [probe.name for probe in probes])[begin:]
    courses = dict(zip((probe.name for probe in probes), values.T, strict=True))
    early = time_s - time_s[0] <= FIRST_S
    is_long = bool(time_s[-1] - time_s[0] >= FIRST_S)

    def drift(name: str, of: tuple[str, ...], unit: Literal["um", "um/m"], course: Vector) -> Drift:
        return Drift(name, of, unit, _range(course[early]) if is_long else None, _range(course))

    drifts = [drift(probe.name, (probe.name,), "um", courses[probe.name]) for probe in probes]
    for name, first, second, per_m in _rotations(probes):
        course = per_m * (courses[second] - courses[first])
        drifts.append(drift(name, (first, second), "um/m", course))
    for axis in range(3):
        pair = [probe for probe in probes if _axis_of(probe) == axis]
        # nobody says how far apart they stand: their difference is all of the tilt
        if len(pair) == 2 and any(probe.xyz_m is None for probe in pair):
            first, second = pair[0].name, pair[1].name
            drifts.append(drift(f"{second}−{first}", (first, second), "um", courses[second] - courses[first]))
    return RunDrift(run, test, float(time_s[0]), float(time_s[-1] - time_s[0]), tuple(drifts))


def _rotations(probes: list[Channel]) -> Iterator[tuple[str, str, str, float]]:
    """(name, first, second, factor): a rotation is factor · (second − first) [µm/m].

    A small rotation ω moves a point at r by ω × r. Of probes that read along axis i and stand apart along j it is
    ω_k = ε_ikj · (difference of the readings) / (difference of the places along j). Of several pairs the widest counts.
    """
    widest: dict[int, tuple[float, tuple[str, str, str, float]]] = {}
    for first, second in combinations(probes, 2):
        along = _axis_of(first)
        if along is None or along != _axis_of(second) or first.xyz_m is None or second.xyz_m is None:
            continue
        apart = np.subtract(second.xyz_m, first.xyz_m)
        distance = float(np.linalg.norm(apart))
        j = int(np.argmax(np.abs(apart)))
        across = float(np.linalg.norm(np.delete(apart, j)))
        if distance < LEAST_DISTANCE_M or j == along or across > PARALLEL * distance:
            continue
        k = 3 - along - j
        sign = 1.0 if (along, k, j) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
        if distance > widest.get(k, (0.0,))[0]:
            widest[k] = distance, (_ROTATIONS[k], first.name, second.name, sign / float(apart[j]))
    yield from (rotation for _, (_, rotation) in sorted(widest.items()))


def _axis_of(channel: Channel) -> int | None:
    """0, 1, 2 for X, Y, Z: what the machine file says, else a name such as X1."""
    said = channel.axis.strip().upper() if channel.axis else ""
    named = _NAMED.fullmatch(channel.name)
    letter = said if said in _AXES else named[1] if named and not said else None
    return None if letter is None else _AXES.index(letter)


def _test(recording: Recording, run: str) -> tuple[Test, int]:
    """What moved, and the first sample with motion."""
    spindle = recording.values(run, recording.with_role("spindle_speed"))
    feeds = recording.values(run, recording.with_role("feed_rate", "velocity"))
    if not np.isfinite(np.hstack([spindle, feeds])).any():
        return "unknown", 0
    turning, moving = (np.nan_to_num(np.abs(part)).max(axis=1, initial=0.0) > 0.0 for part in (spindle, feeds))
    if not (turning | moving).any():
        return "environment", 0
    return ("axes" if moving.any() else "spindle"), int(np.argmax(turning | moving))


def _range(course: Vector) -> float | None:
    known = course[np.isfinite(course)]
    return float(known.max() - known.min()) if len(known) else None


def largest_displacement(recording: Recording, run: str) -> tuple[str, float, float]:
    """(channel, time [s], displacement [µm]) of the largest displacement from the start of a run; no name if none."""
    best = ("", 0.0, 0.0)
    for name in recording.with_role("displacement"):
        course = recording.values(run, [name])[:, 0]
        course = course - course[0]
        if not np.isfinite(course).any():
            continue
        k = int(np.nanargmax(np.abs(course)))
        if abs(course[k]) > abs(best[2]):
            best = (name, float(recording.time_s(run)[k]), float(course[k]))
    return best
