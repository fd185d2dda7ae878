"""What an effect of the catalogue is: its physics, the shapes it can take in a residual, how a fit of it is read."""

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, wraps
from pathlib import Path
from typing import Any, Literal

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shown_units import displayed
from selector.number_text import number_text
from selector.types import Matrix, Vector

Entry = Literal["force", "heat flow", "displacement", "measurement", "state", "limit"]


@dataclass(frozen=True)
class Quantity:
    """A number with its unit; `low` and `high` are its 95 % interval where it was fitted, infinite at an open end.

    An interval without width is none: the value is one of a grid whose neighbours fit worse, and is known no better
    than the grid's step.
    """

    value: float
    unit: str
    low: float | None = None
    high: float | None = None

    def words(self, *, amount: bool = False) -> str:
        """Value, unit and interval, lengths as they are shown; with `amount` without its sign."""
        factor, unit = displayed(self.unit, self.value)
        text = f"{number_text(factor * (abs(self.value) if amount else self.value))} {unit}".strip()
        if self.low is None or self.high is None:
            return text
        low, high = factor * self.low, factor * self.high
        if amount and self.value < 0.0:
            low, high = -high, -low
        if np.isinf(high):
            return f"{text} (at least {number_text(low)})" if low > 0.0 else text
        start = "at most" if low == 0.0 < self.value else f"{number_text(low)} to"
        return f"{text} ({start} {number_text(high)})"


@dataclass(frozen=True)
class ShapeParameter:
    """A parameter of an effect: its name in the answer, unit, bounds and meaning."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


#: Of shapes whose coefficient says nothing by itself.
LARGEST = ShapeParameter("largest", "unit of the response", 0.0, 1e12, "largest amount in the response")
_YIELD = ShapeParameter("yield_s2", "s^2", 0.0, 1e-4, "compliance between drive and table times the moving mass")
_SHARED = {one.name: one for one in (LARGEST, _YIELD)}


@dataclass(frozen=True, eq=False)
class Variant:
    """One shape that an effect can take in the residual of one response: columns whose coefficients are fitted."""

    #: (n_rows, n_columns): Over all rows, held-out ones included; finite. 1 to 4 columns. The coefficients carry the
    #: unit.
    columns: Matrix
    names: tuple[str, ...]  #: What each column is, in words, e.g. ``"T2 delayed by 40 min"``.
    #: The shape parameters of this variant, e.g. ``{"tau_s": Quantity(2400.0, "s")}``.
    shape: Mapping[str, Quantity] = field(default_factory=dict)
    place: str | None = None  #: Where the effect would act, in the words of the machine file
    sources: tuple[str, ...] = ()  #: Channels that it was made of
    run: str | None = None  #: The one run that it acts in; None = all
    #: Allowed interval of every coefficient where physics knows it; None = any
    bounds: tuple[tuple[float, float], ...] | None = None
    #: When it acts, in words of recorded channels, e.g. ``"spindle_speed > 1500 rpm"``; None = always.
    regime: str | None = None
    looked_at: float = 1.0  #: Among how many shapes this one was chosen by looking at the residual; 1 = it was not
    weight: float = 1.0  #: How likely it is beforehand against the other shapes of the effect

    def __post_init__(self) -> None:
        if self.columns.ndim != 2 or self.columns.shape[1] != len(self.names):
            raise ValueError(f"columns of shape {self.columns.shape} with {len(self.names)} names")
        if self.bounds is not None and len(self.bounds) != len(self.names):
            raise ValueError(f"{len(self.bounds)} bounds for {len(self.names)} columns")


def always(comparison: Comparison, response: str) -> None:
    """Of an effect that can be tested in every response."""


def equally_likely(*kinds: Iterable[Variant]) -> Iterator[Variant]:
    """The shapes of several kinds of which each is as likely as the others, however many shapes it can take."""
    for kind in kinds:
        shapes = list(kind)
        yield from (replace(shape, weight=shape.weight / len(shapes)) for shape in shapes)


@dataclass(frozen=True)
class Fitted:
    """A fitted variant, as `Effect.reading` receives it."""

    #: response and unit: The response and its unit
    response: str
    unit: str
    variant: Variant  #: The shape that fits best
    #: coefficients and standard_errors: (n_columns,): In the unit of the response per unit of the column
    coefficients: Vector
    standard_errors: Vector
    #: 95 % interval of each shape parameter, from the profile over the variants; without those of no width. An end of 0
    #: or infinity says that the record sets no limit there.
    shape_intervals: Mapping[str, tuple[float, float]]
    #: rms and largest: Root mean square and largest amount of the effect's course in the response [unit]
    rms: float
    largest: float
    #: Lowest and highest value of the course since the start of a run [unit]; both 0 where they are not known
    extremes: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        wide = {name: (low, high) for name, (low, high) in self.shape_intervals.items() if low != high}
        object.__setattr__(self, "shape_intervals", wide)

    def coefficient(self, unit: str | None = None, *, factor: float = 1.0, offset: float = 0.0) -> Quantity:
        """`offset` + `factor` × the first coefficient with its 95 % interval, in this unit (None: of the response)."""
        value = offset + factor * float(self.coefficients[0])
        half = 1.96 * abs(factor) * float(self.standard_errors[0])
        return Quantity(value, self.unit if unit is None else unit, value - half, value + half)

    def parameter(self, name: str) -> Quantity:
        """A shape parameter with the interval of its profile."""
        found = self.variant.shape[name]
        return Quantity(found.value, found.unit, *self.shape_intervals.get(name, (found.low, found.high)))

    @property
    def size(self) -> dict[str, Quantity]:
        """The largest amount of the course, as a parameter of the answer."""
        return {"largest": Quantity(self.largest, self.unit)}

    @property
    def where(self) -> str:
        """Where a fault of the data acts, to stand at the end of a sentence."""
        regime = self.variant.regime or "in all runs"
        return f" in {regime}" if regime.startswith("run ") else f" {regime}"

    @property
    def up_to(self) -> str:
        """The same in words, in the unit of the response."""
        return Quantity(self.largest, self.unit).words()

    @property
    def size_words(self) -> str:
        """How large the effect's course is, lengths as they are shown."""
        factor, unit = displayed(self.unit, self.largest)
        return f"{factor * self.rms:.3g} {unit} rms and up to {factor * self.largest:.3g} {unit} in {self.response}"


