"""Whole jobs through the command line: describe, convert, apply, model show and check, and unusable input."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.controllers.model_file import Input, ModelFile, Output, Term, write_model
from selector.controllers.self_check import sealed
from tests.interruptible import interrupted_in

MACHINE = """
[machine]
name = "VMC-850"
[time]
column = "t"
unit = "min"
[channels.T1]
column = "PT01"
role = "temperature"
unit = "degC"
place = "lower bearing"
[channels.T2]
column = "PT02"
role = "temperature"
unit = "degF"
[channels.Z]
column = "dial"
role = "displacement"
unit = "mm"
axis = "Z"
"""

INTERCEPT_UM, PER_K_UM, OFF_UM = 0.0, 6.0, 1.5
MINUTES = np.arange(0.0, 240.0)


def run_table(seed: int, off_um: float = 0.0) -> pd.DataFrame:
    """A warm-up in which the displacement is 6 µm per kelvin of T1's rise, plus `off_um` with changing sign."""
    rng = np.random.default_rng(seed)
    rise = 7.0 * (1 - np.exp(-MINUTES / (50 + 10 * seed)))
    sign = np.where(np.arange(MINUTES.size) % 2 == 0, 1.0, -1.0)
    sign[0] = 0.0
    t2 = 22.0 + 0.6 * rise + rng.normal(0, 0.02, MINUTES.size)
    return pd.DataFrame(
        {"t": MINUTES, "PT01": 20.0 + rise, "PT02": t2 * 9 / 5 + 32, "dial": (PER_K_UM * rise + off_um * sign) / 1000.0}
    )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with two runs, their machine file and a model."""
    monkeypatch.chdir(tmp_path)
    Path("runs").mkdir()
    for seed in (1, 2):
        run_table(seed, OFF_UM).to_csv(f"runs/r{seed}.csv", index=False)
    Path("machine.toml").write_text(MACHINE, encoding="utf-8")
    model = ModelFile(
        name="6 µm per kelvin",
        inputs=(Input(name="T1", centre=3.0, scale=2.0, valid_min=0.0, valid_max=8.0),),
        outputs=(Output(name="Z", intercept=3 * PER_K_UM, terms=(Term(powers={"T1": 1}, coefficient=2 * PER_K_UM),)),),
    )
    write_model(sealed(model), "model.json")
    return tmp_path


ROOT = Path(__file__).resolve().parents[2]
# found wherever the tests are started, installed or not
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}


def selector(
    *arguments: str, environment: dict[str, str] | None = None, encoding: str = "utf-8"
) -> subprocess.CompletedProcess[str]:
    """The program in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "selector", *arguments],
        capture_output=True, text=True, encoding=encoding, timeout=300, check=False,
        env=ENVIRONMENT | (environment or {}),
    )  # fmt: skip


def answer(capfd, *arguments: str) -> dict:
    """The JSON of a command that runs in this process."""
    assert exit_status([*arguments, "--json"]) == 0
    out, _ = capfd.readouterr()
    return json.loads(out, parse_constant=pytest.fail)


def test_describe_says_what_was_read(folder, capfd):
    shown = answer(capfd, "describe", "runs", "--machine", "machine.toml")
    assert shown["schema"] == "selector.description/1"
    assert [run["run"] for run in shown["runs"]] == ["r1", "r2"]
    first = shown["runs"][0]
    assert first["file"].endswith("r1.csv")
    assert first["rows"] == MINUTES.size
    # minutes are whole numbers, so seconds are exact
    assert first["duration_s"] == 60.0 * (MINUTES.size - 1)
    assert first["period_s"] == 60.0
    channels = {channel["name"]: channel for channel in shown["channels"]}
    assert set(channels) == {"T1", "T2", "Z"}
    assert channels["T2"]["column"] == "PT02"
    assert channels["T2"]["unit"] == "degC"
    assert channels["T2"]["unit_in_file"] == "degF"
    assert channels["T2"]["guessed"] == []
    assert shown["reading"]["separator"] == ","
    assert all({"id", "level", "statement", "where"} <= set(finding) for finding in shown["findings"])


def test_what_is_guessed_is_said_and_can_be_overruled(folder, capfd):
    channels = {c["column"]: c for c in answer(capfd, "describe", "runs/r1.csv")["channels"]}
    assert "role" in channels["PT01"]["guessed"]
    line = ["describe", "runs/r1.csv", "--role", "PT01=force", "--unit", "PT01=kN"]
    channels = {c["column"]: c for c in answer(capfd, *line)["channels"]}
    assert channels["PT01"]["role"] == "force"
    assert channels["PT01"]["unit"] == "N"
    assert channels["PT01"]["unit_in_file"] == "kN"
    assert channels["PT01"]["guessed"] == []


