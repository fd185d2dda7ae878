"""Axes whose simulation lacks what motor, load and loop do: ripple, mass, constant force, delay, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from selector.proof.case import TrueEffect, Window
from selector.proof.drive.machine import LENGTH_S, RUNS, Bench
from selector.proof.drive.recorded import Drive, plan, plus
from selector.proof.drive.true_axis import STEP_S, TrueAxis, true_motion
from selector.types import Vector

Runs = Mapping[str, Sequence[Vector]]

_OWN_VALUE = ("missing-physics", "miscalibrated")
"""A value of the simulation that is wrong may be called either."""


def _late(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """The command arrives late, by size microseconds."""
    return {"delay_s": lambda size: 1e-6 * size}


def _limited(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """A limit of the current that is size × 1 % below the highest that the programme asks for."""
    still = np.zeros(round(LENGTH_S / STEP_S))
    start = bench.axis
    currents = [true_motion(start, command, still)[3] for command in bench.commands]
    # the loop asks for more than the current that follows it with a lag
    asked = [amps + start.current_lag_s * np.gradient(amps, STEP_S) for amps in currents]
    peak = max(float(np.abs(course).max()) for course in asked[:-1])
    return {"true": lambda size: start._replace(limit_a=peak / (1.0 + 0.01 * size)) if size else start}


def _loaded(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """A constant force that sets in during the second run and stays: a counterweight that lets go."""
    onset = float(generator.uniform(2.0, 4.5))

    def force(run: int, time_s: Vector, size: float) -> Vector:
        if run == 0:
            return np.zeros_like(time_s)
        return size * np.where(time_s > onset, 1.0, 0.0) if run == 1 else np.full_like(time_s, size)

    def effects(size: float) -> tuple[TrueEffect, ...]:
        window = Window(RUNS[1], onset, LENGTH_S - 0.05)
        accept = ("drive.offset_force", "data.step")
        windows = (window, Window(RUNS[2], 0.0, LENGTH_S))
        return (TrueEffect("drive.offset_force", accept, ("E", "I"), "table", windows),)

    return {"force": force, "effects": effects}


def _braked(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """The brake is shut, and the current off, at the beginning of every run and again at its end."""
    draw = generator.uniform
    shut = [(float(draw(0.1, 0.22)), LENGTH_S - float(draw(0.12, 0.22))) for _ in bench.commands]

    def opened(courses: Runs, times: Sequence[Vector], *, states: bool) -> Runs:
        result = {name: list(parts) for name, parts in courses.items()}
        for k, time in enumerate(times):
            is_open = (time >= shut[k][0]) & (time < shut[k][1])
            result["I"][k] = np.where(is_open, result["I"][k], 0.0)
            if states:
                result["brake"][k] = is_open.astype(float)
        return result

    return {
        "recorded_as": lambda courses, size: opened(courses, bench.stamps, states=True),
        "simulated_as": lambda courses, times: opened(courses, times, states=False),
        "names": ("r", "v", "E", "I", "brake"),
    }


def _heavier(axis: TrueAxis, size: float) -> TrueAxis:
    return axis._replace(table_kg=axis.table_kg + size)


DRIVES = (
    Drive(
        plan("drive.ripple/cogging"),
        "drive.ripple",
        plus("ripple_n"),
        {"styles": ("gentle", "strokes", "other")},
        {"ripple_m": 0.0025},
        world={"first": 3.0},
        place="motor",
    ),
    Drive(
        plan("drive.ripple/slow", ("small", "ruled out in E"), note="A turn of the motor takes half a second."),
        "drive.ripple",
        plus("ripple_n"),
        {"styles": ("gentle", "gentle", "other"), "fastest": 0.1, "coarse_scale": True, "colour": "ar"},
        {"ripple_m": 0.010, "ripple_phase": 1.0},
        world={"first": 3.0},
        place="motor",
    ),
    Drive(
        plan("drive.ripple/force", note="Force and position of a linear motor; nothing else is recorded."),
        "drive.ripple",
        plus("ripple_n"),
        {"styles": ("gentle", "sines", "other"), "friction": False, "jitter_s": 0.0},
        {"ripple_m": 0.032},
        world={"first": 3.0, "names": ("x", "F"), "responses": ("x", "F")},
        channels=("x", "F"),
        place="motor",
    ),
    Drive(
        plan("drive.mass/workpiece", verdicts=_OWN_VALUE),
        "drive.mass",
        _heavier,
        {"colour": "ar"},
        world={"first": 1.0},
        place="table",
    ),
    Drive(
        plan(
            "drive.mass/absorbed",
            ("absorbed", "like I"),
            verdicts=_OWN_VALUE,
            tolerated=("drive.viscous", "data.gain"),
            note="Current goes with acceleration nearly alone, so that its gain takes in most.",
        ),
        "drive.mass",
        _heavier,
        {"friction": False, "styles": ("strokes", "sines", "gentle")},
        {"viscous_ns_per_m": 350.0},
        world={"first": 2.0},
        place="table",
    ),
    Drive(
        plan("drive.mass/ruled-out", ("small", "ruled out in E"), verdicts=_OWN_VALUE),
        "drive.mass",
        _heavier,
        {"coarse_scale": True, "styles": ("strokes", "sines", "strokes"), "colour": "heavy-tailed"},
        world={"first": 1.0},
        place="table",
    ),
    Drive(
        plan("drive.delay/bus", verdicts=_OWN_VALUE, note="Speed is fed forward in full: only the delay lags with it."),
        "drive.delay",
        None,
        {"friction": False},
        {"feed_forward": 1.0},
        world={"first": 2.0},
        place="command",
        prepared=_late,
    ),
    Drive(
        plan("drive.delay/rubbing", verdicts=_OWN_VALUE),
        "drive.delay",
        None,
        {"styles": ("gentle", "sines", "other"), "colour": "quantised"},
        {"feed_forward": 1.0},
        world={"first": 2.0},
        place="command",
        prepared=_late,
    ),
    Drive(
        plan("drive.saturation/current", ("rare",)),
        "drive.saturation",
        None,
        {"styles": ("strokes", "strokes", "strokes"), "friction": False},
        world={"first": 5.0},
        place="drive",
        prepared=_limited,
    ),
    Drive(
        plan("drive.saturation/rubbing", ("rare",)),
        "drive.saturation",
        None,
        {"styles": ("strokes", "one speed", "strokes"), "colour": "heavy-tailed"},
        world={"first": 5.0},
        place="drive",
        prepared=_limited,
    ),
    Drive(
        plan("drive.offset_force/sets-in", verdicts=("missing-physics", "data-fault")),
        "drive.offset_force",
        None,
        {"friction": False},
        world={"first": 3.0},
        prepared=_loaded,
    ),
    Drive(
        plan(
            "drive.offset_force/brake",
            ("absorbed",),
            note="Weight of a slide that is half balanced; the current is 0 while the brake is shut.",
        ),
        "drive.offset_force",
        plus("offset_n"),
        {"friction": False},
        world={"first": 3.0},
        channels=("I",),
        place="table",
        prepared=_braked,
    ),
    Drive(
        replace(
            plan("drive.offset_force/constant", ("absorbed",), kind="undecidable"),
            verdicts=("missing-physics", "data-fault", "miscalibrated"),
            size=15.0,
            note="A weight in every run: the same as a zero of the current that is off.",
        ),
        "drive.offset_force",
        plus("offset_n"),
        {},
        accept=("drive.offset_force", "data.zero"),
        channels=("I",),
        place="table",
    ),
)
SCENARIOS = tuple(drive.scenario for drive in DRIVES)
