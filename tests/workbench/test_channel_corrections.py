"""What is corrected in the table is what the machine file says, and no more."""

from __future__ import annotations

from dataclasses import replace

import pytest

from selector.errors import InputError
from selector.readers import machine_of, read
from selector.workbench.readable import NO_CHANNEL, corrected, rows_of


@pytest.fixture
def reading(tmp_path):
    path = tmp_path / "r1.csv"
    rows = "".join(f"{k},{20 + k / 10},{68 + k / 5},{k},{k * 7 % 11}\n" for k in range(50))
    path.write_text("time_s,T1,T2,Z,thing\n" + rows, encoding="utf-8")
    return read([path])


def changed(reading, name, **cells):
    return corrected(reading, [replace(row, **cells) if row.name == name else row for row in rows_of(reading)])


def test_nothing_changed_is_the_machine_file_of_describe(reading):
    assert corrected(reading, rows_of(reading)) == machine_of(reading)


def test_rows_are_the_channels_and_what_is_none(reading):
    assert [(row.name, row.role) for row in rows_of(reading)] == [
        ("T1", "temperature"), ("T2", "temperature"), ("Z", "displacement"), ("thing", NO_CHANNEL),
    ]  # fmt: skip
    assert rows_of(reading)[-1].reason


def test_a_unit_is_corrected(reading):
    machine = changed(reading, "T2", unit="degF")
    again = read([reading.runs[0].file], machine=machine)
    assert again.recording.values("r1", ["T2"])[0, 0] == pytest.approx(20.0)
    assert again.recording.values("r1", ["T1"])[0, 0] == pytest.approx(20.0)


def test_a_column_becomes_a_channel_and_a_channel_none(reading):
    machine = changed(reading, "thing", role="spindle_speed", unit="rpm", place="spindle")
    assert machine.channels["thing"].role == "spindle_speed"
    assert machine.channels["thing"].place == "spindle"
    assert "T2" not in changed(reading, "T2", role=NO_CHANNEL).channels


@pytest.mark.parametrize(
    ("cells", "said"), [({"unit": "furlong"}, "furlong"), ({"unit": "mm"}, "mm"), ({"role": "nonsense"}, "nonsense")]
)
def test_what_cannot_be_is_refused(reading, cells, said):
    with pytest.raises(InputError) as refused:
        changed(reading, "T1", **cells)
    assert said in str(refused.value)


def test_the_last_channel_stays(reading):
    with pytest.raises(InputError, match="no channel"):
        corrected(reading, [replace(row, role=NO_CHANNEL) for row in rows_of(reading)])
