"""The study of one machine of a fleet: recordings and options in, an answer out, whatever goes wrong."""

import hashlib
import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import not_
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from threadpoolctl import threadpool_limits

from selector import __version__
from selector.atomic_file import is_full, write_whole
from selector.controllers.from_selection import model_file_of
from selector.controllers.model_file import write_model
from selector.errors import CancelledError, InputError, ReadError, SelectorError, StorageError, StudyError
from selector.fleet.places import local_recordings
from selector.json_text import json_text
from selector.readers.files import recording_files
from selector.selection import select
from selector.study.applied import proven_on_control
from selector.study.asked import options_of, overrides_of
from selector.study.data import study_data
from selector.study.inputs import sha256_of
from selector.study.study_file import Study

OVERDUE = "no answer within {:g} s: raise time_limit_s, or offer fewer sensors and terms"
DONE_FILE = "done.json"  #: Stands in the folder of an answer when all others do; without it the study is done again.


class Document(BaseModel):
    """A part of what a command of a fleet prints, or keeps."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class Refit(Document):
    """Whether a new model took the place of the one in use."""

    promoted: bool
    because: str
    challenger: str | None = None  #: Key of the new model's answer; in use though not promoted: there was no comparison
    runs: tuple[str, ...] = ()  #: On which both were compared
    #: champion_rmse_um and challenger_rmse_um: Response → error in these runs
    champion_rmse_um: dict[str, float] = Field(default_factory=dict)
    challenger_rmse_um: dict[str, float] = Field(default_factory=dict)
    #: Share of the error that the new model takes away at least, all responses together; below 0: it may be worse
    least_fall: float | None = None


class Answer(Document):
    """What came of one machine."""

    status: Literal["done", "reused", "failed", "missing"]
    error: str | None = None  #: Why it failed, or that the machine was not found
    #: Name of the folder of its answer; of a machine that failed or is missing, that of the model in use, if there is
    #: one. None if its recordings could not be read
    key: Annotated[str, Field(pattern=r"^\w+$")] | None = None
    sensors: tuple[str, ...] = ()  #: Those that were chosen
    heldout_rmse_um: dict[str, float | None] = Field(default_factory=dict)  #: Response → error on unseen runs
    seconds: float = 0.0  #: That the study took, also when its answer is used again
    #: None, and not in the document: no new model was tried
    refit: Refit | None = Field(default=None, exclude_if=not_)
    #: SHA-256 of a recording on which the model in use was compared → key of the other model, or its own where it won;
    #: of one that was there, and left over → nothing
    judged: dict[str, str] = Field(default_factory=dict, exclude_if=not_)
    is_unkept: bool = Field(default=False, exclude=True)  #: Nothing can be kept: that is no fault of the machine

    @property
    def in_short(self) -> str:
        """For a line of progress."""
        told = self.error or f"{', '.join(self.sensors)}, {self.seconds:.1f} s"
        return f"{self.status}: {told}" + ("" if self.refit is None else f"; {self.outcome}: {self.refit.because}")

    @property
    def outcome(self) -> str:
        """Which model is in use, where it was asked: ``promoted``, ``kept``, or ``anew`` without a comparison."""
        if self.refit is None:
            return ""
        return "promoted" if self.refit.promoted else "anew" if self.refit.challenger == self.key else "kept"


class Done(Document):
    """``done.json``: what an answer is in short, and the SHA-256 of its files."""

    schema_: Annotated[Literal["selector.fleet-study/1"], Field(alias="schema")] = "selector.fleet-study/1"
    sensors: tuple[str, ...]
    heldout_rmse_um: dict[str, float | None]
    seconds: float
    files: dict[str, str]
    question: str | None = None  #: See `question_of`


@dataclass(frozen=True)
class Task:
    """The study of one machine, as it goes to a process or to another computer."""

    name: str
    study: Study
    results: Path
    time_limit_s: float
    version: str = __version__

    def answered(self) -> Answer:
        """See `answered`."""
        return answered(self)


def answered(task: Task) -> Answer:
    """The answer to a task; an error is one, too. What was answered before, of the same bytes, is not done again.

    Sums are added in one thread: their last digits must not depend on the number of processors.
    """
    start = time.monotonic()
    threadpool_limits(1)
    key: list[str] = []
    try:
        if task.version != __version__:
            raise StudyError(
                f"selector {__version__} on this worker",
                expected=f"selector {task.version}, as where the fleet was started",
                where=f"machine {task.name}",
                advice="install the same version of selector and numpy everywhere",
            )
        return _answered(task, start, key.append)
    except Exception as error:
        said, is_unkept = error_text(error), is_full(error) or isinstance(error, StorageError)
    seconds = round(time.monotonic() - start, 3)
    return Answer(status="failed", error=said, key=key[0] if key else None, seconds=seconds, is_unkept=is_unkept)


def error_text(error: Exception) -> str:
    """What is told of an error that must not stop the other machines."""
    if isinstance(error, MemoryError):
        return f"memory ran out ({error}): use fewer processes, or store the recordings as Parquet"
    is_known = isinstance(error, SelectorError | OSError)
    return str(error) if is_known else f"a defect of the program, not of the data: {type(error).__name__}: {error}"


def _answered(task: Task, start: float, tell_key: Callable[[str], None]) -> Answer:
    study = task.study
    with local_recordings(study.recordings) as (named, machine):
        found = recording_files(runs := list(named))
        machine = machine or found.machine
        hashes = {file: sha256_of(file) for file in (*found.files, *([machine] if machine else []))}
        machine_sha256 = None if machine is None else hashes[machine]
        key = key_of(study, [(name, hashes[file]) for file, name in _names(found.files)], machine_sha256)
        tell_key(key)
        if (known := known_answer(task.results / key)) is not None:
            return _answer("reused", key, known)

        def in_time(_doing: str = "", _share: float = 0.0) -> None:
            if time.monotonic() - start > task.time_limit_s:
                raise CancelledError(OVERDUE.format(task.time_limit_s))

        options = options_of(study, where=f"machine {task.name}")
        data = study_data(runs, machine, overrides_of(study))
        in_time()
        if any(hashes.get(Path(file)) != sha256 for file, sha256 in data.files):
            raise ReadError(
                "a recording that changed while it was read",
                expected="recordings that nobody writes to",
                where=", ".join(study.recordings.runs)[:300],
                advice="run the fleet again when the logger is done",
            )
        selection = select(data.source, options, findings=data.findings, provenance=data.provenance, progress=in_time)
        selection = proven_on_control(selection, data)
        place = task.results / key
        write_whole(place / "selection.json", (json_text(selection.as_dict()) + "\n").encode("utf-8"))
        write_model(model_file_of(selection, data.source.channels, source=data.source), place / "model.json")
        done = Done(
            sensors=selection.chosen,
            heldout_rmse_um={name: selection.proof.rmse_um(name) for name in selection.models},
            seconds=round(time.monotonic() - start, 3),
            files={name: sha256_of(place / name) for name in ("selection.json", "model.json")},
            question=question_of(study),
        )
        write_whole(place / DONE_FILE, (json_text(done.model_dump(by_alias=True)) + "\n").encode("utf-8"))
        return _answer("done", key, done)


def key_of(study: Study, recordings: Sequence[tuple[str, str]], machine_sha256: str | None) -> str:
    """SHA-256 of all that an answer depends on: name and SHA-256 of every recording, machine file, options, version."""
    content = {
        "version": __version__,
        "recordings": [list(one) for one in recordings],
        "machine": machine_sha256,
        "reading": study.reading.model_dump(mode="json"),
        "select": None if study.select is None else study.select.model_dump(mode="json", by_alias=True),
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode("ascii")).hexdigest()


def question_of(study: Study) -> str:
    """SHA-256 of the options that a study says otherwise than they are by default."""
    select = study.select
    content = None if select is None else select.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode("ascii")).hexdigest()


def _names(files: Sequence[Path]) -> list[tuple[Path, str]]:
    """What runs are called by: the file, or with its folder where two have one name."""
    counts = Counter(file.stem for file in files)
    return [(file, file.name if counts[file.stem] == 1 else f"{file.parent.name}/{file.name}") for file in files]


def known_answer(place: Path) -> Done | None:
    """The answer in a folder, if all of it is there as it was written."""
    done = done_of(place)
    try:
        whole = done is not None and all(sha256_of(place / name) == sha256 for name, sha256 in done.files.items())
    except (OSError, InputError):
        return None
    return done if whole else None


def done_of(place: Path) -> Done | None:
    """What ``done.json`` of a folder says."""
    try:
        return Done.model_validate_json((place / DONE_FILE).read_bytes())
    except (OSError, ValidationError):
        return None


def _answer(status: Literal["done", "reused"], key: str, done: Done) -> Answer:
    return Answer(status=status, key=key, **done.model_dump(include={"sensors", "heldout_rmse_um", "seconds"}))
