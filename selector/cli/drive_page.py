"""What stands on the page of a simulated feed drive: its axes in every run, its loops, its numbers and their origin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from selector.cli.parameter_origin import facts_of, is_said
from selector.findings import Finding
from selector.physics.drive.course import ParameterCourse
from selector.physics.drive.friction import Friction
from selector.physics.drive.parameter_bounds import OUTPUT_UNITS
from selector.physics.drive.servo import Servo

if TYPE_CHECKING:
    from selector.physics.drive.axis_summary import LoopSummary
    from selector.physics.drive.comparison import Difference
    from selector.physics.drive.drive_model import AxisRun, DriveModel, DriveSimulation
    from selector.physics.drive.drive_summary import DriveSummary
    from selector.report.drive_report import AxisOnPage, DrivePage, Response

_FREQUENCIES = 600
_SPREAD = 30.0
"""Frequencies are shown from the bandwidth divided by this to the bandwidth times this."""


def page_of(
    model: DriveModel,
    simulation: DriveSimulation,
    summary: DriveSummary,
    findings: tuple[Finding, ...],
    path: Path,
    differences: tuple[Difference, ...] = (),
) -> DrivePage:
    """Everything that the page shows; `path` is the model file, `differences` are those from recordings."""
    from selector.report.ball_bar_part import BallBarOnPage
    from selector.report.drive_report import MOST_RUNS, DrivePage

    # circles are drawn as circles
    shown = list(simulation.axes)[: 0 if simulation.traces else MOST_RUNS]
    runs = {
        run: tuple(_axis(model, name, one.recorded, summary, run, compared=run in shown) for name, one in done.items())
        for run, done in simulation.axes.items()
    }
    first = next(iter(runs.values()))
    told = simulation.recording.provenance["simulated"]
    return DrivePage(
        recording=simulation.recording,
        model=model.name,
        runs=runs,
        inputs=tuple(
            channel.name
            for channel in simulation.recording.channels
            if channel.role == "position_command" or channel.name in model.inputs
        ),
        loops=summary.loops,
        responses={one.name: _response(one, summary.loops[one.name]) for one in first if one.name in summary.loops},
        ball_bar=BallBarOnPage(tuple(simulation.traces.values()), summary.quantities, summary.causes, summary.wind_up_m)
        if summary.quantities
        else None,
        differences=differences,
        findings=findings,
        parameters=tuple(_parameters(model)),
        told={
            **facts_of(path, model.file.model.note),
            "step of the calculation [s]": {
                f"{run}, {name}" if len(simulation.axes) > 1 else name: one.step_s
                for run, done in list(simulation.axes.items())[:1]
                for name, one in done.items()
            },
            "seed": told["seed"],
        },
    )


_DEFAULTS = {field.name: field.default for kind in (Friction, Servo) for field in fields(kind)}


def _axis(model: DriveModel, name: str, one: AxisRun, summary: DriveSummary, run: str, *, compared: bool) -> AxisOnPage:
    from selector.figures.drive import LINEAR, ROTARY
    from selector.physics.drive.axis_summary import limited_samples
    from selector.physics.drive.drive_summary import course_of
    from selector.report.drive_report import AxisOnPage

    course = course_of(model, name, one)
    return AxisOnPage(
        name=name,
        axis=one.axis,
        motion=one.motion,
        summary=summary.axes[run][name],
        limited=limited_samples(one.axis, one.reference, one.motion),
        course=course,
        constant_error_m=_constant_error_m(one) if compared and course is not None else None,
        output_unit=OUTPUT_UNITS[model.file_axes[name].section.output] or "control's unit",
        measures=ROTARY if model.file_axes[name].rotary else LINEAR,
    )


def _constant_error_m(one: AxisRun) -> NDArray[np.float64]:
    """Tracking error with the stiffness unloaded at position 0 and the damping at rest [m], as in `time_variation`."""
    from selector.physics.drive.simulation import simulate_axis

    constant = replace(one.axis, compliance=None)
    return simulate_axis(constant, one.reference, step_s=one.step_s).tracking_error_m


def _response(one: AxisOnPage, loop: LoopSummary) -> Response:
    """Of the axis as it is, or frozen at three instants of its course: softest, stiffest and between."""
    from selector.physics.drive.frequency import frequency_response, frozen
    from selector.report.drive_report import Response

    servo = one.axis.servo
    middle_hz = loop.figures.bandwidth_hz
    if not math.isfinite(middle_hz):
        middle_hz = float(np.median(np.abs(loop.stability.poles))) / (2.0 * math.pi)
    most_hz = math.inf if servo is None or servo.sample_s == 0 else 0.499 / servo.sample_s
    frequency_hz = np.geomspace(middle_hz / _SPREAD, min(middle_hz * _SPREAD, most_hz), _FREQUENCIES)
    course = one.course
    if course is None:
        return Response(frequency_hz, {"": frequency_response(one.axis, frequency_hz)})
    instants = _instants_s(course)
    return Response(
        frequency_hz,
        {
            f"at {instant:.3g} s": frequency_response(frozen(one.axis, course, instant), frequency_hz)
            for instant in instants
        },
        instants,
    )


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


def _parameters(model: DriveModel) -> list[tuple[str, float, str, str]]:
    """(name, value, unit, where it is from) of every number of the axes."""
    from selector.physics.model_text import plain_values

    values = plain_values(model.file)
    found = []
    for name, one in model.parameters.items():
        parts = name.split(".")
        said = "model file" if is_said(values, parts) else _otherwise(values, parts, one.value)
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
