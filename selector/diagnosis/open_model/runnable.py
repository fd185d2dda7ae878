"""What can be run again with other parameters: own model files, Python functions, FMUs; at the recordings' times."""

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, Literal

import numpy as np
import pandas as pd

from selector.errors import InputError, OptionError, ReadError
from selector.findings import Finding
from selector.physics.model_fields import Parameter, model_file_text, put_at
from selector.physics.model_text import Key, plain_values
from selector.physics.simulation_kind import Columns, RunSettings, SimulationKind, simulation_kinds
from selector.recording import Recording

Mode = Literal["B", "C"]  #: B: a black box; C: one of our own models, with open equations

#: Sections with numbers that a control was set to, which nobody has to fit.
_KNOWN = ("servo", "sensing", "thresholds", "relay")
_INSEPARABLE = "area_m2"  #: A film on an area cannot be told from a better one on a smaller area.


@dataclass(frozen=True, eq=False)
class OwnModel:
    """A model file of ours, driven by recorded runs (mode C)."""

    kind: str  #: One of `simulation_kinds`
    file: Any  #: Its content, as the `model_file` module of its physics has read it
    recording: Recording  #: The runs that drive it
    columns: Columns = field(default_factory=dict)  #: Values of the columns of files beside it that it refers to
    step_s: float | None = None  #: Longest internal step of a network or field of heat [s]; default: that of its file
    mode: ClassVar[Mode] = "C"

    @property
    def name(self) -> str:
        """What the file calls it."""
        return str(self.file.model.name)

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """The numbers of the file, those that are switched off included, see `parameters` of its physics."""
        return dict(self._model(self.file).parameters)

    @cached_property
    def refitted(self) -> tuple[str, ...]:
        """Numbers that the file says and that are not 0, but what a control was set to; and those with bounds."""
        said = _said(plain_values(self.file))
        return tuple(
            name
            for name, one in self.parameters.items()
            # of heat nothing is a parameter that the file does not say
            if name in self.bounded
            or (
                one.value != 0.0
                and (self.kind == "thermal" or name in said or ".parts." in name)
                and not _is_known(name)
            )
        )

    @property
    def bounded(self) -> frozenset[str]:
        """Those that ``[bounds]`` names."""
        return frozenset(self.file.bounds)

    def simulated(self, values: Mapping[str, float]) -> Recording:
        """The recorded runs as the model has them with these values, without noise and rounding.

        Raises InputError: the recordings cannot drive this model, or it runs away with these values.
        """
        return self.driven(values)[0]

    def driven(self, values: Mapping[str, float]) -> tuple[Recording, tuple[Finding, ...]]:
        """As `simulated`, with what is to be said of it."""
        model = self._quiet
        if values:
            model = model.with_parameters({name: float(value) for name, value in values.items()})
        done = self._kind.driven(model, self.recording, RunSettings(self.columns))
        return done.recording, done.findings

    def with_values(self, values: Mapping[str, float]) -> "OwnModel":
        """The same with these numbers in its file."""
        return dataclasses.replace(self, file=self._model(self.file).with_parameters(dict(values)).file)

    def with_changes(self, changes: Sequence[tuple[Key, Any]]) -> "OwnModel":
        """The same with these values at these places of the file, sections that lack made.

        Raises ModelFileError: the file cannot have them.
        """
        plain = copy.deepcopy(plain_values(self.file))
        for path, value in changes:
            put_at(plain, path, value)
        return dataclasses.replace(self, file=self._checked(plain))

    def text(self, head: str = "") -> str:
        """The model file; `head` becomes a comment at its beginning."""
        return model_file_text(plain_values(self.file), head=head)

    @cached_property
    def _quiet(self) -> Any:
        file = self._kind.quiet(self.file)
        if self.step_s is not None:
            plain = copy.deepcopy(plain_values(file))
            put_at(plain, ("run", "step_s"), self.step_s)
            file = self._checked(plain)
        return self._model(file)

    @property
    def _kind(self) -> SimulationKind:
        return simulation_kinds()[self.kind]

    def _checked(self, plain: Mapping[str, Any]) -> Any:
        return self._kind.checked(plain, where=f"model {self.name!r}")

    def _model(self, file: Any) -> Any:
        return self._kind.model(file, self.columns)


