from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import InputError, ReadError, RecordingError, UnitError
from selector.readers import Machine, Overrides, machine, machine_text, read, write_machine_file
from selector.readers.machine_file import (
    WHOLE,
    ChannelSection,
    MachineSection,
    RunChannelSection,
    RunSection,
    TimeSection,
    machine_from_text,
)
from selector.recording import of_axis
from selector.units import CANONICAL_UNITS

EXAMPLE = """
# comments are fine
[machine]
name = "VMC-850"
[time]
column = "t"
unit = "min"
[channels.T1]
column = "PT01"
role = "temperature"
unit = "degC"
place = "lower bearing"
xyz = [0.0, 0.12, 0.40]
[channels.Z]
role = "displacement"
unit = "um"
axis = "Z"
"""


def test_the_example_of_the_contract():
    read = machine_from_text(EXAMPLE, "machine.toml")
    assert read.machine.name == "VMC-850"
    assert read.time.columns == ("t",)
    assert read.channels["T1"].column == "PT01"
    assert read.channels["T1"].xyz == (0.0, 0.12, 0.40)
    assert read.channels["Z"].axis == "Z"


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("[channels.T1]\nunti = 'degC'", ReadError, ["line 2", "'unti'", "'unit'"]),
        ("[tme]\ncolumn = 't'", ReadError, ["line 1", "'tme'", "'time'"]),
        ("[channels.T1]\nrole = 'temprature'", ReadError, ["line 2", "'temperature'"]),
        ("[channels.T1]\n\n\nrole = 'temperature'\nunit = 'mm'", UnitError, ["line 5", "'mm'", "degC"]),
        ("[channels.T1]\nrole = 'temperature'\nunit = 'bar'", UnitError, ["line 3", "'bar'"]),
        ("[channels.T1]\nxyz = [1, 2]", ReadError, ["line 2", "xyz"]),
        ("[channels.T1]\nxyz = [1, 2, nan]", ReadError, ["xyz"]),
        ("[time]\nunit = 'parsec'", ReadError, ["line 2", "'parsec'", "datetime"]),
        ("[time]\nperiod_s = 0", ReadError, ["line 2", "period_s"]),
        ("[time]\ncolumn = 5", ReadError, ["line 2", "column"]),
        ("[time\ncolumn = 't'", ReadError, ["TOML", "line 1"]),
        ("[channels.a]\ncolumn = 'x'\n[channels.b]\ncolumn = 'x'", RecordingError, ["line 4", "'a'", "'b'", "'x'"]),
        ("[channels.' ']\nrole = 'state'", ReadError, ["channel name"]),
        ("[runs.r1]\nuse = 'no'", ReadError, ["line 2", "runs.r1.use"]),
        ("[runs.r1]\nswp = [['a', 'b']]", ReadError, ["line 2", "'swp'", "'swap'"]),
        ("[runs.r1]\nswap = [['a', 'a']]", ReadError, ["line 2", "'a'"]),
        ("[runs.r1]\nswap = [['a', 'b', 'c']]", ReadError, ["line 2", "swap"]),
        ("[runs.r1.channels.T1]\nunti = 'degF'", ReadError, ["line 2", "'unti'", "'unit'"]),
        ("[runs.r1.channels.T1]\nleave_out = 'half'", ReadError, ["line 2", "leave_out", "all"]),
        ("[runs.r1.channels.T1]\nleave_out = [[20, 10]]", ReadError, ["line 2", "leave_out", "[20, 10]"]),
        ("[runs.r1.channels.T1]\nleave_out = [[-5, 10]]", ReadError, ["line 2", "leave_out"]),
        ("[runs.r1.channels.T1]\nleave_out = [[nan, 10]]", ReadError, ["line 2", "leave_out"]),
    ],
)
def test_mistakes_are_named_with_line_and_nearest_word(text, error, words):
    with pytest.raises(error) as caught:
        machine_from_text(text, "machine.toml")
    for word in words:
        assert word in str(caught.value)


NAME = st.text(
    st.characters(exclude_categories=["Cc", "Cs", "Zl", "Zp", "Cn", "Co", "Cf"]), min_size=1, max_size=20
).filter(lambda text: text.strip() and text.isprintable())
TEXT = st.none() | st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    channels = {}
    for name in draw(st.lists(NAME, max_size=4, unique=True)):
        role = draw(st.sampled_from(sorted(CANONICAL_UNITS)))
        xyz = draw(st.none() | st.tuples(*[st.floats(-1e5, 1e5)] * 3))
        unit = draw(st.none() | st.just(CANONICAL_UNITS[role]))
        channels[name] = ChannelSection(role=role, unit=unit, place=draw(TEXT), axis=draw(TEXT), xyz=xyz)
    columns = draw(st.none() | NAME | st.lists(NAME, min_size=1, max_size=2).map(tuple))
    time = TimeSection(
        column=columns,
        unit=draw(st.sampled_from([None, "s", "min", "datetime"])),
        period_s=draw(st.none() | st.floats(1e-9, 1e9)),
        date_order=draw(st.sampled_from([None, "dmy", "mdy", "ymd"])),
    )
    stretches = st.tuples(st.floats(0.0, 1e6), st.floats(1e6 + 1.0, 1e9))
    left_out = st.just(WHOLE) | st.lists(stretches, max_size=2).map(tuple)
    repair = st.builds(RunChannelSection, unit=TEXT, leave_out=left_out)
    swaps = st.lists(st.tuples(NAME, NAME).filter(lambda pair: pair[0] != pair[1]), max_size=2).map(tuple)
    section = st.builds(RunSection, use=st.booleans(), swap=swaps, channels=st.dictionaries(NAME, repair, max_size=2))
    runs = draw(st.dictionaries(NAME, section, max_size=2))
    return Machine(machine=MachineSection(name=draw(TEXT)), time=time, channels=channels, runs=runs)


