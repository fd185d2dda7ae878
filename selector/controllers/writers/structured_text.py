"""Structured Text of IEC 61131-3: one function block in LREAL or REAL, also for TwinCAT 3 and as PLCopen XML."""

import re
import textwrap
import uuid
from collections.abc import Mapping, Sequence
from html import escape
from typing import Literal

import numpy as np

from selector import __version__
from selector.controllers.model_file import ModelFile, equations_sha256
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Language, Place, Program, Variable, plain
from selector.controllers.writers.exported import Exported, filled, heading, with_sheet
from selector.errors import OptionError

RealType = Literal["LREAL", "REAL"]
NAME = "thermal_correction"
BLOCK = "FB_ThermalCorrection"
LONGEST_NAME = 24  #: Characters: more are refused by STEP 7 before TIA Portal.
LONGEST_LINE = 120

#: Place of a variable → what opens its declarations.
SECTIONS: Mapping[Place, str] = {
    "input": "VAR_INPUT",
    "output": "VAR_OUTPUT",
    "retained": "VAR RETAIN",
    "kept": "VAR",
    "temporary": "VAR_TEMP",
}

_RESERVED = frozenset(filled("structured_text_words").split())
# what STEP 7 takes for an address, a block, a timer or a counter: DB7, MW10, T1, and in German E0, A0, Z1
_ADDRESS = re.compile(r"(D|DI|M|I|Q|E|A|L|P|PI|PQ|PE|PA)[XBWD]?\d+|(DB|DI|FB|FC|OB|SFB|SFC|SDB|UDT|VAT|T|C|Z)\d+", re.I)


def is_reserved(name: str) -> bool:
    """Whether a name means something else in one of the dialects, in whatever letters."""
    return name.upper() in _RESERVED or _ADDRESS.fullmatch(name) is not None


class StructuredText(Language):
    """Words of Structured Text and of SCL.

    `real_type` is LREAL, IEEE 754 binary64, or REAL, binary32 with every literal rounded to it.
    """

    signs: Mapping[str, str] = {"and": "AND", "or": "OR", "==": "="}
    negation = "NOT "
    assignment = "{to} := {value};"
    condition = "IF {condition} THEN"
    otherwise = "ELSE"
    end = "END_IF;"
    nothing = ";"
    remark = "(* {text} *)"
    # SCL has no two signs in a row
    signed_above = 0

    def __init__(self, real_type: RealType = "LREAL") -> None:
        self.real_type = real_type

    def real(self, value: float) -> str:
        """A literal with a digit on both sides of its point, exponent or not."""
        if self.real_type == "LREAL":
            text = repr(float(value))
        else:
            with np.errstate(over="ignore"):
                text = str(np.float32(value))
        if not np.isfinite(float(text)) or (float(text) == 0.0 and value != 0.0):
            raise OptionError(
                f"the number {value:g}",
                expected=f"numbers that {self.real_type} can hold (REAL: 1e-45 to 3.4e38)",
                where="model file",
                advice="correct the model, or export it for a control that calculates in LREAL",
            )
        mantissa, _, exponent = text.partition("e")
        if "." not in mantissa:
            mantissa += ".0"
        return f"{mantissa}E{int(exponent):+d}" if exponent else mantissa

    def flag(self, value: bool) -> str:
        """TRUE or FALSE."""
        return "TRUE" if value else "FALSE"

    def name(self, variable: Variable) -> str:
        """The name of the program, unless the language has it for itself (DT: DATE_AND_TIME)."""
        return f"v_{variable.name}" if is_reserved(variable.name) else variable.name

    def type(self, variable: Variable) -> str:
        """The type of a variable."""
        return {"real": self.real_type, "flag": "BOOL", "code": "INT"}[variable.kind]


