"""Of long records only the window is kept, and means in place of samples."""

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.errors import OptionError, ReadError
from selector.readers import Overrides, read

HOUR = 3600


@pytest.fixture
def lake(tmp_path):
    """Three days of a machine, two thermometers and a displacement every ten seconds, a file a day."""
    for day in ("2026-03-30", "2026-03-31", "2026-04-01"):
        folder = tmp_path / "machine=m" / f"month={day[:7]}"
        folder.mkdir(parents=True, exist_ok=True)
        time = pd.date_range(day, periods=8640, freq="10s")
        seconds = np.arange(8640) * 10.0
        frame = pd.DataFrame({"time": time, "T1": 20.0 + seconds / HOUR, "T2": 21.0, "Z": np.sin(seconds)})
        frame.loc[100:105, "T2"] = np.nan
        frame.to_parquet(folder / f"{day}.parquet", index=False)
    return tmp_path


def test_a_window_keeps_its_days_and_hours(lake):
    reading = read([lake], overrides=Overrides(since="2026-03-30T22:00", until="2026-04-01"))
    assert [run.name for run in reading.runs] == ["2026-03-30", "2026-03-31"]
    first, whole = reading.runs
    assert (first.start, first.rows, first.duration_s) == ("2026-03-30T22:00:00", 720, 7190.0)
    assert (whole.start, whole.rows) == ("2026-03-31T00:00:00", 8640)
    t1 = reading.recording.values(first.name, ["T1"])[:, 0]
    assert t1[0] == pytest.approx(42.0)
    assert reading.recording.time_s(first.name)[0] == 0.0


def test_files_of_other_days_are_not_opened(lake):
    (lake / "machine=m" / "month=2026-04" / "2026-04-02.parquet").write_bytes(b"PAR1 broken")
    with pytest.raises(ReadError):
        read([lake])
    assert len(read([lake], overrides=Overrides(until="2026-04-02")).runs) == 3


def test_means_are_of_what_is_there(lake):
    reading = read([lake], overrides=Overrides(since="2026-03-31", until="2026-04-01", mean_s=60.0))
    (run,) = reading.runs
    # the first sample, then means of which each stands in the middle of its samples
    assert (run.rows, run.period_s) == (1441, 60.0)
    time_s = reading.recording.time_s(run.name)
    assert time_s[:3].tolist() == [0.0, 30.0, 85.0]
    t1, t2 = reading.recording.values(run.name, ["T1", "T2"]).T
    np.testing.assert_allclose(t1, 20.0 + time_s / HOUR)
    # equal values stay bit for bit; samples 100 to 105 lack: of the 17th mean two are there
    assert set(t2[np.isfinite(t2)].tolist()) == {21.0}
    assert np.isfinite(t2).all()
    (told,) = [one for one in reading.findings if one.id == "means-taken"]
    assert told.evidence == {"mean_s": 60.0, "rows": 8640, "means": 1441}
    as_sampled = read([lake], overrides=Overrides(since="2026-03-31", until="2026-04-01", mean_s=10.0))
    plain = read([lake], overrides=Overrides(since="2026-03-31", until="2026-04-01"))
    names = ["T1", "T2", "Z"]
    np.testing.assert_array_equal(as_sampled.recording.values(run.name, names), plain.recording.values(run.name, names))


def test_places_of_findings_move_with_the_window(tmp_path):
    rows = [f"2026-03-30 0{k // 60}:{k % 60:02},{20 + k / 10},{'OPEN' if 50 <= k < 60 else k / 5}" for k in range(120)]
    (tmp_path / "r.csv").write_text("time,T1 [degC],T2 [degC]\n" + "\n".join(rows), encoding="utf-8")
    breaks = {}
    for since in (None, "2026-03-30T00:40", "2026-03-30T01:10"):
        findings = read([tmp_path / "r.csv"], overrides=Overrides(since=since)).findings
        breaks[since] = [(one.where.from_s, one.where.to_s) for one in findings if one.id == "sensor-break"]
    assert breaks == {None: [(3000.0, 3540.0)], "2026-03-30T00:40": [(600.0, 1140.0)], "2026-03-30T01:10": []}


