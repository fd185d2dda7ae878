"""How a test starts the program so that it hears Ctrl-C, even where the tests run as a job that must not."""

from __future__ import annotations

import sys

# a shell without job control starts its background jobs deaf to SIGINT, and what they start inherits it
_START = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from selector.cli import main; main()"
)

INTERRUPTIBLE = (sys.executable, "-c", _START)
"""The command line up to its first argument."""
