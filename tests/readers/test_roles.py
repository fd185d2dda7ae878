from __future__ import annotations

import numpy as np
import pytest

from selector.errors import OptionError, RecordingError, UnitError
from selector.quality import inspect
from selector.readers.machine_file import machine_from_text
from selector.readers.roles.names import known_unit, name_and_unit, role_guess
from selector.units import parse_unit

WARM = np.linspace(20, 30, 50)


@pytest.mark.parametrize(
    ("header", "role", "unit", "axis"),
    [
        ("T1 [°C]", "temperature", "degC", None),
        ("T1/K", "temperature", "kelvin", None),
        ("PT01", "temperature", "degC", None),
        ("Temp_spindle_degF", "temperature", "degF", None),
        ("温度1(℃)", "temperature", "degC", None),
        ("Темп. 1, °C", "temperature", "degC", None),
        ("Spindellager vorn in °C", "temperature", "degC", None),
        ("Spindle Rear", "temperature", "degC", None),
        ("T_oil_C", "temperature", "degC", None),
        ("Tamb", "ambient", "degC", None),
        ("T_Hall [°C]", "ambient", "degC", None),
        ("Umgebung", "ambient", "degC", None),
        ("环境温度", "ambient", "degC", None),
        ("Z_um", "displacement", "um", "Z"),
        ("dX [µm]", "displacement", "um", "X"),
        ("Verlagerung Y (µm)", "displacement", "um", "Y"),
        ("位移Z(um)", "displacement", "um", "Z"),
        ("Смещение Z, мкм", "displacement", "um", "Z"),
        ("Dia Disp", "displacement", "um", None),
        ("X position [mm]", "position", "mm", "X"),
        ("X_cmd [mm]", "position_command", "mm", "X"),
        ("rpm", "spindle_speed", "rpm", None),
        ("n [1/min]", "spindle_speed", "rpm", None),
        ("转速(r/min)", "spindle_speed", "rpm", None),
        ("Vorschub mm/min", "feed_rate", "mm/min", None),
        ("coolant_on", "state", "1", None),
        ("F_z [kN]", "force", "kN", "Z"),
        ("force kN", "force", "kN", None),
        ("spindle_speed Hz", "spindle_speed", "Hz", None),
        ("spindle speed kRPM", "spindle_speed", "krpm", None),
        ("Temp1 Fahrenheit", "temperature", "degF", None),
        ("Y micron", "displacement", "um", "Y"),
        ("X position inch", "position", "inch", "X"),
        ("acceleration mm/s²", "acceleration", "mm/s^2", None),
        ("current mA", "current", "mA", None),
        ("motor current [A]", "current", "A", None),
        ("v [m/s]", "velocity", "m/s", None),
        ("Spindellager vorne (Öl) [°C]", "temperature", "degC", None),
        ("T3 [°C] (hinten)", "temperature", "degC", None),
        ("oil flow [l/min]", "flow", "liter/min", None),
        ("vitesse broche (tr/min)", "spindle_speed", "rpm", None),
        ("Частота вращения, об/мин", "spindle_speed", "rpm", None),
        ("obroty wrzeciona [obr/min]", "spindle_speed", "rpm", None),
        ("T1_degC.2", "temperature", "degC", None),
        ("Z_um.1", "displacement", "um", "Z"),
    ],
)
def test_what_headers_of_shop_floors_mean(header, role, unit, axis):
    name, written = name_and_unit(header)
    values = WARM if role != "position" and role != "position_command" else WARM * 20
    guess = role_guess(name, known_unit(written), values)
    assert (guess.role, guess.unit, guess.axis) == (role, unit, axis)
    assert "role" in guess.guessed
    assert ("unit" in guess.guessed) == (written is None and role != "state")


@pytest.mark.parametrize("header", ["Amplitude 50 Hz", "Vibration RMS 10-1000 Hz", "T at 20 mA", "Load 5 kN"])
def test_a_quantity_within_a_name_is_no_unit_of_the_channel(header):
    assert name_and_unit(header) == (header, None)


def test_a_displacement_in_nanometres_stays_one_in_capitals():
    assert name_and_unit("Z [NM]") == ("Z", "NM")
    assert (parse_unit("NM"), parse_unit("Nm")) == ("nm", "N*m")


@pytest.mark.parametrize(
    ("header", "name"),
    [("T1_degC.2", "T1.2"), ("Частота вращения, об/мин", "Частота вращения"), ("v1.2", "v1.2"), (", °C", ", °C")],
)
def test_a_name_keeps_its_number_and_no_mark_of_its_unit(header, name):
    assert name_and_unit(header)[0] == name


@pytest.mark.parametrize("name", ["spindle", "Spindel", "主轴"])
def test_a_spindle_that_mostly_stands_is_no_thermometer(name):
    speeds = np.repeat([0.0, 4000.0, 0.0, 1000.0], [300, 20, 100, 80])
    assert role_guess(name, None, speeds).role == "spindle_speed"
    warm = np.append(WARM, 850.0)  # a break code among them
    assert role_guess(name, None, warm).role == "temperature"


