"""The tables of the page on the blind proof are made from a score.json, and only between its marks."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from proving_ground.scoring import ROWS, Measured, score_table

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tables() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_proof_tables", ROOT / "docs" / "make_proof_tables.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def score() -> dict[str, Any]:
    """A score as `selector.proof/1` has it: half of everything right, one clean case of ten with a false name."""
    measured = {one.key: Measured(0.5, 0.4, 0.6, 20) for one in ROWS} | {
        "false_on_clean": Measured(0.1, 0.0, 0.4, 10),
        "window_iou": Measured(None, None, None, 0),
    }
    rows = [row.as_dict() for row in score_table(measured)]
    return {
        "cases": 30, "scenarios": 3, "seeds": [0, 1], "exam": False, "version": "0", "seal": "ab" * 32,
        "answers_sha256": "cd" * 32, "failures": [], "scores": rows, "rivals": {"lasso": rows[:1]},
        "confusion": {
            "least_d_prime": 6.0,
            "true": ["thermal.memory", "(nothing missing)"],
            "said": ["thermal.ambient", "thermal.memory", "right, in a set", "nothing"],
            "counts": [[2, 5, 1, 0], [1, 0, 0, 9]],
            "cases": [8, 10],
        },
    }  # fmt: skip


def test_scores_and_confusion_stand_between_the_marks(tables: ModuleType) -> None:
    page = f"before\n{tables.BEGIN}\nobsolete\n{tables.END}\nafter\n"
    made = tables.filled(page, score())
    assert made.startswith("before\n")
    assert made.endswith("after\n")
    assert "obsolete" not in made
    lines = made.splitlines()
    assert "| any false name on clean cases | 10.0 % | 0.0 % … 40.0 % | 10 | 5.0 % | 1.0 % | **no** | 10.0 % |" in lines
    assert "| `thermal.memory` | 8 | 5 | 1 |  |  | thermal.ambient 2 |" in lines
    assert "| `(nothing missing)` | 10 |  |  |  | 9 | thermal.ambient |" in lines
    # no case speaks of windows
    assert not any(line.startswith("| windows") for line in lines)
    # made twice is made once
    assert tables.filled(made, score()) == made


def test_a_page_without_marks_is_refused(tables: ModuleType) -> None:
    with pytest.raises(ValueError, match="once each"):
        tables.filled("no marks", score())


def test_the_page_can_be_filled(tables: ModuleType) -> None:
    assert "right, in a set" not in tables.filled(tables.PAGE.read_text(encoding="utf-8"), score())
