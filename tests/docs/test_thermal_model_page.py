"""The page on thermal model files names every key of the schema with its unit and its default, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from selector.physics.model_fields import said_of, unit_in
from selector.physics.thermal import model_file as schema

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "thermal-model.md"

SECTIONS = {
    "`[model]`": schema.ModelSection,
    "`[run]`": schema.RunSection,
    "`[conditions]`": schema.ConditionsSection,
    "A sine": schema.Sine,
    "A column of a file": schema.Column,
    "`[inputs]`": schema.InputsSection,
    "`[nodes.NAME]`": schema.Node,
    "`[[links]]`": schema.Link,
    "`[films.NAME]` of a network": schema.NodeFilm,
    "`[sources.NAME]` of a network or a mesh": schema.NodeSource,
    "`[modes]`": schema.ModesSection,
    "`[field]`": schema.FieldSection,
    "`[mesh]`": schema.MeshSection,
    "`[parts.GROUP]`": schema.MeshPart,
    "`[films.NAME]` of a mesh": schema.MeshFilm,
    "`[supports.NAME]`": schema.MeshSupport,
    "`[displacements.NAME]`": schema.MeshDisplacement,
    "`[candidates]`": schema.CandidatesSection,
    "`[sources.NAME]` of the field machine": schema.FieldSource,
    "`[films.NAME]` and `[coolant_films.NAME]` of the field machine": schema.FieldFilm,
    "`[cooled.NAME]` of the field machine": schema.FieldCooling,
    "`[[sensors]]`": schema.Sensor,
    "`[[gauges]]`": schema.Gauge,
    "`[bounds]`": None,
}


def tables() -> dict[str, dict[str, tuple[str, str, str]]]:
    """Heading → key → unit, default, meaning."""
    found: dict[str, dict[str, tuple[str, str, str]]] = {}
    for part in re.split(r"^##+ ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \| ([^|]*) \|$", body, flags=re.MULTILINE)
        assert len({row[0] for row in rows}) == len(rows), f"a key twice under {heading}"
        found[heading] = {key: (unit, default, meaning) for key, unit, default, meaning in rows}
    return found


def test_every_section_of_the_schema_has_its_heading():
    assert list(tables()) == list(SECTIONS)
    documented = set(SECTIONS.values())
    entries = {
        value
        for name, value in vars(schema).items()
        if not name.startswith("_")
        and isinstance(value, type)
        and issubclass(value, schema.Entry)
        and not issubclass(value, schema._Common)
    }
    # thermal modes have one condition, which the page says in words
    assert entries - documented == {schema.Entry, schema.SpeedOnly}
    top = {key for kind in schema.KINDS.values() for key in kind.model_fields}
    assert {re.match(r"`\[+(\w+)", name)[1] for name in SECTIONS if name.startswith("`")} | {"coolant_films"} == top


def default_text(field) -> str:
    if field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if isinstance(default, bool):
        return "true" if default else "false"
    if isinstance(default, int | float):
        return f"{default:g}"
    if default and isinstance(default, tuple):
        return ", ".join(default)
    return default if isinstance(default, str) and default else "–"


@pytest.mark.parametrize("heading", [name for name, entry in SECTIONS.items() if entry is not None])
def test_every_key_is_explained_and_no_other(heading):
    rows, fields = tables()[heading], SECTIONS[heading].model_fields
    assert list(rows) == list(fields)
    for key, (unit, default, meaning) in rows.items():
        assert default == default_text(fields[key]), key
        assert meaning.strip(), key
        expected = unit_in(said_of(fields[key]))
        if expected == "1":
            expected = "–"
        if heading == "A sine" and key in ("mean", "amplitude"):
            expected = "that of the course"
        assert unit == expected, key
