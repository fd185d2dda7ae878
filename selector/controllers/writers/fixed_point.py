"""C99 in whole numbers, for processors and PLC ladders without floating point: the text of the program."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

from selector.controllers.evaluator import axes_of
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import (
    LONGEST_S,
    LONGEST_STEP_S,
    SAMPLE_S,
    DecidedLimits,
    Mode,
    SensorCode,
    decided_limits,
    is_turned,
    longest_test_s,
    valid_positions_m,
)
from selector.controllers.model_file import ModelFile, Output, PositionPart
from selector.controllers.program.language import plain
from selector.controllers.writers.exported import ExportRefusedError, heading
from selector.controllers.writers.fixed_point_numbers import (
    FRACTION_BITS,
    LARGEST_INT32,
    STATE_STEPS,
    Fixed,
    Normalised,
    Polynomial,
    counts_of,
    fixed,
    position_um,
)
from selector.controllers.writers.fixed_point_sensor import (
    INT_NAME,
    MISSING,
    kept_lines,
    long_literal,
    milliseconds,
    nanometres,
    sensor_lines,
)
from selector.findings import Finding

TOOLS = {
    "shifted": """\
static int64_t shifted(int64_t value, int bits)
{
    int64_t half = ((int64_t)1 << bits) >> 1;
    return value >= 0 ? (value + half) >> bits : -((-value + half) >> bits);
}
""",
    "limited": """\
static int64_t limited(int64_t value, int64_t low, int64_t high)
{
    return value < low ? low : value > high ? high : value;
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
    "slope_left": """\
/* nm/m that nm leave over um of the axis */
static int64_t slope_left(int64_t nm, int64_t um, int64_t most)
{
    return um > 0 ? limited(nm * 1000000 / um, 0, most) : 0;
}
""",
    "moved": """\
/* no faster than slew [pm/s]; what is less than 1 nm waits for the next call */
static int32_t moved(int32_t now, int32_t aim, int64_t slew, int32_t dt, int32_t *rest)
{
    int64_t allowed = slew * dt + *rest;
    int64_t most = allowed / 1000000;
    *rest = (int32_t)(allowed % 1000000);
    return (int32_t)limited(aim, now - most, now + most);
}
""",
}


_LARGEST_SLEW_PM_PER_S = 10**14
_PM = 10**6


