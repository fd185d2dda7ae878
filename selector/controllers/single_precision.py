"""How far single precision can take a correction from the float64 model at most, from the model file alone.

A-priori error analysis (N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., SIAM 2002, 3.1):
n roundings of u = 2^-24 on the way to a sum of products take it off by at most n · u times the sum of the magnitudes;
so do readings, and literals their own rounding. A first-order lag
    level + g · (x − level), g = s / (tau + s)
passes on (1 − g) of its error, so that what each step rounds, at most rho, sums to rho / g: largest at the shortest s.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from selector.controllers.evaluator import Equations, polynomial
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import LARGEST_NUMBER, SAMPLE_S, DecidedLimits, decided_limits
from selector.controllers.model_file import Input, ModelFile, Output, State, Term
from selector.findings import Finding

WORTH_A_WARNING_UM = 0.01

SINGLE = 2.0**-24  #: Unit roundoff of IEEE 754 binary32.
CALLS_PER_S = 100  #: The clock of a memory is a sum of so many times of calls: every one is rounded.
WARMEST_START_DEGC = 60.0  #: A start reading is taken for no warmer where the model file has no limits of readings.
_OF_RESTART = 128.0  #: Roundings of the gain over a standstill: a quotient, squared four times.
_FURTHER = 1.01  #: Products of roundings, and those of binary64.


def rounding_errors_um(
    model: ModelFile,
    largest_readings: Mapping[str, float] | None = None,
    calls_per_s: int = CALLS_PER_S,
    shortest_s: float = SAMPLE_S,
) -> dict[str, float]:
    """Per output, what the correction in single precision can differ at most from that in binary64 in the same mode.

    It holds for readings that both take for good, model and fallbacks alike, and one restart. What a dead band or a
    slew limit makes of the difference is not in it, and nothing is larger than twice the clamp.

    `largest_readings`: largest magnitude of a reading that is used, start readings included; default:
    `largest_reading`. `calls_per_s`: 1 = time is counted without an error. `shortest_s`: between two readings
    that are looked at.
    """
    readings = {item.name: largest_reading(item) for item in model.inputs} | dict(largest_readings or {})
    limits, _ = decided_limits(model)
    # valid ranges are those of the model itself, also in a fallback
    ranges = {item.name: (item.valid_min, item.valid_max) for item in model.inputs}
    everything: tuple[Equations, ...] = (model, *(model.fallbacks if model.guard.on_fault == "fallback" else ()))
    found = dict.fromkeys(limits, 0.0)
    for of in everything:
        size, error = _variables(of, ranges, readings, calls_per_s, shortest_s)
        for output in of.outputs:
            # the clamp is rounded, too
            apart = 2.0001 * limits[output.name].clamp_um
            least = min(_of_output(output, limits[output.name], size, error), apart)
            found[output.name] = max(found[output.name], least)
    return found


def largest_reading(item: Input) -> float:
    """Largest magnitude of a reading that the model uses [unit of the input]: from its limits, or assumed."""
    largest = max(abs(item.valid_min), abs(item.valid_max))
    if item.reading_min is not None and item.reading_max is not None:
        return max(abs(item.reading_min), abs(item.reading_max))
    if item.reference == "absolute":
        return largest
    return largest + (WARMEST_START_DEGC if item.unit == "degC" else largest)


def single_precision_findings(model: ModelFile, file: str) -> Iterator[Finding]:
    """The bound per output of the program in `file`; a warning where it is beyond `WORTH_A_WARNING_UM`."""
    for name, bound_um in rounding_errors_um(model).items():
        is_large = bound_um > WORTH_A_WARNING_UM
        yield FINDINGS.finding(
            "single-precision-bound",
            f"{file}: {name} differs from the model in float64 by at most {_above(bound_um)} µm inside the "
            "valid ranges, all roundings at their worst.",
            evidence={"file": file, "output": name, "bound_um": bound_um},
            suggestion="use double precision where there is one; centres far from the valid range, terms that "
            "cancel each other and memory of many hours make it large"
            if is_large
            else "",
            level="warning" if is_large else "info",
        )


def single_precision_lines(model: ModelFile) -> Iterator[str]:
    """The bound and what it holds for, to stand at the head of a program."""
    errors = rounding_errors_um(model)
    told = ", ".join(f"{name} {_above(bound_um)} um" for name, bound_um in errors.items())
    yield f"Single precision: largest difference to the float64 model inside the valid ranges: {told},"
    readings = ", ".join(f"{item.name} {largest_reading(item):g} {item.unit}" for item in model.inputs)
    yield f"  for readings up to {readings}, called at most {CALLS_PER_S} times a second."
    if max(errors.values()) > WORTH_A_WARNING_UM:
        yield f"  More than {WORTH_A_WARNING_UM:g} um: use double precision where there is one."


def _above(bound_um: float) -> str:
    """Two digits, rounded up."""
    if bound_um == 0.0:
        return "0"
    step = 10.0 ** (math.floor(math.log10(bound_um)) - 1)
    return f"{math.ceil(bound_um / step) * step:.2g}"


def _variables(
    of: Equations,
    ranges: Mapping[str, tuple[float, float]],
    readings: Mapping[str, float],
    calls_per_s: int,
    shortest_s: float,
) -> tuple[dict[str, float], dict[str, float]]:
    """Largest magnitudes of the scaled inputs and states, and of their errors."""
    size, error, off = {}, {}, {}
    for item in of.inputs:
        ends = ranges[item.name]
        largest = max(map(abs, ends))
        # reading and start reading are rounded, then their difference, then the end of the range
        off[item.name] = SINGLE * (2.0 * largest + (2.0 * readings[item.name] if item.reference == "rise" else 0.0))
    variables: tuple[Input | State, ...] = (*of.inputs, *of.states)
    for one in variables:
        source = one.name if isinstance(one, Input) else one.source
        low, high = ranges[source]
        e = (
            off[source]
            if isinstance(one, Input)
            else _of_level(low, high, off[source], one.tau_s, calls_per_s, shortest_s)
        )
        far = max(abs(low - one.centre), abs(high - one.centre))
        size[one.name] = far / one.scale
        error[one.name] = (e + _of_literal(one.centre) + 3.0 * SINGLE * (far + e)) / one.scale
    return size, error


def _of_literal(value: float) -> float:
    """The rounding of a number that is known."""
    with np.errstate(over="ignore"):
        return abs(float(np.float32(value)) - value)


def _of_level(low: float, high: float, off: float, tau_s: float, calls_per_s: int, shortest_s: float) -> float:
    """Of e' ≤ (1 − g)·e + g·e_x + g·κ·(W + e_x + e) + u·(L + e) the e that stays; W = width, L = largest level."""
    width, largest, share = high - low, max(abs(low), abs(high)), shortest_s / (tau_s + shortest_s)
    per_step = (calls_per_s + 8.0) * SINGLE
    kept = 1.0 - per_step - SINGLE / share
    most = width + off + 8.0 * SINGLE * largest
    error = most if kept <= 0.0 else (off + per_step * (width + off) + SINGLE * largest / share) / kept
    return min(error, most) + SINGLE * (_OF_RESTART * width + 2.0 * largest)


