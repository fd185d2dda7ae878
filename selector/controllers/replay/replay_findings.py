"""What a person has to know of a replay: files that differ, runs that the model did not cover, errors that grew."""

from __future__ import annotations

from collections.abc import Iterator

from selector.controllers.replay.replayed import BeyondValid, Replay
from selector.controllers.sensor_check import SLIGHT_SHARE
from selector.findings import Finding, Where

SEEN_UM = 0.01
"""What a smaller guard costs less is not told."""


def replay_findings(proof: Replay, *, has_guard: bool) -> tuple[Finding, ...]:
    """Findings of files (``replay-differs`` …) and of runs (``outside-valid-range``, ``worse-than-nothing`` …).

    `has_guard`: the control takes the end of the valid range for what is beyond it.
    """
    return *_of_runs(proof, has_guard=has_guard), *_of_parts(proof)


def _of_parts(proof: Replay) -> Iterator[Finding]:
    """Files that are farther from what they have to give than their numbers explain; what a smaller guard costs."""
    for part in proof.parts:
        evidence = {"file": part.file, "output": part.output}
        if not part.is_explained:
            yield Finding(
                "replay-differs",
                "error",
                f"{part.file}: {part.output} and the reference differ by up to {part.max_abs_difference_um:.3g} µm; "
                f"{part.allowed_um:.3g} µm is what its numbers explain"
                + (
                    f", and the reference in single precision, which it has to be to the last bit, by "
                    f"{part.in_single_um:.3g} µm."
                    if part.in_single_um > 0.0
                    else "."
                ),
                evidence=evidence
                | {
                    "max_abs_difference_um": part.max_abs_difference_um,
                    "allowed_um": part.allowed_um,
                    "in_single_um": part.in_single_um,
                },
                suggestion="do not use this file: other rules of arithmetic were at work, a sensor was judged "
                "otherwise at the very edge of a limit, or it is a defect of ours",
            )
        if part.lacks and part.guard_difference_um > max(part.allowed_um, SEEN_UM):
            yield Finding(
                "guard-differs",
                "warning",
                f"{part.file}: what {part.output} gets and what the whole guard would give differ by up to "
                f"{part.guard_difference_um:.3g} µm on these runs: {part.lacks}.",
                evidence=evidence | {"guard_difference_um": part.guard_difference_um},
                suggestion="see in the sheet which run it is, and whether a sensor failed there or a limit acted",
            )


def _of_runs(proof: Replay, *, has_guard: bool) -> Iterator[Finding]:
    """Runs in which the program did not follow the whole model, or made the error larger."""
    for run in proof.runs:
        if run.faulty_share > 0.0:
            did = "the program held, ramped to zero or fell back to a model without it"
            if not proof.tells_mode:
                did = "the whole guard would have held, ramped to zero or fallen back; this control followed it"
            yield Finding(
                "not-the-whole-model",
                "warning",
                f"Run {run.run}: a sensor was not to be believed in {run.faulty_share:.1%} of the samples; {did}.",
                Where(run=run.run),
                {"share_of_samples": run.faulty_share},
                "see `selector apply` for the sensor, and the sheet for what the correction did there",
            )
        yield from (_beyond(run.run, one, has_guard=has_guard) for one in run.beyond_valid)
        for name, of in run.accuracy.items():
            if of.rmse_um is not None and of.before_rmse_um is not None and of.rmse_um > of.before_rmse_um:
                yield Finding(
                    "worse-than-nothing",
                    "error",
                    f"Run {run.run}: the program makes {name} worse: RMS error {of.rmse_um:.3g} µm with it, "
                    f"{of.before_rmse_um:.3g} µm without.",
                    Where(channel=name, run=run.run),
                    of.as_dict(),
                    "do not use it like this; check the sign, the first readings and the sensors",
                )


def _beyond(run: str, of: BeyondValid, *, has_guard: bool) -> Finding:
    did = "The program took the end of the range" if has_guard else "This control has no range and extrapolates"
    return Finding(
        "outside-valid-range",
        "info" if of.share_of_samples < SLIGHT_SHARE else "warning",
        f"Run {run}: {of.input} was beyond {of.valid_min:.4g} … {of.valid_max:.4g} {of.unit}, where the model has seen "
        f"it{' rise' if of.is_rise else ''}, in {of.share_of_samples:.1%} of the samples. {did}.",
        Where(channel=of.input, run=run),
        {
            "valid_min": of.valid_min,
            "valid_max": of.valid_max,
            "unit": of.unit,
            "share_of_samples": of.share_of_samples,
        },
        "add a run like this one to the recordings that the model is built from",
    )