@given(machines())
def test_round_trip(values):
    assert machine_from_text(machine_text(values), "x") == values


def test_writing_is_whole_or_not_at_all(tmp_path: Path):
    path = tmp_path / "new" / "machine.toml"
    values = machine_from_text(EXAMPLE, "x")
    write_machine_file(values, path, {"qg": "its role could not be inferred"})
    assert machine(path) == values
    assert "# [channels.qg]" in path.read_text(encoding="utf-8")
    assert [p.name for p in path.parent.iterdir()] == ["machine.toml"]
    with pytest.raises(InputError):
        write_machine_file(values, path / "inside" / "a-file.toml")


def test_files_that_are_no_machine_file(tmp_path: Path):
    path = tmp_path / "machine.toml"
    for content in ("[machine]\nname = 'Fräse'".encode("cp1252"), bytes(range(256)), b"\xff\xfe[\0"):
        path.write_bytes(content)
        with pytest.raises(ReadError):
            machine(path)
    with pytest.raises(ReadError):
        machine(tmp_path / "missing.toml")
    path.write_bytes("\ufeff[machine]\r\nname = 'Fräse'\r\n".encode())
    assert machine(path).machine.name == "Fräse"


def test_a_file_that_lost_its_content_is_refused(tmp_path: Path) -> None:
    for content in (b"", b"\xef\xbb\xbf\r\n"):
        (tmp_path / "machine.toml").write_bytes(content)
        with pytest.raises(ReadError, match="empty"):
            machine(tmp_path / "machine.toml")


def test_twenty_thousand_channels_are_read() -> None:
    text = "".join(f'[channels.C{i}]\nrole = "temperature"\nunit = "degC"\n' for i in range(20_000))
    # a search of the whole text for every channel would take an hour
    assert len(machine_from_text(text, "machine.toml").channels) == 20_000


@pytest.mark.parametrize(
    ("text", "found", "expected"),
    [
        ("[channels.Hall]\nrole = 5\n", "channels.Hall.role = 5", "a text in quotation marks"),
        ("[time]\nunit = true\n", "time.unit = true", "a text in quotation marks"),
        ("channels = 5\n", "channels = 5", "a table"),
        ("[channels]\nHall = 5\n", "channels.Hall = 5", "a table"),
    ],
)
def test_a_value_of_the_wrong_kind_is_shown_as_it_stands_in_the_file(text: str, found: str, expected: str) -> None:
    with pytest.raises(ReadError) as caught:
        machine_from_text(text, "m.toml")
    assert caught.value.found == found
    assert caught.value.expected.startswith(expected)


@pytest.mark.parametrize(
    ("axis", "is_told"), [("Q", True), ("spindle", True), ("Z", False), ("z", False), ("X1", False)]
)
def test_an_axis_that_machines_rarely_have_is_told(tmp_path: Path, axis: str, is_told: bool) -> None:
    rows = "".join(f"{60 * k},{20 + k / 4},{k / 2}\n" for k in range(30))
    (tmp_path / "r1.csv").write_text("t_s,T1_degC,Grow_um\n" + rows, encoding="utf-8")
    told = f'[channels.Grow_um]\nrole = "displacement"\nunit = "um"\naxis = "{axis}"\n'
    (tmp_path / "machine.toml").write_text(told, encoding="utf-8")
    reading = read([tmp_path / "r1.csv"], machine=tmp_path / "machine.toml", overrides=Overrides(partial=True))
    found = [one for one in reading.findings if one.id == "axis-unusual"]
    assert [(one.where.channel, one.evidence["axis"]) for one in found] == [("Grow_um", axis)] * is_told
    assert of_axis(axis.upper(), reading.recording.channels) == "Grow_um"


@pytest.mark.parametrize(
    ("column", "found"),
    [("note", "column 'note' holds text, not numbers"), ("t [s]", "column 't [s]' is the time column")],
)
def test_a_column_that_holds_no_channel_is_told_without_a_list_of_columns(
    tmp_path: Path, column: str, found: str
) -> None:
    names = [f"T{k} [degC]" for k in range(40)]
    rows = [",".join([str(s), "cold", *(str(20.0 + 0.1 * s + k) for k in range(40))]) for s in range(20)]
    (tmp_path / "r.csv").write_text("\n".join([",".join(["t [s]", "note", *names]), *rows]))
    of_one = f"[channels.X]\ncolumn = '{column}'\nrole = 'temperature'\nunit = 'degC'"
    with pytest.raises(RecordingError) as error:
        read([tmp_path / "r.csv"], machine=machine_from_text(of_one, "machine.toml"))
    assert error.value.found == found
