"""The duty cycle of a prediction: its steps as they are typed, and its file in the study folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from selector.atomic_file import write_whole
from selector.csv_text import csv_text
from selector.readers.cycle_file import read_cycle
from selector.types import Vector
from selector.workbench import typed

_LONGEST_MIN, _FASTEST_RPM = 1e5, 1e6


class Step(NamedTuple):
    """A speed that is held."""

    minutes: float
    speed_rpm: float


@dataclass(frozen=True)
class Cycle:
    """Steps, and temperatures of the hall that are foreseen: name → times [s] and values [°C], as the file has them."""

    steps: tuple[Step, ...] = (Step(60.0, 2000.0), Step(30.0, 0.0), Step(60.0, 3000.0), Step(60.0, 0.0))
    hall: Mapping[str, tuple[Vector, Vector]] = field(default_factory=dict)


def typed_steps(text: str | None) -> tuple[Step, ...]:
    """The steps that were typed. Raises OptionError: one is no time and speed.

    >>> typed_steps("20 at 2000; 280 at 1000,5")
    (Step(minutes=20.0, speed_rpm=2000.0), Step(minutes=280.0, speed_rpm=1000.5))
    """
    found = []
    for part in filter(str.strip, (text or "").split(";")):
        time, _, speed = part.partition("at")
        minutes = typed.number(time.strip(), f"time of “{part.strip()}”", 1e-3, _LONGEST_MIN, "min")
        rpm = typed.number(speed.strip(), f"speed of “{part.strip()}”", 0.0, _FASTEST_RPM, "r/min")
        found.append(Step(minutes, rpm))
    return tuple(found)


def steps_text(steps: Sequence[Step]) -> str:
    """The steps as they are typed."""
    return "; ".join(f"{one.minutes:.6g} at {one.speed_rpm:.6g}" for one in steps)


def cycle_in(path: Path) -> Cycle:
    """The duty cycle of a file. Raises ReadError: it holds none."""
    rows = read_cycle(path)
    speeds = rows.speed_rpm[:-1]
    first = np.flatnonzero(np.r_[True, np.diff(speeds) != 0])
    minutes = np.diff(np.r_[rows.time_s[first], rows.time_s[-1]]) / 60.0
    steps = tuple(Step(float(one), float(speed)) for one, speed in zip(minutes, speeds[first], strict=True))
    return Cycle(steps, {name: (rows.time_s, values) for name, values in rows.temperatures([*rows.others]).items()})


def write_cycle(cycle: Cycle, path: Path) -> None:
    """Writes the file of a duty cycle, whole or not at all; a hall that is foreseen ends as it is known last."""
    starts_s = 60.0 * np.cumsum([0.0, *(one.minutes for one in cycle.steps)])
    times_s = np.unique(np.concatenate([starts_s, *(at[at < starts_s[-1]] for at, _ in cycle.hall.values())]))
    held = np.clip(np.searchsorted(starts_s, times_s, "right") - 1, 0, len(cycle.steps) - 1)
    speeds = [cycle.steps[k].speed_rpm for k in held]
    columns = [np.round(np.interp(times_s, at, values), 3).tolist() for at, values in cycle.hall.values()]
    rows = zip(times_s.tolist(), speeds, *columns, strict=True)
    write_whole(path, csv_text(("time_s", "spindle_speed", *cycle.hall), rows).encode("utf-8"))
