"""How far single precision can take a correction from the float64 model at most, from the model file alone.

Running error analysis (N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., SIAM 2002, section 3.3):
every value is an interval of exact values and a bound of the error of the computed one. An operation adds
u · (|result| + error) to what its operands bring, u = 2^-24 (eq. 2.4); so do readings, and literals their own rounding.
A first-order lag
    level + g · (x − level), g = s / (tau + s)
passes on (1 − g) of its error, so that what each step rounds, at most rho, sums to rho / g: largest at the shortest s.
Minimum and maximum are no larger in error than their larger operand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from selector.controllers.evaluator import Equations, polynomial
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import LARGEST_NUMBER, SAMPLE_S, DecidedLimits, decided_limits
from selector.controllers.model_file import Input, ModelFile, Output
from selector.findings import Finding

WORTH_A_WARNING_UM = 0.01

SINGLE, DOUBLE = 2.0**-24, 2.0**-53  #: Unit roundoff of IEEE 754 binary32 and binary64.
CALLS_PER_S = 100  #: The clock of a memory is a sum of so many times of calls: every one is rounded.
WARMEST_START_DEGC = 60.0  #: A start reading is taken for no warmer where the model file has no limits of readings.
_LARGEST_SINGLE, _SMALLEST_SINGLE = 3.4e38, 2.0**-149
_OF_RESTART = 128.0  #: Roundings of the gain over a standstill: a quotient, squared four times.
_OF_BOUND = 1.0 + 1e-6  #: The bound itself is computed in binary64.


@dataclass(frozen=True)
class LargestError:
    """Bounds of one output."""

    correction_um: float
    k0_um: float
    slope_um_per_m: float = 0.0

    def plus(self, other: LargestError) -> LargestError:
        """Bound of a sum."""
        k0, slope = self.k0_um + other.k0_um, self.slope_um_per_m + other.slope_um_per_m
        return LargestError(self.correction_um + other.correction_um, k0, slope)

    def within(self, limits: DecidedLimits) -> LargestError:
        """Two corrections are no farther apart than from one end of their clamp to the other."""
        # the clamp is rounded, too
        apart, apart_in_slope = 2.0001 * limits.clamp_um, 2.0001 * limits.slope_clamp_um_per_m
        slope = min(self.slope_um_per_m, apart_in_slope)
        return LargestError(min(self.correction_um, apart), min(self.k0_um, apart), slope)


def rounding_errors(
    model: ModelFile,
    largest_readings: Mapping[str, float] | None = None,
    calls_per_s: int = CALLS_PER_S,
    shortest_s: float = SAMPLE_S,
) -> dict[str, LargestError]:
    """Per output, what the correction in this arithmetic can differ at most from that in binary64 in the same mode.

    It holds for readings that both take for good, model and fallbacks alike, and one restart. What a dead band or a
    slew limit makes of the difference is not in it, and nothing is larger than twice the clamp.

    `largest_readings`: largest magnitude of a reading that is used, start readings included; default:
    `largest_reading`. `calls_per_s`: 1 = time is counted without an error. `shortest_s`: between two readings
    that are looked at.
    """
    readings = {item.name: largest_reading(item) for item in model.inputs} | dict(largest_readings or {})
    single = _errors(model, readings, calls_per_s, SINGLE, shortest_s)
    double = _errors(model, readings, calls_per_s, DOUBLE, shortest_s)
    limits, _ = decided_limits(model)
    return {name: of.plus(double[name]).within(limits[name]) for name, of in single.items()}


def largest_reading(item: Input) -> float:
    """Largest magnitude of a reading that the model uses [unit of the input]: from its limits, or assumed."""
    largest = max(abs(item.valid_min), abs(item.valid_max))
    if item.reading_min is not None and item.reading_max is not None:
        return max(abs(item.reading_min), abs(item.reading_max))
    if item.reference == "absolute":
        return largest
    return largest + (WARMEST_START_DEGC if item.unit == "degC" else largest)


def single_precision_findings(model: ModelFile, file: str) -> tuple[Finding, ...]:
    """The bound per output of the program in `file`; a warning where it is beyond `WORTH_A_WARNING_UM`."""
    found = []
    for name, of in rounding_errors(model).items():
        is_large = not of.correction_um <= WORTH_A_WARNING_UM
        found.append(
            FINDINGS.finding(
                "single-precision-bound",
                f"{file}: {name} differs from the model in float64 by at most {_above(of.correction_um)} µm inside the "
                "valid ranges, all roundings at their worst.",
                evidence={"file": file, "output": name, "bound_um": of.correction_um},
                suggestion="use double precision where there is one; centres far from the valid range, terms that "
                "cancel each other and memory of many hours make it large"
                if is_large
                else "",
                level="warning" if is_large else "info",
            )
        )
    return tuple(found)


def single_precision_lines(model: ModelFile) -> Iterator[str]:
    """The bound and what it holds for, to stand at the head of a program."""
    errors = rounding_errors(model)
    told = ", ".join(f"{name} {_above(of.correction_um)} um" for name, of in errors.items())
    yield f"Single precision: largest difference to the float64 model inside the valid ranges: {told},"
    readings = ", ".join(f"{item.name} {largest_reading(item):g} {item.unit}" for item in model.inputs)
    yield f"  for readings up to {readings}, called at most {CALLS_PER_S} times a second."
    if any(of.correction_um > WORTH_A_WARNING_UM for of in errors.values()):
        yield f"  More than {WORTH_A_WARNING_UM:g} um: use double precision where there is one."


def _above(bound_um: float) -> str:
    """Two digits, rounded up."""
    if bound_um == 0.0:
        return "0"
    step = 10.0 ** (math.floor(math.log10(bound_um)) - 1)
    return f"{math.ceil(bound_um / step) * step:.2g}"


def _errors(
    model: ModelFile, readings: Mapping[str, float], calls_per_s: int, unit: float, shortest_s: float
) -> dict[str, LargestError]:
    limits, _ = decided_limits(model)
    found: dict[str, LargestError] = {}
    everything: tuple[Equations, ...] = (model, *(model.fallbacks if model.guard.on_fault == "fallback" else ()))
    sensors = {item.name: item for item in model.inputs}
    for of in everything:
        z = _variables(of, sensors, readings, calls_per_s, unit, shortest_s)
        for output in of.outputs:
            error = _of_output(output, limits[output.name], z, unit)
            so_far = found.get(output.name, LargestError(0.0, 0.0))
            found[output.name] = LargestError(
                max(so_far.correction_um, error.correction_um),
                max(so_far.k0_um, error.k0_um),
                max(so_far.slope_um_per_m, error.slope_um_per_m),
            )
    return found


@dataclass(frozen=True)
class _Value:
    """Exact values from `low` to `high`; the computed one is off by at most `error`, roundings of `unit` included."""

    low: float
    high: float
    error: float
    unit: float

    @classmethod
    def literal(cls, value: float, unit: float) -> _Value:
        return cls(value, value, _of_literal(value, unit), unit)

    @property
    def size(self) -> float:
        return max(abs(self.low), abs(self.high))

    @property
    def is_passed_on(self) -> bool:
        """Whether no program takes it for no number."""
        return self.size + self.error < LARGEST_NUMBER

    def rounded(self) -> _Value:
        largest = self.size + self.error
        # written so that NaN, too, is an error without a bound
        error = self.error + self.unit * largest + _SMALLEST_SINGLE if largest < _LARGEST_SINGLE else math.inf
        return _Value(self.low, self.high, error, self.unit)

    def __add__(self, other: _Value) -> _Value:
        return _Value(self.low + other.low, self.high + other.high, self.error + other.error, self.unit).rounded()

    def __sub__(self, other: _Value) -> _Value:
        return _Value(self.low - other.high, self.high - other.low, self.error + other.error, self.unit).rounded()

    def __mul__(self, other: _Value) -> _Value:
        ends = [one * two for one in (self.low, self.high) for two in (other.low, other.high)]
        error = self.size * other.error + other.size * self.error + self.error * other.error
        return _Value(min(ends), max(ends), error, self.unit).rounded()

    def over(self, divisor: float) -> _Value:
        """By a positive literal, which is rounded, too."""
        off = _of_literal(divisor, self.unit)
        error = (self.error + self.size * off / divisor) / (divisor - off) if off < divisor else math.inf
        return _Value(self.low / divisor, self.high / divisor, error, self.unit).rounded()

    def limited(self, low: float, high: float) -> _Value:
        """Between two literals."""
        error = max(self.error, _of_literal(low, self.unit), _of_literal(high, self.unit))
        return _Value(min(max(self.low, low), high), max(min(self.high, high), low), error, self.unit)


def _of_literal(value: float, unit: float) -> float:
    """The rounding of a number that is known."""
    if unit != SINGLE:
        return 0.0 if unit == DOUBLE else unit * abs(value)
    with np.errstate(over="ignore"):
        return abs(float(np.float32(value)) - value)


def _variables(
    of: Equations,
    sensors: Mapping[str, Input],
    readings: Mapping[str, float],
    calls_per_s: int,
    unit: float,
    shortest_s: float,
) -> dict[str, _Value]:
    """Scaled values of inputs and states."""
    x, z = {}, {}
    # valid ranges are those of the model itself, also in a fallback
    for item in of.inputs:
        x[item.name] = _x(sensors[item.name], readings[item.name], unit)
        z[item.name] = (x[item.name] - _Value.literal(item.centre, unit)).over(item.scale)
    for state in of.states:
        level = _level(x[state.source], state.tau_s, calls_per_s, unit, shortest_s)
        z[state.name] = (level - _Value.literal(state.centre, unit)).over(state.scale)
    return z


def _x(item: Input, largest: float, unit: float) -> _Value:
    low, high = item.valid_min, item.valid_max
    # reading and start reading are rounded, then their difference
    error = 2.0 * unit * largest if item.reference == "rise" else 0.0
    return _Value(low, high, error, unit).rounded().limited(low, high)


def _level(x: _Value, tau_s: float, calls_per_s: int, unit: float, shortest_s: float) -> _Value:
    """Of e' ≤ (1 − g)·e + g·e_x + g·κ·(W + e_x + e) + u·(L + e) the e that stays; W = width, L = largest level."""
    width, share = x.high - x.low, shortest_s / (tau_s + shortest_s)
    per_step = (calls_per_s + 8.0) * unit
    kept = 1.0 - per_step - unit / share
    most = width + x.error + 8.0 * unit * x.size
    error = most
    if kept > 0.0:
        error = (x.error + per_step * (width + x.error) + (unit * x.size + 2.0 * _SMALLEST_SINGLE) / share) / kept
    error = min(error, most) + unit * (_OF_RESTART * width + 2.0 * x.size)
    return _Value(x.low, x.high, error, unit)


