"""What else than a broken sensor could make a channel leave its siblings in one run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from selector.quality.relations import Relations
from selector.quality.survey import Floats, Survey

_BEYOND = 0.25
"""The siblings may go beyond their range in the other runs by this share of it: further, the relation is a guess."""
_OTHERS_QUIET = 1.5
"""When another channel is off by more than so many times what is usual for it, the run is one of another kind."""
_TESTED = 0.5
"""The channel must have followed its siblings over a movement of this share of the departure at least."""
_WARM_K = 2.0
"""A run in which a channel starts so far from its place among the others does not start like the other runs [K]."""
_OWN_SOURCE_K = 3.0
"""A place with a source of heat of its own, a tank or a pump, may leave the others by as much when it is used [K]."""
_SHARE = 0.1
"""A switch or flow may be on for this share of the run more or less than in any of the other runs."""


def other_cause(
    relations: Relations, i: int, siblings: Sequence[int], r: int, departure: Floats, off_elsewhere: float
) -> str | None:
    """What could explain that channel `i` leaves its siblings in run `r` although its sensor is sound; None if nothing.

    Parameters
    ----------
    departure : ndarray of shape (n_blocks,)
        What the channel is off by [K].
    off_elsewhere : float
        Largest departure of any other channel in this run over what is usual for that channel.
    """
    others = [o for o in range(len(relations.runs)) if o != r and relations.present[i, o]]
    size = float(np.quantile(np.abs(departure), 0.95))
    warm = _starting_elsewhere(relations, r, others)
    if warm is not None:
        return f"the run does not start like the others ({_name(relations, warm)})"
    switch = _switched_otherwise(relations.survey, r, others)
    if switch is not None:
        return f"{switch} is on for longer or shorter than in the other runs"
    for j in siblings:
        here = _rise(relations, j, r)
        seen = np.concatenate([_rise(relations, j, o) for o in others])
        margin = _BEYOND * float(np.ptp(seen))
        if here.max() > seen.max() + margin or here.min() < seen.min() - margin:
            return f"{_name(relations, j)} is beyond what the other runs cover"
    if size < _OWN_SOURCE_K:
        return "a source of heat at its place could do as much"
    if max(float(np.ptp(relations.movement(o)[i])) for o in others) < _TESTED * size:
        return "in the other runs it moved too little to know how it follows"
    return "other channels are off more than usual too" if off_elsewhere > _OTHERS_QUIET else None


def _rise(relations: Relations, i: int, r: int) -> Floats:
    course = relations.movement(r)[i]
    return np.asarray(course - np.median(course[: max(3, course.size // 10)]), dtype=np.float64)


def _starting_elsewhere(relations: Relations, r: int, others: Sequence[int]) -> int | None:
    """The thermal channel whose start, seen from the room or else the middle of all, is not that of the other runs."""
    survey = relations.survey
    thermal = [i for i, role in enumerate(relations.roles) if role != "displacement"]
    room = [i for i in thermal if relations.roles[i] == "ambient"]
    level = np.array([[survey.scale(run, column).start for run in relations.runs] for column in relations.columns])
    level = level - np.array([_middle(row) for row in level[room or thermal].T])
    off = np.abs(level[:, r] - np.array([_middle(row) for row in level[:, list(others)]]))
    off = np.where(np.isfinite(off) & np.isin(np.arange(off.size), thermal), off, 0.0)
    return int(np.argmax(off)) if off.max() > _WARM_K else None


def _switched_otherwise(survey: Survey, r: int, others: Sequence[int]) -> str | None:
    """The state or flow whose mean over the run lies outside that of the other runs."""
    for column in survey.columns("state", "flow"):
        means = [survey.values[run][column] for run in survey.runs]
        mean = np.array([float(np.mean(x[np.isfinite(x)])) if np.isfinite(x).any() else np.nan for x in means])
        seen = mean[list(others)]
        seen = seen[np.isfinite(seen)]
        every = np.concatenate([x[np.isfinite(x)] for x in means])
        margin = _SHARE * float(np.ptp(every)) if every.size else 0.0
        if seen.size and not seen.min() - margin <= mean[r] <= seen.max() + margin:
            return survey.channels[column].name
    return None


def _middle(values: Floats) -> float:
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else float("nan")


def _name(relations: Relations, i: int) -> str:
    return relations.survey.channels[relations.columns[i]].name
