"""Notebooks run from top to bottom, hold what they claim by their own assertions, and are stored without outputs."""

from __future__ import annotations

import importlib
import json
import os
from pathlib import Path

import pytest

from docs.strip_notebooks import stripped

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
QUESTION, SAYS, SAYS_NOT = "**Question.**", "**What it says.**", "**What it does not say.**"


def cells(path: Path, kind: str) -> list[str]:
    notebook = json.loads(path.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == kind]


def test_there_are_six():
    assert [path.stem[:2] for path in NOTEBOOKS] == ["01", "02", "03", "04", "05", "06"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, monkeypatch):
    """In a kernel of its own, like a reader's; the longest takes 12 s on two cores once machine code is compiled."""
    nbformat, nbclient = importlib.import_module("nbformat"), importlib.import_module("nbclient")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(FOLDER.parent), os.environ.get("PYTHONPATH", "")]))
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=900, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}}
    ).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    warned = [o.text for o in outputs if o.output_type == "stream" and o.name == "stderr"]
    assert warned == []
    assert any("application/vnd.plotly.v1+json" in output.get("data", {}) for output in outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_what_running_it_leaves(path):
    text = path.read_text(encoding="utf-8")
    assert text == stripped(text), "run `python -m docs.strip_notebooks`"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_asks_answers_and_says_what_it_does_not(path):
    text = cells(path, "markdown")
    assert text[0].startswith("# ")
    assert QUESTION in text[0]
    assert "**Data.**" in text[0]
    assert SAYS in text[-1]
    assert SAYS_NOT in text[-1]
    assert sum("assert " in code for code in cells(path, "code")) >= 1


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_links_of_a_notebook_lead_somewhere(path):
    text = "\n".join(cells(path, "markdown"))
    targets = [part.partition(")")[0] for part in text.split("](")[1:]]
    assert targets
    assert all((path.parent / target).is_file() for target in targets)


def test_stripping_takes_outputs_counts_and_metadata():
    dirty = {
        "cells": [
            {"cell_type": "code", "execution_count": 7, "id": "a1", "metadata": {"collapsed": True}, "outputs": [1],
             "source": ["1 + 1\n", "\n"]},
            {"cell_type": "markdown", "id": "b", "metadata": {"x": 1}, "source": "text", "attachments": {}},
        ],
        "metadata": {"kernelspec": {"name": "mine"}}, "nbformat": 4, "nbformat_minor": 2,
    }  # fmt: skip
    clean = json.loads(stripped(json.dumps(dirty)))
    assert clean["cells"] == [
        {"cell_type": "code", "execution_count": None, "id": "cell-01", "metadata": {}, "outputs": [],
         "source": ["1 + 1"]},
        {"cell_type": "markdown", "id": "cell-02", "metadata": {}, "source": ["text"]},
    ]  # fmt: skip
    assert clean["metadata"]["kernelspec"]["name"] == "python3"
    assert stripped(json.dumps(clean)) == stripped(json.dumps(dirty))
