"""The generated Python module, executed row by row."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from selector.controllers.model_file import ModelFile
from selector.controllers.replay.rows import Answers, Rows
from selector.controllers.writers.python_module import CLASS, NAME, python_files


def python_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the generated module gives; default of the files: as exported."""
    names: dict[str, Any] = {}
    # our own text, made a line above from numbers and variable names; names of the model stand in remarks only
    exec(compile((files or python_files(model))[f"{NAME}.py"], f"{NAME}.py", "exec"), names)  # noqa: S102
    program = names[CLASS]()
    n, outputs, inputs = len(rows), len(model.outputs), len(model.inputs)
    found = Answers.empty(n, outputs, inputs)
    readings, positions = rows.readings.tolist(), rows.positions_m.tolist()
    for k in range(n):
        program.dt_s, program.standstill_s = float(rows.dt_s[k]), float(rows.standstill_s[k])
        for name in ("is_ready", "is_wanted", "is_restart"):
            setattr(program, name, bool(getattr(rows, name)[k]))
        for i, value in enumerate(readings[k]):
            setattr(program, f"reading_{i + 1}", value)
        for i, value in enumerate(positions[k]):
            setattr(program, f"position_{i + 1}", value)
        program.step()
        for i in range(outputs):
            found.correction_um[k, i] = getattr(program, f"correction_{i + 1}")
            found.k0_um[k, i] = getattr(program, f"k0_{i + 1}")
            found.slope_um_per_m[k, i] = getattr(program, f"slope_{i + 1}", 0.0)
        found.mode[k] = program.mode
        found.sensors[k] = [getattr(program, f"sensor_{i + 1}") for i in range(inputs)]
    return found
