"""Batches of ground parts whose simulation lacks the gauge's lag, wear, or what a groove does to the reading.

A gauge decides when the grinder stops: every part is ground in time, step by step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numba import njit

from proving_ground.case import TrueEffect
from proving_ground.concealment import Noise, coloured
from proving_ground.world import Made, Plan, Runs, World, scenarios_of
from selector.recording import Channel
from selector.types import Vector

STEP_S = 4e-3
"""Step of the grinding of a part [s]."""


GROOVE_SHARE = 0.3
"""Share of the time in which the finger falls in."""


def ground_sizes(allowance_um: Vector, feed_um_per_s: Vector, lag_s: float, groove_um: Vector) -> Vector:
    """Size of every part when the gauge let go [µm over the target], shape (n_parts,).

    The wheel comes in with four times the fine feed until the reading is 25 µm over the target, then with the fine
    feed `feed_um_per_s`; machine and part give way with a time constant of 0.3 s. The gauge reads through two lags in
    a row that delay it by `lag_s` altogether. Grooves pass 23 times a second: in `GROOVE_SHARE` of the time the finger
    falls in, by up to `groove_um`, and comes out again slowly, so that the reading is too low.
    """
    result: Vector = _ground(allowance_um, feed_um_per_s, lag_s, groove_um)
    return result


def read_course(allowance_um: float, feed_um_per_s: float, lag_s: float, n_rows: int, period_s: float) -> Vector:
    """What the gauge reads in time while a part is ground and 1 s after [µm over the target]; then it is held."""
    result: Vector = _course(allowance_um, feed_um_per_s, lag_s, n_rows, round(period_s / STEP_S))
    return result


@njit(cache=True, nogil=True)
def _ground(allowance, feed, lag_s, depth):  # type: ignore[no-untyped-def]
    result = np.empty(len(allowance))
    h = STEP_S
    pole = 1.0 - np.exp(-h / (0.5 * lag_s)) if lag_s > 0.0 else 1.0
    give = 1.0 - np.exp(-h / 0.3)
    for part in range(len(allowance)):
        if lag_s <= 0.0 and depth[part] <= 0.0:
            # a reading without fault stops at the target
            result[part] = 0.0
            continue
        size = allowance[part]
        rate = 0.0
        first = second = size
        finger = 0.0
        last_reading = size
        last_size = size
        k = 0
        while True:
            wanted = 4.0 * feed[part] if last_reading > 25.0 else feed[part]
            rate += give * (wanted - rate)
            last_size = size
            size -= h * rate
            turn = (k * h * 23.0 + 0.37 * part) % 1.0
            drop = depth[part] if turn < GROOVE_SHARE else 0.0
            finger += 0.85 * (drop - finger) if drop > finger else 0.2 * (drop - finger)
            seen = size - finger
            first += pole * (seen - first)
            second += pole * (first - second)
            reading = second
            k += 1
            if reading <= 0.0 or k > 10000:
                # where between the two steps the reading crossed the target
                over = last_reading - reading
                inside = last_reading / over if over > 0.0 else 1.0
                result[part] = last_size + min(max(inside, 0.0), 1.0) * (size - last_size)
                break
            last_reading = reading
    return result


@njit(cache=True, nogil=True)
def _course(allowance, feed, lag_s, n_rows, every):  # type: ignore[no-untyped-def]
    result = np.empty(n_rows)
    h = STEP_S
    pole = 1.0 - np.exp(-h / (0.5 * lag_s)) if lag_s > 0.0 else 1.0
    give = 1.0 - np.exp(-h / 0.3)
    size = first = second = allowance
    rate = 0.0
    for k in range(n_rows * every):
        if k % every == 0:
            result[k // every] = second
        wanted = 0.0 if size <= 0.0 else (4.0 * feed if size > 25.0 else feed)
        rate += give * (wanted - rate)
        size -= h * rate
        first += pole * (size - first)
        second += pole * (first - second)
    return result


Change = Callable[["Batches", float], list[Vector]]
"""(batches, size of the effect) → sizes of the parts of every run [µm]."""

RUNS = ("r1", "r2", "r3")
PARTS = 800
CYCLE_S = 40.0
CHANNELS = (
    Channel("feed", "feed_rate", "mm/min", place="wheel head, at the stop"),
    Channel("T", "temperature", "degC", place="coolant"),
    Channel("dressed", "state", "1", place="wheel, 1 = dressed before this part"),
    Channel("grooved", "state", "1", place="part with keyways, 1 = yes"),
    Channel("d", "size", "um", place="finished diameter over target"),
)


@dataclass(frozen=True, eq=False)
class Batches:
    """What is ground: per run the fine feed [µm/s], allowance [µm], coolant [°C], dressings, grooved parts."""

    feeds: tuple[Vector, ...]
    allowances: tuple[Vector, ...]
    temperatures: tuple[Vector, ...]
    dressed: tuple[Vector, ...]
    grooved: tuple[Vector, ...]
    growth_um_per_k: float

    def sizes(self, lag_s: float = 0.0, groove_um: float = 0.0) -> list[Vector]:
        """Sizes of the parts of every run [µm]: what the gauge lets through, and growth with the coolant."""
        return [
            ground_sizes(self.allowances[run], self.feeds[run], lag_s, groove_um * self.grooved[run]) + self.growth(run)
            for run in range(len(RUNS))
        ]

    def growth(self, run: int) -> Vector:
        """Growth of the parts with the coolant [µm]."""
        return np.asarray(self.growth_um_per_k * (self.temperatures[run] - 20.0))


def batches(
    generator: np.random.Generator, *, feeds: str = "varied", grooves: float = 0.4, dressing: int = 60
) -> Batches:
    """Three runs of parts; `feeds` varied or even (in the runs that are fitted); every so many parts a dressing."""
    fine = generator.uniform(4.0, 9.0)
    per_run: dict[str, list[Vector]] = {
        name: [] for name in ("feeds", "allowances", "temperatures", "dressed", "grooved")
    }
    for run in range(len(RUNS)):
        spread = 0.02 if feeds == "even" and run < 2 else 0.3
        levels = fine * (1.0 + spread * generator.uniform(-1.0, 1.0, PARTS // 20))
        per_run["feeds"].append(np.round(np.repeat(levels, 20) * 0.06, 4) / 0.06)
        per_run["allowances"].append(generator.uniform(60.0, 110.0, PARTS))
        part = np.arange(PARTS)
        wave = np.sin(2 * np.pi * (part / generator.uniform(300.0, 700.0) + generator.random()))
        per_run["temperatures"].append(np.round(21.5 + generator.uniform(0.5, 1.2) * wave + 0.4 * part / PARTS, 3))
        gaps = generator.integers(dressing // 2, dressing + dressing // 2, 60)
        dressed = np.zeros(PARTS)
        dressed[[k for k in np.r_[0, np.cumsum(gaps)] if k < PARTS]] = 1.0
        per_run["dressed"].append(dressed)
        kinds = (generator.random(PARTS // 16) < grooves).astype(float)
        if grooves > 0.0 and not kinds.any():
            kinds[len(kinds) // 2] = 1.0
        per_run["grooved"].append(np.repeat(kinds, 16))
    growth = float(generator.uniform(0.6, 1.5))
    return Batches(**{name: tuple(parts) for name, parts in per_run.items()}, growth_um_per_k=growth)


def lagging(made: Batches, size: float) -> list[Vector]:
    """The filter of the gauge delays the stop by size × 10 ms."""
    return made.sizes(lag_s=0.01 * size)


def worn(made: Batches, size: float) -> list[Vector]:
    """The wheel wears after every dressing: fast at first, then evenly."""
    sizes = made.sizes()
    for run in range(len(RUNS)):
        since = np.zeros(PARTS)
        for k in range(1, PARTS):
            since[k] = 0.0 if made.dressed[run][k] else since[k - 1] + made.allowances[run][k] / 85.0
        sizes[run] = sizes[run] + size * (0.4 * (1.0 - np.exp(-since / 8.0)) + 0.6 * since / 60.0)
    return sizes


def worn_probe(made: Batches, size: float) -> list[Vector]:
    """The probe wears from the first part to the last of all runs, the less the more it has."""
    sizes = made.sizes()
    for run in range(len(RUNS)):
        count = (run * PARTS + np.arange(PARTS)) / (len(RUNS) * PARTS)
        sizes[run] = sizes[run] + size * (1.0 - (1.0 - count) ** 1.4)
    return sizes


def falling_in(made: Batches, size: float) -> list[Vector]:
    """Keyways let the finger fall in, so that the gauge stops early."""
    return made.sizes(groove_um=0.5 * size)


def as_worn_as_lagging(made: Batches, size: float) -> list[Vector]:
    """Wear as strong as the lag of the same size."""
    base, late, less = made.sizes(), lagging(made, 10.0), worn(made, 1.0)
    spreads = [float(np.std(np.concatenate(one[:2]) - np.concatenate(base[:2]))) for one in (late, less)]
    return worn(made, 0.1 * size * spreads[0] / spreads[1])


def lagging_and_worn(made: Batches, size: float) -> list[Vector]:
    """Both, the wear as strong as the lag."""
    three = zip(lagging(made, size), as_worn_as_lagging(made, size), made.sizes(), strict=True)
    return [late + less - base for late, less, base in three]


def _shifted(changes: Sequence[Vector]) -> Change:
    return lambda made, size: [part + size * change for part, change in zip(made.sizes(), changes, strict=True)]


def _touched(generator: np.random.Generator) -> Change:
    """Somebody turns the zero of the gauge at random and back again; nobody wrote it down."""
    changes = []
    for _ in RUNS:
        moments = np.sort(generator.uniform(20.0, PARTS - 20.0, int(generator.integers(12, 20))))
        changes.append(np.r_[0.0, generator.standard_normal(len(moments))][np.searchsorted(moments, np.arange(PARTS))])
    return _shifted(changes)


def _cycling(generator: np.random.Generator) -> Change:
    """The cooler of the gauge's amplifier switches with a period that wanders."""
    changes = []
    for _ in RUNS:
        turns = np.cumsum(generator.uniform(12.0, 40.0, 60)) - 20.0
        heights = np.where(np.arange(60) % 2 == 0, -1.0, 1.0) * generator.uniform(0.7, 1.3, 60)
        changes.append(np.interp(np.arange(PARTS), turns, heights))
    return _shifted(changes)


