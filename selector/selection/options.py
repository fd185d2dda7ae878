"""What the user asks of a selection, checked once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from selector.errors import OptionError
from selector.models.design import Form, Reference
from selector.recording import SENSOR_ROLES, RunSource

MAX_ROUNDS = 20
_LARGEST_SEED = 2**53
MAX_CANDIDATES = 12
"""Representatives that a search over products is made of; more are first thinned by the linear search."""


@dataclass(frozen=True)
class Options:
    """Options of `selector.selection.select`; the command line has the same ones under the same names."""

    responses: tuple[str, ...] = ()  #: Displacement channels; empty = all there are
    level: float | tuple[float, ...] | None = None  #: λ of the cut, or one per round; None = chosen ("auto")
    rounds: int = 1  #: Rounds of screening
    max_sensors: int = 5  #: Most sensors in a set
    #: degree and interactions: Terms that are offered to the model, see `Form`. What does not help on unseen runs is
    #: not used.
    degree: int = 1
    interactions: bool = False
    memory: bool = False  #: Offer first-order lags of the sensors and of the spindle speed
    #: {"rise", "absolute"}: Readings as differences to the start of the run, or as they are
    reference: Reference = "rise"
    absolute_similarity: bool = False  #: Group by |r|, so that a sensor and its mirror image stand together
    #: must and never: Sensors that every set contains, or none does
    must: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    #: Cost of a sensor; 1 where nothing is said. Parsimony goes by total cost.
    cost: Mapping[str, float] = field(default_factory=dict)
    #: The patent's parsimony: the cheapest set whose adjusted R² is within this distance of the best. None = the
    #: cheapest set that predicts unseen runs as well as the best does, within one standard error.
    tolerance: float | None = None
    ridge: bool = False  #: Shrink the coefficients by the amount that predicts unseen runs best
    #: Run → condition (e.g. "winter"): whole conditions are left out in turn instead of runs
    conditions: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0  #: For the bootstrap over runs

    def __post_init__(self) -> None:
        Form(self.degree, self.interactions)
        if self.reference not in ("rise", "absolute"):
            raise OptionError(
                repr(self.reference), expected="rise or absolute", where="--reference", advice="leave it out for rise"
            )
        if not 0 <= self.seed < _LARGEST_SEED:
            raise OptionError(str(self.seed), expected="a whole number from 0", where="--seed", advice="e.g. --seed 0")
        for level in self.levels or ():
            if not (math.isfinite(level) and 0.0 <= level <= 1.0):
                raise OptionError(
                    f"λ = {level}",
                    expected="a number from 0 to 1, or auto",
                    where="--lambda",
                    advice="try --lambda auto; sensors on one machine usually part between 0.9 and 0.999",
                )
        _whole("--rounds", self.rounds, 1)
        if self.rounds > MAX_ROUNDS:
            raise OptionError(
                f"{self.rounds} rounds",
                expected=f"at most {MAX_ROUNDS}",
                where="--rounds",
                advice="two or three rounds do: each must merge groups to have any effect",
            )
        _whole("--max-sensors", self.max_sensors, 1)
        if self.tolerance is not None and not (math.isfinite(self.tolerance) and self.tolerance >= 0):
            raise OptionError(
                f"{self.tolerance}",
                expected="a distance in adjusted R² of 0 or more, e.g. 0.001",
                where="--tolerance",
                advice="leave the option out to choose by the error on unseen runs",
            )
        for name, cost in self.cost.items():
            if not (math.isfinite(cost) and cost >= 0):
                raise OptionError(
                    f"cost {cost} of {name}", expected="a cost of 0 or more", where="--cost", advice="use e.g. T3=2"
                )
        both = sorted(set(self.must) & set(self.never))
        if both:
            raise OptionError(
                ", ".join(both) + " in both",
                expected="a sensor in at most one of them",
                where="--must and --never",
                advice="take it out of one of the two options",
            )
        if len(set(self.must)) > self.max_sensors:
            raise OptionError(
                f"{len(set(self.must))} sensors that must be in every set",
                expected=f"at most --max-sensors {self.max_sensors}",
                where="--must",
                advice="raise --max-sensors",
            )

    @property
    def levels(self) -> tuple[float, ...] | None:
        """λ of each round, the last one repeated; None = auto."""
        if self.level is None:
            return None
        given = self.level if isinstance(self.level, tuple) else (self.level,)
        return tuple(given[min(i, len(given) - 1)] for i in range(self.rounds))

    @property
    def form(self) -> Form:
        """The largest form that is offered."""
        return Form(self.degree, self.interactions)

    def total_cost(self, sensors: Sequence[str]) -> float:
        """Cost of a set."""
        return sum(self.cost.get(sensor, 1.0) for sensor in sensors)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        level = "auto" if self.level is None else list(self.levels or ())
        return {"lambda" if name == "level" else name: value for name, value in {**vars(self), "level": level}.items()}


@dataclass(frozen=True)
class Question:
    """Options applied to one recording: which channels are what."""

    options: Options
    sensors: tuple[str, ...]
    responses: tuple[str, ...]
    speeds: tuple[str, ...]


def question_of(source: RunSource, options: Options) -> Question:
    """Check the options against the channels of a recording.

    Raises OptionError: no displacement, no temperature, or a name that the recording does not have.
    """
    by_role: dict[str, list[str]] = {}
    for channel in source.channels:
        by_role.setdefault(channel.role, []).append(channel.name)
    displacements = by_role.get("displacement", [])
    sensors = [channel.name for channel in source.channels if channel.role in SENSOR_ROLES]
    listing = ", ".join(f"{channel.name} ({channel.role})" for channel in source.channels)
    if not displacements:
        raise OptionError(
            "no displacement channel",
            expected="at least one channel with role displacement",
            where=f"recording with channels {listing}",
            advice="write a machine file with `selector describe FILE --write machine.toml`, set the role there",
        )
    responses = list(dict.fromkeys(options.responses)) or displacements
    for name in responses:
        _known("--response", name, displacements, "a displacement channel")
    if not sensors:
        raise OptionError(
            "no temperature channel",
            expected="at least one channel with role temperature or ambient",
            where=f"recording with channels {listing}",
            advice="set the roles in the machine file (`selector describe FILE --write machine.toml`)",
        )
    for option, names in (("--must", options.must), ("--never", options.never), ("--cost", tuple(options.cost))):
        for name in names:
            _known(option, name, sensors, "a temperature sensor of the recording")
    for run in options.conditions:
        _known("--condition", run, source.runs, "a run of the recording")
    usable = allowed_sensors(sensors, options)
    speeds = tuple(by_role.get("spindle_speed", [])) if options.memory else ()
    return Question(options, usable, tuple(responses), speeds)


def allowed_sensors(sensors: Iterable[str], options: Options) -> tuple[str, ...]:
    """The sensors that ``--never`` leaves.

    Raises OptionError: it leaves none.
    """
    allowed = tuple(name for name in sensors if name not in options.never)
    if not allowed:
        raise OptionError(
            "every sensor is excluded",
            expected="at least one sensor left",
            where="--never",
            advice="take a sensor out of --never",
        )
    return allowed


def _known(option: str, name: str, known: Sequence[str], what: str) -> None:
    if name not in known:
        raise OptionError(
            f"{name!r}",
            expected=f"{what}: " + ", ".join(known),
            where=option,
            advice="correct the name; `selector describe` lists the channels, and the faults for which one is left out",
        )


def _whole(option: str, value: int, least: int) -> None:
    if value < least:
        raise OptionError(
            str(value),
            expected=f"a whole number of at least {least}",
            where=option,
            advice=f"use e.g. {option} {least}",
        )


Progress = Callable[[str, float], None]
"""Called with what is being done and the share that is done."""
