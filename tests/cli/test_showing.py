"""JSON for programs, text for people."""

from __future__ import annotations

import io
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from selector.cli.shared import showing
from selector.findings import Finding, Where
from selector.number_text import span_text
from selector.telling.account import Account, captioned, section, sections, table

FINDING = Finding(
    "stuck-channel",
    "warning",
    "T4 does not change.",
    Where("T4", "r2", 3600.0, 9000.0),
    {"samples": np.int64(90), "level": np.float64("nan")},
    "Check the cable.",
    "leave-out-stretch",
)


def test_numbers_that_json_lacks_become_null():
    value = {"a": float("nan"), "b": [np.inf, np.float32(0.5)], "c": np.array([1, 2]), "d": (True, None, "µm")}
    assert json.loads(showing.json_text(value)) == {"a": None, "b": [None, 0.5], "c": [1, 2], "d": [True, None, "µm"]}
    assert "µm" in showing.json_text(value)


def test_findings_and_paths_have_a_json_form():
    shown = json.loads(showing.json_text({"findings": (FINDING,), "file": Path("runs") / "r1.csv"}))
    assert shown["file"] == "runs/r1.csv"
    assert shown["findings"][0]["where"] == {"channel": "T4", "run": "r2", "from_s": 3600.0, "to_s": 9000.0}
    assert shown["findings"][0]["evidence"] == {"samples": 90, "level": None}


def test_what_has_no_json_form_is_refused():
    with pytest.raises(TypeError, match="object"):
        showing.json_text({"a": object()})


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@given(json_values)
def test_json_round_trip_is_exact(value):
    assert json.loads(showing.json_text(value)) == value


def test_json_is_utf8_whatever_the_terminal_speaks(monkeypatch):
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="cp1252"))
    # a lone surrogate is what the system makes of a file name that is not UTF-8
    showing.print_json({"温度": "λ", "file": "r\udcff.csv"})
    assert json.loads(raw.getvalue().decode("utf-8")) == {"温度": "λ", "file": "r\udcff.csv"}


def test_tables_degrade_on_a_code_page_that_lacks_letters(monkeypatch):
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="cp1252", write_through=True))
    console = showing.screen()
    console.print(showing.table("通道", ["name", "value"], [["主轴温度", 1.23456], ["T[2]", None]], numeric=["value"]))
    showing.show_findings(console, [FINDING])
    text = raw.getvalue().decode("cp1252")
    assert "1.23" in text
    assert "T[2]" in text
    assert "left out" in text


ROWS = [["longitudinal motor", "12 × longitudinal motor", "1.19e-6", "0.0684"], ["spindle", "–", "123.4", "1.2"]]
HEADS = ["source", "order and shaft", "tool − workpiece", "by chains"]


@pytest.mark.parametrize("width", [10, 30, 43, 50, 57, 66, 80, 140])
def test_numbers_stay_whole_and_nothing_is_cut_off(width, monkeypatch, capfd):
    monkeypatch.setenv("COLUMNS", str(width))
    showing.screen().print(showing.table("Lines", HEADS, ROWS, numeric=HEADS[2:]))
    shown = capfd.readouterr().out
    assert max(map(len, shown.splitlines())) <= width
    # 1 + 3·3 + 1 between the columns, 8 for either text, 9 for "workpiece", 6 for "chains"
    if width >= 11 + 8 + 8 + 9 + 6:
        for number in ("1.19e-6", "0.0684", "123.4", "1.2"):
            assert number in shown.split()
    if width >= 11 + 12 + 12 + 9 + 6:
        assert {"longitudinal", "motor", "workpiece"} <= {*shown.split()}
    if width == 140:
        assert "tool − workpiece" in shown  # headings give way where they must only


