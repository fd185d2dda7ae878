"""A tool on its spring, shaken and turning, beside a model of vibration that lacks a source, a member or a law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from proving_ground.open_model.machine import RUNS, Concealed, Courses, Machine, effect
from proving_ground.vibration.structure import STEP_S, Structure, true_swing
from selector.recording import Channel

_PERIOD_S = 5e-4
_ROWS = 2400
_SIZES = {
    "vibration.imbalance": 2e-5,
    "vibration.mode": 1.0,
    "vibration.line": 1.0,
    "vibration.hardening": 1e9,
    "hidden.impacts": 20.0,
}


def shaken(generator: np.random.Generator, *, ids: Sequence[str] = (), style: str = "varied") -> Machine:
    """A structure whose model lacks these effects; `style` of its speed: varied, or one."""
    draw = generator.uniform
    mass, hz, damping = draw(25.0, 60.0), draw(55.0, 85.0), draw(0.01, 0.02)
    stiffness = mass * (2 * np.pi * hz) ** 2
    line_hz, mode_hz, angle = draw(85.0, 120.0), draw(95.0, 150.0), draw(0.0, 2 * np.pi)
    plain_structure = Structure(
        mass_kg=mass,
        stiffness_n_per_m=stiffness,
        damping_ns_per_m=2.0 * damping * np.sqrt(stiffness * mass),
        second_kg=1e-6,
        second_n_per_m=1.0,
        second_ns_per_m=1e-3,
    )
    knocks = [generator.integers(100, _ROWS - 200, 8) for _ in RUNS]
    phases = draw(0.0, 2 * np.pi, len(RUNS))

    def read(told: Courses, sizes: Sequence[float]) -> Courses:
        rows = np.arange(len(told["F"]))
        half = np.arange(2 * round(len(rows) * _PERIOD_S / STEP_S) + 1) * 0.5 * STEP_S
        force, speed = (np.interp(half, rows * _PERIOD_S, told[name]) for name in ("F", "n"))
        turning = speed * 2 * np.pi / 60.0
        turned = np.cumsum(turning) * 0.5 * STEP_S
        number = round(1e3 * abs(float(told["F"].sum()))) % len(RUNS)
        structure = plain_structure
        for id_, size in zip(ids, sizes, strict=True):
            if id_ == "vibration.imbalance":
                force = force + size * turning**2 * np.cos(turned + angle)
            elif id_ == "vibration.line":
                force = force + size * np.sin(2 * np.pi * line_hz * half + phases[number])
            elif id_ == "vibration.mode" and size:
                held = size * (2 * np.pi * mode_hz) ** 2
                structure = structure._replace(
                    second_kg=size, second_n_per_m=held, second_ns_per_m=0.06 * np.sqrt(held * size), back=1.0
                )
            elif id_ == "vibration.hardening":
                structure = structure._replace(hardening_per_m2=size)
            elif id_ == "hidden.impacts":
                for knock in knocks[number]:
                    force = force + size * np.exp(-0.5 * ((half - knock * _PERIOD_S) / 8e-4) ** 2)
        swung = true_swing(structure, np.ascontiguousarray(force))
        return {"y": 1e6 * swung[:: round(_PERIOD_S / STEP_S), 0][: len(rows)]}

    def programmed() -> Courses:
        time = np.arange(_ROWS) * _PERIOD_S
        total = np.zeros(_ROWS)
        for tone, phase in zip(draw(20.0, 170.0, 60), draw(0.0, 2 * np.pi, 60), strict=True):
            total += np.sin(2 * np.pi * tone * time + phase)
        swell = np.clip(time / 0.05, 0.0, 1.0)
        # the model is quasi-steady, so a speed stays for a run
        speed = np.full(_ROWS, 3000.0 if style == "one" else np.round(draw(900.0, 5500.0)))
        return {"F": np.round(draw(3.0, 6.0) * swell * total / np.sqrt(30.0), 3), "n": speed}

    plain = {
        "model": {"kind": "vibration", "name": "a tool on its spring"},
        "run": {"period_s": _PERIOD_S, "duration_s": 1.0},
        "members": {"tool": {"mass_kg": mass}, "workpiece": {"mass_kg": 2000.0}},
        "joints": [
            {"between": ["tool", "ground"], "stiffness_n_per_m": stiffness, "dissipation": 4 * np.pi * damping},
            {"between": ["workpiece", "ground"], "stiffness_n_per_m": 1e10, "dissipation": 0.3},
        ],
        "sources": {"F": {"member": "tool", "lines": [{"frequency_hz": 30.0, "force_n": 1.0}]}},
        "shafts": {"n": {"rpm": 3000.0}},
    }
    inputs = (
        Channel("F", "force", "N", place="shaker at the tool"),
        Channel("n", "spindle_speed", "rpm", place="spindle"),
    )
    responses = {Channel("y", "displacement", "um", place="tool", axis="Y"): draw(0.04, 0.08)}
    first = tuple(_SIZES[id_] for id_ in ids)
    programmes = {run: programmed() for run in RUNS}
    return Machine("vibration", plain, _PERIOD_S, inputs, responses, programmes, read, first)


def _lacking(name: str, *ids: str, kind: Any = "single", style: str = "varied", **rest: Any) -> Concealed:
    effects = tuple(effect(id_, "y", accept=_ALSO.get(id_, ())) for id_ in ids)
    machine = partial(shaken, ids=ids, style=style)
    return Concealed(f"{name}/shaken", kind, rest.pop("verdicts", ("missing-physics",)), machine, effects, **rest)


_ALSO: Mapping[str, tuple[str, ...]] = {}
_OUTSIDE: Mapping[str, Any] = {"kind": "out-of-catalogue", "verdicts": ("unexplained",), "larger": 2.0}
SCENARIOS = tuple(
    one.scenario
    for one in (
        _lacking("clean", kind="clean", verdicts=("nothing-missing", "miscalibrated")),
        _lacking("wrong parameters", kind="miscalibrated", verdicts=("miscalibrated",)),
        *(_lacking(id_, id_) for id_ in _SIZES if not id_.startswith("hidden")),
        _lacking("two: imbalance and mode", "vibration.imbalance", "vibration.mode", kind="several"),
        _lacking("hidden: impacts", "hidden.impacts", **_OUTSIDE),
        _lacking("undecided: one speed", "vibration.imbalance", kind="undecidable", style="one"),
    )
)
