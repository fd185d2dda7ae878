"""Repairs of single runs: what a machine file says of a run is done when it is read, and the file is not touched."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.errors import ReadError, RecordingError, UnitError
from selector.readers import read
from selector.readers.stream import stream_parquet
from selector.shipped import shipped

TIME = np.arange(0.0, 3600.0, 10.0)
CHANNELS = """
[time]
column = "time"
unit = "s"
[channels.T1]
role = "temperature"
unit = "degC"
[channels.T2]
role = "temperature"
unit = "degC"
[channels.Z]
role = "displacement"
unit = "um"
"""
FAULTS = """
[runs.r2]
swap = [["T1", "T2"]]
[runs.r3.channels.T1]
unit = "degF"
[runs.r4.channels.T2]
leave_out = [[600, 1200], [2000, 2100]]
[runs.r5]
use = false
[runs.r6.channels.T2]
leave_out = "all"
"""

MORE_FAULTS = """
[runs.r7.channels.Z]
unit = "mm"
[runs.r8.channels.T1]
unit = "K"
"""


def run(k):
    draw = np.random.default_rng(k)
    duty = np.interp(TIME, np.linspace(0.0, 3600.0, 6), draw.uniform(0.0, 1.0, 6))
    first, second = 20.0 + 15.0 * duty, 20.0 + 8.0 * np.cumsum(duty) / len(duty)
    z = 2.0 * (first - 20.0) + 3.0 * (second - 20.0) + 0.1 * draw.standard_normal(len(TIME))
    return pd.DataFrame({"time": TIME, "T1": first, "T2": second, "Z": z})


def spoilt(k):
    table = run(k)
    if k == 2:
        table[["T1", "T2"]] = table[["T2", "T1"]].to_numpy()
    if k == 3:
        table["T1"] = 1.8 * table["T1"] + 32.0
    if k == 4:
        table.loc[TIME.searchsorted([600, 2000])[0] : TIME.searchsorted(1200), "T2"] = 99.0
        table.loc[TIME.searchsorted(2000) : TIME.searchsorted(2100), "T2"] = 99.0
    if k == 5:
        table["Z"] = 1e4
    if k == 6:
        table["T2"] = -400.0
    if k == 7:
        table["Z"] /= 1000.0
    if k == 8:
        table["T1"] += 273.15
    return table


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for k in range(1, 7):
        spoilt(k).to_csv(tmp_path / f"r{k}.csv", index=False)
    return tmp_path


def machine(folder: Path, repairs: str = FAULTS) -> Path:
    path = folder / "machine.toml"
    path.write_text(CHANNELS + repairs, encoding="utf-8")
    return path


def test_each_repair_gives_back_the_clean_run(folder):
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    reading = read([folder], machine(folder))
    found = reading.recording
    assert found.runs == ("r1", "r2", "r3", "r4", "r6")
    for k in (1, 2, 3, 4, 6):
        values = found.values(f"r{k}", ("T1", "T2", "Z"))
        clean = run(k)[["T1", "T2", "Z"]].to_numpy(copy=True)
        if k == 4:
            clean[((TIME >= 600) & (TIME <= 1200)) | ((TIME >= 2000) & (TIME <= 2100)), 1] = np.nan
        if k == 6:
            clean[:, 1] = np.nan
        # 17 digits in the file; degF to degC and back loses a few
        assert values == pytest.approx(clean, abs=1e-9, nan_ok=True)
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix == ".csv"} == before
    assert {one.id for one in reading.findings} >= {"run-not-used", "run-repaired"}
    assert "empty-channel" not in {one.id for one in reading.findings}


@pytest.mark.parametrize(
    ("repair", "expected"),
    [('swap = [["T1"]]', "a further value"), ('late_s = "three"', "a number"), ('use = "no"', "true or false")],
)
def test_a_repair_of_another_kind_is_refused_in_plain_words(folder, repair, expected):
    with pytest.raises(ReadError) as caught:
        read([folder], machine(folder, f"[runs.r1]\n{repair}\n"))
    assert caught.value.expected == expected


def test_the_same_piece_by_piece(folder):
    for k in range(1, 7):
        spoilt(k).to_parquet(folder / f"r{k}.parquet", index=False)
        (folder / f"r{k}.csv").unlink()
    path = machine(folder)
    source, whole = stream_parquet([folder], path), read([folder], path).recording
    assert source.runs == whole.runs
    for name in whole.runs:
        pieces = np.concatenate([values for _, values in source.chunks(name, whole.names)])
        assert np.array_equal(pieces, whole.values(name, whole.names), equal_nan=True)


def test_seven_faults_repaired_by_the_machine_file_alone_give_the_model_of_the_clean_study(folder, tmp_path, capsys):
    clean = tmp_path / "clean"
    clean.mkdir()
    for k in range(1, 9):
        run(k).to_csv(clean / f"r{k}.csv", index=False)
        spoilt(k).to_csv(folder / f"r{k}.csv", index=False)
    found = {}
    for where, repairs in ((clean, ""), (folder, FAULTS + MORE_FAULTS), (folder, "")):
        asked = ["select", str(where), "--machine", str(machine(where, repairs)), "--response", "Z", "--json"]
        assert exit_status(asked) == 0
        found[where == clean, bool(repairs)] = json.loads(capsys.readouterr().out)
    models = {key: one["models"]["Z"] for key, one in found.items()}
    wanted, repaired, spoiled = models[True, False], models[False, True], models[False, False]
    assert found[False, True]["chosen"]["sensors"] == found[True, False]["chosen"]["sensors"]
    for one, other in zip(wanted["terms"], repaired["terms"], strict=True):
        assert one["powers"] == other["powers"]
        # the clean study has two runs and a stretch more; their noise moves a coefficient by its standard error
        assert one["coefficient"] == pytest.approx(other["coefficient"], abs=4 * other["standard_error"])
    assert repaired["heldout_rmse_um"] == pytest.approx(wanted["heldout_rmse_um"], rel=0.1)
    assert spoiled["heldout_rmse_um"] > 2 * repaired["heldout_rmse_um"]


def test_clean_recordings_are_written_without_the_repairs(folder, capsys):
    out = folder / "out"
    asked = ["convert", str(folder), "--machine", str(machine(folder)), "--out", str(out), "--json"]
    assert exit_status(asked) == 0
    assert "[runs" not in (out / "machine.toml").read_text(encoding="utf-8")
    again = read([out]).recording
    assert np.array_equal(
        again.frame.to_numpy(), read([folder], machine(folder)).recording.frame.to_numpy(), equal_nan=True
    )


def test_the_file_of_describe_keeps_the_repairs(folder, capsys):
    written = folder.parent / "written.toml"
    asked = ["describe", str(folder), "--machine", str(machine(folder)), "--write", str(written), "--force"]
    assert exit_status(asked) == 0
    assert written.read_text(encoding="utf-8").count("[runs.") == 5
    assert read([folder], written).recording.frame.equals(read([folder], machine(folder)).recording.frame)


@pytest.mark.parametrize(
    ("repairs", "error", "words"),
    [
        ('[runs.r1]\nswap = [["T1", "T9"]]', RecordingError, ["'T9'", "runs.r1", "T2"]),
        ('[runs.r1]\nswap = [["T1", "Z"]]', RecordingError, ["T1 [degC] and Z [um]", "runs.r1"]),
        ('[runs.r1.channels.T9]\nunit = "degF"', RecordingError, ["'T9'", "runs.r1"]),
        ('[runs.r1.channels.T1]\nunit = "mm"', UnitError, ["'mm'", "runs.r1.channels.T1"]),
        ("".join(f"[runs.r{k}]\nuse = false\n" for k in range(1, 7)), RecordingError, ["use = false", "r1"]),
    ],
)
def test_what_cannot_be_repaired_is_refused(folder, repairs, error, words):
    with pytest.raises(error) as caught:
        read([folder], machine(folder, repairs))
    for word in words:
        assert word in str(caught.value)


def test_a_repair_of_a_run_that_was_not_read_is_told(folder):
    reading = read([folder / "r1.csv"], machine(folder))
    (told,) = [one for one in reading.findings if one.id == "repair-of-no-run"]
    assert told.evidence["repaired"] == ["r2", "r3", "r4", "r5", "r6"]


def test_a_stretch_beyond_its_run_is_told(folder):
    repairs = "[runs.r1.channels.T2]\nleave_out = [[600, 1200], [36000, 72000]]"
    (told,) = [one for one in read([folder], machine(folder, repairs)).findings if one.id == "repair-of-no-sample"]
    assert (told.where.run, told.where.channel) == ("r1", "T2")
    assert told.evidence["leave_out"] == [[36000.0, 72000.0]]
    whole = read([folder], machine(folder, '[runs.r1.channels.T2]\nleave_out = "all"'))
    assert "repair-of-no-sample" not in {one.id for one in whole.findings}


def test_a_run_of_which_repairs_leave_nothing_is_refused_with_their_place(folder):
    repairs = "".join(f'[runs.r1.channels.{name}]\nleave_out = "all"\n' for name in ("T1", "T2", "Z"))
    with pytest.raises(ReadError, match=r'leave_out of \[runs\."r1"\]'):
        read([folder], machine(folder, repairs))


def test_describe_writes_the_repairs_that_its_findings_prove(tmp_path, capsys):
    """Cables that changed places, °F and mm, each in one run: the written file gives back the clean recording."""
    clean, spoilt_folder = shipped("vmc37"), tmp_path / "recordings"
    spoilt_folder.mkdir()
    for path in sorted(clean.glob("r*.csv")):
        table = pd.read_csv(path)
        if path.stem == "r3":
            table[["T14", "T30"]] = table[["T30", "T14"]].to_numpy()
        if path.stem == "r5":
            table["T20"] = 1.8 * table["T20"] + 32.0
        if path.stem == "r6":
            table["Z"] = table["Z"] / 1000.0
        table.to_csv(spoilt_folder / path.name, index=False)
    machine, written = clean / "machine.toml", tmp_path / "written.toml"
    assert exit_status(["describe", str(spoilt_folder), "--machine", str(machine), "--write", str(written)]) == 0
    assert "it repairs r3, r5, r6" in capsys.readouterr().out
    found, expected = read([spoilt_folder], machine=written).recording, read([clean], machine=machine).recording
    for name in expected.names:
        np.testing.assert_allclose(found.frame[name], expected.frame[name], rtol=1e-9, atol=1e-9)
    again = tmp_path / "again.toml"
    assert exit_status(["describe", str(spoilt_folder), "--machine", str(written), "--write", str(again)]) == 0
    assert "it repairs" not in capsys.readouterr().out
    assert again.read_text(encoding="utf-8") == written.read_text(encoding="utf-8")


def test_describe_repairs_nothing_of_clean_recordings(tmp_path, capsys):
    assert exit_status(["describe", str(shipped("vmc37")), "--write", str(tmp_path / "machine.toml")]) == 0
    assert "[runs" not in (tmp_path / "machine.toml").read_text(encoding="utf-8")
