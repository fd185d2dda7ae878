"""What the user asks of a selection, checked once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

from selector.errors import Misfit, OptionError, refuse
from selector.models.design import Form, ListedTerms, Reference
from selector.recording import PARTS, SENSOR_ROLES, RunSource, of_axis

if TYPE_CHECKING:
    from selector.models.formula import Formula

MAX_ROUNDS, MAX_SENSORS = 20, 10_000
_LARGEST_SEED = 2**53
#: Representatives that a search over products is made of; more are first thinned by the linear search.
MAX_CANDIDATES = 12

Kind = Literal["closure", "cmeans"]


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
    #: {"closure", "cmeans"}: Groups by λ-cuts of the transitive closure, or by fuzzy c-means, whose number is chosen
    #: as λ is
    grouping: Kind = "closure"
    absolute_similarity: bool = False  #: Group by |r|, so that a sensor and its mirror image stand together
    #: must and never: Sensors that every set contains, or none does
    must: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    #: Cost of a sensor; 1 where nothing is said. Parsimony goes by total cost.
    cost: Mapping[str, float] = field(default_factory=dict)
    #: The patent's parsimony: the cheapest set whose adjusted R² is within this distance of the best. None = the
    #: cheapest set that predicts unseen runs as well as the best does, within one standard error.
    tolerance: float | None = None
    #: Sets whose unseen error is within this of the best count as equal [µm]; None = what is within one standard error,
    #: or within the noise of the gauge and a tenth of the error
    within: float | None = None
    target: float | None = None  #: Take the cheapest set whose unseen error is at most this [µm]
    ridge: bool = False  #: Shrink the coefficients by the amount that predicts unseen runs best
    #: Run → condition (e.g. "winter"): whole conditions are left out in turn instead of runs
    conditions: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0  #: For the bootstrap over runs
    #: This model and no other, in Wilkinson's notation, e.g. ``"Z ~ T1 + T3 + T1:T3"``: nothing is searched, all is
    #: proved
    formula: str | None = None

    def __post_init__(self) -> None:
        Form(self.degree, self.interactions)
        refuse(self._misfits(), OptionError)

    def _misfits(self) -> Iterator[Misfit]:
        yield from self._beside_formula()
        if self.reference not in ("rise", "absolute"):
            yield repr(self.reference), "rise or absolute", "--reference", "leave it out for rise"
        if self.grouping not in ("closure", "cmeans"):
            advice = "leave it out for the cuts of the closure"
            yield repr(self.grouping), "closure or cmeans", "--grouping", advice
        if self.grouping == "cmeans" and (self.level is not None or self.rounds > 1):
            found = f"--grouping cmeans and {'--rounds' if self.level is None else '--lambda'}"
            expected = "fuzzy groups alone: they have no λ, and are made once"
            yield found, expected, "--grouping", "leave one of the two out"
        if not 0 <= self.seed < _LARGEST_SEED:
            yield str(self.seed), "a whole number from 0 below 2^53", "--seed", "e.g. --seed 0"
        for level in self.levels or ():
            if not (math.isfinite(level) and 0.0 <= level <= 1.0):
                advice = "try --lambda auto; sensors on one machine usually part between 0.9 and 0.999"
                yield f"λ = {level}", "a number from 0 to 1, or auto", "--lambda", advice
        for option, asked, most in (
            ("--rounds", self.rounds, MAX_ROUNDS),
            ("--max-sensors", self.max_sensors, MAX_SENSORS),
        ):
            if not 1 <= asked <= most:
                yield str(asked), f"a whole number of at least 1, at most {most}", option, f"use e.g. {option} 2"
        if self.tolerance is not None and not (math.isfinite(self.tolerance) and self.tolerance >= 0):
            expected = "a distance in adjusted R² of 0 or more, e.g. 0.001"
            advice = "leave the option out to choose by the error on unseen runs"
            yield f"{self.tolerance}", expected, "--tolerance", advice
        yield from self._of_micrometres()
        for name, cost in self.cost.items():
            if not (math.isfinite(cost) and cost >= 0):
                yield f"cost {cost} of {name}", "a cost of 0 or more", "--cost", "use e.g. T3=2"
        both = sorted(set(self.must) & set(self.never))
        if both:
            found, advice = ", ".join(both) + " in both", "take it out of one of the two options"
            yield found, "a sensor in at most one of them", "--must and --never", advice
        if len(set(self.must)) > self.max_sensors:
            found = f"{len(set(self.must))} sensors that must be in every set"
            yield found, f"at most --max-sensors {self.max_sensors}", "--must", "raise --max-sensors"

    @property
    def levels(self) -> tuple[float, ...] | None:
        """λ of each round, the last one repeated; None = auto."""
        if self.level is None:
            return None
        given = self.level if isinstance(self.level, tuple) else (self.level,)
        return tuple(given[min(i, len(given) - 1)] for i in range(self.rounds))

    @property
    def asked_formula(self) -> Formula | None:
        """What the formula says."""
        if self.formula is None:
            return None
        from selector.models.formula import formula_of  # its parser costs a fifth of a second

        return formula_of(self.formula)

    @property
    def forms(self) -> tuple[Form | ListedTerms, ...]:
        """The forms that are offered, the simplest first."""
        if self.asked_formula is not None:
            return (ListedTerms(self.asked_formula.terms),)
        return Form(self.degree, self.interactions).simpler()

    def _of_micrometres(self) -> Iterator[Misfit]:
        rules = {"--tolerance": self.tolerance, "--within": self.within, "--target": self.target}
        given = [option for option, value in rules.items() if value is not None]
        if len(given) > 1:
            advice = "--within compares unseen errors, --target bounds them, --tolerance compares adjusted R²"
            yield " and ".join(given), "one rule by which a set is taken", given[0], advice
        for option, value, least in (("--within", self.within, "0 µm"), ("--target", self.target, "more than 0 µm")):
            if value is not None and not (math.isfinite(value) and (value > 0 or (value == 0 and least == "0 µm"))):
                expected = f"an error in µm: {least}" + " or more" * (least == "0 µm")
                yield f"{value:g} µm", expected, option, f"e.g. {option} 0.5"

    def _beside_formula(self) -> Iterator[Misfit]:
        if self.asked_formula is None:
            return
        besides = {
            "--degree": self.degree > 1,
            "--interactions": self.interactions,
            "--memory": self.memory,
            "--must": self.must,
            "--never": self.never,
            "--cost": self.cost,
            "--tolerance": self.tolerance is not None,
            "--within": self.within is not None,
            "--target": self.target is not None,
        }
        given = [option for option, is_given in besides.items() if is_given]
        if given:
            expected = "--formula alone: it says which sensors and terms the model has"
            advice = f"leave out {given[0]}, or the formula"
            yield f"--formula and {', '.join(given)}", expected, "--formula", advice
        wanted = self.asked_formula.responses
        if self.responses and set(self.responses) != set(wanted):
            found, where = f"--response {', '.join(self.responses)}", "--response and --formula"
            yield found, f"{', '.join(wanted)}, as the formula has it left of the tilde", where, "leave --response out"

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
    noise_um: tuple[float, ...] = ()  #: Of the gauge of each response, from differences of neighbouring samples

    @property
    def needed(self) -> tuple[str, ...]:
        """The sensors without which there is no model: those that must be kept, or those of the formula."""
        formula = self.options.asked_formula
        return self.options.must if formula is None else formula.variables

    @property
    def max_sensors(self) -> int:
        """Most sensors in a set, of those that there are; a formula may name more than `max_sensors` of the options."""
        return max(min(self.options.max_sensors, len(self.sensors)), len(self.needed))


_NONE = "set roles in the file of `selector describe --write machine.toml`, or mend the faults that leave channels out"


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
    for role, there, other in (("displacement", displacements, ""), ("temperature", sensors, " or ambient")):
        if not there:
            found, expected = f"no {role} channel", f"at least one channel with role {role}{other}"
            raise OptionError(found, expected=expected, where=f"recording with channels {listing}", advice=_NONE)
    formula = options.asked_formula
    asked = formula.responses if formula else options.responses
    responses = list(dict.fromkeys(of_axis(name, source.channels) for name in asked)) or displacements
    for name in responses:
        _known("--formula" if formula else "--response", name, displacements, "a displacement channel")
    for option, names in (
        ("--must", options.must),
        ("--never", options.never),
        ("--cost", tuple(options.cost)),
        ("--formula", formula.variables if formula else ()),
    ):
        for name in names:
            _known(option, name, sensors, "a temperature sensor of the recording")
    cut = {part: run for part, (run, _) in getattr(source, "provenance", {}).get(PARTS, {}).items()}
    for run in options.conditions:
        _known("--condition", run, (*source.runs, *dict.fromkeys(cut.values())), "a run of the recording")
    of_run = {one: options.conditions.get(one, options.conditions.get(cut.get(one, one))) for one in source.runs}
    options = replace(options, conditions={run: one for run, one in of_run.items() if one is not None})
    usable = allowed_sensors(sensors, options)
    speeds = tuple(by_role.get("spindle_speed", [])) if options.memory else ()
    return Question(options, usable, tuple(responses), speeds)


def allowed_sensors(sensors: Iterable[str], options: Options) -> tuple[str, ...]:
    """The sensors that ``--never`` leaves. Raises OptionError: it leaves none."""
    allowed = tuple(name for name in sensors if name not in options.never)
    if not allowed:
        expected, advice = "at least one sensor left", "take a sensor out of --never"
        raise OptionError("every sensor is excluded", expected=expected, where="--never", advice=advice)
    return allowed


def _known(option: str, name: str, known: Sequence[str], what: str) -> None:
    if name not in known:
        advice = "correct the name; `selector describe` lists the channels, and the faults for which one is left out"
        raise OptionError(f"{name!r}", expected=f"{what}: " + ", ".join(known), where=option, advice=advice)


Progress = Callable[[str, float], None]  #: Called with what is being done and the share that is done.
