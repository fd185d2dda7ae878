"""What is done to the machine and when, and what thermometers and gauges make of its true course."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit

from selector.errors import InputError, OptionError
from selector.physics.model_text import Column
from selector.physics.thermal.model_file import ConditionsSection, InputsSection, Sine, SpeedOnly
from selector.physics.thermal.modes.modes import Cyclogram
from selector.physics.thermal.modes.thermal_test import held
from selector.physics.thermal.network.heat_system import Conditions
from selector.recording import Recording
from selector.types import Vector


@dataclass(frozen=True)
class Condition:
    """Something that is done to a machine."""

    key: str  #: In ``[conditions]`` of a model file
    field: str  #: Of `Conditions`
    resting: float  #: For a model that does not know it
    limits: tuple[float, float]  #: What is physical
    #: role and place: Of its channel
    role: str
    place: str | None = None


#: By their names as inputs of a model and as channels of a recording; the order is that of `Conditions`.
CONDITIONS: Mapping[str, Condition] = {
    "spindle_speed": Condition("spindle_speed_rpm", "spindle_speed", 0.0, (0.0, 1e6), "spindle_speed"),
    "torque": Condition("torque_nm", "torque", 0.0, (-1e9, 1e9), "state", "torque of the spindle [N·m]"),
    "ambient": Condition("ambient_degc", "ambient_degc", 20.0, (-100.0, 1000.0), "ambient", "hall"),
    "coolant_on": Condition("coolant_on", "coolant_on", 0.0, (0.0, 1.0), "state", "coolant: 0 off, 1 on"),
    "coolant": Condition("coolant_degc", "coolant_degc", 20.0, (-100.0, 1000.0), "temperature", "coolant"),
    "machine_on": Condition("machine_on", "machine_on", 1.0, (0.0, 1.0), "state", "machine: 0 off, 1 on"),
}

_KNOWN_BY_ROLE = ("spindle_speed", "ambient")


@dataclass(frozen=True)
class Driven:
    """What drove a simulation: the conditions, channel → condition, and conditions that the recording did not say."""

    conditions: Conditions
    channels: Mapping[str, str]
    not_recorded: tuple[str, ...]


def condition(conditions: Conditions, name: str) -> Vector:
    """The values of one of `CONDITIONS`, shape (n_samples,)."""
    values: Vector = getattr(conditions, CONDITIONS[name].field)
    return values


def held_at(conditions: Conditions, name: str, time_s: Vector) -> Vector:
    """The value of one of `CONDITIONS` that is held at each time [s], shape (n_times,)."""
    return _held(conditions.time_s, condition(conditions, name), time_s)


def scheduled(
    section: ConditionsSection | SpeedOnly,
    columns: Mapping[str, tuple[Vector, Vector]],
    *,
    duration_s: float,
    period_s: float,
    cyclogram: Cyclogram | None = None,
) -> Conditions:
    """The conditions that a model file describes, up to `duration_s`.

    Steps change at their own times; a sine is held over every `period_s` at the value of its middle. `columns` holds
    (time_s, values) for every key whose course is a column of a file; the last value is held. A `cyclogram` takes the
    place of the file's spindle speed, and its last speed is held.

    Raises InputError: a condition is outside what is physical, or a column holds no value.
    """
    stepwise: dict[str, tuple[Vector, Vector]] = {}
    for name, about in CONDITIONS.items():
        course = getattr(section, about.key, about.resting)
        if name == "spindle_speed" and cyclogram is not None:
            stepwise[name] = (cyclogram.start_s, cyclogram.speed_rpm)
        elif isinstance(course, Column):
            stepwise[name] = _column(about.key, course, columns)
        elif isinstance(course, tuple):
            steps = np.array(course, dtype=np.float64)
            stepwise[name] = (steps[:, 0] * 60.0, steps[:, 1])
        elif isinstance(course, Sine):
            start = np.arange(0.0, duration_s, period_s)
            stepwise[name] = (start, _sine(course, (start + np.minimum(start + period_s, duration_s)) / 2.0))
        else:
            stepwise[name] = (np.zeros(1), np.array([course], dtype=np.float64))
    changes = np.unique(np.concatenate([start for start, _ in stepwise.values()]))
    time_s = np.r_[changes[(changes > 0.0) & (changes < duration_s)], duration_s]
    time_s = np.r_[0.0, time_s]
    values = {name: _held(start, course, time_s) for name, (start, course) in stepwise.items()}
    for name, about in CONDITIONS.items():
        _within_limits(name, values[name], f"key conditions.{about.key}")
    return Conditions(time_s, *values.values())


def driven(recording: Recording, run: str, inputs: InputsSection, otherwise: Conditions) -> Driven:
    """The conditions of a recorded run, at its own time stamps; a missing sample takes the one before it.

    Spindle speed and hall temperature are known by their roles, anything else by its name, unless `inputs` names the
    channel. A condition that was not recorded has the value of `otherwise`, the conditions of the model file.

    Raises OptionError: a channel that `inputs` names is not there or empty, more than one channel has the role, a value
    is outside what is physical, or nothing tells the spindle speed.
    """
    time_s = recording.time_s(run)
    if len(time_s) < 2:
        raise _unusable(f"a single sample in run {run!r}", "two samples or more", "leave this run out")
    values: dict[str, Vector] = {}
    channels: dict[str, str] = {}
    for name in CONDITIONS:
        channel = _channel(recording, name, getattr(inputs, name))
        course = None if channel is None else recording.values(run, [channel])[:, 0]
        if channel is None or course is None or not np.isfinite(course).any():
            if getattr(inputs, name) is not None:
                raise _unusable(f"nothing in channel {channel!r} of run {run!r}", "samples", "leave this run out")
            values[name] = held_at(otherwise, name, time_s)
            continue
        if name == "spindle_speed":
            course = np.abs(course)
        values[name] = held(course)
        channels[channel] = name
        _within_limits(name, values[name], f"channel {channel!r} of run {run!r}")
    absent = tuple(name for name in CONDITIONS if name not in channels.values())
    if "spindle_speed" in absent and np.ptp(otherwise.spindle_speed) > 0:
        raise _unusable(
            f"no spindle speed in run {run!r}, and a schedule of its own in the model file",
            "a channel with the role spindle_speed",
            "give the channel this role in the machine file, or name it in [inputs] of the model file",
        )
    return Driven(Conditions(time_s, *values.values()), channels, absent)


def condensed(conditions: Conditions, step_s: float) -> Conditions:
    """Conditions of which many fall into a step [s], averaged over such steps; others as they are.

    Heat and temperatures follow the mean; a recording with a sample every second and a speed that trembles would
    otherwise ask for a matrix of its own at every sample.
    """
    time_s = conditions.time_s
    if len(time_s) <= 2.0 * (time_s[-1] - time_s[0]) / step_s + 2:
        return conditions
    step = np.floor((time_s[:-1] - time_s[0]) / step_s)
    first = np.flatnonzero(np.r_[True, step[1:] != step[:-1]])
    length = np.diff(time_s)
    total = np.add.reduceat(length, first)
    means = [
        np.r_[np.add.reduceat(values[:-1] * length, first) / total, values[-1]]
        for values in (condition(conditions, name) for name in CONDITIONS)
    ]
    return Conditions(np.r_[time_s[first], time_s[-1]], *means)


def _channel(recording: Recording, name: str, asked: str | None) -> str | None:
    if asked is not None:
        if asked not in recording.names:
            found = f"no channel {asked!r}, which the model file names in inputs.{name}"
            raise _unusable(found, "one of " + ", ".join(recording.names), "correct the name")
        return asked
    if name not in _KNOWN_BY_ROLE:
        return name if name in recording.names else None
    known = recording.with_role(name)
    if len(known) > 1 and name not in known:
        found = f"{len(known)} channels with the role {name} ({', '.join(known)})"
        raise _unusable(found, "one, or one that is named", f'write {name} = "{known[0]}" under [inputs]')
    return name if name in known else known[0] if known else None


def _column(key: str, course: Column, columns: Mapping[str, tuple[Vector, Vector]]) -> tuple[Vector, Vector]:
    time_s, values = columns[key]
    there = np.isfinite(values)
    if not there.any():
        raise InputError(
            f"no value in column {course.column!r} of {course.file}",
            expected="numbers",
            where=f"key conditions.{key}",
            advice="choose another column",
        )
    return np.asarray(time_s[there] - time_s[0]), np.asarray(values[there])


def _sine(course: Sine, time_s: Vector) -> Vector:
    phase = (time_s / 60.0 - course.phase_min) / course.period_min
    return np.asarray(course.mean + course.amplitude * np.sin(2.0 * np.pi * phase))


def _held(start_s: Vector, values: Vector, time_s: Vector) -> Vector:
    """Each value from its start to the next; before the first one, the first."""
    return values[np.clip(np.searchsorted(start_s, time_s, side="right") - 1, 0, None)]


def _within_limits(name: str, values: Vector, where: str) -> None:
    low, high = CONDITIONS[name].limits
    wrong = ~((values >= low) & (values <= high))
    if wrong.any():
        expected = "0 (off) to 1 (on)" if name in ("coolant_on", "machine_on") else f"{low:g} to {high:g}"
        raise OptionError(
            f"{name} = {values[np.argmax(wrong)]:g}",
            expected=expected,
            where=where,
            advice="correct the value, or its unit",
        )


def _unusable(found: str, expected: str, advice: str) -> OptionError:
    return OptionError(found, expected=expected, where="the recording that drives the model", advice=advice)


def lagged(time_s: Vector, values: Vector, tau_s: float, start: float | None = None) -> Vector:
    """First-order lag τ·y' = x − y, shape (n_times,), exact for a course that is straight between its samples.

    It starts settled, or at `start`. A lag of 0 is the course itself.
    """
    if tau_s <= 0.0 or not len(values):
        return np.array(values, dtype=np.float64)
    # copies can be written to: one kernel is compiled
    course, at_s = np.array(values, dtype=np.float64), np.array(time_s, dtype=np.float64)
    return np.asarray(_lag(course, at_s, tau_s, course[0] if start is None else start))


@njit(cache=True, nogil=True)
def _lag(x, time_s, tau_s, start):  # type: ignore[no-untyped-def]
    s = np.empty(len(x))
    s[0] = start
    for k in range(1, len(x)):
        r = (time_s[k] - time_s[k - 1]) / tau_s
        e = np.exp(-r)
        m = (1.0 - e) / r if r > 1e-9 else 1.0
        s[k] = e * s[k - 1] + (m - e) * x[k - 1] + (1.0 - m) * x[k]
    return s


def read_out(values: Vector, *, noise: float, resolution: float, seed: int, channel: str) -> Vector:
    """Values with Gaussian noise of this standard deviation, rounded to multiples of the resolution; 0 = none.

    The noise depends on the seed and the channel's name only: another sensor in the list does not change it.
    """
    random = np.random.default_rng([seed, zlib.crc32(channel.encode())])
    answer = values + noise * random.standard_normal(len(values)) if noise else np.array(values)
    # twelve decimals: 20.31 and not 20.310000000000002; adding zero turns −0.0 into 0.0
    return np.round(np.round(answer / resolution) * resolution, 12) + 0.0 if resolution else answer


def seed_of_run(seed: int, run: str) -> int:
    """A seed for one of several runs, so that their noise differs whatever their order."""
    return int(np.random.SeedSequence([seed, zlib.crc32(run.encode())]).generate_state(1)[0])
