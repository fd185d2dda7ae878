"""Which study when, what is tried again and what is kept; with workers that die, hang and answer as they are told."""

import errno
import json
import os
import re
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from selector.cli import exit_status
from selector.errors import OptionError, ResultError, StudyError
from selector.fleet import RESULT_FILE, Answer, Processes, answered, read_answer, read_fleet, run_fleet
from selector.fleet.machine_study import Task
from selector.telling.fleet import fleet_account
from tests.fleet.machines import Here, fleet_file, machine
from tests.patience import PATIENCE_S


class Told:
    """Workers that do with each machine what `script` says for each try: an answer, "dies", "hangs", "stop"."""

    def __init__(self, script, jobs=2):
        self.script = {name: list(tries) for name, tries in script.items()}
        self.jobs, self.busy, self.begun, self.stopped, self.closed = jobs, {}, [], [], False

    @property
    def free(self):
        return self.jobs - len(self.busy)

    def start(self, task):
        assert self.free > 0
        self.begun.append(task.name)
        self.busy[task.name] = self.script[task.name].pop(0)

    def finished(self, timeout_s):
        ended = {name: what for name, what in self.busy.items() if what != "hangs"}
        for name, what in ended.items():
            if what == "stop":
                raise KeyboardInterrupt
            del self.busy[name]
            yield name, None if what == "dies" else what

    def stop(self, name):
        del self.busy[name]
        self.stopped.append(name)

    def close(self):
        self.closed = True


DONE = Answer(status="done", key="k", sensors=("T1",), heldout_rmse_um={"Z": 1.0}, seconds=2.0)


@pytest.fixture
def fleet(tmp_path):
    """Four machines whose studies nobody does."""
    return read_fleet(fleet_file(tmp_path, "[machines]\n" + "".join(f'm{i} = "m{i}"\n' for i in range(4))))


