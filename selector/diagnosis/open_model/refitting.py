"""How far do its own parameters bring a simulation that can be run again; which of them were pulled, and how surely."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.entrance.alignment import comparison_of
from selector.diagnosis.evidence.noise import stretches
from selector.diagnosis.open_model.refit_problem import RefitProblem, noise_of, simulated_rows
from selector.diagnosis.open_model.runnable import Runnable
from selector.errors import InputError
from selector.findings import Finding
from selector.physics.model_parameters import Parameter
from selector.recording import Recording

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Say = Callable[[int, int, str], None]

NAMEPLATE = 0.2
"""Standard deviation of a parameter about what the file says, as a share of it: what name plates are worth."""
_UNDETERMINED = 0.8
"""A parameter of which the record leaves more than this share of the nameplate's uncertainty is not determined."""
_PULLED = 0.1
_PULLED_SD = 3.0
_ROUNDS = 10
_SETTLED = 0.02
"""Change of a parameter in nameplate units that a new estimate of the noise may make without being followed."""
_STEPS = 12
_MOST_DIRECTIONS = 8


@dataclass(frozen=True, eq=False)
class Refitted:
    """A simulation whose parameters were fitted to the recordings.

    Attributes
    ----------
    nominal : Comparison
        With the simulation as it was given.
    comparison : Comparison
        With the refitted one; its `tangents` say what the parameters could still change.
    values : mapping of str to float
        Every parameter that was fitted.
    quantities : mapping of str to Quantity
        The same with units and 95 % intervals.
    left_alone : tuple of str
        Those that the record says little about, so that the nameplate holds them.
    runs : int
        How often the simulation was run.
    findings : tuple of Finding
    """

    nominal: Comparison
    comparison: Comparison
    values: Mapping[str, float]
    quantities: Mapping[str, Quantity]
    left_alone: tuple[str, ...]
    runs: int
    findings: tuple[Finding, ...]


