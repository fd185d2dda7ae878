"""The meaning of a model file, written a second time."""

import math
from collections.abc import Mapping
from typing import Any

from selector.controllers.evaluator import Equations
from selector.controllers.model_file import Output, PositionPart


class Evaluator:
    """One sample after another, in plain arithmetic: what `evaluate` gives to the last bit.

    A reading that is not a finite number is missing: outputs that need it are NaN, the memory of its sensor waits, and
    time goes on for it when readings come back. A start reading that is not given is the first reading.
    """

    def __init__(self, model: Equations, start_readings: Mapping[str, float] | None = None) -> None:
        self._model = model
        self._start = {name: float(value) for name, value in (start_readings or {}).items()}
        self._memory: dict[str, tuple[float, float]] = {}

    def step(
        self, time_s: float, readings: Mapping[str, float], positions_m: Mapping[str, float] | None = None
    ) -> dict[str, float]:
        """The outputs [µm] at the next sample; `positions_m` by axis [m], none = every axis at its reference."""
        x: dict[str, float] = {}
        z: dict[str, Any] = {}
        for item in self._model.inputs:
            value = float(readings[item.name])
            if not math.isfinite(value):
                value = math.nan
            elif item.reference == "rise":
                value = value - self._start.setdefault(item.name, value)
            x[item.name] = value
            z[item.name] = (value - item.centre) / item.scale
        for state in self._model.states:
            value = x[state.source]
            if value == value:
                if state.name in self._memory:
                    before_s, lagged = self._memory[state.name]
                    dt_s = time_s - before_s
                    value = lagged + dt_s / (state.tau_s + dt_s) * (value - lagged)
                self._memory[state.name] = (time_s, value)
            z[state.name] = (value - state.centre) / state.scale
        return {output.name: displacement(output, z, positions_m) for output in self._model.outputs}


def displacement(output: Output, z: Mapping[str, float], positions_m: Mapping[str, float] | None) -> float:
    """An output [µm] of scaled values, at positions [m] or at the references."""
    found, part = polynomial(output, z), output.position
    if part is not None and positions_m is not None:
        found += polynomial(part, z) * (positions_m[part.axis] - part.reference_m)
    return found


def polynomial(of: Output | PositionPart, z: Mapping[str, float]) -> float:
    """Intercept and terms, powers by repeated multiplication, from left to right."""
    total = of.intercept
    for term in of.terms:
        product = term.coefficient
        for name, power in term.powers.items():
            for _ in range(power):
                product *= z[name]
        total += product
    return total
