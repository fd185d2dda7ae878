"""A new machine with few runs and its sisters: where they help there is a model, and where they do not it is said."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.controllers.model_file import read_model
from selector.controllers.self_check import model_findings
from selector.fleet import read_fleet, sisters_in
from selector.readers import read
from selector.study.applied import applied
from tests.fleet.machines import changed, fleet_file, machine, sister

SISTERS = 7


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """Seven sisters, a new machine with one run and more that nobody sees, and machines that are none in some way."""
    root = tmp_path_factory.mktemp("fleet")
    for number in range(SISTERS):
        sister(root / f"s{number}", number)
    sister(root / "new", 100, n_runs=10)
    for run in range(2, 11):
        (root / "unseen").mkdir(exist_ok=True)
        (root / "new" / f"r{run}.csv").rename(root / "unseen" / f"r{run}.csv")
    changed(sister(root / "millimetres", 20), range(1, 5), _in_another_unit)
    changed(sister(root / "without-T1", 21), range(1, 5), lambda table: table.pop("T1 [degC]"))
    sister(root / "once", 22, n_runs=1)
    changed(sister(root / "broken-run", 23), range(2, 3), _gauge_knocked)
    (root / "nothing").mkdir()
    return root


def _in_another_unit(table):
    table["Z [um]"] *= 25.4


def _gauge_knocked(table):
    table.loc[table.index >= 20, "Z [um]"] += 30.0


def fleet_of(root, names, tmp_path, options="max_sensors = 3"):
    rows = "".join(f'{name} = "{root / name}"\n' for name in names)
    return fleet_file(tmp_path, f'[select]\nresponses = ["Z"]\n{options}\n[machines]\n{rows}')


def left_um(model, recordings):
    return applied(model, read(recordings))[0].overall["Z"].rmse_um


def test_sisters_help_with_one_run_and_what_is_no_sister_is_told(plant, tmp_path, capsys):
    odd = ["millimetres", "without-T1", "once", "broken-run", "nothing"]
    path = fleet_of(plant, [*(f"s{number}" for number in range(SISTERS)), *odd, "new"], tmp_path)
    out = tmp_path / "made" / "model.json"
    assert exit_status(["fleet", "sisters", str(path), "--machine", "new", "--json", "--out", str(out)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["schema"], told["verdict"], told["machine"], told["runs"]) == (
        "selector.fleet-sisters/1", "sisters", "new", ["r1"],
    )  # fmt: skip
    assert set(told["left_out"]) == {"without-T1", "once", "nothing"}
    assert "T1" in told["left_out"]["without-T1"]
    z = told["responses"]["Z"]
    assert "millimetres" in z["alone"]
    assert set(z["alone"]) <= {"millimetres", "broken-run"}
    assert z["distance"] < z["limit"]
    one = z["errors"]
    # the one in another unit is unlike the others, too, when it is left out
    assert one["machines"] in (SISTERS, SISTERS + 1)
    assert one["sisters_um"] < one["own_um"]
    model = read_model(out)
    assert not [finding for finding in model_findings(model) if finding.level == "error"]
    assert model.validation["Z"].method.startswith("leave-one-machine-out")
    assert model.validation["Z"].heldout_rmse_um == pytest.approx(one["sisters_um"], rel=0.2)
    assert {run.partition("/")[0] for run in model.provenance.data_sha256} >= {"new", "s0", "s6"}
    assert not any(run.startswith("millimetres") for run in model.provenance.data_sha256)
    # the drift that nobody measures is 0.8 µm by the end of a run, and the gauge has 0.2 µm
    assert left_um(model, [plant / "unseen"]) < 1.2
    # a fallback without each sensor is that of a whole model
    assert {one.without[0] for one in model.fallbacks} == {item.name for item in model.inputs}


def test_machines_that_share_nothing_are_no_sisters(tmp_path, capsys):
    for number in range(6):
        machine(tmp_path / f"m{number}", number)
    path = fleet_of(tmp_path, [f"m{number}" for number in range(6)], tmp_path)
    out = tmp_path / "model.json"
    older = '{"schema": "selector.model/1"}'
    out.write_text(older, encoding="utf-8")
    assert exit_status(["fleet", "sisters", str(path), "--machine", "m0", "--runs", "3", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "no model" in said
    assert not out.exists()
    # what is no longer true is not lost, and said
    assert (tmp_path / "model.json.old").read_text(encoding="utf-8") == older
    assert "model.json.old" in said


def test_a_machine_with_other_thermometers_has_no_sisters(plant, tmp_path):
    """What they have in common, the air of the hall, is no model of it."""
    folder = sister(tmp_path / "other", 51, n_runs=2)
    for path in folder.glob("*.csv"):
        path.write_text(re.sub(r"\bT([123])", r"K\1", path.read_text(encoding="utf-8")), encoding="utf-8")
    path = fleet_of(plant, [f"s{number}" for number in range(SISTERS)], tmp_path)
    path.write_text(path.read_text() + f'other = "{folder}"\n')
    answer, model = sisters_in(read_fleet(path), "other", 1)
    assert (answer.verdict, model) == ("none", None)
    assert all("K1, K2, K3" in answer.left_out[f"s{number}"] for number in range(SISTERS))


def test_a_machine_that_is_nothing_like_the_others_gets_no_model(plant, tmp_path):
    sister(tmp_path / "mirrored", 50, n_runs=2, gain=(-30.0, 20.0))
    path = fleet_of(plant, [f"s{number}" for number in range(SISTERS)], tmp_path)
    path.write_text(path.read_text() + f'mirrored = "{tmp_path / "mirrored"}"\n')
    answer, model = sisters_in(read_fleet(path), "mirrored", 1)
    assert (answer.verdict, model) == ("none", None)
    assert answer.responses["Z"].distance > answer.responses["Z"].limit


@pytest.mark.parametrize("n_others", [0, 1, 2])
def test_too_few_others_are_told(plant, tmp_path, n_others):
    path = fleet_of(plant, ["new", *(f"s{number}" for number in range(n_others))], tmp_path)
    answer, model = sisters_in(read_fleet(path), "new")
    assert (answer.verdict, answer.responses, model) == ("none", {}, None)
    assert str(n_others) in answer.because


def test_sisters_with_no_run_to_spare_prove_nothing(plant, tmp_path):
    sister(tmp_path / "long", 60, n_runs=4)
    path = fleet_of(plant, [f"s{number}" for number in range(3)], tmp_path)
    path.write_text(path.read_text() + f'long = "{tmp_path / "long"}"\n')
    answer, model = sisters_in(read_fleet(path), "long")
    assert (answer.verdict, model) == ("none", None)
    assert re.search(r"\b0 others .*\b4 runs", answer.because)


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (("--machine", "nobody"), "--machine"),
        (("--machine", "new", "--runs", "2"), "machine new"),
        (("--machine", "nothing"), "nothing"),
    ],
)
def test_what_cannot_be_done_ends_with_2(plant, tmp_path, capsys, arguments, where):
    path = fleet_of(plant, ["s0", "s1", "s2", "new", "nothing"], tmp_path)
    out = tmp_path / "model.json"
    assert exit_status(["fleet", "sisters", str(path), *arguments, "--out", str(out)]) == 2
    assert where in capsys.readouterr().err
    assert not out.exists()


def test_what_is_read_is_not_replaced_by_the_model(plant, tmp_path, capsys):
    path = fleet_of(plant, ["s0", "s1", "s2", "new"], tmp_path)
    before, recording = path.read_bytes(), plant / "s0" / "r1.csv"
    for out in (path, recording, plant / "s0", recording / "model.json"):
        assert exit_status(["fleet", "sisters", str(path), "--machine", "new", "--out", str(out)]) == 2
        assert "--out" in capsys.readouterr().err
    assert path.read_bytes() == before
    assert recording.read_bytes()[:1] != b"{"


def test_memory_is_shared(plant, tmp_path):
    path = fleet_of(plant, [*(f"s{number}" for number in range(4)), "new"], tmp_path, "max_sensors = 2\nmemory = true")
    answer, _ = sisters_in(read_fleet(path), "new")
    assert answer.shape is not None
    assert np.isfinite(answer.responses["Z"].errors["sisters_um"])


def test_the_table_of_a_sister_keeps_its_order_of_runs_by_clock(plant, tmp_path):
    """The first run is the oldest one by the clock, not by name."""
    folder = sister(tmp_path / "clocked", 70, n_runs=2)
    for number, day in ((1, 2), (2, 1)):
        table = pd.read_csv(folder / f"r{number}.csv")
        stamps = pd.Timestamp(f"2026-03-0{day} 08:00:00") + pd.to_timedelta(table.pop("t [s]"), unit="s")
        table.insert(0, "time", stamps.dt.strftime("%Y-%m-%d %H:%M:%S"))
        table.to_csv(folder / f"r{number}.csv", index=False)
    path = fleet_of(plant, ["s0"], tmp_path)
    path.write_text(path.read_text() + f'clocked = "{folder}"\n')
    assert sisters_in(read_fleet(path), "clocked", 1)[0].runs == ("r2",)
