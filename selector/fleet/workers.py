"""Who does the studies of a fleet: processes of this computer, or a cluster of Dask."""

import contextlib
import logging
import multiprocessing
import queue
import secrets
import signal
import sys
import tempfile
import time
import warnings
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Protocol

from selector.errors import OptionError
from selector.fleet.machine_study import Answer, Task
from selector.study.study_file import Recordings, SelectSection, Study


class Work(Protocol):
    """What is to be done for a machine; it goes to a process or to another computer."""

    @property
    def name(self) -> str:
        """Of the machine."""

    def answered(self) -> Any:
        """The answer; an error is one, too."""


_BIRTHS, _BIRTH_WAIT_S = 5, 0.2
_SMALLEST = "t [s],T1 [degC],Z [um]\n" + "".join(f"{60 * i},{20 + i % 7},{i % 5}\n" for i in range(60))
NO_WORKER_S = 60.0  #: So long a cluster may be without any worker before the fleet gives up.


class Processes:
    """Processes of this computer; each does one study after the other and can be replaced alone."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        # a server with all modules and one thread, from which workers are forked at once; Windows has none
        method = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
        self._context: Any = multiprocessing.get_context(method)
        if method == "forkserver":
            self._context.set_forkserver_preload([__name__])
        self._idle: list[tuple[BaseProcess, Connection]] = []
        self._busy: dict[str, tuple[BaseProcess, Connection]] = {}
        self._unborn: list[str] = []

    @property
    def free(self) -> int:
        """How many more studies can be begun."""
        return self._jobs - len(self._busy) - len(self._unborn)

    def start(self, task: Work) -> None:
        """Begin a study."""
        try:
            process, connection = self._idle.pop() if self._idle else self._new()
        except (EOFError, OSError):
            self._unborn.append(task.name)
            return
        self._busy[task.name] = process, connection
        # a worker that died while it had nothing to do is found by `finished`
        with contextlib.suppress(OSError):
            connection.send(task)

    def finished(self, timeout_s: float) -> list[tuple[str, Any]]:
        """(machine, answer) of work that has ended; None where the worker died before it answered."""
        found: list[tuple[str, Any]] = [(name, None) for name in self._unborn]
        self._unborn = []
        ends = [end for process, connection in self._busy.values() for end in (connection, process.sentinel)]
        wait(ends, 0.0 if found else timeout_s)
        for name, (process, connection) in list(self._busy.items()):
            is_alive, answer = process.is_alive(), None
            if is_alive and not connection.poll():
                continue
            # what it said before it died counts
            with contextlib.suppress(EOFError, OSError):
                answer = connection.recv() if connection.poll() else None
            found.append((name, answer))
            if is_alive and answer is not None:
                self._idle.append((process, connection))
            else:
                _end(process, connection)
            del self._busy[name]
        return found

    def taken_gb(self, name: str) -> float:
        """Memory that the process of a study holds, program and all [GB], of "" an idle one; 0 where it is gone."""
        import psutil

        with contextlib.suppress(LookupError, psutil.Error):
            process, _ = self._busy[name] if name else self._idle[-1]
            return float(psutil.Process(process.pid).memory_info().rss) / 1e9
        return 0.0

    def least_gb(self) -> float:
        """Memory that a process holds after a study of next to nothing [GB]; it does the others, too."""
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "r.csv").write_text(_SMALLEST, encoding="ascii")
            study = Study(recordings=Recordings(runs=(folder,)), select=SelectSection())
            self.start(Task("", study, Path(folder) / "answers", 3600.0))
            while not self.finished(1.0):
                pass
        return self.taken_gb("")

    def stop(self, name: str) -> None:
        """Give a study up; it never appears in `finished`."""
        _end(*self._busy.pop(name))

    def close(self) -> None:
        """End all that is at work."""
        for process, connection in (*self._busy.values(), *self._idle):
            _end(process, connection)
        self._busy, self._idle, self._unborn = {}, [], []

    def _new(self) -> tuple[BaseProcess, Connection]:
        ours, theirs = self._context.Pipe()
        for tries_left in range(_BIRTHS - 1, -1, -1):
            process = self._context.Process(target=_serve, args=(theirs,), daemon=True)
            try:
                if self._context.get_start_method() == "forkserver":
                    # a Ctrl-C while it loads is no affair of its own: it would print where it was
                    resource_tracker.ensure_running()  # unblocks it
                    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
                    try:
                        forkserver.ensure_running()
                    finally:
                        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
                process.start()
                break
            except (EOFError, OSError):
                # the server was killed, which is seen a moment later: then there is a new one
                if not tries_left:
                    raise
                time.sleep(_BIRTH_WAIT_S)
        # else its end would stay open when it dies
        theirs.close()
        return process, ours


def _serve(connection: Connection) -> None:
    """Studies until nobody asks any more: a worker whose fleet was killed ends after the study that it is at."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    # stdout belongs to the JSON of the fleet
    sys.stdout = sys.stderr
    with contextlib.suppress(EOFError, OSError):
        while True:
            connection.send(_answered(connection.recv()))


