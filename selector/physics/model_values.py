"""Which section of a model file describes a value, which value does a section describe, and how is one written."""

import dataclasses
import types
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import AfterValidator, Field, StrictBool, create_model

from selector.errors import InputError
from selector.physics.model_fields import Limits
from selector.physics.model_text import Contradiction, Entry, Key, limited
from selector.text_file import toml_key, toml_value

LARGEST = 1e15  #: Beyond it no number of a machine lies, in whatever unit.
_MOST_VALUES = 10_000

Value = TypeVar("Value")

_NO_LIMITS = Limits(0.0, LARGEST)


def entry_of(kind: type, *, called: str | None = None, **more: Any) -> type[Entry]:
    """The section whose keys are the fields of a dataclass, with their defaults; dataclasses inside are tables.

    Fields may be numbers, whole numbers, truth values, choices of words, tuples of numbers, dataclasses, or None.
    With `called` it has ``kind = "called"`` as its first key; `more` are further keys as pydantic has them: (type,
    default).
    """
    hints = get_type_hints(kind, include_extras=True)
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

    Raises InputError: the dataclass refuses a value; `where` is its field.
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
        found[name] = _inner_value(inner, value, name) if inner is not None and isinstance(value, Entry) else value
    return found


def refused(error: InputError, key: Key, section: Entry | None) -> Contradiction:
    """What a dataclass refused, at the key of the section that describes it."""
    names = tuple(error.where.split("."))
    inside: Any = section
    for name in names:
        inside = getattr(inside, name, None) if isinstance(inside, Entry) and name in type(inside).model_fields else ...
    return (key if inside is ... else (*key, *names)), error.found, error.expected, error.advice


def refusals(make: Callable[[], object], key: Key, section: Entry | None = None) -> Iterator[Contradiction]:
    """What making a value refuses, if anything, at the key of the section that describes it."""
    try:
        make()
    except InputError as error:
        yield refused(error, key, section)


def _inner_value(kind: type[Value], section: Entry, name: str) -> Value:
    """As `value_of`, of a table inside a section: what is refused has the name of the table before it."""
    try:
        return value_of(kind, section)
    except InputError as error:
        where = f"{name}.{error.where}"
        raise type(error)(error.found, expected=error.expected, where=where, advice=error.advice) from error


def _default(hint: Any, value: Any) -> Any:
    hint = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    if dataclasses.is_dataclass(value):
        return entry_of(hint).model_construct()
    return dict(value) if isinstance(value, Mapping) else value


def _dataclass_in(hint: Any) -> Any:
    """The dataclass of ``X`` or ``X | None``, if there is one."""
    return next((kind for kind in (hint, *get_args(hint)) if dataclasses.is_dataclass(kind)), None)


def _key_type(hint: Any, limits: Limits = _NO_LIMITS) -> Any:
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        own = next((one for one in hint.__metadata__ if isinstance(one, Limits)), limits)
        return Annotated[(_key_type(inner[0], own), *hint.__metadata__)]
    if origin in (Union, types.UnionType):
        return Union[tuple(kind if kind is type(None) else _key_type(kind, limits) for kind in inner)]  # noqa: UP007
    if origin is tuple:
        if len(inner) == 2 and inner[1] is ...:
            many = tuple[_key_type(inner[0], limits), ...]  # type: ignore[misc, valid-type]
            return Annotated[many, Field(max_length=_MOST_VALUES)]
        return tuple[tuple(_key_type(one, limits) for one in inner)]  # type: ignore[misc]
    if origin is Literal:
        return hint
    if dataclasses.is_dataclass(hint):
        return entry_of(hint)  # type: ignore[arg-type]
    whole = int(min(limits.most, 10**9))
    simple = {
        bool: StrictBool,
        int: Annotated[int, Field(strict=True, ge=-whole, le=whole)],
        float: Annotated[
            float, limited(-limits.most, limits.most), AfterValidator(partial(_large_enough, least=limits.least))
        ],
    }
    if hint not in simple:
        raise TypeError(f"a model file has no keys of the type {hint}")
    return simple[hint]


def _large_enough(value: float, *, least: float) -> float:
    if 0.0 < abs(value) < least:
        raise ValueError(f"0, or a number of at least {least:g} in size")
    return value


_DEEPEST = 3  #: Parts of a header; tables further inside are written in a line.


def model_file_text(values: Mapping[str, Any], *, head: str = "") -> str:
    """Plain values of a model file as TOML text; `head` becomes comment lines at its beginning.

    >>> values = {"model": {"kind": "drive", "name": "axis"}, "links": [{"between": ["a", "b"]}]}
    >>> print(model_file_text(values).rstrip())
    [model]
    kind = "drive"
    name = "axis"
    <BLANKLINE>
    [[links]]
    between = ["a", "b"]
    """
    comments = [f"# {line}".rstrip() for line in head.splitlines()]
    return "\n".join([*comments, *_table(values, ())]).lstrip("\n") + "\n"


def _table(values: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    inside = {key: value for key, value in values.items() if _has_sections(value, len(path))}
    for key, value in values.items():
        if key == "file" and isinstance(value, str) and Path(value).is_absolute():
            # what was read beside the model file has to be beside this one, too
            yield f"{toml_key(key)} = {toml_value(Path(value).name)}  # copy it beside this file"
        elif value is not None and key not in inside:
            yield f"{toml_key(key)} = {toml_value(value)}"
    for key, value in inside.items():
        several = not isinstance(value, Mapping)
        name = ".".join(toml_key(part) for part in (*path, key))
        for table in value if several else [value]:
            if several or not table or any(not _has_sections(one, len(path) + 1) for one in table.values()):
                yield from ("", f"[[{name}]]" if several else f"[{name}]")
            yield from _table(table, (*path, key))


def _has_sections(value: Any, depth: int) -> bool:
    """Whether a value at this depth is written below headers of its own."""
    return depth < _DEEPEST and (isinstance(value, Mapping) or _is_array_of_tables(value))


def _is_array_of_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(one, Mapping) for one in value)
