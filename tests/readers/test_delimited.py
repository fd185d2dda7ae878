from __future__ import annotations

import math

import numpy as np
import pytest

from selector.errors import ReadError
from tests.work import counted_calls

BODY = "".join(f"{60 * i};{20 + i / 4:.2f};{i - 2.5:.1f}\n" for i in range(8)).replace(".", ",")
T1 = [20 + i / 4 for i in range(8)]


@pytest.mark.parametrize(
    ("head", "rows_above"),
    [
        ("t [s];T1 [°C];Z [µm]\n", 0),
        ("sep=;\nt [s];T1 [°C];Z [µm]\n", 1),
        ("Logger;;\nDatum: 01.02.2026;;\n;;\nt [s];T1 [°C];Z [µm]\n", 3),
        ("Sample interval;60\nOperator;Smith\n\nt/s;T1/°C;Z/µm\n", 3),
        ("# run 5\n# cold start\nt (s);T1 (degC);Z (um)\n", 2),
        ("t_s;T1_degC;Z_um\n", 0),
        ('"t\n[s]";"T1\n[°C]";"Z\n[µm]"\n', 3),
    ],
)
def test_names_units_and_preamble(reads, column, times, head, rows_above):
    reading = reads(head + BODY)
    assert column(reading, "T1") == T1
    assert times(reading) == [60.0 * i for i in range(8)]
    assert [(c.name, c.unit_in_file) for c in reading.channels] == [("T1", "degC"), ("Z", "um")]
    assert reading.reading["skipped_rows"] == rows_above
    assert reading.reading["unit_row"] is False


@pytest.mark.parametrize(
    "above",
    [
        "Datum;20.11.2026;\nKanal;1;2\n", ";1;2\n", "0;1;2\n", "Datum;20.11.2026;\n1;2;3\n",
        "Datum;20.11.2026;08:00\nNr;4711;4712\nFaktor;1,0;0,5\n",
    ],
)  # fmt: skip
def test_numbers_of_channels_and_a_date_above_the_names_are_neither_names_nor_a_sample(reads, column, above):
    reading = reads(above + "t [s];T1 [°C];Z [µm]\n" + BODY)
    assert [c.name for c in reading.channels] == ["T1", "Z"]
    assert column(reading, "T1") == T1
    assert reading.reading["skipped_rows"] == above.count("\n")


def test_an_event_between_the_first_samples_is_no_row_of_names(reads, column):
    first, *rest = BODY.splitlines(keepends=True)
    reading = reads("t [s];T1 [°C];Z [µm]\n" + first + "Zeit;Spindel an;\n" + "".join(rest))
    assert column(reading, "T1")[0] == T1[0]


@pytest.mark.parametrize(
    ("units", "expected"),
    [("min;°C;µm", [1200.0, 0.05]), ("s;°F;mm", [20.0, 50.0]), ("[h];[K];[inch]", [72e3, 1270.0])],
)
def test_a_row_of_units_is_obeyed(reads, units, expected):
    rows = "".join(f"{i};{300 + i};{i / 400}\n" for i in range(21))
    reading = reads(f"t;T1;Z\n{units}\n" + rows)
    assert reading.reading["unit_row"] is True
    assert reading.recording.time_s("r1")[-1] == pytest.approx(expected[0], rel=1e-12)
    # unit conversion: a few roundings of float64
    assert reading.recording.values("r1", ["Z"])[-1, 0] == pytest.approx(expected[1], rel=1e-12)


def test_campbell_file_with_four_header_rows(reads, column):
    head = (
        '"TOA5","CR1000","CR1000","1234","Std.32","CPU:x.CR1","5","Table1"\n"TIMESTAMP","RECORD","T1_Avg","T2_Avg","Z_Avg"\n'
        '"TS","RN","Deg C","Deg C","um"\n"","","Avg","Avg","Avg"\n'
    )
    rows = "".join(f'"2026-01-02 10:0{i}:00",{i},{20 + i},"NAN",{i}.25\n' for i in range(6))
    reading = reads(head + rows)
    assert column(reading, "T1_Avg") == [20, 21, 22, 23, 24, 25]
    assert reading.runs[0].start == "2026-01-02T10:00:00"
    assert [c.name for c in reading.channels] == ["T1_Avg", "T2_Avg", "Z_Avg"]
    assert any(f.id == "empty-channel" and f.where.channel == "T2_Avg" for f in reading.findings)


