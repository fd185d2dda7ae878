"""A model that is in use stays until one that learnt from later runs is better in still later ones."""

import json

import pytest

from selector.cli import exit_status
from selector.fleet import Processes, read_answer, read_fleet, run_fleet
from tests.fleet.machines import changed, fleet_file, machine

PROVED, ALL = 6, 16


@pytest.fixture
def fleet(tmp_path):
    """A machine with a model of six runs, ten more runs of the same machine, and a second machine without new ones."""
    machine(tmp_path / "m", 1, n_runs=PROVED)
    machine(tmp_path / "still", 2, n_runs=PROVED)
    asked = read_fleet(fleet_file(tmp_path, '[machines]\nm = "m"\nstill = "still"\n'))
    assert run_fleet(asked, Processes(1)).done == 2
    machine(tmp_path / "m", 1, n_runs=ALL)
    return asked


def gauge_turned(table):
    table["Z [um]"] *= 1.5


def test_where_nothing_changed_the_model_stays(fleet):
    before = read_answer(fleet.results).machines
    answer = run_fleet(fleet, Processes(1), refit=True)
    one = answer.machines["m"]
    assert (answer.reused, answer.done, answer.failed) == (2, 0, 0)
    assert (one.key, one.sensors) == (before["m"].key, before["m"].sensors)
    assert not one.refit.promoted
    # of ten later runs the newest five are for the comparison
    assert one.refit.runs == tuple(f"r{number}" for number in range(12, 17))
    assert one.refit.champion_rmse_um["Z"] == pytest.approx(one.refit.challenger_rmse_um["Z"], rel=0.3)
    assert answer.machines["still"].refit.because == "0 recordings came after it, and 5 are needed"


def test_a_machine_that_has_changed_gets_a_new_model(fleet):
    changed(fleet.place.parent / "m", range(PROVED + 1, ALL + 1), gauge_turned)
    before = read_answer(fleet.results).machines["m"]
    told = []
    one = run_fleet(fleet, Processes(1), lambda *what: told.append(what), refit=True).machines["m"]
    assert one.refit.promoted
    assert one.status == "done"
    assert one.key == one.refit.challenger != before.key
    assert one.refit.challenger_rmse_um["Z"] < 0.8 * one.refit.champion_rmse_um["Z"]
    assert one.refit.least_fall > 0.0
    assert [done for *_, done, _ in told] == [1, 2]
    # it is the one in use from now on
    assert read_answer(fleet.results).machines["m"].key == one.key
    again = run_fleet(fleet, Processes(1), refit=True).machines["m"]
    assert again.key == one.key


def test_the_newest_runs_are_those_of_the_clock_and_of_the_challenger_none(fleet):
    changed(fleet.place.parent / "m", range(PROVED + 1, ALL + 1), gauge_turned)
    refit = run_fleet(fleet, Processes(1), refit=True).machines["m"].refit
    model = json.loads((fleet.results / refit.challenger / "model.json").read_text(encoding="utf-8"))
    learnt = set(model["provenance"]["data_sha256"])
    assert not learnt & set(refit.runs)
    # as many as the model in use had: the oldest give way to later ones
    assert learnt == {f"r{number}" for number in range(6, 12)}


def test_runs_that_are_not_used_take_no_part(fleet):
    repairs = "".join(f"[runs.r{number}]\nuse = false\n" for number in (8, 16))
    (fleet.place.parent / "m" / "machine.toml").write_text(repairs, encoding="utf-8")
    refit = run_fleet(fleet, Processes(1), refit=True).machines["m"].refit
    # of eight later runs the newest four
    assert refit.runs == ("r12", "r13", "r14", "r15")
    repairs = "".join(f"[runs.r{number}]\nuse = false\n" for number in range(8, 15))
    (fleet.place.parent / "m" / "machine.toml").write_text(repairs, encoding="utf-8")
    refit = run_fleet(fleet, Processes(1), refit=True).machines["m"].refit
    assert refit.because == "3 recordings came after it, and 5 are needed"


def test_recordings_that_cannot_be_read_cost_no_model(fleet):
    (fleet.place.parent / "m" / "r9.csv").write_bytes(b"\0\1\2 no recording")
    before = read_answer(fleet.results).machines["m"]
    one = run_fleet(fleet, Processes(1), refit=True).machines["m"]
    assert (one.status, one.key) == ("reused", before.key)
    assert "cannot be used" in one.refit.because


def test_an_answer_that_is_no_longer_whole_is_made_again(fleet):
    key = read_answer(fleet.results).machines["still"].key
    (fleet.results / key / "model.json").unlink()
    one = run_fleet(fleet, Processes(1), refit=True).machines["still"]
    assert (one.status, one.key, one.refit) == ("done", key, None)


def test_the_command_keeps_the_contract(fleet, capsys):
    assert exit_status(["fleet", "run", str(fleet.place), "--jobs", "1", "--refit", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["machines"]["m"]["refit"]["promoted"] is False
    assert exit_status(["fleet", "report", str(fleet.place)]) == 0
    assert "0 of 2 models in use gave way to a better one" in " ".join(capsys.readouterr().out.split())
    fleet.results.joinpath("fleet.json").unlink()
    assert exit_status(["fleet", "run", str(fleet.place), "--refit"]) == 2
    assert "run the fleet first" in capsys.readouterr().err
