"""Axes whose simulation lacks what motor, load and loop do, or two or three things at once, some of them opposed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from proving_ground.case import TrueEffect, Window
from proving_ground.concealment import like_known, ruled_out
from proving_ground.data.faults import Fault
from proving_ground.drive.friction_and_joints import OWN_VALUE, softer
from proving_ground.drive.recorded import FORCE, Drive, axis_world
from proving_ground.drive.true_axis import LENGTH_S, RUNS, STEP_S, Bench, TrueAxis, true_motion
from proving_ground.world import Change, Prepared, Runs, plus, scenarios_of, size_with
from selector.types import Vector


def _limited(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """A limit of the current that is size × 1 % below the highest that the programme asks for."""
    still = np.zeros(round(LENGTH_S / STEP_S))
    start = bench.machine
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


_ripple = partial(Drive.of, change=plus("ripple_n"), place="motor", first=3.0)
_mass = partial(Drive.of, change=plus("table_kg"), place="table", verdicts=OWN_VALUE)
_late = {"delay_s": lambda size: 1e-6 * size}
_delay = partial(Drive.of, start={"feed_forward": 1.0}, place="command", verdicts=OWN_VALUE, first=2.0, world=_late)
_limit = partial(Drive.of, hidden=("rare",), place="drive", first=5.0, prepared=_limited)

DRIVES = (
    _ripple("drive.ripple/cogging", bench={"styles": ("gentle", "strokes", "other")}, start={"ripple_m": 0.0025}),
    _ripple(
        "drive.ripple/slow",
        bench={"styles": ("gentle", "gentle", "other"), "fastest": 0.1, "coarse_scale": True, "colour": "ar"},
        start={"ripple_m": 0.010, "ripple_phase": 1.0},
        hidden=("small", ruled_out("E")),
        note="A turn of the motor takes half a second.",
    ),
    _ripple(
        "drive.ripple/force",
        bench={"styles": ("gentle", "sines", "other"), "friction": False, "jitter_s": 0.0},
        start={"ripple_m": 0.032},
        note="Force and position of a linear motor; nothing else is recorded.",
        world=FORCE,
        channels=("x", "F"),
    ),
    _mass("drive.mass/workpiece", bench={"colour": "ar"}),
    _mass(
        "drive.mass/absorbed",
        bench={"friction": False, "styles": ("strokes", "sines", "gentle")},
        start={"viscous_ns_per_m": 350.0},
        hidden=("absorbed", like_known("I")),
        tolerated=("drive.viscous", "data.gain"),
        note="Current goes with acceleration nearly alone, so that its gain takes in most.",
        first=2.0,
    ),
    _mass(
        "drive.mass/ruled-out",
        bench={"coarse_scale": True, "styles": ("strokes", "sines", "strokes"), "colour": "heavy-tailed"},
        hidden=("small", ruled_out("E")),
    ),
    _delay(
        "drive.delay/bus", bench={"friction": False}, note="Speed is fed forward in full: only the delay lags with it."
    ),
    _delay("drive.delay/rubbing", bench={"styles": ("gentle", "sines", "other"), "colour": "quantised"}),
    _limit("drive.saturation/current", bench={"styles": ("strokes", "strokes", "strokes"), "friction": False}),
    _limit("drive.saturation/rubbing", bench={"styles": ("strokes", "one speed", "strokes"), "colour": "heavy-tailed"}),
    Drive.of(
        "drive.offset_force/sets-in",
        bench={"friction": False},
        verdicts=("missing-physics", "data-fault"),
        first=3.0,
        prepared=_loaded,
    ),
    Drive.of(
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
    Drive.of(
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


_UNIT_D_PRIME = 8.0


@dataclass(frozen=True)
class Part:
    """One of several effects: id, change of the axis, a first size, where it shows; or a fault that is drawn."""

    id: str
    change: Change | None = None
    first: float = 1.0
    channels: tuple[str, ...] = ("E", "I")
    place: str | None = "guide"
    sign: float = 1.0
    drawing: Callable[[np.random.Generator], Fault] | None = None


def together(*parts: Part) -> Prepared:
    """What `Drive.prepared` needs: the parts, each scaled so that alone it has the same strength at size 1."""
    everything = tuple(range(len(parts)))

    def prepared(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
        sizes = [part.sign for part in parts]
        faults: dict[int, tuple[int, Fault]] = {}
        for k, part in enumerate(parts):
            if part.drawing is not None:
                faults[k] = int(generator.integers(0, 2)), part.drawing(generator)

        def true(acting: tuple[int, ...], size: float) -> TrueAxis:
            axis = bench.machine
            for k in acting:
                change = parts[k].change
                axis = change(axis, size * sizes[k]) if size and change is not None else axis
            return axis

        def read(acting: tuple[int, ...], courses: Runs, size: float) -> Runs:
            for k, (run, fault) in faults.items():
                if k in acting:
                    courses = fault.read(bench.stamps, parts[k].channels, (run,))(courses, size * sizes[k])
            return courses

        def arguments(*acting: int) -> dict[str, Any]:
            return {"true": partial(true, acting), "recorded_as": partial(read, acting)}

        def effects(size: float) -> tuple[TrueEffect, ...]:
            windows = {k: fault.windows((run,), size * sizes[k]) for k, (run, fault) in faults.items()}
            told = enumerate(parts)
            return tuple(TrueEffect(one.id, (one.id,), one.channels, one.place, windows.get(k, ())) for k, one in told)

        alone = [axis_world(bench, **arguments(k), first=part.first) for k, part in enumerate(parts)]
        sizes[:] = [part.sign * size_with(world, _UNIT_D_PRIME) for part, world in zip(parts, alone, strict=True)]
        lacking = tuple(arguments(*(other for other in everything if other != k)) for k in everything)
        return {**arguments(*everything), "effects": effects, "lacking": lacking}

    return prepared


def _several(name: str, parts: Sequence[Part], *bench_and_start: Mapping[str, Any], note: str = "") -> Drive:
    return Drive.of(
        f"drive.several/{name}",
        None,
        *bench_and_start,
        first=0.3,
        kind="several",
        note=note,
        id="several",
        prepared=together(*parts),
    )


_COULOMB = Part("drive.coulomb", plus("coulomb_n"), 2.0)
_PLAY = Part("drive.backlash", plus("play_m", 1e-6), 0.15, ("E",), "screw")
_RIPPLE = Part("drive.ripple", plus("ripple_n"), 4.0, ("E", "I"), "motor")
_LEAD = Part("drive.pitch_error", plus("lead_m", 1e-6), 0.1, ("E",), "screw")
_ELASTIC = Part("drive.elasticity", softer(1e-10), 2.0, ("E",), "screw")
_POSITION = Part("drive.varying_damping", plus("viscous_by_position_per_m"), 0.5)
_DIRECTION = Part("drive.asymmetric_friction", plus("viscous_by_direction"), 0.02)
_MASS = Part("drive.mass", plus("table_kg"), 1.0, ("E", "I"), "table", sign=-1.0)

SEVERAL = (
    _several("coulomb+lead", (_COULOMB, _LEAD), {"friction": False, "on_scale": False}),
    _several("play+ripple", (_PLAY, _RIPPLE), {"on_scale": False}, {"ripple_m": 0.003}),
    _several("play+elasticity", (_PLAY, _ELASTIC), {"on_scale": False, "colour": "ar"}),
    _several(
        "position+direction",
        (_POSITION, _DIRECTION),
        {"friction": False, "fastest": 0.2, "styles": ("strokes", "sines", "strokes")},
        {"viscous_ns_per_m": 700.0},
    ),
    _several(
        "mass-coulomb",
        (_MASS, _COULOMB),
        {"friction": False, "styles": ("strokes", "sines", "other")},
        note="The table is lighter than simulated and rubs: opposing signs during acceleration.",
    ),
    _several(
        "triple",
        (_COULOMB, _PLAY, _RIPPLE),
        {"on_scale": False, "styles": ("strokes", "gentle", "other")},
        {"ripple_m": 0.004},
    ),
)
SCENARIOS = scenarios_of(drive.case for drive in (*DRIVES, *SEVERAL))
