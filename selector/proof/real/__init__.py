"""Real recordings beside simulations from which an effect is left out that their authors document.

Those of EMPS and of the virtual machining centre come with the package; the others are read from a folder
(`selector prove --recordings DIR`). A recording leaves nothing to choose: its cases have neither strength nor seeds.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from selector.errors import OptionError
from selector.proof.case import Case, Kind, Scenario, TrueEffect, Truth
from selector.proof.real.emps import emps
from selector.proof.real.regressed import FEW, ace_thermal, vmc37
from selector.proof.real.tables import cascaded_tanks, silverbox
from selector.recording import Recording

FAMILY = "real"
PUBLISHED = ("silverbox", "cascaded_tanks", "ace_thermal")
"""Folders that are looked for in the one given with `--recordings`."""

_FOUND = ("missing-physics",)
_FRICTION_LAW = ("drive.coulomb", "drive.viscous", "drive.stribeck")
"""Friction near standstill is 7 N less than its fitted law (docs/explanation/real-recordings.md), and levels that were
fitted without what is missing are wrong with it: no record of this drive speaks against these names."""


def _scenario(
    name: str, kind: Kind, note: str, pair: Callable[[], tuple[Recording, Recording]], truth: Truth
) -> Scenario:
    name = f"{FAMILY}.{name}"
    build = partial(_case, name, kind, pair, truth)
    return Scenario(name, FAMILY, kind, build, note, has_strength=False, has_seeds=False)


def _case(
    name: str,
    kind: Kind,
    pair: Callable[[], tuple[Recording, Recording]],
    truth: Truth,
    seed: int,
    d_prime: float | None,
) -> Case:
    """The case; there is nothing to choose by seed or strength."""
    recording, simulation = pair()
    return Case(name, FAMILY, kind, recording, simulation, simulation.names, truth)


def _truth(of: TrueEffect, *tolerated: str) -> Truth:
    return Truth(_FOUND, (of,), tolerated)


_OF_LOOP = ("q", "U")

SCENARIOS: tuple[Scenario, ...] = (
    _scenario(
        "emps/viscous",
        "single",
        "drive EMPS, both records; its loop simulated with mass, viscous friction and a constant force",
        partial(emps, "viscous"),
        _truth(
            TrueEffect("drive.coulomb", ("drive.coulomb",), _OF_LOOP),
            *("drive.asymmetric_friction", "drive.viscous", "drive.stribeck"),
        ),
    ),
    _scenario(
        "emps/symmetric",
        "single",
        "the same with dry friction alike in both directions; wind-up and dead time, which its makers saw, may show",
        partial(emps, "symmetric"),
        _truth(
            TrueEffect("drive.asymmetric_friction", ("drive.asymmetric_friction",), _OF_LOOP),
            *("drive.elasticity", "drive.delay"),
            *_FRICTION_LAW,
        ),
    ),
    _scenario(
        "emps/pulses",
        "undecidable",
        "the record with pulses beside friction by direction: wind-up, dead time and inertia look alike in it",
        partial(emps, "by direction", ("pulses",)),
        _truth(
            TrueEffect("drive.elasticity", ("drive.elasticity", "drive.delay", "drive.mass"), _OF_LOOP),
            *_FRICTION_LAW,
        ),
    ),
    _scenario(
        "vmc37/all",
        "single",
        "virtual machining centre beside a regression on all thermometers: most of what expands has none",
        vmc37,
        _truth(
            TrueEffect("thermal.memory", ("thermal.memory",), ("Y", "Z")),
            *("thermal.speed_heating", "thermal.second_source", "thermal.convection", "thermal.coolant"),
        ),
    ),
    _scenario(
        "vmc37/seven",
        "single",
        "the same with seven thermometers",
        partial(vmc37, FEW),
        _truth(
            TrueEffect("thermal.memory", ("thermal.memory",), ("Y", "Z")),
            *("thermal.speed_heating", "thermal.second_source", "thermal.convection", "thermal.coolant"),
        ),
    ),
)


def published(folder: Path) -> tuple[tuple[Scenario, ...], tuple[str, ...]]:
    """The scenarios of the recordings in a folder, and which of `PUBLISHED` are not in it.

    Raises OptionError: none of them is.
    """
    found = tuple(name for name in PUBLISHED if (folder / name).is_dir())
    if not found:
        raise OptionError(
            f"none of the folders {', '.join(PUBLISHED)} in {folder}",
            expected="a folder that holds at least one of them, with the files as they were published",
            where="--recordings",
            advice="see docs/reference/sources.md for where they come from, or leave the option out",
        )
    scenarios = tuple(one for name in found for one in _OF_FOLDER[name](folder / name))
    return scenarios, tuple(name for name in PUBLISHED if name not in found)


def _of_silverbox(folder: Path) -> tuple[Scenario, ...]:
    hardens = TrueEffect("vibration.hardening", ("vibration.hardening",), ("V2",))
    return (
        _scenario(
            "silverbox/linear",
            "single",
            "oscillator with a cubic spring beside the best linear one",
            partial(silverbox, folder),
            _truth(hardens),
        ),
        _scenario(
            "silverbox/cubic",
            "clean",
            "the same beside the best one with a cubic spring: 0.6 % of the swing is left",
            partial(silverbox, folder, cubic=True),
            Truth(("nothing-missing", "miscalibrated")),
        ),
    )


def _of_tanks(folder: Path) -> tuple[Scenario, ...]:
    spills = TrueEffect("flow.overflow", ("flow.overflow",), ("y",))
    note = "two tanks that spill beside tanks without brims"
    return (_scenario("tanks/brims", "single", note, partial(cascaded_tanks, folder), _truth(spills)),)


def _of_ace(folder: Path) -> tuple[Scenario, ...]:
    # days fall into groups by something that was not recorded; speed, load and coolant were not either
    note = "lathe over 18 days beside a regression on its thermometers; what is missing cannot be decided"
    truth = Truth(("unexplained",), (TrueEffect("hidden.conditions", ("hidden.conditions",), ("D",)),))
    return (_scenario("ace/regression", "undecidable", note, partial(ace_thermal, folder), truth),)


_OF_FOLDER: dict[str, Callable[[Path], tuple[Scenario, ...]]] = {
    "silverbox": _of_silverbox,
    "cascaded_tanks": _of_tanks,
    "ace_thermal": _of_ace,
}
