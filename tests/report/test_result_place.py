"""A folder as a result: what is told where it holds none, or one that was changed by hand."""

import shlex
from pathlib import Path

import pytest

from selector.errors import ResultError
from selector.selection.result_file import selection_of
from selector.telling.result_file import Result, made_of, result_place


def test_the_command_that_makes_the_results_can_be_pasted(tmp_path):
    folder = tmp_path / "lathe 3"
    folder.mkdir()
    (folder / "study.toml").write_text("", encoding="utf-8")
    with pytest.raises(ResultError) as told:
        result_place(folder)
    command = str(told.value).split("`")[1]
    assert shlex.split(command) == ["selector", "select", "--study", str(folder), "--out", str(folder)]


@pytest.mark.parametrize("part", [1, "T1", [], None])
def test_a_part_of_another_kind_is_told_and_no_defect(part):
    result = Result("selection", {"combinations": [part], "faults": [part]}, Path("selection.json"))
    with pytest.raises(ResultError) as told:
        made_of(result, selection_of)
    assert told.value.where.startswith("selection.json")
