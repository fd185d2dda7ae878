"""Whether the loop of an axis is stable, with which poles, and up to which gains."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from selector.findings import Finding, Where
from selector.physics.drive.axis import Axis
from selector.physics.drive.closed_loop import closed_loop, servo_of
from selector.physics.drive.frequency import loop_figures
from selector.physics.drive.sampled_loop import sampled_closed_loop

GAINS = ("position_gain_per_s", "velocity_gain", "velocity_integral_gain")
LEAST_GAIN_MARGIN_DB, LEAST_PHASE_MARGIN_DEG = 6.0, 20.0
# factors that are tried: forty a decade, so that no narrower range of stable gains is of use to anybody
FACTORS = np.geomspace(1e-4, 1e4, 321)


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
    poles = _poles(axis)
    growth = float(poles.real.max())
    ranges = {name: _stable_factors(axis, name) for name in GAINS if getattr(servo_of(axis), name) > 0}
    return Stability(
        poles=poles,
        stable=growth < -_rounding(poles),
        margin_per_s=-growth,
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
    limits = [_limit_in_words(axis, name, found) for name in found.gain_limits]
    evidence = {
        "margin_per_s": found.margin_per_s,
        "gain_limits": dict(found.gain_limits),
        "gain_floors": dict(found.gain_floors),
    }
    if not found.stable:
        growing = [pole for pole in found.poles if pole.real >= -_rounding(found.poles) and pole.imag >= 0]
        return (
            Finding(
                id="unstable-loop",
                level="error",
                statement=f"The control loop of {where} is unstable: it has {_joined(map(_pole_in_words, growing))}.",
                where=Where(channel=where),
                evidence={
                    **evidence,
                    "poles_per_s": [[pole.real, pole.imag] for pole in growing],
                    "frequency_hz": [abs(pole.imag) / (2.0 * math.pi) for pole in growing],
                },
                suggestion="With the other gains as they are: " + "; ".join(limits) + ".",
            ),
        )
    figures = loop_figures(axis)
    little = [
        f"{value:.1f} {unit} of {name} margin, less than {least:g} {unit}"
        for value, least, unit, name in (
            (figures.gain_margin_db, LEAST_GAIN_MARGIN_DB, "dB", "gain"),
            (figures.phase_margin_deg, LEAST_PHASE_MARGIN_DEG, "degrees", "phase"),
        )
        if value < least
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
            suggestion="It swings after every change. With the other gains as they are: " + "; ".join(limits) + ".",
        ),
    )


def _poles(axis: Axis) -> NDArray[np.complex128]:
    servo = servo_of(axis)
    if servo.sample_s > 0:
        z = sampled_closed_loop(axis).poles
        # what decays within one sample has no logarithm and is of no interest here
        poles: NDArray[np.complex128] = np.asarray(np.log(np.where(np.abs(z) > 1e-12, z, 1e-12)) / servo.sample_s)
    else:
        poles = closed_loop(axis).poles
    return np.asarray(poles[np.argsort(-poles.real, kind="stable")])


def _rounding(poles: NDArray[np.complex128]) -> float:
    return 1e-10 * float(np.abs(poles).max())


def _stable_factors(axis: Axis, name: str) -> tuple[float | None, float | None]:
    """Ends of the range of factors nearest to 1 with which the loop is stable."""

    def growth(log_factor: float) -> float:
        servo = servo_of(axis)
        changed = replace(servo, **{name: getattr(servo, name) * math.exp(log_factor)})
        return float(_poles(replace(axis, servo=changed)).real.max())

    logs = np.log(FACTORS)
    is_stable = np.array([growth(value) < 0.0 for value in logs])
    if not is_stable.any():
        return None, 0.0
    inside = int(np.flatnonzero(is_stable)[np.argmin(np.abs(logs[is_stable]))])
    low = high = inside
    while low > 0 and is_stable[low - 1]:
        low -= 1
    while high < len(logs) - 1 and is_stable[high + 1]:
        high += 1
    floor = None if low == 0 else math.exp(optimize.brentq(growth, logs[low - 1], logs[low]))
    limit = None if high == len(logs) - 1 else math.exp(optimize.brentq(growth, logs[high], logs[high + 1]))
    return floor, limit


def _limit_in_words(axis: Axis, name: str, found: Stability) -> str:
    value, low, high = getattr(axis.servo, name), found.gain_floors[name], found.gain_limits[name]
    if high == 0.0:
        return f"no {name} makes it stable"
    if low is None and high is None:
        return f"{name} may have any value"
    parts = [] if low is None else [f"above {low * value:.4g} ({low:.3g} times what it is)"]
    parts += [] if high is None else [f"below {high * value:.4g} ({high:.3g} times what it is)"]
    return f"stable with {name} {' and '.join(parts)}"


def _pole_in_words(pole: complex) -> str:
    grows = f"growing e-fold in {_seconds(1.0 / pole.real)}" if pole.real > 0 else "that does not decay"
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
