"""Files as loggers and colleagues leave them: stated intervals, odd stamps, zero bytes, structures, broken sensors."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from selector.cli import app
from selector.errors import UnitError
from selector.readers import read
from selector.units import CANONICAL_UNITS, convert, parse_unit, unit_for_role

TIME = np.arange(120) * 10.0
COURSES = {
    "time": TIME,
    "T1": 20.0 + 5.0 * (1 - np.exp(-TIME / 500)),
    "T2": 19.0 + 4.0 * (1 - np.exp(-TIME / 900)) + 0.05 * np.sin(TIME / 70.0),
    "Z": 10.0 * (1 - np.exp(-TIME / 400)),
}
UNITS = {"time": "s", "T1": "degC", "T2": "degC", "Z": "um"}


def table(*, without_time: bool = False, stamp: str | None = None) -> str:
    names = list(COURSES)[1:]
    lines = []
    for i, t in enumerate(TIME):
        when = [] if without_time else [f"{t:g}" if stamp is None else str(np.datetime64("2021-06-05T13:24:41") + i)]
        if stamp is not None:
            when = [when[0].replace("-", "/").replace("T", stamp)]
        lines.append(",".join([*when, *(f"{COURSES[name][i]:.3f}" for name in names)]))
    header = ",".join(
        [*([] if without_time else ["time" + " [s]" * (stamp is None)]), "T1 [degC]", "T2 [degC]", "Z [um]"]
    )
    return "\n".join([header, *lines]) + "\n"


@pytest.mark.parametrize(
    ("line", "period_s"),
    [
        ("Sampling interval,500 ms", 0.5),
        ("Sampling interval [s],2", 2.0),
        ("# sample rate: 10 Hz", 0.1),
        ("Abtastintervall;0,25 s", 0.25),
        ('"Scan interval","1 min"', 60.0),
        ("采样间隔,5 s", 5.0),
    ],
)
def test_an_interval_that_the_heading_states_is_the_clock(tmp_path, line, period_s):
    path = tmp_path / "r1.csv"
    path.write_text("Logger,XYZ\n" + line + "\n\n" + table(without_time=True), encoding="utf-8")
    found = read([path])
    assert found.runs[0].period_s == pytest.approx(period_s)
    assert found.reading["time"]["guessed"] == []
    assert {finding.id for finding in found.findings} & {"stated-period", "no-clock"} == {"stated-period"}


@pytest.mark.parametrize("line", ["Recording time,30 min", "Samples,5000", "Logger rate,fast", "Log interval,0 s"])
def test_what_is_no_interval_is_none(tmp_path, line):
    path = tmp_path / "r1.csv"
    path.write_text("Logger,XYZ\n" + line + "\n\n" + table(without_time=True), encoding="utf-8")
    assert {finding.id for finding in read([path]).findings} & {"stated-period", "no-clock"} == {"no-clock"}


def test_a_clock_counts_more_than_the_heading(tmp_path):
    path = tmp_path / "r1.csv"
    path.write_text("Sampling interval,500 ms\n" + table(), encoding="utf-8")
    assert read([path]).runs[0].period_s == 10.0


@pytest.mark.parametrize("between", ["-", " ", "T", "_"])
def test_a_date_and_a_time_may_be_joined_by_a_hyphen(tmp_path, between):
    path = tmp_path / "r1.csv"
    path.write_text(table(stamp=between), encoding="utf-8")
    run = read([path]).runs[0]
    assert (run.as_dict()["start"], run.period_s) == ("2021-06-05T13:24:41", 1.0)


def test_zero_bytes_in_a_text_are_left_out_and_told(tmp_path):
    text, path = table().encode(), tmp_path / "r1.csv"
    path.write_bytes(text[:1000] + b"\0\0\0" + text[1000:] + b"\0" * 512)
    found, clean = read([path]), tmp_path / "r2.csv"
    clean.write_bytes(text)
    assert found.recording.frame.to_numpy().tolist() == read([clean]).recording.frame.to_numpy().tolist()
    assert [f.evidence["bytes"] for f in found.findings if f.id == "zero-bytes"] == [515]


def structures() -> dict[str, object]:
    def parts(name: str) -> dict[str, dict[str, object]]:
        return {key: {name: values, "unit": UNITS[key]} for key, values in COURSES.items()}

    rows = [(key, UNITS[key], values) for key, values in COURSES.items()]
    return {
        "units-beside": {"data": {**COURSES, "units": UNITS}},
        "a-structure-a-channel": {"rec": parts("values")},
        "at-the-top": parts("data"),
        "an-array-of-channels": {"ch": np.array(rows, dtype=[("name", object), ("unit", object), ("data", object)])},
    }


@pytest.mark.parametrize("form", structures())
def test_structures_of_matlab_bring_every_channel_and_its_unit(tmp_path, form):
    savemat(tmp_path / "r1.mat", structures()[form])
    found = read([tmp_path / "r1.mat"])
    assert {one.name: one.unit_in_file for one in found.channels} == {"T1": "degC", "T2": "degC", "Z": "um"}
    assert found.reading["time"] == {"columns": ["time"], "unit": "s", "guessed": ["column"]}
    np.testing.assert_array_equal(found.recording.frame["Z"], COURSES["Z"])


def test_a_unit_that_was_understood_is_understood_again():
    for unit in CANONICAL_UNITS.values():
        assert parse_unit(unit) is not None
    assert unit_for_role(unit_for_role("in/min", "feed_rate", where="F"), "feed_rate", where="F") == "inch/min"


@pytest.mark.parametrize(
    ("written", "role", "canonical"),
    [
        ("kHz", "frequency", 1e3), ("rev/s", "spindle_speed", 60.0), ("kRPM", "spindle_speed", 1e3),
        ("um/s", "feed_rate", 0.06), ("kA", "current", 1e3), ("kV", "voltage", 1e3), ("g0", "acceleration", 9.80665),
        ("kgf", "force", 9.80665), ("daN", "force", 10.0),
        ("l/s", "flow", 1e-3), ("ml/min", "flow", 1e-6 / 60), ("lpm", "flow", 1e-3 / 60), ("m3/min", "flow", 1 / 60),
        ("gpm", "flow", 231 * 0.0254**3 / 60),
    ],
)  # fmt: skip
def test_units_of_a_role(written, role, canonical):
    unit = unit_for_role(written, role, where="F")
    # the constants are exact; six roundings of a conversion
    assert convert(np.ones(1), unit, CANONICAL_UNITS[role]) == pytest.approx(canonical, rel=6 * 2.2e-16)


def test_kilohertz_are_no_spindle_speed():
    with pytest.raises(UnitError, match="does not fit role 'spindle_speed'"):
        unit_for_role("kHz", "spindle_speed", where="F")


def test_decimals_of_a_file_are_met_by_conversions():
    """Through kelvin, tenths of a degree became 19.430000000000007."""
    tenths = np.arange(-500, 2000) / 10.0
    np.testing.assert_array_equal(convert(tenths, "decidegC", "degC"), np.round(tenths / 10.0, 2))
    np.testing.assert_array_equal(convert(np.array([292.58, 273.07, np.nan]), "kelvin", "degC"), [19.43, -0.08, np.nan])
    np.testing.assert_array_equal(convert(np.array([0.0123, -0.0131]), "mm", "um"), [12.3, -13.1])


def test_conversions_keep_every_bit_of_values_without_decimals():
    rng = np.random.default_rng(3)
    kelvin = rng.uniform(280.0, 300.0, 2000)
    np.testing.assert_array_equal(convert(kelvin, "kelvin", "degC") + 273.15, kelvin)
    mixed = np.r_[np.full(500, 292.58), kelvin]
    np.testing.assert_array_equal(convert(mixed, "kelvin", "degC")[500:] + 273.15, kelvin)


def test_convert_writes_single_precision_as_short_as_it_is(tmp_path):
    rng = np.random.default_rng(4)
    single = {"T1": (20.0 + np.arange(60) * 0.01).astype("f4"), "Z": rng.normal(0.0, 9.0, 60).astype("f4")}
    double = rng.normal(20.0, 1.0, 60)
    pd.DataFrame({"time_s": np.arange(60) / 3.0, **single, "T2": double}).to_parquet(tmp_path / "r1.parquet")
    done = CliRunner().invoke(app, ["convert", str(tmp_path / "r1.parquet"), "--out", str(tmp_path / "clean")])
    assert done.exit_code == 0, done.output
    text = (tmp_path / "clean" / "r1.csv").read_text(encoding="utf-8")
    lines = [line.split(",") for line in text.splitlines()]
    assert [line[lines[0].index("T1")] for line in lines[1:4]] == ["20", "20.01", "20.02"]
    found = read([tmp_path / "clean" / "r1.csv"]).recording
    for name, values in single.items():
        np.testing.assert_array_equal(found.frame[name].to_numpy().astype("f4"), values)
    np.testing.assert_array_equal(found.frame["T2"], double)
    np.testing.assert_array_equal(found.time_s("r1"), np.arange(60) / 3.0)


def test_convert_writes_no_codes_of_broken_sensors_and_says_so(tmp_path):
    lines = table().splitlines()
    for i, code in ((50, "850"), (51, "850"), (80, "-9999"), (100, "1e30")):
        cells = lines[i].split(",")
        lines[i] = ",".join([cells[0], code, *cells[2:]])
    (tmp_path / "r1.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = CliRunner().invoke(app, ["convert", str(tmp_path / "r1.csv"), "--out", str(tmp_path / "clean"), "--json"])
    told = [finding for finding in json.loads(done.stdout)["findings"] if finding["id"] == "sensor-break"]
    assert {finding["where"]["channel"] for finding in told} == {"T1"}
    written = [line.split(",") for line in (tmp_path / "clean" / "r1.csv").read_text(encoding="utf-8").splitlines()]
    empty = [i for i, cells in enumerate(written) if cells[1] == ""]
    assert set(empty) >= {50, 51, 80, 100}
    assert all(float(cells[1]) < 30 for cells in written[1:] if cells[1])
