"""`selector export`: whole jobs on the command line, and everything that it refuses."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from selector.cli import exit_status
from selector.controllers.c_compiler import compiler
from selector.controllers.model_file import read_model

ROOT = Path(__file__).parents[2]
PATENT = ROOT / "fixtures" / "models" / "patent-two-sensors.json"
PATENT8 = ROOT / "fixtures" / "patent8"
needs_cc = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")


def export(*arguments: object) -> int:
    return exit_status(["export", *map(str, arguments)])


def answer(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


def test_python_with_a_replay(tmp_path, capsys):
    out = tmp_path / "out"
    status = export(
        PATENT, "--for", "python", "--out", out, "--replay", PATENT8 / "recording.csv", "--machine",
        PATENT8 / "machine.toml", "--json",
    )  # fmt: skip
    assert status == 0
    said = answer(capsys)
    assert said["schema"] == "selector.export/1"
    assert (said["target"], said["sign_verified"]) == ("python", False)
    assert said["replay"]["max_abs_difference_um"] == 0.0
    assert said["replay"]["rows"] > 0
    assert said["replay"]["executed_by"].startswith("Python 3")
    assert sorted(path.name for path in out.iterdir()) == sorted(said["files"])
    assert {"limit-not-decided", "sign-unverified"} <= {finding["id"] for finding in said["findings"]}
    page = (out / "commissioning.html").read_text(encoding="utf-8")
    assert "SIGN UNVERIFIED" in page
    assert "every bit" in page
    assert "http://" not in page.split("<script>")[0]


@needs_cc
def test_c_with_a_replay_for_people(tmp_path, capsys):
    status = export(
        PATENT, "--for", "c", "--out", tmp_path / "out", "--replay", PATENT8 / "recording.csv", "--machine",
        PATENT8 / "machine.toml", "--sign-verified", "--slew", "Z=2", "--clamp", "Z=80", "--slew", "Y=2", "--clamp",
        "Y=80",
    )  # fmt: skip
    assert status == 0
    said = capsys.readouterr().out
    assert "every bit" in said
    assert "sign-unverified" not in said
    assert "limit-not-decided" not in said
    assert "UNVERIFIED" not in (tmp_path / "out" / "thermal_correction.c").read_text()
    written = json.loads((tmp_path / "out" / "model.json").read_text(encoding="utf-8"))
    assert written["guard"]["limits"][0]["clamp_um"] == 80.0


def test_a_turned_output_is_replayed_as_such_and_said_everywhere(tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["--for", "python", "--invert", "Y", "--json"]
    arguments += ["--replay", PATENT8 / "recording.csv", "--machine", PATENT8 / "machine.toml"]
    assert export(PATENT, "--out", out, *arguments) == 0
    said = answer(capsys)
    assert said["replay"]["max_abs_difference_um"] == 0.0
    assert "sign-turned" in {finding["id"] for finding in said["findings"]}
    assert "worse-than-nothing" not in {finding["id"] for finding in said["findings"]}
    assert re.search(r"TURNED ROUND: .*\bY\b", (out / "thermal_correction.py").read_text())
    assert [output.sign for output in read_model(out / "model.json").outputs] == [
        "correction = -displacement", "correction = displacement",
    ]  # fmt: skip
    sheet = (out / "commissioning.html").read_text()
    assert re.search(r"Turned round [^<:]*: Y\b", sheet)
    assert sheet.index("+10</td>") < sheet.index("−10</td>")


def test_without_a_replay_it_is_null(tmp_path, capsys):
    assert export(PATENT, "--for", "c", "--out", tmp_path / "out", "--json") == 0
    assert answer(capsys)["replay"] is None


def test_without_a_compiler_the_program_is_written_and_the_lack_told(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("selector.controllers.replay.compiled.compiler", lambda: None)
    status = export(
        PATENT, "--for", "c", "--out", tmp_path / "out", "--replay", PATENT8 / "recording.csv", "--machine",
        PATENT8 / "machine.toml", "--json",
    )  # fmt: skip
    said = answer(capsys)
    assert (status, said["replay"]) == (0, None)
    assert [finding["suggestion"] for finding in said["findings"] if finding["id"] == "replay-not-run"] == [
        "install one (Debian: apt install gcc), or export without --replay"
    ]


@needs_cc
def test_the_screen_holds_it(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "140")
    arguments = ["--replay", PATENT8 / "recording.csv", "--machine", PATENT8 / "machine.toml"]
    assert export(PATENT, "--for", "c", "--out", tmp_path / "out", *arguments) == 0
    shown = capsys.readouterr().out
    assert "Faults rehearsed" in shown
    assert len(shown.splitlines()) <= 40
    assert "Each file" in (tmp_path / "out" / "commissioning.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--for", "siemens"], "one of c"),
        (["--for", "siemens"], "did you mean sinumerik?"),
        (["--for", "scl"], "did you mean sinumerik?"),
        (["--for", "py"], "did you mean python?"),
        (["--for", "zz"], "choose one"),
        (["--for", "c", "--clamp", "X=3"], "no output 'X'"),
        (["--for", "c", "--clamp", "Z=0"], "a number above 0"),
        (["--for", "c", "--slew", "Z=nan"], "a number above 0"),
        (["--for", "c", "--clamp", "Z=3000000"], "e.g. --clamp Z=50"),
        (["--for", "c", "--clamp", "Y=1e6"], "above 0 and below 1000000 µm"),
        (["--for", "c", "--slew", "Y=1e6"], "e.g. --slew Y=1"),
        (["--for", "c", "--time-unit", "parsec"], "--replay beside it: --time-unit says how recordings are read"),
        (["--for", "c", "--machine", "/nonexistent.toml"], "--machine /nonexistent.toml without --replay"),
        (["--for", "c", "--header-row", "0"], "--header-row 0 without --replay"),
        (["--for", "c", "--unit", "T1=degC"], "--unit T1=degC without --replay"),
        (["--for", "c", "--slew", "Z"], "--slew"),
        (["--for", "c", "--invert", "Q"], "no output 'Q'"),
        (["--for", "c", "--replay", "nowhere.csv"], "nowhere.csv"),
    ],
)
def test_what_cannot_be_used_ends_with_2_and_leaves_nothing(tmp_path, capsys, arguments, told):
    assert export(PATENT, "--out", tmp_path / "out", *arguments) == 2
    error = capsys.readouterr().err
    assert told in " ".join(error.split())
    assert "Traceback" not in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda text: text.replace("selector.model/1", "selector.model/9"), "schema"),
        (lambda text: text.replace('"name":', '"secret": 1, "name":', 1), "secret"),
        (lambda text: text[: len(text) // 2], "cut off"),
        (lambda text: text.replace('"intercept":', '"intercept": 1e400, "was":', 1), "1e400"),
    ],
)
def test_a_malformed_model_ends_with_2_names_the_place_and_writes_nothing(tmp_path, capsys, change, place):
    broken = tmp_path / "model.json"
    broken.write_text(change(PATENT.read_text(encoding="utf-8")), encoding="utf-8")
    assert export(broken, "--for", "c", "--out", tmp_path / "out") == 2
    assert place in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_model_whose_numbers_were_changed_is_not_exported(tmp_path, capsys):
    document = json.loads(PATENT.read_text(encoding="utf-8"))
    document["outputs"][0]["intercept"] += 1.0
    changed = tmp_path / "model.json"
    changed.write_text(json.dumps(document), encoding="utf-8")
    assert export(changed, "--for", "c", "--out", tmp_path / "out") == 2
    assert "digest" in capsys.readouterr().err
    del document["digest"]
    changed.write_text(json.dumps(document), encoding="utf-8")
    assert export(changed, "--for", "c", "--out", tmp_path / "out") == 2
    # what the file's own test vector says, and what the changed coefficients give
    said = capsys.readouterr().err
    assert all(value in said for value in ("-1.871 µm", "-0.871 µm"))


@pytest.mark.parametrize(
    ("target", "wrong"),
    [("python", ("self.correction_1 = self.k0_1", "self.correction_1 = -self.k0_1")),
     pytest.param("c", ("m->correction_1 = m->k0_1", "m->correction_1 = -m->k0_1"), marks=needs_cc)],
)  # fmt: skip
def test_the_replay_executes_what_is_written(tmp_path, capsys, monkeypatch, target, wrong):
    from dataclasses import replace

    from selector import exporting

    honest = exporting.TARGETS[target]

    def lying(model, *, is_sign_verified=False):
        exported = honest.write(model, is_sign_verified=is_sign_verified)
        return replace(exported, files={name: text.replace(*wrong) for name, text in exported.files.items()})

    monkeypatch.setattr(exporting, "TARGETS", {target: replace(honest, write=lying)})
    status = export(
        PATENT, "--for", target, "--out", tmp_path / "out", "--replay", PATENT8 / "recording.csv", "--machine",
        PATENT8 / "machine.toml", "--json",
    )  # fmt: skip
    said = answer(capsys)
    assert status == 0
    assert said["replay"]["max_abs_difference_um"] > 10.0
    assert {"replay-differs", "worse-than-nothing"} <= {
        one["id"] for one in said["findings"] if one["level"] == "error"
    }


def test_no_input_is_lost(tmp_path, capsys):
    own = tmp_path / "model.json"
    own.write_bytes(PATENT.read_bytes())
    assert export(own, "--for", "python", "--out", tmp_path, "--slew", "Z=3", "--json") == 0
    assert own.read_bytes() == PATENT.read_bytes()
    assert "model.json" not in answer(capsys)["files"]
    named = tmp_path / "other" / "thermal_correction.py"
    named.parent.mkdir()
    named.write_bytes(PATENT.read_bytes())
    assert export(named, "--for", "python", "--out", named.parent) == 2
    assert "thermal_correction.py" in capsys.readouterr().err
    assert named.read_bytes() == PATENT.read_bytes()


def test_files_that_this_model_does_not_get_are_not_left_from_an_earlier_export(tmp_path, capsys):
    out, model = tmp_path / "out", json.loads(PATENT.read_text(encoding="utf-8"))
    assert export(PATENT, "--for", "c", "--out", out) == 0
    (out / "mine.c").write_text("kept", encoding="utf-8")
    assert (out / "thermal_correction_f.c").exists()
    (out / "thermal_correction_i.c").write_text("of version 0.1", encoding="utf-8")
    model["outputs"][0]["terms"][0]["coefficient"] = 1e39
    model = {key: value for key, value in model.items() if "vectors" not in key and key != "digest"}
    (tmp_path / "m.json").write_text(json.dumps(model), encoding="utf-8")
    assert export(tmp_path / "m.json", "--for", "c", "--out", out) == 0
    assert sorted(path.name for path in out.glob("*_[fi].*")) == []
    assert (out / "mine.c").read_text(encoding="utf-8") == "kept"


def test_programs_of_other_targets_in_the_folder_are_named(tmp_path, capsys):
    def left(target: str, out: str) -> list[str]:
        assert export(PATENT, "--for", target, "--out", tmp_path / out, "--json") == 0
        said = [one for one in answer(capsys)["findings"] if one["id"] == "other-target-in-folder"]
        assert [one["level"] for one in said] == ["warning"] * len(said)
        return [file for one in said for file in one["evidence"]["files"]]

    assert left("c", "out") == left("c", "out") == []
    (tmp_path / "out" / "mine.st").write_text("own", encoding="utf-8")
    programs = [f"thermal_correction{ending}" for ending in (".c", "_f.c", "_f.h")]
    assert sorted(left("python", "out")) == programs
    assert "thermal_correction.py" in left("c", "out")
    assert "other controls" in (tmp_path / "out" / "commissioning.html").read_text(encoding="utf-8")
    # a block that two targets write is of this export
    assert left("tcpou", "block") == left("beckhoff", "block") == []
    tables = ["temp_comp_1.lis", "temp_comp_2.lis", "temp_comp_ads.txt"]
    assert sorted(left("tcpou", "block")) == tables


def test_a_model_beside_its_program_that_says_other_limits_is_told(tmp_path, capsys):
    model = tmp_path / "model.json"
    model.write_bytes(PATENT.read_bytes())
    assert export(model, "--for", "python", "--out", tmp_path, "--clamp", "Z=10", "--json") == 0
    assert "model-not-of-program" in {one["id"] for one in answer(capsys)["findings"]}
    assert model.read_bytes() == PATENT.read_bytes()


def test_a_page_that_is_no_sheet_is_not_replaced(tmp_path, capsys):
    (tmp_path / "commissioning.html").write_text("mine", encoding="utf-8")
    assert export(PATENT, "--for", "python", "--out", tmp_path) == 2
    assert "commissioning.html" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["commissioning.html"]
    assert (tmp_path / "commissioning.html").read_text(encoding="utf-8") == "mine"


def test_a_folder_in_the_place_of_the_predictions_is_called_one(tmp_path, capsys):
    recording, machine = PATENT8 / "recording.csv", PATENT8 / "machine.toml"
    words = ["apply", PATENT, recording, "--machine", machine, "--out", tmp_path]
    assert exit_status([str(word) for word in words]) == 2
    assert f"{tmp_path} is a folder" in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.parametrize(("command", "out"), [("apply", "x.csv"), ("convert", "")])
def test_a_recording_and_a_machine_file_of_others_are_not_replaced(command, out, tmp_path, capsys):
    for name in ("recording.csv", "machine.toml"):
        (tmp_path / ("x.csv" if name == "recording.csv" else name)).write_bytes((PATENT8 / name).read_bytes())
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    model = [PATENT] if command == "apply" else []
    words = [command, *model, PATENT8 / "recording.csv", "--machine", PATENT8 / "machine.toml", "--out", tmp_path / out]
    assert exit_status([str(word) for word in words]) == 2
    assert "Where" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
