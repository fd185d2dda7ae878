"""Axes with what no catalogue knows: chatter, slipping belts, sticking chains, shocks through the floor, cross-talk."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from selector.proof.case import TrueEffect, Window
from selector.proof.drive.machine import LENGTH_S, RUNS, Bench
from selector.proof.drive.recorded import Drive, plan
from selector.proof.world import HIDDEN_FACTOR
from selector.types import Vector

Course = Callable[[Vector], Vector]
Drawn = tuple[list[Course], tuple[Window, ...]]
"""A course of time [s] for every run, and when it acts."""


def _held(moments: Vector, places: Vector, time_s: Vector) -> Vector:
    return np.asarray(places[np.searchsorted(moments, time_s)])


def _joined(turns: Vector, heights: Vector, time_s: Vector) -> Vector:
    return np.interp(time_s, turns, heights)


def _squared(knots: Vector, heights: Vector, time_s: Vector) -> Vector:
    return np.interp(time_s, knots, heights) ** 2


def _moments(generator: np.random.Generator, least: int, most: int) -> Vector:
    return np.sort(generator.uniform(0.4, LENGTH_S - 0.6, int(generator.integers(least, most))))


def chatter(generator: np.random.Generator) -> Drawn:
    """Bursts of a tone that is another each time [share of the size]."""
    courses: list[Course] = []
    windows: list[Window] = []
    for run in RUNS:
        starts = _moments(generator, 4, 8)
        lengths = generator.uniform(0.08, 0.3, len(starts))
        tones = generator.uniform(18.0, 60.0, len(starts))

        def course(time_s: Vector, starts: Vector = starts, lengths: Vector = lengths, tones: Vector = tones) -> Vector:
            total = np.zeros_like(time_s)
            for start, length, tone in zip(starts, lengths, tones, strict=True):
                inside = np.clip((time_s - start) / length, 0.0, 1.0)
                total += np.sin(np.pi * inside) ** 2 * np.sin(2.0 * np.pi * tone * (time_s - start))
            return total

        courses.append(course)
        windows += [Window(run, float(a), float(a + b)) for a, b in zip(starts, lengths, strict=True)]
    return courses, tuple(windows)


def slips(generator: np.random.Generator) -> Drawn:
    """Sudden steps to either side at random moments, back to the middle as a rule."""
    courses: list[Course] = []
    for _ in RUNS:
        moments = _moments(generator, 9, 15)
        places = generator.standard_normal(len(moments))
        courses.append(partial(_held, moments, np.r_[0.0, places]))
    return courses, ()


def sticking(generator: np.random.Generator) -> Drawn:
    """A pull that grows for a while and lets go, at random moments, to either side."""
    courses: list[Course] = []
    windows: list[Window] = []
    for run in RUNS:
        starts = _moments(generator, 3, 6)
        lengths = generator.uniform(0.15, 0.5, len(starts))
        pulls = generator.uniform(0.5, 1.0, len(starts)) * generator.choice([-1.0, 1.0], len(starts))

        def course(time_s: Vector, starts: Vector = starts, lengths: Vector = lengths, pulls: Vector = pulls) -> Vector:
            total = np.zeros_like(time_s)
            for start, length, pull in zip(starts, lengths, pulls, strict=True):
                share = (time_s - start) / length
                total += pull * np.where((share > 0.0) & (share < 1.0), share, 0.0)
            return total

        courses.append(course)
        windows += [Window(run, float(a), float(a + b)) for a, b in zip(starts, lengths, strict=True)]
    return courses, tuple(windows)


def thermostat(generator: np.random.Generator) -> Drawn:
    """A sawtooth whose period wanders: a heater in the amplifier switches."""
    courses: list[Course] = []
    for _ in RUNS:
        turns = np.cumsum(generator.uniform(0.25, 0.9, 40)) - generator.uniform(0.0, 1.0)
        heights = np.where(np.arange(40) % 2 == 0, -1.0, 1.0) * generator.uniform(0.7, 1.3, 40)
        courses.append(partial(_joined, turns, heights))
    return courses, ()


def shocks(generator: np.random.Generator) -> Drawn:
    """A press in the next bay: swings that die away, at random moments."""
    courses: list[Course] = []
    windows: list[Window] = []
    tone, fades = generator.uniform(9.0, 25.0), generator.uniform(0.06, 0.15)
    for run in RUNS:
        starts = _moments(generator, 4, 9)
        sizes = generator.uniform(0.5, 1.5, len(starts))

        def course(time_s: Vector, starts: Vector = starts, sizes: Vector = sizes) -> Vector:
            total = np.zeros_like(time_s)
            for start, size in zip(starts, sizes, strict=True):
                since = np.clip(time_s - start, 0.0, None)
                total += size * np.exp(-since / fades) * np.sin(2.0 * np.pi * tone * since)
            return total

        courses.append(course)
        windows += [Window(run, float(a), float(a + 2.5 * fades)) for a in starts]
    return courses, tuple(windows)


def crosstalk(generator: np.random.Generator) -> Drawn:
    """The square of a signal that nobody recorded: narrow-band, from another machine's supply."""
    courses: list[Course] = []
    for _ in RUNS:
        knots = np.arange(0.0, LENGTH_S + 1.0, 0.12)
        heights = generator.standard_normal(len(knots))
        courses.append(partial(_squared, knots, heights))
    return courses, ()


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
        effect = TrueEffect(f"hidden.{name}", (f"hidden.{name}",), channels, None, windows)
        arguments: dict[str, Any] = {"effects": lambda size: (effect,)}
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

    made = plan(
        f"hidden.drive/{name}",
        (),
        kind="out-of-catalogue",
        verdicts=("unexplained",),
        factor=HIDDEN_FACTOR,
        tolerated=tolerated,
        note=note,
    )
    return Drive(made, f"hidden.{name}", None, bench, world={"first": first}, prepared=prepared)


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
SCENARIOS = tuple(drive.scenario for drive in DRIVES)