@dataclass(frozen=True, eq=False)
class FunctionModel:
    """A Python function that simulates the recorded runs (mode B)."""

    name: str
    #: Values by name → run → table of simulated channels, indexed by the time from the start of the run [s]
    function: Callable[[Mapping[str, float]], Mapping[str, pd.DataFrame]]
    parameters: Mapping[str, Parameter]  #: Value, bounds and unit of everything that may be set; every one is refitted
    recording: Recording  #: The runs that are simulated; says the roles and units of the channels
    mode: ClassVar[Mode] = "B"

    @property
    def refitted(self) -> tuple[str, ...]:
        """All parameters."""
        return tuple(self.parameters)

    @property
    def bounded(self) -> frozenset[str]:
        """All parameters: who wrote them has thought about their bounds."""
        return frozenset(self.parameters)

    def simulated(self, values: Mapping[str, float]) -> Recording:
        """What the function makes of these values, at the times of the recordings.

        Raises InputError: it gives no table for a run, no recorded channel, or numbers that are not finite.
        """
        whole = {name: one.value for name, one in self.parameters.items()} | dict(values)
        return simulation_at_recorded_times(self.function(whole), self.recording, where=self.name)


def simulation_at_recorded_times(tables: Mapping[str, pd.DataFrame], recording: Recording, *, where: str) -> Recording:
    """Simulated tables, indexed by time [s], as a recording with the clock and the channels of another one.

    Raises InputError: a run lacks, no column is called like a recorded channel, or a number is not finite.
    """
    lacking = [run for run in recording.runs if run not in tables]
    if lacking:
        raise InputError(
            f"no table for run {lacking[0]!r}",
            expected=f"one for every recorded run: {', '.join(recording.runs[:8])}",
            where=where,
            advice="simulate all runs that are given",
        )
    names = [name for name in recording.names if all(name in tables[run].columns for run in recording.runs)]
    if not names:
        found = ", ".join(map(str, tables[recording.runs[0]].columns[:8])) or "none"
        raise InputError(
            f"simulated columns: {found}",
            expected=f"one or more of the recorded channels: {', '.join(recording.names[:12])}",
            where=where,
            advice="name what is simulated as the recorded channels are named",
        )
    result = {}
    for run in recording.runs:
        time, at = tables[run].index.to_numpy(dtype=np.float64), recording.time_s(run)
        values = tables[run][names].to_numpy(dtype=np.float64)
        if len(time) == 0 or not np.isfinite(values).all() or (np.diff(time) < 0.0).any():
            raise InputError(
                f"a simulation of run {run!r} with numbers that are not finite, or times that run backwards",
                expected="finite numbers at increasing times",
                where=where,
                advice="look for what makes it diverge, or narrow the bounds of its parameters",
            )
        read = {name: np.interp(at, time, values[:, k], np.nan, np.nan) for k, name in enumerate(names)}
        result[run] = pd.DataFrame(read, index=pd.Index(at, name="time_s"))
    return Recording.from_runs(result, tuple(recording.channel(name) for name in names), {})


def _said(values: Any, path: tuple[str, ...] = ()) -> set[str]:
    """Names of the numbers that plain values hold, arrays counted from 1."""
    if isinstance(values, Mapping):
        return {name for key, inner in values.items() for name in _said(inner, (*path, str(key)))}
    if isinstance(values, list | tuple):
        return {name for number, inner in enumerate(values, 1) for name in _said(inner, (*path, str(number)))}
    return {".".join(path)} if isinstance(values, int | float) and not isinstance(values, bool) else set()


def _is_known(name: str) -> bool:
    parts = name.split(".")
    return any(part in _KNOWN for part in parts[:-1]) or _INSEPARABLE in parts


_REALS = ("Real", "Float64", "Float32")
_TIMES = 10.0


@dataclass(frozen=True, eq=False)
class FmuModel:
    """A functional mock-up unit, driven by recorded channels that are called like its inputs; made by `fmu_model`."""

    name: str  #: What its description calls it
    folder: Path  #: Where it is unpacked
    description: Any  #: FMPy's
    #: Its real parameters; bounds are those it declares, else a tenth and ten times
    parameters: Mapping[str, Parameter]
    bounded: frozenset[str]  #: Those whose bounds it declares
    #: inputs and outputs: Its inputs and outputs that were recorded
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    recording: Recording
    mode: ClassVar[Mode] = "B"

    @property
    def refitted(self) -> tuple[str, ...]:
        """Parameters that are not 0, and those with bounds."""
        return tuple(name for name, one in self.parameters.items() if one.value != 0.0 or name in self.bounded)

    def simulated(self, values: Mapping[str, float]) -> Recording:
        """The recorded runs with these values of the parameters.

        Raises InputError: the unit gives up, or its numbers are not finite.
        """
        tables = {run: self._run(run, values) for run in self.recording.runs}
        return simulation_at_recorded_times(tables, self.recording, where=self.name)

    def _run(self, run: str, values: Mapping[str, float]) -> pd.DataFrame:
        import fmpy

        time = self.recording.time_s(run)
        courses = [_held(self.recording.values(run, [name])[:, 0], run, name) for name in self.inputs]
        signals = np.array(
            list(zip(time, *courses, strict=True)),
            dtype=[("time", np.float64), *((name, np.float64) for name in self.inputs)],
        )
        try:
            result = fmpy.simulate_fmu(
                str(self.folder),
                validate=False,
                start_time=float(time[0]),
                stop_time=float(time[-1]),
                output_interval=float(np.median(np.diff(time))),
                start_values={name: float(value) for name, value in values.items()},
                input=signals if self.inputs else None,
                output=list(self.outputs),
                model_description=self.description,
                debug_logging=False,
            )
        except Exception as error:  # whatever a foreign program ends with
            raise InputError(
                f"the unit stopped in run {run!r}: {' '.join(str(error).split())[:300] or type(error).__name__}",
                expected="a simulation of the whole run",
                where=f"FMU {self.name!r}",
                advice="look whether its inputs and parameters are within what it allows",
            ) from error
        columns = {name: np.asarray(result[name], dtype=np.float64) for name in self.outputs}
        return pd.DataFrame(columns, index=pd.Index(np.asarray(result["time"], dtype=np.float64), name="time_s"))


