"""How does a source move the finals while its shaft changes its speed: quasi-steady, and where that does not hold.

The phase of a line is the integral of the speed, its amplitude that of the frequency of the instant, as if the
structure had had all time to swing up. To first order the true motion differs from it by ½·dω/dt·|d²X/dω²|: of a single
resonance of the half-power width η·f by 10 % of its peak at df/dt = 0.16·(η·f)². Faster run-ups are told as a finding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.vibration.chain_values import Chain
from selector.physics.vibration.final_motion import Method, final_receptance
from selector.physics.vibration.response_curve import response_curve
from selector.physics.vibration.shaft_course import ShaftCourse
from selector.physics.vibration.source import Source
from selector.physics.vibration.spectrum import line_force_n
from selector.physics.vibration.structure import Structure

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]
Beyond = Literal["refuse", "leave-out"]

HURRY = 0.1
"""Share of the largest motion from which on a run-up is told as too quick for its resonance."""


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
        Lines that the sampling cannot carry, a run-up that is too quick, a change from one set of chains to the other.
    """

    force_n: Complex
    motion_m: Complex
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class _Hurry:
    """Where the first-order error of the quasi-steady motion is largest, as a share of the largest motion."""

    share: float
    line: int
    order: float
    final: str
    row: int
    rate_hz_per_s: float


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
    hurried: list[_Hurry] = []
    turns, rpm = course.turns_at(time_s), course.rpm_at(time_s)
    for number, _, order in lines:
        rows = np.flatnonzero(order * rpm / 60.0 >= half_rate_hz)
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
    for (number, line, order), (_, highest) in zip(lines, ranges, strict=True):
        curve = next(one for one in curves if highest <= one.highest_hz)
        frequency = order * rpm / 60.0
        amplitude, response = line_force_n(line, frequency), curve.at(frequency)
        bend = np.abs(curve.at(frequency, derivative=2)) * np.abs(amplitude)
        size = np.abs(response) * np.abs(amplitude)
        for place, final in enumerate(finals):
            worst = _worst(course, time_s, turns, order, size[place], bend[place])
            if worst is not None and worst[0] > HURRY:
                hurried.append(_Hurry(worst[0], number, order, final, worst[1], worst[2]))
        turning = amplitude * np.exp(2j * np.pi * np.mod(order * turns, 1.0))
        turning[frequency >= half_rate_hz] = 0.0
        force += turning
        motion += response * turning
    if hurried:
        findings.append(_too_quick(source, max(hurried, key=lambda one: one.share), time_s, rpm))
    if jump_hz is not None and any(one.lowest_hz <= jump_hz < one.highest_hz for one in curves):
        findings.append(_changes_chains(source, jump_hz))
    return RunUp(force, motion, tuple(findings))


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


def _worst(
    course: ShaftCourse, time: Vector, turns: Vector, order: float, size: Vector, bend: Vector
) -> tuple[float, int, float] | None:
    """Largest first-order error as a share of the largest motion, its row, and the rate of the frequency [Hz/s]."""
    sharpest = int(np.argmax(bend))
    if size.max() == 0.0 or bend[sharpest] == 0.0:
        return None
    # 1/(decay rate) of the resonance that bends the most: it feels mean speeds over this time, not what is quicker
    memory = 1.0 / (2.0 * np.pi * np.sqrt(2.0 * size[sharpest] / bend[sharpest]))
    before, after = course.turns_at(time - memory), course.turns_at(time + memory)
    rate = order * np.abs(before - 2.0 * turns + after) / memory**2
    share = rate * bend / (4.0 * np.pi * size.max())
    row = int(np.argmax(share))
    return float(share[row]), row, float(rate[row])


def _too_quick(source: Source, hurry: _Hurry, time: Vector, rpm: Vector) -> Finding:
    at_hz, at_s = hurry.order * float(rpm[hurry.row]) / 60.0, float(time[hurry.row])
    most = hurry.rate_hz_per_s * HURRY / hurry.share
    return Finding(
        "run-up-too-quick",
        "warning",
        f"Order {hurry.order:g} of {source.name} goes through {at_hz:.4g} Hz at {hurry.rate_hz_per_s:.3g} Hz/s: a "
        f"resonance has no time to swing up there, and the motion of {hurry.final} differs from the simulated one by "
        + (f"about {hurry.share:.0%} of its largest value" if hurry.share < 0.5 else "as much as it is large")
        + ". The true peak is lower and comes later.",
        Where(channel=hurry.final, from_s=at_s, to_s=at_s),
        {
            "source": source.name,
            "line": hurry.line + 1,
            "frequency_hz": at_hz,
            "rate_hz_per_s": hurry.rate_hz_per_s,
            "share": hurry.share,
            "slower_than_hz_per_s": most,
        },
        f"Let the frequency change by less than {most:.3g} Hz/s there, or take the peak as an upper limit.",
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