def test_columns_move_together_before_a_word_of_a_heading_is_broken(monkeypatch, capfd):
    heads = ["run", "moved", "test of", "X1 [µm]", "program − reference [µm]", "correction: largest [µm]", "not whole"]
    row = ["tests", "spindle", "39 h 51 min", "2.01", "0.123", "1.61", "0 %"]
    words = {word for told in (*heads, "tests spindle 51 min") for word in told.split()}
    told = {}
    # the longest words have 5, 7, 4, 4, 9, 11 and 5 letters: with 1, 2 and 3 blanks between them
    for width in (45 + 8, 45 + 14, 45 + 20, 120):
        monkeypatch.setenv("COLUMNS", str(width))
        showing.screen().print(showing.table("Drift", heads, [row], numeric=heads[3:]))
        told[width] = capfd.readouterr().out
        assert max(map(len, told[width].splitlines())) <= width
        assert words <= {*told[width].split()}
    assert "tests   spindle   39 h 51 min" in told[120]


def test_people_read_stderr_when_stdout_is_json(capfd):
    showing.screen(as_json=True).print("progress")
    assert capfd.readouterr() == ("", "progress\n")


def test_no_colours_in_a_file(capfd):
    showing.show_findings(showing.screen(), [FINDING])
    out = capfd.readouterr().out
    assert "\x1b" not in out
    assert out.startswith(f"warning (r2, T4, 1 h to 2 h 30 min): {FINDING.statement}\n")


def test_findings_of_a_kind_are_one_and_a_fault_is_told_once(capfd):
    several = [replace(FINDING, where=Where(channel, run)) for channel in ("T4", "T5") for run in ("r1", "r2")]
    again = Finding("constant-sensor", "warning", "T9 does not move.", Where("T9"))
    gone = Finding("empty-channel", "warning", "T9 is empty.", Where("T9"), action="leave-out-channel")
    others = [Finding(f"kind-{k}", "warning", f"Number {k}.") for k in range(9)]
    showing.show_findings(showing.screen(), [*several, again, gone, *others])
    out = capfd.readouterr().out
    assert "4 times, in T4 and T5, in runs r1 and r2." in out
    assert "T9 is empty." in out
    assert "T9 does not move." not in out
    assert out.count("warning") == 5
    assert re.search(r"--all .*\b6 more", out)
    showing.show_findings(showing.screen(), [*several, again, gone, *others], everything=True)
    assert capfd.readouterr().out.count("warning") == 15


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.5, "0.5 s"),
        (59.0, "59 s"),
        (90.0, "1.5 min"),
        (3600.0, "1 h"),
        (5400.0, "1 h 30 min"),
        (-7200.0, "−2 h"),
        (float("nan"), "–"),
    ],
)
def test_span_text(seconds, text):
    assert span_text(seconds) == text


@pytest.mark.parametrize(
    ("value", "text"), [(None, "–"), (float("nan"), "–"), (3, "3"), (0.123456, "0.123"), ("a", "a")]
)
def test_cell_text(value, text):
    assert showing.cell_text(value) == text


def test_long_names_beside_many_numbers_take_few_lines_unless_all_is_asked_for():
    names = [f"Werk 3 Linie B Spindelkasten vorderes Lager Kühlmantel Ablauf {axis} gemessen" for axis in "YZ"]
    columns = ["output", *(f">value {k} [µm]" for k in range(5))]
    account = Account("A result", (), (), answer=table(columns, [(name, *["0.29 to 2.6"] * 5) for name in names]))
    shown = {}
    for everything in (False, True):
        stream = io.StringIO()
        showing.show_answer(Console(file=stream, width=80), account, (), everything=everything)
        shown[everything] = stream.getvalue()
        assert all(f"{axis} gemessen" in " ".join(stream.getvalue().split()) for axis in "YZ")
        assert ("Ablauf" in stream.getvalue()) is everything
    assert shown[False].count("\n") < shown[True].count("\n")


def test_signs_survive_a_code_page_that_lacks_them():
    assert "Z = −1.9 + 6·ΔT1".encode("ascii", "selector.spelt-out") == b"Z = -1.9 + 6*dT1"
    assert "漢".encode("cp1252", "selector.spelt-out") == b"?"


