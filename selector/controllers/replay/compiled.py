"""Generated C, compiled by the system's compiler, and the generated Python module, called row by row."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.controllers.guard.codes import LARGEST_NUMBER
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
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
    into = rows.columns(len(model.outputs))
    out = [variable.name for variable in guarded_program(model).of("output")]
    return Answers.of_outputs(replayed_columns(exported, name, into, out, np.float64), model)


def replayed_columns(
    files: Mapping[str, str], name: str, into: Mapping[str, NDArray[Any]], out: Sequence[str], number: type[Any]
) -> dict[str, NDArray[Any]]:
    """Members of the struct ``<name>`` after its step, row by row, in a table of this type of numbers.

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
    driver = _driver(name, _C_TYPES[number], list(into), out)
    given = np.column_stack(list(into.values())).astype(number)
    found = np.zeros((len(given), len(out)), dtype=number)
    call = _compiled(cc, name, files[f"{name}.h"], files[f"{name}.c"], driver).replay
    call.restype = None
    call(ctypes.c_long(len(given)), *(ctypes.c_void_p(table.ctypes.data) for table in (given, found)))
    return dict(zip(out, found.T, strict=True))


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


def _driver(name: str, number: str, inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """A loop over rows; what goes into a `float` is rounded once, as a control's inputs are."""
    lines = [
        f'#include "{name}.h"',
        f"void replay(long n, const {number} *in, {number} *out)",
        "{",
        f"    {name} m;",
        "    long k;",
        f"    {name}_init(&m);",
        "    for (k = 0; k < n; k++) {",
        *(f"        m.{one} = in[{len(inputs)} * k + {i}];" for i, one in enumerate(inputs)),
        f"        {name}_step(&m);",
        *(f"        out[{len(outputs)} * k + {i}] = m.{one};" for i, one in enumerate(outputs)),
        "    }",
        "}",
    ]
    return "\n".join(lines) + "\n"


_C_TYPES: dict[type[Any], str] = {np.float64: "double", np.int32: "int32_t"}
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
    per_unit = [float(numbers.inputs[item.name].per_unit) for item in model.inputs]
    into, n = rows.columns(len(model.outputs)), len(model.outputs)
    # the sum of the times is the true time
    into["dt_ms"] = np.diff(np.rint(MS * np.cumsum(into.pop("dt_s"))), prepend=0.0)
    into["standstill_ms"] = _whole(into.pop("standstill_s") * MS)
    into |= {f"reading_{k}": _whole(into[f"reading_{k}"] * of) for k, of in enumerate(per_unit, 1)}
    into |= {name: _whole(column * _UM_PER_M) for name, column in into.items() if name.startswith("position_")}
    into |= {f"test_nm_{k}": _test_nm(into.pop(f"test_um_{k}")) for k in range(1, n + 1)}
    out = [variable.name for variable in guarded_program(model).of("output")]
    found = replayed_columns(files, INT_NAME, into, out, np.int32)
    lengths = ("correction_", "k0_", "slope_")
    return Answers.of_outputs(
        {name: column / _NM_PER_UM if name.startswith(lengths) else column for name, column in found.items()}, model
    )


def _whole(values: Array) -> NDArray[Any]:
    """Rounded; what is no number of 32 bits is missing."""
    rounded = np.rint(values)
    return np.where(np.abs(rounded) < LARGEST_INT32, rounded, _MISSING)


def _test_nm(test_um: Array) -> NDArray[Any]:
    """As a person would round them: what is too large for 32 bits is the largest, what is too small 1 nm."""
    nm = test_um * _NM_PER_UM
    sizes = np.clip(np.ceil(np.abs(nm)), 0, LARGEST_INT32 - 1)
    return np.where(np.abs(test_um) <= LARGEST_NUMBER, np.sign(nm) * sizes, 0)


def python_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the generated module gives; default of the files: as exported."""
    names: dict[str, Any] = {}
    # our own text, made a line above from numbers and variable names; names of the model stand in remarks only
    exec(compile((files or python_files(model))[f"{MODULE_NAME}.py"], f"{MODULE_NAME}.py", "exec"), names)  # noqa: S102
    program = names[CLASS]()
    return called(program, program.step, model, rows, "", float)