def _case(
    id: str,  # noqa: A002 - the word of the contract
    change: Change | None = None,
    *,
    accept: tuple[str, ...] = (),
    colour: str = "white",
    place: str | None = "gauge",
    first: float = 1.0,
    drawing: Callable[[np.random.Generator], Change] | None = None,
    beside: tuple[str, str] | None = None,
    lacking: tuple[Change, ...] = (),
    **settings: Any,
) -> Made:
    def world(generator: np.random.Generator) -> World:
        made = batches(generator, **settings)
        time = CYCLE_S * np.arange(PARTS, dtype=np.float64)

        def recorded(changed: Change | None, size: float) -> Runs:
            return {
                "feed": [0.06 * part for part in made.feeds],
                "T": made.temperatures,
                "dressed": made.dressed,
                "grooved": made.grooved,
                "d": changed(made, size) if changed is not None and size else made.sizes(),
            }

        effects: tuple[TrueEffect, ...] = (TrueEffect(id, accept or (id,), ("d",), place),) if id else ()
        if beside is not None:
            effects += (TrueEffect(beside[0], (beside[0],), ("d",), beside[1]),)
        whole = World(
            CHANNELS,
            ("d",),
            dict.fromkeys(RUNS, time),
            dict.fromkeys(RUNS, time),
            partial(recorded, drawing(generator) if drawing is not None else change),
            lambda size: {"d": [made.growth(run) for run in range(len(RUNS))]},
            {"d": coloured(colour, float(generator.uniform(0.25, 0.5)), 0.02, 0.4)},
            lambda size: effects,
            first,
        )
        return replace(whole, lacking=tuple(replace(whole, recorded=partial(recorded, other)) for other in lacking))

    return world


