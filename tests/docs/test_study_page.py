"""The pages on study files and fleet files name every key of the schema with its default, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from selector.fleet import fleet_file
from selector.study import study_file as schema

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"
FLEET = {"The file": fleet_file.FleetFile, "`[machines.NAME]`": fleet_file.MachineSection}
SECTIONS = {
    "The file": schema.Study,
    "`[recordings]`": schema.Recordings,
    "`[reading]`": schema.ReadingSection,
    "`[select]`": schema.SelectSection,
    "`[diagnose]`": schema.DiagnoseSection,
    "`[export]`": schema.ExportSection,
    "`[[files]]`": schema.InputFile,
}


def default_text(field) -> str:
    if field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if isinstance(default, bool):
        return "true" if default else "false"
    if isinstance(default, int | float):
        return f"{default:g}"
    return default if isinstance(default, str) and default else "–"


@pytest.mark.parametrize(
    ("page", "heading", "section"),
    [("study.md", *one) for one in SECTIONS.items()] + [("fleet.md", *one) for one in FLEET.items()],
)
def test_every_key_is_explained_and_no_other(page, heading, section):
    body = (REFERENCE / page).read_text(encoding="utf-8").partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    rows = {
        key: (default, meaning) for key, default, meaning in re.findall(r"^\| `(\w+)` \| (.*?) \| (.*) \|$", body, re.M)
    }
    fields = {field.alias or name: field for name, field in section.model_fields.items()}
    assert list(rows) == list(fields)
    for key, (default, meaning) in rows.items():
        # what must always stand in a file is required there, whatever Python says
        assert default == ("required" if key == "schema" and page == "study.md" else default_text(fields[key])), key
        assert meaning.strip()
