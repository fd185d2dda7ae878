"""The guard and the model as a program: what `GuardedModel` executes and every writer prints."""

from functools import partial

from selector.controllers.evaluator import Equations, axes_of
from selector.controllers.guard import decided
from selector.controllers.model_file import ModelFile
from selector.controllers.program.language import Expression, Flag, Program, Variable, Writing, is_code
from selector.controllers.program.statements import NO_READING, AdaptedOutput, SlewedCorrection, WatchedSensor
from selector.controllers.program.steps import is_number, remembered


def guarded_program(model: ModelFile, *, has_zero: bool = False) -> Program:
    """The program of a model with its guard.

    Inputs ``dt_s``, ``reading_1`` …, ``position_1`` …, ``is_ready``, ``is_wanted``, ``is_restart``, ``standstill_s``,
    ``test_um_1`` …; outputs ``correction_1`` …, ``k0_1`` …, ``slope_1`` …, ``mode``, ``sensor_1`` …. Readings and
    sensors are numbered as the model's inputs, tests and corrections as its outputs, positions as `axes_of`. With
    adaptation also inputs ``is_touch_valid``, ``touch_um_1`` … and outputs ``touch_1`` …, of the outputs that have it.
    `has_zero`: and inputs ``is_zero_1`` …, for controls whose axes are homed where the error shows.
    """
    return _Guarded(model, has_zero=has_zero).program()


