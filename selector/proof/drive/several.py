"""Axes whose simulation lacks two or three things at once, each as strong as the others, some of them opposed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from selector.proof.case import TrueEffect
from selector.proof.drive.friction_and_joints import softer
from selector.proof.drive.recorded import Change, Drive, axis_world, plan, plus
from selector.proof.drive.true_axis import Bench, TrueAxis
from selector.proof.world import size_with

_UNIT_D_PRIME = 8.0


@dataclass(frozen=True)
class Part:
    """One of several effects: its id, the change of the axis, a first size, where it shows."""

    id: str
    change: Change
    first: float
    channels: tuple[str, ...] = ("E", "I")
    place: str = "guide"
    sign: float = 1.0


def together(*parts: Part) -> Any:
    """What `Drive.prepared` needs: the parts, each scaled so that alone it has the same strength at size 1."""

    def prepared(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
        start = bench.axis
        sizes = [_alone(bench, start, part) for part in parts]

        def without(lacking: int | None, size: float) -> TrueAxis:
            axis = start
            for number, (part, own) in enumerate(zip(parts, sizes, strict=True)):
                axis = part.change(axis, size * own) if size and number != lacking else axis
            return axis

        effects = tuple(TrueEffect(part.id, (part.id,), part.channels, part.place) for part in parts)
        return {
            "true": partial(without, None),
            "effects": lambda size: effects,
            "lacking": tuple({"true": partial(without, k)} for k in range(len(parts))),
        }

    return prepared


def _alone(bench: Bench, start: TrueAxis, part: Part) -> float:
    def true(size: float) -> TrueAxis:
        return part.change(start, part.sign * size) if size else start

    world = axis_world(bench, lambda size: (), true=true, first=part.first)
    return part.sign * size_with(world, _UNIT_D_PRIME)


def _drive(name: str, parts: Sequence[Part], bench: dict[str, Any], axis: dict[str, float], note: str = "") -> Drive:
    return Drive(
        plan(name, (), kind="several", note=note),
        "several",
        None,
        bench,
        axis,
        {"first": 0.3},
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

DRIVES = (
    _drive("drive.several/coulomb+lead", (_COULOMB, _LEAD), {"friction": False, "on_scale": False}, {}),
    _drive("drive.several/play+ripple", (_PLAY, _RIPPLE), {"on_scale": False}, {"ripple_m": 0.003}),
    _drive("drive.several/play+elasticity", (_PLAY, _ELASTIC), {"on_scale": False, "colour": "ar"}, {}),
    _drive(
        "drive.several/position+direction",
        (_POSITION, _DIRECTION),
        {"friction": False, "fastest": 0.2, "styles": ("strokes", "sines", "strokes")},
        {"viscous_ns_per_m": 700.0},
    ),
    _drive(
        "drive.several/mass-coulomb",
        (_MASS, _COULOMB),
        {"friction": False, "styles": ("strokes", "sines", "other")},
        {},
        note="The table is lighter than simulated and rubs: opposing signs during acceleration.",
    ),
    _drive(
        "drive.several/triple",
        (_COULOMB, _PLAY, _RIPPLE),
        {"on_scale": False, "styles": ("strokes", "gentle", "other")},
        {"ripple_m": 0.004},
    ),
)
SCENARIOS = tuple(drive.scenario for drive in DRIVES)
