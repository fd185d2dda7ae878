"""What printers run: the extra of Klipper, called by a stand-in for its printer; RepRapFirmware's macro in binary32."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import CodeType, SimpleNamespace
from typing import Any

import numpy as np

from selector.controllers.evaluator import axes_of
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import Answers, Rows, called
from selector.controllers.writers.fanuc import macro_model
from selector.controllers.writers.klipper import AXES, COMMAND, NAME, klipper_extra
from selector.controllers.writers.reprapfirmware import START, STEP

__all__ = ["klipper_answers", "reprapfirmware_answers"]


class Printer:
    """Printer, configuration, G-code, tool head and temperature sensors of Klipper, in one object.

    Their names are Klipper's. `readings` and `homed` are what a test sets; `sent` are the moves that came out.
    `arguments` are those that Klipper was started with; default: as for a test of a configuration.
    """

    def __init__(
        self, text: str, options: Mapping[str, Any] | None = None, arguments: Mapping[str, str] | None = None
    ) -> None:
        names: dict[str, Any] = {}
        # our own text, from numbers and variable names; names of the model stand in remarks and as literals only
        exec(compile(text, f"{NAME}.py", "exec"), names)  # noqa: S102
        units = [unit for _, unit in names["INPUTS"]]
        self.now, self.homed, self.is_off, self.said = 0.0, "xyz", False, ""
        self.at = [0.0, 0.0, 0.0, 0.0]
        self.sent: list[tuple[float, ...]] = []
        self.readings: list[Any] = [None] * len(units)
        self.options: dict[str, Any] = {f"sensor_{k}": f"temperature_sensor s{k}" for k in range(1, len(units) + 1)}
        self.options |= {f"field_{k}": "rpm" for k, unit in enumerate(units, start=1) if unit != "degC"}
        self.options |= options or {}
        self.sensors = {self.options[f"sensor_{k + 1}"]: self._sensor(k) for k in range(len(units))}
        self.commands: dict[str, Callable[[Any], None]] = {"G28": lambda _: None}
        self.handlers: dict[str, Callable[[], None]] = {}
        self.config_error = self.error = ValueError
        self.getfloat = self.getboolean = self.get
        self.get_name = lambda: NAME
        self.get_start_args = lambda: arguments or {"config_file": "printer.cfg", "debugoutput": ""}
        self.get_printer = self.get_reactor = self.get_kinematics = lambda: self
        self.monotonic = lambda: self.now
        self.is_shutdown = lambda: self.is_off
        limits = {"axis_minimum": [-1e4] * 3, "axis_maximum": [1e4] * 3}
        self.get_status = lambda _time: limits | {"homed_axes": self.homed}
        self.get_position = lambda: list(self.at)
        self.set_move_transform = lambda _transform, force: self
        self.reset_last_position = lambda: self.extra.get_position()
        self.wait_moves = lambda: None
        self.load_object = lambda _config, _name: None
        self.available_sensors = list(self.sensors)
        self.register_event_handler = self.handlers.__setitem__
        self.register_timer = lambda tick, _time: setattr(self, "tick", tick)
        self.tick: Callable[[float], float]
        self.extra: Any = names["load_config"](self)
        self.handlers["klippy:connect"]()
        self.handlers["klippy:ready"]()

    def get(self, name: str, *default: Any, **_limits: float) -> Any:
        return self.options.get(name, *default) if default else self.options[name]

    def lookup_object(self, name: str, *default: Any) -> Any:
        known = dict.fromkeys(("gcode", "toolhead", "gcode_move", "heaters"), self) | self.sensors
        return known.get(name, *default) if default else known[name]

    def register_command(self, name: str, call: Any, **_help: str) -> Any:
        former = self.commands.pop(name, None)
        if call is not None:
            self.commands[name] = call
        return former

    def move(self, position: list[float], speed: float) -> None:
        self.at = list(position)
        self.sent.append((*position, speed))

    def run(self, command: str, **parameters: Any) -> None:
        """A G-code command with its parameters."""

        def asked(name: str, default: Any = None, **_limits: float) -> Any:
            return parameters.get(name, default)

        gcmd = SimpleNamespace(get=asked, get_int=asked, get_float=asked, error=ValueError)
        gcmd.respond_info = lambda text: setattr(self, "said", text)
        self.commands[command](gcmd)

    def _sensor(self, k: int) -> SimpleNamespace:
        """A section ``temperature_sensor``; ``speak`` is what its driver calls with a reading."""
        section = SimpleNamespace(temperature_callback=lambda _time, _temperature: None)
        section.sensor = SimpleNamespace(setup_callback=lambda callback: setattr(section, "speak", callback))
        section.get_status = lambda _time: dict.fromkeys(("temperature", "rpm"), self.readings[k])
        return section


def klipper_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the extra gives in Klipper's timer; default of the files: as exported."""
    printer = Printer(files[f"{NAME}.py"] if files else klipper_extra(model))
    extra, row = printer.extra, SimpleNamespace()
    letters = [output.axis_or_name.upper() for output in model.outputs]
    places = [AXES.index(axis.upper()) for axis in axes_of(model)]

    def tick() -> None:
        # so that the difference of both times is the time of the row to the last bit
        extra.last_time, printer.now = 0.0, row.dt_s
        printer.readings = [getattr(row, f"reading_{k + 1}") for k in range(len(printer.readings))]
        printer.homed = "xyz" if row.is_ready else ""
        for sensor in printer.sensors.values():
            if hasattr(sensor, "speak"):
                sensor.speak(printer.now, 0.0)
        for k, place in enumerate(places, start=1):
            extra.last[place] = 1000.0 * getattr(row, f"position_{k}")
        extra.program.is_restart, extra.program.standstill_s = row.is_restart, row.standstill_s
        tests = {f"TEST_{letter}": getattr(row, f"test_um_{k}") for k, letter in enumerate(letters, start=1)}
        printer.run(COMMAND, ENABLE=int(row.is_wanted), **tests)
        printer.tick(printer.now)
        vars(row).update(vars(extra.program))

    return called(row, tick, model, rows, "", float)


