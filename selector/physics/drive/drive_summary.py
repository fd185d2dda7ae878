"""What does a simulated feed drive amount to: its error and what it goes with, loops, circles; what is odd about it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.drive.ball_bar.causes import CircleCauses, circle_causes
from selector.physics.drive.ball_bar.circle import CircleQuantities, circle_quantities
from selector.physics.drive.closed_loop import fastest_rate_per_s
from selector.physics.drive.drive_model import DriveModel, DriveSimulation
from selector.physics.drive.finding_table import FINDINGS
from selector.physics.drive.model_schema import FileAxis
from selector.physics.drive.parts.axis import (
    Axis,
    ThreeMassMechanics,
    passive_bristle_damping_ns_per_m,
    passive_fading_speed_m_per_s,
    wind_up_m,
)
from selector.physics.drive.parts.catalogue import Parts
from selector.physics.drive.parts.stiffness import axial_stiffness_n_per_m
from selector.physics.drive.simulation import AxisRun
from selector.physics.drive.stability import LoopFigures, Stability, frozen, loop_figures, stability, stability_findings
from selector.physics.drive.trajectory import Motion, ParameterCourse, Reference
from selector.physics.model_fields import unlikely_values
from selector.types import Array, Mask, Vector

PARTS = ("speed", "acceleration", "direction", "constant")
REST = "rest"

#: Share of the largest speed below which an axis is said to stand: its direction is that of its last motion.
_STANDSTILL = 1e-6
#: Mean square of the speed about its mean, relative to its mean square, while the axis moves, below which it moves at
#: one speed only: a trapezoid that is ramp for less than 3 % of its time.
_ONE_SPEED = 0.01


@dataclass(frozen=True)
class ErrorParts:
    """A tracking error split by least squares into what goes with the commanded motion, and what is left.

    The parts describe, they do not prove: a lag through a loop of gain Kp goes with the speed, inertia and springs
    go with the acceleration, friction and lost motion with the direction, weight and scales with nothing. What a motion
    cannot tell apart is one part: direction and constant if it goes one way, speed and direction at one speed.
    """

    lag_s: float | None  #: Error per commanded speed [s]
    per_acceleration_s2: float | None  #: Error per commanded acceleration [s²]
    reversal_m: float | None  #: Half the difference between the two directions of travel [m]
    constant_m: float | None  #: What is always there [m]. These four are None where the motion does not tell.
    #: Root mean square that a part adds to those before it, the one that explains most first, ``rest`` last [m]: the
    #: squares add up to that of the error. Parts are called as in `PARTS`, those that are one with a + between.
    rms_m: Mapping[str, float]

    @property
    def largest(self) -> str:
        """Name of the part with the largest root mean square."""
        return max(self.rms_m, key=lambda name: self.rms_m[name])

    def share(self, name: str) -> float:
        """Share of a part in the mean square of the error; of nothing 0."""
        whole = sum(rms**2 for rms in self.rms_m.values())
        return self.rms_m[name] ** 2 / whole if whole > 0 else 0.0


def error_parts(motion: Motion) -> ErrorParts:
    """The parts of the tracking error of a motion."""
    error = motion.tracking_error_m
    speed = np.gradient(motion.reference_m, motion.time_s)
    rows = {
        "speed": speed,
        "acceleration": np.gradient(speed, motion.time_s),
        "direction": direction_of_travel(speed),
        "constant": np.ones_like(error),
    }
    groups = _told_apart(speed, rows["direction"])
    # where the direction is always the same, the constant stands for both
    names = [name for group in groups for name in group if not (name == "direction" and "constant" in group)]
    design = np.column_stack([rows[name] / float(np.abs(rows[name]).max()) for name in names])
    found, *_ = np.linalg.lstsq(design, error, rcond=1e-9)
    weights = {name: float(weight) / float(np.abs(rows[name]).max()) for name, weight in zip(names, found, strict=True)}
    alone = {group[0] for group in groups if len(group) == 1}
    lag, acceleration, reversal, constant = (weights[name] if name in alone else None for name in PARTS)
    columns = [[names.index(name) for name in group if name in names] for group in groups]
    added = _added_squares(design, error, columns)
    called = ["+".join(group) for group in groups]
    squares = {called[at]: square for at, square in added}
    squares[REST] = float(np.sum((error - design @ found) ** 2))
    rms_m = {name: float(np.sqrt(max(square, 0.0) / len(error))) for name, square in squares.items()}
    return ErrorParts(lag, acceleration, reversal, constant, rms_m)


def direction_of_travel(speed_m_per_s: Vector) -> Vector:
    """+1 or −1; while the axis stands that of its last motion, before the first motion 0."""
    sign = np.where(_moves(speed_m_per_s), np.sign(speed_m_per_s), 0.0)
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), 0))
    return np.asarray(sign[last], dtype=np.float64)


def _moves(speed_m_per_s: Vector) -> Mask:
    size = np.abs(speed_m_per_s)
    return np.asarray(size > _STANDSTILL * float(size.max()), dtype=np.bool_)


def _told_apart(speed: Vector, direction: Vector) -> list[tuple[str, ...]]:
    """Names of parts, those together that this motion does not tell apart."""
    moving = np.abs(speed[_moves(speed)])
    if moving.size == 0:
        return [("constant",)]
    one_way = np.unique(direction[direction != 0]).size < 2
    one_speed = float(np.var(moving)) < _ONE_SPEED * float(np.mean(moving**2))
    accelerated: list[tuple[str, ...]] = [("acceleration",)] if np.ptp(speed) > _STANDSTILL * moving.max() else []
    if one_way and one_speed:
        return [("speed", "direction", "constant"), *accelerated]
    if one_way:
        return [("speed",), *accelerated, ("direction", "constant")]
    if one_speed:
        return [("speed", "direction"), *accelerated, ("constant",)]
    return [(name,) for name in PARTS]


def _added_squares(design: Vector, error: Vector, groups: list[list[int]]) -> Iterator[tuple[int, float]]:
    """(group, sum of squares that it adds), the group that adds most first, then again among the others."""
    # least squares need no more of the rows than this triangle
    triangle = np.asarray(np.linalg.qr(np.column_stack([design, error]), mode="r"))
    target = triangle[:, -1]
    left, used = list(range(len(groups))), list[int]()
    explained = 0.0
    while left:
        sums = {}
        for group in left:
            columns = triangle[:, [*used, *groups[group]]]
            fitted = columns @ np.linalg.lstsq(columns, target, rcond=1e-9)[0]
            sums[group] = float(fitted @ fitted)
        best = max(left, key=lambda group: sums[group])
        yield best, sums[best] - explained
        explained = sums[best]
        used += groups[best]
        left.remove(best)


_CREEPS, _JUMPS = 0.5, 2.0  #: Shares of the commanded speed below which the table creeps and above which it jumps.
_LEAST_SHARE, _LEAST_JUMPS = 0.5, 2
_IN_EARNEST = 0.05  #: Share of the largest commanded speed from which on an axis is said to be commanded to move.


@dataclass(frozen=True)
class StickSlip:
    """A table that sticks and slips."""

    #: Share of the time that it is commanded to move in which it stands or goes at less than half that speed
    creeping_share: float
    #: How often it then catches up; the first time in each stretch of one direction, where it breaks loose, left out
    jumps: int


def stick_slip(motion: Motion) -> StickSlip | None:
    """Creeping and jumps of a motion that creeps for most of its time and jumps again and again; None of any other.

    Travel is looked at from sample to sample, so that no short jump is missed. A jump is a fall of the tracking error
    between the outer thirds of what it has for four fifths of the time: small vibrations do not count.
    """
    period_s = np.diff(motion.time_s)
    commanded = np.diff(motion.reference_m) / period_s
    moves = np.abs(commanded) > _IN_EARNEST * float(np.abs(commanded).max(initial=0.0))
    if not moves.any():
        return None
    direction = direction_of_travel(commanded)[moves]
    share = np.diff(motion.table_m)[moves] / period_s[moves] / commanded[moves]
    behind = direction * motion.tracking_error_m[1:][moves]
    creeping = float(np.mean(share < _CREEPS))
    if creeping < _LEAST_SHARE:
        return None
    turns = np.flatnonzero(np.diff(direction) != 0) + 1
    stretches = zip(np.split(share, turns), np.split(behind, turns), strict=True)
    jumps = sum(max(0, _falls(lag) - 1) for speed, lag in stretches if speed.max() > _JUMPS)
    return StickSlip(creeping, jumps) if jumps >= _LEAST_JUMPS else None


def _falls(course: Vector) -> int:
    """How often a course goes from the upper third to the lower third of what it is for four fifths of its samples."""
    low, high = np.quantile(course, [0.1, 0.9])
    third = (high - low) / 3.0
    marks = np.where(course < low + third, -1, np.where(course > high - third, 1, 0))
    marks = marks[marks != 0]
    return int(np.count_nonzero((marks[:-1] == 1) & (marks[1:] == -1)))


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
    axis: Axis  #: Whose loop this is: stiffness and damping may be those of one instant of its runs
    at_m: float | None = None  #: Where its table is then [m; rad]; None: as the axis stands in the file
    at: str = ""  #: The same in words


def loop_summary(axis: Axis) -> LoopSummary | None:
    """Poles, limits, bandwidth and margins of the loop of an axis; None without a servo."""
    return None if axis.servo is None else LoopSummary(stability(axis), loop_figures(axis), axis)


def tightest_loop(model: DriveModel, name: str, runs: Sequence[AxisRun]) -> LoopSummary | None:
    """The loop where it has the least gain margin: as it stands in the file, or at its softest or stiffest in a run.

    None without a servo.
    """
    nearest = loop_summary(runs[0].axis)
    if nearest is None:
        return None
    measures = ROTARY if model.file_axes[name].rotary else LINEAR
    ends: list[tuple[float, AxisRun, ParameterCourse, int]] = []
    for run in runs:
        course = course_of(model, name, run)
        values = None if course is None else course.varying
        if course is not None and values is not None:
            ends += [(float(values[k]), run, course, k) for k in (int(values.argmin()), int(values.argmax()))]
    by_value = sorted(ends, key=lambda one: one[0])
    for _, run, course, k in (*by_value[:1], *by_value[-1:]):
        axis = frozen(run.axis, course, k * course.period_s)
        at_m, (unit, times) = float(run.motion.table_m[k]), measures.position
        at = f" at table position {at_m * times:.4g} {unit}"
        there = LoopSummary(stability(axis), loop_figures(axis), axis, at_m, at)
        nearest = min(nearest, there, key=lambda one: (one.stability.stable, abs(one.figures.gain_margin_db)))
    return nearest


def axis_summary(axis: Axis, reference: Reference, motion: Motion, course: ParameterCourse | None) -> AxisSummary:
    """Errors, limits and ranges of one axis in one run; `course` holds what varied, see `parameters_along`."""
    error = motion.tracking_error_m
    worst = int(np.argmax(np.abs(error)))
    mechanics = axis.mechanics
    stiffness: float | Array | None = None
    damping: float | Array = mechanics.guide_damping_ns_per_m
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


def limited_samples(axis: Axis, reference: Reference, motion: Motion) -> Mask:
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


def _range(values: float | Array) -> tuple[float, float]:
    return float(np.min(values)), float(np.max(values))


@dataclass(frozen=True)
class DriveSummary:
    """What a simulation amounts to."""

    axes: Mapping[str, Mapping[str, AxisSummary]]  #: Run → axis → its errors
    loops: Mapping[str, LoopSummary]  #: Axis → its loop, for those with a control
    quantities: tuple[CircleQuantities, ...] = ()  #: Of circles, slowest feed first
    causes: CircleCauses | None = None  #: Of circles
    #: Axis → how much of its lost motion its own friction and springs make, see `wind_up_m`; None: measured
    wind_up_m: Mapping[str, float] | None = field(default_factory=dict)


def drive_summary(model: DriveModel, simulation: DriveSimulation) -> DriveSummary:
    """The summary of a simulation of this model: of what is recorded, so of circles without run-in and run-out."""
    axes = {
        run: {
            name: axis_summary(seen.axis, seen.reference, seen.motion, course_of(model, name, seen))
            for name, seen in ((name, one.recorded) for name, one in done.items())
        }
        for run, done in simulation.axes.items()
    }
    known = {name: one.axis for done in simulation.axes.values() for name, one in done.items()}
    loops = {name: tightest_loop(model, name, simulation.runs_of(name)) for name in known}
    traces = tuple(simulation.traces.values())
    mechanics = {name: one.axis.mechanics for name, one in model.axes.items()}
    leads = {name: one.lead_m for name, one in mechanics.items() if isinstance(one, ThreeMassMechanics)}
    wound = {name: wind_up_m(axis) for name, axis in known.items()} if traces else {}
    return DriveSummary(
        axes,
        {name: loop for name, loop in loops.items() if loop is not None},
        circle_quantities(traces) if traces else (),
        circle_causes(traces, lead_m=leads) if traces else None,
        {name: size for name, size in wound.items() if size is not None},
    )


def course_of(model: DriveModel, name: str, run: AxisRun) -> ParameterCourse | None:
    """Stiffness and damping that an axis had in a run, given or from its own position and load; None if constant."""
    return run.course or parameters_along(model.parts.get(name), run.axis, run.motion)


def _odd_effects(
    name: str, directions: tuple[tuple[float, float], tuple[float, float]], shares: list[float]
) -> Iterator[Finding]:
    for (sliding, static), way in zip(directions, ("positive", "negative"), strict=True):
        if static < sliding:
            yield FINDINGS.finding(
                "breakaway-below-sliding",
                f"Breakaway friction of {name} in the {way} direction, {static:.6g} N, is below its sliding friction, "
                f"{sliding:.6g} N: friction rises with the speed.",
                Where(channel=name),
                {"static_n": static, "coulomb_n": sliding},
            )
    for number, share in enumerate(shares):
        if abs(share) >= 1.0:
            yield FINDINGS.finding(
                "ripple-beyond-force",
                f"Ripple {number + 1} of {name} is {abs(share):.3g} times the force of the actuator, which it turns "
                "round at times.",
                Where(channel=name),
                {"share": share},
            )


#: Step × fastest rate above which a method of order 4 takes more than 4 % of that vibration a period (2π/144).
COARSE_PER_MODE = 1.0
_LIMIT_SHARE = 0.5  #: Share of the samples at a limit above which a motion is more limit than control.
_START_SHARE = 0.02  #: Speed of the first sample, as a share of the largest, from which on a motion begins with a jolt.


def model_findings(model: DriveModel) -> tuple[Finding, ...]:
    """What is odd before it runs: unlikely numbers, unstable loops, steps that are too coarse, friction that drives."""
    found = list(unlikely_values(model.file, lambda path: str(path[1]) if path[0] == "axes" else None))
    for name, axis in model.file_axes.items():
        found += _odd_effects(name, axis.axis.friction.directions, [one.share for one in axis.axis.ripple])
    for name, axis in model.axes.items():
        found += stability_findings(axis.axis, name)
        step_s, rate = model.file.run.step_s, fastest_rate_per_s(axis.axis)
        if step_s is not None and step_s * rate > COARSE_PER_MODE:
            told = FINDINGS.finding(
                "coarse-step",
                f"The step of {step_s:.3g} s is long for the fastest vibration of {name}, {rate / (2 * math.pi):.4g} "
                "Hz: the calculation damps it.",
                Where(channel=name),
                {"step_s": step_s, "frequency_hz": rate / (2 * math.pi)},
                f"take run.step_s = {COARSE_PER_MODE / rate / 2:.2g} or less, or leave it out",
            )
            found.append(told)
        found += _bristles(name, axis.axis, axis.rotary)
    return tuple(found)


def simulation_findings(
    model: DriveModel, simulation: DriveSimulation, loops: Mapping[str, LoopSummary], *, driven: bool = False
) -> tuple[Finding, ...]:
    """What is odd about what the axes did; of each the worst run, and how many runs it concerns.

    `loops`: those of the summary of the simulation.

    Limits that were reached, commands that cannot be followed, a start in motion, a table that leaves its screw, one
    that sticks and slips, an encoder that is coarser than the error. `driven` says that recordings drove it, not the
    motion of the file.
    """
    found: list[Finding] = []
    kind = "" if driven else model.file.motion.kind
    names = dict.fromkeys(name for done in simulation.axes.values() for name in done)
    for name in names:
        told: dict[str, list[tuple[float, Finding]]] = {}
        loop = loops.get(name)
        if loop is not None and loop.at_m is not None:
            found += stability_findings(loop.axis, name, loop.at)
        stable = loop is None or loop.stability.stable
        for run, done in simulation.axes.items():
            if name in done:
                for size, one in _of_run(name, run, done[name], model.file_axes[name], kind, stable):
                    told.setdefault(one.id, []).append((size, one))
        found += [_worst(ones, len(simulation.axes)) for ones in told.values()]
    return tuple(found)


def _of_run(
    name: str, run: str, done: AxisRun, made: FileAxis, kind: str, stable: bool
) -> Iterator[tuple[float, Finding]]:
    """(how bad, finding) of one axis in one run; `kind` of the motion, empty of a recording."""
    where = Where(channel=name, run=run or None)
    yield from _limits(name, where, done.recorded, stable)
    yield from _too_fast(name, where, done, made.rotary)
    yield from _jolt(name, where, done, made.rotary, kind)
    if made.parts is not None:
        yield from _off_screw(name, where, done, made.parts)
    yield from _sticks(name, where, done.recorded)


def _limits(name: str, where: Where, done: AxisRun, stable: bool) -> Iterator[tuple[float, Finding]]:
    share = float(limited_samples(done.axis, done.reference, done.motion).mean())
    if share == 0:
        return
    said = (
        f"Axis {name} was at the limit of its current or speed for {100 * share:.3g} % of the time; then it does not "
        "follow."
    )
    advice = (
        "the loop is unstable, and so swings from limit to limit: lower its gains first"
        if not stable
        else "ask for less speed or acceleration, check friction, load and actuator_gain, or raise command_limit or "
        "speed_limit of the servo if the machine has more"
    )
    found = FINDINGS.finding(
        "limit-reached", said, where, {"share": share}, advice, level="warning" if share > _LIMIT_SHARE else "info"
    )
    yield share, found


def _too_fast(name: str, where: Where, done: AxisRun, turns: bool) -> Iterator[tuple[float, Finding]]:
    servo = done.axis.servo
    if servo is None or servo.speed_limit is None:
        return
    most = servo.speed_limit * done.axis.mechanics.travel_per_motion
    asked = float(np.abs(done.reference.speed_m_per_s).max())
    if asked > most:
        found = FINDINGS.finding(
            "faster-than-speed-limit",
            f"Axis {name} is asked for {_speed(asked, turns)} and can go {_speed(most, turns)}: it falls behind.",
            where,
            {"asked_m_per_s": asked, "possible_m_per_s": most},
        )
        yield asked / most, found


_AT_REST_FROM = {
    "": "let the recording have the position of the axis, so that it begins as fast as the machine did",
    "sine": "begin at rest: phase_deg = 90",
}
_COURSE = "let the course begin at rest"


def _jolt(name: str, where: Where, done: AxisRun, turns: bool, kind: str) -> Iterator[tuple[float, Finding]]:
    speed = np.abs(done.reference.speed_m_per_s)
    share = float(speed[0] / speed.max()) if speed.max() > 0 else 0.0
    stands = abs(float(done.motion.table_speed_m_per_s[0])) <= _START_SHARE * speed.max()
    if share > _START_SHARE and stands:
        found = FINDINGS.finding(
            "begins-in-motion",
            f"The motion of {name} begins at {_speed(speed[0], turns)} while the axis stands: first it catches up, "
            "which says nothing of its errors later.",
            where,
            {"speed_m_per_s": float(speed[0])},
            f"look at the error after the first moments, or {_AT_REST_FROM.get(kind, _COURSE)}",
        )
        yield share, found


def _off_screw(name: str, where: Where, done: AxisRun, parts: Parts) -> Iterator[tuple[float, Finding]]:
    near, far = -parts.screw.origin_mm * 1e-3, (parts.screw.length_mm - parts.screw.origin_mm) * 1e-3
    places = np.concatenate([done.motion.table_m, done.reference.position_m])
    low, high = float(places.min()), float(places.max())
    beyond = max(near - low, high - far)
    if beyond >= 0:
        found = FINDINGS.finding(
            "table-off-the-screw",
            f"The table of {name} goes from {low * 1e3:.6g} to {high * 1e3:.6g} mm; the nut is on the screw from "
            f"{near * 1e3:.6g} to {far * 1e3:.6g} mm only.",
            where,
            {"from_m": low, "to_m": high, "nut_from_m": near, "nut_to_m": far},
        )
        yield beyond, found


def _sticks(name: str, where: Where, done: AxisRun) -> Iterator[tuple[float, Finding]]:
    slips = stick_slip(done.motion)
    if slips is not None:
        found = FINDINGS.finding(
            "stick-slip",
            f"The table of {name} sticks and slips: it stands or creeps for {100 * slips.creeping_share:.0f} % of "
            f"the time that it is commanded to move, and jumps {slips.jumps} times after it first broke loose.",
            where,
            {"creeping_share": slips.creeping_share, "jumps": slips.jumps},
        )
        yield slips.creeping_share, found


def _speed(speed_m_per_s: float, turns: bool) -> str:
    return f"{speed_m_per_s * 30 / math.pi:.4g} r/min" if turns else f"{speed_m_per_s * 60:.4g} m/min"


def _bristles(name: str, axis: Axis, turns: bool) -> Iterator[Finding]:
    lugre, most = axis.friction.lugre, passive_bristle_damping_ns_per_m(axis)
    if lugre is None or lugre.damping_ns_per_m <= most:
        return
    unit, speed = ("N·m·s/rad", "rad/s") if turns else ("N·s/m", "m/s")
    fading = passive_fading_speed_m_per_s(axis)
    less = f"set friction.lugre.damping_ns_per_m to at most {most:.2g} {unit}"
    if most == 0:
        less = "leave friction.lugre.damping_ns_per_m out"
    other = f", or set fading_speed_m_per_s to at most {fading:.2g} {speed}" if fading > 0 else ""
    yield FINDINGS.finding(
        "bristles-make-energy",
        f"The bristles of {name} are damped by {lugre.damping_ns_per_m:.4g} {unit}; above {most:.4g} {unit} they can "
        "push the table on while it slides, because friction falls from breakaway to sliding: a friction that drives.",
        Where(channel=name),
        {"damping": lugre.damping_ns_per_m, "largest": most, "fading_speed": fading},
        less + other,
    )


def _worst(ones: list[tuple[float, Finding]], runs: int) -> Finding:
    """The worst of findings of one kind, with how many runs have it."""
    worst = max(ones, key=lambda one: one[0])[1]
    if runs == 1 or len(ones) == 1:
        return worst
    said = f"{worst.statement} So in {len(ones)} of {runs} runs; here the worst."
    evidence = {**worst.evidence, "runs": [one.where.run for _, one in ones]}
    return Finding(worst.id, worst.level, said, worst.where, evidence, worst.suggestion, worst.action)
