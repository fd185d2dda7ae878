"""A study file: closed, the same bytes for the same study, every mistake with its key and the nearest name."""

from __future__ import annotations

import json
import os
import runpy
import tomllib
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import OptionError, StudyError
from selector.readers import Overrides
from selector.selection import Options
from selector.study import (
    InputFile,
    Study,
    diagnose_section,
    options_of,
    overrides_of,
    parsed_study,
    path_at,
    read_study,
    reference_to,
    select_section,
    study_of,
    study_text,
    write_study,
)

ROOT = Path(__file__).resolve().parents[2]
OPTIONS = Options(
    responses=("Z", "Y lower"), level=(0.99, 0.98), rounds=2, max_sensors=3, degree=2, memory=True,
    reference="absolute", must=("T1",), never=("T 7",), cost={"T.3": 2.5}, tolerance=0.001,
    conditions={"r1": "winter"}, seed=7,
)  # fmt: skip
OVERRIDES = Overrides(
    separator=";", decimal=",", header_row=2, period_s=60.0, units={"T1": "degF"}, roles={"Q": "state"}
)


def study(folder: Path) -> Study:
    return study_of(
        folder,
        [folder / "recordings", folder.parent / "a b.csv"],
        machine=folder / "machine.toml",
        overrides=OVERRIDES,
        select=OPTIONS,
        diagnose=diagnose_section(folder, simulation=[folder / "sim"], holdout="r2", seed=3),
        files=[InputFile(path="recordings/r1.csv", sha256="0" * 64)] * 2,
        date="2026-11-20",
        results={"model.json": "1" * 64},
    )


def test_what_is_asked_comes_back_as_it_went_in(tmp_path):
    made = study(tmp_path)
    assert parsed_study(study_text(made)) == made
    assert options_of(made) == OPTIONS
    assert overrides_of(made) == OVERRIDES
    assert made.recordings.runs == ("recordings", "../a b.csv")
    assert len(made.files) == 1  # a workbook with two runs is one file


@given(
    cost=st.dictionaries(st.text(min_size=1, max_size=9).filter(str.isprintable), st.floats(0, 1e9)),
    level=st.none() | st.floats(0, 1) | st.tuples(st.floats(0, 1), st.floats(0, 1)),
    name=st.text(min_size=1, max_size=12).filter(lambda t: "\0" not in t and t.strip() and t.isascii()),
)
def test_any_names_and_numbers_come_back(cost, level, name):
    options = Options(level=level, rounds=2, cost=cost)
    made = study_of("/somewhere", ["/somewhere/r1.csv"], select=options, overrides=Overrides(sheet=name))
    again = parsed_study(study_text(made))
    assert options_of(again) == options
    assert overrides_of(again).sheet == name


def test_the_shipped_schema_is_that_of_the_program_and_takes_a_study(tmp_path):
    maker = runpy.run_path(str(ROOT / "fixtures" / "make" / "study_schema.py"))
    text = maker["SCHEMA_FILE"].read_text(encoding="utf-8")
    assert text == maker["schema_text"](), "run python fixtures/make/study_schema.py"
    schema = json.loads(text)
    jsonschema.validate(tomllib.loads(study_text(study(tmp_path))), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**tomllib.loads(study_text(study(tmp_path))), "more": 1}, schema)


