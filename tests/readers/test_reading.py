from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from selector.errors import OptionError, ReadError
from selector.quality import inspect
from selector.readers import Overrides, convert, machine, machine_of, read, write_machine_file

CONTENT = "Zeit;PT01;Z\nmin;°F;mm\n" + "".join(f"{i};{68 + i},5;0,0{i}\n" for i in range(6))
MACHINE = (
    "[machine]\nname = 'VMC'\n[time]\ncolumn = 'Zeit'\nunit = 'min'\n[channels.T1]\ncolumn = 'PT01'\n"
    "role = 'temperature'\n"
    "unit = 'degF'\nplace = 'nose'\n[channels.Z]\nrole = 'displacement'\nunit = 'mm'\naxis = 'Z'\n"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("r10.csv", "r2.csv", "r1.csv"):
        (tmp_path / name).write_text(CONTENT, encoding="utf-8")
    (tmp_path / "machine.toml").write_text(MACHINE, encoding="utf-8")
    (tmp_path / ".hidden.csv").write_text("x", encoding="utf-8")
    (tmp_path / "~$r1.xlsx").write_text("x", encoding="utf-8")
    (tmp_path / "photo.jpg").write_text("x", encoding="utf-8")
    (tmp_path / "sim").mkdir()
    (tmp_path / "sim" / "r1.csv").write_text(CONTENT, encoding="utf-8")
    return tmp_path


def test_a_folder_is_its_recordings_in_natural_order_with_its_machine_file(folder):
    reading = read([folder])
    assert reading.recording.runs == ("r1", "r2", "r10")
    assert reading.recording.names == ("T1", "Z")
    told = {f.id: f for f in reading.findings}
    assert told["files-skipped"].evidence["files"] == ["photo.jpg"]
    assert "machine-file-found" in told
    assert read([folder], folder / "machine.toml").recording.runs == ("r1", "r2", "r10")


@pytest.mark.parametrize(
    "name", ["SOURCE.txt", "README.txt", "readme_first.txt", "LICENSE.txt", "Notes.txt", "Notizen 2026.txt"]
)
def test_text_beside_recordings_is_told_and_not_read(folder, name):
    (folder / name).write_text("MIT, from example.org\n1 2 3\n", encoding="utf-8")
    reading = read([folder])
    assert reading.recording.runs == ("r1", "r2", "r10")
    (told,) = [f for f in reading.findings if f.id == "files-skipped"]
    assert name in told.evidence["files"]


def test_one_path_alone_is_read_as_one(folder):
    for one in (str(folder), folder):
        assert read(one).recording.runs == read([folder]).recording.runs


def test_a_recording_may_have_a_word_in_its_name(folder):
    (folder / "r1.csv").rename(folder / "source_1.csv")
    assert "source_1" in read([folder]).recording.runs


def test_channels_that_the_same_runs_lack_are_told_once(folder):
    (folder / "r3.txt").write_text("t [s],other [degC]\n0,20\n1,21\n", encoding="utf-8")
    (folder / "machine.toml").unlink()
    found = [f for f in read([folder / "r1.csv", folder / "r3.txt"]).findings if f.id == "channel-missing-in-run"]
    assert {tuple(f.evidence["runs"]): sorted(f.evidence["columns"]) for f in found} == {
        ("r3",): ["PT01", "Z"],
        ("r1",): ["other"],
    }


def test_files_of_one_name_in_two_folders_keep_apart(folder):
    reading = read([folder / "r1.csv", folder / "sim" / "r1.csv"])
    assert reading.recording.runs == (f"{folder.name}_r1", "sim_r1")
    assert any(f.id == "runs-renamed" for f in reading.findings)
    assert read([folder / "r1.csv", folder / "." / "r1.csv"]).recording.runs == ("r1",)


def test_the_description_is_the_contract(folder):
    description = read([folder / "r1.csv"]).description()
    assert json.loads(json.dumps(description, allow_nan=False)) == description
    assert list(description) == ["schema", "runs", "channels", "reading", "findings"]
    assert description["schema"] == "selector.description/1"
    (run,) = description["runs"]
    assert {k: run[k] for k in ("run", "rows", "duration_s", "period_s", "start")} == {
        "run": "r1", "rows": 6, "duration_s": 300.0, "period_s": 60.0, "start": None,
    }  # fmt: skip
    assert run["file"].endswith("r1.csv")
    assert len(run["sha256"]) == 64
    first = description["channels"][0]
    assert first == {
        "name": "PT01", "column": "PT01", "role": "temperature", "unit": "degC", "unit_in_file": "degF",
        "guessed": ["role"],
    }  # fmt: skip
    shown = description["reading"]
    assert {k: shown[k] for k in ("format", "encoding", "separator", "decimal", "skipped_rows", "unit_row")} == {
        "format": "delimited", "encoding": "utf-8", "separator": ";", "decimal": ",", "skipped_rows": 0,
        "unit_row": True,
    }  # fmt: skip
    assert all(
        set(f) == {"id", "level", "statement", "where", "evidence", "suggestion", "action"}
        for f in description["findings"]
    )


def test_a_machine_file_written_from_a_reading_reads_the_same_without_guesses(folder):
    first = read([folder / "r1.csv"])
    path = folder / "written.toml"
    write_machine_file(machine_of(first), path, first.undeclared)
    again = read([folder / "r1.csv"], path)
    assert again.recording.channels == first.recording.channels
    assert np.array_equal(again.recording.frame, first.recording.frame)
    assert all(c.guessed == () for c in again.channels)
    assert again.reading["time"]["guessed"] == []


def test_runs_with_other_channels_and_other_formats(folder, tmp_path):
    (folder / "r3.txt").write_text("t [s],PT01 [degC]\n0,20\n1,21\n", encoding="cp1252")
    (folder / "machine.toml").unlink()
    reading = read([folder / "r1.csv", folder / "r3.txt"])
    assert np.isnan(reading.recording.values("r3", ["Z"])).all()
    assert reading.recording.values("r3", ["PT01"])[0, 0] == 20.0
    (finding,) = [f for f in reading.findings if f.id == "channel-missing-in-run"]
    assert finding.evidence["runs"] == ["r3"]
    assert reading.reading["per_run"]["r3"]["separator"] == ","


def test_the_same_remark_on_many_runs_is_made_once(folder):
    for k in range(20, 28):
        (folder / f"r{k}.csv").write_text("T1\n" + "".join(f"2{i % 3}.5\n" for i in range(5)), encoding="utf-8")
    (folder / "machine.toml").unlink()
    reading = read([folder / f"r{k}.csv" for k in range(20, 28)])
    (finding,) = [f for f in reading.findings if f.id == "no-clock"]
    assert len(finding.evidence["runs"]) == 8


def test_convert_writes_the_contract(folder, tmp_path):
    reading = read([folder])
    out = tmp_path / "clean"
    paths = convert(reading, out)
    assert [p.name for p in paths] == ["r1.csv", "r2.csv", "r10.csv", "machine.toml"]
    lines = (out / "r1.csv").read_bytes().decode("utf-8").split("\n")
    assert lines[0] == "time_s,T1,Z"
    assert lines[2].split(",")[0] == "60"
    assert float(lines[2].split(",")[2]) == 10.0
    declared = machine(out / "machine.toml")
    assert (declared.time.column, declared.time.unit, declared.machine.name) == ("time_s", "s", "VMC")
    assert declared.channels["T1"].place == "nose"
    assert sorted(p.name for p in out.iterdir()) == ["machine.toml", "r1.csv", "r10.csv", "r2.csv"]
    again = read([out])
    assert np.array_equal(again.recording.frame, reading.recording.frame)
    assert again.recording.channels == reading.recording.channels
    convert(again, tmp_path / "twice")
    for name in ("r1.csv", "machine.toml"):
        assert (tmp_path / "twice" / name).read_bytes() == (out / name).read_bytes()


def test_convert_never_writes_over_an_input(folder):
    before = {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}
    with pytest.raises(OptionError, match="inputs"):
        convert(read([folder]), folder)
    with pytest.raises(OptionError, match=r"machine\.toml"):
        convert(read([folder / "r1.csv"], folder / "machine.toml"), folder, "parquet")
    with pytest.raises(OptionError):
        convert(read([folder]), folder / "r1.csv" / "deeper")
    with pytest.raises(OptionError, match=r"'xml'.*csv.*parquet"):
        convert(read([folder]), folder / "out", "xml")
    assert {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()} == before


def test_a_failed_conversion_leaves_nothing_behind(folder, tmp_path, monkeypatch):
    import pyarrow.csv

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pyarrow.csv, "write_csv", full)
    with pytest.raises(OptionError, match="No space left"):
        convert(read([folder]), tmp_path / "clean")
    assert not (tmp_path / "clean").exists()


