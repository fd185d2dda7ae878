"""Results behind a URL: everything that a fleet does with a folder, and what is told where the server refuses."""

import json
import pickle

import pytest

from selector.atomic_file import require_writable_folder
from selector.cli import exit_status
from selector.errors import StorageError
from selector.fleet import read_fleet, run_fleet
from selector.fleet.places import found_by, results_at
from tests.fleet.machines import Here, changed, fleet_file, machine

fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed")
memory = pytest.importorskip("fsspec.implementations.memory", reason="fsspec is not installed")
MEMORY = "fsspec.implementations.memory.MemoryFileSystem"


@pytest.fixture
def fleet(tmp_path, monkeypatch):
    """Two machines with six runs each, whose answers will lie in the memory of this process."""
    monkeypatch.setattr("selector.fleet.Processes", lambda _: Here())
    monkeypatch.setattr(f"{MEMORY}.store", {})
    monkeypatch.setattr(f"{MEMORY}.pseudo_dirs", [""])
    for number in range(2):
        machine(tmp_path / "plant" / f"m{number}", number, n_runs=6)
    text = 'folders = ["plant/*"]\nresults = "memory://shop/answers"\n'
    return fleet_file(tmp_path, text)


def said(capsys, *arguments):
    """What a command prints as JSON."""
    assert exit_status(["fleet", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_year_of_a_fleet(fleet, capsys):
    folder = fleet.parent / "plant" / "m1"
    first = said(capsys, "run", fleet)
    assert (first["done"], said(capsys, "run", fleet)["reused"]) == (2, 2)
    machine(folder, 1, n_runs=16)
    changed(folder, range(7, 17), lambda table: table.update(2.0 * table[["Z [um]"]]))
    assert said(capsys, "watch", fleet)["machines"]["m1"]["status"] == "alarm"
    new = said(capsys, "run", fleet, "--refit")["machines"]["m1"]
    assert new["refit"]["promoted"], new["refit"]["because"]
    assert new["key"] != first["machines"]["m1"]["key"]
    assert said(capsys, "watch", fleet)["machines"]["m1"]["status"] == "nothing-new"
    report = said(capsys, "report", fleet)
    assert report["machines"]["m1"]["key"] == new["key"]
    place = results_at("memory://shop/answers", fleet.parent)
    assert b"places" in (pickle.loads(pickle.dumps(place)) / "fleet.html").read_bytes()
    # nothing but what a folder has
    files = {name.rpartition("/")[2] for name in fsspec.filesystem("memory").find("/shop")}
    assert files == {"fleet.json", "watch.json", "fleet.html", "selection.json", "model.json", "done.json"}


@pytest.mark.parametrize("error", [PermissionError("403"), RuntimeError("could not connect"), FileNotFoundError("404")])
@pytest.mark.parametrize("command", ["run", "watch"])
def test_a_place_that_refuses_is_told_before_any_machine_is_looked_at(fleet, command, error, monkeypatch, capsys):
    def refused(*_, **__):
        raise error

    monkeypatch.setattr(f"{MEMORY}.pipe_file", refused)
    assert exit_status(["fleet", command, str(fleet)]) == 2
    told = capsys.readouterr().err
    assert all(word in told for word in (str(error), "memory://shop/answers", "Expected", "What to do"))
    assert "m0" not in told


def test_a_server_that_is_lost_ends_the_fleet_and_it_goes_on_from_there(fleet, monkeypatch, capsys):
    put, count = memory.MemoryFileSystem.pipe_file, []

    def lost(self, path, value, **how):
        count.append(path)
        if len(count) > 5:
            raise RuntimeError("could not connect")
        put(self, path, value, **how)

    with monkeypatch.context() as patch:
        patch.setattr(f"{MEMORY}.pipe_file", lost)
        assert exit_status(["fleet", "run", str(fleet), "--json"]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert "could not connect" in told.err
    assert "the same command" in told.err
    # one trial, three files of the first machine, the first of the second
    again = said(capsys, "run", fleet)
    assert (again["done"], again["reused"], again["failed"]) == (1, 1, 0)


def test_a_server_that_is_not_reached_costs_no_model_that_is_in_use(fleet, monkeypatch):
    asked = read_fleet(fleet)
    before = run_fleet(asked, Here())
    machine(fleet.parent / "plant" / "m1", 1, n_runs=16)
    read = memory.MemoryFileSystem.cat_file

    def lost(self, path, **how):
        if path.endswith("model.json"):
            raise RuntimeError("could not connect")
        return read(self, path, **how)

    with monkeypatch.context() as patch:
        patch.setattr(f"{MEMORY}.cat_file", lost)
        with pytest.raises(StorageError, match="could not connect"):
            run_fleet(asked, Here(), refit=True)
    machines = run_fleet(asked, Here(), refit=True).machines
    assert {name: one.key for name, one in machines.items()} == {name: one.key for name, one in before.machines.items()}


def test_a_url_where_nothing_can_be_kept(tmp_path):
    (tmp_path / "taken").write_text("a file")
    for url, found in (("nosuch://a/b", "nosuch"), (f"{(tmp_path / 'taken').as_uri()}/b", "cannot be used")):
        with pytest.raises(StorageError, match=found) as told:
            require_writable_folder(results_at(url, tmp_path), "results")
        assert told.value.where.startswith(url)


def test_a_password_is_told_to_nobody(tmp_path):
    place = results_at("nosuch://shop:secret@server/share", tmp_path) / "fleet.json"
    with pytest.raises(StorageError) as told:
        place.read_bytes()
    assert "server/share/fleet.json" in told.value.where
    assert "secret" not in f"{place} {told.value}"


def test_a_pattern_keeps_the_server_that_its_file_system_forgets():
    class Share(fsspec.AbstractFileSystem):
        """As that of SMB: paths without their server, folders with a slash at their end."""

        protocol = "share"

        @classmethod
        def _strip_protocol(cls, path):
            return f"/{path.partition('://')[2].partition('/')[2]}" if "://" in path else path

        def ls(self, path, detail=True, **_):
            inside = {"/plant/m1/": "directory", "/plant/notes": "file"} if path.rstrip("/") == "/plant" else {}
            return [{"name": name, "type": kind, "size": 0} for name, kind in inside.items()] if detail else [*inside]

    fsspec.register_implementation("share", Share, clobber=True)
    found = ["share://user@server:445/plant/m1", "share://user@server:445/plant/notes"]
    assert found_by("share://user@server:445/plant/*") == found