def test_describe_writes_a_machine_file_that_reads_back(folder, capfd):
    first = answer(capfd, "describe", "runs", "--machine", "machine.toml", "--write", "again.toml")
    second = answer(capfd, "describe", "runs", "--machine", "again.toml")
    assert first == second
    assert exit_status(["describe", "runs", "--write", "again.toml"]) == 2
    assert "--force" in capfd.readouterr().err
    assert exit_status(["describe", "runs", "--machine", "machine.toml", "--write", "again.toml", "--force"]) == 0


def test_describe_for_people(folder, capfd):
    assert exit_status(["describe", "runs", "--machine", "machine.toml", "--all"]) == 0
    out, err = capfd.readouterr()
    for text in ("r1", "T2", "PT02", "temperature", "°F"):
        assert text in out
    assert "\x1b" not in out + err


def test_names_in_any_alphabet(folder, capfd):
    run_table(1).rename(columns={"PT01": "主轴温度 [℃]", "PT02": "Темп. стойки [°F]", "dial": "Z [мм]"}).to_csv(
        "温度 день.csv", index=False, encoding="utf-8"
    )
    shown = answer(capfd, "describe", "温度 день.csv")
    assert shown["runs"][0]["run"] == "温度 день"
    assert any("主轴温度" in channel["name"] for channel in shown["channels"])
    assert exit_status(["describe", "温度 день.csv"]) == 0
    assert "主轴温度" in capfd.readouterr().out


def test_convert_writes_what_describe_reads_without_a_guess(folder, capfd):
    assert exit_status(["convert", "runs", "--machine", "machine.toml", "--out", "clean"]) == 0
    capfd.readouterr()
    assert sorted(path.name for path in Path("clean").iterdir()) == ["machine.toml", "r1.csv", "r2.csv"]
    text = Path("clean/r1.csv").read_bytes()
    assert text.startswith(b"time_s,T1,T2,Z\n0")
    assert b"\r" not in text
    table = pd.read_csv("clean/r1.csv")
    original = run_table(1, OFF_UM)
    np.testing.assert_allclose(table["time_s"], 60.0 * original["t"], rtol=1e-15)
    # two roundings of a float64 on the way from °F to °C and from mm to µm
    np.testing.assert_allclose(table["T2"], (original["PT02"] - 32) / 1.8, rtol=1e-14)
    np.testing.assert_allclose(table["Z"], 1000 * original["dial"], rtol=1e-14, atol=1e-12)
    shown = answer(capfd, "describe", "clean", "--machine", "clean/machine.toml")
    assert [channel["guessed"] for channel in shown["channels"]] == [[], [], []]
    assert [channel["unit_in_file"] for channel in shown["channels"]] == ["degC", "degC", "um"]


def test_convert_to_parquet_and_back(folder, capfd):
    line = ["convert", "runs", "--machine", "machine.toml", "--out", "clean", "--format", "parquet"]
    assert exit_status(line) == 0
    capfd.readouterr()
    shown = answer(capfd, "describe", "clean", "--machine", "clean/machine.toml")
    assert shown["reading"]["format"] == "parquet"
    assert [run["rows"] for run in shown["runs"]] == [MINUTES.size, MINUTES.size]


def test_convert_never_writes_over_what_it_read(folder, capfd):
    before = Path("runs/r1.csv").read_bytes()
    assert exit_status(["convert", "runs", "--machine", "machine.toml", "--out", "runs"]) == 2
    assert "inputs" in capfd.readouterr().err
    assert Path("runs/r1.csv").read_bytes() == before
    line = ["convert", "runs", "--machine", "machine.toml", "--out", "clean"]
    assert exit_status(line) == 0
    first = Path("clean/r1.csv").read_bytes()
    assert exit_status(line) == 0
    assert Path("clean/r1.csv").read_bytes() == first


def test_apply_gives_the_error_that_was_built_in(folder, capfd):
    line = ["apply", "model.json", "runs", "--machine", "machine.toml", "--out", "predictions.csv"]
    shown = answer(capfd, *line)
    assert shown["schema"] == "selector.application/1"
    assert set(shown["per_run"]) == {"r1", "r2"}
    for figures in (*shown["per_run"].values(), shown["overall"]):
        # ±1.5 µm on every sample but the first; the start level of a warm-up is uncertain by its first minutes
        assert figures["Z"]["rmse_um"] == pytest.approx(OFF_UM, abs=0.3)
        assert figures["Z"]["before_rmse_um"] > 25.0
    predicted = pd.read_csv("predictions.csv")
    assert list(predicted.columns) == ["run", "time_s", "Z"]
    assert len(predicted) == 2 * MINUTES.size
    steps = np.diff(predicted["Z"][predicted["run"] == "r1"])
    np.testing.assert_allclose(steps, PER_K_UM * np.diff(run_table(1)["PT01"]), atol=1e-9)


