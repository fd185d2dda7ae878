"""How is the page served: by this computer to this computer only, until Ctrl-C."""

import logging
import os
import signal
import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from flask import Flask
from werkzeug.serving import BaseWSGIServer, make_server

from selector.errors import OptionError
from selector.readers import machine as machine_at
from selector.readers.files import recording_files
from selector.workbench.access import Access
from selector.workbench.bench import Bench
from selector.workbench.page import page
from selector.workbench.study_folder import new_folder, require_usable

HOST = "127.0.0.1"


def serve(
    files: Sequence[Path] = (),
    *,
    machine: Path | None = None,
    folder: Path | None = None,
    port: int = 0,
    when_ready: Callable[[str, Path], None],
) -> None:
    """Serves the workbench at 127.0.0.1 until Ctrl-C, SIGTERM or the end of the terminal.

    Then jobs are ended, and nothing is half written.

    Recordings are read where they are, and what is in the study folder is taken up; without one there is a new one in
    the current folder. Port 0 is any that is free; `when_ready` gets the address, token included, and a file
    that leads a browser there once, which only its owner can read.

    Raises InputError: a recording or the machine file is not there, or the folder or the port cannot be used.
    """
    if machine is not None:
        machine_at(machine)
    found = recording_files(files) if files else None
    own = new_folder(Path.cwd()) if folder is None else folder
    if found is not None and machine is None:
        machine = found.machine
    try:
        bench = Bench(require_usable(own), () if found is None else found.files, machine)
        _serve_until_stopped(started(bench, port), when_ready)
    finally:
        if folder is None:
            # a study folder in which nothing was done
            with suppress(OSError):
                own.rmdir()


def _serve_until_stopped(server: "Served", when_ready: Callable[[str, Path], None]) -> None:
    # the thread that a Ctrl-C interrupts waits here; the server runs in another
    over = threading.Event()
    ends = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    # whoever started it with nohup wants it to go on
    heard = [end for end in ends if signal.getsignal(end) != signal.SIG_IGN]
    earlier = {end: signal.signal(end, lambda *_: over.set()) for end in heard}
    # for its owner alone
    place, name = tempfile.mkstemp(prefix="selector-", suffix=".html")
    try:
        with os.fdopen(place, "w", encoding="utf-8") as opener:
            opener.write(server.access.opener())
        when_ready(server.access.address, Path(name))
        while not over.wait(0.5):
            pass
    except KeyboardInterrupt:
        pass
    finally:
        Path(name).unlink(missing_ok=True)
        for end, handler in earlier.items():
            signal.signal(end, handler)
        server.close()


class Served:
    """A server that runs in a thread of its own: who is let in, and its end."""

    def __init__(self, server: BaseWSGIServer, access: Access, bench: Bench) -> None:
        self.access = access
        self._server = server
        self._bench = bench
        self._thread = threading.Thread(target=server.serve_forever, name="selector-server", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends the jobs, then the server."""
        self._bench.jobs.close()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


def started(bench: Bench, port: int = 0) -> Served:
    """The page of a bench, served at this port. Raises OptionError: the port is in use."""
    # it says every request, the token in the first one
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    try:
        # the page needs to know the port, which is known when the server is there; it answers nothing until then
        server = make_server(HOST, port, Flask("selector.workbench.closed"), threaded=True)
    except (OSError, SystemExit, OverflowError) as error:
        raise OptionError(
            f"port {port} cannot be used",
            expected="a port that no other program uses",
            where="--port",
            advice="leave --port out: a free one is taken",
        ) from error
    access = Access(server.port)
    server.app = page(bench, access).server
    if bench.loaded:
        bench.read()
    return Served(server, access, bench)
