"""What each cause does to the radius of a circle: a named column a cause, and the shapes that are not linear.

θ is the angle of the bar, d = ±1 the direction, p the places of the axes over R: cos θ and sin θ, or those of axes
that follow a ball on a rotary table (`circle`); p′ is their change with θ, s the time or arc since an axis reversed. An
error e of the first axis moves the radius by e·cos θ, one of the second by e·sin θ.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from selector.physics.drive.ball_bar.circle import BallBarTrace, TableBall
from selector.types import Matrix, Vector

_GRID = 7200
_ALIKE = 0.03


@dataclass(frozen=True, eq=False)
class AxisCourse:
    """One axis along the circle."""

    #: (n_samples,): Arc since its last reversal at its positive end, and at its negative end; infinite before the first
    since_reversal_rad: tuple[Vector, Vector]
    gone: Vector  #: (n_samples,): Travel since its last reversal, over R
    ends: tuple[float, float]  #: Its farthest places, lowest first, over R


@dataclass(frozen=True, eq=False)
class CirclePair:
    """The two directions of a circle, one after the other."""

    #: angle_rad, direction and deviation_um: (n_samples,): θ, d [–] and the deviation [µm]
    angle_rad: Vector
    direction: Vector
    deviation_um: Vector
    #: radius_um and speed_um_per_s: R and feed [µm], [µm/s]
    radius_um: float
    speed_um_per_s: float
    parts: tuple[slice, ...]  #: Samples of each direction
    #: (n_samples,): Angle that the bar has travelled since the start, counter-clockwise positive [rad]
    turned_rad: Vector
    table_ball: TableBall | None = None  #: The ball of the workpiece if it turns with a rotary axis
    start_angle_rad: float = 0.0  #: θ where `turned_rad` is 0 [rad]

    @cached_property
    def along(self) -> tuple[Vector, Vector]:
        """How much an error of each axis moves the radius: cos θ and sin θ."""
        return np.cos(self.angle_rad), np.sin(self.angle_rad)

    @cached_property
    def ball_over_radius(self) -> float:
        """Distance of the workpiece ball from the centre of its table over R; 0 without a table."""
        return 0.0 if self.table_ball is None else self.table_ball.ball_distance_m * 1e6 / self.radius_um

    @cached_property
    def places(self) -> tuple[Vector, Vector]:
        """Place of each axis over R, from the centre."""
        return self.places_at(self.turned_rad)

    @cached_property
    def paces(self) -> tuple[Vector, Vector]:
        """p′: change of the places with θ."""
        return self.places_at(self.turned_rad, 1)

    @cached_property
    def arm(self) -> tuple[Vector, Vector]:
        """Parts of the workpiece ball's arm over R along the bar and across it; zero without a table."""
        if self.table_ball is None:
            return np.zeros(len(self.angle_rad)), np.zeros(len(self.angle_rad))
        between = self.table_ball.ball_angle_rad - self.start_angle_rad + (self.table_ball.ratio - 1) * self.turned_rad
        return self.ball_over_radius * np.cos(between), self.ball_over_radius * np.sin(between)

    @property
    def reach(self) -> float:
        """How far the axes are from their centre along the bar, over R, on average; 1 without a table."""
        return 1.0 + float(np.mean(self.arm[0]))

    @cached_property
    def courses(self) -> tuple[AxisCourse, AxisCourse]:
        """How each axis goes along the circle."""
        return self._course(0), self._course(1)

    @cached_property
    def smooth(self) -> dict[str, Vector]:
        """The columns of `smooth_columns` that can be told apart."""
        columns = smooth_columns(self)
        kept = told_apart(columns)
        return {name: columns[name] for name in kept}

    def places_at(self, turned_rad: Vector, order: int = 0) -> tuple[Vector, Vector]:
        """Places of the axes over R, or their derivatives, where the bar has travelled so far."""
        bar = self.start_angle_rad + turned_rad + order * np.pi / 2.0
        first, second = np.cos(bar), np.sin(bar)
        if self.table_ball is not None:
            ratio = self.table_ball.ratio
            table = self.table_ball.ball_angle_rad + ratio * turned_rad + order * np.pi / 2.0
            first = first + self.ball_over_radius * ratio**order * np.cos(table)
            second = second + self.ball_over_radius * ratio**order * np.sin(table)
        return first, second

    def _course(self, axis: int) -> AxisCourse:
        high, low, gone = (np.full(len(self.angle_rad), np.inf) for _ in range(3))
        extremes: list[float] = []
        for part in self.parts:
            d = float(self.direction[part][0])
            travelled = d * self.turned_rad[part]
            # one turn earlier too: what was before the run-in has faded
            grid = np.linspace(travelled.min() - 2.0 * np.pi, travelled.max() + 0.01, 2 * _GRID)
            pace = d * self.places_at(d * grid, 1)[axis]
            at = np.flatnonzero(np.signbit(pace[1:]) != np.signbit(pace[:-1]))
            upper = ~np.signbit(pace[at])
            turns = grid[at] - pace[at] * (grid[at + 1] - grid[at]) / (pace[at + 1] - pace[at])
            for _ in range(3):
                turns = turns - d * self.places_at(d * turns, 1)[axis] / self.places_at(d * turns, 2)[axis]
            for arcs, own in ((high, turns[upper]), (low, turns[~upper])):
                if len(own):
                    before = np.searchsorted(own, travelled + 1e-9) - 1
                    since = np.maximum(travelled - own[np.maximum(before, 0)], 0.0)
                    arcs[part] = np.where(before >= 0, since, np.inf)
            since = np.minimum(high[part], low[part])
            last = travelled - np.where(np.isfinite(since), since, travelled - travelled.min() + 2.0 * np.pi)
            gone[part] = np.abs(self.places[axis][part] - self.places_at(d * last)[axis])
            extremes += [*self.places_at(d * turns)[axis], *self.places_at(d * grid[:1])[axis]]
        return AxisCourse((high, low), gone, (float(min(extremes)), float(max(extremes))))


