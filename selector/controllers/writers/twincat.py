"""The function block as a file of a TwinCAT 3 PLC project."""

from __future__ import annotations

import uuid
from collections.abc import Mapping

from selector.controllers.model_file import ModelFile
from selector.controllers.model_io import equations_sha256
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Place
from selector.controllers.writers.exported import Exported
from selector.controllers.writers.sign_test import sign_test_of_block
from selector.controllers.writers.structured_text import (
    BLOCK,
    SECTIONS,
    StructuredText,
    declaration_lines,
    head_lines,
    joined,
)

# early builds refuse RETAIN, later ones keep it with NOVRAM and a retain handler only; PERSISTENT they all know
_SECTIONS: Mapping[Place, str] = {**SECTIONS, "retained": "VAR PERSISTENT"}


def tcpou_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``FB_ThermalCorrection.TcPOU``: the block of `st_export`, its retained variables PERSISTENT."""
    program = guarded_program(model)
    language = StructuredText()
    declaration = joined(
        [
            *head_lines(model, is_sign_verified=is_sign_verified),
            *declaration_lines(program, language, BLOCK, _SECTIONS),
        ]
    )
    text = (
        '<?xml version="1.0" encoding="utf-8"?>\n'
        '<TcPlcObject Version="1.1.0.1">\n'
        f'  <POU Name="{BLOCK}" Id="{{{guid(model)}}}" SpecialFunc="None">\n'
        f"    <Declaration>{_cdata(declaration)}</Declaration>\n"
        "    <Implementation>\n"
        f"      <ST>{_cdata(joined(list(language.lines(program.body))))}</ST>\n"
        "    </Implementation>\n"
        "  </POU>\n"
        "</TcPlcObject>\n"
    )
    return Exported(
        files={f"{BLOCK}.TcPOU": text},
        install=(
            f"In the PLC project: POUs, Add, Existing Item, {BLOCK}.TcPOU. Declare one instance of it in a program.",
            "Call it in a cyclic task. Wire dt_s to the real cycle time [s], the readings and positions in the units "
            "that stand behind them (positions in m), is_ready and is_wanted.",
            "After a start of TwinCAT set is_restart to TRUE in the first call only, and standstill_s to how long it "
            "was off [s]; without a clock, to 1.0E6.",
            "Persistent variables are written when TwinCAT shuts down: have a UPS, or call FB_WritePersistentData "
            "every few minutes.",
            "Hand k0_1 ... [um] and slope_1 ... [um/m] to the axis, or add correction_1 ... [um].",
        ),
        sign_test=sign_test_of_block(model),
        silently=(
            "After a power failure without a UPS the persistent variables are gone or old: then start readings are "
            "taken anew, on a warm machine too.",
            "Reset origin forgets the start readings.",
            "Called with dt_s = 0 for ever, the correction stands still: dt_s must be the real cycle time.",
        ),
    )


def guid(model: ModelFile) -> uuid.UUID:
    """The identity of the file: the same for the same model."""
    return uuid.uuid5(uuid.NAMESPACE_URL, f"selector.model/{equations_sha256(model)}")


def _cdata(text: str) -> str:
    return "<![CDATA[" + text.replace("]]>", "]]]]><![CDATA[>") + "]]>"
