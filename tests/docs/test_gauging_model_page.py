"""The page on model files of gauging names every key of the schema with its unit and its default, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from selector.physics import model_text
from selector.physics.gauging import model_file as schema
from selector.physics.gauging import transducer
from selector.physics.gauging.gauged_grinding import MOST_STEPS
from selector.physics.model_fields import SectionOf, said_of, unit_in
from selector.physics.model_text import Entry

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "gauging-model.md"


def inside(section, key):
    """The section of a key that is a table, or an array of tables."""
    kinds = [section.model_fields[key].annotation, *getattr(section.model_fields[key].annotation, "__args__", ())]
    return next(kind for kind in kinds if isinstance(kind, type) and issubclass(kind, Entry))


SECTIONS = {
    "`[model]`": schema.ModelSection,
    "`[run]`": schema.RunSection,
    "`[transducer]`": SectionOf[transducer.Transducer],
    **{
        f"`[transducer.{key}]`": inside(SectionOf[transducer.Transducer], key)
        for key in ("electromagnet", "probe", "contact", "generator", "smoothing", "relay")
    },
    "`[linear]`": SectionOf[transducer.LinearGauge],
    "`[relay]`": SectionOf[transducer.Relay],
    "`[grinding]`": SectionOf[transducer.Grinding],
    "`[[grinding.stages]]`": inside(SectionOf[transducer.Grinding], "stages"),
    "`[surface]`": SectionOf[transducer.Surface],
    "`[noise]`": SectionOf[transducer.Noise],
    "`[tolerance]`": SectionOf[transducer.Tolerance],
    "`[thresholds]`": schema.ThresholdsSection,
    "`[correction]`": SectionOf[transducer.Correction],
    "`[recorded]`": schema.RecordedSection,
    "`[bounds]`": None,
}


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


def default_text(field) -> str:
    if field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if isinstance(default, bool):
        return str(default).lower()
    return f"{default:g}" if isinstance(default, int | float) else "–"


def test_every_section_of_the_schema_has_its_heading():
    assert list(tables()) == list(SECTIONS)
    entries = {value for value in vars(schema).values() if isinstance(value, type) and issubclass(value, Entry)}
    assert entries - {Entry, schema.GaugingFile} <= set(SECTIONS.values())
    assert {re.match(r"`\[+(\w+)", name)[1] for name in SECTIONS} == set(schema.GaugingFile.model_fields)


@pytest.mark.parametrize("heading", [name for name, entry in SECTIONS.items() if entry is not None])
def test_every_key_is_explained_and_no_other(heading):
    rows, fields = tables()[heading], SECTIONS[heading].model_fields
    assert list(rows) == list(fields)
    for key, (unit, default, meaning) in rows.items():
        assert default == default_text(fields[key]), key
        assert meaning.strip(), key
        said = unit_in(said_of(fields[key]))
        # sections that are no physics say their units by their keys
        of_name = {"period_s": "s", "waveform_s": "s", "volts": "V"}.get(key, said)
        assert unit == {"1": "–"}.get(of_name, of_name), key


def test_the_limits_are_those_of_the_program():
    text = PAGE.read_text(encoding="utf-8").replace("\n  ", " ")
    for number, what in (
        (schema.MOST_STAGES, "stages"), (schema.MOST_PARTS, "parts"), (model_text.MOST_SAMPLES, "samples of a part"),
        (MOST_STEPS, "steps of the calculation"), (schema.MOST_WAVEFORM_S, "s of waveform"),
    ):  # fmt: skip
        assert f"{int(number):,} {what}".replace(",", " ") in text, what
