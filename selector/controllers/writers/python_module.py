"""A Python module without any import, for edge computers and for controls that run Python."""

from selector.controllers.guard.decided import Mode
from selector.controllers.model_file import ModelFile
from selector.controllers.program.executed import PythonText
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import PLACES, Program, plain
from selector.controllers.writers.exported import Exported, heading, sheet, sign_test

MODULE_NAME = "thermal_correction"
CLASS = "ThermalCorrection"


def python_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``thermal_correction.py``."""
    install, silently = sheet("python", name=MODULE_NAME)
    return Exported(
        files=python_files(model, is_sign_verified=is_sign_verified),
        install=install,
        sign_test=sign_test(
            model,
            "Call step() in its cycle with is_ready = True and is_wanted = False, and send what it gives, until "
            "correction_1 ... are 0. No sensor is needed.",
            lambda k, um: f"program.test_um_{k} = {um!r}",
            lambda k, um: f"program.mode == {Mode.TEST:d}, program.correction_{k} == {um:g}",
            "Set test_um_1 ... to 0.0 and, when the indicator is back at zero, is_wanted to True.",
        ),
        silently=silently,
    )


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
