"""A whole circular test: counter-clockwise and clockwise at every feed, simulated."""

from __future__ import annotations

from collections.abc import Mapping

from selector.physics.drive.ball_bar.circle import BallBarPlan, BallBarTrace, PairGeometry, ball_bar_run
from selector.physics.drive.parts.axis import Axis


def ball_bar_test(
    axes: Mapping[str, Axis], geometry: PairGeometry | None = None, plan: BallBarPlan | None = None, **options
) -> tuple[BallBarTrace, ...]:
    """The traces of all circles of the plan; options as `ball_bar_run` has them."""
    ideal, asked = geometry or PairGeometry(), plan or BallBarPlan()
    return tuple(
        ball_bar_run(axes, circle, ideal, asked, number=number, **options)[0]
        for number, circle in enumerate(asked.circles)
    )
