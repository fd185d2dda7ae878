"""The text of a fixed-point C99 program: sensors, memory, model, slew, all in whole numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

from selector.controllers.guard.codes import ANCHOR_S, FORGIVEN_S, LONGEST_S, LONGEST_STEP_S, SAMPLE_S, Mode, SensorCode
from selector.controllers.guard.decided import DecidedLimits, decided_limits
from selector.controllers.model_file import ModelFile, Output, PositionPart
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.program.text_of_program import plain
from selector.controllers.sensor_check import CODE_SLACK, RANGE_SLACK
from selector.controllers.writers.fixed_point_numbers import (
    FRACTION_BITS,
    LARGEST_INT32,
    MS,
    ONE,
    STATE_STEPS,
    Counted,
    Normalised,
    Polynomial,
    counts_of,
    fixed,
    position_um,
)
from selector.controllers.writers.fixed_point_tools import TOOLS
from selector.controllers.writers.refused import ExportRefusedError

NAME = "thermal_correction_i"
MISSING = "(-2147483647 - 1)"
"""A reading or position that is not there: the smallest 32-bit number, in any C."""

_LARGEST_SLEW_PM_PER_S = 10**14
_FASTEST = 2**33  # counts a minute; no two readings differ by more
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
        lines = [f"#ifndef {NAME.upper()}_H", f"#define {NAME.upper()}_H", "", "#include <stdint.h>", ""]
        lines.append(f"typedef struct {NAME} {{")
        for title, members in self._members().items():
            lines.append(f"    /* {title} */")
            lines += [
                f"    {kind} {name};" + (f" /* {plain(about)} */" if about else "") for kind, name, _, about in members
            ]
        lines += [f"}} {NAME};", "", "/* Once, before the first call. */", f"void {NAME}_init({NAME} *m);"]
        lines += ["/* Every cycle, after the inputs are set. */", f"void {NAME}_step({NAME} *m);", "", "#endif"]
        return lines

    def body(self) -> list[str]:
        """Lines of the source file."""
        lines = [f"void {NAME}_init({NAME} *m)", "{"]
        lines += [f"    m->{name} = {initial};" for of in self._members().values() for _, name, initial, _ in of]
        lines += ["}", ""]
        for item in self._model.inputs:
            lines += [*self._sensor(self.fixed.inputs[item.name]), ""]
        lines += [*self._aimed(), "", *self._stepped()]
        text = "\n".join(lines)
        # a static function that nobody calls is a warning
        tools = [tool for name, tool in TOOLS.items() if f"{name}(" in text]
        return [f'#include "{NAME}.h"', "", *tools, *lines]

    def _members(self) -> dict[str, list[tuple[str, str, str, str]]]:
        """Title → (type, name, initial value, what it is)."""
        n, w = "int32_t", "int64_t"
        inputs = [(n, "dt_ms", "0", "time since the last call [ms]; the sum must be the true time")]
        outputs, kept, retained = [], [], []
        for name, k in self._index.items():
            counted = self.fixed.inputs[name]
            inputs.append((n, f"reading_{k}", MISSING, f"{name}: {counts_of(counted)}; smallest number = missing"))
            retained.append((n, f"has_memory_{k}", "0", ""))
            kept += [(n, f"x_{k}", "0", ""), (n, f"since_ms_{k}", "0", "")]
            kept.append((n, f"good_ms_{k}", str(_ms(self._model.guard.recover_after_s)), ""))
            if counted.item.reference == "rise":
                retained.append((n, f"start_{k}", "0", f"start reading of {name} [counts]"))
                retained.append((n, f"has_start_{k}", "0", ""))
            if counted.item.rate_limit_per_min is not None:
                kept += [(n, f"{of}_{k}", "0", "") for of in ("anchor", "has_anchor", "anchor_age_ms")]
        for axis, k in self._axes.items():
            reference = str(position_um(self._parts[axis].reference_m))
            inputs.append((n, f"position_{k}", reference, f"position of axis {axis} [um]"))
            kept.append((n, f"at_{k}", reference, ""))
        inputs += [(n, "is_ready", "1", "drives on, axis referenced"), (n, "is_wanted", "1", "the operator's switch")]
        for k, output in enumerate(self._model.outputs, 1):
            outputs.append((n, f"correction_{k}", "0", f"to be added to the axis for {output.name} [nm]"))
            outputs.append((n, f"k0_{k}", "0", "the same at the reference position [nm]"))
            kept += [(n, f"aim_{k}", "0", ""), (n, f"rest_{k}", "0", "")]
            if output.position is not None:
                outputs.append((n, f"slope_{k}", "0", "and its slope [nm/m]"))
                kept += [(n, f"slope_aim_{k}", "0", ""), (n, f"slope_rest_{k}", "0", "")]
        outputs.append((n, "mode", "0", "0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off"))
        outputs += [
            (n, f"sensor_{k}", str(int(SensorCode.MISSING)), f"{name}: 0 ok, 1 limited, 2 recovering, 3 missing, "
             "4 break code, 5 out of limits, 6 jump, 8 range" if k == 1 else name)
            for name, k in self._index.items()
        ]  # fmt: skip
        retained += [
            (w, f"level_{k}", "0", f"memory of {source} over {tau:g} s, 2^-{FRACTION_BITS} counts")
            for (source, tau), k in self._levels.items()
        ]
        kept += [(n, "is_first", "1", ""), (n, "since_ms", "0", ""), (n, "held_ms", "0", "")]
        kept.append((n, "follows", str(int(Mode.HOLD)), ""))
        titles = ("inputs", "outputs", "to be kept when the control is off", "state")
        return dict(zip(titles, (inputs, outputs, retained, kept), strict=True))

    def _sensor(self, counted: Counted) -> Iterator[str]:
        """A function that judges one reading and takes it over if it is good."""
        item, guard, k = counted.item, self._model.guard, self._index[counted.item.name]
        ages = [(f"since_ms_{k}", LONGEST_S)]
        if item.rate_limit_per_min is not None:
            ages.append((f"anchor_age_ms_{k}", FORGIVEN_S))
        yield f"/* sensor {plain(item.name)} */"
        yield f"static void sensor_{k}({NAME} *m)"
        yield "{"
        yield f"    int64_t r = m->reading_{k}, x;"
        yield f"    int32_t code = {SensorCode.OK:d};"
        for age, longest_s in ages:
            yield f"    m->{age} = (int32_t)limited((int64_t)m->{age} + m->since_ms, 0, {_ms(longest_s)});"
        yield f"    if (r == {MISSING} || r == {LARGEST_INT32})"
        yield f"        code = {SensorCode.MISSING:d};"
        for condition, code in self._faults(counted):
            yield f"    if (code == {SensorCode.OK:d} && {condition})"
            yield f"        code = {code:d};"
        if item.rate_limit_per_min is not None:
            yield from _jump(k, min(round(Fraction(item.rate_limit_per_min) * counted.per_unit), _FASTEST))
        fresh = f"m->has_start_{k} ? r - m->start_{k} : 0" if item.reference == "rise" else "r"
        yield f"    x = {fresh};"
        slack = Fraction(RANGE_SLACK) * (counted.high - counted.low)
        outside = f"x < {math.ceil(counted.low - slack)} || x > {math.floor(counted.high + slack)}"
        if guard.outside_valid_range == "fault":
            yield f"    if (code == {SensorCode.OK:d} && ({outside}))"
            yield f"        code = {SensorCode.OUTSIDE_VALID_RANGE:d};"
        yield f"    m->good_ms_{k} = code != {SensorCode.OK:d} ? 0 :"
        yield f"        (int32_t)limited((int64_t)m->good_ms_{k} + m->since_ms, 0, {_ms(LONGEST_S)});"
        yield f"    if (code == {SensorCode.OK:d} && m->good_ms_{k} < {_ms(guard.recover_after_s)})"
        yield f"        code = {SensorCode.RECOVERING:d};"
        yield f"    if (code == {SensorCode.OK:d}) {{"
        if item.reference == "rise":
            yield f"        if (!m->has_start_{k}) {{"
            yield f"            m->start_{k} = m->reading_{k};"
            yield f"            m->has_start_{k} = 1;"
            yield "            x = 0;"
            yield "        }"
        yield f"        if ({outside})"
        yield f"            code = {SensorCode.LIMITED:d};"
        yield f"        m->x_{k} = (int32_t)limited(x, {counted.low}, {counted.high});"
        for (source, tau_s), level in self._levels.items():
            if source == item.name:
                tau, target = self.fixed.taus_ms[source, tau_s], f"(int64_t)m->x_{k} * {ONE}"
                yield f"        m->level_{level} = !m->has_memory_{k} ? {target}"
                # what was put back after a restart may be anything
                kept = f"limited(m->level_{level}, {_long(counted.low * ONE)}, {_long(counted.high * ONE)})"
                yield f"            : followed({kept}, {target}, m->since_ms_{k}, {tau}LL);"
        yield f"        m->has_memory_{k} = 1;"
        yield f"        m->since_ms_{k} = 0;"
        yield "    }"
        yield f"    m->sensor_{k} = code;"
        yield "}"

    def _faults(self, counted: Counted) -> Iterator[tuple[str, SensorCode]]:
        item, per_unit = counted.item, counted.per_unit
        for value in self._model.guard.break_codes if item.unit == "degC" else ():
            around = Fraction(CODE_SLACK) * abs(Fraction(value))
            # half a count more: the code itself is rounded, too
            low = math.ceil((Fraction(value) - around) * per_unit - Fraction(1, 2))
            high = math.floor((Fraction(value) + around) * per_unit + Fraction(1, 2))
            if low >= -LARGEST_INT32 and high <= LARGEST_INT32:
                yield f"r >= {low} && r <= {high}", SensorCode.BREAK_CODE
        for limit, sign, toward in ((item.reading_min, "<", math.ceil), (item.reading_max, ">", math.floor)):
            if limit is not None and abs(Fraction(limit) * per_unit) < LARGEST_INT32:
                yield f"r {sign} {toward(Fraction(limit) * per_unit)}", SensorCode.OUT_OF_LIMITS

    def _aimed(self) -> Iterator[str]:
        yield "/* the model */"
        yield f"static void aimed({NAME} *m)"
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
            clamp, band = _nm(limits.clamp_um), _nm(limits.dead_band_um)
            yield f"    /* displacement {plain(output.name)} */"
            yield from self._sum(self.fixed.own[output.name])
            yield f"    own = limited(-own, -{clamp}, {clamp});"
            if band > 0:
                yield f"    change = own - m->aim_{k};"
                yield f"    if (change >= {band} || change <= -{band})"
            yield f"    {'    ' if band > 0 else ''}m->aim_{k} = (int32_t)own;"
            if output.position is not None:
                most = _nm(limits.slope_clamp_um_per_m)
                yield from self._sum(self.fixed.slopes[output.name])
                reach_um = position_um(limits.reach_m)
                if reach_um > 0:
                    # the straight line keeps the clamp at the far end of the axis, too
                    yield f"    change = m->aim_{k} < 0 ? -(int64_t)m->aim_{k} : m->aim_{k};"
                    yield f"    change = limited(({clamp} - change) * 1000000 / {reach_um}, 0, {most});"
                    yield f"    m->slope_aim_{k} = (int32_t)limited(-own, -change, change);"
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
        return f"shifted({x} * {_long(v.gain)} + {_long(v.offset)}, {v.shift})"

    def _is_used(self, name: str) -> bool:
        polynomials = (*self.fixed.own.values(), *self.fixed.slopes.values())
        return any(name in factors for p in polynomials for _, factors in p.terms)

    def _sum(self, of: Polynomial) -> Iterator[str]:
        yield f"    sum = {_long(of.constant)};"
        for coefficient, factors in of.terms:
            product = self._v[factors[0]]
            if len(factors) > 1:
                yield f"    p = {product};"
                yield from (f"    p = shifted(p * {self._v[name]}, {FRACTION_BITS});" for name in factors[1:])
                product = "p"
            yield f"    sum += {_long(coefficient)} * {product};"
        yield f"    own = shifted(sum, {of.shift});"

    def _stepped(self) -> Iterator[str]:
        guard = self._model.guard
        on_fault = guard.without_fallback if guard.on_fault == "fallback" else guard.on_fault
        believed = " && ".join(f"m->sensor_{k} <= {SensorCode.LIMITED:d}" for k in self._index.values())
        yield f"void {NAME}_step({NAME} *m)"
        yield "{"
        yield f"    int32_t dt = (int32_t)limited(m->dt_ms, 0, {_ms(LONGEST_S)});"
        yield f"    int32_t slewed = (int32_t)limited(dt, 0, {_ms(LONGEST_STEP_S)});"
        for k in self._axes.values():
            yield f"    if (m->position_{k} != {MISSING})"
            yield f"        m->at_{k} = m->position_{k};"
        yield f"    m->since_ms = (int32_t)limited((int64_t)m->since_ms + dt, 0, {_ms(LONGEST_S)});"
        yield f"    if (m->is_first || m->since_ms >= {_ms(SAMPLE_S)}) {{"
        yield from (f"        sensor_{k}(m);" for k in self._index.values())
        yield f"        m->follows = {believed}"
        yield f"            ? {Mode.MODEL:d} : {Mode.RAMP_TO_ZERO if on_fault == 'ramp-to-zero' else Mode.HOLD:d};"
        if on_fault == "hold" and guard.hold_at_most_s is not None:
            yield f"        m->held_ms = m->follows == {Mode.MODEL:d} ? 0 :"
            yield f"            (int32_t)limited((int64_t)m->held_ms + m->since_ms, 0, {_ms(LONGEST_S)});"
            yield f"        if (m->held_ms > {_ms(guard.hold_at_most_s)})"
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
        yield "    if (!m->is_ready)"
        yield f"        m->mode = {Mode.OFF:d};"
        for k, output in enumerate(self._model.outputs, 1):
            yield from self._moved(k, output)
        yield "}"

    def _moved(self, k: int, output: Output) -> Iterator[str]:
        limits = self._limits[output.name]
        moving = [("k0", "aim", "rest", limits.own_slew_um_per_s)]
        if output.position is not None:
            moving.append(("slope", "slope_aim", "slope_rest", limits.slope_slew_um_per_m_s))
        yield f"    /* correction of {plain(output.name)}: no faster than the slew limit */"
        for now, aim, rest, slew_um in moving:
            slew = min(max(1, round(Fraction(slew_um) * _PM)), _LARGEST_SLEW_PM_PER_S)
            yield f"    m->{now}_{k} = m->mode == {Mode.OFF:d} ? 0 : moved(m->{now}_{k},"
            yield f"        m->mode == {Mode.SWITCHED_OFF:d} ? 0 : m->{aim}_{k}, {slew}LL, slewed, &m->{rest}_{k});"
        part = output.position
        if part is None:
            yield f"    m->correction_{k} = m->k0_{k};"
            return
        clamp, reference = _nm(limits.clamp_um), position_um(part.reference_m)
        low, high = position_um(part.valid_min_m), position_um(part.valid_max_m)
        yield f"    m->correction_{k} = m->mode == {Mode.OFF:d} ? 0 : (int32_t)limited("
        yield f"        m->k0_{k} + scaled(m->slope_{k} *"
        yield f"        (limited(m->at_{self._axes[part.axis]}, {low}, {high}) - {reference})), -{clamp}, {clamp});"


def _jump(k: int, counts_per_min: int) -> Iterator[str]:
    """As `SensorWatch`: against a reading of about a minute ago."""
    yield f"    if (code == {SensorCode.OK:d} && !m->has_anchor_{k}) {{"
    yield f"        m->has_anchor_{k} = 1;"
    yield f"        m->anchor_{k} = m->reading_{k};"
    yield f"        m->anchor_age_ms_{k} = 0;"
    yield f"    }} else if (code == {SensorCode.OK:d}) {{"
    yield f"        int64_t age = limited(m->anchor_age_ms_{k}, {_ms(ANCHOR_S)}, {_ms(FORGIVEN_S)});"
    yield f"        int64_t allowed = {counts_per_min}LL * age / 60000;"
    yield f"        int64_t change = r - m->anchor_{k};"
    yield "        if (change > allowed || change < -allowed) {"
    yield f"            code = {SensorCode.JUMP:d};"
    yield f"        }} else if (m->anchor_age_ms_{k} >= {_ms(ANCHOR_S)}) {{"
    yield f"            m->anchor_{k} = m->reading_{k};"
    yield f"            m->anchor_age_ms_{k} = 0;"
    yield "        }"
    yield "    }"


def _ms(seconds: float) -> int:
    return min(round(seconds * MS), LARGEST_INT32)


def _nm(um: float) -> int:
    return round(Fraction(um) * 1000)


def _long(value: int) -> str:
    return f"({value}LL)" if value < 0 else f"{value}LL"


def _places_m(part: PositionPart) -> tuple[float, ...]:
    return part.valid_min_m, part.valid_max_m, part.reference_m


def _check_limits(output: Output, limits: DecidedLimits) -> None:
    for what, value in (("clamp", limits.clamp_um), ("slope clamp", limits.slope_clamp_um_per_m)):
        if _nm(value) > LARGEST_INT32:
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
