"""klippy.log, as klippy.py, queuelogger.py, statistics.py, heaters.py, probe.py of Klipper write it."""

from __future__ import annotations

import numpy as np
import pytest

from selector.errors import ReadError
from selector.readers.files import tables_of
from selector.readers.reading import read
from selector.readers.tables import Overrides
from selector.readers.text.klippy import is_klippy_log

HEAD = """\
Starting Klippy...
Args: ['klippy.py', 'printer.cfg']
Git version: 'v0.12.0'
"""
START = "Start printer at Sun Mar 28 12:21:19 2021 (1616930479.1 3226.5)\n"
LOG = """\
===== Config file =====
[heater_bed]
=======================
Stats 3230.2: gcodein=0  mcu: mcu_awake=0.001 heater_bed: target=60 temp=25.0 pwm=1.000 frame: temp=20.1 sysload=0.2
Stats 3231.2: gcodein=0  heater_bed: target=60 temp=25.4 pwm=1.000 frame: temp=20.1 extruder: target=0 temp=-3.1 pwm=0.0
probe: at 100.000,100.000 bed will contact at z=0.500000
Stats 3232.2: gcodein=0  heater_bed: target=60 temp=25.9 pwm=1.000
probe at 100.000,100.000 is z=0.520000
probe at 100.000,100.000 is z=0.540000
Result is z=0.530000
Stats 3233.2: gcodein=0  heater_bed: target=60 temp=26.3 pwm=1.000 frame: temp=20.2
probe: at 20.000,20.000 bed will contact at z=0.712500
Stats 3234.2: gcodein=0  heater_bed: target=60 temp=26.6 pwm=1.000 frame: temp=20.2
// Result: at 100.006,100.000 estimate contact at z=0.540000
probe: at 100.000,180.000 bed will contact at z=0.900000
Stats 3235.2: gcodein=0  heater_bed: target=60 temp=26.8 pwm=1.000 frame: temp=20.3
"""


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "klippy.log"

    def written(text):
        path.write_text(text, encoding="utf-8")
        return path

    return written


def test_temperatures_and_probed_heights_of_one_start(log):
    recording = read([log(HEAD + START + LOG)]).recording
    (run,) = recording.runs
    values = dict(zip(recording.names, recording.values(run, recording.names).T, strict=True))
    nan = np.nan
    np.testing.assert_array_equal(values["heater_bed"], [25.0, 25.4, 25.9, 26.3, 26.6, 26.8])
    np.testing.assert_array_equal(values["frame"], [20.1, 20.1, nan, 20.2, 20.2, 20.3])
    np.testing.assert_array_equal(values["extruder"], [nan, -3.1, nan, nan, nan, nan])
    # a mean of samples counts; what was probed elsewhere does not
    np.testing.assert_array_equal(values["Z"], [nan, nan, 0.0, -30.0, nan, -40.0])
    assert {name: recording.channel(name).unit for name in ("frame", "Z")} == {"frame": "degC", "Z": "um"}
    np.testing.assert_allclose(recording.time_s(run), np.arange(6.0))


def test_the_clock_is_that_of_the_line_in_which_the_printer_starts(log):
    (table,) = tables(log(HEAD + START + LOG))
    assert table.start == np.datetime64("2021-03-28T12:21:22.700")


def test_a_log_that_was_rolled_over_has_no_wall_clock(log):
    (table,) = tables(log("=============== Log rollover at Sun Mar 28 00:00:00 2021 ===============\n" + LOG))
    assert table.start is None
    assert len(table) == 6


def test_every_start_of_the_printer_is_a_run_with_a_zero_of_its_own(log):
    again = LOG.replace("0.500000", "0.900000").replace("Stats 32", "Stats 42")
    tables_ = tables(log(HEAD + START + LOG + "Restarting printer\n" + START.replace("3226.5", "4226.5") + again))
    assert [table.name for table in tables_] == ["klippy_1", "klippy_2"]
    assert [finding.id for table in tables_ for finding in table.findings] == [
        "starts-are-runs",
        "probed-elsewhere",
        "probed-elsewhere",
    ]
    height = next(column for column in tables_[1].columns if column.header == "Z")
    np.testing.assert_array_equal(height.values[2:4], [0.0, 370.0])


def test_a_start_without_samples_is_no_run(log):
    assert len(tables(log(HEAD + START + "mcu 'mcu': Timeout on connect\n" + START + LOG))) == 1


def test_a_log_without_temperatures_is_refused(log):
    with pytest.raises(ReadError, match="with 1 lines Stats"):
        tables(log(HEAD + START + "Stats 3230.2: gcodein=0  mcu: mcu_awake=0.001\n"))


def test_what_is_no_such_log_is_read_as_text():
    assert not is_klippy_log(b"time;T1;T2\n0;20.1;20.3\n")
    assert not is_klippy_log(b"a log; Stats 1.2: none\n")


def tables(path):
    return tables_of(path, Overrides())[0]


def test_a_heater_and_a_sensor_of_one_name_are_two_channels(log):
    lines = "".join(f"Stats {3230 + k}.2: chamber: target=0 temp={30 + k}.0 chamber: temp=20.{k}\n" for k in range(4))
    (table,) = tables_of(log(HEAD + START + lines), Overrides())[0]
    assert [(one.header, one.values[-1]) for one in table.columns] == [("chamber", 33.0), ("chamber.2", 20.3)]
    assert [one.evidence["read_as"] for one in table.findings if one.id == "duplicate-header"] == [["chamber.2"]]


@pytest.mark.parametrize("clock", ["9" * 30 + ".5", "9" * 13 + ".5", "9" * 400 + ".5"])
def test_a_start_at_no_time_of_a_calendar_has_no_date(log, clock):
    (table,) = tables_of(log(HEAD + START.replace("3226.5", clock) + LOG), Overrides())[0]
    assert table.start is None
    assert table.time_s[-1] == 5.0


def test_a_mesh_before_the_probings_at_one_place_is_left_out_and_told(log):
    mesh = "".join(f"probe at {x}.000,{y}.000 is z={0.1 + 0.001 * x * y:.6f}\n" for x in (10, 90) for y in (10, 90))
    pair = "Stats {}.2: bed: temp=20.{}\nprobe at 50.000,50.00{} is z=0.{}\n"
    lines = "".join(pair.format(3230 + k, k, k, k + 3) for k in range(5))
    (table,) = tables_of(log(HEAD + START + "Stats 3229.2: bed: temp=20.0\n" + mesh + lines), Overrides())[0]
    # what was probed after the last line Stats stands at that
    np.testing.assert_array_equal(table.columns[-1].values, [np.nan, np.nan, 0.0, -100.0, -200.0, -400.0])
    (finding,) = (one for one in table.findings if one.id == "probed-elsewhere")
    assert "(places: 4)" in finding.statement
    assert finding.evidence == {"x_mm": 50.0, "y_mm": 50.0}
