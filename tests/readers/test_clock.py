from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.errors import ReadError
from selector.readers import Overrides, read
from selector.readers.clock.stamps import stamps as stamps_of
from selector.readers.machine_file import machine_from_text
from selector.readers.roles.names import name_and_unit


def run(stamps: list[str], name: str = "Time", separator: str = ";") -> str:
    return f"{name}{separator}T1\n" + "".join(f"{s}{separator}{20 + i}\n" for i, s in enumerate(stamps))


@pytest.mark.parametrize(
    ("stamps", "start"),
    [
        (["2026-11-20 08:00:00", "2026-11-20 08:00:30", "2026-11-20 08:01:00"], "2026-11-20T08:00:00"),
        (["2026-11-20T08:00:00.000Z", "2026-11-20T08:00:30Z", "2026-11-20T08:01:00Z"], "2026-11-20T08:00:00+00:00"),
        (
            ["2026-11-20T08:00:00+01:00", "2026-11-20T08:00:30+01:00", "2026-11-20T08:01:00+01:00"],
            "2026-11-20T08:00:00+01:00",
        ),
        (["20.11.2026 08:00:00", "20.11.2026 08:00:30", "20.11.2026 08:01:00"], "2026-11-20T08:00:00"),
        (["20.11.26 8:00:00", "20.11.26 8:00:30", "20.11.26 8:01:00"], "2026-11-20T08:00:00"),
        (["11/20/2026 08:00:00 AM", "11/20/2026 08:00:30 AM", "11/20/2026 08:01:00 AM"], "2026-11-20T08:00:00"),
        (["20/11/2026 20:00:00", "20/11/2026 20:00:30", "20/11/2026 20:01:00"], "2026-11-20T20:00:00"),
        (["2026/11/20 8:00:00", "2026/11/20 8:00:30", "2026/11/20 8:01:00"], "2026-11-20T08:00:00"),
        (["20-Nov-2026 08:00:00", "20-Nov-2026 08:00:30", "20-Nov-2026 08:01:00"], "2026-11-20T08:00:00"),
        (["2026年11月20日 08:00:00", "2026年11月20日 08:00:30", "2026年11月20日 08:01:00"], "2026-11-20T08:00:00"),
        (["20261120T080000", "20261120T080030", "20261120T080100"], "2026-11-20T08:00:00"),
        (["20.11.2026 08:00:00 CET", "20.11.2026 08:00:30 CET", "20.11.2026 08:01:00 CET"], "2026-11-20T08:00:00"),
        (["20261120080000", "20261120080030", "20261120080100"], "2026-11-20T08:00:00"),
        (["1795161600", "1795161630", "1795161660"], "2026-11-20T08:00:00"),
        (["1795161600000", "1795161630000", "1795161660000"], "2026-11-20T08:00:00"),
        (["134396352000000000", "134396352300000000", "134396352600000000"], "2026-11-20T08:00:00"),
        (["46346.333333333336", "46346.333680555560", "46346.334027777775"], "2026-11-20T08:00:00"),
        (["20.11.2026 07:59:30,500", "20.11.2026 08:00:00,500", "20.11.2026 08:00:30,500"], "2026-11-20T07:59:30.500"),
    ],
)
def test_absolute_clocks(reads, stamps, start):
    reading = reads(run(stamps))
    assert reading.runs[0].start == start
    # days of a spreadsheet resolve about 1 µs, epochs and texts are exact
    assert np.allclose(reading.recording.time_s("r1"), [0, 30, 60], atol=1e-3)
    assert reading.reading["time"]["unit"] == "datetime"
    assert all(start in one.statement for one in reading.findings if one.id == "absolute-clock")


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        (["08:00:00", "08:00:30", "08:01:00"], [0, 30, 60]),
        (["23:59:30", "00:00:00", "00:00:30"], [0, 30, 60]),
        (["11:59:30 PM", "12:00:00 AM", "12:00:30 AM"], [0, 30, 60]),
        (["11:59:30 AM", "12:00:00 PM", "12:00:30 PM"], [0, 30, 60]),
        (["下午 11:59:30", "上午 12:00:00", "上午 12:00:30"], [0, 30, 60]),
        (["12:59:30", "01:00:00", "01:00:30"], [0, 30, 60]),
        (["35:59:30", "36:00:00", "36:00:30"], [0, 30, 60]),
        (["0:00:00.25", "0:00:00.5", "0:00:00.75"], [0, 0.25, 0.5]),
        (["10:00:00:125", "10:00:00:250", "10:00:00:375"], [0, 0.125, 0.25]),
    ],
)
def test_times_of_day(reads, times, stamps, expected):
    assert times(reads(run(stamps))) == expected


