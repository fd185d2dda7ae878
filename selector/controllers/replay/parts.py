"""What a program is called with and gives; what executes each written file of an export, and what it has to give."""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.controllers.evaluator import axes_of, evaluate
from selector.controllers.guard.decided import LARGEST_NUMBER, decided_limits, is_turned
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Number, executable
from selector.controllers.single_precision import SINGLE
from selector.types import Array, Indices, Mask

Flags = Mask


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
    is_touch_valid: Flags | None = None  #: (n_rows,): A touch-off is there; default: none
    touch_um: Array | None = None  #: (n_rows, n_outputs): What the probe shows; default: nothing

    def __len__(self) -> int:
        return len(self.dt_s)

    def tests_um(self, n_outputs: int) -> Array:
        """What is commanded for the sign test, zeros if nothing is; of shape (n_rows, n_outputs)."""
        return np.zeros((len(self), n_outputs)) if self.test_um is None else self.test_um

    def touches(self, n_outputs: int) -> tuple[Flags, Array]:
        """When touch-offs are there, and what they show, of shape (n_rows, n_outputs); NaN if there are none."""
        valid = np.zeros(len(self), dtype=np.bool_) if self.is_touch_valid is None else self.is_touch_valid
        return valid, np.full((len(self), n_outputs), np.nan) if self.touch_um is None else self.touch_um

    def columns(self, model: ModelFile) -> dict[str, NDArray[Any]]:
        """Every input of the guarded program of a model by its name."""
        n_outputs = len(model.outputs)
        tables = {"reading": self.readings, "position": self.positions_m, "test_um": self.tests_um(n_outputs)}
        numbered = {f"{name}_{k}": column for name, table in tables.items() for k, column in enumerate(table.T, 1)}
        single = ("dt_s", "standstill_s", "is_ready", "is_wanted", "is_restart")
        found = {name: getattr(self, name) for name in single} | numbered
        if model.adaptation is not None:
            names, (valid, shown) = [output.name for output in model.outputs], self.touches(n_outputs)
            found["is_touch_valid"] = valid
            for of in model.adaptation.outputs:
                k = names.index(of.output)
                found[f"touch_um_{k + 1}"] = shown[:, k]
        return found


@dataclass(frozen=True, eq=False)
class Answers:
    """What the calls gave."""

    #: correction_um, k0_um and slope_um_per_m: (n_rows, n_outputs)
    correction_um: Array
    k0_um: Array
    slope_um_per_m: Array
    mode: Indices  #: (n_rows,)
    sensors: Indices  #: (n_rows, n_inputs)
    axes: Indices  #: (n_rows, n_axes): Codes of the positions; 0 where a control has none

    @classmethod
    def empty(cls, n_rows: int, n_outputs: int, n_inputs: int, n_axes: int) -> "Answers":
        """Zeros, to be filled."""
        real = np.zeros((3, n_rows, n_outputs))
        codes = np.zeros((n_rows, 1 + n_inputs + n_axes), dtype=np.int64)
        return cls(real[0], real[1], real[2], codes[:, 0], codes[:, 1 : 1 + n_inputs], codes[:, 1 + n_inputs :])

    @classmethod
    def of_outputs(cls, columns: Mapping[str, NDArray[Any]], model: ModelFile) -> "Answers":
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
    given = {prefix + name: column.tolist() for name, column in rows.columns(model).items()}
    found = []
    for k in range(len(rows)):
        for name, column in given.items():
            setattr(program, name, column[k] if isinstance(column[k], bool) else number(column[k]))
        call()
        found.append([getattr(program, prefix + name) for name in names])
    table = np.array(found, dtype=np.float64).reshape(len(rows), len(names))
    return Answers.of_outputs(dict(zip(names, table.T, strict=True)), model)


def reference_answers(model: ModelFile, rows: Rows, number: Number = float, literal: Number | None = None) -> Answers:
    """What the guard gives in this number type; `literal`: what a control makes of its literals."""
    block = executable(guarded_program(model), number, literal)
    with np.errstate(all="ignore"):
        return called(block, block.call, model, rows, "", number)


def in_single_um(model: ModelFile, rows: Rows, _whole: Answers, _main: Answers) -> Array:
    """What a program in single precision has to give, to the last bit."""
    return reference_answers(model, rows, np.float32).correction_um


def rows_at(rows: Rows, calls: Indices) -> Rows:
    """These rows alone, with the time from one to the next."""
    tables: dict[str, Any] = {field.name: getattr(rows, field.name) for field in dataclasses.fields(Rows)}
    chosen: dict[str, Any] = {name: None if table is None else table[calls] for name, table in tables.items()}
    return Rows(**chosen | {"dt_s": np.diff(np.cumsum(rows.dt_s)[calls], prepend=0.0)})


