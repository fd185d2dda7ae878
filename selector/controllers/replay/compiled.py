"""Generated C, compiled by the system's compiler, and the generated Python module, called row by row."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.controllers.guard.codes import LARGEST_NUMBER
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import axes_of, guarded_program
from selector.controllers.replay.rows import Answers, Rows, called
from selector.controllers.writers.c99 import NAME, Precision, c_files
from selector.controllers.writers.fixed_point_numbers import LARGEST_INT32, MS, fixed
from selector.controllers.writers.fixed_point_sensor import INT_NAME
from selector.controllers.writers.python_module import CLASS, MODULE_NAME, python_files
from selector.errors import NotExecutableError
from selector.types import Array

OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared")


def compiler() -> str | None:
    """The C compiler of this machine: $CC, cc, gcc or clang."""
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and shutil.which(name):
            return name
    return None


def compiler_version(of: str) -> str:
    """The first line that the compiler says about itself."""
    said = subprocess.run([of, "--version"], capture_output=True, text=True, check=False).stdout  # noqa: S603
    return (said.splitlines() or [of])[0].strip()


def c_answers(
    model: ModelFile,
    rows: Rows,
    precision: Precision = "double",
    files: Mapping[str, str] | None = None,
    name: str = NAME,
) -> Answers:
    """What the generated C gives, ``<name>.c`` of `files`; default: as exported.

    Raises
    ------
    NotExecutableError
        There is no compiler, or it refuses the program.
    """
    exported = files or c_files(model, precision=precision, name=name)
    return _called(replay_of(exported, name, _driver(model, precision, name)), model, rows)


def replay_of(files: Mapping[str, str], name: str, driver: str) -> Any:
    """The function ``replay`` of a driver, compiled together with ``<name>.h`` and ``<name>.c``.

    Raises
    ------
    NotExecutableError
        There is no compiler, or it refuses the program.
    """
    cc = compiler()
    if cc is None:
        raise NotExecutableError(
            "no C compiler",
            expected="cc, gcc or clang on the path, or its name in the environment variable CC",
            where="--replay",
            advice="install one (Debian: apt install gcc), or export without --replay",
        )
    return _compiled(cc, name, files[f"{name}.h"], files[f"{name}.c"], driver).replay


@lru_cache(maxsize=8)
def _compiled(cc: str, name: str, header: str, source: str, driver: str) -> ctypes.CDLL:
    """Once for all runs of a recording."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as path:
        folder = Path(path)
        texts = {f"{name}.h": header, f"{name}.c": source, "replay.c": driver}
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="ascii")
        library = folder / "replay.so"
        command = [cc, *OPTIONS, "-o", str(library), str(folder / "replay.c"), str(folder / f"{name}.c")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode != 0:
            raise NotExecutableError(
                f"{cc} refuses {name}.c: {_first_error(done.stderr)}",
                expected="a C99 compiler for this machine",
                where="--replay",
                advice="name another compiler in the environment variable CC",
            )
        return ctypes.CDLL(str(library))


def _first_error(said: str) -> str:
    lines = said.strip().splitlines() or ["?"]
    return next((line for line in lines if "error" in line), lines[0])


def _called(call: Any, model: ModelFile, rows: Rows) -> Answers:
    n, outputs, inputs = len(rows), len(model.outputs), len(model.inputs)
    real = np.zeros((n, 3 * outputs))
    codes = np.zeros((n, 1 + inputs + len(axes_of(model))), dtype=np.int32)
    call.restype = None
    tables: list[NDArray[Any]] = [
        np.ascontiguousarray(rows.dt_s, dtype=np.float64),
        np.ascontiguousarray(rows.readings, dtype=np.float64),
        np.ascontiguousarray(rows.positions_m, dtype=np.float64),
        np.column_stack([rows.is_ready, rows.is_wanted, rows.is_restart]).astype(np.int32),
        np.ascontiguousarray(rows.standstill_s, dtype=np.float64),
        np.ascontiguousarray(rows.tests_um(outputs), dtype=np.float64),
        real,
        codes,
    ]
    call(ctypes.c_long(n), *(ctypes.c_void_p(table.ctypes.data) for table in tables))
    parts = real[:, :outputs], real[:, outputs : 2 * outputs], real[:, 2 * outputs :]
    told = codes.astype(np.int64)
    return Answers(*parts, told[:, 0], told[:, 1 : 1 + inputs], told[:, 1 + inputs :])


def _driver(model: ModelFile, precision: Precision, name: str) -> str:
    """A loop over rows; `float` readings are rounded once, as a control's inputs are."""
    program = guarded_program(model)
    names = {variable.name for variable in program.variables}
    inputs, outputs = len(model.inputs), len(model.outputs)
    axes = sum(variable.name.startswith("position_") for variable in program.of("input"))
    lines = [
        f'#include "{name}.h"',
        "void replay(long n, const double *dt, const double *readings, const double *positions, const int *flags,",
        "            const double *standstill, const double *tests, double *real, int *codes)",
        "{",
        f"    {name} m;",
        "    long k;",
        f"    {name}_init(&m);",
        "    (void)positions;",
        "    for (k = 0; k < n; k++) {",
        f"        m.dt_s = ({precision})dt[k];",
    ]
    lines += [f"        m.reading_{i + 1} = ({precision})readings[{inputs} * k + {i}];" for i in range(inputs)]
    lines += [f"        m.position_{i + 1} = ({precision})positions[{axes} * k + {i}];" for i in range(axes)]
    lines += [
        "        m.is_ready = flags[3 * k];",
        "        m.is_wanted = flags[3 * k + 1];",
        "        m.is_restart = flags[3 * k + 2];",
        f"        m.standstill_s = ({precision})standstill[k];",
        *(f"        m.test_um_{i + 1} = ({precision})tests[{outputs} * k + {i}];" for i in range(outputs)),
        f"        {name}_step(&m);",
    ]
    for j, what in enumerate(("correction", "k0", "slope")):
        for i in range(outputs):
            one = f"{what}_{i + 1}"
            if one in names:
                lines.append(f"        real[{3 * outputs} * k + {outputs * j + i}] = m.{one};")
    codes = ["mode", *(f"sensor_{i + 1}" for i in range(inputs)), *(f"axis_{i + 1}" for i in range(axes))]
    lines += [f"        codes[{len(codes)} * k + {i}] = m.{one};" for i, one in enumerate(codes)]
    return "\n".join([*lines, "    }", "}"]) + "\n"


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
    call = replay_of(files, INT_NAME, _fixed_driver(model))
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


def _fixed_driver(model: ModelFile) -> str:
    inputs = ["dt_ms", *(f"reading_{k + 1}" for k in range(len(model.inputs)))]
    inputs += [*(f"position_{k + 1}" for k in range(len(axes_of(model)))), "is_restart", "standstill_ms"]
    inputs += [*(f"test_nm_{k + 1}" for k in range(len(model.outputs))), "is_ready", "is_wanted"]
    outputs: list[str | None] = [f"{of}_{k + 1}" for of in ("correction", "k0") for k in range(len(model.outputs))]
    outputs += [None if o.position is None else f"slope_{k}" for k, o in enumerate(model.outputs, 1)]
    outputs += ["mode", *(f"sensor_{k + 1}" for k in range(len(model.inputs)))]
    outputs += [f"axis_{k + 1}" for k in range(len(axes_of(model)))]
    return "\n".join(
        [
            f'#include "{INT_NAME}.h"',
            "void replay(long n, const int32_t *in, int32_t *out)",
            "{",
            f"    {INT_NAME} m;",
            "    long k;",
            f"    {INT_NAME}_init(&m);",
            "    for (k = 0; k < n; k++) {",
            *(f"        m.{name} = in[{len(inputs)} * k + {i}];" for i, name in enumerate(inputs)),
            f"        {INT_NAME}_step(&m);",
            *(f"        out[{len(outputs)} * k + {i}] = m.{name};" for i, name in enumerate(outputs) if name),
            "    }",
            "}",
            "",
        ]
    )


def python_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the generated module gives; default of the files: as exported."""
    names: dict[str, Any] = {}
    # our own text, made a line above from numbers and variable names; names of the model stand in remarks only
    exec(compile((files or python_files(model))[f"{MODULE_NAME}.py"], f"{MODULE_NAME}.py", "exec"), names)  # noqa: S102
    program = names[CLASS]()
    return called(program, program.step, model, rows, "", float)