def st_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``thermal_correction.st``: the function block FB_ThermalCorrection in LREAL."""
    return _exported("st", f"{NAME}.st", st_text(model, is_sign_verified=is_sign_verified), model)


def _exported(target: str, file: str, text: str, model: ModelFile) -> Exported:
    return with_sheet(target, model, {file: text}, name=NAME, block=BLOCK)


def st_text(model: ModelFile, *, is_sign_verified: bool = False) -> str:
    """The text of ``thermal_correction.st``."""
    head = head_lines(model, is_sign_verified=is_sign_verified)
    return block_text(head, guarded_program(model), StructuredText(), BLOCK)


def block_text(
    head: list[str],
    program: Program,
    language: StructuredText,
    block: str,
    sections: Mapping[Place, str] = SECTIONS,
    begin: str = "",
) -> str:
    """A whole function block; `begin` stands between declarations and statements."""
    declared = declaration_lines(program, language, block, sections)
    return joined([*head, *declared, begin, *language.lines(program.body), "END_FUNCTION_BLOCK"])


def head_lines(model: ModelFile, *, is_sign_verified: bool) -> list[str]:
    """A comment for the person who opens the file."""
    return ["(*", *(f" * {line}" for line in heading(model, is_sign_verified=is_sign_verified)), " *)"]


def declaration_lines(
    program: Program, language: StructuredText, block: str, sections: Mapping[Place, str] = SECTIONS
) -> list[str]:
    """``FUNCTION_BLOCK`` and its variables."""
    lines = [f"FUNCTION_BLOCK {block}"]
    for opening, variables in _sections(program, language, sections).items():
        lines += [opening, *(_declared(one, language) for one in variables), "END_VAR"]
    return lines


def _sections(program: Program, language: StructuredText, sections: Mapping[Place, str]) -> dict[str, list[Variable]]:
    """What opens the declarations of a section → its variables; none that is empty."""
    names = [language.name(one).lower() for one in program.variables]
    if len(set(names)) < len(names) or max(map(len, names)) > LONGEST_NAME:
        raise ValueError(f"names that no control takes: {names}")
    found = {
        opening: [one for one in program.variables if sections[one.place] == opening] for opening in sections.values()
    }
    return {opening: variables for opening, variables in found.items() if variables}


def joined(lines: Sequence[str]) -> str:
    """One text; long lines go on in the next, which means the same everywhere outside of literals."""
    short = []
    for line in lines:
        before = " " * (len(line) - len(line.lstrip()) + 8)
        short += textwrap.wrap(
            line, LONGEST_LINE, subsequent_indent=before, break_long_words=False, break_on_hyphens=False
        ) or [""]
    return "\n".join(short) + "\n"


def _declared(one: Variable, language: StructuredText) -> str:
    text = f"{language.indent}{language.name(one)} : {language.type(one)}"
    if one.place != "temporary":
        text += f" := {language.initial(one)}"
    about = f" (* {plain(one.about)} *)" if one.about else ""
    return f"{text};{about}"


# early builds refuse RETAIN, later ones keep it with NOVRAM and a retain handler only; PERSISTENT they all know
_SECTIONS: Mapping[Place, str] = {**SECTIONS, "retained": "VAR PERSISTENT"}


def tcpou_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``FB_ThermalCorrection.TcPOU``: the block of `st_export`, its retained variables PERSISTENT."""
    program = guarded_program(model)
    language = StructuredText()
    declaration = joined(
        [*head_lines(model, is_sign_verified=is_sign_verified), *declaration_lines(program, language, BLOCK, _SECTIONS)]
    )
    body = _cdata(joined(list(language.lines(program.body))))
    text = filled("twincat_pou", block=BLOCK, guid=guid(model), declaration=_cdata(declaration), body=body)
    return _exported("tcpou", f"{BLOCK}.TcPOU", text, model)


_LISTS: Mapping[Place, str] = {
    "input": "<inputVars>",
    "output": "<outputVars>",
    "retained": '<localVars retain="true">',
    "kept": "<localVars>",
    "temporary": "<tempVars>",
}
_NO_DATE = "1970-01-01"  # the schema wants one, and the same model is written the same on any day


def plcopen_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``FB_ThermalCorrection.xml``: the block of `st_export`, its interface as XML (PLCopen TC6, version 2.01)."""
    program, language = guarded_program(model), StructuredText()
    interface = []
    for opening, variables in _sections(program, language, _LISTS).items():
        declared = (f"  {_variable(one, language)}" for one in variables)
        interface += [opening, *declared, f"</{opening[1:].split()[0].rstrip('>')}>"]
    text = filled(
        "plcopen_project",
        version=__version__,
        date=(model.provenance and model.provenance.date) or _NO_DATE,
        block=BLOCK,
        interface=textwrap.indent("\n".join(interface), 10 * " "),
        body=_cdata(joined([*head_lines(model, is_sign_verified=is_sign_verified), *language.lines(program.body)])),
    )
    return _exported("plcopen", f"{BLOCK}.xml", text, model)


def _variable(one: Variable, language: StructuredText) -> str:
    initial = f'<initialValue><simpleValue value="{language.initial(one)}"/></initialValue>'
    about = f"<documentation><xhtml:p>{escape(plain(one.about))}</xhtml:p></documentation>"
    return (
        f'<variable name="{language.name(one)}"><type><{language.type(one)}/></type>'
        f"{initial if one.place != 'temporary' else ''}{about if one.about else ''}</variable>"
    )


def guid(model: ModelFile) -> uuid.UUID:
    """The identity of the file: the same for the same model."""
    return uuid.uuid5(uuid.NAMESPACE_URL, f"selector.model/{equations_sha256(model)}")


def _cdata(text: str) -> str:
    return "<![CDATA[" + text.replace("]]>", "]]]]><![CDATA[>") + "]]>"
