"""A model that is in use stays until one that learnt from later runs is better in still later ones."""

import json
import re
import shutil

import pandas as pd
import pytest

from selector.cli import exit_status
from selector.fleet import Processes, read_answer, read_fleet, run_fleet, watch_fleet
from tests.fleet.machines import Here, changed, fleet_file, machine

PROVED, ALL = 6, 16


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """A machine with a model of six runs, ten more runs of the same machine, and a second machine without new ones."""
    folder = tmp_path_factory.mktemp("plant")
    machine(folder / "m", 1, n_runs=PROVED)
    machine(folder / "still", 2, n_runs=PROVED)
    asked = read_fleet(fleet_file(folder, '[machines]\nm = "m"\nstill = "still"\n'))
    assert run_fleet(asked, Processes(1)).done == 2
    machine(folder / "m", 1, n_runs=ALL)
    return folder


@pytest.fixture
def fleet(plant, tmp_path):
    """A copy of it."""
    shutil.copytree(plant, tmp_path, dirs_exist_ok=True)
    return read_fleet(tmp_path / "FLEET.toml")


def gauge_turned(table):
    table["Z [um]"] *= 1.5


def test_where_nothing_changed_the_model_stays(fleet):
    before = read_answer(fleet.results).machines
    answer = run_fleet(fleet, Here(), refit=True)
    one = answer.machines["m"]
    assert (answer.reused, answer.done, answer.failed) == (2, 0, 0)
    assert (one.key, one.sensors) == (before["m"].key, before["m"].sensors)
    assert not one.refit.promoted
    # of ten later runs the newest five are for the comparison
    assert one.refit.runs == tuple(f"r{number}" for number in range(12, 17))
    # where it stays in use, the watch goes on over all of them
    assert len(watch_fleet(fleet).machines["m"].runs) == 10
    assert one.refit.champion_rmse_um["Z"] == pytest.approx(one.refit.challenger_rmse_um["Z"], rel=0.3)
    assert re.fullmatch(r"0 recordings .*\b5 .*", answer.machines["still"].refit.because)


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
    refit = run_fleet(fleet, Here(), refit=True).machines["m"].refit
    model = json.loads((fleet.results / refit.challenger / "model.json").read_text(encoding="utf-8"))
    learnt = set(model["provenance"]["data_sha256"])
    assert not learnt & set(refit.runs)
    # as many as the model in use had: the oldest give way to later ones
    assert learnt == {f"r{number}" for number in range(6, 12)}


def test_runs_that_are_not_used_take_no_part(fleet):
    repairs = "".join(f"[runs.r{number}]\nuse = false\n" for number in (8, 16))
    (fleet.place.parent / "m" / "machine.toml").write_text(repairs, encoding="utf-8")
    refit = run_fleet(fleet, Here(), refit=True).machines["m"].refit
    # of eight later runs the newest four
    assert refit.runs == ("r12", "r13", "r14", "r15")
    repairs = "".join(f"[runs.r{number}]\nuse = false\n" for number in range(8, 15))
    (fleet.place.parent / "m" / "machine.toml").write_text(repairs, encoding="utf-8")
    refit = run_fleet(fleet, Here(), refit=True).machines["m"].refit
    # r15 was judged before, r16 was not used then
    assert re.fullmatch(r"1 recording .*compared.*\b5 .*", refit.because)


def test_recordings_that_cannot_be_read_cost_no_model(fleet):
    (fleet.place.parent / "m" / "r9.csv").write_bytes(b"\0\1\2 no recording")
    before = read_answer(fleet.results).machines["m"]
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert (one.status, one.key) == ("reused", before.key)
    assert "cannot be used" in one.refit.because


def test_a_run_is_used_for_one_decision_only(fleet):
    folder = fleet.place.parent / "m"
    changed(folder, range(PROVED + 1, ALL + 1), gauge_turned)
    assert run_fleet(fleet, Here(), refit=True).machines["m"].refit.promoted
    again = run_fleet(fleet, Here(), refit=True).machines["m"].refit
    # r1 to r5 are unknown to the new model, and older; r12 to r16 have chosen it
    assert re.fullmatch(r"0 recordings .*compared, and 5 are needed", again.because)
    left_over = watch_fleet(fleet).machines["m"]
    assert (left_over.status, left_over.error) == ("nothing-new", None)
    machine(folder, 1, n_runs=ALL + 6)
    changed(folder, range(PROVED + 1, ALL + 7), gauge_turned)
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert one.refit.runs == ("r19", "r20", "r21", "r22")
    model = json.loads((fleet.results / one.refit.challenger / "model.json").read_text(encoding="utf-8"))
    assert set(model["provenance"]["data_sha256"]) == {f"r{number}" for number in range(13, 19)}


def stuck(table):
    table["Z [um]"] = 0.0


def in_mm(table):
    table["Z [um]"] /= 1000.0