def test_two_parts_may_be_hours_or_minutes_and_that_is_told(reads, times, ids):
    content = run([f"{i:02d}:30" for i in range(4)])
    reading = reads(content)
    assert times(reading) == [0, 3600, 7200, 10800]
    assert "ambiguous-time" in ids(reading)
    assert times(reads(content, time_unit="min")) == [0, 60, 120, 180]
    assert ids(reads(content, time_unit="datetime")) == set()
    assert ids(reads(run(["08:30", "08:31", "08:32"]))) == set()


def test_several_midnights(reads, times, column):
    stamps = [f"{(22 + 6 * i) % 24:02d}:00:00" for i in range(12)]
    reading = reads(run(stamps))
    assert times(reading) == [6 * 3600.0 * i for i in range(12)]
    assert any(f.id == "midnight-wrap" and f.evidence["count"] == 3 for f in reading.findings)


@pytest.mark.parametrize("header", ["Datum;Uhrzeit", "Date;Time", "日期;时间", "Дата;Время"])
def test_date_and_time_in_two_columns(reads, times, header):
    rows = ["31.12.2025;23:59:30", "01.01.2026;00:00:00", "01.01.2026;00:00:30"]
    reading = reads(header + ";T1\n" + "".join(f"{row};2{i},5\n" for i, row in enumerate(rows)))
    assert times(reading) == [0, 30, 60]
    assert reading.reading["time"]["columns"] == header.split(";")
    assert reading.runs[0].start == "2025-12-31T23:59:30"


def test_an_ambiguous_date_is_told_and_can_be_settled(reads):
    content = run([f"03/04/2026 10:0{i}" for i in range(4)])
    reading = reads(content)
    (finding,) = [f for f in reading.findings if f.id == "ambiguous-date"]
    assert finding.level == "warning"
    assert "--date-order" in finding.suggestion
    assert reads(content, date_order="dmy").runs[0].start == "2026-04-03T10:00:00"
    assert reads(content, date_order="mdy").runs[0].start == "2026-03-04T10:00:00"
    machine = machine_from_text("[time]\ncolumn='Time'\nunit='datetime'\ndate_order='dmy'", "m")
    settled = reads(content, machine=machine)
    assert settled.runs[0].start == "2026-04-03T10:00:00"
    assert not [f for f in settled.findings if f.id == "ambiguous-date"]


@pytest.mark.parametrize(
    ("stamps", "start"),
    [
        (["1/30/2026", "1/31/2026", "2/1/2026"], "2026-01-30T00:00:00"),
        (["30/1/2026", "31/1/2026", "1/2/2026"], "2026-01-30T00:00:00"),
        (["2/3/2026 12:00", "3/3/2026 12:00", "4/3/2026 12:00"], "2026-03-02T12:00:00"),
        (["3/2/2026 12:00", "3/3/2026 12:00", "3/4/2026 12:00"], "2026-03-02T12:00:00"),
    ],
)
def test_several_dates_settle_their_order(reads, times, stamps, start):
    reading = reads(run(stamps))
    assert reading.runs[0].start == start
    assert times(reading) == [0, 86400, 172800]