def test_headers_that_a_spreadsheet_would_run_are_defused_and_read_back(reads, tmp_path):
    reading = reads(
        "t [s],=1+1,@SUM,-x,+y\n0,1,2,3,4\n1,2,3,4,5\n2,3,4,5,6\n",
        roles=dict.fromkeys(("=1+1", "@SUM", "-x", "+y"), "state"),
    )
    out = tmp_path / "clean"
    convert(reading, out)
    header = (out / "r1.csv").read_text(encoding="utf-8").split("\n")[0]
    assert header == "time_s,'=1+1,'@SUM,'-x,'+y"
    again = read([out])
    assert again.recording.names == ("=1+1", "@SUM", "-x", "+y")
    assert np.array_equal(again.recording.frame, reading.recording.frame)
    # without the machine file, too
    (out / "machine.toml").unlink()
    alone = read([out], overrides=Overrides(roles=dict.fromkeys(reading.recording.names, "state")))
    assert alone.recording.names == reading.recording.names


def test_a_machine_file_may_name_a_defused_header_either_way(tmp_path):
    (tmp_path / "r1.csv").write_text("time_s,'=1+1\n0,1\n1,2\n2,3\n", encoding="utf-8")
    for said in ("'=1+1", "=1+1"):
        (tmp_path / "machine.toml").write_text(
            f'[channels.T1]\ncolumn = "{said}"\nrole = "temperature"\nunit = "degC"\n', encoding="utf-8"
        )
        assert read([tmp_path]).recording.names == ("T1",)


