"""A fleet through the command line: six machines, three of them broken, in processes and on a cluster."""

import json
import re
import signal
import subprocess
import sys

import pytest

from selector.cli import exit_status
from tests.fleet.machines import fleet_file, machine
from tests.interruptible import interrupted_in

TEXT = """
[select]
responses = ["Z"]
max_sensors = 3
[machines]
good1 = "plant/good1"
good2 = "plant/good2/*.csv"
unreadable = "plant/unreadable"
missing = ["plant/missing/r1.csv", "plant/missing/r9.csv"]
[machines.good3]
runs = ["plant/good3"]
select.max_sensors = 1
[machines.option]
runs = ["plant/option"]
select.must = ["T99"]
"""


def answers(fleet, capsys, *arguments):
    assert exit_status(["fleet", "run", str(fleet), *arguments, "--json"]) == 0
    said = capsys.readouterr()
    return json.loads(said.out), said.err


def files(folder):
    """Bytes of every answer; done.json holds the time that it took."""
    return {path.relative_to(folder): path.read_bytes() for path in folder.glob("*/[ms]*.json")}


def without_times(found):
    return {name: one | {"seconds": 0, "status": one["status"][:4]} for name, one in found["machines"].items()}


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """The six machines."""
    folder = tmp_path_factory.mktemp("fleet")
    for number, name in enumerate(("good1", "good2", "good3", "unreadable", "option", "missing")):
        machine(folder / "plant" / name, number)
    (folder / "plant" / "unreadable" / "r2.csv").write_bytes(bytes(range(256)) * 40)
    return folder


@pytest.fixture(scope="module")
def done(plant):
    """The fleet done by two processes: the file, what was printed, and what stood on stderr."""
    fleet = fleet_file(plant, TEXT)
    found = subprocess.run(
        [sys.executable, "-m", "selector", "fleet", "run", str(fleet), "--jobs", "2", "--json"],
        capture_output=True, text=True, encoding="utf-8", check=True,
    )  # fmt: skip
    return fleet, json.loads(found.stdout), found.stderr


def test_right_ones_are_done_and_each_wrong_one_is_told(done):
    _, said, progress = done
    assert set(said) == {"schema", "done", "reused", "failed", "machines"}
    assert (said["schema"], said["done"], said["reused"], said["failed"]) == ("selector.fleet/1", 3, 0, 3)
    assert list(said["machines"]) == ["good1", "good2", "unreadable", "missing", "good3", "option"]
    fields = {"status", "error", "key", "sensors", "heldout_rmse_um", "seconds"}
    for one in said["machines"].values():
        assert set(one) == fields
    right = said["machines"]["good1"]
    assert (right["status"], right["error"]) == ("done", None)
    assert re.fullmatch("[0-9a-f]{64}", right["key"])
    # the gauge's noise is 0.2 µm; that of the sensors, times their coefficients, comes on top
    assert 0.2 < right["heldout_rmse_um"]["Z"] < 1
    assert len(said["machines"]["good3"]["sensors"]) == 1
    errors = {name: one["error"] for name, one in said["machines"].items() if one["status"] == "failed"}
    assert set(errors) == {"unreadable", "missing", "option"}
    assert "r2.csv" in errors["unreadable"]
    assert "r9.csv" in errors["missing"]
    assert "T99" in errors["option"]
    lines = progress.splitlines()
    assert len([line for line in lines if re.match(r"\[\d/6\] \w+ (done|failed): ", line)]) == 6


def test_the_second_time_nothing_is_done_again(done, capsys):
    fleet, before, _ = done
    kept = files(fleet.parent / "results")
    said, _ = answers(fleet, capsys, "--jobs", "1")
    assert (said["done"], said["reused"], said["failed"]) == (0, 3, 3)
    reused = {name: one for name, one in said["machines"].items() if one["status"] == "reused"}
    assert reused == {name: before["machines"][name] | {"status": "reused"} for name in reused}
    assert files(fleet.parent / "results") == kept


def test_one_process_gives_the_same_bytes_as_two(done, plant, capsys):
    _, before, _ = done
    said, _ = answers(fleet_file(plant, 'results = "one"' + TEXT), capsys, "--jobs", "1")
    fleet_file(plant, TEXT)
    assert without_times(said) == without_times(before)
    assert files(plant / "one") == files(plant / "results")
    assert len(files(plant / "one")) == 6


def test_a_dask_cluster_gives_the_same_bytes(done, plant, capsys):
    distributed = pytest.importorskip("distributed")
    _, before, _ = done
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp"
    ) as cluster:
        fleet = fleet_file(plant, 'results = "dask"' + TEXT)
        said, _ = answers(fleet, capsys, "--dask", cluster.scheduler_address)
    fleet_file(plant, TEXT)
    assert without_times(said) == without_times(before)
    assert files(plant / "dask") == files(plant / "results")


def test_the_page_has_a_row_a_machine_the_worst_first(done, capsys):
    fleet, _, _ = done
    page = fleet.parent / "results" / "fleet.html"
    assert exit_status(["fleet", "report", str(fleet), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["failed"] == 3
    text = page.read_text(encoding="utf-8")
    places = [re.search(rf"<td[^>]*>\s*{name}\s*</td>", text).start() for name in ("unreadable", "missing", "option")]
    rest = [re.search(rf"<td[^>]*>\s*{name}\s*</td>", text).start() for name in ("good1", "good2", "good3")]
    assert max(places) < min(rest)
    assert rest[2] == min(rest)  # one sensor has the largest error
    assert "no such file" in text
    assert "3 of 6 machines have a model" in text
    assert page.stat().st_size < 8e6


def test_a_machine_that_came_later_had_no_turn_yet(done, plant, capsys):
    fleet = fleet_file(plant, TEXT + '[machines.new]\nruns = ["plant/new"]\n')
    assert exit_status(["fleet", "report", str(fleet), "--out", str(plant / "page.html")]) == 0
    fleet_file(plant, TEXT)
    said = capsys.readouterr().out
    assert "3 of 7 machines have a model" in said
    assert "1 machine had" in said
    assert "wrote" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "nowhere.toml"], "a fleet file"),
        (["run", "FLEET.toml", "--jobs", "2", "--dask", "tcp://127.0.0.1:1"], "--jobs 2 beside --dask"),
        (["run", "FLEET.toml", "--jobs", "0"], "--jobs"),
        (["report", "FLEET.toml"], "run the fleet first"),
    ],
)
def test_what_cannot_be_ends_with_2(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    fleet_file(tmp_path, '[machines]\nm = "m"')
    assert exit_status(["fleet", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_without_dask_it_is_said_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    fleet = fleet_file(tmp_path, '[machines]\nm = "m"')
    assert exit_status(["fleet", "run", str(fleet), "--dask", "tcp://127.0.0.1:1"]) == 2
    assert 'pip install ".[fleet]"' in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="Windows sends Ctrl-C to the whole console")
def test_ctrl_c_ends_with_130_and_says_where_it_goes_on(plant):
    fleet = fleet_file(plant, 'results = "stopped"' + TEXT)
    found = interrupted_in("finished", "fleet", "run", str(fleet), "--jobs", "1")
    fleet_file(plant, TEXT)
    assert found.returncode == 130
    assert "same command" in found.stderr
    assert "Traceback" not in found.stderr
    assert (plant / "stopped" / "fleet.json").is_file()
