"""Two loggers at one machine: temperatures in one file, displacements in another, and one run of both."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.errors import RecordingError
from selector.readers import machine, read
from selector.readers.beside import on_clock
from selector.readers.stream import stream_parquet

ROWS, SLOW_S, FAST_S = 120, 60.0, 4.0


def course(time_s, k):
    return 10.0 * (1.0 - np.exp(-np.asarray(time_s) / (1500.0 + 200.0 * k)))


@pytest.fixture
def loggers(tmp_path) -> Path:
    """Five runs, each a file of temperatures every minute and one of displacements every 4 s that begins 90 s later."""
    for k in range(5):
        draw = np.random.default_rng(k)
        slow = SLOW_S * np.arange(ROWS)
        fast = 90.0 + FAST_S * np.arange(int(ROWS * SLOW_S / FAST_S))
        begin = pd.Timestamp("2026-03-02 06:00:00") + pd.Timedelta(days=k)
        warm = {"time": begin + pd.to_timedelta(slow, unit="s")}
        for j, part in enumerate((1.0, 0.6, 0.3)):
            warm[f"T{j + 1} [degC]"] = 20.0 + part * course(slow, k + 3 * j) + 0.02 * draw.standard_normal(ROWS)
        # a dial that is at another place every day
        moved = 40.0 * k + 3.0 * course(fast, k) + 0.2 * draw.standard_normal(len(fast))
        gauge = {"time": begin + pd.to_timedelta(fast, unit="s"), "Z [um]": moved}
        pd.DataFrame(warm).to_csv(tmp_path / f"logger_{k + 1}.csv", index=False)
        pd.DataFrame(gauge).to_csv(tmp_path / f"gauge_{k + 1}.csv", index=False)
    return tmp_path


def test_describe_proposes_it_and_every_command_takes_it(loggers, capsys):
    written = loggers / "machine.toml"
    files = [str(loggers / f"{kind}_{k}.csv") for kind in ("logger", "gauge") for k in range(1, 6)]
    assert exit_status(["select", *files]) == 2
    assert "two-loggers" in capsys.readouterr().err
    assert exit_status(["describe", *files, "--write", str(written), "--json"]) == 0
    [told] = [one for one in json.loads(capsys.readouterr().out)["findings"] if one["id"] == "two-loggers"]
    assert told["evidence"]["beside"] == {f"logger_{k}": f"gauge_{k}" for k in range(1, 6)}
    assert machine(written).runs["logger_3"].beside == ("gauge_3",)
    assert exit_status(["select", *files, "--machine", str(written), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    # the gauge's noise of 0.2 µm is in means of 15 readings, the thermometer's of 0.02 K counts threefold
    assert found["models"]["Z"]["heldout_rmse_um"] < 0.2
    assert "two-loggers" not in {one["id"] for one in found["findings"]}


def test_a_quicker_logger_is_averaged_about_the_time_of_the_slower_one(loggers):
    (loggers / "m.toml").write_text('[runs.logger_1]\nbeside = ["gauge_1"]\n', encoding="utf-8")
    reading = read([loggers / "logger_1.csv", loggers / "gauge_1.csv"], loggers / "m.toml")
    [run] = reading.runs
    assert [Path(file).name for file, _ in reading.files] == ["logger_1.csv", "gauge_1.csv"]
    assert [Path(one["file"]).name for one in run.as_dict()["beside"]] == ["gauge_1.csv"]
    z = reading.recording.values("logger_1", ("Z",))[:, 0]
    raw = pd.read_csv(loggers / "gauge_1.csv")["Z [um]"].to_numpy()
    late = 90.0 + FAST_S * np.arange(len(raw))
    # the run begins where both have begun
    assert (run.start, run.rows) == ("2026-03-02T06:02:00", ROWS - 2)
    for k in (2, 50, ROWS - 1):
        about = (late >= SLOW_S * (k - 0.5)) & (late < SLOW_S * (k + 0.5))
        assert z[k - 2] == pytest.approx(raw[about].mean(), rel=1e-12)


def test_codes_of_a_broken_sensor_are_in_no_mean(loggers):
    table = pd.read_csv(loggers / "gauge_1.csv")
    table["T9 [degC]"] = 21.0 + 0.01 * np.random.default_rng(3).standard_normal(len(table))
    table.loc[300:900:7, "T9 [degC]"] = 850.0
    table.to_csv(loggers / "gauge_1.csv", index=False)
    (loggers / "m.toml").write_text('[runs.logger_1]\nbeside = ["gauge_1"]\n', encoding="utf-8")
    reading = read([loggers / "logger_1.csv", loggers / "gauge_1.csv"], loggers / "m.toml")
    seen = reading.recording.values("logger_1", ("T9",))[:, 0]
    assert np.nanmax(seen) < 22.0
    assert np.isfinite(seen).all()


def test_without_dates_both_begin_together_but_for_what_is_said(loggers):
    for name, unit in (("logger_1", "T1 [degC]"), ("gauge_1", "Z [um]")):
        table = pd.read_csv(loggers / f"{name}.csv")
        step = SLOW_S if name == "logger_1" else FAST_S
        pd.DataFrame({"t [s]": step * np.arange(len(table)), unit: table[unit]}).to_csv(
            loggers / f"{name}.csv", index=False
        )
    values = {}
    for late_s in (None, 0.0, 90.0):
        late = "" if late_s is None else f"[runs.gauge_1]\nlate_s = {late_s}\n"
        said = f'[runs.logger_1]\nbeside = ["gauge_1"]\n{late}'
        (loggers / "m.toml").write_text(said, encoding="utf-8")
        reading = read([loggers / "logger_1.csv", loggers / "gauge_1.csv"], loggers / "m.toml")
        values[late_s] = reading.recording.values("logger_1", ("Z",))[:, 0]
        told = [one.level for one in reading.findings if one.id == "loggers-aligned"]
        assert told == (["warning"] if late_s is None else [])
    np.testing.assert_array_equal(values[None], values[0.0])
    assert np.isfinite(values[0.0]).all()
    # a minute and a half later is 22.5 readings later, and the run begins with its third sample
    assert values[90.0][18] == pytest.approx(0.5 * (values[0.0][18] + values[0.0][19]), abs=0.2)


def test_of_a_logger_as_quick_the_nearest_reading_is_taken_and_none_over_a_gap():
    time, values = np.array([4.0, 14.0, 24.0, 34.0, 205.0]), np.array([1.0, 3.0, np.nan, 7.0, 9.0])[:, None]
    expected = [1.0, 3.0, np.nan, 7.0, 7.0, np.nan, np.nan]
    np.testing.assert_array_equal(on_clock(np.arange(0.0, 70.0, 10.0), time, values)[:, 0], expected)


@pytest.mark.parametrize("late_s", [60.0, 140.0, 170.0, 180.0])
def test_a_run_does_not_begin_a_period_before_the_gauge_nor_end_one_after_it(late_s):
    clock, gauge_s = 60.0 * np.arange(12), late_s + 60.0 * np.arange(5)
    on = on_clock(clock, gauge_s, np.arange(5.0)[:, None])[:, 0]
    # no reading counts farther from its time than half a period, and none twice
    assert np.abs(gauge_s - clock[np.isfinite(on)]).max() <= 30.0
    np.testing.assert_array_equal(on[np.isfinite(on)], np.arange(5.0))


def test_the_slower_logger_has_the_clock_whichever_is_first(loggers):
    files = [loggers / "logger_1.csv", loggers / "gauge_1.csv"]
    seen = []
    for first, second in (("logger_1", "gauge_1"), ("gauge_1", "logger_1")):
        (loggers / "m.toml").write_text(f'[runs.{first}]\nbeside = ["{second}"]\n', encoding="utf-8")
        reading = read(files, loggers / "m.toml")
        assert [(run.name, run.start, run.period_s) for run in reading.runs] == [(first, "2026-03-02T06:02:00", SLOW_S)]
        seen.append(reading.recording.values(first, ("T1", "T2", "T3", "Z")))
    np.testing.assert_array_equal(*seen)


def test_channels_of_one_name_stay_apart(loggers):
    for name in ("logger_1", "logger_2"):
        table = pd.read_csv(loggers / f"{name}.csv")
        pd.DataFrame({"t [s]": SLOW_S * np.arange(len(table)), "T1 [degC]": table["T1 [degC]"]}).to_csv(
            loggers / f"{name}.csv", index=False
        )
    (loggers / "m.toml").write_text('[runs.logger_1]\nbeside = ["logger_2"]\n', encoding="utf-8")
    reading = read([loggers / "logger_1.csv", loggers / "logger_2.csv"], loggers / "m.toml")
    one, other = reading.recording.values("logger_1", reading.recording.names).T
    np.testing.assert_array_equal(one, pd.read_csv(loggers / "logger_1.csv")["T1 [degC]"])
    np.testing.assert_array_equal(other, pd.read_csv(loggers / "logger_2.csv")["T1 [degC]"])


def test_a_run_that_nothing_stands_beside_stays_as_it_is(loggers):
    """Rows without a reading at its start and end, too."""
    table = pd.read_csv(loggers / "logger_2.csv")
    table.iloc[[0, 1, -1], 1:] = np.nan
    table.to_csv(loggers / "logger_2.csv", index=False)
    (loggers / "m.toml").write_text('[runs.logger_1]\nbeside = ["gauge_1"]\n', encoding="utf-8")
    reading = read([loggers / f"{name}.csv" for name in ("logger_1", "gauge_1", "logger_2")], loggers / "m.toml")
    assert [(run.name, run.rows) for run in reading.runs] == [("logger_1", ROWS - 2), ("logger_2", ROWS)]


def test_repairs_of_what_stands_beside_a_run_are_made(loggers):
    files = [loggers / "logger_1.csv", loggers / "gauge_1.csv"]
    said = '[runs.logger_1]\nbeside = ["gauge_1"]\n[runs.gauge_1.channels.Z]\n'
    (loggers / "m.toml").write_text(said, encoding="utf-8")
    plain = read(files, loggers / "m.toml").recording.values("logger_1", ("Z",))[:, 0]
    (loggers / "m.toml").write_text(said + 'unit = "mm"\nleave_out = [[510, 1110]]\n', encoding="utf-8")
    mended = read(files, loggers / "m.toml").recording.values("logger_1", ("Z",))[:, 0]
    # the gauge began 90 s later
    clock = SLOW_S * np.arange(2, ROWS)
    gone = (clock >= 600) & (clock <= 1200)
    assert np.isnan(mended[gone]).all()
    np.testing.assert_allclose(mended[~gone], 1000.0 * plain[~gone])


def test_two_headings_of_the_time_are_no_columns_of_a_machine_file(loggers, capsys):
    for k in range(1, 6):
        table = pd.read_csv(loggers / f"gauge_{k}.csv").rename(columns={"time": "Zeit"})
        table.to_csv(loggers / f"gauge_{k}.csv", index=False)
    files = [str(loggers / f"{kind}_{k}.csv") for kind in ("logger", "gauge") for k in range(1, 6)]
    assert exit_status(["describe", *files, "--write", str(loggers / "m.toml"), "--json"]) == 0
    assert exit_status(["describe", *files, "--machine", str(loggers / "m.toml"), "--json"]) == 0
    capsys.readouterr()


@pytest.mark.parametrize(
    ("said", "found"),
    [
        ('[runs.logger_1]\nbeside = ["guage_1"]\n', "gauge_1"),
        ('[runs.logger_1]\nbeside = ["logger_1"]\n', "beside itself"),
        ('[runs.logger_1]\nbeside = ["gauge_1"]\n[runs.logger_2]\nbeside = ["gauge_1"]\n', "part of 'logger_1'"),
        ('[runs.logger_1]\nbeside = ["gauge_2"]\n', "begins 86490 s after"),
        ('[runs.logger_1]\nbeside = ["gauge_1"]\nlate_s = 3\n', "stands beside no other run"),
    ],
)
def test_what_cannot_be_one_run_is_refused(loggers, said, found):
    (loggers / "m.toml").write_text(said, encoding="utf-8")
    files = [loggers / f"{kind}_{k}.csv" for kind in ("logger", "gauge") for k in (1, 2)]
    with pytest.raises(RecordingError, match=r"beside|runs") as caught:
        read(files, loggers / "m.toml")
    assert found in str(caught.value)


def test_large_recordings_are_not_joined_in_pieces(loggers):
    for name in ("logger_1", "gauge_1"):
        pd.read_csv(loggers / f"{name}.csv", parse_dates=["time"]).to_parquet(loggers / f"{name}.parquet")
    (loggers / "m.toml").write_text('[runs.logger_1]\nbeside = ["gauge_1"]\n', encoding="utf-8")
    with pytest.raises(RecordingError, match="read in pieces"):
        stream_parquet([loggers / "logger_1.parquet", loggers / "gauge_1.parquet"], loggers / "m.toml")


def rewritten(loggers, name, time):
    table = pd.read_csv(loggers / f"{name}.csv")
    table["time"] = time(pd.to_datetime(table["time"]))
    table.to_csv(loggers / f"{name}.csv", index=False)


def test_the_clocks_of_the_files_count_where_there_are_no_dates(loggers):
    (loggers / "m.toml").write_text('[runs.logger_1]\nbeside = ["gauge_1"]\n', encoding="utf-8")
    files = [loggers / "logger_1.csv", loggers / "gauge_1.csv"]
    by_dates = read(files, loggers / "m.toml").recording.values("logger_1", ("Z",))
    before_midnight = pd.Timedelta(hours=17, minutes=59)
    for name in ("logger_1", "gauge_1"):
        rewritten(loggers, name, lambda time: (time + before_midnight).dt.strftime("%H:%M:%S"))
    by_clock = read(files, loggers / "m.toml")
    np.testing.assert_array_equal(by_clock.recording.values("logger_1", ("Z",)), by_dates)
    assert {one.level for one in by_clock.findings if one.id == "loggers-aligned"} == {"warning"}


def test_a_time_zone_in_one_file_alone_is_asked_for(loggers):
    rewritten(loggers, "gauge_1", lambda time: time.dt.strftime("%Y-%m-%dT%H:%M:%SZ"))
    said = '[runs.logger_1]\nbeside = ["gauge_1"]\n'
    files = [loggers / "logger_1.csv", loggers / "gauge_1.csv"]
    (loggers / "m.toml").write_text(said, encoding="utf-8")
    with pytest.raises(RecordingError, match="without a time zone and of 'gauge_1' with the time zone UTC"):
        read(files, loggers / "m.toml")
    (loggers / "m.toml").write_text(said + "[runs.gauge_1]\nlate_s = 90\n", encoding="utf-8")
    assert np.isfinite(read(files, loggers / "m.toml").recording.values("logger_1", ("Z",))).all()


def test_no_mean_reaches_into_a_gap_of_the_slower_logger():
    clock, time = np.r_[np.arange(0.0, 300.0, 60.0), np.arange(3000.0, 3300.0, 60.0)], np.arange(0.0, 3300.0, 2.0)
    seen = on_clock(clock, time, time[:, None])[:, 0]
    # of times evenly about its own the mean is the time itself, but for the ends and half a step of the quicker one
    np.testing.assert_allclose(seen[1:-1], clock[1:-1], atol=1.0)


def test_a_logger_that_began_a_new_file_goes_on(loggers):
    table = pd.read_csv(loggers / "gauge_1.csv")
    table.iloc[:900].to_csv(loggers / "first.csv", index=False)
    table.iloc[900:].to_csv(loggers / "second.csv", index=False)
    values = []
    for parts in (["gauge_1"], ["first", "second"], ["second", "first"]):
        (loggers / "m.toml").write_text(f"[runs.logger_1]\nbeside = {json.dumps(parts)}\n", encoding="utf-8")
        reading = read([loggers / f"{name}.csv" for name in ("logger_1", *parts)], loggers / "m.toml")
        assert reading.recording.names == ("T1", "T2", "T3", "Z")
        values.append(reading.recording.values("logger_1", ("Z",))[:, 0])
    np.testing.assert_allclose(values[1], values[0], rtol=1e-12)
    np.testing.assert_allclose(values[2], values[0], rtol=1e-12)
    # two gauges of one time stay two channels
    (loggers / "m.toml").write_text('[runs.logger_1]\nbeside = ["first", "gauge_1"]\n', encoding="utf-8")
    both = read([loggers / f"{name}.csv" for name in ("logger_1", "first", "gauge_1")], loggers / "m.toml")
    assert len(both.recording.names) == 5


@pytest.mark.parametrize("hours", [0.0, 0.5, 1.0, -2.0])
def test_clocks_in_two_time_zones_are_told(tmp_path, hours):
    seconds = 60.0 * np.arange(720)
    heat = np.repeat(np.random.default_rng(4).choice([0.0, 1.0, 2.0], 36), 20)
    warm = np.zeros((720, 2))
    for k in range(1, 720):
        warm[k] = warm[k - 1] + (heat[k] * 8.0 - warm[k - 1]) / np.array([12.0, 50.0])
    noise = np.random.default_rng(5).standard_normal((720, 3))
    begin = pd.Timestamp("2026-03-02 06:00:00")
    stamps = begin + pd.to_timedelta(seconds, unit="s")
    front, rear = (20.0 + warm + 0.02 * noise[:, :2]).T
    pd.DataFrame({"time": stamps, "T1 [degC]": front, "T2 [degC]": rear}).to_csv(tmp_path / "a.csv", index=False)
    # a column between the two sensors in its speed: what lags is no shift
    z = 4.0 * warm[:, 0] - 1.5 * warm[:, 1] + 0.1 * noise[:, 2]
    moved = pd.DataFrame({"time": stamps + pd.Timedelta(hours=hours), "Z [um]": z})
    moved.to_csv(tmp_path / "b.csv", index=False)
    (tmp_path / "m.toml").write_text('[runs.a]\nbeside = ["b"]\n', encoding="utf-8")
    told = read([tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "m.toml").findings
    shifts = [one.evidence for one in told if one.id == "loggers-shifted"]
    assert [(one["shift_s"], one["late_s"]) for one in shifts] == ([(-3600.0 * hours, 0.0)] if hours else [])
    said = '[runs.a]\nbeside = ["b"]\n[runs.b]\nlate_s = 0\n'
    (tmp_path / "m.toml").write_text(said, encoding="utf-8")
    again = read([tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "m.toml")
    assert "loggers-shifted" not in {one.id for one in again.findings}


def test_what_only_lags_behind_is_no_other_time_zone(tmp_path):
    seconds = 60.0 * np.arange(720)
    heat = np.repeat(np.random.default_rng(4).choice([0.0, 1.0, 2.0], 24), 30)
    warm = np.zeros((720, 2))
    for k in range(1, 720):
        warm[k] = warm[k - 1] + (np.array([heat[k] * 8.0, warm[k - 1, 0]]) - warm[k - 1]) / np.array([12.0, 45.0])
    pd.DataFrame({"t [s]": seconds, "T1 [degC]": 20.0 + warm[:, 0]}).to_csv(tmp_path / "a.csv", index=False)
    pd.DataFrame({"t [s]": seconds, "Z [um]": 4.0 * warm[:, 1]}).to_csv(tmp_path / "b.csv", index=False)
    (tmp_path / "m.toml").write_text('[runs.a]\nbeside = ["b"]\n', encoding="utf-8")
    told = read([tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "m.toml").findings
    assert "loggers-shifted" not in {one.id for one in told}


def test_a_gauge_file_that_is_missing_leaves_the_other_pairs(loggers):
    names = [f"{kind}_{k}" for kind in ("logger", "gauge") for k in range(1, 6)]
    reading = read([loggers / f"{name}.csv" for name in names if name != "gauge_4"])
    [told] = [one for one in reading.findings if one.id == "two-loggers"]
    assert told.evidence["beside"] == {f"logger_{k}": f"gauge_{k}" for k in (1, 2, 3, 5)}
    assert "logger_4" in told.statement


@pytest.mark.parametrize(("late_days", "is_told"), [(0, True), (1, False)])
def test_one_run_in_two_files_is_seen_beside_runs_that_are_whole(loggers, late_days, is_told):
    for k in (1, 2):
        warm, gauge = (pd.read_csv(loggers / f"{kind}_{k}.csv", parse_dates=["time"]) for kind in ("logger", "gauge"))
        pd.merge_asof(warm, gauge, on="time").to_csv(loggers / f"whole_{k}.csv", index=False)
    late = pd.read_csv(loggers / "gauge_3.csv", parse_dates=["time"])
    late["time"] += pd.Timedelta(days=late_days)
    late.to_csv(loggers / "gauge_3.csv", index=False)
    reading = read([loggers / f"{name}.csv" for name in ("whole_1", "whole_2", "logger_3", "gauge_3")])
    told = [one.evidence["beside"] for one in reading.findings if one.id == "two-loggers"]
    assert told == [{"logger_3": "gauge_3"}] * is_told


def test_without_dates_nothing_says_that_two_files_beside_whole_runs_are_one(tmp_path):
    seconds = SLOW_S * np.arange(ROWS)
    whole = pd.DataFrame({"t [s]": seconds, "T1 [degC]": 20.0 + course(seconds, 1), "Z [um]": course(seconds, 2)})
    for name, left in (("a", []), ("b", ["Z [um]"]), ("c", ["T1 [degC]"])):
        whole.drop(columns=left).to_csv(tmp_path / f"{name}.csv", index=False)
    assert "two-loggers" not in {one.id for one in read([tmp_path]).findings}


@pytest.mark.parametrize(
    ("files", "said", "found"),
    [
        (
            ("logger_1", "gauge_1"),
            'logger_1]\nbeside = ["gauge_1"]\n[runs.gauge_1]\nbeside = ["logger_1"]',
            "beside it itself",
        ),
        (("logger_1",), 'logger_1]\nbeside = ["gauge_1"]', "the file of that run"),
    ],
)
def test_what_is_wrong_with_beside_is_told(loggers, files, said, found):
    (loggers / "m.toml").write_text(f"[runs.{said}\n", encoding="utf-8")
    with pytest.raises(RecordingError) as caught:
        read([loggers / f"{name}.csv" for name in files], loggers / "m.toml")
    assert found in str(caught.value)
