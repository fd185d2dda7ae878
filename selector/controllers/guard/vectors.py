"""Test vectors of what runs when something fails: every path of the guard, as calls with what they must give."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from selector.controllers.closed_values import GuardVector
from selector.controllers.guard.decided import decided_limits
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.model_file import Input, ModelFile

START_DEGC = 20.0
MINUTE_S = 60.0
MOST_FALLBACKS, MOST_TESTS = 12, 40
NO_READING = 1e30
_DECIMALS = 6
_JUST = 0.01  #: Of the width of a range: so far on either side of a limit it is probed.


@dataclass
class _Calls:
    """Calls while they are written; `of` is what is asked for of each: dt_s, readings and switches."""

    model: ModelFile
    guarded: GuardedModel
    of: list[tuple[float, dict[str, float], Mapping[str, float], float, bool, bool]] = field(default_factory=list)

    def call(
        self,
        share: float,
        dt_s: float = MINUTE_S,
        *,
        of: Mapping[str, float] | None = None,
        test_um: Mapping[str, float] | None = None,
        off_s: float = 0.0,
        is_ready: bool = True,
        is_wanted: bool = True,
    ) -> None:
        """Every x at this share of its valid range, but for the readings `of` some sensors."""
        # a sensor that never changes would count as stuck
        wiggle = 0.002 * (len(self.of) % 2)
        readings = {item.name: _reading(item, share + wiggle) for item in self.model.inputs} | dict(of or {})
        self.of.append((round(dt_s, 3), readings, test_um or {}, off_s, is_ready, is_wanted))

    def begun(self) -> "_Calls":
        """Good for as long as it takes to be believed."""
        for _ in range(8):
            self.call(0.3, max(10.0, math.ceil(self.model.guard.recover_after_s / 6.0)))
        return self

    def vector(self, name: str) -> GuardVector:
        """With what the guard gives."""
        parts = {o.position.axis: o.position for o in self.model.outputs if o.position is not None}
        places = {
            axis: tuple((part.valid_max_m, part.valid_min_m)[k // 5 % 2] for k in range(len(self.of)))
            for axis, part in parts.items()
        }
        dt_s, readings, tests, off_s, is_ready, is_wanted = zip(*self.of, strict=True)
        outputs = [output.name for output in self.model.outputs] if any(tests) else []
        vector = GuardVector(
            name=name,
            dt_s=dt_s,
            readings={item.name: tuple(row[item.name] for row in readings) for item in self.model.inputs},
            positions_m=places,
            test_um={output: tuple(row.get(output, 0.0) for row in tests) for output in outputs},
            standstill_s=off_s,
            is_ready=is_ready,
            is_wanted=is_wanted,
            expected={output.name: (0.0,) * len(dt_s) for output in self.model.outputs},
            mode=(0,) * len(dt_s),
            sensors={item.name: (0,) * len(dt_s) for item in self.model.inputs},
        )
        return vector.model_copy(update=recomputed(self.model, self.guarded, vector))


def guard_vectors(model: ModelFile) -> tuple[GuardVector, ...]:
    """One for each path: range, limits of readings, jump, standing still, hold, fallbacks, sign test, restart."""
    paths = {
        "range": _range,
        "readings": _limits_of_readings,
        "jump": _jumps,
        "stuck": _stuck,
        "hold": _hold,
        "fallback": _fallbacks,
        "sign test": _sign_test,
        "restart": _restarts,
    }
    found, guarded = [], GuardedModel(model)
    for name, path in paths.items():
        calls = _Calls(model, guarded).begun()
        path(calls, model)
        if len(calls.of) > 8:
            found.append(calls.vector(name))
    return tuple(found)


def recomputed(model: ModelFile, of: GuardedModel, vector: GuardVector) -> dict[str, object]:
    """What the guard gives in these calls: the fields `expected`, `mode` and `sensors`."""
    guarded, given = of.again(), []
    for k, dt_s in enumerate(vector.dt_s):
        if vector.standstill_s[k] > 0.0:
            guarded.restart(vector.standstill_s[k])
        readings, positions, tests = (
            {name: series[k] for name, series in of.items()}
            for of in (vector.readings, vector.positions_m, vector.test_um)
        )
        is_ready, is_wanted = vector.is_ready[k], vector.is_wanted[k]
        given.append(guarded.step(dt_s, readings, positions, is_ready=is_ready, is_wanted=is_wanted, test_um=tests))
    sensors = zip(*([int(code) for code in one.sensors] for one in given), strict=True)
    return {
        "expected": {o.name: tuple(float(one.correction_um[o.name]) for one in given) for o in model.outputs},
        "mode": tuple(one.mode for one in given),
        "sensors": dict(zip((item.name for item in model.inputs), sensors, strict=True)),
    }


def _start(item: Input) -> float:
    """A start reading inside the limits of readings."""
    low, high = item.reading_limits
    return START_DEGC if low <= START_DEGC <= high else low if math.isfinite(low) else high


def _reading(item: Input, share: float) -> float:
    x = item.valid_min + share * (item.valid_max - item.valid_min)
    return round(x + _start(item) if item.reference == "rise" else x, _DECIMALS)


def _range(calls: _Calls, model: ModelFile) -> None:
    for share in (0.5, 0.7, 0.9, 1.0 - _JUST, 1.0 + _JUST, 1.2, 0.9, 0.6, 0.3, 0.1, _JUST, -_JUST, -0.2, 0.5):
        calls.call(share)
        calls.call(share)


def _limits_of_readings(calls: _Calls, model: ModelFile) -> None:
    for end in ("reading_min", "reading_max"):
        for away in (-_JUST, _JUST):
            of = {}
            for item in model.inputs:
                limit, width = getattr(item, end), item.valid_max - item.valid_min
                if limit is not None:
                    of[item.name] = round(limit + away * max(width, 1.0), _DECIMALS)
            if of:
                calls.call(0.3, of=of)
    for code in (*model.guard.break_codes, NO_READING):
        calls.call(0.3, of=dict.fromkeys((item.name for item in model.inputs), code))


def _jumps(calls: _Calls, model: ModelFile) -> None:
    limited = [item for item in model.inputs if item.rate_limit_per_min is not None]
    for share in (0.9, 1.1) if limited else ():
        for _ in range(2):
            calls.call(0.3)
        of = {item.name: round(_reading(item, 0.3) + share * (item.rate_limit_per_min or 0.0), 6) for item in limited}
        calls.call(0.3, of=of)
        calls.call(0.3, 1.0)


def _stuck(calls: _Calls, model: ModelFile) -> None:
    after_s = model.guard.stuck_after_s
    for share in () if after_s is None else (0.01, 0.49, 0.49, 0.49):
        calls.call(0.3, share * (after_s or 0.0), of={item.name: _reading(item, 0.4) for item in model.inputs})


def _hold(calls: _Calls, model: ModelFile) -> None:
    bad, most_s = dict.fromkeys((item.name for item in model.inputs), NO_READING), model.guard.hold_at_most_s
    for _ in range(4):
        calls.call(0.6, 10.0)
    for share in (0.01, 0.49, 0.49, 0.49) if most_s is not None else (1.0,) * 4:
        calls.call(0.6, share * (most_s or MINUTE_S), of=bad)
    for _ in range(2):
        calls.call(0.6, 10.0, of=bad)
    calls.begun()


def _fallbacks(calls: _Calls, model: ModelFile) -> None:
    for fallback in model.fallbacks[:MOST_FALLBACKS]:
        for _ in range(3):
            calls.call(0.5, of=dict.fromkeys(fallback.without, NO_READING))
        calls.begun()


def _sign_test(calls: _Calls, model: ModelFile) -> None:
    """Beyond the clamp, so that slew and clamp are seen."""
    limits, _ = decided_limits(model)
    for name, of in limits.items():
        steps = of.clamp_um / max(of.own_slew_um_per_s, 1e-300) / 10.0
        n = math.ceil(min(steps, MOST_TESTS // len(limits))) + 2
        for _ in range(n):
            calls.call(0.3, 10.0, test_um={name: round(min(2.0 * of.clamp_um, 1e300), _DECIMALS)})
        for _ in range(2):
            calls.call(0.3, 10.0)


def _restarts(calls: _Calls, model: ModelFile) -> None:
    longest_s = model.guard.new_start_after_s
    for off_s in (600.0,) if longest_s is None else (600.0, 0.9 * longest_s, longest_s + 1.0):
        for _ in range(3):
            calls.call(0.6)
        calls.call(0.7, 10.0, off_s=off_s)
        calls.begun()
    for is_ready, is_wanted in ((True, False), (True, False), (False, True), (True, True), (True, True)):
        calls.call(0.6, 10.0, is_ready=is_ready, is_wanted=is_wanted)
