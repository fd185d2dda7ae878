"""Cases whose cause is in no catalogue and in no channel: draughts, wandering thermostats, slips, loads, neighbours."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proving_ground.concealment import unrelated
from proving_ground.thermal.duty import BOTH, STEP_S, Duty, Maker, Omission, gated, held, wandering, with_bath
from proving_ground.thermal.machine import Heat, Machine
from proving_ground.thermal.scene import STRIDE, of, thermal_case, warmed
from proving_ground.world import Made, Plan, scenarios_of
from selector.types import Matrix, Vector

Draw = Callable[[np.random.Generator, int], Vector]
"""Generator, number of steps → a course that nobody records."""


_CANDIDATES = 6


def _drawn(draw: Draw, generator: np.random.Generator, duties: Sequence[Duty]) -> dict[str, Vector]:
    """A course for every run: of some candidates the one that least resembles what the spindle's heat does, or time."""
    result = {}
    for one in duties:
        candidates = [draw(generator, len(one.time_s)) for _ in range(_CANDIDATES)]
        known = np.column_stack([warmed(one["speed"], 1500.0), warmed(one["speed"], 6000.0), one.time_s])
        result[one.run] = min(candidates, key=lambda course: _resemblance(warmed(course, 300.0), known))
    return result


def _resemblance(course: Vector, known: NDArray[np.float64]) -> float:
    return float(np.max(np.abs(np.corrcoef(np.column_stack([course, known])[::20], rowvar=False)[0, 1:])))


def fixture_of(name: str, draw: Draw, tau_s: float, axes: Mapping[str, float] = BOTH, *, brief: bool = False) -> Maker:
    """A fixture that no sensor feels, warmed by a course that nobody records; the simulation has its mean.

    Two masses, one behind the other, with time constants around `tau_s` and a third of it.
    """

    def make(generator: np.random.Generator, duties: Sequence[Duty]) -> Omission:
        slow, quick = tau_s * generator.uniform(0.7, 1.4), tau_s * generator.uniform(0.2, 0.5)
        drawn = _drawn(draw, generator, duties)
        mean = np.mean([course.mean() for course in drawn.values()])
        courses = {run: warmed(warmed(course - mean, slow), quick) for run, course in drawn.items()}
        return _shift(name, courses, place="fixture", axes=axes, brief=brief)

    return make


def air_of(name: str, bath: str, draw: Draw) -> Maker:
    """Air along a bath's surfaces while a course that nobody records is not 0: so much warmer than the hall."""

    def make(generator: np.random.Generator, duties: Sequence[Duty]) -> Omission:
        courses = _drawn(draw, generator, duties)

        def heated(_tool: Machine, heat: Heat, one: Duty, size: float) -> Heat:
            excess = courses[one.run]
            return with_bath(heat, bath, one["hall"] + excess, size * (excess != 0.0))

        return Omission(f"hidden.{name}", place=bath, heated=heated, brief=True)

    return make


def shift_of(name: str, draw: Draw, axes: Mapping[str, float], *, brief: bool = False) -> Maker:
    """A displacement [µm] by a course that nobody records."""
    return lambda generator, duties: _shift(name, _drawn(draw, generator, duties), axes=axes, brief=brief)


def _shift(name: str, courses: Mapping[str, Vector], **omission: Any) -> Omission:
    def shifted(_tool: Machine, rises: Matrix, one: Duty) -> dict[str, Vector]:
        return dict.fromkeys(BOTH, courses[one.run][::STRIDE][: len(rises)])

    return Omission(f"hidden.{name}", shifted=shifted, **omission)


def _minutes(low: float, high: float) -> tuple[float, float]:
    return 60.0 * low / STEP_S, 60.0 * high / STEP_S


def _by_turns(
    generator: np.random.Generator, n: int, off_min: tuple[float, float], on_min: tuple[float, float]
) -> Vector:
    return gated(generator, n, _minutes(*off_min), _minutes(*on_min))


def _door(generator: np.random.Generator, n: int) -> Vector:
    """Cold while the door is open, then the warm air of its curtain for as long."""
    result = np.zeros(n)
    at = int(generator.uniform(*_minutes(15.0, 80.0)))
    while at < n:
        span = int(generator.uniform(*_minutes(4.0, 25.0)))
        result[at : at + span], result[at + span : at + 2 * span] = -7.0, 7.0
        at += 2 * span + int(generator.uniform(*_minutes(25.0, 100.0)))
    return result


def _thermostat(generator: np.random.Generator, n: int) -> Vector:
    """Heating and cooling by turns with a period that wanders between 10 and 35 minutes."""
    period_s = 60.0 * (21.0 + 6.0 * np.tanh(wandering(generator, n, 1500.0)) * 2.0)
    phase = np.cumsum(STEP_S / period_s) + generator.uniform()
    return np.asarray(60.0 * np.sign(np.sin(2.0 * np.pi * phase)))


