"""What is odd about a feed drive: numbers that no machine has, what shows before it runs, and what it did."""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from selector.findings import Finding, Where
from selector.physics.drive.drive_model import DriveModel, DriveSimulation
from selector.physics.drive.drive_summary import LoopSummary, limited_samples, stick_slip
from selector.physics.drive.file.model_schema import FileAxis
from selector.physics.drive.finding_table import FINDINGS
from selector.physics.drive.loop.closed_loop import fastest_rate_per_s
from selector.physics.drive.loop.stability import stability_findings
from selector.physics.drive.parts.axis import Axis, passive_bristle_damping_ns_per_m, passive_fading_speed_m_per_s
from selector.physics.drive.parts.catalogue import Parts
from selector.physics.drive.simulation import AxisRun
from selector.physics.model_fields import unlikely_values


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
