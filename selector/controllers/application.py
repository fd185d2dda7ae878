"""An exported model on other recordings: what it predicts, how well, and where it must not be trusted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.atomic_file import write_whole
from selector.controllers.compared import displacement_starts
from selector.controllers.evaluator import evaluate, first_finite
from selector.controllers.model_file import Input, ModelFile, Output
from selector.controllers.sampling import other_sampling
from selector.controllers.sensor_check import outside_valid_range, time_share, usable_readings
from selector.csv_text import defused
from selector.errors import OptionError, RecordingError, UnitError
from selector.findings import Finding, Where
from selector.recording import SENSOR_ROLES, Recording

Array = NDArray[np.float64]
PerRun = Mapping[str, Mapping[str, float]]

SCHEMA = "selector.application/1"


@dataclass(frozen=True)
class Accuracy:
    """How large the displacement is with and without compensation [µm], over the same samples; None = not recorded."""

    rmse_um: float | None
    max_um: float | None
    before_rmse_um: float | None
    before_max_um: float | None
    n_samples: int

    @classmethod
    def of(cls, predicted_um: Array, recorded_um: Array) -> Accuracy:
        """The accuracy of predictions, over the samples where both are known."""
        both = np.isfinite(predicted_um) & np.isfinite(recorded_um)
        if not both.any():
            return cls(None, None, None, None, 0)
        left, before = recorded_um[both] - predicted_um[both], recorded_um[both]
        return cls(_rms(left), _largest(left), _rms(before), _largest(before), int(both.sum()))

    def as_dict(self) -> dict[str, float | None]:
        """The four figures of the contract."""
        return {key: value for key, value in vars(self).items() if key != "n_samples"}


@dataclass(frozen=True, eq=False)
class Application:
    """The result of `apply_model`.

    Attributes
    ----------
    per_run : mapping of run to mapping of output to Accuracy
    overall : mapping of output to Accuracy
        All samples of all runs together.
    predictions : DataFrame
        Columns ``run``, ``time_s`` and one per output: the predicted displacement [µm], counted from the zero of the
        recording so that the two can be laid over each other; NaN = no prediction.
    findings : tuple of Finding
    """

    per_run: Mapping[str, Mapping[str, Accuracy]]
    overall: Mapping[str, Accuracy]
    predictions: pd.DataFrame
    findings: tuple[Finding, ...]

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


def apply_model(
    model: ModelFile,
    recording: Recording,
    start_readings: PerRun | None = None,
    displacement_start: PerRun | None = None,
) -> Application:
    """Predictions of a model for every run of a recording, compared with the recorded displacement where there is one.

    Readings that mean a broken sensor (break codes, limits of the model file) count as missing, with a finding.

    Parameters
    ----------
    model : ModelFile
    recording : Recording
    start_readings : mapping of run to mapping of input to reading, optional
        Readings at the start of a run, for inputs that are rises. Default: the first finite reading.
    displacement_start : mapping of run to mapping of output to float, optional
        Displacement [µm] that counts as zero. Default: 0, or `displacement_starts` if the output itself is a rise.

    Raises
    ------
    RecordingError
        An input (or an axis position that the model needs) is missing in every run.
    UnitError
        A channel has a role that does not fit the input or output of its name.
    OptionError
        A start value names a run or a channel that does not exist, or is not a finite number.
    """
    require_channels(model, recording)
    _require_starts(start_readings, recording.runs, [item.name for item in model.inputs], "start_readings")
    _require_starts(displacement_start, recording.runs, [item.name for item in model.outputs], "displacement_start")
    findings = list(other_sampling(model, recording))
    zeros = displacement_starts(model, recording)
    per_run: dict[str, dict[str, Accuracy]] = {}
    tables: list[pd.DataFrame] = []
    recorded: dict[str, list[Array]] = {output.name: [] for output in model.outputs}
    modelled: dict[str, list[Array]] = {output.name: [] for output in model.outputs}
    for run in recording.runs:
        start, given = (start_readings or {}).get(run, {}), (displacement_start or {}).get(run, {})
        predicted, about_run = _predictions(model, recording, run, start)
        findings.extend(about_run)
        per_run[run] = {}
        for output in model.outputs:
            zero = given.get(output.name, zeros[run].get(output.name, 0.0))
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
    return Application(per_run, overall, predictions, tuple(findings))


def write_predictions(application: Application, path: str | Path) -> None:
    """Write the predictions as CSV (``run,time_s,<output>…``, UTF-8, empty = no prediction), whole or not at all.

    Names are those of `selector.csv_text.defused`. Numbers are the shortest text that reads back to the same float64.

    Raises
    ------
    OptionError
        Nothing can be written at this path.
    """
    table = application.predictions.rename(columns=defused)
    table["run"] = table["run"].map({run: defused(run) for run in table["run"].unique()})
    text = table.to_csv(index=False, lineterminator="\n")
    write_whole(Path(path), text.encode("utf-8"))


def _predictions(
    model: ModelFile, recording: Recording, run: str, start: Mapping[str, float]
) -> tuple[dict[str, Array], list[Finding]]:
    time_s = recording.time_s(run)
    names = [item.name for item in model.inputs]
    table = recording.values(run, names)
    readings, findings = usable_readings(model, run, time_s, dict(zip(names, table.T, strict=True)))
    starts = {name: start.get(name, first_finite(readings[name])) for name in names}
    positions = {
        axis: recording.values(run, [channel])[:, 0] for axis, channel in position_channels(model, recording).items()
    }
    predicted = evaluate(model, time_s, readings, starts, positions or None)
    found = [*findings, *outside_valid_range(model, run, time_s, readings, starts)]
    for name, values in predicted.items():
        missing = ~np.isfinite(values)
        if missing.any():
            share = time_share(time_s, missing)
            found.append(
                Finding(
                    "no-prediction",
                    "warning",
                    f"Run {run} has no prediction of {name} for {share:.1%} of the time, for want of readings.",
                    Where(channel=name, run=run),
                    {"share_of_time": share, "samples": int(missing.sum())},
                    "see the findings about its sensors; errors are counted over the other samples",
                )
            )
    return predicted, found


def displacement_of(output: Output, recording: Recording, run: str) -> Array:
    """The recorded displacement of an output [µm], NaN throughout where there is none."""
    if output.name not in recording.names:
        return np.full(len(recording.time_s(run)), np.nan)
    return recording.values(run, [output.name])[:, 0]


def require_channels(model: ModelFile, recording: Recording) -> None:
    """Ends with an error where a recording lacks what the model needs, or has it in another role.

    Raises
    ------
    RecordingError
        No readings of an input, or no position of an axis.
    UnitError
        A channel has another role than in the model.
    """
    names = set(recording.names)
    present = [item.name for item in model.inputs if item.name in names]
    seen = {name for name in present if bool(recording.frame[name].notna().any())}
    absent = [item.name for item in model.inputs if item.name not in seen]
    if absent:
        raise RecordingError(
            f"no readings of {', '.join(absent)} in any run",
            expected="the inputs of the model: " + ", ".join(item.name for item in model.inputs),
            where="recording",
            advice='name the columns in the machine file, e.g. column = "PT01" under '
            f"[channels.{absent[0]}]; the recording has: {', '.join(recording.names)}",
        )
    for item in model.inputs:
        _require_role(item, recording)
    for output in model.outputs:
        if output.name in names and recording.channel(output.name).role != "displacement":
            raise _role_error(output.name, recording.channel(output.name).role, "displacement")
    position_channels(model, recording)


def _require_role(item: Input, recording: Recording) -> None:
    role = recording.channel(item.name).role
    # an ambient sensor is a temperature sensor by another name
    if role != item.role and not (role in SENSOR_ROLES and item.role in SENSOR_ROLES):
        raise _role_error(item.name, role, item.role)


def _role_error(name: str, found: str, expected: str) -> UnitError:
    return UnitError(
        f"role {found!r}",
        expected=f"role {expected!r}, as in the model",
        where=f"channel {name!r}",
        advice="correct the role of this channel in the machine file, or apply the model to other recordings",
    )


def position_channels(model: ModelFile, recording: Recording) -> dict[str, str]:
    """Axis → channel of its position, for the axes whose position the model needs.

    Raises
    ------
    RecordingError
        There is no such channel.
    """
    channels = {}
    for output in model.outputs:
        if output.position is None:
            continue
        axis = output.position.axis
        fitting = [
            channel.name
            for role in ("position", "position_command")
            for channel in recording.channels
            if channel.role == role and channel.axis == axis
        ]
        if not fitting:
            raise RecordingError(
                f"no position of axis {axis}",
                expected=f"a channel with role position or position_command and axis {axis!r}: the model depends on it",
                where="recording",
                advice="describe the channel in the machine file",
            )
        channels[axis] = fitting[0]
    return channels


def _require_starts(given: PerRun | None, runs: tuple[str, ...], names: list[str], where: str) -> None:
    for run, values in (given or {}).items():
        wrong = f"run {run!r}" if run not in runs else None
        expected = "one of the runs " + ", ".join(runs)
        for name, value in values.items():
            if wrong is None and name not in names:
                wrong, expected = f"channel {name!r}", "one of " + ", ".join(names)
            elif wrong is None and not math.isfinite(value):
                wrong, expected = f"{name} = {value}", "a finite number"
        if wrong is not None:
            raise OptionError(wrong, expected=expected, where=where, advice="correct the start values")


def _without_displacement(runs: tuple[str, ...], recorded: Mapping[str, list[Array]]) -> Iterator[Finding]:
    for name, parts in recorded.items():
        lacking = [run for run, values in zip(runs, parts, strict=True) if not np.isfinite(values).any()]
        if lacking:
            said = "No run has" if len(lacking) == len(runs) else f"{', '.join(lacking)}: no"
            yield Finding(
                "no-displacement",
                "info",
                f"{said} recorded displacement {name}; there are predictions, but no errors.",
                Where(channel=name, run=lacking[0] if len(lacking) == 1 else None),
                {"runs": lacking},
            )


def _worse_than_nothing(overall: Mapping[str, Accuracy]) -> Iterator[Finding]:
    for name, figures in overall.items():
        if (
            figures.rmse_um is not None
            and figures.before_rmse_um is not None
            and figures.rmse_um > figures.before_rmse_um
        ):
            yield Finding(
                "worse-than-nothing",
                "error",
                f"The model makes {name} worse: RMS error {figures.rmse_um:.3g} µm with compensation, "
                f"{figures.before_rmse_um:.3g} µm without.",
                Where(channel=name),
                figures.as_dict(),
                "do not use this model here; check the sign, the start readings and the sensors",
            )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values)))