def _slips(generator: np.random.Generator, n: int) -> Vector:
    """Steps at random times, back more often than onwards."""
    result = np.zeros(n)
    for at in np.sort(generator.integers(n // 20, n, size=int(generator.integers(7, 12)))):
        back = -np.sign(result[at]) if generator.random() < 0.8 else 1.0
        result[at:] += (back or generator.choice([-1.0, 1.0])) * generator.uniform(0.5, 1.5)
    return result


def _chips(generator: np.random.Generator, n: int) -> Vector:
    """Hot chips heap up at a drawn rate and are taken away at once, at any time."""
    result = np.zeros(n)
    at = 0
    while at < n:
        span = int(generator.uniform(*_minutes(25.0, 100.0)))
        part = result[at : at + span]
        part[:] = 100.0 * generator.uniform(0.2, 1.0) * np.arange(len(part)) / span
        at += span
    return result


def _lorries(generator: np.random.Generator, n: int) -> Vector:
    on = _by_turns(generator, n, (15.0, 80.0), (3.0, 9.0))
    return np.asarray(on * held(generator, n, 5.0, 20.0, np.array([-1.0, 0.7, 1.3, -0.5])))


def _sun(generator: np.random.Generator, n: int) -> Vector:
    """Sun through a window on the column, clouds before it."""
    time = STEP_S * np.arange(n)
    middle, width = generator.uniform(0.2, 0.8) * n * STEP_S, generator.uniform(3000.0, 5500.0)
    clouds = np.clip(0.5 + wandering(generator, n, 300.0), 0.0, 1.0)
    return np.asarray(150.0 * np.exp(-0.5 * ((time - middle) / width) ** 2) * clouds)


_MORE = (of("n"), of("f"), of("T10"), of("T11"))
_SOURCE = ("thermal.second_source",)
_STYLES = ("steps", "intermittent", "steps")


def _case(name: str, note: str, omission: Maker, styles: tuple[str, ...] = _STYLES, **rest: Any) -> tuple[Plan, Made]:
    told: dict[str, Any] = {"kind": "out-of-catalogue", "hidden": (unrelated,), **rest}
    return thermal_case(f"hidden.thermal/{name}", note, (omission,), styles, **told)


_CASES = (
    _case(
        "door",
        "A door opens at random times: draught at the column's foot, then warm air.",
        air_of("door", "draught", _door),
        tolerated=_SOURCE,
    ),
    _case(
        "thermostat",
        "The cooler of a rotary table switches with a wandering period; nothing recorded follows it.",
        fixture_of("thermostat", _thermostat, 500.0, {"Z": 0.5, "Y": 1.0}),
        tolerated=_SOURCE,
    ),
    _case(
        "crosstalk",
        "The square of a signal that nobody records leaks into both probes.",
        shift_of("crosstalk", lambda draw, n: wandering(draw, n, 500.0) ** 2, {"Z": 1.0, "Y": -0.6}),
    ),
    _case(
        "slips",
        "A loose foot slips suddenly, in both axes and both directions.",
        shift_of("slips", _slips, {"Z": 0.7, "Y": 1.0}),
        tolerated=("data.step",),
    ),
    _case(
        "neighbour",
        "A second machine warms the table whenever it works.",
        fixture_of("neighbour", lambda draw, n: 80.0 * _by_turns(draw, n, (10.0, 60.0), (10.0, 50.0)), 700.0),
        gauges=_MORE,
        tolerated=_SOURCE,
    ),
    _case(
        "chips",
        "Hot chips heap up and on the fixture and are taken away at random times.",
        fixture_of("chips", _chips, 500.0, {"Z": 1.0, "Y": 0.4}),
        gauges=_MORE,
        tolerated=_SOURCE,
    ),
    _case(
        "unlogged",
        "A coolant that nobody logs runs over the fixture for an hour or two.",
        fixture_of(
            "unlogged", lambda draw, n: -60.0 * _by_turns(draw, n, (40.0, 120.0), (30.0, 120.0)), 150.0, brief=True
        ),
    ),
    _case(
        "loads",
        "Workpieces of unknown weight stand on the table for a while and tilt the machine.",
        shift_of("loads", lambda draw, n: held(draw, n, 4.0, 20.0, draw.uniform(-1.0, 1.0, 7)), {"Z": 0.5, "Y": 1.0}),
        styles=("intermittent", "steps", "warm-up"),
    ),
    _case(
        "blasts",
        "Compressed air cools the workpiece for some minutes, at random.",
        fixture_of("blasts", lambda draw, n: -60.0 * _by_turns(draw, n, (12.0, 70.0), (2.0, 7.0)), 150.0, {"Z": 1.0}),
        tolerated=_SOURCE,
    ),
    _case(
        "lorries",
        "Lorries beside the hall tilt its floor for some minutes.",
        shift_of("lorries", _lorries, {"Z": 0.4, "Y": 1.0}, brief=True),
    ),
    _case(
        "sun",
        "Sun shines on the table through a window, with clouds.",
        fixture_of("sun", _sun, 600.0, {"Z": 0.3, "Y": 1.0}),
        ("intermittent", "steps", "steps"),
        gauges=_MORE,
        tolerated=_SOURCE,
    ),
)
SCENARIOS = scenarios_of(_CASES, "hidden.thermal/door")
