"""The exported extra in Klipper itself, in its batch mode: G-code in, steps into a file, every module Klipper's own.

`KLIPPER=folder` names a checkout of github.com/Klipper3d/klipper in which a dictionary was built:
``cp test/configs/linuxprocess.config .config; make olddefconfig; make``. `KLIPPER_PYTHON` names a Python with Klipper's
requirements (cffi, greenlet, jinja2, pyserial, python-can); default: this one.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import Rows, reference_answers
from selector.controllers.writers.klipper import klipper_export
from tests.controllers.model_builders import rich_model
from tests.controllers.test_klipper import z_model

FOLDER = Path(os.environ.get("KLIPPER") or "/nonexistent")
PYTHON = os.environ.get("KLIPPER_PYTHON") or sys.executable
DICTIONARY = FOLDER / "out" / "klipper.dict"


def _lacks() -> str:
    if not (FOLDER / "klippy" / "klippy.py").is_file():
        return "Klipper is not there: fetch github.com/Klipper3d/klipper, set KLIPPER to it"
    if not DICTIONARY.is_file():
        return f"{DICTIONARY} is not there: build it with test/configs/linuxprocess.config"
    asked = subprocess.run(
        [PYTHON, "-c", "import cffi, greenlet, jinja2, serial, can"], check=False, capture_output=True
    )
    return "" if asked.returncode == 0 else f"{PYTHON} lacks what Klipper needs: set KLIPPER_PYTHON"


LACKS = _lacks()
pytestmark = pytest.mark.skipif(bool(LACKS), reason=LACKS)

# sensors that say what G-code tells them, and time that goes when G-code says so
TOLD = """
import json, logging

class Told:
    def __init__(self, config):
        self.name = config.get_name().split()[-1]
        config.get_printer().lookup_object('told').sensors[self.name] = self
        self.value = None
    def setup_minmax(self, low, high):
        pass
    def setup_callback(self, callback):
        self.callback = callback
    def get_report_time_delta(self):
        return .3

class Telling:
    def __init__(self, config):
        self.printer = config.get_printer()
        self.reactor = self.printer.get_reactor()
        self.sensors, self.ahead, real = {}, 0., self.reactor.monotonic
        self.reactor.monotonic = lambda: real() + self.ahead
        self.printer.load_object(config, 'heaters').add_sensor_factory('told', Told)
        gcode = self.printer.lookup_object('gcode')
        for name in ('TELL', 'WAIT', 'SHOW'):
            gcode.register_command(name, getattr(self, name))
    def TELL(self, gcmd):
        for name, sensor in self.sensors.items():
            sensor.value = gcmd.get_float(name, sensor.value)
    def WAIT(self, gcmd):
        extra = self.printer.lookup_object('selector_correction')
        for second in range(gcmd.get_int('S')):
            self.ahead += 1.
            for sensor in self.sensors.values():
                if sensor.value is not None:
                    sensor.callback(0., sensor.value)
            extra.last_time = 0.
            extra._tick(1.)
            extra.last_time = self.reactor.monotonic()
    def SHOW(self, gcmd):
        extra = self.printer.lookup_object('selector_correction')
        logging.info("SHOW %s", json.dumps({
            'at': gcmd.get('AT', ''),
            'toolhead': self.printer.lookup_object('toolhead').get_position(),
            'gcode': list(self.printer.lookup_object('gcode_move').get_status()['position']),
            'correction': extra.program.correction_1,
            'status': extra.get_status(extra.last_time)}))

def load_config(config):
    return Telling(config)
