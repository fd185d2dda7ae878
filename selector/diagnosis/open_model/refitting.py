"""How far do its own parameters bring a simulation that can be run again, and which of them were pulled."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.noise import NoiseModel, filled_rows, noise_model, stretches, whitened
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.matching.usable import rounding_of
from selector.diagnosis.open_model.runnable import Runnable
from selector.errors import InputError
from selector.findings import Finding
from selector.physics.model_fields import Parameter
from selector.recording import Recording
from selector.types import Matrix, Vector
from selector.units import convert

FARTHEST = 3.0  #: Standard deviations of the nameplate that a parameter may go.
STEP = 0.1  #: Step of a finite difference, in standard deviations of the nameplate.


@dataclass(frozen=True, eq=False)
class RefitProblem:
    """Weighted residuals of the fitted rows as a function of parameters in nameplate units."""

    runnable: Runnable
    comparison: Comparison
    names: tuple[str, ...]  #: Parameters that are fitted
    #: centre and spread: (n_parameters,): What the file says, and its standard deviation
    centre: Vector
    spread: Vector
    free: NDArray[np.bool_]  #: (n_parameters,): Parameters that no nameplate holds
    noise: Mapping[str, NoiseModel]  #: Response → what counts as one standard deviation
    parts: Mapping[str, list[slice]]  #: Response → stretches without gaps, fitted rows
    counted: Callable[[], None]  #: Told of every run of the simulation

    def courses(self, z: Vector) -> dict[str, Vector]:
        """Simulated responses; z is in standard deviations of the nameplate."""
        self.counted()
        values = dict(zip(self.names, (self.centre + self.spread * z).tolist(), strict=True))
        return simulated_rows(self.comparison, self.runnable.simulated(values))

    def white(self, courses: Mapping[str, Vector]) -> Vector:
        """Recorded less simulated in standard deviations, fitted rows, responses behind each other."""
        parts = []
        for name in self.comparison.responses:
            left = self.comparison.recorded[name] - courses[name]
            rows = filled_rows(left, self.parts[name])
            parts.append(whitened(self.noise[name], rows[:, None], self.parts[name])[:, 0])
        kept = ~self.comparison.held_out
        return np.concatenate([part[kept] for part in parts])

    def cost(self, z: Vector, courses: Mapping[str, Vector]) -> float:
        """Sum of squares of what is left, and of how far parameters went that nameplates hold."""
        white = self.white(courses)
        return float(white @ white + np.sum(z[~self.free] ** 2))

    def tangents(
        self, z: Vector, at: Mapping[str, Vector], known: Mapping[str, Mapping[str, Vector]] | None = None
    ) -> dict[str, Matrix]:
        """Response → change of its course with every parameter, by finite differences, shape (n_rows, n_parameters).

        Those that are `known` (response → parameter) are taken as they are.
        """
        found = {name: np.zeros((len(self.comparison.time_s), len(self.names))) for name in self.comparison.responses}
        for k, parameter in enumerate(self.names):
            if known and all(parameter in known[name] for name in found):
                for name, columns in found.items():
                    columns[:, k] = known[name][parameter]
                continue
            for step in (STEP, -STEP):
                moved = np.array(z)
                moved[k] += step
                if abs(moved[k]) > self.limits[1][k] + 1e-12 and step > 0.0:
                    continue
                try:
                    courses = self.courses(moved)
                except InputError:
                    continue
                for name, columns in found.items():
                    columns[:, k] = (courses[name] - at[name]) / step
                break
        return found

    def white_tangents(self, tangents: Mapping[str, Matrix]) -> Matrix:
        """The same in standard deviations of the responses, fitted rows."""
        kept = ~self.comparison.held_out
        return np.concatenate([
            whitened(self.noise[name], np.column_stack([filled_rows(c, self.parts[name]) for c in tangents[name].T])
                     if tangents[name].shape[1] else tangents[name], self.parts[name])[kept]
            for name in self.comparison.responses
        ])  # fmt: skip

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Between what z may lie: three standard deviations of the nameplate, or the bounds that were said."""
        parameters = self.runnable.parameters
        low, high = (np.array([getattr(parameters[name], end) for name in self.names]) for end in ("low", "high"))
        bounds = (low - self.centre) / self.spread, (high - self.centre) / self.spread
        far = np.where(self.free, np.inf, FARTHEST)
        return np.maximum(bounds[0], -far), np.minimum(bounds[1], far)


