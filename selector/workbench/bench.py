"""What is on the bench: the state of one study on the server, and what can be done to it.

Pages read it and change it; none of them keeps a state of its own. It may be used by several threads.
"""

import dataclasses
import json
import threading
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from functools import partialmethod
from pathlib import Path
from typing import Any

from selector.atomic_file import write_whole
from selector.physics.model_fields import model_file_text
from selector.physics.model_text import plain_values, word_of_kind
from selector.physics.simulation_kind import kind_of_file
from selector.physics.thermal.field.mesh_file import FORMATS
from selector.readers import Machine, Overrides, guessed_clock, write_machine_file
from selector.shipped import shipped_models
from selector.study import DiagnoseSection, diagnose_section
from selector.telling.account import Account
from selector.workbench import commands
from selector.workbench.cycle import Cycle, Step, cycle_in, write_cycle
from selector.workbench.jobs import Job, Jobs
from selector.workbench.live import Latest, Live
from selector.workbench.readable import Inspection, Loaded, as_far_as_readable, inspected, placed
from selector.workbench.saved_study import Asked, asked_in, save
from selector.workbench.study_folder import (
    CYCLE,
    MACHINE,
    MACHINE_BEFORE,
    MODELS,
    RECORDINGS,
    SIMULATION,
    files_in,
    put_away,
)

#: What files beside recordings are that are no simulated runs: a model that a diagnosis runs itself, and its mesh.
MODEL_ENDINGS = dict.fromkeys((".toml", ".fmu"), "a model, run by the diagnosis")
BESIDE = MODEL_ENDINGS | dict.fromkeys(FORMATS, "the mesh of the model")

_COMPARED = {"simulation", "model"}