def pair_of(traces: Sequence[BallBarTrace]) -> CirclePair:
    """Traces of one feed as one pair."""
    ends = np.cumsum([0, *(len(one.angle_rad) for one in traces)])
    table_ball = traces[0].table_ball
    start = traces[0].start_angle_rad if table_ball is not None else 0.0
    turned = []
    for one in traces:
        since = np.unwrap(one.angle_rad) - start
        turned.append(since - 2.0 * np.pi * np.round(since[0] / (2.0 * np.pi)))
    directions = [np.full(len(one.angle_rad), float(one.direction)) for one in traces]
    rows = [one.angle_rad for one in traces], directions, [one.deviation_um for one in traces]
    speed = float(np.mean([one.feed_mm_per_min for one in traces])) * 1e3 / 60.0
    parts = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
    angle, direction, deviation = map(np.concatenate, rows)
    radius, went = traces[0].radius_m * 1e6, np.concatenate(turned)
    return CirclePair(angle, direction, deviation, radius, speed, parts, went, table_ball, start)


def smooth_columns(pair: CirclePair) -> dict[str, Vector]:
    """Columns that need no shape, by name; 0 and 1 are the axes; each multiplies µm.

    Without a table: centre: place of the spindle ball against the middle. Radius: constant. Scale mismatch: half the
    difference of the two radii, cos 2θ. Squareness: sin 2θ. Gain mismatch: half the difference of the two lags along
    the path, d·sin 2θ. Straightness: a bow b of the first axis, b·cos²θ·sin θ, of the second, b·sin²θ·cos θ, less what
    looks like a centre.

    With a table p and p′ are those of the axes; further columns are the place of the ball on its table, which
    turns with it, and the lag of the linear axes behind the table.
    """
    (cos, sin), (first, second), (faster, slower) = pair.along, pair.places, pair.paces
    d, reach = pair.direction, 1.0 + pair.ball_over_radius
    grid = np.arange(_GRID) * 2.0 * np.pi / _GRID
    bar = pair.start_angle_rad + grid
    columns = {"centre 0": cos, "centre 1": sin, "radius": np.ones(len(cos))}
    if pair.table_ball is not None:
        back = pair.start_angle_rad + (1.0 - pair.table_ball.ratio) * pair.turned_rad
        columns |= {"set-up 0": np.cos(back), "set-up 1": np.sin(back)}
    columns |= {
        "scale-mismatch": first * cos - second * sin,
        "squareness": 2.0 * second * cos,
        "gain-mismatch": d * (slower * sin - faster * cos),
    }
    for axis, (place, across) in enumerate(((first, sin), (second, cos))):
        bent = (pair.places_at(grid)[axis] / reach) ** 2 * (np.cos(bar) if axis else np.sin(bar))
        columns[f"straightness {axis}"] = (
            (place / reach) ** 2 * across
            - 2.0 * np.mean(bent * np.cos(bar)) * cos
            - 2.0 * np.mean(bent * np.sin(bar)) * sin
        )
    if pair.table_ball is not None:
        columns["rotary-lag"] = d * pair.table_ball.ratio * pair.arm[1]
    return columns


