from __future__ import annotations

import datetime
import gc
import io
import logging
import warnings
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
import scipy.io
from pydantic import TypeAdapter

from selector.controllers.closed_values import Name
from selector.errors import ReadError
from selector.readers import Overrides, read
from selector.readers.binary.optional import quiet
from selector.readers.roles.names import name_and_unit
from selector.readers.tables import unique_headers

N = 8
TIME = np.arange(N, dtype=np.float64) * 10
T1 = 20 + np.arange(N) / 8
Z = np.arange(N) * 1.5 - 2


def check(reading, run="r1", unit="s"):
    assert reading.recording.runs == (run,)
    assert reading.recording.time_s(run).tolist() == TIME.tolist()
    assert reading.recording.values(run, ["T1"])[:, 0].tolist() == T1.tolist()
    assert reading.recording.values(run, ["Z"])[:, 0].tolist() == Z.tolist()


def workbook(sheets: dict[str, list[list[object]]]) -> bytes:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


ROWS = [[t, a, b] for t, a, b in zip(TIME.tolist(), T1.tolist(), Z.tolist(), strict=True)]
HEAD = ["t [s]", "T1 [°C]", "Z [µm]"]
START = datetime.datetime(2026, 1, 2, 10)


class TestExcel:
    def test_a_sheet_with_preamble_and_a_sheet_of_notes(self, reads):
        reading = reads(workbook({"Data": [["Logger X"], [], HEAD, *ROWS], "Notes": [["a"], ["b"]]}), "r1.xlsx")
        check(reading)
        assert reading.reading["format"] == "excel"
        assert reading.reading["skipped_rows"] == 2
        assert any(f.id == "sheets-left-out" and "Notes" in f.statement for f in reading.findings)

    def test_a_wrong_ending_does_not_matter(self, reads):
        check(reads(workbook({"S": [HEAD, *ROWS]}), "r1.csv"))

    def test_dates(self, reads):
        rows = [[START + datetime.timedelta(seconds=t), a, b] for t, a, b in ROWS]
        reading = reads(workbook({"S": [["Time", *HEAD[1:]], *rows]}), "r1.xlsx")
        check(reading)
        assert reading.runs[0].start == "2026-01-02T10:00:00"

    def test_date_and_time_of_day_in_two_columns(self, reads):
        rows = [[START.date(), (START + datetime.timedelta(seconds=t)).time(), a, b] for t, a, b in ROWS]
        check(reads(workbook({"S": [["Date", "Time", *HEAD[1:]], *rows]}), "r1.xlsx"))

    def test_units_row_and_decimal_commas_as_text(self, reads):
        rows = [[str(cell).replace(".", ",") for cell in row] for row in ROWS]
        reading = reads(workbook({"S": [["t", "T1", "Z"], ["s", "°C", "µm"], *rows]}), "r1.xlsx")
        check(reading)
        assert reading.reading["unit_row"] is True

    def test_merged_heading_above_the_names_errors_and_empty_cells(self, reads):
        rows = [list(row) for row in ROWS]
        rows[2][1] = "#N/A"
        rows[3][1] = None
        rows[4][1] = "OPEN"
        reading = reads(workbook({"S": [[None, "Temperatures", None], HEAD, *rows]}), "r1.xlsx")
        assert np.isnan(reading.recording.values("r1", ["T1"])[2:5, 0]).all()
        assert any(f.id == "sensor-break" for f in reading.findings)

    def test_names_in_two_rows_with_merged_cells(self, reads):
        rows = [[t, a, a + 1, a - 1, b] for t, a, b in ROWS]
        upper = ["Zeit [s]", "Spindelstock", None, "Säule", None]
        lower = [None, "Lager [°C]", "Öl [°C]", "links [°C]", "Z [µm]"]
        for sheet in ([upper, lower], [["Prüfer", "Müller", None, None, None], [], upper, lower]):
            reading = reads(workbook({"S": [*sheet, *rows]}), "r1.xlsx")
            names = ("Spindelstock Lager", "Spindelstock Öl", "Säule links", "Säule Z")
            assert reading.recording.names == names
            assert [one.unit_in_file for one in reading.channels] == ["degC"] * 3 + ["um"]
            np.testing.assert_allclose(reading.recording.values("r1", names[:2]), np.array([T1, T1 + 1]).T)
            assert reading.reading["header_row"] == len(sheet)
            text = "\n".join(";".join("" if cell is None else str(cell) for cell in row) for row in [*sheet, *rows])
            assert reads(text.encode("cp1252"), "r1.csv").recording.names == names

    def test_names_that_stand_twice_are_told_apart_by_what_stands_over_them(self, reads):
        rows = [[t, a, a + 1, a - 1, b] for t, a, b in ROWS]
        lower = ["Zeit [s]", "oben [°C]", "unten [°C]", "oben [°C]", "Z [µm]"]
        for upper, names in (
            ([None, "Spindelstock", None, "Säule", None], ("Spindelstock oben", "unten", "Säule oben", "Z")),
            ([None, "Spindelstock", None, None, None], ("oben", "unten", "oben .2", "Z")),  # that tells nothing apart
            (["s", "°C", "°C", "°C", "µm"], ("oben", "unten", "oben .2", "Z")),  # units are no names
        ):
            reading = reads(workbook({"S": [upper, lower, *rows]}), "r1.xlsx")
            assert reading.recording.names == names
            np.testing.assert_allclose(reading.recording.values("r1", names[:3:2]), np.array([T1, T1 - 1]).T)
            text = "\n".join(
                ";".join("" if cell is None else str(cell) for cell in row) for row in [upper, lower, *rows]
            )
            assert reads(text.encode("cp1252"), "r1.csv").recording.names == names

    def test_sheets_of_one_kind_are_runs_or_one_is_chosen(self, reads):
        book = workbook({f"Day {k}": [HEAD, *ROWS] for k in (1, 2, 3)} | {"Sum": [["x", "y"], [1, 2], [3, 4]]})
        reading = reads(book, "w.xlsx")
        assert reading.recording.runs == ("w_Day 1", "w_Day 2", "w_Day 3")
        assert any(f.id == "sheets-are-runs" for f in reading.findings)
        assert any(f.id == "sheets-left-out" and "Sum" in f.statement for f in reading.findings)
        check(reads(book, "r1.xlsx", sheet="Day 2"))
        check(reads(book, "r1.xlsx", sheet="2"))
        with pytest.raises(ReadError, match="no sheet 'Day 9'"):
            reads(book, "r1.xlsx", sheet="Day 9")