def test_reasons_of_many_machines_leave_the_screen_its_forty_lines(tmp_path, capsys):
    reason = "a folder without recordings. Expected: files that end in .csv. What to do: " + "name the folder " * 8
    given = {f"m{i:02d}": Answer(status="failed", error=reason) for i in range(30)}
    path = fleet_file(tmp_path, "[machines]\n" + "".join(f'{name} = "{name}"\n' for name in given))
    run_fleet(read_fleet(path), Told({name: [one] for name, one in given.items()}), refit=False)
    assert exit_status(["fleet", "report", str(path)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) <= 40
    # the worst first, and where the others are
    assert any("m00" in line for line in shown)
    assert not any("m29" in line for line in shown)
    assert "Everything else that is known is in the page." in shown


@pytest.mark.parametrize("command", ["run", "watch"])
def test_results_that_cannot_be_kept_are_told_before_any_machine_is_looked_at(tmp_path, capsys, command):
    (tmp_path / "taken").write_text("a file\n", encoding="utf-8")
    path = fleet_file(tmp_path, 'results = "taken"\n[machines]\nm0 = "m0"\n')
    assert exit_status(["fleet", command, str(path)]) == 2
    told = capsys.readouterr().err
    assert "a file of this name exists" in told
    assert f"results {tmp_path / 'taken'}" in told
    assert "m0" not in told


def test_all_are_answered_in_the_order_of_the_file(fleet):
    workers = Told({f"m{i}": [DONE] for i in range(4)})
    told = []
    answer = run_fleet(fleet, workers, lambda *said: told.append(said))
    assert list(answer.machines) == ["m0", "m1", "m2", "m3"]
    assert (answer.done, answer.reused, answer.failed) == (4, 0, 0)
    assert [said[2:] for said in told] == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert workers.closed
    assert read_answer(fleet.results) == answer
    written = json.loads((fleet.results / RESULT_FILE).read_text(encoding="utf-8"))
    assert written["schema"] == "selector.fleet/1"


def test_a_worker_that_dies_is_tried_once_more(fleet):
    workers = Told({"m0": ["dies", DONE], "m1": ["dies", "dies"], "m2": [DONE], "m3": [DONE]})
    answer = run_fleet(fleet, workers)
    assert (answer.done, answer.failed) == (3, 1)
    assert "2 times" in answer.machines["m1"].error
    assert sorted(workers.begun) == ["m0", "m0", "m1", "m1", "m2", "m3"]


def test_one_that_hangs_is_ended_and_the_others_go_on(fleet, monkeypatch):
    monkeypatch.setattr("selector.fleet.running.GRACE_S", 0.0)
    monkeypatch.setattr("selector.fleet.running.time.monotonic", iter(range(0, 10**6, 100)).__next__)
    workers = Told({"m0": ["hangs"], "m1": [DONE], "m2": ["hangs"], "m3": [DONE]})
    answer = run_fleet(fleet, workers)
    assert workers.stopped == ["m0", "m2"]
    assert "3600 s" in answer.machines["m0"].error
    assert (answer.done, answer.failed) == (2, 2)


def test_one_that_takes_too_much_memory_is_ended_and_not_tried_again(tmp_path, monkeypatch):
    monkeypatch.setattr(Processes, "least_gb", lambda _: 0.0)
    for number in range(2):
        machine(tmp_path / f"m{number}", number)
    names = '[machines]\nm0 = "m0"\nm1 = "m1"\n'
    # a process has more than 10 MB before it has read anything
    small = read_fleet(fleet_file(tmp_path, f"memory_limit_gb = 0.01\n{names}"))
    told = []
    answer = run_fleet(small, Processes(2), lambda *said: told.append(said[0]))
    assert (answer.failed, sorted(told)) == (2, ["m0", "m1"])
    for one in answer.machines.values():
        took, limit = re.match(r"it took ([\d.]+) GB, and memory_limit_gb is ([\d.]+): raise it", one.error).groups()
        assert 0.01 < float(took) < 4.0
        assert float(limit) == 0.01
    enough = read_fleet(fleet_file(tmp_path, f"memory_limit_gb = 4\n{names}"))
    assert run_fleet(enough, Processes(1)).done == 2


def test_a_limit_that_the_program_itself_does_not_keep_is_told_before_the_start(tmp_path, capsys):
    machine(tmp_path / "m", 1)
    path = fleet_file(tmp_path, 'memory_limit_gb = 0.01\n[machines]\nm = "m"\n')
    assert exit_status(["fleet", "run", str(path), "--jobs", "1"]) == 2
    told = capsys.readouterr().err
    assert "memory_limit_gb" in told
    assert not (tmp_path / "results").exists()
    workers, fleet = Processes(1), read_fleet(path)
    least_gb = workers.least_gb()
    # what two processes hold after the same differs by less than a fifth; a study that fails at once needs half of it
    assert float(re.search(r"more than ([\d.]+) GB", told)[1]) == pytest.approx(least_gb, rel=0.2)
    workers.start(Task("m", fleet.studies["m"], fleet.results, PATIENCE_S))
    while not (ended := workers.finished(1.0)):
        pass
    assert ended[0][1].status == "done"
    assert workers.taken_gb("m") == 0.0
    assert workers.taken_gb("") == pytest.approx(least_gb, rel=0.2)
    workers.close()


def test_a_limit_of_memory_that_cannot_be_looked_at_is_told_before_the_start(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "psutil", None)
    path = fleet_file(tmp_path, 'memory_limit_gb = 1\n[machines]\nm = "m"\n')
    assert exit_status(["fleet", "run", str(path)]) == 2
    told = capsys.readouterr().err
    assert 'pip install ".[fleet]"' in told
    assert not (tmp_path / "results").exists()


def test_ctrl_c_keeps_what_is_done(fleet):
    workers = Told({"m0": [DONE], "m1": [DONE], "m2": ["stop"], "m3": [DONE]})
    with pytest.raises(KeyboardInterrupt):
        run_fleet(fleet, workers)
    assert workers.closed
    assert list(read_answer(fleet.results).machines) == ["m0", "m1"]


def test_a_results_folder_of_another_fleet_is_told_and_left_as_it_was(fleet):
    run_fleet(fleet, Told({f"m{i}": [DONE] for i in range(4)}))
    before = (fleet.results / RESULT_FILE).read_bytes()
    other = replace(fleet, studies={"mill": fleet.studies["m0"]})
    workers = Told({"mill": [DONE]})
    for refit in (False, True):
        with pytest.raises(StudyError, match="m0, m1, m2, m3"):
            run_fleet(other, workers, refit=refit)
    assert workers.begun == []
    assert (fleet.results / RESULT_FILE).read_bytes() == before
    # machines may come and go, as long as one is left
    run_fleet(
        replace(fleet, studies={"mill": fleet.studies["m0"], "m1": fleet.studies["m1"]}),
        Told({"mill": [DONE], "m1": [DONE]}),
    )


def test_another_fleet_that_began_in_the_same_empty_folder_meanwhile_loses_nothing(fleet):
    other = replace(fleet, studies={"mill": fleet.studies["m0"]})

    class Meanwhile(Told):
        def start(self, task):
            if task.name == "m2":
                run_fleet(other, Told({"mill": [DONE]}))
            super().start(task)

    workers = Meanwhile({f"m{i}": [DONE] for i in range(4)}, jobs=1)
    with pytest.raises(StudyError, match="answers of other machines: mill"):
        run_fleet(fleet, workers)
    assert workers.closed
    assert list(read_answer(fleet.results).machines) == ["mill"]


@pytest.mark.parametrize(("command", "file"), [("run", RESULT_FILE), ("watch", "watch.json"), ("report", "fleet.html")])
def test_a_file_of_somebody_else_is_not_written_over(tmp_path, command, file, monkeypatch, capsys):
    monkeypatch.setattr("selector.fleet.Processes", lambda _: Here())
    machine(tmp_path / "m", 1, n_runs=2)
    path = fleet_file(tmp_path, 'results = "."\n[machines]\nm = "m"\n')
    for name in dict.fromkeys(("run", command)):
        # what the command wrote before gives way
        assert [exit_status(["fleet", name, str(path)]) for _ in range(2)] == [0, 0]
    (tmp_path / file).write_text("what I know of the fleet")
    capsys.readouterr()
    assert exit_status(["fleet", command, str(path)]) == 2
    assert "which this command did not write" in capsys.readouterr().err
    assert (tmp_path / file).read_text() == "what I know of the fleet"
    (tmp_path / file).write_text("")  # as a computer that went down may leave it: nobody's
    assert exit_status(["fleet", command, str(path)]) == 0


def test_a_full_disk_ends_the_fleet_and_is_no_fault_of_its_machines(fleet, monkeypatch):
    unkept = Answer(status="failed", error="…: No space left on device", is_unkept=True)
    workers = Told({"m0": [DONE], "m1": [unkept], "m2": [DONE], "m3": [DONE]}, jobs=1)
    with pytest.raises(OptionError, match="the answer of m1 cannot be kept: …: No space left"):
        run_fleet(fleet, workers)
    assert workers.closed
    assert workers.begun == ["m0", "m1"]
    assert list(read_answer(fleet.results).machines) == ["m0"]

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("selector.atomic_file.os.fsync", full)
    with pytest.raises(OptionError, match="the same command: it goes on") as told:
        run_fleet(fleet, Told({f"m{i}": [DONE] for i in range(4)}))
    assert str(fleet.results) in told.value.where
    assert list(read_answer(fleet.results).machines) == ["m0"]


def test_what_a_study_could_not_write_is_known_from_what_it_could_not_do(tmp_path, monkeypatch):
    machine(tmp_path / "m", 1)
    fleet = read_fleet(fleet_file(tmp_path, '[machines]\nm = "m"\nn = "n"'))
    tasks = [Task(name, study, fleet.results, PATIENCE_S) for name, study in fleet.studies.items()]

    def failing(number):
        def fsync(_):
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr("selector.atomic_file.os.fsync", fsync)
        return [answered(task) for task in tasks]

    assert [one.is_unkept for one in failing(errno.ENOSPC)] == [True, False]
    refused = failing(errno.EACCES)[0]
    assert (refused.status, refused.is_unkept) == ("failed", False)
    assert "is_unkept" not in refused.model_dump()


def test_a_folder_without_results_is_told(tmp_path):
    with pytest.raises(ResultError, match="fleet"):
        read_answer(tmp_path)
    (tmp_path / RESULT_FILE).mkdir()
    with pytest.raises(ResultError, match=r"something else \(.*directory"):  # as where it may not be read
        read_answer(tmp_path)
    (tmp_path / RESULT_FILE).rmdir()
    (tmp_path / RESULT_FILE).write_text("{}")
    with pytest.raises(ResultError, match="something else"):
        read_answer(tmp_path)


class TestProcesses:
    @pytest.fixture
    def workers(self):
        """One process."""
        workers = Processes(1)
        yield workers
        workers.close()

    def task(self, folder, name="m"):
        fleet = read_fleet(fleet_file(folder, f'[machines]\n{name} = "{name}"'))
        return Task(name, fleet.studies[name], fleet.results, PATIENCE_S)

    def ended(self, workers):
        stop = time.monotonic() + PATIENCE_S
        while time.monotonic() < stop:
            found = workers.finished(0.05)
            if found:
                return found
        return pytest.fail("no answer")

    def test_one_that_is_killed_is_found_and_another_takes_its_place(self, workers, tmp_path):
        machine(tmp_path / "m", 1)
        workers.start(self.task(tmp_path))
        assert workers.free == 0
        (process, _) = workers._busy["m"]
        os.kill(process.pid, signal.SIGKILL)
        assert self.ended(workers) == [("m", None)]
        workers.start(self.task(tmp_path))
        ((name, answer),) = self.ended(workers)
        assert (name, answer.status) == ("m", "done"), answer.error
        assert workers._idle[0][0].pid != process.pid
        # the same process does the next one, and one that died while it rested is found, too
        workers.start(self.task(tmp_path))
        assert self.ended(workers)[0][1].status == "reused"
        os.kill(workers._idle[0][0].pid, signal.SIGKILL)
        workers._idle[0][0].join()
        workers.start(self.task(tmp_path))
        assert self.ended(workers) == [("m", None)]

    def test_the_server_that_starts_them_may_be_killed_too(self, workers, tmp_path):
        from multiprocessing import forkserver

        machine(tmp_path / "m", 1)
        workers.start(self.task(tmp_path))
        os.kill(forkserver._forkserver._forkserver_pid, signal.SIGKILL)
        # its end looks like that of its workers
        assert self.ended(workers) in ([("m", None)], [("m", DONE)])
        workers.start(self.task(tmp_path))
        (answer,) = [answer for _, answer in self.ended(workers)]
        assert answer.status in ("done", "reused")

    @pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="what a process blocks is read from /proc")
    def test_ctrl_c_does_not_reach_the_server_while_it_loads(self, workers):
        from multiprocessing import forkserver

        # one that runs already may have been started by something else
        forkserver._forkserver._stop()
        workers._idle.append(workers._new())
        status = Path(f"/proc/{forkserver._forkserver._forkserver_pid}/status").read_text()
        blocked = int(re.search(r"SigBlk:\s*(\w+)", status)[1], 16)
        assert blocked >> (signal.SIGINT - 1) & 1
        assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())

    def test_ctrl_c_is_heard_again_where_the_server_cannot_be_started(self, workers, monkeypatch):
        def none():
            raise BlockingIOError(errno.EAGAIN, "too many processes")

        monkeypatch.setattr("selector.fleet.workers._BIRTH_WAIT_S", 0.0)
        monkeypatch.setattr("multiprocessing.forkserver.ensure_running", none)
        heard = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        try:
            with pytest.raises(BlockingIOError):
                workers._new()
            assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == heard
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, heard)

    def test_one_that_is_stopped_never_answers(self, workers, tmp_path):
        machine(tmp_path / "m", 1)
        workers.start(self.task(tmp_path))
        process = workers._busy["m"][0]
        workers.stop("m")
        assert not process.is_alive()
        assert workers.free == 1
        assert workers.finished(0.0) == []


