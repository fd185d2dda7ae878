"""The drawings of a simulated feed drive: courses, what varies, friction, loops, circles."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.simulated.ball_bar import ball_bar_figure
from selector.figures.simulated.drive import (
    axis_course,
    frequency_response,
    stiffness_and_damping,
    varying_against_constant,
)
from selector.number_text import number_text
from selector.physics.drive.ball_bar.quantities import paired
from selector.physics.drive.drive_summary import LoopSummary, course_of, limited_samples
from selector.physics.drive.file.model_file import OUTPUT_UNITS
from selector.physics.drive.loop.stability import frequency_response as response_of_loop
from selector.physics.drive.loop.stability import frozen
from selector.physics.drive.parts.axis import Axis, ThreeMassMechanics
from selector.physics.drive.simulation import AxisRun, simulate_axis
from selector.physics.drive.trajectory import ParameterCourse
from selector.telling.account import Block, Drawing
from selector.telling.simulated.ball_bar import POLAR
from selector.telling.simulated.drive import MOST_RUNS, AxisInRun, axes_in_runs
from selector.telling.simulated.result import SimulationResult
from selector.types import Vector

_FREQUENCIES = 600
_SPREAD = 30.0  #: Frequencies are shown from the bandwidth divided by this to the bandwidth times this.

#: Frequency response of a loop: frequencies [Hz], table over reference by its name, and its instants [s].
Response = tuple[Vector, dict[str, NDArray[np.complex128]], tuple[float, ...]]


def drawings(result: SimulationResult) -> dict[str, list[Block]]:
    """Section of the account, a run or a loop → its drawings."""
    done, model, summary = result.simulated.details, result.simulated.model, result.summary
    axes = axes_in_runs(result)
    first_run = axes[0].run
    courses = {
        one.name: course_of(model, one.name, done.axes[first_run][one.name].recorded)
        for one in axes
        if one.run == first_run
    }
    responses = {
        one.name: _response(one.axis, courses[one.name], summary.loops[one.name])
        for one in axes
        if one.run == first_run and one.name in summary.loops
    }
    found: dict[str, list[Block]] = {
        "ball-bar": [Drawing(ball_bar_figure(pair), POLAR) for pair in reversed(paired(tuple(done.traces.values())))]
        if summary.quantities
        else []
    }
    # circles are drawn as circles
    for run in [] if summary.quantities else list(done.axes)[:MOST_RUNS]:
        own = [one for one in axes if one.run == run]
        found[f"run {run}"] = [
            drawn for one in own for drawn in _axis(result, one, responses.get(one.name), is_only=len(own) == 1)
        ]
    for name, loop in summary.loops.items():
        found[f"loop {name}"] = [_loop(name, loop, responses[name], several=len(summary.loops) > 1)]
    return found


def _axis(result: SimulationResult, one: AxisInRun, response: Response | None, *, is_only: bool) -> list[Block]:
    model, name = result.simulated.model, "" if is_only else one.name
    moved = result.simulated.details.axes[one.run][one.name].recorded
    samples = limited_samples(moved.axis, moved.reference, moved.motion)
    limited = samples if samples.any() else None
    unit = OUTPUT_UNITS[model.file_axes[one.name].section.output] or "control's unit"
    course = axis_course(one.motion, name, unit, limited=limited, measures=one.measures)
    drawn: list[Block] = [Drawing(course, _COURSE + (_LIMITED if limited is not None else ""))]
    varying = course_of(model, one.name, moved)
    if varying is not None:
        drawn += _varying(one, moved, varying, response)
    return drawn


def _varying(one: AxisInRun, moved: AxisRun, course: ParameterCourse, response: Response | None) -> list[Block]:
    drawn: list[Block] = []
    time_s, mechanics = one.motion.time_s, one.axis.mechanics
    stiffness, damping = course.axial_stiffness_n_per_m, course.guide_damping_ns_per_m
    if stiffness is None and isinstance(mechanics, ThreeMassMechanics):
        stiffness = np.full(len(time_s), mechanics.axial_stiffness_n_per_m)
    if stiffness is not None:
        if damping is None:
            damping = np.full(len(time_s), mechanics.guide_damping_ns_per_m)
        marks = () if response is None else response[2]
        drawn.append(Drawing(stiffness_and_damping(time_s, stiffness, damping, marks), _VARYING))
    # the same axis with the stiffness unloaded at position 0 and the damping at rest
    constant = replace(moved.axis, compliance=None)
    error_m = simulate_axis(constant, moved.reference, step_s=moved.step_s).tracking_error_m
    compared = varying_against_constant(time_s, one.motion.tracking_error_m, error_m, one.measures)
    return [*drawn, Drawing(compared, _COMPARED)]


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
    return Drawing(picture, _RESPONSE)


def _instants_s(course: ParameterCourse) -> tuple[float, ...]:
    """When the axis is softest, stiffest, and in the middle between; of a rigid one by its damping."""
    values = course.axial_stiffness_n_per_m
    if values is None or np.ptp(values) == 0:
        values = course.guide_damping_ns_per_m
    if values is None:
        return (0.0,)
    middle = (values.min() + values.max()) / 2.0
    at = {int(np.argmin(values)), int(np.argmax(values)), int(np.argmin(np.abs(values - middle)))}
    return tuple(k * course.period_s for k in sorted(at))


_THINNED = "Long courses are drawn with the lowest and highest sample of each of 300 stretches; the file has them all."
_COURSE = f"Error: commanded minus true position of the table. Output: what the control puts out. {_THINNED}"
_LIMITED = " Shaded: a limit of current or speed is reached."
_VARYING = "Stiffness changes with load and position, damping with speed. Dotted: instants of the frequency response."
_COMPARED = "Constant: the stiffness at position 0 without load, and the damping of viscous friction alone."
_RESPONSE = (
    "From commanded to true position, for small motions without dry friction, backlash and limits. Dotted: −3 dB."
)
