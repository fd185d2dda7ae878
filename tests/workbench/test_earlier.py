"""An answer that was asked otherwise than the form asks now is told, in the words of the fields."""

from __future__ import annotations

from pathlib import Path

from selector.readers import Overrides
from selector.selection import Options
from selector.workbench.commands import option_arguments, source_arguments
from selector.workbench.parts import differing_fields

FOLDER = Path("/study")


def select(options: Options, runs: tuple[str, ...] = ("r1.csv", "r2.csv"), overrides: Overrides | None = None):
    source = source_arguments(FOLDER, [FOLDER / run for run in runs], None, overrides or Overrides())
    return ("select", *source, *option_arguments(options), "--out", "selection")


def test_what_was_chosen_since_the_answer():
    then = select(Options(level=0.98, cost={"T1": 2.0}), overrides=Overrides(time_unit="min"))
    assert differing_fields(then, then) == []
    now = select(Options(level=0.9, max_sensors=3, responses=("Z",), memory=True, cost={"T1": 2.0}), ("r1.csv",))
    assert differing_fields(now, then) == [
        "Displacements to predict", "Memory: lagged temperatures and speed", "Most sensors in a set", "Unit of time",
        "λ", "the files",
    ]  # fmt: skip