@pytest.mark.parametrize("width", [80, 140])
@pytest.mark.parametrize("sentences", [1, 6])
def test_an_answer_of_many_tables_fits_a_screen_and_says_where_the_rest_is(width, sentences):
    rows = [(f"Spindelstock_Oben_Lager_{k}", float(k), "what a row says at some length") for k in range(30)]
    tables = [section(f"s{k}", f"Table {k}", captioned("", table(["name", ">value", "text"], rows))) for k in range(5)]
    account = Account("A result", ("It is [/so] and so. " * 10,) * sentences, sections(*tables))
    long = replace(FINDING, statement="What was found. " * 12)
    shown = {}
    for everything in (False, True):
        stream = io.StringIO()
        showing.show_answer(Console(file=stream, width=width), account, [long] * 3, everything=everything)
        shown[everything] = stream.getvalue()
    assert shown[False].count("\n") <= 40
    assert "Table 0" in shown[False]
    assert "Table 4" not in shown[False]
    assert "--all shows" in shown[False]
    assert "more rows are not shown; --all has them" in shown[False]
    assert shown[True].count("_29") == 5
    assert "--all" not in shown[True]


@pytest.mark.parametrize("width", [120, 140])
def test_a_brief_answer_gives_its_tables_what_its_findings_leave_of_a_screen(width):
    rows = [(f"T{k}", float(k), "what a row says at some length") for k in range(12)]
    tables = [section(f"s{k}", f"Table {k}", captioned("", table(["name", ">value", "text"], rows))) for k in range(2)]
    account = replace(Account("A result", ("It is so. " * 10,) * 3, sections(*tables)), brief=("s0", "s1"))
    shown = {}
    for n in (1, 5):
        found = [replace(FINDING, id=f"kind-{k}", statement=f"Found-{k}. " * 20) for k in range(n)]
        stream = io.StringIO()
        showing.show_answer(Console(file=stream, width=width), account, found, everything=False)
        shown[n] = stream.getvalue()
    assert shown[1].count("Table") == 2
    assert shown[5].count("Found-4.") == 20
    assert max(text.count("\n") for text in shown.values()) <= 38


@pytest.mark.parametrize("numbers", [1, 8])
def test_short_statements_beside_many_numbers_stay_whole(numbers):
    said = "the error has shifted since r4" if numbers > 1 else "the rise leaves the range of the model since r4; " * 4
    columns = ["machine", *(f">value {k} [µm]" for k in range(numbers)), "what has changed"]
    account = Account("A", (), (), answer=table(columns, [("mill-0", *["0.376"] * numbers, said.strip())]))
    stream = io.StringIO()
    showing.show_answer(Console(file=stream, width=80), account, (), everything=False)
    assert "…" not in stream.getvalue()
    assert set(said.split()) <= set(stream.getvalue().split())


def test_on_a_narrow_screen_the_findings_that_weigh_least_make_room():
    account = replace(Account("A result", ("It is so. " * 20,) * 3, (), answer=table(["name"], [("T1",)])), brief=())
    found = [replace(FINDING, id=f"kind-{k}", statement=f"Found-{k}. " * 25, suggestion="do " * 40) for k in range(5)]
    stream = io.StringIO()
    showing.show_answer(Console(file=stream, width=80), account, found, everything=False)
    shown = stream.getvalue()
    assert shown.count("\n") <= 37, "and three lines say what was written"
    assert "Found-1" in shown
    assert "Found-4" not in shown
    assert "--all shows" in shown


def test_long_names_in_a_table_that_does_not_fit_are_shortened_in_the_middle():
    names = [f"Spindelstock_Vorderes_Hauptlager_Aussenring_Messstelle_{k}_oben_links" for k in ("A1", "A2", "B1")]
    inside = [f"a_very_long_beginning_{k}_and_an_end_that_is_as_long_as_that" for k in (1, 2, 3)]

    def shown(cells, width):
        stream = io.StringIO()
        rows = [(cell, 1.0, "text") for cell in cells]
        Console(file=stream, width=width).print(showing.table("", ["sensor", "µm", "text"], rows, numeric=["µm"]))
        return [line.split()[0] for line in stream.getvalue().splitlines() if line.strip()][2:]

    assert shown(names, 140) == names
    narrow = shown(names, 60)
    assert len(set(narrow)) == 3
    assert all("…" in one for one in narrow)
    # cut, these would be one: they are broken instead
    assert "…" not in "".join(shown(inside, 40))
