"""From readings to the columns of a regression: terms, rises, lags, scaled products, run by run."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numba import njit
from scipy.special import chdtri

from selector.errors import OptionError
from selector.models.run_before import Before, chain_before
from selector.quality.completeness import is_late
from selector.recording import RunSource
from selector.types import Array, Indices, Mask

MAX_DEGREE = 3


@dataclass(frozen=True)
class Term:
    """A product of powers of variables, e.g. T1·T3 or T1²."""

    powers: tuple[tuple[str, int], ...]  #: Variable and exponent (≥ 1), in the order of the variables in their model

    @classmethod
    def of(cls, powers: Mapping[str, int]) -> Term:
        """The term with these exponents."""
        return cls(tuple(powers.items()))

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the factors."""
        return tuple(name for name, _ in self.powers)

    @property
    def degree(self) -> int:
        """Sum of the exponents."""
        return sum(power for _, power in self.powers)

    def __str__(self) -> str:
        return "·".join(name if power == 1 else f"{name}^{power}" for name, power in self.powers)


@dataclass(frozen=True)
class Form:
    """Which terms a set of variables brings with it."""

    degree: int = 1  #: Highest power of one variable, 1 to 3
    interactions: bool = False  #: Whether products of different variables come too, up to total degree max(2, degree)

    def __post_init__(self) -> None:
        if not 1 <= self.degree <= MAX_DEGREE:
            raise OptionError(
                f"degree {self.degree}",
                expected=f"1 to {MAX_DEGREE}",
                where="--degree",
                advice="use 1, 2 or 3; higher powers extrapolate wildly outside the recorded temperatures",
            )

    def terms(self, variables: Sequence[str]) -> tuple[Term, ...]:
        """Every term of this form: hierarchical, so no product stands without its factors."""
        return polynomial_terms(variables, self.degree, interactions=self.interactions)

    @property
    def is_hierarchical(self) -> bool:
        """Whether no product stands without its factors, so that a shift of the readings only changes coefficients."""
        return True

    def simpler(self) -> tuple[Form, ...]:
        """All forms nested in it, the simplest first, and itself."""
        forms = [Form(degree, mixed) for degree in range(1, self.degree + 1) for mixed in (False, True)]
        return tuple(form for form in forms if self.interactions or not form.interactions)

    def __str__(self) -> str:
        shape = ("linear", "quadratic", "cubic")[self.degree - 1]
        return f"{shape} with products" if self.interactions else shape


@dataclass(frozen=True)
class ListedTerms:
    """Terms one by one, where `Form` has all of a kind."""

    listed: tuple[Term, ...]

    @property
    def degree(self) -> int:
        """Highest power of one variable."""
        return max((power for term in self.listed for _, power in term.powers), default=1)

    @property
    def interactions(self) -> bool:
        """Whether a term has several variables."""
        return any(len(term.powers) > 1 for term in self.listed)

    @property
    def is_hierarchical(self) -> bool:
        """Whether no product stands without its factors."""
        have = {tuple(sorted(term.powers)) for term in self.listed}
        return all(tuple(sorted(one.powers)) in have for term in self.listed for one in _factors_of(term))

    def terms(self, variables: Sequence[str]) -> tuple[Term, ...]:
        """Those that need none but these variables."""
        return tuple(term for term in self.listed if set(term.variables) <= set(variables))

    def __str__(self) -> str:
        return "terms " + " + ".join(map(str, self.listed))


def hierarchical(terms: Iterable[Term]) -> tuple[Term, ...]:
    """The terms and all products of their factors, by total degree."""
    found: dict[tuple[tuple[str, int], ...], Term] = {}
    waiting = list(terms)
    while waiting:
        term = waiting.pop(0)
        if tuple(sorted(term.powers)) not in found:
            found[tuple(sorted(term.powers))] = term
            waiting += _factors_of(term)
    return tuple(sorted(found.values(), key=lambda term: term.degree))


def _factors_of(term: Term) -> list[Term]:
    """The term with one power less of each of its variables; none of a single variable."""
    powers = dict(term.powers)
    less = [{name: power - (name == one) for name, power in powers.items()} for one in powers]
    return [Term.of({name: power for name, power in one.items() if power}) for one in less if any(one.values())]


