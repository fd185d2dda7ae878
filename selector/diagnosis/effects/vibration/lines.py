"""Lines in the spectrum: of the turning spindle, of a source at a fixed frequency."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared, equally_likely
from selector.diagnosis.shapes.linear_response import LinearResponse, linear_responses, resonances_of, resonator
from selector.diagnosis.shapes.residual import unexplained
from selector.diagnosis.shapes.signals import course, no_vibration, of_a_drive, swept_hz
from selector.diagnosis.shapes.spectral_lines import (
    CHANCE,
    Line,
    aligned,
    course_of,
    fitted_parts,
    is_turning,
    lines,
    turns_of,
)
from selector.types import Vector

_ROLES = ("displacement", "acceleration", "velocity", "position", "voltage", "force", "current")
_ORDERS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
_CHANCE = 0.5  #: That noise shows a line at all; what is offered pays for the lines that were looked at.
_BESIDE_AN_ORDER = 3.0  #: Lines that are told apart within the width of one order.
_SIMULATED = -1.0
#: By which powers of the speed the line grows: of a force n², below the resonance; of run-out 0.
_POWERS = {"displacement": (2.0, 0.0), "position": (2.0, 0.0), "velocity": (3.0, 1.0), "acceleration": (4.0, 2.0)}


def _imbalance(comparison: Comparison, response: str) -> Iterator[Variant]:
    swept = swept_hz(comparison, response)
    speeds = [n for n in comparison.with_role("spindle_speed") if is_turning(comparison, n)]
    if swept is not None:
        yield from _of_a_curve(comparison, response, swept)
        return
    left = unexplained(comparison, response)
    for name in speeds:
        turns = turns_of(comparison, np.abs(course(comparison, name)))
        yield from equally_likely(
            _through_the_simulated_structure(comparison, response, name, left, turns),
            _of_lines(comparison, response, name, left, turns),
        )


def _of_lines(comparison: Comparison, response: str, name: str, left: Vector, turns: Vector) -> Iterator[Variant]:
    """Orders that stand out of what is left, as they are and behind resonances that the speed passes."""
    rpm = np.abs(course(comparison, name))
    relative = rpm / float(rpm.max())
    known: list[Line] = []
    for power in _POWERS.get(comparison.channel(response).role, (2.0, 0.0)):
        weight = relative**power
        for line in lines(comparison, left, turns, weight, near=_ORDERS, chance=_CHANCE):
            known.append(line)
            yield _order(comparison, name, line, course_of(line, comparison, turns, weight)[:, None], power)
    if not known:
        # order 1 without a proof of its own: a run-up through a resonance turns the phase, and no order stays coherent
        known = [_in_every_run(comparison)] if np.ptp(relative) >= 0.1 and np.any(left) else []
    yield from _through_resonances(comparison, name, known[:3], left, turns, relative)


def _order(
    comparison: Comparison, name: str, line: Line, columns: NDArray[np.float64], power: float | None, hz: float = 0.0
) -> Variant:
    order = min(_ORDERS, key=lambda o: abs(o - line.cycles))
    law = f"grows with speed^{power:g}" if power is not None else f"through the resonance at {hz:.4g} Hz"
    if hz == _SIMULATED:
        law = "through the simulated structure"
    names = tuple(
        f"order {order:g} of {name}, {law}{', a quarter turn on' if k else ''}" for k in range(columns.shape[1])
    )
    shape = {"order": Quantity(order, "1")}
    if power is not None:
        shape["speed_power"] = Quantity(power, "1")
    run = comparison.runs[line.runs[0]] if len(line.runs) == 1 and len(comparison.runs) > 1 else None
    return Variant(columns, names, shape, sources=(name,), run=run, looked_at=_looked_at(comparison, line))


def _looked_at(comparison: Comparison, line: Line) -> float:
    """Among how many lines this one was found: orders, runs, and a phase in every run that is fitted."""
    # that the force of imbalance turns with the shaft is as likely as all other orders together
    orders = _BESIDE_AN_ORDER * (2.0 if abs(line.cycles - 1.0) < 0.25 else 2.0 * (len(_ORDERS) - 1))
    runs = len(comparison.runs) if len(line.runs) == 1 else 1
    return _phases(comparison, line) * orders * runs


def _phases(comparison: Comparison, line: Line) -> float:
    """What a phase in every run that is fitted costs, as shapes that were looked at."""
    n_fitted = sum(part.start < part.stop for part in fitted_parts(comparison))
    return float(np.exp(min(len(line.runs), n_fitted)))


def _through_the_simulated_structure(
    comparison: Comparison, response: str, name: str, left: Vector, turns: Vector
) -> Iterator[Variant]:
    """The force n²·cos φ behind the identified structure: only its phase in every run is read off what is left."""
    rpm = np.abs(course(comparison, name))
    once = _in_every_run(comparison)
    for path in linear_responses(comparison, response):
        if path.source is not None and np.any(left):
            column, _ = _passed(comparison, path, once, left, turns, (rpm / float(rpm.max())) ** 2)
            if np.any(column):
                shape = _order(comparison, name, once, column[:, None], None, _SIMULATED)
                yield replace(shape, looked_at=_phases(comparison, once))


def _through_resonances(
    comparison: Comparison, name: str, found: list[Line], left: Vector, turns: Vector, relative: Vector
) -> Iterator[Variant]:
    """The force n²·cos φ behind resonances within the speeds that were run."""
    hz = np.abs(course(comparison, name)) / 60.0
    for line in found:
        low, high = (line.cycles * float(f(hz)) for f in (np.min, np.max))
        resonances = np.geomspace(max(low, 0.15 * high), 1.3 * high, 8) if high > 1.1 * low else ()
        ways = [(_resonance(f0, z, comparison.period_s), float(f0)) for f0 in resonances for z in (0.02, 0.08)]
        offered: list[Variant] = []
        for path, f0 in ways:
            column, chance = _passed(comparison, path, line, left, turns, relative**2)
            if np.any(column) and (line.strength > 0.0 or chance < CHANCE / len(ways)):
                offered.append(_order(comparison, name, line, column[:, None], None, f0))
        # those that showed nothing were looked at as well
        yield from (replace(one, looked_at=one.looked_at * len(ways) / len(offered)) for one in offered)


def _passed(
    comparison: Comparison, path: LinearResponse, line: Line, left: Vector, turns: Vector, weight: Vector
) -> tuple[Vector, float]:
    """A turning force behind a structure, in every run at the angle that this run shows; and the chance of noise."""
    at_rest = replace(line, phases=tuple(None if p is None else 0.0 for p in line.phases))
    late = replace(line, phases=tuple(None if p is None else -0.5 * np.pi for p in line.phases))
    cosine, sine = (path.passed(comparison, course_of(part, comparison, turns, weight)) for part in (at_rest, late))
    return aligned(comparison, left, cosine, sine, line, is_known=path.source is not None)


def _in_every_run(comparison: Comparison) -> Line:
    return Line(1.0, tuple(0.0 for _ in comparison.runs), 0.0)


def _resonance(frequency_hz: float, damping: float, period_s: float) -> LinearResponse:
    b, a = resonator(min(frequency_hz, 0.45 / period_s), damping, period_s)
    return LinearResponse(None, b[0], a, 1.0)


def _of_a_curve(comparison: Comparison, response: str, swept: Vector) -> Iterator[Variant]:
    """A force that grows with the square of the speed behind the structure that the simulated curve shows."""
    amplitude = comparison.simulated_course(response)
    relative = np.abs(swept) / float(np.abs(swept).max())
    shape = {"order": Quantity(1.0, "1"), "speed_power": Quantity(2.0, "1")}
    yield Variant((relative**2)[:, None], ("square of the speed",), shape)
    yield Variant((amplitude * relative**2)[:, None], ("simulated curve times the square of the speed",), shape)


def _imbalance_testable(comparison: Comparison, response: str) -> str | None:
    if not any(is_turning(comparison, n) for n in comparison.with_role("spindle_speed")):
        return "no turning spindle is recorded (role spindle_speed)"
    if swept_hz(comparison, response) is not None:
        return None
    return no_vibration(comparison, response, roles=_ROLES)


def _imbalance_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    shape = fitted.variant.shape
    order, power = shape["order"], shape.get("speed_power")
    text = f"{fitted.response} vibrates at {order.value:g} × spindle speed, up to {fitted.up_to}"
    if power is not None and power.value > 0.0:
        text += f", growing with speed^{power.value:g}"
    name = fitted.variant.sources[0] if fitted.variant.sources else None
    if name is not None:
        speed = course(comparison, name)
        if float(np.ptp(speed)) <= 0.01 * float(np.abs(speed).max(initial=0.0)):
            text += "; the speed was the same throughout, so a source at a fixed frequency would look the same"
    return Reading(text, {"order": order} | fitted.size | ({"speed_power": power} if power is not None else {}))


_ROLES = ("displacement", "acceleration", "velocity", "position", "voltage", "force", "current")
_FEWEST_CYCLES = 8.0
#: What a line pays at a resonance that the simulation has: there a structure rings by itself at every knock.
_RINGS = 25.0
_CHANCE = 0.5  #: That noise shows a line at all; what is offered pays for the frequencies that were looked at.


def _line(comparison: Comparison, response: str) -> Iterator[Variant]:
    if swept_hz(comparison, response) is not None:
        yield from _of_a_fixed_line(comparison, response)
        return
    time, even = comparison.time_s, np.ones(len(comparison.time_s))
    shortest = min(float(comparison.time_s[rows][-1]) for _, rows in comparison.rows_of_runs())
    lowest = max(_FEWEST_CYCLES / max(shortest, comparison.period_s), 0.5)
    n_fitted = sum(part.start < part.stop for part in fitted_parts(comparison))
    octaves = np.log(max(0.5 / comparison.period_s / lowest, math.e))
    found = lines(comparison, unexplained(comparison, response), time, even, lowest=lowest, chance=_CHANCE)
    own = resonances_of(comparison, response) if found else ()
    for line in found:
        # a frequency of many, as likely in one octave as in another
        looked = max(line.cycles * shortest * float(octaves), 1.0)
        shape = {"frequency_hz": Quantity(line.cycles, "Hz")}
        run = comparison.runs[line.runs[0]] if len(line.runs) == 1 and len(comparison.runs) > 1 else None
        aligned = course_of(line, comparison, time, even)
        words = (f"line at {line.cycles:.4g} Hz, phase of each run",)
        # a phase in every run that is fitted; noise between two of the frequencies counts like one run more
        looked_at = looked * float(np.exp(1.0 + min(len(line.runs), n_fitted)))
        looked_at *= len(comparison.runs) if run is not None else 1
        rings = _RINGS if any(abs(line.cycles - f0) < 2.0 * damping * f0 for f0, damping in own) else 1.0
        yield Variant(aligned[:, None], words, shape, run=run, looked_at=looked_at * rings)
        if len(line.runs) > 1:
            turn = 2.0 * np.pi * line.cycles * time
            columns = np.column_stack([np.cos(turn), np.sin(turn)])
            names = (f"cosine of {line.cycles:.4g} Hz from the start of each run", "sine of the same")
            yield Variant(columns, names, shape, looked_at=looked * math.e * rings)


def _of_a_fixed_line(comparison: Comparison, response: str) -> Iterator[Variant]:
    """Amplitudes of unrelated motions add by squares: a constant floor shows where the curve is low."""
    amplitude = np.abs(comparison.simulated_course(response))
    for share in (0.1, 0.3, 1.0):
        floor = share * float(np.median(amplitude))
        if floor > 0.0:
            added = np.sqrt(amplitude**2 + floor**2) - amplitude
            yield Variant(added[:, None], ("floor that adds by squares",), {"floor": Quantity(floor, "um")})


def _line_testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return None
    # what repeats in the residual of a feed repeats with its programme more often than by a source of its own
    return no_vibration(comparison, response, roles=_ROLES) or of_a_drive(comparison, response)


def _line_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    line = fitted.variant.shape.get("frequency_hz")
    if line is None:
        text = f"a constant vibration of about {fitted.up_to} lies under {fitted.response} at every step"
        return Reading(text, {"amplitude": fitted.size["largest"]})
    amplitude, error = float(np.hypot.reduce(fitted.coefficients)), 1.96 * float(np.max(fitted.standard_errors))
    size = Quantity(amplitude, fitted.unit, amplitude - error, amplitude + error)
    where = f" in run {fitted.variant.run}" if fitted.variant.run else ""
    text = f"{fitted.response} vibrates by ±{amplitude:.3g} {fitted.unit} at a fixed {line.value:.5g} Hz{where}"
    speeds = [comparison.filled(comparison.recorded[name]) for name in comparison.with_role("spindle_speed")]
    if not any(float(np.ptp(speed)) > 0.01 * float(np.abs(speed).max(initial=0.0)) for speed in speeds):
        text += "; the spindle speed does not change, so a source on the spindle would look the same"
    return Reading(text, {"frequency_hz": line, "amplitude": size})


EFFECTS = (
    declared("vibration.imbalance", _imbalance, _imbalance_testable, _imbalance_reading),
    declared("vibration.line", _line, _line_testable, _line_reading),
)
