"""The page of effects is what the catalogue says, with a picture of each."""

from __future__ import annotations

import re
import runpy
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
GENERATOR = runpy.run_path(str(ROOT / "docs" / "make_effects.py"))
IDS = [effect.id for effect in GENERATOR["shipped"]()]


def test_the_page_is_up_to_date():
    assert GENERATOR["PAGE"].read_text(encoding="utf-8") == GENERATOR["page"](), "run `python -m docs.make_effects`"


@pytest.mark.parametrize("id_", IDS)
def test_every_effect_has_its_picture(id_):
    picture = ET.parse(GENERATOR["PICTURES"] / f"{id_}.svg").getroot()
    assert picture.findtext("{*}title") == id_
    lines = picture.findall("{*}polyline")
    assert len(lines) == 2
    heights = {point.split(",")[1] for point in lines[1].get("points").split()}
    assert len(heights) > 1  # a shape that does something


def test_no_picture_is_of_nothing():
    assert sorted(path.stem for path in GENERATOR["PICTURES"].glob("*.svg")) == sorted(IDS)


def test_links_between_effects_lead_somewhere():
    page = GENERATOR["page"]()
    anchors = {id_.replace(".", "") for id_ in IDS}
    assert set(re.findall(r"\]\(#([^)]+)\)", page)) <= anchors
