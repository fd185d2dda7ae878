"""What an effect of the catalogue is: its physics, the shapes it can take in a residual, how a fit of it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Family = Literal["data", "thermal", "drive", "vibration", "gauging", "flow"]
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

    def with_real_interval(self) -> Quantity:
        """The same without an interval that has no width."""
        return Quantity(self.value, self.unit) if self.low is not None and self.low == self.high else self


@dataclass(frozen=True)
class ShapeParameter:
    """A parameter of an effect: its name in the answer, unit, bounds and meaning."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


@dataclass(frozen=True, eq=False)
class Variant:
    """One shape that an effect can take in the residual of one response: columns whose coefficients are fitted.

    Attributes
    ----------
    columns : ndarray of shape (n_rows, n_columns)
        Over all rows, held-out ones included; finite. 1 to 4 columns. The coefficients carry the unit.
    names : tuple of str
        What each column is, in words, e.g. ``"T2 delayed by 40 min"``.
    shape : mapping of str to Quantity
        The shape parameters of this variant, e.g. ``{"tau_s": Quantity(2400.0, "s")}``.
    place : str or None
        Where the effect would act, in the words of the machine file.
    sources : tuple of str
        Channels that it was made of.
    run : str or None
        The one run that it acts in; None = all.
    bounds : tuple of (float, float) or None
        Allowed interval of every coefficient where physics knows it; None = any.
    regime : str or None
        When it acts, in words of recorded channels, e.g. ``"spindle_speed > 1500 rpm"``; None = always.
    looked_at : float
        Among how many shapes this one was chosen by looking at the residual; 1 = it was not.
    weight : float
        How likely it is beforehand against the other shapes of the effect.
    """

    columns: Matrix
    names: tuple[str, ...]
    shape: Mapping[str, Quantity] = field(default_factory=dict)
    place: str | None = None
    sources: tuple[str, ...] = ()
    run: str | None = None
    bounds: tuple[tuple[float, float], ...] | None = None
    regime: str | None = None
    looked_at: float = 1.0
    weight: float = 1.0

    def __post_init__(self) -> None:
        if self.columns.ndim != 2 or self.columns.shape[1] != len(self.names):
            raise ValueError(f"columns of shape {self.columns.shape} with {len(self.names)} names")
        if self.bounds is not None and len(self.bounds) != len(self.names):
            raise ValueError(f"{len(self.bounds)} bounds for {len(self.names)} columns")


def equally_likely(*kinds: Iterable[Variant]) -> Iterator[Variant]:
    """The shapes of several kinds of which each is as likely as the others, however many shapes it can take."""
    for kind in kinds:
        shapes = list(kind)
        yield from (replace(shape, weight=shape.weight / len(shapes)) for shape in shapes)


@dataclass(frozen=True)
class Fitted:
    """A fitted variant, as `Effect.reading` receives it.

    Attributes
    ----------
    response, unit : str
        The response and its unit.
    variant : Variant
        The shape that fits best.
    coefficients, standard_errors : ndarrays of shape (n_columns,)
        In the unit of the response per unit of the column.
    shape_intervals : mapping of str to (float, float)
        95 % interval of each shape parameter, from the profile over the variants; without those of no width. An end of
        0 or infinity says that the record sets no limit there.
    rms, largest : float
        Root mean square and largest amount of the effect's course in the response [unit].
    extremes : (float, float)
        Lowest and highest value of the course since the start of a run [unit]; both 0 where they are not known.
    """

    response: str
    unit: str
    variant: Variant
    coefficients: Vector
    standard_errors: Vector
    shape_intervals: Mapping[str, tuple[float, float]]
    rms: float
    largest: float
    extremes: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        wide = {name: (low, high) for name, (low, high) in self.shape_intervals.items() if low != high}
        object.__setattr__(self, "shape_intervals", wide)


@dataclass(frozen=True)
class Reading:
    """A fitted effect in words and numbers: one sentence with units, and its parameters as the contract has them."""

    statement: str
    parameters: Mapping[str, Quantity] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Effect:
    """One kind of physics, or one fault of the data, that a simulation may not have.

    Attributes
    ----------
    id : str
        ``"family.name"``; contract, never renamed.
    title : str
        A few words.
    physics : str
        Two sentences: what happens, and how it shows.
    reference : str
        Where the equation comes from.
    enters : {"force", "heat flow", "displacement", "measurement", "state", "limit"}
        Where it enters the machine's equations.
    acts_at : str
        The places at which it can act.
    parameters : tuple of ShapeParameter
        Its parameters with units and bounds.
    needs : str
        Channels and excitation without which it cannot be tested.
    confounders : tuple of str
        Ids that resemble it.
    refuted_by : str
        What observation would refute it.
    experiment : str
        The run that shows it best, as an instruction.
    variants : callable (Comparison, response) -> iterable of Variant
        Every shape that it can take in this response; empty if `testable` says why not.
    testable : callable (Comparison, response) -> str or None
        None if it can be tested here, else one clause that says what is lacking.
    reading : callable (Fitted, Comparison) -> Reading
        The fit in words.
    absorbs : bool
        Whether it is a parameter that every such simulation has, and whose wrong value hides other effects (a viscous
        coefficient fitted without dry friction): its first variant is then fitted beside all others.
    """

    id: str
    title: str
    physics: str
    reference: str
    enters: Entry
    acts_at: str
    parameters: tuple[ShapeParameter, ...]
    needs: str
    confounders: tuple[str, ...]
    refuted_by: str
    experiment: str
    variants: Callable[[Comparison, str], Iterable[Variant]]
    testable: Callable[[Comparison, str], str | None]
    reading: Callable[[Fitted, Comparison], Reading]
    absorbs: bool = False

    @property
    def family(self) -> str:
        """The part of the id before the dot."""
        return self.id.partition(".")[0]