def polynomial_terms(variables: Sequence[str], degree: int, *, interactions: bool = False) -> tuple[Term, ...]:
    """Terms in `variables` up to `degree`, ordered by total degree, then by the order of the variables.

    >>> [str(term) for term in polynomial_terms(["T1", "T3"], 2, interactions=True)]
    ['T1', 'T3', 'T1^2', 'T1·T3', 'T3^2']
    """
    return _polynomial_terms(tuple(variables), degree, interactions)


@functools.lru_cache(maxsize=10_000)  # a choice asks for the terms of the same few sets again and again
def _polynomial_terms(variables: tuple[str, ...], degree: int, interactions: bool) -> tuple[Term, ...]:
    orders = range(1, 1 + (max(2, degree) if interactions else degree))
    products = itertools.chain.from_iterable(itertools.combinations_with_replacement(variables, n) for n in orders)
    powers = ({name: one.count(name) for name in dict.fromkeys(one)} for one in products)
    return tuple(Term.of(of) for of in powers if max(of.values()) <= degree and (interactions or len(of) == 1))


@dataclass(frozen=True)
class Scaling:
    """z = (x − centre) / scale for each variable.

    Raw temperatures in a polynomial are hopelessly collinear (degree 4 in °C: condition number 1e9); every fit of
    this package is made in z and converted back only for people.
    """

    variables: tuple[str, ...]
    centre: tuple[float, ...]
    scale: tuple[float, ...]

    def scaled(self, values: Array) -> Array:
        """Z for samples x of shape (n_samples, n_variables)."""
        return (values - np.asarray(self.centre)) / np.asarray(self.scale)

    def about_zero(self) -> Scaling:
        """The same scales without centres: a product without its factors means another model after a shift."""
        return Scaling(self.variables, (0.0,) * len(self.variables), self.scale)

    def only(self, variables: Iterable[str]) -> Scaling:
        """The scaling of some of the variables, in the order given."""
        wanted = tuple(variables)
        position = {name: i for i, name in enumerate(self.variables)}
        return Scaling(
            wanted,
            tuple(self.centre[position[name]] for name in wanted),
            tuple(self.scale[position[name]] for name in wanted),
        )


def design_matrix(scaled: Array, variables: Sequence[str], terms: Sequence[Term]) -> Array:
    """One column per term, shape (n_samples, n_terms), without the intercept.

    `variables` names the columns of `scaled`, shape (n_samples, n_variables), which are centred and scaled.
    """
    position = {name: i for i, name in enumerate(variables)}
    columns = np.empty((len(scaled), len(terms)), order="F")
    for j, term in enumerate(terms):
        factors = [scaled[:, position[name]] for name, power in term.powers for _ in range(power)]
        columns[:, j] = functools.reduce(np.multiply, factors)
    return columns


def physical_transform(terms: Sequence[Term], scaling: Scaling) -> tuple[tuple[Term, ...], Array]:
    """How coefficients of z become coefficients of x.

    Expanding Π((x − c)/s)^p gives every product of lower powers, so for a hierarchical list of terms the expansion
    needs no new ones; for others the missing ones are added.

    Returns
    -------
    terms : tuple of Term
        Terms in x: those given, then any that the expansion adds.
    matrix : ndarray of shape (1 + n_terms_x, 1 + n_terms_z)
        Maps (intercept, coefficients of z) to (intercept, coefficients of x).
    """
    centre = dict(zip(scaling.variables, scaling.centre, strict=True))
    scale = dict(zip(scaling.variables, scaling.scale, strict=True))
    out: dict[tuple[tuple[str, int], ...], int] = {(): 0}
    for term in terms:
        out[tuple(sorted(term.powers))] = len(out)
    expansions: list[dict[tuple[tuple[str, int], ...], float]] = []
    for term in terms:
        expansion: dict[tuple[tuple[str, int], ...], float] = {(): 1.0}
        for name, power in term.powers:
            binomial = np.polynomial.polynomial.polypow([-centre[name] / scale[name], 1.0 / scale[name]], power)
            expansion = {
                tuple(sorted((*key, (name, k)))) if k else key: value * float(factor)
                for key, value in expansion.items()
                for k, factor in enumerate(binomial)
                if factor
            }
        expansions.append(expansion)
        for key in expansion:
            out.setdefault(key, len(out))
    matrix = np.zeros((len(out), 1 + len(terms)))
    matrix[0, 0] = 1.0
    for j, expansion in enumerate(expansions, start=1):
        for key, value in expansion.items():
            matrix[out[key], j] += value
    given = {tuple(sorted(term.powers)): term for term in terms}
    return tuple(given.get(key, Term(key)) for key in out if key), matrix


