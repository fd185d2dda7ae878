"""Axes with nothing missing, with wrong values only, and with what no expert could tell apart on this record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from proving_ground.drive import friction_and_joints, servo
from proving_ground.drive.friction_and_joints import softer
from proving_ground.drive.recorded import FORCE, Drive
from proving_ground.drive.true_axis import Bench
from proving_ground.world import Change, Runs, plus, scenarios_of, twin

_ANY = ("data-fault", "missing-physics")
_VALUES = ("drive.mass", "drive.viscous", "drive.coulomb", "drive.elasticity", "drive.delay", "data.gain")


def _clean(name: str, bench: Mapping[str, Any], note: str = "", lost: float = 0.0, **rest: Any) -> Drive:
    told: dict[str, Any] = {"kind": "clean", "lost": lost, "note": note, "id": "", **rest}
    return Drive.of(f"clean.drive/{name}", None, bench, **told)


def _scaled_current(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """The force per ampere of the simulation is up to 20 % off."""
    share = 1.0 + float(generator.choice([-1.0, 1.0]) * generator.uniform(0.1, 0.2))
    plain = bench.machine
    other = plain._replace(force_per_a=plain.force_per_a * share)
    return {"given": lambda size: other if size else plain}


def _shifted(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """Both responses of the simulation come from zeros that are off."""
    error, amps = float(generator.uniform(1.0, 4.0)), float(generator.uniform(0.1, 0.4))

    def shifted(courses: Runs, size: float) -> Runs:
        away = {"E": size * error, "I": -size * amps}
        return {name: [part + away.get(name, 0.0) for part in parts] for name, parts in courses.items()}

    return {"recorded_as": shifted}


def _late(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """The simulation is read out late, all of it."""
    late = float(generator.uniform(3e-4, 8e-4))

    def delayed(courses: Runs, size: float) -> Runs:
        return {
            name: [
                np.interp(time - size * late, time, part) if name in ("E", "I") else part
                for time, part in zip(bench.stamps, parts, strict=True)
            ]
            for name, parts in courses.items()
        }

    return {"recorded_as": delayed}


def _guessed(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """Mass, friction and stiffness of the simulation are nominal values, each up to 20 % off."""
    plain = bench.machine
    shares = 1.0 + generator.choice([-1.0, 1.0], 3) * generator.uniform(0.1, 0.2, 3)
    names = ("table_kg", "viscous_ns_per_m", "coulomb_n")
    other = plain._replace(**{name: getattr(plain, name) * share for name, share in zip(names, shares, strict=True)})
    return {"given": lambda size: other if size else plain}


def _miscalibrated(name: str, prepared: Any, tolerated: tuple[str, ...], verdicts: tuple[str, ...], note: str) -> Drive:
    return Drive.of(
        f"miscalibrated.drive/{name}",
        kind="miscalibrated",
        verdicts=("miscalibrated", *verdicts),
        tolerated=tolerated,
        size=1.0,
        note=note,
        id="",
        prepared=prepared,
    )


CLEAN = (
    _clean("white", {}),
    _clean("ar", {"colour": "ar"}),
    _clean("heavy-tailed", {"colour": "heavy-tailed"}),
    _clean("quantised", {"colour": "quantised"}),
    _clean(
        "coarse",
        {"colour": "coarse"},
        "Steps of the readings are far above their noise.",
        verdicts=("nothing-missing", "unexplained"),
    ),
    _clean(
        "cycle-locked",
        {"colour": "cycle-locked", "styles": ("cycles", "cycles", "cycles")},
        "The machine repeats a cycle, and so does half of the noise.",
        verdicts=("nothing-missing", "unexplained"),
    ),
    _clean("jitter", {"jitter_s": 5e-6, "coarse_scale": True}, "The clock of the recorder jitters."),
    _clean(
        "lost-rows",
        {"friction": False},
        "Rows were lost; the simulation has its own grid.",
        0.05,
        world={"simulation_period_s": 1e-3},
    ),
    _clean("one-run", {"styles": ("strokes",)}, "A single run; its last 30 % are held out."),
    _clean("force", {"jitter_s": 0.0}, "Position and force only.", world=FORCE),
)
MISCALIBRATED = (
    _miscalibrated("current", _scaled_current, ("data.gain",), ("data-fault",), "Force per ampere is off."),
    _miscalibrated(
        "zeros",
        _shifted,
        ("data.zero", "drive.offset_force"),
        _ANY,
        "Zeros are off: nothing tells a force from a zero.",
    ),
    _miscalibrated(
        "clock",
        _late,
        ("data.clock", "drive.delay"),
        _ANY,
        "Recorded late, in every run: nothing tells a clock from a delay.",
    ),
    _miscalibrated("values", _guessed, _VALUES, ("missing-physics",), "Mass and friction are nominal values."),
)
_NO_SCALE: Mapping[str, Any] = {"names": ("r", "v", "I"), "responses": ("I",)}
"""Nothing tells where the table is."""
_LAG = (plus("current_lag_s", 1e-5), 3.0)
_SOFT = (softer(1e-10), 8.0)


def _undecidable(
    name: str,
    id: str,  # noqa: A002 - the word of the contract
    accept: tuple[str, ...],
    changes: tuple[tuple[Change, float], tuple[Change, float]],
    bench: Mapping[str, Any],
    note: str,
    start: Mapping[str, float] | None = None,
    world: Mapping[str, Any] = _NO_SCALE,
) -> Drive:
    (change, first), (other, other_first) = changes

    def rival(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
        return {"true": lambda size: other(bench.machine, size) if size else bench.machine, "first": other_first}

    told: dict[str, Any] = {"kind": "undecidable", "note": note, "id": id, "accept": accept, "rival": rival}
    channels = tuple(world.get("responses", ("E", "I")))
    named = f"undecidable.drive/{name}"
    return Drive.of(named, change, bench, start, first=first, world=world, channels=channels, **told)


_LAG_OR_SOFT = ("drive.delay", "drive.elasticity")
_JERKY: Mapping[str, Any] = {"friction": False, "styles": ("strokes", "strokes", "gentle"), "rounded_s": 0.015}
_AT_ONE_SPEED: Mapping[str, Any] = {"friction": False, "styles": ("one speed",) * 3, "fastest": 0.05}
_SIGN = (plus("coulomb_n"), 0.3)
_SPEED = (plus("viscous_ns_per_m"), 4.0)
UNDECIDABLE = (
    _undecidable(
        "lag", "drive.delay", _LAG_OR_SOFT, (_LAG, _SOFT), _JERKY, "The current follows later than simulated."
    ),
    _undecidable(
        "soft", "drive.elasticity", _LAG_OR_SOFT, (_SOFT, _LAG), _JERKY, "A softer screw; only the current is compared."
    ),
    _undecidable(
        "one-speed",
        "drive.coulomb",
        ("drive.coulomb", "drive.viscous", "drive.mass"),
        (_SIGN, _SPEED),
        _AT_ONE_SPEED,
        "All runs, the held-out one too, know one speed: friction by sign or by speed.",
    ),
    _undecidable(
        "one-speed-oil",
        "drive.viscous",
        ("drive.coulomb", "drive.viscous", "drive.mass"),
        (_SPEED, _SIGN),
        _AT_ONE_SPEED,
        "The same with the other friction.",
    ),
    _undecidable(
        "lost-motion",
        "drive.elasticity",
        ("drive.elasticity", "drive.backlash"),
        (_SOFT, (plus("play_m", 1e-6), 0.05)),
        {"on_scale": False, "styles": ("gentle",) * 3, "fastest": 0.02, "coarse_scale": True},
        "Slow moves against constant friction: wind-up and play look alike.",
        {"coulomb_n": 200.0},
        {"names": ("r", "v", "E"), "responses": ("E",)},
    ),
)
_TWINS = (
    "drive.coulomb/absorbed",
    "drive.stribeck/creeping",
    "drive.backlash/small",
    "drive.elasticity/friction",
    "drive.pitch_error/half-lead",
    "drive.offset_force/brake",
)
_LACKING = (*friction_and_joints.DRIVES, *servo.DRIVES)
SCENARIOS = (
    *scenarios_of(drive.case for drive in (*CLEAN, *MISCALIBRATED, *UNDECIDABLE)),
    *(twin(*drive.case) for drive in _LACKING if drive.plan.name in _TWINS),
)
