"""The text of a fixed-point C99 program that judges one sensor, as `SensorWatch` does."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from selector.controllers.guard.decided import (
    ANCHOR_S,
    CODE_SLACK,
    FORGIVEN_S,
    LEAST_GOOD_SAMPLES,
    LONGEST_S,
    RANGE_SLACK,
    SensorCode,
)
from selector.controllers.model_file import Guard
from selector.controllers.program.language import plain
from selector.controllers.writers.fixed_point_numbers import LARGEST_INT32, MS, ONE, Counted

INT_NAME = "thermal_correction_i"
MISSING = "(-2147483647 - 1)"
"""A reading or position that is not there: the smallest 32-bit number, in any C."""

_FASTEST = 2**33  # counts a minute; no two readings differ by more


def sensor_lines(counted: Counted, guard: Guard, k: int, taus_ms: Mapping[int, int]) -> Iterator[str]:
    """A function that judges the k-th reading and takes it over if it is good.

    `taus_ms` are the time constants of its memories, by the numbers of their levels.
    """
    item, ok = counted.item, int(SensorCode.OK)
    is_rise = item.reference == "rise"
    ages = [(f"since_ms_{k}", LONGEST_S, "m->since_ms")]
    if item.rate_limit_per_min is not None:
        ages.append((f"anchor_age_ms_{k}", FORGIVEN_S, _credit(ANCHOR_S)))
    yield f"/* sensor {plain(item.name)} */"
    yield f"static void sensor_{k}({INT_NAME} *m)"
    yield "{"
    yield f"    int64_t r = m->reading_{k}, x;"
    yield f"    int32_t code = {ok};"
    cleared = f"(!m->has_memory_{k}{f' || !m->has_start_{k}' if is_rise else ''}) && !m->is_new_{k}"
    yield f"    if ({cleared}) {{ /* somebody wants a new start */"
    yield f"        m->has_memory_{k} = 0;"
    yield f"        m->is_new_{k} = 1;"
    yield f"        m->good_ms_{k} = -1;"
    yield "    }"
    for age, longest_s, passed in ages:
        yield f"    m->{age} = (int32_t)limited((int64_t)m->{age} + {passed}, 0, {milliseconds(longest_s)});"
    yield f"    if (r == {MISSING} || r == {LARGEST_INT32})"
    yield f"        code = {SensorCode.MISSING:d};"
    for condition, code in _faults(counted, guard):
        yield f"    if (code == {ok} && {condition})"
        yield f"        code = {code:d};"
    if item.rate_limit_per_min is not None:
        yield from _jump(k, min(round(Fraction(item.rate_limit_per_min) * counted.per_unit), _FASTEST))
    yield f"    x = {f'm->has_start_{k} ? r - m->start_{k} : 0' if is_rise else 'r'};"
    slack = Fraction(RANGE_SLACK) * (counted.high - counted.low)
    outside = f"x < {math.ceil(counted.low - slack)} || x > {math.floor(counted.high + slack)}"
    if guard.outside_valid_range == "fault":
        yield f"    if (code == {ok} && ({outside}))"
        yield f"        code = {SensorCode.OUTSIDE_VALID_RANGE:d};"
    yield f"    if (code != {ok}) {{"
    yield f"        m->good_ms_{k} = -1;"
    yield "    } else {"
    yield from (f"        {line}" for line in _good(counted, guard, k, taus_ms))
    yield f"        if (m->good_ms_{k} < {milliseconds(guard.recover_after_s)}) {{"
    yield f"            code = {SensorCode.RECOVERING:d};"
    yield "        } else {"
    if is_rise:
        yield f"            m->has_start_{k} = 1;"
        yield f"            x = r - m->start_{k};"
    yield f"            if ({outside})"
    yield f"                code = {SensorCode.LIMITED:d};"
    yield f"            m->x_{k} = (int32_t)limited(x, {counted.low}, {counted.high});"
    for level, tau_ms in taus_ms.items():
        # what was put back after a restart may be anything
        kept = f"limited(m->level_{level}, {long_literal(counted.low * ONE)}, {long_literal(counted.high * ONE)})"
        target = f"(int64_t)m->x_{k} * {ONE}"
        yield f"            m->level_{level} = m->is_new_{k} && m->has_memory_{k}"
        yield f"                ? filled({kept}, {target}, m->since_ms_{k}, {tau_ms}LL)"
        yield f"                : followed({kept}, {target}, m->since_ms_{k}, {tau_ms}LL);"
    yield f"            m->has_memory_{k} = 1;"
    yield f"            m->is_new_{k} = 0;"
    yield f"            m->since_ms_{k} = 0;"
    yield "        }"
    yield "    }"
    yield f"    m->sensor_{k} = code;"
    yield "}"


def kept_lines(counted: Counted, k: int, levels: Sequence[int]) -> Iterator[str]:
    """Drops a start that is no reading, and memory with a level out of range."""
    item = counted.item
    if item.reference == "rise":
        ends = [
            round(Fraction(limit) * counted.per_unit) if limit is not None else sign * LARGEST_INT32
            for limit, sign in ((item.reading_min, -1), (item.reading_max, 1))
        ]
        low, high = max(ends[0], 1 - LARGEST_INT32), min(ends[1], LARGEST_INT32 - 1)
        yield f"if (m->start_{k} < {low} || m->start_{k} > {high})"
        yield f"    m->has_start_{k} = m->has_memory_{k} = 0;"
    for level in levels:
        low, high = counted.low * ONE, counted.high * ONE
        yield f"if (m->level_{level} < {long_literal(low)} || m->level_{level} > {long_literal(high)})"
        yield f"    m->has_memory_{k} = 0;"


def _good(counted: Counted, guard: Guard, k: int, taus_ms: Mapping[int, int]) -> Iterator[str]:
    """Counts for how long the reading has been good; the first good one is what a rise and memory begin with."""
    is_rise, width = counted.item.reference == "rise", counted.high - counted.low
    if is_rise:
        yield f"if (!m->has_start_{k} && (r - m->start_{k} > {width} || r - m->start_{k} < -{width}))"
        yield f"    m->good_ms_{k} = -1;"
    yield f"if (m->good_ms_{k} >= 0) {{"
    passed = _credit(guard.recover_after_s / LEAST_GOOD_SAMPLES)
    yield f"    m->good_ms_{k} = (int32_t)limited((int64_t)m->good_ms_{k} + {passed}, 0, {milliseconds(LONGEST_S)});"
    yield "} else {"
    yield f"    m->good_ms_{k} = 0;"
    yield f"    if (!m->has_memory_{k}) {{"
    if is_rise:
        yield f"        if (!m->has_start_{k})"
        yield f"            m->start_{k} = m->reading_{k};"
        yield f"        x = r - m->start_{k};"
    yield f"        m->x_{k} = (int32_t)limited(x, {counted.low}, {counted.high});"
    yield f"        m->since_ms_{k} = 0;"
    yield from (f"        m->level_{level} = (int64_t)m->x_{k} * {ONE};" for level in taus_ms)
    yield "    }"
    yield "}"


def _faults(counted: Counted, guard: Guard) -> Iterator[tuple[str, SensorCode]]:
    item, per_unit = counted.item, counted.per_unit
    for value in guard.break_codes if item.unit == "degC" else ():
        around = Fraction(CODE_SLACK) * abs(Fraction(value))
        # half a count more: the code itself is rounded, too
        low = math.ceil((Fraction(value) - around) * per_unit - Fraction(1, 2))
        high = math.floor((Fraction(value) + around) * per_unit + Fraction(1, 2))
        if low >= -LARGEST_INT32 and high <= LARGEST_INT32:
            yield f"r >= {low} && r <= {high}", SensorCode.BREAK_CODE
    for limit, sign, toward in ((item.reading_min, "<", math.ceil), (item.reading_max, ">", math.floor)):
        if limit is not None and abs(Fraction(limit) * per_unit) < LARGEST_INT32:
            yield f"r {sign} {toward(Fraction(limit) * per_unit)}", SensorCode.OUT_OF_LIMITS


def _jump(k: int, counts_per_min: int) -> Iterator[str]:
    """Against a reading of about a minute ago; a sensor that is new is judged against its newest reading."""
    yield f"    if (code == {SensorCode.OK:d} && !m->has_anchor_{k}) {{"
    yield f"        m->has_anchor_{k} = 1;"
    yield f"        m->anchor_{k} = m->reading_{k};"
    yield f"        m->anchor_age_ms_{k} = 0;"
    yield f"    }} else if (code == {SensorCode.OK:d}) {{"
    yield f"        int64_t age = limited(m->anchor_age_ms_{k}, {milliseconds(ANCHOR_S)}, {milliseconds(FORGIVEN_S)});"
    yield f"        int64_t allowed = {counts_per_min}LL * age / 60000;"
    yield f"        int64_t change = r - m->anchor_{k};"
    yield "        if (change > allowed || change < -allowed)"
    yield f"            code = {SensorCode.JUMP:d};"
    yield f"        if (code == {SensorCode.JUMP:d} ? m->is_new_{k} != 0"
    yield f"                : m->anchor_age_ms_{k} >= {milliseconds(ANCHOR_S)}) {{"
    yield f"            m->anchor_{k} = m->reading_{k};"
    yield f"            m->anchor_age_ms_{k} = 0;"
    yield "        }"
    yield "    }"


def _credit(most_s: float) -> str:
    """What one sample counts for; rounded up, so that six are enough."""
    return f"limited(m->since_ms, 0, {min(math.ceil(most_s * MS), LARGEST_INT32)})"


def milliseconds(seconds: float) -> int:
    """A time as a whole number of 32 bits."""
    return min(round(seconds * MS), LARGEST_INT32)


def nanometres(um: float) -> int:
    """A length as a whole number."""
    return round(Fraction(um) * 1000)


def long_literal(value: int) -> str:
    """A literal of 64 bits."""
    return f"({value}LL)" if value < 0 else f"{value}LL"
