"""Are the models of a fleet still true: quiet while nothing changes, and told where, since when and by how much."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

from selector.cli import exit_status
from selector.errors import ResultError
from selector.fleet import Processes, overview, read_answer, read_fleet, run_fleet, watch_fleet
from selector.fleet.refitting import older_unseen
from selector.telling.fleet import fleet_account, watch_account
from tests.fleet.machines import Here, changed, fleet_file, machine

PROVED, ALL = 6, 18


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """A machine whose model was made of six runs, twelve more of the same machine, and one without a model."""
    folder = tmp_path_factory.mktemp("plant")
    machine(folder / "m", 1, n_runs=PROVED)
    fleet = read_fleet(fleet_file(folder, '[machines]\nm = "m"\nnone = "nowhere"\n'))
    assert run_fleet(fleet, Processes(1)).done == 1
    assert watch_fleet(fleet).machines["m"].status == "nothing-new"
    machine(folder / "m", 1, n_runs=ALL)
    return folder


@pytest.fixture
def watched(plant, tmp_path):
    """A copy of it."""
    shutil.copytree(plant, tmp_path, dirs_exist_ok=True)
    return read_fleet(tmp_path / "FLEET.toml")


def test_it_is_quiet_while_the_machine_stays_as_it_was(watched):
    found = watch_fleet(watched)
    one = found.machines["m"]
    assert (found.alarms, one.status, found.machines["none"].status) == (0, "quiet", "no-model")
    assert one.runs == tuple(f"r{number}" for number in range(PROVED + 1, ALL + 1))
    z = one.responses["Z"]
    assert (z.runs, z.alarm, z.since) == (12, None, None)
    assert z.highest < z.limit
    # the noise of the gauge, 0.2 µm, and little else
    assert z.rmse_um == pytest.approx(z.expected_um, rel=0.5)


def test_a_shift_is_told_with_its_first_run_and_its_size(watched):
    def shifted(table):
        # a gauge that gives way while the machine warms up: 1.5 µm after the start
        table["Z [um]"] -= 1.5 * (table["t [s]"] > 0)

    changed(watched.place.parent / "m", range(11, ALL + 1), shifted)
    found = watch_fleet(watched)
    z = found.machines["m"].responses["Z"]
    # green are rows that are chosen, which an alarm is not
    assert watch_account(found).sections[0].blocks[0].table.marked == frozenset()
    assert z.alarm == "mean"
    # the sum may begin a run or two before a change
    assert z.since in {"r9", "r10", "r11"}
    assert z.mean_um == pytest.approx(-1.5, abs=0.5)


def test_errors_that_grow_to_both_sides_are_told(watched):
    def scattered(table):
        table["Z [um]"] += 1.5 * (-1.0) ** (table.index // 3)

    changed(watched.place.parent / "m", range(11, ALL + 1), scattered)
    found = watch_fleet(watched)
    assert found.machines["m"].responses["Z"].alarm == "spread"
    assert found.alarms == 1


@pytest.mark.parametrize("first", [0, 20])
def test_a_gauge_that_is_not_zeroed_and_read_now_and_then_is_no_change(tmp_path, first):
    folder = machine(tmp_path / "m", 1, n_runs=PROVED)

    def told(table):
        table["Z [um]"] += 40.0

    def now_and_then(table):
        told(table)
        table.loc[~table.index.isin([first, 24, 25, 31, 36, 39]), "Z [um]"] = float("nan")

    changed(folder, range(1, PROVED + 1), told)
    fleet = read_fleet(fleet_file(tmp_path, '[machines]\nm = "m"\n'))
    assert run_fleet(fleet, Here()).done == 1
    machine(folder, 1, n_runs=ALL)
    changed(folder, range(1, PROVED + 1), told)
    changed(folder, range(PROVED + 1, ALL + 1), now_and_then)
    one = watch_fleet(fleet).machines["m"]
    assert (one.status, one.responses["Z"].runs) == ("quiet", ALL - PROVED)
    assert one.responses["Z"].rmse_um < 2.0 * one.responses["Z"].expected_um


def test_a_dead_sensor_is_among_the_findings(watched):
    sensor = run_fleet(watched, Here()).machines["m"].sensors[0]
    machine(watched.place.parent / "m", 1, n_runs=ALL)
    for number in range(ALL + 1, ALL + 3):
        path = watched.place.parent / "m" / f"r{number}.csv"
        table = pd.read_csv(watched.place.parent / "m" / "r1.csv")
        table[f"{sensor} [degC]"] = -9999.0
        table["Z [um]"] += 0.01 * number  # no copies
        table.to_csv(path, index=False)
    one = watch_fleet(watched).machines["m"]
    assert one.runs == (f"r{ALL + 1}", f"r{ALL + 2}")
    assert (one.status, one.error) == ("suspect", None)
    assert any(finding["where"].get("channel") == sensor for finding in one.findings)


@pytest.mark.parametrize("since", [0, 10])
def test_a_sensor_that_stands_still_in_all_later_runs_is_to_be_looked_at(watched, since):
    """Among these runs alone it is one that always does; the runs of the model show that it moved."""
    sensor = read_answer(watched.results).machines["m"].sensors[0]

    def frozen(table):
        table.loc[since:, f"{sensor} [degC]"] = table[f"{sensor} [degC]"][since]

    changed(watched.place.parent / "m", range(PROVED + 1, ALL + 1), frozen)
    found = watch_fleet(watched)
    errors = [one for one in found.machines["m"].findings if one["level"] == "error"]
    newest = {f"r{number}" for number in range(ALL - PROVED // 2 + 1, ALL + 1)}
    told = {(one["id"], one["where"]["channel"], one["where"]["run"]) for one in errors if one["id"] == "stuck"}
    assert {("stuck", sensor, run) for run in newest} <= told
    assert "Look at m." in watch_account(found).sentences


def test_what_a_finding_of_level_error_speaks_against_is_not_told_as_before(watched):
    """A gauge in mm from now on: two runs are too few for an alarm, but anybody can see it."""
    for number in range(PROVED + 3, ALL + 1):
        (watched.place.parent / "m" / f"r{number}.csv").unlink()
    changed(
        watched.place.parent / "m", range(PROVED + 1, PROVED + 3), lambda table: table.update(table["Z [um]"] / 1e3)
    )
    found = watch_fleet(watched)
    assert found.machines["m"].status == "suspect"
    assert "worse-than-nothing" in {one["id"] for one in found.machines["m"].findings}
    account = watch_account(found)
    assert account.verdict == "bad"
    assert "Look at m." in account.sentences
    assert not any("as before" in sentence for sentence in account.sentences)
    [row] = [row for row in account.sections[0].blocks[0].table.rows if row[0] == "m"]
    assert row[1] == "to be looked at"
    assert "worse" in row[-1]


def test_the_command_prints_the_contract_and_a_page(watched, capsys, tmp_path):
    page = tmp_path / "watch.html"
    assert exit_status(["fleet", "watch", str(watched.place), "--json", "--out", str(page)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["schema"] == "selector.fleet-watch/1"
    assert told["machines"]["m"]["responses"]["Z"]["runs"] == 12
    assert "as before" in page.read_text(encoding="utf-8")
    assert exit_status(["fleet", "watch", str(watched.place)]) == 0
    assert "1 as before" in capsys.readouterr().out


def test_a_fleet_that_was_never_run_has_nothing_to_watch(tmp_path):
    fleet = read_fleet(fleet_file(tmp_path, '[machines]\nm = "m"'))
    with pytest.raises(ResultError, match="fleet"):
        watch_fleet(fleet)


def test_runs_that_are_not_used_or_older_are_not_new(watched):
    folder = watched.place.parent / "m"
    for number in range(PROVED + 1, ALL + 1):
        (folder / f"r{number}.csv").rename(folder / f"a{number}.csv")
    one = watch_fleet(watched).machines["m"]
    assert (one.status, one.runs) == ("suspect", ())
    assert all(word in one.error for word in (str(ALL - PROVED), f"r{PROVED}.csv", f"a{ALL}.csv"))
    page = fleet_account(read_answer(watched.results), beside=overview(watched.results, read_answer(watched.results)))
    assert any(one.error in told for told in page.sections[0].blocks[0].items)
    kept = run_fleet(watched, Here(), refit=True).machines["m"].refit.because
    assert kept.startswith("0 recordings")
    assert one.error in kept
    for number in range(PROVED + 1, ALL + 1):
        (folder / f"a{number}.csv").rename(folder / f"r{number}.csv")
    unused = "".join(f"[runs.r{number}]\nuse = false\n" for number in range(PROVED + 1, ALL + 1))
    (folder / "machine.toml").write_text(unused, encoding="utf-8")
    assert watch_fleet(watched).machines["m"].status == "nothing-new"


def test_a_clock_that_goes_wrong_after_some_later_runs_is_told(watched):
    """Runs that look older than the model are in no chart: the machine would be as before for ever."""
    folder = watched.place.parent / "m"
    for number in range(PROVED + 5, ALL + 1):
        (folder / f"r{number}.csv").rename(folder / f"a{number}.csv")
    found = watch_fleet(watched)
    one = found.machines["m"]
    assert (one.status, one.runs) == ("suspect", tuple(f"r{number}" for number in range(PROVED + 1, PROVED + 5)))
    assert f"a{ALL}.csv" in one.error
    assert "Look at m." in watch_account(found).sentences
    answer = read_answer(watched.results)
    page = fleet_account(answer, beside=overview(watched.results, answer))
    assert any(one.error in told for told in page.sections[0].blocks[0].items)


def test_a_run_that_no_model_can_learn_from_is_no_wrong_clock(tmp_path):
    machine(tmp_path / "m", 1, n_runs=PROVED)
    changed(tmp_path / "m", range(2, 3), lambda table: table.pop("Z [um]"))
    fleet = read_fleet(fleet_file(tmp_path, '[machines]\nm = "m"\n'))
    assert run_fleet(fleet, Here()).done == 1
    shutil.copytree(tmp_path / "m", tmp_path / "made")
    machine(tmp_path / "m", 1, n_runs=ALL)
    shutil.copytree(tmp_path / "made", tmp_path / "m", dirs_exist_ok=True)
    one = watch_fleet(fleet).machines["m"]
    assert (one.status, one.error, len(one.runs)) == ("quiet", None, ALL - PROVED)


def test_runs_outside_the_window_are_not_new(tmp_path):
    machine(tmp_path / "m", 1, n_runs=PROVED)

    def dated(numbers):
        for number in numbers:

            def stamp(table, number=number):
                stamps = pd.Timestamp(2026, 1, number) + pd.to_timedelta(table["t [s]"], unit="s")
                table.insert(0, "time", stamps.dt.strftime("%Y-%m-%d %H:%M:%S"))
                table.pop("t [s]")

            changed(tmp_path / "m", range(number, number + 1), stamp)

    dated(range(1, PROVED + 1))
    fleet = read_fleet(fleet_file(tmp_path, f'[reading]\nuntil = "2026-01-{PROVED + 1:02}"\n[machines]\nm = "m"\n'))
    assert run_fleet(fleet, Here()).done == 1
    known = {path: path.read_bytes() for path in (tmp_path / "m").iterdir()}
    machine(tmp_path / "m", 1, n_runs=ALL)
    for path, data in known.items():
        path.write_bytes(data)
    dated(range(PROVED + 1, ALL + 1))
    assert watch_fleet(fleet).machines["m"].status == "nothing-new"


def test_the_proof_of_one_run_is_no_spread_of_runs(tmp_path):
    """Its stretches are eight errors, of one day."""
    machine(tmp_path / "m", 1, n_runs=1)
    fleet = read_fleet(fleet_file(tmp_path, '[machines]\nm = "m"\n'))
    assert run_fleet(fleet, Here()).done == 1
    machine(tmp_path / "m", 1, n_runs=4)
    one = watch_fleet(fleet).machines["m"]
    assert one.status == "not-judged"
    assert one.responses["Z"].runs == 3
    assert one.responses["Z"].expected_um > 0.0


def test_what_keeps_the_watch_from_looking_is_to_be_done_this_week(watched):
    (watched.place.parent / "m" / "s1.csv").touch()
    assert exit_status(["fleet", "watch", str(watched.place)]) == 0
    answer = read_answer(watched.results)
    page = fleet_account(answer, beside=overview(watched.results, answer))
    assert any("m: not watched: s1.csv: an empty file" in told for told in page.sections[0].blocks[0].items)


@pytest.mark.parametrize(("known", "told"), [("ad", "2 "), ("abcd", ""), ("abd", "1 "), ("d", "3 "), ("", "4 ")])
def test_runs_that_were_there_at_a_comparison_are_no_wrong_clock(known, told):
    said = older_unseen({name: Path(f"{name}.csv") for name in "abcd"}, known)
    assert said.startswith(told)
    assert bool(said) == bool(told)


@pytest.mark.parametrize("gain", [1.0, 1.4])
def test_a_comparison_leaves_runs_over_and_does_not_silence_a_wrong_clock(watched, gain):
    """Whether the new model wins (the displacement has become larger) or not."""
    folder = watched.place.parent / "m"
    changed(folder, range(PROVED + 1, ALL + 1), lambda table: table.update(table["Z [um]"] * gain))
    for number in (PROVED + 1, PROVED + 2):
        (folder / f"r{number}.csv").rename(folder / f"a{number}.csv")
    before = watch_fleet(watched).machines["m"].error
    assert all(word in before for word in ("2 that", f"a{PROVED + 2}.csv"))
    answer = run_fleet(watched, Here(), refit=True).machines["m"]
    assert (answer.outcome, answer.refit.challenger is not None) == ("promoted" if gain > 1.0 else "kept", True)
    one = watch_fleet(watched).machines["m"]
    assert (one.status, one.error.partition(" are older")[0]) == ("suspect", "2 that were never used")
    again = run_fleet(watched, Here(), refit=True).machines["m"].refit.because
    assert "2 that were never used" in again
    for number in (PROVED + 1, PROVED + 2):
        (folder / f"a{number}.csv").unlink()
    assert watch_fleet(watched).machines["m"].error is None


def test_many_processes_say_what_one_says(watched):
    assert watch_fleet(watched, workers=Processes(2)) == watch_fleet(watched)


def test_a_process_that_dies_is_told(watched):
    class Dying(Here):
        def start(self, task):
            self._done.append((task.name, None))

    found = watch_fleet(watched, workers=Dying()).machines["m"]
    assert (found.status, "ended from outside" in found.error) == ("failed", True)


def test_a_machine_whose_folder_is_gone_is_told(watched):
    (watched.place.parent / "FLEET.toml").write_text('[machines]\nnone = "nowhere"\n', encoding="utf-8")
    found = watch_fleet(read_fleet(watched.place))
    assert (found.machines["m"].status, found.machines["none"].status) == ("failed", "no-model")
    assert "look for its folder" in found.machines["m"].error
