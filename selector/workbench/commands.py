"""Which command line does the same as a page: words after ``selector``, and the text that a person copies."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from selector.controllers.writers.targets import TARGETS
from selector.readers import Overrides
from selector.selection import Options
from selector.study import DiagnoseSection
from selector.text_file import shell_word
from selector.workbench.study_folder import CYCLE

#: Folders of the answers in the study folder.
SELECTION, DIAGNOSIS, PREDICTION, SIMULATED = "selection", "diagnosis", "prediction", "simulated"
BALL_BAR, TAPS = "ballbar", "taps"


@dataclass(frozen=True)
class Prediction:
    """What is asked of a prediction; its duty cycle is a file of the study folder."""

    tests: tuple[Path, ...] = ()  #: None: all recordings that are used
    responses: tuple[str, ...] = ()
    method: str = "modal"
    operations: str = ""  #: As the options are typed
    tolerance: str = ""
    warm_up: str = ""
    order: bool = False
    nc: str = ""  #: Target of the NC subprogram; empty: none
    invert: str = ""
    readings: str = ""  #: Recording of a day, in the study folder; empty: none
    observe: tuple[str, ...] = ()


@dataclass(frozen=True)
class BallBar:
    """What is asked of measured circles."""

    files: tuple[str, ...] = ()  #: Names in the study folder; none: all
    radius: float | None = None
    feed: float | None = None
    axes: str = ""
    lead: str = ""
    reset_time: str = ""


@dataclass(frozen=True)
class Taps:
    """What is asked of a tap test."""

    files: tuple[str, ...] = ()  #: Names in the study folder; none: all
    model: str = ""  #: Model file of vibration
    point: str = ""  #: As the options are typed, apart by blanks
    axis: str = ""
    unit: str = ""


@dataclass(frozen=True)
class Simulation:
    """What is simulated: the kind, a model file, and parameters that are other than it says."""

    kind: str = "thermal"
    model: str = ""
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Export:
    """What is asked of an export."""

    model: str = ""  #: Model file in the study folder
    target: str = "c"  #: One of `selector.controllers.writers.targets.TARGETS`
    replayed: tuple[Path, ...] | None = None  #: Recordings that are run through the program; None: all that are used
    is_sign_verified: bool = False  #: Whether the sign test of the commissioning sheet was passed
    tested: str = ""  #: Digits of the equations SHA-256 of the program that passed it; empty: nobody said
    #: clamp_um and slew_um_per_s: Output → largest correction, and fastest change of it; none: what the model says, or
    #: the export decides
    clamp_um: Mapping[str, float] = field(default_factory=dict)
    slew_um_per_s: Mapping[str, float] = field(default_factory=dict)
    margin: float = 0.0  #: How far beyond their recorded range sensors are followed [% of its width]
    inverted: tuple[str, ...] = ()  #: Outputs whose axis the control counts the other way

    def of(self, outputs: Sequence[str]) -> "Export":
        """What is asked of these outputs; another model has others."""
        return replace(
            self,
            clamp_um={name: self.clamp_um[name] for name in outputs if name in self.clamp_um},
            slew_um_per_s={name: self.slew_um_per_s[name] for name in outputs if name in self.slew_um_per_s},
            inverted=tuple(name for name in outputs if name in self.inverted),
        )

    @property
    def folder(self) -> str:
        """Folder of the files in the study folder."""
        return f"export-{self.target}"


_READING = tuple(field.name for field in fields(Overrides) if field.name not in ("units", "roles", "partial", "needed"))
_FLAGS = ("interactions", "memory", "absolute_similarity", "ridge")
_VALUES = ("max_sensors", "grouping", "degree", "reference", "tolerance", "seed", "formula", "within", "target")


def option_of(name: str) -> str:
    """The option of the command line that is called like a field."""
    return f"--{name.strip('_').replace('_', '-')}"


def source_arguments(
    folder: Path, paths: Sequence[Path], machine: Path | None, overrides: Overrides
) -> tuple[str, ...]:
    """The recordings, and how they are read; paths in `folder` are told from there."""
    return (*(told_path(folder, path) for path in paths), *_reading_words(folder, machine, overrides))


def _each(option: str, values: Iterable[str]) -> list[str]:
    """The option before each of its values."""
    return [word for value in values for word in (option, value)]


def _of_names(option: str, values: Mapping[str, Any], form: str = "") -> list[str]:
    return _each(option, (f"{name}={value:{form}}" for name, value in values.items()))


def _changed(asked: Any, default: Any, names: Sequence[str]) -> list[str]:
    """Options that are called like these fields, where their values are not the defaults."""
    now = {name: getattr(asked, name) for name in names if getattr(asked, name) != getattr(default, name)}
    told = {name: repr(value) if isinstance(value, float) else str(value) for name, value in now.items()}
    return [word for name, value in told.items() for word in (option_of(name), value)]


def _reading_words(folder: Path, machine: Path | None, overrides: Overrides) -> list[str]:
    words = [] if machine is None else ["--machine", told_path(folder, machine)]
    for name in _READING:
        value = getattr(overrides, name)
        if value is not None:
            words += [option_of(name), f"{value:.12g}" if isinstance(value, float) else str(value)]
    return words + _of_names("--unit", overrides.units) + _of_names("--role", overrides.roles)


def option_arguments(options: Options) -> tuple[str, ...]:
    """What is asked of a selection; what is left at its default is not said."""
    levels = options.levels or ()
    words = [*_each("--response", options.responses), *_each("--lambda", map(repr, levels))]
    words += ["--rounds", str(options.rounds)] if options.rounds > max(1, len(levels)) else []
    words += _changed(options, Options(), _VALUES)
    words += [option_of(name) for name in _FLAGS if getattr(options, name)]
    words += [*_each("--must", options.must), *_each("--never", options.never)]
    return (*words, *_of_names("--cost", options.cost, "g"), *_of_names("--condition", options.conditions))


def diagnosis_arguments(asked: DiagnoseSection) -> tuple[str, ...]:
    """What is asked of a diagnosis; what is left at its default is not said."""
    words = _each("--simulation", asked.simulation) + ([] if asked.model is None else ["--model", asked.model])
    words += _each("--response", asked.responses)
    return (*words, *_changed(asked, DiagnoseSection(), ("simulation_time_unit", "holdout", "seed", "false_alarm")))


def export_command(folder: Path, asked: Export, machine: Path | None, overrides: Overrides) -> tuple[str, ...]:
    """`selector export`, which reads as all other commands do; paths in `folder` are told from there."""
    words = ["export", asked.model, "--for", asked.target, "--out", asked.folder]
    words += _each("--replay", (told_path(folder, path) for path in asked.replayed or ()))
    words += _reading_words(folder, machine, overrides) if asked.replayed else []
    # a control without a guard refuses limits
    if TARGETS[asked.target].has_guard:
        words += _of_names("--clamp", asked.clamp_um, ".12g") + _of_names("--slew", asked.slew_um_per_s, ".12g")
        words += _changed(asked, Export(), ["margin"])
    words += _each("--invert", asked.inverted)
    if asked.is_sign_verified:
        words += ["--sign-verified", *(["--tested", asked.tested] if asked.tested else [])]
    return tuple(words)


def prediction_command(
    folder: Path, asked: Prediction, used: Sequence[Path], machine: Path | None, overrides: Overrides
) -> tuple[str, ...]:
    """`selector predict` for the duty cycle of the study folder."""
    others = [path for path in used if str(path) != asked.readings]
    tests = [path for path in others if path in asked.tests] or others
    words = ["predict", *source_arguments(folder, tests, machine, overrides), "--cycle", CYCLE]
    words += [
        *_each("--response", asked.responses),
        *_changed(asked, Prediction(), ("method", "operations", "tolerance", "warm_up")),
        *["--order"] * asked.order,
    ]
    if asked.nc:
        words += ["--nc", asked.nc, *_each("--invert", asked.invert.split())]
    if asked.readings:
        words += ["--readings", told_path(folder, Path(asked.readings)), *_each("--observe", asked.observe)]
    return (*words, "--out", PREDICTION)


def ball_bar_command(folder: Path, asked: BallBar, files: Sequence[Path]) -> tuple[str, ...]:
    """`selector ballbar` of these files."""
    words = ["ballbar", *(told_path(folder, path) for path in files)]
    words += _changed(asked, BallBar(), ("radius", "feed", "axes"))
    words += [*_each("--lead", asked.lead.split()), *_each("--reset-time", asked.reset_time.split())]
    return (*words, "--out", BALL_BAR)


def taps_command(folder: Path, asked: Taps, files: Sequence[Path]) -> tuple[str, ...]:
    """`selector taps` of these files."""
    words = ["taps", *(told_path(folder, path) for path in (Path(asked.model), *files))]
    words += [*_each("--point", asked.point.split()), *_changed(asked, Taps(), ("axis", "unit"))]
    return (*words, "--out", TAPS)


def command_words(command: Sequence[str]) -> list[str]:
    """The command as a person types it in the shell of this system, word by word, ``selector`` first."""
    return [shell_word(word) for word in ("selector", *command)]


def command_text(command: Sequence[str]) -> str:
    """The command as one line."""
    return " ".join(command_words(command))


def told_path(folder: Path, path: Path) -> str:
    """A path as a command in `folder` names it."""
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)
