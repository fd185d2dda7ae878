"""`model show`, `model check` and `model card`: what a model file says, whether it keeps its word, how good it is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from selector.cli.shared import showing
from selector.cli.shared.showing import AsJson
from selector.errors import ModelFileError

Model = Annotated[Path, typer.Argument(metavar="MODEL.json", help="A model file, as `selector select` writes it.")]


def show(model: Model, as_json: AsJson = False) -> None:
    """Prints a model as formulas in readings and rises, with the tables of its card."""
    from selector.controllers.evaluator import formula_text, legend_text
    from selector.controllers.guard.decided import is_turned
    from selector.controllers.model_file import read_model
    from selector.telling.account import Captioned, Heading
    from selector.telling.model_card import card_blocks

    read = read_model(model)
    if as_json:
        showing.print_json(
            {
                "schema": "selector.model-view/1",
                "file": model.name,
                "formulas": dict(line.split(" = ", 1) for line in formula_text(read).splitlines()),
                "model": read.model_dump(mode="json", by_alias=True),
            }
        )
        return
    console = showing.screen()
    console.print(formula_text(read), markup=False)
    console.print()
    console.print(legend_text(read), markup=False)
    console.print()
    for output in filter(is_turned, read.outputs):
        console.print(f"sign of {output.name}: turned round, the correction is the displacement itself", markup=False)
    caption = ""
    for block in card_blocks(read, 2):
        if isinstance(block, Heading):
            caption = block.text
        elif isinstance(block, Captioned):
            showing.show_captioned(console, block, caption)


def check(model: Model, as_json: AsJson = False) -> None:
    """Recomputes the test vectors of a model file and looks for what would go wrong on a control.

    Ends with exit code 2 when the file contradicts itself and must not be used.
    """
    from selector.controllers.self_check import check_model

    findings = check_model(model)
    wrong = [finding for finding in findings if finding.level == "error"]
    if as_json:
        showing.print_json(
            {"schema": "selector.model-check/1", "file": model.name, "usable": not wrong, "findings": findings}
        )
    else:
        showing.show_findings(showing.screen(), findings)
    if wrong:
        raise ModelFileError(
            "; ".join(finding.statement for finding in wrong),
            expected="a model file whose test vectors and numbers agree with each other",
            where=str(model),
            advice="do not use this file; export the model again with `selector select --out DIR`",
        )


def card(
    model: Model,
    out: Annotated[Path, typer.Option("--out", metavar="FILE.html", help="Where to write the card.")],
) -> None:
    """Writes the card of a model: machine, data, method, ranges, coefficients, limits, validation, identity."""
    from selector.atomic_file import refuse_to_replace_input
    from selector.controllers.model_file import read_model
    from selector.telling.model_card import model_card_account
    from selector.telling.page import write_account

    read = read_model(model)
    refuse_to_replace_input(out, [model], "--out")
    write_account(model_card_account(read), out)
    showing.show_written(showing.screen(), out)