Runnable = (
    OwnModel | FunctionModel | FmuModel
)  #: A simulation that can be run again with other values of its parameters.


@contextmanager
def fmu_model(path: str | Path, recording: Recording) -> Iterator[FmuModel]:
    """The functional mock-up unit at a path, driven by recorded runs; unpacked while the context lasts.

    It is a program that runs on this machine with the rights of who starts it. Its inputs, outputs and parameters are
    those of its description; inputs and outputs belong to the channels of the same name.

    Raises OptionError: FMPy is not installed. Raises ReadError: the file is none, or none for this machine. Raises
    InputError: an input was not recorded, or no output was.
    """
    try:
        import fmpy
    except ImportError as error:
        raise OptionError(
            "a functional mock-up unit, and no FMPy to run it", expected="the package FMPy", where=str(path),
            advice="in the folder of selector: pip install '.[fmu]'",
        ) from error  # fmt: skip
    if Path(path).exists() and not Path(path).is_file():
        # opening a pipe would wait for ever
        raise ReadError(
            "not a regular file", expected="a functional mock-up unit (.fmu)", where=str(path), advice="check the path"
        )
    with TemporaryDirectory() as folder:
        try:
            unpacked = fmpy.extract(str(path), unzipdir=folder)
            description = fmpy.read_model_description(str(path), validate=False)
        except Exception as error:  # zip, XML and version errors of all kinds
            raise ReadError(
                f"a file that cannot be read as an FMU ({' '.join(str(error).split())[:200]})",
                expected="a functional mock-up unit (FMI 1, 2 or 3)",
                where=str(path),
                advice="export it again, for co-simulation or model exchange, with binaries for this machine",
            ) from error
        yield _made(Path(unpacked), description, recording, str(path))


def _made(folder: Path, description: Any, recording: Recording, where: str) -> FmuModel:
    variables = description.modelVariables
    of = {kind: [v.name for v in variables if v.causality == kind and v.type in _REALS] for kind in ("input", "output")}
    lacking = [name for name in of["input"] if name not in recording.names]
    outputs = tuple(name for name in of["output"] if name in recording.names)
    if lacking or not outputs:
        raise InputError(
            f"input {lacking[0]!r}, which was not recorded" if lacking else f"outputs {', '.join(of['output'][:8])}",
            expected=f"{'inputs' if lacking else 'an output'} called like recorded channels: "
            f"{', '.join(recording.names[:12])}",
            where=where,
            advice="give the channels these names in the machine file",
        )
    parameters, bounded = {}, set()
    for variable in variables:
        if variable.causality != "parameter" or variable.type not in _REALS or variable.start is None:
            continue
        value = float(variable.start)
        ends = [None if end is None else float(end) for end in (variable.min, variable.max)]
        if None not in ends:
            bounded.add(variable.name)
        spread = sorted((value / _TIMES, value * _TIMES)) if value else [0.0, 1.0]
        low, high = (usual if end is None else end for end, usual in zip(ends, spread, strict=True))
        if math.isfinite(value) and low < high:
            parameters[variable.name] = Parameter(value, min(low, value), max(high, value), variable.unit or "1")
    return FmuModel(
        str(description.modelName), folder, description, parameters, frozenset(bounded & parameters.keys()),
        tuple(of["input"]), outputs, recording,
    )  # fmt: skip


def _held(values: np.ndarray[Any, np.dtype[np.float64]], run: str, name: str) -> np.ndarray[Any, Any]:
    if not np.isfinite(values).all():
        raise InputError(
            f"missing values of {name!r} in run {run!r}", expected="a value at every sample: it drives the unit",
            where=f"channel {name!r}", advice="cut the recording to the stretch that is complete",
        )  # fmt: skip
    return values
