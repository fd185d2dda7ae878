"""`selector diagnose --model` on the command line: what it writes can be simulated, what is no model is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from selector.cli import exit_status
from selector.physics.model_fields import model_file_text
from tests.diagnosis.ablated import AXIS, axis_recording, axis_without

MACHINE = """
[time]
column = "time_s"
unit = "s"
[channels.X_command]
role = "position_command"
unit = "m"
[channels.X_position]
role = "position"
unit = "m"
[channels.X_voltage]
role = "voltage"
unit = "V"
"""

# half as long as those of tests/diagnosis/test_modelled.py, which looks at how well sizes are found
WAYS = (([40.0, 10.0, 0.0], 9000.0), ([30.0, 0.0], 4000.0), ([35.0, 5.0, 20.0, 0.0], 7000.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("axis")
    recording = axis_recording(ways=WAYS)
    for run in recording.runs:
        table = recording.frame.loc[run]
        table.to_csv(path / f"{run}.csv", index_label="time_s", float_format="%.12g")
    (path / "machine.toml").write_text(MACHINE)
    (path / "without.toml").write_text(model_file_text(axis_without("coulomb_n")))
    (path / "whole.toml").write_text(model_file_text(AXIS))
    return path


def runs(folder):
    return [str(folder / f"r{k}.csv") for k in range(3)]


def test_the_improved_model_is_simulated_with_the_error_that_was_said(folder, capsys):
    machine = ["--machine", str(folder / "machine.toml")]
    model = ["--model", str(folder / "without.toml")]
    assert exit_status(["diagnose", *runs(folder), *machine, *model, "--out", str(folder / "out"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [effect["id"] for effect in said["effects"]] == ["drive.coulomb"]
    assert any(finding["id"] == "mode" for finding in said["findings"])
    improved, simulated = str(folder / "out" / "improved.toml"), folder / "simulated"
    command = ["simulate", "drive", improved, *(part for run in runs(folder) for part in ("--inputs", run))]
    assert exit_status([*command, *machine, "--out", str(simulated)]) == 0
    rows = np.genfromtxt(simulated / "r2.csv", delimiter=",", names=True)
    there = np.genfromtxt(folder / "r2.csv", delimiter=",", names=True)
    error = float(np.sqrt(np.mean((there["X_voltage"] - rows["X_voltage"]) ** 2)))
    # the file's own voltage noise of 0.02 V is drawn anew in what `simulate` writes: √2 of the error that was said
    assert error < 1.6 * said["fit"]["X_voltage"]["heldout"]["rmse_after"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--model", "without.toml", "--simulation", "r0.csv"], "one of them"),
        (["--model", "missing.toml"], "cannot be opened"),
        (["--model", "machine.toml"], "no kind of model"),
        (["--model", "r0.csv"], "functional mock-up unit"),
        (["--model", "without.toml", "--simulation-time-unit", "min"], "driven at the times of the recordings"),
    ],
)
def test_what_is_no_model_is_refused(folder, capsys, options, words):
    command = [str(folder / one) if "." in one and not one.startswith("--") else one for one in options]
    assert exit_status(["diagnose", *runs(folder), "--machine", str(folder / "machine.toml"), *command]) == 2
    assert words in capsys.readouterr().err