def test_columns_without_names_are_named_and_told(reads, ids):
    reading = reads("0,21.5,22\n10,22,23\n20,23,24\n30,23,25\n40,24,26\n50,24,26\n")
    assert [c.column for c in reading.channels] == ["col2", "col3"]
    assert {"no-header", "ambiguous-role", "time-column-guessed"} <= ids(reading)
    assert all("role" in c.guessed for c in reading.channels)


def test_hash_before_the_names(reads, column):
    reading = reads("# run 5\n# t T1 Z\n0 21.5 22\n1 22 23\n2 23 24\n3 23 25\n")
    assert column(reading, "T1") == [21.5, 22, 23, 23]


@pytest.mark.parametrize("gap", [" ", "   ", "\t \t"])
def test_runs_of_blanks(reads, column, gap):
    rows = [["Time", "T1", "T2"], *[[str(i), f"2{i}.5", f"3{i}.5"] for i in range(5)]]
    reading = reads("\n".join("  " + gap.join(row) for row in rows))
    assert column(reading, "T2") == [30.5, 31.5, 32.5, 33.5, 34.5]


def test_one_column_with_decimal_comma_is_one_column(reads, column, ids):
    reading = reads("T1\n" + "".join(f"20,{i}\n" for i in range(6)))
    assert column(reading, "T1") == [20.0, 20.1, 20.2, 20.3, 20.4, 20.5]
    assert "no-clock" in ids(reading)


def test_quoted_decimal_commas_between_commas(reads, column):
    reading = reads('"t [s]","T1"\n' + "".join(f'"{i}","2{i},5"\n' for i in range(6)))
    assert column(reading, "T1")[:3] == [20.5, 21.5, 22.5]


def test_comma_as_separator_and_decimal_mark_is_refused_with_advice(reads):
    with pytest.raises(ReadError) as told:
        reads("t,T1,Z\n" + "".join(f"{i},2{i},5,{i},25\n" for i in range(6)))
    assert "';'" in told.value.advice


def test_trailing_separators_make_no_column(reads):
    assert [c.name for c in reads("t;T1;\n" + "".join(f"{i};2{i};\n" for i in range(5))).channels] == ["T1"]
    assert [c.name for c in reads("t;T1\n" + "".join(f"{i};2{i};;\n" for i in range(5))).channels] == ["T1"]


def test_ragged_lines_are_told_by_number_and_shift_nothing(reads, column):
    reading = reads("t,T1,T2\n0,1,2\n1,2\n2,3,4,5\n3,4,5\n4,5,6\n5,6,7\n6,7,8\n7,8,9\n")
    assert column(reading, "T1") == [1, 2, 4, 5, 6, 7, 8]
    assert math.isnan(column(reading, "T2")[1])
    told = {f.id: f.evidence["lines"] for f in reading.findings if "lines" in f.evidence}
    assert told["ragged-rows"] == [3]
    assert told["overlong-rows"] == [4]


def test_a_last_line_that_was_cut_off_is_left_out(reads, column):
    reading = reads("t,T1,T2\n" + "".join(f"{i},{i + 20},{i + 30}\n" for i in range(6)) + "6,2")
    assert column(reading, "T1")[-1] == 25
    assert any("cut off" in f.statement for f in reading.findings)


def test_a_column_of_remarks_may_hold_the_separator(reads, times):
    rows = "".join(f"{i};2{i},5;{'on; loud' if i == 3 else ''}\n" for i in range(8))
    reading = reads("t [s];T1;Remark\n" + rows)
    assert times(reading) == [0, 1, 2, 3, 4, 5, 6, 7]
    assert any(f.id == "text-columns" and f.evidence["columns"] == ["Remark"] for f in reading.findings)