@pytest.mark.parametrize("header", ["Torque [Nm]", "TORQUE (NM)", "Motor torque_Nm", "Moment, N·m"])
def test_a_torque_is_no_displacement_in_nanometres(header):
    name, written = name_and_unit(header)
    assert (written is not None, role_guess(name, known_unit(written), WARM).role) == (True, None)
    assert role_guess(*name_and_unit("Z1 [nm]"), WARM).role == "displacement"


@pytest.mark.parametrize("name", ["qg", "uEst", "Channel 1", "foo"])
def test_what_nobody_can_know_is_not_guessed(name):
    assert role_guess(name, None, WARM).role is None


def test_an_axis_letter_in_mm_is_judged_by_its_span_and_doubted():
    small = role_guess("Z", "mm", np.linspace(0, 0.05, 20))
    large = role_guess("Z", "mm", np.linspace(0, 400, 20))
    assert (small.role, large.role) == ("displacement", "position")
    assert small.doubt is not None


CONTENT = "t [s],PT01 [degC],Z [um]\n0,20,1\n1,21,2\n2,22,3\n"


def test_the_machine_file_counts_and_nothing_is_guessed_then(reads):
    text = "[channels.T1]\ncolumn='PT01'\nrole='ambient'\nunit='degC'\nplace='hall'\nxyz=[0,1,2]\n"
    machine = machine_from_text(text + "[channels.Z]\nrole='displacement'\nunit='um'\naxis='Z'", "m")
    reading = reads(CONTENT, machine=machine)
    channel = reading.recording.channel("T1")
    assert (channel.role, channel.place, channel.xyz_m) == ("ambient", "hall", (0.0, 1.0, 2.0))
    assert [c.guessed for c in reading.channels] == [(), ()]
    assert reading.channels[0].column == "PT01 [degC]"


def test_what_the_machine_file_leaves_out_is_inferred_and_marked(reads, ids):
    machine = machine_from_text("[channels.T1]\ncolumn='PT01'\n[channels.Z]\nrole='displacement'", "m")
    reading = reads(CONTENT, machine=machine)
    assert [c.guessed for c in reading.channels] == [("role",), ("axis",)]
    without_unit = reads(CONTENT.replace(" [um]", ""), machine=machine)
    assert "unit" in without_unit.channels[1].guessed
    assert "unit-guessed" in ids(without_unit)


def test_units_of_file_and_machine_file_may_differ_but_not_in_silence(reads, column, ids):
    machine = machine_from_text("[channels.T1]\ncolumn='PT01'\nrole='temperature'\nunit='degF'", "m")
    reading = reads(CONTENT, machine=machine)
    # (20 °F - 32) / 1.8, a few roundings
    assert column(reading, "T1")[0] == pytest.approx(-12 / 1.8, rel=1e-13)
    assert "unit-conflict" in ids(reading)


def test_a_channel_that_no_file_has_is_an_error_that_names_the_nearest_column(reads):
    machine = machine_from_text("[channels.T1]\ncolumn='PT1'\nrole='temperature'\nunit='degC'", "m")
    with pytest.raises(RecordingError) as caught:
        reads(CONTENT, machine=machine)
    assert "nearest: 'PT01 [degC]'" in str(caught.value)
    assert "Z [um]" in str(caught.value)


def test_a_simulation_may_have_some_of_the_channels_only(reads):
    text = "[channels.T1]\ncolumn='PT1'\nrole='temperature'\nunit='degC'\n[channels.Z]\nrole='displacement'\nunit='um'"
    reading = reads(CONTENT, machine=machine_from_text(text, "m"), partial=True)
    assert reading.recording.names == ("Z",)
    assert any(f.id == "channels-lacking" and f.evidence["channels"] == ["T1"] for f in reading.findings)


def test_a_simulation_without_v_is_not_read_from_its_column_v_in_capitals(reads):
    channels = "[channels.v]\nrole='velocity'\nunit='m/s'\n[channels.V]\nrole='voltage'\nunit='V'"
    reading = reads("time_s,V\n0,1.5\n1,2.5\n2,2.0\n", machine=machine_from_text(channels, "m"), partial=True)
    assert reading.recording.names == ("V",)


def test_columns_that_the_machine_file_does_not_name_are_told(reads):
    machine = machine_from_text("[channels.Z]\nrole='displacement'\nunit='um'", "m")
    reading = reads(CONTENT, machine=machine)
    (finding,) = [f for f in reading.findings if f.id == "columns-ignored"]
    assert finding.evidence["columns"] == ["PT01 [degC]"]


def test_overrides_of_role_and_unit(reads, column):
    reading = reads(CONTENT, roles={"PT01": "ambient", "Z": "displacement"}, units={"PT01": "degF", "Z": "mm"})
    assert reading.recording.channel("PT01").role == "ambient"
    assert column(reading, "Z") == [1000.0, 2000.0, 3000.0]
    with pytest.raises(OptionError, match="nearest: 'PT01'"):
        reads(CONTENT, roles={"PT1": "ambient"})
    with pytest.raises(OptionError, match="'warm'"):
        reads(CONTENT, roles={"PT01": "warm"})
    for unit in ("mm", "furlong"):
        with pytest.raises(UnitError) as raised:
            reads(CONTENT, roles={"PT01": "temperature"}, units={"PT01": unit})
        assert raised.value.where == f"--unit PT01={unit}"
        assert "machine file" not in raised.value.advice


