"""A notebook as a Markdown page: its text and its cells, without what they print."""

from __future__ import annotations

import json
from pathlib import Path


def notebook_page(path: Path) -> str:
    """The page of one notebook; it begins with the notebook's title and says how to run it."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    parts = [_cell(cell["cell_type"], "".join(cell["source"])) for cell in cells]
    parts.insert(1, f"*The cells of `notebooks/{path.name}`. Open the notebook to run them and to see the figures.*")
    return "\n\n".join(parts) + "\n"


def _cell(kind: str, text: str) -> str:
    return f"```python\n{text}\n```" if kind == "code" else text
