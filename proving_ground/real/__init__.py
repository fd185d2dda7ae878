"""Real recordings beside simulations from which an effect is left out that their authors document.

Those of EMPS and of the virtual machining centre come with the package; the others are read from a folder
(`selector prove --recordings DIR`). A recording leaves nothing to choose: its cases have neither strength nor seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from proving_ground.case import Case, Kind, Scenario, TrueEffect, Truth
from proving_ground.real.emps import emps
from proving_ground.real.regressed import FEW, ace_thermal, vmc37
from proving_ground.real.tables import cascaded_tanks, silverbox
from selector.errors import OptionError
from selector.recording import Recording

FAMILY = "real"
Pair = Callable[[], tuple[Recording, Recording]]

_FRICTION_LAW = ("drive.coulomb", "drive.viscous", "drive.stribeck")
"""Friction near standstill is 7 N less than its fitted law (docs/explanation/real-recordings.md), and levels that were
fitted without what is missing are wrong with it: no record of this drive speaks against these names."""


def _scenario(name: str, kind: Kind, note: str, pair: Pair, truth: Truth) -> Scenario:
    """A scenario without anything to choose by seed or strength."""
    name = f"{FAMILY}.{name}"

    def build(seed: int, d_prime: float | None) -> Case:
        recording, simulation = pair()
        return Case(name, FAMILY, kind, recording, simulation, simulation.names, truth)

    return Scenario(name, FAMILY, kind, build, note, has_strength=False, has_seeds=False)


def _lacks(id: str, channels: tuple[str, ...], *tolerated: str, accept: tuple[str, ...] = ()) -> Truth:  # noqa: A002
    """The truth that this effect is missing; `accept` are the ids that are right where others than its own are."""
    return Truth(("missing-physics",), (TrueEffect(id, accept or (id,), channels),), tolerated)


_OF_LOOP = ("q", "U")
_SPINDLE_AND_COOLING = ("thermal.speed_heating", "thermal.second_source", "thermal.convection", "thermal.coolant")

SCENARIOS: tuple[Scenario, ...] = (
    _scenario(
        "emps/viscous",
        "single",
        "drive EMPS, both records; its loop simulated with mass, viscous friction and a constant force",
        partial(emps, "viscous"),
        _lacks("drive.coulomb", _OF_LOOP, "drive.asymmetric_friction", "drive.viscous", "drive.stribeck"),
    ),
    _scenario(
        "emps/symmetric",
        "single",
        "the same with dry friction alike in both directions; wind-up and dead time, which its makers saw, may show",
        partial(emps, "symmetric"),
        _lacks("drive.asymmetric_friction", _OF_LOOP, "drive.elasticity", "drive.delay", *_FRICTION_LAW),
    ),
    _scenario(
        "emps/pulses",
        "undecidable",
        "the record with pulses beside friction by direction: wind-up, dead time and inertia look alike in it",
        partial(emps, "by direction", ("pulses",)),
        _lacks("drive.elasticity", _OF_LOOP, *_FRICTION_LAW, accept=("drive.elasticity", "drive.delay", "drive.mass")),
    ),
    _scenario(
        "vmc37/all",
        "single",
        "virtual machining centre beside a regression on all thermometers: most of what expands has none",
        vmc37,
        _lacks("thermal.memory", ("Y", "Z"), *_SPINDLE_AND_COOLING),
    ),
    _scenario(
        "vmc37/seven",
        "single",
        "the same with seven thermometers",
        partial(vmc37, FEW),
        _lacks("thermal.memory", ("Y", "Z"), *_SPINDLE_AND_COOLING),
    ),
)

_OF_FOLDER: Mapping[str, tuple[tuple[str, Kind, str, Callable[[Path], tuple[Recording, Recording]], Truth], ...]] = {
    "silverbox": (
        (
            "silverbox/linear",
            "single",
            "oscillator with a cubic spring beside the best linear one",
            silverbox,
            _lacks("vibration.hardening", ("V2",)),
        ),
        (
            "silverbox/cubic",
            "clean",
            "the same beside the best one with a cubic spring: 0.6 % of the swing is left",
            partial(silverbox, cubic=True),
            Truth(("nothing-missing", "miscalibrated")),
        ),
    ),
    "cascaded_tanks": (
        (
            "tanks/brims",
            "single",
            "two tanks that spill beside tanks without brims",
            cascaded_tanks,
            _lacks("flow.overflow", ("y",)),
        ),
    ),
    "ace_thermal": (
        (
            "ace/regression",
            "undecidable",
            "lathe over 18 days beside a regression on its thermometers; what is missing cannot be decided",
            ace_thermal,
            # days fall into groups by something that was not recorded; speed, load and coolant were not either
            Truth(("unexplained",), (TrueEffect("hidden.conditions", ("hidden.conditions",), ("D",)),)),
        ),
    ),
}
PUBLISHED = tuple(_OF_FOLDER)
"""Folders that are looked for in the one given with `--recordings`."""


def published(folder: Path) -> tuple[tuple[Scenario, ...], tuple[str, ...]]:
    """The scenarios of the recordings in a folder, and which of `PUBLISHED` are not in it.

    Raises OptionError: none of them is.
    """
    found = [name for name in PUBLISHED if (folder / name).is_dir()]
    if not found:
        raise OptionError(
            f"none of the folders {', '.join(PUBLISHED)} in {folder}",
            expected="a folder that holds at least one of them, with the files as they were published",
            where="--recordings",
            advice="see docs/reference/sources.md for where they come from, or leave the option out",
        )
    scenarios = (
        _scenario(name, kind, note, partial(pair, folder / of), truth)
        for of in found
        for name, kind, note, pair, truth in _OF_FOLDER[of]
    )
    return tuple(scenarios), tuple(name for name in PUBLISHED if name not in found)
