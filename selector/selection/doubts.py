"""What a careful engineer would doubt about a selection, said as findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.models.design import Datum
from selector.models.hull import validity_hull
from selector.models.rows import Rows
from selector.selection.regimes import regime_findings
from selector.selection.result import Selection
from selector.selection.survey import Survey
from selector.sensors.groups import chaining_findings
from selector.sensors.similarity import similarity_findings

COLLINEAR_VIF = 10.0
ILL_CONDITIONED = 30.0


def doubts(
    selection: Selection,
    surveyed: Survey,
    datum: Datum,
    rows: Rows,
    ridge: tuple[float, float, float],
    memory_errors: tuple[float, float] | None,
    stride: int,
) -> tuple[Finding, ...]:
    """Findings about the data that were used, the groups, the proof and the model."""
    grouping = selection.grouping
    screening = grouping.chosen
    return (
        *_datum_findings(selection, datum, surveyed),
        *similarity_findings(grouping.similarity, selection.sensors),
        *chaining_findings(grouping.similarity.matrix, screening.rounds[0].partition),
        *(finding for one in screening.rounds for finding in one.findings),
        *_proof_findings(selection, surveyed, stride),
        *regime_findings(selection),
        *_memory_findings(memory_errors),
        *_model_findings(selection, ridge),
        *_range_findings(selection, rows),
        *_stability_findings(selection),
    )


def _datum_findings(selection: Selection, datum: Datum, surveyed: Survey) -> list[Finding]:
    if datum.reference == "absolute":
        return []
    findings = []
    for name in selection.models:
        starts = {run: datum.level(run, name) for run in surveyed.runs if datum.level(run, name)}
        if starts:
            listed = ", ".join(f"{run} at {level:.4g} µm" for run, level in list(starts.items())[:6])
            more = f" and {len(starts) - 6} more runs" if len(starts) > 6 else ""
            findings.append(
                Finding(
                    "gauge-not-zeroed",
                    "info",
                    f"{name} does not start at zero ({listed}{more}); displacements count from the start of the run.",
                    Where(channel=name),
                    {"start_um": starts},
                    "use --reference absolute if these starts are real displacements and not the zero of the gauge",
                )
            )
    return findings


def _proof_findings(selection: Selection, surveyed: Survey, stride: int) -> list[Finding]:
    proof = selection.proof
    found = []
    if proof.left_out == "block":
        found.append(
            Finding(
                "one-run-only",
                "warning",
                "There is one run. The error is that of stretches of this run left out in turn; a day that is not in "
                "the data is not proved.",
                Where(run=surveyed.runs[0]),
                {"runs": 1, "parts": len(next(iter(proof.per_response.values())))},
                "record at least three runs on different days and duty cycles",
            )
        )
    elif len(surveyed.runs) < 4:
        found.append(
            Finding(
                "few-runs",
                "warning",
                f"There are {len(surveyed.runs)} runs; an error over so few days is itself uncertain.",
                Where(),
                {"runs": len(surveyed.runs)},
                "record more runs, with other speeds and another season",
            )
        )
    for name in selection.models:
        baseline = proof.baselines_um[name]
        error = proof.rmse_um(name)
        rival, best = min(((way, baseline[way]) for way in ("none", "mean")), key=lambda item: item[1])
        if error >= best:
            words = {"none": "leaving the machine as it is", "mean": "a constant"}[rival]
            found.append(
                Finding(
                    "no-better-than-nothing",
                    "error",
                    f"On unseen data the model of {name} errs by {error:.3g} µm, {words} by {best:.3g} µm: "
                    "do not use it.",
                    Where(channel=name),
                    {"heldout_rmse_um": error, rival: best},
                    "look for a condition that the recording does not hold (see the regimes, if any were found), "
                    "record it, or try --memory",
                )
            )
        worst = max(proof.per_response[name], key=lambda part: part.rmse_um)
        others = [part.rmse_um for part in proof.per_response[name] if part is not worst]
        if others and worst.rmse_um > 3.0 * float(np.median(others)) and worst.rmse_um > 1.0:
            found.append(
                Finding(
                    "one-part-unlike-the-others",
                    "warning",
                    f"{name} of {worst.name} is predicted to {worst.rmse_um:.3g} µm, the others typically to "
                    f"{float(np.median(others)):.3g} µm.",
                    Where(channel=name, run=worst.name),
                    {"rmse_um": worst.rmse_um, "median_of_others_um": float(np.median(others))},
                    "look at this run: another setup, a moved gauge, coolant, an open door?",
                )
            )
    if stride > 1:
        found.append(
            Finding(
                "samples-thinned",
                "info",
                f"Sensors were chosen on all {surveyed.n_samples} samples; the final coefficients and errors come from "
                f"every {stride}th sample.",
                Where(),
                {"samples": surveyed.n_samples, "stride": stride},
            )
        )
    return found


def _memory_findings(errors: tuple[float, float] | None) -> list[Finding]:
    if errors is None:
        return []
    with_memory, static = errors
    evidence = {"relative_error_with_memory": with_memory, "relative_error_static": static}
    if with_memory >= static:
        return [
            Finding(
                "memory-not-used",
                "info",
                f"Lagged terms do not help on unseen data (error {with_memory:.1%} of the spread of the displacement "
                f"with them, {static:.1%} without); the model has none.",
                Where(),
                evidence,
                "longer runs with heating and cooling show slow parts better",
            )
        ]
    return [
        Finding(
            "memory-helps",
            "info",
            f"Lagged terms reduce the error on unseen data from {static:.1%} to {with_memory:.1%} of the spread of the "
            "displacement.",
            Where(),
            evidence,
        )
    ]


def _model_findings(selection: Selection, ridge: tuple[float, float, float]) -> list[Finding]:
    found = []
    for name, model in selection.models.items():
        diagnostics = model.diagnostics
        single = [(t, v) for t, v in zip(model.terms, model.vif, strict=True) if t.degree == 1]
        worst, vif = max(single, key=lambda item: item[1])
        if vif > COLLINEAR_VIF or diagnostics.condition_number > ILL_CONDITIONED:
            found.append(
                Finding(
                    "collinear-terms",
                    "warning",
                    f"The terms of {name} move together (VIF of {worst} {vif:.3g}, condition number "
                    f"{diagnostics.condition_number:.3g}): single coefficients are uncertain, and a sensor fault or "
                    "another season is amplified.",
                    Where(channel=name),
                    {"vif": float(vif), "term": str(worst), "condition_number": diagnostics.condition_number},
                    "use fewer sensors, or --ridge, which shrinks the coefficients and shows what that costs",
                )
            )
        if diagnostics.durbin_watson < 1.0:
            found.append(
                Finding(
                    "correlated-residuals",
                    "info",
                    f"Residuals of {name} follow each other (Durbin–Watson {diagnostics.durbin_watson:.2f}): the "
                    "machine remembers something that the model does not. Standard errors allow for it.",
                    Where(channel=name),
                    {"durbin_watson": diagnostics.durbin_watson, "ljung_box_p": diagnostics.ljung_box_p},
                    "" if selection.recipe.shape.has_memory else "try --memory: lagged temperatures follow slow parts",
                )
            )
        if diagnostics.max_cooks_distance > 1.0:
            found.append(
                Finding(
                    "influential-sample",
                    "warning",
                    f"One sample bends the model of {name} by itself (Cook's distance "
                    f"{diagnostics.max_cooks_distance:.3g}).",
                    Where(channel=name),
                    {"cooks_distance": diagnostics.max_cooks_distance, "row": diagnostics.most_influential},
                    "look for a spike in the recordings",
                )
            )
    if selection.options.ridge:
        penalty, with_it, without = ridge
        in_sample = ", ".join(f"{name} {model.rmse_um:.3g} µm" for name, model in selection.models.items())
        found.append(
            Finding(
                "ridge",
                "info",
                f"The ridge penalty {penalty:.3g} predicts unseen data best: {with_it:.4g} µm against {without:.4g} µm "
                f"without; in sample {in_sample}.",
                Where(),
                {"penalty": penalty, "heldout_rmse_um": with_it, "heldout_rmse_um_without": without},
            )
        )
    return found


def _range_findings(selection: Selection, rows: Rows) -> list[Finding]:
    """Runs whose inputs lie outside the hull of all the others: there the proof is an extrapolation."""
    found = []
    number = np.arange(len(rows.runs))
    if len(number) < 2:
        return []
    for r, run in enumerate(rows.runs):
        mine, others = rows.run == r, rows.run != r
        if not mine.any() or not others.any():
            continue
        hull = validity_hull(rows.variables[others])
        outside = _box_excess(rows.variables[mine], hull.low, hull.high)
        j = int(np.argmax(outside / hull.scale))
        distance = float(hull.distance(_thinned(rows.variables[mine], 40)).max())
        if distance > 1.0:
            name = selection.recipe.design.variables[j]
            beyond = f", {name} by up to {outside[j]:.3g}" if outside[j] > 0 else ""
            found.append(
                Finding(
                    "run-outside-the-others",
                    "info",
                    f"Run {run} goes {distance:.2g} standard deviations beyond what the other runs cover{beyond}; its "
                    "error is that of an extrapolation.",
                    Where(run=run, channel=name if outside[j] > 0 else None),
                    {"distance": distance, "excess": float(outside[j])},
                    "more runs of this kind would prove the model there",
                )
            )
    return found


def _stability_findings(selection: Selection) -> list[Finding]:
    return [
        Finding(
            "unstable-choice",
            "warning",
            f"{name} (or a sensor of its group) is chosen in {100 * share:.0f} % of resamples of the runs only.",
            Where(channel=name),
            {"share": share},
            "the runs do not agree on this sensor: record more, or compare the sets beside the chosen one",
        )
        for name, share in selection.stability.items()
        if share < 0.6
    ]


def _box_excess(
    values: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.maximum(np.maximum(low - values.min(axis=0), values.max(axis=0) - high), 0.0)


def _thinned(values: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    keep: Sequence[int] = np.unique(np.linspace(0, len(values) - 1, min(n, len(values))).astype(int)).tolist()
    return values[keep]
