"""What each cause does to the radius of a circle: a named column a cause, and the shapes that are not linear.

θ is the angle of the bar, d = ±1 the direction, x = R·cos θ and y = R·sin θ the axes, s the time or arc since an axis
reversed. An error e of the first axis moves the radius by e·cos θ, one of the second by e·sin θ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.ball_bar import BallBarTrace

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SMOOTH = (
    "centre 0",
    "centre 1",
    "radius",
    "scale-mismatch",
    "squareness",
    "gain-mismatch",
    "straightness 0",
    "straightness 1",
)
"""Columns that need no shape; 0 and 1 are the axes."""


@dataclass(frozen=True, eq=False)
class CirclePair:
    """The two directions of a circle, one after the other.

    Attributes
    ----------
    angle_rad, direction, deviation_um : ndarrays of shape (n_samples,)
        θ, d [–] and the deviation [µm].
    radius_um, speed_um_per_s : float
        R and feed [µm], [µm/s].
    parts : tuple of slice
        Samples of each direction.
    """

    angle_rad: Vector
    direction: Vector
    deviation_um: Vector
    radius_um: float
    speed_um_per_s: float
    parts: tuple[slice, ...]

    @cached_property
    def since_reversal_rad(self) -> tuple[tuple[Vector, Vector], tuple[Vector, Vector]]:
        """Axis → arc travelled since its reversal at its positive end, at its negative end, each from 0 to 2π."""
        turn = 2.0 * np.pi
        ends = ((0.0, np.pi), (np.pi / 2.0, 1.5 * np.pi))
        first, second = ([(self.direction * (self.angle_rad - end)) % turn for end in axis] for axis in ends)
        return (first[0], first[1]), (second[0], second[1])

    @cached_property
    def along(self) -> tuple[Vector, Vector]:
        """Position of each axis over the radius: cos θ and sin θ."""
        return np.cos(self.angle_rad), np.sin(self.angle_rad)

    @property
    def reach(self) -> float:
        """How much longer the arm of the axes is along the bar than the bar itself, on average."""
        return 1.0


def pair_of(traces: Sequence[BallBarTrace]) -> CirclePair:
    """Traces of one feed as one pair."""
    ends = np.cumsum([0, *(len(one.angle_rad) for one in traces)])
    return CirclePair(
        np.concatenate([one.angle_rad for one in traces]),
        np.concatenate([np.full(len(one.angle_rad), float(one.direction)) for one in traces]),
        np.concatenate([one.deviation_um for one in traces]),
        traces[0].radius_m * 1e6,
        float(np.mean([one.feed_mm_per_min for one in traces])) * 1e3 / 60.0,
        tuple(slice(int(a), int(b)) for a, b in pairwise(ends)),
    )


def smooth_columns(pair: CirclePair) -> Matrix:
    """Columns of `SMOOTH`, shape (n_samples, 8): each multiplies µm.

    Centre: place of the spindle ball against the middle. Radius: constant. Scale mismatch: half the difference of the
    two radii, cos 2θ. Squareness: sin 2θ. Gain mismatch: half the difference of the two lags along the path, d·sin 2θ.
    Straightness: a bow b of the first axis, b·cos²θ·sin θ, of the second, b·sin²θ·cos θ, less what looks like a centre.
    """
    angle = pair.angle_rad
    return np.column_stack(
        [
            *pair.along,
            np.ones(len(angle)),
            np.cos(2.0 * angle),
            np.sin(2.0 * angle),
            pair.direction * np.sin(2.0 * angle),
            np.sin(3.0 * angle) / 4.0,
            -np.cos(3.0 * angle) / 4.0,
        ]
    )


def backlash_columns(pair: CirclePair, axis: int, gap_um: tuple[float, float]) -> Matrix:
    """Lost motion of an axis at its positive and at its negative end, (n_samples, 2); each multiplies the whole gap.

    The table lags by half the gap on the side it comes from; between the ends the gap changes along the travel. After a
    reversal the table waits until the drive has gone through the gap: R·(1 − cos s) = `gap_um`.
    """
    along = pair.along[axis]
    behind_high, behind_low = pair.since_reversal_rad[axis]
    after_high = behind_high < behind_low
    since = np.where(after_high, behind_high, behind_low)
    gone = pair.radius_um * (1.0 - np.cos(np.minimum(since, np.pi)))
    gap = np.where(after_high, gap_um[0], gap_um[1])
    # where the drive stands in its gap: from 1 to −1 after the positive end
    state = 1.0 - np.divide(2.0 * gone, gap, out=np.full(len(gone), np.inf), where=gap > 0)
    lag = np.where(after_high, 1.0, -1.0) * np.maximum(state, -1.0)
    part = -along * lag / 2.0
    return np.column_stack([part * (1.0 + along) / 2.0, part * (1.0 - along) / 2.0])


def spike_columns(pair: CirclePair, axis: int, spike: tuple[float, float]) -> Matrix:
    """Spikes of an axis after the reversals at its positive and negative end, (n_samples, 2); each multiplies µm.

    ((s/w)·exp(1 − s/w))^k with (w, k) = `spike`: 1 at its highest, at s = w [s]; its width falls as w/√k. Positive
    outwards: the axis stays where it turned, and follows when it breaks away.
    """
    height = np.abs(pair.along[axis])
    columns = []
    for arc in pair.since_reversal_rad[axis]:
        reached = np.maximum(arc * pair.radius_um / pair.speed_um_per_s / spike[0], 1e-300)
        columns.append(height * np.exp(spike[1] * (np.log(reached) + 1.0 - reached)))
    return np.column_stack(columns)


def cyclic_columns(pair: CirclePair, axis: int, wavelength_um: float) -> Matrix:
    """Error of an axis that repeats along it, cosine and sine from the middle, (n_samples, 2); each multiplies µm."""
    along = pair.along[axis]
    phase = 2.0 * np.pi * pair.radius_um * along / wavelength_um
    return np.column_stack([along * np.cos(phase), along * np.sin(phase)])
