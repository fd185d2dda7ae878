"""A kind of simulation: what can be done with its model files, whatever the physics; and which kinds there are.

The command line, `diagnose --model` and the documentation go through `simulation_kinds`. A kind of one's own derives
from `SimulationKind` and is made known by `selector.telling.simulated.register`, with the way its results are told.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

if TYPE_CHECKING:
    # names alone are needed for --help
    from selector.findings import Finding
    from selector.physics.channel_differences import ChannelDifference
    from selector.physics.model_fields import Parameter
    from selector.physics.model_text import ModelFamily
    from selector.recording import Recording
    from selector.types import Vector

Progress = Callable[[int, int, str], None]
#: Key of a model file → (time_s, values in the unit of its role) of the column beside it that it refers to.
Columns = Mapping[str, tuple["Vector", "Vector"]]


def unheard(step: int, total: int, text: str) -> None:
    """Progress that nobody looks at."""


@dataclass(frozen=True)
class RunSettings:
    """How a model is run."""

    columns: Columns = field(default_factory=dict)
    seed: int | None = None  #: Of the noise; None: that of the file, and none where recordings drive
    asked: Mapping[str, Any] = field(default_factory=dict)  #: The `options` of the kind
    progress: Progress = unheard


class Model(Protocol):
    """What a model file describes, ready to be run."""

    @property
    def name(self) -> str:
        """What the file calls it."""

    @property
    def file(self) -> Any:
        """The content of the file."""

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Every number of its physics that could be fitted again."""

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same with other values of some parameters."""


@dataclass(frozen=True, eq=False)
class Simulated:
    """What a model did, in its own run or driven by recorded ones."""

    model: Any  #: The `Model`
    recording: Recording  #: What a measurement would hold
    findings: tuple[Finding, ...]
    details: Any = None  #: What only this kind of simulation has
    inputs: tuple[str, ...] = ()  #: Channels that act on the model; the others are its answer
    differences: tuple[ChannelDifference, ...] | None = None  #: From the recordings that drove it; None if none did
    #: What else the JSON says of each run; default: what the provenance of the recording does
    said_of_runs: Mapping[str, Mapping[str, Any]] | None = None

    @property
    def seed(self) -> int | None:
        """Of the noise; None if there was none."""
        told = self.recording.provenance["simulated"]
        return told["seed"] if told.get("instruments", True) else None

    @property
    def per_run(self) -> Mapping[str, Mapping[str, Any]]:
        """What else the JSON says of each run."""
        return self.recording.provenance["runs"] if self.said_of_runs is None else self.said_of_runs


@dataclass(frozen=True, eq=False)
class DutyCycle:
    """A duty cycle from a file: speeds from these times on; the last row is the end."""

    path: Path
    time_s: Vector  #: (n_rows,): [s]
    speed_rpm: Vector  #: (n_rows,): [r/min]


@dataclass(frozen=True)
class Option:
    """An option that only this kind of simulation has, for the command line."""

    name: str
    kind: type  #: bool, float, or `DutyCycle`
    metavar: str
    help: str


class SimulationKind(ABC):
    """One kind of simulation. Everything heavy is imported by the methods: the names alone stand in `--help`."""

    name: ClassVar[str]  #: The word behind `selector simulate`
    file_kinds: ClassVar[tuple[str, ...]]  #: ``kind`` of the model files that it reads
    about: ClassVar[str]  #: What it does, for `--help`; paragraphs are parted by empty lines
    model_help: ClassVar[str]
    report_help: ClassVar[str]
    out_help: ClassVar[str] = "Recording to write; with --inputs a folder, one file a run."
    seed_help: ClassVar[str] = "Of the noise. Default: that of the model file."
    why_folder: ClassVar[str] = ""  #: Why several runs of its own are several files
    options: ClassVar[tuple[Option, ...]] = ()
    column_section: ClassVar[str] = ""  #: What stands before the keys of columns in the file
    family_module: ClassVar[str] = ""  #: Module with the `FAMILY` of its model files

    def family(self) -> ModelFamily[Any]:
        """How its model files are read."""
        family: ModelFamily[Any] = import_module(self.family_module).FAMILY
        return family

    def read(self, path: Path) -> Any:
        """The content of a model file."""
        return self.family().read(path)

    def checked(self, values: Mapping[str, Any], *, where: str) -> Any:
        """The same from plain values; errors name `where`."""
        return self.family().checked(values, where=where)

    def columns_needed(self, file: Any) -> Mapping[str, Any]:
        """Key → column of a recording beside the file that it refers to."""
        return self.family().columns_needed(file)

    def column_roles(self) -> Mapping[str, str]:
        """Key of such a column → the role of its values."""
        return self.family().column_roles

    def sections(self, file: Any) -> Sequence[str]:
        """Sections that errors may be about without saying that they are of the file."""
        return ()

    @abstractmethod
    def model(self, file: Any, columns: Columns) -> Model:
        """What the file describes."""

    def runs(self, model: Any) -> Sequence[str]:
        """Names of its own runs, the `runs` of the model; without any, one that is called after the file."""
        return tuple(getattr(model, "runs", ("",)))

    def require_options(  # noqa: B027
        self, file: Any, asked: Mapping[str, Any], *, driven: bool, report: bool
    ) -> None:
        """Refuses options that do not go together, before anything long is begun."""

    @abstractmethod
    def planned(self, model: Any, run: str, how: RunSettings) -> Simulated:
        """What the file describes; `run` is the name of the first run."""

    @abstractmethod
    def driven(self, model: Any, recording: Recording, how: RunSettings) -> Simulated:
        """The runs of a recording, at its times, as the model has them; findings are those of the driving alone."""

    def quiet(self, file: Any) -> Any:
        """The file without noise and rounding, where a driven model would have them without a seed, too."""
        return file

    def roles_asked(self, file: Any, recording: Recording, unread: Sequence[str]) -> Mapping[str, str]:
        """Column → role that recordings have to be read with for this model, where a guess says otherwise."""
        return {}

    def findings_before(self, model: Any) -> tuple[Finding, ...]:
        """What is odd about a model, whatever it does."""
        return ()

    def findings_after(self, done: Simulated, summary: Any) -> tuple[Finding, ...]:
        """What is odd about what it did, beside what `planned` and `driven` say: the `findings` of its summary."""
        return tuple(getattr(summary, "findings", ()))

    def summary(self, done: Simulated, progress: Progress) -> Any:
        """The numbers that are told of a simulation."""
        return None


_registered: dict[str, SimulationKind] = {}


def own_kinds() -> dict[str, SimulationKind]:
    """Name → every kind of simulation that is shipped."""
    from selector.physics.drive.kind import DriveKind
    from selector.physics.gauging.kind import GaugingKind
    from selector.physics.thermal.kind import ThermalKind
    from selector.physics.vibration.kind import VibrationKind

    own = (ThermalKind(), DriveKind(), VibrationKind(), GaugingKind())
    return {kind.name: kind for kind in own}


def simulation_kinds() -> dict[str, SimulationKind]:
    """Name → every kind of simulation, those that were registered last."""
    return own_kinds() | _registered


def register_kind(kind: SimulationKind) -> None:
    """Makes a kind known under its name."""
    _registered[kind.name] = kind


def kind_of_file(word: str) -> SimulationKind | None:
    """The kind of simulation that reads model files with this word as ``kind``; None if none does."""
    return next((kind for kind in simulation_kinds().values() if word in kind.file_kinds), None)
