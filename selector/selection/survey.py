"""What there is to work with: length and period of every run, and which sensors can be candidates at all."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.models.design import Columns, Datum, Design, Term
from selector.models.moments import centred, moments, scaling_of
from selector.models.run_before import AT_RESTS
from selector.quality.finding_table import WRONG_UNIT
from selector.recording import RunSource
from selector.selection.finding_table import FINDINGS, SENSOR_MISSING
from selector.selection.options import Question
from selector.sensors.finding_table import CONSTANT_SENSOR
from selector.text_file import shell_word
from selector.types import Array

#: Gaps that are told; below the second, a sensor costs more by its absence than the samples that its gaps cost.
FEW_MISSING, WORTH_ITS_GAPS = 0.01, 0.1
MOST_MISSING, ENOUGH_COMPLETE = 0.5, 0.5
#: What is left of a sensor beyond the others must be of the size of its noise before it can be done without.
REPLACEABLE_R2 = 0.998
Reasons = dict[str, tuple[str, str, str]]  #: Sensor → (finding id, why it cannot be used, advice).


def usable_sensors(
    source: RunSource, question: Question, missing: Array, low: Array, high: Array, found: Iterable[Finding] = ()
) -> tuple[list[str], list[Finding]]:
    """Sensors that can be candidates, and findings about those that cannot or that cost samples.

    Sensors are compared on samples at which all of them are there. One that is missing often costs the others their
    samples: it is left out if the others can stand in for it, or if fewer than half of the samples would remain.

    `missing`, `low` and `high` have shape (≥ n_sensors,): share of samples without a reading, smallest and largest
    reading of each sensor, sensors first. What was `found` before may be the cause of readings that are not there.

    Raises OptionError: nothing usable is left, or a sensor that must be kept cannot be.
    """
    reasons: Reasons = {}
    before = tuple(found)
    for j, name in enumerate(question.sensors):
        if not np.isfinite(low[j]) or missing[j] >= 1.0:
            reasons[name] = (SENSOR_MISSING, *_why_no_reading(name, before))
        elif high[j] - low[j] <= 1e-9 * max(1.0, abs(high[j])):
            reasons[name] = (CONSTANT_SENSOR, f"always reads {high[j]:.6g} °C", "check the sensor and its wiring")
    gaps = {name: float(missing[j]) for j, name in enumerate(question.sensors) if name not in reasons}
    likeness = _left_out_for_gaps(source, question.needed, gaps, reasons)
    for name, (_, why, _) in reasons.items():
        if name in question.needed:
            option = "--must" if question.options.formula is None else "--formula"
            raise OptionError(
                f"{name} {why}",
                expected="a sensor that can be used",
                where=option,
                advice=f"take {name} out of {option}",
            )
    kept = [name for name in question.sensors if name not in reasons]
    if not kept:
        raise OptionError(
            "no usable sensor: " + "; ".join(f"{name} {why}" for name, (_, why, _) in reasons.items()),
            expected="at least one temperature that changes",
            where="recordings",
            advice="look at the recordings with `selector describe`: it says if temperatures and displacements of one "
            "time stand in two files (two-loggers); else record a run in which the machine warms up",
        )
    findings = [
        FINDINGS.finding(
            kind, f"{name} {why}; it is not a candidate.", Where(channel=name), {}, advice, "leave-out-channel"
        )
        for name, (kind, why, advice) in reasons.items()
    ]
    findings += [_samples_lost(name, gaps[name], likeness[name]) for name in likeness if name in kept]
    return kept, findings


def _why_no_reading(name: str, found: Sequence[Finding]) -> tuple[str, str]:
    """(why a sensor has no reading, advice): what was found before, not the wiring, if that left its readings out."""
    left_out = [one for one in found if one.where.channel == name and one.action != "none"]
    units = [one for one in found if one.id == WRONG_UNIT and one.where.channel in (None, name)]
    if left_out and units:
        mistake = units[0].evidence.get("mistake", "another unit")
        return f"has no reading left, as its unit looks wrong ({mistake})", "mend its unit as wrong-unit says"
    if left_out:
        kinds = ", ".join(dict.fromkeys(one.id for one in left_out))
        return f"has no reading left where the displacement is known ({kinds})", f"see what {kinds} says of {name}"
    return "has no reading where the displacement is known", "check its wiring"


def _left_out_for_gaps(
    source: RunSource, must: Sequence[str], gaps: Mapping[str, float], reasons: Reasons
) -> dict[str, float]:
    """Adds reasons for sensors that are missing too often; R² on the others of every sensor with gaps."""
    likeness: dict[str, float] = {}

    def leave_out(name: str, why: str) -> None:
        advice = f"check its wiring; if it must be kept at the price of those samples: --must {shell_word(name)}"
        reasons[name] = SENSOR_MISSING, f"is missing in {100 * gaps[name]:.0f} % of the samples{why}", advice

    for name in sorted((n for n, share in gaps.items() if share > FEW_MISSING), key=lambda n: -gaps[n]):
        others = [other for other in gaps if other != name and other not in reasons and gaps[other] <= FEW_MISSING]
        likeness[name] = _explained(source, name, others) if others else float("nan")
        is_spared = gaps[name] > WORTH_ITS_GAPS and likeness[name] >= REPLACEABLE_R2
        if name not in must and (is_spared or gaps[name] > MOST_MISSING):
            explained = f"; others explain {100 * likeness[name]:.1f} % of it"
            leave_out(name, "" if math.isnan(likeness[name]) else explained)
    spare = sorted(
        (n for n in likeness if n not in reasons and n not in must), key=lambda n: -np.nan_to_num(likeness[n])
    )
    while spare:
        kept = [name for name in gaps if name not in reasons]
        complete = _complete_share(source, kept)
        if complete >= ENOUGH_COMPLETE:
            break
        why = f", and with the gaps of others only {100 * complete:.0f} % of the samples would be complete"
        leave_out(spare.pop(0), why)
    return likeness


def _explained(source: RunSource, name: str, others: Sequence[str]) -> float:
    """R² of a sensor on the others, where all are there."""
    design = Design((name, *others), (), Datum("absolute"))
    columns = Columns(scaling_of(source, design), tuple(Term(((one, 1),)) for one in design.inputs))
    found = moments(source, design, columns)
    if not len(found.folds):
        return 0.0
    cross, n = centred(found.whole)
    if n <= len(others) + 2 or cross[0, 0] <= 0:
        return 0.0
    within = cross[1:, 1:] + 1e-10 * np.trace(cross[1:, 1:]) / len(others) * np.eye(len(others))
    explained = float(cross[0, 1:] @ np.linalg.solve(within, cross[1:, 0]))
    return min(max(explained / float(cross[0, 0]), 0.0), 1.0)


def _complete_share(source: RunSource, names: Sequence[str]) -> float:
    complete = total = 0
    for run in source.runs:
        for _, values in source.chunks(run, names):
            complete += int(np.isfinite(values).all(axis=1).sum())
            total += len(values)
    return complete / max(total, 1)


def _samples_lost(name: str, share: float, likeness: float) -> Finding:
    return FINDINGS.finding(
        "samples-lost",
        f"{name} is missing in {100 * share:.0f} % of the samples; these are not used for sets with {name}, nor for "
        "comparing sensors.",
        Where(channel=name),
        {"missing_share": share, "explained_by_others": likeness},
        f"repair it and record again, or use --never {shell_word(name)}; --reference absolute needs no start reading",
        "leave-out-stretch",
    )


MOST_CREDIBLE = 1e12  #: Beyond this a reading is broken whatever its unit, and its squares would drown all others.


@dataclass(frozen=True)
class Survey:
    """One pass over the samples."""

    runs: tuple[str, ...]  #: Runs that have displacements
    n_samples: int
    #: period_s and duration_s: Median sampling period and longest run
    period_s: float
    duration_s: float
    question: Question  #: With the sensors that can be used
    findings: tuple[Finding, ...]
    is_one_record: bool  #: Whether the runs are parts of one record


FEWEST_FOR_NOISE = 20


def gauge_noise(displacements: Array) -> Array:
    """Standard deviation of what differs from sample to sample [µm], shape (n_responses,).

    `displacements`, shape (n_samples, n_responses), have no gaps. Third differences see noise (times √20) and hardly a
    machine that warms up; their median is not moved by the steps of a duty cycle.
    """
    return np.asarray(np.median(np.abs(np.diff(displacements, 3, axis=0)), axis=0) / (0.6745 * np.sqrt(20.0)))


class RunsOf:
    """A source restricted to some of its runs."""

    def __init__(self, source: RunSource, runs: Sequence[str]) -> None:
        self._source = source
        self.runs = tuple(runs)  #: The runs kept
        self.channels = source.channels
        self.chunks = source.chunks
        self.provenance = getattr(source, "provenance", {})
        self.follows = getattr(source, "follows", {})


def survey(source: RunSource, question: Question, datum: Datum, found_before: Iterable[Finding] = ()) -> Survey:
    """Decide which runs and sensors can be used.

    A sensor that is constant, that copies another one, or that is missing where others could stand in for it is not a
    candidate; every such decision is a finding, which names what was `found_before` as the cause.

    Raises OptionError: nothing usable is left, or a sensor that must be kept cannot be.
    """
    names = (*question.sensors, *question.responses)
    n_sensors = len(question.sensors)
    findings: list[Finding] = []
    missing = np.zeros(len(names))
    low, high = np.full(len(names), np.inf), np.full(len(names), -np.inf)
    total, runs, periods, durations = 0, [], [], []
    noise: list[Array] = []
    for run in source.runs:
        with_response, first_s, last_s, steps = 0, np.nan, np.nan, []
        absent, measured = np.zeros(len(names)), [np.zeros((0, len(question.responses)))]
        no_start = np.flatnonzero([np.isnan(datum.level(run, name)) for name in names])
        for time_s, values in source.chunks(run, names):
            found = np.isfinite(values)
            # samples without a displacement teach nothing, whatever the sensors say
            rows = found[:, n_sensors:].all(axis=1)
            absent += (~found[rows]).sum(axis=0)
            absent[no_start] += found[rows][:, no_start].sum(axis=0)
            with_response += int(rows.sum())
            if np.isnan(first_s) and len(time_s):
                first_s = float(time_s[0])
            last_s = float(time_s[-1]) if len(time_s) else last_s
            steps.append(float(np.median(np.diff(time_s)))) if len(time_s) > 1 else None
            measured.append(values[rows, n_sensors:])
            if rows.any():
                low = np.fmin(low, np.nanmin(np.where(found, values, np.inf), axis=0))
                high = np.fmax(high, np.nanmax(np.where(found, values, -np.inf), axis=0))
        if with_response < 2:
            findings.append(
                FINDINGS.finding(
                    "run-without-displacement",
                    f"Run {run} has no samples of {' and '.join(question.responses)}; it is left out.",
                    Where(run=run),
                    action="leave-out-run",
                )
            )
            continue
        runs.append(run)
        noise += [gauge_noise(np.concatenate(measured))] if with_response > FEWEST_FOR_NOISE else []
        missing += absent
        total += with_response
        durations.append(last_s - first_s)
        periods.extend(steps)
    if not runs:
        raise OptionError(
            "no run has two samples with " + " and ".join(question.responses),
            expected="recordings of the displacement that the model is to predict",
            where="--response",
            advice="check the column and the unit of the displacement with `selector describe`",
        )
    for name, lowest, highest in zip(names, low, high, strict=True):
        if max(-lowest, highest) > MOST_CREDIBLE and np.isfinite(lowest):
            raise OptionError(
                f"{name} reads from {lowest:.3g} to {highest:.3g}",
                expected=f"readings within ±{MOST_CREDIBLE:g} in the unit of the channel",
                where="recordings",
                advice=f"mark broken readings as missing, or use --never {shell_word(name)}",
            )
    for name, lowest, highest in zip(question.responses, low[n_sensors:], high[n_sensors:], strict=True):
        if highest - lowest <= 1e-12 * max(1.0, abs(highest)):
            raise OptionError(
                f"{name} always reads {highest:.6g} µm",
                expected="a displacement that moves",
                where="--response",
                advice="leave it out (a direction that stays put needs no model), or check the gauge",
            )
    kept, about_sensors = usable_sensors(RunsOf(source, runs), question, missing / total, low, high, found_before)
    return Survey(
        tuple(runs),
        total,
        float(np.median(periods)) if periods else 1.0,
        float(max(durations)),
        replace(
            question,
            sensors=tuple(kept),
            noise_um=tuple(map(float, np.median(noise, axis=0))) if noise else (0.0,) * len(question.responses),
        ),
        (*findings, *about_sensors),
        AT_RESTS in getattr(source, "provenance", {}),
    )
