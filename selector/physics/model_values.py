"""Which section of a model file describes a value, and which value does a section describe: keys are field names.

So the file, the dataclass and the parameter of a fit have one name and one default, and whatever the dataclass
refuses is refused with the key of the file.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import Field, StrictBool, create_model

from selector.errors import InputError
from selector.physics.model_entries import Entry, limited
from selector.physics.model_text import Contradiction, Key

LARGEST = 1e15
"""Beyond it no number of a machine lies, in whatever unit."""

_MOST_VALUES = 10_000

Value = TypeVar("Value")


def entry_of(kind: type, *, called: str | None = None, **more: Any) -> type[Entry]:
    """The section whose keys are the fields of a dataclass, with their defaults; dataclasses inside are tables.

    Fields may be numbers, whole numbers, truth values, choices of words, tuples of numbers, dataclasses, or None.
    With `called` it has ``kind = "called"`` as its first key; `more` are further keys as pydantic has them: (type,
    default).
    """
    hints = get_type_hints(kind)
    keys: dict[str, Any] = {} if called is None else {"kind": (Literal[called], ...)}
    for field in dataclasses.fields(kind):
        default: Any = ...
        if field.default is not dataclasses.MISSING:
            default = field.default
        elif field.default_factory is not dataclasses.MISSING:
            default = _default(hints[field.name], field.default_factory())
        keys[field.name] = (_key_type(hints[field.name]), default)
    return create_model(f"{kind.__name__}Section", __base__=Entry, __doc__=kind.__doc__, **keys, **more)


def value_of(kind: type[Value], section: Entry, **more: Any) -> Value:
    """The dataclass that a section of `entry_of` describes, with `more` fields that the section has not.

    Raises
    ------
    InputError
        The dataclass refuses a value; `where` is its field.
    """
    return kind(**given(kind, section), **more)


def given(kind: type, section: Entry) -> dict[str, Any]:
    """The fields of a dataclass that a section says itself, those inside as dataclasses."""
    known = {field.name for field in dataclasses.fields(kind)}
    hints = get_type_hints(kind)
    found: dict[str, Any] = {}
    for name in section.model_fields_set & known:
        value = getattr(section, name)
        inner = _dataclass_in(hints[name])
        found[name] = value_of(inner, value) if inner is not None and isinstance(value, Entry) else value
    return found


def refused(error: InputError, key: Key, section: Entry | None) -> Contradiction:
    """What a dataclass refused, at the key of the section that describes it."""
    names = tuple(error.where.split("."))
    inside: Any = section
    for name in names:
        inside = getattr(inside, name, None) if isinstance(inside, Entry) and name in type(inside).model_fields else ...
    return (key if inside is ... else (*key, *names)), error.found, error.expected, error.advice


def _default(hint: Any, value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return entry_of(hint).model_construct()
    return dict(value) if isinstance(value, Mapping) else value


def _dataclass_in(hint: Any) -> Any:
    """The dataclass of ``X`` or ``X | None``, if there is one."""
    return next((kind for kind in (hint, *get_args(hint)) if dataclasses.is_dataclass(kind)), None)


def _key_type(hint: Any) -> Any:
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return Union[tuple(kind if kind is type(None) else _key_type(kind) for kind in inner)]  # noqa: UP007
    if origin is tuple:
        if len(inner) == 2 and inner[1] is ...:
            return Annotated[tuple[_key_type(inner[0]), ...], Field(max_length=_MOST_VALUES)]  # type: ignore[misc]
        return tuple[tuple(_key_type(one) for one in inner)]  # type: ignore[misc]
    if origin is Literal:
        return hint
    if dataclasses.is_dataclass(hint):
        return entry_of(hint)  # type: ignore[arg-type]
    simple = {
        bool: StrictBool,
        int: Annotated[int, Field(strict=True, ge=-(10**9), le=10**9)],
        float: Annotated[float, limited(-LARGEST, LARGEST)],
    }
    if hint not in simple:
        raise TypeError(f"a model file has no keys of the type {hint}")
    return simple[hint]
