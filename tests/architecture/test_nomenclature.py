"""Every parameter name means one thing, which docs/nomenclature.md says."""

from __future__ import annotations

import re
from collections import defaultdict

from tests.architecture.public_names import ROOT, public_names

PAGE = ROOT / "docs" / "nomenclature.md"


def explained() -> list[str]:
    """Names in the first column of the tables."""
    rows = re.findall(r"^\| (`[^|]*?) \|", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row)]


def used() -> dict[str, list[str]]:
    """Parameter → public names that have it."""
    found: dict[str, list[str]] = defaultdict(list)
    for public in public_names():
        for parameter in public.parameters or ():
            if not parameter.lstrip("*").startswith("_"):
                found[parameter.lstrip("*")].append(f"{public.module}.{public.name}")
    return found


def test_every_parameter_is_explained():
    known = set(explained())
    missing = {name: where[:3] for name, where in sorted(used().items()) if name not in known}
    assert not missing, "explain these in docs/nomenclature.md: " + "; ".join(
        f"{name} (of {', '.join(where)})" for name, where in missing.items()
    )


def test_every_explanation_is_of_something():
    assert not sorted(set(explained()) - set(used())), "nothing has these parameters any more"


def test_nothing_is_explained_twice():
    names = explained()
    assert sorted(names) == sorted(set(names))
