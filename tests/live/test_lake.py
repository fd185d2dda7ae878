"""`selector convert --lake`: recordings that were made before, in the folders that `selector collect` keeps."""

from __future__ import annotations

import json
from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from selector.cli import exit_status
from selector.live.lake import Lake

MACHINE = """\
[machine]
name = "lathe-3"
[channels.T1]
role = "temperature"
unit = "degC"
place = "nose"
[channels.Z]
column = "Z [um]"
"""


def table(path, start, rows, *, header="time,T1,Z [um]", first=20.0):
    begin = datetime.fromisoformat(start)
    lines = [f"{begin + timedelta(minutes=k)},{first + 0.01 * k:.2f},{0.05 * k:.2f}" for k in range(rows)]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return str(path)


@pytest.fixture
def machine(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(MACHINE, encoding="utf-8")
    return str(path)


def put(lake, machine, *files):
    return exit_status(["convert", *files, "--machine", machine, "--out", str(lake), "--lake", "--json"])


def test_days_months_roles_and_units_are_those_of_collected_ones(tmp_path, machine, capsys):
    lake = tmp_path / "lake"
    assert put(lake, machine, table(tmp_path / "a.csv", "2026-03-31 22:00:00", 240)) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["rows"], said["new_rows"]) == (240, 240)
    folder = lake / "machine=lathe-3"
    days = [folder / "month=2026-03" / "2026-03-31.parquet", folder / "month=2026-04" / "2026-04-01.parquet"]
    assert said["files"] == [str(day) for day in days]
    read = [pq.ParquetFile(day).read() for day in days]
    assert [one.num_rows for one in read] == [120, 120]
    assert read[0].schema.field("T1").metadata == {b"unit": b"degC", b"role": b"temperature", b"place": b"nose"}
    window = ["--since", "2026-04-01", "--mean-s", "600", "--json"]
    assert exit_status(["describe", str(lake), *window]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert (run["rows"], run["start"][:19]) == (13, "2026-04-01T00:00:00")


def test_a_ctrl_c_between_days_tells_what_stays_and_the_same_command_goes_on(tmp_path, machine, capsys, monkeypatch):
    files = [table(tmp_path / f"r{day}.csv", f"2026-03-0{day} 06:00:00", 10) for day in (1, 2, 3)]
    whole, done = Lake.put, []

    def put_two(self, *given):
        done.append(given)
        if len(done) == 3:
            raise KeyboardInterrupt
        return whole(self, *given)

    with monkeypatch.context() as patched:
        patched.setattr(Lake, "put", put_two)
        assert put(tmp_path / "lake", machine, *files) == 130
    told = capsys.readouterr().err
    assert "Nothing was written" not in told
    assert f"The days that are in {tmp_path / 'lake'} by now stay" in told
    assert put(tmp_path / "lake", machine, *files) == 0
    said = json.loads(capsys.readouterr().out)
    assert (len(said["files"]), said["rows"], said["new_rows"]) == (3, 30, 10)


def test_late_and_double_files_fill_what_is_missing_and_nothing_twice(tmp_path, machine, capsys):
    lake = tmp_path / "lake"
    first = table(tmp_path / "a.csv", "2026-03-31 10:00:00", 60)
    assert put(lake, machine, first) == 0
    late = table(tmp_path / "late.csv", "2026-03-31 09:30:00", 60, first=50.0)
    capsys.readouterr()
    assert put(lake, machine, first, late) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["rows"], said["new_rows"], said["other_rows"]) == (120, 30, 30)
    kept = pq.ParquetFile(lake / "machine=lathe-3" / "month=2026-03" / "2026-03-31.parquet").read().to_pandas()
    assert kept["time"].is_monotonic_increasing
    # what was kept first stays
    np.testing.assert_allclose(kept["T1"], [*(50.0 + 0.01 * np.arange(30)), *(20.0 + 0.01 * np.arange(60))])


def test_another_unit_is_the_same_channel_and_a_new_channel_comes_beside_it(tmp_path, machine, capsys):
    lake = tmp_path / "lake"
    assert put(lake, machine, table(tmp_path / "a.csv", "2026-03-31 10:00:00", 60)) == 0
    other = table(tmp_path / "b.csv", "2026-04-01 10:00:00", 60, header="time,T1 [degF],T2 [degC]", first=68.0)
    assert exit_status(["convert", other, "--machine", machine_of(tmp_path), "--out", str(lake), "--lake"]) == 0
    kept = pq.ParquetFile(lake / "machine=lathe-3" / "month=2026-04" / "2026-04-01.parquet").read().to_pandas()
    assert kept["T1"][0] == pytest.approx(20.0)
    said = (lake / "machine=lathe-3" / "machine.toml").read_text(encoding="utf-8")
    assert "[channels.Z]" in said
    assert "[channels.T2]" in said
    assert 'place = "nose"' in said
    capsys.readouterr()


