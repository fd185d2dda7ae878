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
from selector.physics.drive.sticking import StickSlip
from selector.report.numbers import NONE, number_text, span_text
from selector.report.tables import Table, table

MOST_POLES = 20
_LEAST_LAG_SHARE = 0.05
"""A lag that is this near to 1/Kp is said to come from the position gain."""

_LEAST_SHARE = 1e-3

_WHAT = {
    "speed": "the speed",
    "acceleration": "the acceleration",
    "direction": "the direction of travel",
    "constant": "nothing: it is always there",
    "rest": "none of these",
    "speed+direction": "speed or direction of travel, not told apart",
    "direction+constant": "the direction of travel or nothing, not told apart",
    "speed+direction+constant": "speed, direction of travel or nothing, not told apart",
}
_WHY = {
    "speed": "the position loop lags behind",
    "acceleration": "inertia, springs, and what the loop needs to accelerate",
    "direction": "dry friction and lost motion",
    "constant": "weight, offsets, pitch",
    "rest": "oscillation, reversals, limits, periodic errors, noise",
    "speed+direction": "lag and dry friction: it moves at one speed only",
    "direction+constant": "dry friction, weight, offsets: it moves one way only",
    "speed+direction+constant": "lag, dry friction, weight, offsets: it moves one way and at one speed only",
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
    name, share = parts.largest, parts.share(parts.largest)
    most = "Most of it" if share >= 0.5 else "The largest part of it"
    part = f"{number_text(100 * share, 2)} % of the mean square"
    if name == "speed":
        return f"{most} goes with the speed ({part}): {_lag_sentence(parts, axis)}"
    if name == "acceleration" and parts.per_acceleration_s2 is not None:
        slope = number_text(parts.per_acceleration_s2 * times)
        return f"{most} goes with the acceleration ({part}): {slope} {unit} per {_per_acceleration(measures)}."
    if name == "direction" and parts.reversal_m is not None:
        size = number_text(abs(parts.reversal_m) * times)
        return f"{most} changes with the direction of travel ({part}): ±{size} {unit}, friction and lost motion."
    if name == "constant" and parts.constant_m is not None:
        return f"{most} is always there ({part}): {number_text(parts.constant_m * times)} {unit}."
    if name == "rest":
        return f"{most} goes with neither speed, acceleration nor direction ({part}); see its course."
    return f"{most} ({part}) may be {_WHY[name].replace(': it moves', '; it moves')}, which tells no more."


def stick_slip_sentence(found: StickSlip, name: str) -> str:
    """How often and how long a table sticks."""
    return (
        f"{name or 'The table'} sticks and slips: it stands or creeps for {number_text(100 * found.creeping_share, 2)} "
        f"% of the time that it is commanded to move, and jumps {found.jumps} times after it first broke loose."
    )


def parts_table(parts: ErrorParts, measures: Measures) -> Table:
    """The parts of a tracking error with their sizes."""
    unit, times = measures.error
    sizes = {
        "speed": parts.lag_s is not None and f"{_ms(parts.lag_s)} behind",
        "acceleration": parts.per_acceleration_s2 is not None
        and f"{number_text(parts.per_acceleration_s2 * times)} {unit} per {_per_acceleration(measures)}",
        "direction": parts.reversal_m is not None and f"±{number_text(abs(parts.reversal_m) * times)} {unit}",
        "constant": parts.constant_m is not None and f"{number_text(parts.constant_m * times)} {unit}",
    }
    rows = [
        (
            _WHAT[name],
            number_text(rms * times),
            _share_text(parts.share(name)),
            sizes.get(name) or "",
            _WHY[name],
        )
        for name, rms in parts.rms_m.items()
    ]
    note = (
        "A least-squares fit of the error on the commanded speed, its derivative, its sign and a constant. It tells "
        "what the error goes with; the last column names what usually makes such a part. Rms and share of the mean "
        "square are what a part adds to those above it, the one that explains most first, so that the shares make "
        "100 %. Sizes are those of the fit of all parts together."
    )
    return table(["goes with", f">rms [{unit}]", ">share", "size", "usual reason"], rows, note)


def _lag_sentence(parts: ErrorParts, axis: Axis) -> str:
    if parts.lag_s is None:
        return ""
    text = f"the table follows {_ms(parts.lag_s)} behind."
    servo = axis.servo
    if servo is None:
        return text
    expected = (1.0 - servo.velocity_feedforward) / servo.position_gain_per_s
    if expected > 0 and abs(parts.lag_s / expected - 1.0) < _LEAST_LAG_SHARE:
        ahead = servo.velocity_feedforward
        text += f" That is about what the position gain of {servo.position_gain_per_s:.4g} 1/s makes"
        text += f", {_ms(expected)}, without feed-forward." if ahead == 0 else ""
        text += f" with {number_text(100 * ahead)} % of feed-forward, {_ms(expected)}." if ahead else ""
    return text


def _share_text(share: float) -> str:
    return f"{number_text(100 * share, 2)} %" if share == 0 or share >= _LEAST_SHARE else "< 0.1 %"


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
