"""`predict`: heating and cooling tests and a duty cycle in, displacement and a correction program out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from selector.atomic_file import begins_with
from selector.cli.selecting import Responses
from selector.cli.shared import showing
from selector.cli.shared.option_table import option
from selector.cli.shared.showing import AsJson, Everything, require_folder
from selector.cli.shared.source import Source, with_source
from selector.errors import Misfit, OptionError, refuse

if TYPE_CHECKING:
    from selector.controllers.timed_program import TimedProgram
    from selector.physics.thermal.prediction.prediction import Prediction, Tolerance


@dataclass(frozen=True)
class Asked:
    """The options of `predict`, one field an option."""

    cycle: Annotated[Path, option("predict --cycle")]
    response: Responses = None
    method: Annotated[Literal["modal", "piecewise"], option("predict --method")] = "modal"
    operations: Annotated[str | None, option("predict --operations")] = None
    tolerance: Annotated[list[str] | None, option("predict --tolerance")] = None
    resolution: Annotated[float | None, option("predict --resolution")] = None
    order: Annotated[bool, option("predict --order")] = False
    warm_up: Annotated[float | None, option("predict --warm-up", min=5.0, max=600.0)] = None
    start: Annotated[Literal["cold", "tests"] | None, option("predict --start")] = None
    nc: Annotated[str | None, option("predict --nc")] = None
    invert: Annotated[list[str] | None, option("predict --invert")] = None
    readings: Annotated[Path | None, option("predict --readings")] = None
    observe: Annotated[list[str] | None, option("predict --observe")] = None

    def require_usable(self, out: Path | None) -> None:
        """Ends with an error when a number is out of its limits, or an NC subprogram has nothing to say or to go to."""
        refuse(self._misfits(out), OptionError)

    def _misfits(self, out: Path | None) -> Iterator[Misfit]:
        has_program = self.operations is not None or bool(self.tolerance)
        if self.nc is not None and (out is None or not has_program):
            found = f"--nc {self.nc} without {'--out' if out is None else 'a correction program'}"
            advice = "add --tolerance (µm between corrections) and --out DIR, or leave --nc out"
            yield found, "--operations or --tolerance, and a folder", "--nc", advice
        if self.observe and self.readings is None:
            found, advice = f"--observe {self.observe[0]} without --readings", "add --readings DAY, or leave it out"
            yield found, "a recording of the day beside it", "--observe", advice
        if self.invert and self.nc is None:
            advice = "add --nc fanuc or --nc sinumerik, or leave it out"
            yield "--invert without --nc", "an NC subprogram, whose sign it turns", "--invert", advice
        if self.warm_up is not None and not has_program:
            found, advice = "--warm-up without a correction program", "say which drift is allowed, e.g. --tolerance 10"
            yield found, "--operations or --tolerance beside it", "--warm-up", advice
        if self.order and len(self.operations_s() or ()) < 2:
            expected = "at least two operations, whose order can change"
            advice = "say how long the operations are, e.g. --operations 60,45,90"
            yield "--order without operations", expected, "--order", advice
        self.tolerances_um()
        if self.resolution is not None and not 0.0 < self.resolution < math.inf:
            advice = "e.g. --resolution 1, or leave it out"
            yield f"{self.resolution:g}", "minutes above 0", "--resolution", advice

    def tolerances_um(self) -> Tolerance | None:
        """Tolerances in µm: one for all, or those of each response, one for all operations or one for each.

        Raises OptionError: one is no drift above 0, a response is named twice, or some have a name and others not.
        """
        told: dict[str | None, float | list[float]] = {}
        for text in self.tolerance or ():
            name, mark, numbers = text.rpartition("=")
            values = [_above_zero(part, text, "--tolerance", "a drift in µm above 0") for part in numbers.split(",")]
            key = name.strip() if mark else None
            if key in told or (told and None in (key, *told)):
                raise OptionError(
                    f"{text[:60]!r} beside other tolerances", expected="one for all, or one a response by its name",
                    where="--tolerance", advice="e.g. --tolerance 10, or --tolerance Z=10 --tolerance X=5",
                )  # fmt: skip
            told[key] = values if len(values) > 1 else values[0]
        if None in told:
            return told[None]
        return {name: values for name, values in told.items() if name is not None} or None

    def operations_s(self) -> list[float] | None:
        """Lengths in seconds, of minutes separated by commas. Raises OptionError: one is no length."""
        if self.operations is None:
            return None
        expected = "minutes above 0, separated by commas"
        parts = self.operations.split(",")
        return [60.0 * _above_zero(part, self.operations, "--operations", expected) for part in parts]


def _above_zero(part: str, text: str, where: str, expected: str) -> float:
    try:
        value = float(part)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise OptionError(f"{part.strip()!r} in {text[:60]!r}", expected=expected, where=where, advice=_EXAMPLES[where])
    return value


_EXAMPLES = {"--operations": "e.g. --operations 60,60,45.5", "--tolerance": "e.g. --tolerance 10, or 10,5,10"}


@with_source
def predict(
    source: Source,
    asked: Asked,
    out: Annotated[Path | None, option("predict --out")] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Predicts the displacement in a duty cycle from heating and cooling tests, and how to correct it.

    No thermometer is needed: what counts is at which speed the spindle turned for how long, and, if it was recorded,
    how the hall moved. With --operations or --tolerance it makes the correction program: when to correct each operation
    by how much, so that the drift stays within the tolerance. With --readings it tells how the day went that was to
    follow the plan.
    """
    import numpy as np

    from selector.physics.thermal.modes.modes import AmbientCourse
    from selector.physics.thermal.modes.thermal_test import thermal_tests
    from selector.physics.thermal.prediction.prediction import cyclogram_of_rows
    from selector.physics.thermal.prediction.prediction import predict as predicted
    from selector.readers import read
    from selector.readers.cycle_file import day_readings, heating_tests, read_cycle
    from selector.recording import of_axis
    from selector.study.data import drift_of, provenance_of
    from selector.telling.predicted import prediction_account

    lengths_s = asked.operations_s()
    asked.require_usable(out)
    if source.mean_s is not None:
        raise OptionError(
            f"--mean-s {source.mean_s:g}", expected="samples as they were recorded", where="--mean-s",
            advice="leave it out: means are taken here anyway, over times that grow since the speed last changed",
        )  # fmt: skip
    beside = [] if asked.readings is None else [asked.readings]
    inputs = [asked.cycle, *beside, *source.machine_files, *source.runs]
    require_folder(out, inputs, ("prediction.json", "report.html"))
    steps = read_cycle(asked.cycle)
    cyclogram, of_cycle = cyclogram_of_rows(steps.time_s, steps.speed_rpm, lengths_s)
    reading = source.reading()
    require_folder(out, [file for file, _ in reading.files])
    channels, tolerances, day = reading.recording.channels, asked.tolerances_um(), None
    wanted = tuple(of_axis(name, channels) for name in asked.response or ())
    if isinstance(tolerances, dict):
        tolerances = {of_axis(name, channels): drift for name, drift in tolerances.items()}
    if asked.readings is not None:
        wanted = wanted or reading.recording.with_role("displacement")
        overrides = replace(source.overrides(), partial=True)
        seen = read([asked.readings], reading.machine, overrides)
        day, of_day = day_readings(seen, reading.recording, wanted, asked.observe or ())
        wanted, of_cycle = (*wanted, *day.thermometers), (*of_cycle, *of_day)
    recording, responses, of_recording = heating_tests(reading, wanted)
    halls = recording.with_role("ambient")
    foreseen = steps.temperatures(halls)
    hall = AmbientCourse(steps.time_s, np.column_stack([*foreseen.values()]), tuple(foreseen)) if foreseen else None
    prediction = predicted(
        thermal_tests(recording, responses), responses, cyclogram, method=asked.method, hall=hall, start=asked.start,
        operations_s=lengths_s, tolerance_um=tolerances, find_order=asked.order, readings=day,
        resolution_s=None if asked.resolution is None else 60.0 * asked.resolution,
        warm_up_s=60.0 * (asked.warm_up or 0.0), told=(*of_recording, *of_cycle, *steps.ignored(foreseen, halls)),
        temperatures=[name for name in responses if name in recording.with_role("temperature")],
    )  # fmt: skip
    told_of_tests = {**provenance_of(reading), "duty cycle": steps.file}
    described = {**reading.description(), "drift": drift_of(recording)}
    account = prediction_account(prediction, described, told_of_tests, drawn=out is not None)
    program = None
    if asked.nc is not None:
        from selector.controllers.timed_program import timed_program

        good = {name: one for name, one in prediction.programs.items() if name not in prediction.doubtful}
        if prediction.programs and not good:
            raise OptionError(
                f"predictions that are not good enough: {', '.join(prediction.doubtful)}", where="--nc",
                expected="twice the error on unseen tests within the tolerance",
                advice="record further tests, allow more, or leave --nc out",
            )  # fmt: skip
        axes = {name: recording.channel(name).axis or "" for name in good}
        inverted = [
            one for one in (of_axis(one, channels) for one in asked.invert or ()) if one not in prediction.doubtful
        ]
        program = timed_program(asked.nc, good, axes, inverted)
    if program is not None:
        account = replace(account, data={**account.data, "nc": program.as_dict()})
    earlier = [] if out is None else [name for name, mark in _NOT_ALWAYS.items() if begins_with(out / name, mark)]
    showing.give_answer(
        account, prediction.findings, out, "prediction.json", beside=_programs(prediction, program), earlier=earlier,
        everything=everything, as_json=as_json,
    )  # fmt: skip


#: File that not every prediction has → what its beginning holds if an earlier one wrote it.
_NOT_ALWAYS = {
    "program.csv": "response,operation,correction,",
    "program.txt": "Timed corrections of",
    "nc_sheet.txt": "Timed corrections: what to do",
    "O9110.nc": "(TIMED CORRECTION)",
    "SELECTOR_TIMED.SPF": "PROC SELECTOR_TIMED(",
}


def _programs(prediction: Prediction, program: TimedProgram | None) -> dict[str, str]:
    """Names and texts of the files with correction programs."""
    from selector.physics.thermal.prediction.correction_program import program_blocks, program_table

    files = {}
    if prediction.programs:
        files["program.csv"] = program_table(prediction.programs)
        files["program.txt"] = program_blocks(prediction.programs, prediction.doubtful)
    if program is not None:
        unless = f"NOT IN IT: the prediction of {', '.join(prediction.doubtful)} is not good enough.\n\n"
        sheet = program.sheet.replace("\n\n", f"\n\n{unless}", 1) if prediction.doubtful else program.sheet
        files |= {program.file: program.text, "nc_sheet.txt": sheet}
    return files
