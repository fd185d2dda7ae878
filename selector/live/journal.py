"""What a process beside the control leaves for people and monitors: journal, metrics, one page, what it keeps."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any

from selector.atomic_file import write_whole
from selector.json_text import json_text
from selector.live.links import Clock

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

    def _numbered(self, k: int) -> Path:
        return self._path if k == 0 else self._path.with_name(f"journal.{k}.jsonl")


def write_status(folder: Path, status: Mapping[str, Any], kept: Mapping[str, Any]) -> None:
    """``status.html``, ``status.json``, ``metrics.prom`` (Prometheus) and ``kept.json`` (for a restart), each whole.

    Raises OptionError: the disk is full, or the folder is gone.
    """
    write_whole(folder / "kept.json", json_text(kept).encode())
    write_whole(folder / "status.json", json_text(status).encode())
    numbers = {key: value for key, value in status.items() if isinstance(value, int | float)}
    metrics = "".join(f"selector_live_{key} {float(value)!r}\n" for key, value in numbers.items())
    write_whole(folder / "metrics.prom", metrics.encode())
    rows = "".join(f"<tr><th>{escape(key)}<td>{escape(_shown(value))}\n" for key, value in status.items())
    page = (
        '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="10"><title>selector live</title>'
        "<style>body{font:16px sans-serif}th{text-align:left;padding-right:2em;vertical-align:top}</style>"
        f"<h1>Process beside the control</h1><p>This is not a safety function.</p><table>{rows}</table>\n"
    )
    write_whole(folder / "status.html", page.encode())


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {_shown(one)}" for key, one in value.items()) or "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