@pytest.mark.parametrize(("unit", "factor"), [("s", 1), ("ms", 1e-3), ("min", 60), ("h", 3600), ("d", 86400)])
def test_units_of_time(reads, unit, factor):
    named = (f"t [{unit}]", f"Time ({unit})", f"Zeit/{unit}", f"t_{unit}", f"t {unit}", f"Elapsed time {unit}")
    for name in (*named, f"Время_{unit}", *(["Time(min.)"] if unit == "min" else [])):
        seconds = reads(run(["10", "20", "30"], name)).recording.time_s("r1")
        assert np.allclose(seconds, np.array([0, 10, 20]) * factor, rtol=1e-15)


def test_the_last_word_is_a_unit_of_time_behind_a_time_only():
    assert [name_and_unit(name) for name in ("time min", "Zeit std.", "время ч")] == [
        ("time", "min"), ("Zeit", "std."), ("время", "ч"),
    ]  # fmt: skip
    for name in ("Load min", "T min", "Time stamp", "Temps C"):
        assert name_and_unit(name) == (name, None)


def test_a_missing_unit_of_time_is_told_and_can_be_given(reads, times, ids):
    reading = reads(run(["0", "1", "2"], "t"))
    assert times(reading) == [0, 1, 2]
    assert "time-unit-guessed" in ids(reading)
    given = reads(run(["0", "1", "2"], "t"), time_unit="min")
    assert times(given) == [0, 60, 120]
    assert "time-unit-guessed" not in ids(given)


def test_fractions_of_a_day(reads, ids):
    reading = reads(run([repr(0.25 + i * 30 / 86400) for i in range(5)], "Uhrzeit"))
    assert np.allclose(reading.recording.time_s("r1"), 30.0 * np.arange(5), atol=1e-4)  # rounded to 0.1 ms
    assert "time-unit-guessed" in ids(reading)


def test_no_time_column(reads, times, ids):
    content = "T1,T2\n" + "".join(f"2{i % 7}.5,3{i % 3}.5\n" for i in range(5))
    reading = reads(content)
    assert times(reading) == [0, 1, 2, 3, 4]
    (finding,) = [f for f in reading.findings if f.id == "no-clock"]
    assert "period_s" in finding.suggestion
    assert times(reads(content, period_s=60.0))[-1] == 240.0
    machine = machine_from_text("[time]\nperiod_s = 60", "m")
    settled = reads(content, machine=machine)
    assert times(settled)[-1] == 240.0
    assert "no-clock" not in ids(settled)


def test_a_time_column_of_words_is_told(reads, times):
    reading = reads("Time,T1\nx,20\ny,21\nz,22\n")
    assert times(reading) == [0, 1, 2]
    (finding,) = [f for f in reading.findings if f.id == "no-clock"]
    assert "'Time'" in finding.statement


def test_sample_numbers_are_no_channel(reads):
    reading = reads("No.;t [s];T1\n" + "".join(f"{i + 1};{i * 5};2{i}\n" for i in range(5)))
    assert [c.name for c in reading.channels] == ["T1"]
    assert reading.recording.time_s("r1")[-1] == 20


def test_a_current_called_i_is_not_taken_for_a_counter(reads):
    reading = reads("t [s];I [A]\n" + "".join(f"{i};{i % 3}.5\n" for i in range(6)))
    assert reading.recording.channel("I").role == "current"


def test_repeated_rows_and_stamps(reads, times, column, ids):
    reading = reads("t [s],T1\n0,1\n1,2\n1,2\n2,3\n2,5\n3,4\n4,4\n5,5\n6,5\n7,5\n")
    assert times(reading) == [0, 1, 2, 3, 4, 5, 6, 7]
    assert column(reading, "T1")[:4] == [1, 2, 4, 4]
    assert "repeated-stamps" in ids(reading)
    assert any(f.id == "repeated-rows" and f.evidence["count"] == 1 for f in reading.findings)


