from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from selector.errors import ReadError, RecordingError
from selector.readers import is_large, read, stream_parquet
from selector.readers import stream as streaming
from selector.readers.machine_file import machine_from_text
from selector.readers.tables import Overrides
from selector.recording import PARTS, at_pauses, parted
from selector.study.data import study_data

ROOT = Path(__file__).resolve().parents[2]
MACHINE = machine_from_text(
    "[time]\ncolumn='t'\nunit='min'\n[channels.T1]\nrole='temperature'\nunit='degF'\n"
    "[channels.Z]\nrole='displacement'\nunit='mm'\naxis='Z'\n[channels.extra]\nrole='state'\n",
    "machine.toml",
)


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    rng = np.random.default_rng(0)
    paths = []
    for k, rows in enumerate((1000, 700), start=1):
        frame = pd.DataFrame(
            {"t": 5 + np.arange(rows) / 10, "T1": rng.normal(70, 3, rows), "Z": rng.normal(0, 0.01, rows)}
        )
        frame.loc[3, "T1"] = np.nan
        if k == 1:
            frame["extra"] = 1.0
        paths.append(tmp_path / f"r{k}.parquet")
        frame.to_parquet(paths[-1], row_group_size=300)
    return paths


def test_pieces_are_the_recording(files, monkeypatch):
    monkeypatch.setattr(streaming, "CHUNK_ROWS", 128)
    whole = read(files, MACHINE).recording
    source = stream_parquet(files, MACHINE)
    assert (source.runs, source.names, source.channels) == (whole.runs, whole.names, whole.channels)
    assert source.provenance["runs"]["r1"]["sha256"] == whole.provenance["runs"]["r1"]["sha256"]
    for run in whole.runs:
        for names in (["T1"], ["Z", "T1"], ["extra", "Z"], ["extra"], []):
            pieces = list(source.chunks(run, names))
            assert len(pieces) > 4
            assert max(len(time_s) for time_s, _ in pieces) <= 128
            assert np.array_equal(np.concatenate([t for t, _ in pieces]), whole.time_s(run))
            values = np.concatenate([v for _, v in pieces])
            assert np.array_equal(values, whole.values(run, names), equal_nan=True)


def test_pieces_are_cut_at_pauses_as_the_whole_recording_is(tmp_path, monkeypatch):
    monkeypatch.setattr(streaming, "CHUNK_ROWS", 64)
    rng = np.random.default_rng(3)
    at_s = np.concatenate([day * 86400.0 + 10.0 * np.arange(300) for day in range(4)])
    pd.DataFrame({"time_s": at_s, "T1": rng.normal(20, 1, 1200)}).to_parquet(tmp_path / "week.parquet")
    pd.DataFrame({"time_s": at_s[:300], "T1": rng.normal(20, 1, 300)}).to_parquet(tmp_path / "day.parquet")
    files = [tmp_path / "week.parquet", tmp_path / "day.parquet"]
    whole = at_pauses(read(files).recording)
    source = stream_parquet(files)
    opened = []
    monkeypatch.setattr(
        streaming.ParquetSource,
        "chunks",
        lambda self, run, names, own=streaming.ParquetSource.chunks: opened.append(run) or own(self, run, names),
    )
    cut = parted(source)
    assert cut.runs == whole.runs == ("week 1", "week 2", "week 3", "week 4", "day")
    assert cut.provenance[PARTS] == whole.provenance[PARTS]
    opened.clear()
    for run in (*cut.runs, "week 3", "week 2"):
        pieces = list(cut.chunks(run, ["T1"]))
        assert len(pieces) > 4
        assert np.array_equal(np.concatenate([t for t, _ in pieces]), whole.time_s(run))
        assert np.array_equal(np.concatenate([v for _, v in pieces]), whole.values(run, ["T1"]))
    assert opened == ["week", "day", "week", "week"]  # in their order parts cost one pass over the file


def test_timestamps_and_no_clock(tmp_path):
    frame = pd.DataFrame({"time": pd.date_range("2026-01-01", periods=50, freq="250ms"), "T1": np.arange(50.0)})
    frame.to_parquet(tmp_path / "a.parquet")
    frame[["T1"]].assign(T1=np.sin(np.arange(50.0))).to_parquet(tmp_path / "b.parquet")
    for name, step in (("a", 0.25), ("b", 1.0)):
        source = stream_parquet([tmp_path / f"{name}.parquet"])
        time_s = np.concatenate([t for t, _ in source.chunks(name, ["T1"])])
        assert np.array_equal(time_s, step * np.arange(50))


