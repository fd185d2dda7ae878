"""The page on model files of vibration names every key of the schema with its unit and its default, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from selector.physics.model_text import Entry
from selector.physics.vibration import model_file as schema
from selector.physics.vibration.model_file import read_model_file
from selector.physics.vibration.vibration_model import vibration_model

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "vibration-model.md"

SECTIONS = {
    "`[model]`": schema.ModelSection,
    "`[run]`": schema.RunSection,
    "`[members.NAME]`": schema.MemberSection,
    "`[[joints]]`": schema.JointSection,
    "`[[chains]]`": schema.ChainSection,
    "`[sources.NAME]`": schema.SourceSection,
    "One of `lines`": schema.LineSection,
    "`[shafts.NAME]`": schema.ShaftSection,
    "`[cutting]`": schema.CuttingSection,
    "`[surface]`": schema.SurfaceSection,
    "`[realisations]`": schema.RealisationsSection,
    "`[finals]`": schema.FinalsSection,
    "`[sensing]`": schema.SensingSection,
    "`[bounds]`": None,
}
UNITS = (
    ("_n_per_m", "N/m"), ("_kg_m", "kg·m"), ("_kg", "kg"), ("_mm_per_rev", "mm/rev"), ("_mm", "mm"), ("_um", "µm"),
    ("_hz", "Hz"), ("_n", "N"), ("_rad", "rad"), ("_s", "s"),
)  # fmt: skip


def tables() -> dict[str, dict[str, tuple[str, str, str]]]:
    """Heading → key → unit, default, meaning."""
    found: dict[str, dict[str, tuple[str, str, str]]] = {}
    text = PAGE.read_text(encoding="utf-8").partition("\n## What is recorded")[0]
    for part in re.split(r"^##+ ", text, flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \| ([^|]*) \|$", body, flags=re.MULTILINE)
        assert len({row[0] for row in rows}) == len(rows), f"a key twice under {heading}"
        found[heading] = {key: (unit, default, meaning) for key, unit, default, meaning in rows}
    return found


def unit_text(key: str) -> str:
    return "r/min" if key == "rpm" else next((unit for end, unit in UNITS if key.endswith(end)), "–")


def default_text(field) -> str:
    if field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if isinstance(default, int | float):
        return f"{default:g}"
    return default if isinstance(default, str) and default else "–"


def test_every_section_of_the_schema_has_its_heading():
    assert list(tables()) == list(SECTIONS)
    entries = {value for value in vars(schema).values() if isinstance(value, type) and issubclass(value, Entry)}
    assert entries - {Entry, schema.VibrationFile} == {entry for entry in SECTIONS.values() if entry is not None}
    named = {re.match(r"`\[+(\w+)", name)[1] for name in SECTIONS if name.startswith("`")}
    assert named == set(schema.VibrationFile.model_fields)


@pytest.mark.parametrize("heading", [name for name, entry in SECTIONS.items() if entry is not None])
def test_every_key_is_explained_and_no_other(heading):
    rows, fields = tables()[heading], SECTIONS[heading].model_fields
    assert list(rows) == list(fields)
    for key, (unit, default, meaning) in rows.items():
        assert default == default_text(fields[key]), key
        assert unit == unit_text(key), key
        assert meaning.strip(), key


def test_limits_of_the_page_are_those_of_the_schema():
    said = PAGE.read_text(encoding="utf-8").partition("At most 4 MB")[2].partition("\n\n")[0]
    for number in (schema.MOST_MEMBERS, schema.MOST_LINES):
        assert f"{number} " in said
    assert f"{schema.MOST_SAMPLES:,}".replace(",", " ") in said
    assert "5·10⁸" in said
    assert schema.MOST_SINES == 5e8


def test_every_parameter_is_of_a_kind_that_the_page_names():
    said = PAGE.read_text(encoding="utf-8").partition("## `[bounds]`")[2].partition("\n## ")[0]
    model = vibration_model(read_model_file(ROOT / "fixtures" / "vibration" / "lathe.toml"))
    kinds = {name.rpartition(".")[2] for name in model.parameters}
    assert kinds == {"mass_kg", "stiffness_n_per_m", "dissipation", "force_n", "unbalance_kg_m", "phase_rad"}
    assert all(kind in said for kind in kinds)