def _of_sum(intercept: float, terms: tuple[Term, ...], size: Mapping[str, float], error: Mapping[str, float]) -> float:
    """Error of a polynomial of variables so large and so far off; infinite where a program takes it for no number."""
    exact: float = polynomial(intercept, terms, size, abs)
    largest: float = polynomial(intercept, terms, {name: size[name] + error[name] for name in size}, abs)
    if not largest < LARGEST_NUMBER:
        return math.inf
    roundings = 2 + len(terms) + max((sum(term.powers.values()) for term in terms), default=0)
    return _FURTHER * (largest - exact + roundings * SINGLE * largest)


def _of_output(output: Output, limits: DecidedLimits, size: Mapping[str, float], error: Mapping[str, float]) -> float:
    clamp, reach, steepest = limits.clamp_um, limits.reach_m, limits.slope_clamp_um_per_m
    own = max(_of_sum(output.intercept, output.terms, size, error), _of_literal(clamp))
    part = output.position
    if part is None or reach <= 0.0:
        return own
    # the slope has a clamp of its own, and what the clamp of the whole leaves to it
    left = (own + 4.0 * SINGLE * clamp) / reach
    slope = max(_of_sum(part.intercept, part.terms, size, error), left, SINGLE * steepest)
    farthest = max(abs(part.valid_min_m), abs(part.valid_max_m), abs(part.reference_m))
    away = max(abs(part.valid_min_m - part.reference_m), abs(part.valid_max_m - part.reference_m))
    of_line = away * slope + steepest * SINGLE * (4.0 * farthest + 2.0 * away) + SINGLE * (clamp + steepest * away)
    return _FURTHER * (own + of_line)