def test_recordings_that_several_machines_have_are_told_as_that(tmp_path):
    for k, name in enumerate(("a", "b", "c", "d")):
        machine(tmp_path / name, k)
    for file in (tmp_path / "a").iterdir():
        (tmp_path / "b" / file.name).write_bytes(file.read_bytes())
    # one file was put into the folder of another machine, under another name
    (tmp_path / "c" / "r9.csv").write_bytes((tmp_path / "d" / "r2.csv").read_bytes())
    names = "".join(f'{name} = "{name}"\n' for name in "abcd")
    asked = read_fleet(
        fleet_file(tmp_path, f"[machines]\n{names}[select]\nresponses = ['Z']\nmax_sensors = 1\ndegree = 1\n")
    )
    answer = run_fleet(asked, Here())
    assert (answer.done, answer.reused) == (3, 1)
    found = {one.machines: one.runs for one in answer.shared}
    assert found == {("a", "b"): ("r1", "r2", "r3", "r4"), ("c", "d"): ("r9",)}
    assert read_answer(asked.results) == answer
    told = " ".join(fleet_account(answer).sentences)
    assert "earlier run" not in told
    assert "a and b have the same recordings" in told
    # the next run has its answers of this one
    again = fleet_account(run_fleet(asked, Here()))
    assert "4 of them from an earlier run" in " ".join(again.sentences)
    assert again.data["shared"][0]["machines"] == ("a", "b")
