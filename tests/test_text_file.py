"""Files that somebody names: a text of a bounded length, or a reason."""

from __future__ import annotations

import os

import pytest

from selector.errors import InputError, ReadError
from selector.text_file import text_of


def read(path, most_bytes=100):
    return text_of(path, most_bytes, lambda found: ReadError(found, expected="a text", where=str(path), advice="none"))


def test_a_text_is_read_with_any_line_ends_and_a_mark(tmp_path):
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfa\r\nb\xc2\xb5\n")
    assert read(tmp_path / "a") == "a\nbµ\n"
    (tmp_path / "a").write_bytes(b"x" * 100)
    assert len(read(tmp_path / "a")) == 100


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("none", "cannot be opened"),
        ("a\0b", "cannot be opened"),
        ("folder", "a folder"),
        ("long", "more than 0 MB"),
        ("latin", "not UTF-8 at byte 1"),
        ("pipe", "not a regular file"),
    ],
)
def test_what_is_none_is_refused_with_a_reason(tmp_path, name, found):
    (tmp_path / "folder").mkdir()
    (tmp_path / "long").write_bytes(b"x" * 101)
    (tmp_path / "latin").write_bytes(b"a\xb5")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
    elif name == "pipe":
        pytest.skip("there are no pipes here")
    with pytest.raises(InputError, match=found):
        read(tmp_path / name)