@pytest.mark.parametrize("broken", [stuck, in_mm])
def test_where_the_gauge_broke_the_model_stays(fleet, broken):
    before = read_answer(fleet.results).machines["m"]
    changed(fleet.place.parent / "m", range(PROVED + 1, ALL + 1), broken)
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert (one.key, one.refit.promoted) == (before.key, False)
    assert "has an error" in one.refit.because


def test_a_unit_that_most_of_the_later_runs_have_is_no_better_model(fleet):
    folder = machine(fleet.place.parent / "m", 1, n_runs=ALL + 20)
    before = read_answer(fleet.results).machines["m"]
    changed(folder, range(PROVED + 6, ALL + 21), in_mm)
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert (one.key, one.refit.promoted) == (before.key, False)
    assert "mm" in one.refit.because


def test_a_gauge_that_was_wrong_before_does_not_keep_the_model_for_ever(tmp_path):
    """A run in mm among those of the model is left out of it; the newest runs are right."""
    asked = read_fleet(fleet_file(tmp_path, '[machines]\nm = "m"\n'))
    changed(machine(tmp_path / "m", 1, n_runs=PROVED), range(2, 3), in_mm)
    assert run_fleet(asked, Here()).done == 1
    folder = machine(tmp_path / "m", 1, n_runs=ALL)
    changed(folder, range(2, 3), in_mm)
    changed(folder, range(PROVED + 1, ALL + 1), gauge_turned)
    one = run_fleet(asked, Here(), refit=True).machines["m"]
    assert one.refit.promoted, one.refit.because


def test_a_model_that_is_worse_than_no_correction_is_not_taken(fleet):
    def halved(table):
        table["Z [um]"] *= 0.5

    def turned_round(table):
        table["Z [um]"] *= -1.0

    changed(fleet.place.parent / "m", range(PROVED, 12), halved)
    changed(fleet.place.parent / "m", range(12, ALL + 1), turned_round)
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert not one.refit.promoted
    assert "worse" in one.refit.because


def test_copies_are_no_further_recordings(fleet):
    folder = fleet.place.parent / "still"
    machine(folder, 2, n_runs=PROVED + 3)
    for number in range(1, PROVED + 4):
        (folder / f"r{number}_copy.csv").write_bytes((folder / f"r{number}.csv").read_bytes())
    one = run_fleet(fleet, Here(), refit=True).machines["still"]
    assert re.fullmatch(r"3 recordings .*\b5 .*", one.refit.because)


def test_runs_of_one_name_are_told_apart(fleet):
    folder = fleet.place.parent / "m"
    for number in range(PROVED + 1, ALL + 1):
        (folder / f"r{number}.csv").rename(folder / f"r{number - PROVED}.later.csv")
    for path in folder.glob("*.later.csv"):
        (folder / "later").mkdir(exist_ok=True)
        path.rename(folder / "later" / path.name.replace(".later", ""))
    asked = read_fleet(fleet_file(fleet.place.parent, '[machines]\nm = ["m", "m/later"]\n'))
    refit = run_fleet(asked, Here(), refit=True).machines["m"].refit
    assert refit.runs == ("later_r6", "r7", "r8", "r9", "r10")


def test_another_question_is_answered_anew(fleet):
    def second_gauge(table):
        table["Y [um]"] = 0.5 * table["Z [um]"] + 0.1 * (table.index % 3)

    changed(fleet.place.parent / "m", range(1, PROVED + 1), second_gauge)
    before = read_answer(fleet.results).machines
    text = '[select]\nresponses = ["Y"]\n[machines]\nm = "m"\nstill = "still"\n'
    asked = read_fleet(fleet_file(fleet.place.parent, text))
    answer = run_fleet(asked, Here(), refit=True)
    one, still = answer.machines["m"], answer.machines["still"]
    assert (one.status, one.outcome, list(one.heldout_rmse_um)) == ("done", "anew", ["Y"])
    assert "asked" in one.refit.because
    # it has no Y: told, and its model stays
    assert (still.status, still.key) == ("failed", before["still"].key)
    assert "stays in use" in still.error
    assert run_fleet(asked, Here(), refit=True).machines["m"].outcome == "kept"


def test_fewer_options_are_another_question_too(fleet):
    text = '[select]\nmax_sensors = 1\n[machines]\nstill = "still"\n'
    asked = read_fleet(fleet_file(fleet.place.parent, text))
    one = run_fleet(asked, Here(), refit=True).machines["still"]
    assert (one.outcome, len(one.sensors)) == ("anew", 1)


def test_one_machine_does_not_stop_the_others(fleet, monkeypatch):
    def defect(study, champion, results):
        raise KeyError(champion.key)

    monkeypatch.setattr("selector.fleet.running.challenge_of", defect)
    answer = run_fleet(fleet, Here(), refit=True)
    assert all("defect" in one.error and one.key for one in answer.machines.values())
    assert answer.failed == 2


