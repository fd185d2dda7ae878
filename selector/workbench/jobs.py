"""Long work: the command line itself, run in a child process, one at a time, with progress and cancel.

So a result of the workbench is the result of the command that is shown, byte by byte; a command that runs wild can be
ended; and what it writes is written whole or not at all, because that is how the command line writes.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from selector.errors import InputError, OptionError
from selector.workbench.study_folder import trouble_with

State = Literal["queued", "running", "done", "failed", "cancelled"]

GRACE_S = 4.0  #: How long a command that was asked to end may take for it before it is ended.

_KEPT_LINES = 2000
_IS_WINDOWS = os.name == "nt"


@dataclass(frozen=True)
class Job:
    """One command: its number, title, words after ``selector``, the folder it writes; and how far it has come."""

    number: int
    title: str
    command: tuple[str, ...]
    out: Path | None = None
    state: State = "queued"  #: {"queued", "running", "done", "failed", "cancelled"}
    doing: str = ""  #: What it does now, in its own words
    share: float | None = None  #: Share of the work that is done, where it is known
    said: str = ""  #: What it printed: its answer, or when it failed, why and what to do
    data: dict[str, Any] | None = None  #: Its answer, if it was asked to say it as ``--json``
    #: What is wrong with the study folder, if that is why it failed, or why what it wrote is not there
    problem: InputError | None = None

    @property
    def is_over(self) -> bool:
        """Whether nothing of it is to come."""
        return self.state in ("done", "failed", "cancelled")


class Jobs:
    """The commands of one study, in the order in which they were started; safe to be used by several threads.

    `on_end` is called after a job has ended, with it, in the thread that ran it.
    """

    def __init__(self, folder: Path, on_end: Callable[[Job], None] = lambda job: None) -> None:
        self._folder = folder
        self._on_end = on_end
        self._lock = threading.Condition()
        self._jobs: list[Job] = []
        self._child: tuple[int, subprocess.Popen[str]] | None = None
        self._is_closed = False
        self._worker: threading.Thread | None = None

    @property
    def all(self) -> tuple[Job, ...]:
        """Every job, the oldest first."""
        with self._lock:
            return tuple(self._jobs)

    @property
    def current(self) -> Job | None:
        """The job that runs, or the next one in the queue."""
        return next((job for job in self.all if not job.is_over), None)

    def start(self, title: str, command: Sequence[str], out: Path | None = None) -> Job:
        """Puts a command (the words after ``selector``) at the end of the queue; `out` is the folder it writes."""
        with self._lock:
            job = Job(len(self._jobs), title, tuple(command), out)
            self._jobs.append(job)
            if self._worker is None:
                self._worker = threading.Thread(target=self._work, name="selector-jobs", daemon=True)
                self._worker.start()
            self._lock.notify_all()
        return job

    def cancel(self, number: int) -> None:
        """Ends a job: one that waits is taken out of the queue, one that runs is stopped, within `GRACE_S`."""
        with self._lock:
            if not 0 <= number < len(self._jobs) or self._jobs[number].is_over:
                return
            self._change(number, state="cancelled", doing="")
            child = self._child[1] if self._child is not None and self._child[0] == number else None
        if child is not None:
            threading.Thread(target=_end, args=(child,), name="selector-end", daemon=True).start()

    def close(self) -> None:
        """Cancels everything and waits until no child is left."""
        with self._lock:
            self._is_closed = True
            self._lock.notify_all()
        for job in self.all:
            self.cancel(job.number)
        if self._worker is not None:
            self._worker.join()

    def _change(self, number: int, **changes: object) -> Job:
        self._jobs[number] = replace(self._jobs[number], **changes)  # type: ignore[arg-type]
        self._lock.notify_all()
        return self._jobs[number]

    def _work(self) -> None:
        while True:
            with self._lock:
                self._lock.wait_for(lambda: self._is_closed or self.current is not None)
                job = self.current
                if job is None:
                    return
                try:
                    child = _started(job.command, self._folder)
                except OSError as error:
                    said, problem = f"not started: {error.strerror or error}", trouble_with(self._folder)
                    self._on_end(self._change(job.number, state="failed", said=said, problem=problem))
                    continue
                self._change(job.number, state="running")
                self._child = (job.number, child)
            with child:
                said = self._heard(job.number, child)
            # what a command that was ended by force had begun to write beside its folder
            for part in [] if job.out is None else job.out.parent.glob(f".{job.out.name[:60]}.*.part"):
                shutil.rmtree(part, ignore_errors=True)
            problem = trouble_with(self._folder) if child.returncode else _lost(self._folder, job.out)
            is_done = child.returncode == 0 and problem is None
            with self._lock:
                self._child = None
                ended = self._jobs[job.number]
                if ended.state != "cancelled":
                    state: State = "done" if is_done else "failed"
                    data = _data(said) if is_done and "--json" in job.command else None
                    ended = self._change(job.number, state=state, said=said, data=data, doing="", problem=problem)
            self._on_end(ended)

    def _heard(self, number: int, child: subprocess.Popen[str]) -> str:
        """Follows a child to its end; what it said for people."""
        answer: deque[str] = deque(maxlen=_KEPT_LINES)
        messages: deque[str] = deque(maxlen=_KEPT_LINES)
        said, told = ((line.rstrip("\n") for line in stream or ()) for stream in (child.stdout, child.stderr))
        listener = threading.Thread(target=answer.extend, args=(said,), daemon=True)
        listener.start()
        for line in told:
            progress = _progress(line)
            if progress is None:
                messages.append(line)
                continue
            with self._lock:
                if self._jobs[number].state == "running":
                    self._change(number, doing=progress[0], share=progress[1])
        listener.join()
        return "\n".join([*answer, *messages]).strip()


def _started(command: Sequence[str], folder: Path) -> subprocess.Popen[str]:
    """The command in a process, and a group, of its own. Nothing of `folder` can be taken for a module (-P)."""
    package = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONIOENCODING": "utf-8", "SELECTOR_PROGRESS": "lines"}
    own_group: dict[str, object] = (
        {"creationflags": getattr(subprocess, "CREATE_NO_WINDOW", 0)} if _IS_WINDOWS else {"start_new_session": True}
    )
    return subprocess.Popen(  # noqa: S603 (a list of words; no shell)
        [sys.executable, "-P", "-m", "selector", *command],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        **own_group,  # type: ignore[call-overload]
    )


def _end(child: subprocess.Popen[str]) -> None:
    """Asks for an end as Ctrl-C does, so that the command cleans up; then ends it and its children."""
    if _IS_WINDOWS:
        tree = ["taskkill", "/T", "/F", "/PID", str(child.pid)]
        subprocess.run(tree, capture_output=True, check=False)  # noqa: S603
        child.kill()
        return
    for asked in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(child.pid, asked)
            child.wait(GRACE_S)
        except ProcessLookupError:
            return  # nobody of its group is left
        except subprocess.TimeoutExpired:
            continue


def _lost(folder: Path, out: Path | None) -> OptionError | None:
    """Why the result of a command that ended well is not where it belongs; None: it is there."""
    if out is None or out.is_dir():
        return None
    return trouble_with(folder) or OptionError(
        f"the command ended, and {out.name} is not in the study folder",
        expected=str(out),
        where=str(folder),
        advice="see whether the study folder was moved meanwhile: the result is where it is now; or start again",
    )


def _data(said: str) -> dict[str, Any] | None:
    """The object that a command said, messages behind it left out."""
    try:
        found = json.JSONDecoder().raw_decode(said)[0]
        return found if isinstance(found, dict) else None
    except ValueError:
        return None


def _progress(line: str) -> tuple[str, float | None] | None:
    """(doing, share) of a line of progress, see `SELECTOR_PROGRESS`; None: it is a message."""
    if not line.startswith('{"doing"'):
        return None
    try:
        told = json.loads(line)
        return str(told["doing"]), None if told["share"] is None else float(told["share"])
    except (ValueError, KeyError, TypeError):
        return None
