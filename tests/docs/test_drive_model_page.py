"""The page on model files of feed drives names every key of the schema with its unit and its default, and no other."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from selector.physics.drive import model_schema as schema
from selector.physics.drive.model_schema import INSTEAD, OFF
from selector.physics.drive.parts import axis, catalogue
from selector.physics.drive.parts.catalogue import thc6350_x_axis
from selector.physics.model_fields import SectionOf, said_of, unit_in
from selector.physics.model_text import Column, Entry, entries_in

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "drive-model.md"
LUGRE = next(
    kind
    for kind in get_args(SectionOf[axis.Friction].model_fields["lugre"].annotation)
    if isinstance(kind, type) and issubclass(kind, Entry)
)

SECTIONS = {
    "`[model]`": schema.ModelSection,
    "`[run]`": schema.RunSection,
    '`[motion]` with `kind = "sine"`': schema.SineMotion,
    '`[motion]` with `kind = "moves"`': schema.MovesMotion,
    '`[motion]` with `kind = "column"`': schema.ColumnMotion,
    '`[motion]` with `kind = "circle"`': schema.CircleMotion,
    "`[motion.table_ball]`": schema.TableBallSection,
    "A column for `force_n`": Column,
    "`[ball_bar]`": schema.BallBarSection,
    "`[axes.NAME]`": schema.AxisSection,
    '`[axes.NAME.mechanics]` with `kind = "rigid"` or `"rotary"`': schema.RigidSection,
    '`[axes.NAME.mechanics]` with `kind = "three-mass"`': schema.ThreeMassSection,
    "`[axes.NAME.parts]`": schema.PartsSection,
    "`[axes.NAME.parts.motor]`": SectionOf[catalogue.Motor],
    "`[axes.NAME.parts.coupling]`": SectionOf[catalogue.Coupling],
    "`[axes.NAME.parts.screw]`": SectionOf[catalogue.Screw],
    "`[axes.NAME.parts.nut]`": SectionOf[catalogue.Nut],
    "`[axes.NAME.parts.bearings]`": SectionOf[catalogue.Bearings],
    "`[axes.NAME.parts.guide]`": SectionOf[catalogue.Guide],
    "`[axes.NAME.parts.table]`": SectionOf[catalogue.Table],
    "`[axes.NAME.course]`": schema.CourseSection,
    "`[axes.NAME.friction]`": SectionOf[axis.Friction],
    "`[axes.NAME.friction.lugre]`": LUGRE,
    "`[axes.NAME.transmission]`": SectionOf[axis.Transmission],
    "`[[axes.NAME.ripple]]`": SectionOf[axis.Ripple],
    "`[axes.NAME.servo]`": SectionOf[axis.Servo],
    "`[axes.NAME.sensing]`": SectionOf[axis.Sensing],
    "`[axes.NAME.recorded]`": schema.RecordedSection,
    "`[axes.NAME.recorded.added]`": schema.AddedSection,
    "`[bounds]`": None,
}


def tables() -> dict[str, dict[str, tuple[str, str, str]]]:
    """Heading → key → unit, default, meaning."""
    found: dict[str, dict[str, tuple[str, str, str]]] = {}
    text = PAGE.read_text(encoding="utf-8").replace("\\|", "¦").partition("\n## What is recorded")[0]
    for part in re.split(r"^##+ ", text, flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \| ([^|]*) \|$", body, flags=re.MULTILINE)
        assert len({row[0] for row in rows}) == len(rows), f"a key twice under {heading}"
        found[heading] = {key: (unit, default, meaning) for key, unit, default, meaning in rows}
    return found


def sections_in(section):
    """Every section inside of a section."""
    for field in section.model_fields.values():
        for inner in entries_in(field.annotation):
            yield inner
            yield from sections_in(inner)


def test_every_section_of_the_schema_has_its_heading():
    assert list(tables()) == list(SECTIONS)
    entries = set(sections_in(schema.DriveFile)) - {schema.RotarySection}
    assert entries == set(SECTIONS.values()) - {None}
    # rotary axes have the keys of rigid ones, as the heading says
    assert list(schema.RotarySection.model_fields) == list(schema.RigidSection.model_fields)
    assert {re.match(r"`\[+(\w+)", name)[1] for name in SECTIONS if name.startswith("`")} == set(
        schema.DriveFile.model_fields
    )


def test_the_defaults_of_parts_are_those_of_the_named_machine():
    pages = tables()
    for name, part in vars(thc6350_x_axis()).items():
        for key, (_, default, meaning) in pages[f"`[axes.NAME.parts.{name}]`"].items():
            value = getattr(part, key)
            text = "–" if value is None else str(value).lower() if isinstance(value, bool) else f"{value:g}"
            assert default == text or meaning.endswith(f"with `like` {text}"), key


def test_the_page_says_which_keys_of_parts_may_be_left_out():
    text = PAGE.read_text(encoding="utf-8").partition("## `[axes.NAME.parts]`")[2].partition("\n| ")[0]
    off, instead = (part for part in text.split("\n- ")[1:])
    for kind, keys in OFF.items():
        part = kind.__name__.lower()
        assert part in off, part
        assert all(f"`{key}`" in off for key in keys)
    for kind, keys in INSTEAD.items():
        assert kind.__name__.lower() in instead
        for key, spared in keys.items():
            assert f"`{key}`" in instead
            assert all(f"`{one}`" in instead for one in spared)


def default_text(field) -> str:
    if field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if isinstance(default, bool):
        return "true" if default else "false"
    if isinstance(default, int | float):
        return f"{default:g}"
    if default and isinstance(default, tuple):
        return ", ".join(one if isinstance(one, str) else f"{one:g}" for one in default)
    return default if isinstance(default, str) and default else "–"


@pytest.mark.parametrize("heading", [name for name, entry in SECTIONS.items() if entry is not None])
def test_every_key_is_explained_and_no_other(heading):
    rows, fields = tables()[heading], SECTIONS[heading].model_fields
    assert list(rows) == list(fields)
    for key, (unit, default, meaning) in rows.items():
        assert default == default_text(fields[key]), key
        assert meaning.strip(), key
        said = unit_in(said_of(fields[key]))
        assert unit == {"1": "–"}.get(said, said), key
