from __future__ import annotations

import math

import pytest

from selector.readers import read


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["1.500", "1.501", "1.502", "1.503"], [1500, 1501, 1502, 1503]),
        (["1.234,5", "1.234,25", "12.345,5", "5,5"], [1234.5, 1234.25, 12345.5, 5.5]),
        (["1 234,5", "1\u00a0234,5", "1\u202f234,5", "5,5"], [1234.5, 1234.5, 1234.5, 5.5]),
        (["1'234,5", "1’234,5", "234,5", "5,5"], [1234.5, 1234.5, 234.5, 5.5]),
    ],
)
def test_grouped_thousands_next_to_decimal_commas_are_told(reads, column, ids, cells, expected):
    reading = reads("t;n [rpm];T1\n" + "".join(f"{i};{cell};2{i},25\n" for i, cell in enumerate(cells)))
    assert column(reading, "n") == expected
    assert column(reading, "T1")[1] == 21.25
    assert "grouped-thousands" in ids(reading)


@pytest.mark.parametrize(("mark", "other"), [(".", ","), (",", ".")])
def test_three_digits_behind_every_mark_are_ambiguous_and_told(reads, column, mark, other):
    content = "t [s];n [rpm]\n" + "".join(f"{i};1{mark}50{i}\n" for i in range(6))
    reading = reads(content)
    assert column(reading, "n")[3] == 1.503
    (finding,) = [f for f in reading.findings if f.id == "ambiguous-decimal"]
    assert finding.level == "warning"
    assert "1503" not in finding.statement
    assert "1500" in finding.statement
    assert "--decimal" in finding.suggestion
    assert column(reads(content, decimal=other), "n")[3] == 1503


@pytest.mark.parametrize("cells", [["0,125", "0,250"], ["20,12", "20,125"], ["20.125", "20.250"]])
def test_clear_decimals_are_not_called_ambiguous(reads, ids, cells):
    separator = "," if "." in cells[0] else ";"
    reading = reads(f"t [s]{separator}T1\n" + "".join(f"{i}{separator}{cells[i % 2]}\n" for i in range(6)))
    assert "ambiguous-decimal" not in ids(reading)


@pytest.mark.parametrize("word", ["OPEN", "Err", "OL", "***", "-OL", "断线", "Sensor-Error", "#ERR"])
def test_a_broken_sensor_is_told_with_place_and_time(reads, column, word):
    cells = ["22.5", "22.6", "22.7", word, word, word]
    reading = reads("t [min],T1,T2\n" + "".join(f"{i},2{i},{cell}\n" for i, cell in enumerate(cells)))
    assert all(math.isnan(v) for v in column(reading, "T2")[3:])
    (finding,) = [f for f in reading.findings if f.id == "sensor-break"]
    assert (finding.where.channel, finding.where.run) == ("T2", "r1")
    assert (finding.where.from_s, finding.where.to_s) == (180.0, 300.0)
    assert finding.evidence["count"] == 3
    assert "end" in finding.statement


@pytest.mark.parametrize("word", ["", "NaN", "#N/A", "-", "1.#QNAN", "n/a", "NULL", "inf", "-1.#IND"])
def test_missing_values_are_missing(reads, column, word):
    cells = ["22.5", word, "22.7", "22.8"]
    reading = reads("t [s],T1,T2\n" + "".join(f"{i},2{i},{cell}\n" for i, cell in enumerate(cells)))
    assert math.isnan(column(reading, "T2")[1])
    assert column(reading, "T2")[2] == 22.7


def test_numeric_break_codes_are_left_for_the_quality_checks(reads, column):
    reading = reads("t [s],T1\n0,850.0\n1,-9999\n2,21\n3,22\n")
    assert column(reading, "T1") == [850.0, -9999.0, 21.0, 22.0]


def test_units_inside_of_cells(reads, column):
    reading = reads("t;T1\n" + "".join(f"{i} min;{68 + i},5 °F\n" for i in range(5)))
    assert reading.recording.time_s("r1")[1] == 60.0
    # (68.5 - 32) / 1.8, a few roundings
    assert column(reading, "T1")[0] == pytest.approx(36.5 / 1.8, rel=1e-14)


def test_on_and_off_become_a_state(reads, column):
    reading = reads("t [s],T1,coolant_on\n0,20,on\n1,21,OFF\n2,22,On\n")
    assert column(reading, "coolant_on") == [1.0, 0.0, 1.0]
    assert reading.recording.channel("coolant_on").role == "state"


def test_other_forms_of_numbers(reads, column):
    cells = ["1.5e1", "+15", "1.5E+01", "1.5D+01", "１５", "−15", '"15"']
    reading = reads("t [s];T1\n" + "".join(f"{i};{cell}\n" for i, cell in enumerate(cells)))
    assert column(reading, "T1") == [15, 15, 15, 15, 15, -15, 15]


def test_words_among_numbers_are_told_with_their_lines(reads, column):
    reading = reads("t [s],T1\n0,20\n1,broke?\n2,22\n3,23\n")
    assert math.isnan(column(reading, "T1")[1])
    (finding,) = [f for f in reading.findings if f.id == "unreadable-cells"]
    assert finding.evidence["lines"] == [3]


def test_numbers_beyond_all_bounds_are_missing_and_told(reads, column, ids):
    reading = reads("t [s],T1\n0," + "9" * 3_000_000 + "\n1,2\n2,1e999\n3,4\n")
    assert [math.isnan(v) for v in column(reading, "T1")] == [True, False, True, False]
    assert "infinite-values" in ids(reading)


def test_every_float_survives(reads, column):
    values = [0.1, 1 / 3, 1e-300, 1.7976931348623157e308, 5e-324, -0.0, 123456789.123456789]
    reading = reads("t [s],Z [um]\n" + "".join(f"{i},{v!r}\n" for i, v in enumerate(values)))
    assert [v.hex() for v in column(reading, "Z")] == [v.hex() for v in values]


@pytest.mark.parametrize(
    "text",
    ["time_s;T\n0;20,5\n1;21\n2;22\n", "time_s\tT\n0\t20,5\n1\t21\n2\t22\n", "T1\n20,5\n21\n22\n", "20,5\n21\n22\n"],
)
def test_a_decimal_comma_in_the_first_row_alone(text, tmp_path):
    (tmp_path / "r.csv").write_text(text, encoding="utf-8")
    values = read([tmp_path / "r.csv"]).recording.frame.to_numpy()
    assert values.ravel().tolist() == [20.5, 21.0, 22.0]
