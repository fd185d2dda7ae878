"""A kind of simulation that was registered has its command, report, parameters, refit and reference page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from docs.site_schemas import model_pages
from selector.cli import exit_status
from selector.diagnosis.open_model.refitting import refitted
from selector.diagnosis.open_model.runnable import OwnModel
from selector.physics import simulation_kind
from selector.readers import read
from selector.telling import simulated
from tests.simulations.spring_mass import SpringMassKind, account

TEXT = """
[model]
kind = "spring-mass"
name = "a table on its feet"
[oscillator]
mass_kg = 100.0
stiffness_n_per_m = 1.0e6
damping_ns_per_m = 2.0e3
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr(simulation_kind, "_registered", {})
    monkeypatch.setattr(simulated, "_tellers", {})
    simulated.register(SpringMassKind(), account)
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(TEXT, encoding="utf-8")
    return tmp_path


def test_it_has_a_command_with_json_a_screen_and_a_page(folder, capfd):
    line = ["simulate", "spring-mass", "model.toml", "--out", "run.csv", "--report", "page.html"]
    assert exit_status([*line, "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert (told["kind"], told["model"]["name"]) == ("spring-mass", "a table on its feet")
    # 100 N on 1 N/µm with ζ = 0.1: 100 µm and the overshoot exp(−π·ζ/√(1−ζ²)) of 73 %
    assert told["spring-mass"]["largest_um"]["run"] == pytest.approx(172.9, abs=0.1)
    assert told["spring-mass"]["comparison"] is None
    page = Path("page.html").read_text(encoding="utf-8")
    assert "The mass moves by up to 173 µm." in page
    assert "oscillator.stiffness_n_per_m" in page
    assert exit_status(line) == 0
    assert "Largest motion" in capfd.readouterr().out
    assert exit_status(["simulate", "--help"]) == 0
    assert "spring-mass" in capfd.readouterr().out


def test_recordings_drive_it_and_are_compared(folder, capfd):
    assert exit_status(["simulate", "spring-mass", "model.toml", "--out", "run.csv"]) == 0
    line = ["simulate", "spring-mass", "model.toml", "--inputs", "run.csv", "--machine", "run.machine.toml"]
    capfd.readouterr()
    assert exit_status([*line, "--out", "again", "--json"]) == 0
    (one,) = json.loads(capfd.readouterr().out)["spring-mass"]["comparison"]
    assert one["channel"] == "motion"
    assert one["relative"] < 1e-4


def test_its_parameters_are_fitted_to_recordings(folder, capfd):
    assert exit_status(["simulate", "spring-mass", "model.toml", "--out", "run.csv"]) == 0
    recording = read(["run.csv"], machine="run.machine.toml").recording
    kind = SpringMassKind()
    Path("softer.toml").write_text(TEXT.replace("1.0e6", "0.97e6"), encoding="utf-8")
    softer = OwnModel("spring-mass", kind.read(Path("softer.toml")), recording)
    assert list(softer.parameters) == [
        f"oscillator.{key}" for key in ("mass_kg", "stiffness_n_per_m", "damping_ns_per_m")
    ]
    found = refitted(softer, recording, responses=["motion"])
    assert found.values["oscillator.stiffness_n_per_m"] == pytest.approx(1.0e6, rel=1e-3)
    capfd.readouterr()
    line = ["diagnose", "run.csv", "--machine", "run.machine.toml", "--model", "softer.toml", "--json"]
    assert exit_status(line) == 0
    mode = next(one for one in json.loads(capfd.readouterr().out)["findings"] if one["id"] == "mode")
    assert "3 parameters refitted" in mode["statement"]


def test_slips_are_told_and_what_cannot_be_is_refused(folder, capfd):
    Path("grams.toml").write_text(TEXT.replace("100.0", "100000.5"), encoding="utf-8")
    assert exit_status(["simulate", "spring-mass", "grams.toml", "--out", "g.csv", "--json"]) == 0
    (said,) = json.loads(capfd.readouterr().out)["findings"]
    assert (said["id"], said["evidence"]["key"]) == ("unlikely-value", "oscillator.mass_kg")
    Path("bad.toml").write_text(TEXT.replace("mass_kg", "mas_kg"), encoding="utf-8")
    assert exit_status(["simulate", "spring-mass", "bad.toml", "--out", "b.csv"]) == 2
    assert "'mass_kg' perhaps" in capfd.readouterr().err


def test_it_has_a_reference_page(folder):
    page = model_pages()["model-spring-mass"]
    assert "| `stiffness_n_per_m` | number [N/m] | required | of the spring" in page
