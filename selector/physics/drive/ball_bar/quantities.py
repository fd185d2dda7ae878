"""How round a circular test is: circular deviation, its bi-directional form, radial deviation, mean radius, hysteresis.

After ISO 230-4:2005 (G, G(b), F, D) and its first edition of 1996 (H). There the circular deviation is the smallest
radial separation of two concentric circles that envelop the path, and the range of radii about the least-squares centre
is admitted for it; here both are given, the smallest one exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.drive.ball_bar.circle import BallBarTrace
from selector.types import Vector

_UM = 1e6
_ROUNDS = 50
_ENOUGH = 1e-13
_FEASIBLE_UM = 1e-9


@dataclass(frozen=True)
class Extreme:
    """A largest or smallest value [µm] and the angle at which it stands [rad]."""

    value_um: float
    angle_rad: float


@dataclass(frozen=True)
class Roundness:
    """One path, or two paths together."""

    circular_deviation_um: float  #: G, or G(b) of two paths: width of the narrowest annulus [µm]
    #: radial_max and radial_min: F_max, F_min: farthest from the nominal radius outwards and inwards, about the least-
    #: squares centre
    radial_max: Extreme
    radial_min: Extreme
    mean_radial_um: float  #: D if of two paths: radius of the least-squares circle minus nominal radius [µm]
    centre_um: tuple[float, float]  #: Centre of the least-squares circle [µm]


@dataclass(frozen=True)
class CircleQuantities:
    """Both directions at one feed: each by itself, both together, and the hysteresis H, about their common centre."""

    feed_mm_per_min: float
    counter_clockwise: Roundness
    clockwise: Roundness
    both: Roundness
    hysteresis: Extreme


def circle_quantities(traces: Sequence[BallBarTrace]) -> tuple[CircleQuantities, ...]:
    """The quantities of every feed, slowest first.

    InputError if a feed has not exactly one trace of each direction with the same radius and axes.
    """
    found = []
    for one, other in paired(traces):
        paths = roundness(one), roundness(other), roundness(one, other)
        found.append(CircleQuantities(one.feed_mm_per_min, *paths, hysteresis(one, other)))
    return tuple(found)


def paired(traces: Sequence[BallBarTrace]) -> tuple[tuple[BallBarTrace, BallBarTrace], ...]:
    """(counter-clockwise, clockwise) of every feed, slowest first; feeds within 1 % are the same."""
    pairs: list[list[BallBarTrace]] = []
    for trace in sorted(traces, key=lambda one: one.feed_mm_per_min):
        if pairs and trace.feed_mm_per_min <= 1.01 * pairs[-1][0].feed_mm_per_min:
            pairs[-1].append(trace)
        else:
            pairs.append([trace])
    for pair in pairs:
        of_one_kind = len({(one.radius_m, one.axes) for one in pair}) == 1
        if sorted(one.direction for one in pair) != [-1, 1] or not of_one_kind:
            raise InputError(
                ", ".join("counter-clockwise" if one.direction > 0 else "clockwise" for one in pair)
                + ("" if of_one_kind else " of different radii or axes"),
                expected="one trace counter-clockwise and one clockwise, of the same circle",
                where=f"circular test at {pair[0].feed_mm_per_min:g} mm/min",
                advice="give both directions of every feed once",
            )
    if not pairs:
        raise InputError("no traces", expected="two or more", where="circular test", advice="give the measured circles")
    ordered = [sorted(pair, key=lambda one: -one.direction) for pair in pairs]
    return tuple((pair[0], pair[1]) for pair in ordered)


def roundness(*traces: BallBarTrace) -> Roundness:
    """Roundness of one path, or of several taken together [µm]."""
    angle, deviation, radius_um = _together(traces)
    centre, mean = least_squares_circle(angle, deviation, radius_um)
    centred, direction = _about(centre, angle, deviation, radius_um)
    out, inside = (_extreme(centred, direction, sign) for sign in (1, -1))
    return Roundness(minimum_zone_um(angle, deviation, radius_um), out, inside, mean, centre)


def hysteresis(forward: BallBarTrace, back: BallBarTrace) -> Extreme:
    """H: largest radial difference of two paths at the same angle, about the least-squares centre of both [µm]."""
    angle, deviation, radius_um = _together((forward, back))
    centre, _ = least_squares_circle(angle, deviation, radius_um)
    courses = []
    for one in (forward, back):
        radial, direction = _about(centre, one.angle_rad, one.deviation_um, radius_um)
        order = np.argsort(direction, kind="stable")
        courses.append((direction[order], radial[order]))
    at = np.union1d(courses[0][0], courses[1][0])
    apart = np.abs(np.subtract(*(np.interp(at, *course, period=2.0 * np.pi) for course in courses)))
    return _extreme(apart, at, 1)


def centred_traces(traces: Sequence[BallBarTrace]) -> tuple[BallBarTrace, ...]:
    """Traces about the centre of the least-squares circle of all of them: the set-up taken out, for pictures."""
    angle, deviation, radius_um = _together(traces)
    centre, _ = least_squares_circle(angle, deviation, radius_um)
    moved = [_about(centre, one.angle_rad, one.deviation_um, radius_um) for one in traces]
    return tuple(
        replace(one, angle_rad=direction, deviation_um=radial)
        for one, (radial, direction) in zip(traces, moved, strict=True)
    )


def least_squares_circle(
    angle_rad: ArrayLike, deviation_um: ArrayLike, radius_um: float
) -> tuple[tuple[float, float], float]:
    """Centre [µm] and radius minus the nominal one [µm] of the circle with the least squared radial distances.

    Orthogonal distances (Gauss–Newton); samples count as evenly spread.
    """
    angle, deviation = np.asarray(angle_rad, dtype=np.float64), np.asarray(deviation_um, dtype=np.float64)
    centre = (0.0, 0.0)
    mean = 0.0
    for _ in range(_ROUNDS):
        radial, direction = _about(centre, angle, deviation, radius_um)
        columns = np.column_stack([np.cos(direction), np.sin(direction), np.ones(len(radial))])
        change = np.linalg.lstsq(columns, radial, rcond=None)[0]
        centre, mean = (centre[0] + float(change[0]), centre[1] + float(change[1])), float(change[2])
        if np.hypot(change[0], change[1]) <= _ENOUGH * radius_um:
            break
    return centre, mean


def minimum_zone_um(angle_rad: ArrayLike, deviation_um: ArrayLike, radius_um: float) -> float:
    """Radial separation of the minimum-zone circles of a path, the narrowest annulus around it [µm].

    Linear programmes about the last centre, each with the radii as they are there, until the centre stays. A linear
    programme takes in the samples that break its bounds, round after round.
    """
    from scipy.optimize import linprog

    angle, deviation = np.asarray(angle_rad, dtype=np.float64), np.asarray(deviation_um, dtype=np.float64)
    centre, _ = least_squares_circle(angle, deviation, radius_um)
    taken = np.zeros(len(angle), dtype=np.bool_)
    taken[:: max(1, len(angle) // 64)] = True
    for _ in range(_ROUNDS):
        radial, direction = _about(centre, angle, deviation, radius_um)
        u = np.column_stack([np.cos(direction), np.sin(direction)])
        taken[[np.argmax(radial), np.argmin(radial)]] = True
        while True:
            # outer − inner is least, with inner ≤ radial − u·shift ≤ outer
            none, one = np.zeros((int(taken.sum()), 1)), np.ones((int(taken.sum()), 1))
            solved = linprog(
                [0.0, 0.0, -1.0, 1.0],
                np.block([[-u[taken], none, -one], [u[taken], one, none]]),
                np.r_[-radial[taken], radial[taken]],
                bounds=(None, None),
                options={"primal_feasibility_tolerance": _FEASIBLE_UM, "dual_feasibility_tolerance": _FEASIBLE_UM},
            )
            shift, inner, outer = np.split(np.asarray(solved.x, dtype=np.float64), [2, 3])
            left = radial - u @ shift
            outside = np.where(taken, 0.0, np.maximum(left - outer, inner - left))
            if outside.max() <= _FEASIBLE_UM:
                break
            is_peak = (outside >= np.roll(outside, 1)) & (outside >= np.roll(outside, -1))
            taken |= (outside == outside.max()) | ((outside > _FEASIBLE_UM) & is_peak)
        centre = (centre[0] + float(shift[0]), centre[1] + float(shift[1]))
        if np.hypot(shift[0], shift[1]) <= _ENOUGH * radius_um:
            break
    radial, _ = _about(centre, angle, deviation, radius_um)
    return float(radial.max()) - float(radial.min())


def _together(traces: Sequence[BallBarTrace]) -> tuple[Vector, Vector, float]:
    """Angles [rad], deviations [µm] and nominal radius [µm]."""
    angle = np.concatenate([one.angle_rad for one in traces])
    deviation = np.concatenate([one.deviation_um for one in traces])
    return angle, deviation, traces[0].radius_m * _UM


def _about(centre_um: tuple[float, float], angle: Vector, deviation: Vector, radius_um: float) -> tuple[Vector, Vector]:
    """Distances from a centre minus the nominal radius [µm], without the digits of the radius lost, and directions."""
    cos, sin = np.cos(angle), np.sin(angle)
    shift = (
        centre_um[0] ** 2
        + centre_um[1] ** 2
        - 2.0 * (radius_um + deviation) * (centre_um[0] * cos + centre_um[1] * sin)
    )
    outside = radius_um + deviation
    # √(r² + shift) − r, with r not subtracted from its like
    radial = deviation + shift / (np.sqrt(outside**2 + shift) + outside)
    direction = np.arctan2(outside * sin - centre_um[1], outside * cos - centre_um[0])
    return radial, np.asarray(direction)


def _extreme(values: Vector, angle: Vector, sign: int) -> Extreme:
    at = int(np.argmax(sign * values))
    return Extreme(float(values[at]), float(angle[at] % (2.0 * np.pi)))