def test_an_unknown_unit_is_told(reads, ids):
    reading = reads("t,T1,Z\ns,digits,um\n0,20,1\n1,21,2\n2,22,3\n")
    assert "unknown-unit" in ids(reading)


def test_units_in_a_campbell_file_keep_pressures_from_being_positions(reads, ids):
    text = (
        '"TOA5","FRW","CR1000X","26","Std.03","CPU:a.CR1X","29908","MET"\n"TIMESTAMP","RECORD","PressureActual_Avg",'
        '"AirTemperature_Avg","Mixing_Avg"\n"TS","RN","hPa","degC","g/kg"\n"","","Avg","Avg","Avg"\n'
    )
    text += "".join(f'"2026-04-03 00:0{k}:00",{61074 + k},{980.5 + k},{4.5 + k},3.3\n' for k in range(1, 9))
    reading = reads(text)
    assert reading.reading["unit_row"]
    [channel] = reading.channels
    assert (channel.name, channel.role, channel.unit_in_file, channel.place) == (
        "AirTemperature_Avg", "temperature", "degC", None
    )  # fmt: skip
    # of a column that is not read, a unit that is not known says nothing
    assert "unknown-unit" not in ids(reading)


@pytest.mark.parametrize(
    ("unit", "in_a_degree"),
    [
        ("mdegC", 1000),
        ("m°C", 1000),
        ("milli °C", 1000),
        ("0,1 K", 10),
        ("0.1 °C", 10),
        ("1/10 °C", 10),
        ("0.01 K", 100),
    ],
)
def test_parts_of_a_degree(reads, unit, in_a_degree):
    begins, step = 20.8 * in_a_degree, 0.1 * in_a_degree
    reading = reads(f"t [s];T1 [{unit}]\n" + "".join(f"{60 * k};{begins + step * k:.0f}\n" for k in range(30)))
    seen = reading.recording.values("r1", ("T1",))[:, 0]
    np.testing.assert_allclose(seen, 20.8 + 0.1 * np.arange(30), atol=1e-9)
    assert [one.id for one in inspect(reading.recording) if one.level != "info"] == []


def test_a_column_in_tenths_of_a_degree_is_told_the_unit_that_reads_it(reads):
    table = "".join(f"{60 * k},{20 + 0.1 * k},{21 + 0.1 * k},{205 + k}\n" for k in range(60))
    header = "t [s],T1 [°C],T2 [°C],T3 [°C]\n"
    told = [one for one in inspect(reads(header + table).recording) if one.id == "wrong-unit"]
    assert [(one.where.channel, one.evidence["unit"]) for one in told] == [("T3", "0.1 degC")]
    right = reads(header.replace("T3 [°C]", f"T3 [{told[0].evidence['unit']}]") + table).recording
    assert [one.id for one in inspect(right) if one.id == "wrong-unit"] == []
    np.testing.assert_allclose(right.values("r1", ("T3",))[:, 0], 20.5 + 0.1 * np.arange(60), atol=1e-9)


def test_thousandths_of_a_degree_without_their_unit_are_told(reads):
    table = "".join(f"{60 * k},{20875 + 62 * k},{21125 + 62 * k}\n" for k in range(30))
    told = [one for one in inspect(reads("t [s],T1 [°C],T2 [°C]\n" + table).recording) if one.id == "wrong-unit"]
    assert [one.suggestion for one in told] == ['If so, declare unit = "mdegC" for these channels in the machine file.']


def test_no_other_unit_is_advised_where_the_file_has_it(reads):
    for temperature, length, begins, found in (
        ("°C", "um", -8.0, []),
        ("°F", "mm", 19.0, ["°C taken for °F", "µm taken for mm"]),
    ):
        rows = "".join(f"{60 * k},{begins + 0.01 * k},{begins + 2.0 + 0.01 * k},{30.0 * k}\n" for k in range(1000))
        text = f"t [s],T1 [{temperature}],T2 [{temperature}],Z [{length}]\n{rows}"
        told = inspect(reads(text, roles={"Z": "displacement"}).recording)
        assert [one.evidence["mistake"] for one in told if one.id == "wrong-unit"] == found


def test_a_switch_in_a_room_is_no_thermometer(reads):
    text = "t [s],room.window.isOpen,T1 [°C]\n" + "".join(f"{k},{int(k > 25)},{20 + 0.1 * k}\n" for k in range(30))
    assert [one.role for one in reads(text).channels] == ["state", "temperature"]


def test_columns_of_numbers_alone_are_doubted_once(reads):
    reading = reads("".join(f"{k},{20 + 0.1 * k},{300 + k % 7},{21 + 0.1 * k}\n" for k in range(30)))
    told = [one for one in reading.findings if one.id == "ambiguous-role"]
    found = {one.evidence["role"]: one.evidence["channels"] for one in told}
    assert (len(told), found) == (2, {"temperature": ["col2", "col4"], "displacement": ["col3"]})