@pytest.mark.parametrize(
    ("options", "found"),
    [
        ({"since": "2026-05-01"}, "files of other days"),
        ({"since": "2026-04-01T23:59:55", "until": "2026-04-02"}, "fewer than two samples, or means"),
        ({"since": "yesterday"}, "'yesterday'"),
        ({"since": "2026-03-30T00:00Z"}, "'2026-03-30T00:00Z'"),
        ({"since": "2026-04-01", "until": "2026-03-30"}, "a window from 2026-04-01 to 2026-03-30"),
    ],
)
def test_windows_that_cannot_be(lake, options, found):
    with pytest.raises((OptionError, ReadError), match=found) as caught:
        read([lake], overrides=Overrides(**options))
    assert caught.value.where.startswith("--since")


def test_a_clock_without_a_date_has_no_window(tmp_path):
    (tmp_path / "r.csv").write_text("t [s],T1 [degC],Z [um]\n0,20,0\n1,21,1\n2,22,2\n", encoding="utf-8")
    with pytest.raises(OptionError, match="no date") as caught:
        read([tmp_path / "r.csv"], overrides=Overrides(since="2026-03-30"))
    assert caught.value.where.startswith("--since")
    assert len(read([tmp_path / "r.csv"], overrides=Overrides(mean_s=2.0)).recording.time_s("r")) == 3


def test_means_longer_than_the_runs_are_refused(lake):
    with pytest.raises(ReadError, match="no longer than 1e\\+09 s") as caught:
        read([lake], overrides=Overrides(mean_s=1e9))
    assert caught.value.where == "--mean-s"


def test_the_options_reach_the_command_and_the_study(lake, tmp_path, capsys):
    asked = ["--since", "2026-03-30", "--until", "2026-04-01", "--mean-s", "300"]
    assert exit_status(["convert", str(lake), *asked, "--out", str(tmp_path / "clean")]) == 0
    assert len(pd.read_csv(tmp_path / "clean" / "2026-03-30.csv")) == 289
    assert exit_status(["describe", str(lake), "--mean-s", "0"]) == 2
    assert "--mean-s" in capsys.readouterr().err


def table(path, stamps, columns):
    frame = pd.DataFrame({"time": [str(stamp) for stamp in stamps], **{name: list(of) for name, of in columns.items()}})
    frame.to_csv(path, index=False, float_format="%.6g")
    return path


def test_a_model_of_means_is_that_of_the_samples(tmp_path):
    """Z is twice the rise of T1, zeroed at the start: of means, too, whatever their length."""
    minutes = np.arange(0.0, 241.0)
    rise = 15.0 * (1.0 - np.exp(-minutes / 40.0))
    stamps = pd.date_range("2026-03-30 06:00", periods=len(minutes), freq="1min")
    file = table(tmp_path / "r.csv", stamps, {"T1 [degC]": 20.0 + rise, "Z [um]": 2.0 * rise})
    for mean_s in (60.0, 300.0, 900.0):
        recording = read([file], overrides=Overrides(mean_s=mean_s)).recording
        t1, z = recording.values("r", ["T1", "Z"]).T
        np.testing.assert_allclose(z, 2.0 * (t1 - t1[0]), atol=1e-3)  # six digits in the file
        # the middle of a curved stretch is off by its bend, a²/24·T1'' with 15 K and τ = 40 min
        at = np.interp(recording.time_s("r"), 60.0 * minutes, rise)
        np.testing.assert_allclose(t1 - 20.0, at, atol=(mean_s / 2400.0) ** 2 / 24.0 * 15.0 + 1e-3)


def test_codes_of_broken_sensors_are_in_no_mean(tmp_path):
    values = 20.0 + 0.01 * np.arange(600.0)
    broken = values.copy()
    broken[[100, 101, 350]] = -9999.0
    stamps = pd.date_range("2026-03-30 06:00", periods=600, freq="10s")
    file = table(tmp_path / "r.csv", stamps, {"T1 [degC]": broken, "T2 [degC]": values})
    reading = read([file], overrides=Overrides(mean_s=60.0))
    t1, t2 = reading.recording.values("r", ["T1", "T2"]).T
    # two of six samples that are 0.01 K apart lack in a mean, at most
    assert np.abs(t1 - t2).max() < 0.03
    (told, *_) = [one for one in reading.findings if one.id == "sensor-break"]
    assert told.where.channel == "T1"


