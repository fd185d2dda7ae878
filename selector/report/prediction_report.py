"""The report of a prediction: first what to correct when, then why, then everything."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from selector import __version__
from selector.atomic_file import write_whole
from selector.figures.duty_cycle import duty_cycle, prediction_of_tests, thermal_modes
from selector.findings import Where
from selector.physics.thermal.correction_text import program_blocks
from selector.physics.thermal.cyclogram_kind import cyclogram_kind
from selector.physics.thermal.prediction import Prediction
from selector.report import origin
from selector.report.numbers import NONE, given_text, number_text, span_text
from selector.report.page import Picture, Pictures, rendered
from selector.report.prediction_wording import prediction_advice
from selector.report.tables import Table, remarks_of, table
from selector.report.wording import label_of

MOST_ROWS = 400
MOST_TESTS = 12


def write_prediction_report(
    prediction: Prediction,
    path: str | Path,
    *,
    title: str | None = None,
    description: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Path:
    """Write the report of a prediction as one HTML file that needs no network; whole or not at all.

    Parameters
    ----------
    prediction : Prediction
    path : path
        The file; its folder must exist.
    title : str, optional
        Heading of the page.
    description : mapping, optional
        How the tests were read, as `selector describe` says it.
    provenance : mapping, optional
        ``machine``: its name; ``runs``: file and SHA-256 of every run; further facts are shown as they are.

    Raises
    ------
    OptionError
        The file cannot be written; an old file of that name is untouched.
    """
    target = Path(path)
    page = prediction_html(prediction, title=title, description=description, provenance=provenance)
    # a lone surrogate in a name must not end the report
    write_whole(target, page.encode("utf-8", "replace"))
    return target


def prediction_html(
    prediction: Prediction,
    *,
    title: str | None = None,
    description: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> str:
    """The report as text, see `write_prediction_report`."""
    pictures = Pictures()
    told, described = _visible(provenance or {}), _visible(description or {})
    prediction = replace(
        prediction,
        findings=tuple(
            replace(
                one,
                statement=_visible(one.statement),
                where=Where(**{k: _visible(v) for k, v in vars(one.where).items()}),
            )
            for one in prediction.findings
        ),
        repeats=tuple(replace(one, run=_visible(one.run)) for one in prediction.repeats),
    )
    names = prediction.responses
    machine = told.get("machine")
    values: dict[str, Any] = {
        "title": title or ": ".join(["Duty cycle", *([str(machine)] if machine else [])]),
        "version": __version__,
        "label": label_of(title or "", told, described),
        "advice": prediction_advice(prediction),
        "urgent": remarks_of(prediction.findings, "error", "warning"),
        "courses": [
            pictures.add(duty_cycle(prediction, name), _COURSE if i == 0 else "") for i, name in enumerate(names)
        ],
        "program": _program_table(prediction),
        "blocks": _blocks(prediction),
        "method": prediction.method,
        "tests": [picture for name in names for picture in _tests(pictures, prediction, name)],
        "accuracy": _accuracy_table(prediction),
        "modes": _modes_table(prediction),
        "mode_courses": [
            pictures.add(drawn, _MODES if i == 0 else "")
            for i, drawn in enumerate(thermal_modes(prediction, name) for name in names)
            if drawn is not None
        ],
        "cycle": _cycle_table(prediction),
        "remarks": remarks_of(prediction.findings),
        "reading": origin.reading_tables(described),
        "files": origin.files_table(told),
        "origin": origin.remaining_table(told),
    }
    return rendered("prediction.html", values)


def _visible(value: Any) -> Any:
    """Without the control characters that names may hold, also inside of what is nested."""
    if isinstance(value, str):
        return "".join(sign if sign.isprintable() or sign in "\n\t" else " " for sign in value)
    if isinstance(value, Mapping):
        return {_visible(key): _visible(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_visible(item) for item in value]
    return value


def _tests(pictures: Pictures, prediction: Prediction, response: str) -> list[Picture]:
    """All tests, or of many those that are repeated worst, in the order in which they were read."""
    if not prediction.repeats:
        return []
    r = prediction.responses.index(response)
    repeats = prediction.repeats
    ranked = sorted(range(len(repeats)), key=lambda k: -float(repeats[k].rmse_um[r]))[:MOST_TESTS]
    shown = tuple(repeats[k] for k in sorted(ranked))
    text = _TESTS
    if len(shown) < len(prediction.repeats):
        text += f" Of {len(prediction.repeats)} tests, the {len(shown)} that are repeated worst are drawn."
    return [pictures.add(prediction_of_tests(prediction, response, shown), text)]


def _program_table(prediction: Prediction) -> Table | None:
    if not prediction.programs:
        return None
    rows = [
        (
            _visible(name),
            str(number),
            f"{_down(time_s):.1f}",
            f"{_down(time_s - operation.start_s):.1f}",
            f"{_down(time_s + held_s) - _down(time_s):.1f}",
            "new zero" if k == 0 else number_text(step_um),
            number_text(offset_um),
            f"{offset_um / 1000:.4f}".replace("-", "−"),
        )
        for name, program in prediction.programs.items()
        for number, operation in enumerate(program.operations, start=1)
        for k, (time_s, held_s, step_um, offset_um) in enumerate(
            zip(operation.times_s, operation.durations_s, operation.corrections_um, operation.offsets_um, strict=True)
        )
    ]
    headings = [
        "response",
        ">operation",
        ">at [min]",
        ">after the zero [min]",
        ">holds for [min]",
        ">step [µm]",
        ">offset [µm]",
        ">offset [mm]",
    ]
    more = f" {len(rows) - MOST_ROWS} more rows are in program.csv." if len(rows) > MOST_ROWS else ""
    note = "Step and offset are the displacement to be subtracted, counted as the gauge counted in the tests. "
    note += "Times are rounded down to 0.1 min, so corrections act up to 6 s early; the JSON form is exact." + more
    return table(headings, rows[:MOST_ROWS], note)


def _down(time_s: float) -> float:
    """Minutes, rounded down: a correction that is read from here is never late."""
    return math.floor(time_s / 6.0 + 1e-6) / 10.0


def _blocks(prediction: Prediction) -> str:
    """Timed offset blocks, the first of very many."""
    if not prediction.programs:
        return ""
    lines = program_blocks(prediction.programs).splitlines()
    # the rules stand in the page already
    first = next(i for i, line in enumerate(lines) if line.startswith("["))
    lines = lines[first:]
    more = [f"; {len(lines) - MOST_ROWS} more lines are in program.txt"] if len(lines) > MOST_ROWS else []
    return "\n".join([*lines[:MOST_ROWS], *more]).strip()


def _accuracy_table(prediction: Prediction) -> Table:
    """Errors of every response; those of single tests too."""
    columns = [f">{_visible(name)} [µm]" for name in prediction.responses]
    rows = [
        (label, *(number_text(float(value), 2) for value in values))
        for label, values in (
            ("tests that were fitted, means over some samples", prediction.residual_um),
            ("tests, or stretches of them, that were left out", prediction.heldout_um),
        )
        if values is not None
    ]
    rows += [
        (f"{one.run}, single samples", *(number_text(float(value), 2) for value in one.rmse_um))
        for one in prediction.repeats
    ]
    note = "Root mean squares of measured minus predicted. Single samples include the noise of the gauge."
    return table(["", *columns], rows, note)


def _modes_table(prediction: Prediction) -> Table | None:
    if not prediction.modes:
        return None
    rows = [
        (
            str(number),
            number_text(mode.tau_s / 60),
            *(NONE if end is None else number_text(end / 60) for end in (mode.low, mode.high)),
        )
        for number, mode in enumerate(prediction.modes, start=1)
    ]
    note = (
        "A dash: the tests set no bound there. After one time constant 63 % of a mode's way is done, after three 95 %."
    )
    return table([">mode", ">time constant [min]", ">low, 95 % [min]", ">high, 95 % [min]"], rows, note)


def _cycle_table(prediction: Prediction) -> Table:
    cyclogram = prediction.cyclogram
    lengths = np.diff(np.r_[cyclogram.start_s, cyclogram.end_s])
    rows = [
        (given_text(start / 60), given_text(float(speed)), span_text(float(length)))
        for start, speed, length in zip(cyclogram.start_s.tolist(), cyclogram.speed_rpm, lengths, strict=True)
    ]
    more = f" {len(rows) - MOST_ROWS} more rows are not shown." if len(rows) > MOST_ROWS else ""
    note = (
        f"A duty cycle of the kind that is called {cyclogram_kind(cyclogram)}, {span_text(cyclogram.end_s)} long."
        + more
    )
    return table([">from [min]", ">speed [r/min]", ">for"], rows[:MOST_ROWS], note)


_MODES = (
    "The displacement in parts that settle with a time constant each: a short one follows the speed within minutes, a "
    "long one is the warmth that a machine keeps over breaks. What parts with similar time constants have each is less "
    "sure than their sum."
)
_COURSE = (
    "Top: the duty cycle. Middle: the predicted displacement; green: what the zeros of the operations and the "
    "corrections take off. Bottom: what is left of it; the band is the tolerance."
)
_TESTS = (
    "Each test is predicted as if it were a duty cycle, from rest and cold; the zero of the gauge is fitted, and where "
    "a finding says so the part of the hall temperature and the state at the start. The residual is measured minus "
    "predicted. All panels have the same scales."
)
