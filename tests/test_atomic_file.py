"""Folders are written whole or not at all."""

from __future__ import annotations

import pytest

from selector.atomic_file import (
    folder_written_whole,
    refuse_to_overwrite,
    refuse_to_replace_input,
    require_writable_folder,
    written_together,
)
from selector.errors import OptionError


def test_new_folder(tmp_path):
    out = tmp_path / "a" / "study"
    with folder_written_whole(out) as part:
        (part / "model.json").write_text("{}", encoding="utf-8")
        assert not out.exists()
    assert [path.name for path in out.iterdir()] == ["model.json"]
    assert [path.name for path in out.parent.iterdir()] == ["study"]


def test_existing_folder_keeps_what_is_not_replaced(tmp_path):
    out = tmp_path / "study"
    (out / "notes").mkdir(parents=True)
    (out / "notes" / "mine.txt").write_text("mine", encoding="utf-8")
    (out / "model.json").write_text("old", encoding="utf-8")
    with folder_written_whole(out) as part:
        (part / "notes").mkdir()
        (part / "notes" / "new.txt").write_text("new", encoding="utf-8")
        (part / "model.json").write_text("new", encoding="utf-8")
    assert (out / "model.json").read_text(encoding="utf-8") == "new"
    assert sorted(path.name for path in (out / "notes").iterdir()) == ["mine.txt", "new.txt"]


@pytest.mark.parametrize("is_link", [False, True])
def test_a_folder_that_exists_is_all_that_is_written_to(tmp_path, is_link):
    # another disk may be mounted there, and nothing can be moved onto it from beside it
    out = real = tmp_path / "study"
    if is_link:
        real = tmp_path / "disk" / "far"
        real.mkdir(parents=True)
        out.symlink_to(real)
    else:
        out.mkdir()
    beside = sorted(tmp_path.iterdir())
    with folder_written_whole(out) as part:
        assert sorted(tmp_path.iterdir()) == beside
        assert part.parent.samefile(real)
        (part / "model.json").write_text("{}", encoding="utf-8")
    assert [path.name for path in real.iterdir()] == ["model.json"]
    assert out.is_symlink() is is_link


@pytest.mark.parametrize("stop", [KeyboardInterrupt, ValueError])
@pytest.mark.parametrize("there_before", [False, True])
def test_stopped_work_leaves_nothing(tmp_path, stop, there_before):
    out = tmp_path / "study"
    if there_before:
        out.mkdir()
        (out / "model.json").write_text("old", encoding="utf-8")

    def work():
        with folder_written_whole(out) as part:
            (part / "model.json").write_text("half", encoding="utf-8")
            raise stop

    with pytest.raises(stop):
        work()
    assert [path.name for path in tmp_path.iterdir()] == (["study"] if there_before else [])
    if there_before:
        assert (out / "model.json").read_text(encoding="utf-8") == "old"


def test_a_file_in_the_place_of_the_folder(tmp_path):
    (tmp_path / "study").write_text("mine", encoding="utf-8")
    with pytest.raises(NotADirectoryError), folder_written_whole(tmp_path / "study"):
        pass
    assert (tmp_path / "study").read_text(encoding="utf-8") == "mine"


def test_nothing_is_overwritten_by_accident(tmp_path):
    path = tmp_path / "machine.toml"
    refuse_to_overwrite(path, force=False, option="--write")
    path.write_text("", encoding="utf-8")
    refuse_to_overwrite(path, force=True, option="--write")
    with pytest.raises(OptionError, match="--force"):
        refuse_to_overwrite(path, force=False, option="--write")


@pytest.mark.parametrize("force", [False, True])
def test_a_folder_is_not_said_to_be_replaced_by_force(tmp_path, force):
    with pytest.raises(OptionError, match="folder of this name") as caught:
        refuse_to_overwrite(tmp_path, force=force, option="--write")
    assert "--force" not in str(caught.value)