def test_a_machine_that_is_away_keeps_its_model(fleet, capsys):
    before = read_answer(fleet.results).machines["m"]
    away = fleet.place.parent / "away"
    (fleet.place.parent / "m").rename(away)
    asked = read_fleet(fleet_file(fleet.place.parent, 'folders = ["s*"]\n'))
    answer = run_fleet(asked, Here(), refit=True)
    one = answer.machines["m"]
    assert (one.status, one.key, answer.missing) == ("missing", before.key, 1)
    assert exit_status(["fleet", "report", str(asked.place)]) == 0
    assert re.search(r"\b1 machine [^:]*: m\.", " ".join(capsys.readouterr().out.split()))
    away.rename(fleet.place.parent / "m")
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert (one.key, one.error, len(one.refit.runs)) == (before.key, None, 5)


def test_a_plain_run_that_fails_costs_no_model(fleet):
    before = read_answer(fleet.results).machines["m"]
    good = (fleet.place.parent / "m" / "r9.csv").read_bytes()
    (fleet.place.parent / "m" / "r9.csv").write_bytes(b"\0\1\2 no recording")
    one = run_fleet(fleet, Here()).machines["m"]
    assert (one.status, one.key) == ("failed", before.key)
    assert "stays in use" in one.error
    (fleet.place.parent / "m" / "r9.csv").write_bytes(good)
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert (one.status, one.key, len(one.refit.runs)) == ("reused", before.key, 5)


def test_a_model_that_is_lost_is_told_and_made_anew(fleet):
    key = read_answer(fleet.results).machines["still"].key
    (fleet.results / key / "model.json").unlink()
    one = run_fleet(fleet, Here(), refit=True).machines["still"]
    assert (one.status, one.key, one.outcome) == ("done", key, "anew")
    assert "cannot be read" in one.refit.because


def test_a_model_stays_where_only_the_files_beside_it_were_changed(fleet):
    before = read_answer(fleet.results).machines["m"]
    (fleet.results / before.key / "selection.json").write_text("{}", encoding="utf-8")
    assert "were changed" in watch_fleet(fleet).machines["m"].error
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert (one.status, one.key, len(one.refit.runs)) == ("reused", before.key, 5)
    assert "were changed" in one.refit.because


def test_a_run_of_which_two_loggers_wrote_a_file_each_is_learnt_from_with_both(tmp_path):
    folder = tmp_path / "m"
    asked = read_fleet(fleet_file(tmp_path, '[machines]\nm = "m"\n[select]\nresponses = ["Z"]\n'))
    for n_runs in (PROVED, ALL):
        machine(folder, 1, n_runs=n_runs)
        changed(folder, range(PROVED + 1, n_runs + 1), gauge_turned)
        for number in range(1, n_runs + 1):
            table = pd.read_csv(folder / f"r{number}.csv")
            table[["t [s]", "Z [um]"]].to_csv(folder / f"z{number}.csv", index=False)
            table.drop(columns="Z [um]").to_csv(folder / f"r{number}.csv", index=False)
        pairs = (f'[runs.r{number}]\nbeside = ["z{number}"]\n' for number in range(1, n_runs + 1))
        columns = {"t": "", **{f"T{i}": "temperature" for i in range(1, 5)}, "Z": "displacement"}
        (folder / "machine.toml").write_text(
            '[time]\ncolumn = "t"\nunit = "s"\n'
            + "".join(
                f'[channels.{name}]\nrole = "{role}"\nunit = "{"um" if name == "Z" else "degC"}"\n'
                for name, role in columns.items()
                if role
            )
            + "".join(pairs)
        )
        one = run_fleet(asked, Here(), refit=n_runs > PROVED).machines["m"]
        assert one.status == "done", one
    assert one.refit.promoted, one.refit.because


def test_a_model_whose_sensor_is_gone_is_an_error(fleet):
    before = read_answer(fleet.results).machines["m"]
    sensor = f"{before.sensors[0]} [degC]"
    changed(fleet.place.parent / "m", range(8, ALL + 1), lambda table: table.pop(sensor))
    one = run_fleet(fleet, Here(), refit=True).machines["m"]
    assert (one.status, one.key) == ("failed", before.key)
    assert f" {before.sensors[0]}" in one.error


def test_the_command_keeps_the_contract(fleet, capsys):
    assert exit_status(["fleet", "run", str(fleet.place), "--jobs", "1", "--refit", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["machines"]["m"]["refit"]["promoted"] is False
    assert exit_status(["fleet", "report", str(fleet.place)]) == 0
    assert "0 of 2 models" in " ".join(capsys.readouterr().out.split())
    fleet.results.joinpath("fleet.json").unlink()
    assert exit_status(["fleet", "run", str(fleet.place), "--refit"]) == 2
    assert "fleet run" in capsys.readouterr().err
