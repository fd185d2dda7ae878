"""Commands run one at a time, tell how far they are, and end when they are told to."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest
from plotly.utils import PlotlyJSONEncoder

from selector.shipped import shipped
from selector.workbench import jobs as jobs_module
from selector.workbench.jobs import Job, Jobs
from selector.workbench.parts import job_answer
from tests.patience import wait_for

PATENT = shipped("patent8")
SELECT = (
    "select", str(PATENT / "recording.csv"), "--machine", str(PATENT / "machine.toml"), "--response", "Z",
    "--max-sensors", "2", "--out", "selection",
)  # fmt: skip


def waited(jobs: Jobs, number: int) -> Job:
    wait_for(lambda: jobs.all[number].is_over)
    return jobs.all[number]


@pytest.fixture
def jobs(tmp_path):
    made = Jobs(tmp_path)
    yield made
    made.close()


@pytest.fixture
def program(monkeypatch, tmp_path):
    """Starts a Python text instead of the command line; the words of the command are its arguments."""

    def use(text: str) -> None:
        path = tmp_path / "program.py"
        path.write_text(text, encoding="utf-8")
        real = jobs_module.subprocess.Popen

        def started(words, **options):
            return real([sys.executable, str(path), *words[words.index("selector") + 1 :]], **options)

        monkeypatch.setattr(jobs_module.subprocess, "Popen", started)

    return use


def test_a_selection_is_the_one_of_the_command_line(jobs, tmp_path):
    seen = []
    jobs.start("Selection", SELECT, tmp_path / "selection")
    wait_for(lambda: seen.append((jobs.all[0].doing, jobs.all[0].share)) or jobs.all[0].is_over)
    job = waited(jobs, 0)
    assert job.state == "done", job.said
    assert "Keep " in job.said
    assert {path.name for path in (tmp_path / "selection").iterdir()} >= {"selection.json", "model.json", "report.html"}
    assert any(share is not None and 0 < share < 1 for _, share in seen)
    assert '{"doing"' not in job.said


def test_what_fails_says_what_the_command_says(jobs):
    jobs.start("Selection", ("select", "nothing.csv"))
    job = waited(jobs, 0)
    assert job.state == "failed"
    assert "nothing.csv" in job.said
    assert "What to do" in job.said
    assert "Traceback" not in job.said


def test_progress_is_told(jobs, program, tmp_path):
    program(
        "import os, sys, time\n"
        'print(\'{"doing": "folds", "share": 0.25}\', file=sys.stderr, flush=True)\n'
        "print('{\"doing\": broken', file=sys.stderr, flush=True)\n"
        "while not os.path.exists('seen'): time.sleep(0.01)\n"
        "print('an answer')\n"
    )
    jobs.start("Work", ())
    wait_for(lambda: jobs.all[0].share is not None)
    assert (jobs.all[0].doing, jobs.all[0].share, jobs.all[0].state) == ("folds", 0.25, "running")
    (tmp_path / "seen").touch()
    assert waited(jobs, 0).said == 'an answer\n{"doing": broken'


def test_cancel_ends_the_child_and_its_children(jobs, program, tmp_path):
    """Children, too, that do not listen to Ctrl-C as their parent does."""
    program(
        "import os, subprocess, sys, time\n"
        "code = 'import signal, time; signal.signal(2, signal.SIG_IGN); print(1, flush=True); time.sleep(3000)'\n"
        "child = subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE); child.stdout.readline()\n"
        "open('pids', 'w').write(f'{os.getpid()} {child.pid}')\n"
        'print(\'{"doing": "x", "share": null}\', file=sys.stderr, flush=True)\n'
        "time.sleep(3000)\n"
    )
    jobs.start("Work", ())
    wait_for(lambda: jobs.all[0].doing == "x")
    pids = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    jobs.cancel(0)
    assert jobs.all[0].state == "cancelled"
    wait_for(lambda: not any(lives(pid) for pid in pids))


def test_a_child_that_does_not_listen_is_ended_all_the_same(jobs, program, tmp_path, monkeypatch):
    monkeypatch.setattr(jobs_module, "GRACE_S", 0.3)
    program(
        "import os, signal, sys, time\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN); signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "open('pids', 'w').write(str(os.getpid()))\n"
        "os.mkdir('.result.0123.part'); open('.result.0123.part/half', 'w').write('half')\n"
        'print(\'{"doing": "x", "share": null}\', file=sys.stderr, flush=True)\n'
        "time.sleep(3000)\n"
    )
    jobs.start("Work", (), tmp_path / "result")
    wait_for(lambda: jobs.all[0].doing == "x")
    jobs.cancel(0)
    pid = int((tmp_path / "pids").read_text())
    wait_for(lambda: not lives(pid))
    jobs.close()
    assert list(tmp_path.glob(".result*")) == []


def test_one_at_a_time_and_the_queue_can_be_left(jobs, program, tmp_path):
    program("import os, time\nwhile not os.path.exists('go'): time.sleep(0.01)\n")
    for number in range(3):
        jobs.start(f"Work {number}", ())
    wait_for(lambda: jobs.all[0].state == "running")
    assert [job.state for job in jobs.all] == ["running", "queued", "queued"]
    jobs.cancel(1)
    (tmp_path / "go").touch()
    assert waited(jobs, 2).state == "done"
    assert [job.state for job in jobs.all] == ["done", "cancelled", "done"]
    jobs.cancel(0)
    assert jobs.all[0].state == "done"


def test_closing_ends_everything(tmp_path, program):
    program('import sys, time; print(\'{"doing": "x", "share": 0}\', file=sys.stderr, flush=True); time.sleep(3000)')
    jobs = Jobs(tmp_path)
    jobs.start("Work", ())
    jobs.start("More", ())
    wait_for(lambda: jobs.all[0].doing == "x")
    jobs.close()
    assert [job.state for job in jobs.all] == ["cancelled", "cancelled"]


def test_files_of_the_study_are_no_modules(jobs, tmp_path):
    for name in ("numpy.py", "selector.py", "json.py"):
        (tmp_path / name).write_text("raise SystemExit('taken for a module')")
    jobs.start("Version", ("--version",))
    job = waited(jobs, 0)
    assert job.state == "done", job.said
    assert job.said.startswith("selector ")


def lives(pid: int) -> bool:
    status = Path(f"/proc/{pid}/status")
    try:
        os.kill(pid, 0)
        return not (status.exists() and "State:\tZ" in status.read_text())
    except OSError:
        # it may also go while its status is read
        return False


def test_a_study_folder_that_goes_away_is_told_before_and_while_a_command_runs(tmp_path, program):
    study = tmp_path / "study"
    study.mkdir()
    made = Jobs(study)
    program("import os, sys; os.rmdir(sys.argv[1]); sys.exit('no such file or folder')")
    made.start("Selection", (str(study),), study / "selection")
    made.start("Selection", ("select",), study / "selection")
    try:
        for number in (0, 1):
            job = waited(made, number)
            assert job.state == "failed"
            assert "folder is gone" in str(job.problem)
            shown = json.dumps(job_answer(job), cls=PlotlyJSONEncoder)
            assert "folder is gone" in shown
            assert "no such file" not in shown
    finally:
        made.close()


def test_a_result_that_went_away_with_its_folder_is_not_called_done(tmp_path, program):
    study = tmp_path / "study"
    study.mkdir()
    made = Jobs(study)
    try:
        # the child goes on in the folder that has another name now
        program("import os, sys; os.rename(*sys.argv[1:]); os.mkdir('selection')")
        made.start("Selection", (str(study), str(tmp_path / "elsewhere")), study / "selection")
        job = waited(made, 0)
        assert (job.state, "folder is gone" in str(job.problem)) == ("failed", True)
    finally:
        made.close()


def test_a_result_that_is_not_in_the_study_folder_is_told(jobs, program, tmp_path):
    program("print('done')")
    jobs.start("Selection", (), tmp_path / "selection")
    job = waited(jobs, 0)
    assert (job.state, "selection is not" in str(job.problem)) == ("failed", True)