def _answered(task: Work) -> Any:
    return task.answered()


def _end(process: BaseProcess, connection: Connection) -> None:
    process.kill()
    process.join()
    connection.close()


class Cluster:
    """The workers of a Dask scheduler; as many studies are under way as they have threads.

    They reach recordings and results under the same paths as this computer. Dask itself gives the study of a worker
    that died to another one, three times by default.

    Raises OptionError: nobody answers at the address. Raises ImportError: Dask is not installed.
    """

    def __init__(self, address: str) -> None:
        from distributed import Client

        self._address = address
        # what matters of a lost scheduler or worker is told as the error of a study, or of the fleet
        for name in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        try:
            connect: Any = Client
            self._client: Any = connect(address, timeout="20s", set_as_default=False)
        except Exception as error:  # each kind of address has errors of its own
            raise OptionError(
                f"no scheduler that answers ({error})",
                expected="the address of a Dask scheduler, such as tcp://computer:8786",
                where=f"--dask {address}",
                advice="start one with `dask scheduler`, and workers with `dask worker ADDRESS`",
            ) from error
        self._ended: queue.Queue[str] = queue.Queue()
        self._futures: dict[str, Any] = {}
        self._without_s = 0.0

    @property
    def free(self) -> int:
        """How many more studies can be begun."""
        return max(1, sum(self._threads().values())) - len(self._futures)

    def start(self, task: Work) -> None:
        """Begin a study."""
        # a key of its own: the answer to a study that failed may be another one the next time
        future = self._client.submit(_answered, task, key=f"{task.name}-{secrets.token_hex(8)}", pure=False)
        self._futures[task.name] = future
        future.add_done_callback(lambda _, name=task.name: self._ended.put(name))

    def finished(self, timeout_s: float) -> list[tuple[str, Any]]:
        """(machine, answer) of work that has ended; None where the worker died before it answered."""
        found: list[tuple[str, Any]] = []
        with contextlib.suppress(queue.Empty):
            name = self._ended.get(timeout=timeout_s)
            while True:
                if name in self._futures:
                    found.append((name, _came_of(self._futures.pop(name))))
                name = self._ended.get_nowait()
        self._without_s = 0.0 if found or self._threads() else self._without_s + timeout_s
        if self._client.status != "running" or self._without_s > NO_WORKER_S:
            lost = "the scheduler is gone" if self._client.status != "running" else "there is no worker"
            raise OptionError(
                f"{lost}, and not everything is done",
                expected="a scheduler and workers until the fleet is done",
                where=f"--dask {self._address}",
                advice="start them again and repeat the command: what is done is kept",
            )
        return found

    def taken_gb(self, _name: str = "") -> float:
        """Nothing: the memory of a worker is its own affair, and its nanny ends it."""
        return 0.0

    least_gb = taken_gb

    def stop(self, name: str) -> None:
        """Give a study up; it never appears in `finished`."""
        future = self._futures.pop(name)
        busy = [worker for worker, keys in self._client.processing().items() if future.key in keys]
        future.cancel(force=True)
        # only a worker with a nanny can be started again; elsewhere the study ends by its own clock
        with contextlib.suppress(Exception):
            self._client.restart_workers(busy, timeout=20)

    def close(self) -> None:
        """End all that is at work."""
        with contextlib.suppress(Exception):
            self._client.cancel(list(self._futures.values()), force=True)
        self._client.close(timeout=5)

    def _threads(self) -> dict[str, int]:
        with contextlib.suppress(Exception):
            return dict(self._client.nthreads())
        return {}


Workers = Processes | Cluster  #: Who does studies, a few at a time.


def _came_of(future: Any) -> Any:
    if future.status == "finished":
        return future.result()
    if future.status == "error":
        error = future.exception()
        ended = "the workers that did it died one after the other, most often because memory ran out"
        told = ended if type(error).__name__ == "KilledWorker" else f"Dask says {type(error).__name__}"
        return Answer(status="failed", error=f"{told}: {error}")
    return None