@dataclass(frozen=True)
class Lag:
    """A first-order lag of a channel with time constant `tau_s` [s]."""

    source: str
    tau_s: float

    @property
    def name(self) -> str:
        """Name of the lagged variable, e.g. ``"T1.lag1800s"``."""
        return f"{self.source}.lag{self.tau_s:.6g}s"


def lagged(values: Array, time_s: Array, tau_s: Array, state: Array, last_s: Array) -> tuple[Array, Array, Array]:
    """Lagged samples, the states after the last one and their time stamps, so that a run can be fed in pieces.

    Backward Euler, s_k = s_{k−1} + Δt/(τ + Δt)·(x_k − s_{k−1}): stable for any step, and the control can compute it
    with + − × ÷ alone, so that the model on the machine is the model that was fitted.

    `values`, shape (n_samples, n_lags), hold the source of each lag; where it is missing the state waits, then takes
    the whole gap in one step. Time [s] increases, not necessarily regularly. Time constants [s], the states before the
    first sample (NaN = equilibrium with the first reading) and their time stamps have shape (n_lags,).
    """
    state, last_s = np.array(state, dtype=np.float64), np.array(last_s, dtype=np.float64)
    result = np.empty(values.shape)
    # copies can be written to: one kernel is compiled
    _lag_kernel(np.array(values, order="C"), np.array(time_s), np.array(tau_s, dtype=np.float64), state, last_s, result)
    return result, state, last_s


@njit(cache=True, nogil=True)
def _lag_kernel(values, time_s, tau_s, state, last_s, result):  # type: ignore[no-untyped-def]
    for k in range(values.shape[0]):
        for j in range(values.shape[1]):
            x = values[k, j]
            if np.isnan(x):
                result[k, j] = np.nan
                continue
            if np.isnan(state[j]):
                state[j] = x
            else:
                step = time_s[k] - last_s[j]
                state[j] += step / (tau_s[j] + step) * (x - state[j])
            last_s[j] = time_s[k]
            result[k, j] = state[j]


def time_constant_grid(period_s: float, duration_s: float, n: int = 9) -> Array:
    """Time constants worth trying [s], evenly spaced in their logarithm.

    From three sampling periods (a faster lag is noise) to the length of the longest run (a slower one is a straight
    line there, and what it does on a longer day nobody has seen).
    """
    low = max(3.0 * period_s, duration_s / 200.0)
    high = max(duration_s, 2.0 * low)
    return np.geomspace(low, high, n)


NOISE_SAMPLES = 30
#: Largest next power, in its standard errors. At 1 a bend hides behind the noise and the start is off by more than one
#: sample's noise; much below, too few samples are used (0.6 of a sample's noise on warming and cooling runs at 0.7).
SMALL_BEND = 0.7
#: Readings are neighbours up to so many sampling periods and so many seconds apart: between others a machine moves,
#: and that is not noise.
NEIGHBOURS_PERIODS, NEIGHBOURS_S = 3.0, 60.0


