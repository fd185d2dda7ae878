"""What does a thermal model file say: TOML text → checked values, or an error that names the key."""

from __future__ import annotations

import difflib
import json
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from selector.errors import ModelFileError
from selector.physics.thermal.model_mistakes import expected_text
from selector.physics.thermal.model_schema import (
    COURSE_KINDS,
    KINDS,
    MOST_SAMPLES,
    Column,
    Entry,
    FieldFile,
    ModelFile,
    ModesFile,
    NetworkFile,
)

LARGEST_FILE_BYTES = 4_000_000
"""A network of the largest size that is allowed takes a tenth of it."""

PAGE = "docs/reference/thermal-model.md"
Key = tuple[str | int, ...]

_MOST_PARTS = 32
_PART = r"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?:{_PART}[ \t]*+\.[ \t]*+){{{_MOST_PARTS}}}")
"""Reading a dotted key takes a time that grows with the square of its parts."""


def read_model_file(path: str | Path) -> ModelFile:
    """The thermal model file at `path`.

    Raises
    ------
    ModelFileError
        The file cannot be read, is not TOML, has an unknown key (the nearest known one is named), a value of the wrong
        kind or outside its limits, or two places that contradict each other; the message names file and key.
    """
    place = Path(path)
    if place.exists() and not (place.is_file() or place.is_dir()):
        # opening a pipe would wait for ever
        raise _no_model_file("not a regular file but a device, a pipe or a socket", str(place))
    try:
        with place.open("rb") as file:
            content = file.read(LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise _no_model_file(f"a file that cannot be opened ({error.strerror or error})", str(place)) from error
    if len(content) > LARGEST_FILE_BYTES:
        raise _no_model_file(f"a file of more than {LARGEST_FILE_BYTES // 10**6} MB", str(place))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _no_model_file(f"text that is not UTF-8 at byte {error.start}", str(place)) from None
    return parsed_model_file(text.replace("\r\n", "\n"), where=str(place))


def parsed_model_file(text: str, *, where: str = "model file") -> ModelFile:
    """The thermal model file with this content; `where` names it in messages.

    Raises
    ------
    ModelFileError
        As `read_model_file`.
    """
    long = _LONG_KEY.search(text)
    if long is not None:
        raise ModelFileError(
            f"a key of more than {_MOST_PARTS} parts ({_shown(long.group()[:30])} …)",
            expected="keys of a few parts, such as nodes.bed.place",
            where=f"{where}, line {text.count(chr(10), 0, long.start()) + 1}",
            advice="correct this line",
        )
    try:
        values = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        said = "nested too deep" if isinstance(error, RecursionError) else str(error)[:200]
        raise ModelFileError(
            f"text that is not TOML ({said})",
            expected="sections such as [model] and [run] with key = value lines",
            where=where,
            advice="correct this line; texts need quotation marks, numbers a decimal point and no unit",
        ) from None
    return checked_model_file(values, where=where)


def checked_model_file(values: Mapping[str, Any], *, where: str = "model file") -> ModelFile:
    """The thermal model file with these sections as plain values.

    Raises
    ------
    ModelFileError
        As `read_model_file`.
    """
    section = values.get("model")
    kind = section.get("kind") if isinstance(section, Mapping) else None
    if not isinstance(kind, str) or kind not in KINDS:
        raise ModelFileError(
            f"kind {_shown(kind)}" if isinstance(section, Mapping) and "kind" in section else "no kind of model",
            expected="one of " + ", ".join(f'"{name}"' for name in KINDS),
            where=f"{where}, key model.kind",
            advice='begin the file with [model], kind = "network" and name = "…"',
        )
    schema = KINDS[kind]
    try:
        read: ModelFile = schema.model_validate(dict(values))
    except ValidationError as error:
        raise _invalid(error, schema, where) from None
    for key, found, expected, advice in contradictions(read):
        raise ModelFileError(found, expected=expected, where=f"{where}, key {key_text(key)}", advice=advice)
    return read


def plain_values(file: ModelFile) -> dict[str, Any]:
    """The sections as plain values, as they were given; `checked_model_file` makes an equal file of them."""
    return file.model_dump(mode="python", exclude_unset=True)


def columns_needed(file: ModelFile) -> dict[str, Column]:
    """Condition → column of a recording that it is read from."""
    conditions = file.conditions
    courses = {name: getattr(conditions, name) for name in type(conditions).model_fields}
    return {name: course for name, course in courses.items() if isinstance(course, Column)}


def require_few_samples(file: ModelFile, duration_s: float, where: str) -> None:
    """Refuses a run of this length [s] that the sampling and the steps of the file make too long to be held.

    Raises
    ------
    ModelFileError
        It has more than `MOST_SAMPLES` samples or steps.
    """
    count = duration_s / min(file.run.period_s, file.run.step_s)
    if count > MOST_SAMPLES:
        raise ModelFileError(
            f"{duration_s / 3600:.6g} h, which make {count:.3g} samples or steps",
            expected=f"at most {MOST_SAMPLES}",
            where=where,
            advice="make run.period_s and run.step_s of the model file larger, or simulate a shorter time",
        )


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


def contradictions(file: ModelFile) -> Iterator[tuple[Key, str, str, str]]:
    """(key, found, expected, advice) of whatever does not fit together in a file whose values are valid one by one."""
    run = file.run
    for key in ("period_s", "step_s"):
        count = run.duration_min * 60.0 / getattr(run, key)
        if count > MOST_SAMPLES:
            advice = f"make {key} larger or duration_min shorter"
            yield ("run", key), f"{count:.3g} samples or steps", f"at most {MOST_SAMPLES}", advice
    for name in type(file.conditions).model_fields:
        steps = getattr(file.conditions, name)
        if isinstance(steps, tuple):
            starts = [start for start, _ in steps]
            if starts[0] != 0.0 or any(b <= a for a, b in pairwise(starts)):
                advice = "begin with [0, …] and sort the steps; one value a time"
                yield ("conditions", name), f"steps at {starts[:6]} min", "times that begin with 0 and increase", advice
    if isinstance(file, NetworkFile):
        yield from _of_network(file)
    if isinstance(file, ModesFile):
        yield from _of_modes(file)
    yield from _of_names(file)
    for name, (low, high) in file.bounds.items():
        if low >= high:
            yield ("bounds", name), f"[{low:g}, {high:g}]", "a lower and a higher limit", "exchange the two numbers"


def _of_network(file: NetworkFile) -> Iterator[tuple[Key, str, str, str]]:
    known = list(file.nodes)
    for number, link in enumerate(file.links):
        a, b = link.between
        for node in (a, b):
            if node not in file.nodes:
                yield ("links", number, "between"), *unknown_name("node", node, known)
        if a == b:
            yield ("links", number, "between"), f"{a!r} twice", "two different nodes", "name both ends of the link"
    pairs = Counter(frozenset(link.between) for link in file.links)
    for number, link in enumerate(file.links):
        if pairs[frozenset(link.between)] > 1:
            found, advice = f"{' and '.join(link.between)} linked twice", "add the conductances into one link"
            yield ("links", number, "between"), found, "one link between two nodes", advice
    for name, film in file.films.items():
        for node in film.area_m2:
            if node not in file.nodes:
                yield ("films", name, "area_m2"), *unknown_name("node", node, known)
    for name, source in file.sources.items():
        for node in source.shares:
            if node not in file.nodes:
                yield ("sources", name, "shares"), *unknown_name("node", node, known)
        total = sum(source.shares.values())
        if abs(total - 1.0) > 1e-6:  # numbers of a few digits add up to 1 far better than this
            yield ("sources", name, "shares"), f"shares that add up to {total:g}", "1", "share out all of the heat"
        if source.softening_per_k and source.at is None:
            advice = 'add at = "NODE", the node whose temperature thins the lubricant'
            yield ("sources", name, "softening_per_k"), "softening without a place", "a node", advice
        if source.at is not None and source.at not in file.nodes:
            yield ("sources", name, "at"), *unknown_name("node", source.at, known)
    for number, sensor in enumerate(file.sensors):
        if (sensor.at or sensor.name) not in file.nodes:
            yield ("sensors", number, "at"), *unknown_name("node", sensor.at or sensor.name, known)
    displacements = list(dict.fromkeys(d for node in file.nodes.values() for d in node.expansion_um_per_k))
    yield from _of_gauges(file, displacements)


def _of_modes(file: ModesFile) -> Iterator[tuple[Key, str, str, str]]:
    modes = file.modes
    for key, values in (("tau_s", modes.tau_s), ("speed_rpm", modes.speed_rpm)):
        if any(b <= a for a, b in pairwise(values)):
            yield ("modes", key), f"{list(values)[:8]}", "numbers that increase", "sort them; each once"
    for name, rows in modes.gains_um.items():
        shape = [len(row) for row in rows]
        if len(rows) != len(modes.speed_rpm) or set(shape) != {len(modes.tau_s)}:
            found = f"{len(rows)} rows of {sorted(set(shape))} gains"
            expected = f"{len(modes.speed_rpm)} rows (one a speed) of {len(modes.tau_s)} gains (one a mode)"
            yield ("modes", "gains_um", name), found, expected, "give one row for each speed of speed_rpm"
    yield from _of_gauges(file, list(modes.gains_um))


def _of_gauges(file: ModelFile, displacements: list[str]) -> Iterator[tuple[Key, str, str, str]]:
    for number, gauge in enumerate(file.gauges):
        if (gauge.of or gauge.name) not in displacements:
            yield ("gauges", number, "of"), *unknown_name("displacement", gauge.of or gauge.name, displacements)


def _of_names(file: ModelFile) -> Iterator[tuple[Key, str, str, str]]:
    entries: list[tuple[Key, str]] = []
    if not isinstance(file, ModesFile):
        entries += [(("sensors", number, "name"), sensor.name) for number, sensor in enumerate(file.sensors)]
    entries += [(("gauges", number, "name"), gauge.name) for number, gauge in enumerate(file.gauges)]
    taken = set(RECORDED_CONDITIONS)
    for key, name in entries:
        if name in taken:
            yield key, f"a second channel called {name!r}", "a name for each channel", "give it another name"
        taken.add(name)


RECORDED_CONDITIONS = ("time_s", "spindle_speed", "ambient", "torque", "coolant_on", "coolant", "machine_on")
"""Names of the channels that hold the conditions of a simulation; sensors and gauges have others."""


def unknown_name(what: str, name: str, known: Sequence[str]) -> tuple[str, str, str]:
    """(found, expected, advice) of a name that does not exist, with the nearest that does."""
    near = _closest(name, known)
    return (
        f"no {what} called {name!r}",
        (f"{near!r} perhaps; " if near else "") + "one of " + (", ".join(known[:20]) or "none, there are none"),
        "correct the name, or add what it names",
    )


def _no_model_file(found: str, where: str) -> ModelFileError:
    return ModelFileError(
        found, expected="a thermal model file (TOML text)", where=where, advice="check the path; see fixtures/thermal"
    )


def _invalid(error: ValidationError, schema: type[BaseModel], where: str) -> ModelFileError:
    """The first thing that is wrong, in words; a key that is not known before one that is missing."""
    problems: list[Any] = error.errors(include_url=False)
    rank = {"extra_forbidden": 0, "missing": 2}
    first = min(problems, key=lambda one: rank.get(one["type"], 1))
    key: Key = tuple(part for part in first["loc"] if part not in COURSE_KINDS and part != "[key]")
    place = f"{where}, key {key_text(key)}"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    if first["type"] == "extra_forbidden":
        known = _keys_at(schema, first["loc"][:-1])
        near = _closest(str(key[-1]), known)
        elsewhere = [name for name, other in KINDS.items() if len(key) == 1 and key[0] in other.model_fields]
        advice = (
            f"this section belongs to models of kind {', '.join(elsewhere)}" if elsewhere else "correct the spelling"
        )
        return ModelFileError(
            f"unknown key {_shown(key[-1])}{more}",
            expected=(f"{near!r} perhaps; " if near else "") + "one of " + ", ".join(known),
            where=place,
            advice=f"{advice}, or remove it; {PAGE} explains every key",
        )
    if first["type"] == "missing":
        found, expected = f"no {_shown(key[-1]) if isinstance(key[-1], str) else 'further value'}{more}", "this key"
    else:
        found = f"{_shown(first['input'])}{more}"
        expected = expected_text(first)
    return ModelFileError(found, expected=expected, where=place, advice=f"correct this value; {PAGE} explains it")


def _keys_at(schema: type[BaseModel], path: Sequence[str | int]) -> list[str]:
    """Keys that the section at this path may have."""
    kinds: list[Any] = [schema]
    for part in path:
        inner: list[Any] = []
        for kind in kinds:
            if isinstance(part, str) and part in kind.model_fields:
                inner += _entries_in(kind.model_fields[part].annotation)
            else:
                inner.append(kind)
        kinds = inner
    return list(dict.fromkeys(name for kind in kinds for name in kind.model_fields))


def _entries_in(annotation: Any) -> Iterable[type[Entry]]:
    """Sections inside a type such as ``dict[str, Node]``."""
    if isinstance(annotation, type) and issubclass(annotation, Entry):
        return [annotation]
    return [entry for inner in get_args(annotation) for entry in _entries_in(inner)]


def _closest(name: str, among: Sequence[str]) -> str | None:
    near = difflib.get_close_matches(name[:100].lower(), [known.lower() for known in among], n=1, cutoff=0.5)
    return next((known for known in among if near and known.lower() == near[0]), None)


def _shown(value: object) -> str:
    """A value of the file on one short line of printable characters."""
    if isinstance(value, Mapping):
        return f"a table with {len(value)} keys"
    if isinstance(value, list | tuple) and len(value) > 8:
        return f"an array of {len(value)} values"
    if isinstance(value, int) and abs(value) >= 10**18:
        return "a number beyond all limits"
    text = ascii(value)
    return text if len(text) <= 80 else f"{text[:79]}…"


__all__ = [
    "RECORDED_CONDITIONS",
    "FieldFile",
    "ModelFile",
    "ModesFile",
    "NetworkFile",
    "checked_model_file",
    "columns_needed",
    "contradictions",
    "key_text",
    "parsed_model_file",
    "plain_values",
    "read_model_file",
    "require_few_samples",
    "unknown_name",
]
