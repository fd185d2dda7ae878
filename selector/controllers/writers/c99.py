"""Plain C99 without any library: a header and a source file, in double or single precision."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from selector.controllers.finding_table import FINDINGS
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import PLACES, Language, Program, Variable, plain
from selector.controllers.single_precision import single_precision_findings, single_precision_lines
from selector.controllers.writers.exported import Exported, filled, heading, with_sheet
from selector.errors import OptionError

Precision = Literal["double", "float"]
NAME = "thermal_correction"
SINGLE_NAME = f"{NAME}_f"


class _C(Language):
    signs: Mapping[str, str] = {"and": "&&", "or": "||"}
    negation = "!"
    assignment = "{to} = {value};"
    condition = "if ({condition}) {{"
    otherwise = "} else {"
    end = "}"
    remark = "/* {text} */"
    prefixes = dict.fromkeys(PLACES, "m->")

    def __init__(self, precision: Precision) -> None:
        self.precision = precision

    def real(self, value: float) -> str:
        if self.precision == "double":
            return repr(float(value))
        with np.errstate(over="ignore"):
            rounded = np.float32(value)
        if not np.isfinite(rounded) or (rounded == 0.0 and value != 0.0):
            raise OptionError(
                f"a number of the model, {value:g}, does not fit single precision",
                expected="numbers between 1e-45 and 3.4e38",
                where="model file",
                advice="centre and scale the inputs: make the model again with `selector select`",
            )
        text = str(rounded)
        return (text if "." in text or "e" in text else f"{text}.0") + "f"

    def flag(self, value: bool) -> str:
        return "1" if value else "0"


def c_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """Double precision in ``thermal_correction.*``, single in ``thermal_correction_f.*`` if it can."""
    try:
        in_single = c_files(model, precision="float", name=SINGLE_NAME, is_sign_verified=is_sign_verified)
        findings = tuple(single_precision_findings(model, f"{SINGLE_NAME}.c"))
    except OptionError as error:
        in_single = {}
        findings = (
            FINDINGS.finding("no-single-precision", f"No single precision: {error.found}.", suggestion=error.advice),
        )
    files = {**c_files(model, is_sign_verified=is_sign_verified), **in_single}
    return with_sheet("c", model, files, findings=findings, name=NAME, single=SINGLE_NAME)


def c_files(
    model: ModelFile, *, precision: Precision = "double", name: str = NAME, is_sign_verified: bool = False
) -> dict[str, str]:
    """``<name>.h`` and ``<name>.c``: a struct with inputs, outputs and state, ``<name>_init`` and ``<name>_step``."""
    program = guarded_program(model)
    bound = [plain(line) for line in single_precision_lines(model)] if precision == "float" else []
    head = [f" * {line}" for line in [*heading(model, is_sign_verified=is_sign_verified), *bound]]
    parts = c_parts(program, precision)
    values = {"head": head, "name": name, "guard": f"{name.upper()}_H"} | parts
    return {f"{name}.h": filled("c_header", **values), f"{name}.c": filled("c_source", **values)}


def c_parts(program: Program, precision: Precision) -> dict[str, list[str]]:
    """Lines for a struct ``m``: its members, their initial values, temporaries, statements."""
    language = _C(precision)
    return {
        "members": list(_members(program, precision)),
        "initial": [f"    m->{one.name} = {language.initial(one)};" for one in _lasting(program)],
        "temporaries": [f"    {_type(one, precision)} {one.name};" for one in program.of("temporary")],
        "body": list(language.lines(program.body, 1)),
    }


def _members(program: Program, precision: Precision) -> Iterator[str]:
    """Members of the struct, one a line, with what they mean."""
    for place, title in PLACES.items():
        yield f"    /* {title} */"
        for one in _lasting(program):
            if one.place == place:
                about = f" /* {plain(one.about)} */" if one.about else ""
                yield f"    {_type(one, precision)} {one.name};{about}"


def _lasting(program: Program) -> Sequence[Variable]:
    return [one for one in program.variables if one.place != "temporary"]


def _type(variable: Variable, precision: Precision) -> str:
    return precision if variable.kind == "real" else "int"