def test_apply_names_a_broken_sensor_and_leaves_out_a_broken_gauge(folder, capfd):
    table = run_table(3, OFF_UM)
    table.loc[100:119, "PT01"] = 850.0
    table.loc[150:159, "dial"] = -9.999
    table.to_csv("later.csv", index=False)
    shown = answer(capfd, "apply", "model.json", "later.csv", "--machine", "machine.toml")
    broken = [f for f in shown["findings"] if f["where"].get("channel") == "T1" and f["level"] != "info"]
    # said once: by the model's own look at its sensors, which counts these readings as missing
    assert [finding["id"] for finding in broken] == ["sensor-looks-broken"]
    assert [f["action"] for f in shown["findings"] if f["where"].get("channel") == "Z" and f["level"] == "error"] == [
        "leave-out-stretch"
    ]
    # with the broken stretches in, it would be 10 mm
    assert shown["overall"]["Z"]["max_um"] < 3.0


def test_apply_for_people(folder, capfd):
    assert exit_status(["apply", "model.json", "runs", "--machine", "machine.toml"]) == 0
    out = capfd.readouterr().out
    assert "all runs" in out
    assert "RMS before" in out


def test_apply_without_the_sensors_of_the_model(folder, capfd):
    assert exit_status(["apply", "model.json", "runs/r1.csv"]) == 2
    err = capfd.readouterr().err
    assert "T1" in err
    assert "What to do" in err


def test_model_show(folder, capfd):
    assert exit_status(["model", "show", "model.json"]) == 0
    assert "Z = 6·ΔT1" in capfd.readouterr().out
    shown = answer(capfd, "model", "show", "model.json")
    assert shown["formulas"] == {"Z": "6·ΔT1"}
    assert shown["model"] == json.loads(Path("model.json").read_text(encoding="utf-8"))