def start_reading(time_s: Array, samples: Array) -> tuple[float, float]:
    """Level at the start of a run and its standard error, from the first samples.

    One sample carries the whole noise of the gauge into every later rise of the run. A straight line or a parabola
    through the first k samples, read off at the first of them, carries less. Of both and all k up to 30, the one with
    the smallest standard error is taken among those that the samples do not contradict: by their scatter (χ² at 10 %,
    noise from second differences), and by the next power, which must be small against its own standard error, since
    a bend that is barely seen already shifts the start. A level run is not assumed to be level for the same reason.
    Readings after a gap, as of a gauge that is read now and then, say nothing of the start.

    The run's first samples (30 are enough) have shape (n_samples,), NaN = missing. Both numbers are NaN if there is no
    reading; the error is NaN if it cannot be estimated.
    """
    known = np.isfinite(samples)
    found, time = samples[known][:NOISE_SAMPLES], time_s[known][:NOISE_SAMPLES]
    if len(found) == 0:
        return np.nan, np.nan
    if len(found) > 1 and np.diff(time).max() > NEIGHBOURS_S:
        far = np.diff(time) > max(NEIGHBOURS_PERIODS * _median(np.diff(time_s)), NEIGHBOURS_S)
        n = 1 + int(np.argmax(np.append(far, True)))
        found, time = found[:n], time[:n]
    if len(found) < 4:
        return float(found[0]), np.nan
    # second differences see the noise and not the warming
    noise = _median(np.abs(np.diff(found, 2))) / (0.6745 * np.sqrt(6.0))
    noise = max(noise, _quantum(found) / np.sqrt(12.0))
    if noise < 0.1 * _median(np.abs(np.diff(found))):
        # a smooth curve, whose second differences are its bend and not noise
        return float(found[0]), noise
    fits, next_powers, gains = _start_fits(tuple((time - time[0]).tolist()))
    errors = noise * gains
    usable = np.flatnonzero((np.abs(next_powers @ found) <= SMALL_BEND * noise) & (errors < noise))
    # the most exact first, so that the search ends with the first that holds
    for i in usable[np.argsort(errors[usable], kind="stable")]:
        basis, solver, limit = fits[i]
        values = found[: len(basis)]
        coefficients = solver @ values
        if float((((values - basis @ coefficients) / noise) ** 2).sum()) <= limit:
            return float(coefficients[0]), float(errors[i])
    return float(found[0]), noise


@functools.lru_cache(maxsize=256)
def _start_fits(time: tuple[float, ...]) -> tuple[tuple[tuple[Array, Array, float], ...], Array, Array]:
    """Least squares of polynomials through the first samples, done once for each pattern of time stamps.

    For each its basis, solver and limit of χ²; for a noise of 1 what gives its next coefficient, in standard errors,
    and the standard error of the start.
    """
    fits, gains, further = [], [], []
    for k in range(4, len(time) + 1):
        powers = np.vander(np.array(time[:k]) / time[k - 1], 4, increasing=True)
        for order in range(1, min(2, k - 3) + 1):
            basis = powers[:, : order + 1]
            solver = np.asarray(np.linalg.pinv(basis), dtype=np.float64)
            following = np.linalg.pinv(powers[:, : order + 2])[-1]
            further.append(np.concatenate([following / np.linalg.norm(following), np.zeros(len(time) - k)]))
            gains.append(float(np.linalg.norm(solver[0])))
            fits.append((basis, solver, float(chdtri(k - order - 1, 0.1))))
    return tuple(fits), np.array(further), np.array(gains)


def start_readings(source: RunSource, names: Sequence[str]) -> dict[str, dict[str, tuple[float, float]]]:
    """`start_reading` of every channel in every run: {run: {channel: (level, standard error)}}.

    A channel whose first reading comes late (`is_late`) has no start: (NaN, NaN).
    """
    wanted = tuple(dict.fromkeys(names))
    starts: dict[str, dict[str, tuple[float, float]]] = {}
    for run in source.runs:
        times: list[Array] = []
        parts: list[Array] = []
        for time_s, values in source.chunks(run, wanted):
            times.append(time_s[: 4 * NOISE_SAMPLES])
            parts.append(values[: 4 * NOISE_SAMPLES])
            if sum(map(len, times)) >= 4 * NOISE_SAMPLES:
                break
        if not times:
            starts[run] = dict.fromkeys(wanted, (np.nan, np.nan))
            continue
        time, head = np.concatenate(times), np.concatenate(parts)
        at_start = ~is_late(np.arange(len(time)), time - time[0])
        starts[run] = {
            name: start_reading(time, head[:, j]) if np.isfinite(head[at_start, j]).any() else (np.nan, np.nan)
            for j, name in enumerate(wanted)
        }
    return starts


