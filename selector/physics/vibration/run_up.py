"""How does a source move the finals while its shaft changes its speed: quasi-steady, and where that does not hold.

The phase of a line is the integral of the speed, its amplitude that of the frequency of the instant, as if the
structure had had all time to swing up. To first order the true motion differs from it by ½·dω/dt·|d²X/dω²|: of a single
resonance of the half-power width η·f by 10 % of its peak at df/dt = 0.16·(η·f)². What is quicker, or short, is judged
by the modes in time (`swing_up`) and told where it matters beside the whole motion of the final.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.vibration.chain_values import Chain
from selector.physics.vibration.final_motion import Method, final_receptance
from selector.physics.vibration.response_curve import response_curve
from selector.physics.vibration.sameness import above, below
from selector.physics.vibration.shaft_course import ShaftCourse
from selector.physics.vibration.source import Source
from selector.physics.vibration.spectrum import line_force_n
from selector.physics.vibration.structure import Structure
from selector.physics.vibration.swing_up import Answer, LateMotion, late_motion

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]
Beyond = Literal["refuse", "leave-out"]

HURRY = 0.1
"""Share of a final's largest motion from which on it is told that a run-up is too quick."""
_ALIKE = 0.05
"""Share by which two peaks differ that are about as large."""
_STRETCHES = 1000
_UM = 1e6


@dataclass(frozen=True, eq=False)
class Hurry:
    """How far the motion of one final by one source is from the true one, as the coupled structure tells.

    Attributes
    ----------
    final : str
    off_m : float
        Largest difference [m].
    answer : Answer
        Line and mode that differ most.
    changed_hz, rate_hz_per_s : float
        By how much the frequency of the line changes while the mode fades to 1/e, and at most how quickly.
    simulated_m, true_m : float
        Largest motion by the source, in whatever phase it is [m].
    from_s : ndarray of shape (n_stretches,)
        Starts of stretches of the same length [s].
    stretch_off_m : ndarray of shape (n_stretches,)
        Largest difference in each [m].
    stretch_s : float
        Their length [s].
    """

    final: str
    off_m: float
    answer: Answer
    changed_hz: float
    rate_hz_per_s: float
    simulated_m: float
    true_m: float
    from_s: Vector
    stretch_off_m: Vector
    stretch_s: float


@dataclass(frozen=True, eq=False)
class RunUp:
    """What the lines of one source that follow its shaft do, as analytic signals whose imaginary parts are meant.

    Attributes
    ----------
    force_n : complex ndarray of shape (n_times,)
        [N].
    motion_m : complex ndarray of shape (n_finals, n_times)
        [m].
    findings : tuple of Finding
        Lines that the sampling cannot carry, a change from one set of chains to the other.
    hurries : tuple of Hurry
        How far it is from the true motion, one a final; none where nothing has to swing up.
    """

    force_n: Complex
    motion_m: Complex
    findings: tuple[Finding, ...]
    hurries: tuple[Hurry, ...]


