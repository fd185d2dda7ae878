"""`model show`, `model check` and `model card`: what a model file says, whether it keeps its word, how good it is."""

from pathlib import Path
from typing import Annotated

from selector.cli.shared import showing
from selector.cli.shared.option_table import argument, option
from selector.cli.shared.showing import AsJson

Model = Annotated[Path, argument("model MODEL.json")]


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


def check(
    model: Model, as_json: AsJson = False, accept: Annotated[bool, option("model check --accept")] = False
) -> None:
    """Recomputes the vectors of a model file and looks for what would go wrong on a control.

    Ends with exit code 2 when the file contradicts itself and must not be used. With --accept a guard that was changed
    by hand counts as meant: where model and fallbacks still give what the file expects, it is written anew.
    """
    from selector.controllers.finding_table import FINDINGS
    from selector.controllers.model_file import ChangedFileError, read_model, write_model
    from selector.controllers.self_check import model_findings, require_usable, sealed

    changed = None
    try:
        read = read_model(model, is_changed=accept)
    except ChangedFileError as error:
        changed, read = error, read_model(model, is_changed=True)
    if accept:
        require_usable(model_findings(read.model_copy(update={"guard_vectors": ()})), model)
        read = sealed(read, is_kept=bool(read.test_vectors) and not read.fallbacks)
        write_model(read, model)
    findings = model_findings(read)
    if changed is not None:
        findings = (FINDINGS.finding("digest-mismatch", f"The file was changed: {changed.found}."), *findings)
    usable = not any(finding.level == "error" for finding in findings)
    if as_json:
        showing.print_json(
            {"schema": "selector.model-check/1", "file": model.name, "usable": usable, "findings": findings}
        )
    else:
        console = showing.screen(as_json=not usable)
        showing.show_findings(console, findings, everything=True)
        if accept:
            showing.show_written(console, model)
    if changed is not None:
        raise changed
    require_usable(findings, model)


def card(model: Model, out: Annotated[Path, option("model card --out")]) -> None:
    """Writes the card of a model: machine, data, method, ranges, coefficients, limits, validation, identity."""
    from selector.atomic_file import refuse_to_replace_input
    from selector.controllers.model_file import read_model
    from selector.telling.model_card import model_card_account
    from selector.telling.page import write_account

    read = read_model(model)
    refuse_to_replace_input(out, [model], "--out")
    write_account(model_card_account(read), out)
    showing.show_written(showing.screen(), out)
