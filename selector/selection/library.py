"""Shapes of a model, and the cross-products of every term that the shapes under test may need."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from selector.models import moments as sums
from selector.models.best_subsets.results import adjusted_r2
from selector.models.design import Columns, Datum, Design, Form, Lag, ListedTerms, Scaling, Term
from selector.recording import RunSource
from selector.types import Array, Indices

ROUNDING = 1e-10


@dataclass(frozen=True)
class Shape:
    """What a set of sensors brings into the model."""

    form: Form | ListedTerms = field(default_factory=Form)  #: Polynomial terms in the sensors
    sensor_taus_s: tuple[float, ...] = ()  #: Each sensor brings a lag with each of these time constants [s]
    #: The spindle speed comes in, at once and lagged with these time constants [s]
    speed_taus_s: tuple[float, ...] = ()

    @property
    def has_memory(self) -> bool:
        """Whether any lag is in."""
        return bool(self.sensor_taus_s or self.speed_taus_s)

    def lags(self, sensors: Iterable[str], speeds: Iterable[str]) -> tuple[Lag, ...]:
        """The lags of a set of sensors."""
        of_sensors = (Lag(sensor, tau) for sensor in sensors for tau in self.sensor_taus_s)
        of_speeds = (Lag(speed, tau) for speed in speeds for tau in self.speed_taus_s)
        return (*of_sensors, *of_speeds)

    def terms(self, sensors: Sequence[str], speeds: Sequence[str]) -> tuple[Term, ...]:
        """Polynomial terms in the sensors, then the speed, then the lags (linear)."""
        direct = tuple(Term(((speed, 1),)) for speed in speeds) if self.speed_taus_s else ()
        lags = tuple(Term(((lag.name, 1),)) for lag in self.lags(sensors, speeds))
        return (*self.form.terms(sensors), *direct, *lags)

    def __str__(self) -> str:
        parts = [str(self.form)]
        if self.sensor_taus_s:
            parts.append("lags of " + " and ".join(f"{tau:.0f} s" for tau in self.sensor_taus_s))
        if self.speed_taus_s:
            parts.append("spindle speed lagged by " + " and ".join(f"{tau:.0f} s" for tau in self.speed_taus_s))
        return ", ".join(parts)


def key_of(term: Term) -> tuple[tuple[str, int], ...]:
    """The term whatever the order of its factors."""
    return tuple(sorted(term.powers))


@dataclass(frozen=True)
class Library:
    """Cross-products of many terms on every fold."""

    moments: sums.Moments
    position: dict[tuple[tuple[str, int], ...], int]  #: Column of each term
    responses: tuple[str, ...]
    speeds: tuple[str, ...]
    scaling: Scaling  #: Of the variables
    _columns: dict[tuple[tuple[str, ...], Shape], list[int]] = field(default_factory=dict, init=False, repr=False)

    def columns(self, sensors: Sequence[str], shape: Shape) -> list[int]:
        """Positions of the terms of a set of sensors."""
        asked = (tuple(sensors), shape)
        if asked not in self._columns:
            self._columns[asked] = [self.position[key_of(term)] for term in shape.terms(sensors, self.speeds)]
        return self._columns[asked]

    def owners(self, sensors: Sequence[str], shape: Shape) -> list[tuple[int, ...]]:
        """Sensors that each term needs, as positions in `sensors`; none for terms of the spindle speed."""
        number = {sensor: i for i, sensor in enumerate(sensors)}
        number.update({lag.name: number[lag.source] for lag in shape.lags(sensors, ())})
        return [
            tuple(sorted({number[name] for name in term.variables if name in number}))
            for term in shape.terms(sensors, self.speeds)
        ]


@dataclass(frozen=True)
class Bench:
    """A library restricted to the folds that a choice may see, ready to test sets on them."""

    library: Library
    total: Array  #: (k, k): Cross-products of [1, terms, responses] over the rows of the folds
    leave_one_out: sums.LeaveOneOut  #: Of the inner groups
    samples: Array  #: (n_groups,): Samples of each inner group
    power: Array  #: (n_responses,): Variance of each response [µm²]

    @classmethod
    def of(cls, library: Library, folds: Sequence[int]) -> "Bench":
        """The bench for these folds."""
        part = library.moments.only(folds)
        # rows that are purged between blocks are in the whole of all folds, and in none of them
        total = part.whole if part is not library.moments else part.products.sum(axis=0)
        groups = tuple(tuple(folds[i] for i in group) for group in sums.inner_grouping(part))
        apart = sums.LeaveOneOut(library.moments.products, groups, total[None], part.n_columns)
        return cls(library, part.whole, apart, apart.left_out(0, 0), sums.response_power(part))

    def cross(self, sensors: Sequence[str], shape: Shape, response: int) -> Array:
        """Centred cross-products of the terms of a set and one response, the response last."""
        at = [*self.library.columns(sensors, shape), self.library.moments.n_columns + response]
        return self._about_means(at)

    def _about_means(self, columns: ArrayLike) -> Array:
        """Cross-products about the means of some columns and responses, (..., n) → (..., n, n)."""
        at = 1 + np.asarray(columns, dtype=np.int64)
        index = np.concatenate([np.zeros((*at.shape[:-1], 1), dtype=np.int64), at], axis=-1)
        return sums.centred(self.total[index[..., :, None], index[..., None, :]])[0]

    @property
    def n_samples(self) -> int:
        """Samples over all folds."""
        return round(float(self.total[0, 0]))

    def held_out(self, sensors: Sequence[str], shape: Shape) -> sums.HeldOut:
        """Errors on every inner group, fitted to the others."""
        return self.leave_one_out.errors(self.library.columns(sensors, shape), len(self.library.responses))

    def held_out_of(
        self, sets: Sequence[tuple[str, ...]], shape: Shape, most_vif: float = np.inf
    ) -> dict[tuple[str, ...], sums.HeldOut]:
        """The same of many sets, of each number of terms together; without those in which a term has a larger VIF."""
        columns = {sensors: self.library.columns(sensors, shape) for sensors in sets}
        found = {}
        for size in dict.fromkeys(map(len, columns.values())):
            alike = [sensors for sensors in sets if len(columns[sensors]) == size]
            at = np.array([columns[sensors] for sensors in alike], dtype=np.int64)
            if most_vif < np.inf:
                kept = np.flatnonzero(self.largest_vifs(at) <= most_vif)
                at, alike = at[kept], [alike[k] for k in kept]
            sse = self.leave_one_out.errors_of(at, len(self.library.responses))
            found.update({sensors: sums.HeldOut(sse[:, i], self.samples) for i, sensors in enumerate(alike)})
        return found

    def relative(self, held_out: sums.HeldOut) -> Array:
        """Mean squared error per inner group, relative to each response's variance, mean over responses."""
        # differences below this are rounding of the cross-products, and no gauge would see them
        return np.asarray(np.maximum((held_out.mse / self.power).mean(axis=1), ROUNDING))

    def faults(self, sensors: Sequence[str], shape: Shape, alike: float = 1.0) -> tuple[float, bool]:
        """(worst fault, whether sensors that correlate by more than `alike` have coefficients of opposite signs).

        A fault is the share of a displacement's spread that one sensor moves when it is wrong by its own spread.
        With lags and powers the sign of a sensor is that of all its terms together, each times its spread.
        """
        terms, at = shape.terms(sensors, self.library.speeds), self.library.columns(sensors, shape)
        responses = range(1 + self.library.moments.n_columns, len(self.total))
        beta = sums.coefficients(self.total, [1 + column for column in at], responses)[1:]
        spread = np.sqrt(np.maximum(np.diag(self._about_means(at)) / self.n_samples, 0.0))
        moved = beta * spread[:, None] / np.sqrt(self.power)
        owners = self.library.owners(sensors, shape)
        of = np.array([[s in owners[i] for i in range(len(terms))] for s in range(len(sensors))], dtype=np.float64)
        worst = float((of @ np.abs(moved)).max(initial=0.0))
        plain = [self.library.position[((name, 1),)] for name in sensors if ((name, 1),) in self.library.position]
        if alike >= 1.0 or len(plain) < len(sensors):
            return worst, False
        cross = self._about_means(plain)
        size = np.sqrt(np.maximum(np.diag(cross), 1e-300))
        r, together = cross / size[:, None] / size, of @ moved
        opposed = together[:, None, :] * together[None, :, :] < 0.0
        return worst, bool((opposed & (r > alike)[:, :, None]).any())

    def largest_vif(self, sensors: Sequence[str], shape: Shape) -> float:
        """Variance inflation of the most redundant term; infinite for a term that the others make up."""
        return float(self.largest_vifs(np.array([self.library.columns(sensors, shape)]))[0])

    def largest_vifs(self, sets: Indices) -> Array:
        """The same of many sets of as many columns, shape (n_sets,)."""
        cross = self._about_means(sets)
        scale = np.sqrt(np.maximum(np.einsum("sii->si", cross), 1e-300))
        try:
            inverse = np.linalg.inv(cross / scale[:, :, None] / scale[:, None, :])
        except np.linalg.LinAlgError:
            return (
                np.concatenate([self.largest_vifs(one[None]) for one in sets]) if len(sets) > 1 else np.array([np.inf])
            )
        largest = np.einsum("sii->si", inverse).max(axis=1)
        return np.where(largest >= 1.0 - 1e-6, largest, np.inf)

    def r2(self, sensors: Sequence[str], shape: Shape) -> list[tuple[float, float]]:
        """(R², adjusted R²) of the fit over all folds, per response."""
        at = [1 + column for column in self.library.columns(sensors, shape)]
        n = self.library.moments.n_columns
        responses = range(1 + n, 1 + n + len(self.library.responses))
        rss = sums.squared_error(self.total, at, responses, sums.coefficients(self.total, at, responses))
        sst = np.diag(self._about_means(np.array(responses) - 1))
        found = []
        for j in range(len(responses)):
            r2 = 1.0 - float(rss[j] / sst[j]) if sst[j] > 0 else float("nan")
            found.append((r2, adjusted_r2(r2, self.n_samples, len(at))))
        return found

    def mean_adjusted_r2(self, sensors: Sequence[str], shape: Shape) -> float:
        """Adjusted R² averaged over the responses; −∞ where there are too few samples to say."""
        values = [adjusted for _, adjusted in self.r2(sensors, shape)]
        return float(np.mean(values)) if np.all(np.isfinite(values)) else float("-inf")