#: What stands in a macro, and what it is in Python; every sensor is there, and nothing is kept in files.
_PYTHON = (
    (r" +;.*", ""), (r"^( *)(?:M98|echo) .*", r"\1pass"),
    (r"^( *)M290 R0 ([XYZ])\{(.*)\}", r"\1at['\2'].babystep = \3"),
    (r"^( *)set ", r"\1"), (r"^( *)var ", r"\1var."), (r"^( *)global ", r"\1global."), (r"\bglobal\.", "lasting."),
    (r"^( *(?:if .*|else))$", r"\1:"), (r"\bexists\(lasting\.(\w+)\)", r"hasattr(lasting, '\1')"),
    (r"\bexists\(sensors.*\)", "true"), (r"\bfileexists\(.*\)", "false"),
    (r"(?<![\w.])((?:\d+\.\d+|\d+(?=e))(?:e[-+]\d+)?)", r"number(\1)"), ("&&", "and"), (r"\|\|", "or"),
    ("!(?!=)", "not "), (r"\btrue\b", "True"), (r"\bfalse\b", "False"), (r"\bnull\b", "None"),
)  # fmt: skip


def reprapfirmware_answers(model: ModelFile, rows: Rows, files: Mapping[str, str]) -> Answers:
    """What the macro leaves in the babysteps, called in every row, with its mode and codes."""
    at = {axis: SimpleNamespace(homed=True, babystep=np.float32(0.0)) for axis in AXES}
    lasting, state = SimpleNamespace(), SimpleNamespace(upTime=0, time=None)
    analog = [SimpleNamespace(state="ok") for _ in model.inputs]
    names: dict[str, Any] = {"number": np.float32, "lasting": lasting, "state": state, "at": at}
    names |= {name: SimpleNamespace() for name in ("move", "sensors", "var")}
    names["move"].axes, names["sensors"].analog = list(at.values()), analog
    exec(_compiled(files[START]), names)  # noqa: S102
    step, sent = _compiled(files[STEP]), []

    def call() -> None:
        for k, sensor in enumerate(analog):
            sensor.lastReading = getattr(lasting, f"selector_reading_{k + 1}")
            setattr(lasting, f"selector_number_{k + 1}", k)
        # so that the difference of both times is the time of the row to the last bit
        state.upTime, lasting.selector_called_at = lasting.selector_dt_s, 0
        for axis in at.values():
            axis.homed = lasting.selector_is_ready
        exec(step, names)  # noqa: S102
        sent.append([1000.0 * float(at[output.axis_or_name.upper()].babystep) for output in model.outputs])

    with np.errstate(all="ignore"):
        found = called(lasting, call, macro_model(model), rows, "selector_", np.float32)
    return replace(found, correction_um=np.array(sent).reshape(found.correction_um.shape))


def _compiled(text: str) -> CodeType:
    # our own text, from numbers and variable names; names of the model stand in remarks only
    for was, becomes in _PYTHON:
        text = re.sub(was, becomes, text, flags=re.MULTILINE)
    return compile(text, "macro", "exec")