class TestParquet:
    def frame(self) -> pd.DataFrame:
        return pd.DataFrame({"t [s]": TIME, "T1": T1, "Z_um": Z})

    def stored(self, frame: pd.DataFrame, kind: str) -> bytes:
        buffer = io.BytesIO()
        getattr(frame, f"to_{kind}")(buffer)
        return buffer.getvalue()

    @pytest.mark.parametrize("kind", ["parquet", "feather"])
    def test_numbers(self, reads, kind):
        reading = reads(self.stored(self.frame(), kind), f"r1.{kind}")
        check(reading)
        assert reading.reading["format"] == kind

    def test_timestamps_zones_and_other_types(self, reads):
        frame = self.frame().drop(columns="t [s]")
        stamps = pd.to_datetime(START) + pd.to_timedelta(TIME, unit="s")
        frame.insert(0, "time", stamps.tz_localize("Europe/Berlin"))
        frame["coolant_on"] = [True, False] * (N // 2)
        frame["nested"] = [[1, 2]] * N
        frame["note"] = pd.Categorical(["a"] * N)
        reading = reads(self.stored(frame, "parquet"), "r1.parquet")
        check(reading)
        assert reading.runs[0].start == "2026-01-02T09:00:00+00:00"
        assert reading.recording.channel("coolant_on").role == "state"
        assert any(f.id == "nested-columns" for f in reading.findings)

    def test_a_run_column_tells_runs_apart(self, reads):
        frame = pd.concat([self.frame().assign(run=name) for name in ("cold", "warm")])
        reading = reads(self.stored(frame.reset_index(drop=True), "parquet"), "both.parquet")
        assert reading.recording.runs == ("cold", "warm")
        assert reading.recording.time_s("warm").tolist() == TIME.tolist()


class TestMatlab:
    def stored(self, content: dict[str, object], **options: object) -> bytes:
        buffer = io.BytesIO()
        scipy.io.savemat(buffer, content, **options)
        return buffer.getvalue()

    @pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}])
    def test_vectors(self, reads, options):
        content = {"t_s": TIME[:, None], "T1": T1, "Z_um": Z, "gain": 3.0}
        check(reads(self.stored(content, **options), "r1.mat"))

    def test_structure_of_vectors_beside_settings(self, reads):
        content = {"log": {"time": TIME, "T1": T1, "Z_um": Z, "sub": {"a": 1}}, "cfg": {"x": np.arange(3.0)}}
        check(reads(self.stored(content), "r1.mat", time_unit="s"))

    def test_matrix_with_names_and_units(self, reads):
        names, units = (np.array(x, dtype=object) for x in (["t", "T1", "Z"], ["s", "degC", "um"]))
        check(reads(self.stored({"data": np.c_[TIME, T1, Z], "names": names, "units": units}), "r1.mat"))

    def test_structure_array_is_runs(self, reads):
        runs = np.zeros(2, dtype=[("t_s", object), ("T1", object)])
        runs[0], runs[1] = (TIME, T1), (TIME[:5], T1[:5])
        reading = reads(self.stored({"runs": runs}), "r1.mat")
        assert [run.rows for run in reading.runs] == [8, 5]

    def test_damage_never_reaches_the_library(self, reads):
        whole = bytearray(self.stored({"t": TIME, "T1": T1, "s": {"a": np.array(["x", "yy"], dtype=object)}}))
        rng = np.random.default_rng(3)
        refused = 0
        for _ in range(150):
            damaged = whole.copy()
            for at in rng.integers(128, len(whole), 4):
                damaged[at] = rng.integers(0, 256)
            try:
                reads(bytes(damaged), "r1.mat")
            except ReadError:
                refused += 1
        assert refused > 20

    def hdf(self, tmp_path: Path, *, opaque_only: bool = False) -> bytes:
        h5py = pytest.importorskip("h5py")
        path = tmp_path / "source.h5"
        with h5py.File(path, "w", userblock_size=512) as file:
            if not opaque_only:
                group = file.create_group("log")
                group.attrs["MATLAB_class"] = np.bytes_("struct")
                for name, value in {"t_s": TIME, "T1": T1, "Z_um": Z}.items():
                    stored = group.create_dataset(name, data=value[None, :])
                    stored.attrs["MATLAB_class"] = np.bytes_("double")
            table = file.create_dataset("tt", data=np.zeros((1, 6), np.uint32))
            table.attrs["MATLAB_class"] = np.bytes_("timetable")
            table.attrs["MATLAB_object_decode"] = 3
        content = bytearray(path.read_bytes())
        content[:19] = b"MATLAB 7.3 MAT-file"
        return bytes(content)

    def test_version_7_3(self, reads, tmp_path):
        reading = reads(self.hdf(tmp_path), "r1.mat")
        check(reading)
        assert reading.reading["format"] == "mat-7.3"
        assert any(f.id == "opaque-objects" and "tt" in f.statement for f in reading.findings)

    def test_objects_only_matlab_can_read(self, reads, tmp_path):
        with pytest.raises(ReadError, match="writetimetable"):
            reads(self.hdf(tmp_path, opaque_only=True), "r1.mat")

    def test_a_dataset_that_claims_to_be_huge(self, reads, tmp_path):
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / "big.h5", "w") as file:
            file.create_dataset("x", shape=(10**12,), dtype="f8", chunks=(1024,))
        with pytest.raises(ReadError, match=r"1e\+12 numbers"):
            read([tmp_path / "big.h5"])


