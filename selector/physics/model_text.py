"""What does a model file say: TOML text → checked values, or an error that names the key; the same for all kinds."""

import difflib
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError

from selector.errors import ModelFileError
from selector.text_file import text_of

MOST_SAMPLES = 2_000_000  #: Samples of one run, and steps of the calculation where they are as long as the samples.
NO_SUCH_KIND = "no_such_kind"  #: Type of the problem where a table has none of the kinds that it may have.
_MARK = "\x1f"  #: No name and no key of a file may hold it, so that it tells choices from keys.


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

    Raises ValueError: it is empty, longer than 100 characters, or has control characters.
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


_WORDS = {
    "dict_type": "a table, { key = value }",
    "model_type": "a table, { key = value }",
    "model_attributes_type": "a table, { key = value }",
    "tuple_type": "an array, [ … ]",
    "list_type": "an array, [ … ]",
    "string_type": 'a text in quotation marks, "…"',
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "missing": "a further value",
    "string_pattern_mismatch": "a letter, then letters, digits and _, 16 at most",
}
_ENTRIES = {"Dictionary": "entry", "String": "character"}


def expected_text(problem: Mapping[str, Any]) -> str:
    """What a problem that pydantic found asks for, e.g. "at most 2 values"."""
    kind, limits = str(problem["type"]), problem.get("ctx", {})
    if kind in _WORDS:
        return _WORDS[kind]
    if kind in ("too_long", "too_short", "string_too_long", "string_too_short"):
        bound, count = ("at most", "max_length") if kind.endswith("long") else ("at least", "min_length")
        what = "character" if kind.startswith("string") else _ENTRIES.get(limits.get("field_type", ""), "value")
        number = limits[count]
        many = what if number == 1 else f"{what.removesuffix('y')}ies" if what.endswith("y") else f"{what}s"
        return f"{bound} {number} {many}"
    said = str(problem["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    return said.removeprefix("a valid ")


LARGEST_FILE_BYTES = 4_000_000  #: A thermal network of the largest size that is allowed takes a tenth of it.
Key = tuple[str | int, ...]
#: (key, found, expected, advice) of what does not fit together in a file whose values are valid one by one.
Contradiction = tuple[Key, str, str, str]
File = TypeVar("File", bound=Entry)

_MOST_PARTS = 32
_MOST_NAMED = 8
_PART = r"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
#: A value alone: its key belongs before it.
_VALUE = re.compile(r"""[-+]?(?:[\d.]+(?:e[-+]?\d+)?|inf|nan)|'[^']*'|\[[^\]]*\]""")
#: Reading a dotted key takes a time that grows with the square of its parts.
_LONG_KEY = re.compile(rf"(?:{_PART}[ \t]*+\.[ \t]*+){{{_MOST_PARTS}}}")


@dataclass(frozen=True)
class ModelFamily(Generic[File]):
    """The model files of one physics."""

    physics: str  #: What they are called: "thermal" for thermal model files
    kinds: Mapping[str, type[File]]  #: ``kind`` in ``[model]`` → its sections
    #: File → whatever does not fit together in it, as (key, found, expected, advice)
    contradictions: Callable[[File], Iterable[Contradiction]]
    #: page and examples: Page that explains every key; folder with examples
    page: str
    examples: str
    #: columns_needed and column_roles: File → key → column of a recording beside it that it refers to; key → role
    columns_needed: Callable[[File], Mapping[str, Any]] = lambda file: {}
    column_roles: Mapping[str, str] = field(default_factory=dict)
    numbers: Callable[[File], Iterable[Any]] = lambda file: ()  #: File → every `Number` that is one of its parameters
    #: File, its path → the same with whole paths of what it names beside it
    with_files: Callable[[File, Path], File] = lambda file, path: file

    def read(self, path: str | Path) -> File:
        """The model file at `path`.

        Raises ModelFileError: the file cannot be read, is not TOML, has an unknown key (the nearest known one is
        named), a value of the wrong kind or outside its limits, or two places that contradict each other; the message
        names file and key.
        """
        place, expected = Path(path), f"a {self.physics} model file (TOML text)"

        def refused(found: str) -> ModelFileError:
            advice = f"check the path; see {self.examples}"
            return ModelFileError(found, expected=expected, where=str(place), advice=advice)

        return self.with_files(self.parsed(text_of(place, LARGEST_FILE_BYTES, refused), where=str(path)), place)

    def parsed(self, text: str, *, where: str = "model file") -> File:
        """The model file with this content; `where` names it in messages. Errors as `read`."""
        return self.checked(sections_of_text(text, where=where), where=where)

    def checked(self, values: Mapping[str, Any], *, where: str = "model file") -> File:
        """The model file with these sections as plain values. Errors as `read`."""
        schema = self._schema(values, where)
        try:
            file = schema.model_validate(dict(values))
        except ValidationError as error:
            raise invalid(error.errors(include_url=False), schema, where, self.page, self.kinds) from None
        for key, found, expected, advice in self.contradictions(file):
            if _VALUE.fullmatch(found):
                found = f"{_name_of(key)} = {found}"
            raise ModelFileError(found, expected=expected, where=f"{where}, key {key_text(key)}", advice=advice)
        return file

    def _schema(self, values: Mapping[str, Any], where: str) -> type[File]:
        section = values.get("model")
        kind = section.get("kind") if isinstance(section, Mapping) else None
        if isinstance(kind, str) and kind in self.kinds:
            return self.kinds[kind]
        # which kinds there are is known above
        from selector.physics.simulation_kind import kind_of_file

        other = kind_of_file(kind) if isinstance(kind, str) else None
        example = f'begin the file with [model], kind = "{next(iter(self.kinds))}" and name = "…"'
        raise ModelFileError(
            f"kind {shown(kind)}" if isinstance(section, Mapping) and "kind" in section else "no kind of model",
            expected="one of " + ", ".join(f'"{name}"' for name in self.kinds),
            where=f"{where}, key model.kind",
            advice=f"run such a model with `selector simulate {other.name}`" if other else example,
        )


def word_of_kind(model: Path) -> Any:
    """What stands under ``kind`` in a model file, be it no word; None if nothing does.

    Raises OSError, TOMLDecodeError or RecursionError: the file cannot be read.
    """
    with model.open("rb") as file:
        text = file.read(LARGEST_FILE_BYTES).decode("utf-8-sig", errors="replace")
    section = tomllib.loads(text.replace("\r\n", "\n")).get("model")
    return section.get("kind") if isinstance(section, dict) else None


def invalid(
    problems: Iterable[Any],
    schema: type[BaseModel],
    where: str,
    page: str,
    kinds: Mapping[str, type[BaseModel]] | None = None,
) -> ModelFileError:
    """What pydantic found, in words: the first thing that is wrong, and where the others are.

    Unknown keys come before missing ones. `page` explains the keys; `kinds` are others to which a section may belong.
    """
    rank = {"extra_forbidden": 0, "missing": 2}
    first, *others = sorted(problems, key=lambda one: rank.get(one["type"], 1))
    key, held = _key_of(first), first["input"]
    if first["type"] == "missing":
        # keys that lack in one place are one mistake
        alike = [one for one in others if one["type"] == "missing" and one["loc"][:-1] == first["loc"][:-1]]
        return _missing(schema, [first, *alike], [one for one in others if one not in alike], where, page)
    kindless = first["type"] == NO_SUCH_KIND and isinstance(held, Mapping)
    if kindless:
        key, held = (*key, "kind"), held.get("kind")
    place, more = f"{where}, key {key_text(key)}", _also(others)
    if first["type"] == "extra_forbidden":
        fields = (one for entry in _entries_at(schema, first["loc"][:-1]) for one in entry.model_fields.items())
        known = list(dict.fromkeys(field.alias or name for name, field in fields))
        near = _closest(str(key[-1]), known)
        elsewhere = [name for name, other in (kinds or {}).items() if len(key) == 1 and key[0] in other.model_fields]
        advice = (
            f"this section belongs to models of kind {', '.join(elsewhere)}" if elsewhere else "correct the spelling"
        )
        return ModelFileError(
            f"unknown key {shown(key[-1])}{more}",
            expected=(f"{near!r} perhaps; " if near else "") + "one of " + ", ".join(known),
            where=place,
            advice=f"{advice}, or remove it; {page} explains every key",
        )
    expected, advice = expected_text(first), f"correct this value; {page} explains it"
    found = shown(held) if isinstance(held, Mapping) else f"{_name_of(key)} = {shown(held)}"
    header = _header_at(schema, first["loc"], key)
    if header and isinstance(held, Mapping | list) and header.startswith("[[") == isinstance(held, Mapping):
        what = "one of them" if header.startswith("[[") else "it"
        expected, advice = f"{header} before {what}", f"correct the brackets; {page} explains the section"
    if kindless and held is None:
        found, advice = "no 'kind'", f'add kind = "…"; {page} explains each'
    return ModelFileError(f"{found}{more}", expected=expected, where=place, advice=advice)


def _missing(
    schema: type[BaseModel], lacking: Sequence[Any], others: Sequence[Any], where: str, page: str
) -> ModelFileError:
    """Keys, or sections, that lack in one place."""
    keys = [_key_of(one) for one in lacking]
    headers = [_header_at(schema, one["loc"], key) for one, key in zip(lacking, keys, strict=True)]
    found = [
        header or (shown(key[-1]) if isinstance(key[-1], str) else "further value")
        for key, header in zip(keys, headers, strict=True)
    ]
    one, sections = len(keys) == 1, all(headers)
    it = "it" if one else "them"
    place = keys[0] if one else keys[0][:-1]
    return ModelFileError(
        f"no {'section ' * sections}{', '.join(found)}{_also(others)}",
        expected=f"this {'section' if sections else 'key'}" if one else "all of these",
        where=f"{where}, key {key_text(place)}" if place else where,
        advice=f"add {it}; {page} explains {it}",
    )


def sections_of_text(text: str, *, where: str) -> dict[str, Any]:
    """The sections of a TOML text as plain values; `where` names it in messages.

    Raises ModelFileError: it is not TOML, or made so that reading it would take very long.
    """
    long = _LONG_KEY.search(text)
    if long is not None:
        raise ModelFileError(
            f"a key of more than {_MOST_PARTS} parts ({shown(long.group()[:30])} …)",
            expected="keys of a few parts, such as nodes.bed.place",
            where=f"{where}, line {text.count(chr(10), 0, long.start()) + 1}",
            advice="correct this line",
        )
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        said = "nested too deep" if isinstance(error, RecursionError) else str(error)[:200]
        raise ModelFileError(
            f"text that is not TOML ({said})",
            expected="sections such as [model] and [run], each once, with key = value lines; double brackets, [[…]], "
            "before each of what comes several times",
            where=where,
            advice="correct this line; texts need quotation marks, numbers a decimal point and no unit",
        ) from None


def file_beside(model: Path, name: str, where: str, what: str) -> Path:
    """The file of this name in the folder of the model file, or below it; `what` says what it holds.

    Raises ModelFileError: the name leads elsewhere, also through a link.
    """
    folder = model.resolve().parent
    path = (folder / name).resolve()
    if Path(name).is_absolute() or not path.is_relative_to(folder):
        raise ModelFileError(
            f"{name!r}, which is outside the folder of the model file",
            expected="a file beside the model file, or in a folder below it",
            where=where,
            advice=f"copy the {what} there",
        )
    return path


def plain_values(file: Entry) -> dict[str, Any]:
    """The sections as plain values, as they were given; `ModelFamily.checked` makes an equal file of them."""
    return file.model_dump(mode="python", exclude_unset=True)


def bound_contradictions(bounds: Mapping[str, tuple[float, float]]) -> Iterator[Contradiction]:
    """Those of ``[bounds]``: limits in the wrong order."""
    for name, (low, high) in bounds.items():
        if low >= high:
            yield ("bounds", name), f"[{low:g}, {high:g}]", "a lower and a higher limit", "exchange the two numbers"


def key_text(key: Sequence[str | int]) -> str:
    """A place in a TOML file as text; entries of an array count from 1.

    >>> key_text(("links", 2, "between")), key_text(("nodes", "upper bearing", "xyz"))
    ('links[3].between', 'nodes."upper bearing".xyz')
    """
    text = ""
    for part in key:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            # at most a line of it: a key may be as long as the file
            word = part if re.fullmatch(r"[A-Za-z0-9_-]{1,60}", part) else json.dumps(part[:60])
            text += f".{word}" if text else word
    return text


def unknown_name(what: str, name: str, known: Sequence[str], *, add: str = "") -> tuple[str, str, str]:
    """(found, expected, advice) of a name that does not exist, with the nearest that does; `add` is how to make it."""
    near = _closest(name, known)
    if not known:
        advice = f"add the {what}{f': {add}' if add else ''}, or leave out what names it"
        return f"no {what} called {name!r}", f"a {what} of the file, which has none", advice
    return (
        f"no {what} called {name!r}",
        (f"{near!r} perhaps; " if near else "") + "one of " + ", ".join(known[:20]),
        "correct the name, or add what it names",
    )


def shown(value: object) -> str:
    """A value of the file on one short line of printable characters."""
    if isinstance(value, Mapping):
        return f"a table with {len(value)} keys"
    if isinstance(value, list | tuple) and len(value) > 8:
        return f"an array of {len(value)} values"
    if isinstance(value, int) and abs(value) >= 10**18:
        return "a number beyond all limits"
    text = ascii(value)
    return text if len(text) <= 80 else f"{text[:79]}…"


def _name_of(key: Key) -> str:
    """The last name of a key, with the numbers behind it."""
    named = [place for place, part in enumerate(key) if isinstance(part, str)]
    return key_text(key[named[-1] :]) if named else key_text(key)


def _key_of(problem: Mapping[str, Any]) -> Key:
    """The place of what is wrong, as a key of the file."""
    return tuple(part for part in problem["loc"] if not is_choice_tag(part) and part != "[key]")


def _also(others: Sequence[Mapping[str, Any]]) -> str:
    """Where else something is wrong, to stand behind what was found; empty for nowhere."""
    words = {"extra_forbidden": "unknown ", "missing": "no "}
    named = [f"{words.get(one['type'], '')}{key_text(_key_of(one))}" for one in others]
    more = f" and {len(named) - _MOST_NAMED} more" if len(named) > _MOST_NAMED else ""
    return f" (also wrong: {', '.join(named[:_MOST_NAMED])}{more})" if named else ""


def _header_at(schema: type[BaseModel], path: Sequence[str | int], key: Key) -> str:
    """How a section that lacks would begin; empty for what is no section."""
    for entry in _entries_at(schema, path[:-1]):
        field = entry.model_fields.get(str(path[-1]))
        if field is not None and entries_in(field.annotation):
            origin = get_origin(field.annotation)
            header = f"[{key_text(key)}{'.NAME' if origin is dict else ''}]"
            return f"[{header}]" if origin is tuple else header
    return ""


def _entries_at(schema: type[BaseModel], path: Sequence[str | int]) -> list[type[BaseModel]]:
    """What the section at this path may be."""
    entries: list[type[BaseModel]] = [schema]
    annotations: list[Any] = []
    for part in path:
        if is_choice_tag(part):
            entries = [entry for annotation in annotations for entry in entries_in(annotation, str(part))]
        elif inner := [e.model_fields[part].annotation for e in entries if part in e.model_fields]:
            annotations = inner
            entries = [entry for annotation in annotations for entry in entries_in(annotation)]
    return entries


def entries_in(annotation: Any, tag: str | None = None) -> list[type[BaseModel]]:
    """Sections inside a type such as ``dict[str, Node]``; of a choice with a tag, that one."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    inner = get_args(annotation)
    if any(isinstance(part, Tag) and tag not in (None, part.tag) for part in inner):
        return []
    return [entry for part in inner for entry in entries_in(part, tag)]


def _closest(name: str, among: Sequence[str]) -> str | None:
    near = difflib.get_close_matches(name[:100].lower(), [known.lower() for known in among], n=1, cutoff=0.5)
    return next((known for known in among if near and known.lower() == near[0]), None)
