"""Structures whose simulation lacks a source, a resonance, a member's answer, or a spring that is not linear."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from selector.proof.case import TrueEffect, Window
from selector.proof.vibration.excitation import LENGTH_S, RUNS, Bench, bench, swinging
from selector.proof.vibration.structure import Structure
from selector.proof.world import HIDDEN_FACTOR, Plan, World, scenario, twin
from selector.types import Vector

Change = Callable[[Structure, float], Structure]
Force = Callable[[int, Vector, float], Vector]
Drawing = Callable[[Bench, np.random.Generator], tuple[Force, tuple[Window, ...]]]


@dataclass(frozen=True)
class Swing:
    """A scenario of vibration: what is right, and a change of the structure by size or a force unknown to all."""

    plan: Plan
    id: str
    change: Change | None = None  #: (structure, size) -> structure, or None
    drawing: Drawing | None = None  #: (bench, generator) -> (force, windows), or None
    #: bench and world: Arguments of `selector.proof.vibration.excitation.bench` and of `swinging`
    bench: Mapping[str, Any] = field(default_factory=dict)
    world: Mapping[str, Any] = field(default_factory=dict)
    #: accept, channels and place: Of the true effect
    accept: tuple[str, ...] = ()
    channels: tuple[str, ...] = ("y",)
    place: str | None = "spindle nose"
    #: Parameters of the structure that are set whatever was drawn
    start: Mapping[str, float] = field(default_factory=dict)
    rival: tuple[Drawing, float] | None = None  #: Which this record does not tell from the true one

    def made(self, generator: np.random.Generator) -> World:
        """The world of this scenario with what the generator draws."""
        drawn = bench(generator, **self.bench)
        plain = drawn.structure._replace(**self.start)
        change = self.change
        windows: tuple[Window, ...] = ()
        arguments: dict[str, Any] = {
            "true": lambda size: change(plain, size) if change is not None and size else plain,
        }
        if self.drawing is not None:
            arguments["force"], windows = self.drawing(drawn, generator)
        effect = TrueEffect(self.id, self.accept or (self.id,), self.channels, self.place, windows)
        effects = (effect,) if self.id else ()
        arguments |= self.world
        if self.rival is not None:
            other = arguments | {"force": self.rival[0](drawn, generator)[0], "first": self.rival[1]}
            arguments["rival"] = swinging(drawn, lambda size: (), **other)
        return swinging(drawn, lambda size: effects, **arguments)

    @property
    def scenario(self) -> Any:
        """Cases of any strength."""
        return scenario(self.plan, self.made, has_strength=bool(self.id) and not self.plan.size)


def plan(name: str, hidden: tuple[str, ...] = ("small",), **rest: Any) -> Plan:
    """A plan of the vibration family."""
    return Plan(name, **{"family": "vibration", "kind": "single", "hidden": hidden} | rest)


def line(low_hz: float, high_hz: float) -> Drawing:
    """A pump or a fan at a fixed frequency, in every run from another phase on."""

    def drawing(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
        tone, phases = generator.uniform(low_hz, high_hz), generator.uniform(0.0, 2 * np.pi, len(RUNS))
        return lambda run, time_s, size: size * np.sin(2 * np.pi * tone * time_s + phases[run]), ()

    return drawing


def imbalance(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A mass on the spindle that nobody balanced."""

    def force(run: int, time_s: Vector, size: float) -> Vector:
        turning = bench.speeds[run] * 2 * np.pi / 60.0
        return np.asarray(size * 1e-5 * turning**2 * np.cos(bench.angles[run] + bench.angle))

    return force, ()


