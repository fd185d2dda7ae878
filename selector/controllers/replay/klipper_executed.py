"""The generated extra of Klipper, called by a stand-in for Klipper's printer: what it needs of it, and no more."""

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from selector.controllers.evaluator import axes_of
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.replay.parts import Answers, Rows
from selector.controllers.writers.klipper import AXES, COMMAND, NAME, klipper_extra

__all__ = ["klipper_answers"]


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
        self.lookup_objects = lambda: list(self.sensors.items())
        self.register_event_handler = self.handlers.__setitem__
        self.register_timer = lambda tick, _time: setattr(self, "tick", tick)
        self.tick: Callable[[float], float]
        self.extra: Any = names["load_config"](self)
        self.handlers["klippy:connect"]()
        self.handlers["klippy:ready"]()

    def get(self, name: str, *default: Any) -> Any:
        return self.options.get(name, *default) if default else self.options[name]

    def getfloat(self, name: str, default: float, **_limits: float) -> float:
        return float(self.options.get(name, default))

    def getboolean(self, name: str, default: bool) -> bool:
        return bool(self.options.get(name, default))

    def lookup_object(self, name: str, *default: Any) -> Any:
        known = dict.fromkeys(("gcode", "toolhead", "gcode_move"), self) | self.sensors
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
    extra, program = printer.extra, printer.extra.program
    names = [variable.name for variable in guarded_program(model).of("output")]
    letters = [output.axis_or_name.upper() for output in model.outputs]
    places = [AXES.index(axis.upper()) for axis in axes_of(model)]
    positions, tests, found = 1000.0 * rows.positions_m, rows.tests_um(len(letters)), []
    for k in range(len(rows)):
        # so that the difference of both times is the time of the row to the last bit
        extra.last_time, printer.now = 0.0, float(rows.dt_s[k])
        printer.readings, printer.homed = rows.readings[k].tolist(), "xyz" if rows.is_ready[k] else ""
        for sensor in printer.sensors.values():
            if hasattr(sensor, "speak"):
                sensor.speak(printer.now, 0.0)
        for axis, place in zip(places, positions[k].tolist(), strict=True):
            extra.last[axis] = place
        program.is_restart, program.standstill_s = bool(rows.is_restart[k]), float(rows.standstill_s[k])
        commanded = {f"TEST_{letter}": um for letter, um in zip(letters, tests[k].tolist(), strict=True)}
        printer.run(COMMAND, ENABLE=int(rows.is_wanted[k]), **commanded)
        printer.tick(printer.now)
        found.append([getattr(program, name) for name in names])
    table = np.array(found, dtype=np.float64).reshape(len(rows), len(names))
    return Answers.of_outputs(dict(zip(names, table.T, strict=True)), model)