def run_up(
    structure: Structure,
    source: Source,
    course: ShaftCourse,
    finals: Mapping[str, str],
    time_s: Vector,
    *,
    half_rate_hz: float,
    method: Method = "coupled",
    chains: Sequence[Chain] = (),
    split_hz: float | None = None,
    beyond: Beyond = "refuse",
) -> RunUp:
    """Force and motion by the lines of `source` that follow its shaft; see `motion_signal`.

    Parameters
    ----------
    half_rate_hz : float
        Half the sampling rate, from which on a line is refused or left out [Hz].

    Raises
    ------
    InputError
        A line that the sampling cannot carry, a resonance without dissipation, or the errors of `final_receptance`.
    """
    lines = [(number, line, line.order) for number, line in enumerate(source.lines) if line.order is not None]
    force = np.zeros(len(time_s), dtype=np.complex128)
    motion = np.zeros((len(finals), len(time_s)), dtype=np.complex128)
    findings: list[Finding] = []
    turns, rpm = course.turns_at(time_s), course.rpm_at(time_s)
    for number, _, order in lines:
        rows = np.flatnonzero(~below(order * rpm / 60.0, half_rate_hz))
        if len(rows):
            highest = order * float(rpm.max()) / 60.0
            findings.append(
                beyond_sampling(source, number, highest, half_rate_hz, beyond, from_s=float(time_s[rows[0]]))
            )

    def solved(frequency: Vector) -> Complex:
        return final_receptance(
            structure, source, frequency, finals, method=method, chains=chains, split_hz=split_hz
        ).motion_m_per_n

    jump_hz = split_hz if method == "chains" else None
    least = min((joint.loss_factor for joint in structure.joints), default=0.0)
    low, high = course.range_rpm(float(time_s[0]), float(time_s[-1]))
    # a hair wider, so that rounding does not lead out of a curve
    ranges = [(order * low / 60.0 * (1.0 - 1e-12), order * high / 60.0 * (1.0 + 1e-12)) for _, _, order in lines]
    curves = [response_curve(solved, *one, loss_factor=least, jump_hz=jump_hz) for one in _joined(ranges)]
    for (_, line, order), (_, highest) in zip(lines, ranges, strict=True):
        curve = next(one for one in curves if highest <= one.highest_hz)
        frequency = order * rpm / 60.0
        turning = line_force_n(line, frequency) * np.exp(2j * np.pi * np.mod(order * turns, 1.0))
        turning[~below(frequency, half_rate_hz)] = 0.0
        force += turning
        motion += curve.at(frequency) * turning
    if jump_hz is not None and any(
        not above(one.lowest_hz, jump_hz) and above(one.highest_hz, jump_hz) for one in curves
    ):
        findings.append(_changes_chains(source, jump_hz))
    late = late_motion(structure, source, course, finals, time_s)
    hurries = () if late is None else tuple(_hurries(late, source, course, tuple(finals), time_s, motion))
    return RunUp(force, motion, tuple(findings), hurries)


def beyond_sampling(
    source: Source,
    number: int,
    frequency_hz: float,
    half_rate_hz: float,
    beyond: Beyond,
    *,
    from_s: float | None = None,
) -> Finding:
    """The finding that a line, counted from 0, is left out from a time on; InputError if it is to be refused."""
    when = "" if from_s is None else f" from {from_s:.4g} s on"
    if beyond == "refuse":
        raise InputError(
            f"a line at {frequency_hz:.6g} Hz{when}",
            expected=f"lines below half the sampling rate, {half_rate_hz:.6g} Hz",
            where=f"sources.{source.name}.lines[{number + 1}]",
            advice=f"sample more often than every {0.5 / frequency_hz:.2g} s, or leave the line out",
        )
    return Finding(
        "line-beyond-sampling",
        "warning",
        f"Line {number + 1} of {source.name} comes to {frequency_hz:.4g} Hz{when}, the sampling carries less than "
        f"{half_rate_hz:.4g} Hz: where it is beyond that, it is left out.",
        Where(from_s=from_s),
        {"source": source.name, "line": number + 1, "frequency_hz": frequency_hz, "half_rate_hz": half_rate_hz},
        "Sample more often if this line matters.",
    )