@pytest.mark.parametrize(
    ("old", "new", "where", "said"),
    [
        ("degree = 2", "degre = 2", "select.degre", "'degree' perhaps"),
        ("[select]", "[selct]", "selct", "'select' perhaps"),
        ("sha256 =", "sha265 =", "files[1].sha265", "'sha256' perhaps"),
        ('schema = "selector.study/1"', 'schema = "selector.study/2"', "schema", "selector.study/1"),
        ('schema = "selector.study/1"', "", "schema", "selector.study/1"),
        ("degree = 2", "degree = 4", "select.degree", "less than or equal to 3"),
        ("degree = 2", "degree = true", "select.degree", "a whole number"),
        ("lambda = [0.99, 0.98]", "lambda = 1.5", "select.lambda", '"auto"'),
        ("lambda = [0.99, 0.98]", 'lambda = "often"', "select.lambda", '"auto"'),
        ("tolerance = 0.001", "tolerance = nan", "select.tolerance", "finite"),
        ('"model.json" =', '"../model.json" =', "results", "beside the study file"),
        ('"' + "0" * 64 + '"', '"00"', "files[1].sha256", "64 hexadecimal digits"),
        ("runs = [", "run = [", "recordings.run", "'runs' perhaps"),
        ("must = [", "must = {", "", "TOML"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_its_key(tmp_path, old, new, where, said):
    text = study_text(study(tmp_path))
    assert old in text
    with pytest.raises(StudyError) as told:
        parsed_study(text.replace(old, new, 1), where="study.toml")
    assert where in told.value.where
    assert said in f"{told.value.found} {told.value.expected}"


def test_options_that_contradict_each_other_are_told_with_the_file(tmp_path):
    text = study_text(study(tmp_path)).replace('never = ["T 7"]', 'never = ["T1"]')
    with pytest.raises(StudyError, match="T1 in both") as told:
        options_of(parsed_study(text), where="study.toml")
    assert told.value.where.startswith("study.toml, [select]")


def test_a_question_that_is_not_there():
    with pytest.raises(StudyError, match=r"no table \[select\]"):
        options_of(study_of("/x", ["/x/r1.csv"]))


def test_what_cannot_stand_in_a_study_is_refused():
    with pytest.raises(OptionError, match="never"):
        select_section(Options(never=tuple(f"T{k}" for k in range(20_000))))


@pytest.mark.parametrize(
    "content", [b"\xff\xfe\x00", b"\x00", b"[" * 100_000, b"a." * 100_000 + b"a = 1", b"", b"x = 1e999"]
)
def test_hostile_content_is_refused(tmp_path, content):
    place = tmp_path / "study.toml"
    place.write_bytes(content)
    with pytest.raises(StudyError):
        read_study(tmp_path)


def test_a_pipe_and_a_missing_file_are_refused(tmp_path):
    with pytest.raises(StudyError, match="cannot be opened"):
        read_study(tmp_path)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "study.toml")
        with pytest.raises(StudyError, match="not a regular file"):
            read_study(tmp_path)


def test_a_study_file_written_on_another_system_is_read(tmp_path):
    write_study(study(tmp_path), tmp_path / "study.toml")
    text = (tmp_path / "study.toml").read_bytes()
    assert b"\r" not in text
    (tmp_path / "study.toml").write_bytes(b"\xef\xbb\xbf" + text.replace(b"\n", b"\r\n"))
    assert read_study(tmp_path) == study(tmp_path)


def test_references_lead_to_what_they_were_made_of(tmp_path):
    inside, beside = tmp_path / "study" / "r1.csv", tmp_path / "runs"
    assert reference_to(inside, tmp_path / "study") == "r1.csv"
    assert reference_to(beside, tmp_path / "study") == "../runs"
    assert path_at("../runs", tmp_path / "study") == Path(os.path.realpath(beside))
    assert path_at("~/x", tmp_path).name == "x"
    assert path_at("~/x", tmp_path).parent.parent == Path(os.path.realpath(tmp_path))


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no links on this system")
def test_references_see_through_links_on_the_way(tmp_path):
    real = tmp_path / "far" / "away" / "study"
    real.mkdir(parents=True)
    (tmp_path / "link").symlink_to(real, target_is_directory=True)
    (tmp_path / "r1.csv").write_text("t,T1\n", encoding="utf-8")
    reference = reference_to(tmp_path / "r1.csv", tmp_path / "link")
    assert reference == "../../../r1.csv"
    assert path_at(reference, tmp_path / "link").samefile(tmp_path / "r1.csv")
