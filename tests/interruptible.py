"""How a test starts the program so that it hears Ctrl-C, even where the tests run as a job that must not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

from selector.cli import exit_status
from tests.patience import PATIENCE_S

ROOT = Path(__file__).resolve().parents[1]

# a shell without job control starts its background jobs deaf to SIGINT, nohup to SIGHUP; what they start inherits it
_START = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "hasattr(signal, 'SIGHUP') and signal.signal(signal.SIGHUP, signal.SIG_DFL); "
    "from selector.cli import main; main()"
)

INTERRUPTIBLE = (sys.executable, "-c", _START)
"""The command line up to its first argument."""

# Ctrl-C comes when the work has come to a place, however long that takes, and not after some seconds
_INTERRUPTED = f"""
import os, signal, sys, threading, time

def interrupt(name=sys.argv.pop(1), main=threading.main_thread().ident):
    while True:
        frame = sys._current_frames()[main]
        while frame is not None:
            if frame.f_code.co_name == name:
                os.kill(os.getpid(), signal.SIGINT)
                return
            frame = frame.f_back
        time.sleep(0.001)

threading.Thread(target=interrupt, daemon=True).start()
{_START}
"""


def interrupted_in(function: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command to which Ctrl-C happens once, as soon as a function of this name is at work."""
    return subprocess.run(
        [sys.executable, "-c", _INTERRUPTED, function, *arguments],
        capture_output=True, text=True, encoding="utf-8", timeout=PATIENCE_S, check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])},
    )  # fmt: skip


def exit_status_interrupted_in(function: str, *arguments: str) -> int | None:
    """The exit code of a command in this process to which Ctrl-C happens once, as soon as the function is at work.

    None: it came when the command had already ended. For what a command does then; `interrupted_in` looks at the
    process, too, whose start takes two seconds of CPU.
    """
    main, over = threading.main_thread().ident, threading.Event()

    def interrupt() -> None:
        while not over.wait(0.001):
            frame = sys._current_frames()[main]
            while frame is not None:
                if frame.f_code.co_name == function:
                    os.kill(os.getpid(), signal.SIGINT)
                    return
                frame = frame.f_back

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    watcher = threading.Thread(target=interrupt, daemon=True)
    try:
        watcher.start()
        return exit_status(arguments)
    except KeyboardInterrupt:
        return None
    finally:
        over.set()
        watcher.join()
        signal.signal(signal.SIGINT, before)
