"""A folder as a result: what is told where it holds none."""

import shlex

import pytest

from selector.errors import ResultError
from selector.telling.result_file import result_place


def test_the_command_that_makes_the_results_can_be_pasted(tmp_path):
    folder = tmp_path / "lathe 3"
    folder.mkdir()
    (folder / "study.toml").write_text("", encoding="utf-8")
    with pytest.raises(ResultError) as told:
        result_place(folder)
    command = str(told.value).split("`")[1]
    assert shlex.split(command) == ["selector", "select", "--study", str(folder), "--out", str(folder)]
