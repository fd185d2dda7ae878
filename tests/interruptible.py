"""How a test starts the program so that it hears Ctrl-C, even where the tests run as a job that must not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

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
