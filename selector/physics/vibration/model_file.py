"""What does the model file of a vibration say: TOML text → checked values, numbers to be fitted, or an error."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag

from selector.errors import InputError
from selector.physics.model_fields import Fit, Number, Unit, Usual, numbers_of, refusals
from selector.physics.model_text import (
    MOST_SAMPLES,
    Contradiction,
    Entry,
    Key,
    ModelFamily,
    Name,
    Note,
    Seed,
    bound_contradictions,
    choice_tag,
    key_text,
    limited,
    unknown_name,
)
from selector.physics.vibration.chains import Chain, chain_links, force_sign
from selector.physics.vibration.structure import GROUND, Joint, Line, Member, ShaftCourse, Source, Structure

MOST_MEMBERS = 200
MOST_LINES = 2_000
LEAST_PERIOD_S = 1e-7
MOST_SINES = 500_000_000  #: Lines × samples of one run: some ten seconds.
HEAVIEST_KG = 2e5  #: No member of a machine is heavier.
Rpm = Annotated[float, limited(0, 1e6)]
Corner = tuple[Annotated[float, limited(0, 1e6)], Rpm]
_NUMBER, _CORNERS = choice_tag("number"), choice_tag("corners")

#: A speed that stays, or the corners of a course that is straight between them.
Speed = Annotated[
    Annotated[Rpm, Tag(_NUMBER)] | Annotated[tuple[Corner, ...], Field(min_length=2, max_length=10_000), Tag(_CORNERS)],
    Discriminator(lambda value: _CORNERS if isinstance(value, list | tuple) else _NUMBER),
]

Exponent = Annotated[float, limited(-10, 10)]
Limit = Annotated[float, limited(-1e15, 1e15)]
Bounds = Annotated[dict[str, tuple[Limit, Limit]], Field(max_length=5_000)]


class ModelSection(Entry):
    """``[model]``."""

    kind: Literal["vibration"]
    name: Name
    note: Note = ""


class RunSection(Entry):
    """``[run]``: how often, how long, from which phases, by which method."""

    period_s: Annotated[float, limited(LEAST_PERIOD_S, 10), Unit("s"), Usual(1e-6, 0.05, {"ms": 1e-3, "µs": 1e-6})]
    duration_s: Annotated[float, limited(0, 1e6, above=True), Unit("s")]
    seed: Seed = 0
    method: Literal["coupled", "chains"] = "coupled"


class MemberSection(Entry):
    """``[members.NAME]``."""

    mass_kg: Annotated[float, limited(1e-9, 1e9), Unit("kg"), Fit(), Usual(0.02, HEAVIEST_KG, {"t": 1e3, "g": 1e-3})]


class JointSection(Entry):
    """``[[joints]]``."""

    between: tuple[Name, Name]
    stiffness_n_per_m: Annotated[
        float, limited(1e-3, 1e15), Unit("N/m"), Fit(), Usual(1e5, 1e11, {"N/µm": 1e6, "N/mm": 1e3, "kN/mm": 1e6})
    ]
    #: No joint of a machine takes more of the energy in a cycle than 2; rubber takes as much
    dissipation: Annotated[float, limited(0, 100), Fit(up_to=2.0), Usual(0.0, 3.0, {"%": 0.01})] = 0.0


Groups = Annotated[
    tuple[Annotated[tuple[Name, ...], Field(min_length=1, max_length=MOST_MEMBERS)], ...],
    # a text in a path stands for a group of one
    BeforeValidator(
        lambda path: (
            [[one] if isinstance(one, str) else one for one in path] if isinstance(path, list | tuple) else path
        )
    ),
    Field(max_length=MOST_MEMBERS),
]


class ChainSection(Entry):
    """``[[chains]]``."""

    name: Name
    range: Literal["high", "low"]
    sources: Annotated[tuple[Name, ...], Field(min_length=1, max_length=50)]
    path: Annotated[Groups, Field(min_length=1)]
    final: Name
    branch: Groups = ()
    held: Name = GROUND


class LineSection(Entry):
    """One of ``lines`` of a source."""

    frequency_hz: Annotated[float, limited(1e-6, 1e6), Unit("Hz")] | None = None
    order: Annotated[float, limited(1e-6, 1e5)] | None = None
    force_n: Annotated[float, limited(0, 1e9), Unit("N"), Fit(), Usual(1e-4, 1e5, {"kN": 1e3, "mN": 1e-3})] = 0.0
    unbalance_kg_m: Annotated[
        float, limited(0, 1e4), Unit("kg·m"), Fit(), Usual(0.0, 1.0, {"g·mm": 1e-6, "kg·mm": 1e-3})
    ] = 0.0
    phase_rad: Annotated[float, limited(-1e3, 1e3), Unit("rad"), Fit(-math.pi, math.pi)] = 0.0


class SourceSection(Entry):
    """``[sources.NAME]``."""

    member: Name
    lines: Annotated[tuple[LineSection, ...], Field(min_length=1, max_length=MOST_LINES)]
    against: Name | None = None
    shaft: Name | None = None


class ShaftSection(Entry):
    """``[shafts.NAME]``: its own speed, or that of another one times a ratio."""

    rpm: Annotated[Speed | None, Unit("r/min")] = None
    of: Name | None = None
    ratio: Annotated[float, limited(0, 1e4, above=True)] | None = None


class CuttingSection(Entry):
    """``[cutting]``."""

    shaft: Name
    diameter_mm: Annotated[float, limited(0, 1e5, above=True), Unit("mm"), Usual(0.5, 2e4, {"m": 1e3})]
    feed_mm_per_rev: Annotated[float, limited(0, 1e3, above=True), Unit("mm/rev"), Usual(1e-3, 20.0, {"µm": 1e-3})]
    force_coefficient: Annotated[float, limited(0, 1e6, above=True), Usual(5.0, 2000.0, {"N": 0.1})]
    depth_exponent: Annotated[float, limited(0, 10, above=True)]
    feed_exponent: Exponent
    speed_exponent: Exponent
    force_correction: Annotated[float, limited(0, 1e3, above=True)] = 1.0


class SurfaceSection(Entry):
    """``[surface]``: where one kind of periodic error ends and the next begins."""

    roughness_below_mm: Annotated[float, limited(0, 1e3, above=True), Unit("mm")] = 0.8
    lobing_up_to_upr: Annotated[float, limited(2, 1e4)] = 15.0


class RealisationsSection(Entry):
    """``[realisations]``: phase shifts of every source, and how many times are looked at."""

    phases: Annotated[int, Field(strict=True, ge=1, le=360)] = 4
    sections: Annotated[int, Field(strict=True, ge=1, le=20_000)] = 1000


class FinalsSection(Entry):
    """``[finals]``: members whose motion is asked for."""

    tool: Name = "tool"
    workpiece: Name = "workpiece"


class SensingSection(Entry):
    """``[sensing]``."""

    noise_um: Annotated[float, limited(0, 1e4), Unit("µm"), Usual(0.0, 100.0, {"nm": 1e-3})] = 0.0


class VibrationFile(Entry):
    """A structure, what shakes it, and the cut that it shakes."""

    model: ModelSection
    run: RunSection
    members: Annotated[dict[Name, MemberSection], Field(min_length=1, max_length=MOST_MEMBERS)]
    joints: Annotated[tuple[JointSection, ...], Field(min_length=1, max_length=2_000)]
    chains: Annotated[tuple[ChainSection, ...], Field(max_length=50)] = ()
    sources: Annotated[dict[Name, SourceSection], Field(min_length=1, max_length=50)]
    shafts: Annotated[dict[Name, ShaftSection], Field(max_length=50)] = Field(default_factory=dict)
    cutting: CuttingSection | None = None
    surface: SurfaceSection = SurfaceSection()
    realisations: RealisationsSection = RealisationsSection()
    finals: FinalsSection = FinalsSection()
    sensing: SensingSection = SensingSection()
    bounds: Bounds = Field(default_factory=dict)


KINDS: Mapping[str, type[VibrationFile]] = {"vibration": VibrationFile}


def file_structure(file: VibrationFile) -> Structure:
    """The members and joints of a file."""
    members = tuple(Member(name, section.mass_kg) for name, section in file.members.items())
    return Structure(members, tuple(Joint(**dict(one)) for one in file.joints))


def source_of(name: str, section: SourceSection) -> Source:
    """The source that a section describes."""
    lines = tuple(Line(**dict(one)) for one in section.lines)
    return Source(name, section.member, lines, section.against, section.shaft)


def file_shafts(file: VibrationFile, replaced: Mapping[str, ShaftCourse] | None = None) -> dict[str, ShaftCourse]:
    """Shaft → its course, or what replaces it; one that follows another has that one's course times the ratio."""

    def course(name: str) -> ShaftCourse:
        shaft = file.shafts[name]
        if replaced is not None and name in replaced:
            return replaced[name]
        if shaft.of is None:
            return _own_course(shaft)
        led, ratio = course(shaft.of), 1.0 if shaft.ratio is None else shaft.ratio
        return led if ratio == 1.0 else ShaftCourse(led.time_s, ratio * led.rpm)

    return {name: course(name) for name in file.shafts}


