"""An exported model on other recordings: what it predicts, how well, and where it must not be believed."""

import dataclasses
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from selector.atomic_file import write_whole
from selector.controllers.evaluator import axes_of, evaluate_after, first_finite
from selector.controllers.finding_table import FINDINGS, SENSOR_LOOKS_BROKEN
from selector.controllers.guard.decided import CODE_SLACK, RANGE_SLACK
from selector.controllers.model_file import Input, ModelFile, Output
from selector.csv_text import defused
from selector.errors import OptionError, RecordingError, UnitError
from selector.findings import Finding, Where
from selector.models.design import datum_of
from selector.models.run_before import Before, before_gauge, begun, chain_before, runs_before
from selector.number_text import span_text
from selector.quality import inspect, without_faults
from selector.quality.finding_table import GAUGE_BEGINS_LATE
from selector.recording import PARTS, SENSOR_ROLES, Recording, RunSource, at_pauses, thinned
from selector.types import Array, Mask

SLIGHT_SHARE = 0.01
#: Shorter and less (of the width of the range) than both: noise at the edge, worth a note but no warning.
SLIGHT_EXCESS = 0.05
MISSING_SHARE = 0.05
LAST_SAMPLES = 20

PerRun = Mapping[str, Mapping[str, float]]


def usable_readings(
    model: ModelFile, run: str, time_s: Array, readings: Mapping[str, Array]
) -> tuple[dict[str, Array], tuple[Finding, ...]]:
    """Readings per input with NaN where they are not temperatures (or speeds, …) at all, and what was found.

    Findings ``sensor-looks-broken`` (kinds missing, break-code, out-of-limits) and ``missing-readings``;
    what stands still or jumps is found by `selector.quality`.
    """
    usable: dict[str, Array] = {}
    findings: list[Finding] = []
    for item in model.inputs:
        values = np.where(np.isfinite(readings[item.name]), readings[item.name], np.nan)
        low, high = item.reading_limits
        breaks = np.array(model.guard.break_codes if item.unit == "degC" else ())
        codes = np.any(np.abs(values[:, None] - breaks) <= CODE_SLACK * np.abs(breaks), axis=1)
        beyond = ((values < low) | (values > high)) & ~codes
        for where, kind in ((np.isnan(values), "missing"), (codes, "break-code"), (beyond, "out-of-limits")):
            findings.extend(_broken(item, run, time_s, values, where, kind))
        usable[item.name] = np.where(codes | beyond, np.nan, values)
    return usable, tuple(findings)


def outside_valid_range(
    model: ModelFile, run: str, time_s: Array, readings: Mapping[str, Array], start: Mapping[str, float]
) -> Iterator[Finding]:
    """One finding ``outside-valid-range`` for every input of a run that leaves what the model has seen."""
    for item in model.inputs:
        x = readings[item.name] - (start[item.name] if item.reference == "rise" else 0.0)
        width, excess = item.valid_max - item.valid_min, np.fmax(item.valid_min - x, x - item.valid_max)
        outside = excess > RANGE_SLACK * width
        if not outside.any():
            continue
        worst = int(np.nanargmax(excess))
        share = time_share(time_s, outside)
        unit = unit_of_difference(item)
        what = "rise" if item.reference == "rise" else "reading"
        when = np.flatnonzero(outside)
        slight = share < SLIGHT_SHARE and float(excess[worst]) < SLIGHT_EXCESS * width
        said = f"{100 * share:.1f} %" if share >= 0.001 else "less than 0.1 %"
        yield FINDINGS.finding(
            "outside-valid-range",
            f"{item.name} in run {run}: the {what} leaves the valid range {item.valid_min:.4g} … {item.valid_max:.4g} "
            f"{unit} of the model since {time_s[when[0]]:.0f} s, by up to {excess[worst]:.3g} {unit}, for {said} "
            "of the time. There the model extrapolates.",
            Where(channel=item.name, run=run, from_s=float(time_s[when[0]]), to_s=float(time_s[when[-1]])),
            {
                "valid_min": item.valid_min,
                "valid_max": item.valid_max,
                "smallest": float(np.nanmin(x)),
                "largest": float(np.nanmax(x)),
                "largest_excess": float(excess[worst]),
                "unit": unit,
                "share_of_time": share,
            },
            level="info" if slight else "warning",
        )