@dataclass(frozen=True)
class Reading:
    """A fitted effect in words and numbers: one sentence with units, and its parameters as the contract has them."""

    statement: str
    parameters: Mapping[str, Quantity] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Effect:
    """One kind of physics, or one fault of the data, that a simulation may not have."""

    id: str  #: ``"family.name"``; contract, never renamed
    title: str  #: A few words that can stand inside a sentence: *the clock of a channel*
    physics: str  #: Two sentences: what happens, and how it shows
    reference: str  #: Where the equation comes from
    #: {"force", "heat flow", "displacement", "measurement", "state", "limit"}: Where it enters the machine's equations
    enters: Entry
    acts_at: str  #: The places at which it can act
    parameters: tuple[ShapeParameter, ...]  #: Its parameters with units and bounds
    needs: str  #: Channels and excitation without which it cannot be tested
    confounders: tuple[str, ...]  #: Ids that resemble it
    refuted_by: str  #: What observation would refute it
    experiment: str  #: The run that shows it best, as an instruction
    #: (Comparison, response) -> iterable of Variant: Every shape that it can take in this response; empty if `testable`
    #: says why not
    variants: Callable[[Comparison, str], Iterable[Variant]]
    #: (Comparison, response) -> str or None: None if it can be tested here, else one clause that says what is lacking
    testable: Callable[[Comparison, str], str | None]
    reading: Callable[[Fitted, Comparison], Reading]  #: (Fitted, Comparison) -> Reading: The fit in words
    #: Whether it is a parameter that every such simulation has, and whose wrong value hides other effects (a viscous
    #: coefficient fitted without dry friction): its first variant is then fitted beside all others
    absorbs: bool = False

    def __post_init__(self) -> None:
        made, testable = self.variants, self.testable

        @wraps(made)
        def where_testable(comparison: Comparison, response: str) -> Iterable[Variant]:
            return made(comparison, response) if testable(comparison, response) is None else ()

        object.__setattr__(self, "variants", where_testable)

    @property
    def family(self) -> str:
        """The part of the id before the dot."""
        return self.id.partition(".")[0]


def declared(id_: str, variants: Any, testable: Any, reading: Any, **more: Any) -> Effect:
    """A shipped effect, of which texts, where it enters and parameters stand in ``words.toml`` of its family.

    Of the parameters each has a row: name, unit, lowest and highest value, meaning; those of several effects are named
    alone. Those that are made of constants of the code are given as `more`, as of `Effect`.
    """
    family, _, name = id_.partition(".")
    return Effect(id_, variants=variants, testable=testable, reading=reading, **{**_words(family)[name], **more})


@cache
def _words(family: str) -> dict[str, dict[str, Any]]:
    told = tomllib.loads((Path(__file__).parent / family / "words.toml").read_text(encoding="utf-8"))
    for of in told.values():
        of["confounders"] = tuple(of["confounders"])
        if "parameters" in of:
            rows = of["parameters"]
            of["parameters"] = tuple(_SHARED[row] if isinstance(row, str) else ShapeParameter(*row) for row in rows)
    return told
