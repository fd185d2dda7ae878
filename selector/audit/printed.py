"""What patent CN1868666 prints, and one printed number against ours."""

import math
import textwrap
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from selector.types import Array

#: Lower bearing, intermediate gear, upper bearing, hydraulic unit, gearbox, main motor, and others without a name.
SENSORS = tuple(f"T{k}" for k in range(1, 9))
ENTRY_HALF_UNIT = 0.5e-4  #: Correlations, R² and most coefficients are printed with four decimals.


def _matrix(file: str) -> Array:
    matrix = np.loadtxt(Path(__file__).with_name(file))
    matrix.setflags(write=False)
    return matrix


#: R, the similarity matrix.
SIMILARITY = _matrix("similarity.txt")
#: t(R), the transitive closure.
CLOSURE = _matrix("closure.txt")

LEVEL = 0.995
CUT_ROWS = ("11010001", "11010001", "00101110", "11010001", "00101110", "00101110", "00101110", "11010001")
GROUPS_CLAIMED = 3
REPRESENTATIVES = ("T1", "T3", "T5")


@dataclass(frozen=True)
class PrintedPair:
    """R² and adjusted R² of one combination of sensors, as printed."""

    sensors: tuple[str, ...]
    r2: float
    adjusted_r2: float


PAIRS = (PrintedPair(("T1", "T3"), 0.9989, 0.9988), PrintedPair(("T1", "T3", "T5"), 0.9990, 0.9989))


@dataclass(frozen=True)
class PrintedModel:
    """A printed formula."""

    direction: str  #: {"Z", "Y"}
    name: str  #: In words, for tables
    terms: tuple[tuple[str, ...], ...]  #: The variables that each term multiplies; () is the constant
    printed: tuple[str, ...]  #: The coefficients with all their printed decimals

    @property
    def coefficients(self) -> Array:
        """The coefficients as numbers [µm, µm/K, µm/K²], shape (n_terms,)."""
        return np.array([float(text) for text in self.printed])

    def columns(self, x1: Array, x3: Array, x5: Array) -> Array:
        """One column per term, shape (n_samples, n_terms), from the rises of sensors 1, 3, 5 [K]."""
        rise = {"T1": x1, "T3": x3, "T5": x5}
        columns = [math.prod((rise[name] for name in term), start=np.ones_like(x1)) for term in self.terms]
        return np.stack(columns, axis=1)


_LINEAR = ((), ("T1",), ("T3",))
Z_TWO_SENSORS = PrintedModel("Z", "Z, two sensors", _LINEAR, ("-1.871", "6.0476", "2.6667"))
Y_TWO_SENSORS = PrintedModel("Y", "Y, two sensors", _LINEAR, ("0.5703", "4.7292", "-0.5908"))
Z_THREE_SENSORS = PrintedModel(
    "Z",
    "Z, three sensors",
    ((), ("T1",), ("T3",), ("T1", "T3"), ("T5",)),
    ("1.0168", "11.5237", "4.4909", "-0.5527", "-3.6181"),
)
Y_THREE_SENSORS = PrintedModel(
    "Y",
    "Y, three sensors",
    ((), ("T1",), ("T3",), ("T1", "T3"), ("T3", "T5"), ("T1", "T5"), ("T5",)),
    ("-0.1298", "11.7861", "1.8778", "-0.8547", "1.0439", "-0.1995", "-10.4045"),
)

Verdict = Literal["agrees independently", "agrees by construction", "contradicts", "in tension", "cannot be checked"]


@dataclass(frozen=True)
class AuditLine:
    """One printed statement, checked."""

    section: str  #: Part of the patent, e.g. ``"similarity"``.
    item: str  #: What is checked
    printed: str  #: The printed value, with its printed decimals
    ours: str  #: What we get
    #: Whether the printed value stands. "agrees by construction": on the reconstruction, which was solved for to have
    #: it; "in tension": with another printed number, but a reading exists in which both hold; "cannot be checked": the
    #: patent prints nothing that would decide it
    verdict: Verdict
    why: str  #: How ours was obtained, and what a contradiction means

    def as_dict(self) -> dict[str, str]:
        """JSON form."""
        return dict(vars(self))


def judged(
    section: str,
    item: str,
    printed: str,
    ours: str,
    holds: bool,
    why: str,
    yes: Verdict = "agrees independently",
    no: Verdict = "contradicts",
) -> AuditLine:
    """A line whose verdict is one of two."""
    return AuditLine(section, item, printed, ours, yes if holds else no, why)


_STATEMENTS = tomllib.loads(Path(__file__).with_name("statements.toml").read_text(encoding="utf-8"))


def checked(statement: str, ours: str, holds: bool = True, **values: object) -> AuditLine:
    """The line of a table of ``statements.toml``; `values` are what its braces stand for."""
    said: dict[str, Any] = {key: text.format(**values) for key, text in _STATEMENTS[statement].items()}
    return judged(ours=ours, holds=holds, **said)


def audit_table_text(lines: Iterable[AuditLine], *, width: int = 118) -> str:
    """The lines as a plain table, one block per section, with the count of each verdict at the end."""
    lines = tuple(lines)
    out: list[str] = []
    for section in dict.fromkeys(line.section for line in lines):
        out += ["", section.upper()]
        for line in (line for line in lines if line.section == section):
            out.append(f"  {line.verdict:<22}  {line.item}: printed {line.printed}; ours {line.ours}")
            out += textwrap.wrap(line.why, width, initial_indent=" " * 26, subsequent_indent=" " * 26)
    counts = {verdict: sum(line.verdict == verdict for line in lines) for verdict in Verdict.__args__}  # type: ignore[attr-defined]
    out += ["", ", ".join(f"{count} {verdict}" for verdict, count in counts.items())]
    return "\n".join(out[1:]) + "\n"