def time_share(time_s: Array, where: Mask) -> float:
    """Share of the time of a run for which `where` holds, each sample lasting until the next one."""
    if len(time_s) == 1:
        return float(where[0])
    steps = np.diff(time_s)
    lasting = np.append(steps, np.median(steps))
    return float(np.sum(lasting[where]) / np.sum(lasting))


def unit_of_difference(item: Input) -> str:
    """The unit of a difference of readings, for people."""
    return "K" if item.unit == "degC" else item.unit


def _broken(item: Input, run: str, time_s: Array, values: Array, where: Mask, kind: str) -> Iterator[Finding]:
    """What is no reading in part of a run: it has no prediction there."""
    if not where.any():
        return
    when, share = np.flatnonzero(where), time_share(time_s, where)
    at = Where(channel=item.name, run=run, from_s=float(time_s[when[0]]), to_s=float(time_s[when[-1]]))
    evidence: dict[str, Any] = {"share_of_time": share, "samples": len(when)}
    id_: str = SENSOR_LOOKS_BROKEN
    if kind == "missing":
        said = "has no reading at all" if where.all() else f"has no reading for {100 * share:.1f} % of the time"
        if share <= MISSING_SHARE and not where[-LAST_SAMPLES:].all():
            id_ = "missing-readings"
    else:
        reading, unit = float(values[when[0]]), item.unit.replace("degC", "°C")
        meaning = "the code of a broken sensor" if kind == "break-code" else "beyond the limits of its readings"
        said = f"reads {reading:.6g} {unit} since {at.from_s:.0f} s, which is {meaning}"
        said += f", for {100 * share:.1f} % of the time"
        evidence["reading"] = reading
    broken = {} if id_ == "missing-readings" else {"kind": kind}
    yield FINDINGS.finding(
        id_,
        f"{item.name} in run {run} {said}; there is no prediction there.",
        at,
        broken | evidence,
        action="leave-out-stretch",
    )


def displacement_starts(model: ModelFile, recording: Recording) -> dict[str, dict[str, float]]:
    """Run → output → displacement [µm] that counts as zero, for the outputs that are rises and were recorded.

    As in a selection, so that a model is compared with what it was fitted to: 0 where the gauge was zeroed, else the
    start of a curve through the first samples (`gauge_start`); the first sample would leave its noise in the whole run.
    """
    levels = datum_of(recording, (), _rises(model, recording), "rise").levels
    return {run: dict(found) for run, found in levels.items()}


def _rises(model: ModelFile, recording: Recording) -> list[str]:
    return [output.name for output in model.outputs if output.reference == "rise" and output.name in recording.names]


def sensor_starts(model: ModelFile, recording: Recording) -> dict[str, dict[str, float]]:
    """Run → sensor → reading that its rise counts from, as in a selection; NaN: it has none at the start of the run."""
    rises = [item.name for item in model.inputs if item.reference == "rise" and item.name in recording.names]
    levels = datum_of(recording, rises, (), "rise").levels
    return {run: {name: found.get(name, math.nan) for name in rises} for run, found in levels.items()}


def known_starts(starts: PerRun) -> dict[str, dict[str, float]]:
    """Those that there are."""
    return {run: {name: of for name, of in found.items() if math.isfinite(of)} for run, found in starts.items()}