class Source:
    """The text of one model."""

    def __init__(self, model: ModelFile) -> None:
        self.fixed = fixed(model)
        self._model = model
        self._limits, _ = decided_limits(model)
        self._index = {item.name: k for k, item in enumerate(model.inputs, 1)}
        self._axes = {axis: k for k, axis in enumerate(axes_of(model), 1)}
        self._parts = {o.position.axis: o.position for o in model.outputs if o.position is not None}
        self._levels = {key: k for k, key in enumerate(self.fixed.taus_ms, 1)}
        self._v = {name: f"v_{k}" for k, name in enumerate(self.fixed.variables, 1)}
        for output in model.outputs:
            _check_limits(output, self._limits[output.name])

    def header(self) -> list[str]:
        """Lines of the header file."""
        lines = [f"#ifndef {INT_NAME.upper()}_H", f"#define {INT_NAME.upper()}_H", "", "#include <stdint.h>", ""]
        lines.append(f"typedef struct {INT_NAME} {{")
        for title, members in self._members().items():
            lines.append(f"    /* {title} */")
            lines += [
                f"    {kind} {name};" + (f" /* {plain(about)} */" if about else "") for kind, name, _, about in members
            ]
        lines += [f"}} {INT_NAME};", "", "/* Once, before the first call. */", f"void {INT_NAME}_init({INT_NAME} *m);"]
        lines += ["/* Every cycle, after the inputs are set. */", f"void {INT_NAME}_step({INT_NAME} *m);", "", "#endif"]
        return lines

    def body(self) -> list[str]:
        """Lines of the source file."""
        lines = [f"void {INT_NAME}_init({INT_NAME} *m)", "{"]
        lines += [f"    m->{name} = {initial};" for of in self._members().values() for _, name, initial, _ in of]
        lines += ["}", ""]
        for item in self._model.inputs:
            taus = {k: self.fixed.taus_ms[key] for key, k in self._levels.items() if key[0] == item.name}
            own = sensor_lines(self.fixed.inputs[item.name], self._model.guard, self._index[item.name], taus)
            lines += [*own, ""]
        lines += [*self._aimed(), "", *self._restarted(), "", *self._stepped()]
        text = "\n".join(lines)
        # a static function that nobody calls is a warning
        tools = [tool for name, tool in TOOLS.items() if f"{name}(" in text]
        return [f'#include "{INT_NAME}.h"', "", *tools, *lines]

    def _members(self) -> dict[str, list[tuple[str, str, str, str]]]:
        """Title → (type, name, initial value, what it is)."""
        n, w = "int32_t", "int64_t"
        inputs = [(n, "dt_ms", "0", "time since the last call [ms]; the sum must be the true time")]
        outputs, kept, retained = [], [], []
        for name, k in self._index.items():
            counted = self.fixed.inputs[name]
            inputs.append(
                (n, f"reading_{k}", MISSING, f"{name}: {counts_of(counted)}; smallest, largest number = missing")
            )
            retained.append((n, f"has_memory_{k}", "0", ""))
            kept += [(n, f"x_{k}", "0", ""), (n, f"since_ms_{k}", "0", "")]
            kept += [(n, f"good_ms_{k}", "-1", ""), (n, f"is_new_{k}", "1", "")]
            if counted.item.reference == "rise":
                retained.append((n, f"start_{k}", "0", f"start reading of {name} [counts]"))
                retained.append((n, f"has_start_{k}", "0", ""))
            if counted.item.rate_limit_per_min is not None:
                kept += [(n, f"{of}_{k}", "0", "") for of in ("anchor", "has_anchor", "anchor_age_ms")]
        for axis, k in self._axes.items():
            reference = str(position_um(self._parts[axis].reference_m))
            inputs.append(
                (n, f"position_{k}", MISSING, f"position of axis {axis} [um]; smallest, largest number = missing")
            )
            outputs.append((n, f"axis_{k}", str(int(SensorCode.MISSING)), f"{axis}: 0 ok, 1 limited, 3 missing"))
            kept.append((n, f"at_{k}", reference, ""))
        inputs += [(n, "is_ready", "1", "drives on, axis referenced"), (n, "is_wanted", "1", "the operator's switch")]
        inputs.append((n, "is_restart", "0", "not 0 in the first call after the control was off"))
        inputs.append((n, "standstill_ms", "0", "with is_restart: off for so long [ms]"))
        for k, output in enumerate(self._model.outputs, 1):
            inputs.append((n, f"test_nm_{k}", "0", f"sign test of {output.name}: not 0 commands so much [nm]"))
            outputs.append((n, f"correction_{k}", "0", f"to be added to the axis for {output.name} [nm]"))
            outputs.append((n, f"k0_{k}", "0", "the same at the reference position [nm]"))
            kept += [(n, f"aim_{k}", "0", ""), (n, f"rest_{k}", "0", "")]
            if output.position is not None:
                outputs.append((n, f"slope_{k}", "0", "and its slope [nm/m]"))
                kept += [(n, f"{of}_{k}", "0", "") for of in ("slope_aim", "slope_rest", "is_back", "back_rest")]
                kept.append((n, f"where_{k}", str(position_um(output.position.reference_m)), ""))
        outputs.append((n, "mode", "0", "0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test"))
        outputs += [
            (n, f"sensor_{k}", str(int(SensorCode.MISSING)), f"{name}: 0 ok, 1 limited, 2 recovering, 3 missing, "
             "4 break code, 5 out of limits, 6 jump, 8 range" if k == 1 else name)
            for name, k in self._index.items()
        ]  # fmt: skip
        retained += [
            (w, f"level_{k}", "0", f"memory of {source} over {tau:g} s, 2^-{FRACTION_BITS} counts")
            for (source, tau), k in self._levels.items()
        ]
        kept.append((n, "is_first", "1", ""))
        kept += [(n, name, "0", "") for name in ("was_restart", "since_ms", "held_ms", "test_left_ms")]
        kept.append((n, "follows", str(int(Mode.HOLD)), ""))
        titles = ("inputs", "outputs", "to be kept when the control is off", "state")
        return dict(zip(titles, (inputs, outputs, retained, kept), strict=True))

    def _aimed(self) -> Iterator[str]:
        yield "/* the model */"
        yield f"static void aimed({INT_NAME} *m)"
        yield "{"
        yield "    int64_t sum, p, own, change;"
        yield f"    int64_t {', '.join(self._v.values())};"
        for name, v in self.fixed.variables.items():
            yield f"    {self._v[name]} = {self._normalised(name, v)}; /* {plain(name)} */"
        unused = [v for name, v in self._v.items() if not self._is_used(name)]
        yield from (f"    (void){v};" for v in unused)
        yield "    p = own = change = 0;"
        for k, output in enumerate(self._model.outputs, 1):
            limits = self._limits[output.name]
            clamp, band = nanometres(limits.clamp_um), nanometres(limits.dead_band_um)
            yield f"    /* displacement {plain(output.name)} */"
            yield from self._sum(self.fixed.own[output.name])
            sign = "" if is_turned(output) else "-"
            yield f"    own = limited({sign}own, -{clamp}, {clamp});"
            if band > 0:
                yield f"    change = own - m->aim_{k};"
                yield f"    if (change >= {band} || change <= -{band})"
            yield f"    {'    ' if band > 0 else ''}m->aim_{k} = (int32_t)own;"
            if output.position is not None:
                yield from self._sum(self.fixed.slopes[output.name])
                yield "    /* the straight line keeps the clamp at the far end of the axis, too */"
                yield f"    change = slope_left({clamp} - (m->aim_{k} < 0 ? -(int64_t)m->aim_{k} : m->aim_{k}),"
                yield f"        {position_um(limits.reach_m)}, {nanometres(limits.slope_clamp_um_per_m)});"
                yield f"    m->slope_aim_{k} = (int32_t)limited({sign}own, -change, change);"
        yield "    (void)p;"
        yield "    (void)change;"
        yield "}"

    def _normalised(self, name: str, v: Normalised) -> str:
        if name in self._index:
            x = f"(int64_t)m->x_{self._index[name]}"
        else:
            state = next(state for state in self._model.states if state.name == name)
            bits = FRACTION_BITS - STATE_STEPS.bit_length() + 1
            x = f"shifted(m->level_{self._levels[state.source, state.tau_s]}, {bits})"
        return f"shifted({x} * {long_literal(v.gain)} + {long_literal(v.offset)}, {v.shift})"

    def _is_used(self, name: str) -> bool:
        polynomials = (*self.fixed.own.values(), *self.fixed.slopes.values())
        return any(name in factors for p in polynomials for _, factors in p.terms)

    def _sum(self, of: Polynomial) -> Iterator[str]:
        yield f"    sum = {long_literal(of.constant)};"
        for coefficient, factors in of.terms:
            product = self._v[factors[0]]
            if len(factors) > 1:
                yield f"    p = {product};"
                yield from (f"    p = shifted(p * {self._v[name]}, {FRACTION_BITS});" for name in factors[1:])
                product = "p"
            yield f"    sum += {long_literal(coefficient)} * {product};"
        yield f"    own = shifted(sum, {of.shift});"

    def _stepped(self) -> Iterator[str]:
        guard = self._model.guard
        believed = " && ".join(f"m->sensor_{k} <= {SensorCode.LIMITED:d}" for k in self._index.values())
        yield f"void {INT_NAME}_step({INT_NAME} *m)"
        yield "{"
        yield f"    int32_t dt = m->dt_ms > 0 && m->dt_ms <= {milliseconds(LONGEST_S)} ? m->dt_ms : 0;"
        yield f"    int32_t slewed = (int32_t)limited(dt, 0, {milliseconds(LONGEST_STEP_S)}), is_test = 0;"
        if self._axes:
            yield f"    int32_t {', '.join(f'back_{k} = 0' for k in self._axes.values())};"
        yield "    if (m->is_restart && !m->was_restart)"
        yield "        restarted(m);"
        yield "    m->was_restart = m->is_restart;"
        yield "    if (m->is_first) { /* what was kept is dropped where it cannot be */"
        for name, k in self._index.items():
            levels = [level for (source, _), level in self._levels.items() if source == name]
            yield from (f"        {line}" for line in kept_lines(self.fixed.inputs[name], k, levels))
        yield "    }"
        for axis, k in self._axes.items():
            low, high = (position_um(at) for at in valid_positions_m(self._model)[axis])
            ok, limited, missing = (int(SensorCode[name]) for name in ("OK", "LIMITED", "MISSING"))
            yield f"    if (m->position_{k} != {MISSING} && m->position_{k} != {LARGEST_INT32}) {{"
            yield f"        back_{k} = m->axis_{k} == {missing};"
            yield f"        m->at_{k} = m->position_{k};"
            yield f"        m->axis_{k} = m->at_{k} < {low} || m->at_{k} > {high} ? {limited} : {ok};"
            yield "    } else {"
            yield f"        m->axis_{k} = {missing};"
            yield "    }"
        yield f"    m->since_ms = (int32_t)limited((int64_t)m->since_ms + dt, 0, {milliseconds(LONGEST_S)});"
        yield f"    if (m->is_first || m->since_ms >= {milliseconds(SAMPLE_S)}) {{"
        yield f"        if (m->mode == {Mode.TEST:d})"
        yield "            m->test_left_ms = m->test_left_ms > m->since_ms ? m->test_left_ms - m->since_ms : 0;"
        yield from (f"        sensor_{k}(m);" for k in self._index.values())
        otherwise = Mode.RAMP_TO_ZERO if guard.last_resort == "ramp-to-zero" else Mode.HOLD
        yield f"        m->follows = {believed}"
        yield f"            ? {Mode.MODEL:d} : {otherwise:d};"
        if guard.last_resort == "hold" and guard.hold_at_most_s is not None:
            yield f"        m->held_ms = m->follows == {Mode.MODEL:d} ? 0 :"
            yield f"            (int32_t)limited((int64_t)m->held_ms + m->since_ms, 0, {milliseconds(LONGEST_S)});"
            yield f"        if (m->held_ms > {milliseconds(guard.hold_at_most_s)})"
            yield f"            m->follows = {Mode.RAMP_TO_ZERO:d};"
        yield f"        if (m->follows == {Mode.MODEL:d})"
        yield "            aimed(m);"
        yield f"        if (m->follows == {Mode.RAMP_TO_ZERO:d}) {{"
        for k, output in enumerate(self._model.outputs, 1):
            yield f"            m->aim_{k} = 0;"
            if output.position is not None:
                yield f"            m->slope_aim_{k} = 0;"
        yield "        }"
        yield "        m->is_first = 0;"
        yield "        m->since_ms = 0;"
        yield "    }"
        yield "    m->mode = m->follows;"
        yield "    if (!m->is_wanted)"
        yield f"        m->mode = {Mode.SWITCHED_OFF:d};"
        yield "    /* sign test: only after all were 0 while ready, and not for ever; else to zero */"
        for k in range(1, len(self._model.outputs) + 1):
            yield f"    is_test = is_test || (m->test_nm_{k} != 0 && !({_is_none(k)}));"
        yield "    if (!is_test)"
        yield f"        m->test_left_ms = {milliseconds(longest_test_s(self._model))};"
        yield "    else"
        yield f"        m->mode = m->test_left_ms > 0 ? {Mode.TEST:d} : {Mode.SWITCHED_OFF:d};"
        yield "    if (!m->is_ready) {"
        yield f"        m->mode = {Mode.OFF:d};"
        yield "        m->test_left_ms = 0;"
        yield "    }"
        for k, output in enumerate(self._model.outputs, 1):
            yield from self._moved(k, output)
        yield "}"

    def _restarted(self) -> Iterator[str]:
        """Memory goes on, the correction begins at zero; start readings are kept or not, as the guard says."""
        guard, longest = self._model.guard, milliseconds(LONGEST_S)
        yield f"static void restarted({INT_NAME} *m)"
        yield "{"
        yield f"    int32_t off = (int32_t)limited(m->standstill_ms, 0, {longest});"
        for name, k in self._index.items():
            item = self.fixed.inputs[name].item
            yield f"    m->since_ms_{k} = (int32_t)limited((int64_t)m->since_ms_{k} + off, 0, {longest});"
            yield f"    m->good_ms_{k} = -1;"
            yield f"    m->is_new_{k} = 1;"
            if item.rate_limit_per_min is not None:
                yield f"    m->has_anchor_{k} = 0;"
            for flag in [f"has_memory_{k}"] + ([f"has_start_{k}"] if item.reference == "rise" else []):
                if guard.restart == "new-start":
                    yield f"    m->{flag} = 0;"
                elif guard.new_start_after_s is not None:
                    yield f"    m->{flag} = off > {milliseconds(guard.new_start_after_s)} ? 0 : m->{flag};"
        yield "    m->is_first = 1;"
        yield "    m->since_ms = m->held_ms = m->test_left_ms = 0;"
        yield f"    m->follows = {Mode.HOLD:d};"
        for k, output in enumerate(self._model.outputs, 1):
            yield from (f"    m->{name}_{k} = 0;" for name in ("aim", *_moving(output)))
            if output.position is not None:
                yield f"    m->slope_aim_{k} = 0;"
        yield "}"

    def _moved(self, k: int, output: Output) -> Iterator[str]:
        limits, part = self._limits[output.name], output.position
        clamp = nanometres(limits.clamp_um)
        yield f"    /* correction of {plain(output.name)}: no faster than the slew limit */"
        yield f"    if (m->mode == {Mode.OFF:d}) {{"
        yield from (f"        m->{name}_{k} = 0;" for name in _moving(output))
        yield "    } else {"
        if part is not None:
            axis = self._axes[part.axis]
            at = f"limited(m->at_{axis}, {position_um(part.valid_min_m)}, {position_um(part.valid_max_m)})"
            yield f"        int32_t where = (int32_t){at}, whole;"
            yield "        /* the correction moves with the axis, unless its position was lost */"
            yield f"        if (back_{axis})"
            yield f"            m->is_back_{k} = 1;"
            yield "        else"
            yield f"            m->correction_{k} = (int32_t)limited(m->correction_{k} + scaled((int64_t)m->slope_{k} *"
            yield f"                ((int64_t)where - m->where_{k})), -{clamp}, {clamp});"
            yield f"        m->where_{k} = where;"
        test = f"{_is_none(k)} ? 0 : (int32_t)limited(m->test_nm_{k}, -{clamp}, {clamp})"
        yield from self._towards(f"k0_{k}", f"aim_{k}", test, f"rest_{k}", limits.own_slew_um_per_s)
        if part is None:
            yield f"        m->correction_{k} = m->k0_{k};"
        else:
            slew = limits.slope_slew_um_per_m_s
            yield from self._towards(f"slope_{k}", f"slope_aim_{k}", "0", f"slope_rest_{k}", slew)
            yield f"        whole = (int32_t)limited(m->k0_{k} + scaled((int64_t)m->slope_{k} *"
            yield f"            ((int64_t)where - {position_um(part.reference_m)})), -{clamp}, {clamp});"
            yield f"        m->correction_{k} = !m->is_back_{k} ? whole : moved(m->correction_{k}, whole,"
            yield f"            {_slew_pm(limits.slew_um_per_s)}LL, slewed, &m->back_rest_{k});"
            yield f"        m->is_back_{k} = m->correction_{k} != whole;"
        yield "    }"

    @staticmethod
    def _towards(now: str, aim: str, test: str, rest: str, slew_um_per_s: float) -> Iterator[str]:
        yield f"        m->{now} = moved(m->{now}, m->mode == {Mode.SWITCHED_OFF:d} ? 0"
        yield f"            : m->mode != {Mode.TEST:d} ? m->{aim} : {test},"
        yield f"            {_slew_pm(slew_um_per_s)}LL, slewed, &m->{rest});"


