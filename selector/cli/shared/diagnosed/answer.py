"""What a diagnosis is asked, what it reads, and its answer with all that is written beside it."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.cli.shared.diagnosed.asked import Asked
    from selector.cli.shared.source import Source
    from selector.controllers.model_file import ModelFile
    from selector.diagnosis.answer import Diagnosis
    from selector.diagnosis.comparison import Comparison
    from selector.diagnosis.open_model.modelled import Improved
    from selector.readers import Reading


@dataclass(frozen=True)
class Answer:
    """A diagnosis, what is written beside it, and what it was made from; `told` is its provenance."""

    found: Diagnosis
    improved: Improved | None
    correction: ModelFile | None
    recorded: Reading
    simulated: Reading | None
    told: dict[str, Any]


def answered(source: Source, asked: Asked, progress: Callable[[str, float], None]) -> Answer:
    """Read, compare and diagnose.

    Raises InputError: a file cannot be read, or what is asked cannot be answered.
    """
    progress("reading", 0.0)
    say = _in_steps(progress)
    improved, simulated = None, None
    recorded = source.reading()
    if asked.model is not None:
        found, improved = _of_model(recorded, asked.model, asked, say)
    else:
        from selector.diagnosis.workflow import diagnosis

        comparison, simulated = _compared(source, recorded, asked)
        found = diagnosis(comparison, seed=asked.seed, false_alarm=asked.false_alarm, progress=say)
    found, correction = correction_told(found, improved)
    options = {"holdout": asked.holdout, "false alarm": f"{asked.false_alarm:g}", "response": asked.responses}
    told = _provenance(recorded, simulated, asked.model, options)
    return Answer(found, improved, correction, recorded, simulated, told)


def _compared(source: Source, recorded: Reading, asked: Asked) -> tuple[Comparison, Reading]:
    """The recordings of a command line beside their simulation, and how that was read.

    Raises InputError: a file cannot be read, or the two cannot be compared.
    """
    from selector.cli.shared.simulation_inputs import not_simulated, simulated_reading
    from selector.diagnosis.matching.alignment import comparison_of
    from selector.readers.finding_table import CHANNELS_LACKING, COLUMNS_IGNORED
    from selector.study.material import without_folders

    if not asked.simulation:
        raise OptionError(
            "nothing to compare the recordings with",
            expected="simulated runs, named as the recorded ones",
            where="--simulation",
            advice="add --simulation PATH with a folder, or once for each file; or --model MODEL.toml",
        )
    simulated = simulated_reading(asked.simulation, recorded, source.overrides(), asked.simulation_time_unit)
    comparison = comparison_of(
        recorded.recording, simulated.recording, responses=asked.responses or None, holdout=asked.holdout
    )
    told = [dataclasses.replace(f, statement=f"Simulation: {f.statement}") for f in simulated.findings]
    said = [finding for finding in told if finding.id not in (COLUMNS_IGNORED, CHANNELS_LACKING)]
    if not asked.responses:
        said += not_simulated(recorded.recording, simulated.recording, comparison.responses)
    findings = without_folders((*recorded.findings, *said, *comparison.findings))
    return dataclasses.replace(comparison, findings=findings), simulated


def _of_model(
    reading: Reading, model: Path, asked: Asked, say: Callable[[int, int, str], None]
) -> tuple[Diagnosis, Improved | None]:
    """The diagnosis of a model that can be run again, and the improved one."""
    from selector.cli.shared.diagnosed.model import diagnosed_model
    from selector.study.material import without_folders

    done = diagnosed_model(model, reading.recording, asked, say)
    answer = dataclasses.replace(done.answer, findings=without_folders((*reading.findings, *done.answer.findings)))
    return answer, done.improved


def _provenance(
    recorded: Reading, simulated: Reading | None, model: Path | None, options: dict[str, Any]
) -> dict[str, Any]:
    """Files with their SHA-256, and what was asked, as the report shows them."""
    from selector.readers.roles.names import printable_name
    from selector.study.material import provenance_of

    told = provenance_of(recorded)
    if simulated is not None:
        told["runs"] |= {f"{run}, simulated": entry for run, entry in provenance_of(simulated)["runs"].items()}
    asked = {name: value for name, value in options.items() if value}
    if model is not None:
        asked["model"] = printable_name(model.name)
        asked["SHA-256 of the model"] = hashlib.sha256(model.read_bytes()).hexdigest()
    return told | asked


def _in_steps(progress: Callable[[str, float], None]) -> Callable[[int, int, str], None]:
    return lambda done, total, text: progress(text, 0.05 + 0.95 * done / max(total, 1))


def correction_told(found: Diagnosis, improved: Improved | None) -> tuple[Diagnosis, ModelFile | None]:
    """The answer with what is to be said of its correction, and the model file of that if a control can compute it."""
    from selector.controllers.from_diagnosis import correction_of

    if not is_corrected(found, improved):
        return found, None
    model, findings = correction_of(found)
    return dataclasses.replace(found, findings=(*found.findings, *findings)), model


def is_corrected(found: Diagnosis, improved: Improved | None) -> bool:
    """Whether physics is named that is not in an improved model."""
    from selector.diagnosis.answer import physics_of

    return bool(physics_of(found)) and (improved is None or bool(improved.not_in_it))
