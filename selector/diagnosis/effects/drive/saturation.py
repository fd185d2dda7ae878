"""A limit that something of the drive runs into."""

from collections.abc import Iterator

import numpy as np
from numba import njit

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import held_back, motion_of
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.axis import (
    FORCE_ROLES,
    SimulatedAxis,
    commanded,
    derivatives,
    simulated_axis,
    simulated_drive_force,
)
from selector.diagnosis.shapes.force_response import PLACE_ROLES, ClosedLoop, closed_loop, responds, slowest_s
from selector.diagnosis.shapes.signals import lagged, rate, scaled
from selector.types import Vector

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


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    axis = comparison.channel(response).axis
    told = simulated_axis(comparison, axis)
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
                sources = motion_of(comparison, response).sources
                bounds = ((0.0, np.inf),) if kind == 1.0 else None
                yield Variant(column[:, None], words, shape, sources=sources, regime=regime, bounds=bounds)
    yield from _followers(comparison, response)


def _followers(comparison: Comparison, response: str) -> Iterator[Variant]:
    """What a position lacks that follows its command, or the simulation, no faster than a speed, behind a lag."""
    channel, moving = comparison.channel(response), motion_of(comparison, response)
    command = commanded(comparison, channel.axis)
    asked = moving.position_m if command is None else command
    ways = asked, comparison.filled(comparison.recorded[response])
    wanted, seen = (np.abs(derivatives(comparison, way)[0][~comparison.held_out]) for way in ways)
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
    loop: SimulatedAxis | ClosedLoop | None,
    course: Vector,
    level: float,
    kind: float,
) -> Iterator[tuple[Vector, str]]:
    """What a course that cannot exceed a level does to the response; with a control that winds up, and without."""
    role = comparison.channel(response).role
    if kind == 1.0:
        yield np.clip(course, -level, level) - course, "motion that lacks"
    elif loop is None:
        if role in FORCE_ROLES:
            yield np.clip(course, -level, level) - course, "force that lacks"
    else:
        for winds_up in (True, False):
            lacking, behind = held_back(comparison, loop, course, level, winds_up=winds_up)
            # an integral part that winds up may take the axis anywhere
            if not np.abs(behind).max() < _FURTHEST_S**2 * np.abs(course).max():
                continue
            if role in FORCE_ROLES:
                yield lacking, "force that lacks"
            elif role in PLACE_ROLES:
                yield scaled(behind), "way behind"
            else:
                speed, acceleration = derivatives(comparison, scaled(behind))
                yield speed if role == "velocity" else acceleration, "motion that lacks"


def _limited(comparison: Comparison, response: str) -> Iterator[tuple[str, Vector, str, float]]:
    """What may have a limit: force of the drive, or acceleration if none is simulated; speed."""
    moving = motion_of(comparison, response)
    drive = simulated_drive_force(comparison, comparison.channel(response).axis)
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


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    limit = fitted.parameter("limit")
    what = fitted.variant.regime or ""
    return Reading(
        f"A limit of {limit.value:.3g} {limit.unit} is run into ({what}), and what is lacking has to be made good "
        f"later: {fitted.size_words}.",
        {"limit": limit},
    )


EFFECT = Effect(**words_of("drive.saturation"), variants=_variants, testable=responds, reading=_reading)
