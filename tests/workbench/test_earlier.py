"""An answer that was asked otherwise than the form asks now is told, in the words of the fields."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from selector.readers import Overrides
from selector.selection import Options
from selector.workbench.bench import Bench
from selector.workbench.commands import option_arguments, source_arguments
from selector.workbench.pages import simulation
from selector.workbench.parts import Task, differing_fields, made_since

FOLDER = Path("/study")


def select(options: Options, runs: tuple[str, ...] = ("r1.csv", "r2.csv"), overrides: Overrides | None = None):
    source = source_arguments(FOLDER, [FOLDER / run for run in runs], None, overrides or Overrides())
    return ("select", *source, *option_arguments(options), "--out", "selection")


def test_what_was_chosen_since_the_answer():
    then = select(Options(level=0.98, cost={"T1": 2.0}), overrides=Overrides(time_unit="min"))
    assert differing_fields(then, then) == []
    now = select(Options(level=0.9, max_sensors=3, responses=("Z",), memory=True, cost={"T1": 2.0}), ("r1.csv",))
    assert differing_fields(now, then) == [
        "Displacements to predict", "Memory: lagged temperatures and speed", "Most sensors in a set", "Unit of time",
        "λ", "the files",
    ]  # fmt: skip


@pytest.fixture
def answered(tmp_path):
    """A study folder in which a command has read a file and a folder, and written a sheet and then a table."""
    for number, name in enumerate(
        ["r1.csv", "simulation/s1.csv", "simulation", "diagnosis/report.html", "diagnosis/run.csv"]
    ):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        if path.suffix:
            path.write_text("t\n", encoding="utf-8")
        os.utime(path, ns=(number, number))
    command = ("diagnose", "r1.csv", "--simulation", "simulation", "--out", "diagnosis/run.csv")
    task = Task("diagnosis", "Diagnosis", lambda _: command, lambda _: "diagnosis", None)
    return lambda: made_since(Bench(tmp_path), task, command)


def test_what_a_command_has_written_itself_is_no_change(answered):
    assert answered() == []


@pytest.mark.parametrize("name", ["r1.csv", "simulation/s1.csv", "simulation/s2.csv"])
def test_a_file_that_was_read_and_replaced_or_came_into_a_folder_is_told(answered, tmp_path, name):
    (tmp_path / name).write_text("t\n1\n", encoding="utf-8")
    assert answered() == [Path(name).parts[0]]


def test_a_file_that_was_taken_out_of_a_folder_is_told(answered, tmp_path):
    (tmp_path / "simulation/s1.csv").unlink()
    assert answered() == ["simulation"]


def test_a_machine_whose_values_were_changed_once_more_is_told(tmp_path):
    bench = Bench(tmp_path)
    bench.choose_simulation(
        kind="thermal", model=next(at for at, name in bench.models("thermal").items() if name == "three-modes")
    )
    rows = simulation._rows(bench)
    name = next(iter(simulation._parameters(bench.simulation)))
    assert simulation._unwritten(bench) == []
    rows.choose({"value": {name: 1.25}})
    assert simulation._unwritten(bench) == []
    simulation._prepare(bench)
    assert simulation._unwritten(bench) == []
    rows.choose({"value": {name: 1.5}})
    assert simulation._unwritten(bench) == ["changed-three-modes.toml"]
