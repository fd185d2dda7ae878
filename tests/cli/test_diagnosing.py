"""`selector diagnose` from the command line: how recordings and simulation come together, and what cannot be used."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from selector.cli import exit_status
from selector.diagnosis import workflow
from selector.diagnosis.answer import Diagnosis, Errors, Fit, NamedEffect, Place
from selector.diagnosis.effects.effect import Quantity

MACHINE = """
[time]
column = "t"
unit = "min"
[channels.T1]
role = "temperature"
unit = "degC"
[channels.Z]
role = "displacement"
unit = "um"
axis = "Z"
[channels.Y]
role = "displacement"
unit = "um"
axis = "Y"
"""
N = 150


def courses(seed, n=N):
    random = np.random.default_rng(seed)
    t = np.arange(n, dtype=float)
    heat = 1 - np.exp(-t / 40.0)
    simulated = {"Z": 20 * heat, "Y": 6 * heat}
    recorded = {"T1": 20 + 8 * heat} | {k: v + random.normal(scale=0.4, size=n) for k, v in simulated.items()}
    return t, {k: np.round(v, 2) for k, v in recorded.items()}, {k: np.round(v, 4) for k, v in simulated.items()}


def write(path, header, columns, *, separator=",", decimal="."):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = (
        separator.join("" if not math.isfinite(v) else f"{v:.10g}".replace(".", decimal) for v in row)
        for row in zip(*columns, strict=True)
    )
    path.write_text("\n".join([separator.join(header), *rows, ""]), encoding="utf-8")


@pytest.fixture
def folder(tmp_path):
    for k, run in enumerate(("r1", "r2", "r3")):
        t, recorded, simulated = courses(k)
        write(tmp_path / f"{run}.csv", ["t", *recorded], [t, *recorded.values()])
        write(tmp_path / "sim" / f"{run}.csv", ["t", *simulated], [t, *simulated.values()])
    (tmp_path / "machine.toml").write_text(MACHINE, encoding="utf-8")
    return tmp_path


@pytest.fixture
def seen(monkeypatch):
    """Comparisons that reach the workflow, which answers at once."""
    comparisons = []

    def answered(comparison, *, seed, false_alarm, progress):
        comparisons.append(comparison)
        progress(0, 2, "testing")
        names = comparison.responses
        zero = np.zeros(len(comparison.time_s))
        errors = Errors(1.0, 0.5, 0.4)
        fit = {name: Fit("um", errors, errors, 0.9, None, None, zero, zero, zero) for name in names}
        effect = NamedEffect(
            "thermal.memory", names[0], "column", "Z follows past heating.", {"tau_s": Quantity(2400.0, "s")}, 0.97,
            1e-6, 0.8, ("thermal.ambient",), "warm up and let it cool",
        )  # fmt: skip
        return Diagnosis(
            comparison, "missing-physics", "", (Place(names[0], "column", "r2", 60.0, 120.0, "T1 > 22 degC", 0.8),),
            (effect,), fit, (), (), (), {}, comparison.findings, seed,
        )  # fmt: skip

    monkeypatch.setattr(workflow, "diagnosis", answered)
    return comparisons


def command(folder, *more, runs=("r1", "r2", "r3"), simulation=None):
    files = [str(folder / f"{run}.csv") for run in runs]
    sim = [] if simulation == [] else ["--simulation", str(simulation or folder / "sim")]
    return ["diagnose", *files, "--machine", str(folder / "machine.toml"), *sim, *more]


def refused(capsys, arguments):
    """The message of a command line that ends with exit code 2."""
    assert exit_status(arguments) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "Traceback" not in said.err
    for part in ("Where:", "Expected:", "What to do:"):
        assert part in said.err
    return said.err


def test_the_contract_and_the_screen(folder, seen, capsys):
    assert exit_status(command(folder, "--json", "--seed", "4")) == 0
    said = capsys.readouterr()
    answer = json.loads(said.out)
    assert answer["schema"] == "selector.diagnosis/1"
    assert set(answer) >= {"verdict", "where", "effects", "fit", "findings"}
    assert set(answer["fit"]) == {"Z", "Y"}
    comparison = seen[0]
    assert comparison.runs == ("r1", "r2", "r3")
    assert comparison.held_out.sum() == N
    assert exit_status(command(folder, "--all")) == 0
    shown = capsys.readouterr().out
    for part in (
        "leaves out memory",
        "Memory of past heating",
        "97 % sure",
        "the hall temperature",
        "T1 > 22 °C",
        "Root mean square",
    ):
        assert part in shown


def test_results_are_written_whole_or_not_at_all(folder, seen, capsys, monkeypatch):
    out = folder / "answer"
    assert exit_status(command(folder, "--out", str(out), "--json")) == 0
    said = capsys.readouterr()
    assert json.loads((out / "diagnosis.json").read_text(encoding="utf-8")) == json.loads(said.out)
    monkeypatch.setattr(workflow, "diagnosis", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
    other = folder / "stopped"
    assert exit_status(command(folder, "--out", str(other))) == 130
    assert "stopped" in capsys.readouterr().err
    assert not other.exists()
    assert not list(folder.glob(".*.part"))


def test_files_one_by_one_and_one_response(folder, seen):
    sims = [part for run in ("r1", "r3") for part in ("--simulation", str(folder / "sim" / f"{run}.csv"))]
    assert exit_status(command(folder, *sims, "--response", "Y", "--holdout", "0.2", simulation=[])) == 0
    comparison = seen[0]
    assert comparison.responses == ("Y",)
    assert comparison.runs == ("r1", "r3")
    # a fifth of 150 rows of two runs, to within a row of each
    assert abs(comparison.held_out.sum() - 60) <= 2
    assert [f.where.run for f in comparison.findings if f.id == "run-not-compared"] == ["r2"]


@pytest.mark.parametrize(
    ("header", "factor"),
    [("t", 1.0), ("time [s]", 60.0), ("time_s", 60.0), ("t", 60.0), ("Zeit [h]", 1 / 60), ("t", 1 / 60)],
)
def test_other_clocks_and_grids(folder, seen, header, factor):
    for k, run in enumerate(("r1", "r2", "r3")):
        t, _, simulated = courses(k)
        fine = np.linspace(0.0, t[-1], 2 * N + 37)
        columns = [fine * factor, *(np.interp(fine, t, v) for v in simulated.values())]
        write(folder / "sim" / f"{run}.csv", [header, *simulated], columns, separator=";", decimal=",")
    assert exit_status(command(folder)) == 0
    comparison = seen[0]
    for name in ("Z", "Y"):
        course = np.concatenate([courses(k)[2][name] for k in range(3)])
        # twice as fine: what a line loses at the steepest place is 20/40²/8/4 µm
        assert np.nanmax(np.abs(comparison.simulated[name] - course)) < 0.02
        assert np.isfinite(comparison.simulated[name]).mean() > 0.99


def test_a_unit_of_time_that_is_told(folder, seen):
    for run in ("r1", "r2", "r3"):
        t, _, simulated = courses(0)
        half = slice(0, 80)
        write(folder / "sim" / f"{run}.csv", ["t", *simulated], [60 * t[half], *(v[half] for v in simulated.values())])
    assert exit_status(command(folder, "--simulation-time-unit", "s")) == 0
    assert np.isfinite(seen[0].simulated["Z"][:N]).sum() == 80


def test_columns_of_the_machine_file(folder, seen):
    (folder / "machine.toml").write_text(
        MACHINE.replace("[channels.Z]", '[channels.Z]\ncolumn = "D7"'), encoding="utf-8"
    )
    for run in ("r1", "r2", "r3"):
        for path in (folder / f"{run}.csv", folder / "sim" / f"{run}.csv"):
            path.write_text(path.read_text(encoding="utf-8").replace("Z", "D7", 1), encoding="utf-8")
    assert exit_status(command(folder)) == 0
    assert seen[0].responses == ("Z", "Y")


def test_without_a_machine_file(folder, seen):
    for run in ("r1", "r2", "r3"):
        for path in (folder / f"{run}.csv", folder / "sim" / f"{run}.csv"):
            text = path.read_text(encoding="utf-8").replace("t,", "t [min],", 1).replace("Z,Y", "Z [um],Y [um]", 1)
            path.write_text(text, encoding="utf-8")
    arguments = [part for part in command(folder) if part != "--machine" and not part.endswith(".toml")]
    assert exit_status(arguments) == 0
    assert seen[0].responses == ("Z", "Y")


def test_what_cannot_be_compared(folder, seen, capsys):
    assert "--simulation" in refused(capsys, command(folder, simulation=[]))
    assert "nowhere" in refused(capsys, command(folder, simulation=folder / "nowhere"))
    assert "--response" in refused(capsys, command(folder, "--response", "T1"))
    assert "--response" in refused(capsys, command(folder, "--response", "Q"))
    assert "--holdout" in refused(capsys, command(folder, "--holdout", "r9"))
    assert "--false-alarm" in refused(capsys, command(folder, "--false-alarm", "0"))
    assert "--false-alarm" in refused(capsys, command(folder, "--false-alarm", "nan"))
    assert "--seed" in refused(capsys, command(folder, "--seed", "-1"))
    for run in ("r1", "r2", "r3"):
        (folder / "sim" / f"{run}.csv").rename(folder / "sim" / f"other_{run}.csv")
    assert "other_r1" in refused(capsys, command(folder))
    assert seen == []


def rewritten(folder, change):
    for k, run in enumerate(("r1", "r2", "r3")):
        t, recorded, simulated = courses(k)
        header, columns = change(t, recorded, simulated)
        write(folder / "sim" / f"{run}.csv", header, columns)


@pytest.mark.parametrize(
    "change",
    [
        lambda t, _, s: (["t", "Q"], [t, s["Z"]]),
        lambda t, _, s: (["t", "Z", "Y"], [t, s["Z"] * math.nan, s["Y"] * math.nan]),
        lambda t, _, s: (["t", "Z", "Y"], [t + 1e5, s["Z"], s["Y"]]),
        lambda t, _, s: (["t", "Z"], [t, s["Z"] / 1000.0]),
        lambda t, _, s: (["t", "Z"], [t[:15], s["Z"][:15]]),
    ],
    ids=["no common channel", "only missing values", "no overlap", "another unit", "15 samples"],
)
def test_simulations_that_are_no_basis(folder, seen, capsys, change):
    rewritten(folder, change)
    refused(capsys, command(folder, "--json", *(["--holdout", "r3"])))
    assert seen == []


def test_one_run_of_twenty_samples(folder, seen, capsys):
    t, recorded, _ = courses(0)
    write(folder / "r1.csv", ["t", *recorded], [t[:20], *(v[:20] for v in recorded.values())])
    assert "samples" in refused(capsys, command(folder, runs=("r1",)))


def test_recorded_channels_full_of_holes(folder, seen, capsys):
    for k, run in enumerate(("r1", "r2", "r3")):
        t, recorded, _ = courses(k)
        recorded["Y"] = recorded["Y"] * math.nan
        recorded["Z"][::3] = math.nan
        write(folder / f"{run}.csv", ["t", *recorded], [t, *recorded.values()])
    assert exit_status(command(folder, "--json")) == 0
    assert seen[0].responses == ("Z",)
    found = json.loads(capsys.readouterr().out)["findings"]
    assert any(f["id"] == "not-compared" and f["where"]["channel"] == "Y" for f in found)


def test_a_copy_of_the_recording_names_nothing(folder, capsys):
    for run in ("r1", "r2", "r3"):
        (folder / "sim" / f"{run}.csv").write_text(
            (folder / f"{run}.csv").read_text(encoding="utf-8"), encoding="utf-8"
        )
    assert exit_status(command(folder, "--json", "--response", "Z")) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"] == "nothing-missing"
    assert answer["effects"] == []
    assert "simulation-is-recording" in [f["id"] for f in answer["findings"]]


def test_the_whole_way_with_an_honest_simulation(folder, capsys):
    # with 2 % false alarms one draw of noise in fifty has structure: here that of seed 0
    assert exit_status(command(folder, "--json", "--seed", "1")) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"] == "nothing-missing"
    assert answer["effects"] == []
    # 0.4 µm of noise in 150 rows: its standard deviation is known to 6 %
    assert answer["fit"]["Z"]["heldout"]["rmse_before"] == pytest.approx(0.4, rel=0.2)
