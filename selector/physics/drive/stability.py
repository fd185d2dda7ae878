"""How fast the loop of an axis is, whether it is stable, and up to which gains."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.drive import closed_loop
from selector.physics.drive.finding_table import FINDINGS
from selector.physics.drive.parts.axis import Axis, RigidMechanics
from selector.physics.drive.trajectory import COURSES, ParameterCourse
from selector.types import Array, Complex, Mask, Vector

GAINS = ("position_gain_per_s", "velocity_gain", "velocity_integral_gain")

_BEYOND = 1e3  #: How far the frequencies reach above and below those of the poles; farther off no phase turns any more.
_A_DECADE, _A_TURN = 60, 48
_NEAR = np.geomspace(1e-9, 0.5, 60)  #: Distances from a resonance, as a share of its frequency, where it is looked at.
_NO_PHASE = 1e-11  #: Sine of an angle that is rounding.
_RIGHT_ANGLE = 0.7  #: Sine of an angle that is nearer to a right one than to 0.
_HALVINGS = 60
_KNOTS = 50  #: Of a cubic spline; what stands farther off moves it by less than rounding, a quarter as much a knot.


@dataclass(frozen=True)
class Crossing:
    """Poles that reach the edge of stability."""

    factor: float  #: On the gain
    #: How many poles more grow with a larger factor: 2 of a pair, 1 where a sampled loop swings from sample to sample;
    #: negative if fewer
    grow: int


def gain_crossings(axis: Axis, gain: str, poles: Complex) -> tuple[Crossing, ...]:
    """Where poles reach the edge of stability as one of `GAINS` changes, the others as they are; by factor.

    `poles` of the closed loop [1/s] tell where to look; the gain must be above 0.

    InputError if the axis has no servo, or numbers too far apart to be calculated with.
    """
    rad = _frequencies(axis, poles)
    sine = _sine(*_loop_of_gain(axis, gain, rad))
    told = np.abs(sine) > _NO_PHASE
    rad, sine = rad[told], sine[told]
    at = np.flatnonzero(np.sign(sine[:-1]) != np.sign(sine[1:]))
    low, high, before = rad[at], rad[at + 1], sine[at]
    for _ in range(_HALVINGS if len(at) else 0):
        middle = np.sqrt(low * high)
        same = np.sign(_sine(*_loop_of_gain(axis, gain, middle))) == np.sign(before)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    found = list(zip(np.sqrt(low * high), np.where(before < 0, 2, -2), strict=True))
    # at half the sample rate L is real; turned by a right angle up to there it is 0, which no factor brings to the edge
    if np.isfinite(edge := closed_loop.nyquist_rad_per_s(axis)) and len(sine) and abs(sine[-1]) < _RIGHT_ANGLE:
        found.append((edge, 1 if sine[-1] < 0 else -1))
    crossings = []
    for frequency, grow in found:
        numerator, denominator = _loop_of_gain(axis, gain, np.array([frequency]))
        with np.errstate(all="ignore"):
            factor = float(-(denominator / numerator).real[0])
        if np.isfinite(factor) and factor > 0:
            crossings.append(Crossing(factor, int(grow)))
    return tuple(sorted(crossings, key=lambda one: one.factor))


def stable_factors(crossings: tuple[Crossing, ...], growing: int) -> tuple[float | None, float | None]:
    """Ends of the range of factors nearest to 1 with which nothing grows; (None, 0) if there is none.

    `crossings` are those of `gain_crossings`, and `growing` poles grow with factor 1.
    """
    factors = [one.factor for one in crossings]
    first = int(np.searchsorted(factors, 1.0, side="right"))
    # poles that grow between crossing number i − 1 and i
    between = [0] * (len(crossings) + 1)
    between[first] = growing
    for number in range(first, len(crossings)):
        between[number + 1] = between[number] + crossings[number].grow
    for number in range(first, 0, -1):
        between[number - 1] = between[number] - crossings[number - 1].grow
    ends: list[float | None] = [None, *factors, None]
    ranges = [(ends[i], ends[i + 1]) for i, count in enumerate(between) if count <= 0]
    return min(ranges, key=_distance, default=(None, 0.0))


def _distance(ends: tuple[float | None, float | None]) -> float:
    """Of a range from the factor 1, as a logarithm."""
    low, high = ends
    return max(float(np.log(low)) if low else 0.0, -float(np.log(high)) if high else 0.0, 0.0)


def _loop_of_gain(axis: Axis, gain: str, rad_per_s: Vector) -> tuple[Complex, Complex]:
    """Numerator and denominator of L, which 1 + k·L = 0 is about."""
    servo, found = closed_loop.servo_of(axis), closed_loop.loop_response(axis, rad_per_s)
    integral = servo.velocity_integral_gain * found.integral
    position = servo.position_gain_per_s / axis.mechanics.travel_per_motion * found.measured
    if gain == "position_gain_per_s":
        control = servo.velocity_gain + integral
        return control * position, 1.0 + control * found.motor_speed
    if gain == "velocity_gain":
        return servo.velocity_gain * (found.motor_speed + position), 1.0 + integral * (found.motor_speed + position)
    return integral * (found.motor_speed + position), 1.0 + servo.velocity_gain * (found.motor_speed + position)


def _sine(numerator: Complex, denominator: Complex) -> Vector:
    """Sine of the angle of L; free of the poles and zeros that L may have on the edge itself."""
    with np.errstate(all="ignore"):
        turned = numerator / np.abs(numerator) * np.conj(denominator / np.abs(denominator))
    return np.nan_to_num(turned.imag)


def _frequencies(axis: Axis, poles: Complex) -> Vector:
    """Frequencies between which no phase turns unseen: decades, turns of the delay, and both sides of resonances."""
    servo, edge = closed_loop.servo_of(axis), closed_loop.nyquist_rad_per_s(axis)
    own = closed_loop.plant(closed_loop.small_signal_mechanics(axis)).poles
    corners = np.abs(np.concatenate([poles, own]))
    corners = np.append(corners, [servo.position_gain_per_s, servo.velocity_integral_gain / servo.velocity_gain])
    corners = corners[corners > 1e-15 * corners.max()]
    lowest, highest = corners.min() / _BEYOND, min(corners.max() * _BEYOND, edge)
    lowest = min(lowest, highest / _BEYOND)
    rows = [np.geomspace(lowest, highest, int(_A_DECADE * np.log10(highest / lowest)) + 2)]
    swinging = np.unique(np.abs(np.concatenate([poles, own]).imag))
    rows += [swinging * (1.0 + side * share) for share in _NEAR for side in (-1.0, 1.0)]
    if np.isfinite(edge):
        samples = servo.delay_s / servo.sample_s + (
            axis.sensing.speed_samples if axis.sensing.speed_from_encoder else 1
        )
        rows.append(np.linspace(0.0, edge, int(_A_TURN * (samples + 2.0)) + 2))
    rad = np.unique(np.concatenate(rows))
    return np.asarray(rad[(rad >= lowest) & (rad <= highest) & (rad < edge * (1.0 - 1e-9))])


@dataclass(frozen=True)
class LoopFigures:
    """Key figures of a position loop; NaN where the loop is unstable, infinite where there is no such limit."""

    bandwidth_hz: float  #: Where the amplitude of the table falls 3 dB below the reference for the first time [Hz]
    #: peak and peak_hz: Largest amplitude of table / reference, and where; 1 at 0 Hz if nothing is amplified
    peak: float
    peak_hz: float
    #: gain_margin_db and phase_margin_deg: Margins of the opened position loop; that of the gain is exact, and negative
    #: where less gain is nearer to the edge than more
    gain_margin_db: float
    phase_margin_deg: float


def frequency_response(axis: Axis, frequency_hz: ArrayLike) -> Complex:
    """Table position over reference at frequencies [Hz], complex, shape of `frequency_hz`.

    With a sampled servo of the table at the samples, which means something up to half the sample rate. With
    feed-forward, the reference's derivatives are part of it.
    """
    rad_per_s = 2.0 * math.pi * np.asarray(frequency_hz, dtype=np.float64)
    return closed_loop.loop_response(axis, rad_per_s).reference_to_table(axis)


def loop_figures(axis: Axis) -> LoopFigures:
    """Bandwidth, resonance and margins of the position loop; the phase margin by python-control.

    InputError if the axis has no servo.
    """
    import control

    poles = closed_loop.loop_poles(axis)
    if len(closed_loop.growing_poles(poles)):
        return LoopFigures(*[math.nan] * 5)
    # frequencies that miss nothing: 4000 over all that the poles ask for, and those of the poles
    size, own_hz = np.abs(poles), np.abs(poles.imag) / (2.0 * math.pi)
    highest_hz = min(20.0 * float(size.max()), closed_loop.nyquist_rad_per_s(axis)) / (2.0 * math.pi)
    lowest_hz = 1e-3 * float(size[size > 0].min()) / (2.0 * math.pi)
    frequency_hz = np.unique(np.concatenate([np.geomspace(lowest_hz, highest_hz, 4000), own_hz[own_hz > lowest_hz]]))
    frequency_hz = frequency_hz[frequency_hz < highest_hz]
    peak, peak_hz, bandwidth_hz = _resonance(axis, frequency_hz)
    # from the response itself: crossings of polynomials are too inexact in z, and where numbers are far apart
    rad = 2.0 * math.pi * frequency_hz
    response = closed_loop.loop_response(axis, rad).opened_position_loop(axis)
    near = _near_crossover(response)
    opened = control.frd(response[near], rad[near], smooth=True)
    phase_deg = float(control.stability_margins(opened)[1])
    # the nearest factor on the position gain with which the loop is at the edge
    factors = [one.factor for one in gain_crossings(axis, "position_gain_per_s", poles)]
    gain_db = 20.0 * math.log10(min(factors, key=lambda factor: abs(math.log(factor)), default=math.inf))
    return LoopFigures(bandwidth_hz, peak, peak_hz, gain_db, phase_deg)


def _near_crossover(response: Complex) -> Mask:
    """Which frequencies stand near one where the amplitude passes 1; the first ones if none does.

    A phase margin needs no others, and python-control evaluates its spline singly at each that it is given.
    """
    beyond = np.abs(response) > 1.0
    passed = np.flatnonzero(beyond[1:] != beyond[:-1])
    near = np.zeros(len(response), dtype=np.bool_)
    for at in passed if len(passed) else [0]:
        near[max(at - _KNOTS, 0) : at + _KNOTS + 2] = True
    return near


def frozen(axis: Axis, course: ParameterCourse, time_s: float) -> Axis:
    """The axis with the stiffness and damping that a course has at one instant [s], held.

    InputError if the instant is outside the course, or the course has a stiffness and the axis no spring.
    """
    courses = {name: samples for name in COURSES if (samples := getattr(course, name)) is not None}
    end_s = course.period_s * (min(map(len, courses.values()), default=1) - 1)
    springless = isinstance(axis.mechanics, RigidMechanics) and "axial_stiffness_n_per_m" in courses
    if springless or not 0.0 <= time_s <= end_s * (1.0 + 1e-12):
        raise InputError(
            "a course of the axial stiffness for a rigid axis" if springless else f"an instant at {time_s:g} s",
            expected=f"an axis with a spring, and an instant from 0 to {end_s:g} s",
            where="frozen frequency response",
            advice="describe motor, screw and table" if springless else "choose an instant within the course",
        )
    values: dict[str, Any] = {
        name: float(np.interp(time_s, np.arange(len(samples)) * course.period_s, samples))
        for name, samples in courses.items()
    }
    compliance = None if "axial_stiffness_n_per_m" in values else axis.compliance
    return replace(axis, mechanics=replace(axis.mechanics, **values), compliance=compliance)


def _resonance(axis: Axis, frequency_hz: Array) -> tuple[float, float, float]:
    """Largest amplitude, where, and the first frequency 3 dB below the amplitude at rest."""
    amplitude = np.abs(frequency_response(axis, frequency_hz))
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


LEAST_GAIN_MARGIN_DB, LEAST_PHASE_MARGIN_DEG = 6.0, 20.0

_MOST_POLES = 4
_SLOWER = tuple(0.5**power for power in range(1, 15))


@dataclass(frozen=True)
class Stability:
    """Poles of a closed loop, and how far its gains may go."""

    #: Poles [1/s], the slowest or growing ones first; of a sampled servo ln(z)/sample time
    poles: Complex
    stable: bool  #: Whether every pole decays
    margin_per_s: float  #: Rate at which the slowest decays; negative: at which the fastest grows [1/s]
    #: Gain → factor from which on the loop is unstable, the other gains as they are; None: never
    gain_limits: Mapping[str, float | None]
    #: Gain → factor below which it is unstable; None: there is none. Both are the ends of the range of stable factors
    #: that is nearest to 1; a limit of 0 means that no factor makes the loop stable.
    gain_floors: Mapping[str, float | None]

    def __post_init__(self) -> None:
        poles = np.array(self.poles, dtype=np.complex128)
        poles.setflags(write=False)
        object.__setattr__(self, "poles", poles)


def stability(axis: Axis) -> Stability:
    """Poles, margin and limits of the gains; of a sampled servo from the exact discrete-time loop.

    InputError if the axis has no servo.
    """
    poles = closed_loop.loop_poles(axis)
    growing = len(closed_loop.growing_poles(poles))
    margin = -float(poles.real.max())
    ranges = {
        name: stable_factors(gain_crossings(axis, name, poles), growing)
        for name in GAINS
        if getattr(closed_loop.servo_of(axis), name) > 0
    }
    return Stability(
        poles=poles,
        stable=growing == 0,
        # a slow pole that decays may be computed as one that grows by rounding
        margin_per_s=max(margin, 0.0) if growing == 0 else margin,
        gain_limits={name: high for name, (_, high) in ranges.items()},
        gain_floors={name: low for name, (low, _) in ranges.items()},
    )


def stability_findings(axis: Axis, where: str, at: str = "") -> Iterator[Finding]:
    """What a person must know about the loop of the axis called `where`: unstable, or less than 6 dB or 20° from it.

    `at` says where along its travel it is so.

    An axis without a servo has no loop and no findings.
    """
    if axis.servo is None:
        return
    found = stability(axis)
    evidence: dict[str, Any] = {
        "margin_per_s": found.margin_per_s,
        "gain_limits": dict(found.gain_limits),
        "gain_floors": dict(found.gain_floors),
    }
    if not found.stable:
        growing = [pole for pole in closed_loop.growing_poles(found.poles) if pole.imag >= 0]
        told = [_pole_in_words(pole, axis.servo.sample_s) for pole in growing[:_MOST_POLES]]
        if len(growing) > _MOST_POLES:
            told.append(f"{len(growing) - _MOST_POLES} more")
        yield FINDINGS.finding(
            "unstable-loop",
            f"The control loop of {where}{at} is unstable: it has {' and '.join(told)}.",
            Where(channel=where),
            evidence={
                **evidence,
                "poles_per_s": [[pole.real, pole.imag] for pole in growing],
                "frequency_hz": [abs(pole.imag) / (2.0 * math.pi) for pole in growing],
            },
            suggestion=_remedy(axis, found),
        )
        return
    figures = loop_figures(axis)
    little = [
        f"{value:.1f} {unit} of {name} margin, less than {least:g} {unit}"
        for value, least, unit, name in (
            (figures.gain_margin_db, LEAST_GAIN_MARGIN_DB, "dB", "gain"),
            (figures.phase_margin_deg, LEAST_PHASE_MARGIN_DEG, "degrees", "phase"),
        )
        if abs(value) < least
    ]
    if little:
        for name in ("gain_margin_db", "phase_margin_deg"):
            value = getattr(figures, name)
            evidence[name] = value if math.isfinite(value) else None
        yield FINDINGS.finding(
            "little-stability-margin",
            f"The position loop of {where}{at} is stable with {' and '.join(little)}.",
            Where(channel=where),
            evidence,
            suggestion=f"It swings after every change. {_limits_in_words(axis, found)}",
        )


def _remedy(axis: Axis, found: Stability) -> str:
    """What makes an unstable loop stable: one gain if that does, else less delay or a slower loop."""
    if any(high != 0.0 for high in found.gain_limits.values()):
        return _limits_in_words(axis, found)
    servo, told = closed_loop.servo_of(axis), ["No gain alone makes it stable."]
    if servo.sample_s > 0:
        delay = f"delay_s ({_seconds(servo.delay_s)}) and " if servo.delay_s > 0 else ""
        told.append(f"Shorten {delay}sample_s ({_seconds(servo.sample_s)}) of the servo, or lower the gains together.")
    slower = next(
        (by for by in _SLOWER if not len(closed_loop.growing_poles(closed_loop.loop_poles(_slower(axis, by))))), None
    )
    if slower is not None:
        names = " and ".join(f"{name} {slower * getattr(servo, name):.3g}" for name in GAINS[:2])
        integral = f", {GAINS[2]} {slower**2 * servo.velocity_integral_gain:.3g}" * (servo.velocity_integral_gain > 0)
        told.append(f"It is stable with {names}{integral}.")
    return " ".join(told)


def _slower(axis: Axis, by: float) -> Axis:
    servo = closed_loop.servo_of(axis)
    gains = {name: by * getattr(servo, name) for name in GAINS[:2]}
    return replace(axis, servo=replace(servo, **gains, velocity_integral_gain=by**2 * servo.velocity_integral_gain))


def _limits_in_words(axis: Axis, found: Stability) -> str:
    limits = [_limit_in_words(axis, name, found) for name in found.gain_limits]
    return "With the other gains as they are: " + "; ".join(limits) + "."


def _limit_in_words(axis: Axis, name: str, found: Stability) -> str:
    value, low, high = getattr(axis.servo, name), found.gain_floors[name], found.gain_limits[name]
    if high == 0.0:
        return f"no {name} makes it stable"
    if low is None and high is None:
        return f"{name} may have any value"
    parts = [] if low is None else [f"above {low * value:.4g} ({low:.3g} times what it is)"]
    parts += [] if high is None else [f"below {high * value:.4g} ({high:.3g} times what it is)"]
    return f"stable with {name} {' and '.join(parts)}"


def _pole_in_words(pole: complex, sample_s: float) -> str:
    grows = f"growing e-fold in {_seconds(1.0 / pole.real)}" if pole.real > 0 else "that does not decay"
    if sample_s > 0 and abs(pole.imag * sample_s / math.pi - 1.0) < 1e-9:
        # ln z of a real z below 0, which has no twin
        z = -math.exp(pole.real * sample_s)
        return f"a pole at z = {z:.4g}, a swing to and fro from sample to sample {grows}"
    if pole.imag == 0:
        return f"a pole at {pole.real:.3g} 1/s, {grows}"
    return (
        f"poles at {pole.real:.3g} ± {pole.imag:.4g}j 1/s, an oscillation at {pole.imag / (2.0 * math.pi):.3g} Hz "
        f"{grows} (damping ratio {-pole.real / abs(pole):.3g})"
    )


def _seconds(value: float) -> str:
    return f"{value:.3g} s" if value >= 1 else f"{value * 1e3:.3g} ms"
