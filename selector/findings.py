"""What the tool says to a person about data or models, as values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
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
    """One statement about data or a model.

    Attributes
    ----------
    id : str
        Stable kebab-case name of the kind of finding, e.g. ``"stuck-channel"``.
    level : {"info", "warning", "error"}
        How much it matters.
    statement : str
        One or two plain sentences with numbers and units.
    where : Where
        Channel, run and time window.
    evidence : mapping of str to JSON value
        The numbers behind the statement.
    suggestion : str
        What the user can do about it.
    action : {"none", "leave-out-stretch", "leave-out-run", "leave-out-channel"}
        What the tool will do with the data because of it. Nothing is left out without a finding that says so.
    """

    id: str
    level: Level
    statement: str
    where: Where = field(default_factory=Where)
    evidence: Mapping[str, Any] = field(default_factory=dict)
    suggestion: str = ""
    action: Action = "none"

    def as_dict(self) -> dict[str, Any]:
        """JSON form, the same in every contract."""
        return {
            "id": self.id,
            "level": self.level,
            "statement": self.statement,
            "where": self.where.as_dict(),
            "evidence": dict(self.evidence),
            "suggestion": self.suggestion,
            "action": self.action,
        }
