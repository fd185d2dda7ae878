"""UFF files of tap tests: the same compliance whatever their units, signs and functions; what is damaged is refused."""

from __future__ import annotations

import gc
import sys

import numpy as np
import pytest

from selector.errors import InputError
from selector.readers.uff_file import TapOptions, read_taps
from tests.physics.vibration.planted_taps import (
    NODES,
    RATE_HZ,
    SAMPLES,
    dataset,
    drawn,
    planted,
    records,
    spectra,
    spectrum,
    write_uff,
)  # fmt: skip

pytest.importorskip("pyuff")

POINTS = {node: name for name, node in NODES.items()}
LINES = SAMPLES // 2 + 1
HZ = RATE_HZ / SAMPLES * np.arange(LINES)
COMPLIANCE = 1e-8 / (1 - (HZ / 120.0) ** 2 + 0.1j)
ACCELERANCE = -((2 * np.pi * HZ) ** 2) * COMPLIANCE


def read(path, **asked):
    return read_taps([path], TapOptions(**{"points": POINTS, **asked}))


def written(tmp_path, *datasets, **units):
    return write_uff(tmp_path / "test.uff", list(datasets), **units)


#: Dataset, file, what the user says.
FORMS = {
    "SI": ({}, {}, {}),
    "text": ({"binary": 0}, {}, {}),
    "g per N": ({"data": ACCELERANCE / 9.80665, "ordinate_axis_units_lab": "g"}, {"unitless": True}, {}),
    "mm": ({"data": 1e3 * ACCELERANCE, "ordinate_axis_units_lab": "NONE"}, {"length": 1e3}, {}),
    "kN": ({"data": 1e3 * ACCELERANCE, "orddenom_axis_units_lab": "NONE"}, {"force": 1e-3}, {}),
    "as asked": ({"data": ACCELERANCE / 9.80665}, {}, {"motion": "g_0", "force": "N"}),
    "against the axis": ({"data": -ACCELERANCE, "rsp_dir": -3}, {}, {}),
    "no direction": ({"rsp_dir": 0, "ref_dir": 0}, {}, {}),
    "velocity": (
        {"data": ACCELERANCE / (2j * np.pi * np.maximum(HZ, 1e-9)), "ordinate_spec_data_type": 11,
         "ordinate_axis_units_lab": "m/s"}, {}, {},
    ),
    "displacement": (
        {"data": 1e6 * COMPLIANCE, "ordinate_spec_data_type": 8, "ordinate_axis_units_lab": "µm"},
        {"unitless": True}, {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_the_form_of_a_file_changes_nothing(tmp_path, form):
    more, units, asked = FORMS[form]
    path = written(tmp_path, spectrum(ACCELERANCE, "tool", "bed", **more), **units)
    (found,), findings = read(path, **asked)
    # three nodes are named, and the file has two
    told = [one.id for one in findings if one.id != "uff-no-such-node"]
    assert (found.of, found.at, len(found.taps), told) == ("tool", "bed", 1, [])
    assert found.frequency_hz == pytest.approx(HZ[1:])
    # numbers of a text file have twelve decimals
    assert found.mean == pytest.approx(COMPLIANCE[1:], rel=1e-9)


def test_a_window_of_the_analyser_is_taken_into_account(tmp_path):
    s = 1 / 0.2 + 2j * np.pi * HZ
    path = written(tmp_path, spectrum(s**2 * COMPLIANCE, "tool", "bed"))
    ((found,), _) = read(path, window_s=0.2)
    assert found.mean == pytest.approx(COMPLIANCE[1:], rel=1e-9)
    assert found.square_per_s2 == pytest.approx(-(s[1:] ** 2))


def test_records_are_paired_by_tap_and_member(tmp_path):
    true = drawn(1)
    found, _ = read(written(tmp_path, *records(true, 1, 3)))
    expected = planted(true, 1, 3)
    assert [(one.of, one.at) for one in found] == [(one.of, one.at) for one in expected]
    for one, other in zip(found, expected, strict=True):
        # the file has six digits of the time between samples
        assert one.taps == pytest.approx(other.taps, rel=1e-5)
        assert one.weight == pytest.approx(other.weight, rel=1e-6)


def test_coherence_belongs_to_its_pair_and_taps_are_counted(tmp_path):
    path = written(tmp_path, *spectra(drawn(1), 1, 3), *spectra(drawn(1), 2, 3)[:1])
    found, _ = read(path)
    assert [len(one.taps) for one in found] == [2, 1, 1, 1, 1, 1]
    assert all(one.coherence.min() >= 0 and one.coherence.max() < 1 + 1e-9 for one in found)


def test_what_does_not_count_is_said(tmp_path):
    path = written(
        tmp_path,
        spectrum(ACCELERANCE, "tool", "bed"),
        spectrum(ACCELERANCE, "tool", "bed", rsp_dir=1),
        spectrum(ACCELERANCE, "workpiece", "bed"),
        spectrum(np.abs(ACCELERANCE), "tool", "bed", 2),
    )
    found, (finding,) = read(path, axis="Z", points={**POINTS, NODES["workpiece"]: ""})
    assert len(found) == 1
    assert finding.id == "uff-left-out"
    assert sorted(finding.evidence.values()) == [1, 1, 1]


PLAIN = spectrum(ACCELERANCE, "tool", "bed")
REFUSED = {
    "a node of nobody": ([spectrum(ACCELERANCE, "tool", "bed", rsp_node=77)], {}, "--point 77="),
    "two directions": ([PLAIN, spectrum(ACCELERANCE, "bed", "bed", rsp_dir=1)], {}, "--axis"),
    "units that contradict": ([spectrum(ACCELERANCE, "tool", "bed", ordinate_axis_units_lab="g")], {}, "--unit"),
    "no unit": (
        [spectrum(ACCELERANCE, "tool", "bed", ordinate_axis_units_lab="?")], {"unitless": True}, "no dataset 164"
    ),
    "a motion in N": ([PLAIN | {"ordinate_axis_units_lab": "N", "ordinate_spec_data_type": 13}], {}, "type 13 in N"),
    "another motion": ([spectrum(ACCELERANCE, "tool", "bed", ordinate_axis_units_lab="um")], {}, "motion of type 12"),
    "other lines": ([PLAIN, spectrum(ACCELERANCE[:99], "tool", "bed")], {}, "99 values"),
    "three values": ([spectrum(ACCELERANCE[:3], "tool", "bed")], {}, "16 at least"),
    "a dead channel": ([spectrum(0 * ACCELERANCE, "tool", "bed")], {}, "all 0"),
    "no hammer": ([dataset(HZ, "tool", "accelerometer", 1)], {}, "0 records of force"),
    "two hammers": ([dataset(HZ, "tool", "hammer", 1), dataset(HZ, "bed", "hammer", 1)], {}, "2 records of force"),
    "no function that counts": ([spectrum(np.abs(ACCELERANCE), "tool", "bed", 2)], {}, "types 2"),
    "only what is left out": ([spectrum(ACCELERANCE, "tool", "bed", 6)], {}, "types 6"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_used_is_refused(tmp_path, case):
    datasets, units, said = REFUSED[case]
    path = written(tmp_path, *datasets, **units)
    with pytest.raises(InputError) as error:
        read(path)
    assert said in f"{error.value.found} {error.value.expected} {error.value.advice}"


@pytest.mark.parametrize(
    "content", [b"", b"a,b\n1,2\n", b"    -1\n" * 50_000, b"    -1\n    58\n    -1\n", bytes(range(256)) * 9]
)
def test_what_is_no_uff_file_is_refused(tmp_path, content):
    path = tmp_path / "test.uff"
    path.write_bytes(content)
    with pytest.raises(InputError):
        read(path)


def test_damage_is_no_reason_to_search_the_memory_of_the_process(tmp_path, monkeypatch):
    path = tmp_path / "test.uff"
    path.write_bytes(b"    -1\n    58\n    -1\n")
    monkeypatch.setattr(gc, "collect", lambda *_: pytest.fail("all objects of the process were visited"))
    with pytest.raises(InputError):
        read(path)


@pytest.mark.parametrize("word", [b"NaN", b"inf", b"1,5", b"abc"])
def test_a_number_that_is_none_is_refused(tmp_path, word):
    path = written(tmp_path, spectrum(ACCELERANCE, "tool", "bed", binary=0))
    lines = path.read_bytes().split(b"\n")
    lines[-5] = word.rjust(20) + lines[-5][20:]
    path.write_bytes(b"\n".join(lines))
    with pytest.raises(InputError):
        read(path)


def test_without_pyuff_the_remedy_is_named(tmp_path, monkeypatch):
    path = written(tmp_path, PLAIN)
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(InputError) as error:
        read(path)
    assert ".[formats]" in error.value.advice


def test_a_folder_or_nothing_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / "nothing.uff"):
        with pytest.raises(InputError):
            read(path)


def test_damage_ends_in_a_message_or_in_numbers(tmp_path):
    rng = np.random.default_rng(0)
    whole = written(
        tmp_path, *(spectrum(ACCELERANCE[:40], "tool", at, binary=k % 2) for k, at in enumerate(("bed", "tool")))
    ).read_bytes()
    path, refused = tmp_path / "damaged.uff", 0
    for number in range(150):
        content = bytearray(whole)
        if number % 3 == 0:
            del content[int(rng.integers(len(content))) :]
        else:
            for place in rng.integers(len(content), size=int(rng.integers(1, 9))):
                content[place] = int(rng.integers(256))
        path.write_bytes(bytes(content))
        try:
            found, _ = read(path)
        except InputError:
            refused += 1
        else:
            assert all(np.isfinite(one.taps).all() for one in found)
    # every file that was cut, and of the others some
    assert refused >= 50
