"""A whole circular test: counter-clockwise and clockwise at every feed, simulated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from selector.physics.drive.ball_bar.circle import BallBarTrace, Circle, PairGeometry, TableBall, ball_bar_run
from selector.physics.drive.parts.axis import Axis


@dataclass(frozen=True)
class BallBarPlan:
    """Which circles are run: both directions at every feed."""

    radius_m: float = 0.1
    feeds_mm_per_min: tuple[float, ...] = (100.0, 1000.0, 3000.0, 5000.0)
    table_ball: TableBall | None = None
    start_angle_rad: float = 0.0
    noise_um: float = 0.0

    @property
    def circles(self) -> tuple[Circle, ...]:
        path = (self.radius_m, (0.0, 0.0), self.start_angle_rad, math.pi / 4, self.table_ball)
        return tuple(Circle(feed, direction, *path) for feed in self.feeds_mm_per_min for direction in (1, -1))


def ball_bar_test(
    axes: Mapping[str, Axis], geometry: PairGeometry | None = None, plan: BallBarPlan | None = None, **options
) -> tuple[BallBarTrace, ...]:
    """The traces of all circles of the plan; options as `ball_bar_run` has them."""
    ideal, asked = geometry or PairGeometry(), plan or BallBarPlan()
    return tuple(
        ball_bar_run(axes, circle, ideal, noise_um=asked.noise_um, number=number, **options)[0]
        for number, circle in enumerate(asked.circles)
    )
