"""The generated macro of RepRapFirmware as Python in single precision: what is written, and no more."""

import re
from collections.abc import Mapping
from dataclasses import replace
from types import CodeType, SimpleNamespace
from typing import Any

import numpy as np

from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import Answers, Rows, called
from selector.controllers.writers.fanuc import macro_model
from selector.controllers.writers.reprapfirmware import AXES, START, STEP

#: What stands in a macro, and what it is in Python; every sensor is there, and nothing is kept in files.
_PYTHON = (
    (r" +;.*", ""), (r"^( *)(?:M98|echo) .*", r"\1pass"),
    (r"^( *)M290 R0 ([XYZ])\{(.*)\}", r"\1at['\2'].babystep = \3"),
    (r"^( *)set ", r"\1"), (r"^( *)var ", r"\1var."), (r"^( *)global ", r"\1global."), (r"\bglobal\.", "lasting."),
    (r"^( *(?:if .*|else))$", r"\1:"), (r"\bexists\(lasting\.(\w+)\)", r"hasattr(lasting, '\1')"),
    (r"\bexists\(sensors.*\)", "true"), (r"\bfileexists\(.*\)", "false"),
    (r"(?<![\w.])((?:\d+\.\d+|\d+(?=e))(?:e[-+]\d+)?)", r"number(\1)"), ("&&", "and"), (r"\|\|", "or"),
    ("!(?!=)", "not "), (r"\btrue\b", "True"), (r"\bfalse\b", "False"), (r"\bnull\b", "None"),
)  # fmt: skip


def reprapfirmware_answers(model: ModelFile, rows: Rows, files: Mapping[str, str]) -> Answers:
    """What the macro leaves in the babysteps, called in every row, with its mode and codes."""
    at = {axis: SimpleNamespace(homed=True, babystep=np.float32(0.0)) for axis in AXES}
    lasting, state = SimpleNamespace(), SimpleNamespace(upTime=0, time=None)
    analog = [SimpleNamespace(state="ok") for _ in model.inputs]
    names: dict[str, Any] = {"number": np.float32, "lasting": lasting, "state": state, "at": at}
    names |= {name: SimpleNamespace() for name in ("move", "sensors", "var")}
    names["move"].axes, names["sensors"].analog = list(at.values()), analog
    exec(_compiled(files[START]), names)  # noqa: S102
    step, sent = _compiled(files[STEP]), []

    def call() -> None:
        for k, sensor in enumerate(analog):
            sensor.lastReading = getattr(lasting, f"selector_reading_{k + 1}")
            setattr(lasting, f"selector_number_{k + 1}", k)
        # so that the difference of both times is the time of the row to the last bit
        state.upTime, lasting.selector_called_at = lasting.selector_dt_s, 0
        for axis in at.values():
            axis.homed = lasting.selector_is_ready
        exec(step, names)  # noqa: S102
        sent.append([1000.0 * float(at[output.axis_or_name.upper()].babystep) for output in model.outputs])

    with np.errstate(all="ignore"):
        found = called(lasting, call, macro_model(model), rows, "selector_", np.float32)
    return replace(found, correction_um=np.array(sent).reshape(found.correction_um.shape))


def _compiled(text: str) -> CodeType:
    # our own text, from numbers and variable names; names of the model stand in remarks only
    for was, becomes in _PYTHON:
        text = re.sub(was, becomes, text, flags=re.MULTILINE)
    return compile(text, "macro", "exec")
