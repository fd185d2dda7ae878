"""The page of findings is what the tables of findings say."""

from __future__ import annotations

import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
GENERATOR = runpy.run_path(str(ROOT / "docs" / "make_findings.py"))


def test_the_page_is_up_to_date():
    assert GENERATOR["PAGE"].read_text(encoding="utf-8") == GENERATOR["page"](), "run `python -m docs.make_findings`"


def test_every_table_is_on_the_page():
    tables = {path.relative_to(ROOT / "selector").parent for path in (ROOT / "selector").rglob("finding_table.py")}
    assert {".".join(path.parts) for path in tables} == set(GENERATOR["ROOMS"])
