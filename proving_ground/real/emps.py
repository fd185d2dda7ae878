"""The recorded drive EMPS beside simulations of its loop, from the friction of which something is left out.

A. Janot, M. Gautier, M. Brunot: Data Set and Reference Models of EMPS, Workshop on Nonlinear System Identification
Benchmarks, Eindhoven 2019. Both records come with the package.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from numba import njit
from scipy.io import loadmat
from scipy.signal import butter, decimate, filtfilt

from selector.recording import Channel, Recording
from selector.shipped import shipped
from selector.types import Vector

Law = Literal["viscous", "symmetric", "by direction"]

RECORDS = {"nominal": "DATA_EMPS", "pulses": "DATA_EMPS_PULSES"}
_PERIOD_S = 1e-3
_PULSE_V = 5.07
"""What is added to the control's output where the mark of the pulses is set (fixtures/emps/README.md)."""
_KEPT = 4
"""One sample of so many is compared: the loop has 19 Hz."""
_BORDER = 50
"""Samples left out at the start, while what was before the record still shows."""
_CUT_OFF_HZ = 95.5
_DECIMATION = 10
_STEPS = 10
_ENCODER_M = 5e-8
_CHANNELS = (
    Channel("q_ref", "position_command", "m", place="reference of the control", axis="X"),
    Channel("q", "position", "m", place="encoder of the motor, as travel", axis="X"),
    Channel("U", "voltage", "V", place="control's output plus pulse; 35.15 N/V", axis="X"),
)


class AxisLaw(NamedTuple):
    """A rigid axis: mass [kg]; viscous [N·s/m] and dry friction [N] forwards and backwards; constant force [N]."""

    mass_kg: float
    viscous_forwards: float
    viscous_backwards: float
    dry_forwards: float
    dry_backwards: float
    constant: float


class Record(NamedTuple):
    """One of the two records, arrays of shape (n_samples,): reference, position [m], voltage, pulse [V], and gains."""

    reference: Vector
    position: Vector
    voltage: Vector
    pulse: Vector
    position_gain_per_s: float
    speed_gain: float
    newtons_per_volt: float


@lru_cache(maxsize=2)
def record(run: str) -> Record:
    """The record of a run, ``"nominal"`` or ``"pulses"``."""
    read = loadmat(shipped("emps") / f"{RECORDS[run]}.mat")
    data = {name: np.asarray(values, dtype=np.float64).ravel() for name, values in read.items() if name[0] != "_"}
    marked = data.get("pulses_N", np.zeros(len(data["vir"]))) > 0.0
    gains = (float(data[name][0]) for name in ("kp", "kv", "gtau"))
    return Record(data["qg"], data["qm"], data["vir"], np.asarray(_PULSE_V * marked, dtype=np.float64), *gains)


def identified(law: Law, run: str = "nominal") -> AxisLaw:
    """Least squares of force on motion, both filtered and decimated alike (docs/explanation/emps-drive.md).

    The voltage is held over a sample, so its force acts half a sample late.
    """
    data = record(run)
    numerator, denominator = butter(4, 2.0 * _PERIOD_S * _CUT_OFF_HZ)
    position = filtfilt(numerator, denominator, data.position)
    speed = np.gradient(position, _PERIOD_S)
    samples = np.arange(len(speed))
    force = data.newtons_per_volt * np.interp(samples - 0.5, samples, data.voltage)
    one = np.ones(len(speed))
    forwards = (speed > 0.0).astype(np.float64)
    columns = {
        "viscous": [speed, one],
        "symmetric": [speed, np.sign(speed), one],
        "by direction": [speed * forwards, speed * (1.0 - forwards), forwards, forwards - 1.0],
    }[law]
    inner = slice(_BORDER, -_BORDER)
    kept = [decimate(column[inner], _DECIMATION) for column in (np.gradient(speed, _PERIOD_S), *columns, force)]
    x = np.linalg.lstsq(np.column_stack(kept[:-1]), kept[-1])[0].tolist()
    if law == "viscous":
        return AxisLaw(x[0], x[1], x[1], 0.0, 0.0, x[2])
    if law == "symmetric":
        return AxisLaw(x[0], x[1], x[1], x[2], x[2], x[3])
    return AxisLaw(x[0], x[1], x[2], x[3], x[4], 0.0)


def simulated(axis: AxisLaw, data: Record) -> tuple[Vector, Vector]:
    """Position that the control sees [m] and voltage at the amplifier [V] of the closed loop, shapes (n_samples,).

    The control takes its speed over two samples, as the records show; the pulse acts behind it.
    """
    speed, place = np.polyfit(np.arange(20) * _PERIOD_S, data.position[:20], 2)[1:]
    gains = (data.position_gain_per_s, data.speed_gain, data.newtons_per_volt)
    q, u = _loop(np.array(axis), np.array(gains), data.reference, data.pulse, float(place), float(speed))
    return q, u


@njit(cache=True, nogil=True)
def _loop(axis, gains, reference, pulse, place, speed):  # type: ignore[no-untyped-def]
    """Time stepping with friction as a bound of the impulse: J. J. Moreau (1999), Comput. Methods Appl. Mech. Eng. 177.

    Mechanics in tenths of a millisecond, the control once in ten of them.
    """
    mass, constant, step = axis[0], axis[5], _PERIOD_S / _STEPS
    q, u = np.empty(len(reference)), np.empty(len(reference))
    before, last = place - 2.0 * speed * _PERIOD_S, place - speed * _PERIOD_S
    for k in range(len(reference)):
        seen = _ENCODER_M * np.round(place / _ENCODER_M)
        control = gains[1] * (gains[0] * (reference[k] - seen) - (seen - before) / (2.0 * _PERIOD_S))
        before, last = last, seen
        q[k], u[k] = seen, control + pulse[k]
        for _ in range(_STEPS):
            viscous = axis[1] if speed > 0.0 else axis[2]
            free = (speed + step / mass * (gains[2] * u[k] - constant)) / (1.0 + step * viscous / mass)
            slowed = max(free - step / mass * axis[3], 0.0)
            speed = slowed if free > 0.0 else min(free + step / mass * axis[4], 0.0)
            place += step * speed
    return q, u


def emps(law: Law, runs: tuple[str, ...] = ("nominal", "pulses")) -> tuple[Recording, Recording]:
    """The records and the simulated loop with the friction law that `nominal` was fitted with."""
    axis = identified(law)
    kept = slice(_BORDER, None, _KEPT)
    recorded, given = {}, {}
    for run in runs:
        data = record(run)
        position, voltage = simulated(axis, data)
        index = pd.Index(_PERIOD_S * np.arange(len(position))[kept], name="time_s")
        columns = {"q_ref": data.reference, "q": data.position, "U": data.voltage}
        recorded[run] = pd.DataFrame({name: column[kept] for name, column in columns.items()}, index=index)
        given[run] = pd.DataFrame({"q": position[kept], "U": voltage[kept]}, index=index)
    return Recording.from_runs(recorded, _CHANNELS), Recording.from_runs(given, _CHANNELS[1:])
