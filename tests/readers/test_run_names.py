"""Whatever a file is called, its run has a name that can be shown, stored and told from the others."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pydantic
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.controllers.closed_values import Name
from selector.errors import ReadError
from selector.readers import read
from selector.readers.roles.names import printable_name

TEXT = b"t [s],T1,Z\n0,20,1\n60,21,2\n120,22,3\n"


@given(st.text(st.characters(codec=None), max_size=150))
def test_printable_names_are_valid_in_model_files(text: str) -> None:
    name = printable_name(text)
    assert pydantic.TypeAdapter(Name).validate_python(name) == name == printable_name(name)
    assert name.isprintable()
    name.encode()


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="such file names cannot be made there")
def test_runs_of_files_with_odd_names(tmp_path: Path) -> None:
    odd = [b"a\nb.csv", b"a b.csv", b"\x1b[31mred.csv", b"\xff.csv", b"\xfe.csv", b"\n.csv", b"x" * 240 + b".csv"]
    paths = [tmp_path / os.fsdecode(name) for name in odd]
    for path in paths:
        path.write_bytes(TEXT)
    reading = read(paths)
    folder = tmp_path.name
    assert [run.name for run in reading.runs] == [
        f"{folder}_a b", f"{folder}_a b_2", "[31mred", f"{folder}_?", f"{folder}_?_2", "run", "x" * 100
    ]  # fmt: skip
    (told,) = [finding for finding in reading.findings if finding.id == "run-name-changed"]
    assert len(told.evidence["runs"]) == 6
    json.dumps(told.as_dict(), ensure_ascii=False).encode()


def test_ordinary_names_stay(tmp_path: Path) -> None:
    path = tmp_path / "Прогон 1 – warm.csv"
    path.write_bytes(TEXT)
    reading = read([path])
    assert [run.name for run in reading.runs] == ["Прогон 1 – warm"]
    assert not {"runs-renamed", "run-name-changed"} & {finding.id for finding in reading.findings}


def test_a_device_is_no_file() -> None:
    with pytest.raises(ReadError, match="not a regular file" if os.name == "posix" else ""):
        read([Path(os.devnull)])
