"""What a diagnosis is asked, on the command line or by a study."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.cli.shared.studying import OpenedStudy


@dataclass(frozen=True)
class Asked:
    """The options of `diagnose`, one field an option."""

    simulation: list[Path] | None
    model: Path | None
    time_unit: str | None
    responses: list[str] | None
    holdout: str
    seed: int
    false_alarm: float


def asked_of(opened: OpenedStudy) -> Asked:
    """What the ``[diagnose]`` of a study asks.

    Raises
    ------
    StudyError
        It has none.
    """
    from selector.study import path_at
    from selector.study.asked import require_diagnose

    section = require_diagnose(opened.study, where=str(opened.place))
    return Asked(
        simulation=[path_at(path, opened.folder) for path in section.simulation] or None,
        model=None if section.model is None else path_at(section.model, opened.folder),
        time_unit=section.simulation_time_unit,
        responses=list(section.responses) or None,
        holdout=section.holdout,
        seed=section.seed,
        false_alarm=section.false_alarm,
    )


def require_usable(asked: Asked) -> None:
    """Ends with an error when options contradict each other or are out of their limits."""
    both = asked.simulation and asked.model
    _require(not both, "--simulation and --model", "one of them", "command line", "leave one out")
    _require(0 <= asked.seed < 2**53, str(asked.seed), "a whole number from 0", "--seed", "e.g. --seed 0")
    _require(
        0.0 < asked.false_alarm <= 0.2,
        str(asked.false_alarm),
        "a probability above 0 and up to 0.2",
        "--false-alarm",
        "e.g. 0.02",
    )


def _require(holds: bool, found: str, expected: str, where: str, advice: str) -> None:
    if not holds:
        raise OptionError(found, expected=expected, where=where, advice=advice)
