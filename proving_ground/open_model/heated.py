"""Spindle, headstock and column cut into volumes, beside a network of three nodes that lacks heat, films or both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from proving_ground.open_model.machine import RUNS, Concealed, Courses, Machine, effect
from proving_ground.thermal.machine import Body, Heat, temperatures
from selector.recording import Channel
from selector.types import Vector

PERIOD_S = 60.0
_STRIDE = 20
_ROWS = 420
_PARTS = {"spindle": 3, "headstock": 4, "column": 6}
_INSIDE = 15.0
"""How much better heat goes through a body than from one to the next."""
_TOP_RPM = 3000.0
_COOLANT_DEGC = 18.0
_CHANNELS = (
    Channel("n", "spindle_speed", "rpm", place="spindle"),
    Channel("hall", "ambient", "degC", place="hall"),
    Channel("coolant_on", "state", "1", place="coolant pump, 1 = on"),
)
_SIZES = {
    "thermal.second_source": 60.0,
    "thermal.coolant": 6.0,
    "thermal.ambient": 12.0,
    "thermal.speed_heating": 100.0,
    "thermal.convection": 10.0,
    "hidden.draught": 300.0,
}


def heated(generator: np.random.Generator, *, ids: Sequence[str] = (), style: str = "varied") -> Machine:
    """A machine whose model lacks these effects; `style` varied, or one: one speed, coolant whenever it turns."""
    draw = generator.uniform
    capacity = {"spindle": draw(1.5e4, 2.5e4), "headstock": draw(6e4, 1e5), "column": draw(1.5e5, 2.5e5)}
    joint = {("spindle", "headstock"): draw(15.0, 25.0), ("headstock", "column"): draw(12.0, 20.0)}
    film = {"headstock": draw(6.0, 10.0), "column": draw(12.0, 20.0)}
    growth = {"spindle": draw(1.5, 2.5), "headstock": draw(1.0, 2.0), "column": draw(2.0, 4.0)}
    speed_w = draw(150.0, 250.0)
    place = {name: np.arange(count) + sum(list(_PARTS.values())[:k]) for k, (name, count) in enumerate(_PARTS.items())}
    total = sum(_PARTS.values())

    def over(name: str) -> Vector:
        weights = np.zeros(total)
        weights[place[name]] = 1.0 / len(place[name])
        return weights

    links, conductance = [], []
    inside = {name: _INSIDE * max(joint.values()) for name in _PARTS}
    for name in _PARTS:
        links += [(int(a), int(a) + 1) for a in place[name][:-1]]
        conductance += [inside[name]] * (len(place[name]) - 1)
    for (a, b), through in joint.items():
        links.append((int(place[a][-1]), int(place[b][0])))
        conductance.append(through)
    lacks_film = "thermal.ambient" in ids
    body = Body(
        np.sum([capacity[name] * over(name) for name in _PARTS], axis=0),
        np.array(links),
        np.array(conductance),
        {
            "hall": film["headstock"] * over("headstock") + (0.0 if lacks_film else film["column"]) * over("column"),
            "stirred": over("headstock"),
            "jets": over("headstock"),
            "wall": over("column"),
        },
        {"bearings": over("spindle"), "motor": over("headstock"), "pump": over("column"), "draught": over("column")},
    )
    gusts = [np.sort(generator.integers(0, _ROWS, 14)) for _ in RUNS]

    def read(told: Courses, sizes: Sequence[float]) -> Courses:
        size = dict(zip(ids, sizes, strict=True))
        speed = np.repeat(told["n"], _STRIDE) / _TOP_RPM
        hall, wet = np.repeat(told["hall"], _STRIDE), np.repeat(told["coolant_on"], _STRIDE)
        number = round(1e3 * float(np.sum(told["hall"]))) % len(gusts)
        blown = np.cumsum(np.isin(np.arange(len(told["n"])), gusts[number])) % 2
        nothing = np.zeros_like(speed)
        heat = Heat(
            {
                "bearings": speed_w * speed**1.5,
                "motor": size.get("thermal.speed_heating", 0.0) * speed**2 + nothing,
                "pump": size.get("thermal.second_source", 0.0) + nothing,
                "draught": size.get("hidden.draught", 0.0)
                * (np.repeat(blown, _STRIDE) - 0.5 * ("hidden.draught" in ids)),
            },
            {"hall": hall, "stirred": hall, "jets": np.full_like(hall, _COOLANT_DEGC), "wall": hall},
            {
                "hall": np.ones_like(hall),
                "stirred": size.get("thermal.convection", 0.0) * speed,
                "jets": size.get("thermal.coolant", 0.0) * wet,
                "wall": np.full_like(hall, size.get("thermal.ambient", 0.0)),
            },
            {"hall": 0.02},
        )
        degc = temperatures(body, heat, float(hall[0]), PERIOD_S / _STRIDE, _STRIDE)
        moved = sum(growth[name] * (degc[:, place[name]].mean(axis=1) - degc[0, 0]) for name in _PARTS)
        return {"T1": degc[:, place["headstock"][1]], "T2": degc[:, place["column"][2]], "Z": np.asarray(moved)}

    films: dict[str, Any] = {"hall": {"area_m2": {"headstock": 1.0}, "still_w_per_m2_k": film["headstock"]}}
    if not lacks_film:
        films["column"] = {"area_m2": {"column": 2.0}, "still_w_per_m2_k": 0.5 * film["column"]}
    plain = {
        "model": {"kind": "network", "name": "headstock on a column"},
        "run": {"duration_min": _ROWS, "period_s": PERIOD_S, "step_s": PERIOD_S},
        "conditions": {"spindle_speed_rpm": 0.0, "ambient_degc": 20.0, "coolant_degc": _COOLANT_DEGC},
        "nodes": {
            name: {"heat_capacity_j_per_k": capacity[name], "expansion_um_per_k": {"Z": growth[name]}}
            for name in _PARTS
        },
        "links": [{"between": list(pair), "conductance_w_per_k": through} for pair, through in joint.items()],
        "films": films,
        "sources": {
            "bearings": {
                "shares": {"spindle": 1.0}, "speed_w": speed_w, "reference_rpm": _TOP_RPM, "exponent": 1.5,
            },
        },
        "sensors": [{"name": "T1", "at": "headstock"}, {"name": "T2", "at": "column"}],
        "gauges": [{"name": "Z", "axis": "Z"}],
    }  # fmt: skip
    responses = {
        Channel("T1", "temperature", "degC", place="headstock"): 0.02,
        Channel("T2", "temperature", "degC", place="column"): 0.02,
        Channel("Z", "displacement", "um", axis="Z"): 0.3,
    }
    programmes = {run: _programme(generator, style) for run in RUNS}
    first = tuple(_SIZES[id_] for id_ in ids)
    return Machine("thermal", plain, PERIOD_S, _CHANNELS, responses, programmes, read, first)


def _programme(generator: np.random.Generator, style: str) -> Courses:
    rows = np.arange(_ROWS)
    edges = np.sort(generator.integers(0, _ROWS, 5))
    if style == "one":
        turning = (np.searchsorted(edges, rows) % 2 == 0).astype(float)
        speed, wet = _TOP_RPM * 0.8 * turning, turning
    else:
        levels = _TOP_RPM * generator.choice([0.0, 0.3, 0.5, 0.7, 1.0, 1.0], 6)
        speed = levels[np.searchsorted(edges, rows)]
        wet = (np.searchsorted(np.sort(generator.integers(0, _ROWS, 6)), rows) % 2).astype(float)
    swing = generator.uniform(1.0, 2.5) * np.sin(
        2 * np.pi * (rows / generator.uniform(300.0, 700.0) + generator.random())
    )
    return {"n": speed, "hall": 20.0 + np.round(swing + generator.normal(0.0, 0.5), 2), "coolant_on": wet}


def _lacking(name: str, *effects: Any, kind: Any = "single", style: str = "varied", **rest: Any) -> Concealed:
    ids = tuple(one.id for one in effects)
    machine = partial(heated, ids=ids, style=style)
    return Concealed(f"{name}/heated", kind, rest.pop("verdicts", ("missing-physics",)), machine, effects, **rest)


_ALL = ("T1", "T2", "Z")
_PUMP = effect("thermal.second_source", *_ALL, place="column")
_JETS = effect("thermal.coolant", *_ALL, place="headstock")
_MOTOR = effect("thermal.speed_heating", *_ALL, accept=("thermal.second_source",), place="headstock")
_OUTSIDE: Mapping[str, Any] = {"kind": "out-of-catalogue", "verdicts": ("unexplained",), "larger": 2.0}
SCENARIOS = tuple(
    one.scenario
    for one in (
        _lacking("clean", kind="clean", verdicts=("nothing-missing", "miscalibrated")),
        _lacking("wrong parameters", kind="miscalibrated", verdicts=("miscalibrated",)),
        _lacking("thermal.second_source", _PUMP),
        _lacking("thermal.coolant", _JETS),
        _lacking("thermal.ambient", effect("thermal.ambient", *_ALL, place="column")),
        _lacking("thermal.speed_heating", _MOTOR),
        _lacking("thermal.convection", effect("thermal.convection", *_ALL, place="headstock")),
        _lacking("two: pump and coolant", _PUMP, _JETS, kind="several"),
        _lacking("two: motor and pump", _MOTOR, _PUMP, kind="several"),
        _lacking("hidden: a door that opens", effect("hidden.draught", *_ALL), **_OUTSIDE),
        _lacking("undecided: one speed, and coolant with it", _JETS, kind="undecidable", style="one"),
    )
)
