"""A guarded program in whole numbers, for processors and PLC ladders without floating point.

The statements are those of every other program (`selector.controllers.program`); here are the units of their literals
(ms, counts, nm, um), the steps that whole numbers take otherwise, and what all that costs at most.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import LARGEST_NUMBER, DecidedLimits, decided_limits
from selector.controllers.model_file import Input, ModelFile, Output, State, Term
from selector.controllers.program.language import Call, Code, Expression, Kind, Place, Variable, Writing, plain
from selector.controllers.program.numbers import Numbers
from selector.controllers.program.statements import NO_READING
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.fixed_point_numbers import (
    FRACTION_BITS,
    LARGEST_INT32,
    MS,
    ONE,
    STATE_STEPS,
    Normalised,
    counts_of,
    fixed,
    normalised_input,
    normalised_state,
    polynomial,
    position_um,
    tau_ms,
)
from selector.findings import Finding

INT_NAME = "thermal_correction_i"
MISSING = -(2**31)
"""A reading or position that is not there."""

TOOLS = {
    "shifted": """\
static int64_t shifted(int64_t value, int bits)
{
    int64_t half = ((int64_t)1 << bits) >> 1;
    return value >= 0 ? (value + half) >> bits : -((-value + half) >> bits);
}
""",
    "scaled": """\
/* nm from nm/m times um */
static int64_t scaled(int64_t product)
{
    return (product >= 0 ? product + 500000 : product - 500000) / 1000000;
}
""",
    "followed": """\
/* level + (target - level) * dt / (tau + dt), without an intermediate value beyond 64 bits */
static int64_t followed(int64_t level, int64_t target, int64_t dt, int64_t tau)
{
    int64_t change = target - level;
    int64_t all = tau + dt;
    int64_t rest = change % all * dt;
    rest += rest >= 0 ? all / 2 : -(all / 2);
    return level + change / all * dt + rest / all;
}
""",
    "filled": """\
