"""Strips notebooks of what running them left behind: `python -m docs.strip_notebooks` after an edit.

What is kept is the text and the cells, so that a change shows as what was changed, and nothing of a machine gets in.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def stripped(text: str) -> str:
    """The notebook without outputs, counts and metadata; cells are numbered in their order."""
    cells = [_cell(number, cell) for number, cell in enumerate(json.loads(text)["cells"], start=1)]
    notebook = {"cells": cells, "metadata": METADATA, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def _cell(number: int, cell: dict[str, Any]) -> dict[str, Any]:
    common = {"cell_type": cell["cell_type"], "id": f"cell-{number:02d}", "metadata": {}}
    source = "".join(cell["source"]).strip("\n").splitlines(keepends=True)
    if cell["cell_type"] != "code":
        return {**common, "source": source}
    # in the order in which Jupyter writes them
    return {
        "cell_type": "code", "execution_count": None, "id": common["id"], "metadata": {}, "outputs": [],
        "source": source,
    }  # fmt: skip


if __name__ == "__main__":
    for path in sorted(FOLDER.glob("*.ipynb")):
        path.write_text(stripped(path.read_text(encoding="utf-8")), encoding="utf-8", newline="\n")
