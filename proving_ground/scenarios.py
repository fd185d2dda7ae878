"""Which scenarios are there: those of every family's proving ground, by family and by name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Sequence
from fnmatch import fnmatchcase

import proving_ground as proof
from proving_ground.case import Scenario
from selector.errors import OptionError

FAMILIES = ("thermal", "drive", "vibration", "gauging", "flow", "data", "imperfect", "open_model", "real")


def scenarios(
    families: Sequence[str] = (), names: Sequence[str] = (), recordings: Sequence[Scenario] = ()
) -> tuple[Scenario, ...]:
    """The scenarios of these families whose name fits one of the patterns (``thermal.*``); empty = all.

    `recordings` are those of recordings that do not come with the package (`proving_ground.real.published`).

    Raises OptionError if a family is unknown, or no scenario fits a pattern.
    """
    unknown = [family for family in families if family not in FAMILIES]
    if unknown:
        raise OptionError(
            f"family {unknown[0]!r}",
            expected="one of " + ", ".join(FAMILIES),
            where="--families",
            advice="correct the option, or leave it out for all",
        )
    known = [*(one for family in FAMILIES for one in _of_family(family)), *recordings]
    found = tuple(one for one in known if not families or one.family in families)
    for pattern in names:
        if not any(fnmatchcase(one.name, pattern) for one in found):
            raise OptionError(
                f"{pattern!r}, which fits none of {len(found)} scenarios",
                expected="a name, or a pattern such as 'thermal.*'",
                where="--scenarios",
                advice="`selector prove --list` prints their names" if found else "choose other families",
            )
    return tuple(one for one in found if not names or any(fnmatchcase(one.name, pattern) for pattern in names))


def _of_family(family: str) -> list[Scenario]:
    """`SCENARIOS` of the package if it joins them itself, else those of its modules."""
    package = importlib.import_module(f"{proof.__name__}.{family}")
    modules = [package]
    if not hasattr(package, "SCENARIOS"):
        names = sorted(info.name for info in pkgutil.iter_modules(package.__path__))
        modules = [importlib.import_module(f"{package.__name__}.{name}") for name in names]
    unique: dict[str, Scenario] = {}
    for scenario in (one for module in modules for one in getattr(module, "SCENARIOS", ())):
        if unique.setdefault(scenario.name, scenario) is not scenario:
            raise ValueError(f"two scenarios are called {scenario.name!r}")
    return list(unique.values())
