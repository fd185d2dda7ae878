"""From a diagnosis to a model file: a correction of the simulation by readings and their lags, for the control."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from scipy.optimize import minimize_scalar

from selector import __version__
from selector.controllers.finding_table import FINDINGS
from selector.controllers.model_file import Guard, Input, ModelFile, Output, OutputLimits, Provenance, State, Term
from selector.controllers.self_check import sealed
from selector.diagnosis.answer import Correction, Diagnosis, corrections, recalibration_of
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity
from selector.findings import Finding
from selector.models.design import Lag, lagged
from selector.types import Matrix, Vector

_ROLES = ("temperature", "ambient", "spindle_speed")
_ABSOLUTE = ("spindle_speed",)
_MOST_TERMS = 6
_GRID = 14
_EXACT = 0.002
WORST = 0.05  #: Share of the size of a correction by which its terms may miss it.


@dataclass(frozen=True, eq=False)
class _Fit:
    """Terms of one response: sources with their lags [s], 0 = at once; coefficients with the intercept first."""

    terms: tuple[tuple[str, float], ...]
    coefficients: Vector
    missed: float
    is_whole: bool = True  #: Whether the recalibration of the simulation is in it.

    @property
    def names(self) -> tuple[str, ...]:
        """Inputs and states that the terms are made of."""
        return tuple(Lag(name, tau_s).name if tau_s > 0.0 else name for name, tau_s in self.terms)


def correction_of(found: Diagnosis) -> tuple[ModelFile | None, tuple[Finding, ...]]:
    """The model file whose outputs, added to the simulation, hold the thermal effects that were named.

    Its terms are temperatures, hall and spindle speed, at once and behind first-order lags, as a control computes them.
    They are fitted to the courses of the correction, not to the recordings again. Where they can follow it the
    recalibration of the simulation is in them; where they cannot, only its offset is, and that is said. No file if
    nothing thermal was named or no such terms follow it.
    """
    comparison = found.comparison
    effects = [effect for effect in found.effects if effect.id.startswith("thermal.")]
    names = [
        name for name in comparison.responses
        if comparison.channel(name).role == "displacement" and any(name in effect.courses for effect in effects)
    ]  # fmt: skip
    if not names:
        return None, ()
    sources = [
        channel.name for channel in comparison.channels
        if channel.role in _ROLES and channel.name not in names and np.ptp(_x(comparison, channel.name)) > 0.0
    ]  # fmt: skip
    whole, refused, fits = corrections(found), [], {}
    for name in names:
        course = np.sum([effect.courses[name] for effect in effects if name in effect.courses], axis=0)
        offset = found.recalibration.get(name, {}).get("offset")
        fit = _of_response(comparison, sources, course, whole.get(name), 0.0 if offset is None else offset.value)
        if fit is None or fit.missed > WORST:
            refused.append(_not_expressible(name, [effect.id for effect in effects], fit))
        else:
            fits[name] = fit
    if not fits:
        return None, tuple(refused)
    partly = [_partly(comparison, name, found.recalibration[name]) for name, fit in fits.items() if not fit.is_whole]
    return _file(comparison, fits, found, " ".join(one.statement for one in partly)), (*refused, *partly)


def _of_response(
    comparison: Comparison, sources: Sequence[str], course: Vector, whole: Correction | None, offset: float
) -> _Fit | None:
    """Terms that follow the whole correction; where none do, those of the effects alone with the offset beside them."""
    if not sources:
        return None
    size = float(np.sqrt(np.mean(course**2)))
    if whole is None:
        return _fitted(comparison, sources, course)
    fit = _fitted(comparison, sources, course)
    rest = _fitted(comparison, sources, whole.add - course)
    tried = (_fitted(comparison, sources, whole.add).terms, (*fit.terms, *rest.terms))
    both = min((_of_terms(comparison, terms, whole.add) for terms in tried), key=lambda one: one.missed)
    missed = both.missed * float(np.sqrt(np.mean(whole.add**2))) / max(size, 1e-300)
    if missed <= WORST:
        return replace(both, missed=missed)
    coefficients = np.array(fit.coefficients)
    coefficients[0] += offset
    without = float(np.sqrt(np.mean((whole.add - course - offset) ** 2))) / max(size, 1e-300)
    return replace(fit, coefficients=coefficients, is_whole=without <= WORST)


def _x(comparison: Comparison, name: str) -> Vector:
    """A source as the model file has it: rise since the first sample of the run, or as it was read."""
    values = np.array(comparison.filled(comparison.recorded[name]))
    if comparison.channel(name).role not in _ABSOLUTE:
        for _, rows in comparison.rows_of_runs():
            values[rows] -= values[rows.start]
    return values


def _behind(comparison: Comparison, name: str, tau_s: float) -> Vector:
    """A source behind a lag, by the arithmetic of the control; without one where it is 0."""
    x, result = _x(comparison, name), np.empty(len(comparison.time_s))
    if tau_s <= 0.0:
        return x
    for _, rows in comparison.rows_of_runs():
        time_s = comparison.time_s[rows]
        start, stamps = np.array([np.nan]), np.array([np.nan])
        result[rows] = lagged(x[rows][:, None], time_s, np.array([tau_s]), start, stamps)[0][:, 0]
    return result


def _fitted(comparison: Comparison, sources: Sequence[str], course: Vector) -> _Fit:
    """Sources, at once or lagged, that follow a course best, added one by one while each is worth it."""
    low = 2.0 * comparison.period_s
    grid = [0.0, *np.geomspace(low, max(2.0 * comparison.longest_s, 4.0 * low), _GRID).tolist()]
    terms = [(name, tau) for name in sources for tau in grid]
    # a source at a time: all of them at once would be copied as a whole
    candidates = [np.column_stack([_behind(comparison, name, tau) for tau in grid]) for name in sources]
    chosen: list[tuple[str, float]] = []
    base = [np.ones(len(course))]
    missed = 1.0
    while len(chosen) < _MOST_TERMS and missed > _EXACT:
        name, tau_s = terms[int(np.argmin(np.concatenate([_missed(base, of, course) for of in candidates])))]
        if tau_s > 0.0:
            tau_s = _refined(comparison, name, tau_s, grid, base, course)
        column = _behind(comparison, name, tau_s)
        after = float(_missed(base, column[:, None], course)[0])
        if after > 0.9 * missed or (name, tau_s) in chosen:
            break
        base.append(column)
        chosen.append((name, tau_s))
        missed = after
    return _of_terms(comparison, chosen, course)


def _of_terms(comparison: Comparison, terms: Sequence[tuple[str, float]], course: Vector) -> _Fit:
    """These terms, each once, with the coefficients that follow a course best."""
    terms = tuple(dict.fromkeys(terms))
    return _Fit(terms, *_followed(_columns(comparison, terms), course))


def _columns(comparison: Comparison, terms: Sequence[tuple[str, float]]) -> list[Vector]:
    return [np.ones(len(comparison.time_s)), *(_behind(comparison, name, tau_s) for name, tau_s in terms)]


def _refined(
    comparison: Comparison, name: str, tau_s: float, grid: Sequence[float], base: Sequence[Vector], course: Vector
) -> float:
    """The time constant between the neighbours on the grid that follows the course best."""
    number = grid.index(tau_s)
    low, high = grid[number - 1] or 0.5 * tau_s, grid[min(number + 1, len(grid) - 1)]
    found = minimize_scalar(
        lambda log_tau: _missed(base, _behind(comparison, name, float(np.exp(log_tau)))[:, None], course)[0],
        bounds=(float(np.log(low)), float(np.log(max(high, 1.01 * tau_s)))),
        method="bounded",
    )
    return float(f"{np.exp(found.x):.6g}")


def _followed(columns: Sequence[Vector], course: Vector) -> tuple[Vector, float]:
    """Coefficients by least squares, and what these columns miss of a course, as a share of its size."""
    matrix = np.column_stack(columns)
    size = np.maximum(np.sqrt(np.mean(matrix**2, axis=0)), 1e-300)
    amounts = np.linalg.lstsq(matrix / size, course, rcond=1e-10)[0]
    left = course - (matrix / size) @ amounts
    missed = float(np.sqrt(np.mean(left**2)) / max(float(np.sqrt(np.mean(course**2))), 1e-300))
    return np.asarray(amounts / size, dtype=np.float64), missed


def _missed(base: Sequence[Vector], columns: Matrix, course: Vector) -> Vector:
    """What the base and each of these columns miss of a course together, as shares of its size."""
    span = np.linalg.qr(np.column_stack(base))[0]
    left, beside = course - span @ (span.T @ course), columns - span @ (span.T @ columns)
    squares = np.sum(beside**2, axis=0)
    is_new = squares > 1e-20 * np.sum(columns**2, axis=0)
    left = left[:, None] - beside * np.where(is_new, left @ beside / np.maximum(squares, 1e-300), 0.0)
    return np.asarray(np.sqrt(np.mean(left**2, axis=0) / max(float(np.mean(course**2)), 1e-300)), dtype=np.float64)


def _file(comparison: Comparison, fits: dict[str, _Fit], found: Diagnosis, partly: str) -> ModelFile:
    terms = list(dict.fromkeys(term for fit in fits.values() for term in fit.terms))
    sources = list(dict.fromkeys(name for name, _ in terms))
    lags = [Lag(name, tau_s) for name, tau_s in terms if tau_s > 0.0]
    inputs = []
    for name in sources:
        channel, x = comparison.channel(name), _x(comparison, name)
        inputs.append(
            Input(
                name=name,
                role=cast(Any, channel.role),
                unit=channel.unit,
                reference="absolute" if channel.role in _ABSOLUTE else "rise",
                valid_min=float(x.min()),
                valid_max=float(x.max()),
                place=channel.place,
            )
        )
    outputs, limits = [], []
    for name, fit in fits.items():
        outputs.append(
            Output(
                name=name,
                axis=comparison.channel(name).axis,
                intercept=float(fit.coefficients[0]),
                terms=tuple(
                    Term(powers={key: 1}, coefficient=float(value))
                    for key, value in zip(fit.names, fit.coefficients[1:], strict=True)
                ),
            )
        )
        largest = np.abs(np.column_stack(_columns(comparison, fit.terms)) @ fit.coefficients).max()
        limits.append(OutputLimits(output=name, clamp_um=float(np.ceil(largest)) or None))
    model = ModelFile(
        name=f"correction of {' and '.join(fits)}",
        inputs=tuple(inputs),
        states=tuple(State(name=lag.name, source=lag.source, tau_s=lag.tau_s) for lag in lags),
        outputs=tuple(outputs),
        guard=Guard(limits=tuple(limits)),
        provenance=Provenance(
            period_s=comparison.period_s if comparison.period_s > 0.0 else None,
            version=__version__,
            seed=found.seed,
            method=", ".join(effect.id for effect in found.effects if effect.id.startswith("thermal.")),
            note=partly or "To be added to what the simulation says: it holds what the simulation left out.",
        ),
    )
    return sealed(model)


def _not_expressible(name: str, effects: Sequence[str], fit: _Fit | None) -> Finding:
    why = (
        "no temperature or speed was recorded" if fit is None else f"the best terms miss {100 * fit.missed:.0f} % of it"
    )
    return FINDINGS.finding(
        "correction-not-in-model-file",
        f"No model.json holds the correction of {name} ({', '.join(effects)}); as readings and lags it cannot be "
        f"written: {why}.",
        evidence={"channel": name, "missed": None if fit is None else fit.missed},
    )


def _partly(comparison: Comparison, name: str, recalibration: Mapping[str, Quantity]) -> Finding:
    """That gain and delay of the simulation are not in the file, with their numbers."""
    numbers = recalibration_of(recalibration)
    gain = numbers["gain"].value if "gain" in numbers else 1.0
    delay = numbers["delay"].value if "delay" in numbers else 0.0
    offset = numbers["offset"].value if "offset" in numbers else 0.0
    late = f"{'−' if delay >= 0.0 else '+'} {abs(delay):.4g}"
    return FINDINGS.finding(
        "correction-of-recalibrated",
        f"model.json is to be added to the recalibrated simulation: {name} = {gain:.4g} · s(t {late} s) + its output, "
        f"where s is what the simulation says of {name} now. The offset of {offset:.4g} "
        f"{comparison.channel(name).unit} is in its intercept; gain and delay cannot be written as readings and lags.",
        evidence={"channel": name, "gain": gain, "delay_s": delay, "offset": offset},
    )
