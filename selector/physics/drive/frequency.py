"""How fast the loop of an axis is: frequency response, bandwidth, resonance, margins; also frozen at instants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.closed_loop import closed_loop, opened_position_loop, servo_of
from selector.physics.drive.course import ParameterCourse
from selector.physics.drive.mechanics import Mechanics, RigidMechanics
from selector.physics.drive.sampled_loop import SampledLoop, sampled_closed_loop, sampled_opened_position_loop
from selector.physics.system import StateSpace


@dataclass(frozen=True)
class LoopFigures:
    """Key figures of a position loop; NaN where the loop is unstable, infinite where there is no such limit.

    Attributes
    ----------
    bandwidth_hz : float
        Where the amplitude of the table falls 3 dB below the reference for the first time [Hz].
    peak, peak_hz : float
        Largest amplitude of table / reference, and where; 1 at 0 Hz if nothing is amplified.
    gain_margin_db, phase_margin_deg : float
        Margins of the opened position loop.
    gain_margin_hz, phase_margin_hz : float
        Where they are found [Hz].
    """

    bandwidth_hz: float
    peak: float
    peak_hz: float
    gain_margin_db: float
    phase_margin_deg: float
    gain_margin_hz: float
    phase_margin_hz: float


def frequency_response(axis: Axis, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """Table position over reference at frequencies [Hz], complex, shape of `frequency_hz`.

    With a sampled servo of the table at the samples, which means something up to half the sample rate. With
    feed-forward, the reference's derivatives are part of it.
    """
    return _reference_to_table(axis, np.asarray(frequency_hz, dtype=np.float64))


def loop_figures(axis: Axis) -> LoopFigures:
    """Bandwidth, resonance and margins of the position loop, by python-control.

    Raises
    ------
    InputError
        If the axis has no servo.
    """
    import control

    opened, closed = _as_control(_opened(axis), 0, control), _closed(axis)
    if not _is_stable(closed):
        return LoopFigures(*[math.nan] * 7)
    peak, peak_hz, bandwidth_hz = _resonance(axis)
    # python-control finds crossings from polynomials, which are too inexact in z: there it gets the response itself
    if isinstance(closed, SampledLoop):
        rad = 2.0 * math.pi * _frequencies_hz(closed)
        opened = control.frd(opened(np.exp(1j * rad * closed.step_s)), rad, smooth=True)
    gain, phase, _, gain_rad, phase_rad, _ = control.stability_margins(opened)
    return LoopFigures(
        bandwidth_hz=bandwidth_hz,
        peak=peak,
        peak_hz=peak_hz,
        gain_margin_db=20.0 * math.log10(gain) if math.isfinite(gain) else math.inf,
        phase_margin_deg=float(phase),
        gain_margin_hz=float(gain_rad) / (2.0 * math.pi),
        phase_margin_hz=float(phase_rad) / (2.0 * math.pi),
    )


def frozen(axis: Axis, course: ParameterCourse, time_s: float) -> Axis:
    """The axis with the stiffness and damping that a course has at one instant [s], held.

    Raises
    ------
    InputError
        If the instant is outside the course, or the course has a stiffness and the axis no spring.
    """
    mechanics: Mechanics = axis.mechanics
    values: dict[str, float] = {}
    for name in ("axial_stiffness_n_per_m", "guide_damping_ns_per_m"):
        samples = getattr(course, name)
        if samples is None:
            continue
        times = np.arange(len(samples)) * course.period_s
        if not 0.0 <= time_s <= times[-1] * (1.0 + 1e-12):
            raise InputError(
                f"{time_s:g} s",
                expected=f"an instant from 0 to {times[-1]:g} s",
                where="frozen frequency response",
                advice="choose an instant within the course of parameters",
            )
        values[name] = float(np.interp(time_s, times, samples))
    if isinstance(mechanics, RigidMechanics):
        if "axial_stiffness_n_per_m" in values:
            raise InputError(
                "a course of the axial stiffness for a rigid axis",
                expected="a course of the damping alone",
                where="frozen frequency response",
                advice="describe motor, screw and table",
            )
        return replace(axis, mechanics=replace(mechanics, **values))
    compliance = None if "axial_stiffness_n_per_m" in values else axis.compliance
    return replace(axis, mechanics=replace(mechanics, **values), compliance=compliance)


def frozen_figures(axis: Axis, course: ParameterCourse, times_s: Sequence[float]) -> tuple[LoopFigures, ...]:
    """`loop_figures` with the parameters of a course at each instant [s] (F fig. 8)."""
    return tuple(loop_figures(frozen(axis, course, time_s)) for time_s in times_s)


def _is_stable(loop: StateSpace | SampledLoop) -> bool:
    if isinstance(loop, SampledLoop):
        return bool(np.abs(loop.poles).max() < 1.0)
    return bool(loop.poles.real.max() < 0.0)


def _opened(axis: Axis) -> StateSpace | SampledLoop:
    sampled = servo_of(axis).sample_s > 0
    return sampled_opened_position_loop(axis) if sampled else opened_position_loop(axis)


def _closed(axis: Axis) -> StateSpace | SampledLoop:
    return sampled_closed_loop(axis) if servo_of(axis).sample_s > 0 else closed_loop(axis)


def _as_control(loop: StateSpace | SampledLoop, source: int, control: Any) -> Any:
    """One input and the first output of a loop as python-control knows it."""
    column, row = slice(source, source + 1), slice(0, 1)
    period = loop.step_s if isinstance(loop, SampledLoop) else 0
    return control.ss(loop.A, loop.B[:, column], loop.C[row], loop.D[row, column], period)


def _reference_to_table(axis: Axis, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
    import control

    loop = _closed(axis)
    s = 2j * math.pi * frequency_hz
    at = np.exp(s * loop.step_s) if isinstance(loop, SampledLoop) else s
    response = _as_control(loop, 0, control)(at)
    servo = servo_of(axis)
    for source, share in ((1, servo.velocity_feedforward), (2, servo.acceleration_feedforward)):
        if share > 0:
            response = response + s**source * _as_control(loop, source, control)(at)
    return np.asarray(response, dtype=np.complex128)


def _resonance(axis: Axis) -> tuple[float, float, float]:
    """Largest amplitude, where, and the first frequency 3 dB below the amplitude at rest."""
    frequency_hz = _frequencies_hz(_closed(axis))
    amplitude = np.abs(_reference_to_table(axis, frequency_hz))
    highest = int(np.argmax(amplitude))
    below = np.flatnonzero(amplitude < 1.0 / math.sqrt(2.0))
    bandwidth_hz = math.inf
    if len(below) and below[0] > 0:
        pair = slice(below[0] - 1, below[0] + 1)
        bandwidth_hz = float(np.interp(-1.0 / math.sqrt(2.0), -amplitude[pair], frequency_hz[pair]))
    if amplitude[highest] <= 1.0:
        return 1.0, 0.0, bandwidth_hz
    return float(amplitude[highest]), float(frequency_hz[highest]), bandwidth_hz


def _frequencies_hz(loop: StateSpace | SampledLoop) -> NDArray[np.float64]:
    """Frequencies that miss nothing: 4000 over all that the poles ask for, and those of the poles."""
    poles: NDArray[np.complex128] = loop.poles
    if isinstance(loop, SampledLoop):
        poles = np.asarray(np.log(poles[np.abs(poles) > 1e-6]) / loop.step_s)
        highest_hz = 0.5 / loop.step_s
    else:
        highest_hz = 20.0 * float(np.abs(poles).max()) / (2.0 * math.pi)
    lowest_hz = 1e-3 * float(np.abs(poles).min()) / (2.0 * math.pi)
    near = np.abs(poles.imag) / (2.0 * math.pi)
    frequency_hz = np.unique(np.concatenate([np.geomspace(lowest_hz, highest_hz, 4000), near[near > lowest_hz]]))
    return np.asarray(frequency_hz[frequency_hz < highest_hz])
