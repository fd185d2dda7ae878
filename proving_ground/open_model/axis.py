"""The true axis of two masses and a screw, beside a drive of one or three masses that lacks friction, play or more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from proving_ground.drive.true_axis import COMMAND_S, STEP_S, Style, TrueAxis, programme, true_motion
from proving_ground.open_model.machine import RUNS, Concealed, Courses, Machine, effect
from selector.recording import Channel

_EVERY = 2
"""Commands in a recorded row."""
_ROWS = 1500
_SAMPLE_S = 5e-4
_LEAD_M = 0.01
_SCREW = 0.1
"""Share of the screw in what turns."""
_FIELDS = {
    "drive.coulomb": ("coulomb_n", 40.0),
    "drive.asymmetric_friction": ("coulomb_by_direction", 0.2),
    "drive.stribeck": ("break_away_n", 20.0),
    "drive.viscous": ("viscous_ns_per_m", 200.0),
    "drive.offset_force": ("offset_n", 10.0),
    "drive.delay": ("current_lag_s", 5e-4),
    "drive.ripple": ("ripple_n", 5.0),
    "drive.backlash": ("play_m", 4e-6),
}
_PUSHED = "hidden.push"
_LOWEST, _HIGHEST = 0.7, 1.4


def axis(generator: np.random.Generator, *, ids: Sequence[str] = (), screw: bool = False) -> Machine:
    """An axis whose model lacks these effects; with `screw` the model has three masses, else one."""
    draw = generator.uniform
    table, motor = draw(100.0, 250.0), draw(40.0, 90.0)
    true = TrueAxis(
        motor_kg=motor,
        table_kg=table,
        stiffness_n_per_m=draw(0.8e8, 2.0e8) if screw else 2.5e9,
        screw_damping_ns_per_m=draw(1.5e4, 4e4),
        coulomb_n=0.0 if "drive.coulomb" in ids else draw(40.0, 120.0),
        presliding_m=2e-6,
        viscous_ns_per_m=0.0 if "drive.viscous" in ids else draw(200.0, 500.0),
        ripple_m=_LEAD_M / 4.0,
        ripple_phase=draw(0.0, 6.0),
        offset_n=0.0 if "drive.offset_force" in ids else draw(10.0, 30.0),
        position_gain_per_s=draw(40.0, 70.0),
        feed_forward=draw(0.85, 0.98),
        speed_gain_ns_per_m=(motor + table) * draw(150.0, 220.0),
        integral_time_s=draw(0.015, 0.03),
        current_lag_s=1e-5,
        force_per_a=draw(60.0, 120.0),
        on_scale=0.0,
    )
    pushes = [(generator.integers(200, _ROWS - 200, 8), generator.choice([-1.0, 1.0], 8)) for _ in RUNS]

    def read(told: Courses, sizes: Sequence[float]) -> Courses:
        changed, force = true, np.zeros(len(told["X_command"]) * _EVERY * round(COMMAND_S / STEP_S))
        for id_, size in zip(ids, sizes, strict=True):
            if id_ == _PUSHED:
                moments, sides = pushes[round(1e6 * told["X_command"][0]) % len(pushes)]
                time = np.arange(len(force)) * STEP_S
                for moment, side in zip(moments, sides, strict=True):
                    force += size * side * np.exp(-(((time - moment * _EVERY * COMMAND_S) / 0.02) ** 2))
            elif id_ == "drive.stribeck":
                changed = changed._replace(break_away_n=size)
            else:
                key = _FIELDS[id_][0]
                changed = changed._replace(**{key: getattr(changed, key) + size})
        grid = np.arange(len(told["X_command"]) * _EVERY)
        command = CubicSpline(grid[::_EVERY], told["X_command"])(np.minimum(grid, grid[::_EVERY][-1]))
        place, _, _, amps = true_motion(changed, command, force)
        by = _EVERY * round(COMMAND_S / STEP_S)
        return {"X_position": place[::by], "X_current": amps[::by]}

    def commanded() -> Courses:
        styles: tuple[Style, ...] = ("strokes", "other")
        course = programme(styles[int(generator.integers(0, 2))], generator, draw(0.1, 0.2), draw(1.5, 2.5))
        return {"X_command": course[: _ROWS * _EVERY : _EVERY]}

    servo = {
        "position_gain_per_s": true.position_gain_per_s,
        "velocity_gain": true.speed_gain_ns_per_m / true.force_per_a,
        "velocity_integral_gain": true.speed_gain_ns_per_m / true.force_per_a / true.integral_time_s,
        "actuator_gain": true.force_per_a,
        "velocity_feedforward": true.feed_forward,
        "sample_s": _SAMPLE_S,
        "feedback": "motor",
    }
    mechanics: dict[str, Any] = {"kind": "rigid", "mass_kg": motor + table}
    radius = _LEAD_M / (2.0 * np.pi)
    if screw:
        inertia = motor * radius**2
        mechanics = {
            "kind": "three-mass",
            "motor_inertia_kg_m2": (1.0 - _SCREW) * inertia,
            "screw_inertia_kg_m2": _SCREW * inertia,
            "table_mass_kg": table,
            "lead_m": _LEAD_M,
            "torsional_stiffness_nm_per_rad": 10.0 * true.stiffness_n_per_m * radius**2,
            "axial_stiffness_n_per_m": true.stiffness_n_per_m / 0.9,
            "axial_damping_ns_per_m": true.screw_damping_ns_per_m,
            "torsional_damping_nms_per_rad": 10.0 * true.screw_damping_ns_per_m * radius**2,
        }
        for key in ("velocity_gain", "velocity_integral_gain", "actuator_gain"):
            servo[key] = float(servo[key]) * radius  # type: ignore[arg-type]
    said = {"guide_damping_ns_per_m": true.viscous_ns_per_m}
    friction = {"coulomb_n": true.coulomb_n, "offset_n": true.offset_n}
    plain = {
        "model": {"kind": "drive", "name": "an axis"},
        "run": {"period_s": _EVERY * COMMAND_S},
        "motion": {"kind": "sine", "amplitude_mm": 10.0, "frequency_hz": 1.0, "duration_s": 1.0},
        "axes": {
            "X": {
                "mechanics": mechanics | {key: value for key, value in said.items() if value},
                "friction": {key: value for key, value in friction.items() if value},
                "servo": servo,
                "ripple_period": 2.0 * np.pi if screw else _LEAD_M,
            }
        },
        # the true control samples its loops at two rates, which no number of the file says: its gains are fitted
        "bounds": {
            f"axes.X.servo.{key}": [by * float(servo[key]) for by in (_LOWEST, _HIGHEST)]  # type: ignore[arg-type]
            for key in ("velocity_gain", "velocity_integral_gain", "position_gain_per_s")
        },
    }
    channels = (Channel("X_command", "position_command", "m", axis="X"),)
    responses = {
        Channel("X_position", "position", "m", place="motor", axis="X"): draw(2e-6, 4e-6),
        Channel("X_current", "current", "A", axis="X"): draw(0.05, 0.1),
    }
    first = tuple(60.0 if id_ == _PUSHED else _FIELDS[id_][1] for id_ in ids)
    programmes = {run: commanded() for run in RUNS}
    return Machine("drive", plain, _EVERY * COMMAND_S, channels, responses, programmes, read, first)


def _lacking(name: str, *ids: str, kind: Any = "single", screw: bool = False, **rest: Any) -> Concealed:
    effects = tuple(effect(id_, "X_position", "X_current", accept=_ALSO.get(id_, ())) for id_ in ids)
    machine = partial(axis, ids=ids, screw=screw)
    verdicts = rest.pop("verdicts", ("missing-physics",))
    return Concealed(f"{name}/axis", kind, verdicts, machine, effects, _LOOP, **rest)


_LOOP = ("drive.delay", "drive.elasticity")
"""What the true control, which samples its loops at two rates, and a screw of 2500 N/µm may be called."""
_ALSO = {"drive.delay": ("drive.elasticity",)}
_OUTSIDE: Mapping[str, Any] = {"kind": "out-of-catalogue", "verdicts": ("unexplained",), "larger": 2.0}
SCENARIOS = tuple(
    one.scenario
    for one in (
        _lacking("clean", kind="clean", verdicts=("nothing-missing", "miscalibrated")),
        _lacking("wrong parameters", kind="miscalibrated", verdicts=("miscalibrated",)),
        *(_lacking(id_, id_) for id_ in _FIELDS if id_ != "drive.backlash"),
        _lacking("drive.backlash", "drive.backlash", screw=True),
        _lacking("two: dry friction and ripple", "drive.coulomb", "drive.ripple", kind="several"),
        _lacking("two: dry friction and play", "drive.coulomb", "drive.backlash", kind="several", screw=True),
        _lacking("hidden: pushes", _PUSHED, **_OUTSIDE),
    )
)
