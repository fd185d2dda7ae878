"""What a diagnosis is asked, on the command line or by a study."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.cli.shared.studying import OpenedStudy


_of_simulation = partial(typer.Option, rich_help_panel="What it is compared with")

Simulation = Annotated[
    list[Path] | None,
    _of_simulation(
        "--simulation",
        metavar="PATH",
        help="Simulated runs, named as the recorded ones: a folder, or a file; repeat.",
    ),
]
Model = Annotated[
    Path | None,
    _of_simulation(
        "--model",
        metavar="MODEL.toml|UNIT.fmu",
        help="Instead: a model file of `selector simulate`, or an FMU; the recordings drive it, and it is refitted.",
    ),
]
SimulationTimeUnit = Annotated[
    str | None,
    _of_simulation(
        "--simulation-time-unit",
        metavar="UNIT",
        help="Unit of the time in the simulated files, if it is another one and not written there.",
    ),
]
Responses = Annotated[
    list[str] | None,
    typer.Option("--response", metavar="NAME", help="Channel to compare; repeat. Default: all that are simulated."),
]
HoldOut = Annotated[
    str,
    typer.Option(
        "--holdout",
        metavar="last|RUN|SHARE",
        help="What nothing is fitted to: the last run (of a single one its last 30 %), a run, or a share of every run.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Of the draws of noise.")]
FalseAlarm = Annotated[
    float,
    typer.Option("--false-alarm", metavar="P", help="Allowed probability of naming something where nothing is."),
]


@dataclass(frozen=True)
class Asked:
    """The options of `diagnose`, one field an option."""

    simulation: Simulation = None
    model: Model = None
    simulation_time_unit: SimulationTimeUnit = None
    responses: Responses = None
    holdout: HoldOut = "last"
    seed: Seed = 0
    false_alarm: FalseAlarm = 0.02


def asked_of(opened: OpenedStudy) -> Asked:
    """What the ``[diagnose]`` of a study asks.

    Raises StudyError: it has none.
    """
    from selector.study import path_at
    from selector.study.asked import require_diagnose

    section = require_diagnose(opened.study, where=str(opened.place))
    return Asked(
        simulation=[path_at(path, opened.folder) for path in section.simulation] or None,
        model=None if section.model is None else path_at(section.model, opened.folder),
        simulation_time_unit=section.simulation_time_unit,
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
