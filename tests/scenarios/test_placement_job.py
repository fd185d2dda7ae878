"""Placement before drilling, whole: candidates → simulated runs → places kept → error on a run of another kind.

With fewer candidates and shorter runs what docs/how-to/place-sensors-before-drilling.md shows.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from selector import figures
from selector.cli import exit_status
from selector.physics.thermal.field import machine_outline
from selector.readers import read
from selector.selection.result_file import selection_of

ROOT = Path(__file__).resolve().parents[2]
CYCLES = {
    "steps": [(0, 1500), (3600, 2000), (7200, 2500), (10800, 3000), (14400, 3000)],
    "heating": [(0, 2500), (9000, 0), (14400, 0)],
    "pieces": [(t, 3000 if t % 2700 == 0 else 0) for t in range(0, 14400, 900) if t % 2700 != 900] + [(14400, 0)],
    "slow": [(0, 800), (5400, 1600), (9000, 400), (14400, 400)],
    # another kind: nothing else falls and rises again
    "unseen": [(0, 2800), (3600, 600), (7200, 2200), (10800, 1000), (14400, 1000)],
}


def said(capfd, *arguments: str) -> dict:
    """The JSON of a command."""
    capfd.readouterr()
    code = exit_status([*arguments, "--json"])
    out, err = capfd.readouterr()
    assert code == 0, err
    return json.loads(out, parse_constant=pytest.fail)


def test_places_chosen_on_simulated_runs_serve_a_run_of_another_kind(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    model = (ROOT / "fixtures" / "thermal" / "candidates.toml").read_text(encoding="utf-8")
    Path("model.toml").write_text(model.replace("spacing_m = 0.3", "spacing_m = 0.5"), encoding="utf-8")
    for number, (name, steps) in enumerate(CYCLES.items()):
        rows = "".join(f"{t},{speed}\n" for t, speed in steps)
        Path(f"{name}-cycle.csv").write_text(f"time_s,spindle_speed\n{rows}", encoding="utf-8")
        cycle = ["--cycle", f"{name}-cycle.csv", "--seed", str(number)]
        shown = said(capfd, "simulate", "thermal", "model.toml", *cycle, "--out", f"{name}.csv")
        assert shown["findings"] == []
    candidates = [c["name"] for c in shown["channels"] if c["role"] == "temperature"]
    assert len(candidates) > 20
    machine = ["--machine", "unseen.machine.toml"]
    learnt = [f"{name}.csv" for name in CYCLES if name != "unseen"]
    study = said(
        capfd, "select", *learnt, *machine, "--response", "Z", "--response", "Y", "--max-sensors", "3", "--out", "study"
    )
    kept = study["chosen"]["sensors"]
    assert len(kept) <= 3
    assert set(kept) <= {*candidates, "ambient"}
    applied = said(capfd, "apply", "study/model.json", "unseen.csv", *machine)["overall"]
    for response in ("Z", "Y"):
        # 8 % and 5 % with these seeds; three places drawn by lot leave 18 % of Z in the median (bench_placement)
        assert applied[response]["rmse_um"] < 0.12 * applied[response]["before_rmse_um"]
    assert "sensors sit" in Path("study/report.html").read_text(encoding="utf-8")

    selection = selection_of(json.loads(Path("study/selection.json").read_text(encoding="utf-8")))
    recording = read([Path("unseen.csv")], machine=Path("unseen.machine.toml")).recording
    places = {channel.name: channel.xyz_m for channel in recording.channels if channel.xyz_m is not None}
    assert set(candidates) <= set(places)
    assert figures.sensor_places(selection, places, machine_outline()).data