def simulated_rows(comparison: Comparison, simulation: Recording) -> dict[str, Vector]:
    """Responses of a simulation with the recordings' times, at the rows and in the units of a comparison."""
    names = list(comparison.responses)
    rows = np.concatenate([
        simulation.values(run, names)[np.searchsorted(simulation.time_s(run), comparison.time_s[part])]
        for run, part in comparison.rows_of_runs()
    ])  # fmt: skip
    units = [(simulation.channel(name).unit, comparison.channel(name).unit) for name in names]
    return {name: convert(np.ascontiguousarray(rows[:, k]), *units[k]) for k, name in enumerate(names)}


def noise_of(fit: RefitProblem, slopes: "_Slopes", *, repeated: bool = False) -> dict[str, NoiseModel]:
    """What counts as one standard deviation of every response: the size of what its parameters leave of it.

    A filter that made it white would weigh its fast part most, where the model is wrong most often; an even weight
    finds the parameters that make all errors small. With `repeated` readings that repeat each other count once: for
    intervals. Of a recording that equals its simulation rounding is left.
    """
    found, kept = {}, ~fit.comparison.held_out
    for name in fit.comparison.responses:
        left = fit.comparison.recorded[name] - slopes.courses[name]
        seen = np.isfinite(left) & kept
        columns = slopes.tangents[name]
        left = left - columns @ np.linalg.lstsq(columns[seen], left[seen], rcond=_TOLD)[0]
        left = np.where(kept, left, np.nan)
        size = float(np.sqrt(np.nanmean(left**2)))
        if repeated:
            model = noise_model(left, [part for part in fit.parts[name] if part.stop - part.start > 8])
            size *= float(np.sqrt(model.correlation_samples))
        found[name] = NoiseModel(np.zeros(0), max(size, rounding_of(fit.comparison, name), 1e-300))
    return found


_TOLD = 1e-3  #: Of the largest singular value: directions of parameters that a response tells of.
Say = Callable[[int, int, str], None]
_Start = tuple[Vector, "_Slopes"]

#: Standard deviation of a parameter about what the file says, as a share of it: what name plates are worth.
NAMEPLATE = 0.2
#: The least of it where a parameter may have either sign, as a share of its range: it may be near 0 by chance.
_OF_RANGE = 0.005
#: A parameter of which the record leaves more than this share of the nameplate's uncertainty is not determined.
_UNDETERMINED = 0.8
_PULLED = 0.1
_PULLED_SD = 3.0
_SETTLED = 0.01  #: Change of a parameter in nameplate units that is not followed.
_STEPS, _HALVINGS = 20, 5
_GAINS = 1e-4  #: Share of the weighted sum of squares that a step has to gain to be worth another one.
_AS_FORETOLD = 0.5
_ANEW = 3  #: How often finite differences are taken anew at most.
_USUAL_SLOPES = 2
_NEAR = 0.1  #: Way from where finite differences were taken, in nameplate units, within which they hold.
_MOST_DIRECTIONS = 8
_AT_LIMIT = 0.9  #: Share of the way to the limits from which on a parameter is at them.
#: Starts that are drawn when a fit ran to its limits, and those of them that are followed to their ends.
_DRAWS, _FOLLOWED = 24, 2


@dataclass(frozen=True, eq=False)
class Refitted:
    """A simulation whose parameters were fitted to the recordings."""

    nominal: Comparison  #: With the simulation as it was given
    comparison: Comparison  #: With the refitted one; its `tangents` say what the parameters could still change
    values: Mapping[str, float]  #: Every parameter that was fitted
    quantities: Mapping[str, Quantity]  #: The same with units and 95 % intervals
    runs: int  #: How often the simulation was run
    findings: tuple[Finding, ...]
    #: (n_rows,): Response → parameter → change of its course with the parameter, per unit of the parameter
    slopes: Mapping[str, Mapping[str, Vector]]
    #: Parameter → standard deviation of its nameplate; how many of them it has gone, but of those that nothing holds
    spread: Mapping[str, float]
    away: Mapping[str, float]


