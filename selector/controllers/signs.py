"""Which sign a correction has on its control: the negative of the displacement, or turned round for an axis."""

from __future__ import annotations

from collections.abc import Collection

from selector.controllers.model_file import Fallback, ModelFile, Output, Sign
from selector.errors import OptionError

WITH: Sign = "correction = displacement"


def is_turned(output: Output) -> bool:
    """Whether the control counts the axis the other way: its correction is the displacement itself."""
    return output.sign == WITH


def with_turned_signs(model: ModelFile, outputs: Collection[str]) -> ModelFile:
    """The model with the corrections of these outputs turned round, whatever the file says of them; others stay.

    Displacements, and so the formulas and test vectors, stay as they are. Naming an output twice is naming it once, so
    that the same words give the same program from the model and from the copy of it that an export leaves.

    Raises
    ------
    OptionError
        The model has no such output.
    """
    names = [output.name for output in model.outputs]
    for name in outputs:
        if name not in names:
            raise OptionError(
                f"no output {name!r}",
                expected="one of " + ", ".join(names),
                where="--invert",
                advice="correct the name",
            )

    def turned(of: ModelFile | Fallback) -> tuple[Output, ...]:
        return tuple(
            output.model_copy(update={"sign": WITH}) if output.name in outputs else output for output in of.outputs
        )

    fallbacks = tuple(one.model_copy(update={"outputs": turned(one)}) for one in model.fallbacks)
    return model.model_copy(update={"outputs": turned(model), "fallbacks": fallbacks})