def _own_course(shaft: ShaftSection) -> ShaftCourse:
    if isinstance(shaft.rpm, tuple):
        time_s, rpm = np.array(shaft.rpm).T
        return ShaftCourse(time_s, rpm)
    return ShaftCourse(np.zeros(1), np.array([shaft.rpm or 0.0]))


def mean_rpm(course: ShaftCourse, from_s: float, to_s: float) -> float:
    """Mean speed of a course from one time to another [r/min]."""
    if course.is_level:
        return float(course.rpm[0])
    first, last = course.turns_at(np.array([from_s, to_s]))
    return float(60.0 * (last - first) / (to_s - from_s))


FEWEST_SAMPLES = 4  #: In a run: with fewer there is nothing to see of a vibration.


def contradictions(file: VibrationFile) -> Iterator[Contradiction]:
    """(key, found, expected, advice) of whatever does not fit together in a file whose values are valid one by one."""
    yield from _of_structure(file)
    yield from _of_shafts(file)
    yield from _of_sources(file)
    yield from _of_finals(file)
    yield from _of_chains(file)
    yield from _of_run(file)
    yield from bound_contradictions(file.bounds)


def _of_structure(file: VibrationFile) -> Iterator[Contradiction]:
    known = [*file.members, GROUND]
    for name, member in file.members.items():
        for _, found, expected, advice in refusals(partial(Member, name, member.mass_kg), ("members",)):
            yield ("members", name), found, expected, advice
    for number, joint in enumerate(file.joints):
        key: Key = ("joints", number)
        for side, name in enumerate(joint.between):
            if name not in known:
                yield (*key, "between", side), *unknown_name("member", name, known)
        yield from refusals(partial(Joint, **dict(joint)), key, joint)
    yield from refusals(partial(file_structure, file), ("joints",))


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
            elif _own_course(shaft).range_rpm(0.0, file.run.duration_s)[1] == 0:
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
            yield from refusals(partial(Line, **dict(line)), (*key, "lines", number), line)
        yield from refusals(partial(source_of, name, source), key, source)
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
        yield from refusals(partial(Chain, **dict(section)), key, section)
        chain = Chain(**dict(section))
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


