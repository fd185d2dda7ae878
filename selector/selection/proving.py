"""The proof: every part of the recording predicted by a procedure that has not seen it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from selector.models.design import Datum
from selector.models.rows import rows_of
from selector.models.validation import (
    ErrorCurvePoint,
    Grouping,
    HeldOut,
    LeaveOneOut,
    error_curve_point,
    response_power,
)
from selector.recording import RunSource
from selector.selection.choice import Choice, Offer, Trial
from selector.selection.fitting import Part, predictions, refined
from selector.selection.library import Library
from selector.selection.options import Question
from selector.selection.result import RunProof, Trace

TRACE_POINTS = 1500
"""Of one part that was left out; with many parts fewer, so that all have `MOST_TRACE_POINTS` at most."""

MOST_TRACE_POINTS = 120_000
TRACE_DIGITS = 4
"""Decimals of traces [µm, s]: they are for pictures, and results hold them as text."""


def left_out_errors(
    question: Question,
    source: RunSource,
    datum: Datum,
    choices: Sequence[Choice],
    parts: Sequence[Part],
    ridge: float,
) -> tuple[dict[str, tuple[RunProof, ...]], tuple[Trace, ...]]:
    """Errors on each part, from the sensors, terms, time constants and coefficients that the others chose."""
    proofs: dict[str, list[RunProof]] = {name: [] for name in question.responses}
    traces: list[Trace] = []
    points = max(2, min(TRACE_POINTS, MOST_TRACE_POINTS // max(len(parts), 1)))
    for choice, part in zip(choices, parts, strict=True):
        recipe = refined(question, source, datum, choice.trial, part.training)
        rows = rows_of(source, recipe.design, source.runs)
        unseen = rows.only(part.unseen(rows))
        if not len(unseen.run):
            continue
        predicted = predictions(recipe, rows.only(part.training(rows)), unseen, ridge=ridge)
        error = unseen.responses - predicted
        for j, name in enumerate(question.responses):
            measured = unseen.responses[:, j]
            proofs[name].append(
                RunProof(
                    part.name,
                    recipe.sensors,
                    float(np.sqrt(np.mean(error[:, j] ** 2))),
                    float(np.abs(error[:, j]).max()),
                    float(error[:, j].mean()),
                    float(np.sqrt(np.mean(measured**2))),
                    float(np.abs(measured).max()),
                    len(measured),
                )
            )
        for r in np.unique(unseen.run):
            at = np.flatnonzero(unseen.run == r)
            at = at[:: max(1, -(-len(at) // points))]
            courses = (unseen.time_s[at], unseen.responses[at], predicted[at])
            traces.append(Trace(unseen.runs[r], *(np.round(course, TRACE_DIGITS) for course in courses)))
    return {name: tuple(found) for name, found in proofs.items()}, tuple(traces)


def error_curve(library: Library, outer: Grouping, choices: Sequence[Choice]) -> tuple[ErrorCurvePoint, ...]:
    """Held-out error against the number of sensors, the set of every size chosen anew inside each fold.

    A fold whose groups allow no set of a size takes its largest smaller one.
    """
    sizes = sorted({size for choice in choices for size in choice.by_size})
    loo = LeaveOneOut.of(library.moments, outer)
    return tuple(
        error_curve_point(size, _held_out(library, loo, [_of_size(choice, size) for choice in choices]))
        for size in sizes
        if all(min(choice.by_size) <= size for choice in choices)
    )


def _of_size(choice: Choice, size: int) -> Trial:
    return choice.by_size[max(known for known in choice.by_size if known <= size)]


def baselines(
    linear: Library, library: Library, outer: Grouping, others: Mapping[Offer, Sequence[Choice]]
) -> dict[str, dict[str, float]]:
    """What other ways reach on the same unseen parts [µm rmse], per response; `others` are offers not taken."""
    loo = LeaveOneOut.of(linear.moments, outer)
    n = len(linear.responses)
    samples = loo.left_out[:, 0, 0]
    at = 1 + linear.moments.n_columns + np.arange(n)
    ways = {
        "none": HeldOut(loo.left_out[:, at, at], samples).rmse_um,
        "mean": loo.errors([], n).rmse_um,
        "all sensors": loo.errors(list(range(linear.moments.n_columns)), n).rmse_um,
    }
    rest = LeaveOneOut.of(library.moments, outer)
    for offer, choices in others.items():
        ways[f"chosen, {offer}"] = _held_out(library, rest, [choice.trial for choice in choices]).rmse_um
    return {name: {way: float(rmse[j]) for way, rmse in ways.items()} for j, name in enumerate(linear.responses)}


def relative_error(library: Library, outer: Grouping, choices: Sequence[Choice]) -> float:
    """Held-out root mean square error relative to the spread of the displacements, over all responses."""
    loo = LeaveOneOut.of(library.moments, outer)
    held_out = _held_out(library, loo, [choice.trial for choice in choices])
    return float(np.sqrt((held_out.rmse_um**2 / response_power(library.moments)).mean()))


def _held_out(library: Library, loo: LeaveOneOut, trials: Sequence[Trial]) -> HeldOut:
    """Errors when each group is predicted by its own trial."""
    n = len(library.responses)
    rows = []
    for i, trial in enumerate(trials):
        one = LeaveOneOut(loo.training[i : i + 1], loo.left_out[i : i + 1], loo.n_columns)
        rows.append(one.errors(library.columns(trial.set.sensors, trial.shape), n).sse[0])
    return HeldOut(np.array(rows), loo.left_out[:, 0, 0])
