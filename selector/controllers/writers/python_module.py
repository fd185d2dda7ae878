"""A Python module without any import, and beside it what brings its corrections into words of a Mitsubishi M800."""

from selector.controllers.guard.decided import decided_limits
from selector.controllers.model_file import ModelFile, kept_sha256
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import PLACES, Program, PythonText, plain
from selector.controllers.program.statements import NO_READING
from selector.controllers.writers.exported import Exported, filled, heading, require_axes, require_own_axes, with_sheet

MODULE_NAME = "thermal_correction"
CLASS = "ThermalCorrection"
M800_FILE = "m800_words.py"


def python_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``thermal_correction.py``."""
    files = python_files(model, is_sign_verified=is_sign_verified)
    return with_sheet("python", model, files, name=MODULE_NAME)


def mitsubishi_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``thermal_correction.py`` and ``m800_words.py``."""
    where, axes = "Mitsubishi M800, words from R5700 on", [output.axis_or_name.upper() for output in model.outputs]
    require_own_axes(model, where)
    require_axes(axes, "XYZ", "the six words are of these", where)
    words = filled(
        "m800_words",
        head=[f"# {line}" for line in heading(model, is_sign_verified=is_sign_verified)],
        model=repr(kept_sha256(model)),
        axes=repr(axes),
        clamps=repr([of.clamp_um for of in decided_limits(model)[0].values()]),
        retained=[f"    {one.name!r}," for one in guarded_program(model).of("retained")],
        no_reading=repr(NO_READING),
    )
    files = {**python_files(model, is_sign_verified=is_sign_verified), M800_FILE: words}
    return with_sheet("mitsubishi", model, files, file=M800_FILE, module=MODULE_NAME)


def python_files(model: ModelFile, *, is_sign_verified: bool = False) -> dict[str, str]:
    """``thermal_correction.py`` with one class: set its inputs, call ``step()``, read its outputs."""
    program = guarded_program(model)
    head = [f"# {line}" for line in heading(model, is_sign_verified=is_sign_verified)]
    return {f"{MODULE_NAME}.py": "\n".join([*head, *program_class(program)]) + "\n"}


def program_class(program: Program) -> list[str]:
    """Lines of the class ``ThermalCorrection``; Python 2.7 takes them, too."""
    language = PythonText()
    lines = [
        "",
        "",
        f"class {CLASS}:",
        '    """Set the inputs, call step() every cycle, read the outputs."""',
        "",
        "    def __init__(self):",
    ]
    for place, title in PLACES.items():
        lines.append(f"        # {title}")
        for one in program.variables:
            if one.place == place:
                about = f"  # {plain(one.about)}" if one.about else ""
                lines.append(f"        self.{one.name} = {language.initial(one)}{about}")
    return [*lines, "", "    def step(self):", *language.lines(program.body, 2)]