def test_stamps_coarser_than_the_sampling_are_spread(reads, times, ids):
    stamps = [f"10:00:{i // 5:02d}" for i in range(2, 40)]
    reading = reads(run(stamps))
    assert np.allclose(times(reading), 0.2 * np.arange(38), atol=1e-6)  # shown rounded to a microsecond
    assert "coarse-stamps" in ids(reading)


@pytest.mark.parametrize("order", [[0, 1, 3, 2, 4, 5], [5, 4, 3, 2, 1, 0], [3, 4, 5, 0, 1, 2], [4, 0, 5, 2, 1, 3]])
def test_rows_out_of_order_are_sorted_and_told(reads, times, column, order):
    reading = reads("t [s],T1\n" + "".join(f"{i * 10},{20 + i}\n" for i in order))
    assert times(reading) == [0, 10, 20, 30, 40, 50]
    assert column(reading, "T1") == [20, 21, 22, 23, 24, 25]
    assert any(f.id == "unsorted-stamps" for f in reading.findings)


@pytest.mark.parametrize(
    ("second", "cause"),
    [(range(0, 100, 10), "restart"), (range(40, 140, 10), "set back"), (range(45, 145, 10), "set back")],
)
def test_a_clock_that_jumps_back_is_told_and_moved_on(reads, times, second, cause):
    stamps = [*range(0, 100, 10), *second]
    reading = reads("t [s],T1\n" + "".join(f"{t},{20 + i}\n" for i, t in enumerate(stamps)))
    assert times(reading) == [10.0 * i for i in range(20)]
    (finding,) = [f for f in reading.findings if f.id == "clock-jump-back"]
    assert finding.level == "warning"
    assert cause in finding.statement
    assert finding.evidence["row"] == "line 12"
    assert finding.where.from_s == 100.0
    assert finding.evidence["jump_s"] == second[0] - 90


def test_end_and_begin_of_summer_time(reads, times):
    autumn = [f"2026-10-25 {h:02d}:{m:02d}" for h in (1, 2, 2, 3) for m in range(60)]
    reading = reads(run(autumn))
    assert times(reading) == [60.0 * i for i in range(240)]
    assert any(f.id == "clock-jump-back" and "summer time" in f.statement for f in reading.findings)
    # an hour on a day in which no summer time ends is not called its end
    reading = reads(run([f"2026-03-05 {h:02d}:{m:02d}" for h in (1, 2, 2, 3) for m in range(60)]))
    (finding,) = [f for f in reading.findings if f.id == "clock-jump-back"]
    assert "(an hour, as at the end of summer time)" in finding.statement
    spring = [f"2026-03-29 {h:02d}:{m:02d}" for h in (1, 3) for m in range(60)]
    reading = reads(run(spring))
    assert times(reading) == [60.0 * i for i in range(120)]
    assert any(f.id == "clock-jump-forward" for f in reading.findings)
    ordinary_gap = [f"2026-03-25 {h:02d}:{m:02d}" for h in (1, 3) for m in range(60)]
    assert times(reads(run(ordinary_gap)))[60] == 7200.0


def test_rows_without_a_stamp_are_left_out_and_told(reads, times):
    reading = reads("t [s],T1\n0,1\n,2\n2,3\n3,4\n")
    assert times(reading) == [0, 2, 3]
    (finding,) = [f for f in reading.findings if f.id == "missing-stamps"]
    assert finding.evidence["rows"] == ["line 3"]


def test_a_block_that_was_pasted_twice_is_taken_once(reads, times):
    stamps = [*range(0, 100, 10), *range(50, 150, 10)]
    reading = reads("t [s],T1\n" + "".join(f"{t},{20 + t / 10}\n" for t in stamps))
    assert times(reading) == [10.0 * i for i in range(15)]
    assert not [f for f in reading.findings if f.id == "clock-jump-back"]
    assert any(f.id == "repeated-rows" for f in reading.findings)


def test_a_time_column_that_is_not_there(reads):
    with pytest.raises(ReadError, match=r"nearest: 'Time'"):
        reads(run(["0", "1", "2"]), time_column="tme")
    with pytest.raises(ReadError, match=r"no times .*'a'"):
        reads("a,b\nx,1\ny,2\nz,3\n", time_column="a")