def test_repeated_headers_comments_and_footers_are_no_samples(reads, times):
    reading = reads("t,T1\n0,1\n1,2\n# pause\nt,T1\n2,3\n3,4\nMin,1\nMax,4\n\nEnd of measurement\n")
    assert times(reading) == [0, 1, 2, 3]
    assert {"repeated-header", "comment-lines", "missing-stamps", "text-lines"} <= {f.id for f in reading.findings}


def test_a_time_column_for_every_channel(reads, times, column):
    head = "Name\tProject\nFile\tx.svdx\n\nName\tT1\tName\tZ\nSampleTime[ms]\t500\tSampleTime[ms]\t500\n"
    head += "Unit\t°C\tUnit\tµm\n\n"
    rows = "".join(f"{500 * i}\t{20 + i}.5\t{500 * i}\t{i}.25\n" for i in range(6))
    reading = reads(head + rows)
    assert times(reading) == [0, 0.5, 1, 1.5, 2, 2.5]
    assert column(reading, "T1")[:2] == [20.5, 21.5]
    assert [(c.name, c.role, c.unit_in_file) for c in reading.channels] == [
        ("T1", "temperature", "degC"),
        ("Z", "displacement", "um"),
    ]
    first = 134396352000000000
    rows = "".join(f"{first + 5_000_000 * i}\t{20 + i}.5\t{first + 5_000_000 * i}\t{i}.25\n" for i in range(6))
    reading = reads(head + rows)
    assert times(reading) == [0, 0.5, 1, 1.5, 2, 2.5]
    assert reading.runs[0].start == "2026-11-20T08:00:00"


def test_two_columns_of_one_name(reads, ids, column):
    reading = reads("t,T1,T1\n0,1,20\n1,2,21\n2,3,22\n")
    assert column(reading, "T1.2") == [20, 21, 22]
    assert "duplicate-header" in ids(reading)


def test_row_numbers_without_a_name_do_not_shift_the_names(reads, column):
    reading = reads("t T1 Z\n" + "".join(f"{i} {i * 10} {20 + i} {i}.5\n" for i in range(6)))
    assert column(reading, "T1") == [20, 21, 22, 23, 24, 25]


def test_names_of_digits(reads):
    reading = reads("time_s,1,2\n" + "".join(f"{i},{20 + i},{30 + i}\n" for i in range(5)))
    assert [c.name for c in reading.channels] == ["1", "2"]
    assert len(reading.recording.frame) == 5


def test_header_row_of_the_users_choice(reads):
    content = "a,b,c\nt,T1,T2\n" + "".join(f"{i},2{i},3{i}\n" for i in range(5))
    assert [c.name for c in reads(content, header_row=2).channels] == ["T1", "T2"]
    with pytest.raises(ReadError, match="header row 99"):
        reads(content, header_row=99)
    assert [c.column for c in reads("".join(f"{i},2{i},3{i}\n" for i in range(6)), header_row=0).channels] == [
        "col2",
        "col3",
    ]


def test_columns_are_matched_to_lines_of_text_without_a_step_for_every_cell(reads):
    # the promise is 40 columns x 200 000 rows in 3 s: benchmarks/bench_promises.py
    rows, columns = 20_000, 40
    cells = np.round(20 + np.random.default_rng(0).normal(0, 3, (rows, columns)), 3)
    text = "t [s]," + ",".join(f"T{k} [degC]" for k in range(1, columns)) + "\n"
    cells[:, 0] = np.arange(rows)
    text += "\n".join(",".join(map(repr, row)) for row in cells.tolist())
    with counted_calls() as calls:
        reading = reads(text)
    assert np.array_equal(reading.recording.values("r1", reading.recording.names), cells[:, 1:])
    assert calls.count < rows * columns
