"""Whatever stands in a file, reading it gives a recording or an InputError, never another exception."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.readers import Overrides, Reading, convert, machine_of, machine_text, read
from selector.readers.machine_file import machine_from_text

FUZZ = settings(
    max_examples=int(os.environ.get("SELECTOR_FUZZ", "60")),
    # the first example pays for imports and compiled patterns
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)

VALID = (
    "Logger XY;;\n\nZeit;T1;Z\nmin;°C;µm\n" + "".join(f"{i};2{i % 10},5;{i - 3},25\n" for i in range(12)),
    "t,T1,T2\n" + "".join(f"{i * 60},{20 + i / 10},{21 + i / 7:.3f}\n" for i in range(12)),
    "Datum\tUhrzeit\tTemp 1\n" + "".join(f"31.12.2025\t23:{50 + i}:00\t{20 + i},1\n" for i in range(10)),
    '"time","T1 [°C]"\n' + "".join(f'"2026-03-29T01:{50 + i}:00","{20 + i}"\n' for i in range(10)),
)

ODD_TEXT = (
    "|NaN|OPEN|-|1,5|1.5|1.234,5|1e999|-1e308|2026-01-01|24:61:61|12:00 AM|\"|'|=1+1|99999999999999999999|31.02.2026|"
    "1/2/3|on|°C|\0|\u2028|٣|²|1:2|#|%|1d5|0x10|1 d 2:3|12 12|T1|t|Time|inf|"
)
ODD_CELLS = ODD_TEXT.split("|")
CELL = st.one_of(
    st.sampled_from([*ODD_CELLS, "9" * 400]),
    st.floats(allow_nan=True, allow_infinity=True).map(repr),
    st.integers().map(str),
    st.text(max_size=6),
)


def outcome(path: Path, overrides: Overrides | None = None) -> Reading | None:
    try:
        reading = read([path], overrides=overrides)
    except InputError as error:
        told = (error.found, error.expected, error.where, error.advice)
    else:
        assert reading.description()["schema"] == "selector.description/1"
        return reading
    assert all(told)
    return None


@FUZZ
@given(content=st.binary(max_size=600))
def test_any_bytes(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "r1.csv"
    path.write_bytes(content)
    outcome(path)


@FUZZ
@given(
    content=st.text(max_size=500), encoding=st.sampled_from(["utf-8", "utf-16", "utf-16-le", "gb18030", "utf-8-sig"])
)
def test_any_text(tmp_path: Path, content: str, encoding: str) -> None:
    path = tmp_path / "r1.csv"
    path.write_bytes(content.encode(encoding, "replace"))
    outcome(path)


@FUZZ
@given(
    rows=st.lists(st.lists(CELL, min_size=1, max_size=5), min_size=1, max_size=12),
    separator=st.sampled_from([",", ";", "\t", "|", " ", "  "]),
    header=st.sampled_from(["", "t,T1,Z\n", "Time;T1 [°C];Z [µm]\n", "# t T1\n", "Date\tTime\tT1\n"]),
)
def test_any_table(tmp_path: Path, rows: list[list[str]], separator: str, header: str) -> None:
    path = tmp_path / "r1.csv"
    path.write_text(header + "\n".join(separator.join(row) for row in rows), encoding="utf-8", errors="replace")
    reading = outcome(path)
    if reading is not None:
        for run in reading.recording.runs:
            assert np.all(np.diff(reading.recording.time_s(run)) > 0)


@FUZZ
@given(data=st.data())
def test_damaged_files(tmp_path: Path, data: st.DataObject) -> None:
    content = data.draw(st.sampled_from(VALID)).encode(data.draw(st.sampled_from(["utf-8", "cp1252", "utf-16"])))
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, max(len(content) - 1, 0)))
        kind = data.draw(st.sampled_from(["cut", "insert", "delete", "double", "replace"]))
        extra = data.draw(st.binary(min_size=1, max_size=4))
        content = {
            "cut": content[:at],
            "insert": content[:at] + extra + content[at:],
            "delete": content[:at] + content[at + 7 :],
            "double": content[:at] + content[max(0, at - 40) :],
            "replace": content[:at] + extra + content[at + len(extra) :],
        }[kind]
    path = tmp_path / "r1.txt"
    path.write_bytes(content)
    outcome(path)


@FUZZ
@given(
    content=st.sampled_from(VALID),
    overrides=st.builds(
        Overrides,
        encoding=st.sampled_from([None, "utf-8", "cp1251", "utf-16", "nonsense", "rot13", "idna", "unicode_escape"]),
        separator=st.sampled_from([None, ",", ";", "tab", "blank", "ab", "", '"', "5"]),
        decimal=st.sampled_from([None, ",", ".", "x"]),
        header_row=st.sampled_from([None, 0, 1, 3, 999, -4]),
        time_column=st.sampled_from([None, "t", "Zeit", "T1", "nothing", ""]),
        time_unit=st.sampled_from([None, "s", "min", "datetime", "parsec"]),
        date_order=st.sampled_from([None, "dmy", "ymd", "xyz"]),
        period_s=st.sampled_from([None, 1.0, 0.0, -1.0, float("nan")]),
        units=st.sampled_from([{}, {"T1": "degF"}, {"T1": "mm"}, {"no": "s"}]),
        roles=st.sampled_from([{}, {"T1": "ambient"}, {"Z": "warm"}, {"T1": "displacement"}]),
    ),
)
def test_any_overrides(tmp_path: Path, content: str, overrides: Overrides) -> None:
    path = tmp_path / "r1.csv"
    path.write_text(content, encoding="utf-8")
    outcome(path, overrides)


@FUZZ
@given(content=st.one_of(st.text(max_size=200), st.binary(max_size=100).map(lambda b: b.decode("latin-1"))))
def test_any_machine_file(content: str) -> None:
    with contextlib.suppress(InputError):
        machine_from_text(content, "machine.toml")


NAME = st.text(st.characters(categories=["L", "N", "P", "S", "Zs"]), min_size=1, max_size=12).filter(
    lambda name: name.isprintable() and name.strip()
)


@FUZZ
@given(
    names=st.lists(NAME, min_size=1, max_size=4, unique=True),
    rows=st.lists(
        st.lists(st.one_of(st.floats(allow_nan=False, allow_infinity=False), st.none()), min_size=4, max_size=4),
        min_size=2,
        max_size=8,
    ),
    steps=st.lists(st.floats(1e-6, 1e6), min_size=8, max_size=8),
    form=st.sampled_from(["csv", "parquet"]),
)
def test_converted_recordings_read_back_bit_for_bit(
    tmp_path: Path, names: list[str], rows: list[list[float | None]], steps: list[float], form: str
) -> None:
    values = np.array([[np.nan if cell is None else cell for cell in row[: len(names)]] for row in rows])
    if np.isnan(values).all():
        values[0, 0] = 1.5
    source = tmp_path / "in" / "r1.csv"
    source.parent.mkdir(exist_ok=True)
    time_s = np.cumsum(steps[: len(rows)])
    lines = [
        ",".join(repr(float(v)) if v == v else "" for v in (t, *row)) for t, row in zip(time_s, values, strict=True)
    ]
    source.write_text(
        "t," + ",".join(f"c{k}" for k in range(len(names))) + "\n" + "\n".join(lines) + "\n", encoding="utf-8"
    )
    channels = "".join(
        f"[channels.{quoted(name)}]\ncolumn = 'c{k}'\nrole = 'displacement'\nunit = 'um'\n"
        for k, name in enumerate(names)
    )
    machine = machine_from_text("[time]\ncolumn = 't'\nunit = 's'\n" + channels, "machine.toml")
    first = read([source], machine)
    out = tmp_path / "out"
    shutil.rmtree(out, ignore_errors=True)
    convert(first, out, form)
    again = read([out / f"r1.{form}"], out / "machine.toml")
    assert again.recording.channels == first.recording.channels
    assert np.array_equal(again.recording.time_s("r1"), first.recording.time_s("r1"))
    for name in first.recording.names:
        one, two = (r.recording.values("r1", [name])[:, 0] for r in (first, again))
        known = ~np.isnan(one)
        assert np.array_equal(known, ~np.isnan(two))
        with np.errstate(over="ignore"):
            is_single = form == "csv" and np.array_equal(one.astype(np.float32), one, equal_nan=True)
        # what holds nothing but single precision has its digits, and is the same in single precision
        kind, bits = (np.float32, np.int32) if is_single else (np.float64, np.int64)
        assert np.array_equal(one[known].astype(kind).view(bits), two[known].astype(kind).view(bits))
    assert machine_from_text(machine_text(machine_of(again)), "x") == machine_of(again)


def quoted(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'


@pytest.mark.parametrize("length", [0, 1, 3, 7, 15, 40])
def test_every_prefix_of_a_valid_file(tmp_path: Path, length: int) -> None:
    for number, content in enumerate(VALID):
        raw = content.encode("utf-8")
        path = tmp_path / f"r{number}.csv"
        path.write_bytes(raw[: len(raw) * length // 40])
        outcome(path)
