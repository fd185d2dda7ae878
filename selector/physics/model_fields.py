"""What stands at a field of a model file: unit, bounds of a fit, what machines have; sections of fields, and text.

A field says it once, as in ``mass_kg: Annotated[float, limited(1e-6, 1e6), Unit("kg"), Fit(), Usual(0.1, 1e4)]``;
parameters, their bounds, warnings about slips and the reference page come from there.
"""

import copy
import dataclasses
import math
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial, reduce
from itertools import pairwise
from operator import getitem
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Generic,
    Literal,
    Self,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from pydantic import AfterValidator, BaseModel, Field, StrictBool, create_model
from pydantic.fields import FieldInfo

from selector.errors import InputError, Misfit, ModelFileError, OptionError, refuse
from selector.findings import Finding, Where
from selector.physics.finding_table import FINDINGS
from selector.physics.model_text import (
    Contradiction,
    Entry,
    Key,
    ModelFamily,
    entries_in,
    key_text,
    limited,
    plain_values,
)
from selector.text_file import toml_key, toml_value

_File = TypeVar("_File", bound=Any)


@dataclass(frozen=True)
class Parameter:
    """A number of a model: its value, its unit, and the bounds between which a fit may look for it."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class ModelOfFile(Generic[_File]):
    """What a model file describes, ready to be run."""

    file: _File  #: The file's content
    family: ClassVar[ModelFamily[Any]]  #: How such files are read, and which of their numbers are parameters

    @property
    def name(self) -> str:
        """What the file calls it."""
        return str(self.file.model.name)

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Named numbers with units and bounds, see `numbers` of the model file; errors as `parameters_of`."""
        return parameters_of(self.file, self.family.numbers(self.file))

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same model with other values of some parameters; errors as `file_with`."""
        file = file_with(self.file, values, self.family.numbers(self.file), self.family.checked)
        return dataclasses.replace(self, file=file)


def numbers_in(value: Any, path: Key) -> Iterator[Key]:
    """Places of all numbers inside plain values, below `path`."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers_in(inner, (*path, key))
    elif isinstance(value, list | tuple):
        for position, inner in enumerate(value):
            yield from numbers_in(inner, (*path, position))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def put_at(values: Any, path: Key, value: Any) -> None:
    """Sets what stands at a place; sections that lack are made, arrays become lists and grow by one."""
    for part, following in pairwise(path):
        if isinstance(values, dict) and part not in values:
            values[part] = [] if isinstance(following, int) else {}
        if isinstance(values[part], tuple):
            values[part] = list(values[part])
        if isinstance(values[part], list) and following == len(values[part]):
            values[part].append({})
        values = values[part]
    values[path[-1]] = value


@dataclass(frozen=True)
class Number:
    """A number of a model file that could be fitted again."""

    path: Key  #: Where it stands in the plain values of the file
    value: float
    #: low and high: Bounds of a fit, unless ``[bounds]`` of the file says otherwise
    low: float
    high: float
    unit: str
    name: str = ""  #: Default: the keys that lead to it, arrays counted from 1
    limits: tuple[float, float] = (-math.inf, math.inf)  #: What its key may have, which no bounds may pass

    @property
    def called(self) -> str:
        """Its name."""
        return self.name or ".".join(str(part + 1) if isinstance(part, int) else part for part in self.path)


def parameters_of(file: Any, numbers: Iterable[Number]) -> dict[str, Parameter]:
    """Name → parameter; ``[bounds]`` of the file goes before the bounds of a number.

    Raises ModelFileError: ``[bounds]`` names what is no parameter, excludes the value of one, or allows what its key
    does not.
    """
    found: dict[str, Parameter] = {}
    for one in numbers:
        least, most = one.limits
        around = max(min(one.low, one.value), least), min(max(one.high, one.value), most)
        low, high = file.bounds.get(one.called, around)
        if not low <= one.value <= high:
            raise _bad_bounds(one.called, f"[{low:g}, {high:g}]", f"limits around the value, {one.value:g}")
        if low < least or high > most:
            expected = f"limits between {least:g} and {most:g}, as its key has them"
            raise _bad_bounds(one.called, f"[{low:g}, {high:g}]", expected)
        found[one.called] = Parameter(one.value, low, high, one.unit)
    for name in file.bounds:
        if name not in found:
            raise _bad_bounds(name, "no parameter of this name", "one of " + ", ".join(list(found)[:12]) + ", …")
    return found


