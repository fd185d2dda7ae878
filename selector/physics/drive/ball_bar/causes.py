"""What is behind a circular test: which causes make the deviation, how much each, and what would compensate them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import optimize

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.drive.ball_bar.basis import CirclePair, pair_of, smooth_columns
from selector.physics.drive.ball_bar.circle import BallBarTrace, paired
from selector.physics.drive.ball_bar.fit import ALARM, CircleFit, amounts_probability, circle_fit
from selector.physics.drive.finding_table import FINDINGS
from selector.types import Matrix, Vector

Fits = Sequence[tuple[CirclePair, CircleFit]]

#: Range of a part of the deviation below which it is not told: half of the last digit of a usual bar [µm].
SMALLEST_UM = 0.05
SMALLEST_SHARE = 0.002  #: The same, of the range of the deviation: what columns of first order leave out.
SET_UP = ("centre 0", "centre 1", "set-up 0", "set-up 1")  #: Columns that are no errors of the machine.
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

    Unequal lags look like unequal scales (docs/explanation/ball-bar.md), −g·κ in cos 2θ beside g in d·sin 2θ. With
    several feeds κ is what grows with feed²; with one it is that of a first-order loop, as uncertain as it is large.
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
        value, error, small = value * factor, math.sqrt(variance) * abs(factor), least / range_um * abs(factor)
        is_told = abs(value) >= small and amounts_probability(np.array([value]), np.array([[error**2]])) < ALARM
        return SharedAmount(value, error, unit, is_told, max(abs(value) + 2.0 * error, small))

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


#: The mean gain that makes a first-order loop shrink the circle as it does.
RADIUS_GAIN = "gain by the radius, of a first-order loop"
#: Difference of the lag times over the mean lag time that this gain means.
GAIN_MISMATCH = "gain mismatch, of first-order loops"


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


Kind = Literal[
    "radius",
    "gain-mismatch",
    "rotary-lag",
    "squareness",
    "scale-mismatch",
    "straightness",
    "backlash",
    "reversal-spike",
    "cyclic-pitch",
]

_PLAIN = 0.1
_STRUCTURED = 3.0
#: After a reversal; so many usual residuals are no chance, of 100 samples there.
_NARROW_SAMPLES, _NARROW_STANDS_OUT = 3, 8.0


@dataclass(frozen=True)
class Cause:
    """One cause at one feed."""

    kind: Kind  #: What it is
    axis: str | None  #: Axis it belongs to
    #: Whether it stands out of the residual: its chance is below `ALARM` over all causes and shapes tried
    found: bool
    amounts: Mapping[str, Amount]  #: Its numbers by name
    range_um: float  #: Deviation it makes by itself, from its innermost to its outermost, 0 included [µm]
    share: float  #: Of the sum of squares of the deviation about its centre; shares and what remains add up to 1
    probability: float  #: Chance of an amount like this if the cause is not there


@dataclass(frozen=True, eq=False)
class FeedCauses:
    """The causes at one feed."""

    feed_mm_per_min: float  #: Feed [mm/min]
    causes: tuple[Cause, ...]  #: Those that were found first, the largest first
    #: Axis → place of the spindle ball against the middle: set-up, no error of the machine
    centre: Mapping[str, Amount]
    #: deviation_rms_um, remaining_rms_um and remaining_share: Deviation about its centre; what no cause explains [µm],
    #: as a share of the sum of squares
    deviation_rms_um: float
    remaining_rms_um: float
    remaining_share: float

    def cause(self, kind: Kind, axis: str | None = None) -> Cause:
        """The cause of this kind, of this axis if it belongs to one."""
        return next(one for one in self.causes if (one.kind, one.axis) == (kind, axis))


@dataclass(frozen=True)
class CircleCauses:
    """The causes at every feed, slowest first; the laws through all of them; and what cannot be told apart."""

    feeds: tuple[FeedCauses, ...]
    through_feeds: Mapping[str, SharedAmount]
    findings: tuple[Finding, ...]


def circle_causes(traces: Sequence[BallBarTrace], *, lead_m: Mapping[str, float] | None = None) -> CircleCauses:
    """The deviation of a circular test, taken apart.

    Each feed by itself: least squares on the columns of `circle_basis`, then laws through the feeds: lag and length of
    the bar part by feed², squareness and gain mismatch by the direction.

    The traces are both directions at one or more feeds, of two linear axes; with a rotary one where its `table_ball` is
    known. `lead_m` is axis → lead of its screw [m]: wavelength of the cyclic error; where it is missing it is searched.

    InputError if a direction is missing, or the place of the ball on a rotary axis.
    """
    leads = dict(lead_m or {})
    pairs = paired(traces)
    names = pairs[0][0].axes
    if any(pair[0].axes != names or pair[0].radius_m != pairs[0][0].radius_m for pair in pairs):
        raise _unfit("circles of different axes or radii", "one circle at several feeds", "analyse them one by one")
    tables = {(one.table_ball, one.start_angle_rad) for pair in pairs for one in pair if len(names) == 3}
    if len(names) == 3 and (len(tables) != 1 or None in next(iter(tables))):
        raise _unfit(
            f"a rotary axis ({names[2]}) and no or several places of its ball",
            "one table_ball, and start_angle_rad, in all traces",
            "say where the ball of the workpiece stood on the table",
        )
    if not set(leads) <= set(names[:2]) or not all(0 < lead <= pairs[0][0].radius_m for lead in leads.values()):
        raise _unfit(
            f"leads {leads}", f"leads in m of {' and '.join(names)}, up to the radius", "give the leads of the screws"
        )
    waves = {names.index(name): lead * 1e6 for name, lead in leads.items()}
    circles = [pair_of(pair) for pair in pairs]
    fits = [(circle, circle_fit(circle, waves)) for circle in circles]
    fits = list(zip(circles, lag_parted(fits), strict=True))
    shared = shared_amounts(fits, names)
    fits = list(zip(circles, steady_fits(fits), strict=True))
    feeds = tuple(_feed(pair, fit, names) for pair, fit in fits)
    return CircleCauses(feeds, shared, (*_not_apart(circles[0], names), *_findings(feeds, fits, names)))


def _feed(pair: CirclePair, fit: CircleFit, names: tuple[str, ...]) -> FeedCauses:
    centred = pair.deviation_um - fit.part_um(*SET_UP)
    total = float(centred @ centred)
    per_m = 2e6 / pair.radius_um
    least = smallest_um(pair, fit)

    def cause(kind: Kind, axis: int | None, columns: Sequence[str], amounts: Mapping[str, Amount], tried: int) -> Cause:
        values, covariance = fit.amounts(*columns)
        part = fit.part_um(*columns)
        chance = amounts_probability(values, covariance, tried)
        range_um = float(max(part.max(), 0.0) - min(part.min(), 0.0))
        found, name = chance < ALARM and range_um >= least, None if axis is None else names[axis]
        share = float(part @ centred) / total if total > 0 else 0.0
        return Cause(kind, name, found, amounts, range_um, share, chance)

    causes = [cause("radius", None, ["radius"], _radius(pair, fit), 1)]
    if "gain-mismatch" in fit.names:
        lags = {
            "difference of the lags": _scaled(fit, "gain-mismatch", 2.0, "µm"),
            "difference of the lag times": _scaled(fit, "gain-mismatch", 2e3 / pair.speed_um_per_s, "ms"),
        }
        causes.append(cause("gain-mismatch", None, ["gain-mismatch"], lags, 1))
    if "rotary-lag" in fit.names:
        late = _scaled(fit, "rotary-lag", -1e3 / pair.speed_um_per_s, "ms")
        causes.append(cause("rotary-lag", 2, ["rotary-lag"], {"lag time over that of the others": late}, 1))
    scaled: tuple[tuple[Kind, str], ...] = (("squareness", "squareness"), ("scale-mismatch", "scale"))
    for kind, called in scaled:
        if kind in fit.names:
            causes.append(cause(kind, None, [kind], {called: _scaled(fit, kind, per_m, "µm/m")}, 1))
    for axis in (0, 1):
        bow, ends = f"straightness {axis}", [f"backlash {axis}+", f"backlash {axis}-"]
        tops, waves = [f"spike {axis}+", f"spike {axis}-"], [f"cyclic {axis}c", f"cyclic {axis}s"]
        if bow in fit.names:
            causes.append(cause("straightness", axis, [bow], {"bow": _scaled(fit, bow, 1.0, "µm")}, 1))
        causes += [
            cause("backlash", axis, ends, _of_ends(fit, ends), 1),
            cause("reversal-spike", axis, tops, _spikes(pair, fit, axis, tops), fit.shapes.spikes_tried),
            cause("cyclic-pitch", axis, waves, _cyclic(fit, axis, waves), fit.shapes.wavelengths_tried[axis]),
        ]
    causes.sort(key=lambda one: (not one.found, -one.range_um))
    remaining = float(fit.residual_um @ fit.residual_um)
    rms, rest = math.sqrt(total / len(centred)), math.sqrt(remaining / len(centred))
    centre = {name: _scaled(fit, f"centre {axis}", 1.0, "µm") for axis, name in enumerate(names[:2])}
    share = remaining / total if total > 0 else 0.0
    return FeedCauses(pair.speed_um_per_s * 60e-3, tuple(causes), centre, rms, rest, share)


def _scaled(fit: CircleFit, name: str, factor: float, unit: str) -> Amount:
    values, covariance = fit.amounts(name)
    return Amount(float(values[0]) * factor, math.sqrt(float(covariance[0, 0])) * abs(factor), unit)


def _weighted(fit: CircleFit, names: Sequence[str], weights: Sequence[float]) -> Amount:
    values, covariance = fit.amounts(*names)
    w = np.array(weights)
    return Amount(float(w @ values), math.sqrt(float(w @ covariance @ w)), "µm")


def _radius(pair: CirclePair, fit: CircleFit) -> dict[str, Amount]:
    change = _scaled(fit, "radius", 1.0, "µm")
    amounts = {"radius": change}
    if change.value < 0:
        gain = pair.speed_um_per_s * math.sqrt(max(pair.reach, 0.1) / (-2.0 * pair.radius_um * change.value))
        amounts["gain if all of it is lag"] = Amount(gain, gain * change.standard_error / -change.value / 2.0, "1/s")
    return amounts


def _of_ends(fit: CircleFit, ends: Sequence[str]) -> dict[str, Amount]:
    return {
        "at the positive end": _scaled(fit, ends[0], 1.0, "µm"),
        "at the negative end": _scaled(fit, ends[1], 1.0, "µm"),
        "mean": _weighted(fit, ends, (0.5, 0.5)),
    }


def _spikes(pair: CirclePair, fit: CircleFit, axis: int, tops: Sequence[str]) -> dict[str, Amount]:
    width_s, steepness = fit.shapes.spike[axis]
    return {
        **_of_ends(fit, tops),
        "width": _shape(fit, f"spike {axis} width", width_s * 1e3, "ms"),
        "travel": _shape(fit, f"spike {axis} width", width_s * pair.speed_um_per_s * 1e-3, "mm"),
        "steepness": _shape(fit, f"spike {axis} steepness", steepness, "–"),
    }


def _shape(fit: CircleFit, name: str, value: float, unit: str) -> Amount:
    """A searched number; its error is known relative to it, and only where its cause stands out."""
    if name not in fit.names:
        return Amount(value, math.nan, unit)
    at = fit.names.index(name)
    return Amount(value, value * math.sqrt(float(fit.covariance[at, at])), unit)


def _cyclic(fit: CircleFit, axis: int, waves: Sequence[str]) -> dict[str, Amount]:
    values, _ = fit.amounts(*waves)
    size = float(np.hypot(values[0], values[1]))
    direction = values / size if size > 0 else np.array([1.0, 0.0])
    along = _weighted(fit, waves, [float(one) for one in direction])
    return {
        "amplitude": Amount(size, along.standard_error, "µm"),
        "wavelength": _shape(fit, f"cyclic {axis} wavelength", fit.shapes.wavelength_um[axis] * 1e-3, "mm"),
    }


def _narrow_spikes(feed: FeedCauses, pair: CirclePair, fit: CircleFit, names: Sequence[str]) -> Iterator[Finding]:
    """Axes with something at their reversals that stands out and is too narrow for these samples to be fitted."""
    step_rad = 2.0 * math.pi * len(pair.parts) / len(pair.angle_rad)
    spread = 1.4826 * float(np.median(np.abs(fit.residual_um)))
    for axis, name in enumerate(names[:2]):
        near = np.min(pair.courses[axis].since_reversal_rad, axis=0) < _NARROW_SAMPLES * step_rad
        off = float(np.abs(fit.residual_um[near]).max(initial=0.0))
        if off > _NARROW_STANDS_OUT * spread and not feed.cause("reversal-spike", name).found:
            found = f"Within {_NARROW_SAMPLES} samples after {name} turns, at {feed.feed_mm_per_min:.4g} mm/min, "
            found += f"{off:.3g} µm are left where {spread:.2g} µm are usual: a spike too narrow for samples "
            found += f"{np.degrees(step_rad):.2g}° apart."
            evidence = {"feed_mm_per_min": feed.feed_mm_per_min, "left_um": off, "spread_um": spread}
            yield FINDINGS.finding("ball-bar-narrow-spike", found, Where(channel=name), evidence)


def _findings(
    feeds: Sequence[FeedCauses], fits: Sequence[tuple[CirclePair, CircleFit]], names: Sequence[str]
) -> Iterator[Finding]:
    if len(feeds) == 1:
        yield FINDINGS.finding(
            "ball-bar-single-feed",
            f"At one feed ({feeds[0].feed_mm_per_min:.4g} mm/min) lag of the drives, an error of the bar's length and "
            "a scale error of both axes all change the radius alike, and different scales look like different "
            "amplitudes.",
        )
    for feed, (pair, fit) in zip(feeds, fits, strict=True):
        yield from _narrow_spikes(feed, pair, fit, names)
        if feed.remaining_share > _PLAIN and fit.resemblance > _STRUCTURED:
            yield FINDINGS.finding(
                "ball-bar-unexplained",
                f"At {feed.feed_mm_per_min:.4g} mm/min {feed.remaining_rms_um:.2g} µm (RMS) of "
                f"{feed.deviation_rms_um:.2g} µm follow none of the causes and are not noise.",
                Where(),
                {"feed_mm_per_min": feed.feed_mm_per_min, "remaining_share": feed.remaining_share},
            )


def _not_apart(pair: CirclePair, names: tuple[str, ...]) -> Iterator[Finding]:
    """What the place of the ball on the rotary axis hides."""
    hidden = [name for name in smooth_columns(pair) if name not in pair.smooth]
    if "rotary-lag" in hidden:
        yield FINDINGS.finding(
            "ball-bar-rotary-lag-hidden",
            f"The ball of the workpiece stands in line with the bar, or at the centre of {names[2]}: lag of it against "
            "the linear axes moves it across the bar and does not show.",
        )
    if "set-up 0" in hidden or "set-up 1" in hidden:
        yield FINDINGS.finding(
            "ball-bar-set-up-turns",
            f"The ball's place on {names[2]} turns with it: what the set-up is off looks like another length of the "
            f"bar or another centre of {names[2]} and is not told apart from them.",
        )
    others = [name for name in hidden if name != "rotary-lag" and not name.startswith("set-up")]
    if others:
        yield FINDINGS.finding(
            "ball-bar-alike",
            f"On this circle {', '.join(others)} cannot be told apart from other causes and are left out.",
            Where(),
            {"left_out": others},
        )


def _unfit(found: str, expected: str, advice: str) -> InputError:
    return InputError(found, expected=expected, where="causes of a circular test", advice=advice)


@dataclass(frozen=True)
class ReversalPulse:
    """What the control has to add to the set speed of an axis when it turns, amplitude·exp(−t/reset time)."""

    axis: str
    feed_mm_per_min: float
    acceleration_m_per_s2: float  #: Of the axis where it turns, v²/R: the scale of an adaptation characteristic
    height_um: Amount  #: Of the spikes that it is to take away, mean of both ends
    amplitude: Amount | None  #: In the new direction [mm/min]; None where gain or reset time is not known


@dataclass(frozen=True)
class Compensations:
    """Values for a control; what was not found is not there."""

    backlash: Mapping[str, Amount]  #: Axis → lost motion, mean of both ends [µm]
    delay: tuple[str, Amount] | None  #: The axis that is ahead, and by how long [ms]
    pulses: tuple[ReversalPulse, ...]

    @property
    def any(self) -> bool:
        """Whether there is anything to compensate."""
        return bool(self.backlash or self.delay or self.pulses)


def compensations(
    causes: CircleCauses, axes: tuple[str, ...], radius_m: float, reset_s: Mapping[str, float]
) -> Compensations:
    """What would take the causes away; `reset_s` is axis → reset time Tn of its velocity controller [s]."""
    through, backlash, delay = causes.through_feeds, dict[str, Amount](), None
    for axis in axes[:2]:
        ends = [through[f"backlash {axis}, {end} end"] for end in ("positive", "negative")]
        if all(end.found for end in ends):
            error = math.hypot(*(end.standard_error for end in ends)) / 2.0
            backlash[axis] = Amount(sum(end.value for end in ends) / 2.0, error, "µm")
    late = through.get("difference of the lag times")
    if late is not None and late.found:
        delay = (axes[1] if late.value > 0 else axes[0], Amount(abs(late.value), late.standard_error, "ms"))
    gain = through.get(RADIUS_GAIN)
    pulses = [
        _pulse(axis, feed, cause.amounts["mean"], radius_m, gain, reset_s.get(axis))
        for axis in axes[:2]
        for feed in causes.feeds
        for cause in [feed.cause("reversal-spike", axis)]
        if cause.found and cause.amounts["mean"].value > 0
    ]
    return Compensations(backlash, delay, tuple(pulses))


def _pulse(
    axis: str, feed: FeedCauses, height: Amount, radius_m: float, gain: SharedAmount | None, reset_s: float | None
) -> ReversalPulse:
    acceleration = (feed.feed_mm_per_min / 60e3) ** 2 / radius_m
    amplitude = None
    if gain is not None and reset_s is not None:

        def pulse(height_um: float, gain_per_s: float) -> float:
            return 60e3 * pulse_m_per_s(height_um * 1e-6, acceleration, gain_per_s, reset_s)

        value, by = pulse(height.value, gain.value), 1e-3
        of_height = (pulse(height.value * (1.0 + by), gain.value) - value) / by * height.standard_error / height.value
        of_gain = (pulse(height.value, gain.value * (1.0 + by)) - value) / by * gain.standard_error / gain.value
        amplitude = Amount(value, math.hypot(of_height, of_gain), "mm/min")
    return ReversalPulse(axis, feed.feed_mm_per_min, acceleration, height, amplitude)


def pulse_m_per_s(height_m: float, acceleration_m_per_s2: float, gain_per_s: float, reset_s: float) -> float:
    """Pulse that takes a spike of this height away [m/s]: dry friction 2F over the gain of the velocity controller.

    P position loop (gain Kv) around a PI velocity loop (reset time Tn) that is fast beside both. The axis sticks where
    it turned until the controller has made up for the friction that turned over, A = 2F/Kvp; meanwhile it falls behind
    by a·t²/2. What it needs at once is a step of force, which A·exp(−t/Tn) at the input of a PI controller is.
    """
    about = math.log(gain_per_s * height_m)

    def too_high(log_pulse: float) -> float:
        return spike_height_m(math.exp(log_pulse), acceleration_m_per_s2, gain_per_s, reset_s) - height_m

    return math.exp(optimize.brentq(too_high, about - 7.0, about + 25.0, maxiter=1000))


def spike_height_m(pulse_m_per_s: float, acceleration_m_per_s2: float, gain_per_s: float, reset_s: float) -> float:
    """How far a table falls behind after a reversal [m] without the pulse that it needs, see `pulse_m_per_s`.

    While it sticks, δ = a·t²/2 and δ' + Kv·δ + ∫(δ' + Kv·δ)dt/Tn rises to the pulse; then δ' + Kv·δ falls as
    exp(−t/Tn).
    """
    a, kv, rate = acceleration_m_per_s2, gain_per_s, 1.0 / reset_s

    def lacking(t: float) -> float:
        return a * t * (1.0 + (kv + rate) * t / 2.0 + rate * kv * t * t / 6.0) - pulse_m_per_s

    breaks_s = optimize.brentq(lacking, 0.0, pulse_m_per_s / a, xtol=1e-12, maxiter=1000)
    behind = a * breaks_s**2 / 2.0
    pushed = a * breaks_s + kv * behind
    if math.isclose(kv, rate, rel_tol=1e-6):
        kv *= 1.0 + 1e-5
    # δ = behind·exp(−kv·s) + pushed·(exp(−rate·s) − exp(−kv·s))/(kv − rate), and where its slope is 0
    top_s = math.log(kv * (pushed - behind * (kv - rate)) / (pushed * rate)) / (kv - rate)
    slow, fast = math.exp(-rate * top_s), math.exp(-kv * top_s)
    return behind * fast + pushed * (slow - fast) / (kv - rate)
