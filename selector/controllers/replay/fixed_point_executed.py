"""The generated fixed-point C, compiled by the system's compiler and called row by row with whole numbers."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.controllers.guard.codes import LARGEST_NUMBER
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.replay.compiled import replay_of
from selector.controllers.replay.rows import Answers, Array, Rows
from selector.controllers.writers.fixed_point_numbers import LARGEST_INT32, MS, fixed
from selector.controllers.writers.fixed_point_sensor import NAME

_MISSING = -(2**31)
_UM_PER_M, _NM_PER_UM = 1e6, 1000.0


def fixed_point_answers(model: ModelFile, rows: Rows, files: Mapping[str, str]) -> Answers:
    """What ``thermal_correction_i.c`` gives: readings in counts, times in ms and positions in µm go in, nm come out.

    Raises
    ------
    NotExecutableError
        There is no compiler, or it refuses the program.
    """
    numbers = fixed(model)
    n, inputs, outputs = len(rows), len(model.inputs), len(model.outputs)
    per_unit = np.array([float(numbers.inputs[item.name].per_unit) for item in model.inputs])
    # the sum of the times is the true time
    ms = np.diff(np.rint(MS * np.cumsum(rows.dt_s)), prepend=0.0)
    counts = [ms, *_whole(rows.readings * per_unit).T, *_whole(rows.positions_m * _UM_PER_M).T]
    counts += [rows.is_restart, _whole(rows.standstill_s * MS), *_tests_nm(rows.tests_um(outputs)).T]
    into = np.column_stack([*counts, rows.is_ready, rows.is_wanted]).astype(np.int32)
    out = np.zeros((n, 3 * outputs + 1 + inputs + len(axes_of(model))), dtype=np.int32)
    call = replay_of(files, NAME, _driver(model))
    call.restype = None
    call(ctypes.c_long(n), *(ctypes.c_void_p(table.ctypes.data) for table in (into, out)))
    real = out[:, : 3 * outputs] / _NM_PER_UM
    parts = real[:, :outputs], real[:, outputs : 2 * outputs], real[:, 2 * outputs :]
    codes = out[:, 3 * outputs :].astype(np.int64)
    return Answers(*parts, codes[:, 0], codes[:, 1 : 1 + inputs], codes[:, 1 + inputs :])


def _whole(values: Array) -> NDArray[Any]:
    """Rounded; what is no number of 32 bits is missing."""
    rounded = np.rint(values)
    return np.where(np.abs(rounded) < LARGEST_INT32, rounded, _MISSING)


def _tests_nm(tests_um: Array) -> NDArray[Any]:
    """As a person would round them: what is too large for 32 bits is the largest, what is too small 1 nm."""
    nm = tests_um * _NM_PER_UM
    sizes = np.clip(np.ceil(np.abs(nm)), 0, LARGEST_INT32 - 1)
    return np.where(np.abs(tests_um) <= LARGEST_NUMBER, np.sign(nm) * sizes, 0)


def _driver(model: ModelFile) -> str:
    inputs = ["dt_ms", *(f"reading_{k + 1}" for k in range(len(model.inputs)))]
    inputs += [*(f"position_{k + 1}" for k in range(len(axes_of(model)))), "is_restart", "standstill_ms"]
    inputs += [*(f"test_nm_{k + 1}" for k in range(len(model.outputs))), "is_ready", "is_wanted"]
    outputs: list[str | None] = [f"{of}_{k + 1}" for of in ("correction", "k0") for k in range(len(model.outputs))]
    outputs += [None if o.position is None else f"slope_{k}" for k, o in enumerate(model.outputs, 1)]
    outputs += ["mode", *(f"sensor_{k + 1}" for k in range(len(model.inputs)))]
    outputs += [f"axis_{k + 1}" for k in range(len(axes_of(model)))]
    return "\n".join(
        [
            f'#include "{NAME}.h"',
            "void replay(long n, const int32_t *in, int32_t *out)",
            "{",
            f"    {NAME} m;",
            "    long k;",
            f"    {NAME}_init(&m);",
            "    for (k = 0; k < n; k++) {",
            *(f"        m.{name} = in[{len(inputs)} * k + {i}];" for i, name in enumerate(inputs)),
            f"        {NAME}_step(&m);",
            *(f"        out[{len(outputs)} * k + {i}] = m.{name};" for i, name in enumerate(outputs) if name),
            "    }",
            "}",
            "",
        ]
    )
