"""Axes whose simulation lacks what motor, load and loop do: ripple, mass, constant force, delay, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from selector.proof.case import TrueEffect, Window
from selector.proof.drive.friction_and_joints import OWN_VALUE
from selector.proof.drive.recorded import lacking, plus
from selector.proof.drive.true_axis import LENGTH_S, RUNS, STEP_S, Bench, true_motion
from selector.types import Vector

Runs = Mapping[str, Sequence[Vector]]


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


_ripple = partial(lacking, change=plus("ripple_n"), place="motor", first=3.0)
_mass = partial(lacking, change=plus("table_kg"), place="table", verdicts=OWN_VALUE)
_delay = partial(lacking, axis={"feed_forward": 1.0}, place="command", verdicts=OWN_VALUE, first=2.0, prepared=_late)
_limit = partial(lacking, hidden=("rare",), place="drive", first=5.0, prepared=_limited)

DRIVES = (
    _ripple("drive.ripple/cogging", bench={"styles": ("gentle", "strokes", "other")}, axis={"ripple_m": 0.0025}),
    _ripple(
        "drive.ripple/slow",
        bench={"styles": ("gentle", "gentle", "other"), "fastest": 0.1, "coarse_scale": True, "colour": "ar"},
        axis={"ripple_m": 0.010, "ripple_phase": 1.0},
        hidden=("small", "ruled out in E"),
        note="A turn of the motor takes half a second.",
    ),
    _ripple(
        "drive.ripple/force",
        bench={"styles": ("gentle", "sines", "other"), "friction": False, "jitter_s": 0.0},
        axis={"ripple_m": 0.032},
        note="Force and position of a linear motor; nothing else is recorded.",
        world={"names": ("x", "F"), "responses": ("x", "F")},
        channels=("x", "F"),
    ),
    _mass("drive.mass/workpiece", bench={"colour": "ar"}),
    _mass(
        "drive.mass/absorbed",
        bench={"friction": False, "styles": ("strokes", "sines", "gentle")},
        axis={"viscous_ns_per_m": 350.0},
        hidden=("absorbed", "like I"),
        tolerated=("drive.viscous", "data.gain"),
        note="Current goes with acceleration nearly alone, so that its gain takes in most.",
        first=2.0,
    ),
    _mass(
        "drive.mass/ruled-out",
        bench={"coarse_scale": True, "styles": ("strokes", "sines", "strokes"), "colour": "heavy-tailed"},
        hidden=("small", "ruled out in E"),
    ),
    _delay(
        "drive.delay/bus",
        bench={"friction": False},
        note="Speed is fed forward in full: only the delay lags with it.",
    ),
    _delay("drive.delay/rubbing", bench={"styles": ("gentle", "sines", "other"), "colour": "quantised"}),
    _limit("drive.saturation/current", bench={"styles": ("strokes", "strokes", "strokes"), "friction": False}),
    _limit("drive.saturation/rubbing", bench={"styles": ("strokes", "one speed", "strokes"), "colour": "heavy-tailed"}),
    lacking(
        "drive.offset_force/sets-in",
        bench={"friction": False},
        verdicts=("missing-physics", "data-fault"),
        first=3.0,
        prepared=_loaded,
    ),
    lacking(
        "drive.offset_force/brake",
        plus("offset_n"),
        {"friction": False},
        hidden=("absorbed",),
        note="Weight of a slide that is half balanced; the current is 0 while the brake is shut.",
        first=3.0,
        channels=("I",),
        place="table",
        prepared=_braked,
    ),
    lacking(
        "drive.offset_force/constant",
        plus("offset_n"),
        hidden=("absorbed",),
        kind="undecidable",
        verdicts=("missing-physics", "data-fault", "miscalibrated"),
        size=15.0,
        note="A weight in every run: the same as a zero of the current that is off.",
        accept=("drive.offset_force", "data.zero"),
        channels=("I",),
        place="table",
    ),
)
SCENARIOS = tuple(drive.scenario for drive in DRIVES)