def test_an_input_is_never_replaced(tmp_path):
    recording = tmp_path / "r1.csv"
    recording.write_text("mine", encoding="utf-8")
    (tmp_path / "sub").mkdir()
    # the same file under another name
    with pytest.raises(OptionError, match="inputs"):
        refuse_to_replace_input(tmp_path / "sub" / ".." / "r1.csv", [recording], "--out")
    refuse_to_replace_input(tmp_path / "new.csv", [recording], "--out")


def test_a_folder_that_cannot_be_written_is_known_before_the_work(tmp_path):
    require_writable_folder(tmp_path / "new" / "deep", "--out")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    with pytest.raises(OptionError, match="file"):
        require_writable_folder(tmp_path / "file", "--out")


def test_results_that_do_not_fit_into_the_folder_leave_the_old_ones(tmp_path):
    folder = tmp_path / "study"
    (folder / "report.html").mkdir(parents=True)
    (folder / "model.json").write_text("old", encoding="utf-8")
    with pytest.raises(IsADirectoryError), folder_written_whole(folder) as part:  # noqa: PT012 (fails at its end)
        (part / "model.json").write_text("new", encoding="utf-8")
        (part / "report.html").write_text("new", encoding="utf-8")
    assert (folder / "model.json").read_text(encoding="utf-8") == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study"]


def test_an_earlier_answer_goes_with_the_new_one(tmp_path):
    out = tmp_path / "study"
    out.mkdir()
    for name in ("old.json", "mine.txt", "kept.json"):
        (out / name).write_text("old", encoding="utf-8")
    with folder_written_whole(out, ["old.json", "kept.json", "never.json"]) as part:
        (part / "kept.json").write_text("new", encoding="utf-8")
    assert sorted(path.name for path in out.iterdir()) == ["kept.json", "mine.txt"]
    assert (out / "kept.json").read_text(encoding="utf-8") == "new"


def test_an_earlier_answer_stays_if_the_new_one_fails(tmp_path):
    out = tmp_path / "study"
    (out / "a.json").mkdir(parents=True)
    (out / "old.json").write_text("old", encoding="utf-8")
    with pytest.raises(IsADirectoryError), folder_written_whole(out, ["old.json"]) as part:
        (part / "a.json").write_text("new", encoding="utf-8")
    assert (out / "old.json").read_text(encoding="utf-8") == "old"


@pytest.mark.parametrize("is_blocked", [False, True])
def test_files_of_several_folders_take_their_places_together(tmp_path, is_blocked):
    one, other, new = tmp_path / "a" / "r1.csv", tmp_path / "b" / "page.html", tmp_path / "c" / "d" / "m.toml"
    for path in (one, other):
        path.parent.mkdir()
        path.write_text("old", encoding="utf-8")
    if is_blocked:
        # a folder in the place of the last file, made while the others were written
        new.mkdir(parents=True)
    try:
        with written_together([one, other, new]) as drafts:
            for draft in drafts.values():
                draft.write_text("new", encoding="utf-8")
    except IsADirectoryError:
        assert is_blocked
    said = "old" if is_blocked else "new"
    assert [path.read_text(encoding="utf-8") for path in (one, other)] == [said, said]
    assert new.is_file() != is_blocked
    assert not list(tmp_path.rglob("*.part"))


def test_folders_made_for_files_go_when_these_are_not_written(tmp_path):
    with pytest.raises(ValueError, match="no"), written_together([tmp_path / "a" / "b" / "r1.csv"]):
        raise ValueError("no")
    assert list(tmp_path.iterdir()) == []


def test_what_another_program_wrote_is_not_replaced(tmp_path):
    (tmp_path / "report.html").write_text("<html>mine", encoding="utf-8")
    (tmp_path / "model.json").write_text('{"schema": "selector.model/1"}', encoding="utf-8")
    require_writable_folder(tmp_path, "--out", ["model.json", "selection.json"])
    with pytest.raises(OptionError, match=r"^[^,]*report\.html in "):
        require_writable_folder(tmp_path, "--out", ["model.json", "report.html"])


def test_a_link_to_nowhere_is_called_one(tmp_path):
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "gone")
    with pytest.raises(OptionError, match="link"):
        require_writable_folder(link, "--out")
