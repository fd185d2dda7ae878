"""What a control with less than the whole guard has to give: the reference without what its sheet says is left out.

Then any difference of its program is a defect, and what the smaller guard costs on a recording is a number of its own.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.controllers.evaluator import evaluate
from selector.controllers.guard.codes import LARGEST_NUMBER, SAMPLE_S, SensorCode
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.replay.rows import Answers, Array, Rows, reference_answers
from selector.controllers.signs import is_turned
from selector.controllers.writers.fanuc import LONGEST_PAUSE_S


def without_fallbacks(model: ModelFile) -> ModelFile:
    """The guard of the fixed-point program: no fallback models, no sensor that stands still is found."""
    guard = model.guard
    on_fault = guard.without_fallback if guard.on_fault == "fallback" else guard.on_fault
    changes = {"on_fault": on_fault, "stuck_after_s": None}
    return model.model_copy(update={"guard": guard.model_copy(update=changes), "fallbacks": ()})


def macro_model(model: ModelFile) -> ModelFile:
    """The guard of custom macro B: also no jumps, no end of holding, no position."""
    small = without_fallbacks(model)
    return small.model_copy(
        update={
            "inputs": tuple(item.model_copy(update={"rate_limit_per_min": None}) for item in small.inputs),
            "outputs": tuple(output.model_copy(update={"position": None}) for output in small.outputs),
            "guard": small.guard.model_copy(update={"hold_at_most_s": None}),
        }
    )


def macro_corrections_um(model: ModelFile, rows: Rows) -> Array:
    """What a macro has to give that is called as its sheet says, of shape (n_rows, n_outputs) [µm].

    With one bad reading it takes none of that call: memory and start readings wait for all sensors. So does it in the
    first call after a pause.
    """
    small, calls = macro_model(model), sampled_rows(rows)
    called = dataclasses.replace(rows_at(rows, calls), positions_m=np.zeros((len(calls), 0)))
    called.readings[called.dt_s > LONGEST_PAUSE_S] = np.nan
    limiting = small.model_copy(update={"guard": small.guard.model_copy(update={"outside_valid_range": "limit-input"})})
    # what is bad whatever the start reading, then what is outside the valid range
    for judged in (limiting, small):
        bad = np.any(reference_answers(judged, called).sensors > SensorCode.RECOVERING, axis=1, keepdims=True)
        called = dataclasses.replace(called, readings=np.where(bad, np.nan, called.readings))
    return held(reference_answers(small, called).correction_um, calls, len(rows))


def sampled_rows(rows: Rows) -> NDArray[np.int64]:
    """Rows in which readings are looked at, at most once a second; without restarts."""
    sampled, since = [], np.inf
    for k, dt_s in enumerate(rows.dt_s.tolist()):
        since += dt_s
        if since >= SAMPLE_S:
            sampled.append(k)
            since = 0.0
    return np.array(sampled, dtype=np.int64)


def rows_at(rows: Rows, calls: NDArray[np.int64]) -> Rows:
    """These rows alone, with the time from one to the next."""
    tables: dict[str, Any] = {field.name: getattr(rows, field.name) for field in dataclasses.fields(Rows)}
    chosen: dict[str, Any] = {name: None if table is None else table[calls] for name, table in tables.items()}
    return Rows(**chosen | {"dt_s": np.diff(np.cumsum(rows.dt_s)[calls], prepend=0.0)})


def held(answers: NDArray[Any], calls: NDArray[np.int64], n_rows: int) -> NDArray[Any]:
    """The answer of each call, until the next."""
    return answers[np.searchsorted(calls, np.arange(n_rows), side="right") - 1]


def unguarded_um(model: ModelFile, rows: Rows) -> Array:
    """The model alone, on whatever readings, of shape (n_rows, n_outputs) [µm]; 0 where it has none.

    For models without memory: time is not looked at.
    """
    readings = {item.name: rows.readings[:, k] for k, item in enumerate(model.inputs)}
    positions = dict(zip(axes_of(model), places_m(model, rows).T, strict=True))
    found = evaluate(model, np.arange(len(rows)), readings, None, positions or None)
    displacement = np.column_stack([found[output.name] for output in model.outputs])
    signs = [1.0 if is_turned(output) else -1.0 for output in model.outputs]
    return np.where(np.isfinite(displacement), signs * displacement, 0.0)


def straight_line_um(model: ModelFile, rows: Rows, answers: Answers) -> Array:
    """K0 + m · (P − P0) wherever the axis stands, of shape (n_rows, n_outputs) [µm]: no control clamps its line."""
    line, places, axes = answers.k0_um.copy(), places_m(model, rows), axes_of(model)
    for k, output in enumerate(model.outputs):
        if output.position is not None:
            away_m = places[:, axes.index(output.position.axis)] - output.position.reference_m
            line[:, k] += answers.slope_um_per_m[:, k] * away_m
    return line


def places_m(model: ModelFile, rows: Rows) -> Array:
    """Positions of the rows, what is missing replaced by the last known one, at first by the reference."""
    parts = {o.position.axis: o.position for o in model.outputs if o.position is not None}
    filled = rows.positions_m.copy()
    for k, axis in enumerate(axes_of(model)):
        is_known = np.abs(filled[:, k]) <= LARGEST_NUMBER
        last = np.maximum.accumulate(np.where(is_known, np.arange(len(rows)), -1))
        filled[:, k] = np.where(last >= 0, filled[last, k], parts[axis].reference_m)
    return filled