_TIMES = 10.0
_SMALLEST = 1e-3  #: Of a force that is there: a line without any is refused.


def numbers(file: VibrationFile) -> Iterator[Number]:
    """The physics of a structure and its sources as named numbers, those that are switched off included.

    Their names and bounds: docs/reference/vibration-model.md, ``[bounds]``.
    """
    for name, member in file.members.items():
        yield from _of_section(member, ("members", name))
    for number, joint in enumerate(file.joints):
        yield from _of_section(joint, ("joints", number))
    courses = file_shafts(file)
    for name, source in file.sources.items():
        course = courses[source.shaft] if source.shaft is not None else None
        for number, line in enumerate(source.lines):
            yield from _of_line(("sources", name, "lines", number), line, course, file.run.duration_s)


def _of_section(section: Entry, path: Key) -> Iterator[Number]:
    """Its numbers, whose bounds may not pass what their keys may have."""
    for one in numbers_of(section, path):
        said = type(section).model_fields[str(one.path[-1])].metadata
        least, most = (
            float(next(getattr(limit, end) for limit in said if hasattr(limit, end))) for end in ("ge", "le")
        )
        yield replace(one, limits=(least, most))


def _of_line(path: Key, line: LineSection, course: ShaftCourse | None, duration_s: float) -> Iterator[Number]:
    frequency = line.frequency_hz
    if frequency is None and course is not None:
        frequency = (line.order or 0.0) * course.range_rpm(0.0, duration_s)[1] / 60.0
    square = (2.0 * math.pi * (frequency or 0.0)) ** 2
    instead = {"force_n": line.unbalance_kg_m * square, "unbalance_kg_m": line.force_n / square if square > 0 else 0.0}
    for one in _of_section(line, path):
        key = str(one.path[-1])
        if key not in instead:
            yield one
        elif one.value > 0:
            yield replace(one, low=_SMALLEST * one.value, high=_TIMES * one.value)
        elif line.order is not None or key == "force_n":
            # what keeps its frequency is no unbalance: that follows a shaft
            yield replace(one, low=0.0, high=_TIMES * instead[key])


FAMILY: ModelFamily[VibrationFile] = ModelFamily(
    "vibration",
    KINDS,
    contradictions,
    page="docs/reference/vibration-model.md",
    examples="fixtures/vibration",
    numbers=numbers,
)
#: The model file at a path, with this content, and with these sections as plain values, see `ModelFamily`.
read_model_file, parsed_model_file, checked_model_file = FAMILY.read, FAMILY.parsed, FAMILY.checked