def file_with(
    file: _File,
    values: Mapping[str, float],
    numbers: Iterable[Number],
    checked: Callable[..., _File],
    plain: Mapping[str, Any] | None = None,
) -> _File:
    """The model file with other values of some parameters, checked as if it were read.

    `values` are by the names of the parameters, `checked` makes a file of plain values; `plain` are those of the file,
    if they are more than it says.

    Raises OptionError: there is no such parameter, or the value is outside the bounds that the file gives it. Raises
    ModelFileError: a value is impossible, e.g. a negative mass.
    """
    changed = copy.deepcopy(dict(plain_values(file) if plain is None else plain))
    paths = {one.called: one.path for one in numbers}
    for name, value in values.items():
        refuse(_misfits(name, value, list(paths), file.bounds, file.model.name), OptionError)
        put_at(changed, paths[name], float(value))
    return checked(changed, where=f"model {file.model.name!r}")


def _misfits(
    name: str, value: float, known: Sequence[str], bounds: Mapping[str, tuple[float, float]], model: str
) -> Iterator[Misfit]:
    """A name that no parameter of the model has, or a value outside the bounds that its file gives."""
    where = f"model {model!r}"
    if name not in known:
        expected = "one of " + ", ".join(known[:12]) + ", …"
        yield f"no parameter {name!r}", expected, where, "look the names up in `parameters`"
    low, high = bounds.get(name, (-math.inf, math.inf))
    if value < low or value > high:
        expected = f"{low:g} to {high:g}, its bounds in the model file"
        yield f"{name} = {value:g}", expected, where, "stay within the bounds, or widen them in the file"


def _bad_bounds(name: str, found: str, expected: str) -> ModelFileError:
    """The error for an entry of ``[bounds]`` that cannot be."""
    advice = "correct the name and the limits, or leave them out"
    return ModelFileError(found, expected=expected, where=f"key bounds.{name}", advice=advice)


_TIMES = 10.0


@dataclass(frozen=True)
class Unit:
    """The unit of a number."""

    text: str

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: Any) -> dict[str, Any]:
        """The schema of the number, with its unit."""
        return {**handler(core_schema), "unit": self.text}


@dataclass(frozen=True)
class Limits:
    """What a file may say: the least size of what is not 0, and the most."""

    least: float
    most: float


@dataclass(frozen=True)
class Fit:
    """That a fit may look for a number, and where: a tenth to ten times its value unless said otherwise."""

    low: float | None = None  #: Least, whatever the value is
    high: float | None = None  #: Most, whatever the value is
    up_to: float | None = None  #: The number may be 0, which switches something off; how far at least it may go up
    either_sign: float | None = None  #: The number may have either sign; how far at least it may go
    at_zero: float | None = None  #: How far a number may go that is 0, in place of a tenth to ten times
    around: float | None = None  #: How far to both sides, in place of a tenth to ten times

    def bounds(self, value: float) -> tuple[float, float]:
        """Lower and upper bound, always around the value."""
        low, high = sorted((value / _TIMES, value * _TIMES))
        if self.around is not None:
            low, high = value - self.around, value + self.around
        if self.up_to is not None:
            low, high = 0.0, max(self.up_to, _TIMES * value)
        if self.either_sign is not None:
            high = max(self.either_sign, _TIMES * abs(value))
            low = -high
        if value == 0.0 and self.at_zero is not None:
            low, high = (0.0 if self.either_sign is None else -self.at_zero), self.at_zero
        low, high = (low if self.low is None else self.low), (high if self.high is None else self.high)
        return min(low, value), max(high, value)


@dataclass(frozen=True)
class Usual:
    """Between which numbers machines lie, and units that are easily taken for that of the key."""

    low: float
    high: float
    units: Mapping[str, float] = field(
        default_factory=dict, hash=False
    )  #: Another unit → how many of the unit of the key it is


def numbers_of(value: Any, path: Key = (), said: Iterable[Any] = ()) -> Iterator[Number]:
    """Every number in a model file, a part of it or a dataclass that says where a fit may look for it.

    `said` stands at the value itself, if it is not a section.
    """
    if isinstance(value, BaseModel) or dataclasses.is_dataclass(value):
        for name, inner, told in _members(value):
            yield from numbers_of(inner, (*path, name), told)
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers_of(inner, (*path, key), said)
    elif isinstance(value, tuple | list):
        for position, inner in enumerate(value):
            yield from numbers_of(inner, (*path, position), said)
    elif isinstance(value, float | int):
        for fit in (one for one in said if isinstance(one, Fit)):
            yield Number(path, float(value), *fit.bounds(float(value)), unit_in(said))


def unit_in(said: Iterable[Any]) -> str:
    """The unit among what a field says; "1" if none."""
    return next((one.text for one in said if isinstance(one, Unit)), "1")


