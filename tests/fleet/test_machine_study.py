"""The study of one machine: what its key depends on, what is used again, and that every error is an answer."""

import json
import shutil

import pytest

from selector.errors import ReadError
from selector.fleet import read_fleet
from selector.fleet.machine_study import Task, answered
from selector.fleet.places import local_paths
from tests.fleet.machines import fleet_file, machine


def task(folder, text='[machines]\nm = "m"', limit_s=600.0, **changes):
    fleet = read_fleet(fleet_file(folder, text))
    return Task("m", fleet.studies["m"], fleet.results, limit_s, **changes)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A folder with one machine whose study is done, and its answer."""
    folder = tmp_path_factory.mktemp("plant")
    machine(folder / "m", 1)
    answer = answered(task(folder))
    assert answer.status == "done", answer.error
    return folder, answer


@pytest.fixture
def again(done, tmp_path):
    """A copy of it at another place."""
    shutil.copytree(done[0], tmp_path / "copy")
    return tmp_path / "copy"


def test_its_answer_is_that_of_select(done, capsys):
    from selector.cli import exit_status

    folder, answer = done
    assert exit_status(["select", str(folder / "m"), "--json"]) == 0
    written = (folder / "results" / answer.key / "selection.json").read_text(encoding="utf-8")
    assert written == capsys.readouterr().out
    said = json.loads(written)
    assert list(answer.sensors) == said["chosen"]["sensors"]
    assert answer.heldout_rmse_um == {"Z": said["models"]["Z"]["heldout_rmse_um"]}
    assert exit_status(["model", "check", str(folder / "results" / answer.key / "model.json")]) == 0


def test_the_same_recordings_elsewhere_are_not_done_again(done, again):
    found = answered(task(again))
    assert found.status == "reused"
    assert found == done[1].model_copy(update={"status": "reused"})


@pytest.mark.parametrize(
    "change",
    [
        lambda folder: (folder / "m" / "r2.csv").write_text((folder / "m" / "r2.csv").read_text() + "\n"),
        lambda folder: (folder / "m" / "r4.csv").unlink(),
        lambda folder: (folder / "m" / "r4.csv").rename(folder / "m" / "r5.csv"),
        lambda folder: (folder / "m" / "machine.toml").write_text('[channels.T1]\nrole = "ambient"\nunit = "degC"\n'),
    ],
    ids=["byte", "run less", "name", "machine file"],
)
def test_what_changes_the_recordings_changes_the_key(done, again, change):
    change(again)
    assert answered(task(again)).key not in (None, done[1].key)


@pytest.mark.parametrize("text", ["[select]\nmax_sensors = 2", '[reading]\nunits = {T1 = "K"}'])
def test_so_does_what_is_asked(done, again, text):
    assert answered(task(again, f'{text}\n[machines]\nm = "m"')).key != done[1].key


@pytest.mark.parametrize("name", ["done.json", "selection.json", "model.json"])
def test_an_answer_that_is_not_whole_is_made_again(done, again, name):
    place = again / "results" / done[1].key / name
    text = place.read_text(encoding="utf-8")
    place.write_text(text[: len(text) // 2], encoding="utf-8")
    assert answered(task(again)).status == "done"
    assert answered(task(again)).status == "reused"
    if name != "done.json":
        assert place.read_text(encoding="utf-8") == text


class TestErrorsAreAnswers:
    def told(self, found, *words):
        assert found.status == "failed"
        assert all(word in found.error for word in words), found.error

    def test_nothing_there(self, again):
        shutil.rmtree(again / "m")
        self.told(answered(task(again)), "no such file or folder", "What to do")

    def test_a_pattern_that_fits_nothing(self, again):
        self.told(answered(task(again, '[machines]\nm = "m/*.tdms"')), "nothing that this pattern fits")

    def test_bytes_that_are_no_recording(self, again):
        (again / "m" / "r1.csv").write_bytes(b"\x89PNG\r\n\x1a\n")
        self.told(answered(task(again)), "a picture", "r1.csv")

    def test_options_that_do_not_fit_this_machine(self, again):
        found = answered(task(again, '[machines.m]\nruns = ["m"]\nselect.responses = ["Q"]'))
        self.told(found, "'Q'", "--response")
        assert found.key is not None

    def test_options_that_contradict_each_other(self, again):
        self.told(answered(task(again, '[machines.m]\nruns = ["m"]\nselect = {must = ["T1"], never = ["T1"]}')), "both")

    def test_too_long(self, again):
        shutil.rmtree(again / "results")
        self.told(answered(task(again, limit_s=1e-9)), "no answer within 1e-09 s", "time_limit_s")
        assert not (again / "results").exists()

    def test_another_version(self, again):
        self.told(answered(task(again, version="0.0.1")), "0.0.1", "same version")

    def test_a_defect(self, again, monkeypatch):
        shutil.rmtree(again / "results")
        monkeypatch.setattr("selector.fleet.machine_study.select", lambda *_, **__: 1 / 0)
        self.told(answered(task(again)), "a defect of the program", "ZeroDivisionError")

    def test_rights_that_are_missing_are_no_defect(self, again, monkeypatch):
        def refused(*_, **__):
            raise PermissionError(13, "Permission denied", "answers/model.json")

        monkeypatch.setattr("selector.fleet.machine_study.known_answer", refused)
        found = answered(task(again))
        self.told(found, "Permission denied", "answers/model.json")
        assert "defect" not in found.error

    def test_a_results_folder_that_cannot_be_written(self, again):
        shutil.rmtree(again / "results")
        (again / "results").write_text("a file")
        assert answered(task(again)).status == "failed"

    def test_a_recording_that_grows_meanwhile(self, again, monkeypatch):
        from selector.fleet import machine_study

        shutil.rmtree(again / "results")
        before = machine_study.study_data

        def grown(*arguments):
            with (again / "m" / "r1.csv").open("a", encoding="utf-8") as file:
                file.write("2400,20,20,20,20,1\n")
            return before(*arguments)

        monkeypatch.setattr(machine_study, "study_data", grown)
        self.told(answered(task(again)), "changed while it was read")


def test_a_url_is_the_same_machine(done, again):
    pytest.importorskip("fsspec")
    url = f"file://{(again / 'm').as_posix()}"
    for named in (f'"{url}"', f'["{url}/*.csv"]'):
        found = answered(task(again, f"[machines]\nm = {named}"))
        assert (found.status, found.key) == ("reused", done[1].key)
    found = answered(task(again, f'[machines]\nm = "{url}-nowhere"'))
    assert found.status == "failed"
    assert f"{url}-nowhere" in found.error


@pytest.mark.parametrize(("url", "asked"), [("memory://plant/*", "glob"), ("memory://plant/m", "isdir")])
def test_a_server_that_cannot_be_reached_is_told_and_no_defect(url, asked, tmp_path, monkeypatch):
    def unreached(*_, **__):
        raise RuntimeError("could not connect")  # botocore's errors are no OSError either

    monkeypatch.setattr(f"fsspec.implementations.memory.MemoryFileSystem.{asked}", unreached)
    with pytest.raises(ReadError, match="could not connect") as told:
        local_paths([url], tmp_path)
    assert told.value.where == url


def test_a_url_without_fsspec_says_what_to_install(again, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "fsspec", None)
    monkeypatch.setitem(__import__("sys").modules, "fsspec.core", None)
    found = answered(task(again, '[machines]\nm = "s3://bucket/m"'))
    assert 'pip install ".[fleet]"' in found.error