"""

AXIS = """
[stepper_{letter}]
step_pin: gpio{first}
dir_pin: gpio{second}
microsteps: 16
rotation_distance: 40
endstop_pin: {endstop}
position_max: 200
"""

CONFIG = """
[mcu]
serial: /tmp/none
[printer]
kinematics: {kinematics}
max_velocity: 300
max_accel: 3000
[told]
[extruder]
step_pin: gpio20
dir_pin: gpio21
microsteps: 16
rotation_distance: 33
nozzle_diameter: 0.4
filament_diameter: 1.75
heater_pin: gpio22
sensor_type: told
control: watermark
min_temp: 0
max_temp: 250
[skew_correction]
[tuning_tower]
"""


def configuration(kinematics: str = "cartesian", *, has_probe: bool = False) -> str:
    axes = []
    for k, letter in enumerate("xyz"):
        endstop = "probe:z_virtual_endstop" if has_probe and letter == "z" else f"gpio{3 * k + 3}"
        axis = AXIS.format(letter=letter, first=3 * k + 1, second=3 * k + 2, endstop=endstop)
        axes.append(axis if endstop.startswith("probe") else f"{axis}position_endstop: 0\n")
    probe = "[probe]\npin: gpio30\nz_offset: 1.5\n[safe_z_home]\nhome_xy_position: 100,100\nz_hop: 5\n[bed_mesh]\n"
    probe += "mesh_min: 20,20\nmesh_max: 180,180\nfade_start: 1\nfade_end: 10\n"
    return CONFIG.format(kinematics=kinematics) + "".join(axes) + (probe if has_probe else "")


def klipper(model: ModelFile, gcode: str, folder: Path, config: str, section: str = "") -> tuple[int, str, list[Any]]:
    """Exit code, log and what SHOW told of Klipper's batch mode."""
    shutil.copytree(FOLDER / "klippy", folder / "klippy", dirs_exist_ok=True)
    files = klipper_export(model).files
    (folder / "klippy" / "extras" / "selector_correction.py").write_text(files["selector_correction.py"])
    (folder / "klippy" / "extras" / "told.py").write_text(TOLD)
    text = section or files["selector_correction.cfg"]
    names = re.findall(r"^sensor_\d+: temperature_sensor (\w+)$", text, re.MULTILINE)
    sensors = "".join(f"[temperature_sensor {name}]\nsensor_type: told\n" for name in names if name != "typo")
    (folder / "selector_correction.cfg").write_text(text)
    (folder / "printer.cfg").write_text(f"{config}{sensors}[include selector_correction.cfg]\n")
    (folder / "t.gcode").write_text(gcode + "\n")
    command = [PYTHON, folder / "klippy" / "klippy.py", "printer.cfg", "-i", "t.gcode", "-o", "steps", "-d", DICTIONARY,
               "-l", "log.txt"]  # fmt: skip
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
    log = (folder / "log.txt").read_text(errors="replace")
    return done.returncode, log, [json.loads(told) for told in re.findall(r"^SHOW (.*)$", log, re.MULTILINE)]


def test_klipper_computes_what_the_guard_computes(tmp_path):
    """Wandering readings of two sensors, one that falls silent, and the switch."""
    model, n = z_model(), 400
    rng = np.random.default_rng(4)
    readings = np.round(20.0 + np.cumsum(rng.normal(0.0, 0.05, n)), 2)
    readings[150:155] = 900.0
    wanted = np.ones(n, dtype=bool)
    wanted[250:300] = False
    model = model.model_copy(
        update={"inputs": (model.inputs[0].model_copy(update={"reading_max": 90.0, "rate_limit_per_min": 9.0}),)}
    )
    lines = ["TELL T1=20", "G28"]
    for k in range(n):
        lines += [f"TELL T1={readings[k]}", f"SELECTOR_CORRECTION ENABLE={int(wanted[k])}", "WAIT S=1", "SHOW"]
    section = klipper_export(model).files["selector_correction.cfg"] + "zero_at_homing: False\n"
    code, log, shown = klipper(model, "\n".join(lines), tmp_path, configuration(), section)
    assert code == 0, log[-2000:]
    # the call after homing has no reading yet, and hardly any time
    rows = Rows(np.ones(n), readings[:, None], np.zeros((n, 0)), np.ones(n, dtype=bool), wanted,
                np.zeros(n, dtype=bool), np.zeros(n))  # fmt: skip
    expected = reference_answers(model, rows)
    given = np.array([one["correction"] for one in shown])
    late = [one["status"]["mode"] for one in shown]
    assert np.array_equal(given, expected.correction_um[:, 0])
    assert np.abs(given).max() > 3.0
    assert late == expected.mode.tolist()


@pytest.mark.parametrize("kinematics", ["cartesian", "corexy"])
def test_a_print_is_corrected_without_a_jump_and_without_an_error(tmp_path, kinematics):
    lines = ["TELL T1=20", "G28", "WAIT S=70", "M83", "G1 X50 Y50 Z5 F6000", "TELL T1=23", "WAIT S=60", "SHOW"]
    for k in range(60):  # a second each
        lines += [f"G1 X{50 + 10 * ((k + 1) % 2)} E0.3 F600", "SHOW", "G1 E-0.5 F2400", "G1 E0.5 F2400", "SHOW AT=same"]
    lines += ["G1 Z0 F600", "SHOW AT=bottom", "SELECTOR_CORRECTION ENABLE=0", "WAIT S=60", "G1 Z5 F600"]
    lines += ["SELECTOR_CORRECTION MOVE=1", "SHOW AT=off"]
    code, log, shown = klipper(z_model(), "\n".join(lines), tmp_path, configuration(kinematics))
    assert code == 0, log[-2000:]
    plain = [one for one in shown if not one["at"]]
    added_um = np.array([1000.0 * (one["toolhead"][2] - one["gcode"][2]) for one in plain])
    assert np.abs(np.diff(added_um)).max() <= 1.0 + 1e-6
    assert added_um[[0, -1]] == pytest.approx([0.0, -30.0], abs=1e-6)
    same = [one for one in shown if one["at"] == "same"]
    assert [one["toolhead"][2] for one in same] == [one["toolhead"][2] for one in plain[1:]]
    told = {one["at"]: one["toolhead"][2] for one in shown}
    assert told["bottom"] == 0.0, "never beyond the end of the axis"
    assert told["off"] == pytest.approx(5.0, abs=1e-9)