class TestTdms:
    def stored(self, channels: list[tuple[str, str, np.ndarray, dict[str, object]]]) -> bytes:
        nptdms = pytest.importorskip("nptdms")
        buffer = io.BytesIO()
        with nptdms.TdmsWriter(buffer) as writer:
            writer.write_segment([nptdms.ChannelObject(*channel) for channel in channels])
        return buffer.getvalue()

    def test_waveforms_with_units_and_start(self, reads):
        wave = {"wf_increment": 10.0, "wf_start_offset": 0.0, "wf_start_time": np.datetime64("2026-01-02T10:00:00")}
        channels = [("G", "T1", T1, {**wave, "unit_string": "degC"}), ("G", "Z", Z, {**wave, "unit_string": "um"})]
        reading = reads(self.stored(channels), "r1.tdms")
        check(reading)
        assert reading.runs[0].start == "2026-01-02T10:00:00"
        assert reading.reading["format"] == "tdms"

    def test_a_time_channel_and_two_groups(self, reads):
        one = [("A", "t [s]", TIME, {}), ("A", "T1", T1, {}), ("A", "Z_um", Z, {})]
        check(reads(self.stored(one), "r1.tdms"))
        both = one + [("B", *channel[1:]) for channel in one]
        reading = reads(self.stored(both), "r1.tdms")
        assert reading.recording.runs == ("r1_A", "r1_B")
        assert any(f.id == "groups-are-runs" and f.level == "warning" for f in reading.findings)
        check(reads(self.stored(both), "r1.tdms", sheet="B"))

    def test_channels_of_other_rates_are_interpolated_and_told(self, reads, ids):
        wave = {"wf_start_offset": 0.0}
        fast = np.arange(2 * N) * 0.75 - 2
        channels = [("G", "T1", T1, {**wave, "wf_increment": 10.0}), ("G", "Z_um", fast, {**wave, "wf_increment": 5.0})]
        reading = reads(self.stored(channels), "r1.tdms")
        check(reading)
        assert "several-clocks" in ids(reading)