def test_names_of_runs_become_names_that_every_system_takes(reads, tmp_path):
    content = "run,t [s],T1\n" + "".join(
        f"{r},{i},2{i}\n" for r in ("a/b:c", "con", "A/b:C", "machine") for i in range(3)
    )
    paths = convert(reads(content), tmp_path / "clean")
    assert [p.name for p in paths] == ["a_b_c.csv", "run_con.csv", "A_b_C_2.csv", "run_machine.csv", "machine.toml"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes")
def test_a_pipe_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(ReadError):
        read([tmp_path / "pipe.csv"], overrides=Overrides())


UNITS_OF_RUNS = {"Lauf_1": ("°C", "µm"), "Lauf_2": ("°C", "µm"), "Lauf_3": ("°F", "µm"), "Lauf_4": ("°C", "mm")}


@pytest.fixture
def of_several_units(tmp_path):
    """Four runs of the same course, one printed in °F, one in mm."""
    for run, (thermal, length) in UNITS_OF_RUNS.items():
        lines = [f"t [min],PT01 [{thermal}],PT02 [{thermal}],Z [{length}]"]
        for minute in range(30):
            kelvin, um = 5 * (1 - np.exp(-minute / 10)), 40 * (1 - np.exp(-minute / 15))
            shown = [1.8 * (t + kelvin) + 32 if thermal == "°F" else t + kelvin for t in (20.0, 21.0)]
            lines.append(f"{minute},{shown[0]:.4f},{shown[1]:.4f},{um / 1000 if length == 'mm' else um:.6f}")
        (tmp_path / f"{run}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return tmp_path


def test_units_that_differ_between_runs_are_right_with_and_without_the_written_machine_file(of_several_units):
    bare = read([of_several_units])
    written = of_several_units.parent / "written.toml"
    write_machine_file(machine_of(bare), written, bare.undeclared)
    again = read([of_several_units], written)
    for reading in (bare, again):
        for run in UNITS_OF_RUNS:
            # every run is the same course; the files hold 1e-4 °F and 1e-6 mm
            values = reading.recording.values(run, ["PT01", "PT02", "Z"])
            assert np.allclose(values, reading.recording.values("Lauf_1", ["PT01", "PT02", "Z"]), rtol=0, atol=2e-3)
        thermal, length = (f for f in reading.findings if f.id == "units-differ")
        assert thermal.evidence["channels"] == ["PT01", "PT02"]
        assert thermal.evidence["in_file"] == {"degC": ["Lauf_1", "Lauf_2", "Lauf_4"], "degF": ["Lauf_3"]}
        assert length.evidence["in_file"] == {"um": ["Lauf_1", "Lauf_2", "Lauf_3"], "mm": ["Lauf_4"]}
        assert not [f for f in inspect(reading.recording) if f.action != "none" and f.id != "same-file-twice"]
    assert again.recording.channels == bare.recording.channels
    assert all(section.unit is None for section in machine(written).channels.values())
    channel = bare.description()["channels"][0]
    assert channel["unit_in_file"] == "degC, degF"
    assert channel["unit_per_run"]["Lauf_3"] == "degF"


def test_a_header_counts_where_other_runs_agree_with_the_machine_file(of_several_units):
    path = of_several_units.parent / "own.toml"
    text = "".join(f'[channels.{n}]\nrole="temperature"\nunit="degC"\n' for n in ("PT01", "PT02"))
    path.write_text(text + '[channels.Z]\nrole="displacement"\nunit="um"\n', encoding="utf-8")
    reading = read([of_several_units], path)
    assert np.array_equal(reading.recording.frame, read([of_several_units]).recording.frame)
    told = [f for f in reading.findings if f.id in ("units-differ", "unit-conflict")]
    assert {(f.id, f.where.run) for f in told} == {("units-differ", "Lauf_3"), ("units-differ", "Lauf_4")}
    assert "2 temperature channels (PT01, PT02)" in next(f for f in told if f.where.run == "Lauf_3").statement
    # what is written from this reading keeps it
    again = path.with_name("again.toml")
    write_machine_file(machine_of(reading), again)
    assert np.array_equal(read([of_several_units], again).recording.frame, reading.recording.frame)
    # the advice can be followed: the option makes the declared unit count in all runs
    forced = read([of_several_units], path, Overrides(units={"PT01": "degC"}))
    assert forced.recording.values("Lauf_3", ["PT01"])[0, 0] == 68.0


def test_a_machine_file_that_every_header_contradicts_is_a_correction(of_several_units):
    path = of_several_units.parent / "own.toml"
    path.write_text('[channels.PT01]\nrole="temperature"\nunit="K"\n', encoding="utf-8")
    reading = read([of_several_units], path)
    assert reading.recording.values("Lauf_1", ["PT01"])[0, 0] == pytest.approx(20 - 273.15, rel=1e-12)
    assert reading.recording.values("Lauf_3", ["PT01"])[0, 0] == pytest.approx(68 - 273.15, rel=1e-12)
    (finding,) = [f for f in reading.findings if f.id in ("units-differ", "unit-conflict")]
    assert (finding.id, finding.where.channel) == ("unit-conflict", "PT01")
    assert "unit" in finding.suggestion
    path.write_text('[channels.PT01]\nrole="temperature"\n', encoding="utf-8")
    assert read([of_several_units], path).recording.values("Lauf_3", ["PT01"])[0, 0] == pytest.approx(20.0, abs=1e-4)


def test_what_a_wrong_unit_in_one_run_advises_works_and_so_does_the_header_of_that_file(of_several_units):
    """With a machine file and without; the other files print no unit."""
    for path in of_several_units.iterdir():
        text = path.read_text(encoding="utf-8")
        for unit in (" [°C]", " [°F]", " [µm]", " [mm]"):
            text = text.replace(unit, "")
        path.write_text(text, encoding="utf-8")
    told = [f for f in inspect(read([of_several_units]).recording) if f.id == "wrong-unit" and f.where.run == "Lauf_3"]
    assert {f.where.channel for f in told} == {"PT01", "PT02"}
    path = of_several_units.parent / "own.toml"
    sections = "".join(f'[channels.{n}]\nrole="temperature"\nunit="degC"\n' for n in ("PT01", "PT02"))
    repairs = ""
    for finding in told:
        section = f'[runs."Lauf_3".channels."{finding.where.channel}"]'
        assert section in finding.suggestion
        assert 'unit = "degF"' in finding.suggestion
        repairs += f'{section}\nunit = "degF"\n'
    path.write_text(sections + repairs, encoding="utf-8")
    readings = [read([of_several_units], path)]
    path.write_text(sections, encoding="utf-8")
    third = of_several_units / "Lauf_3.csv"
    text = third.read_text(encoding="utf-8")
    for finding in told:
        text = text.replace(f",{finding.where.channel}", f",{finding.where.channel} [degF]")
    third.write_text(text, encoding="utf-8")
    for reading in (*readings, read([of_several_units]), read([of_several_units], path)):
        assert reading.recording.values("Lauf_3", ["PT01"])[0, 0] == pytest.approx(20.0, abs=1e-4)
        assert not [f for f in inspect(reading.recording, ["PT01", "PT02"]) if f.id == "wrong-unit"]