def library_of(
    source: RunSource,
    sets: Iterable[tuple[tuple[str, ...], Shape]],
    *,
    responses: Sequence[str],
    speeds: Sequence[str],
    datum: Datum,
    n_blocks: int,
    fold_of: Mapping[str, Hashable] | None = None,
) -> Library:
    """One pass over the samples for all terms of these sets of sensors and shapes; folds are those of `moments`."""
    inputs: dict[str, None] = {}
    lags: dict[Lag, None] = {}
    terms: dict[tuple[tuple[str, int], ...], Term] = {}
    is_hierarchical = True
    for sensors, shape in sets:
        is_hierarchical &= shape.form.is_hierarchical
        inputs.update(dict.fromkeys(sensors))
        if shape.speed_taus_s:
            inputs.update(dict.fromkeys(speeds))
        lags.update(dict.fromkeys(shape.lags(sensors, speeds)))
        for term in shape.terms(sensors, speeds):
            terms.setdefault(key_of(term), term)
    ordered = sorted(terms.values(), key=lambda term: term.degree)
    design = Design(tuple(inputs), tuple(responses), datum, tuple(lags))
    scaling = sums.scaling_of(source, design)
    columns = Columns(scaling if is_hierarchical else scaling.about_zero(), tuple(ordered))
    found = sums.moments(source, design, columns, n_blocks=n_blocks, fold_of=fold_of)
    position = {key_of(term): i for i, term in enumerate(ordered)}
    return Library(found, position, tuple(responses), tuple(speeds), scaling)