@pytest.mark.parametrize("options", [{}, {"mean_s": 600.0}, {"since": "2026-03-30T06:10"}])
def test_what_a_repair_leaves_out_counts_from_the_whole_run(tmp_path, options):
    stamps = pd.date_range("2026-03-30 06:00", periods=121, freq="1min")
    values = 20.0 + 0.01 * np.arange(121.0)
    values[20:41] = 60.0
    file = table(tmp_path / "r.csv", stamps, {"T1 [degC]": values, "T2 [degC]": 20.0 + 0.01 * np.arange(121.0)})
    (tmp_path / "m.toml").write_text("[runs.r.channels.T1]\nleave_out = [[1200, 2400]]\n", encoding="utf-8")
    recording = read([file], machine=tmp_path / "m.toml", overrides=Overrides(**options)).recording
    t1, t2 = recording.values("r", ["T1", "T2"]).T
    known = np.isfinite(t1)
    assert 0 < (~known).sum() <= 21
    np.testing.assert_allclose(t1[known], t2[known], atol=0.11)  # of a mean a part may be left out


def test_the_window_goes_by_the_clock_of_the_file_when_summer_time_begins(tmp_path):
    stamps = [
        *pd.date_range("2026-03-29 00:00", "2026-03-29 01:59", freq="1min"),
        *pd.date_range("2026-03-29 03:00", "2026-03-29 06:00", freq="1min"),
    ]
    hours = [stamp.hour for stamp in stamps]
    file = table(tmp_path / "r.csv", stamps, {"T1 [degC]": hours, "T2 [degC]": np.linspace(20.0, 21.0, len(hours))})
    window = Overrides(since="2026-03-29T04:00", until="2026-03-29T05:00")
    reading = read([file], overrides=window)
    (run,) = reading.runs
    assert (run.start, run.rows) == ("2026-03-29T04:00:00", 60)
    assert set(reading.recording.values("r", ["T1"])[:, 0]) == {4.0}
    (told,) = [one for one in reading.findings if one.id == "window-begins-in-run"]
    assert told.evidence == {"skipped_s": 3 * HOUR}


def test_runs_without_samples_in_the_window_are_told(lake, tmp_path):
    stamps = pd.date_range("2026-03-31 06:00", periods=5, freq="10s")
    short = table(tmp_path / "short.csv", stamps, {"T1": [20.0] * 5, "T2": [21.0] * 5, "Z": [0.0, 1, 2, 3, 4]})
    reading = read([lake, short], overrides=Overrides(mean_s=120.0))
    (told,) = [one for one in reading.findings if one.id == "run-outside-window"]
    assert told.evidence == {"runs": ["short"]}


def test_the_last_day_of_all_is_a_day(lake):
    (lake / "machine=m" / "month=9999-12").mkdir()
    last = lake / "machine=m" / "month=9999-12" / "9999-12-31.parquet"
    last.write_bytes((lake / "machine=m" / "month=2026-03" / "2026-03-30.parquet").read_bytes())
    assert len(read([lake], overrides=Overrides(since="2026-03-31", until="2026-04-01")).runs) == 1


def test_what_cannot_have_means_or_a_window_says_so(tmp_path, capsys):
    minutes = pd.date_range("2026-03-30", periods=60, freq="1min")
    record = table(tmp_path / "r.csv", minutes, {"T1 [degC]": range(60), "Z [um]": range(60)})
    (tmp_path / "sim").mkdir()
    table(tmp_path / "sim" / "r.csv", range(0, 3600, 60), {"T1 [degC]": range(60), "Z [um]": range(60)})
    simulated = ["--simulation", str(tmp_path / "sim"), "--simulation-time-unit", "s"]
    assert exit_status(["diagnose", str(record), *simulated, "--since", "2026-03-30T00:10"]) == 2
    assert "no date" in capsys.readouterr().err
    for command in (["diagnose", str(record), "--model", "m.toml"], ["predict", str(record), "--cycle", "c.csv"]):
        assert exit_status([*command, "--mean-s", "300"]) == 2
        assert "--mean-s" in capsys.readouterr().err
    touched = ["adapt", "model.json", str(record), "--touch-offs", "t.csv", "--since", "2026-03-30"]
    assert exit_status(touched) == 2
    assert "--since and --until" in capsys.readouterr().err
