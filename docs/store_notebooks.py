"""Runs the notebooks and stores them with what they print and a small picture of each figure.

    python -m docs.store_notebooks [01 02 …]   # needs Jupyter and Chromium; about two minutes
    python -m docs.store_notebooks --text      # nothing is run: after an edit of the words

A code host shows them as they are stored, and a reader sees what to expect before anything is installed.
"""

from __future__ import annotations

import base64
import importlib
import io
import json
import os
import sys
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}
KEPT = ("text/plain", "image/png")
PLOTLY = "application/vnd.plotly.v1+json"
WIDTH_PX, HEIGHT_PX, COLOURS = 760, 420, 48


def stored(text: str) -> str:
    """The notebook as it is kept: cells in their order, what they printed, pictures; nothing else of a machine."""
    cells = [_cell(number, cell) for number, cell in enumerate(json.loads(text)["cells"], start=1)]
    notebook = {"cells": cells, "metadata": METADATA, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def _cell(number: int, cell: dict[str, Any]) -> dict[str, Any]:
    common = {"cell_type": cell["cell_type"], "id": f"cell-{number:02d}", "metadata": {}}
    source = _lines("".join(cell["source"]).strip("\n"))
    if cell["cell_type"] != "code":
        return {**common, "source": source}
    # in the order in which Jupyter writes them
    return {
        "cell_type": "code", "execution_count": None, "id": common["id"], "metadata": {},
        "outputs": [kept for output in cell["outputs"] if (kept := _output(output))], "source": source,
    }  # fmt: skip


def _output(output: dict[str, Any]) -> dict[str, Any] | None:
    if output["output_type"] == "stream":
        return {"name": output["name"], "output_type": "stream", "text": _lines("".join(output["text"]))}
    data = {kind: output["data"][kind] for kind in KEPT if kind in output["data"]}
    if "image/png" in data:
        data = {"image/png": "".join(data["image/png"]).strip()}
    elif data:
        data = {"text/plain": _lines("".join(data["text/plain"]))}
    return {"data": data, "metadata": {}, "output_type": "display_data"} if data else None


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def run(path: Path) -> str:
    """The notebook run from top to bottom in a kernel of its own, its figures as PNG."""
    nbformat, nbclient = importlib.import_module("nbformat"), importlib.import_module("nbclient")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(FOLDER.parent), os.environ.get("PYTHONPATH", "")])
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=900, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}}
    ).execute()
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if PLOTLY in output.get("data", {}):
                output["data"]["image/png"] = picture(output["data"][PLOTLY])
    return stored(nbformat.writes(notebook))


def picture(figure: dict[str, Any]) -> str:
    """A figure of plotly as a small PNG with few colours, in base64."""
    from PIL import Image  # the tests need neither it nor a browser
    from plotly.graph_objects import Figure

    from docs.images.make_pictures import photograph

    drawn = Figure({"data": figure["data"], "layout": figure["layout"]})
    height = int(drawn.layout.height or HEIGHT_PX)
    # a page is wider than the window of a headless browser
    drawn.update_layout(width=WIDTH_PX, height=height)
    page = (
        f'<body style="margin:0">{drawn.to_html(full_html=False, include_plotlyjs=True, config={"staticPlot": True})}'
    )
    target = Path(f"{os.getpid()}.png").resolve()
    try:
        photograph(page, target, width_px=WIDTH_PX, height_px=height)
        small = Image.open(target).convert("RGB").resize((WIDTH_PX, height)).quantize(COLOURS)
    finally:
        target.unlink(missing_ok=True)
    with io.BytesIO() as buffer:
        small.save(buffer, "PNG", optimize=True)
        return base64.b64encode(buffer.getvalue()).decode()


if __name__ == "__main__":
    only = [word for word in sys.argv[1:] if word != "--text"]
    for one in sorted(FOLDER.glob("*.ipynb")):
        if not only or one.stem[:2] in only:
            text = stored(one.read_text(encoding="utf-8")) if "--text" in sys.argv else run(one)
            one.write_text(text, encoding="utf-8", newline="\n")
            print(f"stored {one.name}, {len(text) / 1e3:.0f} kB")