def told_apart(columns: dict[str, Vector]) -> tuple[str, ...]:
    """Names of the columns that stand out of those before them by 3 % of their length or more."""
    kept: list[str] = []
    basis = np.empty((len(next(iter(columns.values()))), 0))
    for name, column in columns.items():
        left = column - basis @ (basis.T @ column)
        left = left - basis @ (basis.T @ left)
        size = float(np.linalg.norm(left))
        if size > _ALIKE * float(np.linalg.norm(column)) and size > 1e-9:
            kept.append(name)
            basis = np.column_stack([basis, left / size])
    return tuple(kept)


def backlash_columns(pair: CirclePair, axis: int, gap_um: tuple[float, float]) -> Matrix:
    """Lost motion of an axis at its positive and at its negative end, (n_samples, 2); each multiplies the whole gap.

    The table lags by half the gap on the side it comes from; between the ends the gap changes along the travel. After a
    reversal the table waits until the drive has gone through the gap.
    """
    course = pair.courses[axis]
    behind_high, behind_low = course.since_reversal_rad
    after_high = behind_high < behind_low
    gone = pair.radius_um * course.gone
    gap = np.where(after_high, gap_um[0], gap_um[1])
    # where the drive stands in its gap: from 1 to −1 after the positive end
    state = 1.0 - np.divide(2.0 * gone, gap, out=np.full(len(gone), np.inf), where=gap > 0)
    lag = np.where(after_high, 1.0, -1.0) * np.maximum(state, -1.0)
    part = -pair.along[axis] * lag / 2.0
    low, high = course.ends
    share = (pair.places[axis] - low) / (high - low)
    return np.column_stack([part * share, part * (1.0 - share)])


def spike_columns(pair: CirclePair, axis: int, spike: tuple[float, float]) -> Matrix:
    """Spikes of an axis after the reversals at its positive and negative end, (n_samples, 2); each multiplies µm.

    1 at its highest, at s = w [s], with (w, k) = `spike`. From k = 1 on ((s/w)·exp(1 − s/w))^k, whose width falls as
    w/√k. Below, an axis that sticks for a time T, falls behind by s²/2 meanwhile, and then follows as a critically
    damped loop does, ((s/τ + …)·exp(−s/τ) with T/τ = k⁻² − 1: of T = 0 the shape of k = 1, of a long T a sawtooth.
    Positive towards the end.
    """
    columns = np.zeros((len(pair.angle_rad), 2))
    stuck = spike[1] ** -2 - 1.0
    # beyond it a spike is 0
    end = (101.0 + stuck) / (stuck + 2.0 / (2.0 + stuck)) if spike[1] < 1.0 else 100.0 / spike[1] + 10.0
    for column, arc, sign in zip(columns.T, pair.courses[axis].since_reversal_rad, (1.0, -1.0), strict=True):
        near = np.flatnonzero(arc < end * spike[0] * pair.speed_um_per_s / pair.radius_um)
        reached = np.maximum(arc[near] * pair.radius_um / pair.speed_um_per_s / spike[0], 1e-300)
        if spike[1] < 1.0:
            height = _let_go(reached, stuck)
        else:
            power = spike[1] * (np.log(reached) + 1.0 - reached)
            # no more than 1e-43, and its square would be too small for a normal number: a hundred times slower
            height = np.where(power > -100.0, np.exp(np.maximum(power, -100.0)), 0.0)
        column[near] = sign * pair.along[axis][near] * height
    return columns


def _let_go(reached: Vector, stuck: float) -> Vector:
    """How far an axis is behind over its largest, at times over that of the largest; it sticks for `stuck` × τ."""
    times = reached * (stuck + 2.0 / (2.0 + stuck))  # over τ
    after = np.clip(times - stuck, 0.0, 100.0)
    behind, pushed = stuck**2 / 2.0, stuck + stuck**2 / 2.0
    gone = (behind + pushed * after) * np.exp(-after) * (after < 100.0)
    return np.asarray(np.where(times < stuck, times**2 / 2.0, gone) / (pushed * math.exp(-2.0 / (2.0 + stuck))))


def cyclic_columns(pair: CirclePair, axis: int, wavelength_um: float) -> Matrix:
    """Error of an axis that repeats along it, cosine and sine from the middle, (n_samples, 2); each multiplies µm."""
    phase = 2.0 * np.pi * pair.radius_um * pair.places[axis] / wavelength_um
    return np.column_stack([pair.along[axis] * np.cos(phase), pair.along[axis] * np.sin(phase)])