def gauge_start(level: float, standard_error: float) -> float:
    """The offset of a displacement gauge at the start of a run [µm]; 0 when it cannot be told from zero.

    A gauge is zeroed before a run. Subtracting the first reading of a gauge that *was* zeroed would only add its
    noise to the whole run. The start is the best of many fits and its standard error knows nothing of that choice, so
    an offset counts as one from eight standard errors on.
    """
    if not np.isfinite(level):
        return 0.0
    if np.isfinite(standard_error) and abs(level) <= 8.0 * standard_error:
        return 0.0
    return level


def _quantum(found: Array) -> float:
    ordered = np.sort(found)
    steps = np.diff(ordered)
    large = steps[steps > 1e-9 * max(1.0, abs(float(ordered[0])), abs(float(ordered[-1])))]
    return float(large.min()) if len(large) and np.count_nonzero(steps) < len(found) // 2 else 0.0


def _median(few: Array) -> float:
    """Of a few numbers; `numpy.median` takes longer to look at what it was given than to find it."""
    ordered = np.sort(few)
    return 0.5 * float(ordered[(len(few) - 1) // 2] + ordered[len(few) // 2])


Reference = Literal["rise", "absolute"]


@dataclass(frozen=True)
class Datum:
    """What is subtracted from every reading of a run: {run: {channel: level}}; nothing for `absolute`."""

    reference: Reference
    levels: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    follows: Mapping[str, Before] = field(default_factory=dict)  #: What `runs_before` knows: memory goes on from there

    def level(self, run: str, channel: str) -> float:
        """The level of one channel in one run: 0 if it has no datum, NaN if it needs one and its start is missing."""
        return self.levels.get(run, {}).get(channel, 0.0)


def datum_of(source: RunSource, inputs: Sequence[str], responses: Sequence[str], reference: Reference) -> Datum:
    """The datum of every run.

    Temperatures count from the start of the run; one that has no reading there has no rise in that run. A displacement
    counts from the start too, unless its gauge was zeroed already (`gauge_start`); `begun` has taken the start of the
    run to where it reads something. A speed is never a rise.
    """
    if reference == "absolute":
        return Datum("absolute")
    found = start_readings(source, (*inputs, *responses))
    levels = {
        run: {name: gauge_start(*reading) if name in responses else reading[0] for name, reading in readings.items()}
        for run, readings in found.items()
    }
    return Datum("rise", levels)


@dataclass(frozen=True)
class Piece:
    """Some consecutive samples of a run."""

    time_s: Array  #: (n_samples,)
    variables: Array  #: (n_samples, n_variables): Rises (or absolute readings), then lags; NaN = missing
    responses: Array  #: (n_samples, n_responses): Displacements [µm]


@dataclass(frozen=True)
class Design:
    """Which variables are made from which channels, and against which datum."""

    inputs: tuple[str, ...]
    responses: tuple[str, ...]
    datum: Datum
    lags: tuple[Lag, ...] = ()

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables: inputs, then lags."""
        return (*self.inputs, *(lag.name for lag in self.lags))

    def lag_and_source(self, variable: str) -> tuple[Lag | None, str]:
        """The lag that a variable is, if it is one, and the channel that it is made from."""
        lag = next((lag for lag in self.lags if lag.name == variable), None)
        return lag, lag.source if lag else variable

    def pieces(self, source: RunSource, run: str, *, complete: bool = True) -> Iterator[Piece]:
        """Samples of a run in order; with `complete` only those at which nothing is missing."""
        channels = (*self.inputs, *self.responses)
        levels = np.array([self.datum.level(run, name) for name in channels])
        n_inputs = len(self.inputs)
        source_of_lag = [self.inputs.index(lag.source) for lag in self.lags]
        tau_s = np.array([lag.tau_s for lag in self.lags])
        state = np.full(len(self.lags), np.nan)
        last_s = np.full(len(self.lags), np.nan)
        for earlier, later_s in chain_before(self.datum.follows, run, tau_s):
            for time_s, raw in source.chunks(earlier, self.inputs):
                past = (raw - levels[:n_inputs])[:, source_of_lag]
                _, state, last_s = lagged(past, time_s - later_s, tau_s, state, last_s)
        # rises: what a state has at the start is in the displacement that counts as zero
        settling = np.isfinite(state) & (self.datum.reference == "rise")
        shift = np.where(settling, np.nan, 0.0)
        for time_s, raw in source.chunks(run, channels):
            values = raw - levels
            variables = values[:, :n_inputs]
            if self.lags:
                now = variables[:, source_of_lag]
                past, state, last_s = lagged(now, time_s, tau_s, state, last_s)
                for j in np.flatnonzero(np.isnan(shift) & np.isfinite(past).any(axis=0)):
                    first = int(np.argmax(np.isfinite(past[:, j])))
                    shift[j] = now[first, j] - past[first, j]
                variables = np.concatenate([variables, past + shift], axis=1)
            piece = Piece(time_s, variables, values[:, n_inputs:])
            if complete:
                whole = np.isfinite(piece.variables).all(axis=1) & np.isfinite(piece.responses).all(axis=1)
                if not whole.all():
                    piece = Piece(time_s[whole], piece.variables[whole], piece.responses[whole])
            if len(piece.time_s):
                yield piece


@dataclass(frozen=True)
class Columns:
    """Regression columns over the variables of a design."""

    scaling: Scaling
    terms: tuple[Term, ...]

    def matrix(self, variables: Array) -> Array:
        """Column per term, shape (n_samples, n_terms), from unscaled variables in the order of `scaling`."""
        return design_matrix(self.scaling.scaled(variables), self.scaling.variables, self.terms)


@dataclass(frozen=True)
class Rows:
    """Complete samples of some runs, one after the other."""

    runs: tuple[str, ...]
    run: Indices  #: (n_samples,): Position in `runs`
    time_s: Array  #: (n_samples,)
    variables: Array  #: (n_samples, n_variables)
    responses: Array  #: (n_samples, n_responses)

    def only(self, keep: Mask) -> Rows:
        """The samples for which `keep` is true."""
        return Rows(self.runs, self.run[keep], self.time_s[keep], self.variables[keep], self.responses[keep])

    def blocks(self, n_blocks: int) -> Indices:
        """Block of each sample within its run, −1 = purged at an edge; shape (n_samples,)."""
        labels = np.full(len(self.run), -1, dtype=np.int64)
        for r in range(len(self.runs)):
            at = np.flatnonzero(self.run == r)
            for i, (start, stop) in enumerate(block_bounds(len(at), n_blocks)):
                labels[at[start:stop]] = i
        return labels


def block_bounds(n: int, n_blocks: int) -> list[tuple[int, int]]:
    """(start, stop) of contiguous blocks; an eighth of a block is purged at each side that touches another.

    Neighbouring samples of a warming machine are all but copies of each other, so a block next to the one left out
    would give the answer away at the edge.
    """
    if n_blocks == 1:
        return [(0, n)]
    edges = np.linspace(0, n, n_blocks + 1).astype(int)
    purge = max((n // n_blocks) // 8, 1)
    return [
        (int(edges[i]) + (purge if i else 0), int(edges[i + 1]) - (purge if i < n_blocks - 1 else 0))
        for i in range(n_blocks)
    ]


def rows_of(source: RunSource, design: Design, runs: Sequence[str]) -> Rows:
    """The complete samples of some runs."""
    number: list[Indices] = []
    parts: list[tuple[Array, Array, Array]] = []
    for r, run in enumerate(runs):
        for piece in design.pieces(source, run):
            parts.append((piece.time_s, piece.variables, piece.responses))
            number.append(np.full(len(piece.time_s), r, dtype=np.int64))
    empty = (np.zeros(0), np.zeros((0, len(design.variables))), np.zeros((0, len(design.responses))))
    time_s, variables, responses = (np.concatenate(column) for column in zip(*(parts or [empty]), strict=True))
    run_number = np.concatenate(number) if number else np.zeros(0, dtype=np.int64)
    return Rows(tuple(runs), run_number, time_s, variables, responses)
