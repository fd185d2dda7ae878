"""Examples of the README and of the documentation do what the page says; see docs/how-to/write-docs.md."""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from selector.cli import exit_status
from tests.physics.gauging.quick_trials import shorten_trials
from tests.physics.thermal.modes_chosen import modes_chosen_once as modes_chosen_once

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
EXIT_CODE = re.compile(r"\s+# exit code (\d+)$")


@dataclass(frozen=True)
class Block:
    """One fenced block of a page."""

    language: str
    marks: tuple[str, ...]
    text: str
    line: int

    @property
    def file(self) -> str | None:
        return next((mark.removeprefix("file=") for mark in self.marks if mark.startswith("file=")), None)

    @property
    def is_run(self) -> bool:
        return "test" in self.marks


def blocks(page: str) -> list[Block]:
    found, fence, start, info, lines = [], None, 0, "", []
    for number, line in enumerate(page.splitlines(), start=1):
        opening = re.match(r"^(`{3,})([^`]*)$", line)
        if fence is None and opening:
            fence, info, start, lines = opening[1], opening[2].strip(), number, []
        elif fence is not None and line.strip() == fence:
            language, *marks = info.split() or [""]
            found.append(Block(language, tuple(marks), "\n".join(lines) + "\n", start))
            fence = None
        elif fence is not None:
            lines.append(line)
    assert fence is None, f"the fence of line {start} is never closed"
    return found


@dataclass(frozen=True)
class Command:
    """One `$ ` line with the output that the page shows under it."""

    text: str
    expected: tuple[str, ...]
    exit_code: int


def commands(block: Block) -> list[Command]:
    found: list[Command] = []
    for line in block.text.splitlines():
        if line.startswith("$ "):
            code = EXIT_CODE.search(line)
            found.append(Command(EXIT_CODE.sub("", line[2:]), (), int(code[1]) if code else 0))
        elif found and found[-1].text.endswith("\\"):
            previous = found[-1]
            code = EXIT_CODE.search(line)
            text = previous.text[:-1] + EXIT_CODE.sub("", line)
            found[-1] = Command(text, (), int(code[1]) if code else previous.exit_code)
        elif found and line.strip():
            found[-1] = Command(found[-1].text, (*found[-1].expected, line), found[-1].exit_code)
    return found


def run_command(text: str) -> tuple[int, str]:
    """(exit code, stdout and stderr) of one line."""
    program, *arguments = shlex.split(text)
    if program == "cat":
        return 0, Path(arguments[0]).read_text(encoding="utf-8")
    assert program == "selector", f"a page can only run selector, not {program!r}"
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = exit_status(arguments)
    return code, "".join(stream.buffer.getvalue().decode("utf-8") for stream in (out, err))  # type: ignore[attr-defined]


def missing_lines(output: str, expected: tuple[str, ...]) -> list[str]:
    """Lines of `expected` that do not follow each other in the output."""
    rest, missing = " ".join(output.split()), []
    for line in expected:
        pattern = r".*?".join(re.escape(" ".join(part.split())) for part in line.split("…"))
        hit = re.search(pattern, rest)
        if hit is None:
            missing.append(line)
        else:
            rest = rest[hit.end() :]
    return missing


def page_name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.fixture
def folder(tmp_path, monkeypatch, modes_chosen_once):
    try:
        (tmp_path / "fixtures").symlink_to(ROOT / "fixtures", target_is_directory=True)
    except OSError:  # Windows without the right to make links
        shutil.copytree(ROOT / "fixtures", tmp_path / "fixtures")
    monkeypatch.chdir(tmp_path)
    # no page shows a number of a trial
    shorten_trials(monkeypatch)
    return tmp_path


TESTED_PAGES = [page for page in PAGES if any(block.is_run for block in blocks(page.read_text(encoding="utf-8")))]


@pytest.mark.parametrize("page", TESTED_PAGES, ids=page_name)
def test_page(page, folder):
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks(page.read_text(encoding="utf-8")):
        where = f"{page_name(page)} line {block.line}"
        if block.file:
            target = folder / block.file
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(block.text, encoding="utf-8")
        if not block.is_run:
            continue
        if block.language == "python" and ">>>" in block.text:
            example = doctest.DocTestParser().get_doctest(block.text, names, where, str(page), block.line)
            report = io.StringIO()
            runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
            runner.run(example, out=report.write, clear_globs=False)
            assert runner.summarize(verbose=False).failed == 0, report.getvalue()
            names.update(example.globs)
        elif block.language == "python":
            exec(compile("\n" * block.line + block.text, str(page), "exec"), names)
        else:
            assert block.language == "console", f"{where}: {block.language!r} cannot be run"
            assert commands(block), f"{where}: no line starts with '$ '"
            for command in commands(block):
                code, output = run_command(command.text)
                assert code == command.exit_code, f"{where}: $ {command.text}\n{output}"
                absent = missing_lines(output, command.expected)
                assert not absent, f"{where}: $ {command.text}\ndoes not print {absent}, but:\n{output}"


def test_there_are_pages_with_examples():
    assert len(TESTED_PAGES) >= 3


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_links_between_pages_lead_somewhere(page):
    text = re.sub(r"^(`{3,})[^`]*\n.*?^\1$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    targets = re.findall(r"\]\(([^)\s#]+)[^)]*\)", text)
    broken = [target for target in targets if "://" not in target and not (page.parent / target).exists()]
    assert not broken


def linked_pages(page: Path) -> list[Path]:
    """Pages that a page links to; a link to a folder leads to every page in it."""
    targets = [
        page.parent / t for t in re.findall(r"\]\(([^)\s#]+)", page.read_text(encoding="utf-8")) if "://" not in t
    ]
    return [p for target in targets for p in (target.glob("*.md") if target.is_dir() else [target])]


def test_every_page_can_be_reached_from_the_index():
    reached, todo = set(), [ROOT / "docs" / "index.md"]
    while todo:
        page = todo.pop().resolve()
        if page not in reached and page.suffix == ".md" and page.exists():
            reached.add(page)
            todo += linked_pages(page)
    assert {page.resolve() for page in PAGES} - {ROOT / "README.md"} <= reached


def test_the_checker_finds_a_page_that_lies(folder):
    code, output = run_command("selector describe nothing.csv")
    assert code == 2
    assert missing_lines(output, ("no such … folder",)) == []
    assert missing_lines(output, ("all is well",)) == ["all is well"]
