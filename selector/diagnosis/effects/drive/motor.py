"""What the motor gives and moves: mass, constant force, ripple, dead time, limits."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numba import njit

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive import _forces as axis_forces
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.shapes import axis as axes
from selector.diagnosis.shapes import signals
from selector.diagnosis.shapes.force_response import PLACE_ROLES, ClosedLoop, closed_loop, responds, slowest_s
from selector.diagnosis.shapes.signals import in_run, lagged, rate, scaled
from selector.types import Vector

_MOST_STARTS = 8  #: Runs from which on the inertia may be another one; of more runs every second, third, …


def _mass(comparison: Comparison, response: str) -> Iterator[Variant]:
    inertia = axis_forces.motion_of(comparison, response).acceleration_m_per_s2
    yield from axis_forces.of_forces(comparison, response, {"force of inertia": inertia})
    for k in range(1, len(comparison.runs), -(-len(comparison.runs) // _MOST_STARTS)):
        # a workpiece that was put on the table
        later = np.where(comparison.run_index >= k, inertia, 0.0)
        if later[~comparison.held_out].any():
            for variant in axis_forces.of_forces(comparison, response, {"force of inertia": later}):
                yield replace(variant, regime=f"from run {comparison.runs[k]} on", looked_at=float(_MOST_STARTS))


def _mass_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    when = f" {fitted.variant.regime}" if fitted.variant.regime else ""
    if axis_forces.is_force(fitted, comparison):
        of_mass = fitted.unit == "N"
        found = fitted.coefficient("kg" if of_mass else f"{fitted.unit}*s^2/m")
        what, key = ("The axis moves", "mass_kg") if of_mass else ("The inertia of the axis asks for", "inertia")
        more = f"{found.words(amount=True)} {'more' if found.value > 0.0 else 'less'}"
        return Reading(f"{what} {more} than in the simulation{when} ({fitted.size_words}).", {key: found})
    text = "While it speeds up and slows down the axis is off by what another moving mass makes"
    return Reading(f"{text}{when}: {fitted.size_words}.", fitted.size)


_CONSTANT = "constant force"


def _offset_force(comparison: Comparison, response: str) -> Iterator[Variant]:
    ones = np.ones(len(comparison.time_s))
    yield from _shown(comparison, response, ones)
    for run in comparison.runs if len(comparison.runs) > 1 else ():
        yield from _shown(comparison, response, in_run(comparison, run, ones), run=run)
    for name in comparison.with_role("state"):
        state = signals.course(comparison, name)
        values = np.unique(state)
        # a brake, a clamp or the drive itself, on and off
        if len(values) == 2:
            on = (state > values.mean()).astype(np.float64)
            yield from _shown(comparison, response, on, regime=f"{name} = {values[1]:g}")


def _shown(
    comparison: Comparison, response: str, force: Vector, *, run: str | None = None, regime: str | None = None
) -> Iterator[Variant]:
    """Long at rest before the recording begins, so that it has settled; or put on with the first sample."""
    settled = axis_forces.direct(comparison, response, {_CONSTANT: force})
    for variant in (settled, *axis_forces.of_forces(comparison, response, {_CONSTANT: force}, most=2)):
        yield replace(variant, run=run, regime=regime)


def _offset_force_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    run, regime = fitted.variant.run, fitted.variant.regime
    shift = fitted.coefficient()
    when = ("" if run is None else f" in run {run}") + ("" if regime is None else f" while {regime}")
    key = axis_forces.force_key(fitted, comparison)
    if key:
        text = f"A constant force of {shift.words()} acts on the axis{when}, at rest and in motion alike"
        return Reading(f"{text} ({fitted.size_words}).", {key: shift})
    text = f"A constant force holds the axis {shift.words()} aside{when}, at rest and in motion alike."
    return Reading(text, {"shift": shift})


def _ripple(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    for lead in axis_forces.leads(comparison, comparison.channel(response).axis, of_force=True):
        turn = 2.0 * np.pi * moving.position_m / lead
        once = {"sine of the angle": np.sin(turn), "cosine of the angle": np.cos(turn)}
        twice = {"sine of twice the angle": np.sin(2.0 * turn), "cosine of twice the angle": np.cos(2.0 * turn)}
        for harmonics, waves in ((1.0, once), (2.0, once | twice)):
            shape = {"lead_mm": Quantity(1e3 * lead, "mm"), "harmonics": Quantity(harmonics, "1")}
            yield from axis_forces.of_forces(comparison, response, waves, shape, of_motor=True)


def _ripple_testable(comparison: Comparison, response: str) -> str | None:
    lacking = responds(comparison, response)
    if lacking is None and not axis_forces.leads(comparison, comparison.channel(response).axis, of_force=True):
        return "the way is too short, or too quick for the sampling, to show what repeats along it"
    return lacking


def _ripple_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    lead = fitted.parameter("lead_mm")
    key, amplitude = axis_forces.force_key(fitted, comparison), axis_forces.waved(fitted)
    text = f"A force that repeats every {lead.value:.4g} mm shakes the axis, less the slower it goes"
    if key:
        has = f"has an amplitude of {amplitude.value:.3g} {fitted.unit}"
        text = f"A force that repeats every {lead.value:.4g} mm, as cogging or commutation does, {has}"
    return Reading(f"{text} ({fitted.size_words}).", {"lead_mm": lead} | ({key: amplitude} if key else fitted.size))


def _delay(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    if comparison.channel(response).role == "displacement":
        # an error that is measured late is off by the way of the delay
        late = {"speed": moving.velocity_m_per_s * 1e3}
    else:
        simulated = comparison.simulated_course(response)
        late = {"rate of the simulated course": -1e-3 * rate(comparison, simulated)}
    yield axis_forces.direct(comparison, response, late, {"in": Quantity(0.0, "1")})
    drive = axes.simulated_drive_force(comparison, comparison.channel(response).axis)
    if drive is not None:
        # a force that comes late acts as a push of the delay times its rate
        pushed = {f"rate of {drive[0]}": 1e-3 * rate(comparison, drive[1])}
    else:
        pushed = {"jerk": 1e-3 * rate(comparison, moving.acceleration_m_per_s2, over_samples=5)}
    yield from axis_forces.of_forces(comparison, response, pushed, {"in": Quantity(1.0, "1")}, of_motor=True)


def _delay_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if fitted.variant.shape["in"].value == 0.0:
        delay = fitted.coefficient("ms")
        late = "late" if delay.value > 0.0 or axis_forces.is_force(fitted, comparison) else "early"
        return Reading(
            f"Command or measurement is {delay.words(amount=True)} {late}: {fitted.size_words}.", {"delay_ms": delay}
        )
    return Reading(
        f"The force comes late, which the loop makes good after each change: {fitted.size_words}.", fitted.size
    )


_SHARES = (0.99, 0.98, 0.97, 0.955, 0.94, 0.92, 0.9, 0.87, 0.84, 0.8, 0.75, 0.7, 0.6, 0.5, 0.4)
_SHARES_OF_SPEED = (0.97, 0.94, 0.9, 0.85, 0.8, 0.7)  #: Less would be a lack in proportion to speed, which a delay is.
#: Of the speed that the recorded position hardly exceeds; of the simulation's lag, which has made up for the limit.
_SHARES_OF_FASTEST, _LAGS = (1.0, 0.9, 0.8), (0.1, 0.33, 1.0)
_HARDLY = 0.99
_CLEARLY = 1.5  #: Times a limit of speed: a command that is hardly faster is followed late, which a delay is.
#: Of a limit of speed: what moves slower stands, what moves faster goes at it, as at least half of the moving rows do.
_STANDS, _AT_LIMIT, _HALF = 0.2, 0.8, 0.5
_FEWEST_ROWS = 5
_FURTHEST_S = 10.0  #: Way behind, as the time in which the whole force would go it from rest.


def _saturation(comparison: Comparison, response: str) -> Iterator[Variant]:
    axis = comparison.channel(response).axis
    told = axes.simulated_axis(comparison, axis)
    loop = told or closed_loop(comparison, axis)
    for name, course, unit, kind in _limited(comparison, response):
        if told is not None and kind == 0.0:
            # the limit is where the control asks, ahead of the lag: F + τF'
            course = course + told.lag_s * rate(comparison, course)
        top = float(np.abs(course).max())
        shares = _SHARES if kind == 0.0 else _SHARES_OF_SPEED
        levels = sorted({*(share * top for share in shares), *_plateau(comparison, name)}, reverse=True)
        for level in levels:
            above = np.abs(course) > level
            if not 0.0 < level < top or int(np.count_nonzero(above[~comparison.held_out])) < _FEWEST_ROWS:
                continue
            shape = {"limit": Quantity(level, unit), "kind": Quantity(kind, "1")}
            regime = f"|{name}| > {level:.3g} {unit}"
            for column, what in _shapes(comparison, response, loop, course, level, kind):
                words = (f"{what} at the limit of {name}",)
                sources = axis_forces.motion_of(comparison, response).sources
                bounds = ((0.0, np.inf),) if kind == 1.0 else None
                yield Variant(column[:, None], words, shape, sources=sources, regime=regime, bounds=bounds)
    yield from _followers(comparison, response)


def _followers(comparison: Comparison, response: str) -> Iterator[Variant]:
    """What a position lacks that follows its command, or the simulation, no faster than a speed, behind a lag."""
    channel, moving = comparison.channel(response), axis_forces.motion_of(comparison, response)
    command = axes.commanded(comparison, channel.axis)
    asked = moving.position_m if command is None else command
    ways = asked, comparison.filled(comparison.recorded[response])
    wanted, seen = (np.abs(axes.derivatives(comparison, way)[0][~comparison.held_out]) for way in ways)
    fastest = float(np.quantile(seen, _HARDLY))
    if channel.role != "position" or wanted.max() < _CLEARLY * fastest:
        return
    if np.sum(seen > _AT_LIMIT * fastest) < _HALF * np.sum(seen > _STANDS * fastest):
        return
    for level in (share * fastest for share in _SHARES_OF_FASTEST):
        lacks = _slewed(asked, comparison.time_s, np.asarray(comparison.starts), level) - asked
        shape = {"limit": Quantity(level, "m/s"), "kind": Quantity(1.0, "1")}
        for lag_s in (part * slowest_s(comparison, response) for part in _LAGS):
            column = lagged(comparison, lacks, lag_s)[:, None]
            words, regime = ("way that lacks at the limit of speed",), f"|speed| > {level:.3g} m/s"
            yield Variant(column, words, shape, sources=moving.sources, regime=regime, bounds=((0.0, np.inf),))


@njit(cache=True, nogil=True)
def _slewed(command, time_s, starts, fastest):  # type: ignore[no-untyped-def]
    way = command.copy()
    for run in range(len(starts) - 1):
        for k in range(starts[run] + 1, starts[run + 1]):
            most = fastest * (time_s[k] - time_s[k - 1])
            way[k] = way[k - 1] + min(max(command[k] - way[k - 1], -most), most)
    return way


def _shapes(
    comparison: Comparison,
    response: str,
    loop: axes.SimulatedAxis | ClosedLoop | None,
    course: Vector,
    level: float,
    kind: float,
) -> Iterator[tuple[Vector, str]]:
    """What a course that cannot exceed a level does to the response; with a control that winds up, and without."""
    role = comparison.channel(response).role
    if kind == 1.0:
        yield np.clip(course, -level, level) - course, "motion that lacks"
    elif loop is None:
        if role in axes.FORCE_ROLES:
            yield np.clip(course, -level, level) - course, "force that lacks"
    else:
        for winds_up in (True, False):
            lacking, behind = axis_forces.held_back(comparison, loop, course, level, winds_up=winds_up)
            # an integral part that winds up may take the axis anywhere
            if not np.abs(behind).max() < _FURTHEST_S**2 * np.abs(course).max():
                continue
            if role in axes.FORCE_ROLES:
                yield lacking, "force that lacks"
            elif role in PLACE_ROLES:
                yield scaled(behind), "way behind"
            else:
                speed, acceleration = axes.derivatives(comparison, scaled(behind))
                yield speed if role == "velocity" else acceleration, "motion that lacks"


def _limited(comparison: Comparison, response: str) -> Iterator[tuple[str, Vector, str, float]]:
    """What may have a limit: force of the drive, or acceleration if none is simulated; speed."""
    moving = axis_forces.motion_of(comparison, response)
    drive = axes.simulated_drive_force(comparison, comparison.channel(response).axis)
    if drive is not None:
        yield drive[0], drive[1], comparison.channel(drive[0]).unit, 0.0
    else:
        yield "acceleration", moving.acceleration_m_per_s2, "m/s^2", 0.0
    if comparison.channel(response).role == "velocity":
        # what was recorded does not go beyond its limit
        yield response, comparison.simulated_course(response), "m/s", 1.0


def _plateau(comparison: Comparison, name: str) -> list[float]:
    """The level that a recorded channel stays at where it is largest, if the simulation goes beyond it."""
    if name not in comparison.recorded or name not in comparison.simulated:
        return []
    seen = np.abs(comparison.recorded[name][~comparison.held_out])
    told = np.abs(comparison.simulated[name][~comparison.held_out])
    both = np.isfinite(seen) & np.isfinite(told)
    order = np.argsort(told[both])[-max(_FEWEST_ROWS, both.sum() // 200) :]
    level = float(np.median(seen[both][order])) if both.any() else 0.0
    return [level] if 0.2 * float(told[both].max(initial=0.0)) < level else []


def _saturation_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    limit = fitted.parameter("limit")
    what = fitted.variant.regime or ""
    return Reading(
        f"A limit of {limit.value:.3g} {limit.unit} is run into ({what}), and what is lacking has to be made good "
        f"later: {fitted.size_words}.",
        {"limit": limit},
    )


EFFECTS = (
    declared("drive.mass", _mass, responds, _mass_reading),
    declared("drive.offset_force", _offset_force, responds, _offset_force_reading),
    declared("drive.ripple", _ripple, _ripple_testable, _ripple_reading),
    declared("drive.delay", _delay, responds, _delay_reading),
    declared("drive.saturation", _saturation, responds, _saturation_reading),
)
