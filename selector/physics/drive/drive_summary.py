"""What does a simulated feed drive amount to: every axis in every run, every loop, and how round its circles are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.drive.ball_bar.causes import CircleCauses, circle_causes
from selector.physics.drive.ball_bar.quantities import CircleQuantities, circle_quantities
from selector.physics.drive.drive_model import DriveModel, DriveSimulation
from selector.physics.drive.energy import wind_up_m
from selector.physics.drive.loop.stability import LoopFigures, Stability, loop_figures, stability
from selector.physics.drive.motion import Motion, ParameterCourse, Reference
from selector.physics.drive.parts.axis import Axis
from selector.physics.drive.parts.catalogue import Parts
from selector.physics.drive.parts.mechanics import ThreeMassMechanics
from selector.physics.drive.parts.stiffness import axial_stiffness_n_per_m
from selector.physics.drive.simulation import AxisRun
from selector.physics.drive.tracking import ErrorParts, StickSlip, error_parts, stick_slip

_AT_LIMIT = 1.0 - 1e-9


@dataclass(frozen=True)
class Measures:
    """Units in which an axis is read: (text, how many in the SI unit) of position, error and speed; that of force."""

    position: tuple[str, float]
    error: tuple[str, float]
    speed: tuple[str, float]
    force: str


LINEAR = Measures(("mm", 1e3), ("µm", 1e6), ("m/min", 60.0), "N")
ROTARY = Measures(("°", 180.0 / math.pi), ("µrad", 1e6), ("r/min", 30.0 / math.pi), "N·m")


@dataclass(frozen=True)
class AxisSummary:
    """One axis in one run."""

    #: rms_m, max_m and max_at_s: Tracking error: root mean square, largest amount [m; rad], and when [s]
    rms_m: float
    max_m: float
    max_at_s: float
    parts: ErrorParts  #: What it goes with
    limited_share: float  #: Share of the samples at which a limit of current or speed was reached
    #: stiffness_n_per_m and damping_ns_per_m: Least and most of axial stiffness [N/m] and damping of the guide [N·s/m];
    #: a rigid axis has no stiffness
    stiffness_n_per_m: tuple[float, float] | None
    damping_ns_per_m: tuple[float, float]
    stick_slip: StickSlip | None = None  #: How it sticks and slips, if it does


@dataclass(frozen=True)
class LoopSummary:
    """The control loop of an axis: poles and limits of its gains, bandwidth and margins."""

    stability: Stability
    figures: LoopFigures


def loop_summary(axis: Axis) -> LoopSummary | None:
    """Poles, limits, bandwidth and margins of the loop of an axis; None without a servo."""
    return None if axis.servo is None else LoopSummary(stability(axis), loop_figures(axis))


def axis_summary(axis: Axis, reference: Reference, motion: Motion, course: ParameterCourse | None) -> AxisSummary:
    """Errors, limits and ranges of one axis in one run; `course` holds what varied, see `parameters_along`."""
    error = motion.tracking_error_m
    worst = int(np.argmax(np.abs(error)))
    mechanics = axis.mechanics
    stiffness: float | NDArray[np.float64] | None = None
    damping: float | NDArray[np.float64] = mechanics.guide_damping_ns_per_m
    if isinstance(mechanics, ThreeMassMechanics):
        stiffness = mechanics.axial_stiffness_n_per_m
    if course is not None:
        stiffness = stiffness if course.axial_stiffness_n_per_m is None else course.axial_stiffness_n_per_m
        damping = damping if course.guide_damping_ns_per_m is None else course.guide_damping_ns_per_m
    return AxisSummary(
        rms_m=float(np.sqrt(np.mean(error**2))),
        max_m=float(abs(error[worst])),
        max_at_s=float(motion.time_s[worst]),
        parts=error_parts(motion),
        limited_share=float(limited_samples(axis, reference, motion).mean()),
        stiffness_n_per_m=None if stiffness is None else _range(stiffness),
        damping_ns_per_m=_range(damping),
        stick_slip=stick_slip(motion),
    )


def parameters_along(parts: Parts | None, axis: Axis, motion: Motion) -> ParameterCourse | None:
    """Stiffness that an axis with a compliance had along its motion, from its position and load.

    None without a compliance, or if the table leaves the screw.
    """
    if parts is None or axis.compliance is None:
        return None
    period_s = float(motion.time_s[1] - motion.time_s[0])
    try:
        stiffness = axial_stiffness_n_per_m(parts, position_m=motion.table_m, load_n=motion.axial_force_n)
    except InputError:
        return None
    return ParameterCourse(period_s, stiffness)


def limited_samples(axis: Axis, reference: Reference, motion: Motion) -> NDArray[np.bool_]:
    """Where the command or the commanded speed was at its limit, shape (n_samples,)."""
    servo = axis.servo
    reached = np.zeros(len(motion.time_s), dtype=np.bool_)
    if servo is None:
        return reached
    if servo.command_limit is not None:
        reached |= np.abs(motion.command) >= _AT_LIMIT * servo.command_limit
    if servo.speed_limit is not None:
        lag = servo.position_gain_per_s * (motion.reference_m - motion.measured_m)
        asked = (lag + servo.velocity_feedforward * reference.speed_m_per_s) / axis.mechanics.travel_per_motion
        reached |= np.abs(asked) >= _AT_LIMIT * servo.speed_limit
    return reached


def _range(values: float | NDArray[np.float64]) -> tuple[float, float]:
    return float(np.min(values)), float(np.max(values))


@dataclass(frozen=True)
class DriveSummary:
    """What a simulation amounts to."""

    axes: Mapping[str, Mapping[str, AxisSummary]]  #: Run → axis → its errors
    loops: Mapping[str, LoopSummary]  #: Axis → its loop, for those with a control
    quantities: tuple[CircleQuantities, ...] = ()  #: Of circles, slowest feed first
    causes: CircleCauses | None = None  #: Of circles
    #: Axis → how much of its lost motion its own friction and springs make, see `wind_up.wind_up_m`
    wind_up_m: Mapping[str, float] = field(default_factory=dict)


def drive_summary(model: DriveModel, simulation: DriveSimulation) -> DriveSummary:
    """The summary of a simulation of this model: of what is recorded, so of circles without run-in and run-out."""
    axes = {
        run: {name: _of_recorded(model, name, one.recorded) for name, one in done.items()}
        for run, done in simulation.axes.items()
    }
    known = {name: one.axis for done in simulation.axes.values() for name, one in done.items()}
    loops = {name: loop_summary(axis) for name, axis in known.items()}
    traces = tuple(simulation.traces.values())
    wound = {name: wind_up_m(axis) for name, axis in known.items()} if traces else {}
    return DriveSummary(
        axes,
        {name: loop for name, loop in loops.items() if loop is not None},
        circle_quantities(traces) if traces else (),
        circle_causes(traces, lead_m=_leads(model)) if traces else None,
        {name: size for name, size in wound.items() if size is not None},
    )


def course_of(model: DriveModel, name: str, run: AxisRun) -> ParameterCourse | None:
    """Stiffness and damping that an axis had in a run, given or from its own position and load; None if constant."""
    return run.course or parameters_along(model.parts.get(name), run.axis, run.motion)


def _of_recorded(model: DriveModel, name: str, run: AxisRun) -> AxisSummary:
    return axis_summary(run.axis, run.reference, run.motion, course_of(model, name, run))


def _leads(model: DriveModel) -> dict[str, float]:
    return {
        name: axis.axis.mechanics.lead_m
        for name, axis in model.axes.items()
        if isinstance(axis.axis.mechanics, ThreeMassMechanics)
    }
