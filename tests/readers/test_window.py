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
    assert (run.rows, run.period_s) == (1440, 60.0)
    t1, t2 = reading.recording.values(run.name, ["T1", "T2"]).T
    # six samples from 0 to 50 s
    assert t1[0] == pytest.approx(20.0 + 25.0 / HOUR)
    # equal values stay bit for bit; samples 100 to 105 lack: of the 17th mean two are there
    assert set(t2[np.isfinite(t2)].tolist()) == {21.0}
    assert np.isfinite(t2).all()
    (told,) = [one for one in reading.findings if one.id == "means-taken"]
    assert told.evidence == {"mean_s": 60.0, "rows": 8640, "means": 1440}
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
    with pytest.raises(OptionError, match="whose clock has no date"):
        read([tmp_path / "r.csv"], overrides=Overrides(since="2026-03-30"))
    assert len(read([tmp_path / "r.csv"], overrides=Overrides(mean_s=2.0)).recording.time_s("r")) == 2


def test_means_longer_than_the_runs_are_refused(lake):
    with pytest.raises(ReadError, match="no longer than 1e\\+09 s") as caught:
        read([lake], overrides=Overrides(mean_s=1e9))
    assert caught.value.where == "--mean-s"


def test_the_options_reach_the_command_and_the_study(lake, tmp_path, capsys):
    asked = ["--since", "2026-03-30", "--until", "2026-04-01", "--mean-s", "300"]
    assert exit_status(["convert", str(lake), *asked, "--out", str(tmp_path / "clean")]) == 0
    assert len(pd.read_csv(tmp_path / "clean" / "2026-03-30.csv")) == 288
    assert exit_status(["describe", str(lake), "--mean-s", "0"]) == 2
    assert "a positive number of seconds" in capsys.readouterr().err
