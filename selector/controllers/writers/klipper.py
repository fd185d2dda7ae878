"""Klipper: an extra with the generated Python inside that corrects every move, and its configuration section."""

import re
from collections.abc import Sequence

from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import decided_limits
from selector.controllers.model_file import Input, ModelFile, equations_sha256, kept_sha256
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import plain
from selector.controllers.program.statements import NO_READING
from selector.controllers.writers import exported
from selector.controllers.writers.python_module import program_class

NAME = "selector_correction"  #: Of the section, the module and its files
COMMAND = NAME.upper()
AXES = "XYZ"
MOST_INPUTS = 100  #: Moves wait while they are looked at: 0.4 ms for so many (benchmarks/bench_klipper.py).

_SECTION_NAME = re.compile(r"[A-Za-z0-9_.-]{1,48}")


def klipper_export(model: ModelFile, *, is_sign_verified: bool = False) -> exported.Exported:
    """``selector_correction.py`` for ``klippy/extras`` and ``selector_correction.cfg``."""
    where = "Klipper's move transform"
    axes = [output.axis_or_name for output in model.outputs]
    why = "these are what Klipper can add a correction to, and knows the position of"
    exported.require_axes((*axes, *axes_of(model)), AXES, why, where)
    exported.require_own_axes(model, where)
    if len(model.inputs) > MOST_INPUTS:
        raise exported.ExportRefusedError(
            f"{len(model.inputs)} inputs",
            expected=f"at most {MOST_INPUTS}: Klipper waits while they are looked at",
            where=where,
            advice="select fewer sensors (`selector select --max-sensors`)",
        )
    files = {
        f"{NAME}.py": klipper_extra(model, is_sign_verified=is_sign_verified),
        f"{NAME}.cfg": _section(model, is_sign_verified=is_sign_verified),
    }
    return exported.with_sheet("klipper", model, files, name=NAME, command=COMMAND)


def klipper_extra(model: ModelFile, *, is_sign_verified: bool = False) -> str:
    """Text of the module: what is decided for this model, its program, and what connects it with Klipper."""
    program = guarded_program(model, has_zero=True)
    limits, _ = decided_limits(model)
    outputs = []
    for k, output in enumerate(model.outputs, start=1):
        of, part = limits[output.name], output.position
        along = part and (_number(part.axis), part.valid_min_m, part.valid_max_m, part.reference_m)
        outputs.append((k, _number(output.axis_or_name), of.clamp_um, of.slew_um_per_s, along))
    of_outputs = "number, axis (0: X), clamp [um], slew limit [um/s], of a slope: along which axis, from, to, zero [m]"
    retained = [(one.name, one.kind == "flag") for one in program.of("retained")]
    lists: tuple[tuple[str, str, Sequence[object]], ...] = (
        ("INPUTS", "name, unit", [(plain(item.name), plain(item.unit)) for item in model.inputs]),
        ("OUTPUTS", of_outputs, outputs),
        ("POSITIONS", "axes whose position the program needs", [_number(axis) for axis in axes_of(model)]),
        ("RETAINED", "name in the program, whether it is a flag", retained),
    )
    lines = [f"# {line}" for line in exported.heading(model, is_sign_verified=is_sign_verified)]
    lines += ["# Python 2.7 and 3.", "import logging", "import math", "import os", "import time", ""]
    lines += [f"PROGRAM = {equations_sha256(model)!r}", f"MODEL = {kept_sha256(model)!r}  # the same without signs"]
    lines += [f"KEPT_FILE = {NAME + '_kept.txt'!r}", f"NO_READING = {NO_READING!r}"]
    for name, about, values in lists:
        lines += [f"# {about}", f"{name} = [", *(f"    {one!r}," for one in values), "]"]
    return exported.filled("klipper_extra", program=[*lines, *program_class(program)])


def _number(axis: str) -> int:
    return AXES.index(axis.upper())


def _section(model: ModelFile, *, is_sign_verified: bool) -> str:
    head = [f"# {line}" for line in exported.heading(model, is_sign_verified=is_sign_verified)]
    sensors = [line for k, item in enumerate(model.inputs, start=1) for line in _mapped(k, item)]
    return exported.filled("klipper_section", head=head, name=NAME, sensors=sensors)


def _mapped(k: int, item: Input) -> list[str]:
    """The lines of one sensor; Klipper refuses to start until those with ``>>>>`` are filled in."""
    about = f"{plain(item.name)} [{plain(item.unit)}]"
    if item.unit != "degC":
        return [f"# >>>> The object with {about}, and its status field, e.g. fan and rpm:", f"#sensor_{k}:",
                f"#field_{k}:"]  # fmt: skip
    if _SECTION_NAME.fullmatch(item.name):
        return [f"# >>>> {about}: correct the name, if the printer calls it otherwise.",
                f"sensor_{k}: temperature_sensor {item.name}"]  # fmt: skip
    return [f"# >>>> The object with {about}, e.g. temperature_sensor frame:", f"#sensor_{k}:"]
