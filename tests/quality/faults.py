"""Faults planted into a clean recording, each with the truth about where it is and what must be found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from selector.findings import Finding
from selector.recording import Recording


@dataclass(frozen=True)
class Planted:
    """A recording with one fault: accepted finding ids, and where it is (run None: in several)."""

    recording: Recording
    ids: tuple[str, ...]
    channels: tuple[str | None, ...]
    run: str | None
    window_s: tuple[float, float] | None
    acts: bool = True

    def is_told_by(self, finding: Finding) -> bool:
        """Right kind and place, and at least half of what it leaves out of the channel is the fault."""
        where = finding.where
        if finding.id not in self.ids or where.channel not in self.channels or not self._in_run(where.run):
            return False
        if finding.level == "info" and self.acts:
            return False
        if self.window_s is None or where.from_s is None or where.to_s is None:
            return True
        (a, b), (c, d) = self.window_s, (where.from_s, where.to_s)
        return min(b, d) - max(a, c) >= 0.5 * min(b - a, d - c) and (d - c) <= 2.5 * (b - a) + 1e-9

    def is_beside_the_fault(self, finding: Finding) -> bool:
        """Something is left out that has no fault."""
        return finding.action != "none" and (
            finding.where.channel not in self.channels or not self._in_run(finding.where.run)
        )

    def _in_run(self, run: str | None) -> bool:
        return self.run is None or run in (None, self.run)


def planted(recording: Recording, kind: str, rng: np.random.Generator) -> Planted | None:
    """The recording with a fault of this kind, or None where it could not be seen by anybody (nothing moves)."""
    return KINDS[kind](recording, rng)


def _with(recording: Recording, run: str, change: Callable[[pd.DataFrame], None]) -> Recording:
    tables = {name: _table(recording, name) for name in recording.runs}
    change(tables[run])
    return Recording.from_runs(tables, recording.channels)


def _table(recording: Recording, run: str) -> pd.DataFrame:
    return pd.DataFrame(recording.values(run, recording.names), recording.time_s(run), list(recording.names))


def _choice(recording: Recording, rng: np.random.Generator, *roles: str) -> tuple[str, str]:
    return str(rng.choice(recording.with_role(*roles))), str(rng.choice(recording.runs))


def _span(recording: Recording, run: str, name: str) -> float:
    x = recording.values(run, [name])[:, 0]
    return float(np.nanquantile(x, 0.98) - np.nanquantile(x, 0.02))


def _stuck(recording: Recording, rng: np.random.Generator, role: str) -> Planted | None:
    name, run = _choice(recording, rng, role)
    time = recording.time_s(run)
    x = recording.values(run, [name])[:, 0]
    begin = int(rng.uniform(0.15, 0.6) * time.size)
    end = time.size - 1 if rng.random() < 0.5 else begin + int(rng.uniform(0.15, 0.35) * time.size)
    least = 1.5 if role == "temperature" else 8.0
    if np.isnan(x).any() or np.ptp(x[begin : end + 1]) < least:
        return None  # it would not have moved by more than a lag leaves open

    def change(table: pd.DataFrame) -> None:
        table.iloc[begin : end + 1, table.columns.get_loc(name)] = x[begin]

    return Planted(_with(recording, run, change), ("stuck", "saturated"), (name,), run, (time[begin], time[end]))


def _step(recording: Recording, rng: np.random.Generator, role: str) -> Planted:
    name, run = _choice(recording, rng, role)
    time = recording.time_s(run)
    at = int(rng.uniform(0.15, 0.85) * time.size)
    height = float(rng.choice([-1, 1]) * (rng.uniform(1.0, 3.0) if role == "temperature" else rng.uniform(10, 30)))

    def change(table: pd.DataFrame) -> None:
        table.iloc[at:, table.columns.get_loc(name)] += height

    acts = role == "temperature" or bool(recording.with_role("spindle_speed"))
    return Planted(_with(recording, run, change), ("step",), (name,), run, (time[at], time[-1]), acts)


def _spike(recording: Recording, rng: np.random.Generator, role: str) -> Planted:
    name, run = _choice(recording, rng, role)
    time = recording.time_s(run)
    at, width = int(rng.uniform(0.1, 0.9) * time.size), int(rng.integers(1, 4))
    height = float(rng.choice([-1, 1]) * (rng.uniform(2.0, 10.0) if role == "temperature" else rng.uniform(15, 60)))

    def change(table: pd.DataFrame) -> None:
        table.iloc[at : at + width, table.columns.get_loc(name)] += height

    return Planted(_with(recording, run, change), ("spike",), (name,), run, (time[at], time[at + width - 1]))


def _code(recording: Recording, rng: np.random.Generator, role: str) -> Planted:
    name, run = _choice(recording, rng, role)
    time = recording.time_s(run)
    code = float(rng.choice([850.0, -9999.0, 9999.0, -200.0, 3276.7, 32767.0, 327.67, 999.9, 1e30, -127.0]))
    if role == "displacement":
        code = float(rng.choice([-9999.0, 9999.0, 32767.0, 1e30]))
    at = int(rng.uniform(0.1, 0.7) * time.size)
    end = at + int(rng.uniform(1, 0.2 * time.size))

    def change(table: pd.DataFrame) -> None:
        table.iloc[at : end + 1, table.columns.get_loc(name)] = code

    return Planted(_with(recording, run, change), ("sensor-break",), (name,), run, (time[at], time[end]))


def _drift(recording: Recording, rng: np.random.Generator) -> Planted | None:
    """The sensor loosens: its gain towards the machine falls, or it creeps away."""
    name, run = _choice(recording, rng, "temperature")
    if len(recording.runs) < 3 or len(recording.with_role("temperature")) < 4:
        return None
    time = recording.time_s(run)
    at = int(rng.uniform(0.15, 0.5) * time.size)
    size = float(rng.choice([-1, 1]) * rng.uniform(3.0, 6.0))

    def change(table: pd.DataFrame) -> None:
        ramp = np.clip((time[at:] - time[at]) / (0.5 * (time[-1] - time[at])), 0, 1)
        table.iloc[at:, table.columns.get_loc(name)] += size * ramp

    return Planted(_with(recording, run, change), ("drifts-from-group",), (name,), run, (time[at], time[-1]))


def _saturated(recording: Recording, rng: np.random.Generator, role: str) -> Planted | None:
    name, run = _choice(recording, rng, role)
    every = np.concatenate([recording.values(r, [name])[:, 0] for r in recording.runs])
    x = recording.values(run, [name])[:, 0]
    rail = float(np.round(np.nanquantile(x, 0.7), 2))
    if np.nanmax(x) - rail < (1.5 if role == "temperature" else 8.0) or np.isnan(every).any():
        return None
    tables = {r: _table(recording, r) for r in recording.runs}
    for table in tables.values():
        table[name] = np.minimum(table[name], rail)
    whole = Recording.from_runs(tables, recording.channels)
    return Planted(whole, ("saturated", "stuck"), (name,), None, None)


def _duplicate(recording: Recording, rng: np.random.Generator) -> Planted | None:
    names = recording.with_role("temperature")
    a, b = (str(name) for name in rng.choice(names, 2, replace=False))
    if max(_span(recording, run, a) for run in recording.runs) < 2.0:
        return None
    tables = {run: _table(recording, run) for run in recording.runs}
    for table in tables.values():
        table[b] = table[a]
    return Planted(
        Recording.from_runs(tables, recording.channels), ("duplicate-channel",), (a, b), None, None, acts=False
    )


def _swapped(recording: Recording, rng: np.random.Generator) -> Planted | None:
    names = recording.with_role("temperature")
    a, b = (str(name) for name in rng.choice(names, 2, replace=False))
    run = str(rng.choice(recording.runs))
    apart = recording.values(run, [a])[:, 0] - recording.values(run, [b])[:, 0]
    if len(recording.runs) < 3 or len(names) < 5 or np.std(apart) < 1.0:
        return None

    def change(table: pd.DataFrame) -> None:
        table[[a, b]] = table[[b, a]].to_numpy()

    return Planted(_with(recording, run, change), ("swapped-channels",), (a, b), run, None)


def _fahrenheit(recording: Recording, rng: np.random.Generator) -> Planted | None:
    name, run = _choice(recording, rng, "temperature")
    if (
        len(recording.runs) < 2
        or len(recording.with_role("temperature", "ambient")) < 3
        or _span(recording, run, name) < 3
    ):
        return None

    def change(table: pd.DataFrame) -> None:
        table[name] = np.round(1.8 * table[name] + 32, 1)

    return Planted(_with(recording, run, change), ("wrong-unit",), (name,), run, None)


def _kelvin(recording: Recording, rng: np.random.Generator) -> Planted | None:
    name, run = _choice(recording, rng, "temperature")
    if len(recording.runs) < 2:
        return None

    def change(table: pd.DataFrame) -> None:
        table[name] += 273.15

    return Planted(_with(recording, run, change), ("wrong-unit",), (name,), run, None)


def _fahrenheit_run(recording: Recording, rng: np.random.Generator) -> Planted | None:
    run = str(rng.choice(recording.runs))
    names = recording.with_role("temperature", "ambient")
    if len(recording.runs) < 2:
        return None

    def change(table: pd.DataFrame) -> None:
        table[list(names)] = np.round(1.8 * table[list(names)] + 32, 1)

    return Planted(_with(recording, run, change), ("wrong-unit",), names, run, None)


def _millimetre(recording: Recording, rng: np.random.Generator) -> Planted | None:
    name, run = _choice(recording, rng, "displacement")
    if len(recording.runs) < 2 or min(_span(recording, r, name) for r in recording.runs) < 10:
        return None

    def change(table: pd.DataFrame) -> None:
        table[name] = np.round(table[name] / 1000, 4)

    return Planted(_with(recording, run, change), ("wrong-unit",), (name,), run, None)


def _gap(recording: Recording, rng: np.random.Generator) -> Planted:
    name, run = _choice(recording, rng, "temperature")
    time = recording.time_s(run)
    at, length = int(rng.uniform(0.1, 0.7) * time.size), int(rng.uniform(0.03, 0.2) * time.size)

    def change(table: pd.DataFrame) -> None:
        table.iloc[at : at + length, table.columns.get_loc(name)] = np.nan

    return Planted(_with(recording, run, change), ("gap",), (name,), run, None, acts=False)


def _clock(recording: Recording, rng: np.random.Generator) -> Planted | None:
    run = str(rng.choice(recording.runs))
    time = recording.time_s(run)
    at, leap = int(rng.uniform(0.2, 0.8) * time.size), float(rng.choice([3600.0, 1800.0, 5000.0]))
    moving = max(abs(np.polyfit(time[at - 8 : at + 8], recording.values(run, [n])[at - 8 : at + 8, 0], 1)[0]) / (
        0.02 if n.startswith("T") else 0.3) for n in recording.with_role("temperature", "displacement"))  # fmt: skip
    if leap != 3600.0 and moving * leap < 100:
        return None

    def change(table: pd.DataFrame) -> None:
        table.index = pd.Index(np.r_[time[:at], time[at:] + leap])

    return Planted(_with(recording, run, change), ("clock-jump",), (None,), run, None, acts=False)


KINDS: dict[str, Callable[[Recording, np.random.Generator], Planted | None]] = {
    "stuck temperature": lambda r, g: _stuck(r, g, "temperature"),
    "stuck displacement": lambda r, g: _stuck(r, g, "displacement"),
    "step temperature": lambda r, g: _step(r, g, "temperature"),
    "step displacement": lambda r, g: _step(r, g, "displacement"),
    "spike temperature": lambda r, g: _spike(r, g, "temperature"),
    "spike displacement": lambda r, g: _spike(r, g, "displacement"),
    "code temperature": lambda r, g: _code(r, g, "temperature"),
    "code displacement": lambda r, g: _code(r, g, "displacement"),
    "drift": _drift,
    "saturated temperature": lambda r, g: _saturated(r, g, "temperature"),
    "saturated displacement": lambda r, g: _saturated(r, g, "displacement"),
    "duplicate": _duplicate,
    "swapped": _swapped,
    "one channel in °F": _fahrenheit,
    "one channel in K": _kelvin,
    "one run in °F": _fahrenheit_run,
    "one run in mm": _millimetre,
    "missing values": _gap,
    "clock jump": _clock,
}
"""Kind of fault: how it is planted."""