def refitted(
    runnable: Runnable,
    recording: Recording,
    *,
    responses: Sequence[str] | None = None,
    holdout: str = "last",
    added: Sequence[Mapping[str, float]] = (),
    start: Refitted | None = None,
    progress: Say | None = None,
) -> Refitted:
    """The simulation with its own parameters fitted to the recordings, by Gauss–Newton on weighted residuals.

    Every parameter is held by its nameplate (docs/how-to/diagnose-a-model.md). Noise is estimated from what is left,
    and the fit repeated with it.

    `responses` and `holdout` are those of `alignment.comparison_of`. `added` are parameters to be fitted beyond those
    that recalibration changes, of which nothing is known but their bounds: where the search may begin. The best one is
    taken, for the way from one to another may lead uphill. `start` is of the model without what was added: where to
    begin with the others, and how they change it there. `progress` is told how often the simulation was run, how often
    it may have to be, and what is done.

    Raises InputError: recordings and simulation cannot be compared.
    """
    done = 0
    starts = [dict(one) for one in added] or [{}]
    extra = starts[0]
    names = tuple(dict.fromkeys([*runnable.refitted, *extra]))
    usual = 1 + len(starts) + (_USUAL_SLOPES + 1) * len(names) + 2 * _STEPS

    def counted() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            of = f" of about {usual}" if done <= usual else ""
            what = f"fitting {len(names)} parameters: run {done}{of} of the simulation"
            progress(min(done, usual), usual, what)

    counted()
    nominal = comparison_of(recording, runnable.simulated({}), responses=responses, holdout=holdout)
    parameters = runnable.parameters
    seen = {name: np.isfinite(nominal.difference(name)) & ~nominal.held_out for name in nominal.responses}
    fit = RefitProblem(
        runnable=runnable,
        comparison=nominal,
        names=names,
        centre=np.array([parameters[name].value for name in names]),
        spread=np.array([_spread(parameters[name], name, runnable, extra) for name in names]),
        free=np.array([name in extra or name in runnable.bounded for name in names], dtype=bool),
        noise={},
        parts={name: stretches(nominal, rows) for name, rows in seen.items()},
        counted=counted,
    )
    earlier = {} if start is None else start.values
    z, slopes = _best_start(fit, [{**earlier, **one} for one in starts], start)
    z, slopes = _fitted(fit, z, slopes)
    if start is None and bool(np.any(np.abs(z[~fit.free]) > _AT_LIMIT * FARTHEST)):
        z, slopes = _from_elsewhere(fit, z, slopes)
    courses, tangents = slopes.courses, slopes.taken
    fit = replace(fit, noise=noise_of(fit, slopes, repeated=True))
    white = fit.white_tangents(tangents)
    inner = white.T @ white + np.diag(np.where(fit.free, 1e-12, 1.0))
    covariance = np.linalg.pinv(inner, hermitian=True)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    left_alone = tuple(name for k, name in enumerate(names) if sd[k] > _UNDETERMINED and not fit.free[k])
    values = dict(zip(fit.names, (fit.centre + fit.spread * z).tolist(), strict=True))
    quantities = {}
    for k, name in enumerate(fit.names):
        one, half = parameters[name], 1.96 * float(fit.spread[k] * sd[k])
        ends = max(values[name] - half, one.low), min(values[name] + half, one.high)
        quantities[name] = Quantity(values[name], one.unit, *ends)
    comparison = replace(
        nominal,
        simulated={**nominal.simulated, **courses},
        tangents=_directions(fit, tangents, white, sd < _UNDETERMINED),
    )
    findings = [*_pulled(fit, z, sd, extra), *_told(left_alone, runnable)]
    by_name = {
        response: dict(zip(names, (columns / fit.spread).T, strict=True)) for response, columns in tangents.items()
    }
    spread = dict(zip(names, fit.spread.tolist(), strict=True))
    away = {name: float(z[k]) for k, name in enumerate(names) if not fit.free[k]}
    return Refitted(nominal, comparison, values, quantities, done, tuple(findings), by_name, spread, away)


