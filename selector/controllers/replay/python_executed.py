"""The generated Python module, executed row by row."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from selector.controllers.model_file import ModelFile
from selector.controllers.replay.rows import Answers, Rows, called
from selector.controllers.writers.python_module import CLASS, NAME, python_files


def python_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the generated module gives; default of the files: as exported."""
    names: dict[str, Any] = {}
    # our own text, made a line above from numbers and variable names; names of the model stand in remarks only
    exec(compile((files or python_files(model))[f"{NAME}.py"], f"{NAME}.py", "exec"), names)  # noqa: S102
    program = names[CLASS]()
    return called(program, program.step, model, rows, "", float)
