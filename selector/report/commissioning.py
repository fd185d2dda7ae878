"""The sheet that goes to the machine with an exported program: wiring, sign test, limits, restart, proof."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from selector import __version__
from selector.atomic_file import write_whole
from selector.controllers.formula import formula_text, legend_text
from selector.controllers.guard.codes import LEAST_GOOD_SAMPLES
from selector.controllers.model_file import ModelFile
from selector.controllers.model_io import equations_sha256
from selector.controllers.replay.replayed import Replay
from selector.controllers.signs import is_turned
from selector.controllers.writers.exported import Exported
from selector.figures.replay import replayed_run
from selector.findings import Finding
from selector.report.model_card import limits_table, model_card, sensors_table
from selector.report.numbers import NONE, number_text, share_text
from selector.report.page import Picture, Pictures, rendered
from selector.report.tables import Table, remarks_of, table

MOST_RUNS_DRAWN = 3


def write_commissioning_sheet(
    path: str | Path,
    model: ModelFile,
    exported: Exported,
    title: str,
    *,
    replay: Replay | None,
    findings: Sequence[Finding],
    is_sign_verified: bool,
    has_guard: bool = True,
) -> Path:
    """Write the sheet as one HTML file that needs no network, to be printed and signed.

    Parameters
    ----------
    path : path
    model : ModelFile
    exported : Exported
    title : str
        Of the control.
    replay : Replay or None
        The proof; None if none was asked for, or possible.
    findings : sequence of Finding
    is_sign_verified : bool
    has_guard : bool
        Whether this control checks sensors and limits the correction.

    Raises
    ------
    OptionError
        The file cannot be written.
    """
    pictures = Pictures()
    values: dict[str, Any] = {
        "title": f"Thermal correction: {title}",
        "version": __version__,
        "is_sign_verified": is_sign_verified,
        "identity": equations_sha256(model),
        "turned": [output.name for output in model.outputs if is_turned(output)],
        "sign_test": exported.sign_test,
        "commanded": [
            (
                one.output,
                one.axis or NONE,
                one.command,
                f"{one.wait_s:.0f} s" if one.wait_s else "none",
                one.shown,
                f"{one.expected_um:+g}".replace("-", "−"),
            )
            for one in exported.sign_test.commanded
        ],
        "name": model.name,
        "formulas": formula_text(model),
        "legend": legend_text(model).splitlines(),
        "files": list(exported.files),
        "install": list(exported.install),
        "silently": list(exported.silently),
        "sensors": sensors_table(model, has_guard=has_guard),
        "limits": limits_table(model) if has_guard else None,
        "has_rate_limit": has_guard and any(item.rate_limit_per_min is not None for item in model.inputs),
        "replay": None if replay is None else replay_table(replay),
        "parts_of_replay": None if replay is None else parts_table(replay),
        "verdict": None if replay is None else verdict_of(replay),
        "courses": [] if replay is None else _courses(pictures, model, replay),
        "card": model_card(model, has_guard=has_guard),
        "remarks": remarks_of(findings),
    }
    target = Path(path)
    write_whole(target, rendered("commissioning.html", values).encode("utf-8", "replace"))
    return target


def verdict_of(replay: Replay) -> str:
    """The result of a replay in a sentence."""
    largest = replay.max_abs_difference_um
    told = "not at all: every bit is the same" if largest == 0.0 else f"by {number_text(largest)} µm at most"
    return (
        f"{replay.rows} recorded samples went through the generated program ({replay.executed_by}) and through the "
        f"reference: they differ {told}."
    )


BEFORE_AND_AFTER = (
    "Without correction: displacement as recorded, from its start. With correction: what is left of it with the "
    "correction that this program gave, limits, guard and start readings from single samples included."
)


def errors_of(replay: Replay) -> list[str]:
    """What the recorded displacement was without the correction and with it, a line per run and output."""
    said = [
        f"run {run.run}, {name}: {number_text(of.before_rmse_um)} µm rms without correction, {number_text(of.rmse_um)} "
        f"µm with it (largest {number_text(of.max_um)} µm)"
        for run in replay.runs
        for name, of in run.accuracy.items()
        if of.rmse_um is not None
    ]
    return [*said, *_beginnings(replay), *([BEFORE_AND_AFTER] if said else [])]


def _beginnings(replay: Replay) -> list[str]:
    """How long nothing was corrected at the start of the runs; nothing where the control does not wait."""
    waited = [run.begins_s for run in replay.runs if run.begins_s > 0.0]
    if not waited:
        return []
    shortest, longest = f"{min(waited):.0f}", f"{max(waited):.0f}"
    first = longest if shortest == longest else f"{shortest} … {longest}"
    return [
        f"No correction in the first {first} s of a run: readings have to be good for some time first, in "
        f"{LEAST_GOOD_SAMPLES} samples or more, and the correction then grows at its slew limit; the largest errors "
        "may be from there. A control that has run for some time is past this."
    ]


def replay_table(replay: Replay) -> Table:
    """One row per run and output."""
    rows = []
    for run in replay.runs:
        for name, of in run.accuracy.items():
            rows.append(
                (
                    run.run,
                    name,
                    str(len(run.time_s)),
                    number_text(run.max_abs_difference_um) if run.max_abs_difference_um else "0",
                    number_text(of.before_rmse_um),
                    number_text(of.rmse_um),
                    number_text(of.max_um),
                    share_text(run.faulty_share),
                )
            )
    return table(
        ["run", "output", ">samples", ">program − reference [µm]", ">without correction: rms [µm]",
         ">with correction: rms [µm]", ">with correction: largest [µm]", ">not the whole model"],
        rows,
        " ".join([BEFORE_AND_AFTER, *_beginnings(replay)]),
    )  # fmt: skip


def parts_table(replay: Replay) -> Table:
    """One row per written file and output."""
    rows = [
        (
            part.file,
            part.output,
            number_text(part.max_abs_difference_um) if part.max_abs_difference_um else "0",
            number_text(part.allowed_um) if part.allowed_um else "0",
            number_text(part.guard_difference_um) if part.lacks else "0",
            part.executed_by,
        )
        for part in replay.parts
    ]
    return table(
        ["file", "output", ">largest difference [µm]", ">allowed [µm]", ">smaller guard [µm]", "executed by"],
        rows,
        "Difference: to what the file has to give. Allowed: what its number type explains; more is a defect. Smaller "
        "guard: from what this file has to give to what the whole guard gives, where the control has a smaller one.",
    )


def _courses(pictures: Pictures, model: ModelFile, replay: Replay) -> list[Picture]:
    drawn = []
    for run in replay.runs[:MOST_RUNS_DRAWN]:
        for k, output in enumerate(model.outputs):
            recorded = run.recorded_um[:, k]
            text = "" if np.isfinite(recorded).any() else "This run has no recorded displacement."
            # as seen at the tool, whatever way the control counts
            seen = -run.correction_um[:, k] if is_turned(output) else run.correction_um[:, k]
            drawn.append(pictures.add(replayed_run(run.run, output.name, run.time_s, seen, recorded), text))
    return drawn