def _spread(one: Parameter, name: str, runnable: Runnable, extra: Mapping[str, float]) -> float:
    """Standard deviation before anything was recorded [unit of the parameter]."""
    if name in extra:
        return max(abs(extra[name]), 0.1 * (one.high - one.low))
    if name in runnable.bounded:
        return (one.high - one.low) / np.sqrt(12.0)
    return max(NAMEPLATE * abs(one.value), _OF_RANGE * (one.high - one.low) if one.low < 0.0 < one.high else 0.0)


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Courses at a point, and how they change there: by finite differences elsewhere, mended by every step since."""

    #: at and taken_at: (n_parameters,): Where the courses are; where the finite differences were taken
    at: Vector
    taken_at: Vector
    courses: Mapping[str, Vector]  #: (n_rows,)
    #: taken and tangents: (n_rows, n_parameters): Finite differences, and the same as mended since
    taken: Mapping[str, Matrix]
    tangents: Mapping[str, Matrix]

    def mended(self, z: Vector, courses: Mapping[str, Vector]) -> "_Slopes":
        """So that they say what a step did, courses there (C. G. Broyden 1965, Math. Comp. 19, 577–593)."""
        step = z - self.at
        length = float(step @ step)
        if length == 0.0:
            return self
        tangents = {
            name: columns + np.outer(courses[name] - self.courses[name] - columns @ step, step / length)
            for name, columns in self.tangents.items()
        }
        return replace(self, tangents=tangents)


def _slopes(
    fit: RefitProblem, z: Vector, courses: Mapping[str, Vector], known: Mapping[str, Mapping[str, Vector]] | None = None
) -> _Slopes:
    taken = fit.tangents(z, courses, known)
    return _Slopes(z, z, courses, taken, taken)


def _best_start(fit: RefitProblem, starts: Sequence[Mapping[str, float]], earlier: Refitted | None) -> _Start:
    """The start from which one step of all parameters that are not `free` leads lowest."""
    found = [
        np.clip([(one.get(name, c) - c) / s for name, c, s in zip(fit.names, fit.centre, fit.spread, strict=True)],
                *fit.limits)
        for one in starts
    ]  # fmt: skip
    courses = fit.courses(found[0])
    slopes = _slopes(fit, found[0], courses, _known(fit, earlier))
    if len(found) == 1:
        return found[0], slopes
    weighed = replace(fit, noise=noise_of(fit, slopes))
    columns = weighed.white_tangents(slopes.tangents)[:, ~fit.free]
    best, least = slopes, np.inf
    for z in found:
        try:
            held = z[~fit.free]
            inner = columns.T @ columns + np.eye(len(held))
            courses = weighed.courses(z)
            z[~fit.free] += np.linalg.solve(inner, columns.T @ weighed.white(courses) - held)
            z = np.clip(z, *fit.limits)
            courses = weighed.courses(z)
        except InputError:
            continue
        cost = weighed.cost(z, courses)
        if cost < least:
            best, least = replace(slopes, at=z, courses=courses), cost
    # what was added changes the courses elsewhere in another way
    known = {
        name: {parameter: columns[:, k] for k, parameter in enumerate(fit.names) if not fit.free[k]}
        for name, columns in best.taken.items()
    }
    return best.at, _slopes(fit, best.at, best.courses, known)


def _known(fit: RefitProblem, earlier: Refitted | None) -> dict[str, dict[str, Vector]]:
    """Response → parameter → how an earlier fit changed with it, in standard deviations of the nameplate."""
    if earlier is None or any(
        name not in earlier.slopes or len(fit.comparison.time_s) != len(earlier.comparison.time_s)
        for name in fit.comparison.responses
    ):
        return {}
    return {
        name: {n: earlier.slopes[name][n] * s for n, s in zip(fit.names, fit.spread, strict=True)
               if n in earlier.slopes[name]}
        for name in fit.comparison.responses
    }  # fmt: skip


def _fitted(fit: RefitProblem, z: Vector, slopes: _Slopes) -> _Start:
    """Parameters with the smallest weighted residual, in standard deviations of the nameplate, and slopes there.

    Gauss–Newton steps within the limits, shortened until they gain; slopes are taken anew where they do not hold.
    """
    if not fit.names:
        return z, slopes
    held, (low, high) = np.where(fit.free, 0.0, 1.0), fit.limits
    anew = 0
    for _ in range(_STEPS):
        fit = replace(fit, noise=noise_of(fit, slopes))
        white, columns = fit.white(slopes.courses), fit.white_tangents(slopes.tangents)
        cost = float(white @ white + np.sum((held * z) ** 2))
        step = _step(columns, white, held, z, low, high)
        foretold = cost - float(np.sum((white - columns @ step) ** 2) + np.sum((held * (z + step)) ** 2))
        gained = 0.0
        for _ in range(_HALVINGS):
            moved = np.clip(z + step, low, high)
            try:
                courses = fit.courses(moved)
            except InputError:  # it runs away there
                gained = -np.inf
            else:
                gained = cost - fit.cost(moved, courses)
                slopes = slopes.mended(moved, courses)
            if gained > 0.0:
                z, slopes = moved, replace(slopes, at=moved, courses=courses)
                break
            step = 0.5 * step if np.isfinite(gained) else 0.25 * step
        settled = gained <= _GAINS * cost or bool(np.all(np.abs(step) < _SETTLED))
        if settled and bool(np.all(np.abs(z - slopes.taken_at) < _NEAR)):
            break
        if settled or gained < _AS_FORETOLD * foretold:
            if anew == _ANEW:
                break
            slopes, anew = _slopes(fit, z, slopes.courses), anew + 1
    return z, slopes


def _from_elsewhere(fit: RefitProblem, z: Vector, slopes: _Slopes) -> _Start:
    """Of a fit and of some from starts that nameplates allow, the one that leaves least.

    What ran to its limits may have gone the wrong way: a resonance beyond the recorded one is drawn away from it.
    """
    weighed = replace(fit, noise=noise_of(fit, slopes))
    starts: list[tuple[Vector, Mapping[str, Vector]]] = []
    for draw in np.random.default_rng(0).standard_normal((_DRAWS, len(z))):
        at = np.clip(np.where(fit.free, z, draw), *fit.limits)
        with suppress(InputError):
            starts.append((at, fit.courses(at)))
    starts = sorted(starts, key=lambda start: weighed.cost(*start))[:_FOLLOWED]
    ends = [(z, slopes), *(_fitted(fit, at, _slopes(fit, at, courses)) for at, courses in starts)]
    return min(ends, key=lambda end: weighed.cost(end[0], end[1].courses))


def _step(columns: Matrix, white: Vector, held: Vector, z: Vector, low: Vector, high: Vector) -> Vector:
    """The step to the smallest sum of squares within the limits, as the slopes have it."""
    both = np.column_stack([np.vstack([columns, np.diag(held)]), np.r_[white, -held * z]])
    triangle = np.asarray(np.linalg.qr(both, mode="r"))
    room = low - z, np.maximum(high - z, low - z + 1e-12)
    return np.asarray(lsq_linear(triangle[:, :-1], triangle[:, -1], room).x)


def _directions(
    fit: RefitProblem, tangents: Mapping[str, Matrix], white: Matrix, told: NDArray[np.bool_]
) -> dict[str, dict[str, Vector]]:
    """Response → what the parameters that the record tells can still change; of many, what changes most.

    The others are held by their nameplates: free in every response by itself they would explain nearly everything.
    """
    kept = np.flatnonzero(told | fit.free)
    words = [fit.names[k] for k in kept]
    turned = None
    if len(words) > _MOST_DIRECTIONS:
        turned = np.linalg.svd(white[:, kept], full_matrices=False)[2][:_MOST_DIRECTIONS]
        words = [f"direction {k + 1}, most of all {words[int(np.argmax(np.abs(v)))]}" for k, v in enumerate(turned)]
    found = {response: columns[:, kept] for response, columns in tangents.items()}
    return {
        response: dict(zip(words, (columns if turned is None else columns @ turned.T).T, strict=True))
        for response, columns in found.items()
    }


def _pulled(fit: RefitProblem, z: Vector, sd: Vector, extra: Mapping[str, float]) -> list[Finding]:
    """Parameters that had to go far from what the file says: evidence that they stand in for something else."""
    found = []
    for k, name in enumerate(fit.names):
        was, now = float(fit.centre[k]), float(fit.centre[k] + fit.spread[k] * z[k])
        if name in extra or was == 0.0 or abs(now / was - 1.0) < _PULLED or abs(z[k]) < _PULLED_SD * sd[k]:
            continue
        unit = fit.runnable.parameters[name].unit
        statement = (
            f"{name} was pulled from {was:.4g} to {now:.4g} {unit} ({now / was - 1.0:+.0%}) to fit the recordings: "
            "it may stand in for something that the model does not have."
        )
        evidence = {"parameter": name, "from": was, "to": now, "unit": unit}
        found.append(FINDINGS.finding("parameter-pulled", statement, evidence=evidence))
    return found


def _told(left_alone: Sequence[str], runnable: Runnable) -> list[Finding]:
    if not left_alone:
        return []
    shown = ", ".join(left_alone[:8]) + (f" and {len(left_alone) - 8} more" if len(left_alone) > 8 else "")
    statement = f"The recordings say little of {shown}: they stay near what {runnable.name!r} says."
    return [FINDINGS.finding("parameters-left-alone", statement, evidence={"parameters": list(left_alone)})]
