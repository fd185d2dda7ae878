"""The table of failures names tests that there are, and every control."""

from __future__ import annotations

import re
from pathlib import Path

from selector.controllers.writers.targets import TARGETS

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "reference" / "failures.md").read_text(encoding="utf-8")


def test_every_test_of_the_table_is_there():
    named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", PAGE)
    assert len(named) > 25
    texts = {file: (ROOT / "tests" / "controllers" / file).read_text(encoding="utf-8") for file, _ in named}
    assert [f"{file}::{name}" for file, name in named if f"def {name}(" not in texts[file]] == []


def test_every_control_is_in_it():
    assert [target for target in TARGETS if f"`{target}`" not in PAGE] == []
