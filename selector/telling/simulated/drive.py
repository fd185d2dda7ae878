"""What is told of a simulated feed drive: how far it was off, what that goes with, its loop, how round it goes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from selector.json_text import fields_of
from selector.number_text import number_text
from selector.physics.drive.drive_model import DriveModel
from selector.physics.drive.drive_summary import (
    LINEAR,
    ROTARY,
    AxisSummary,
    DriveSummary,
    ErrorParts,
    LoopSummary,
    Measures,
)
from selector.physics.drive.loop.stability import LoopFigures
from selector.physics.drive.parts.axis import Axis, Friction, Servo
from selector.physics.drive.trajectory import Motion
from selector.physics.model_text import plain_values
from selector.telling.account import Account, Block, Captioned, Heading, Note, Table, section, table
from selector.telling.numbers import NONE, ms_text, span_text
from selector.telling.simulated.ball_bar import ball_bar_data, ball_bar_sentences, ball_bar_tables
from selector.telling.simulated.result import SAID, Drawings, SimulationResult, is_said, simulation_account

_MICRO = 1e6
MOST_RUNS = 4
MOST_ROWS = 12
MOST_POLES = 20
_LEAST_LAG_SHARE = 0.05  #: A lag that is this near to 1/Kp is said to come from the position gain.
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
_DEFAULTS = {field.name: field.default for kind in (Friction, Servo) for field in fields(kind)}


@dataclass(frozen=True)
class AxisInRun:
    """An axis in one run."""

    run: str
    name: str
    axis: Axis
    motion: Motion
    summary: AxisSummary
    measures: Measures  #: Units in which it is read


def drive_account(result: SimulationResult, drawings: Drawings) -> Account:
    """What is told of a simulated feed drive: how far it was off and why, what varied, its loop, how round it goes."""
    done, model, summary = result.simulated.details, result.simulated.model, result.summary
    axes = axes_in_runs(result)
    circles = bool(summary.quantities)
    # circles are drawn as circles
    runs = () if circles else tuple(done.axes)[:MOST_RUNS]
    several = len(done.axes) > 1
    courses: list[Block] = [] if circles else [Captioned("Tracking error", errors_table(axes))]
    for run in runs:
        own = [one for one in axes if one.run == run]
        courses += [Heading(f"Run {run}" if several else "How it moves"), *drawings.get(f"run {run}", ())]
        if len(own) == 1:
            parts = parts_table(own[0].summary.parts, own[0].measures)
            courses.append(Captioned("What the error goes with", parts, on_screen=not several))
    if runs and len(done.axes) > len(runs):
        courses.append(Note(f"{len(done.axes) - len(runs)} more runs were simulated; they are in their files."))
    loops: list[Block] = []
    for name, loop in summary.loops.items():
        axis = next(one.axis for one in axes if one.name == name)
        of = f" of {name}" if len(summary.loops) > 1 else ""
        loops += drawings.get(f"loop {name}", ())
        loops += [Captioned(f"{caption}{of}", one, caption != "Poles") for caption, one in loop_tables(loop, axis)]
    first_run = list(done.axes.items())[:1]
    return simulation_account(
        result,
        ball_bar_sentences(summary) if circles else _sentences(axes, summary, several),
        (
            section("ball-bar", "Ball-bar", *drawings.get("ball-bar", ()), *ball_bar_tables(summary))
            if circles
            else None,
            section("runs", "", *courses, link="Courses"),
            section("loop", "Control loop", *loops),
        ),
        drawings=drawings,
        facts={
            "step of the calculation [s]": {
                f"{run}, {name}" if several else name: one.step_s
                for run, moved in first_run
                for name, one in moved.items()
            }
        },
        data=_data(model, summary),
        parameters=tuple(_parameters(model)),
    )


def axes_in_runs(result: SimulationResult) -> list[AxisInRun]:
    """Every axis in every run, as it was recorded."""
    model, summary = result.simulated.model, result.summary
    return [
        AxisInRun(run, name, one.axis, one.motion, summary.axes[run][name], ROTARY if turns else LINEAR)
        for run, moved in result.simulated.details.axes.items()
        for name, one in ((name, one.recorded) for name, one in moved.items())
        for turns in [model.file_axes[name].rotary]
    ]


def _sentences(axes: Sequence[AxisInRun], summary: DriveSummary, several: bool) -> list[str]:
    """What matters most, and what it comes from."""
    one = max(axes, key=lambda axis: axis.summary.max_m)
    name = one.name if len({axis.name for axis in axes}) > 1 else ""
    more = [cause_sentence(one.summary.parts, one.axis, one.measures)]
    if one.summary.limited_share > 0:
        share = number_text(100 * one.summary.limited_share, 2)
        more.append(f"A limit of current or speed was reached {share} % of the time.")
    slips = one.summary.stick_slip
    if slips is not None:
        creeping = f"it stands or creeps for {number_text(100 * slips.creeping_share, 2)} % of the time"
        jumping = f"and jumps {slips.jumps} times after it first broke loose"
        more.insert(0, f"{name or 'The table'} sticks and slips: {creeping} that it is commanded to move, {jumping}.")
    unstable = [name for name, loop in summary.loops.items() if not loop.stability.stable]
    if unstable:
        more.insert(0, f"The control loop of {', '.join(unstable)} is unstable.")
    return [off_sentence(name, one.motion, one.measures, one.run if several else ""), *more]


def errors_table(axes: Sequence[AxisInRun]) -> Table:
    """How far every axis was off in every run; of many runs the worst of each axis."""
    shown, note = list(axes), ""
    if len(shown) > MOST_ROWS:
        worst: dict[str, AxisInRun] = {}
        for one in shown:
            if one.name not in worst or one.summary.max_m > worst[one.name].summary.max_m:
                worst[one.name] = one
        shown, note = list(worst.values()), "The worst run of each axis."
    rows = []
    for one in shown:
        (unit, times), parts, limited = one.measures.error, one.summary.parts, one.summary.limited_share
        cause = f"{_WHAT[parts.largest]} ({_share_text(parts.share(parts.largest))})"
        errors = (one.summary.max_m * times, one.summary.rms_m * times)
        rows.append((one.run, one.name, *errors, unit, cause, _share_text(limited) if limited else None))
    return table(["run", "axis", ">largest", ">rms", "unit", "goes with", ">at limits"], rows, note)


def _parameters(model: DriveModel) -> list[tuple[str, float, str, str]]:
    """(name, value, unit, where it is from) of every number of the axes."""
    values = plain_values(model.file)
    found = []
    for name, one in model.parameters.items():
        parts = name.split(".")
        said = SAID if is_said(values, parts) else _otherwise(values, parts, one.value)
        found.append((name, one.value, one.unit, said))
    return found


def _otherwise(values: Mapping[str, Any], path: list[str], value: float) -> str:
    section = values.get("axes", {}).get(path[1], {}) if len(path) > 1 else {}
    parts = section.get("parts") if isinstance(section, Mapping) else None
    like = parts if isinstance(parts, str) else parts.get("like") if isinstance(parts, Mapping) else None
    if "parts" in path:
        return f"catalogue values of {like}" if like else "left out: off"
    return (
        "from the parts" if parts is not None and value not in (0.0, _DEFAULTS.get(path[-1])) else "left out: default"
    )


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


def parts_table(parts: ErrorParts, measures: Measures) -> Table:
    """The parts of a tracking error with their sizes."""
    unit, times = measures.error
    sizes = {
        "speed": parts.lag_s is not None and f"{ms_text(parts.lag_s)} behind",
        "acceleration": parts.per_acceleration_s2 is not None
        and f"{number_text(parts.per_acceleration_s2 * times)} {unit} per {_per_acceleration(measures)}",
        "direction": parts.reversal_m is not None and f"±{number_text(abs(parts.reversal_m) * times)} {unit}",
        "constant": parts.constant_m is not None and f"{number_text(parts.constant_m * times)} {unit}",
    }
    rows = [
        (_WHAT[name], rms * times, _share_text(parts.share(name)), sizes.get(name) or "", _WHY[name])
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
    text = f"the table follows {ms_text(parts.lag_s)} behind."
    servo = axis.servo
    if servo is None:
        return text
    expected = (1.0 - servo.velocity_feedforward) / servo.position_gain_per_s
    if expected > 0 and abs(parts.lag_s / expected - 1.0) < _LEAST_LAG_SHARE:
        ahead = servo.velocity_feedforward
        text += f" That is about what the position gain of {servo.position_gain_per_s:.4g} 1/s makes"
        text += f", {ms_text(expected)}, without feed-forward." if ahead == 0 else ""
        text += f" with {number_text(100 * ahead)} % of feed-forward, {ms_text(expected)}." if ahead else ""
    return text


def _share_text(share: float) -> str:
    return f"{number_text(100 * share, 2)} %" if share == 0 or share >= _LEAST_SHARE else "< 0.1 %"


def _per_acceleration(measures: Measures) -> str:
    return "m/s²" if measures.error[0] == "µm" else "rad/s²"


def loop_tables(loop: LoopSummary, axis: Axis) -> list[tuple[str, Table]]:
    """Bandwidth and margins, how far the gains may go, and the poles."""
    figures, found = loop.figures, loop.stability
    rows: list[tuple[str | float, ...]] = [
        ("bandwidth (−3 dB)", figures.bandwidth_hz, "Hz"),
        ("highest amplitude", _peak(figures), "table / command"),
        ("gain margin", _margin(figures.gain_margin_db), "dB"),
        ("phase margin", _margin(figures.phase_margin_deg), "°"),
        ("slowest decay", found.margin_per_s, "1/s"),
    ]
    gains = []
    for name, high in found.gain_limits.items():
        low, gain = found.gain_floors[name], getattr(axis.servo, name)
        ends = (None if low is None else low * gain, high * gain if high else None)
        values = [number_text(value, 4) for value in (gain, *ends)]
        gains.append((name.removesuffix("_per_s").replace("_", " "), *values, _times(high)))
    poles = []
    for pole in (one for one in found.poles[:MOST_POLES] if one.imag >= 0):
        place = [number_text(value, 4) for value in (pole.real, abs(pole.imag) / (2.0 * math.pi))]
        poles.append((*place, -pole.real / abs(pole) if pole else 0.0))
    heads = ["gain", ">is", ">unstable below", ">unstable above", ">room"]
    note = "The slowest first; a pole with a positive real part grows. Pairs are named once."
    return [
        ("Loop", table(["", ">value", "unit"], rows)),
        ("Gains", table(heads, gains, "One gain is changed and the others stay.")),
        ("Poles", table([">real part [1/s]", ">frequency [Hz]", ">damping ratio"], poles, note)),
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


def _data(model: DriveModel, summary: DriveSummary) -> dict[str, Any]:
    """`drive` of `selector.simulation/1`."""
    names = list(dict.fromkeys(name for axes in summary.axes.values() for name in axes))
    return {
        "axes": [
            {
                "axis": name,
                "unit": "urad" if model.file_axes[name].rotary else "um",
                "runs": [{"run": run, **_axis_data(axes[name])} for run, axes in summary.axes.items() if name in axes],
                "loop": _loop_data(summary.loops.get(name)),
            }
            for name in names
        ],
        "ball_bar": ball_bar_data(summary),
    }


def _axis_data(one: AxisSummary) -> dict[str, Any]:
    return {
        "rms": one.rms_m * _MICRO,
        "max": one.max_m * _MICRO,
        "max_at_s": one.max_at_s,
        "parts_rms": {name: rms * _MICRO for name, rms in one.parts.rms_m.items()},
        "lag_ms": None if one.parts.lag_s is None else one.parts.lag_s * 1e3,
        "limited_share": one.limited_share,
        "stick_slip": None if one.stick_slip is None else dict(vars(one.stick_slip)),
        "stiffness_n_per_um": None if one.stiffness_n_per_m is None else [s * 1e-6 for s in one.stiffness_n_per_m],
        "damping_ns_per_m": list(one.damping_ns_per_m),
    }


def _loop_data(loop: LoopSummary | None) -> dict[str, Any] | None:
    if loop is None:
        return None
    found, figures = loop.stability, loop.figures
    return {
        "stable": found.stable,
        "margin_per_s": found.margin_per_s,
        "poles_per_s": [[pole.real, pole.imag] for pole in found.poles.tolist()],
        "gain_limits": dict(found.gain_limits),
        "gain_floors": dict(found.gain_floors),
        **fields_of(figures, "bandwidth_hz", "peak", "peak_hz", "gain_margin_db", "phase_margin_deg"),
    }
