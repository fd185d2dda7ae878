"""What the tool says to a person about data or models, as values."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

Level = Literal["info", "warning", "error"]
Action = Literal["none", "leave-out-stretch", "leave-out-run", "leave-out-channel"]


@dataclass(frozen=True)
class Where:
    """The place a finding speaks of; ``None`` means "all of them" or "does not apply".

    ``from_s`` and ``to_s`` count from the start of the run [s].
    """

    channel: str | None = None
    run: str | None = None
    from_s: float | None = None
    to_s: float | None = None
    file: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """The fields that are set, for JSON."""
        return {key: value for key, value in vars(self).items() if value is not None}


@dataclass(frozen=True)
class Finding:
    """One statement about data or a model."""

    id: str  #: Stable kebab-case name of the kind of finding, e.g. ``"stuck"``.
    level: Level  #: {"info", "warning", "error"}: How much it matters
    statement: str  #: One or two plain sentences with numbers and units
    where: Where = field(default_factory=Where)  #: Channel, run and time window
    evidence: Mapping[str, Any] = field(default_factory=dict)  #: The numbers behind the statement
    suggestion: str = ""  #: What the user can do about it
    #: {"none", "leave-out-stretch", "leave-out-run", "leave-out-channel"}: What the tool will do with the data because
    #: of it. Nothing is left out without a finding that says so.
    action: Action = "none"

    def as_dict(self) -> dict[str, Any]:
        """JSON form, the same in every contract."""
        return {**vars(self), "where": self.where.as_dict(), "evidence": dict(self.evidence)}


@dataclass(frozen=True)
class Kind:
    """What all findings of one id have in common; declared once, in the table of the room that makes them."""

    #: How much such a finding can matter: one level, or the levels among which the numbers decide
    level: Level | tuple[Level, ...]
    title: str  #: What it means, in one line without numbers
    #: What to do about it in general: the suggestion of every finding that has none of its own
    advice: str = ""

    @property
    def levels(self) -> tuple[Level, ...]:
        """Every level that such a finding can have."""
        return (self.level,) if isinstance(self.level, str) else self.level


known_kinds: dict[str, Kind] = {}  #: The kinds of all rooms that were imported, by id.


class Kinds(dict[str, Kind]):
    """The kinds of finding that one room of the package can make, by id."""

    @classmethod
    def of(cls, table: str) -> "Kinds":
        r"""The kinds of a text: ``id [level, …] title``; more lines of it are indented, the advice stands behind →.

        >>> Kinds.of("gap [info, warning] the recording pauses\n    → Look at the logger.")["gap"].levels
        ('info', 'warning')
        """
        kinds = cls()
        for entry in re.split(r"\n(?=\S)", table.strip()):
            head, _, advice = (" ".join(part.split()) for part in entry.partition("→"))
            id_, levels, title = re.fullmatch(r"([a-z0-9-]+) \[([a-z, ]+)\] (.+)", head).groups()  # type: ignore[union-attr]
            several: Any = tuple(levels.split(", "))
            kinds[id_] = Kind(several[0] if len(several) == 1 else several, title, advice)
        known_kinds.update(kinds)
        return kinds

    @classmethod
    def beside(cls, file: str) -> "Kinds":
        """The kinds of the text file beside a Python file: of the same name, ending in ``.txt``."""
        return cls.of(Path(file).with_suffix(".txt").read_text(encoding="utf-8"))

    def finding(
        self,
        id_: str,
        statement: str,
        where: Where | None = None,
        evidence: Mapping[str, Any] | None = None,
        suggestion: str | None = None,
        action: Action = "none",
        *,
        level: Level | None = None,
    ) -> Finding:
        """A finding of a declared kind.

        The level is the kind's, and has to be given where the kind has several; the suggestion is the kind's advice
        unless the finding has one of its own. Raises ``KeyError`` for an id and ``ValueError`` for a level that the
        kind does not have.
        """
        kind = self[id_]
        if level is None:
            (level,) = kind.levels
        elif level not in kind.levels:
            raise ValueError(f"a finding {id_!r} has no level {level!r}")
        return Finding(
            id_,
            level,
            statement,
            where or Where(),
            evidence or {},
            kind.advice if suggestion is None else suggestion,
            action,
        )
