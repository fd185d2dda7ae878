"""Generated C, compiled by the system's compiler and called row by row."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.replay.rows import Answers, Rows
from selector.controllers.writers.c99 import NAME, Precision, c_files
from selector.errors import NotExecutableError

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
    model: ModelFile, rows: Rows, precision: Precision = "double", files: Mapping[str, str] | None = None
) -> Answers:
    """What the generated C gives; default of the files: as exported.

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
    exported = files or c_files(model, precision=precision)
    texts = {f"{NAME}.{ending}": exported[f"{NAME}.{ending}"] for ending in ("h", "c")}
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="ascii")
        (folder / "replay.c").write_text(_driver(model, precision), encoding="ascii")
        library = folder / "replay.so"
        command = [cc, *OPTIONS, "-o", str(library), str(folder / "replay.c"), str(folder / f"{NAME}.c")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode != 0:
            raise NotExecutableError(
                f"{cc} refuses the generated program: {_first_error(done.stderr)}",
                expected="a C99 compiler for this machine",
                where="--replay",
                advice="name another compiler in the environment variable CC",
            )
        return _called(library, model, rows)


def _first_error(said: str) -> str:
    lines = said.strip().splitlines() or ["?"]
    return next((line for line in lines if "error" in line), lines[0])


def _called(library: Path, model: ModelFile, rows: Rows) -> Answers:
    n, outputs, inputs = len(rows), len(model.outputs), len(model.inputs)
    real = np.zeros((n, 3 * outputs))
    codes = np.zeros((n, 1 + inputs), dtype=np.int32)
    call = ctypes.CDLL(str(library)).replay
    call.restype = None
    tables: list[NDArray[Any]] = [
        np.ascontiguousarray(rows.dt_s, dtype=np.float64),
        np.ascontiguousarray(rows.readings, dtype=np.float64),
        np.ascontiguousarray(rows.positions_m, dtype=np.float64),
        np.column_stack([rows.is_ready, rows.is_wanted, rows.is_restart]).astype(np.int32),
        np.ascontiguousarray(rows.standstill_s, dtype=np.float64),
        real,
        codes,
    ]
    call(ctypes.c_long(n), *(ctypes.c_void_p(table.ctypes.data) for table in tables))
    parts = real[:, :outputs], real[:, outputs : 2 * outputs], real[:, 2 * outputs :]
    return Answers(*parts, codes[:, 0].astype(np.int64), codes[:, 1:].astype(np.int64))


def _driver(model: ModelFile, precision: Precision) -> str:
    """A loop over rows; `float` readings are rounded once, as a control's inputs are."""
    program = guarded_program(model)
    names = {variable.name for variable in program.variables}
    inputs, outputs = len(model.inputs), len(model.outputs)
    axes = sum(variable.name.startswith("position_") for variable in program.of("input"))
    lines = [
        f'#include "{NAME}.h"',
        "void replay(long n, const double *dt, const double *readings, const double *positions, const int *flags,",
        "            const double *standstill, double *real, int *codes)",
        "{",
        f"    {NAME} m;",
        "    long k;",
        f"    {NAME}_init(&m);",
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
        f"        {NAME}_step(&m);",
    ]
    for j, what in enumerate(("correction", "k0", "slope")):
        for i in range(outputs):
            name = f"{what}_{i + 1}"
            if name in names:
                lines.append(f"        real[{3 * outputs} * k + {outputs * j + i}] = m.{name};")
    lines.append(f"        codes[{1 + inputs} * k] = m.mode;")
    lines += [f"        codes[{1 + inputs} * k + {1 + i}] = m.sensor_{i + 1};" for i in range(inputs)]
    return "\n".join([*lines, "    }", "}"]) + "\n"