def _is_none(k: int) -> str:
    """Nothing is commanded for the k-th output."""
    return f"m->test_nm_{k} == {MISSING} || m->test_nm_{k} == {LARGEST_INT32}"


def _moving(output: Output) -> tuple[str, ...]:
    """What is 0 while the axis is not ready."""
    own = ("correction", "k0", "rest")
    return own if output.position is None else (*own, "slope", "slope_rest", "is_back", "back_rest")


def _slew_pm(um: float) -> int:
    return min(max(1, round(Fraction(um) * _PM)), _LARGEST_SLEW_PM_PER_S)


def _places_m(part: PositionPart) -> tuple[float, ...]:
    return part.valid_min_m, part.valid_max_m, part.reference_m


def _check_limits(output: Output, limits: DecidedLimits) -> None:
    for what, value in (("clamp", limits.clamp_um), ("slope clamp", limits.slope_clamp_um_per_m)):
        if nanometres(value) > LARGEST_INT32:
            raise ExportRefusedError(
                f"{what} of {output.name}: {value:g} um",
                expected=f"at most {LARGEST_INT32 / 1000:.0f} um (or um/m): 32 bits of nm",
                where="fixed-point export, guard.limits",
                advice="decide on a smaller limit in guard.limits of the model file",
            )
    part = output.position
    if part is not None and max(abs(position_um(at)) for at in _places_m(part)) > 10**9:
        raise ExportRefusedError(
            f"positions of {output.name} reach beyond 1000 m",
            expected="positions in um that fit into 32 bits",
            where="fixed-point export, position",
            advice="correct the positions of the position-dependent part",
        )


