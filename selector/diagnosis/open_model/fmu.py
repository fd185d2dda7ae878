"""What does a functional mock-up unit simulate of recorded runs: a black box with parameters, run by FMPy (mode B)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from selector.diagnosis.open_model.runnable import Mode, simulation_at_recorded_times
from selector.errors import InputError, OptionError, ReadError
from selector.physics.model_fields import Parameter
from selector.recording import Recording

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

    @property
    def mode(self) -> Mode:
        """B."""
        return "B"

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
            "a functional mock-up unit, and no FMPy to run it",
            expected="the package FMPy",
            where=str(path),
            advice="install it: pip install 'selector[fmu]'",
        ) from error
    if Path(path).exists() and not Path(path).is_file():
        # opening a pipe would wait for ever
        raise ReadError(
            "not a regular file",
            expected="a functional mock-up unit (.fmu)",
            where=str(path),
            advice="check the path",
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
            f"missing values of {name!r} in run {run!r}",
            expected="a value at every sample: it drives the unit",
            where=f"channel {name!r}",
            advice="cut the recording to the stretch that is complete",
        )
    return values
