"""A recording without a unit of time: what select is told, export and apply are told too; a guess is no statement."""

from __future__ import annotations

import json

import pytest

from selector.cli import exit_status
from selector.readers import Overrides, read
from selector.workbench.bench import Bench
from selector.workbench.commands import Export, export_command
from selector.workbench.readable import corrected, rows_of
from tests.selection.machines import PERIOD_S, machine

MEMORY = ["--memory", "--max-sensors", "2", "--never", "T1", "--never", "T4"]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Recordings in minutes of which no header says so, and a model with memory that was fitted as such."""
    folder = tmp_path_factory.mktemp("minutes")
    source = machine(n_runs=5, n=120)
    files = []
    for run in source.runs:
        frame = source.frame.xs(run, level="run")
        frame.index = frame.index / 60.0
        frame.index.name = "t"
        files.append(folder / f"{run}.csv")
        frame.to_csv(files[-1])
    names = [str(file) for file in files]
    assert exit_status(["select", *names, *MEMORY, "--time-unit", "min", "--out", str(folder / "selection")]) == 0
    return folder, files


def told(capsys, *words):
    capsys.readouterr()
    assert exit_status([*map(str, words), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def of_clock(said):
    return [(finding["level"], finding["id"]) for finding in said["findings"] if finding["id"] == "other-sampling"]


def test_the_model_says_how_it_was_sampled(study):
    folder, _ = study
    model = json.loads((folder / "selection" / "model.json").read_text(encoding="utf-8"))
    assert model["provenance"]["period_s"] == pytest.approx(PERIOD_S)
    assert model["states"]


def test_a_wrong_clock_is_an_error_and_the_options_of_reading_mend_it(study, tmp_path, capsys):
    folder, files = study
    model = folder / "selection" / "model.json"
    replay = ["export", model, "--for", "python", "--out", tmp_path / "out", "--replay", files[0]]
    assert of_clock(told(capsys, *replay)) == [("error", "other-sampling")]
    assert of_clock(told(capsys, "apply", model, files[0])) == [("error", "other-sampling")]
    assert of_clock(told(capsys, *replay, "--time-unit", "min")) == []
    assert of_clock(told(capsys, "apply", model, files[0], "--time-unit", "min")) == []


def test_a_guess_of_the_workbench_does_not_become_a_statement(study, tmp_path):
    _, files = study
    bench = Bench(tmp_path)
    bench.use(files)
    for file in files:
        bench.add(file)
    while bench.is_reading:
        pass
    reading = bench.inspection.reading
    bench.correct(corrected(reading, rows_of(reading)))
    text = (tmp_path / "machine.toml").read_text(encoding="utf-8")
    assert '\n# unit = "s"  # a guess' in text
    again = read(files[:1], machine=tmp_path / "machine.toml")
    assert "time-unit-guessed" in {finding.id for finding in again.findings}
    # what a person said is written, and read so without the option
    bench.read_as(Overrides(time_unit="min"))
    while bench.is_reading:
        pass
    reading = bench.inspection.reading
    bench.correct(corrected(reading, rows_of(reading)))
    again = read(files[:1], machine=tmp_path / "machine.toml")
    assert again.runs[0].period_s == pytest.approx(PERIOD_S)
    assert "time-unit-guessed" not in {finding.id for finding in again.findings}
    asked = export_command(tmp_path, Export("m.json", replayed=(files[0],)), bench.machine, bench.overrides)
    assert asked[-4:] == ("--machine", "machine.toml", "--time-unit", "min")
    bench.jobs.close()


def test_describe_writes_a_guess_as_a_comment(study, tmp_path, capsys):
    _, files = study
    told(capsys, "describe", *files, "--write", tmp_path / "m.toml")
    assert '\n# unit = "s"  # a guess' in (tmp_path / "m.toml").read_text(encoding="utf-8")
    ambiguous = tmp_path / "ambiguous.csv"
    ambiguous.write_text("time,T1\n00:00,20\n00:10,21\n00:20,22\n00:30,23\n", encoding="utf-8")
    told(capsys, "describe", ambiguous, "--write", tmp_path / "a.toml")
    assert "\nunit" not in (tmp_path / "a.toml").read_text(encoding="utf-8").split("[channels")[0]
    found = {finding.id for finding in read([ambiguous], machine=tmp_path / "a.toml").findings}
    assert "ambiguous-time" in found


def test_runs_in_several_units_of_time_keep_those_of_their_headers(tmp_path, capsys):
    for name, header, step in (("r1", "t [min]", 1), ("r2", "t [s]", 60)):
        rows = "".join(f"{k * step},{20 + k}\n" for k in range(20))
        (tmp_path / f"{name}.csv").write_text(f"{header},T1 [°C]\n{rows}", encoding="utf-8")
    files = [tmp_path / "r1.csv", tmp_path / "r2.csv"]
    told(capsys, "describe", *files, "--write", tmp_path / "m.toml")
    assert [run.period_s for run in read(files, machine=tmp_path / "m.toml").runs] == [60.0, 60.0]
