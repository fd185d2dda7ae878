"""What is told of a result, as data: sentences, tables, drawings and findings, for the screen, for a page, for JSON.

A result is told once, as an `Account`. `selector.telling.page` makes a page of it, `selector.cli.shared.showing` writes
it on the screen, and `data` is what the JSON says.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from selector.findings import Finding, Kind, known_kinds
from selector.number_text import listed, number_text, told_apart
from selector.telling.numbers import place_text

if TYPE_CHECKING:
    import plotly.graph_objects as go

ACTIONS = {
    "none": "",
    "leave-out-stretch": "this stretch is left out",
    "leave-out-run": "this run is left out",
    "leave-out-channel": "this channel is left out",
}
_LEVELS = ("error", "warning", "info")

Verdict = Literal["good", "plain", "bad"]


@dataclass(frozen=True)
class Column:
    """Heading of a column; numbers are aligned to the right."""

    name: str
    numeric: bool = False


@dataclass(frozen=True)
class Table:
    """A table of text."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    marked: frozenset[int] = frozenset()  #: Rows that stand out
    note: str = ""


@dataclass(frozen=True)
class Remark:
    """A finding, or several of a kind, ready to be read."""

    level: str
    statement: str
    place: str
    action: str
    suggestion: str


@dataclass(frozen=True)
class Drawing:
    """A figure, and how to read it; an account that is not for a page has none."""

    figure: go.Figure
    text: str = ""
    title: str = ""  #: Default: that of the figure


@dataclass(frozen=True)
class Captioned:
    """A table and what stands above it; the screen has only those that answer the question of the command."""

    caption: str
    table: Table
    on_screen: bool = True


@dataclass(frozen=True)
class Heading:
    """A heading within a section."""

    text: str
    level: int = 2
    on_screen: bool = False


