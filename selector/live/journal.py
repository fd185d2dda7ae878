"""What a process beside the control leaves for people and monitors: journal, metrics, one page, what it keeps."""

import json
import os
import sqlite3
from collections.abc import Mapping
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

from selector.atomic_file import write_whole
from selector.controllers.guard.decided import mode_words
from selector.controllers.model_file import ModelFile
from selector.errors import OptionError
from selector.json_text import json_text
from selector.live.links import Clock
from selector.number_text import number_text

LARGEST_JOURNAL_BYTES = 10_000_000
JOURNALS_KEPT = 5


class Journal:
    """``journal.jsonl``: a line an event, with the time of this computer; the oldest are dropped at 60 MB."""

    def __init__(self, folder: Path, clock: Clock) -> None:
        self.folder, self._clock = folder, clock
        self._path = folder / "journal.jsonl"

    def tell(self, event: str, **what: Any) -> None:
        """Append an event. A disk that is full does not end the correction: then the line is lost."""
        time = datetime.fromtimestamp(min(max(self._clock.wall(), 0.0), 4e9), UTC).isoformat(timespec="milliseconds")
        line = json.dumps({"time": time, "event": event} | what, ensure_ascii=True) + "\n"
        try:
            # not before: a process that is refused leaves no folder behind
            self.folder.mkdir(parents=True, exist_ok=True)
            if self._path.exists() and self._path.stat().st_size > LARGEST_JOURNAL_BYTES:
                for k in range(JOURNALS_KEPT, 0, -1):
                    older = self._numbered(k - 1)
                    if older.exists():
                        older.replace(self._numbered(k))
            with self._path.open("a", encoding="ascii") as file:
                file.write(line)
        except OSError:
            return

    def locked(self) -> sqlite3.Connection:
        """The folder for this process alone until it closes this, or dies. Raises OptionError: it cannot have it."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = sqlite3.connect(path := self.folder / ".lock", timeout=0.0, isolation_level=None)
            if not os.access(path, os.W_OK):
                raise PermissionError("it belongs to another user")  # two could have it
            # nothing is written: a machine is corrected although a disk is full
            lock.execute("PRAGMA journal_mode = OFF")
            lock.execute("BEGIN EXCLUSIVE")
            return lock
        except (OSError, sqlite3.Error) as error:
            is_other = getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY
            found = "another process of selector, at work there" if is_other else f"its .lock cannot be had ({error})"
            expected = "a folder for this one alone: each would overwrite what the other keeps"
            advice = "end the other one (its journal.jsonl says since when it runs)" if is_other else "delete .lock"
            advice += ", or give another --out where you may write"
            raise OptionError(found, expected=expected, where=str(self.folder), advice=advice) from error

    def _numbered(self, k: int) -> Path:
        return self._path if k == 0 else self._path.with_name(f"journal.{k}.jsonl")


def status_words(status: Mapping[str, Any], model: ModelFile) -> list[tuple[str, str]]:
    """What people read of a status: what it is, and what it is now."""

    def each(key: str) -> str:
        return ", ".join(f"{name}: {str(value).lower().replace('_', ' ')}" for name, value in status[key].items())

    corrections = [f"{name} {number_text(value)} µm" for name, value in status["correction_um"].items()]
    of_touches = status["touch_offs"].items()
    touches = [f"{name}: {of['last'].lower()}, offset {number_text(of['offset_um'])} µm" for name, of in of_touches]
    latency = [f"{number_text(status[key])} ms" for key in ("latency_median_ms", "latency_999_ms")]
    return [
        ("machine", status["machine"]),
        ("time", f"{datetime.fromtimestamp(status['time'], UTC):%Y-%m-%d %H:%M:%S} UTC"),
        ("ready", "yes" if status["ready"] else "no: journal.jsonl says why"),
        ("correction", ", ".join(corrections) or "–"),
        ("follows", mode_words(status["mode"], model)),
        ("sensors", each("sensors") or "all are well"),
        *([("last touch-offs", "; ".join(touches))] if touches else []),
        ("connections", each("connections")),
        ("periods", f"{status['cycles']}, {status['late_cycles']} of them late"),
        ("answers of servers", str(status["rows_in"])),
        ("writes confirmed", str(status["rows_out"])),
        ("values read back", f"{status['rows_confirmed']} as written, {status['mismatches']} something else"),
        ("from question to write", f"{latency[0]} at the median, {latency[1]} at 99.9 %"),
        ("last refused write", status["refused"] or "none"),
        *([("files not written", status["not_written"])] if status["not_written"] else []),
    ]


def write_status(folder: Path, status: Mapping[str, Any], kept: Mapping[str, Any], model: ModelFile) -> None:
    """``status.html``, ``status.json``, ``metrics.prom`` (Prometheus) and ``kept.json`` (for a restart), each whole.

    Raises OptionError: the disk is full, or the folder is gone.
    """
    write_whole(folder / "kept.json", json_text(kept).encode())
    write_whole(folder / "status.json", json_text(status).encode())
    numbers = {key: value for key, value in status.items() if isinstance(value, int | float)}
    metrics = "".join(f"selector_live_{key} {float(value)!r}\n" for key, value in numbers.items())
    write_whole(folder / "metrics.prom", metrics.encode())
    rows = "".join(f"<tr><th>{escape(what)}<td>{escape(now)}\n" for what, now in status_words(status, model))
    page = (
        '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="10"><title>selector live</title>'
        "<style>body{font:16px sans-serif}th{text-align:left;padding-right:2em;vertical-align:top}</style>"
        f"<h1>Process beside the control</h1><p>This is not a safety function.</p><table>{rows}</table>\n"
    )
    write_whole(folder / "status.html", page.encode())