def too_quick(
    source: Source, hurries: Sequence[Hurry], whole_m: Mapping[str, float], begin_s: float, method: Method
) -> Finding | None:
    """The finding that the true motion differs much from the simulated one, of the final where it does so most.

    Parameters
    ----------
    whole_m : mapping of str to float
        Final → the largest motion of the whole run, by all sources [m].
    begin_s : float
        Time of the first sample [s].
    """
    told = [one for one in hurries if one.off_m > HURRY * whole_m[one.final] > 0.0]
    if not told:
        return None
    worst = max(told, key=lambda one: one.off_m)
    answer, whole, order = worst.answer, whole_m[worst.final], source.lines[worst.answer.line].order or 0.0
    long = worst.from_s[worst.stretch_off_m > HURRY * whole]
    # 10 % of what the mode makes at 0.16 times the square of its half-power width, and then it comes to its peak
    beside = max(whole / answer.steady_m, 1.0)
    slower = min(HURRY * beside * 0.5 * np.pi / (np.pi * answer.ring_s) ** 2, worst.rate_hz_per_s)
    off, simulated, true = (_UM * one for one in (worst.off_m, worst.simulated_m, worst.true_m))
    evidence = {
        "source": source.name,
        "line": answer.line + 1,
        "resonance_hz": answer.mode_hz,
        "changed_hz": worst.changed_hz,
        "rate_hz_per_s": worst.rate_hz_per_s,
        "slower_than_hz_per_s": slower,
        "off_um": off,
        "largest_um": _UM * whole,
        "share": worst.off_m / whole,
    }
    said = (
        f"Order {order:g} of {source.name} changes by {worst.changed_hz:.3g} Hz in "
        + (f"the {answer.ring_s:.3g} s" if np.isfinite(answer.ring_s) else "less than the time")
        + f" that a vibration at the resonance of {answer.mode_hz:.4g} Hz needs to fade to 1/e: the motion of "
        f"{worst.final} differs from the simulated one by up to {off:.3g} µm, "
        + (
            f"{worst.off_m / whole:.0%} of its largest value."
            if worst.off_m < whole
            else "more than its largest value."
        )
    )
    advice = f"Let the frequency change by less than {slower:.3g} Hz/s there"
    if method == "chains":
        said, advice = f"{said} So says the coupled structure.", f"{advice}."
    else:
        evidence |= {"true_um": true, "simulated_um": simulated}
        peaks = f"In its worst phase it comes to about {true:.3g} µm by this source instead of {simulated:.3g} µm"
        if true > (1.0 + _ALIKE) * simulated:
            said += f" {peaks}: what begins so suddenly overshoots."
            advice += f", or reckon with {true:.3g} µm."
        elif true < (1.0 - _ALIKE) * simulated:
            said += f" {peaks}, and later: it has no time to swing up."
            advice += ", or take the simulated peak as an upper limit."
        else:
            said += f" The largest value by this source stays about {true:.3g} µm."
            advice += ", or believe the peak alone, not the course."
    where = Where(
        channel=worst.final, from_s=float(long[0]) - begin_s, to_s=float(long[-1]) + worst.stretch_s - begin_s
    )
    return Finding("run-up-too-quick", "warning", said, where, evidence, advice)


def _hurries(
    late: LateMotion, source: Source, course: ShaftCourse, finals: tuple[str, ...], time_s: Vector, motion_m: Complex
) -> Iterator[Hurry]:
    step, even = float(late.time_s[1] - late.time_s[0]), late.time_s
    starts = np.unique(np.linspace(0, len(even), _STRETCHES, endpoint=False).astype(int))
    for row, (final, answer) in enumerate(zip(finals, late.answers, strict=True)):
        size = np.abs(late.motion_m[row])
        at_s, order = float(even[int(np.argmax(size))]), source.lines[answer.line].order or 0.0
        frequency = order * course.rpm_at(even[(even >= at_s - answer.ring_s) & (even <= at_s)]) / 60.0
        yield Hurry(
            final,
            float(size.max()),
            answer,
            float(np.ptp(frequency)),
            float(np.abs(np.diff(frequency)).max(initial=0.0)) / step,
            float(np.abs(motion_m[row]).max()),
            float(np.abs(motion_m[row] + np.interp(time_s, even, late.motion_m[row])).max()),
            even[starts],
            np.maximum.reduceat(size, starts),
            float(even[-1] - even[0]) / len(starts),
        )


def _changes_chains(source: Source, jump_hz: float) -> Finding:
    return Finding(
        "line-changes-chains",
        "info",
        f"Lines of {source.name} pass {jump_hz:.4g} Hz, where the chains of the other range take over: the motion "
        "jumps there, which no machine does.",
        evidence={"source": source.name, "split_hz": jump_hz},
        suggestion="Simulate a run-up with the coupled structure.",
    )


def _joined(ranges: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Ranges that overlap as one, by frequency."""
    found: list[tuple[float, float]] = []
    for low, high in sorted(ranges):
        if found and low <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], high)
        else:
            found.append((low, high))
    return found
