"""Notebooks run from top to bottom, hold what they claim, and are stored with what they print and small pictures."""

from __future__ import annotations

import ast
import importlib
import json
import os
from pathlib import Path

import pytest
from plotly.graph_objects import Figure

from docs.store_notebooks import stored

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
CLAIMS = {
    "01": """
import numpy as np
from selector.audit.checks import CLOSURE
assert np.allclose(closure, CLOSURE, atol=5e-5)  # four printed decimals
assert len(groups.groups) == 2
three = [step.partition for step in lambda_axis(SIMILARITY, SENSORS) if len(step.partition.groups) == 3]
assert three
assert all(any({"T3", "T5"} <= set(group) for group in cut.groups) for cut in three)
assert Counter(line.verdict for line in lines) == {
    "agrees by construction": 50,
    "agrees independently": 51,
    "contradicts": 14,
    "cannot be checked": 7,
    "in tension": 6,
}
assert triple.adjusted_r2 > pair.adjusted_r2
""",
    "02": """
assert later.overall["Y1"].rmse_um < 0.25 * later.overall["Y1"].before_rmse_um
assert any(finding.id == "one-run-only" for finding in real.findings)
assert unseen.overall["Z"].rmse_um < 0.25 * unseen.overall["Z"].before_rmse_um
assert any(finding.id == "outside-valid-range" for finding in unseen.findings)
assert after < 0.25 * before
""",
    "03": """
assert left <= TOLERANCE_UM + 1e-6
assert without > 2 * TOLERANCE_UM  # else there is nothing to correct
""",
    "04": """
assert all(abs(value / published[name] - 1) < 0.002 for name, value in zip(found.names, found.values, strict=True))
rms = {law: np.sqrt(np.mean(values**2)) for law, values in error_um.items()}
assert rms["speed over two samples"] < 2.0
assert rms["true speed"] > 1.9 * rms["speed over two samples"]
assert free_mm > 1.0
""",
    "05": """
assert found.verdict == "missing-physics"
assert {effect.id for effect in found.effects} == {"thermal.memory"}
assert found.fit["Z"].heldout.rmse_after < 0.5 * found.fit["Z"].heldout.rmse_before
""",
    "06": """
import numpy as np
assert "SIGN UNVERIFIED" in component
assert all(part.is_explained for part in proof.parts)
assert broken.mode == Mode.HOLD
assert broken.correction_um == now.correction_um
assert np.isclose(now.correction_um["Z"], -(-1.871 + 6.0476 * 2.0 + 2.6667 * 1.0), atol=5e-4)
""",
}
"""What the text of each notebook says of its numbers, checked with its names after its last cell."""
MOST_KB = 250
QUESTION, SAYS, SAYS_NOT = "**Question.**", "**What it says.**", "**What it does not say.**"


def cells(path: Path, kind: str) -> list[str]:
    notebook = json.loads(path.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == kind]


def test_every_notebook_has_its_claims():
    assert [path.stem[:2] for path in NOTEBOOKS] == list(CLAIMS)


def shown_by(cell: str, names: dict[str, object]) -> object:
    """Runs a cell with the names of those before it; the value that a notebook would show under it."""
    tree = ast.parse(cell)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<cell>", "exec"), names)
    return eval(compile(ast.Expression(last.value), "<cell>", "eval"), names) if last else None


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_is_right(path, monkeypatch, capsys):
    """In this process, which has imported and compiled what each of six kernels would import and load anew."""
    monkeypatch.chdir(FOLDER)
    names: dict[str, object] = {"__name__": "__main__"}
    shown = [shown_by(cell, names) for cell in cells(path, "code")]
    exec(compile(CLAIMS[path.stem[:2]], f"<claims of {path.stem}>", "exec"), names)
    assert capsys.readouterr().err == ""
    assert any(isinstance(value, Figure) for value in shown)


def test_a_reader_runs_a_notebook_in_a_kernel_of_its_own(monkeypatch):
    """That whose own work is the least; the longest imports of all of them are the same."""
    (path,) = FOLDER.glob("04-*.ipynb")
    nbformat, nbclient = importlib.import_module("nbformat"), importlib.import_module("nbclient")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(FOLDER.parent), os.environ.get("PYTHONPATH", "")]))
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.append(nbformat.v4.new_code_cell(CLAIMS["04"]))
    nbclient.NotebookClient(
        notebook, timeout=900, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}}
    ).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    warned = [o.text for o in outputs if o.output_type == "stream" and o.name == "stderr"]
    assert warned == []
    assert any("application/vnd.plotly.v1+json" in output.get("data", {}) for output in outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_with_what_it_prints_and_small_pictures(path):
    text = path.read_text(encoding="utf-8")
    assert text == stored(text), "run `python -m docs.store_notebooks`"
    assert len(text) < 1000 * MOST_KB
    outputs = [output for cell in json.loads(text)["cells"] for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert any(output["output_type"] == "stream" for output in outputs)
    assert str(FOLDER.parent) not in text


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_asks_answers_and_says_what_it_does_not(path):
    text = cells(path, "markdown")
    assert text[0].startswith("# ")
    assert QUESTION in text[0]
    assert "**Data.**" in text[0]
    assert SAYS in text[-1]
    assert SAYS_NOT in text[-1]
    assert not any("assert " in code for code in cells(path, "code"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_links_of_a_notebook_lead_somewhere(path):
    text = "\n".join(cells(path, "markdown"))
    targets = [part.partition(")")[0] for part in text.split("](")[1:]]
    assert targets
    assert all((path.parent / target).is_file() for target in targets)


def test_what_running_leaves_is_not_stored_but_text_and_pictures_are():
    said = {"output_type": "stream", "name": "stdout", "text": "a\nb\n"}
    drawn = {"output_type": "display_data", "metadata": {"x": 1},
             "data": {"application/vnd.plotly.v1+json": {}, "text/html": "<div>", "image/png": "iVBO\n"}}  # fmt: skip
    shown = {"output_type": "execute_result", "execution_count": 7, "metadata": {}, "data": {"text/plain": "42"}}
    page = {"output_type": "display_data", "metadata": {}, "data": {"text/html": "<div>"}}
    dirty = {
        "cells": [
            {"cell_type": "code", "execution_count": 7, "id": "a1", "metadata": {"collapsed": True},
             "outputs": [said, drawn, shown, page], "source": ["1 + 1\n", "\n"]},
            {"cell_type": "markdown", "id": "b", "metadata": {"x": 1}, "source": "text", "attachments": {}},
        ],
        "metadata": {"kernelspec": {"name": "mine"}}, "nbformat": 4, "nbformat_minor": 2,
    }  # fmt: skip
    clean = json.loads(stored(json.dumps(dirty)))
    assert clean["cells"] == [
        {"cell_type": "code", "execution_count": None, "id": "cell-01", "metadata": {}, "outputs": [
            {"name": "stdout", "output_type": "stream", "text": ["a\n", "b\n"]},
            {"data": {"image/png": "iVBO"}, "metadata": {}, "output_type": "display_data"},
            {"data": {"text/plain": ["42"]}, "metadata": {}, "output_type": "display_data"}], "source": ["1 + 1"]},
        {"cell_type": "markdown", "id": "cell-02", "metadata": {}, "source": ["text"]},
    ]  # fmt: skip
    assert clean["metadata"]["kernelspec"]["name"] == "python3"
    assert stored(json.dumps(clean)) == stored(json.dumps(dirty))