def test_a_month_in_another_unit_than_the_machine_file_says_is_refused_until_it_is_said_which(
    tmp_path, machine, capsys
):
    lake = tmp_path / "lake"
    assert put(lake, machine, table(tmp_path / "a.csv", "2026-03-31 10:00:00", 60)) == 0
    before = {path: path.read_bytes() for path in lake.rglob("*") if path.is_file()}
    other = table(tmp_path / "b.csv", "2026-04-01 10:00:00", 60, header="time,T1 [degF],Z [um]", first=68.0)
    capsys.readouterr()
    assert put(lake, machine, other) == 2
    told = capsys.readouterr().err
    assert all(word in told for word in ("T1 in degC", "in degF", "--unit T1=degF"))
    assert before == {path: path.read_bytes() for path in lake.rglob("*") if path.is_file()}
    day = lake / "machine=lathe-3" / "month=2026-04" / "2026-04-01.parquet"
    asked = ["convert", other, "--machine", machine, "--out", str(lake), "--lake", "--unit"]
    for unit, first in (("degF", 20.0), ("degC", 68.0)):
        assert exit_status([*asked, f"T1={unit}"]) == 0
        assert pq.ParquetFile(day).read().to_pandas()["T1"][0] == pytest.approx(first)
        day.unlink()


def machine_of(tmp_path):
    path = tmp_path / "later.toml"
    path.write_text('[machine]\nname = "lathe-3"\n', encoding="utf-8")
    return str(path)


def test_what_is_of_no_machine_or_no_date_is_refused(tmp_path, machine, capsys):
    lake = tmp_path / "lake"
    dated = table(tmp_path / "a.csv", "2026-03-31 10:00:00", 60)
    assert exit_status(["convert", dated, "--out", str(lake), "--lake"]) == 2
    assert "no machine" in capsys.readouterr().err
    plain = tmp_path / "plain.csv"
    plain.write_text("time [s],T1,Z [um]\n" + "\n".join(f"{k},20.{k},{k}" for k in range(9)), encoding="utf-8")
    assert put(lake, machine, str(plain)) == 2
    assert "plain without a date" in capsys.readouterr().err
    assert not lake.exists()


def test_a_channel_that_is_something_else_is_refused_and_nothing_changes(tmp_path, machine, capsys):
    lake = tmp_path / "lake"
    assert put(lake, machine, table(tmp_path / "a.csv", "2026-03-31 10:00:00", 60)) == 0
    before = {path: path.read_bytes() for path in lake.rglob("*") if path.is_file()}
    odd = tmp_path / "odd.toml"
    odd.write_text('[machine]\nname = "lathe-3"\n[channels.T1]\nrole = "displacement"\nunit = "um"\n', encoding="utf-8")
    assert put(lake, str(odd), table(tmp_path / "b.csv", "2026-04-01 10:00:00", 60, header="time,T1,Z [um]")) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in ("T1", "displacement", " um"))
    assert before == {path: path.read_bytes() for path in lake.rglob("*") if path.is_file()}


def test_an_unreadable_day_is_told_and_stays(tmp_path, machine, capsys):
    lake = tmp_path / "lake"
    first = table(tmp_path / "a.csv", "2026-03-31 10:00:00", 60)
    assert put(lake, machine, first) == 0
    day = lake / "machine=lathe-3" / "month=2026-03" / "2026-03-31.parquet"
    day.write_bytes(b"PAR1 broken")
    assert put(lake, machine, first) == 2
    assert "2026-03-31.parquet" in capsys.readouterr().err
    assert day.read_bytes() == b"PAR1 broken"


def stamped(path, stamps):
    lines = [f"{stamp},{20.0 + 0.01 * k:.2f},{0.05 * k:.2f}" for k, stamp in enumerate(stamps)]
    path.write_text("\n".join(["time,T1,Z [um]", *lines]) + "\n", encoding="utf-8")
    return str(path)


def test_summer_time_is_kept_by_the_clock_of_the_file_and_refused_where_it_ends(tmp_path, machine, capsys):
    lake = tmp_path / "lake"
    spring = [*pd.date_range("2026-03-29 00:00", "2026-03-29 01:59", freq="1min")]
    spring += [*pd.date_range("2026-03-29 03:00", "2026-03-29 04:00", freq="1min")]
    assert put(lake, machine, stamped(tmp_path / "spring.csv", spring)) == 0
    kept = pq.ParquetFile(lake / "machine=lathe-3" / "month=2026-03" / "2026-03-29.parquet").read().to_pandas()
    assert kept["time"].dt.tz_localize(None).tolist() == spring
    autumn = [*pd.date_range("2026-10-25 01:00", "2026-10-25 02:59", freq="1min")]
    autumn += [*pd.date_range("2026-10-25 02:00", "2026-10-25 03:30", freq="1min")]
    assert put(lake, machine, stamped(tmp_path / "autumn.csv", autumn)) == 2
    assert "jumps back" in capsys.readouterr().err


def test_what_is_being_collected_is_left_alone(tmp_path, machine, capsys):
    lake = tmp_path / "lake"
    assert put(lake, machine, table(tmp_path / "a.csv", "2026-03-31 10:00:00", 60)) == 0
    day = lake / "machine=lathe-3" / "month=2026-03" / "2026-03-31.parquet"
    segment = day.with_name("2026-03-31T100000.000000Z.parquet")
    day.rename(segment)
    before = segment.read_bytes()
    capsys.readouterr()
    assert put(lake, machine, table(tmp_path / "b.csv", "2026-03-31 10:30:00", 60)) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["new_rows"] == 30
    assert segment.read_bytes() == before
    times = [pq.ParquetFile(path).read().to_pandas()["time"] for path in (segment, day)]
    assert pd.concat(times).is_unique
    # all of it is there: nothing to write
    assert put(lake, machine, table(tmp_path / "a.csv", "2026-03-31 10:00:00", 60)) == 0
    assert len(pq.ParquetFile(day).read()) == 30