def fixed_point_files(model: ModelFile, *, is_sign_verified: bool) -> dict[str, str]:
    """``thermal_correction_i.h`` and ``.c``."""
    if model.adaptation is not None:
        raise ExportRefusedError(
            "it cannot take touch-offs",
            expected="a model without adaptation",
            where="fixed-point export, adaptation",
            advice="use the double- or single-precision program, or export the model without its adaptation",
        )
    source = Source(model)
    head = [f" * {line}" for line in [*heading(model, is_sign_verified=is_sign_verified), *_about(model, source.fixed)]]
    return {
        f"{INT_NAME}.h": "\n".join(["/*", *head, " */", *source.header()]) + "\n",
        f"{INT_NAME}.c": "\n".join(["/*", *head, " */", *source.body()]) + "\n",
    }


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
    """The bound per output, and what of the guard the fixed-point program does not have."""
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
    left_out = list(_left_out(model))
    if left_out:
        found.append(
            FINDINGS.finding(
                "guard-reduced",
                f"The fixed-point program has a smaller guard than the model file asks for: {'; '.join(left_out)}.",
                evidence={"left_out": left_out},
                suggestion="use the double- or single-precision program where the processor has floating point",
            )
        )
    return tuple(found)


def _left_out(model: ModelFile) -> Iterator[str]:
    guard = model.guard
    if model.fallbacks and guard.on_fault == "fallback":
        yield f"no fallback models, with a bad sensor it does '{guard.without_fallback}'"
    if guard.stuck_after_s is not None:
        yield "a sensor that stands still is not found"


def _about(model: ModelFile, numbers: Fixed) -> Iterator[str]:
    yield "Whole numbers only. Times in ms, corrections in nm, slopes in nm/m, positions in um."
    for counted in numbers.inputs.values():
        item = counted.item
        yield plain(f"{item.name}: {counts_of(counted)}, valid {counted.low} ... {counted.high} counts")
    for (source, tau_s), tau_ms in numbers.taus_ms.items():
        yield plain(f"memory of {source} over {tau_s:g} s: {tau_ms} ms, resolution 2^-{FRACTION_BITS} counts")
    for name, bound in fixed_point_bound_um(model).items():
        own = fixed_point_bound_um(model, is_counted=True)[name]
        yield plain(f"Largest difference to the float64 model inside the valid ranges: {name} {_above(bound)} um,")
        yield f"  {_above(own)} um of it for readings that are whole counts."
    yield "No intermediate value passes 63 bits; proven for all readings when this file was written."
    for line in _left_out(model):
        yield plain(f"Left out: {line}.")


def _above(bound_um: float) -> str:
    return f"{math.ceil(bound_um * 1e5) / 1e5:.5f}"
