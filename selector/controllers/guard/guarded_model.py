"""A model behind its guard, call by call: the executable meaning of every program that `selector export` writes.

Only + − × ÷ and comparisons, in the order written here, in one number type. A program that keeps the order computes the
same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from selector.controllers.evaluator import Equations, polynomial
from selector.controllers.guard.codes import (
    GAP_STEPS_LOG2,
    LARGEST_NUMBER,
    LONGEST_S,
    LONGEST_STEP_S,
    SAMPLE_S,
    Mode,
    SensorCode,
)
from selector.controllers.guard.correction import AxisPosition, Correction
from selector.controllers.guard.decided import decided_limits, longest_test_s, valid_positions_m
from selector.controllers.guard.sensor_watch import SensorWatch
from selector.controllers.model_file import Input, ModelFile, State

Number = Callable[[float], Any]


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


class GuardedModel:
    """A model with its guard and its state; ranges and references of its own inputs hold in its fallbacks, too.

    `number` is ``float`` (IEEE 754 binary64) or ``numpy.float32`` (binary32); `start_readings` are those that the
    control kept; default: the first reading that is good and stays so for `recover_after_s`.
    """

    def __init__(
        self, model: ModelFile, number: Number = float, start_readings: Mapping[str, float] | None = None
    ) -> None:
        self._number = number
        self._zero = number(0.0)
        self._guard = model.guard
        starts = start_readings or {}
        everything: tuple[Equations, ...] = (model, *model.fallbacks)
        self._watches = {
            item.name: SensorWatch(item, model.guard, number, starts.get(item.name)) for item in model.inputs
        }
        self._equations = [_Scaled(of, number) for of in everything]
        # memory is of a sensor and a time constant: model and fallbacks share it
        self._lagged: dict[tuple[str, float], Any] = {}
        self._taus = sorted({(state.source, state.tau_s) for of in everything for state in of.states})
        limits, _ = decided_limits(model)
        reference = {output.position.axis: output.position.reference_m for output in model.outputs if output.position}
        self._axes = {
            axis: AxisPosition(number(reference[axis]), number(low), number(high), number(LARGEST_NUMBER))
            for axis, (low, high) in valid_positions_m(model).items()
        }
        self._outputs = [Correction(output, limits[output.name], number) for output in model.outputs]
        self._largest, self._longest_s = number(LARGEST_NUMBER), number(LONGEST_S)
        self._longest_step_s, self._sample_s = number(LONGEST_STEP_S), number(SAMPLE_S)
        hold = model.guard.hold_at_most_s
        self._hold_at_most_s = None if hold is None else number(hold)
        self._longest_test_s = number(longest_test_s(model))
        self._since_sample_s = self._held_s = self._test_left_s = self._zero
        self._is_first = True
        self._follows = self._mode = int(Mode.HOLD)

    def step(
        self,
        dt_s: float,
        readings: Mapping[str, float],
        positions_m: Mapping[str, float] | None = None,
        *,
        is_ready: bool = True,
        is_wanted: bool = True,
        test_um: Mapping[str, float] | None = None,
    ) -> Corrected:
        """The correction after `dt_s` more seconds; what is no time, or more than 10⁶ s, counts as 0.

        Readings [unit of the input] may be anything, NaN and infinity included. A position [m] that is missing or no
        number stays where it was last. Without `is_ready` (drives on and axis referenced) there is no correction at
        once; without `is_wanted` (the operator's switch) it is ramped to zero.

        `test_um` is for the sign test: while one is a number other than 0 [µm], its output goes there, the others to
        zero, whatever sensors and operator say. Only after a call in which all were 0 and the axis was ready, and for
        `longest_test_s`: what was forgotten there ramps the correction to zero.
        """
        number = self._number
        with np.errstate(all="ignore"):
            if self._is_first:
                self._check_kept()
            dt = self._passed(dt_s)
            for axis, position in self._axes.items():
                position.take(number((positions_m or {}).get(axis, float("nan"))))
            self._since_sample_s = min(self._since_sample_s + dt, self._longest_s)
            if self._is_first or self._since_sample_s >= self._sample_s:
                self._sample(readings)
                self._is_first = False
                self._since_sample_s = self._zero
            tests = [self._tested((test_um or {}).get(output.name, 0.0)) for output in self._outputs]
            self._mode = self._followed_now(tests, is_ready=is_ready, is_wanted=is_wanted)
            slewed_s = min(dt, self._longest_step_s)
            for output, test in zip(self._outputs, tests, strict=True):
                output.move(self._mode, slewed_s, self._axes, test)
        return Corrected(
            {output.name: output.correction for output in self._outputs},
            {output.name: output.k0.now for output in self._outputs},
            {output.name: output.slope.now for output in self._outputs},
            self._mode,
            tuple(watch.code for watch in self._watches.values()),
            {axis: position.code for axis, position in self._axes.items()},
        )

    def restart(self, standstill_s: float) -> None:
        """The control was off for so long: memory goes on, the correction begins at zero.

        Start readings are kept or taken anew, as the guard of the model file says.
        """
        off = self._duration(standstill_s)
        limit = self._guard.new_start_after_s
        anew = self._guard.restart == "new-start" or (limit is not None and off > self._number(limit))
        for watch in self._watches.values():
            watch.passed(off)
            if anew:
                watch.forget_start()
        self._is_first = True
        self._since_sample_s = self._held_s = self._test_left_s = self._zero
        self._follows = int(Mode.HOLD)
        for output in self._outputs:
            output.stop()

    @property
    def start_readings(self) -> dict[str, float]:
        """Start readings so far, for the control to keep."""
        return {
            name: float(watch.start_believed)
            for name, watch in self._watches.items()
            if watch.start_believed is not None
        }

    def _check_kept(self) -> None:
        for name, watch in self._watches.items():
            watch.check_kept(level for (source, _), level in self._lagged.items() if source == name)

    def _passed(self, seconds: float) -> Any:
        """What is no time counts as 0, and what is longer than clocks run is none."""
        passed = self._number(seconds)
        return passed if self._zero < passed <= self._longest_s else self._zero

    def _duration(self, seconds: float) -> Any:
        """What is no time counts as 0."""
        with np.errstate(all="ignore"):
            duration = self._number(seconds)
        return min(duration, self._longest_s) if duration > self._zero else self._zero

    def _tested(self, commanded_um: float) -> Any:
        """What is no number commands nothing."""
        test = self._number(commanded_um)
        return test if -self._largest <= test <= self._largest else self._zero

    def _followed_now(self, tests: Sequence[Any], *, is_ready: bool, is_wanted: bool) -> int:
        mode = self._follows if is_wanted else int(Mode.SWITCHED_OFF)
        if not any(tests):
            self._test_left_s = self._longest_test_s
        else:
            mode = int(Mode.TEST if self._test_left_s > self._zero else Mode.SWITCHED_OFF)
        if not is_ready:
            mode, self._test_left_s = int(Mode.OFF), self._zero
        return mode

    def _sample(self, readings: Mapping[str, float]) -> None:
        number = self._number
        if self._mode == Mode.TEST:
            self._test_left_s = max(self._test_left_s - self._since_sample_s, self._zero)
        for name, watch in self._watches.items():
            watch.sample(self._since_sample_s, number(readings[name]))
        for source, tau_s in self._taus:
            watch = self._watches[source]
            if watch.begins:
                self._lagged[source, tau_s] = watch.x
            if watch.is_believed:
                level = self._lagged[source, tau_s]
                gain = self._gain(number(tau_s), watch.since_s, is_gap=watch.is_new and watch.has_memory)
                self._lagged[source, tau_s] = level + gain * (watch.x - level)
        for watch in self._watches.values():
            if watch.is_believed:
                watch.remember()
        self._follows = self._followed()
        if self._follows == Mode.RAMP_TO_ZERO:
            for output in self._outputs:
                output.aim_at_zero()
        elif self._follows != Mode.HOLD:
            at = max(0, self._follows - Mode.FALLBACK + 1)
            found = self._equations[at].displacements(self._watches, self._lagged)
            for output, (displacement, slope) in zip(self._outputs, found, strict=True):
                output.aim(displacement, slope)

    def _gain(self, tau_s: Any, since_s: Any, *, is_gap: bool) -> Any:
        """Share of the way to x that a memory goes (backward Euler); over a standstill in equal steps."""
        if not is_gap:
            return since_s / (tau_s + since_s)
        one, steps = self._number(1.0), self._number(float(2**GAP_STEPS_LOG2))
        left = one / (one + since_s / (steps * tau_s))
        for _ in range(GAP_STEPS_LOG2):
            left = left * left
        return one - left

    def _followed(self) -> int:
        if self._equations[0].can_be_used(self._watches):
            self._held_s = self._zero
            return int(Mode.MODEL)
        if self._guard.on_fault == "fallback":
            for k, equations in enumerate(self._equations[1:]):
                if equations.can_be_used(self._watches):
                    self._held_s = self._zero
                    return Mode.FALLBACK + k
        if self._guard.last_resort == "ramp-to-zero":
            return int(Mode.RAMP_TO_ZERO)
        self._held_s = min(self._held_s + self._since_sample_s, self._longest_s)
        if self._hold_at_most_s is not None and self._held_s > self._hold_at_most_s:
            return int(Mode.RAMP_TO_ZERO)
        return int(Mode.HOLD)


class _Scaled:
    """A model or a fallback, calculated in one number type."""

    def __init__(self, of: Equations, number: Number) -> None:
        self._of, self._number = of, number
        variables: tuple[Input | State, ...] = (*of.inputs, *of.states)
        self._scaling = {item.name: (number(item.centre), number(item.scale)) for item in variables}

    def can_be_used(self, watches: Mapping[str, SensorWatch]) -> bool:
        return all(watches[item.name].is_believed for item in self._of.inputs)

    def displacements(
        self, watches: Mapping[str, SensorWatch], lagged: Mapping[tuple[str, float], Any]
    ) -> list[tuple[Any, Any]]:
        """Per output, (at the reference position, slope)."""
        values = {item.name: watches[item.name].x for item in self._of.inputs}
        values |= {state.name: lagged[state.source, state.tau_s] for state in self._of.states}
        z = {name: (values[name] - centre) / scale for name, (centre, scale) in self._scaling.items()}
        found = []
        for output in self._of.outputs:
            part, slope = output.position, self._number(0.0)
            if part is not None:
                slope = polynomial(part.intercept, part.terms, z, self._number)
            found.append((polynomial(output.intercept, output.terms, z, self._number), slope))
        return found
