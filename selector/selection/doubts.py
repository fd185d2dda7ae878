"""What a careful engineer would doubt about a selection, said as findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.models.design import Datum
from selector.models.hull import validity_hull
from selector.models.rows import Rows
from selector.selection.choice import Offer
from selector.selection.regimes import regime_findings
from selector.selection.result import Selection
from selector.selection.survey import Survey
from selector.selection.unseen_words import BEST_OF_SIZE
from selector.sensors.groups import chaining_findings
from selector.sensors.similarity import similarity_findings

COLLINEAR_VIF = 10.0
ILL_CONDITIONED = 30.0
OUTSIDE = 1.0
REVERSED = -0.9
CORRELATED = 1.5


def doubts(
    selection: Selection,
    surveyed: Survey,
    datum: Datum,
    rows: Rows,
    ridge: tuple[float, float, float],
    offer_errors: Mapping[Offer, float],
    offer: Offer,
    stride: int,
) -> tuple[Finding, ...]:
    """Findings about the data that were used, the groups, the proof and the model."""
    grouping = selection.grouping
    screening = grouping.chosen
    return (
        *_datum_findings(selection, datum, surveyed),
        *similarity_findings(grouping.similarity, selection.sensors),
        *_chaining(selection),
        *(finding for one in screening.rounds for finding in one.findings),
        *_proof_findings(selection, surveyed, stride),
        *_limit_findings(selection),
        *regime_findings(selection),
        *_offer_findings(offer_errors, offer),
        *_model_findings(selection, ridge),
        *_range_findings(selection, rows),
        *_stability_findings(selection),
    )


def _chaining(selection: Selection) -> list[Finding]:
    found = chaining_findings(selection.grouping.similarity.matrix, selection.grouping.chosen.rounds[0].partition)
    if selection.options.level is not None:
        return list(found)
    # λ was chosen by the error on unseen data, so a chain is no reason to choose it again
    advice = "the choice does not rest on the groups alone: sets of all sensors were compared as well"
    return [replace(finding, level="info", suggestion=advice) for finding in found]


def _datum_findings(selection: Selection, datum: Datum, surveyed: Survey) -> list[Finding]:
    if datum.reference == "absolute":
        return []
    starts = {
        f"{name} in {run}": datum.level(run, name)
        for name in selection.models
        for run in surveyed.runs
        if datum.level(run, name)
    }
    if not starts:
        return []
    largest = sorted(starts, key=lambda key: -abs(starts[key]))
    listed = ", ".join(f"{key}: {starts[key]:.3g} µm" for key in largest[:4])
    more = f" and {len(largest) - 4} smaller ones" if len(largest) > 4 else ""
    return [
        Finding(
            "gauge-not-zeroed",
            "info",
            f"Some displacements do not start at zero ({listed}{more}); they count from the start of the run.",
            Where(),
            {"start_um": starts},
            "use --reference absolute if these starts are real displacements and not the zero of the gauge",
        )
    ]


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
                f"There are {len(surveyed.runs)} runs; an error over so few runs is itself uncertain.",
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
                    "look at this run: its displacement looks reversed, as by a gauge with the other sign"
                    if _reversed(selection, name, worst.name)
                    else "look at this run: another setup, a moved gauge, coolant, an open door?",
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


def _limit_findings(selection: Selection) -> list[Finding]:
    """Whether more sensors than allowed might do better: the choice is as large as it may be, and the curve falls."""
    most, there_are = selection.options.max_sensors, len(selection.sensors)
    chosen = set(selection.chosen)
    if len(chosen) != most or there_are <= most or chosen <= set(selection.options.must):
        return []
    falls = []
    for j, name in enumerate(selection.models):
        of_size = {point.n_sensors: point.rmse_um[j] for point in selection.proof.curve}
        if most in of_size and most - 1 in of_size and of_size[most] < of_size[most - 1]:
            falls.append(f"{name} from {of_size[most - 1]:.3g} to {of_size[most]:.3g} µm")
    if most > 1 and not falls:
        return []
    step = f" and from {most - 1} to {most} the error of the {BEST_OF_SIZE} still falls ({', '.join(falls)})"
    return [
        Finding(
            "choice-at-limit",
            "info",
            f"{most} sensor{'s were' if most > 1 else ' was'} chosen, the most that --max-sensors allows"
            f"{step if falls else ''}: more might predict better.",
            Where(),
            {"max_sensors": most, "sensors": there_are},
            f"see whether more are worth their cost: --max-sensors {min(most + 3, there_are)}",
        )
    ]


def _reversed(selection: Selection, name: str, run: str) -> bool:
    """Whether a run moves against its prediction all the way."""
    j = list(selection.models).index(name)
    for trace in selection.proof.traces:
        measured, predicted = trace.measured_um[:, j], trace.predicted_um[:, j]
        if trace.run == run and len(measured) > 2 and np.ptp(measured) > 0 and np.ptp(predicted) > 0:
            return bool(np.corrcoef(measured, predicted)[0, 1] < REVERSED)
    return False


def _offer_findings(errors: Mapping[Offer, float], taken: Offer) -> list[Finding]:
    """What the richer terms that the user offered are worth on unseen data."""
    if len(errors) == 1:
        return []
    words = {"linear": "linear terms only", "polynomial": "powers and products", "memory": "lagged terms"}
    listed = ", ".join(f"{words[offer]} {error:.1%}" for offer, error in errors.items())
    richest = list(errors)[-1]
    helped = taken == richest
    return [
        Finding(
            "terms-that-help" if helped else "terms-not-used",
            "info",
            f"Error on unseen data, in the spread of the displacement: {listed}. "
            + (f"The model uses {words[taken]}." if helped else f"The model keeps to {words[taken]}."),
            Where(),
            {"relative_error": dict(errors), "taken": taken},
            "" if helped else "more runs, longer and with heating and cooling, would let richer terms prove themselves",
        )
    ]


def _three_digits(value: float) -> str:
    return f"{value:.0f}" if 100 <= value < 1e7 else f"{value:.3g}"


def _model_findings(selection: Selection, ridge: tuple[float, float, float]) -> list[Finding]:
    found = []
    # every response has the same terms, so their collinearity is one statement
    model = next(iter(selection.models.values()))
    single = [(t, v) for t, v in zip(model.terms, model.vif, strict=True) if t.degree == 1]
    worst, vif = max(single, key=lambda item: item[1])
    condition = model.diagnostics.condition_number
    if vif > COLLINEAR_VIF or condition > ILL_CONDITIONED:
        found.append(
            Finding(
                "collinear-terms",
                "warning",
                f"The terms of the model move together (VIF of {worst} {_three_digits(vif)}, condition number "
                f"{_three_digits(condition)}): single coefficients are uncertain, and a sensor fault or another season "
                "is amplified.",
                Where(),
                {"vif": float(vif), "term": str(worst), "condition_number": condition},
                "the unseen error was found with sets like this one and stands for data like these; do not read single "
                "coefficients"
                + ("" if selection.options.ridge else ", and see with --ridge what shrinking them costs")
                + ("" if len(selection.chosen) < 2 else "; a smaller --max-sensors gives terms that are less alike"),
            )
        )
    watson = {name: one.diagnostics.durbin_watson for name, one in selection.models.items()}
    low = {name: value for name, value in watson.items() if value < CORRELATED}
    if low:
        listed = ", ".join(f"{name} {value:.2f}" for name, value in low.items())
        found.append(
            Finding(
                "correlated-residuals",
                "info",
                f"Residuals follow each other (Durbin–Watson: {listed}): the machine remembers something that the "
                "model does not. Standard errors allow for it.",
                Where(),
                {
                    "durbin_watson": watson,
                    "ljung_box_p": {n: m.diagnostics.ljung_box_p for n, m in selection.models.items()},
                },
                "" if selection.options.memory else "try --memory: lagged temperatures follow slow parts",
            )
        )
    for name, one in selection.models.items():
        cooks = one.diagnostics.max_cooks_distance
        if cooks > 1.0:
            found.append(
                Finding(
                    "influential-sample",
                    "warning",
                    f"One sample bends the model of {name} by itself (Cook's distance {cooks:.3g}).",
                    Where(channel=name),
                    {"cooks_distance": cooks, "row": one.diagnostics.most_influential},
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
    beyond: dict[str, float] = {}
    words: list[str] = []
    for r, run in enumerate(rows.runs):
        mine, others = rows.run == r, rows.run != r
        if not mine.any() or not others.any():
            continue
        hull = validity_hull(rows.variables[others])
        distance = float(hull.distance(_thinned(rows.variables[mine], 40)).max())
        if distance <= OUTSIDE:
            continue
        outside = _box_excess(rows.variables[mine], hull.low, hull.high)
        j = int(np.argmax(outside / hull.scale))
        name, unit = _variable_and_unit(selection, j)
        beyond[run] = distance
        far = f", {name} by up to {outside[j]:.3g} {unit}" if outside[j] > 0.1 * hull.scale[j] else ""
        words.append(f"{run} by {distance:.2g}{far}")
    if not beyond:
        return []
    return [
        Finding(
            "runs-outside-the-others",
            "info",
            f"Beyond what the other runs cover, in standard deviations of the inputs: {'; '.join(words)}. The unseen "
            "error of these runs is that of an extrapolation.",
            Where(),
            {"distance": beyond},
            "more runs of this kind would prove the model there",
        )
    ]


def _variable_and_unit(selection: Selection, j: int) -> tuple[str, str]:
    """A variable of the model as a person calls it, and the unit of its differences."""
    design = selection.recipe.design
    name = design.variables[j]
    lag = next((lag for lag in design.lags if lag.name == name), None)
    source = lag.source if lag else name
    return f"{source} lagged {lag.tau_s:.0f} s" if lag else name, "K" if source in selection.chosen else "rpm"


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