def unguarded_um(model: ModelFile, rows: Rows) -> Array:
    """The model alone, on whatever readings, of shape (n_rows, n_outputs) [µm]; 0 where it has none.

    For models without memory: time is not looked at.
    """
    readings = {item.name: rows.readings[:, k] for k, item in enumerate(model.inputs)}
    positions = dict(zip(axes_of(model), places_m(model, rows).T, strict=True))
    found = evaluate(model, np.arange(len(rows)), readings, None, positions or None)
    displacement = np.column_stack([found[output.name] for output in model.outputs])
    signs = [1.0 if is_turned(output) else -1.0 for output in model.outputs]
    return np.where(np.isfinite(displacement), signs * displacement, 0.0)


def straight_line_um(model: ModelFile, rows: Rows, _whole: Answers, main: Answers) -> Array:
    """K0 + m · (P − P0) wherever the axis stands, of shape (n_rows, n_outputs) [µm]: no control clamps its line."""
    line, places, axes = main.k0_um.copy(), places_m(model, rows), axes_of(model)
    for k, output in enumerate(model.outputs):
        if output.position is not None:
            away_m = places[:, axes.index(output.position.axis)] - output.position.reference_m
            line[:, k] += main.slope_um_per_m[:, k] * away_m
    return line


def places_m(model: ModelFile, rows: Rows) -> Array:
    """Positions of the rows, what is missing replaced by the last known one, at first by the reference."""
    parts = {o.position.axis: o.position for o in model.outputs if o.position is not None}
    filled = rows.positions_m.copy()
    for k, axis in enumerate(axes_of(model)):
        is_known = np.abs(filled[:, k]) <= LARGEST_NUMBER
        last = np.maximum.accumulate(np.where(is_known, np.arange(len(rows)), -1))
        filled[:, k] = np.where(last >= 0, filled[last, k], parts[axis].reference_m)
    return filled


#: Calls are replayed at whole eighths of a second: ms are whole, and binary32 counts them exactly up to 10^6 s.
TIME_STEP_S = 0.125

#: Runs one file of an export: what it gives row by row; last what the first file gave, for those that go on with it.
Execution = Callable[[ModelFile, Rows, Mapping[str, str], Answers], Answers]
#: Corrections that a file has to give, of shape (n_rows, n_outputs) [µm], from the answers of the whole guard and of
#: the first file.
Expected = Callable[[ModelFile, Rows, Answers, Answers], Array]
#: Per output, the largest difference that its number type explains in such a run [µm].
Allowed = Callable[[ModelFile, Rows, Answers], Mapping[str, float]]


def at_most(difference_um: float) -> Allowed:
    """The same for every output of every model."""
    return lambda model, _rows, _whole: dict.fromkeys((output.name for output in model.outputs), difference_um)


TO_THE_LAST_BIT = at_most(0.0)


@dataclass(frozen=True)
class Part:
    """One written file that computes something."""

    file: str  #: Left out of a replay if it was not written
    execute: Execution
    executed_by: Callable[[], str]  #: Name and version of what runs it
    #: The reference with the guard that this file has; by default the answers of the whole guard
    expected: Expected = lambda _model, _rows, whole, _main: whole.correction_um
    allowed_um: Allowed = TO_THE_LAST_BIT
    lacks: str = ""  #: What makes its reference another one than the whole guard; empty = nothing
    tells_mode: bool = True  #: Whether it says what it follows


def units_in_single_um(model: ModelFile, rows: Rows, _whole: Answers) -> dict[str, float]:
    """K0, slope and reference position in other units: a literal and a product are rounded, at these positions."""
    found, places, axes = {}, places_m(model, rows), axes_of(model)
    limits, _ = decided_limits(model)
    for output in model.outputs:
        limit, reach_m, part = limits[output.name], 0.0, output.position
        if part is not None:
            far_m = np.abs(places[:, axes.index(part.axis)] - part.reference_m)
            reach_m = float(np.max(far_m, initial=0.0)) + abs(part.reference_m)
        found[output.name] = 2.1 * SINGLE * (limit.clamp_um + reach_m * limit.slope_clamp_um_per_m)
    return found


def tenths_um(model: ModelFile, rows: Rows, whole: Answers) -> dict[str, float]:
    """Half a step of 0.1 µm, and of the reference position as far as the slope makes something of it."""
    limits, _ = decided_limits(model)
    # and float64 itself
    return {name: 0.05 + 0.5e-7 * of.slope_clamp_um_per_m + 1e-9 for name, of in limits.items()}