def without_displacement_faults(model: ModelFile, recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording without the faults of its displacement, and what is wrong with the channels of the model; as in a
    selection it is cut at pauses, and a run begins with its displacement (`begun`): before, it only drives memory.

    A broken sensor is not mended: its readings stay what a control would get. What is missing altogether is left for
    `require_channels`, which says it in the words of the model.
    """
    outputs = [output.name for output in model.outputs]
    used = {*outputs, *(item.name for item in model.inputs)} & set(recording.names)
    found = tuple(_of_comparison(finding, outputs) for finding in inspect(recording, used))
    kept = at_pauses(without_faults(recording, found))
    rises = _rises(model, kept)
    source = begun(kept, rises)
    if model.states and any(one.id == GAUGE_BEGINS_LATE for one in found):
        found = tuple(_of_memory(one, source) if one.where.channel in rises else one for one in found)
        kept = at_pauses(without_faults(recording, found))
        source = begun(kept, _rises(model, kept))
    return kept if source is kept else thinned(source, 1), found


def _of_memory(finding: Finding, source: RunSource) -> Finding:
    """What a rise that begins late means for a model with memory; other findings as they are."""
    if finding.id != GAUGE_BEGINS_LATE:
        return finding
    name, run = finding.where.channel, str(finding.where.run)
    told = f"{name} begins late in run {run}"
    parts = getattr(source, "provenance", {}).get(PARTS, {})
    run = next((part for part, (whole, _) in parts.items() if whole == run), run)
    if before_gauge(getattr(source, "follows", {}), run) is None:
        told += " and is not compared there: other displacements have no reading when it begins."
        mend = "Read all gauges at about the same time; then the run is compared."
        return dataclasses.replace(
            finding, level="warning", statement=told, suggestion=mend, action="leave-out-channel"
        )
    begin_s = float(next(iter(source.chunks(run, ())))[0][0])
    told += f": it is compared from {begin_s:.0f} s on, and what sensors read before only drives the model's memory."
    return dataclasses.replace(finding, statement=told)


def _of_comparison(finding: Finding, outputs: list[str]) -> Finding:
    """The finding with the action that it has here: only faulty displacement is left out."""
    if finding.action == "none" or (finding.action == "leave-out-stretch" and finding.where.channel in outputs):
        return finding
    suggestion = re.sub(r" *\bThe \w+ (is|are) left out\.", "", finding.suggestion)
    return dataclasses.replace(finding, action="none", suggestion=suggestion)


FAR = 3.0  #: Ratio of two sampling periods from which they are no longer alike.
#: Ratios of units of time that are taken for each other: min and s, s and ms, h and s, d and min …
_UNITS_OF_TIME = (60.0, 1000.0, 3600.0, 1440.0, 60_000.0, 86_400.0, 1e6)
_NEAR = 0.03


def period_of(source: RunSource) -> float | None:
    """Median over the runs of the time between two samples [s]; None: no run has two."""
    first = [channel.name for channel in source.channels][:1]
    steps = []
    for run in source.runs:
        pieces = [float(np.median(np.diff(time_s))) for time_s, _ in source.chunks(run, first) if len(time_s) > 1]
        steps += [float(np.median(pieces))] if pieces else []
    period_s = float(np.median(steps)) if steps else 0.0
    return period_s if period_s > 0.0 else None


def other_sampling(model: ModelFile, recording: Recording, *, is_guarded: bool = False) -> Iterator[Finding]:
    """Runs that are sampled otherwise than those of the model; none where its file does not say how these were.

    `is_guarded`: the model is run with its guard, whose limits of change are in seconds, too.
    """
    fitted_s = model.provenance.period_s
    if fitted_s is None:
        return
    rests_on = _on_the_clock(model, is_guarded=is_guarded)
    for run in recording.runs:
        time_s = recording.time_s(run)
        period_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
        if period_s <= 0.0 or max(period_s / fitted_s, fitted_s / period_s) < FAR:
            continue
        ratio = max(period_s / fitted_s, fitted_s / period_s)
        is_unit = any(abs(ratio / of - 1.0) < _NEAR for of in _UNITS_OF_TIME)
        is_guessed = "unit" in (recording.provenance.get("runs", {}).get(run, {}).get("time_guessed") or ())
        doubt = " That looks like a wrong unit of time" if is_unit else ""
        guess = ", which was only guessed here" if is_unit and is_guessed else ""
        yield FINDINGS.finding(
            "other-sampling",
            f"Run {run} has a sample every {span_text(period_s)}, the model was fitted on one every "
            f"{span_text(fitted_s)}: a factor of {ratio:.3g}.{doubt}{guess}{'.' if doubt else ''} "
            + (f"On the clock depend {rests_on}." if rests_on else "This model's answers do not depend on the clock."),
            Where(run=run),
            {"period_s": period_s, "fitted_period_s": fitted_s, "looks_like_unit": is_unit, "unit_guessed": is_guessed},
            "say the unit of the time: --time-unit min (or s, ms, h), or unit under [time] in the machine file"
            if is_unit
            else "check the unit of the time; if the logger was set otherwise, all is well",
            level="info" if not rests_on else "error" if guess else "warning",
        )


def _on_the_clock(model: ModelFile, *, is_guarded: bool) -> str:
    """What of a model depends on the time between two calls, in words; nothing: empty."""
    parts = ["the model's memory"] if model.states else []
    if is_guarded and any(limit.slew_um_per_s is not None for limit in model.guard.limits):
        parts.append("the slew of the correction")
    if is_guarded and any(item.rate_limit_per_min is not None for item in model.inputs):
        parts.append("the fastest change that is believed of a sensor")
    return ", ".join(parts[:-1]) + (" and " if len(parts) > 1 else "") + "".join(parts[-1:])


SCHEMA = "selector.application/1"


@dataclass(frozen=True)
class Accuracy:
    """How large the displacement is with and without compensation [µm], over the same samples; None = not recorded."""

    rmse_um: float | None
    max_um: float | None
    before_rmse_um: float | None
    before_max_um: float | None
    mean_um: float | None  #: Recorded minus predicted
    n_samples: int

    @classmethod
    def of(cls, predicted_um: Array, recorded_um: Array) -> "Accuracy":
        """The accuracy of predictions, over the samples where both are known."""
        both = np.isfinite(predicted_um) & np.isfinite(recorded_um)
        if not both.any():
            return cls(None, None, None, None, None, 0)
        left, before = recorded_um[both] - predicted_um[both], recorded_um[both]
        return cls(*_sizes(left), *_sizes(before), float(np.mean(left)), int(both.sum()))

    @property
    def is_worse(self) -> bool:
        """Whether the error is larger with compensation than without."""
        return self.rmse_um is not None and self.before_rmse_um is not None and self.rmse_um > self.before_rmse_um

    def as_dict(self) -> dict[str, float | None]:
        """The four figures of the contract."""
        return {key: value for key, value in vars(self).items() if key not in ("mean_um", "n_samples")}


@dataclass(frozen=True, eq=False)
class Application:
    """The result of `apply_model`."""

    per_run: Mapping[str, Mapping[str, Accuracy]]
    overall: Mapping[str, Accuracy]  #: All samples of all runs together
    #: Columns ``run``, ``time_s`` and one per output: the predicted displacement [µm], counted from the zero of the
    #: recording so that the two can be laid over each other; NaN = no prediction
    predictions: pd.DataFrame
    findings: tuple[Finding, ...]
    zeros_um: PerRun = dataclasses.field(default_factory=dict)  #: Run → output → what was added to get there

    def as_dict(self) -> dict[str, Any]:
        """JSON form, ``selector.application/1``."""
        return {
            "schema": SCHEMA,
            "per_run": {
                run: {name: accuracy.as_dict() for name, accuracy in outputs.items()}
                for run, outputs in self.per_run.items()
            },
            "overall": {name: accuracy.as_dict() for name, accuracy in self.overall.items()},
            "findings": [finding.as_dict() for finding in self.findings],
        }


def apply_model(model: ModelFile, recording: Recording, start_readings: PerRun | None = None) -> Application:
    """Predictions of a model for every run of a recording, compared with the recorded displacement where there is one.

    Readings that mean a broken sensor (break codes, limits of the model file) count as missing, with a finding.
    `start_readings`: per run and input, for inputs that are rises; default: the first finite reading.
    A displacement counts from 0, from `displacement_starts` if the output is a rise.

    Raises RecordingError: an input (or an axis position that the model needs) is missing in every run. Raises
    UnitError: a channel has a role that does not fit the input or output of its name. Raises OptionError: a start
    value names a run or a channel that does not exist, or is not a finite number.
    """
    require_channels(model, recording)
    _require_starts(start_readings or {}, recording.runs, [item.name for item in model.inputs])
    findings = list(other_sampling(model, recording))
    zeros = displacement_starts(model, recording)
    follows = runs_before(recording, recording.runs) if model.states else {}
    per_run: dict[str, dict[str, Accuracy]] = {}
    added: dict[str, dict[str, float]] = {run: {} for run in recording.runs}
    tables: list[pd.DataFrame] = []
    recorded: dict[str, list[Array]] = {output.name: [] for output in model.outputs}
    modelled: dict[str, list[Array]] = {output.name: [] for output in model.outputs}
    for run in recording.runs:
        predicted, about_run = _predictions(model, recording, run, (start_readings or {}).get(run, {}), follows)
        findings.extend(about_run)
        per_run[run] = {}
        for output in model.outputs:
            zero = added[run][output.name] = zeros[run].get(output.name, 0.0)
            recorded[output.name].append(displacement_of(output, recording, run) - zero)
            modelled[output.name].append(predicted[output.name])
            per_run[run][output.name] = Accuracy.of(predicted[output.name], recorded[output.name][-1])
            predicted[output.name] = predicted[output.name] + zero
        tables.append(pd.DataFrame({"run": run, "time_s": recording.time_s(run), **predicted}))
    predictions = pd.concat(tables, ignore_index=True)
    overall = {
        name: Accuracy.of(np.concatenate(modelled[name]), np.concatenate(parts)) for name, parts in recorded.items()
    }
    findings.extend(_without_displacement(recording.runs, recorded))
    findings.extend(_worse_than_nothing(overall))
    return Application(per_run, overall, predictions, tuple(findings), added)


def write_predictions(application: Application, path: str | Path) -> None:
    """Write the predictions as CSV (``run,time_s,<output>…``, UTF-8, empty = no prediction), whole or not at all.

    Names are those of `selector.csv_text.defused`. Numbers are the shortest text that reads back to the same float64.

    Raises OptionError: nothing can be written at this path.
    """
    table = application.predictions.rename(columns=defused)
    table["run"] = table["run"].map({run: defused(run) for run in table["run"].unique()})
    text = table.to_csv(index=False, lineterminator="\n")
    write_whole(Path(path), text.encode("utf-8"))


def _predictions(
    model: ModelFile, recording: Recording, run: str, start: Mapping[str, float], follows: Mapping[str, Before]
) -> tuple[dict[str, Array], list[Finding]]:
    time_s = recording.time_s(run)
    names = [item.name for item in model.inputs]
    table = recording.values(run, names)
    readings, findings = usable_readings(model, run, time_s, dict(zip(names, table.T, strict=True)))
    starts = {name: start.get(name, first_finite(readings[name])) for name in names}
    positions = {
        axis: recording.values(run, [channel])[:, 0] for axis, channel in position_channels(model, recording).items()
    }
    earlier = []
    for one, later_s in chain_before(follows, run, np.array([state.tau_s for state in model.states])):
        at_s, of = recording.time_s(one) - later_s, dict(zip(names, recording.values(one, names).T, strict=True))
        earlier.append((at_s, usable_readings(model, one, at_s, of)[0]))
    predicted = evaluate_after(model, earlier, time_s, readings, starts, positions or None)
    found = [*findings, *outside_valid_range(model, run, time_s, readings, starts)]
    for name, values in predicted.items():
        missing = ~np.isfinite(values)
        if missing.any():
            share = time_share(time_s, missing)
            found.append(
                FINDINGS.finding(
                    "no-prediction",
                    f"Run {run} has no prediction of {name} for {100 * share:.1f} % of the time, for want of readings.",
                    Where(channel=name, run=run),
                    {"share_of_time": share, "samples": int(missing.sum())},
                )
            )
    return predicted, found


def displacement_of(output: Output, recording: Recording, run: str) -> Array:
    """The recorded displacement of an output [µm], NaN throughout where there is none."""
    if output.name not in recording.names:
        return np.full(len(recording.time_s(run)), np.nan)
    return recording.values(run, [output.name])[:, 0]


def require_channels(model: ModelFile, recording: Recording) -> None:
    """Ends with an error where a recording lacks what the model needs, or has it in another role."""
    names = set(recording.names)
    absent = [one.name for one in model.inputs if one.name not in names or recording.frame[one.name].isna().all()]
    if absent:
        raise RecordingError(
            f"no readings of {', '.join(absent)} in any run",
            expected="the inputs of the model: " + ", ".join(item.name for item in model.inputs),
            where="recording",
            advice='name the columns in the machine file, e.g. column = "PT01" under '
            f"[channels.{absent[0]}]; the recording has: {', '.join(recording.names)}",
        )
    for item in model.inputs:
        role = recording.channel(item.name).role
        # an ambient sensor is a temperature sensor by another name
        if role != item.role and not (role in SENSOR_ROLES and item.role in SENSOR_ROLES):
            raise _role_error(item.name, role, item.role)
    for output in model.outputs:
        if output.name in names and recording.channel(output.name).role != "displacement":
            raise _role_error(output.name, recording.channel(output.name).role, "displacement")
    position_channels(model, recording)


def _role_error(name: str, found: str, expected: str) -> UnitError:
    return UnitError(
        f"role {found!r}",
        expected=f"role {expected!r}, as in the model",
        where=f"channel {name!r}",
        advice="correct the role of this channel in the machine file, or apply the model to other recordings",
    )


_POSITIONS = ("position", "position_command")  #: Roles of the position of an axis; the measured one goes first.


def position_channels(model: ModelFile, recording: Recording) -> dict[str, str]:
    """Axis → channel of its position, for the axes whose position the model needs."""
    channels = {}
    for axis in axes_of(model):
        fitting = [one for one in recording.channels if one.axis == axis and one.role in _POSITIONS]
        if not fitting:
            raise RecordingError(
                f"no position of axis {axis}",
                expected=f"a channel with role position or position_command and axis {axis!r}: the model depends on it",
                where="recording",
                advice="describe the channel in the machine file",
            )
        channels[axis] = min(fitting, key=lambda one: _POSITIONS.index(one.role)).name
    return channels


def _require_starts(given: PerRun, runs: tuple[str, ...], names: list[str]) -> None:
    for run, values in given.items():
        wrong = f"run {run!r}" if run not in runs else None
        expected = "one of the runs " + ", ".join(runs)
        for name, value in values.items():
            if wrong is None and name not in names:
                wrong, expected = f"channel {name!r}", "one of " + ", ".join(names)
            elif wrong is None and not math.isfinite(value):
                wrong, expected = f"{name} = {value}", "a finite number"
        if wrong is not None:
            raise OptionError(wrong, expected=expected, where="start_readings", advice="correct the start values")


def _without_displacement(runs: tuple[str, ...], recorded: Mapping[str, list[Array]]) -> Iterator[Finding]:
    for name, parts in recorded.items():
        lacking = [run for run, values in zip(runs, parts, strict=True) if not np.isfinite(values).any()]
        if lacking:
            said = "No run has" if len(lacking) == len(runs) else f"{', '.join(lacking)}: no"
            yield FINDINGS.finding(
                "no-displacement",
                f"{said} recorded displacement {name} to compare with; there are predictions, but no errors.",
                Where(channel=name, run=lacking[0] if len(lacking) == 1 else None),
                {"runs": lacking},
            )


def _worse_than_nothing(overall: Mapping[str, Accuracy]) -> Iterator[Finding]:
    for name, figures in overall.items():
        if figures.is_worse:
            yield FINDINGS.finding(
                "worse-than-nothing",
                f"The model makes {name} worse: RMS error {figures.rmse_um:.3g} µm with compensation, "
                f"{figures.before_rmse_um:.3g} µm without.",
                Where(channel=name),
                figures.as_dict(),
                "do not use this model here; check sign and unit of the displacement, start readings and sensors",
            )


def _sizes(values: Array) -> tuple[float, float]:
    """Root mean square, and the largest."""
    return float(np.sqrt(np.mean(np.square(values)))), float(np.max(np.abs(values)))
