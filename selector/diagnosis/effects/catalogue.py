"""Which effects are known: those shipped, and those that other packages bring by an entry point."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from importlib.metadata import entry_points

import selector.diagnosis.effects as shipped
from selector.diagnosis.effects.effect import Effect
from selector.diagnosis.effects.foreign import loaded
from selector.errors import OptionError

ENTRY_POINT = "selector.effects"
"""Group of the entry points: each names an `Effect`."""
_FAMILIES = ("data", "thermal", "drive", "vibration", "gauging", "flow")


@cache
def catalogue() -> tuple[Effect, ...]:
    """Every effect, shipped ones first, by family and id.

    Raises
    ------
    OptionError
        If an entry point cannot be loaded, or brings no `Effect`, or an id that is already there.
    """
    found = {effect.id: effect for effect in _shipped()}
    for point in sorted(entry_points(group=ENTRY_POINT), key=lambda point: point.name):
        effect = loaded(point)
        if effect.id in found:
            raise OptionError(
                f"entry point {point.name!r} brings {effect.id!r}",
                expected="an Effect whose id no other effect has",
                where=f"entry points of the group {ENTRY_POINT!r}, package {point.dist.name if point.dist else '?'}",
                advice="correct or remove that package; docs/how-to/write-an-effect.md tells what an effect is made of",
            )
        found[effect.id] = effect
    return tuple(found.values())


def effect_of(id: str) -> Effect:  # noqa: A002 - the word of the contract
    """The effect with this id.

    Raises
    ------
    OptionError
        If there is none.
    """
    known = {effect.id: effect for effect in catalogue()}
    if id not in known:
        raise OptionError(
            f"effect {id!r}",
            expected="one of " + ", ".join(known),
            where="effect",
            advice="`selector effects` lists them with a sentence each",
        )
    return known[id]


def _shipped() -> list[Effect]:
    effects = []
    for family in _FAMILIES:
        package = importlib.import_module(f"{shipped.__name__}.{family}")
        for module in sorted(info.name for info in pkgutil.iter_modules(package.__path__)):
            effect = getattr(importlib.import_module(f"{package.__name__}.{module}"), "EFFECT", None)
            if isinstance(effect, Effect):
                effects.append(effect)
    return effects
