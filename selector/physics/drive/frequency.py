"""How fast the loop of an axis is: frequency response, bandwidth, resonance, margins; also frozen at instants."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.course import ParameterCourse
from selector.physics.drive.gain_limits import gain_crossings
from selector.physics.drive.loop_poles import growing_poles, loop_poles
from selector.physics.drive.loop_response import loop_response, nyquist_rad_per_s
from selector.physics.drive.mechanics import Mechanics, RigidMechanics


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
        Margins of the opened position loop; that of the gain is exact, and negative where less gain is nearer to the
        edge than more.
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
    """Bandwidth, resonance and margins of the position loop; the phase margin by python-control.

    Raises
    ------
    InputError
        If the axis has no servo.
    """
    import control

    poles = loop_poles(axis)
    if len(growing_poles(poles)):
        return LoopFigures(*[math.nan] * 7)
    frequency_hz = _frequencies_hz(axis, poles)
    peak, peak_hz, bandwidth_hz = _resonance(axis, frequency_hz)
    gain_db, gain_hz = _gain_margin(axis, poles)
    # from the response itself: crossings of polynomials are too inexact in z, and where numbers are far apart
    rad = 2.0 * math.pi * frequency_hz
    opened = control.frd(loop_response(axis, rad).opened_position_loop(axis), rad, smooth=True)
    _, phase, _, _, phase_rad, _ = control.stability_margins(opened)
    return LoopFigures(
        bandwidth_hz=bandwidth_hz,
        peak=peak,
        peak_hz=peak_hz,
        gain_margin_db=gain_db,
        phase_margin_deg=float(phase),
        gain_margin_hz=gain_hz,
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


def _gain_margin(axis: Axis, poles: NDArray[np.complex128]) -> tuple[float, float]:
    """Nearest factor on the position gain with which the loop is at the edge [dB], and where [Hz]."""
    crossings = gain_crossings(axis, "position_gain_per_s", poles)
    if not crossings:
        return math.inf, math.nan
    nearest = min(crossings, key=lambda one: abs(math.log(one.factor)))
    return 20.0 * math.log10(nearest.factor), nearest.rad_per_s / (2.0 * math.pi)


def _reference_to_table(axis: Axis, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
    return loop_response(axis, 2.0 * math.pi * frequency_hz).reference_to_table(axis)


def _resonance(axis: Axis, frequency_hz: NDArray[np.float64]) -> tuple[float, float, float]:
    """Largest amplitude, where, and the first frequency 3 dB below the amplitude at rest."""
    amplitude = np.abs(_reference_to_table(axis, frequency_hz))
    highest = int(np.argmax(amplitude))
    below = np.flatnonzero(amplitude < 1.0 / math.sqrt(2.0))
    bandwidth_hz = math.inf
    if len(below) and below[0] > 0:
        pair = slice(below[0] - 1, below[0] + 1)
        bandwidth_hz = float(np.interp(-1.0 / math.sqrt(2.0), -amplitude[pair], frequency_hz[pair]))
    # rounding is no resonance
    if amplitude[highest] <= 1.0 + 1e-9:
        return 1.0, 0.0, bandwidth_hz
    return float(amplitude[highest]), float(frequency_hz[highest]), bandwidth_hz


def _frequencies_hz(axis: Axis, poles: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Frequencies that miss nothing: 4000 over all that the poles ask for, and those of the poles."""
    size = np.abs(poles)
    highest_hz = min(20.0 * float(size.max()), nyquist_rad_per_s(axis)) / (2.0 * math.pi)
    lowest_hz = 1e-3 * float(size[size > 0].min()) / (2.0 * math.pi)
    near = np.abs(poles.imag) / (2.0 * math.pi)
    frequency_hz = np.unique(np.concatenate([np.geomspace(lowest_hz, highest_hz, 4000), near[near > lowest_hz]]))
    return np.asarray(frequency_hz[frequency_hz < highest_hz])
