"""Which cases does `prove` ask: what its options say, the list of scenarios, and cases as folders."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from selector.atomic_file import folder_written_whole
from selector.cli.shared import showing
from selector.cli.shared.progress import counted_progress
from selector.errors import OptionError

if TYPE_CHECKING:
    from rich.console import Console

    from proving_ground.case import Scenario
    from proving_ground.runner import Answerer, Outcome


def published(folder: Path | None) -> tuple[Scenario, ...]:
    """Scenarios of the recordings in a folder; what was looked for in vain is told."""
    if folder is None:
        return ()
    from proving_ground.real import published

    found, lacking = published(folder)
    for name in lacking:
        typer.echo(f"recording {name} is absent: there is no folder {folder / name}", err=True)
    return found


def show_list(scenarios: Sequence[Scenario], as_json: bool) -> None:
    """Every scenario in a row."""
    if as_json:
        showing.print_json([{"name": s.name, "family": s.family, "kind": s.kind, "note": s.note} for s in scenarios])
        return
    rows = [(one.name, one.family, one.kind, one.note) for one in scenarios]
    showing.screen().print(showing.table(f"{len(rows)} scenarios", ["name", "family", "kind", "note"], rows))


def write_cases(folder: Path, asked: Sequence[Any], console: Console, as_json: bool) -> None:
    """The cases as folders, and their answers apart."""
    from proving_ground.runner import write_bundles

    with folder_written_whole(folder) as part, counted_progress("writing cases") as say:
        sealed = write_bundles(asked, part, progress=say)
    if as_json:
        showing.print_json({"cases": len(asked), "answers_sha256": sealed})
    else:
        console.print(f"wrote {folder}: cases, answers.json apart; its SHA-256 is {sealed}", markup=False)


def rivals(names: list[str] | None) -> tuple[Answerer, ...]:
    """The other methods that are asked; what `all` cannot find is told."""
    if not names:
        return ()
    from proving_ground.rivals import RIVALS
    from proving_ground.rivals import rivals as known_rivals

    found = known_rivals(split(names))
    if "all" in split(names):
        for rival in (one for one in RIVALS if not one.is_here):
            typer.echo(f"rival {rival.name} is absent: the package {rival.package} is not installed", err=True)
    return found


def split(given: Iterable[str] | None) -> tuple[str, ...]:
    """What stands between commas, in every word."""
    return tuple(part.strip() for text in given or () for part in text.split(",") if part.strip())


def strengths(text: str) -> tuple[float, ...]:
    """Strengths d′ of an option."""
    try:
        found = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        found = ()
    if not found or not all(0.0 < value <= 1000.0 for value in found):
        raise OptionError(
            repr(text), expected="numbers from 0 to 1000, with commas", where="--strengths", advice="e.g. 3,6,12"
        )
    return tuple(dict.fromkeys(found))


def seeds(text: str) -> tuple[int, ...]:
    """Seeds of an option: a range, or numbers."""
    found: list[int] = []
    try:
        for part in text.split(","):
            first, colon, end = part.partition(":")
            found += range(int(first), int(end)) if colon else [int(first)]
    except (ValueError, MemoryError):
        raise OptionError(
            repr(text), expected="FROM:TO, or numbers with commas", where="--seeds", advice="e.g. 0:5 or 3,7"
        ) from None
    return tuple(dict.fromkeys(found))


def say_done(done: int, total: int, outcome: Outcome) -> None:
    """One line a case on stderr."""
    from proving_ground.results import line_of

    try:
        sys.stderr.write(f"[{done}/{total}] {line_of(outcome)}\n")
    except UnicodeEncodeError:
        sys.stderr.write(f"[{done}/{total}] {line_of(outcome)}\n".encode("ascii", "replace").decode())
