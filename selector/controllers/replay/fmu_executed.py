"""The exported functional mock-up unit, run by FMPy: a step of communication for every row."""

import importlib
import io
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

from selector.controllers.c_compiler import compiler, compiler_version
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import Answers, Rows, called
from selector.controllers.writers.fmu import FILE, fmu_export
from selector.errors import NotExecutableError

TYPES = ("Float64", "Boolean", "Int32")


def fmpy_version() -> str:
    """What runs the unit, and what made its binary."""
    try:
        return f"FMPy {version('FMPy')}, {compiler_version(compiler())}"
    except PackageNotFoundError:
        return "no FMPy"


def fmu_answers(model: ModelFile, rows: Rows, files: Mapping[str, Any] | None = None) -> Answers:
    """What the unit gives; default: as exported."""
    try:
        fmpy = importlib.import_module("fmpy")
    except ImportError as error:
        raise NotExecutableError(
            "no FMPy",
            expected="the package FMPy, which runs functional mock-up units",
            where="--replay",
            advice="in the folder of selector: pip install '.[fmu]'; or export without --replay",
        ) from error
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        fmpy.extract(io.BytesIO((files or fmu_export(model).files)[FILE]), folder)
        if not (Path(folder) / "binaries" / fmpy.platform_tuple).is_dir():
            raise NotExecutableError(
                f"the unit has no binary for {fmpy.platform_tuple}",
                expected="one, which the C compiler makes when the unit is exported",
                where="--replay",
                advice="install a C compiler (Debian: apt install gcc) and export again, or export without --replay",
            )
        description = fmpy.read_model_description(folder)
        unit = fmpy.instantiate_fmu(folder, description, "CoSimulation")
        try:
            unit.enterInitializationMode()
            unit.exitInitializationMode()
            return _stepped(unit, description.modelVariables, model, rows)
        finally:
            unit.freeInstance()


def _stepped(unit: Any, variables: Any, model: ModelFile, rows: Rows) -> Answers:
    row, given = SimpleNamespace(at_s=0.0), rows.columns(model).keys()
    into = [[one for one in variables if one.type == kind and one.name in given] for kind in TYPES]
    out = [[one for one in variables if one.type == kind and one.causality == "output"] for kind in TYPES]

    def step() -> None:
        for kind, of in zip(TYPES, into, strict=True):
            values = [getattr(row, one.name) for one in of]
            getattr(unit, f"set{kind}")([one.valueReference for one in of], values)
        unit.doStep(row.at_s, row.dt_s)
        row.at_s += row.dt_s
        for kind, of in zip(TYPES, out, strict=True):
            found = getattr(unit, f"get{kind}")([one.valueReference for one in of])
            vars(row).update(zip((one.name for one in of), found, strict=True))

    return called(row, step, model, rows, "", float)
