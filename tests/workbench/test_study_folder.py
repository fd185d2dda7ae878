"""Names that a browser says are not paths, and nothing in the study folder leads out of it."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import types
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import OptionError, ReadError
from selector.workbench import study_folder
from selector.workbench.study_folder import (
    files_in,
    free_name,
    inside,
    new_folder,
    require_usable,
    safe_name,
    stored,
    trouble_with,
)


@pytest.mark.parametrize(
    ("said", "name"),
    [
        ("r1.csv", "r1.csv"),
        ("../../etc/passwd", "passwd"),
        (r"C:\data\..\r1.csv", "r1.csv"),
        ("día 1 (warm).csv", "día 1 _warm_.csv"),
        ("测量.csv", "测量.csv"),
        ("con.csv", "_con.csv"),
        ("LPT1", "_LPT1"),
        ("<img src=x onerror=alert(1)>.csv", "_img src_x onerror_alert_1__.csv"),
        ("-rf.csv", "rf.csv"),
        (".hidden", "hidden"),
        ("a\0b\nc.csv", "a_b_c.csv"),
        ("...", "recording"),
        ("", "recording"),
        ("x" * 300 + ".csv", "x" * 117 + ".csv"),
        ("测" * 100 + ".csv", "测" * 65 + ".csv"),
        ("𝟏" * 100, "𝟏" * 50),
        ("r1.csv.", "r1.csv"),
        ("~$r1.xlsx", "__r1.xlsx"),
    ],
)
def test_names_are_made_safe(said, name):
    assert safe_name(said) == name


@given(st.text(max_size=400))
def test_every_name_is_a_name_in_this_folder(said):
    name = safe_name(said)
    assert name
    assert len(name) <= 125
    assert len(name.encode()) <= 205
    assert name[0] not in ".-~ "
    assert name[-1] not in ". "
    assert not set(name) & set('/\\:*?"<>|\0\n')
    assert name.isprintable()


def test_a_name_that_is_taken_gets_a_number(tmp_path):
    for expected in ("r1.csv", "r1_2.csv", "r1_3.csv"):
        path = stored(tmp_path, "r1.csv", io.BytesIO(b"x").read, 1)
        assert path.name == expected
    assert free_name(tmp_path, "R1.CSV") == "R1_4.CSV"  # Windows does not tell R1_2.CSV from r1_2.csv
    assert free_name(tmp_path, "other") == "other"


def test_what_is_sent_is_stored_byte_by_byte(tmp_path):
    content = bytes(range(256)) * 20_000
    path = stored(tmp_path / "recordings", "r.bin", io.BytesIO(content).read, len(content))
    assert path.read_bytes() == content
    assert [one.name for one in path.parent.iterdir()] == ["r.bin"]


@pytest.mark.parametrize("announced", [None, 10_000, 500])
def test_what_is_too_large_leaves_nothing(tmp_path, monkeypatch, announced):
    monkeypatch.setattr(study_folder, "MOST_UPLOADED_BYTES", 1000)
    with pytest.raises(ReadError) as refused:
        stored(tmp_path, "r1.csv", io.BytesIO(b"x" * 10_000).read, announced)
    assert "r1.csv" in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_what_breaks_off_leaves_nothing(tmp_path):
    with pytest.raises(ReadError, match="only 3 of 10 bytes"):
        stored(tmp_path, "r1.csv", io.BytesIO(b"abc").read, 10)

    def lost(_: int) -> bytes:
        raise ConnectionResetError

    with pytest.raises(ConnectionResetError):
        stored(tmp_path, "r1.csv", lost, 10)
    assert list(tmp_path.iterdir()) == []


def test_a_name_of_wide_characters_is_stored_and_can_be_sent_again(tmp_path):
    names = [stored(tmp_path, "测" * 90 + ".csv", io.BytesIO(b"x").read, 1).name for _ in range(2)]
    assert names[1] == names[0].replace(".csv", "_2.csv")


@pytest.mark.parametrize("what", ["write", "link"])
def test_a_full_disk_is_told_and_leaves_nothing(tmp_path, monkeypatch, what):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    if what == "write":
        monkeypatch.setattr(study_folder, "_PIECE_BYTES", 10)
        real = Path.open

        def opened(path, *arguments, **options):
            stream = real(path, *arguments, **options)
            return contextlib.closing(types.SimpleNamespace(write=full, close=stream.close))

        monkeypatch.setattr(Path, "open", opened)
    else:
        monkeypatch.setattr(os, "link", full)
        monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(OptionError, match=r"r1\.csv") as refused:
        stored(tmp_path, "r1.csv", io.BytesIO(b"x" * 100).read, 100)
    assert "room" in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_study_folder_that_is_gone_is_told_and_not_made_again(tmp_path):
    with pytest.raises(OptionError, match=r"r1\.csv"):
        stored(tmp_path / "study" / "recordings", "r1.csv", io.BytesIO(b"x").read, 1)
    assert list(tmp_path.iterdir()) == []


def test_a_new_study_never_takes_an_old_folder(tmp_path):
    assert new_folder(tmp_path).name == "selector-study"
    (tmp_path / "selector-study").mkdir()
    (tmp_path / "selector-study-2").write_text("a file")
    assert new_folder(tmp_path).name == "selector-study-3"


def test_inside_follows_links_before_it_judges(tmp_path):
    study = tmp_path / "study"
    study.mkdir()
    (study / "a.json").write_text("{}")
    (tmp_path / "secret").write_text("secret")
    assert inside(study, "a.json") == (study / "a.json").resolve()
    assert inside(study, "../secret") is None
    assert inside(study, str(tmp_path / "secret")) is None
    assert inside(study, "a.json\0") is None
    assert inside(study, "") is None
    try:
        (study / "link").symlink_to(tmp_path)
    except OSError:
        pytest.skip("links cannot be made here")
    assert inside(study, "link/secret") is None
    (study / "loop").symlink_to(study / "loop")
    for name in ("loop", "loop/a.json", "x" * 300, "\ud800"):
        assert inside(study, name) is None
    assert files_in(study) == (study / "a.json",)


def test_a_folder_that_cannot_be_used_is_refused(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OptionError) as refused:
        require_usable(tmp_path / "file")
    assert "--folder" in str(refused.value)


def test_a_study_folder_that_went_away_is_told(tmp_path, monkeypatch):
    study = tmp_path / "study"
    assert "back" in str(trouble_with(study))
    study.mkdir()
    assert trouble_with(study) is None
    assert list(study.iterdir()) == []

    def read_only(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(Path, "touch", read_only)
    assert "Read-only file system" in str(trouble_with(study))
