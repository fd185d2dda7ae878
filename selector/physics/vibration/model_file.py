"""What does the model file of a vibration say: TOML text → checked values, or an error that names the key."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from selector.errors import InputError
from selector.physics.model_entries import Entry
from selector.physics.model_text import (
    Contradiction,
    Key,
    ModelFamily,
    bound_contradictions,
    key_text,
    plain_values,
    unknown_name,
)
from selector.physics.model_values import refused
from selector.physics.vibration.chain import chain_links, force_sign
from selector.physics.vibration.model_parts import chain_of, file_shafts, file_structure, own_course, source_of
from selector.physics.vibration.model_schema import (
    KINDS,
    LEAST_PERIOD_S,
    MOST_LINES,
    MOST_SAMPLES,
    MOST_SINES,
    ChainSection,
    ShaftSection,
    VibrationFile,
)
from selector.physics.vibration.source import Line
from selector.physics.vibration.structure import GROUND, Joint, Member

FEWEST_SAMPLES = 4
"""In a run: with fewer there is nothing to see of a vibration."""


def read_model_file(path: str | Path) -> VibrationFile:
    """The model file of a vibration at `path`.

    Raises
    ------
    ModelFileError
        As `selector.physics.model_text.ModelFamily.read`.
    """
    return _FAMILY.read(path)


def parsed_model_file(text: str, *, where: str = "model file") -> VibrationFile:
    """The model file with this content; `where` names it in messages. Errors as `read_model_file`."""
    return _FAMILY.parsed(text, where=where)


def checked_model_file(values: Mapping[str, Any], *, where: str = "model file") -> VibrationFile:
    """The model file with these sections as plain values. Errors as `read_model_file`."""
    return _FAMILY.checked(values, where=where)


def contradictions(file: VibrationFile) -> Iterator[Contradiction]:
    """(key, found, expected, advice) of whatever does not fit together in a file whose values are valid one by one."""
    yield from _of_structure(file)
    yield from _of_shafts(file)
    yield from _of_sources(file)
    yield from _of_finals(file)
    yield from _of_chains(file)
    yield from _of_run(file)
    yield from bound_contradictions(file.bounds)


def _tried(make: Callable[[], object], key: Key, section: Entry | None) -> Iterator[Contradiction]:
    """What making a value refuses, if anything."""
    try:
        make()
    except InputError as error:
        yield refused(error, key, section)


def _of_structure(file: VibrationFile) -> Iterator[Contradiction]:
    known = [*file.members, GROUND]
    for name, member in file.members.items():
        for _, found, expected, advice in _tried(partial(Member, name, member.mass_kg), ("members",), None):
            yield ("members", name), found, expected, advice
    for number, joint in enumerate(file.joints):
        key: Key = ("joints", number)
        for side, name in enumerate(joint.between):
            if name not in known:
                yield (*key, "between", side), *unknown_name("member", name, known)
        yield from _tried(partial(Joint, joint.between, joint.stiffness_n_per_m), key, joint)
    yield from _tried(partial(file_structure, file), ("joints",), None)


def _of_shafts(file: VibrationFile) -> Iterator[Contradiction]:
    for name, shaft in file.shafts.items():
        key: Key = ("shafts", name)
        if (shaft.rpm is None) == (shaft.of is None):
            found = "both rpm and of" if shaft.of is not None else "neither rpm nor of"
            yield key, found, "one of them", 'give its own speed, rpm = 1200, or of = "SHAFT" and ratio = 0.5'
        elif shaft.of is None and shaft.ratio is not None:
            yield (*key, "ratio"), "a ratio without of", "the shaft that it follows", "add of, or leave ratio out"
        elif shaft.of is not None and shaft.of not in file.shafts:
            yield (*key, "of"), *_unknown_shaft(file, shaft.of)
        elif shaft.of is not None and _follows_itself(name, file.shafts):
            advice = "give one of these shafts a speed of its own"
            yield (*key, "of"), f"{name!r} following itself", "a shaft that turns at last", advice
        elif isinstance(shaft.rpm, tuple):
            times = [time_s for time_s, _ in shaft.rpm]
            if times[0] != 0.0 or any(b <= a for a, b in pairwise(times)):
                found, expected = f"corners at {times[:6]} s", "times that begin with 0 and increase"
                yield (*key, "rpm"), found, expected, "begin with [0, …] and sort the corners; one speed a time"
            elif own_course(shaft).range_rpm(0.0, file.run.duration_s)[1] == 0:
                yield (*key, "rpm"), "a shaft that stands", "a speed above 0", "leave the shaft and its lines out"
        elif shaft.rpm == 0:
            yield (*key, "rpm"), "a shaft that stands", "a speed above 0", "leave the shaft and its lines out"


def _unknown_shaft(file: VibrationFile, name: str) -> tuple[str, str, str]:
    return unknown_name(
        "shaft", name, list(file.shafts), add=f"[{key_text(('shafts', name))}] and rpm = 1200, for example"
    )


def _follows_itself(name: str, shafts: Mapping[str, ShaftSection]) -> bool:
    seen, at = {name}, shafts[name].of
    while at is not None and at in shafts:
        if at in seen:
            return True
        seen.add(at)
        at = shafts[at].of
    return False


def _of_sources(file: VibrationFile) -> Iterator[Contradiction]:
    known, lines = list(file.members), 0
    courses = file_shafts(file)
    for name, source in file.sources.items():
        key: Key = ("sources", name)
        if source.member not in known:
            yield (*key, "member"), *unknown_name("member", source.member, known)
        if source.against is not None and source.against not in known:
            advice = "leave against out where it pushes against the ground"
            yield (*key, "against"), *unknown_name("member", source.against, known)[:2], advice
        if source.shaft is not None and source.shaft not in file.shafts:
            yield (*key, "shaft"), *_unknown_shaft(file, source.shaft)
        for number, line in enumerate(source.lines):
            made = partial(Line, line.frequency_hz, line.order, line.force_n, line.unbalance_kg_m)
            yield from _tried(made, (*key, "lines", number), line)
        yield from _tried(partial(source_of, name, source), key, source)
        fastest = courses[source.shaft].range_rpm(0.0, file.run.duration_s)[1] if source.shaft else 0.0
        for number, line in enumerate(source.lines):
            yield from _too_fast(file, (*key, "lines", number), line.frequency_hz, line.order, fastest)
        lines += len(source.lines)
    if lines > MOST_LINES:
        yield ("sources",), f"{lines} lines", f"at most {MOST_LINES}", "leave out the lines without effect"


def _too_fast(
    file: VibrationFile, key: Key, frequency_hz: float | None, order: float | None, fastest_rpm: float
) -> Iterator[Contradiction]:
    """A line that the samples of the run would fold to another frequency."""
    highest = frequency_hz if frequency_hz is not None else (order or 0.0) * fastest_rpm / 60.0
    if highest * file.run.period_s >= 0.5:
        found = f"{highest:.6g} Hz, sampled every {file.run.period_s:g} s"
        slower = "the frequency" if frequency_hz is not None else "the order, the rpm of the shaft or a ratio"
        advice = (
            f"make run.period_s smaller than {0.5 / highest:.3g}, or leave the line out"
            if 0.5 / highest > LEAST_PERIOD_S
            else f"make {slower} smaller: no run.period_s is short enough; or leave the line out"
        )
        field = "order" if frequency_hz is None else "frequency_hz"
        yield (*key, field), found, "more than two samples in a period", advice


def _of_chains(file: VibrationFile) -> Iterator[Contradiction]:
    names, structure = [chain.name for chain in file.chains], file_structure(file)
    for number, section in enumerate(file.chains):
        key: Key = ("chains", number)
        if section.name in names[:number]:
            yield (*key, "name"), f"a second chain {section.name!r}", "every name once", "give it another name"
        yield from _unknown_in_chain(file, section, key)
        yield from _tried(partial(chain_of, section), key, section)
        chain = chain_of(section)
        yield from _in_chain(partial(chain_links, structure, chain), key)
        for name in section.sources:
            yield from _in_chain(partial(force_sign, chain, source_of(name, file.sources[name])), key)
    if file.run.method == "chains" and not file.chains:
        yield ("run", "method"), '"chains" without [[chains]]', "chains", 'add them, or say method = "coupled"'
    if len({chain.range for chain in file.chains}) > 1 and file.cutting is None:
        advice = "add [cutting], whose wavelengths part roughness from waviness, or keep the chains of one range"
        yield ("cutting",), "chains of both ranges", "the frequency between them", advice


def _in_chain(make: Callable[[], object], key: Key) -> Iterator[Contradiction]:
    """What making something of a chain refuses, if anything; it says where it is as ``chains.NAME.KEY``."""
    try:
        make()
    except InputError as error:
        yield (*key, error.where.rpartition(".")[2]), error.found, error.expected, error.advice


def _unknown_in_chain(file: VibrationFile, chain: ChainSection, key: Key) -> Iterator[Contradiction]:
    known = list(file.members)
    for what, groups in (("path", chain.path), ("branch", chain.branch)):
        for place, group in enumerate(groups):
            for name in group:
                if name not in known:
                    yield (*key, what, place), *unknown_name("member", name, known)
    if chain.final not in known:
        yield (*key, "final"), *unknown_name("member", chain.final, known)
    if chain.held not in (*known, GROUND):
        yield (*key, "held"), *unknown_name("member", chain.held, [*known, GROUND])
    for place, name in enumerate(chain.sources):
        if name not in file.sources:
            yield (*key, "sources", place), *unknown_name("source", name, list(file.sources))
    finals = (file.finals.tool, file.finals.workpiece)
    if chain.final not in finals:
        advice = "end the chain at one of them, or change [finals]"
        yield (*key, "final"), f"{chain.final!r}", f"{finals[0]!r} or {finals[1]!r}, the finals", advice


def _of_finals(file: VibrationFile) -> Iterator[Contradiction]:
    known = list(file.members)
    for key, name in (("tool", file.finals.tool), ("workpiece", file.finals.workpiece)):
        if name not in known:
            found, expected, _ = unknown_name("member", name, known)
            yield ("finals", key), found, expected, f'name the member: {key} = "MEMBER" under [finals]'
    if file.finals.tool == file.finals.workpiece:
        found = f"{file.finals.tool!r} as tool and workpiece"
        yield ("finals", "workpiece"), found, "two members", "name the one that cuts and the one that is cut"
    if file.cutting is not None and file.cutting.shaft not in file.shafts:
        yield ("cutting", "shaft"), *_unknown_shaft(file, file.cutting.shaft)


def _of_run(file: VibrationFile) -> Iterator[Contradiction]:
    run, samples = file.run, file.run.duration_s / file.run.period_s
    lines = sum(len(source.lines) for source in file.sources.values())
    if samples < FEWEST_SAMPLES:
        found = f"{run.duration_s:g} s in steps of {run.period_s:g} s"
        yield ("run", "duration_s"), found, f"at least {FEWEST_SAMPLES} samples", "make the run longer"
    for what, count, most in (
        ("samples", samples, MOST_SAMPLES),
        (f"sines to be added ({lines} lines in {math.ceil(samples)} samples)", samples * lines, MOST_SINES),
    ):
        if count > most:
            advice = "make the run shorter, or run.period_s larger"
            yield ("run", "duration_s"), f"{math.ceil(count)} {what}", f"at most {most}", advice


_FAMILY: ModelFamily[VibrationFile] = ModelFamily(
    "vibration", KINDS, contradictions, page="docs/reference/vibration-model.md", examples="fixtures/vibration"
)

__all__ = [
    "MOST_SAMPLES",
    "VibrationFile",
    "checked_model_file",
    "contradictions",
    "parsed_model_file",
    "plain_values",
    "read_model_file",
]
