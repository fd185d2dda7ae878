"""`adapt`: how touch-offs keep a model true, and how often they are needed."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from selector.cli.models import Model
from selector.cli.shared import showing
from selector.cli.shared.option_table import option
from selector.cli.shared.progress import counted_progress
from selector.cli.shared.showing import AsJson, Everything, require_folder
from selector.cli.shared.source import Source, with_source
from selector.errors import OptionError, RecordingError

if TYPE_CHECKING:
    from selector.adaptation import Course
    from selector.controllers.from_adaptation import Touched
    from selector.controllers.model_file import ModelFile
    from selector.recording import Recording


_TIME = re.compile(r"\s*(\d+(?:[.]\d*)?|[.]\d+)\s*(s|min|h|d)\s*")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}


@dataclass(frozen=True)
class Asked:
    """The options of `adapt`, one field an option."""

    every: Annotated[str | None, option("adapt --every")] = None
    touch_offs: Annotated[Path | None, option("adapt --touch-offs")] = None
    within: Annotated[float | None, option("adapt --within")] = None

    def every_s(self) -> float | None:
        """The period of --every [s].

        Raises OptionError: not exactly one of the three options was given, or its value is none.
        """
        given = [self.every is not None, self.touch_offs is not None, self.within is not None]
        if sum(given) != 1:
            raise OptionError(
                f"{sum(given)} of --every, --touch-offs and --within",
                expected="one of them",
                where="adapt",
                advice="--every 2h tries touch-offs on the recordings; --touch-offs FILE.csv has those that were "
                "measured; --within 5 looks for how often to probe",
            )
        if self.within is not None and not 0.0 < self.within < math.inf:
            raise OptionError(
                f"{self.within:g}", expected="a number of µm above 0", where="--within", advice="e.g. --within 5"
            )
        if self.every is None:
            return None
        found = _TIME.fullmatch(self.every)
        seconds = float(found[1]) * _SECONDS[found[2]] if found else 0.0
        if not 0.0 < seconds < math.inf:
            raise OptionError(
                repr(self.every[:40]), expected="a time above 0 with its unit: s, min, h or d", where="--every",
                advice="e.g. --every 2h, --every 90min or --every 3600s",
            )  # fmt: skip
        return seconds


@with_source
def adapt(
    source: Source,
    model: Model,
    asked: Asked,
    out: Annotated[Path | None, option("adapt --out")] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Keeps a model true with touch-offs: readings of the true displacement now and then, while the machine runs.

    Drift of offset and gain and the noise of the readings are learnt from these runs, each run judged with what the
    others taught. Errors are counted at all samples, each with what was known before it.
    """
    from selector.adaptation import adaptation
    from selector.controllers.from_adaptation import adaptation_courses, adapted_model, clamp_findings
    from selector.controllers.model_file import model_text
    from selector.controllers.self_check import usable_model
    from selector.study.applied import applied
    from selector.study.data import provenance_of
    from selector.telling.adapted import adaptation_account

    every_s = asked.every_s()
    if asked.touch_offs is not None and (source.since or source.until):
        raise OptionError(
            "touch-offs, whose times count from the start of a run, and a window", expected="whole runs",
            where="--since and --until", advice="leave the two options out, or use --every",
        )  # fmt: skip
    inputs = [model, *([] if asked.touch_offs is None else [asked.touch_offs]), *source.machine_files]
    require_folder(out, [*inputs, *source.runs], ("adaptation.json", "model.json", "report.html"))
    read, _ = usable_model(model)
    reading = source.reading()
    require_folder(out, [file for file, _ in reading.files])
    application, compared = applied(read, reading)
    given = asked.touch_offs
    touched = None if given is None else _touched(given, reading.recording, compared, read)
    courses, of_courses = adaptation_courses(read, compared, application, touched)
    _require_displacement(courses, read)
    with counted_progress("Adaptation") as progress:
        found = adaptation(
            courses,
            every_s=every_s,
            within_um=asked.within,
            told=(*application.findings, *of_courses),
            say=lambda text: progress(0, 0, text),
        )
    found = replace(found, findings=(*found.findings, *clamp_findings(read, found)))
    account = adaptation_account(found, reading.description(), provenance_of(reading), drawn=out is not None)
    beside = {} if out is None else {"model.json": model_text(adapted_model(read, found))}
    showing.give_answer(
        account, found.findings, out, "adaptation.json", beside=beside, everything=everything, as_json=as_json
    )


def _touched(file: Path, recording: Recording, compared: Recording, model: ModelFile) -> Touched:
    """Touch-offs on the clocks of the runs that are `compared`, which may be parts of those recorded."""
    from selector.readers.touch_off_file import read_touch_offs
    from selector.recording import PARTS

    durations_s = {run: float(recording.time_s(run)[-1] - recording.time_s(run)[0]) for run in recording.runs}
    found = read_touch_offs(file, durations_s, {output.name: output.axis for output in model.outputs})
    touched: dict[str, dict[str, list[tuple[float, float]]]] = {name: {} for name in found}
    for name, run, one in ((name, run, one) for name, runs in found.items() for run, of in runs.items() for one in of):
        at_s = float(recording.time_s(run)[0]) + max(one.time_s, 0.0)
        parts = [(part, from_s) for part, (whole, from_s) in compared.provenance.get(PARTS, {}).items() if whole == run]
        part, from_s = ([(run, 0.0)] + [begun for begun in parts if begun[1] <= at_s])[-1]
        touched[name].setdefault(part, []).append((at_s - from_s, one.displacement_um))
    return touched


def _require_displacement(courses: dict[str, list[Course]], model: ModelFile) -> None:
    """Ends with an error where there is nothing to compare the model with."""
    if not any(len(one.judged) for several in courses.values() for one in several):
        names = ", ".join(output.name for output in model.outputs)
        raise RecordingError(
            f"no displacement {names} at a time at which the model has a prediction",
            expected="recorded displacement, or --touch-offs with what the probe found",
            where="recording",
            advice="name the column of the displacement in the machine file, or give --touch-offs FILE.csv",
        )
