"""What does the motion of a simulated axis amount to: errors, limits that were reached, stiffness it had, its loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.catalogue import Parts
from selector.physics.drive.course import ParameterCourse
from selector.physics.drive.error_parts import ErrorParts, error_parts
from selector.physics.drive.frequency import LoopFigures, loop_figures
from selector.physics.drive.mechanics import ThreeMassMechanics
from selector.physics.drive.motion import Motion
from selector.physics.drive.reference import Reference
from selector.physics.drive.stability import Stability, stability
from selector.physics.drive.sticking import StickSlip, stick_slip
from selector.physics.drive.stiffness import axial_stiffness_n_per_m

_AT_LIMIT = 1.0 - 1e-9


@dataclass(frozen=True)
class AxisSummary:
    """One axis in one run.

    Attributes
    ----------
    rms_m, max_m, max_at_s : float
        Tracking error: root mean square, largest amount [m; rad], and when [s].
    parts : ErrorParts
        What it goes with.
    limited_share : float
        Share of the samples at which a limit of current or speed was reached.
    stiffness_n_per_m, damping_ns_per_m : (float, float) or None
        Least and most of axial stiffness [N/m] and damping of the guide [N·s/m]; a rigid axis has no stiffness.
    stick_slip : StickSlip or None
        How it sticks and slips, if it does.
    """

    rms_m: float
    max_m: float
    max_at_s: float
    parts: ErrorParts
    limited_share: float
    stiffness_n_per_m: tuple[float, float] | None
    damping_ns_per_m: tuple[float, float]
    stick_slip: StickSlip | None = None


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
