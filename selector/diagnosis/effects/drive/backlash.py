"""Lost motion at reversal."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from numba import njit

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import direct, motion_of, reverses
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.axis import FORCE_ROLES, Motion, simulated_drive_force, simulated_forces
from selector.diagnosis.shapes.force_response import PLACE_ROLES, loop_parts
from selector.diagnosis.shapes.signals import scaled
from selector.types import Vector

#: Way on which the lost motion is crossed; the finest stands for all that the sampling shows as a step.
_CROSSED_UM = (1.0, 10.0, 100.0)
_WIDER = 10.0**0.5
_OF_WAY = 0.25  #: Of the usual way between reversals: what a machine says nothing of may have play that wide.
#: Of the moving mass, behind the play: where inertia exceeds friction, flanks change while the axis slows down.
_INERTIA_SHARES = (1.0, 0.6)
_STARTS = (1.0, 0.0, -1.0)  #: Flank before a run's first motion: that which it touches then, in between, the other one.
_LOADED = 0.01  #: Share of the largest load below which the flanks stay as they are.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    starts = np.asarray(moving.starts)
    seen: list[Vector] = []
    for crossed_um in _widths(moving):
        for start in _STARTS:
            side = _begun(_side, moving.position_m, starts, 1e-6 * crossed_um, start)
            # within one sample a short way is a step, and one step is like another
            if any(float(np.max(np.abs(side - other))) < 0.05 for other in seen):
                continue
            seen.append(side)
            shape = {"crossed_um": Quantity(crossed_um, "um"), "start": Quantity(start, "1")}
            yield _of_side(comparison, response, side, shape)
    for share, load in _loads(comparison, response, moving):
        for start in _STARTS:
            side = _begun(_loaded_side, load, starts, _LOADED * float(np.abs(load).max()), start)
            shape = {"inertia_share": Quantity(share, "1"), "start": Quantity(start, "1")}
            yield _of_side(comparison, response, side, shape)


def _widths(moving: Motion) -> Iterator[float]:
    yield from _CROSSED_UM
    wider_um = _CROSSED_UM[-1] * _WIDER
    while 1e-6 * wider_um < _OF_WAY * _stroke_m(moving):
        yield wider_um
        wider_um *= _WIDER


def _stroke_m(moving: Motion) -> float:
    """Usual way from one reversal to the next, or to the end of the run."""
    goes = np.flatnonzero(moving.sense)
    turns = goes[np.flatnonzero(np.diff(moving.sense[goes]))]
    at = np.unique([*moving.starts[:-1], *turns, *(stop - 1 for stop in moving.starts[1:])])
    # from the end of one run to the start of the next nothing moves
    ways = np.abs(np.diff(moving.position_m[at]))[~np.isin(at[1:], moving.starts)]
    return float(np.median(ways)) if len(ways) else 0.0


def _begun(sides: Callable[..., Vector], course: Vector, starts: Vector, least: float, start: float) -> Vector:
    """Side that touches, if before the first touch of every run it was `start` times that which touches first."""
    side = sides(course, starts, least, np.zeros(len(starts) - 1))
    first = np.zeros(len(starts) - 1)
    for run, (begin, stop) in enumerate(pairwise(starts)):
        touched = np.flatnonzero(np.abs(side[begin:stop]) > 0.99)
        first[run] = np.sign(side[begin + touched[0]]) if len(touched) else 0.0
    return side if start == 0.0 else sides(course, starts, least, start * first)


def _of_side(comparison: Comparison, response: str, side: Vector, shape: dict[str, Quantity]) -> Variant:
    """Position: half of the play on either side; force: what crossing it costs the drive."""
    if comparison.channel(response).role in PLACE_ROLES:
        return direct(comparison, response, {"side that the flanks touch on": -side}, shape)
    impulses = loop_parts(comparison, response, side)
    columns = {f"impulse at reversal, {k + 1}": scaled(part) for k, part in enumerate(impulses)}
    return direct(comparison, response, columns, shape)


def _loads(comparison: Comparison, response: str, moving: Motion) -> Iterator[tuple[float, Vector]]:
    """Shares of the moving mass behind the play, and simulated force that passes it; or the wind-up by that force."""
    channel = comparison.channel(response)
    if channel.role == "displacement" and response not in moving.sources:
        yield 1.0, comparison.simulated_course(response)
    drive = simulated_drive_force(comparison, channel.axis)
    if drive is None:
        return
    inertia = simulated_forces(comparison, channel.axis)["drive.mass"]
    for share in _INERTIA_SHARES:
        yield share, np.asarray(drive[1] - (1.0 - share) * inertia)


@njit(cache=True, nogil=True)
def _side(place, starts, crossed, begun):  # type: ignore[no-untyped-def]
    side = np.zeros(len(place))
    for run in range(len(starts) - 1):
        side[starts[run]] = begun[run]
        for k in range(starts[run] + 1, starts[run + 1]):
            side[k] = min(max(side[k - 1] + 2.0 * (place[k] - place[k - 1]) / crossed, -1.0), 1.0)
    return side


@njit(cache=True, nogil=True)
def _loaded_side(load, starts, least, begun):  # type: ignore[no-untyped-def]
    side = np.zeros(len(load))
    for run in range(len(starts) - 1):
        side[starts[run]] = begun[run]
        for k in range(starts[run] + 1, starts[run + 1]):
            side[k] = side[k - 1] if abs(load[k]) < least else (1.0 if load[k] > 0.0 else -1.0)
    return side


def _testable(comparison: Comparison, response: str) -> str | None:
    lacking = reverses(comparison, response)
    if lacking is None and comparison.channel(response).role not in PLACE_ROLES + FORCE_ROLES:
        return f"{response} is no displacement, position, force or current"
    return lacking


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if comparison.channel(fitted.response).role in PLACE_ROLES:
        lost = fitted.coefficient(factor=2.0)
        return Reading(
            f"At each reversal {lost.words(amount=True)} of motion are lost, whatever speed and force.",
            {"lost_motion": Quantity(abs(lost.value), lost.unit)},
        )
    return Reading(f"At each reversal the drive crosses a play: impulses of {fitted.size_words}.", fitted.size)


EFFECT = Effect(**words_of("drive.backlash"), variants=_variants, testable=_testable, reading=_reading)
