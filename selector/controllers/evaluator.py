"""What a model file means: its outputs on a run, to the last bit, and as a person would write it."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from selector.controllers.model_file import Fallback, Input, ModelFile, Output, State, Term
from selector.errors import RecordingError
from selector.models.design import lagged
from selector.number_text import SUPERSCRIPTS
from selector.types import Array

BLOCK_SAMPLES = 8192  #: Samples worked on at a time: the values of 37 inputs stay in the processor's cache.

Equations = ModelFile | Fallback


def axes_of(model: Equations) -> tuple[str, ...]:
    """The axes whose position a model needs, in the order of their numbers in programs."""
    return tuple(dict.fromkeys(output.position.axis for output in model.outputs if output.position is not None))


def _displacement(output: Output, z: Mapping[str, Any], positions_m: Mapping[str, Any] | None) -> Any:
    at_reference, part = polynomial(output.intercept, output.terms, z), output.position
    if part is None or positions_m is None:
        return at_reference
    return at_reference + polynomial(part.intercept, part.terms, z) * (positions_m[part.axis] - part.reference_m)


def polynomial(
    intercept: float, terms: Iterable[Term], z: Mapping[str, Any], number: Callable[[float], Any] = float
) -> Any:
    """The sum intercept + Σ coefficient · Π z^power, powers by repeated multiplication, from left to right.

    `number` makes what is calculated with of intercept and coefficients.
    """
    total = number(intercept)
    for term in terms:
        product = number(term.coefficient)
        for name, power in term.powers.items():
            for _ in range(power):
                product = product * z[name]
        total = total + product
    return total


def evaluate(
    model: Equations,
    time_s: ArrayLike,
    readings: Mapping[str, ArrayLike],
    start_readings: Mapping[str, float] | None = None,
    positions_m: Mapping[str, ArrayLike] | None = None,
    earlier: Sequence[tuple[Array, Mapping[str, Array]]] = (),
) -> dict[str, Array]:
    """The outputs [µm] of a run: the executable meaning of `selector.model/1`.

    `time_s`, and every series of readings [unit of the input] and of positions [m], have the shape (n_samples,); a
    reading that is not finite is missing: outputs that need it are NaN, the memory of its sensor waits, and time goes
    on for it when readings come back. Default of the start readings: the first finite ones; of the positions: the
    reference. Memory goes on from `earlier` (time, readings).

    Raises RecordingError: an input has no readings, lengths differ or time does not increase.
    """
    time = np.asarray(time_s, dtype=np.float64)
    table = {item.name: _series(item.name, readings, time) for item in model.inputs}
    positions = None if positions_m is None else {axis: _series(axis, positions_m, time) for axis in axes_of(model)}
    if time.ndim != 1 or not bool(np.all(np.diff(time) > 0)):
        raise _unusable("time that repeats, runs backwards or is missing", "strictly increasing time")
    start = {name: first_finite(values) for name, values in table.items()}
    start |= {name: float(value) for name, value in (start_readings or {}).items()}
    memory: dict[str, tuple[float, float]] = {}
    result = {output.name: np.empty(len(time)) for output in model.outputs}
    # overflow gives inf and NaN
    with np.errstate(over="ignore", invalid="ignore"):
        for times, before in earlier:
            _scaled(model, times, before, start, memory)
        for first in range(0, len(time), BLOCK_SAMPLES):
            block = slice(first, first + BLOCK_SAMPLES)
            z = _scaled(model, time[block], {name: values[block] for name, values in table.items()}, start, memory)
            at = None if positions is None else {axis: values[block] for axis, values in positions.items()}
            for output in model.outputs:
                result[output.name][block] = _displacement(output, z, at)
    return result


def evaluate_after(
    model: Equations,
    earlier: Sequence[tuple[Array, Mapping[str, Array]]],
    time_s: Array,
    readings: Mapping[str, Array],
    start_readings: Mapping[str, float],
    positions_m: Mapping[str, Array] | None,
) -> dict[str, Array]:
    """The outputs of a run with the memory of the runs before, whose (time, readings) end before it begins.

    Rises have at the start what they have in the run by itself.
    """
    found = evaluate(model, time_s, readings, start_readings, positions_m, earlier)
    for output in model.outputs if earlier else ():
        known = np.flatnonzero(np.isfinite(found[output.name]))[:1]
        for first in known if output.reference == "rise" else ():
            begin = slice(first + 1)
            inputs, at = ({k: v[begin] for k, v in (of or {}).items()} for of in (readings, positions_m))
            alone = evaluate(model, time_s[begin], inputs, start_readings, at or None)[output.name][first]
            found[output.name] = found[output.name] + (alone - found[output.name][first])
    return found


def _scaled(
    model: Equations,
    time_s: Array,
    readings: Mapping[str, Array],
    start: Mapping[str, float],
    memory: dict[str, tuple[float, float]],
) -> dict[str, Array]:
    x: dict[str, Array] = {}
    z: dict[str, Array] = {}
    for item in model.inputs:
        values = readings[item.name]
        finite = np.isfinite(values)
        if not finite.all():
            values = np.where(finite, values, np.nan)
        x[item.name] = values - start[item.name] if item.reference == "rise" else values
        z[item.name] = (x[item.name] - item.centre) / item.scale
    for state in model.states:
        last_s, level = memory.get(state.name, (math.nan, math.nan))
        of_one = (np.array([one]) for one in (state.tau_s, level, last_s))
        series, (level,), (last_s,) = lagged(x[state.source][:, None], time_s, *of_one)
        memory[state.name] = float(last_s), float(level)
        z[state.name] = (series[:, 0] - state.centre) / state.scale
    return z


def output_bound_um(model: Equations, output: Output) -> float:
    """A bound [µm] on the magnitude of an output while every input is in its valid range (inf = overflow possible).

    The sum of the largest magnitudes of the terms: never too small, usually too large. Lagged inputs stay inside the
    range of their source. A position-dependent part counts at the far end of its valid positions.
    """
    ranges = {item.name: (item.valid_min, item.valid_max) for item in model.inputs}
    largest = {}
    for item in model.inputs:
        largest[item.name] = max(abs((x - item.centre) / item.scale) for x in ranges[item.name])
    for state in model.states:
        largest[state.name] = max(abs((x - state.centre) / state.scale) for x in ranges[state.source])
    bound: float = polynomial(output.intercept, output.terms, largest, abs)
    part = output.position
    if part is not None:
        bound += polynomial(part.intercept, part.terms, largest, abs) * part.reach_m
    return bound if math.isfinite(bound) else math.inf


def first_finite(values: Array) -> float:
    """The first value that is a finite number, NaN if there is none."""
    for first in range(0, len(values), BLOCK_SAMPLES):
        finite = np.flatnonzero(np.isfinite(values[first : first + BLOCK_SAMPLES]))
        if len(finite):
            return float(values[first + finite[0]])
    return math.nan


def _series(name: str, table: Mapping[str, ArrayLike], time_s: Array) -> Array:
    if name not in table:
        raise _unusable(f"no values of {name!r}", "values of every input and axis of the model")
    values = np.asarray(table[name], dtype=np.float64)
    if values.shape != time_s.shape:
        raise _unusable(f"{values.shape} values of {name!r}", f"shape {time_s.shape}, one value per time stamp")
    return values


def _unusable(found: str, expected: str) -> RecordingError:
    return RecordingError(
        found, expected=expected, where="evaluation of a model", advice="give one value per input and time stamp"
    )


Powers = tuple[tuple[str, int], ...]
Polynomial = tuple[float, dict[Powers, float]]  #: Intercept, and coefficient per product of powers; () is never a key.
SIGNIFICANT_DIGITS = 5

# A coefficient that contributes less than this share of the largest contribution is left from cancelling rounding
# errors of the fit; float64 itself resolves 1e-16 of it.
_NEGLIGIBLE = 1e-12


def physical_coefficients(model: Equations) -> dict[str, Polynomial]:
    """Per output, the polynomial [µm] in rises, readings and their lags instead of scaled values.

    The key ``(("T1", 1), ("T3", 1))`` is ΔT1·ΔT3 (a rise) or T1·T3 (absolute); names are in the model's order.
    """
    return {output.name: _expanded(model, output.intercept, output.terms) for output in model.outputs}


def physical_slopes(model: Equations) -> dict[str, Polynomial]:
    """As `physical_coefficients`, for the position-dependent parts [µm/m]; outputs without one are left out."""
    return {
        output.name: _expanded(model, output.position.intercept, output.position.terms)
        for output in model.outputs
        if output.position is not None
    }


def formula_text(model: Equations) -> str:
    """One line per output, e.g. ``Z = −1.871 + 6.0476·ΔT1 + 2.6667·ΔT3``; ends without a line end."""
    slopes = physical_slopes(model)
    lines = []
    for output, (intercept, terms) in zip(model.outputs, physical_coefficients(model).values(), strict=True):
        line = f"{output.name} = {_sum(model, intercept, terms)}"
        if output.position is not None:
            at = f"P{output.position.axis} − {_number(output.position.reference_m)} m"
            at = at.replace("− −", "+ ")
            line += f" + ({_sum(model, *slopes[output.name])})·({at})"
        lines.append(line)
    return "\n".join(lines)


def legend_text(model: Equations) -> str:
    """One line per input: its symbol, what it is, its unit and the range that the model has seen."""
    lines = []
    for item in model.inputs:
        unit = "K" if item.unit == "degC" and item.reference == "rise" else item.unit.replace("degC", "°C")
        meaning = "rise against the start" if item.reference == "rise" else "reading"
        place = f" ({item.place})" if item.place else ""
        low, high = _number(item.valid_min), _number(item.valid_max)
        lines.append(f"{_symbol(item)}: {item.role} {item.name}{place}, {meaning}, {low} … {high} {unit}")
    return "\n".join(lines)


def _expanded(model: Equations, intercept: float, terms: Iterable[Term]) -> Polynomial:
    variables: list[Input | State] = [*model.inputs, *model.states]
    order = {item.name: i for i, item in enumerate(variables)}
    scaling = {item.name: (Fraction(item.centre), Fraction(item.scale)) for item in variables}
    total: dict[Powers, Fraction] = {(): Fraction(intercept)}
    for term in terms:
        product: dict[Powers, Fraction] = {(): Fraction(term.coefficient)}
        for name in sorted(term.powers, key=order.__getitem__):
            power, (centre, scale) = term.powers[name], scaling[name]
            factor = {
                k: math.comb(power, k) * (-centre) ** (power - k) / scale**power for k in range(power + 1)
            }  # ((v − c) / s)^p by the binomial theorem
            product = {
                key + (((name, k),) if k else ()): value * weight
                for key, value in product.items()
                for k, weight in factor.items()
                if weight
            }
        for key, value in product.items():
            total[key] = total.get(key, Fraction(0)) + value
    constant = _rounded(total.pop(()))
    ranked = sorted(total.items(), key=lambda item: (sum(p for _, p in item[0]), [(order[n], p) for n, p in item[0]]))
    return constant, {key: _rounded(value) for key, value in ranked if value}


def _rounded(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def _sum(model: Equations, intercept: float, terms: Mapping[Powers, float]) -> str:
    symbols = {item.name: _symbol(item) for item in model.inputs}
    reach = {item.name: max(abs(item.valid_min), abs(item.valid_max)) for item in model.inputs}
    for state in model.states:
        symbols[state.name] = f"lag({symbols[state.source]}, {_number(state.tau_s)} s)"
        reach[state.name] = reach[state.source]
    sizes = {key: abs(value) * math.prod(reach[name] ** power for name, power in key) for key, value in terms.items()}
    largest = max(sizes.values(), default=0.0)
    parts = []
    if intercept != 0.0 or not terms:
        parts.append((intercept, _number(abs(intercept))))
    for key, value in terms.items():
        if largest > 0.0 and sizes[key] < _NEGLIGIBLE * largest:
            continue
        product = "·".join(
            symbols[name] + (str(power).translate(SUPERSCRIPTS) if power > 1 else "") for name, power in key
        )
        parts.append((value, f"{_number(abs(value))}·{product}"))
    text = ("−" if parts[0][0] < 0 else "") + parts[0][1]
    return text + "".join(f" {'−' if value < 0 else '+'} {part}" for value, part in parts[1:])


def _symbol(item: Input) -> str:
    # an operator or a blank inside a name would read as part of the formula
    name = item.name if item.name.replace("_", "a").isalnum() else f"[{item.name}]"
    return f"Δ{name}" if item.reference == "rise" else name


def _number(value: float) -> str:
    """Five significant digits, as in print: a true minus sign, powers of ten written out."""
    text = f"{value:.{SIGNIFICANT_DIGITS}g}"
    if "e" in text:
        digits, exponent = text.split("e")
        text = f"{digits}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"
    return text.replace("-", "−")
