"""A stored heat system comes back bit by bit; anything else is refused with a message."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from selector.errors import ReadError
from selector.physics.thermal import stored_system
from selector.physics.thermal.reduction import reduced
from selector.physics.thermal.stored_system import read_system, write_system
from tests.physics.thermal.voxels import voxel_machine

FILMS = [{"bed": 8.0, "column": 8.0, "head": 8.0, "nose": 30.0}]


@pytest.fixture(scope="module")
def machine():
    return voxel_machine(0.12)


@pytest.fixture(scope="module")
def small(machine):
    return reduced(machine, FILMS, max_states=20)


@pytest.fixture
def file(small, tmp_path):
    write_system(tmp_path / "machine.npz", small)
    return tmp_path / "machine.npz"


def test_comes_back_bit_by_bit(small, file, tmp_path):
    back = read_system(file)
    for name in ("capacity", "conduction", "uniform"):
        np.testing.assert_array_equal(getattr(back, name), getattr(small, name))
    for name in ("films", "film_loads", "sources", "probes", "displacements"):
        ours, theirs = getattr(small, name), getattr(back, name)
        assert list(ours) == list(theirs)
        for key in ours:
            np.testing.assert_array_equal(theirs[key], ours[key])
    write_system(tmp_path / "again.npz", back)
    assert (tmp_path / "again.npz").read_bytes() == file.read_bytes()


def test_sparse_systems_are_not_stored(machine, tmp_path):
    with pytest.raises(ValueError, match="reduce it first"):
        write_system(tmp_path / "machine.npz", machine)


def changed(file, **changes):
    with np.load(file, allow_pickle=False) as archive:
        content = {name: archive[name] for name in archive.files}
    content.update(changes)
    np.savez(file, **{name: value for name, value in content.items() if value is not None})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"schema": np.array("other/1")}, "'other/1'"),
        ({"conduction": -np.eye(20)}, "makes or loses heat"),
        ({"capacity": np.zeros((20, 20))}, "makes or loses heat"),
        ({"conduction": np.eye(20)}, "makes or loses heat"),
        ({"conduction": np.full((20, 20), np.nan)}, "conduction of shape"),
        ({"conduction": np.eye(19)}, r"conduction of shape \(19, 19\)"),
        ({"uniform": np.float64(3.0)}, "shape"),
        ({"uniform": None}, "an archive of"),
        ({"more": np.zeros(3)}, "an archive of"),
        ({"names of probes": np.array(["a", "a", "b"])}, "unique names of probes"),
        ({"names of films": np.array(["a", "b", "c", "d\n"])}, "unique names of films"),
        ({"names of films": np.array(["a", "b", "c", "d"])}, "names that do not fit"),
        ({"names of probes": np.array([object()], dtype=object)}, "cannot be read"),
    ],
)
def test_changed_files_are_refused(file, changes, words):
    changed(file, **changes)
    with pytest.raises(ReadError, match=words):
        read_system(file)


def test_other_files_are_refused(file, tmp_path):
    whole = file.read_bytes()
    for name, data in {"text": b"no archive", "cut": whole[: len(whole) // 2], "empty": b""}.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ReadError, match="cannot be read"):
            read_system(tmp_path / name)
    with pytest.raises(ReadError, match="cannot be read"):
        read_system(tmp_path / "nowhere.npz")


def test_large_files_are_refused_before_they_are_read(file, monkeypatch):
    monkeypatch.setattr(stored_system, "MOST_BYTES", 2**10)
    with pytest.raises(ReadError, match="MiB"):
        read_system(file)


def test_a_header_that_promises_too_much_is_refused(file):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**7, 10**7)})
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["conduction.npy"] = header.getvalue()
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    with pytest.raises(ReadError, match="cannot be read"):
        read_system(file)
