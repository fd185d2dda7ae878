"""What all feeds of a circular test share: constants of geometry and control, and what a single feed makes of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from selector.physics.drive.ball_bar.basis import CirclePair
from selector.physics.drive.ball_bar.fit import ALARM, CircleFit, amounts_probability
from selector.types import Matrix, Vector

Fits = Sequence[tuple[CirclePair, CircleFit]]

SMALLEST_UM = 0.05
"""Range of a part of the deviation below which it is not told: half of the last digit of a usual bar [µm]."""

SMALLEST_SHARE = 0.002
"""The same, of the range of the deviation: what columns of first order leave out."""

SET_UP = ("centre 0", "centre 1", "set-up 0", "set-up 1")
"""Columns that are no errors of the machine."""

_ENDS = tuple(f"backlash {axis}{end}" for axis in (0, 1) for end in "+-")
_STEADY = ("squareness", "straightness 0", "straightness 1", "scale-mismatch", *_ENDS)
_OF_LAG = ("gain-mismatch", "rotary-lag")
_SURE = 3.0


@dataclass(frozen=True)
class Amount:
    """A number with its standard error and its unit; the standard error is NaN where none can be given."""

    value: float
    standard_error: float
    unit: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", float(self.value))
        object.__setattr__(self, "standard_error", float(self.standard_error))


@dataclass(frozen=True)
class SharedAmount(Amount):
    """An amount of all feeds."""

    found: bool = True  #: Whether it stands out of its error and is large enough to be told
    #: If it was not found: how large it may be nevertheless, 2 standard errors and the smallest size counted
    below: float = math.nan


def smallest_um(pair: CirclePair, fit: CircleFit) -> float:
    """Range of a part of the deviation from which on it is told [µm]."""
    fitted = pair.deviation_um - fit.residual_um - fit.part_um(*SET_UP)
    return max(SMALLEST_UM, SMALLEST_SHARE * float(np.ptp(fitted)))


def lag_parted(fits: Fits) -> tuple[CircleFit, ...]:
    """The fits with what unequal lags make of the amplitudes counted to the lags, not to the scales.

    An axis that lags by T also shrinks its circle, by (ωT)²/2: unequal lags look like unequal scales, −g·κ in cos 2θ
    beside g in d·sin 2θ. With several feeds κ is what grows with feed²; with one it is that of a first-order loop, and
    as uncertain as it is large: a slow velocity loop makes it smaller, feed-forward larger.
    """
    if len(_shared_names(fits, ("scale-mismatch", "gain-mismatch"))) < 2:
        return tuple(fit for _, fit in fits)
    if len(fits) == 1:
        pair, fit = fits[0]
        radius, lag = (float(fit.amounts(name)[0][0]) for name in ("radius", "gain-mismatch"))
        ratio = math.sqrt(max(-2.0 * radius / (pair.radius_um * max(pair.reach, 0.1)), 0.0))
        return (_with_ratio(fit, ratio, abs(lag) * ratio),)
    feeds = _feeds(fits)
    scale, scale_c = _law(fits, "scale-mismatch", np.column_stack([np.ones(len(feeds)), feeds**2]))
    parted = []
    for (_, fit), feed in zip(fits, feeds, strict=True):
        lags, lags_c = fit.amounts("gain-mismatch")
        if amounts_probability(lags, lags_c) < ALARM:
            error = feed**2 * math.sqrt(scale_c[1, 1])
            fit = _with_ratio(fit, -scale[1] * feed**2 / float(lags[0]), error)
        parted.append(fit)
    return tuple(parted)


def steady_fits(fits: Fits) -> tuple[CircleFit, ...]:
    """The fits with errors that cover how far an amount that is constant by nature is from that of all feeds."""
    if len(fits) == 1:
        return (fits[0][1],)
    feeds, one = _feeds(fits), np.ones((len(fits), 1))
    laws = {name: _law(fits, name, one)[0][0] * one[:, 0] for name in _shared_names(fits, _STEADY)}
    laws |= {name: _law(fits, name, feeds[:, None])[0][0] * feeds for name in _shared_names(fits, _OF_LAG)}
    settled = []
    for number, (_, fit) in enumerate(fits):
        wider = np.ones(len(fit.names))
        for name, law in laws.items():
            value, covariance = fit.amounts(name)
            if covariance[0, 0] > 0:
                away = abs(float(value[0]) - float(law[number])) / math.sqrt(covariance[0, 0])
                wider[fit.names.index(name)] = away if away > _SURE else 1.0
        settled.append(replace(fit, covariance=fit.covariance * np.outer(wider, wider)))
    return tuple(settled)


def shared_amounts(fits: Fits, names: tuple[str, ...]) -> dict[str, SharedAmount]:
    """Laws through the feeds: constants of the geometry and of the control."""
    feeds = _feeds(fits)
    radius_um = fits[0][0].radius_um
    per_m = 2e6 / radius_um
    least = min(smallest_um(pair, fit) for pair, fit in fits)
    one, several = np.ones((len(feeds), 1)), len(feeds) > 1
    squares = np.column_stack([one, feeds**2]) if several else one
    found: dict[str, SharedAmount] = {}

    def told(value: float, variance: float, range_um: float, factor: float, unit: str) -> SharedAmount:
        return _shared(value * factor, math.sqrt(variance) * abs(factor), least / range_um * abs(factor), unit)

    radius, radius_c = _law(fits, "radius", squares)
    if several:
        found["radius at standstill"] = told(radius[0], radius_c[0, 0], 1.0, 1.0, "µm")
        falls, error = -2.0 * radius_um * radius[1], 2.0 * radius_um * math.sqrt(radius_c[1, 1])
        if falls > _SURE * error:
            gain = math.sqrt(max(fits[0][0].reach, 0.1) / falls)
            found[RADIUS_GAIN] = SharedAmount(gain, gain * error / falls / 2.0, "1/s")
    fastest = float(feeds[-1])
    rows = (
        ("scale-mismatch", "scale mismatch", one, 2.0, per_m, "µm/m"),
        ("squareness", "squareness", one, 2.0, per_m, "µm/m"),
        ("gain-mismatch", "difference of the lag times", feeds[:, None], 2.0 * fastest, 2e3, "ms"),
        ("rotary-lag", f"lag time of {names[-1]} over that of the others", feeds[:, None], fastest, -1e3, "ms"),
    )
    for column, name, law, range_um, factor, unit in rows:
        if _shared_names(fits, (column,)):
            value, variance = _law(fits, column, law)
            found[name] = told(value[0], variance[0, 0], range_um, factor, unit)
    gained = found.get(RADIUS_GAIN)
    late = found.get("difference of the lag times")
    if gained is not None and late is not None and late.found:
        percent = -late.value * gained.value * 0.1
        error = math.hypot(late.standard_error * gained.value * 0.1, percent * gained.standard_error / gained.value)
        found[GAIN_MISMATCH] = SharedAmount(percent, error, f"% {names[0]} over {names[1]}")
    for axis, name in enumerate(names[:2]):
        for end, word in (("+", "positive"), ("-", "negative")):
            gap, gap_c = _law(fits, f"backlash {axis}{end}", one)
            found[f"backlash {name}, {word} end"] = told(gap[0], gap_c[0, 0], 1.0, 1.0, "µm")
    return found


RADIUS_GAIN = "gain by the radius, of a first-order loop"
"""The mean gain that makes a first-order loop shrink the circle as it does."""

GAIN_MISMATCH = "gain mismatch, of first-order loops"
"""Difference of the lag times over the mean lag time that this gain means."""


def _shared(value: float, error: float, least: float, unit: str) -> SharedAmount:
    found = abs(value) >= least and amounts_probability(np.array([value]), np.array([[error**2]])) < ALARM
    return SharedAmount(value, error, unit, found, max(abs(value) + 2.0 * error, least))


def _feeds(fits: Fits) -> Vector:
    return np.array([pair.speed_um_per_s for pair, _ in fits])


def _shared_names(fits: Fits, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name in names if all(name in fit.names for _, fit in fits))


def _with_ratio(fit: CircleFit, ratio: float, error_um: float) -> CircleFit:
    """The fit with `ratio` times the column of the scales taken off that of the lags."""
    scale, lag = fit.names.index("scale-mismatch"), fit.names.index("gain-mismatch")
    columns, coefficients = fit.columns.copy(), fit.coefficients.copy()
    columns[:, lag] -= ratio * columns[:, scale]
    coefficients[scale] += ratio * coefficients[lag]
    turned = np.eye(len(fit.names))
    turned[scale, lag] = ratio
    covariance = turned @ fit.covariance @ turned.T
    covariance[scale, scale] += error_um**2
    return replace(fit, columns=columns, coefficients=coefficients, covariance=covariance)


def _law(fits: Fits, name: str, columns: Matrix) -> tuple[Vector, Matrix]:
    """Coefficients of an amount over the feeds, and their covariance: wider where feeds disagree more than they may."""
    pairs = [fit.amounts(name) for _, fit in fits]
    values = np.array([float(value[0]) for value, _ in pairs])
    # an amount without any error would silence the others
    errors = np.sqrt(np.array([float(covariance[0, 0]) for _, covariance in pairs]))
    errors = np.maximum(errors, 1e-9 + 1e-6 * np.abs(values))
    size = np.abs(columns).max(axis=0)
    weighted = columns / size / errors[:, None]
    inverse = np.linalg.inv(weighted.T @ weighted)
    amounts = inverse @ weighted.T @ (values / errors)
    spare = len(values) - columns.shape[1]
    left = values / errors - weighted @ amounts
    wider = max(1.0, float(left @ left) / spare) if spare > 0 else 1.0
    return amounts / size, inverse * wider / np.outer(size, size)