def refitted(
    runnable: Runnable,
    recording: Recording,
    *,
    responses: Sequence[str] | None = None,
    holdout: str = "last",
    added: Sequence[Mapping[str, float]] = (),
    start: Mapping[str, float] | None = None,
    progress: Say | None = None,
) -> Refitted:
    """The simulation with its own parameters fitted to the recordings, by Levenberg–Marquardt on weighted residuals.

    Every parameter is held by its nameplate: what the file says ± 20 %, or anywhere within the bounds that somebody has
    thought about. Noise is estimated from what is left, and the fit repeated with it. Parameters that the record does
    not determine stay near what the file says, and are told.

    Parameters
    ----------
    runnable
        What is fitted.
    recording, responses, holdout
        As of `alignment.comparison_of`.
    added : sequence of mapping of str to float
        Parameters to be fitted beyond those that recalibration changes, of which nothing is known but their bounds:
        where the search may begin. The best one is taken, for the way from one to another may lead uphill.
    start : mapping of str to float, optional
        Where to begin with the others; default: where they are.
    progress : callable, optional
        Told how often the simulation was run, how often it may have to be, and what is done.

    Raises
    ------
    InputError
        Recordings and simulation cannot be compared.
    """
    done = 0
    starts = [dict(one) for one in added] or [{}]
    extra = starts[0]
    names = tuple(dict.fromkeys([*runnable.refitted, *extra]))
    most = 1 + 2 * (_STEPS // 2 + 1) * (len(names) + 1)

    def counted() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(min(done, most), most, f"run {done} of the simulation, {len(names)} parameters")

    counted()
    nominal = comparison_of(recording, runnable.simulated({}), responses=responses, holdout=holdout)
    fit = _fit(runnable, nominal, names, extra, counted)
    z = _best_start(fit, [{**(start or {}), **one} for one in starts])
    for turn in range(_ROUNDS):
        courses = fit.courses(z) if names else simulated_rows(nominal, runnable.simulated({}))
        fit = replace(fit, noise=noise_of(fit, courses))
        before, z = z, _fitted(fit, z, courses)
        if turn > 0 and np.all(np.abs(z - before) < _SETTLED):
            break
    courses = fit.courses(z)
    fit = replace(fit, noise=noise_of(fit, courses))
    tangents = fit.tangents(z, courses)
    white = fit.white_tangents(tangents)
    inner = white.T @ white + np.diag(np.where(fit.free, 1e-12, 1.0))
    covariance = np.linalg.pinv(inner, hermitian=True)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    left_alone = tuple(name for k, name in enumerate(names) if sd[k] > _UNDETERMINED and not fit.free[k])
    values = dict(zip(fit.names, (fit.centre + fit.spread * z).tolist(), strict=True))
    quantities = {
        name: _quantity(values[name], float(fit.spread[k] * sd[k]), runnable.parameters[name])
        for k, name in enumerate(fit.names)
    }
    comparison = replace(
        nominal,
        simulated={**nominal.simulated, **courses},
        tangents=_directions(fit, tangents, white, sd < _UNDETERMINED),
    )
    findings = [*_pulled(fit, z, sd, extra), *_told(left_alone, runnable)]
    return Refitted(nominal, comparison, values, quantities, left_alone, done, tuple(findings))


def _fit(
    runnable: Runnable,
    comparison: Comparison,
    names: tuple[str, ...],
    extra: Mapping[str, float],
    counted: Callable[[], None],
) -> RefitProblem:
    parameters = runnable.parameters
    centre = np.array([parameters[name].value for name in names])
    spread = np.array([_spread(parameters[name], name, runnable, extra) for name in names])
    seen = {name: np.isfinite(comparison.difference(name)) for name in comparison.responses}
    return RefitProblem(
        runnable=runnable,
        comparison=comparison,
        names=names,
        centre=centre,
        spread=spread,
        free=np.array([name in extra or name in runnable.bounded for name in names], dtype=bool),
        noise={},
        parts={name: stretches(comparison, rows & ~comparison.held_out) for name, rows in seen.items()},
        counted=counted,
    )


def _spread(one: Parameter, name: str, runnable: Runnable, extra: Mapping[str, float]) -> float:
    """Standard deviation before anything was recorded [unit of the parameter]."""
    if name in extra:
        return max(abs(extra[name]), 0.1 * (one.high - one.low))
    if name in runnable.bounded:
        return (one.high - one.low) / np.sqrt(12.0)
    return NAMEPLATE * abs(one.value)


def _best_start(fit: RefitProblem, starts: Sequence[Mapping[str, float]]) -> Vector:
    """The start from which one step of all parameters that are not `free` leads lowest."""
    found = [
        np.clip([(one.get(name, c) - c) / s for name, c, s in zip(fit.names, fit.centre, fit.spread, strict=True)],
                *fit.limits)
        for one in starts
    ]  # fmt: skip
    if len(found) == 1:
        return np.asarray(found[0])
    weighed = replace(fit, noise=noise_of(fit, fit.courses(found[0])))
    best, least = found[0], np.inf
    for z in found:
        try:
            courses = weighed.courses(z)
            columns = weighed.white_tangents(weighed.tangents(z, courses))[:, ~fit.free]
            held = z[~fit.free]
            inner = columns.T @ columns + np.eye(len(held))
            z[~fit.free] += np.linalg.solve(inner, columns.T @ weighed.white(courses) - held)
            z = np.clip(z, *fit.limits)
            cost = float((weighed.white(weighed.courses(z)) ** 2).sum() + (z[~fit.free] ** 2).sum())
        except InputError:
            continue
        if cost < least:
            best, least = z, cost
    return np.asarray(best)


def _fitted(fit: RefitProblem, z: Vector, courses: Mapping[str, Vector]) -> Vector:
    """Parameters with the smallest weighted residual, in standard deviations of the nameplate."""
    if not fit.names:
        return z
    held = np.where(fit.free, 0.0, 1.0)
    large = 1e3 * float(np.sqrt(np.mean(fit.white(courses) ** 2)) + 1.0)
    n = len(fit.white(courses))

    latest: dict[bytes, dict[str, Vector]] = {}

    def at(x: Vector) -> dict[str, Vector]:
        if x.tobytes() not in latest:
            courses = fit.courses(x)
            latest.clear()
            latest[x.tobytes()] = courses
        return latest[x.tobytes()]

    def left(x: Vector) -> Vector:
        try:
            return np.r_[fit.white(at(x)), held * x]
        except InputError:
            # it runs away there
            return np.full(n + len(x), large)

    def slopes(x: Vector) -> Matrix:
        white = fit.white_tangents(fit.tangents(x, at(x)))
        return np.vstack([-white, np.diag(held)])

    low, high = fit.limits
    inside = np.clip(z, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    return np.asarray(
        least_squares(
            left,
            inside,
            slopes,
            bounds=(low, high),
            x_scale="jac",
            max_nfev=_STEPS,
            xtol=1e-4,
            ftol=1e-6,
            gtol=1e-12,
        ).x
    )


def _directions(
    fit: RefitProblem, tangents: Mapping[str, Matrix], white: Matrix, told: NDArray[np.bool_]
) -> dict[str, dict[str, Vector]]:
    """Response → what the parameters that the record tells can still change; of many, what changes most.

    The others are held by their nameplates: free in every response by itself they would explain nearly everything.
    """
    kept = np.flatnonzero(told | fit.free)
    names = [fit.names[k] for k in kept]
    if len(names) <= _MOST_DIRECTIONS:
        return {
            response: {name: columns[:, k] for name, k in zip(names, kept, strict=True)}
            for response, columns in tangents.items()
        }
    turned = np.linalg.svd(white[:, kept], full_matrices=False)[2][:_MOST_DIRECTIONS]
    words = [f"direction {k + 1}, most of all {names[int(np.argmax(np.abs(v)))]}" for k, v in enumerate(turned)]
    return {
        response: dict(zip(words, (columns[:, kept] @ turned.T).T, strict=True))
        for response, columns in tangents.items()
    }


def _quantity(value: float, sd: float, one: Parameter) -> Quantity:
    return Quantity(value, one.unit, max(value - 1.96 * sd, one.low), min(value + 1.96 * sd, one.high))


def _pulled(fit: RefitProblem, z: Vector, sd: Vector, extra: Mapping[str, float]) -> list[Finding]:
    """Parameters that had to go far from what the file says: evidence that they stand in for something else."""
    found = []
    for k, name in enumerate(fit.names):
        was, now = float(fit.centre[k]), float(fit.centre[k] + fit.spread[k] * z[k])
        if name in extra or was == 0.0 or abs(now / was - 1.0) < _PULLED or abs(z[k]) < _PULLED_SD * sd[k]:
            continue
        unit = fit.runnable.parameters[name].unit
        found.append(
            Finding(
                "parameter-pulled",
                "warning",
                f"{name} was pulled from {was:.4g} to {now:.4g} {unit} ({now / was - 1.0:+.0%}) to fit the recordings: "
                "it may stand in for something that the model does not have.",
                evidence={"parameter": name, "from": was, "to": now, "unit": unit},
                suggestion="check it against the name plate; the effects below are tested beside it",
            )
        )
    return found


def _told(left_alone: Sequence[str], runnable: Runnable) -> list[Finding]:
    if not left_alone:
        return []
    shown = ", ".join(left_alone[:8]) + (f" and {len(left_alone) - 8} more" if len(left_alone) > 8 else "")
    return [
        Finding(
            "parameters-left-alone",
            "info",
            f"The recordings say little of {shown}: they stay near what {runnable.name!r} says.",
            evidence={"parameters": list(left_alone)},
        )
    ]
