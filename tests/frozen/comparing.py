"""Compares what two checkouts printed and wrote; drifts that were meant are listed, everything else is told."""

from __future__ import annotations

import difflib
import fnmatch
import re
import tomllib
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

DRIFTS = Path(__file__).with_name("drifts.toml")
SHOWN_LINES = 12

# what changes with the clock and not with the program
_VOLATILE = [
    (re.compile(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d(\.\d+)?)?(Z|\+00:00)?)?"), "DATE"),
    (re.compile(r'("(elapsed|seconds|duration|took)_?s?": )[\d.e+-]+'), r"\1TIME"),
    (re.compile(r"\b[\d.]+ (s|min) (elapsed|on \d+ process\w*)"), "TIME"),
    # a study holds the hash of its page
    (re.compile(r'("[\w.]+\.html" = )"[0-9a-f]{64}"'), r'\1"HASH"'),
    # a study names its recordings from where it lies
    (re.compile(r"(?<![./\w-])[./\w-]*/fixtures/"), "FIXTURES/"),
]


@dataclass(frozen=True)
class Drift:
    """A difference that is meant: files whose name matches, and what the old one has to become to be the new one.

    With `adds` the new file may say more, and nothing less; without words or `adds` the whole file is left out.
    """

    files: str
    why: str
    old: str = ""
    new: str = ""
    adds: bool = False

    def applied(self, text: str) -> str:
        return re.sub(self.old, self.new, text) if self.old else text


def drifts() -> list[Drift]:
    return [Drift(**entry) for entry in tomllib.loads(DRIFTS.read_text(encoding="utf-8")).get("drift", [])]


def differences(old: Path, new: Path, meant: list[Drift]) -> list[str]:
    """One text a file that differs or is in one folder only; empty if everything is equal or meant."""
    found = []
    for name in sorted(_files(old) | _files(new)):
        applying = [drift for drift in meant if fnmatch.fnmatch(name, drift.files)]
        if any(not (drift.old or drift.adds) for drift in applying):
            continue
        if not ((old / name).is_file() and (new / name).is_file()):
            found.append(f"{name}: only in the {'old' if (old / name).is_file() else 'new'} checkout's output")
            continue
        before, after = _told(old / name, applying), _told(new / name, [])
        if before != after and not (any(drift.adds for drift in applying) and _is_added(before, after)):
            found.append(f"{name}\n{_difference(before, after)}")
    return found


def _files(folder: Path) -> set[str]:
    found = set[str]()
    for mode in ("screen", "json"):
        found |= {path.relative_to(folder).as_posix() for path in (folder / mode).rglob("*") if path.is_file()}
    return found


def _told(path: Path, meant: list[Drift]) -> str | bytes:
    """The text of a file without what the clock changes; bytes if it is no text."""
    try:
        text = path.read_bytes().decode("utf-8")
    except UnicodeDecodeError:
        return path.read_bytes()
    if path.suffix == ".html":
        text = page_text(text)
    elif path.parent.parent.name == "screen" and path.name == "stdout.txt":
        # a line a word: where a screen breaks its lines says nothing
        text = "\n".join(text.split()) + "\n"
    for pattern, word in _VOLATILE:
        text = pattern.sub(word, text)
    for drift in meant:
        text = drift.applied(text)
    return text


def _is_added(before: str | bytes, after: str | bytes) -> bool:
    """Whether every line of the old text stands in the new one, in the same order."""
    rest = iter(after.splitlines())
    return all(line in rest for line in before.splitlines())


def _difference(before: str | bytes, after: str | bytes) -> str:
    if isinstance(before, bytes) or isinstance(after, bytes):
        return "    bytes differ"
    lines = list(difflib.unified_diff(before.splitlines(), after.splitlines(), "old", "new", lineterm="", n=0))
    shown = [f"    {line[:220]}" for line in lines[2 : 2 + SHOWN_LINES]]
    more = len(lines) - 2 - len(shown)
    return "\n".join([*shown, f"    … {more} lines more"] if more > 0 else shown)


def page_text(html: str) -> str:
    """What a reader of a page reads: its text, a line a piece, and the text of its drawings; no markup, no script."""
    reader = _Text()
    reader.feed(html)
    return "\n".join(reader.lines) + "\n"


class _Text(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._silent = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._silent += tag in ("script", "style")

    def handle_endtag(self, tag: str) -> None:
        self._silent -= tag in ("script", "style")

    def handle_data(self, data: str) -> None:
        words = " ".join(data.split())
        if words and not self._silent:
            self.lines.append(words)
