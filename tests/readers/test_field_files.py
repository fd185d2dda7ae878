"""Files as loggers and colleagues leave them: stated intervals, odd stamps, zero bytes, structures, broken sensors."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from selector.cli import app
from selector.readers import read
from selector.units import CANONICAL_UNITS, parse_unit, unit_for_role

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