def _members(section: Any) -> Iterator[tuple[str, Any, tuple[Any, ...]]]:
    """(name, value, what is said) of every field."""
    if isinstance(section, BaseModel):
        for name, told in type(section).model_fields.items():
            yield name, getattr(section, name), said_of(told)
        return
    for name, hint in get_type_hints(type(section), include_extras=True).items():
        yield name, getattr(section, name), _said_in(hint)


def unlikely_values(file: Entry, channel_of: Callable[[Key], str | None] = lambda path: None) -> Iterator[Finding]:
    """Warnings on numbers of a model file that no machine has; each with the unit that was perhaps meant.

    `channel_of` gives the channel or axis that a place in the file is about, if it is about one.
    """
    usual: dict[str, Usual] = {}
    units: dict[str, str] = {}
    for section, name, told in _fields(type(file)):
        notes = said_of(told)
        units[name] = unit_in(notes)
        range_ = next((one for one in notes if isinstance(one, Usual)), None)
        if range_ is not None:
            usual[f"{section}.{name}" if section else name] = range_
    values: Any = plain_values(file)
    for path in numbers_in(values, ()):
        names = [part for part in path if isinstance(part, str)]
        span = usual.get(".".join(names[-2:])) or usual.get(names[-1])
        value = float(reduce(getitem, path, values))
        if span is None or value == 0 or span.low <= abs(value) <= span.high:
            continue
        key, unit = key_text(path), units[names[-1]].removeprefix("1")
        meant = next(
            (
                (name, value * times)
                for name, times in span.units.items()
                if span.low <= abs(value * times) <= span.high
            ),
            None,
        )
        most = f"up to {span.high:g}" if span.low == 0 else f"{span.low:g} to {span.high:g}"
        said = f"{key} is {value:.6g} {unit}".rstrip() + f"; machines have {most} {unit}".rstrip() + "."
        if meant is not None:
            said += f" {value:.6g} {meant[0]} would be {meant[1]:.6g} {unit}".rstrip() + "."
        yield FINDINGS.finding(
            "unlikely-value",
            said,
            Where(channel=channel_of(path)),
            evidence={"key": key, "value": value, "low": span.low, "high": span.high, "perhaps": meant and meant[1]},
            suggestion="correct it if it is a slip"
            if meant is None
            else f"write {key} = {meant[1]:.6g} if {meant[0]} was meant",
        )


def _fields(schema: type[BaseModel], section: str = "") -> Iterator[tuple[str, str, Any]]:
    """(key of the section, empty if the file names it, key, field) of everything in a schema."""
    for name, told in schema.model_fields.items():
        yield section, name, told
        for inner in entries_in(told.annotation):
            yield from _fields(inner, "" if get_origin(told.annotation) is dict else name)


def said_of(told: FieldInfo) -> tuple[Any, ...]:
    """All that is said at a field of a schema, also where it may be left out."""
    return (*told.metadata, *_said_in(told.annotation))


def _said_in(hint: Any) -> tuple[Any, ...]:
    inside = (one for inner in get_args(hint) for one in getattr(inner, "__metadata__", ()))
    return (*getattr(hint, "__metadata__", ()), *inside)


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
    for one in dataclasses.fields(kind):
        default: Any = ...
        if one.default is not dataclasses.MISSING:
            default = one.default
        elif one.default_factory is not dataclasses.MISSING:
            default = _default(hints[one.name], one.default_factory())
        keys[one.name] = (_key_type(hints[one.name]), default)
    return create_model(f"{kind.__name__}Section", __base__=Entry, __doc__=kind.__doc__, **keys, **more)


if TYPE_CHECKING:

    class SectionOf(Entry, Generic[Value]):
        """``SectionOf[Kind]``, as the type of a field, is ``entry_of(Kind)``."""
else:

    class SectionOf:
        """``SectionOf[Kind]``, as the type of a field, is ``entry_of(Kind)``."""

        @classmethod
        @cache
        def __class_getitem__(cls, kind):
            return entry_of(kind)


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
        inner: Any = next((one for one in (hints[name], *get_args(hints[name])) if dataclasses.is_dataclass(one)), None)
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
        raise error.at(f"{name}.{error.where}") from error


def _default(hint: Any, value: Any) -> Any:
    hint = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    if dataclasses.is_dataclass(value):
        return entry_of(hint).model_construct()
    return dict(value) if isinstance(value, Mapping) else value


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
    is_array = isinstance(value, list | tuple) and bool(value) and all(isinstance(one, Mapping) for one in value)
    return depth < _DEEPEST and (isinstance(value, Mapping) or is_array)
