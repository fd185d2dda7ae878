"""`model show`, `model check` and `model card`: what a model file says, whether it keeps its word, how good it is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.cli import showing
from selector.cli.showing import AsJson
from selector.errors import ModelFileError

if TYPE_CHECKING:
    from selector.controllers.model_file import ModelFile

Model = Annotated[Path, typer.Argument(metavar="MODEL.json", help="A model file, as `selector select` writes it.")]


def show(model: Model, as_json: AsJson = False) -> None:
    """Prints a model as formulas in readings and rises, with the range in which each sensor was seen."""
    from selector.controllers.formula import formula_text, legend_text
    from selector.controllers.model_io import read_model

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
    for line in _particulars(read):
        console.print(line, markup=False)


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
    from selector.cli.files import refuse_to_replace_input
    from selector.controllers.model_io import read_model
    from selector.report.model_card import write_model_card

    read = read_model(model)
    refuse_to_replace_input(out, [model], "--out")
    write_model_card(out, read)
    showing.screen().print(f"wrote {out}", markup=False)


def _particulars(model: ModelFile) -> list[str]:
    """One line for each thing that a person decides on: memory, sign, proof, limits, faults, origin."""
    from selector.controllers.signs import is_turned

    lines = [
        f"memory {state.name}: {state.source} through a first-order lag of {showing.duration_text(state.tau_s)}"
        for state in model.states
    ]
    lines += [
        f"sign of {output.name}: turned round, the correction is the displacement itself"
        for output in model.outputs
        if is_turned(output)
    ]
    for name, proof in model.validation.items():
        if proof.heldout_rmse_um is None:
            lines.append(f"proof of {name}: none; this model has not been tried on unseen runs")
            continue
        most = "" if proof.heldout_max_um is None else f", at most {proof.heldout_max_um:.3g} µm"
        lines.append(
            f"proof of {name}: {proof.heldout_rmse_um:.3g} µm RMS{most} on unseen data ({proof.method or '?'})"
        )
    guard = model.guard
    if not guard.limits:
        lines.append("correction: no limit decided")
    for limit in guard.limits:
        clamp = "no limit decided" if limit.clamp_um is None else f"at most ±{limit.clamp_um:g} µm"
        slew = "" if limit.slew_um_per_s is None else f", {limit.slew_um_per_s:g} µm/s"
        lines.append(f"correction of {limit.output}: {clamp}{slew}")
    lines.append(f"when a sensor breaks: {guard.on_fault}; models without one sensor: {len(model.fallbacks)}")
    lines.append(f"test vectors: {len(model.test_vectors)}")
    origin = model.provenance
    runs = ", ".join(origin.data_sha256) or "not said"
    version = "" if origin.version is None else f", selector {origin.version}"
    lines.append(f"made from runs: {runs}{version}{'' if origin.date is None else f', {origin.date}'}")
    return lines
