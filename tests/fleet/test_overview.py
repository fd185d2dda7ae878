"""The page of a fleet: errors run by run, what the last watch found, places that serve all, what to do this week."""

import json
import shutil

import pytest

from selector.cli import exit_status
from selector.errors import ResultError
from selector.fleet import read_answer, read_fleet
from selector.fleet.overview import overview, serving
from selector.fleet.watching import WATCH_FILE
from selector.telling.fleet import fleet_account
from tests.fleet.machines import changed, fleet_file, machine


def sets(*several):
    return [frozenset(one.split()) for one in several]


def test_places_that_serve_all_come_one_after_the_other():
    of = {"a": sets("T1 T2", "T1 T3"), "b": sets("T3 T4", "T1 T3"), "c": sets("T3"), "d": sets("T5 T6")}
    found = serving(of)
    names, served = [name for name, _ in found], [count for _, count in found]
    assert names[:2] == ["T3", "T1"]
    assert served[:2] == [1, 3]
    assert set(names[2:]) == {"T5", "T6"}
    assert served[-1] == 4


def test_few_machines_or_none_are_served_too():
    assert serving({}) == ()
    assert serving({"a": []}) == ()
    assert serving({"a": sets("T2")}) == (("T2", 1),)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Five machines: one much worse than the others, one broken, one whose gauge has moved since."""
    folder = tmp_path_factory.mktemp("fleet")
    for k in range(4):
        machine(folder / f"m{k}", 20 + k, n_runs=8)
    changed(
        folder / "m1",
        range(1, 9),
        lambda table: table.__setitem__("Z [um]", 30 * table["Z [um]"].sample(frac=1, random_state=1).to_numpy()),
    )
    (folder / "m4").mkdir()
    (folder / "m4" / "r1.csv").write_text("nothing\n", encoding="utf-8")
    names = "".join(f'm{k} = "m{k}"\n' for k in range(5))
    path = fleet_file(folder, f"[machines]\n{names}[select]\nresponses = ['Z']\nmax_sensors = 2\n")
    assert exit_status(["fleet", "run", str(path), "--jobs", "1"]) == 0
    return path


def told(path):
    asked = read_fleet(path)
    answer = read_answer(asked.results)
    return fleet_account(answer, beside=overview(asked.results, answer))


def block(account, id_):
    return next(section for section in account.sections if section.id == id_).blocks


def test_what_to_do_names_the_broken_and_the_worst_and_asks_for_a_watch(fleet):
    items = block(told(fleet), "next")[0].items
    assert items[0].startswith("m4: ")
    assert "on m1:" in items[1]
    assert "fleet watch" in items[-1]


def test_the_table_has_errors_run_by_run(fleet):
    asked = read_fleet(fleet)
    beside = overview(asked.results, read_answer(asked.results))
    for name in ("m0", "m2", "m3"):
        proved = json.loads(
            next(asked.results.glob(f"{read_answer(asked.results).machines[name].key}/selection.json")).read_text(
                encoding="utf-8"
            )
        )
        runs = [one["heldout_rmse_um"] for one in proved["models"]["Z"]["per_run"].values()]
        assert beside.by_run_um[name]["Z"] == tuple(runs)
    assert "m4" not in beside.by_run_um
    rows = {row[0]: row for row in block(told(fleet), "machines")[0].table.rows}
    assert len(rows["m0"][2].split()[1]) == 8
    assert "█" in rows["m0"][2]
    assert beside.serving[-1][1] == 4


def test_the_last_watch_is_kept_and_comes_first(fleet, tmp_path):
    folder = fleet.parent
    for run in range(9, 15):
        extra = machine(tmp_path / "more", 22, n_runs=run)
        (folder / "m2" / f"r{run}.csv").write_bytes((extra / f"r{run}.csv").read_bytes())
    changed(folder / "m2", range(9, 15), lambda table: table.__setitem__("Z [um]", table["Z [um]"] * 1.8))
    assert exit_status(["fleet", "watch", str(fleet)]) == 0
    assert (read_fleet(fleet).results / WATCH_FILE).exists()
    items = block(told(fleet), "next")[0].items
    assert items[0].startswith("m2: ")
    rows = {row[0]: row for row in block(told(fleet), "machines")[0].table.rows}
    assert rows["m2"][-2] == "no longer as it was"
    assert rows["m4"][-2] == "without a model"
    assert exit_status(["fleet", "report", str(fleet)]) == 0
    assert "What to do this week" in (read_fleet(fleet).results / "fleet.html").read_text(encoding="utf-8")
    assert exit_status(["fleet", "report", str(fleet), "--out", str(tmp_path / "fleet.csv")]) == 2
    assert not (tmp_path / "fleet.csv").exists()


def test_a_watch_of_a_model_that_gave_way_tells_nothing_of_the_new_one(fleet):
    asked = read_fleet(fleet)
    answer = read_answer(asked.results)
    assert exit_status(["fleet", "watch", str(fleet)]) == 0
    assert set(overview(asked.results, answer).watch.machines) == {"m0", "m1", "m2", "m3", "m4"}
    new = answer.machines["m2"].model_copy(update={"key": "another"})
    answer = answer.model_copy(update={"machines": answer.machines | {"m2": new}})
    assert set(overview(asked.results, answer).watch.machines) == {"m0", "m1", "m3", "m4"}


@pytest.mark.parametrize(("level", "id_"), [("error", "wrong-unit"), ("warning", "lost-readings-cost")])
def test_what_a_study_found_that_must_be_known_is_among_what_to_do(fleet, tmp_path, level, id_):
    asked = read_fleet(fleet)
    shutil.copytree(asked.results, tmp_path / "results")
    answer = read_answer(tmp_path / "results")
    place = tmp_path / "results" / answer.machines["m3"].key / "selection.json"
    told = json.loads(place.read_text(encoding="utf-8"))
    told["findings"] += [{"id": id_, "level": level, "statement": f"Z in run r{k} …"} for k in (2, 3)]
    told["findings"].append({"id": "few-runs", "level": "warning", "statement": "that is no fault"})
    place.write_text(json.dumps(told), encoding="utf-8")
    items = block(fleet_account(answer, beside=overview(tmp_path / "results", answer)), "next")[0].items
    assert [item for item in items if item.startswith("m3")] == ["m3, when its model was made: Z in run r2 …"]
    assert not any("no fault" in item for item in items)


def test_a_watch_of_something_else_is_none(fleet):
    asked = read_fleet(fleet)
    (asked.results / WATCH_FILE).write_text("{}", encoding="utf-8")
    assert overview(asked.results, read_answer(asked.results)).watch is None


@pytest.mark.parametrize(
    "text",
    ["[]", "{}", '{"models": []}', '{"models": {"Z": {"per_run": {"r1": {"heldout_rmse_um": "x"}}}}}', "[" * 5000],
)
def test_an_answer_that_is_something_else_has_no_errors_run_by_run(fleet, tmp_path, text):
    asked = read_fleet(fleet)
    shutil.copytree(asked.results, tmp_path / "results")
    answer = read_answer(tmp_path / "results")
    (tmp_path / "results" / answer.machines["m0"].key / "selection.json").write_text(text, encoding="utf-8")
    found = overview(tmp_path / "results", answer)
    assert "m0" not in found.by_run_um
    assert "m2" in found.by_run_um


def test_a_run_that_the_proof_does_not_cover_leaves_the_machine_its_bars_and_places(fleet, tmp_path):
    asked = read_fleet(fleet)
    shutil.copytree(asked.results, tmp_path / "results")
    answer = read_answer(tmp_path / "results")
    whole = overview(asked.results, answer)
    place = tmp_path / "results" / answer.machines["m0"].key / "selection.json"
    told = json.loads(place.read_text(encoding="utf-8"))
    told["models"]["Z"]["per_run"]["r8"] = {"rmse_um": 1.0, "max_um": 2.0}
    told["findings"].append({"id": "one-run-only", "level": "warning"})
    place.write_text(json.dumps(told), encoding="utf-8")
    found = overview(tmp_path / "results", answer)
    assert found.by_run_um["m0"]["Z"] == whole.by_run_um["m0"]["Z"][:7]
    assert found.serving == whole.serving
    assert (whole.single, found.single) == ((), ("m0",))
    assert any("third run on m0: " in item for item in block(fleet_account(answer, beside=found), "next")[0].items)


def test_errors_that_are_no_number_have_no_bars(fleet, tmp_path):
    asked = read_fleet(fleet)
    shutil.copytree(asked.results, tmp_path / "results")
    answer = read_answer(tmp_path / "results")
    runs = ", ".join(f'"r{i}": {{"heldout_rmse_um": {error}}}' for i, error in enumerate(("NaN", "1e999", -1.0, 2.0)))
    place = tmp_path / "results" / answer.machines["m0"].key / "selection.json"
    place.write_text(f'{{"models": {{"Z": {{"per_run": {{{runs}}}}}}}}}', encoding="utf-8")
    found = overview(tmp_path / "results", answer)
    assert found.by_run_um["m0"] == {"Z": (2.0,)}
    rows = block(fleet_account(answer, beside=found), "machines")[0].table.rows
    assert next(row for row in rows if row[0] == "m0")[2].count("█") == 1


def test_a_watch_whose_findings_say_nothing_is_none(fleet, tmp_path):
    asked = read_fleet(fleet)
    told = {"schema": "selector.fleet-watch/1", "alarms": 0, "machines": {"m0": {"status": "quiet", "findings": [{}]}}}
    (tmp_path / WATCH_FILE).write_text(json.dumps(told), encoding="utf-8")
    assert overview(tmp_path, read_answer(asked.results)).watch is None


def test_the_folder_of_an_answer_is_in_the_results_folder(fleet, tmp_path):
    document = json.loads((read_fleet(fleet).results / "fleet.json").read_text(encoding="utf-8"))
    document["machines"]["m0"]["key"] = "../elsewhere"
    (tmp_path / "fleet.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ResultError, match="something else"):
        read_answer(tmp_path)
