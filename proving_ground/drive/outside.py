"""Axes with what no catalogue knows: chatter, slipping belts, sticking chains, shocks through the floor, cross-talk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from proving_ground.case import Window
from proving_ground.drive.recorded import Drive
from proving_ground.drive.true_axis import LENGTH_S, RUNS, Bench
from proving_ground.world import scenarios_of
from selector.types import Vector

Course = Callable[[Vector], Vector]
Drawn = tuple[list[Course], tuple[Window, ...]]
"""A course of time [s] for every run, and when it acts."""


def _moments(generator: np.random.Generator, least: int, most: int) -> Vector:
    return np.sort(generator.uniform(0.4, LENGTH_S - 0.6, int(generator.integers(least, most))))


def _events(
    generator: np.random.Generator,
    count: tuple[int, int],
    drawn: Callable[[int], tuple[Vector, ...]],
    shape: Callable[..., Vector],
) -> Drawn:
    """Events at random moments of every run, in number from the one of `count` to before the other.

    `drawn` gives numbers of so many events, first how long they last [s]; `shape` a course of the time since the event.
    """
    courses: list[Course] = []
    windows: list[Window] = []
    for run in RUNS:
        starts = _moments(generator, *count)
        events = list(zip(starts, *drawn(len(starts)), strict=True))
        courses.append(partial(_summed, events, shape))
        windows += [Window(run, float(start), float(start + lasts)) for start, lasts, *_ in events]
    return courses, tuple(windows)


def _summed(events: Sequence[tuple[Any, ...]], shape: Callable[..., Vector], time_s: Vector) -> Vector:
    total = np.zeros_like(time_s)
    for start, *numbers in events:
        total += shape(time_s - start, *numbers)
    return total


def chatter(generator: np.random.Generator) -> Drawn:
    """Bursts of a tone that is another each time [share of the size]."""
    draw = generator.uniform

    def burst(since_s: Vector, length: float, tone: float) -> Vector:
        inside = np.clip(since_s / length, 0.0, 1.0)
        return np.asarray(np.sin(np.pi * inside) ** 2 * np.sin(2.0 * np.pi * tone * since_s))

    return _events(generator, (4, 8), lambda n: (draw(0.08, 0.3, n), draw(18.0, 60.0, n)), burst)


def slips(generator: np.random.Generator) -> Drawn:
    """Sudden steps to either side at random moments, back to the middle as a rule."""

    def drawn() -> Course:
        moments = _moments(generator, 9, 15)
        places = np.r_[0.0, generator.standard_normal(len(moments))]
        return lambda time_s: np.asarray(places[np.searchsorted(moments, time_s)])

    return [drawn() for _ in RUNS], ()


def sticking(generator: np.random.Generator) -> Drawn:
    """A pull that grows for a while and lets go, at random moments, to either side."""

    def drawn(n: int) -> tuple[Vector, Vector]:
        lengths = generator.uniform(0.15, 0.5, n)
        return lengths, generator.uniform(0.5, 1.0, n) * generator.choice([-1.0, 1.0], n)

    def growing(since_s: Vector, length: float, pull: float) -> Vector:
        share = since_s / length
        return np.asarray(pull * np.where((share > 0.0) & (share < 1.0), share, 0.0))

    return _events(generator, (3, 6), drawn, growing)


def thermostat(generator: np.random.Generator) -> Drawn:
    """A sawtooth whose period wanders: a heater in the amplifier switches."""

    def drawn() -> Course:
        turns = np.cumsum(generator.uniform(0.25, 0.9, 40)) - generator.uniform(0.0, 1.0)
        heights = np.where(np.arange(40) % 2 == 0, -1.0, 1.0) * generator.uniform(0.7, 1.3, 40)
        return lambda time_s: np.interp(time_s, turns, heights)

    return [drawn() for _ in RUNS], ()


def shocks(generator: np.random.Generator) -> Drawn:
    """A press in the next bay: swings that die away, at random moments."""
    tone, fades = generator.uniform(9.0, 25.0), generator.uniform(0.06, 0.15)

    def swing(since_s: Vector, lasts: float, size: float) -> Vector:
        since = np.clip(since_s, 0.0, None)
        return np.asarray(size * np.exp(-since / fades) * np.sin(2.0 * np.pi * tone * since))

    return _events(generator, (4, 9), lambda n: (np.full(n, 2.5 * fades), generator.uniform(0.5, 1.5, n)), swing)


def crosstalk(generator: np.random.Generator) -> Drawn:
    """The square of a signal that nobody recorded: narrow-band, from another machine's supply."""
    knots = np.arange(0.0, LENGTH_S + 1.0, 0.12)

    def drawn() -> Course:
        heights = generator.standard_normal(len(knots))
        return lambda time_s: np.interp(time_s, knots, heights) ** 2

    return [drawn() for _ in RUNS], ()


def _outside(
    name: str,
    drawn: Callable[[np.random.Generator], Drawn],
    enters: str,
    channels: tuple[str, ...],
    first: float,
    note: str,
    tolerated: tuple[str, ...] = (),
    **bench: Any,
) -> Drive:
    def prepared(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
        courses, windows = drawn(generator)
        arguments: dict[str, Any] = {"windows": windows}
        if enters == "current":
            arguments["recorded_as"] = lambda runs, size: {
                channel: [
                    part + (size * courses[k](bench.stamps[k]) if channel == "I" else 0.0)
                    for k, part in enumerate(parts)
                ]
                for channel, parts in runs.items()
            }
        else:
            arguments[enters] = lambda run, time_s, size: size * courses[run](time_s)
        return arguments

    return Drive.of(
        f"hidden.drive/{name}",
        None,
        bench,
        first=first,
        kind="out-of-catalogue",
        tolerated=tolerated,
        note=note,
        id=f"hidden.{name}",
        channels=channels,
        prepared=prepared,
    )


DRIVES = (
    _outside("chatter", chatter, "force", ("E", "I"), 20.0, "Bursts of tones, each another, on the table."),
    _outside("belt-slip", slips, "shift", ("E",), 0.3, "The belt slips at random.", ("data.step",), on_scale=False),
    _outside("chain-sticks", sticking, "force", ("E", "I"), 20.0, "The cable chain catches and lets go at random."),
    _outside("thermostat", thermostat, "shift", ("E",), 0.3, "A heater in the amplifier switches, its period wanders."),
    _outside("floor-shocks", shocks, "shift", ("E",), 0.3, "A press in the next bay shakes the scale at random."),
    _outside(
        "crosstalk", crosstalk, "current", ("I",), 0.1, "The square of an unrecorded signal leaks into the current."
    ),
)
SCENARIOS = scenarios_of(drive.case for drive in DRIVES)