def test_rows_that_cannot_be_used_are_told_or_refused(tmp_path, files):
    time = np.array([0, 1, 1, np.nan, 2, 3.0])
    pd.DataFrame({"t": time, "T1": np.arange(6.0), "Z": 0.0, "extra": 0.0}).to_parquet(tmp_path / "r1.parquet")
    source = stream_parquet([tmp_path / "r1.parquet"], MACHINE)
    ((time_s, values),) = source.chunks("r1", ["T1"])
    assert time_s.tolist() == [0, 60, 120, 180]
    assert len(values) == 4
    assert {f.id for f in source.findings} >= {"missing-stamps", "repeated-stamps"}
    rows = 6000
    pd.DataFrame({"t": np.r_[np.arange(rows), np.arange(9)] * 1.0, "T1": 1.0, "Z": 0.0, "extra": 0.0}).to_parquet(
        tmp_path / "r2.parquet"
    )
    source = stream_parquet([tmp_path / "r2.parquet"], MACHINE)
    with pytest.raises(RecordingError, match="row 6001"):
        list(source.chunks("r2", ["T1"]))
    pd.DataFrame({"t": ["10:00:00", "10:00:01", "10:00:02"], "T1": 1.0}).to_parquet(tmp_path / "r3.parquet")
    with pytest.raises(ReadError, match=r"r3\.parquet: .*\bt\b"):
        stream_parquet([tmp_path / "r3.parquet"])
    (tmp_path / "r4.csv").write_text("t,T1\n0,1\n1,2\n", encoding="utf-8")
    with pytest.raises(ReadError, match="not Parquet"):
        stream_parquet([tmp_path / "r4.csv"])
    with pytest.raises(RecordingError, match="no channel 'T9'"):
        list(source.chunks("r2", ["T9"]))


def test_only_large_parquet_is_large(files, tmp_path, monkeypatch):
    assert not is_large(files)
    monkeypatch.setattr(streaming, "LARGE_BYTES", 1000)
    assert is_large(files)
    (tmp_path / "r4.csv").write_text("t,T1\n0,1\n1,2\n", encoding="utf-8")
    assert not is_large([*files, tmp_path / "r4.csv"])
    assert not is_large([tmp_path / "missing.parquet"])


MEASURE = """
import re, sys
from pathlib import Path
from selector.readers import is_large, stream_parquet
path = Path(sys.argv[1])
assert is_large([path])
source = stream_parquet([path])
rows = sum(len(time_s) for time_s, _ in source.chunks("big", source.names))
# getrusage would count what the test runner held before this program took its place
peak = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())
print(rows, len(source.names), peak.group(1))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory in kB is Linux's")
def test_memory_is_bounded(tmp_path):
    # 37 sensors x 2.2 million samples are 0.65 GB of float64; few distinct values keep the file small and quick to make
    rows, sensors = 2_200_000, 37
    path = tmp_path / "big.parquet"
    values = np.resize(np.round(20 + np.arange(64) / 7, 2), rows)
    columns = {"t_s": np.arange(rows) * 0.1} | {f"T{k}": values for k in range(sensors)}
    pq.write_table(pa.table(columns), path, row_group_size=rows)  # one row group: the hardest case
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, str(path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    n_rows, n_names, peak_kb = map(int, done.stdout.split())
    assert (n_rows, n_names) == (rows, sensors)
    # 450 MB measured with imports, with 10 million rows as well; table and imports together would be 850 MB
    assert peak_kb < 620_000


def test_what_the_user_says_holds_for_pieces_too(files, monkeypatch):
    said = Overrides(units={"T1": "degC"}, roles={"Z": "position"}, time_unit="s")
    whole = study_data(files, None, said)
    monkeypatch.setattr(streaming, "LARGE_BYTES", 1000)
    pieces = study_data(files, None, said)
    assert [f.id for f in pieces.findings if f.id == "read-in-pieces"] == ["read-in-pieces"]
    assert pieces.source.channels == whole.source.channels
    assert {c.name: c.role for c in pieces.source.channels}["Z"] == "position"
    time_s, values = (np.concatenate(part) for part in zip(*pieces.source.chunks("r1", ["T1"]), strict=True))
    expected = np.concatenate([part for _, part in whole.source.chunks("r1", ["T1"])])
    known = np.isfinite(values)  # lost readings stay lost in pieces
    assert np.array_equal(values[known], expected[known])
    assert time_s[1] == pytest.approx(0.1)  # seconds, as was said, not minutes
