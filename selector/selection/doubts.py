"""What a careful engineer would doubt about a selection, said as findings."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import stdtrit

from selector.findings import Finding, Where
from selector.json_text import fields_of
from selector.models.design import Datum, Rows
from selector.models.least_squares import outermost_samples, validity_hull
from selector.models.moments import more_than_its_error
from selector.models.run_before import another_before, chain_before
from selector.number_text import number_text
from selector.selection.choice import Offer
from selector.selection.finding_table import FEW_RUNS, FINDINGS
from selector.selection.fitting import evenly
from selector.selection.proving import MOST_FOLDS, fold_of_run
from selector.selection.result import BEST_OF_SIZE, PROCEDURE, Known, Selection
from selector.selection.survey import Survey
from selector.sensors.finding_table import ROUND_WITHOUT_EFFECT
from selector.sensors.groups import between_finding, chaining_findings
from selector.sensors.similarity import similarity_findings
from selector.types import Array, Indices

ENOUGH_SAMPLES = 20  #: Of a run; with fewer, how well its error is known depends on how many there are.
PROMISED_FACTOR = 1.5  #: An error that is known better than to this factor is told without a warning.
#: Standard deviation of the logarithm of errors from run to run before any was seen, and with runs that begin warm from
#: other work or with memory, which rests on starts; and how many degrees of freedom that counts for.
SPREAD, SPREAD_OF_STARTS, PRIOR_FREEDOM = 0.25, 0.35, 3
#: How much further off their mean is than that of independent runs: the models by which left-out runs are predicted
#: share their runs (√2 at least: Nadeau and Bengio 2003). Measured, as the three above, on simulated machines and on
#: days of a real one (`benchmarks/bench_honesty.py`, `benchmarks/bench_days.py --honesty`).
SHARED_RUNS = 2.2
LEAST_OF_A_RUN = 0.3  #: Of the error of all: what a run has at least, as a smaller one does not move the mean.
#: What a run that begins where another ended repeats of it: six runs in a row tell as much as three and a half.
SHARE_OF_THE_RUN_BEFORE = 0.5
LONGEST_PAUSE = 1.0  #: Before a run that begins where another ended, in lengths of that one.
#: Share of the rises by which starts differ, sensor against sensor, when a machine begins warm; less is their noise.
STARTS_APART, START_NOISE_K = 0.1, 0.15
MIN_RUNS = 6
MIN_LENGTH = 2
MAX_REGIMES = 5
MOST_MEANS = 120
FALSE_ALARM = 0.01
N_PERMUTATIONS = 999
#: Parameters that a split counts as: its level, its place, and one for the search of the place (as in the modified BIC
#: of Zhang and Siegmund, 2007). With 2, four in ten clear regimes were cut once more; with 3 it is one in eight, and a
#: single change of two deviations among 18 runs is found in 70 instead of 53 %.
PENALTY = 3.0


def regime_findings(selection: Selection) -> Iterator[Finding]:
    """Stretches of consecutive runs whose unseen errors share a sign and a size that neighbours do not have.

    What is gained is compared with that of shuffled runs, so that scatter from day to day is no regime.
    """
    proof = selection.proof
    for name in selection.models if proof.left_out == "run" else ():
        parts = proof.per_response[name]
        means = np.array([part.mean_um for part in parts])
        # the search goes with the square of the runs, and is done a thousand times: of very many, neighbours together
        together = -(-len(means) // MOST_MEANS)
        means = np.array([means[i : i + together].mean() for i in range(0, len(means), together)])
        bounds, p_value, explained = regimes(means, selection.options.seed)
        if len(bounds) < 2 or float(means.std()) < 0.5 * proof.rmse_um(name):
            continue
        bounds = [(a * together, min(b * together, len(parts))) for a, b in bounds]
        means = np.array([part.mean_um for part in parts])
        names = [part.name for part in parts]
        listed = "; ".join(f"{names[a]} to {names[b - 1]}: {means[a:b].mean():+.1f} µm" for a, b in bounds)
        yield FINDINGS.finding(
            "regimes",
            f"The unseen error of {name} falls into {len(bounds)} regimes of consecutive runs ({listed}): {name} "
            "depends on something that changed between them and is not in the recording.",
            Where(channel=name),
            {
                "regimes": [{"runs": names[a:b], "mean_error_um": float(means[a:b].mean())} for a, b in bounds],
                "p_value": p_value,
                "explained": explained,
            },
        )


def regimes(means: Array, seed: int) -> tuple[list[tuple[int, int]], float, float]:
    """Consecutive (start, stop) stretches of alike values, p-value of one split or more, share of variance explained.

    The best segmentation into k = 2…5 stretches is found exactly (dynamic programming), k by BIC with `PENALTY`
    parameters a split; its BIC gain is compared with that of shuffled values, which repeats the whole search. Every
    stretch holds at least two values, so a single odd run is no regime.
    """
    n = len(means)
    whole = [(0, n)]
    if n < MIN_RUNS or np.ptp(means) == 0:
        return whole, 1.0, 0.0
    rng = np.random.default_rng(seed)
    # ranks would lose sizes and raw values let one odd run decide: pull outliers in to three robust deviations
    centre = np.median(means)
    deviation = max(1.4826 * float(np.median(np.abs(means - centre))), 1e-9 * float(np.ptp(means)))
    values = np.clip(means, centre - 3 * deviation, centre + 3 * deviation)
    total = float(((values - values.mean()) ** 2).sum())
    gain, bounds, within = _best_segmentation(values, total)
    shuffled = np.array([_best_segmentation(rng.permutation(values), total)[0] for _ in range(N_PERMUTATIONS)])
    p_value = float((1 + np.sum(shuffled >= gain - 1e-12)) / (N_PERMUTATIONS + 1))
    if gain <= 0 or p_value > FALSE_ALARM:
        return whole, p_value, 0.0
    return bounds, p_value, 1.0 - within / total


def _best_segmentation(values: Array, total: float) -> tuple[float, list[tuple[int, int]], float]:
    """(BIC gain over one stretch, stretches, squared error within them) of the best segmentation."""
    n = len(values)
    sums = np.r_[0.0, np.cumsum(values)]
    squares = np.r_[0.0, np.cumsum(values**2)]
    start, stop = np.arange(n + 1)[:, None], np.arange(n + 1)[None, :]
    length = np.maximum(stop - start, 1)
    cost = squares[None, :] - squares[:, None] - (sums[None, :] - sums[:, None]) ** 2 / length
    cost = np.where(stop - start >= MIN_LENGTH, cost, np.inf)
    error = cost[0]
    origins: list[Indices] = []
    best = (0.0, [(0, n)], total)
    for k in range(2, min(MAX_REGIMES, n // MIN_LENGTH) + 1):
        candidates = error[:, None] + cost
        origins.append(candidates.argmin(axis=0))
        error = candidates.min(axis=0)
        within = max(float(error[n]), 1e-12 * total)
        gain = n * np.log(total / within) - PENALTY * (k - 1) * np.log(n)
        if gain > best[0]:
            edges = [n]
            for origin in reversed(origins):
                edges.append(int(origin[edges[-1]]))
            edges = [0, *sorted(edges[:-1]), n] if edges[-1] == 0 else [0, *sorted(edges)]
            best = (float(gain), list(itertools.pairwise(edges)), within)
    return best


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
    # a level that was found and not given needs no advice about it
    asked = selection.options.level is not None or selection.options.rounds > 1
    return (
        *_datum_findings(selection, datum, surveyed),
        *similarity_findings(grouping.similarity, selection.sensors),
        *_chaining(selection),
        *(told for one in screening.rounds for told in one.findings if asked or told.id != ROUND_WITHOUT_EFFECT),
        *_memory_findings(selection, datum, surveyed.runs),
        *_proof_findings(selection, surveyed, stride),
        *_limit_findings(selection, surveyed.question.noise_um),
        *_target_findings(selection),
        *regime_findings(selection),
        *_offer_findings(offer_errors, offer),
        *_model_findings(selection, ridge),
        *_range_findings(selection, rows),
        *(
            FINDINGS.finding(
                "unstable-choice",
                f"{name} (or a sensor of its group) is chosen in {100 * share:.0f} % of resamples of the runs only.",
                Where(channel=name),
                {"share": share},
            )
            for name, share in selection.stability.items()
            if share < 0.6
        ),
    )


def _chaining(selection: Selection) -> list[Finding]:
    fuzzy = selection.grouping.chosen.fuzzy
    if fuzzy is not None:
        return list(between_finding(fuzzy))
    found = chaining_findings(selection.grouping.similarity.matrix, selection.grouping.chosen.rounds[0].partition)
    if selection.options.level is not None:
        return list(found)
    # λ was chosen by the error on unseen data, so a chain is no reason to choose it again
    advice = "the choice does not rest on the groups alone: sets of all sensors were compared as well"
    return [replace(finding, level="info", suggestion=advice) for finding in found]


def _datum_findings(selection: Selection, datum: Datum, surveyed: Survey) -> Iterator[Finding]:
    if datum.reference == "absolute":
        return
    starts = {
        f"{name} in {run}": datum.level(run, name)
        for name in selection.models
        for run in surveyed.runs
        if datum.level(run, name)
    }
    if starts:
        largest = sorted(starts, key=lambda key: -abs(starts[key]))
        listed = ", ".join(f"{key}: {starts[key]:.3g} µm" for key in largest[:4])
        more = f" and {len(largest) - 4} smaller ones" if len(largest) > 4 else ""
        yield FINDINGS.finding(
            "gauge-not-zeroed",
            f"Some displacements do not start at zero ({listed}{more}); they count from the start of the run.",
            evidence={"start_um": starts},
        )


def _memory_findings(selection: Selection, datum: Datum, runs: Sequence[str]) -> Iterator[Finding]:
    design = selection.recipe.design
    tau_s = np.array([lag.tau_s for lag in design.lags])
    chains = {run: [one for one in chain_before(datum.follows, run, tau_s) if one[1] > 0.0] for run in runs}
    warm = {run: list(chain[-1]) for run, chain in chains.items() if chain}
    if warm:
        yield FINDINGS.finding(
            "memory-goes-on",
            f"By their clocks {len(warm)} of the runs follow another one: their memory goes on from it, as on a "
            "control that stays on. After a start without memory the error is larger.",
            evidence={"follows": warm},
        )


def _proof_findings(selection: Selection, surveyed: Survey, stride: int) -> Iterator[Finding]:
    proof = selection.proof
    if proof.not_covered:
        yield FINDINGS.finding(
            "runs-not-proved",
            f"The proof covers {len(surveyed.runs) - len(proof.not_covered)} of {len(surveyed.runs)} runs: "
            + "; ".join(f"{run} lacks {', '.join(names)}" for run, names in proof.not_covered.items())
            + ".",
            evidence={"lacking": dict(proof.not_covered)},
        )
    if surveyed.is_one_record or proof.left_out == "block":
        parts = len(next(iter(proof.per_response.values())))
        what = f"{parts} parts of it, each from where the spindle turns again after a rest,"
        yield FINDINGS.finding(
            "one-run-only",
            f"There is one run. The error is that of {what if surveyed.is_one_record else 'stretches of it'} left out "
            "in turn; a day that is not in the data is not proved.",
            Where(run=surveyed.runs[0]),
            {"runs": 1, "parts": parts},
        )
    yield from _few_runs(selection)
    n_folds = len(set((fold_of_run(surveyed.runs, selection.options.conditions) or {}).values()))
    if n_folds:
        yield FINDINGS.finding(
            "runs-left-out-in-groups",
            f"The {len(surveyed.runs)} runs were left out in {n_folds} groups of whole runs, not one by one.",
            evidence={"runs": len(surveyed.runs), "groups": n_folds},
        )
    for name in selection.models:
        baseline = proof.baselines_um[name]
        error = proof.rmse_um(name)
        rival, best = min(((way, baseline[way]) for way in ("none", "mean")), key=lambda item: item[1])
        proved = proof.per_response[name]
        before, left, n = np.array([(part.before_rmse_um, part.rmse_um, part.n_samples) for part in proved]).T
        is_clear = (left < before).all() or more_than_its_error(before**2 - left**2, n)
        if error >= best or not is_clear:
            words = {"none": "leaving the machine as it is", "mean": "a constant"}[rival]
            luck = "" if error >= best else ", and the gain is no larger than its scatter from part to part"
            yield FINDINGS.finding(
                "no-better-than-nothing",
                f"On unseen data the model of {name} errs by {error:.3g} µm, {words} by {best:.3g} µm{luck}: do not "
                "use it.",
                Where(channel=name),
                {"heldout_rmse_um": error, rival: best},
            )
        worst = max(proved, key=lambda part: part.rmse_um)
        others = [part.rmse_um for part in proved if part is not worst]
        usual = float(np.median(others)) if others else float("nan")
        if worst.rmse_um > 3.0 * usual and worst.rmse_um > 1.0:
            yield FINDINGS.finding(
                "one-part-unlike-the-others",
                f"{name} of {worst.name} is predicted to {worst.rmse_um:.3g} µm, the others typically to "
                f"{usual:.3g} µm.",
                Where(channel=name, run=worst.name),
                {"rmse_um": worst.rmse_um, "median_of_others_um": usual},
                "look at this run: its displacement looks reversed, as by a gauge with the other sign"
                if _reversed(selection, name, worst.name)
                else None,
            )
    if stride > 1:
        yield FINDINGS.finding(
            "samples-thinned",
            f"Sensors were chosen on all {surveyed.n_samples} samples; the final coefficients and errors come from "
            f"every {stride}th sample.",
            evidence={"samples": surveyed.n_samples, "stride": stride},
        )


def known(selection: Selection, surveyed: Survey, datum: Datum, rows: Rows) -> Known | None:
    """How well the error on unseen runs is known: by how many were left out, how they begin, how much errors differ.

    `datum` has the first readings of the sensors, whatever the model counts from, and what begins where another ended.
    """
    proof, n_sensors = selection.proof, len(selection.chosen)
    n = len(next(iter(proof.per_response.values())))
    if proof.left_out == "block" or n < 2:
        return None
    starts = np.array([[datum.level(run, name) for name in selection.sensors] for run in surveyed.runs])
    starts = starts[:, np.isfinite(starts).all(axis=0)]
    apart = starts - starts.mean(axis=1, keepdims=True) if starts.size else np.zeros((1, 1))
    apart_k = float((apart - apart.mean(axis=0)).std())
    rises_k = float(np.sqrt(rows.variables[:, :n_sensors].var(axis=0).mean()))
    warm = apart_k > max(STARTS_APART * rises_k, START_NOISE_K)
    kinds = selection.options.conditions if proof.left_out == "condition" else {}
    before = {run: another_before(datum.follows, run) or run for run in surveyed.runs}
    in_a_row = sum(kinds.get(one, one) != kinds.get(run, run) for run, one in before.items())
    # a start that is a little warm does not show in the sensors, and memory rests on it
    spread = SPREAD_OF_STARTS if warm or selection.recipe.design.lags else SPREAD
    # so many samples tell their own error to 1 / √(2 n) of it
    fewest = min(part.n_samples for parts in proof.per_response.values() for part in parts)
    spread = float(np.sqrt(spread**2 + max(0.5 / max(fewest, 1) - 0.5 / ENOUGH_SAMPLES, 0.0)))
    # two runs are predicted by each other alone, and tell no more than two in a row
    of_runs = n - (min(in_a_row, n - 1) if n > 2 else 1) * SHARE_OF_THE_RUN_BEFORE
    factors = {
        name: _factor([part.rmse_um for part in parts], of_runs, spread) for name, parts in proof.per_response.items()
    }
    return Known(max(factors.values()), n, in_a_row, apart_k, warm, factors)


def _factor(errors_um: Sequence[float], runs: float, spread: float) -> float:
    """Within what factor the error of further runs is that of these ones, which tell as much as `runs`, 19 times in 20.

    Student's interval of the mean logarithm of their errors; its variance is that of these runs and, as there are few,
    one that is usual (`spread`), weighted by degrees of freedom.
    """
    least = LEAST_OF_A_RUN * np.sqrt(np.mean(np.square(errors_um)))
    logs, own = np.log(np.maximum(errors_um, least + np.finfo(np.float64).tiny)), len(errors_um) - 1
    freedom = PRIOR_FREEDOM + own
    variance = (PRIOR_FREEDOM * spread**2 + own * logs.var(ddof=1)) / freedom
    return float(np.exp(stdtrit(freedom, 0.975) * SHARED_RUNS * np.sqrt(variance / runs)))


def _few_runs(selection: Selection) -> Iterator[Finding]:
    """Within what factor the error on unseen runs is known, where that is more than `PROMISED_FACTOR`."""
    one, proof = selection.known, selection.proof
    if one is None or (one.factor <= PROMISED_FACTOR and 2 * one.in_a_row < one.runs):
        return
    spans = {name: one.span_um(name, proof.rmse_um(name)) for name in selection.models}
    told = {name: one.factor_of(name) for name, span in spans.items() if span is not None}
    ends = {name: " to ".join(number_text(end, 2) for end in span) for name, span in spans.items() if span}
    errors = ", ".join(f"{name} by {span} µm" for name, span in ends.items())
    begin = f" that do not begin alike (sensors {one.starts_apart_k:.2g} K apart from run to run)" * one.is_warm
    asides = [f"{one.in_a_row} of which begin where another ended"] if one.in_a_row else []
    asides += ["which is little for memory"] if selection.recipe.design.lags else []
    begin += "".join(f", {aside}" for aside in asides) + "," * bool(asides)
    kind = "conditions" if proof.left_out == "condition" else "runs"
    says = []
    if told:
        known_to = f"is known to a factor of {max(told.values()):.2g}"
        says = [f"{known_to}: on further runs within what these cover the model may err {errors}"]
    if untold := " and ".join(name for name in spans if name not in told):
        says.append(f"of {untold} " * bool(told) + f"cannot be told from so few {kind}")
    is_stretch = 2 * one.in_a_row >= one.runs
    later = " That holds for about as long after them as they took; of another season they tell little." * is_stretch
    yield FINDINGS.finding(
        FEW_RUNS,
        f"The error on unseen runs rests on {one.runs} {kind}{begin} and {'; that '.join(says)}." + later,
        evidence={**fields_of(one, "runs", "factor", "in_a_row", "starts_apart_k"), "between_um": spans},
        suggestion="record more runs"
        + ", some of them weeks later" * is_stretch
        + (", and let the machine cool down before each, or begin each where the last one ended" * one.is_warm),
    )


def _target_findings(selection: Selection) -> Iterator[Finding]:
    target = selection.options.target
    if target is None:
        return
    asked, proof = f"At most {target:g} µm were asked for", selection.proof
    idle = {name: proof.baselines_um[name]["none"] for name in selection.models}
    if max(idle.values()) <= target:
        said = ", ".join(f"{name} has {error:.3g} µm" for name, error in idle.items())
        evidence = {"target_um": target, "before_rmse_um": idle}
        told = f"{asked}; without compensation {said}: no sensor is needed for that."
        yield FINDINGS.finding("target-met-already", told, evidence=evidence)
    missed = {name: error for name in selection.models if (error := proof.rmse_um(name)) > target}
    if missed:
        said = ", ".join(f"{name} {error:.3g} µm" for name, error in missed.items())
        evidence = {"target_um": target, "heldout_rmse_um": missed}
        told = f"{asked}; on unseen data the {PROCEDURE} has {said}."
        yield FINDINGS.finding("target-missed", told, evidence=evidence)


def _limit_findings(selection: Selection, noise_um: Sequence[float]) -> Iterator[Finding]:
    """Whether more sensors than allowed might do better: the choice is as large as it may be, and the curve falls.

    By more than the noise of the gauge, that is, or by more than was asked for.
    """
    most, there_are = selection.options.max_sensors, len(selection.sensors)
    chosen = set(selection.chosen)
    if len(chosen) != most or there_are <= most or chosen <= set(selection.options.must):
        return
    if selection.options.formula is not None or selection.options.target is not None:
        return
    falls = []
    for j, name in enumerate(selection.models):
        of_size = {point.n_sensors: point.rmse_um[j] for point in selection.proof.curve}
        worth = noise_um[j] if selection.options.within is None else selection.options.within
        if most in of_size and most - 1 in of_size and of_size[most] < of_size[most - 1] - worth:
            falls.append(f"{name} from {of_size[most - 1]:.3g} to {of_size[most]:.3g} µm")
    if most > 1 and not falls:
        return
    step = f" and from {most - 1} to {most} the error of the {BEST_OF_SIZE} still falls ({', '.join(falls)})"
    yield FINDINGS.finding(
        "choice-at-limit",
        f"{most} sensor{'s were' if most > 1 else ' was'} chosen, the most that --max-sensors allows"
        f"{step if falls else ''}: more might predict better.",
        evidence={"max_sensors": most, "sensors": there_are},
        suggestion=f"see whether more are worth their cost: --max-sensors {min(most + 3, there_are)}",
    )


def _reversed(selection: Selection, name: str, run: str) -> bool:
    """Whether a run moves against its prediction all the way."""
    j = list(selection.models).index(name)
    for trace in selection.proof.traces:
        measured, predicted = trace.measured_um[:, j], trace.predicted_um[:, j]
        if trace.run == run and len(measured) > 2 and np.ptp(measured) > 0 and np.ptp(predicted) > 0:
            return bool(np.corrcoef(measured, predicted)[0, 1] < REVERSED)
    return False


def _offer_findings(errors: Mapping[Offer, float], taken: Offer) -> Iterator[Finding]:
    """What the richer terms that the user offered are worth on unseen data."""
    if len(errors) == 1:
        return
    words = {"linear": "linear terms only", "polynomial": "powers and products", "memory": "lagged terms"}
    listed = ", ".join(f"{words[offer]} {100 * error:.1f} %" for offer, error in errors.items())
    helped = taken == list(errors)[-1]
    yield FINDINGS.finding(
        "terms-that-help" if helped else "terms-not-used",
        f"Error on unseen data, in the spread of the displacement: {listed}. The model "
        f"{'uses' if helped else 'keeps to'} {words[taken]}.",
        evidence={"relative_error": dict(errors), "taken": taken},
        suggestion=""
        if helped
        else "more runs, longer and with heating and cooling, would let richer terms prove themselves",
    )


def _three_digits(value: float) -> str:
    return f"{value:.0f}" if 100 <= value < 1e7 else f"{value:.3g}"


def _model_findings(selection: Selection, ridge: tuple[float, float, float]) -> Iterator[Finding]:
    # every response has the same terms, so their collinearity is one statement
    model = next(iter(selection.models.values()))
    inflated = list(zip(model.terms, model.vif, strict=True))
    single = [(t, v) for t, v in inflated if t.degree == 1] or inflated
    worst, vif = max(single, key=lambda item: item[1])
    condition = model.diagnostics.condition_number
    if vif > COLLINEAR_VIF or condition > ILL_CONDITIONED:
        yield FINDINGS.finding(
            "collinear-terms",
            f"The terms of the model move together (VIF of {worst} {_three_digits(vif)}, condition number "
            f"{_three_digits(condition)}): single coefficients are uncertain, and a sensor fault or another season "
            "is amplified.",
            evidence={"vif": float(vif), "term": str(worst), "condition_number": condition},
            suggestion="the unseen error was found with sets like this one and stands for data like these; do not read "
            "single coefficients"
            + ("" if selection.options.ridge else ", and see with --ridge what shrinking them costs")
            + ("" if len(selection.chosen) < 2 else "; a smaller --max-sensors gives terms that are less alike"),
        )
    watson = {name: one.diagnostics.durbin_watson for name, one in selection.models.items()}
    low = {name: value for name, value in watson.items() if value < CORRELATED}
    if low:
        listed = ", ".join(f"{name} {value:.2f}" for name, value in low.items())
        ljung_box = {name: one.diagnostics.ljung_box_p for name, one in selection.models.items()}
        yield FINDINGS.finding(
            "correlated-residuals",
            f"Residuals follow each other (Durbin–Watson: {listed}): the machine remembers something that the "
            "model does not. Standard errors allow for it.",
            evidence={"durbin_watson": watson, "ljung_box_p": ljung_box},
            suggestion="" if selection.options.memory else "try --memory: lagged temperatures follow slow parts",
        )
    for name, one in selection.models.items():
        cooks = one.diagnostics.max_cooks_distance
        if cooks > 1.0:
            yield FINDINGS.finding(
                "influential-sample",
                f"One sample bends the model of {name} by itself (Cook's distance {cooks:.3g}).",
                Where(channel=name),
                {"cooks_distance": cooks, "row": one.diagnostics.most_influential},
            )
    if selection.options.ridge:
        penalty, with_it, without = ridge
        in_sample = ", ".join(f"{name} {model.rmse_um:.3g} µm" for name, model in selection.models.items())
        yield FINDINGS.finding(
            "ridge",
            f"The ridge penalty {penalty:.3g} predicts unseen data best: {with_it:.4g} µm against {without:.4g} µm "
            f"without; in sample {in_sample}.",
            evidence={"penalty": penalty, "heldout_rmse_um": with_it, "heldout_rmse_um_without": without},
        )


def _range_findings(selection: Selection, rows: Rows) -> Iterator[Finding]:
    """Runs whose inputs lie outside the hull of all the others: there the proof is an extrapolation."""
    beyond: dict[str, float] = {}
    words: list[str] = []
    many = len(rows.runs) > MOST_FOLDS
    # a run beyond all others holds an outermost sample; with few runs it costs nothing to look at each
    outermost = set(rows.run[outermost_samples(rows.variables)].tolist()) if many else ()
    for r, run in enumerate(rows.runs):
        if many and r not in outermost:
            continue
        mine, others = rows.variables[rows.run == r], rows.variables[rows.run != r]
        if not len(mine) or not len(others):
            continue
        hull = validity_hull(others)
        distance = float(hull.distance(mine[evenly(len(mine), 40)]).max())
        if distance <= OUTSIDE:
            continue
        outside = np.maximum(np.maximum(hull.low - mine.min(axis=0), mine.max(axis=0) - hull.high), 0.0)
        j = int(np.argmax(outside / hull.scale))
        name, unit = _variable_and_unit(selection, j)
        beyond[run] = distance
        far = f", {name} by up to {outside[j]:.3g} {unit}" if outside[j] > 0.1 * hull.scale[j] else ""
        words.append(f"{run} by {distance:.2g}{far}")
    if beyond:
        yield FINDINGS.finding(
            "runs-outside-the-others",
            f"Beyond what the other runs cover, in standard deviations of the inputs: {'; '.join(words)}. The unseen "
            "error of these runs is that of an extrapolation.",
            evidence={"distance": beyond},
        )


def _variable_and_unit(selection: Selection, j: int) -> tuple[str, str]:
    """A variable of the model as a person calls it, and the unit of its differences."""
    design = selection.recipe.design
    name = design.variables[j]
    lag, source = design.lag_and_source(name)
    return f"{source} lagged {lag.tau_s:.0f} s" if lag else name, "K" if source in selection.chosen else "rpm"