/* over a standstill in 16 steps: one would keep a fifth of a memory of which 2 % are left */
static int64_t filled(int64_t level, int64_t target, int64_t dt, int64_t tau)
{
    int k;
    for (k = 0; k < 16; k++)
        level = followed(level, target, dt / 16, tau);
    return level;
}
""",
}


_LARGEST_SLEW_PM_PER_S = 10**14
_PM, _FASTEST = 10**6, 2**33  # no two readings differ by more counts, in a minute or ever
_OF_UNITS = {"s": ("ms", 1000.0), "um": ("nm", 1000.0), "um/m": ("nm/m", 1000.0), "m": ("um", 1e6)}
_UNIT = re.compile(r"\[(s|um|um/m|m)\]")


class _Whole(Writing):
    """Variables in whole units: their names and what is said of them, too."""

    def __init__(self, numbers: _WholeNumbers) -> None:
        super().__init__()
        self._numbers = numbers

    def variable(
        self, name: str, kind: Kind = "real", place: Place = "temporary", about: str = "", initial: float = 0.0
    ) -> Variable:
        """As it is asked for in seconds, micrometres and metres."""
        if kind == "real":
            found = _UNIT.search(about)
            if found:
                unit, factor = _OF_UNITS[found[1]]
                about, initial = about.replace(found[0], f"[{unit}]"), initial * factor
            if name.startswith("reading_"):
                about = self._numbers.about_reading(int(name.removeprefix("reading_")))
            if name.startswith(("reading_", "position_")):
                about += "; smallest, largest number = missing"
            if place == "input" and initial >= NO_READING:
                initial = float(MISSING)
            name = re.sub(r"_s$", "_ms", name).replace("test_um_", "test_nm_")
        return super().variable(name, kind, place, about, float(round(initial)))


class _WholeNumbers(Numbers):
    """Milliseconds, counts of a sensor, nanometres, micrometres of a position; memory in steps of 2^-30 counts."""

    def __init__(self, model: ModelFile) -> None:
        self.fixed = fixed(model)
        self._inputs = model.inputs
        self._variables: dict[str, Normalised] = {}

    def writing(self) -> Writing:
        return _Whole(self)

    def about_reading(self, k: int) -> str:
        """What the k-th reading is (from 1)."""
        counted = self.fixed.inputs[self._inputs[k - 1].name]
        return f"{counted.item.name}: {counts_of(counted)}"

    def seconds(self, value: float) -> Expression:
        # upwards, so that six samples of a sixth are enough
        return Code(min(math.ceil(round(value * MS, 6)), LARGEST_INT32))

    def um(self, value: float) -> Expression:
        return Code(round(Fraction(value) * 1000))

    def metres(self, value: float) -> Expression:
        return Code(position_um(value))

    def reading(self, item: Input, value: float, up: int = 0) -> Expression:
        counts = Fraction(value) * self.fixed.inputs[item.name].per_unit
        whole = math.ceil(counts) if up > 0 else math.floor(counts) if up < 0 else round(counts)
        return Code(max(1 - LARGEST_INT32, min(whole, LARGEST_INT32 - 1)))

    def is_given(self, of: Expression) -> Expression:
        return (of >= Code(-LARGEST_INT32)) & (of <= Code(LARGEST_INT32 - 1))

    def is_number(self, of: Expression) -> Expression:
        return (of >= self.um(-LARGEST_NUMBER)) & (of <= self.um(LARGEST_NUMBER))

    def is_level(self, level: Expression, item: Input) -> Expression:
        counted = self.fixed.inputs[item.name]
        return (level >= Code(counted.low * ONE)) & (level <= Code(counted.high * ONE))

    def largest_change(self, item: Input, rate_per_min: float, seconds: Expression) -> Expression:
        per_min = min(round(Fraction(rate_per_min) * self.fixed.inputs[item.name].per_unit), _FASTEST)
        return Code(per_min) * seconds / Code(60 * MS)

    def along(self, slope: Expression, way: Expression) -> Expression:
        return Call("scaled", (slope * way,))

    def left_over(self, length: Expression, reach_m: float) -> Expression:
        return length * Code(_PM) / Code(max(position_um(reach_m), 1))

    def remembered(
        self, w: Writing, level: Variable, x: Variable, since: Variable, tau_s: float, is_gap: Expression
    ) -> None:
        step = (level, self.begun(x), since, Code(tau_ms("a sensor", tau_s)))
        with w.when(is_gap):
            w.assign(level, Call("filled", step))
        with w.otherwise():
            w.assign(level, Call("followed", step))

    def begun(self, x: Variable) -> Expression:
        return x * Code(ONE)

    def scaled(self, w: Writing, z: Variable, of: Input | State, x: Variable, source: Input) -> None:
        counted = self.fixed.inputs[source.name]
        now: Expression = x
        if isinstance(of, Input):
            v = normalised_input(of, counted)
        else:
            v = normalised_state(of, counted)
            now = Call("shifted", (x, Code(FRACTION_BITS - STATE_STEPS.bit_length() + 1)))
        self._variables[of.name] = v
        w.assign(z, Call("shifted", (now * Code(v.gain) + Code(v.offset), Code(v.shift))))

    def polynomial(
        self, w: Writing, total: Variable, intercept: float, terms: Sequence[Term], z: Mapping[str, Variable]
    ) -> None:
        of, sum_ = polynomial("an output", intercept, terms, self._variables), w.variable("sum")
        w.assign(sum_, Code(of.constant))
        for coefficient, factors in of.terms:
            product: Expression = z[factors[0]]
            if len(factors) > 1:
                p = w.variable("product")
                w.assign(p, product)
                for name in factors[1:]:
                    w.assign(p, Call("shifted", (p * z[name], Code(FRACTION_BITS))))
                product = p
            w.assign(sum_, sum_ + Code(coefficient) * product)
        w.assign(total, Call("shifted", (sum_, Code(of.shift))))

    def towards(self, w: Writing, now: Variable, to: Variable, rest: Variable, slewed: Variable, slew: float) -> None:
        most, reach = w.variable("most"), w.variable("reach")
        pm_per_s = min(max(1, round(Fraction(slew) * _PM)), _LARGEST_SLEW_PM_PER_S)
        w.assign(most, Code(pm_per_s) * slewed + rest)
        w.assign(reach, most / Code(_PM))
        w.assign(rest, most - reach * Code(_PM))
        w.limit(to, now - reach, now + reach)
        w.assign(now, to)


def whole_numbers(model: ModelFile) -> Numbers:
    """In which numbers a fixed-point program of a model calculates.

    Raises
    ------
    ExportRefusedError
        The model does not fit into 64 bits, or takes touch-offs.
    """
    if model.adaptation is not None:
        raise ExportRefusedError(
            "it cannot take touch-offs",
            expected="a model without adaptation",
            where="fixed-point export, adaptation",
            advice="use the double- or single-precision program, or export the model without its adaptation",
        )
    limits, _ = decided_limits(model)
    for output in model.outputs:
        _check_limits(output, limits[output.name])
    return _WholeNumbers(model)


def about_whole_numbers(model: ModelFile) -> Iterator[str]:
    """Units and bounds, to stand at the head of the program."""
    numbers = fixed(model)
    yield "Whole numbers only. Times in ms (their sum has to be the true time), corrections in nm, slopes in nm/m,"
    yield "positions in um."
    for counted in numbers.inputs.values():
        item = counted.item
        yield plain(f"{item.name}: {counts_of(counted)}, valid {counted.low} ... {counted.high} counts")
    for (source, tau_s), whole_ms in numbers.taus_ms.items():
        yield plain(f"memory of {source} over {tau_s:g} s: {whole_ms} ms, resolution 2^-{FRACTION_BITS} counts")
    own = fixed_point_bound_um(model, is_counted=True)
    for name, bound in fixed_point_bound_um(model).items():
        yield plain(f"Largest difference to the float64 model inside the valid ranges: {name} {_above(bound)} um,")
        yield f"  {_above(own[name])} um of it for readings that are whole counts."
    yield "No intermediate value passes 63 bits; proven for all readings when this file was written."


def _check_limits(output: Output, limits: DecidedLimits) -> None:
    for what, value in (("clamp", limits.clamp_um), ("slope clamp", limits.slope_clamp_um_per_m)):
        if round(value * 1000.0) > LARGEST_INT32:
            raise ExportRefusedError(
                f"{what} of {output.name}: {value:g} um",
                expected=f"at most {LARGEST_INT32 / 1000:.0f} um (or um/m): 32 bits of nm",
                where="fixed-point export, guard.limits",
                advice="decide on a smaller limit in guard.limits of the model file",
            )
    part = output.position
    if (
        part is not None
        and max(abs(position_um(at)) for at in (part.valid_min_m, part.valid_max_m, part.reference_m)) > 10**9
    ):
        raise ExportRefusedError(
            f"positions of {output.name} reach beyond 1000 m",
            expected="positions in um that fit into 32 bits",
            where="fixed-point export, position",
            advice="correct the positions of the position-dependent part",
        )


def fixed_point_bound_um(model: ModelFile, *, is_counted: bool = False) -> dict[str, float]:
    """Per output, what the correction can differ at most from the float64 model [µm], inside the valid ranges.

    The rounding of readings to counts is part of it, unless `is_counted`: readings are whole counts already. The
    guard's dead band and slew limit are not: they act on either result.
    """
    errors = fixed(model).errors_nm
    # rounded upwards, so that the float is a bound, too
    return {
        name: math.nextafter(float((e.arithmetic if is_counted else e.whole) / 1000), math.inf)
        for name, e in errors.items()
    }


def fixed_point_findings(model: ModelFile) -> tuple[Finding, ...]:
    """The bound per output."""
    counted = fixed_point_bound_um(model, is_counted=True)
    found = [
        FINDINGS.finding(
            "fixed-point-bound",
            f"{name}: the fixed-point program differs from the model by at most {bound:.2g} µm inside the valid "
            f"ranges, {counted[name]:.2g} µm of it by its own arithmetic.",
            evidence={"output": name, "bound_um": bound, "arithmetic_bound_um": counted[name]},
        )
        for name, bound in fixed_point_bound_um(model).items()
    ]
    return tuple(found)


def _above(bound_um: float) -> str:
    return f"{math.ceil(bound_um * 1e5) / 1e5:.5f}"
