"""What is typed into a field: either decimal mark, and refusals in the words of the fields."""

from __future__ import annotations

import math

import pytest
import typer

from selector.cli import app
from selector.errors import OptionError
from selector.workbench.bench import Bench
from selector.workbench.pages import diagnosis, recordings, selection
from selector.workbench.typed import FIELDS, in_words_of_fields, number, numbers, whole


@pytest.mark.parametrize("text", ["0,98", "0.98", " 0,98 ", "9.8e-1", ".98", ",98"])
def test_either_decimal_mark(text):
    assert number(text, "λ", 0.0, 1.0) == 0.98


@pytest.mark.parametrize("text", ["", None, "98", "-0,1", "1.000,5", "0,9,8", "nan", "inf", "λ", "1_0"])
def test_what_is_no_number_says_the_field_and_what_is_expected(text):
    with pytest.raises(OptionError) as refused:
        number(text, "λ", 0.0, 1.0)
    assert refused.value.where == "λ"
    assert "from 0 to 1, e.g. 0.98 or 0,98" in refused.value.expected
    assert refused.value.found == (f"“{text}” was typed" if text else "nothing was typed")


@pytest.mark.parametrize("text", ["12 µm", "12µm", "12 μm", "12,0 um", "12"])
def test_a_number_with_the_unit_of_its_field(text):
    assert number(text, "largest correction", 0.0, 100.0, "µm") == 12.0
    assert number("0,5 µm/s", "fastest change", unit="µm/s") == 0.5
    assert numbers("0,1 m; 0,6 m 1,2m", "x, y, z", unit="m") == (0.1, 0.6, 1.2)


@pytest.mark.parametrize("text", ["12 mm", "12 µm/s", "µm", "12 µm 3", "12 m"])
def test_a_number_with_another_unit_is_refused(text):
    with pytest.raises(OptionError, match="from 0 to 100 µm"):
        number(text, "largest correction", 0.0, 100.0, "µm")


def test_a_limit_that_only_keeps_0_out_is_told_so():
    for high, said in ((math.inf, "a number above 0 µm"), (999_999.0, "a number above 0, at most 999999 µm")):
        with pytest.raises(OptionError) as refused:
            number("0", "largest correction", 1e-6, high, "µm")
        assert refused.value.expected.startswith(said)


def test_several_numbers():
    for text in ("0.99 0.95", "0,99 0,95", "0.99, 0.95", "0,99, 0,95", "0.99,0.95", "0,99;0,95", "0.99; 0.95;"):
        assert numbers(text, "λ", 0.0, 1.0) == (0.99, 0.95), text
    assert numbers("0,98", "λ", 0.0, 1.0) == (0.98,)
    for text in ("0,99,0,95", "0.99 x", "", "  ", "0.9 98"):
        with pytest.raises(OptionError, match="λ"):
            numbers(text, "λ", 0.0, 1.0)


def test_whole_numbers():
    assert whole("3", "Rounds") == 3
    for text in ("2,5", "0", "", "-1"):
        with pytest.raises(OptionError, match="at least 1"):
            whole(text, "Rounds")


def test_options_become_the_titles_of_fields():
    assert in_words_of_fields("try --lambda auto (or `--time-unit min`), raise --max-sensors; --no-such stays") == (
        "try “λ” auto (or `“Unit of time” min`), raise “Most sensors in a set”; --no-such stays"
    )


def test_every_option_of_the_fields_is_one_of_the_command_line():
    known = set()
    waiting = [typer.main.get_command(app)]
    while waiting:
        one = waiting.pop()
        waiting += getattr(one, "commands", {}).values()
        known |= {word for parameter in one.params for word in parameter.opts}
    assert set(FIELDS) <= known


def test_the_fields_of_the_pages_have_these_titles(tmp_path):
    titles = set(FIELDS.values())
    assert {row[1] for row in recordings._READING} <= titles
    bench = Bench(tmp_path)
    assert {box.title for box in selection._boxes(bench).boxes} <= titles
    assert {box.title for box in diagnosis._boxes(bench).boxes} - titles == {"Channels to compare"}
