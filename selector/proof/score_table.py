"""Is it good enough: the scores beside their first bar and their goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from selector.proof.intervals import Measured

Better = Literal["low", "high", "zero", "neither"]


@dataclass(frozen=True)
class Score:
    """What a score is: its key, name, unit (``"share"``, ``"1"``, ``"s"``), and what would be good enough.

    `better` says on which side of `bar` and `goal` it has to be: "low", "high", or "zero" = 0 within the interval or
    above it.
    """

    key: str
    title: str
    better: Better = "neither"
    bar: float | None = None
    goal: float | None = None
    unit: str = "share"


@dataclass(frozen=True)
class Row:
    """A score, what was measured, and whether that meets first bar and goal; None where there is none, or no case."""

    score: Score
    measured: Measured
    meets_bar: bool | None
    meets_goal: bool | None

    def as_dict(self) -> dict[str, Any]:
        """The row as JSON values."""
        return {
            "score": self.score.title,
            "unit": self.score.unit,
            **vars(self.measured),
            "first_bar": self.score.bar,
            "goal": self.score.goal,
            "meets_first_bar": self.meets_bar,
            "meets_goal": self.meets_goal,
        }


ROWS: tuple[Score, ...] = (
    Score("false_on_clean", "any false name on clean cases", "low", 0.05, 0.01),
    Score("found_6", "right name, or a set that contains it, at d′ = 6", "high", 0.90, 0.95),
    Score("exact_6", "exactly the right name at d′ = 6", "high", 0.75, 0.90),
    Score("unexplained", "outside the catalogue, d′ ≥ 6: unexplained and no wrong name", "high", 0.80, 0.95),
    Score("window_iou", "windows: intersection over union, median, d′ ≥ 6", "high", 0.5, 0.8, "1"),
    Score("channel", "channel right, d′ ≥ 6", "high", 0.90, 0.98),
    Score("gap_closed", "held-out gap recalibrated → oracle closed, median, d′ ≥ 6", "high", 0.70, 0.90),
    Score("placebo", "gain of placebos, mean", "zero", 0.0, 0.0),
    Score("calibration", "calibration error of the confidence (ECE)", "low", 0.10, 0.05, "1"),
    Score("seconds", "seconds a case, median", "low", 60.0, 10.0, "s"),
    Score("first_6", "right name first, whatever else is in the set, at d′ = 6"),
    Score("found_3", "right name, or a set that contains it, at d′ = 3"),
    Score("exact_3", "exactly the right name at d′ = 3"),
    Score("found_12", "right name, or a set that contains it, at d′ = 12"),
    Score("exact_12", "exactly the right name at d′ = 12"),
    Score("found_real", "right name, or a set that contains it, where no strength can be chosen"),
    Score("verdict", "verdict right, all cases"),
    Score("verdict_miscalibrated", "verdict right, miscalibrated cases"),
    Score("verdict_data", "verdict right, faults of the data"),
    Score("false_on_all", "any false name, all cases"),
    Score("false_outside", "any false name, outside the catalogue"),
    Score("placebo_covers", "placebos whose own interval holds 0"),
    Score("failed", "cases that raised an error"),
)


def score_table(measured: Mapping[str, Measured]) -> tuple[Row, ...]:
    """The rows in order, judged against first bar and goal."""
    return tuple(
        Row(
            score,
            measured[score.key],
            _meets(score, score.bar, measured[score.key]),
            _meets(score, score.goal, measured[score.key]),
        )
        for score in ROWS
    )


def _meets(score: Score, limit: float | None, measured: Measured) -> bool | None:
    if limit is None or measured.value is None or measured.low is None:
        return None
    if score.better == "zero":
        return measured.low <= 0.0
    return measured.value <= limit if score.better == "low" else measured.value >= limit
