"""One printed number against ours, as a value; and many of them as plain text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["agrees", "contradicts", "cannot be checked"]


@dataclass(frozen=True)
class AuditLine:
    """One printed statement, checked.

    Attributes
    ----------
    section : str
        Part of the patent, e.g. ``"similarity"``.
    item : str
        What is checked.
    printed : str
        The printed value, with its printed decimals.
    ours : str
        What we get.
    verdict : {"agrees", "contradicts", "cannot be checked"}
        Whether the printed value stands. "cannot be checked": the patent prints nothing that would decide it.
    why : str
        How ours was obtained, and what a contradiction means.
    """

    section: str
    item: str
    printed: str
    ours: str
    verdict: Verdict
    why: str

    def as_dict(self) -> dict[str, str]:
        """JSON form."""
        return dict(vars(self))


def judged(section: str, item: str, printed: str, ours: str, holds: bool, why: str) -> AuditLine:
    """A line whose verdict is yes or no."""
    return AuditLine(section, item, printed, ours, "agrees" if holds else "contradicts", why)


def audit_table_text(lines: Iterable[AuditLine], *, width: int = 118) -> str:
    """The lines as a plain table, one block per section, with the count of each verdict at the end."""
    lines = tuple(lines)
    out: list[str] = []
    for section in dict.fromkeys(line.section for line in lines):
        out += ["", section.upper()]
        for line in (line for line in lines if line.section == section):
            out.append(f"  {line.verdict:<17}  {line.item}: printed {line.printed}; ours {line.ours}")
            out += textwrap.wrap(line.why, width, initial_indent=" " * 21, subsequent_indent=" " * 21)
    counts = {verdict: sum(line.verdict == verdict for line in lines) for verdict in Verdict.__args__}  # type: ignore[attr-defined]
    out += ["", ", ".join(f"{count} {verdict}" for verdict, count in counts.items())]
    return "\n".join(out[1:]) + "\n"