@dataclass(frozen=True)
class Note:
    """A remark in small print."""

    text: str
    on_screen: bool = False


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; a page sets what stands between backticks as code, as it does in sentences and items.

    The screen has only paragraphs that belong to the answer.
    """

    text: str
    lead: str = ""  #: What stands out before it
    on_screen: bool = False


@dataclass(frozen=True)
class Formula:
    """A line that is read and copied as it is."""

    text: str


@dataclass(frozen=True)
class Listing:
    """Lines that are read and copied as they are."""

    text: str


@dataclass(frozen=True)
class Items:
    """A list of paragraphs; steps are numbered."""

    items: tuple[str, ...]
    are_steps: bool = False


@dataclass(frozen=True)
class Form:
    """A table to be filled in by hand: empty cells are wide enough to be written into."""

    table: Table


@dataclass(frozen=True)
class Remarks:
    """Findings."""

    remarks: tuple[Remark, ...]


Block = Drawing | Captioned | Heading | Note | Paragraph | Formula | Listing | Items | Form | Remarks


@dataclass(frozen=True)
class Section:
    """A part of an account, with what stands in it in the order of reading."""

    id: str  #: Its place in a page
    title: str  #: Its heading; empty if its blocks have headings of their own
    blocks: tuple[Block, ...]
    link: str = ""  #: What the contents call it; default: the title
    on_paper: bool = True


@dataclass(frozen=True)
class Account:
    """All that is told of a result."""

    title: str
    sentences: tuple[str, ...]  #: The answer; what matters most comes first; none where there is only a description
    sections: tuple[Section, ...]
    answer: Table | None = None  #: Numbers that belong to the sentences
    front: tuple[Block, ...] = ()  #: What else stands on the first page: how sure it is, what to do next, one picture
    about: str = ""  #: Stands under the title
    label: str = ""  #: What has to be said before anything else: made-up data, a turned sign
    verdict: Verdict = "good"  #: How the answer is to be taken
    data: Mapping[str, Any] = field(default_factory=dict)  #: What the JSON says of it
    #: Sections that the screen shows where not everything is asked for; default: all
    brief: tuple[str, ...] | None = None
    footer: str = ""


@cache
def _legends() -> dict[str, dict[str, Any]]:
    return tomllib.loads(Path(__file__).with_name("legends.toml").read_text(encoding="utf-8"))


def legend(key: str) -> str:
    """How a table or a drawing is read, as ``legends.toml`` has it, e.g. of ``"vibration.errors"``."""
    room, name = key.split(".")
    text: str = _legends()[room][name]
    return text


def steps(key: str, **values: object) -> tuple[str, ...]:
    """Steps or sentences that ``legends.toml`` has in a list, values in the places of their {names}."""
    room, name = key.split(".")
    return tuple(text.format(**values).strip() for text in _legends()[room][name])


def table(
    headings: Sequence[str], rows: Sequence[Sequence[str | float | None]], note: str = "", marked: Sequence[int] = ()
) -> Table:
    """A table whose headings say with a leading ``>`` that a column holds numbers, which may be as they are."""
    columns = tuple(Column(heading.removeprefix(">"), heading.startswith(">")) for heading in headings)
    cells = tuple(tuple(cell if isinstance(cell, str) else number_text(cell) for cell in row) for row in rows)
    return Table(columns, cells, frozenset(marked), note)


def remarks_of(findings: Iterable[Finding], *levels: str) -> Remarks:
    """Findings of these levels (all when none is given), the worst first."""
    ordered = sorted(findings, key=lambda finding: _LEVELS.index(finding.level))
    return Remarks(tuple(_remark(one) for one in ordered if one.level in (levels or _LEVELS)))


def grouped_remarks(findings: Iterable[Finding], *levels: str) -> tuple[Remark, ...]:
    """As `remarks_of`, findings of one kind as one, and the same fault of a channel once."""
    findings = tuple(findings)
    left_out = {one.where.channel: one.id for one in findings if one.action == "leave-out-channel"}
    groups: dict[str, list[Finding]] = {}
    for one in sorted(findings, key=lambda finding: _LEVELS.index(finding.level)):
        # that a channel is left out says all
        if one.action != "none" or one.where.run or left_out.get(one.where.channel, one.id) == one.id:
            groups.setdefault(one.id, []).append(one)
    return tuple(
        _remark(of[0]) if len(of) == 1 else _of_several(of)
        for of in groups.values()
        if of[0].level in (levels or _LEVELS)
    )


def next_steps(findings: Iterable[Finding], *then: str, most: int = 3) -> Items:
    """What the worst findings advise, and what comes then; names stay as they are."""
    advised = [
        f"{f'{one.place}:' if one.place else one.statement} {sentence(one.suggestion)}"
        for one in grouped_remarks(findings, "error", "warning")
        if one.suggestion
    ]
    return Items((*advised[:most], *then), are_steps=True)


def sentence(text: str) -> str:
    """The text with a capital and a full stop; λ stays as it is."""
    first = text[:1] if text[:1] == "λ" else text[:1].upper()
    return first + text[1:] + ("" if text.endswith((".", "?")) else ".")


def _remark(one: Finding) -> Remark:
    return Remark(one.level, one.statement, place_text(one.where), ACTIONS[one.action], one.suggestion)


MOST_NAMED, LONGEST = 6, 32


def _of_several(findings: Sequence[Finding]) -> Remark:
    """Findings of one kind: in what, where, how often; what is done and advised is that of the worst."""
    first = findings[0]
    kind = known_kinds.get(first.id, Kind(first.level, first.id.replace("-", " ")))
    where = []
    for word, found in (("in", [of.where.channel for of in findings]), ("in run", [of.where.run for of in findings])):
        names = list(dict.fromkeys(name for name in found if name))
        where += [f"{word}{'s' * (word == 'in run' and len(names) > 1)} {named(names)}"] if names else []
    told = sentence(f"{kind.title}: {', '.join([f'{len(findings)} times', *where])}")
    is_one = len({one.suggestion for one in findings}) == 1
    return Remark(first.level, told, "", ACTIONS[first.action], first.suggestion if is_one else kind.advice)


def named(names: Sequence[str], most: int = MOST_NAMED) -> str:
    """Names in a sentence, of many the first ones and how many more; long ones without a middle, still different."""
    return listed([*told_apart(names[:most], LONGEST), *[f"{len(names) - most} more"] * (len(names) > most)])


def section(id_: str, title: str, *blocks: Block | None, link: str = "", on_paper: bool = True) -> Section | None:
    """A section of the blocks that there are; None if there are none."""
    kept = tuple(block for block in blocks if block is not None)
    return Section(id_, title, kept, link, on_paper) if kept else None


def captioned(caption: str, told: Table | None, *, on_screen: bool = True) -> Captioned | None:
    """A table with what stands above it; None if there is none, or nothing in it."""
    return Captioned(caption, told, on_screen) if told is not None and told.rows else None


def sections(*several: Section | None) -> tuple[Section, ...]:
    """Those that there are."""
    return tuple(one for one in several if one is not None)


def warnings_section(findings: Iterable[Finding]) -> Section | None:
    """What must be known before a result is used; None where nothing must."""
    urgent = remarks_of(findings, "error", "warning")
    return section("warnings", "Before you use it", urgent if urgent.remarks else None, link="Warnings")


def findings_section(findings: Iterable[Finding], *, on_paper: bool = True) -> Section | None:
    """All that was found, whether it matters or not."""
    return section("findings", "All findings", remarks_of(findings), link="Findings", on_paper=on_paper)
