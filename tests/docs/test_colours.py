"""The picture of the colours shows those that the figures use."""

from __future__ import annotations

import runpy
import xml.etree.ElementTree as ET
from pathlib import Path

from selector.figures import style

GENERATOR = runpy.run_path(str(Path(__file__).resolve().parents[2] / "docs" / "images" / "make_colours.py"))


def test_the_picture_is_up_to_date():
    drawn = GENERATOR["PICTURE"].read_text(encoding="utf-8")
    assert drawn == GENERATOR["picture"](), "run `python docs/images/make_colours.py`"


def test_every_role_of_the_style_is_drawn_once():
    root = ET.parse(GENERATOR["PICTURE"]).getroot()
    strokes = [line.get("stroke") for line in root.findall("{*}path")]
    assert len(strokes) == len(set(strokes))
    single = {style.MEASURED, style.PREDICTED, style.RESIDUAL, style.BEFORE, style.CHOSEN, style.OTHER_BASELINE}
    assert set(strokes) == single | {style.BASELINES["mean"], style.BASELINES["all sensors"]}
