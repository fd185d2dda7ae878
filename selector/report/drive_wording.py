"""What a simulated feed drive did, in sentences: how far it was off, what that goes with, how round the circle was."""

from __future__ import annotations

import math

import numpy as np

from selector.figures.drive import Measures
from selector.physics.drive.axis import Axis
from selector.physics.drive.axis_summary import LoopSummary
from selector.physics.drive.error_parts import ErrorParts
from selector.physics.drive.frequency import LoopFigures
from selector.physics.drive.motion import Motion
from selector.report.numbers import NONE, number_text, span_text
from selector.report.tables import Table, table

MOST_POLES = 20
_LEAST_LAG_SHARE = 0.05
"""A lag that is this near to 1/Kp is said to come from the position gain."""

_WHAT = {
    "speed": "the speed",
    "acceleration": "the acceleration",
    "direction": "the direction of travel",
    "constant": "nothing: it is always there",
    "rest": "none of these",
}
_WHY = {
    "speed": "the position loop lags behind",
    "acceleration": "inertia, springs, and what the loop needs to accelerate",
    "direction": "dry friction and lost motion",
    "constant": "weight, offsets, pitch",
    "rest": "oscillation, reversals, limits, periodic errors, noise",
}


def off_sentence(name: str, motion: Motion, measures: Measures, run: str = "") -> str:
    """How far the table is off its command, most and on average, and when."""
    unit, times = measures.error
    error = motion.tracking_error_m * times
    worst = int(np.argmax(np.abs(error)))
    rms = float(np.sqrt(np.mean(error**2)))
    who = f"{name}" if name else "The table"
    where = f" of {run}" if run else ""
    return (
        f"{who} is off its command by up to {number_text(float(abs(error[worst])))} {unit}, "
        f"most after {span_text(float(motion.time_s[worst]))}{where}; {number_text(rms)} {unit} root mean square."
    )


def cause_sentence(parts: ErrorParts, axis: Axis, measures: Measures) -> str:
    """What most of the error goes with; in numbers that can be compared with the axis' settings."""
    unit, times = measures.error
    most, share = _share_of(parts, parts.largest)
    if parts.largest == "speed":
        text = f"{most} goes with the speed ({share}): the table follows {_ms(parts.lag_s)} behind."
        servo = axis.servo
        if servo is not None:
            expected = (1.0 - servo.velocity_feedforward) / servo.position_gain_per_s
            if expected > 0 and abs(parts.lag_s / expected - 1.0) < _LEAST_LAG_SHARE:
                text += f" That is the position gain of {number_text(servo.position_gain_per_s)} 1/s"
                text += (
                    ", without feed-forward."
                    if servo.velocity_feedforward == 0
                    else f" with {number_text(100 * servo.velocity_feedforward)} % of feed-forward."
                )
        return text
    if parts.largest == "acceleration":
        slope = number_text(parts.per_acceleration_s2 * times)
        return f"{most} goes with the acceleration ({share}): {slope} {unit} per {_per_acceleration(measures)}."
    if parts.largest == "direction":
        size = number_text(abs(parts.reversal_m) * times)
        return f"{most} changes with the direction of travel ({share}): ±{size} {unit}, friction and lost motion."
    if parts.largest == "constant":
        return f"{most} is always there ({share}): {number_text(parts.constant_m * times)} {unit}."
    return f"{most} goes with neither speed, acceleration nor direction ({share}); see its course."


def parts_table(parts: ErrorParts, measures: Measures) -> Table:
    """The parts of a tracking error with their sizes."""
    unit, times = measures.error
    sizes = {
        "speed": f"{_ms(parts.lag_s)} behind",
        "acceleration": f"{number_text(parts.per_acceleration_s2 * times)} {unit} per {_per_acceleration(measures)}",
        "direction": f"±{number_text(abs(parts.reversal_m) * times)} {unit}",
        "constant": f"{number_text(parts.constant_m * times)} {unit}",
        "rest": "",
    }
    rows = [
        (_WHAT[name], number_text(rms * times), sizes[name], _WHY[name])
        for name, rms in sorted(parts.rms_m.items(), key=lambda item: -item[1])
    ]
    note = (
        "A least-squares fit of the error on the commanded speed, its derivative, its sign and a constant. It tells "
        "what the error goes with; the last column names what usually makes such a part."
    )
    return table(["goes with", f">rms [{unit}]", "size", "usual reason"], rows, note)


def _share_of(parts: ErrorParts, name: str) -> tuple[str, str]:
    whole = sum(rms**2 for rms in parts.rms_m.values())
    share = parts.rms_m[name] ** 2 / whole if whole > 0 else 1.0
    return ("Most of it" if share >= 0.5 else "The largest part of it"), f"{100 * share:.0f} % of its square"


def _ms(seconds: float) -> str:
    return f"{number_text(1e3 * seconds)} ms"


def _per_acceleration(measures: Measures) -> str:
    return "m/s²" if measures.error[0] == "µm" else "rad/s²"


def loop_tables(loop: LoopSummary, axis: Axis) -> list[tuple[str, Table]]:
    """Bandwidth and margins, how far the gains may go, and the poles."""
    figures, found = loop.figures, loop.stability
    rows = [
        ("bandwidth (−3 dB)", number_text(figures.bandwidth_hz), "Hz"),
        ("highest amplitude", _peak(figures), "table / command"),
        ("gain margin", _margin(figures.gain_margin_db), "dB"),
        ("phase margin", _margin(figures.phase_margin_deg), "°"),
        ("slowest decay", number_text(found.margin_per_s), "1/s"),
    ]
    gains = [
        (
            name.removesuffix("_per_s").replace("_", " "),
            number_text(getattr(axis.servo, name), 4),
            NONE if low is None else number_text(low * getattr(axis.servo, name), 4),
            NONE if not high else number_text(high * getattr(axis.servo, name), 4),
            _times(high),
        )
        for name, high in found.gain_limits.items()
        for low in [found.gain_floors[name]]
    ]
    poles = [
        (number_text(pole.real, 4), number_text(abs(pole.imag) / (2.0 * math.pi), 4), number_text(_damping(pole)))
        for pole in found.poles[:MOST_POLES]
        if pole.imag >= 0
    ]
    return [
        ("Loop", table(["", ">value", "unit"], rows)),
        (
            "Gains",
            table(
                ["gain", ">is", ">unstable below", ">unstable above", ">room"],
                gains,
                "One gain is changed and the others stay.",
            ),
        ),
        (
            "Poles",
            table(
                [">real part [1/s]", ">frequency [Hz]", ">damping ratio"],
                poles,
                "The slowest first; a pole with a positive real part grows. Pairs are named once.",
            ),
        ),
    ]


def _peak(figures: LoopFigures) -> str:
    if not figures.peak_hz > 0:
        return "none above 1" if figures.peak_hz == 0 else NONE
    return f"{number_text(figures.peak)} at {number_text(figures.peak_hz)} Hz"


def _margin(value: float) -> str:
    return "no limit" if value == math.inf else number_text(value)


def _times(factor: float | None) -> str:
    if factor is None:
        return "no limit"
    return f"× {number_text(factor)}" if factor > 0 else "never stable"


def _damping(pole: complex) -> float:
    return -pole.real / abs(pole) if pole else 0.0