def _reading(generator: np.random.Generator) -> World:
    """The gauge's reading in time, part after part; the simulation reads without the filter."""
    period, rows, parts = 0.02, 500, 5
    fine = generator.uniform(4.0, 9.0)
    feeds = [fine * generator.uniform(0.6, 1.4, parts) for _ in RUNS]
    allowances = [generator.uniform(60.0, 110.0, parts) for _ in RUNS]
    time = period * np.arange(rows * parts, dtype=np.float64)

    def read(lag_s: float) -> list[Vector]:
        return [
            np.concatenate(
                [read_course(a, f, lag_s, rows, period) for a, f in zip(allowances[k], feeds[k], strict=True)]
            )
            for k in range(len(RUNS))
        ]

    channels = (
        Channel("feed", "feed_rate", "mm/min", place="wheel head"),
        Channel("d", "size", "um", place="reading of the gauge over target"),
    )
    effect = TrueEffect("gauging.lag", ("gauging.lag", "data.clock"), ("d",), "gauge")

    return World(
        channels,
        ("d",),
        dict.fromkeys(RUNS, time),
        dict.fromkeys(RUNS, time),
        lambda size: {"feed": [np.repeat(0.06 * part, rows) for part in feeds], "d": read(0.01 * size)},
        lambda size: {"d": read(0.0)},
        {"d": Noise(0.15, step=0.01)},
        lambda size: (effect,),
        5.0,
    )


