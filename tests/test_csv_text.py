"""No cell of a CSV that is written is a formula, and names read back as they were."""

from __future__ import annotations

import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.csv_text import as_written, csv_text, defused

SIGNS = ("=", "+", "-", "@", "\t", "\r", "\n")


@pytest.mark.parametrize("text", ['=HYPERLINK("http://evil")', "+1+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "-1", "+"])
def test_a_formula_gets_an_apostrophe(text):
    assert defused(text).startswith("'")


@given(st.text(st.characters(exclude_categories=("C", "Z"))))
def test_names_come_back(text):
    assert not defused(text).startswith(SIGNS)
    assert as_written(defused(text)) == text


@given(st.lists(st.text(), min_size=2, max_size=2))
def test_no_cell_is_a_formula_for_any_reader(cells):
    _, row = csv.reader(io.StringIO(csv_text([], [cells]), newline=""))
    assert not any(cell.startswith(SIGNS) and not cell.lstrip("+-").replace(".", "").isalnum() for cell in row)


def test_numbers_stay_numbers():
    assert (
        csv_text(["-1"], [["T1", -1.5, "-1.500", "+2e-3", None, True, "-1.5 µm"]])
        == "'-1\nT1,-1.5,-1.500,+2e-3,,True,'-1.5 µm\n"
    )
