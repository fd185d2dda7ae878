"""What stands at the head of every exported file, for the person who opens it on the control."""

from __future__ import annotations

from selector import __version__
from selector.controllers.formula import formula_text
from selector.controllers.model_file import ModelFile
from selector.controllers.model_io import equations_sha256
from selector.controllers.program.text_of_program import plain
from selector.controllers.signs import is_turned

UNVERIFIED = "SIGN UNVERIFIED: command +10 um and read the indicator before cutting; see the commissioning sheet."
VERIFIED = "Sign verified, as the person said who exported it."


def heading(model: ModelFile, *, is_sign_verified: bool) -> list[str]:
    """Lines of ASCII: sign, formulas, units, hash of the equations, version."""
    lines = [
        UNVERIFIED if not is_sign_verified else VERIFIED,
        f"Model: {model.name}",
        *(f"  {line} [um]" for line in formula_text(model).splitlines()),
        "The correction of an axis is the negative of its displacement.",
        *(
            f"TURNED ROUND: the correction of {output.name} is the displacement itself; the control counts the axis "
            "the other way."
            for output in model.outputs
            if is_turned(output)
        ),
        f"Equations SHA-256 {equations_sha256(model)}",
        f"Written by selector {__version__}",
    ]
    return [plain(line) for line in lines]