def at_the_speed(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A line that happens to lie at the one speed of all runs."""
    tone = bench.speeds[0][0] / 60.0
    return lambda run, time_s, size: size * np.cos(2 * np.pi * tone * time_s + bench.angle), ()


def tuned(key: str, unit: float) -> Change:
    """The change that adds size × `unit` to a parameter."""
    return lambda structure, size: structure._replace(**{key: getattr(structure, key) + size * unit})


def with_mode(structure: Structure, size: float) -> Structure:
    """A mode that the force excites too; its share grows with size."""
    return structure._replace(mode_kg=structure.mass_kg * 100.0 / size)


def rubbing(structure: Structure, size: float) -> Structure:
    """Joints that slip: springs in parallel with the first, size per cent of its stiffness."""
    return structure._replace(sliders_n_per_m=0.01 * size * structure.stiffness_n_per_m)


def _impacts(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A loose part knocks at random."""
    moments = [np.sort(generator.uniform(0.1, LENGTH_S - 0.15, int(generator.integers(5, 10)))) for _ in RUNS]
    sizes = [generator.uniform(0.4, 1.6, len(part)) * generator.choice([-1.0, 1.0], len(part)) for part in moments]

    def force(run: int, time_s: Vector, size: float) -> Vector:
        total = np.zeros_like(time_s)
        for moment, height in zip(moments[run], sizes[run], strict=True):
            total += height * np.exp(-0.5 * ((time_s - moment) / 8e-4) ** 2)
        return size * total

    return force, tuple(
        Window(run, float(m), float(m) + 0.12) for run, part in zip(RUNS, moments, strict=True) for m in part
    )


def _whine(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A source whose pitch wanders by itself over a third of an octave and more."""
    pitches = [generator.uniform(60.0, 130.0, 8) for _ in RUNS]

    def force(run: int, time_s: Vector, size: float) -> Vector:
        pitch = np.interp(time_s, np.linspace(0.0, LENGTH_S, 8), pitches[run])
        return np.asarray(size * np.sin(2 * np.pi * np.cumsum(pitch) * (time_s[1] - time_s[0])))

    return force, ()


def _chatter(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A cut that begins to sing for a while, each time at another pitch."""
    starts = [np.sort(generator.uniform(0.1, LENGTH_S - 0.3, 4)) for _ in RUNS]
    lengths = [generator.uniform(0.06, 0.16, 4) for _ in RUNS]
    tones = [generator.uniform(55.0, 140.0, 4) for _ in RUNS]

    def force(run: int, time_s: Vector, size: float) -> Vector:
        total = np.zeros_like(time_s)
        for start, length, tone in zip(starts[run], lengths[run], tones[run], strict=True):
            inside = np.clip((time_s - start) / length, 0.0, 1.0)
            total += inside * np.sin(np.pi * inside) * np.sin(2 * np.pi * tone * time_s)
        return size * total

    return force, tuple(
        Window(RUNS[run], float(a), float(a + b) + 0.05)
        for run in range(len(RUNS))
        for a, b in zip(starts[run], lengths[run], strict=True)
    )


def _outside(name: str, drawing: Drawing, first: float, note: str) -> Swing:
    made = plan(
        f"hidden.vibration/{name}",
        (),
        kind="out-of-catalogue",
        verdicts=("unexplained",),
        factor=HIDDEN_FACTOR,
        note=note,
    )
    return Swing(made, f"hidden.{name}", None, drawing, world={"first": first})


def _clean(name: str, note: str = "", world: Mapping[str, Any] | None = None, **bench: Any) -> Swing:
    made = plan(f"clean.vibration/{name}", (), kind="clean", verdicts=("nothing-missing",), note=note)
    return Swing(made, "", bench=bench, world=world or {})


def _lacking(name: str, change: Change | None = None, *, hidden: tuple[str, ...] = ("small",), **rest: Any) -> Swing:
    """The effect before the slash of the name is missing; `rest` are further fields of `Plan` and `Swing`."""
    planned = plan(name, hidden, **{key: rest.pop(key) for key in list(rest) if key in Plan.__dataclass_fields__})
    return Swing(planned, name.partition("/")[0], change, **rest)


_TWO: Mapping[str, Any] = {"names": ("F", "n", "y", "z"), "responses": ("y", "z")}
_ACCELERATION: Mapping[str, Any] = {"names": ("F", "n", "a"), "responses": ("a",)}
_BALANCED = {"imbalance": False}
_back_reaction = partial(
    _lacking,
    change=tuned("back", 0.01),
    hidden=("absorbed",),
    tolerated=("vibration.mode",),
    channels=("y", "z"),
    place="between spindle nose and workpiece",
)
SWINGS: Sequence[Swing] = (
    _lacking("vibration.line/pump", drawing=line(85.0, 110.0)),
    _lacking(
        "vibration.line/off-resonance",
        drawing=line(20.0, 40.0),
        bench={"colour": "ar", "speeds": ("run-up", "steps", "run-up")},
        world={"first": 2.0},
    ),
    _lacking(
        "vibration.line/acceleration",
        drawing=line(120.0, 190.0),
        bench={"colour": "heavy-tailed"},
        world=_ACCELERATION,
        channels=("a",),
    ),
    _lacking("vibration.imbalance/steps", drawing=imbalance, bench=_BALANCED),
    _lacking(
        "vibration.imbalance/run-up",
        drawing=imbalance,
        bench={**_BALANCED, "speeds": ("run-up", "run-up", "steps")},
        hidden=("absorbed",),
        note="Only while the speed passes the resonance it is seen.",
    ),
    _lacking(
        "vibration.imbalance/quiet",
        drawing=imbalance,
        bench={**_BALANCED, "level": 0.2, "colour": "ar"},
        note="The shaker hardly shakes.",
    ),
    _lacking("vibration.mode/above", with_mode, bench=_BALANCED, start={"mode_hz": 142.0}),
    _lacking("vibration.mode/between", with_mode, bench={"colour": "ar", **_BALANCED}, start={"mode_hz": 100.0}),
    _lacking(
        "vibration.mode/acceleration",
        with_mode,
        bench={"colour": "quantised", **_BALANCED},
        world=_ACCELERATION,
        channels=("a",),
        start={"mode_hz": 130.0},
    ),
    _back_reaction("vibration.back_reaction/two", world=_TWO),
    _back_reaction(
        "vibration.back_reaction/refitted", bench={"colour": "heavy-tailed"}, world={**_TWO, "refitted": True}
    ),
    _lacking("vibration.hardening/small", tuned("hardening_per_m2", 1e8), world={"first": 3.0}),
    _lacking(
        "vibration.hardening/absorbed",
        tuned("hardening_per_m2", 1e8),
        bench={"level": 1.5, "colour": "ar"},
        world={"first": 3.0, "refitted": True},
        hidden=("small", "absorbed"),
        note="Stiffness and damping were fitted to it.",
    ),
    _lacking(
        "vibration.hysteresis/absorbed",
        rubbing,
        bench={"level": 1.5},
        world={"refitted": True},
        hidden=("small", "absorbed"),
        note="Stiffness and damping were fitted to it.",
        start={"slip_m": 2e-6},
    ),
    _lacking(
        "vibration.hysteresis/refitted",
        rubbing,
        bench={"colour": "heavy-tailed", **_BALANCED},
        world={"refitted": True},
        start={"slip_m": 1e-6},
    ),
    Swing(
        plan(
            "undecidable.vibration/one-speed", (), kind="undecidable", note="All runs at one speed: line or imbalance."
        ),
        "vibration.imbalance",
        None,
        imbalance,
        {"speeds": ("one", "one", "one"), **_BALANCED},
        accept=("vibration.imbalance", "vibration.line"),
        rival=(at_the_speed, 1.0),
    ),
    _outside("impacts", _impacts, 20.0, "A loose part knocks at random."),
    _outside("whine", _whine, 3.0, "A source whose pitch wanders; no speed is recorded that it follows."),
    _outside("singing", _chatter, 4.0, "A cut begins to sing for a while, each time at another pitch."),
    _clean("white"),
    _clean("ar", colour="ar"),
    _clean("heavy-tailed", colour="heavy-tailed"),
    _clean("quantised", colour="quantised"),
    _clean("two-members", world=_TWO),
    _clean("unshaken", shaken=False),
)
_TWINS = ("vibration.hardening/small", "vibration.imbalance/run-up")
SCENARIOS = (
    *(swing.scenario for swing in SWINGS),
    *(twin(swing.plan, swing.made) for swing in SWINGS if swing.plan.name in _TWINS),
)
