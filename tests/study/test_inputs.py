"""Files of a study that changed, went, or came."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from selector.errors import StudyError
from selector.study import Study, changes, diagnose_section, input_file, require_unchanged, study_of


@pytest.fixture
def made(tmp_path: Path) -> tuple[Study, Path]:
    """A study of a folder with two recordings and a machine file, and of a simulation, in its own folder."""
    folder = tmp_path / "study"
    runs, simulated = tmp_path / "runs", tmp_path / "sim"
    for place in (folder, runs, simulated):
        place.mkdir()
    for name, text in {"r1.csv": "a\n1\n", "r2.csv": "a\n2\n", "machine.toml": ""}.items():
        (runs / name).write_text(text, encoding="utf-8")
    (simulated / "r1.csv").write_text("a\n3\n", encoding="utf-8")
    files = [
        input_file(runs / "machine.toml", folder, "machine"),
        *(input_file(runs / name, folder) for name in ("r1.csv", "r2.csv")),
        input_file(simulated / "r1.csv", folder, "simulation"),
    ]
    return study_of(folder, [runs], files=files, diagnose=diagnose_section(folder, simulation=[simulated])), folder


def test_nothing_has_changed(made):
    study, folder = made
    assert changes(study, folder) == ()
    require_unchanged(study, folder / "study.toml")


def test_every_change_is_told_with_its_hashes(made):
    study, folder = made
    runs = folder.parent / "runs"
    before = {Path(file.path).name: file.sha256 for file in study.files if file.kind == "recording"}
    (runs / "r1.csv").write_text("a\n1.0\n", encoding="utf-8")
    (runs / "r2.csv").unlink()
    (runs / "r3.csv").write_text("a\n4\n", encoding="utf-8")
    (folder.parent / "sim" / "r2.csv").write_text("a\n5\n", encoding="utf-8")
    told = {(one.path, one.happened): one for one in changes(study, folder)}
    assert set(told) == {
        ("../runs/r1.csv", "changed"), ("../runs/r2.csv", "missing"), ("../runs/r3.csv", "added"),
        ("../sim/r2.csv", "added"),
    }  # fmt: skip
    changed = told["../runs/r1.csv", "changed"]
    assert changed.expected == before["r1.csv"]
    assert changed.found == hashlib.sha256(b"a\n1.0\n").hexdigest()
    assert told["../runs/r2.csv", "missing"].found is None
    with pytest.raises(StudyError) as error:
        require_unchanged(study, folder / "study.toml")
    for word in ("../runs/r1.csv", changed.found, changed.expected, "../runs/r2.csv", "../runs/r3.csv"):
        assert word in error.value.found
    assert "--accept-changes" in error.value.advice


def test_a_machine_file_that_appears_changes_how_recordings_are_read(made):
    study, folder = made
    runs = folder.parent / "runs"
    without = study.model_copy(update={"files": tuple(file for file in study.files if file.kind != "machine")})
    (told,) = changes(without, folder)
    assert (told.path, told.kind, told.happened) == ("../runs/machine.toml", "machine", "added")
    (runs / "machine.toml").unlink()
    assert changes(without, folder) == ()


def test_a_study_without_files_measured_nothing_yet(made):
    study, folder = made
    assert changes(study.model_copy(update={"files": ()}), folder) == ()


def test_a_folder_that_went_is_told_file_by_file(made, tmp_path):
    study, _ = made
    told = changes(study, tmp_path / "elsewhere" / "study")
    assert {one.happened for one in told} == {"missing"}
    assert len(told) == len(study.files)
