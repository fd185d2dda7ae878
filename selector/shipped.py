"""Where the recordings are that come with the package."""

from __future__ import annotations

from pathlib import Path

from selector.errors import InputError

_PACKAGE = Path(__file__).parent


def shipped(name: str) -> Path:
    """The folder of a shipped recording, e.g. ``"patent8"``: packaged in a wheel, or `fixtures/` of a checkout.

    Raises
    ------
    InputError
        There is no such folder in either place; the message lists those that there are.
    """
    roots = (_PACKAGE / "_fixtures", _PACKAGE.parent / "fixtures")
    known = sorted({m.parent.name for root in roots if root.is_dir() for m in root.glob("*/machine.toml")})
    for root in roots:
        if name in known and (root / name).is_dir():
            return root / name
    raise InputError(
        f"no shipped recording {name!r}",
        expected="one of " + (", ".join(known) or "none, because this installation has lost its recordings"),
        where="shipped recordings",
        advice="correct the name, or install the package again",
    )