def test_milliseconds_in_a_column_of_their_own(reads, times):
    rows = "".join(f"10:00:0{i // 4};{i % 4 * 250};{20 + i}\n" for i in range(12))
    assert times(reads("Time;ms;T1\n" + rows)) == [0.25 * i for i in range(12)]


def test_irregular_sampling_stays_irregular(reads, times):
    assert times(reads(run(["0", "1", "5", "5.5", "100"], "t [s]"))) == [0, 1, 5, 5.5, 100]


def test_several_files_start_at_zero_each_and_keep_their_own_stamp(tmp_path):
    for k in (1, 2):
        (tmp_path / f"r{k}.csv").write_text(run([str(100 * k + i) for i in range(4)], "t [s]"), encoding="utf-8")
    reading = read([tmp_path / "r1.csv", tmp_path / "r2.csv"], overrides=Overrides())
    assert [reading.recording.time_s(name)[0] for name in ("r1", "r2")] == [0.0, 0.0]
    assert [reading.recording.provenance["runs"][name]["first_stamp_s"] for name in ("r1", "r2")] == [100.0, 200.0]


def dated_parts(rows: int = 200) -> pd.DataFrame:
    moments = pd.Timestamp("2026-03-31 23:58:30") + pd.to_timedelta(2.0 * np.arange(rows), unit="s")
    parts = {name: getattr(moments, name) for name in ("year", "month", "day", "hour", "minute", "second")}
    return pd.DataFrame({"id": np.arange(rows), **parts, "temp1": 20.0 + 0.01 * np.arange(rows)})


@pytest.mark.parametrize(
    "names", [{}, {"year": "Jahr", "month": "Monat", "day": "Tag", "hour": "Stunde", "minute": "min", "second": "sec"}]
)
def test_year_to_second_in_columns_of_their_own_are_a_clock(tmp_path, names):
    dated_parts().rename(columns=names).to_csv(tmp_path / "r.csv", index=False)
    reading = read([tmp_path / "r.csv"])
    [run] = reading.runs
    assert (run.start, run.period_s, run.duration_s) == ("2026-03-31T23:58:30", 2.0, 398.0)
    assert reading.recording.names == ("temp1",)


def test_a_machine_file_may_name_the_six_columns(tmp_path):
    named = '[time]\ncolumn = ["year", "month", "day", "hour", "minute", "second"]\n'
    (tmp_path / "m.toml").write_text(named, encoding="utf-8")
    dated_parts().to_csv(tmp_path / "r.csv", index=False)
    assert read([tmp_path / "r.csv"], tmp_path / "m.toml").runs[0].start == "2026-03-31T23:58:30"


def test_hour_and_minute_are_a_time_of_day_and_go_with_a_date(tmp_path):
    parts = dated_parts()
    parts[["hour", "minute", "second", "temp1"]].to_csv(tmp_path / "daily.csv", index=False)
    [run] = read([tmp_path / "daily.csv"]).runs
    assert (run.start, run.duration_s) == (None, 398.0)
    dated = parts[["hour", "minute", "second", "temp1"]].assign(Date="2026-03-31").iloc[:40]
    dated.to_csv(tmp_path / "dated.csv", index=False)
    assert read([tmp_path / "dated.csv"]).runs[0].start == "2026-03-31T23:58:30"


def test_names_of_units_of_time_are_no_channels(tmp_path):
    table = dated_parts()
    table["Time"] = 2.0 * np.arange(len(table))
    table[["Time", "minute", "second", "temp1"]].to_csv(tmp_path / "r.csv", index=False)
    assert read([tmp_path / "r.csv"]).recording.names == ("temp1",)


