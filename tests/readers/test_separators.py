"""Every separator that a user can name cuts the lines or is refused."""

from __future__ import annotations

import string

import pytest

from selector.errors import ReadError


@pytest.mark.parametrize("mark", sorted({*string.punctuation, "\t", " "} - {'"'}))
def test_any_ascii_mark_cuts_the_lines(reads, column, mark: str) -> None:
    lines = [mark.join(["t", "T1", "Z"])] + [mark.join([str(i), str(20 + i), str(3 * i)]) for i in range(20)]
    reading = reads("\n".join(lines) + "\n", separator=mark)
    assert column(reading, "T1") == [20.0 + i for i in range(20)]
    assert reading.reading["separator"] == {"\t": "tab", " ": "blank"}.get(mark, mark)


@pytest.mark.parametrize("mark", ['"', "\n", "\0", "§", "ab", "", "1", "e"])
def test_what_cannot_cut_lines_is_refused(reads, mark: str) -> None:
    with pytest.raises(ReadError) as told:
        reads("t;T1\n0;20\n1;21\n", separator=mark)
    assert told.value.where == "r1.csv"


def test_a_mark_that_is_not_there_is_told(reads) -> None:
    with pytest.raises(ReadError, match="cut at ':'"):
        reads("t;T1;Z\n0;20.5;1\n1;21.5;2\n", separator=":")
