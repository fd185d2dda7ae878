"""Of what are the sections of a model file made: closed entries, names, numbers within limits, columns of files.

A key carries its unit in its name, as everywhere in the program: a number in a file then has one meaning, and the
same name serves the file, the law in Python and the parameter of a fit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field

MOST_SAMPLES = 2_000_000
"""Samples of one run, and steps of the calculation where they are as long as the samples."""

NO_SUCH_KIND = "no_such_kind"
"""Type of the problem where a table has none of the kinds that it may have."""

_MARK = "\x1f"
"""No name and no key of a file may hold it, so that it tells choices from keys."""


def choice_tag(name: str) -> str:
    """The tag of one of several forms of a section, which is no key of the file: for pydantic's ``Tag``."""
    return f"{_MARK}{name}"


def is_choice_tag(part: object) -> bool:
    """Whether a part of a place is a tag of `choice_tag` and not a key."""
    return isinstance(part, str) and part.startswith(_MARK)


def by_kind(*kinds: str) -> Discriminator:
    """Which of several forms a table has: the one with the `choice_tag` of its ``kind = "…"``."""

    def tag(value: Any) -> str | None:
        kind = value.get("kind") if isinstance(value, Mapping) else getattr(value, "kind", None)
        return choice_tag(kind) if kind in kinds else None

    words = ", ".join(f'"{kind}"' for kind in kinds)
    return Discriminator(tag, custom_error_type=NO_SUCH_KIND, custom_error_message=f"one of {words}")


def printable(text: str) -> str:
    """The same text, if it may name something.

    Raises
    ------
    ValueError
        It is empty, longer than 100 characters, or has control characters.
    """
    if not text.strip() or not text.isprintable() or len(text) > 100:
        raise ValueError("a name of 1 to 100 printable characters")
    return text


def limited(low: float, high: float, *, above: bool = False) -> Any:
    """A pydantic field for finite numbers of [low, high], of (low, high] with `above`."""
    bounds: dict[str, Any] = {"gt": low} if above else {"ge": low}
    return Field(strict=True, allow_inf_nan=False, le=high, **bounds)


Name = Annotated[str, AfterValidator(printable)]
Positive = Annotated[float, limited(1e-9, 1e12)]
NonNegative = Annotated[float, limited(0, 1e12)]
Signed = Annotated[float, limited(-1e9, 1e9)]
Share = Annotated[float, limited(0, 1)]
Point = Annotated[tuple[Signed, Signed, Signed], Field()]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**63)]
Note = Annotated[str, Field(max_length=4000)]
Bounds = Annotated[dict[str, Annotated[tuple[Signed, Signed], Field()]], Field(max_length=5_000)]


class Entry(BaseModel):
    """A section of the file: unknown keys are refused, nothing changes once it is read."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Column(Entry):
    """A course that is read from a column of a recording in the folder of the model file; each value is held."""

    file: Annotated[str, AfterValidator(printable)]
    column: Annotated[str, Field(min_length=1, max_length=200)]
