"""What is told of a simulated feed drive: how far it was off, what that goes with, its loop, how round it goes."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from selector.json_text import fields_of
from selector.number_text import number_text, span_text
from selector.physics.drive.ball_bar.circle import paired
from selector.physics.drive.drive_model import DriveModel
from selector.physics.drive.drive_summary import (
    LINEAR,
    ROTARY,
    AxisSummary,
    DriveSummary,
    ErrorParts,
    LoopSummary,
    Measures,
    course_of,
    limited_samples,
)
from selector.physics.drive.model_file import OUTPUT_UNITS
from selector.physics.drive.parts.axis import Axis, Friction, Servo, ThreeMassMechanics
from selector.physics.drive.stability import LoopFigures, frozen
from selector.physics.drive.stability import frequency_response as response_of_loop
from selector.physics.drive.trajectory import Motion, ParameterCourse
from selector.physics.model_text import plain_values
from selector.telling.account import Account, Block, Captioned, Drawing, Heading, Note, Table, legend, section, table
from selector.telling.numbers import NONE, ms_text
from selector.telling.simulated.ball_bar import ball_bar_data, ball_bar_sentences, ball_bar_tables
from selector.telling.simulated.result import SAID, THINNED, Drawings, SimulationResult, is_said, simulation_account
from selector.types import Complex, Vector

_MICRO = 1e6
MOST_RUNS = 4
MOST_ROWS = 12
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
_DEFAULTS = {field.name: field.default for kind in (Friction, Servo) for field in fields(kind)}
_FREQUENCIES = 600
_SPREAD = 30.0  #: Frequencies are shown from the bandwidth divided by this to the bandwidth times this.

#: Frequency response of a loop: frequencies [Hz], table over reference by its name, and its instants [s].
Response = tuple[Vector, dict[str, Complex], tuple[float, ...]]


@dataclass(frozen=True)
class AxisInRun:
    """An axis in one run."""

    run: str
    name: str
    axis: Axis
    motion: Motion
    summary: AxisSummary
    measures: Measures  #: Units in which it is read


def drive_account(result: SimulationResult, drawn: bool) -> Account:
    """What is told of a simulated feed drive: how far it was off and why, what varied, its loop, how round it goes."""
    done, model, summary = result.simulated.details, result.simulated.model, result.summary
    axes = axes_in_runs(result)
    circles = bool(summary.quantities)
    # circles are drawn as circles
    runs = () if circles else tuple(done.axes)[:MOST_RUNS]
    drawings = _drawings(result, axes, runs) if drawn else {}
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
        of = f"{f' of {name}' * (len(summary.loops) > 1)}{loop.at}"
        loops += drawings.get(f"loop {name}", ())
        loops += [Captioned(f"{caption}{of}", one) for caption, one in loop_tables(loop, axis)]
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
    return [off_sentence(one, name, one.run if several else ""), *more]


def errors_table(axes: Sequence[AxisInRun]) -> Table:
    """How far every axis was off in every run; of many the worst."""
    shown, note = axes, ""
    if len(axes) > MOST_ROWS:
        shown = sorted(axes, key=lambda one: -one.summary.max_m)[:MOST_ROWS]
        note = f"The {MOST_ROWS} largest of {len(axes)}; all are in the JSON."
    rows = []
    for one in shown:
        (unit, times), parts, limited = one.measures.error, one.summary.parts, one.summary.limited_share
        cause = f"{_WHAT[parts.largest]} ({_share_text(parts.share(parts.largest))})"
        errors = (one.summary.max_m * times, one.summary.rms_m * times)
        rows.append((one.run, one.name, *errors, unit, cause, _share_text(limited) if limited else None))
    return table(["run", "axis", ">largest", ">rms", "unit", "goes with", ">at limits"], rows, note)


def _parameters(model: DriveModel) -> Iterator[tuple[str, float, str, str]]:
    """(name, value, unit, where it is from) of every number of the axes."""
    values = plain_values(model.file)
    for name, one in model.parameters.items():
        parts = name.split(".")
        said = SAID if is_said(values, parts) else _otherwise(values, parts, one.value)
        yield name, one.value, one.unit, said


def _otherwise(values: Mapping[str, Any], path: list[str], value: float) -> str:
    section = values.get("axes", {}).get(path[1], {}) if len(path) > 1 else {}
    parts = section.get("parts") if isinstance(section, Mapping) else None
    like = parts if isinstance(parts, str) else parts.get("like") if isinstance(parts, Mapping) else None
    if "parts" in path:
        return f"catalogue values of {like}" if like else "left out: off"
    return (
        "from the parts" if parts is not None and value not in (0.0, _DEFAULTS.get(path[-1])) else "left out: default"
    )


def off_sentence(one: AxisInRun, name: str, run: str = "") -> str:
    """How far the table is off its command, most and on average, and when."""
    unit, times = one.measures.error
    where = f" of {run}" if run else ""
    return (
        f"{name or 'The table'} is off its command by up to {number_text(one.summary.max_m * times)} {unit}, "
        f"most after {span_text(one.summary.max_at_s)}{where}; {number_text(one.summary.rms_m * times)} {unit} root "
        "mean square."
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
        return f"{most} goes with the acceleration ({part}): {slope} {unit} per {'m/s²' if unit == 'µm' else 'rad/s²'}."
    if name == "direction" and parts.reversal_m is not None:
        size = number_text(abs(parts.reversal_m) * times)
        return f"{most} changes with the direction of travel ({part}): ±{size} {unit}, friction and lost motion."
    if name == "constant" and parts.constant_m is not None:
        return f"{most} is always there ({part}): {number_text(parts.constant_m * times)} {unit}."
    if name == "rest":
        return f"{most} goes with neither speed, acceleration nor direction ({part}); see its course."
    return f"{most} goes with {_WHAT[name]} ({part})."


def parts_table(parts: ErrorParts, measures: Measures) -> Table:
    """The parts of a tracking error with their sizes."""
    unit, times = measures.error
    rows = [(_WHAT[name], rms * times, _share_text(parts.share(name))) for name, rms in parts.rms_m.items()]
    return table(["goes with", f">rms [{unit}]", ">share"], rows, legend("drive.parts"))


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


def loop_tables(loop: LoopSummary, axis: Axis) -> list[tuple[str, Table]]:
    """Bandwidth and margins, and how far the gains may go."""
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
    heads = ["gain", ">is", ">unstable below", ">unstable above", ">room"]
    return [
        ("Loop", table(["", ">value", "unit"], rows)),
        ("Gains", table(heads, gains, "One gain is changed and the others stay.")),
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


def _drawings(result: SimulationResult, axes: Sequence[AxisInRun], runs: Sequence[str]) -> Drawings:
    """Section of the account, a run of these or a loop → its drawings."""
    from selector.figures.simulated.drive import ball_bar_figure

    done, model, summary = result.simulated.details, result.simulated.model, result.summary
    first_run = axes[0].run
    responses = {
        one.name: _response(
            one.axis, course_of(model, one.name, done.axes[first_run][one.name].recorded), summary.loops[one.name]
        )
        for one in axes
        if one.run == first_run and one.name in summary.loops
    }
    pairs = reversed(paired(tuple(done.traces.values()))) if summary.quantities else ()
    found: dict[str, list[Block]] = {
        "ball-bar": [Drawing(ball_bar_figure(pair), legend("ball-bar.polar")) for pair in pairs]
    }
    for run in runs:
        own = [one for one in axes if one.run == run]
        found[f"run {run}"] = [
            drawn for one in own for drawn in _axis(result, one, responses.get(one.name), is_only=len(own) == 1)
        ]
    for name, loop in summary.loops.items():
        found[f"loop {name}"] = [_loop(name, loop, responses[name], several=len(summary.loops) > 1)]
    return found


def _axis(result: SimulationResult, one: AxisInRun, response: Response | None, *, is_only: bool) -> list[Block]:
    from selector.figures.simulated.drive import axis_course, stiffness_and_damping

    model, name = result.simulated.model, "" if is_only else one.name
    moved = result.simulated.details.axes[one.run][one.name].recorded
    samples = limited_samples(moved.axis, moved.reference, moved.motion)
    limited = samples if samples.any() else None
    unit = OUTPUT_UNITS[model.file_axes[one.name].section.output] or "control's unit"
    picture = axis_course(one.motion, name, unit, limited=limited, measures=one.measures)
    drawn: list[Block] = [
        Drawing(picture, f"{legend('drive.course')} {THINNED}{legend('drive.limited') if limited is not None else ''}")
    ]
    course = course_of(model, one.name, moved)
    if course is None:
        return drawn
    time_s, mechanics = one.motion.time_s, one.axis.mechanics
    stiffness, damping = course.axial_stiffness_n_per_m, course.guide_damping_ns_per_m
    if stiffness is None and isinstance(mechanics, ThreeMassMechanics):
        stiffness = np.full(len(time_s), mechanics.axial_stiffness_n_per_m)
    if stiffness is None:
        return drawn
    if damping is None:
        damping = np.full(len(time_s), mechanics.guide_damping_ns_per_m)
    marks = () if response is None else response[2]
    return [*drawn, Drawing(stiffness_and_damping(time_s, stiffness, damping, marks), legend("drive.varying"))]


def _response(axis: Axis, course: ParameterCourse | None, loop: LoopSummary) -> Response:
    """Of the axis as it is, or frozen at three instants of its course: softest, stiffest and between."""
    servo = axis.servo
    middle_hz = loop.figures.bandwidth_hz
    if not math.isfinite(middle_hz):
        middle_hz = float(np.median(np.abs(loop.stability.poles))) / (2.0 * math.pi)
    most_hz = math.inf if servo is None or servo.sample_s == 0 else 0.499 / servo.sample_s
    frequency_hz = np.geomspace(middle_hz / _SPREAD, min(middle_hz * _SPREAD, most_hz), _FREQUENCIES)
    if course is None:
        return frequency_hz, {"": response_of_loop(axis, frequency_hz)}, ()
    instants = _instants_s(course)
    over = {
        f"at {instant:.3g} s": response_of_loop(frozen(axis, course, instant), frequency_hz) for instant in instants
    }
    return frequency_hz, over, instants


def _loop(name: str, loop: LoopSummary, response: Response, *, several: bool) -> Drawing:
    from selector.figures import style
    from selector.figures.simulated.drive import frequency_response

    who = f"{style.label(name, 12)} " if several else "the table "
    title = f"Computed: {who}follows up to {number_text(loop.figures.bandwidth_hz)} Hz (−3 dB)"
    if not loop.stability.stable:
        title = f"Computed: the loop of {who}is unstable; this is no answer that could be measured"
    frequency_hz, over, _ = response
    picture = frequency_response(
        frequency_hz,
        {key: np.abs(values) for key, values in over.items()},
        {key: np.degrees(np.unwrap(np.angle(values))) for key, values in over.items()},
        title,
    )
    return Drawing(picture, legend("drive.response"))


def _instants_s(course: ParameterCourse) -> tuple[float, ...]:
    """When the axis is softest, stiffest, and in the middle between; of a rigid one by its damping."""
    values = course.varying
    if values is None:
        return (0.0,)
    middle = (values.min() + values.max()) / 2.0
    at = {int(np.argmin(values)), int(np.argmax(values)), int(np.argmin(np.abs(values - middle)))}
    return tuple(k * course.period_s for k in sorted(at))


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
        "at_m": loop.at_m,
        **fields_of(figures, "bandwidth_hz", "peak", "peak_hz", "gain_margin_db", "phase_margin_deg"),
    }
