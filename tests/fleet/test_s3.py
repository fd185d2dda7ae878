"""Recordings and results of a fleet in S3, on a server of this computer, through the command line."""

import json

import pytest

from selector.cli import exit_status
from selector.fleet import answered, read_fleet, run_fleet
from selector.fleet.machine_study import Task
from tests.fleet.machines import Here, changed, fleet_file, machine
from tests.patience import PATIENCE_S

s3fs = pytest.importorskip("s3fs", reason="s3fs is not installed")
moto = pytest.importorskip("moto.server", reason="moto with its server is not installed")

#: Another choice than from all thermometers, so that a machine file that is not found is seen.
MACHINE = """[time]
column = "t"
unit = "s"
[channels.T1]
role = "temperature"
unit = "degC"
[channels.T2]
role = "temperature"
unit = "degC"
[channels.T4]
role = "temperature"
unit = "degC"
[channels.Z]
role = "displacement"
unit = "um"
"""


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """A bucket with two machines, and the folder that it was filled from."""
    folder = tmp_path_factory.mktemp("plant")
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    known = {"AWS_ENDPOINT_URL": f"http://{host}:{port}", "AWS_ACCESS_KEY_ID": "x", "AWS_SECRET_ACCESS_KEY": "y"}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in known.items():
            patch.setenv(name, value)
        s3fs.S3FileSystem.clear_instance_cache()
        bucket = s3fs.S3FileSystem()
        bucket.mkdir("plant")
        for number in range(2):
            machine(folder / f"m{number}", number)
        for name in ("m0", "m1"):
            bucket.put(f"{folder / name}/", f"plant/shop/{name}/", recursive=True)
        yield folder, bucket
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


@pytest.fixture
def run(plant, monkeypatch, capsys):
    """The file of a fleet that is all in S3, and what its next run says."""
    monkeypatch.setattr("selector.fleet.Processes", lambda _: Here())
    text = 'folders = ["s3://plant/shop/*"]\nresults = "s3://plant/answers/2026"\n[select]\nmax_sensors = 2\n'
    path = fleet_file(plant[0], text)

    def said(*arguments):
        assert exit_status(["fleet", "run", str(path), *arguments, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return path, said


def test_answers_in_s3_are_the_bytes_of_a_folder(plant, run, tmp_path):
    path, said = run
    machines = said()["machines"]
    for name, study in read_fleet(path).studies.items():
        here = answered(Task(name, study, tmp_path, PATIENCE_S))
        assert here.key == machines[name]["key"]
        for file in ("selection.json", "model.json"):
            kept = plant[1].cat_file(f"plant/answers/2026/{here.key}/{file}")
            assert kept == (tmp_path / here.key / file).read_bytes()


def test_it_goes_on_from_what_is_whole_in_s3(plant, run, capsys):
    _, bucket = plant
    path, said = run
    key = said()["machines"]["m1"]["key"]
    # what a killed worker leaves: all but the last file
    bucket.rm_file(f"plant/answers/2026/{key}/done.json")
    for arguments, counts in (([], (1, 1, 0)), ([], (0, 2, 0)), (["--refit"], (0, 2, 0))):
        again = said(*arguments)
        assert (again["done"], again["reused"], again["failed"]) == counts
    assert all("0 recordings came after it" in one["refit"]["because"] for one in again["machines"].values())
    assert exit_status(["fleet", "watch", str(path), "--json"]) == 0
    assert {one["status"] for one in json.loads(capsys.readouterr().out)["machines"].values()} == {"nothing-new"}
    assert exit_status(["fleet", "report", str(path)]) == 0
    assert "wrote s3://plant/answers/2026/fleet.html" in capsys.readouterr().out
    assert b"2 of 2 machines have a model" in bucket.cat_file("plant/answers/2026/fleet.html")
    bucket.invalidate_cache()
    named = {place.rpartition("/")[2] for place in bucket.find("plant/answers")}
    assert named == {"fleet.json", "watch.json", "fleet.html", "selection.json", "model.json", "done.json"}


@pytest.mark.parametrize("names", ["{0}/*.csv", "{0}"])
def test_a_model_is_replaced_by_recordings_in_s3_as_in_a_folder(plant, names, tmp_path, monkeypatch):
    _, bucket = plant
    here, there = tmp_path / "m", f"plant/{tmp_path.name}"
    answers = []
    for n_runs in (6, 16):
        machine(here, 1, n_runs=n_runs)
        changed(here, range(7, n_runs + 1), lambda table: table.update(2.0 * table[["Z [um]"]]))
        (here / "machine.toml").write_text(MACHINE)
        bucket.put(f"{here}/", f"{there}/m/", recursive=True)
        for at in (str(tmp_path), f"s3://{there}"):
            where = names.format(f"{at}/m")
            text = f'results = "{at}/answers"\n[machines.m]\nruns = ["{where}"]\nmachine = "{at}/m/machine.toml"\n'
            text = text if "*" in names else text.rpartition("machine = ")[0]
            asked = read_fleet(fleet_file(tmp_path, text))
            answers.append(run_fleet(asked, Here(), refit=n_runs > 6).machines["m"])
    here, there = answers[2:]
    assert here.refit.promoted, here.refit.because
    assert {*here.sensors} <= {"T1", "T2", "T4"}
    assert there.model_dump(exclude={"seconds"}) == here.model_dump(exclude={"seconds"})


@pytest.mark.parametrize("command", ["run", "watch", "report"])
def test_a_bucket_that_does_not_exist_is_told_and_not_made(plant, command, capsys):
    path = fleet_file(plant[0], 'folders = ["m0"]\nresults = "s3://plnat/answers"\n')
    assert exit_status(["fleet", command, str(path)]) == 2
    told = capsys.readouterr().err
    assert all(word in told for word in ("s3://plnat/answers", "bucket does not exist", "Expected", "What to do"))
    assert "m0" not in told
    assert not any("plnat" in name for name in plant[1].ls("", refresh=True))