def test_model_check(folder, capfd):
    assert answer(capfd, "model", "check", "model.json")["usable"] is True
    changed = Path("model.json").read_text(encoding="utf-8").replace('"coefficient": 12.0', '"coefficient": 12.5')
    Path("changed.json").write_text(changed, encoding="utf-8")
    assert exit_status(["model", "check", "changed.json", "--json"]) == 2
    out, err = capfd.readouterr()
    said = json.loads(out)
    assert said["usable"] is False
    assert {"digest-mismatch", "test-vector-mismatch"} <= {finding["id"] for finding in said["findings"]}
    assert "changed.json" in err
    # what cannot be used is told where messages are read
    assert exit_status(["model", "check", "changed.json"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "--accept" in err


def unusable_files(folder: Path) -> None:
    """Inputs that nobody can use, each under a telling name."""
    (folder / "empty.csv").write_bytes(b"")
    (folder / "header-only.csv").write_text("t,T1,Z\n", encoding="utf-8")
    (folder / "noise.csv").write_bytes(np.random.default_rng(0).bytes(5000))
    (folder / "picture.csv").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(2000))
    (folder / "text.csv").write_text("a letter\nwithout any numbers\n" * 20, encoding="utf-8")
    (folder / "no-recordings").mkdir()
    (folder / "broken.toml").write_text("[channels.T1\nrole = temperature", encoding="utf-8")
    (folder / "unknown-key.toml").write_text('[channels.T1]\ncolour = "red"\n', encoding="utf-8")
    (folder / "wrong-unit.toml").write_text(
        '[channels.T1]\ncolumn = "PT01"\nrole = "temperature"\nunit = "mm"\n', encoding="utf-8"
    )
    (folder / "no-model.json").write_text("{}", encoding="utf-8")
    (folder / "cut.json").write_text((folder / "model.json").read_text(encoding="utf-8")[:300], encoding="utf-8")


UNUSABLE = [
    ["describe"],
    ["describe", "nothing.csv"],
    ["describe", "empty.csv"],
    ["describe", "header-only.csv"],
    ["describe", "noise.csv"],
    ["describe", "picture.csv"],
    ["describe", "text.csv"],
    ["describe", "no-recordings"],
    ["describe", "runs", "--machine", "nothing.toml"],
    ["describe", "runs", "--machine", "broken.toml"],
    ["describe", "runs", "--machine", "unknown-key.toml"],
    ["describe", "runs", "--machine", "wrong-unit.toml"],
    ["describe", "runs", "--encoding", "klingon"],
    ["describe", "runs", "--separator", "abc"],
    ["describe", "runs", "--decimal", ";"],
    ["describe", "runs", "--time-column", "nonsense"],
    ["describe", "runs", "--time-unit", "kg"],
    ["describe", "runs", "--unit", "PT01"],
    ["describe", "runs", "--unit", "PT01=furlong"],
    ["describe", "runs", "--role", "PT01=nonsense"],
    ["describe", "runs", "--unit", "nobody=degC"],
    ["describe", "runs", "--header-row", "-1"],
    ["describe", "runs", "--header-row", "900"],
    ["describe", "runs", "--period-s", "nan"],
    ["describe", "runs", "--write", "runs"],
    ["describe", "runs", "--nonsense"],
    ["convert", "runs"],
    ["convert", "runs", "--out", "machine.toml"],
    ["convert", "runs", "--out", "clean", "--format", "doc"],
    ["apply", "model.json"],
    ["apply", "nothing.json", "runs", "--machine", "machine.toml"],
    ["apply", "no-model.json", "runs", "--machine", "machine.toml"],
    ["apply", "runs/r1.csv", "runs", "--machine", "machine.toml"],
    ["apply", "model.json", "runs", "--machine", "machine.toml", "--out", "runs"],
    ["model", "show", "cut.json"],
    ["model", "check", "nothing.json"],
    ["model", "check", "runs"],
    ["model", "nonsense"],
    ["nonsense"],
]


@pytest.mark.parametrize("arguments", UNUSABLE, ids=" ".join)
def test_unusable_input_says_what_to_do(folder, capfd, arguments):
    unusable_files(folder)
    before = sorted(path.name for path in folder.rglob("*"))
    assert exit_status([*arguments, *(["--json"] if "nonsense" not in arguments[-1] else [])]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "What to do" in err
    assert "Traceback" not in err
    assert sorted(path.name for path in folder.rglob("*")) == before, "something was written"


def test_unusable_input_in_a_process_of_its_own(folder):
    unusable_files(folder)
    ended = selector("describe", "noise.csv", environment={"PYTHONPROFILEIMPORTTIME": "1"})
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert "What to do" in ended.stderr
    assert "Traceback" not in ended.stderr
    # a third of a second of every command that reads recordings
    imported = {line.rpartition("|")[2].strip() for line in ended.stderr.splitlines()}
    assert "selector.readers" in imported
    assert "scipy.stats" not in imported


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="the administrator may read every file")
def test_a_file_without_permission(folder, capfd):
    Path("runs/r1.csv").chmod(0)
    assert exit_status(["describe", "runs"]) == 2
    assert "What to do" in capfd.readouterr().err


def test_a_western_windows_terminal(folder):
    western = {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    run_table(1).rename(columns={"PT01": "主轴温度"}).to_csv("温度.csv", index=False, encoding="utf-8")
    ended = selector("describe", "温度.csv", "--json", environment=western)
    assert ended.returncode == 0
    assert json.loads(ended.stdout)["runs"][0]["run"] == "温度"
    ended = selector("describe", "温度.csv", environment=western, encoding="cp1252")
    assert ended.returncode == 0
    assert "PT02" in ended.stdout
    assert ended.stderr == ""


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a process in another way there")
def test_ctrl_c_leaves_nothing_behind(folder):
    table = run_table(1)
    for run in range(3, 120):
        table.to_csv(f"runs/r{run}.csv", index=False)
    # stopped in the middle of writing, at the first drafts of 119
    work = interrupted_in("write_recording", "convert", "runs", "--machine", "machine.toml", "--out", "clean")
    assert work.returncode == 130
    assert work.stderr.count("\n") == 1
    assert "Nothing" in work.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["machine.toml", "model.json", "runs"]


@pytest.mark.skipif(sys.platform == "win32", reason="there is no `head` there")
def test_a_reader_that_goes_away_is_no_defect(folder):
    line = f"{sys.executable} -m selector describe runs --json | head -c 1"
    ended = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line],
        capture_output=True, text=True, timeout=300, check=False, env=ENVIRONMENT,
    )  # fmt: skip
    assert ended.returncode in (0, 141)
    assert ended.stderr == ""


def test_help_needs_nothing_heavy():
    code = (
        "import sys, selector.cli; heavy = {'numpy', 'pandas', 'scipy', 'sklearn', 'plotly', 'numba', 'pint'}\n"
        "print(sorted((heavy | {'rich'}) & set(sys.modules)))\n"
        "assert selector.cli.exit_status(['--help']) == 0\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True, env=ENVIRONMENT
    )
    first, *_, last = ended.stdout.splitlines()
    assert first == last == "[]", "imported before a command needs it"
