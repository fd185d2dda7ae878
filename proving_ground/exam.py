"""How is an exam asked for in words: what the options of `selector prove` name, and what is said while it is held."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from proving_ground import runner, scenarios
from proving_ground.case import Scenario
from proving_ground.real import published
from proving_ground.results import line_of
from proving_ground.rivals import RIVALS, rivals
from proving_ground.runner import Answerer, Outcome
from selector.errors import OptionError


def chosen_scenarios(
    families: Iterable[str] | None, names: Iterable[str] | None, recordings: Path | None
) -> tuple[Scenario, ...]:
    """The scenarios of options, with those of the recordings in a folder; which of these are absent is said.

    Raises OptionError: an option names none.
    """
    found: tuple[Scenario, ...] = ()
    if recordings is not None:
        found, lacking = published(recordings)
        for name in lacking:
            _say(f"recording {name} is absent: there is no folder {recordings / name}")
    return scenarios.scenarios(_split(families), _split(names), found)


def asked_answerers(names: Iterable[str] | None) -> tuple[Answerer, ...]:
    """What answers: this program, and the other methods of an option; which of `all` are absent is said.

    Raises OptionError: a name is of none, or its package is not installed.
    """
    asked = _split(names)
    found = rivals(asked)
    for rival in RIVALS if "all" in asked else ():
        if not rival.is_here:
            _say(f"rival {rival.name} is absent: the package {rival.package} is not installed")
    return (Answerer(runner.TOOL, runner.answer_of_selector), *found)


def asked_strengths(text: str) -> tuple[float, ...]:
    """The strengths d′ of an option, each once. Raises OptionError: they are no numbers, or beyond 1000."""
    try:
        found = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        found = ()
    if not found or not all(0.0 < value <= 1000.0 for value in found):
        raise OptionError(
            repr(text), expected="numbers from 0 to 1000, with commas", where="--strengths", advice="e.g. 3,6,12"
        )
    return tuple(dict.fromkeys(found))


def asked_seeds(text: str | None, *, is_exam: bool) -> tuple[int, ...]:
    """The seeds of an option, each once: a range, or numbers. Raises OptionError: none, or not those of this exam."""
    found: list[int] = []
    try:
        for part in (text if text is not None else "10000:10005" if is_exam else "0:5").split(","):
            first, colon, end = part.partition(":")
            found += range(int(first), int(end)) if colon else [int(first)]
    except (ValueError, MemoryError):
        raise OptionError(
            repr(text), expected="FROM:TO, or numbers with commas", where="--seeds", advice="e.g. 0:5 or 3,7"
        ) from None
    runner.require_seeds(found, is_exam=is_exam)
    return tuple(dict.fromkeys(found))


def say_done(done: int, total: int, outcome: Outcome) -> None:
    """A line on stderr for every case that was answered."""
    _say(f"[{done}/{total}] {line_of(outcome)}")


def _say(text: str) -> None:
    try:
        sys.stderr.write(f"{text}\n")
    except UnicodeEncodeError:
        sys.stderr.write(f"{text}\n".encode("ascii", "replace").decode())


def _split(given: Iterable[str] | None) -> tuple[str, ...]:
    return tuple(part.strip() for text in given or () for part in text.split(",") if part.strip())
