"""What does a thermal model file say: TOML text → checked values, or an error that names the key."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from selector.errors import ModelFileError
from selector.physics.model_text import (
    Contradiction,
    Key,
    ModelFamily,
    bound_contradictions,
    key_text,
    plain_values,
    unknown_name,
)
from selector.physics.thermal.model_schema import (
    KINDS,
    MOST_SAMPLES,
    Column,
    FieldFile,
    ModelFile,
    ModesFile,
    NetworkFile,
)


def read_model_file(path: str | Path) -> ModelFile:
    """The thermal model file at `path`.

    Raises
    ------
    ModelFileError
        As `selector.physics.model_text.ModelFamily.read`.
    """
    return _FAMILY.read(path)


def parsed_model_file(text: str, *, where: str = "model file") -> ModelFile:
    """The thermal model file with this content; `where` names it in messages.

    Raises
    ------
    ModelFileError
        As `read_model_file`.
    """
    return _FAMILY.parsed(text, where=where)


def checked_model_file(values: Mapping[str, Any], *, where: str = "model file") -> ModelFile:
    """The thermal model file with these sections as plain values.

    Raises
    ------
    ModelFileError
        As `read_model_file`.
    """
    return _FAMILY.checked(values, where=where)


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


def contradictions(file: ModelFile) -> Iterator[Contradiction]:
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
    yield from bound_contradictions(file.bounds)


def _of_network(file: NetworkFile) -> Iterator[Contradiction]:
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


def _of_modes(file: ModesFile) -> Iterator[Contradiction]:
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


def _of_gauges(file: ModelFile, displacements: list[str]) -> Iterator[Contradiction]:
    for number, gauge in enumerate(file.gauges):
        if (gauge.of or gauge.name) not in displacements:
            yield ("gauges", number, "of"), *unknown_name("displacement", gauge.of or gauge.name, displacements)


def _of_names(file: ModelFile) -> Iterator[Contradiction]:
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

_FAMILY: ModelFamily[ModelFile] = ModelFamily(
    "thermal", KINDS, contradictions, page="docs/reference/thermal-model.md", examples="fixtures/thermal"
)


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