@pytest.mark.parametrize("has_probe", [False, True])
def test_homing_by_endstop_and_by_probe_measures_the_error_away(tmp_path, has_probe):
    gcode = f"""
        TELL T1=20
        G28
        {"BED_MESH_CALIBRATE" if has_probe else ""}
        WAIT S=70
        G1 X50 Y50 Z20 F6000
        SHOW AT=cold
        TELL T1=23
        WAIT S=60
        SELECTOR_CORRECTION MOVE=1
        SHOW AT=warm
        G28 X
        SHOW AT=homed-x
        G28 Z
        SHOW AT=homed-z
        G1 Z20 F600
        SHOW AT=at-once
        WAIT S=60
        TELL T1=24
        WAIT S=60
        SELECTOR_CORRECTION MOVE=1
        SHOW AT=since
    """
    code, log, shown = klipper(z_model(), gcode, tmp_path, configuration(has_probe=has_probe))
    assert code == 0, log[-2000:]
    added_um = {one["at"]: 1000.0 * (one["toolhead"][2] - one["gcode"][2]) for one in shown}
    mesh_um = added_um["cold"]  # what is left of the mesh so far above the bed
    assert (mesh_um == 0.0) is not has_probe
    assert added_um["warm"] - mesh_um == pytest.approx(-30.0)
    assert added_um["homed-x"] - mesh_um == pytest.approx(-30.0)
    if not has_probe:
        assert added_um["homed-z"] == pytest.approx(0.0, abs=1e-9)
    assert added_um["at-once"] - mesh_um == pytest.approx(0.0, abs=1e-9)
    assert added_um["since"] - mesh_um == pytest.approx(-10.0)


def test_a_macro_that_homes_only_what_is_not_homed_measures_nothing_away(tmp_path):
    macro = """
[gcode_macro G28]
rename_existing: G28.1
gcode:
  {% if 'z' not in printer.toolhead.homed_axes %}
    G28.1
  {% endif %}
"""
    gcode = """
        TELL T1=20
        G28
        WAIT S=70
        G1 X50 Y50 Z20 F6000
        TELL T1=23
        WAIT S=60
        SELECTOR_CORRECTION MOVE=1
        G28
        SHOW AT=skipped
        G28.1
        SHOW AT=homed
    """
    code, log, shown = klipper(z_model(), gcode, tmp_path, macro + configuration())
    assert code == 0, log[-2000:]
    assert [1000.0 * (one["toolhead"][2] - one["gcode"][2]) for one in shown] == pytest.approx([-30.0, 0.0], abs=1e-9)


def test_the_sign_test_of_the_sheet(tmp_path):
    (commanded,) = klipper_export(z_model()).sign_test.commanded
    test, move = commanded.command.split("; after the wait ")
    gcode = f"""
        G28
        G1 Z5 F600
        SELECTOR_CORRECTION ENABLE=0
        WAIT S=5
        {test}
        WAIT S={commanded.wait_s:.0f}
        {move}
        SHOW
    """
    code, log, (shown,) = klipper(z_model(), gcode, tmp_path, configuration())
    assert code == 0, log[-2000:]
    assert "mode 5" in log
    for told in commanded.shown.split("; ")[1:]:
        assert told in log
    assert 1000.0 * (shown["toolhead"][2] - 5.0) == pytest.approx(commanded.expected_um)


def test_motors_off_and_a_move_before_homing(tmp_path):
    gcode = """
        TELL T1=20
        G28
        WAIT S=70
        G1 X50 Y50 Z20 F6000
        TELL T1=23
        WAIT S=60
        SELECTOR_CORRECTION MOVE=1
        M84
        WAIT S=2
        SHOW AT=off
        G28 X Y
        G1 X50 F6000
        SHOW AT=without-z
        G28 Z
        G1 Z20 F600
        WAIT S=60
        SHOW AT=again
    """
    code, log, shown = klipper(z_model(), gcode, tmp_path, configuration())
    assert code == 0, log[-2000:]
    assert [one["status"]["mode"] for one in shown] == [0, 0, 1]
    assert shown[-1]["toolhead"][2] == pytest.approx(20.0)


def test_klipper_refuses_a_sensor_that_is_not_there_in_words(tmp_path):
    section = "[selector_correction]\nsensor_1: temperature_sensor typo\n"
    code, log, _ = klipper(z_model(), "G28\n", tmp_path, configuration(), section)
    assert code != 0
    assert "sensor_1 (T1) is 'temperature_sensor typo', which is not in the configuration" in log
    code, log, _ = klipper(z_model(), "G28\n", tmp_path, configuration(), "[selector_correction]\n")
    assert code != 0
    assert "Option 'sensor_1' in section 'selector_correction' must be specified" in log


def test_the_section_of_a_model_with_other_names_asks_for_them(tmp_path):
    code, log, _ = klipper(rich_model(), "G28\n", tmp_path, configuration())
    assert code != 0
    assert "Option 'sensor_2' in section 'selector_correction' must be specified" in log
