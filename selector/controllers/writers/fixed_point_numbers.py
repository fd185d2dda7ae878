"""A model in whole numbers, and what the rounding can cost at most.

A variable is normalised: v = (x − centre) / R with the R that makes |v| ≤ 1, in steps of 2^-30. A term is then one
whole coefficient times a product of v, which stays in [−1, 1]. All bounds are exact rational arithmetic: of numbers
that are known (coefficients, gains) the rounding itself is taken, of others half a step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from selector.controllers.evaluator import Equations
from selector.controllers.model_file import Input, ModelFile, Output, State, Term
from selector.controllers.writers.exported import ExportRefusedError

FRACTION_BITS = 30
"""Of normalised variables and of memory."""

STATE_STEPS = 2**10
"""Steps of a count in which the model reads its memory."""

ONE = 2**FRACTION_BITS
LARGEST_INT32 = 2**31 - 1
LARGEST_INT64 = 2**63 - 1
LARGEST_COUNT = 10**9
"""Of a valid range: a difference of two readings and a level in steps of 2^-30 fit into 64 bits."""

LONGEST_TAU_MS = 3 * 10**9
"""35 days: its product with the longest step of time fits into 64 bits."""

MS = 1000
_FEWEST_COUNTS = 10**5
_LARGEST_SUM = 2**62
_MOST_SPARE_BITS = 32

# A reading of at most 2^31 counts in float64, twice (reading and start reading) and their difference.
_FLOAT_COUNTS = Fraction(1, 2**20)
# float64 itself: 5000 terms of 8 factors each, one rounding of 2^-53 a step.
_FLOAT_SHARE = Fraction(1, 10**12)


@dataclass(frozen=True)
class Error:
    """Bounds of one difference to the float64 model."""

    arithmetic: Fraction  #: For readings that are whole counts
    whole: Fraction  #: For any readings, rounded to counts

    def times(self, factor: Fraction | int) -> Error:
        """Both times a factor that is not negative."""
        return Error(self.arithmetic * factor, self.whole * factor)

    def plus(self, other: Error | Fraction | int) -> Error:
        """Both bounds of a sum."""
        if isinstance(other, Error):
            return Error(self.arithmetic + other.arithmetic, self.whole + other.whole)
        return Error(self.arithmetic + other, self.whole + other)

    def larger(self, other: Error) -> Error:
        """The larger of both bounds."""
        return Error(max(self.arithmetic, other.arithmetic), max(self.whole, other.whole))

    def rounded_up(self) -> Error:
        """Both on a grid of 2^-64, so that numerators stay short."""
        return Error(_up(self.arithmetic), _up(self.whole))


@dataclass(frozen=True)
class Counted:
    """An input in counts: its valid range, rounded outwards."""

    item: Input
    per_unit: Fraction
    low: int
    high: int

    @property
    def largest(self) -> int:
        """Largest magnitude of x in counts."""
        return max(abs(self.low), abs(self.high))


@dataclass(frozen=True)
class Normalised:
    """v = shifted(gain · x + offset, shift), x in counts (an input) or in steps of a count (memory)."""

    gain: int
    offset: int
    shift: int
    reach: Fraction  #: z of the model at v = 1
    largest: int  #: Largest |v| in steps of 2^-30
    total: int  #: Largest magnitude of gain · x + offset
    error: Error  #: Of v, in steps of 2^-30


@dataclass(frozen=True)
class Polynomial:
    """constant + Σ coefficient · Π v; shifted by `shift` it is in nm (or nm/m).

    `error` is in the same unit, the last rounding included; `total` bounds the magnitude of the sum before the shift.
    """

    constant: int
    terms: tuple[tuple[int, tuple[str, ...]], ...]
    shift: int
    total: int
    error: Error

    @property
    def largest(self) -> int:
        """Bound of the magnitude of the result."""
        return shifted(self.total, self.shift)


@dataclass(frozen=True)
class Fixed:
    """Everything of a model in whole numbers."""

    inputs: dict[str, Counted]
    taus_ms: dict[tuple[str, float], int]
    variables: dict[str, Normalised]  #: Per input and state
    #: own and slopes: Per output: displacement [nm] at the reference position; its slope [nm/m] where it has one
    own: dict[str, Polynomial]
    slopes: dict[str, Polynomial]
    errors_nm: dict[str, Error]  #: Per output, of the correction


def fixed(model: ModelFile) -> Fixed:
    """The model in whole numbers, and what they cost it or any of its fallbacks at most."""
    inputs = {item.name: _counted(item) for item in model.inputs}
    everything: list[Equations] = [model, *(model.fallbacks if model.guard.on_fault == "fallback" else ())]
    taus = sorted({(state.source, state.tau_s) for of in everything for state in of.states})
    taus_ms = {key: tau_ms(*key) for key in taus}
    parts = [_equations(of, inputs) for of in everything]
    variables, own, slopes, errors = parts[0]
    for *_, others in parts[1:]:
        errors = {name: error.larger(others[name]) for name, error in errors.items()}
    return Fixed(inputs, taus_ms, variables, own, slopes, errors)


def _equations(
    of: Equations, inputs: Mapping[str, Counted]
) -> tuple[dict[str, Normalised], dict[str, Polynomial], dict[str, Polynomial], dict[str, Error]]:
    variables = {item.name: normalised_input(item, inputs[item.name]) for item in of.inputs}
    variables |= {state.name: normalised_state(state, inputs[state.source]) for state in of.states}
    own = {o.name: polynomial(o.name, o.intercept, o.terms, variables) for o in of.outputs}
    slopes = {
        o.name: polynomial(o.name, o.position.intercept, o.position.terms, variables)
        for o in of.outputs
        if o.position is not None
    }
    errors = {o.name: _correction_error(o, own[o.name], slopes.get(o.name)) for o in of.outputs}
    return variables, own, slopes, errors


def normalised_input(item: Input, counted: Counted) -> Normalised:
    """An input of a model or a fallback."""
    return _normalised(item, counted, 1, Error(_FLOAT_COUNTS, Fraction(1) + _FLOAT_COUNTS))


def normalised_state(state: State, counted: Counted) -> Normalised:
    """A memory of a model or a fallback."""
    error = _level_error(counted, tau_ms(state.source, state.tau_s), state.tau_s)
    return _normalised(state, counted, STATE_STEPS, error)


def shifted(value: int, shift: int) -> int:
    """Value / 2^shift, rounded to the nearest, halves away from zero: as the exported function does."""
    half = (1 << shift) >> 1
    return (value + half) >> shift if value >= 0 else -((-value + half) >> shift)


def counts_of(counted: Counted) -> str:
    """How a reading is counted, in words."""
    per_unit = counted.per_unit
    return f"1 {counted.item.unit} = {per_unit} counts" if per_unit >= 1 else f"1 count = {1 / per_unit} of its unit"


def position_um(position_m: float) -> int:
    """A position in whole µm."""
    return round(Fraction(position_m) * 10**6)


def _counted(item: Input) -> Counted:
    """Thousandths of the unit; other units than °C finer or coarser by powers of ten, so that the range is resolved."""
    largest = max(abs(Fraction(item.valid_min)), abs(Fraction(item.valid_max)))
    per_unit = Fraction(1000)
    if item.unit != "degC" and largest > 0:
        while largest * per_unit < _FEWEST_COUNTS / 10:
            per_unit *= 10
    while largest * per_unit > LARGEST_COUNT:
        per_unit /= 10
    low, high = math.floor(Fraction(item.valid_min) * per_unit), math.ceil(Fraction(item.valid_max) * per_unit)
    return Counted(item, per_unit, low, high)


def tau_ms(source: str, tau_s: float) -> int:
    """A time constant in whole milliseconds."""
    whole_ms = max(1, round(Fraction(tau_s) * MS))
    if whole_ms > LONGEST_TAU_MS:
        raise ExportRefusedError(
            f"memory of {source} over {tau_s:g} s",
            expected=f"at most {LONGEST_TAU_MS / MS:g} s, so that products of times fit into 64 bits",
            where="fixed-point export, states",
            advice="export double precision, or leave this memory out of the model",
        )
    return whole_ms


def _level_error(counted: Counted, whole_ms: int, tau_s: float) -> Error:
    """Of memory as the model reads it, in counts.

    With gain g = dt/(tau + dt) an error e becomes (1 − g)·e + ρ: at most ρ/g, largest at the shortest step of 1 s.
    ρ: half a step of 2^-30; of float64 eight roundings of the largest level. Another tau: |x − level| is at most the
    width of the range, and its share |Δtau|/tau is lost. What the model reads is rounded to a step of STATE_STEPS.
    """
    times = Fraction(whole_ms + MS, MS)
    of_steps = times / 2 / ONE
    of_float = times * 8 * max(counted.largest, 1) / 2**53
    of_tau = (counted.high - counted.low) * abs(whole_ms - Fraction(tau_s) * MS) / whole_ms
    inside = _up(of_steps + of_float + of_tau + Fraction(1, 2 * STATE_STEPS) + _FLOAT_COUNTS)
    return Error(inside, inside + 1)


def _normalised(of: Input | State, counted: Counted, steps: int, error_counts: Error) -> Normalised:
    per_unit = counted.per_unit * steps
    centre = Fraction(of.centre) * per_unit
    low, high = counted.low * steps, counted.high * steps
    radius = max(abs(low - centre), abs(high - centre))
    if radius == 0:
        return Normalised(0, 0, 0, Fraction(0), 0, 0, Error(Fraction(0), Fraction(0)))
    gain_exact, offset_exact = ONE / radius, -centre * ONE / radius
    largest = max(abs(low), abs(high))
    for shift in range(40, -1, -1):
        gain, offset = round(gain_exact * 2**shift), round(offset_exact * 2**shift)
        total = abs(gain) * largest + abs(offset)
        if total + 2**shift < _LARGEST_SUM:
            break
    else:
        raise ExportRefusedError(
            f"{of.name}: centre {of.centre:g} is {float(abs(centre) / radius):.3g} times as far away as the valid "
            "range is wide",
            expected="a centre near the valid range, so that products fit into 64 bits",
            where="fixed-point export, centre and valid range",
            advice="export double precision, or fit the model again with centred inputs",
        )
    rounding = (largest * abs(gain - gain_exact * 2**shift) + abs(offset - offset_exact * 2**shift)) / 2**shift
    error = error_counts.times(steps * gain_exact).plus(rounding + Fraction(1, 2)).rounded_up()
    ends = max(abs(shifted(gain * x + offset, shift)) for x in (low, high))
    return Normalised(gain, offset, shift, radius / per_unit / Fraction(of.scale), ends, total, error)


def polynomial(output: str, intercept: float, terms: Iterable[Term], variables: Mapping[str, Normalised]) -> Polynomial:
    """In nm: coefficients times 1000, with as many bits below 1 nm as 64 bits leave."""
    products = [_product(term, variables) for term in terms]
    constant = Fraction(intercept) * 1000
    size = abs(constant) + sum((abs(c) * largest / ONE for c, _, largest, _ in products), Fraction(0))
    spare = _MOST_SPARE_BITS
    while spare >= 0 and (size + 1) * 2 ** (spare + FRACTION_BITS) + len(products) * 2 ** (FRACTION_BITS + 1) >= (
        _LARGEST_SUM
    ):
        spare -= 1
    if spare < 0:
        raise ExportRefusedError(
            f"{output}: the magnitudes of its terms add up to {float(size) / 1e6:.3g} mm",
            expected=f"less than {2 ** (62 - FRACTION_BITS) / 1e6:.0f} mm, so that sums fit into 64 bits",
            where="fixed-point export, coefficients and valid ranges",
            advice="export double precision, or find out which coefficient or valid range is far too large",
        )
    shift = spare + FRACTION_BITS
    whole = round(constant * 2**shift)
    error = Error(*[abs(whole - constant * 2**shift)] * 2)
    total, rounded = abs(whole), []
    for exact, factors, largest, product_error in products:
        coefficient = round(exact * 2**spare)
        if coefficient:
            rounded.append((coefficient, factors))
        total += abs(coefficient) * largest
        error = error.plus(product_error.times(abs(coefficient))).plus(abs(coefficient - exact * 2**spare) * ONE)
    if total + 2**shift > LARGEST_INT64:
        raise AssertionError(output)
    error = error.times(Fraction(1, 2**shift)).plus(Fraction(1, 2) + size * _FLOAT_SHARE).rounded_up()
    return Polynomial(whole, tuple(rounded), shift, total, error)


def _product(term: Term, variables: Mapping[str, Normalised]) -> tuple[Fraction, tuple[str, ...], int, Error]:
    """(coefficient [nm] of Π v, factors, largest |Π v| and its error in steps of 2^-30)."""
    coefficient, factors = Fraction(term.coefficient) * 1000, []
    for name, power in term.powers.items():
        coefficient *= variables[name].reach ** power
        factors += [name] * power
    first = variables[factors[0]]
    largest, error = first.largest, first.error
    for name in factors[1:]:
        v = variables[name]
        # |p·v − p'·v'| ≤ |p|·|v − v'| + |v'|·|p − p'|, where the exact |v'| is at most 1
        error = v.error.times(Fraction(largest, ONE)).plus(error).plus(Fraction(1, 2)).rounded_up()
        largest = shifted(largest * v.largest, FRACTION_BITS)
    return coefficient, tuple(factors), largest, error


def _correction_error(output: Output, own: Polynomial, slope: Polynomial | None) -> Error:
    """Own part, and the slope over the reach; positions and their limits are rounded to 1 µm, the product to 1 nm."""
    part = output.position
    if part is None or slope is None:
        return own.error
    reference = Fraction(part.reference_m)
    reach = max(abs(Fraction(part.valid_min_m) - reference), abs(Fraction(part.valid_max_m) - reference))
    of_position = Fraction(slope.largest + 1, 10**6) + Fraction(1, 2)
    # where the clamp limits the slope, the slope takes over the error of the own part and rounds once more
    of_slope = slope.error.times(reach).larger(own.error.plus(reach + 1))
    return own.error.plus(of_slope).plus(of_position)


def _up(value: Fraction) -> Fraction:
    return Fraction(math.ceil(value * 2**64), 2**64)
