#!/usr/bin/python3
"""The operator of the test's lathe: switches on, homes, moves, warms sensors up and breaks them; writes what he sees.

Started by linuxcnc as its DISPLAY; the job is in job.txt, what was seen goes to seen.json.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import hal
import linuxcnc

PINS = {
    "x_um": ("joint.0.motor-pos-cmd", 1000.0),
    "z_um": ("joint.1.motor-pos-cmd", 1000.0),
    "x_offset_um": ("axis.x.eoffset", 1000.0),
    "z_offset_um": ("axis.z.eoffset", 1000.0),
    "z_axis_um": ("axis.z.pos-cmd", 1000.0),
    "z_um_of_component": ("thermcorr.correction-1", 1.0),
    "x_um_of_component": ("thermcorr.correction-2", 1.0),
    "z_counts": ("thermcorr.counts-1", 1),
    "x_counts": ("thermcorr.counts-2", 1),
    "mode": ("thermcorr.mode", 1),
    "T1": ("thermcorr.sensor-1", 1),
    "T2": ("thermcorr.sensor-2", 1),
}
command, stat = linuxcnc.command(), linuxcnc.stat()
seen = {}
begun = time.monotonic()


def now():
    return {name: hal.get_value(pin) * factor for name, (pin, factor) in PINS.items()}


def note(name):
    stat.poll()
    seen[name] = now() | {
        "after_s": time.monotonic() - begun,
        "z_shown_um": stat.actual_position[2] * 1000.0,
        "enabled": bool(stat.enabled),
    }


def until(is_so, what, most_s=120.0):
    end = time.monotonic() + most_s
    while not is_so():
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: {now()}")
        time.sleep(0.005)


def still(name, seconds=1.3, most_s=120.0):
    """Waits until counts stand still for so long."""
    last, since, begin = None, time.monotonic(), time.monotonic()
    while time.monotonic() - since < seconds:
        values = now()
        counts = values["x_counts"], values["z_counts"]
        if counts != last:
            last, since = counts, time.monotonic()
        if time.monotonic() - begin > most_s:
            raise TimeoutError(f"{name} moves and moves: {now()}")
        time.sleep(0.01)
    note(name)


def temperatures(t1, t2):
    hal.set_p("thermcorr.reading-1", str(t1))
    hal.set_p("thermcorr.reading-2", str(t2))


def believed():
    """Waits until both sensors have been good for as many samples, one a second, as the guard asks for."""
    until(lambda: not hal.get_value("thermcorr.sensor-1") and not hal.get_value("thermcorr.sensor-2"), "sensors")


def mdi(text):
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete(60)
    command.mdi(text)
    command.wait_complete(60)
    time.sleep(0.1)


def switch_on():
    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.wait_complete(60)
    command.state(linuxcnc.STATE_ON)
    command.wait_complete(60)
    until(lambda: hal.get_value("motion.motion-enabled"), "machine on")


def home():
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete(60)
    command.teleop_enable(0)
    command.wait_complete(60)
    command.home(-1)
    until(lambda: hal.get_value("motion.is-all-homed"), "homed")
    command.wait_complete(60)
    command.teleop_enable(1)
    command.wait_complete(60)


def whole_day():
    temperatures(22.0, 25.0)
    believed()
    note("off")
    switch_on()
    time.sleep(0.3)
    note("not homed")
    home()
    mdi("G21 G90 G8 G0 X50 Z-30")
    still("cold")
    temperatures(26.0, 31.0)
    still("warm")
    mdi("G0 Z-130")
    still("far away", 0.3)
    mdi("G0 Z-30")
    still("back", 0.3)

    command.state(linuxcnc.STATE_OFF)
    command.wait_complete(60)
    until(lambda: not hal.get_value("motion.motion-enabled"), "machine off")
    time.sleep(0.1)
    note("power off")
    command.state(linuxcnc.STATE_ON)
    command.wait_complete(60)
    until(lambda: hal.get_value("motion.motion-enabled"), "machine on")
    note("power on")
    still("corrected again", 0.3)
    mdi("G0 Z-31")
    still("Z moved again", 0.3)
    mdi("G0 X50 Z-30")
    still("both moved again", 0.3)

    hal.set_p("thermcorr.is-wanted", "0")
    still("switched off", 0.3)
    hal.set_p("thermcorr.is-wanted", "1")
    still("switched on", 0.3)

    temperatures(26.0, 850.0)
    until(lambda: hal.get_value("thermcorr.mode") == 10, "fallback")
    still("T2 dead", 0.3)
    temperatures("nan", 850.0)
    until(lambda: hal.get_value("thermcorr.mode") == 2, "hold")
    still("both dead", 0.3)
    until(lambda: hal.get_value("thermcorr.mode") == 3, "ramp to zero")
    still("dead for long", 0.3)
    temperatures(26.0, 31.0)
    until(lambda: hal.get_value("thermcorr.mode") == 1, "model again")
    still("alive again", 0.3)


def next_day():
    temperatures(26.0, 31.0)
    switch_on()
    home()
    mdi("G21 G90 G8 G0 X50 Z-30")
    until(lambda: hal.get_value("thermcorr.mode") == 1, "model")
    still("next day", 1.3)


component = hal.component("operator")
component.ready()
try:
    {"whole day": whole_day, "next day": next_day}[Path("job.txt").read_text().strip()]()
except Exception as error:
    seen["error"] = repr(error)
    stat.poll()
    sys.stderr.write(repr(error))
subprocess.run(["halsampler", "-n", str(hal.get_value("sampler.0.curr-depth")), "course.txt"], check=True)
while (message := linuxcnc.error_channel().poll()) is not None:
    seen.setdefault("messages", []).append(message[1])
Path("seen.json").write_text(json.dumps(seen))
component.exit()
