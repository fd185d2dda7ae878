"""Whether the loop of an axis is stable, with which poles, and up to which gains."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.physics.drive.axis import Axis
from selector.physics.drive.closed_loop import servo_of
from selector.physics.drive.frequency import loop_figures
from selector.physics.drive.gain_limits import GAINS, gain_crossings, stable_factors
from selector.physics.drive.loop_poles import growing_poles, loop_poles

LEAST_GAIN_MARGIN_DB, LEAST_PHASE_MARGIN_DEG = 6.0, 20.0

_MOST_POLES = 4
_SLOWER = tuple(0.5**power for power in range(1, 15))


@dataclass(frozen=True)
class Stability:
    """Poles of a closed loop, and how far its gains may go.

    Attributes
    ----------
    poles : ndarray of complex
        Poles [1/s], the slowest or growing ones first; of a sampled servo ln(z)/sample time.
    stable : bool
        Whether every pole decays.
    margin_per_s : float
        Rate at which the slowest decays; negative: at which the fastest grows [1/s].
    gain_limits : mapping of str to float or None
        Gain → factor from which on the loop is unstable, the other gains as they are; None: never.
    gain_floors : mapping of str to float or None
        Gain → factor below which it is unstable; None: there is none. Both are the ends of the range of stable factors
        that is nearest to 1; a limit of 0 means that no factor makes the loop stable.
    """

    poles: NDArray[np.complex128]
    stable: bool
    margin_per_s: float
    gain_limits: Mapping[str, float | None]
    gain_floors: Mapping[str, float | None]

    def __post_init__(self) -> None:
        poles = np.array(self.poles, dtype=np.complex128)
        poles.setflags(write=False)
        object.__setattr__(self, "poles", poles)


def stability(axis: Axis) -> Stability:
    """Poles, margin and limits of the gains; of a sampled servo from the exact discrete-time loop.

    Raises
    ------
    InputError
        If the axis has no servo.
    """
    poles = loop_poles(axis)
    growing = len(growing_poles(poles))
    margin = -float(poles.real.max())
    ranges = {
        name: stable_factors(gain_crossings(axis, name, poles), growing)
        for name in GAINS
        if getattr(servo_of(axis), name) > 0
    }
    return Stability(
        poles=poles,
        stable=growing == 0,
        # a slow pole that decays may be computed as one that grows by rounding
        margin_per_s=max(margin, 0.0) if growing == 0 else margin,
        gain_limits={name: high for name, (_, high) in ranges.items()},
        gain_floors={name: low for name, (low, _) in ranges.items()},
    )


def stability_findings(axis: Axis, where: str) -> tuple[Finding, ...]:
    """What a person must know about the loop of the axis called `where`: unstable, or less than 6 dB or 20° from it.

    An axis without a servo has no loop and no findings.
    """
    if axis.servo is None:
        return ()
    found = stability(axis)
    evidence = {
        "margin_per_s": found.margin_per_s,
        "gain_limits": dict(found.gain_limits),
        "gain_floors": dict(found.gain_floors),
    }
    if not found.stable:
        growing = [pole for pole in growing_poles(found.poles) if pole.imag >= 0]
        told = [_pole_in_words(pole, axis.servo.sample_s) for pole in growing[:_MOST_POLES]]
        if len(growing) > _MOST_POLES:
            told.append(f"{len(growing) - _MOST_POLES} more")
        return (
            Finding(
                id="unstable-loop",
                level="error",
                statement=f"The control loop of {where} is unstable: it has {_joined(told)}.",
                where=Where(channel=where),
                evidence={
                    **evidence,
                    "poles_per_s": [[pole.real, pole.imag] for pole in growing],
                    "frequency_hz": [abs(pole.imag) / (2.0 * math.pi) for pole in growing],
                },
                suggestion=_remedy(axis, found),
            ),
        )
    figures = loop_figures(axis)
    little = [
        f"{value:.1f} {unit} of {name} margin, less than {least:g} {unit}"
        for value, least, unit, name in (
            (figures.gain_margin_db, LEAST_GAIN_MARGIN_DB, "dB", "gain"),
            (figures.phase_margin_deg, LEAST_PHASE_MARGIN_DEG, "degrees", "phase"),
        )
        if abs(value) < least
    ]
    if not little:
        return ()
    return (
        Finding(
            id="little-stability-margin",
            level="warning",
            statement=f"The position loop of {where} is stable with {_joined(little)}.",
            where=Where(channel=where),
            evidence={
                **evidence,
                **{
                    name: value if math.isfinite(value := getattr(figures, name)) else None
                    for name in ("gain_margin_db", "phase_margin_deg")
                },
            },
            suggestion=f"It swings after every change. {_limits_in_words(axis, found)}",
        ),
    )


def _remedy(axis: Axis, found: Stability) -> str:
    """What makes an unstable loop stable: one gain if that does, else less delay or a slower loop."""
    if any(high != 0.0 for high in found.gain_limits.values()):
        return _limits_in_words(axis, found)
    servo, told = servo_of(axis), ["No gain alone makes it stable."]
    if servo.sample_s > 0:
        delay = f"delay_s ({_seconds(servo.delay_s)}) and " if servo.delay_s > 0 else ""
        told.append(f"Shorten {delay}sample_s ({_seconds(servo.sample_s)}) of the servo, or lower the gains together.")
    slower = next((by for by in _SLOWER if not len(growing_poles(loop_poles(_slower(axis, by))))), None)
    if slower is not None:
        names = " and ".join(f"{name} {slower * getattr(servo, name):.3g}" for name in GAINS[:2])
        integral = f", {GAINS[2]} {slower**2 * servo.velocity_integral_gain:.3g}" * (servo.velocity_integral_gain > 0)
        told.append(f"It is stable with {names}{integral}.")
    return " ".join(told)


def _slower(axis: Axis, by: float) -> Axis:
    """The same axis with a loop that is slower by a factor."""
    servo = servo_of(axis)
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


def _joined(parts: object) -> str:
    return " and ".join(str(part) for part in parts)  # type: ignore[attr-defined]
