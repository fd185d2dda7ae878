"""How an axis follows its reference: its motion, step and step-size error, and why one could not go on."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.drive.closed_loop import fastest_rate_per_s, largest_stable_step_s
from selector.physics.drive.finding_table import UNSTABLE_LOOP
from selector.physics.drive.kernel import _packed as at
from selector.physics.drive.parts.axis import Axis, AxisState, RigidMechanics, unloaded_state
from selector.physics.drive.stability import stability_findings
from selector.physics.drive.trajectory import COURSES, Motion, ParameterCourse, Reference
from selector.types import Vector


@dataclass(frozen=True)
class AxisRun:
    """What one axis was asked, and what it did."""

    axis: Axis  #: The axis that was simulated
    reference: Reference  #: What it was asked to do
    motion: Motion  #: What it did
    course: ParameterCourse | None  #: Stiffness and damping that it had, with ``varying = "command"``
    step_s: float  #: Largest step of the calculation [s]
    #: First sample that is recorded, and the first that is not any more; None: all are. Of a circle the 360° between
    #: run-in and run-out.
    arc: tuple[int, int] | None = None
    added: Vector | None = None  #: (n_samples,): What was added to the output of the control, behind it [actuator unit]

    @property
    def recorded(self) -> "AxisRun":
        """Of it what is recorded, with its own time 0; itself where all is."""
        if self.arc is None:
            return self
        part = slice(*self.arc)
        names = ("position_m", "speed_m_per_s", "acceleration_m_per_s2", "force_n")
        reference = Reference(self.reference.period_s, **_cut(self.reference, names, part))
        motion = _cut(self.motion, [one.name for one in fields(Motion)], part)
        motion["time_s"] = motion["time_s"] - motion["time_s"][0]
        course = self.course
        if course is not None:
            course = ParameterCourse(course.period_s, **_cut(course, COURSES, part))
        return replace(self, reference=reference, motion=Motion(**motion), course=course, arc=None)


def _cut(value: Reference | Motion | ParameterCourse, names: Iterable[str], part: slice) -> dict[str, Any]:
    """A stretch of the courses of these names; None where there is none."""
    courses = {name: getattr(value, name) for name in names}
    return {name: None if course is None else course[part] for name, course in courses.items()}


# events within one step before the rest of it is taken without looking for more
MOST_EVENTS = 32

_STATES = [f"{what} of the {part}" for part in ("motor", "screw", "table") for what in ("position", "speed")]
_STATES += ["deflection of the bristles", "integral of the servo"]


def simulate_axis(
    axis: Axis,
    reference: Reference,
    *,
    step_s: float,
    course: ParameterCourse | None = None,
    start: AxisState | None = None,
    commands: ArrayLike | None = None,
    seed: int = 0,
) -> Motion:
    """How an axis follows a reference, at the samples of the reference; see docs/explanation/drive-simulation.md.

    Runge–Kutta of order 4 with a fixed step; sticking, slipping and touching are located in time.

    An axis without a servo ignores all of the reference but its force. The largest step is `step_s` [s]: a whole number
    of equal steps fills every period of reference and servo. `course` is stiffness and damping that change in time, on
    the grid of the reference; without a `start` everything is at rest at the first position of the reference; `seed` is
    of the current noise.

    `commands`, shape (n_samples,), drive the actuator instead of the servo, each held for a period [actuator unit];
    before the first one has passed the delay it counts too. Gain and delay are those of the servo, 1 and 0 without one.

    InputError if periods do not fit together, shapes do not fit, or the motion leaves all bounds.
    """
    from selector.physics.drive.kernel import _kernel

    p, o = at.packed_axis(axis)
    ref = _packed_reference(axis, reference, course, o)
    given = _given(axis, reference, commands, seed, o)
    _lay_grid(axis, reference.period_s, step_s, p, o)
    w, begin = _kernel.work_space(), start or unloaded_state(axis, float(reference.position_m[0]))
    turning = (begin.motor, begin.motor_speed, begin.screw, begin.screw_speed)
    place = (*turning, begin.table_m, begin.table_speed_m_per_s)
    if isinstance(axis.mechanics, RigidMechanics):
        place = (0.0, 0.0, 0.0, 0.0, begin.motor, begin.motor_speed)
    w[at.Y, :8] = (*place, begin.bristle_m, begin.integral)
    count = len(reference.position_m)
    out = np.empty((count, _kernel.COURSES))
    lost, state = _kernel.loop(w, p, o, ref, given, _bounds(axis, reference, begin), out)
    if lost >= 0:
        lost_s, what, step = lost * reference.period_s, _STATES[state], p[at.STEP]
        raise runaway(axis, commanded=commands is not None, time_s=lost_s, state=what, step_s=step)
    return Motion(reference.time_s, reference.position_m, *out.T)


def steps_per_period(axis: Axis, period_s: float, step_s: float) -> int:
    """How many steps of at most `step_s` fill a period of a reference, when they also fill those of the servo.

    InputError if the periods do not fit together.
    """
    p, o = at.packed_axis(axis)
    _lay_grid(axis, period_s, step_s, p, o)
    return int(o[at.PERIOD_STEPS])


def _packed_reference(axis: Axis, reference: Reference, course: ParameterCourse | None, o: at.Switches) -> Vector:
    count = len(reference.position_m)
    # one row more than samples, so that the last sample has a period of its own
    ref = np.zeros((count + 1, at.COLUMNS))
    ref[:count, at.POSITION] = reference.position_m
    ref[:count, at.SPEED] = reference.speed_m_per_s
    ref[:count, at.ACCELERATION] = reference.acceleration_m_per_s2
    if reference.force_n is not None:
        ref[:count, at.FORCE] = reference.force_n
    if course is not None:
        axial, guide = course.axial_stiffness_n_per_m, course.guide_damping_ns_per_m
        _check_course(axis, reference, course)
        if axial is not None:
            o[at.VARYING_AXIAL], ref[:count, at.COURSE_AXIAL] = 1, axial
        if guide is not None:
            o[at.VARYING_GUIDE], ref[:count, at.COURSE_GUIDE] = 1, guide
    ref[count] = ref[count - 1]
    return ref


def _check_course(axis: Axis, reference: Reference, course: ParameterCourse) -> None:
    axial = course.axial_stiffness_n_per_m
    rows = [len(values) for values in (axial, course.guide_damping_ns_per_m) if values is not None]
    count = len(reference.position_m)
    found, expected = "", f"the {count} samples and {reference.period_s:g} s of the reference"
    if any(row != count for row in rows) or not math.isclose(course.period_s, reference.period_s, rel_tol=1e-9):
        found = f"{rows} samples every {course.period_s:g} s"
    elif axial is not None and isinstance(axis.mechanics, RigidMechanics):
        found, expected = "an axial stiffness for a rigid axis", "a three-mass axis"
    elif axial is not None and axis.compliance is not None:
        found, expected = "an axial stiffness beside an axial compliance", "one of them"
    if found:
        raise InputError(
            found, expected=expected, where="course of parameters", advice="make the course from axis and reference"
        )


def _given(axis: Axis, reference: Reference, commands: ArrayLike | None, seed: int, o: at.Switches) -> Vector:
    """Commands if they are given, else the noise of a sampled servo."""
    if commands is not None:
        values = np.array(commands, dtype=np.float64)
        if values.shape != reference.position_m.shape or not np.isfinite(values).all():
            raise InputError(
                f"commands of shape {values.shape}" + ("" if np.isfinite(values).all() else " with missing values"),
                expected=f"{len(reference.position_m)} finite numbers, one a sample of the reference",
                where="commands",
                advice="give the commands at the times of the reference",
            )
        o[at.CONTROL] = at.GIVEN
        return values
    if o[at.CONTROL] != at.SAMPLED or axis.sensing.current_noise == 0 or axis.servo is None:
        return np.zeros(0)
    duration = reference.period_s * (len(reference.position_m) - 1)
    count = math.floor(duration / axis.servo.sample_s * (1 + 1e-9)) + 2
    return np.random.default_rng(seed).normal(0.0, axis.sensing.current_noise, count)


def _lay_grid(axis: Axis, period_s: float, step_s: float, p: Vector, o: at.Switches) -> None:
    """Equal steps that fill the periods of reference and servo, and where between them a delayed command arrives."""
    if not (math.isfinite(step_s) and step_s > 0):
        raise InputError(
            f"{step_s:g} s", expected="a number above 0", where="step_s", advice="give the largest step in seconds"
        )
    per_period, per_sample = 1, 1
    if o[at.CONTROL] == at.SAMPLED:
        ratio = period_s / p[at.SAMPLE]
        share = Fraction(ratio).limit_denominator(1000)
        if share.numerator > 1_000_000 or abs(ratio / share - 1) > 1e-9 if share else True:
            raise InputError(
                f"a reference every {period_s:g} s and a servo every {p[at.SAMPLE]:g} s",
                expected="two periods of which one is a multiple, or a simple share, of the other",
                where="sample_s",
                advice="sample the reference at a multiple of the servo's period",
            )
        per_period, per_sample = share.numerator, share.denominator
    tick = period_s / per_period
    # a step that fits but for rounding is one that fits
    steps = max(1, math.ceil(tick / step_s * (1 - 1e-12)))
    o[at.PERIOD_STEPS], o[at.SAMPLE_STEPS], o[at.MOST_EVENTS] = per_period * steps, per_sample * steps, MOST_EVENTS
    p[at.PERIOD], p[at.STEP] = period_s, tick / steps
    delay = axis.servo.delay_s if axis.servo is not None and o[at.CONTROL] != at.CONTINUOUS else 0.0
    whole = math.floor(delay / p[at.STEP] + 1e-9)
    part = delay / p[at.STEP] - whole
    o[at.DELAY_STEPS], p[at.DELAY_PART] = whole, part if part > 1e-9 else 0.0


def _bounds(axis: Axis, reference: Reference, start: AxisState) -> Vector:
    """A thousand times farther than anything is asked to go; speeds have to be numbers."""
    farthest = 1000.0 * (1.0 + float(np.abs(reference.position_m).max()) + abs(start.table_m))
    turns = farthest / axis.mechanics.travel_per_motion + 1000.0 * (abs(start.motor) + abs(start.screw))
    largest = float(np.finfo(np.float64).max)
    return np.array([turns, largest, turns, largest, farthest, largest, largest, largest])


def runaway(axis: Axis, *, commanded: bool, time_s: float, state: str, step_s: float) -> InputError:
    """The error that says so.

    `state` left the bounds at `time_s` [s]; `commanded` says that given commands drove it in the place of its servo.
    """
    found, stable_step_s = f"the {state} left all bounds before {time_s:.6g} s", largest_stable_step_s(axis)
    if step_s > stable_step_s:
        advice = f"the step of {step_s:.3g} s is too long for the fastest vibration: take at most {stable_step_s:.3g} s"
    elif axis.servo is None or commanded:
        advice = "nothing holds the axis: check the commands and forces that act on it"
    else:
        unstable = [one for one in stability_findings(axis, "the axis") if one.id == UNSTABLE_LOOP]
        if unstable:
            found = f"{found}. {unstable[0].statement}".removesuffix(".")
            advice = unstable[0].suggestion
        else:
            advice = "the loop is stable: check forces, feed-forward, current_noise, and where and how fast it starts"
    return InputError(
        found, expected="a motion that stays near its reference", where="simulation of the axis", advice=advice
    )


#: Step × fastest rate of the axis. A method of order 4 then changes that vibration by less than 2e-5 of itself a
#: period in size (2π·0.2⁵/144) and by 1e-4 in phase (2π·0.2⁴/120).
PER_MODE = 0.2


def advised_step_s(axis: Axis, period_s: float) -> float:
    """Step that resolves the fastest vibration of an axis, at most the period of the samples [s]."""
    rate = fastest_rate_per_s(axis)
    return min(period_s, PER_MODE / rate) if rate > 0 else period_s


def circle_step_s(axis: Axis, period_s: float) -> float:
    """Step for circles: half of what is stable, at most the period of the samples [s].

    Nothing on a circle excites the fastest vibration, which this step damps.
    """
    return min(period_s, largest_stable_step_s(axis) / 2.0)