def test_milliseconds_since_1970_without_a_name_go_before_a_row_counter(tmp_path):
    steps = np.random.default_rng(0).uniform(20.0, 7000.0, 300)
    moments = 1458748404944 + np.round(np.cumsum(steps))
    table = pd.DataFrame({"EID": np.arange(300), "AbsT": moments, "temp1": 20.0 + 0.01 * np.arange(300)})
    table.to_csv(tmp_path / "r.csv", index=False)
    reading = read([tmp_path / "r.csv"])
    assert reading.runs[0].duration_s == pytest.approx((moments[-1] - moments[0]) / 1e3)
    [told] = [one for one in reading.findings if one.id == "time-column-guessed"]
    assert told.evidence["column"] == "AbsT"


@pytest.mark.parametrize("uneven", [0, 13])
def test_a_first_column_that_rises_with_a_few_uneven_steps_is_the_time(tmp_path, uneven):
    steps = np.full(400, 2.0)
    steps[np.linspace(5, 390, uneven).astype(int)] = 3.0
    time_s = np.cumsum(steps)
    values = 21.0 + np.random.default_rng(0).standard_normal(400)
    pd.DataFrame({"a": time_s, "b": values}).to_csv(tmp_path / "r.csv", index=False, header=False)
    reading = read([tmp_path / "r.csv"])
    assert reading.runs[0].duration_s == time_s[-1] - time_s[0]
    assert "time-column-guessed" in {one.id for one in reading.findings}


def test_a_clock_that_was_never_set_is_none_and_a_counter_of_milliseconds_is_one(tmp_path):
    millis = 282 + 1130 * np.arange(40)
    rows = "".join(f"2000-01-01T00:00:00Z, {one}, {25.0 - 0.01 * k}\n" for k, one in enumerate(millis))
    (tmp_path / "a.csv").write_text("# Date, millis, temperature\n" + rows, encoding="utf-8")
    reading = read([tmp_path / "a.csv"])
    assert (reading.reading["time"]["columns"], reading.runs[0].period_s) == (["millis"], pytest.approx(1.13))
    assert reading.recording.names == ("temperature",)


def test_dates_in_another_order_than_was_said_are_told_so(reads):
    content = run([f"24/11/2026 10:0{i}" for i in range(4)])
    (finding,) = [f for f in reads(content, date_order="mdy").findings if f.id == "no-clock"]
    assert "no times in the order mdy" in finding.statement
    assert "--date-order" in finding.suggestion
    machine = machine_from_text("[time]\ncolumn='Time'\nunit='datetime'\ndate_order='mdy'", "m")
    with pytest.raises(ReadError) as caught:
        reads(content, machine=machine)
    assert "--date-order" in caught.value.advice


def test_a_cyrillic_second_is_one(reads, times):
    rows = "".join(f"{i};{20 + i},5;{i}\n" for i in range(8))
    reading = reads("Время, \u0441;T1, \u0441;Z, мкм\n" + rows)
    assert times(reading) == [float(i) for i in range(8)]
    assert "time-unit-guessed" not in {finding.id for finding in reading.findings}
    assert [c.unit_in_file for c in reading.channels] == ["degC", "um"]


@pytest.mark.parametrize(
    ("unit", "second"), [("Sekunden", 1), ("minutos", 60), ("heures", 3600), ("Tage", 86400), ("Wochen", 604800)]
)
def test_units_of_time_in_other_languages(reads, times, unit, second):
    reading = reads(f"t [{unit}];T1 [°C]\n" + "".join(f"{i};{20 + i}\n" for i in range(8)))
    # hours and weeks are seconds by one multiplication
    assert times(reading) == pytest.approx([float(second * i) for i in range(8)], rel=1e-12)
    assert "time-unit-guessed" not in {finding.id for finding in reading.findings}


@pytest.mark.parametrize("label", ["N° 12-5-3", "№№ 3.2 5", "→→→ 2024-01-05", "12 kΩ·m 5"])
def test_signs_before_numbers_are_no_weekday_and_no_month(label):
    cells = np.array([label] * 3, dtype=np.object_)
    assert stamps_of(cells, "label", "file", None, False) is None