class Bench:
    """The state of one study: its folder, with all that is in it, and recordings elsewhere, read where they are.

    Raises StudyError: the study file of the folder cannot be used.
    """

    def __init__(self, folder: Path, files: Sequence[Path] = (), machine: Path | None = None) -> None:
        self.folder = folder
        self.jobs = Jobs(folder, on_end=lambda _: self.changed())
        self._lock = threading.RLock()
        #: Grows with every change of what pages show, jobs' progress excepted
        self.revision = 0
        self._asked = 0
        self._started = -1, 0
        #: Whether recordings are being read; `inspection` is that of before
        self.is_reading = False
        self._has_reader = False
        saved = asked_in(folder)
        asked = saved or Asked()
        named = [file.resolve() for file in files]
        there = dict.fromkeys([*asked.runs, *named, *files_in(folder / RECORDINGS)])
        self._loaded = [Loaded(path, saved is None or path in asked.runs or path in named) for path in there]
        own = folder / MACHINE
        self.machine = machine.resolve() if machine is not None else asked.machine or (own if own.is_file() else None)
        self.overrides = asked.overrides  #: What the user decides instead of the reader
        self.options = asked.options  #: What is asked of a selection
        self._diagnosis = asked.diagnosis
        self.export = asked.export  #: What is asked of an export
        self.inspection = Inspection()  #: What was read, and found
        self.live = Live(self.changed)
        self.prediction, self.simulation = commands.Prediction(), commands.Simulation()
        self.ball_bar = commands.BallBar()  #: What is asked of measured circles
        self.taps = commands.Taps()  #: What is asked of a tap test
        self.simulated_live: Latest[Account] = Latest(self.changed)  #: Of a simulated machine
        place = folder / CYCLE
        self.cycle = cycle_in(place) if place.is_file() else Cycle()  #: The duty cycle of a prediction
        self._results: dict[Path, tuple[float, dict[str, Any]]] = {}

    @property
    def loaded(self) -> tuple[Loaded, ...]:
        """The recordings."""
        with self._lock:
            return tuple(self._loaded)

    @property
    def used(self) -> tuple[Path, ...]:
        """The recordings that are used."""
        return tuple(one.path for one in self.loaded if one.is_used)

    def used_as_options(self) -> list[dict[str, str]]:
        """The recordings that are used, as a menu offers them."""
        return [{"label": path.name, "value": str(path)} for path in self.used]

    def channels(self, *roles: str) -> list[str]:
        """Names of the channels that were read, of these roles if any."""
        recording = None if self.inspection.reading is None else self.inspection.reading.recording
        return [] if recording is None else list(recording.with_role(*roles) if roles else recording.names)

    def models(self, kind: str) -> dict[str, str]:
        """Path → name of every model file that may be of this kind: shipped ones, and those of the study folder."""
        own = [path for path in files_in(self.folder / MODELS) if path.suffix == ".toml" and _may_be(path, kind)]
        return {str(path): path.stem for path in (*shipped_models(kind), *own)}

    @property
    def simulated(self) -> tuple[Path, ...]:
        """The simulated runs in the study folder."""
        return files_in(self.folder / SIMULATION)

    @property
    def diagnosis(self) -> DiagnoseSection:
        """What is asked of a diagnosis; what is compared with is what the study folder holds: runs, or one model."""
        files = self.simulated
        models = [path.name for path in files if path.suffix.lower() in MODEL_ENDINGS]
        if len(models) == 1 and all(path.suffix.lower() in BESIDE for path in files):
            return self._diagnosis.model_copy(update={"model": f"{SIMULATION}/{models[0]}"})
        return self._diagnosis.model_copy(update={"simulation": (SIMULATION,) if files else ()})

    def add(self, *paths: Path, machine: Path | None = None) -> None:
        """Takes recordings up, with a machine file if it is given, and reads all of them."""
        with self._lock:
            there = {one.path for one in self._loaded}
            self._loaded += [Loaded(path) for path in paths if path not in there]
            self.machine = machine or self.machine
        self.read()

    def use(self, paths: Iterable[Path]) -> None:
        """These recordings are used and no others; all of them are read, if that is any different."""
        used = set(paths)
        with self._lock:
            if used == set(self.used):
                return
            # one that was refused and is not tried again stays refused
            self._loaded = [
                Loaded(one.path) if one.path in used else dataclasses.replace(one, is_used=False)
                for one in self._loaded
            ]
        self.read()

    def remove(self, path: Path) -> None:
        """Lets a recording go; a file in the study folder is put away, one elsewhere stays where it is.

        Raises OptionError: the file cannot be moved.
        """
        with self._lock:
            if path.parent == self.folder / RECORDINGS:
                put_away(self.folder, path)
            is_used = path in self.used
            self._loaded = [one for one in self._loaded if one.path != path]
            self.changed()
        if is_used:
            self.read()

    def choose_diagnosis(self, **changes: Any) -> bool:
        """Changes options of the diagnosis; whether any is different now.

        Raises OptionError: an option has a value that cannot be used.
        """
        with self._lock:
            asked = diagnose_section(self.folder, **{**self._diagnosis.model_dump(exclude=_COMPARED), **changes})
            return self._taken("_diagnosis", asked)

    def _choose(self, what: str, **changes: Any) -> bool:
        with self._lock:
            return self._taken(what, dataclasses.replace(getattr(self, what), **changes))

    #: As `choose_diagnosis`: what is asked of a selection, an export, a prediction, measured circles, a tap test
    choose = partialmethod(_choose, "options")
    choose_export = partialmethod(_choose, "export")
    choose_prediction = partialmethod(_choose, "prediction")
    choose_ball_bar = partialmethod(_choose, "ball_bar")
    choose_taps = partialmethod(_choose, "taps")

    def choose_simulation(self, **changes: Any) -> bool:
        """Changes what is simulated; whether anything is different now. Another machine has other parameters."""
        with self._lock:
            asked = dataclasses.replace(self.simulation, **changes)
            if (asked.kind, asked.model) != (self.simulation.kind, self.simulation.model):
                asked = dataclasses.replace(asked, values={})
            return self._taken("simulation", asked)

    def choose_cycle(self, steps: Iterable[Step], hall: Mapping[str, Any] | None = None) -> bool:
        """Takes a duty cycle, which is written into the study folder; whether it is another one."""
        with self._lock:
            cycle = Cycle(tuple(steps), self.cycle.hall if hall is None else hall)
            is_other = self._taken("cycle", cycle)
            if is_other or not (self.folder / CYCLE).is_file():
                write_cycle(cycle, self.folder / CYCLE)
            return is_other

    def write_model(self, relative: str, file: Any) -> None:
        """Writes a model file that was changed into the study folder, whole or not at all."""
        path = self.folder / relative
        path.parent.mkdir(exist_ok=True)
        if mesh := getattr(file, "mesh", None):
            write_whole(path.with_name(Path(mesh.file).name), Path(mesh.file).read_bytes())
        write_whole(path, model_bytes(file))

    def _taken(self, name: str, asked: object) -> bool:
        if asked == getattr(self, name):
            return False
        setattr(self, name, asked)
        self.changed()
        return True

    def read_as(self, overrides: Overrides) -> None:
        """Reads the recordings again, with other decisions about encoding, separator, clock and the like.

        Those that were refused are tried again.
        """
        with self._lock:
            self.overrides = overrides
            self._loaded = [one if one.problem is None else Loaded(one.path) for one in self._loaded]
        self.read()

    def correct(self, machine: Machine) -> None:
        """Reads the recordings with this machine file; only if that succeeds it is written into the study folder.

        Raises InputError: the recordings cannot be read like that; nothing has changed.
        """
        with self._lock:
            self._asked += 1
            self.is_reading = True
            number = self._asked
        try:
            reading, findings = inspected(self.used, machine, self.overrides)
            own = self.folder / MACHINE
            if own.exists():
                own.replace(own.with_name(MACHINE_BEFORE))
            write_machine_file(machine, own, guessed_clock=guessed_clock(reading))
            with self._lock:
                self.machine = own
                self._publish(Inspection(0, dataclasses.replace(reading, machine_file=str(own)), findings))
        finally:
            with self._lock:
                self.is_reading = self._asked != number
                self.changed()

    def place(self, places_m: Mapping[str, tuple[float, float, float]]) -> None:
        """Writes where sensors sit into the machine file of the study folder; no recording is read again.

        Raises InputError: there is no such channel, or the file cannot be written.
        """
        with self._lock:
            own = self.folder / MACHINE
            reading = placed(self.inspection.reading, places_m, own)
            self.machine = own
            self.inspection = dataclasses.replace(self.inspection, reading=reading)
            self.changed()

    def read(self) -> None:
        """Reads the recordings in use, in a thread of its own; what an earlier reading finds is forgotten."""
        with self._lock:
            self._asked += 1
            self.is_reading = True
            self.changed()
            if not self._has_reader:
                self._has_reader = True
                threading.Thread(target=self._read, name="selector-read", daemon=True).start()

    def _read(self) -> None:
        """Reads until nothing else was asked meanwhile: one reading at a time, however many files arrive."""
        while True:
            with self._lock:
                number = self._asked
            loaded, inspection = as_far_as_readable(self.loaded, self.machine, self.overrides)
            with self._lock:
                if number != self._asked:
                    continue
                self._loaded = [loaded.get(one.path, one) for one in self._loaded]
                self._publish(inspection)
                self.is_reading = self._has_reader = False
                return

    def _publish(self, inspection: Inspection) -> None:
        self.inspection = dataclasses.replace(inspection, number=self.inspection.number + 1)
        self.changed()

    def source_arguments(self) -> tuple[str, ...]:
        """The recordings in use, as the words of a command line."""
        return commands.source_arguments(self.folder, self.used, self.machine, self.overrides)

    def save(self) -> Path:
        """Writes the study file of the study folder, see `saved_study.save`."""
        asked = Asked(self.used, self.machine, self.overrides, self.options, self.diagnosis, self.export)
        return save(self.folder, asked, self.inspection.reading, self.simulated)

    def start(self, title: str, command: Sequence[str], out: Path | None = None) -> Job:
        """Runs a command, the words after ``selector``, in the study folder; `out` is the folder it writes.

        Started again while it waits or runs and nothing has changed on the bench, as by a double click, it is that job.
        """
        with self._lock:
            number, revision = self._started
            last = self.jobs.all[number] if number >= 0 else None
            is_same = last is not None and not last.is_over and last.command == tuple(command)
            if last is None or not is_same or revision != self.revision:
                last = self.jobs.start(title, command, out)
                self._started = last.number, self.revision
            return last

    def result(self, relative: str) -> dict[str, Any] | None:
        """A JSON file of the study folder, e.g. ``"selection/selection.json"``; None: it is not there."""
        path = self.folder / relative
        try:
            stamp = path.stat().st_mtime
            known = self._results.get(path)
            if known is None or known[0] != stamp:
                known = stamp, json.loads(path.read_text(encoding="utf-8"))
                self._results[path] = known
            return known[1]
        except (OSError, ValueError):
            return None

    def changed(self) -> None:
        """Something that pages show is different now, e.g. a file of the study folder."""
        with self._lock:
            self.revision += 1


def model_bytes(file: Any) -> bytes:
    """A model file as it is written."""
    return model_file_text(plain_values(file)).encode("utf-8")


def _may_be(model: Path, kind: str) -> bool:
    """Whether a model file says that it is of this kind, or nothing that a reader of another kind knows."""
    try:
        word = word_of_kind(model)
    except (OSError, tomllib.TOMLDecodeError, RecursionError):
        return True
    other = kind_of_file(word) if isinstance(word, str) else None
    return other is None or other.name == kind