class _Guarded:
    def __init__(self, model: ModelFile, *, has_zero: bool) -> None:
        self._model = model
        self._w = w = Writing()
        self._dt = w.variable("dt_s", "real", "input", "time since the last call [s]")
        self._sensors = {
            item.name: WatchedSensor(w, item, model.guard, k) for k, item in enumerate(model.inputs, start=1)
        }
        axes = axes_of(model)
        reference = {o.position.axis: o.position.reference_m for o in model.outputs if o.position is not None}
        self._wired = [
            w.variable(f"position_{k}", "real", "input", f"position of axis {axis} [m]", NO_READING)
            for k, axis in enumerate(axes, start=1)
        ]
        self._ready = w.variable("is_ready", "flag", "input", "drives on and axis referenced", 1.0)
        self._wanted = w.variable("is_wanted", "flag", "input", "the operator's switch", 1.0)
        self._restart = w.variable("is_restart", "flag", "input", "true in the first call after the control was off")
        self._standstill = w.variable("standstill_s", "real", "input", "with is_restart: off for so long [s]")
        limits, _ = decided.decided_limits(model)
        block = model.adaptation
        self._is_touch, adapted = None, {}
        if block is not None:
            about = "a touch-off is there: set it for one call or longer, then false"
            self._is_touch = w.variable("is_touch_valid", "flag", "input", about)
            self._was_touch = w.variable("was_touch_valid", "flag", "kept", "is_touch_valid in the call before")
            has_slope = {output.name: output.position is not None for output in model.outputs}
            names = [output.name for output in model.outputs]
            adapted = {
                of.output: AdaptedOutput(w, of, block, names.index(of.output) + 1, has_slope=has_slope[of.output])
                for of in block.outputs
            }
        self._outputs = [
            SlewedCorrection(w, output, limits[output.name], k, adapted.get(output.name), has_zero=has_zero)
            for k, output in enumerate(model.outputs, 1)
        ]
        self._adapted = list(adapted.values())
        self._mode = w.variable(
            "mode", "code", "output",
            "0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test, 10 and more: fallback",
            float(decided.Mode.OFF),
        )  # fmt: skip
        self._codes = {
            axis: w.variable(
                f"axis_{k}", "code", "output", f"position of {axis}: 0 ok, 1 limited, 3 missing",
                float(decided.SensorCode.MISSING),
            )
            for k, axis in enumerate(axes, start=1)
        }  # fmt: skip
        self._at = {
            axis: w.variable(f"at_{k}", "real", "kept", f"last known position of axis {axis} [m]", reference[axis])
            for k, axis in enumerate(axes, start=1)
        }
        self._back = {axis: w.variable(f"back_{k}", "flag") for k, axis in enumerate(axes, start=1)}
        everything: tuple[Equations, ...] = (model, *model.fallbacks)
        taus = sorted({(state.source, state.tau_s) for of in everything for state in of.states})
        self._levels = {
            key: w.variable(f"level_{k}", "real", "retained", f"memory of {key[0]} over {key[1]:g} s")
            for k, key in enumerate(taus, start=1)
        }
        self._was_restart = w.variable("was_restart", "flag", "kept", "is_restart in the call before")
        self._first = w.variable("is_first", "flag", "kept", "no sample yet", 1.0)
        self._since = w.variable("since_sample_s", "real", "kept", "since the last sample [s]")
        self._held = w.variable("held_s", "real", "kept", "held for so long [s]")
        self._test_left = w.variable("test_left_s", "real", "kept", "a sign test may go on for so long [s]")
        self._follows = w.variable(
            "follows", "code", "kept", "as mode, while ready and wanted", float(decided.Mode.HOLD)
        )

    def program(self) -> Program:
        w = self._w
        with w.when(self._restart & ~self._was_restart):
            self._restarted()
        w.assign(self._was_restart, self._restart)
        with w.when(self._first):
            w.remark("what was kept is dropped where it cannot be")
            for name, sensor in self._sensors.items():
                sensor.kept_checked([level for (source, _), level in self._levels.items() if source == name])
            for adapted in self._adapted:
                adapted.kept_checked()
        dt = w.variable("passed_s")
        w.remark("time: what is no time, or too long, counts as 0")
        w.assign(dt, 0.0)
        with w.when((self._dt > 0.0) & (self._dt <= decided.LONGEST_S)):
            w.assign(dt, self._dt)
        self._positions()
        for one in self._outputs:
            one.zeroed(self._at)
        w.assign(self._since, self._since + dt, most=decided.LONGEST_S)
        if self._is_touch is not None:
            w.remark("a touch-off is taken when it becomes valid, and acts with the next sample")
            for output in self._outputs:
                output.touched(self._is_touch & ~self._was_touch)
            w.assign(self._was_touch, self._is_touch)
        with w.when(self._first | (self._since >= decided.SAMPLE_S)):
            self._sample()
            w.assign(self._first, False)
            w.assign(self._since, 0.0)
        self._choose_mode()
        slewed = w.variable("slewed_s")
        w.assign(slewed, dt, most=decided.LONGEST_STEP_S)
        for one in self._outputs:
            one.moved(self._mode, slewed, self._at, self._back)
        return w.program(self._model.name)

    def _choose_mode(self) -> None:
        w, left, is_test = self._w, self._test_left, self._w.variable("is_test", "flag")
        w.assign(self._mode, self._follows)
        with w.when(~self._wanted):
            w.assign(self._mode, decided.Mode.SWITCHED_OFF)
        w.remark("sign test: only after all were 0 while ready, and not for ever; else to zero")
        w.assign(is_test, False)
        for one in self._outputs:
            one.tested(is_test)
        with w.when(is_test):
            w.assign(self._mode, decided.Mode.SWITCHED_OFF)
            with w.when(left > 0.0):
                w.assign(self._mode, decided.Mode.TEST)
        with w.otherwise():
            w.assign(left, decided.longest_test_s(self._model))
        with w.when(~self._ready):
            w.assign(self._mode, decided.Mode.OFF)
            w.assign(left, 0.0)

    def _positions(self) -> None:
        w = self._w
        for wired, (axis, (low, high)) in zip(self._wired, decided.valid_positions_m(self._model).items(), strict=True):
            at, code, back = self._at[axis], self._codes[axis], self._back[axis]
            w.assign(back, False)
            with w.when(is_number(wired)):
                w.assign(back, is_code(code, decided.SensorCode.MISSING))
                w.assign(at, wired)
                w.assign(code, decided.SensorCode.OK)
                with w.when((at < low) | (at > high)):
                    w.assign(code, decided.SensorCode.LIMITED)
            with w.otherwise():
                w.assign(code, decided.SensorCode.MISSING)

    def _restarted(self) -> None:
        w, guard = self._w, self._model.guard
        w.remark("the control was off: memory goes on, the correction begins at zero")
        off = w.variable("off_s")
        w.assign(off, 0.0)
        with w.when(self._standstill > 0.0):
            w.assign(off, self._standstill)
        w.limit(off, most=decided.LONGEST_S)
        for sensor in self._sensors.values():
            sensor.passed(off)
        anew: Expression | None = None
        if guard.restart == "new-start":
            anew = Flag(True)
        elif guard.new_start_after_s is not None:
            anew = off > guard.new_start_after_s
        if anew is not None:
            with w.when(anew):
                for sensor in self._sensors.values():
                    sensor.begins_anew()
        w.assign(self._first, True)
        w.assign(self._since, 0.0)
        w.assign(self._held, 0.0)
        w.assign(self._test_left, 0.0)
        w.assign(self._follows, decided.Mode.HOLD)
        for one in self._outputs:
            one.stopped()
        for adapted in self._adapted:
            adapted.passed(off)
            adapted.stopped()

    def _sample(self) -> None:
        w = self._w
        with w.when(is_code(self._mode, decided.Mode.TEST)):
            w.assign(self._test_left, self._test_left - self._since, least=0.0)
        for output in self._outputs:
            if output.adapted is not None:
                output.adapted.passed(self._since)
        is_new_start = self._is_new_start()
        if is_new_start is not None and any(one.adapted is not None and one.is_rise for one in self._outputs):
            with w.when(is_new_start):
                for output in self._outputs:
                    if output.adapted is not None and output.is_rise:
                        output.adapted.begun()
        for name, sensor in self._sensors.items():
            sensor.sampled(self._since, partial(self._begin_memory, name))
        w.remark("memory: first-order lags of what is believed")
        sources = dict.fromkeys(source for source, _ in self._levels)
        for source in sources:
            sensor = self._sensors[source]
            with w.when(sensor.is_believed):
                for (of, tau_s), level in self._levels.items():
                    if of == source:
                        is_gap = sensor.is_new & sensor.has_memory
                        remembered(w, level, sensor.x, sensor.since, tau_s, is_gap)
        for sensor in self._sensors.values():
            with w.when(sensor.is_believed):
                w.assign(sensor.has_memory, True)
                w.assign(sensor.is_new, False)
                w.assign(sensor.since, 0.0)
        w.remark("which model")
        self._choose()
        self._follow()
        for adapted in self._adapted:
            adapted.dropped()

    def _is_new_start(self) -> Expression | None:
        """Condition: no sensor has a start reading; None: none needs one."""
        condition: Expression | None = None
        for item in self._model.inputs:
            if item.reference == "rise":
                lacks = ~self._sensors[item.name].has_start
                condition = lacks if condition is None else condition & lacks
        return condition

    def _begin_memory(self, source: str) -> None:
        for (of, _), level in self._levels.items():
            if of == source:
                self._w.assign(level, self._sensors[source].x)

    def _choose(self) -> None:
        w, guard, model = self._w, self._model.guard, self._model
        w.assign(self._follows, decided.Mode.MODEL)
        with w.when(~self._can_be_used(model)):
            w.assign(
                self._follows, decided.Mode.RAMP_TO_ZERO if guard.last_resort == "ramp-to-zero" else decided.Mode.HOLD
            )
            if guard.on_fault == "fallback":
                for k in reversed(range(len(model.fallbacks))):
                    with w.when(self._can_be_used(model.fallbacks[k])):
                        w.assign(self._follows, decided.Mode.FALLBACK + k)
        with w.when(is_code(self._follows, decided.Mode.HOLD)):
            w.assign(self._held, self._held + self._since, most=decided.LONGEST_S)
            if guard.hold_at_most_s is not None:
                with w.when(self._held > guard.hold_at_most_s):
                    w.assign(self._follows, decided.Mode.RAMP_TO_ZERO)
        with w.otherwise():
            if guard.hold_at_most_s is None:
                w.assign(self._held, 0.0)
            else:
                with w.when(~is_code(self._follows, decided.Mode.RAMP_TO_ZERO)):
                    w.assign(self._held, 0.0)

    def _follow(self) -> None:
        w, model = self._w, self._model
        with w.when(is_code(self._follows, decided.Mode.RAMP_TO_ZERO)):
            for one in self._outputs:
                one.aimed_at_zero()
        with w.when(is_code(self._follows, decided.Mode.MODEL)):
            self._aimed(model)
        if model.guard.on_fault == "fallback":
            for k, fallback in enumerate(model.fallbacks):
                with w.when(is_code(self._follows, decided.Mode.FALLBACK + k)):
                    w.remark(f"without {', '.join(fallback.without)}")
                    self._aimed(fallback)

    def _can_be_used(self, of: Equations) -> Expression:
        condition: Expression = self._sensors[of.inputs[0].name].is_believed
        for item in of.inputs[1:]:
            condition = condition & self._sensors[item.name].is_believed
        return condition

    def _aimed(self, of: Equations) -> None:
        w = self._w
        z: dict[str, Variable] = {}
        used = {name for output in of.outputs for term in output.all_terms for name in term.powers}
        for item in (one for one in of.inputs if one.name in used):
            z[item.name] = w.variable(f"z_{len(z) + 1}")
            w.assign(z[item.name], (self._sensors[item.name].x - item.centre) / item.scale)
        for state in (one for one in of.states if one.name in used):
            z[state.name] = w.variable(f"z_{len(z) + 1}")
            level = self._levels[state.source, state.tau_s]
            w.assign(z[state.name], (level - state.centre) / state.scale)
        for one, output in zip(self._outputs, of.outputs, strict=True):
            one.aimed(output, z)
