"""What a program is called with, row by row, and what it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.controllers.evaluator import axes_of
from selector.controllers.guard.guarded_model import GuardedModel, Number
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
from selector.types import Array

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Rows:
    """Calls of a program."""

    dt_s: Array  #: (n_rows,)
    readings: Array  #: (n_rows, n_inputs): [unit of the input]
    positions_m: Array  #: (n_rows, n_axes): As `axes_of`
    #: is_ready, is_wanted and is_restart: (n_rows,)
    is_ready: Flags
    is_wanted: Flags
    is_restart: Flags
    standstill_s: Array  #: (n_rows,)
    test_um: Array | None = None  #: (n_rows, n_outputs): What is commanded for the sign test; default: nothing

    def __len__(self) -> int:
        return len(self.dt_s)

    def tests_um(self, n_outputs: int) -> Array:
        """What is commanded for the sign test, zeros if nothing is; of shape (n_rows, n_outputs)."""
        return np.zeros((len(self), n_outputs)) if self.test_um is None else self.test_um

    def columns(self, n_outputs: int) -> dict[str, NDArray[Any]]:
        """Every input of a guarded program by its name."""
        tables = {"reading": self.readings, "position": self.positions_m, "test_um": self.tests_um(n_outputs)}
        numbered = {f"{name}_{k}": column for name, table in tables.items() for k, column in enumerate(table.T, 1)}
        single = ("dt_s", "standstill_s", "is_ready", "is_wanted", "is_restart")
        return {name: getattr(self, name) for name in single} | numbered


@dataclass(frozen=True, eq=False)
class Answers:
    """What the calls gave."""

    #: correction_um, k0_um and slope_um_per_m: (n_rows, n_outputs)
    correction_um: Array
    k0_um: Array
    slope_um_per_m: Array
    mode: NDArray[np.int64]  #: (n_rows,)
    sensors: NDArray[np.int64]  #: (n_rows, n_inputs)
    axes: NDArray[np.int64]  #: (n_rows, n_axes): Codes of the positions; 0 where a control has none

    @classmethod
    def empty(cls, n_rows: int, n_outputs: int, n_inputs: int, n_axes: int) -> Answers:
        """Zeros, to be filled."""
        real = np.zeros((3, n_rows, n_outputs))
        codes = np.zeros((n_rows, 1 + n_inputs + n_axes), dtype=np.int64)
        return cls(real[0], real[1], real[2], codes[:, 0], codes[:, 1 : 1 + n_inputs], codes[:, 1 + n_inputs :])

    @classmethod
    def of_outputs(cls, columns: Mapping[str, NDArray[Any]], model: ModelFile) -> Answers:
        """From the outputs of a guarded program by their names; the slope is 0 where it has none."""
        n_rows, n_axes = len(columns["mode"]), len(axes_of(model))
        found = cls.empty(n_rows, len(model.outputs), len(model.inputs), n_axes)
        tables = {"correction": found.correction_um, "k0": found.k0_um, "sensor": found.sensors, "axis": found.axes}
        for name, table in tables.items():
            for k in range(table.shape[1]):
                table[:, k] = columns[f"{name}_{k + 1}"]
        for k in range(len(model.outputs)):
            found.slope_um_per_m[:, k] = columns.get(f"slope_{k + 1}", 0.0)
        found.mode[:] = columns["mode"]
        return found


def called(
    program: Any, call: Callable[[], None], model: ModelFile, rows: Rows, prefix: str, number: Number
) -> Answers:
    """What an object gives whose attributes are the inputs and outputs of a program, called row by row.

    `call` runs it once; `prefix` stands before the names of the attributes; `number` is the type of its real inputs.
    """
    names = [variable.name for variable in guarded_program(model).of("output")]
    given = {prefix + name: column.tolist() for name, column in rows.columns(len(model.outputs)).items()}
    found = []
    for k in range(len(rows)):
        for name, column in given.items():
            setattr(program, name, column[k] if isinstance(column[k], bool) else number(column[k]))
        call()
        found.append([getattr(program, prefix + name) for name in names])
    table = np.array(found, dtype=np.float64).reshape(len(rows), len(names))
    return Answers.of_outputs(dict(zip(names, table.T, strict=True)), model)


def reference_answers(model: ModelFile, rows: Rows, number: Number = float) -> Answers:
    """What `GuardedModel` gives in this number type."""
    guarded = GuardedModel(model, number)
    names, axes = [item.name for item in model.inputs], axes_of(model)
    outputs = [output.name for output in model.outputs]
    answers = Answers.empty(len(rows), len(outputs), len(names), len(axes))
    table, where, tests = rows.readings.tolist(), rows.positions_m.tolist(), rows.tests_um(len(outputs)).tolist()
    for k, dt_s in enumerate(rows.dt_s.tolist()):
        # a switch that stays on is one restart
        if rows.is_restart[k] and not (k and rows.is_restart[k - 1]):
            guarded.restart(float(rows.standstill_s[k]))
        found = guarded.step(
            dt_s,
            dict(zip(names, table[k], strict=True)),
            dict(zip(axes, where[k], strict=True)),
            is_ready=bool(rows.is_ready[k]),
            is_wanted=bool(rows.is_wanted[k]),
            test_um=dict(zip(outputs, tests[k], strict=True)),
        )
        answers.correction_um[k] = [found.correction_um[name] for name in outputs]
        answers.k0_um[k] = [found.k0_um[name] for name in outputs]
        answers.slope_um_per_m[k] = [found.slope_um_per_m[name] for name in outputs]
        answers.mode[k], answers.sensors[k] = found.mode, found.sensors
        answers.axes[k] = [found.axes[axis] for axis in axes]
    return answers
