"""Damage of every kind ends in an error that says what to do, quickly."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.errors import InputError, ReadError, RecordingError
from selector.readers import read

BLANKS = 90_000_000


def zipped(parts: dict[str, str]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def workbook(sheet: str) -> bytes:
    parts = {"[Content_Types].xml": "<Types/>", "xl/workbook.xml": "<workbook/>", "xl/worksheets/sheet1.xml": sheet}
    return zipped(parts)


def with_told_size(content: bytes, true: int, told: int) -> bytes:
    """A zip archive whose directory tells another size of a part."""
    return content.replace(true.to_bytes(4, "little"), told.to_bytes(4, "little"))


def parquet_bytes() -> bytes:
    buffer = io.BytesIO()
    pd.DataFrame({"t": np.arange(9.0), "T1": np.arange(9.0)}).to_parquet(buffer)
    return buffer.getvalue()


# large ones are made by the test that reads them, not wherever tests are collected
BAD: dict[str, tuple[bytes | Callable[[], bytes], str]] = {
    "empty": (b"", "empty"),
    "blanks": (b" \n\r\n\t ", "blanks"),
    "bom only": (b"\xef\xbb\xbf", "blanks"),
    "header only": (b"t,T1\n", "no table of numbers"),
    "header and units only": ("t;T1\ns;°C\n".encode(), "no table of numbers"),
    "one row": (b"t,T1\n0,20\n", "one sample"),
    "one time for all rows": (b"t [s],T1\n5,20\n5,21\n", "one sample"),
    "all missing": (b"t,T1\n0,NaN\n1,NaN\n2,NaN\n", "no value"),
    "words": (b"The quick brown fox\njumps over the lazy dog\n", "no table of numbers"),
    "binary": (bytes(range(256)) * 40, ""),
    "zeros": (bytes(5000), "blanks"),
    "noise": (np.random.default_rng(0).bytes(5000), "binary"),
    "html": (b"<!DOCTYPE html><html><table><tr><td>1</td></tr></table></html>", "web page"),
    "json": (b'{"t": [0, 1], "T1": [20, 21]}', "JSON"),
    "pdf": (b"%PDF-1.7 ...", "PDF"),
    "png": (b"\x89PNG\r\n\x1a\n....", "picture"),
    "gzip": (b"\x1f\x8b\x08....", "gzip"),
    "plain zip": (zipped({"a.csv": "t,T1\n0,1\n"}), "cannot be opened"),
    "zip bomb": (lambda: workbook(" " * BLANKS), "unpacks to"),
    "small zip bomb": (lambda: workbook("<row>" + "<c><v>1</v></c>" * 2_500_000 + "</row>"), "unpacks to"),
    "zip bomb that lies": (lambda: with_told_size(workbook(" " * BLANKS), BLANKS, 1000), "longer than"),
    "cut workbook": (b"PK\x03\x04" + bytes(100), "cannot be opened"),
    "protected workbook": (
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600) + "EncryptedPackage".encode("utf-16-le"),
        "password",
    ),
    "damaged xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "cannot be opened"),
    "cut parquet": (parquet_bytes()[:-20], "Parquet"),
    "parquet head": (b"PAR1", "Parquet"),
    "feather head": (b"ARROW1\0\0" + bytes(20), "Feather"),
    "mat head": (b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + bytes(50), ""),
    "hdf head": (b"\x89HDF\r\n\x1a\n" + bytes(100), "HDF5"),
    "tdms head": (b"TDSm" + bytes(30), "TDMS"),
    "tdms index": (b"TDSh" + bytes(30), "index"),
    "mdf head": (b"MDF     4.10    " + bytes(60), "MDF"),
    "a million columns": (
        lambda: b",".join(b"c%d" % i for i in range(10**6)) + b"\n" + b",".join([b"1"] * 10**6) + b"\n",
        "columns",
    ),
    "a million blanks": (lambda: b"t T1\n" + b" 1" * 10**6 + b"\n" + b" 2" * 10**6, ""),
    "one endless line": (lambda: b"1" * 9_000_000, "characters"),
    "names over too few columns": (b"t,T1\n0,20,30\n1,21,31\n2,22,32\n3,23,33\n", "3 columns of values under 2 names"),
}


@pytest.mark.parametrize("kind", BAD)
def test_damage_is_told_with_advice(tmp_path: Path, kind: str):
    made, words = BAD[kind]
    content = made() if callable(made) else made
    for name in ("r1.csv", "r1.xlsx", "r1.mat"):
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            read([path])
        assert words in str(caught.value)
        assert caught.value.advice


def test_ten_thousand_columns_are_still_a_table(reads):
    head = "t [s]," + ",".join(f"T{i}" for i in range(9_000))
    rows = "\n".join(f"{k}," + ",".join(["20.5"] * 9_000) for k in range(3))
    assert len(reads(f"{head}\n{rows}\n").channels) == 9_000


def test_paths_that_are_not_there(tmp_path: Path):
    (tmp_path / "run1.csv").write_text("t,T1\n0,1\n", encoding="utf-8")
    with pytest.raises(ReadError, match=r"nearest.*'run1\.csv'"):
        read([tmp_path / "run.csv"])
    with pytest.raises(ReadError, match="no recording"):
        read([])
    with pytest.raises(ReadError):
        read([tmp_path / "a\0b.csv"])
    with pytest.raises(ReadError):
        read([tmp_path / ("x" * 5000)])


def test_a_folder_without_recordings(tmp_path: Path):
    (tmp_path / "notes.docx").write_text("x", encoding="utf-8")
    (tmp_path / "deeper").mkdir()
    with pytest.raises(ReadError) as caught:
        read([tmp_path])
    assert "notes.docx" in str(caught.value)
    assert "deeper" in str(caught.value)


def test_text_without_any_usable_channel(tmp_path: Path):
    path = tmp_path / "r.csv"
    path.write_text("t [s],comment\n0,warm\n1,warm up\n2,cold\n3,x\n", encoding="utf-8")
    with pytest.raises(RecordingError, match="machine file"):
        read([path])


def test_missing_optional_packages_name_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    import sys

    for module, head in (("nptdms", b"TDSm"), ("asammdf", b"MDF     "), ("h5py", b"\x89HDF\r\n\x1a\n")):
        monkeypatch.setitem(sys.modules, module, None)
        path = tmp_path / "r.dat"
        path.write_bytes(head + bytes(40))
        with pytest.raises(ReadError, match=r"\.\[formats\]"):
            read([path])
