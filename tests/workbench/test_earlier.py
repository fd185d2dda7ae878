"""An answer that was asked otherwise than the form asks now is told, in the words of the fields."""

from __future__ import annotations

from selector.readers import Overrides
from selector.selection import Options
from selector.study import STUDY_FILE, study_of, write_study
from selector.workbench.saved_study import other_than_asked


def test_what_was_chosen_since_the_answer(tmp_path):
    answer, runs = tmp_path / "selection", (tmp_path / "r1.csv", tmp_path / "r2.csv")
    answer.mkdir()
    asked, read_as = Options(level=0.98, cost={"T1": 2.0}), Overrides(time_unit="min")
    # without a study file nobody knows
    assert other_than_asked(answer, asked, read_as, runs) == ()
    write_study(study_of(answer, runs, overrides=read_as, select=asked), answer / STUDY_FILE)
    assert other_than_asked(answer, asked, read_as, runs[::-1]) == ()
    now = Options(level=0.9, max_sensors=3, responses=("Z",), memory=True, cost={"T1": 2.0})
    assert other_than_asked(answer, now, Overrides(), runs[:1]) == (
        "Displacements to predict", "λ", "Most sensors in a set", "Memory: lagged temperatures and speed",
        "the recordings", "how they are read",
    )  # fmt: skip
