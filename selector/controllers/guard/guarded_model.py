"""A model behind its guard, call by call: the statements that every exported program is printed from, executed."""

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import SensorCode, TouchCode
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Number, executable


@dataclass(frozen=True)
class Corrected:
    """What one call gives."""

    correction_um: dict[str, Any]  #: Per output: what is to be added to the axis where it stands
    #: k0_um and slope_um_per_m: The same as a straight line: correction = k0 + slope · (P − P0), before the clamp of
    #: the whole
    k0_um: dict[str, Any]
    slope_um_per_m: dict[str, Any]
    mode: int  #: `Mode`; FALLBACK + k for the k-th fallback
    sensors: tuple[SensorCode, ...]  #: In the order of the model's inputs
    #: Per axis whose position the model needs: OK, LIMITED (beyond its valid positions) or MISSING
    axes: dict[str, SensorCode]
    touches: dict[str, TouchCode]  #: Per output that is adapted: what became of its last touch-off


class GuardedModel:
    """A model behind its guard.

    `number` is the type of every number: `float` (binary64) or ``numpy.float32`` (binary32); `start_readings` are those
    that the control kept; default: the first reading that is good and stays so for `recover_after_s`.
    """

    def __init__(
        self, model: ModelFile, number: Number = float, start_readings: Mapping[str, float] | None = None
    ) -> None:
        self._number = number
        program = guarded_program(model)
        self._block = executable(program, number)
        self._retained = [one.name for one in program.of("retained")]
        self._sensors = {item.name: k for k, item in enumerate(model.inputs, 1)}
        self._rises = {item.name: k for k, item in enumerate(model.inputs, 1) if item.reference == "rise"}
        self._axes = {axis: k for k, axis in enumerate(axes_of(model), 1)}
        self._outputs = {output.name: k for k, output in enumerate(model.outputs, 1)}
        self._adapted = [] if model.adaptation is None else [of.output for of in model.adaptation.outputs]
        for name in self._rises.keys() & (start_readings or {}).keys():
            self._set("start", self._rises[name], (start_readings or {})[name])
            setattr(self._block, f"has_start_{self._rises[name]}", True)

    def step(
        self,
        dt_s: float,
        readings: Mapping[str, float],
        positions_m: Mapping[str, float] | None = None,
        *,
        is_ready: bool = True,
        is_wanted: bool = True,
        test_um: Mapping[str, float] | None = None,
        touch_um: Mapping[str, float] | None = None,
        is_touch_valid: bool = False,
    ) -> Corrected:
        """The correction after `dt_s` more seconds; what is no time, or more than 10⁶ s, counts as 0.

        Readings [unit of the input] may be anything, NaN and infinity included. A position [m] that is missing or no
        number stays where it was last. Without `is_ready` (drives on and axis referenced) there is no correction at
        once; without `is_wanted` (the operator's switch) it is ramped to zero.

        `test_um` is for the sign test: while one is a number other than 0 [µm], its output goes there, the others to
        zero, whatever sensors and operator say. Only after a call in which all were 0 and the axis was ready, and for
        `longest_test_s`: what was forgotten there ramps the correction to zero.

        `touch_um` is the displacement that a probe shows while the correction acts [µm], for outputs that are adapted;
        it is taken in the call in which `is_touch_valid` becomes true, and acts with the next sample of the readings.
        """
        block = self._block
        with np.errstate(all="ignore"):
            block.dt_s = self._number(dt_s)
            for name, k in self._sensors.items():
                self._set("reading", k, readings[name])
            for axis, k in self._axes.items():
                self._set("position", k, (positions_m or {}).get(axis, float("nan")))
            for name, k in self._outputs.items():
                self._set("test_um", k, (test_um or {}).get(name, 0.0))
                self._set("touch_um", k, (touch_um or {}).get(name, float("nan")))
            block.is_ready, block.is_wanted, block.is_touch_valid = is_ready, is_wanted, is_touch_valid
            block.call()
        block.is_restart = block.was_restart = False
        return Corrected(
            self._given("correction", self._outputs),
            self._given("k0", self._outputs),
            {name: getattr(block, f"slope_{k}", self._number(0.0)) for name, k in self._outputs.items()},
            block.mode,
            tuple(map(SensorCode, self._given("sensor", self._sensors).values())),
            {axis: SensorCode(code) for axis, code in self._given("axis", self._axes).items()},
            {name: TouchCode(getattr(block, f"touch_{self._outputs[name]}")) for name in self._adapted},
        )

    def restart(self, standstill_s: float) -> None:
        """The control was off for so long: memory goes on, the correction begins at zero.

        Start readings are kept or taken anew, as the guard of the model file says.
        """
        with np.errstate(over="ignore"):
            self._block.is_restart, self._block.standstill_s = True, self._number(standstill_s)

    def again(self) -> "GuardedModel":
        """The same model in a control that has never run and kept nothing."""
        other = copy(self)
        other._block = type(self._block)()
        return other

    @property
    def retained(self) -> dict[str, float]:
        """What the control keeps while it is off: start readings, memory, what touch-offs taught."""
        return {name: float(getattr(self._block, name)) for name in self._retained}

    def retain(self, kept: Mapping[str, float]) -> None:
        """Take up what `retained` was. Raises ValueError: that is not all of it, or no numbers."""
        if set(kept) != set(self._retained) or not all(math.isfinite(float(one)) for one in kept.values()):
            raise ValueError("kept values that are not those of this model")
        for name, value in kept.items():
            is_flag = isinstance(getattr(self._block, name), bool)
            setattr(self._block, name, bool(value) if is_flag else self._number(value))

    def _set(self, name: str, k: int, value: float) -> None:
        setattr(self._block, f"{name}_{k}", self._number(value))

    def _given(self, name: str, of: Mapping[str, int]) -> dict[str, Any]:
        return {key: getattr(self._block, f"{name}_{k}") for key, k in of.items()}
