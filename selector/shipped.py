"""Where the recordings are that come with the package."""

from pathlib import Path

from selector.errors import InputError

_PACKAGE = Path(__file__).parent
_ROOTS = (_PACKAGE / "_fixtures", _PACKAGE.parent / "fixtures")


def shipped(name: str) -> Path:
    """The folder of a shipped recording, e.g. ``"patent8"``: packaged in a wheel, or `fixtures/` of a checkout.

    Raises InputError: there is no such folder in either place; the message lists those that there are.
    """
    known = sorted({m.parent.name for root in _ROOTS if root.is_dir() for m in root.glob("*/machine.toml")})
    for root in _ROOTS:
        if name in known and (root / name).is_dir():
            return root / name
    raise InputError(
        f"no shipped recording {name!r}",
        expected="one of " + (", ".join(known) or "none, because this installation has lost its recordings"),
        where="shipped recordings",
        advice="correct the name, or install the package again",
    )


def shipped_models(kind: str) -> tuple[Path, ...]:
    """The shipped model files of a kind of simulation, e.g. ``"thermal"``, by name; none if there are none."""
    return next((found for root in _ROOTS if (found := tuple(sorted((root / kind).glob("*.toml"))))), ())