_plan = partial(Plan, family="gauging", kind="single")
_absorbed = partial(_plan, hidden=("absorbed",))
_PLANS: tuple[tuple[Plan, Made], ...] = (
    (_absorbed("gauging.lag/parts"), _case("gauging.lag", lagging)),
    (
        _absorbed(
            "gauging.lag/even-feed", note="Feeds are nearly even in the fitted runs: the offset takes most of it."
        ),
        _case("gauging.lag", lagging, feeds="even", colour="heavy-tailed", first=3.0),
    ),
    (
        _absorbed(
            "gauging.lag/reading",
            verdicts=("missing-physics", "miscalibrated", "data-fault"),
            tolerated=("data.clock",),
            note="Most of a lag is a delay, which recalibration takes in; the knees of the feed tell the rest.",
        ),
        _reading,
    ),
    (_absorbed("gauging.wear/wheel"), _case("gauging.wear", worn, place="wheel", dressing=60)),
    (_plan("gauging.wear/seldom-dressed"), _case("gauging.wear", worn, place="wheel", dressing=160, colour="ar")),
    (
        _absorbed(
            "gauging.wear/probe",
            kind="undecidable",
            verdicts=("missing-physics", "data-fault"),
            note="From the first part to the last: a probe that wears, or an amplifier that runs away.",
        ),
        _case("gauging.wear", worn_probe, accept=("gauging.wear", "data.drift", "data.zero"), place="probe"),
    ),
    (_absorbed("gauging.interrupted/keyways"), _case("gauging.interrupted", falling_in, first=0.5)),
    (
        _plan("gauging.interrupted/rare", hidden=("rare",), note="One lot in thirty has keyways."),
        _case("gauging.interrupted", falling_in, first=0.5, grooves=0.03, colour="quantised"),
    ),
    (
        _plan("gauging.several/lag+wear", kind="several"),
        _case("gauging.lag", lagging_and_worn, beside=("gauging.wear", "wheel"), lacking=(as_worn_as_lagging, lagging)),
    ),
    (
        _plan("hidden.gauging/zero-touched", tolerated=("data.step",), kind="out-of-catalogue"),
        _case("hidden.zero-touched", drawing=_touched, place=None),
    ),
    (_plan("hidden.gauging/cooler", kind="out-of-catalogue"), _case("hidden.cooler", drawing=_cycling, place=None)),
    (_plan("clean.gauging/white", kind="clean"), _case("")),
    (_plan("clean.gauging/ar", kind="clean"), _case("", colour="ar")),
    (_plan("clean.gauging/quantised", kind="clean"), _case("", colour="quantised")),
)
SCENARIOS = scenarios_of(_PLANS, "gauging.wear/seldom-dressed")
