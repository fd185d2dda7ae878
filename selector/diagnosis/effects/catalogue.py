"""Which effects are known: those shipped, and those that other packages bring by an entry point."""

import importlib
import pkgutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points

import numpy as np

import selector.diagnosis.effects as shipped
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, Variant
from selector.errors import InputError, OptionError

_ADVICE = "correct or remove that package; docs/how-to/write-an-effect.md tells what an effect is made of"


def loaded(point: EntryPoint) -> Effect:
    """The effect of an entry point; whatever fails in it later is told with its id and package.

    Raises OptionError: it cannot be imported, or is no `Effect`.
    """
    package = point.dist.name if point.dist else "?"
    where = f"entry points of the group {point.group!r}, package {package}"
    with _told(f"entry point {point.name!r} cannot be loaded", where, "a module that can be imported, with an Effect"):
        effect = point.load()
    if not isinstance(effect, Effect):
        found = f"entry point {point.name!r} brings {type(effect).__name__!r}"
        raise OptionError(found, expected="an Effect", where=where, advice=_ADVICE)
    return guarded(effect, package)


def guarded(effect: Effect, package: str) -> Effect:
    """The same effect, whose functions end with an `OptionError` that names it where they raise or return nonsense."""
    where = f"effect {effect.id!r} of package {package}"

    def testable(comparison: Comparison, response: str) -> str | None:
        with _told("`testable` failed", where, "None, or one clause that says what is lacking"):
            reason = effect.testable(comparison, response)
            if reason is not None and not isinstance(reason, str):
                raise TypeError(f"{reason!r} returned")
            return reason

    def variants(comparison: Comparison, response: str) -> list[Variant]:
        rows = len(comparison.time_s)
        with _told("`variants` failed", where, f"variants with finite columns of {rows} rows, one for each row"):
            found = list(effect.variants(comparison, response))
            for variant in found:
                _require_usable(variant, rows)
            return found

    def reading(fitted: Fitted, comparison: Comparison) -> Reading:
        with _told("`reading` failed", where, "a Reading"):
            found = effect.reading(fitted, comparison)
            if not isinstance(found, Reading):
                raise TypeError(f"{type(found).__name__} returned")
            return found

    return replace(effect, testable=testable, variants=variants, reading=reading)


def _require_usable(variant: object, rows: int) -> None:
    if not isinstance(variant, Variant):
        raise TypeError(f"{type(variant).__name__} among the variants")
    if len(variant.columns) != rows:
        raise ValueError(f"columns of shape {variant.columns.shape}")
    if not np.isfinite(variant.columns).all():
        raise ValueError(f"columns {', '.join(variant.names)} with values that are no finite numbers")


@contextmanager
def _told(what: str, where: str, expected: str) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # whatever another author's code may raise
        said = " ".join(str(error).split())[:300]
        found = f"{what} ({type(error).__name__}{': ' + said if said else ''})"
        raise OptionError(found, expected=expected, where=where, advice=_ADVICE) from error


ENTRY_POINT = "selector.effects"  #: Group of the entry points: each names an `Effect`.
_FAMILIES = ("data", "thermal", "drive", "vibration", "gauging", "flow")


@cache
def catalogue() -> tuple[Effect, ...]:
    """Every effect, shipped ones first, by family and id.

    Raises OptionError if an entry point cannot be loaded, or brings no `Effect`, or an id that is already there.
    """
    found = {effect.id: effect for effect in _shipped()}
    for point in sorted(entry_points(group=ENTRY_POINT), key=lambda point: point.name):
        effect = loaded(point)
        if effect.id in found:
            raise OptionError(
                f"entry point {point.name!r} brings {effect.id!r}",
                expected="an Effect whose id no other effect has",
                where=f"entry points of the group {ENTRY_POINT!r}, package {point.dist.name if point.dist else '?'}",
                advice=_ADVICE,
            )
        found[effect.id] = effect
    return tuple(found.values())


def effect_of(id: str) -> Effect:  # noqa: A002 - the word of the contract
    """The effect with this id. Raises OptionError if there is none."""
    known = {effect.id: effect for effect in catalogue()}
    if id not in known:
        advice = "`selector effects` lists them with a sentence each"
        raise OptionError(f"effect {id!r}", expected="one of " + ", ".join(known), where="effect", advice=advice)
    return known[id]


def _shipped() -> Iterator[Effect]:
    for family in _FAMILIES:
        package = importlib.import_module(f"{shipped.__name__}.{family}")
        names = [f"{package.__name__}.{module.name}" for module in pkgutil.iter_modules(package.__path__)]
        effects = (effect for name in names for effect in getattr(importlib.import_module(name), "EFFECTS", ()))
        yield from sorted(effects, key=lambda effect: effect.id)
