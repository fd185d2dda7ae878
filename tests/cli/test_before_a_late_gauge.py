"""A machine that remembers and a gauge that begins late: what `select` proved is found again by all that check it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.controllers.application import apply_model, known_starts, sensor_starts, without_displacement_faults
from selector.controllers.from_selection import model_file_of
from selector.controllers.replay.replayed import replayed
from selector.controllers.writers.targets import TARGETS
from selector.fleet import Processes, read_fleet, run_fleet, sisters_in, watch_fleet
from selector.readers import read
from selector.recording import Recording
from selector.selection import Options, select
from selector.study.applied import applied
from tests.fleet.machines import fleet_file
from tests.selection.machines import linear, machine

LATE, GAUGED = 200, 300
SISTERS = 8


def remembering(
    folder: Path, seed: int, n_runs: int, first: int = 0, *, knows_before: bool = True, tau_s: float = 9000.0
) -> Path:
    """Recordings of a machine with a hidden body, its gauge zeroed late; `knows_before`: the thermometers were on."""
    gain = -12.0 * (1.0 + 0.05 * np.random.default_rng(seed).normal())
    whole = machine(
        lambda truth: linear(truth) + gain * truth["hidden"],
        n_runs=first + n_runs, n=LATE + GAUGED, seed=seed, tau_hidden_s=tau_s,
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    for run in whole.runs[first:]:
        table = pd.DataFrame(whole.values(run, whole.names), whole.time_s(run), whole.names)
        table["Z"] -= table["Z"].iloc[LATE : LATE + 3].mean()
        table.loc[table.index[:LATE], "Z"] = np.nan
        table = (table if knows_before else table.iloc[LATE:])[["T1", "T4", "T6", "Z"]]
        table.columns = [f"{name} [{'um' if name == 'Z' else 'degC'}]" for name in table.columns]
        table.rename_axis("t [s]").to_csv(folder / f"{run}.csv")
    return folder


@pytest.fixture(scope="module")
def studied(tmp_path_factory) -> tuple[Path, dict]:
    """A folder with recordings and the answer that `select --memory` gives on them."""
    folder = tmp_path_factory.mktemp("late")
    remembering(folder / "runs", 0, 4)
    words = ["select", folder / "runs", "--response", "Z", "--memory", "--max-sensors", 2, "--out", folder / "out"]
    assert exit_status([str(word) for word in words]) == 0
    return folder, json.loads((folder / "out" / "selection.json").read_text(encoding="utf-8"))


def answer(capsys, *words: str | Path) -> dict:
    capsys.readouterr()
    assert exit_status([*map(str, words), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_apply_leaves_what_the_fit_left(studied, tmp_path, capsys):
    folder, selection = studied
    fitted = selection["models"]["Z"]["per_run"]
    model = folder / "out" / "model.json"
    found = answer(capsys, "apply", model, folder / "runs")
    for run, left in found["per_run"].items():
        assert left["Z"]["rmse_um"] == pytest.approx(fitted[run]["rmse_um"], rel=1e-9)
    told = [one for one in found["findings"] if one["id"] == "gauge-begins-late"]
    assert [one["where"]["run"] for one in told] == list(fitted)
    assert all("compared from 6000 s on" in one["statement"] and one["level"] == "info" for one in told)
    # without the readings before, the same model is far off
    remembering(tmp_path / "cut", 0, 4, knows_before=False)
    cut = answer(capsys, "apply", model, tmp_path / "cut")
    assert cut["overall"]["Z"]["rmse_um"] > 3.0 * found["overall"]["Z"]["rmse_um"]


@pytest.mark.parametrize("target", ["python", "st", "klipper"])
def test_a_program_leaves_what_apply_leaves(studied, tmp_path, capsys, target):
    folder, _ = studied
    model = folder / "out" / "model.json"
    found = answer(capsys, "apply", model, folder / "runs")
    words = ["export", model, "--for", target, "--out", tmp_path / target, "--replay", folder / "runs"]
    exported = answer(capsys, *words)["replay"]
    assert exported["max_abs_difference_um"] == 0.0
    for one in exported["runs"]:
        alone = found["per_run"][one["run"]]["Z"]
        assert (one["apply_rmse_um"], one["before_rmse_um"]) == (alone["rmse_um"], alone["before_rmse_um"])
        assert one["program_rmse_um"] == pytest.approx(alone["rmse_um"], rel=0.05)
        assert one["because"] == []
    # the faults are rehearsed while the gauge reads, at half of its time
    assert {one["from_s"] for one in exported["rehearsal"]} == {4500.0}
    healthy = {one["healthy_rmse_um"] for one in exported["rehearsal"] if one["fault"] == "dead"}
    assert max(healthy) < 2.0 * found["overall"]["Z"]["rmse_um"]


def test_adapt_counts_the_same_errors(studied, capsys):
    folder, _ = studied
    model = folder / "out" / "model.json"
    alone = answer(capsys, "apply", model, folder / "runs")["per_run"]
    adapted = answer(capsys, "adapt", model, folder / "runs", "--every", "1h")["per_run"]
    assert {run: of["Z"]["without_rmse_um"] for run, of in adapted.items()} == {
        run: pytest.approx(of["Z"]["rmse_um"], rel=1e-9) for run, of in alone.items()
    }


def test_a_program_that_was_on_before_the_gauge_has_the_range_for_it(studied):
    folder, _ = studied
    source = read([folder / "runs"]).recording
    found = select(source, Options(max_sensors=2, memory=True, responses=("Z",)))
    left = {}
    for knows, given in ((True, source), (False, None)):
        model = model_file_of(found, source.channels, source=given)
        compared, _ = without_displacement_faults(model, source)
        files = TARGETS["python"].write(model, is_sign_verified=False).files
        proof = replayed(model, files, compared, TARGETS["python"].parts)
        left[knows] = max(run.accuracy["Z"].rmse_um for run in proof.runs)
        beyond = [one.share_of_samples for run in proof.runs for one in run.beyond_valid]
        assert (max(beyond, default=0.0) < 0.01) == knows
    assert left[True] < 0.2 * left[False]


@pytest.mark.parametrize("dead_runs", [1, 4])
def test_a_sensor_that_dies_when_the_gauge_begins_is_told_and_replayed(studied, tmp_path, capsys, dead_runs):
    folder, _ = studied
    sensor = json.loads((folder / "out" / "model.json").read_text(encoding="utf-8"))["inputs"][0]["name"]
    for k, path in enumerate(sorted((folder / "runs").glob("*.csv"))):
        table = pd.read_csv(path)
        table.loc[LATE:, f"{sensor} [degC]"] = np.nan if k < dead_runs else table[f"{sensor} [degC]"]
        table.to_csv(tmp_path / path.name, index=False)
    words = ["export", folder / "out" / "model.json", "--for", "klipper", "--out", tmp_path / "out"]
    exported = answer(capsys, *words, "--replay", tmp_path)
    left = {one["run"]: one["apply_rmse_um"] for one in exported["replay"]["runs"]}
    dead = [run for run, rmse_um in left.items() if rmse_um is None]
    assert len(dead) == dead_runs
    told = {one["where"]["run"] for one in exported["findings"] if one["id"] == "not-the-whole-model"}
    assert set(dead) <= told


def test_what_a_loose_sensor_read_long_before_the_gauge_makes_no_clamp(tmp_path):
    source = read([remembering(tmp_path, 0, 4, tau_s=600.0)]).recording
    tables = {
        run: pd.DataFrame(source.values(run, source.names), source.time_s(run), source.names) for run in source.runs
    }
    recorded_um = max(float(table["Z"].abs().max()) for table in tables.values())
    gauged = pd.concat([table["T1"].iloc[LATE:] for table in tables.values()])
    # over by the time the gauge begins, seven time constants later, so that no error shows it
    tables[source.runs[1]].iloc[2:60, source.names.index("T1")] += 120.0 * np.sin(np.linspace(0.0, np.pi, 58))
    loose = Recording.from_runs(tables, source.channels)
    model = model_file_of(
        select(loose, Options(max_sensors=2, memory=True, responses=("Z",))), loose.channels, source=loose
    )
    assert model.states
    (limits,) = model.guard.limits
    assert limits.clamp_um <= np.ceil(2.0 * recorded_um)
    t1 = next(one for one in model.inputs if one.name == "T1")
    assert t1.valid_max <= float(np.ptp(gauged)) + 30.0


def test_gauges_that_never_begin_together_are_not_compared(studied):
    folder, _ = studied
    source = read([folder / "runs"]).recording
    tables = {
        run: pd.DataFrame(source.values(run, source.names), source.time_s(run), source.names) for run in source.runs
    }
    found = select(source, Options(max_sensors=2, memory=True, responses=("Z",)))
    model = model_file_of(found, source.channels, source=source)
    first = source.runs[0]
    other = model.outputs[0].model_copy(update={"name": "X", "axis": "X"})
    both = model.model_copy(update={"outputs": (*model.outputs, other)})
    for run, table in tables.items():
        table["X"] = table["Z"]
        if run == first:
            table["X"] = np.where(np.arange(len(table)) < 30, table["T1"] - 20.0, np.nan)
    x = source.channel("Z").__class__("X", "displacement", "um", axis="X")
    compared, told = without_displacement_faults(both, Recording.from_runs(tables, (*source.channels, x)))
    (odd,) = [one for one in told if one.id == "gauge-begins-late" and one.level == "warning"]
    assert (odd.where.run, odd.where.channel) == (first, "Z")
    applied_to = apply_model(both, compared, known_starts(sensor_starts(both, compared)))
    assert applied_to.per_run[first]["Z"].rmse_um is None
    assert applied_to.per_run[source.runs[1]]["Z"].rmse_um < 1.0


def test_watch_finds_a_model_true_on_runs_with_a_late_gauge(tmp_path):
    remembering(tmp_path / "m", 0, 6)
    fleet = read_fleet(
        fleet_file(tmp_path, '[select]\nresponses = ["Z"]\nmemory = true\nmax_sensors = 2\n[machines]\nm = "m"\n')
    )
    assert run_fleet(fleet, Processes(1)).done == 1
    remembering(tmp_path / "m", 0, 5, first=6)
    one = watch_fleet(fleet).machines["m"]
    assert one.status == "quiet"
    z = one.responses["Z"]
    assert z.runs == 5
    assert z.rmse_um == pytest.approx(z.expected_um, rel=0.5)
    refit = run_fleet(fleet, Processes(1), refit=True).machines["m"].refit
    assert refit is not None
    assert refit.champion_rmse_um["Z"] == pytest.approx(z.rmse_um, rel=0.3)


def test_sisters_know_what_went_before_the_gauge(tmp_path):
    errors, left = {}, {}
    for knows in (True, False):
        root = tmp_path / str(knows)
        names = [*(f"s{k}" for k in range(SISTERS)), "new"]
        for k, name in enumerate(names):
            remembering(root / name, 40 + k, 1 if name == "new" else 4, knows_before=knows)
        rows = "".join(f'{name} = "{root / name}"\n' for name in names)
        text = f'[select]\nresponses = ["Z"]\nmemory = true\nmax_sensors = 2\n[machines]\n{rows}'
        found, model = sisters_in(read_fleet(fleet_file(root, text)), "new")
        errors[knows] = found.responses["Z"].errors
        if knows:
            assert model is not None
            remembering(root / "unseen", 40 + SISTERS, 4, first=1)
            left = applied(model, read([root / "unseen"]))[0].overall["Z"].rmse_um
            assert left < 2.0 * errors[knows]["sisters_um"]
    assert errors[True]["sisters_um"] < 0.5 * errors[False]["sisters_um"]