def _of_output(output: Output, limits: DecidedLimits, z: Mapping[str, _Value], unit: float) -> LargestError:
    clamp, part, literal = limits.clamp_um, output.position, partial(_Value.literal, unit=unit)
    displacement: _Value = polynomial(output.intercept, output.terms, z, literal)
    own = displacement.limited(-clamp, clamp)
    slope, whole = _Value(0.0, 0.0, 0.0, unit), own
    if part is not None and limits.reach_m > 0.0:
        slope_clamp = limits.slope_clamp_um_per_m
        steep: _Value = polynomial(part.intercept, part.terms, z, literal)
        left = (literal(clamp) - _Value(0.0, clamp, own.error, unit)).over(limits.reach_m)
        steepest = max(steep.error, left.error, _of_literal(slope_clamp, unit))
        if not steep.is_passed_on:
            steepest = math.inf
        slope = _Value(-slope_clamp, slope_clamp, steepest, unit)
        place = _Value(part.valid_min_m, part.valid_max_m, 0.0, unit).rounded()
        away = place.limited(part.valid_min_m, part.valid_max_m) - literal(part.reference_m)
        whole = (_Value(-clamp, clamp, own.error, unit) + slope * away).limited(-clamp, clamp)
    if not (displacement.is_passed_on and math.isfinite(slope.error)):
        return LargestError(math.inf, math.inf, math.inf)
    return LargestError(whole.error * _OF_BOUND, own.error * _OF_BOUND, slope.error * _OF_BOUND)