class TestMdf:
    @pytest.mark.parametrize(("version", "ending"), [("4.10", "mf4"), ("3.30", "mdf")])
    def test_groups_of_two_rates(self, tmp_path, version, ending, capsys):
        asammdf = pytest.importorskip("asammdf")
        path = tmp_path / f"r1.{ending}"
        with asammdf.MDF(version=version) as file:
            signal = asammdf.Signal
            file.append([signal(T1, TIME, name="T1", unit="°C"), signal(Z, TIME, name="Z", unit="um")])
            file.append([signal(np.arange(40.0) * 100, np.arange(40) * 2.0, name="n", unit="rpm")])
            file.save(path, overwrite=True)
        reading = read([path])
        check(reading)
        assert reading.recording.values("r1", ["n"])[1, 0] == 500.0
        assert any(f.id == "several-clocks" and f.evidence["channels"] == ["n"] for f in reading.findings)
        # the reader collects what asammdf leaves behind of each: not among all that was made before
        gc.collect()
        gc.freeze()
        # every second prefix of a few hundred bytes: refused, and nothing on standard output
        whole = path.read_bytes()
        for length in range(64, len(whole) - 8, max(64, len(whole) // 12)):
            path.write_bytes(whole[:length])
            with pytest.raises(ReadError):
                read([path], overrides=Overrides())
        assert capsys.readouterr().out == ""


def test_what_is_silenced_while_files_are_read_speaks_again_when_the_last_thread_is_done():
    """The workbench reads in one thread while another reads, too; whoever comes first may leave first."""
    level, filters = logging.root.manager.disable, list(warnings.filters)
    first, second = quiet(), quiet()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert logging.root.manager.disable >= logging.CRITICAL
    second.__exit__(None, None, None)
    assert (logging.root.manager.disable, list(warnings.filters)) == (level, filters)


def test_a_long_name_keeps_its_unit_and_fits_into_a_model():
    long = "Messstelle " * 30
    names, told = unique_headers([long + "links [degF]", long + "rechts [degF]", long + "links [degF]"], "a.csv")
    assert [name_and_unit(name)[1] for name in names[:2]] == ["degF", "degF"]
    assert names[2] == f"{names[0]}.2"
    assert [one.id for one in told] == ["duplicate-header"]
    assert [TypeAdapter(Name).validate_python(name) for name in names] == names
