"""Two stores in a row whose simulation does not know that the upper or the lower one spills."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numba import njit

from proving_ground.case import TrueEffect, Window
from proving_ground.concealment import Noise, coloured
from proving_ground.world import Made, Plan, Runs, World, scenarios_of
from selector.recording import Channel
from selector.types import Matrix, Vector

RUNS = ("r1", "r2", "r3")
PERIOD_S = 4.0
ROWS = 1000
FINE_S = 0.2
CHANNELS = (
    Channel("u", "voltage", "V", place="pump"),
    Channel("h1", "voltage", "V", place="level of the upper store"),
    Channel("h2", "voltage", "V", place="level of the lower store"),
)


@dataclass(frozen=True, eq=False)
class Stores:
    """What a pump fills: per run the pump's voltage every `FINE_S`, coefficients of both outlets and of the pump."""

    pumps: tuple[Vector, ...]
    outlets: tuple[float, float]
    pump: float
    returned: float

    def levels(
        self,
        run: int,
        ceilings: tuple[float, float] = (1e9, 1e9),
        blocked: Vector | None = None,
        *,
        coarse: int = 1,
        every_s: float = PERIOD_S,
    ) -> Matrix:
        """Levels of both stores [V of the sensors] every so often; spilled flow partly gets to the lower one.

        `coarse` fine steps are taken at once, with the pump's mean voltage.
        """
        pump = self.pumps[run].reshape(-1, coarse).mean(axis=1)
        free = np.ones(len(pump)) if blocked is None else blocked.reshape(-1, coarse).mean(axis=1)
        step = coarse * FINE_S
        found: Matrix = _levels(
            pump, free, step, round(every_s / step), *self.outlets, self.pump, *ceilings, self.returned
        )
        return found


@njit(cache=True, nogil=True)
def _levels(pump, free, step, every, out_1, out_2, gain, ceiling_1, ceiling_2, returned):  # type: ignore[no-untyped-def]
    n = len(pump) // every
    result = np.empty((n, 2))
    upper, lower = 2.0, 2.0
    for k in range(n * every):
        if k % every == 0:
            result[k // every, 0], result[k // every, 1] = upper, lower
        # midpoint rule; what is above the edge has gone by the end of the step
        down = free[k] * out_1 * np.sqrt(max(upper, 0.0))
        rate_1 = gain * pump[k] - down
        rate_2 = down - out_2 * np.sqrt(max(lower, 0.0))
        half_1, half_2 = upper + 0.5 * step * rate_1, lower + 0.5 * step * rate_2
        down = free[k] * out_1 * np.sqrt(max(half_1, 0.0))
        upper += step * (gain * pump[k] - down)
        lower += step * (down - out_2 * np.sqrt(max(half_2, 0.0)))
        if upper > ceiling_1:
            lower += returned * (upper - ceiling_1)
            upper = ceiling_1
        lower = min(max(lower, 0.0), ceiling_2)
        upper = max(upper, 0.0)
    return result


def stores(generator: np.random.Generator) -> Stores:
    """Three runs of another pump programme each: steps, slow noise, both."""
    draw = generator.uniform
    fine = round(PERIOD_S / FINE_S) * ROWS
    time = FINE_S * np.arange(fine)
    pumps = []
    for run in range(len(RUNS)):
        knots = np.cumsum(draw(60.0, 220.0, 80))
        levels = draw(1.5, 4.5, 81)
        steps = levels[np.searchsorted(knots, time)]
        slow = 3.0 + np.sum(
            [draw(0.3, 0.6) * np.sin(2 * np.pi * time / draw(150.0, 900.0) + draw(0.0, 6.3)) for _ in range(5)], axis=0
        )
        course = (steps, slow, 0.5 * (steps + slow))[run % 3]
        pumps.append(np.clip(3.0 + (course - 3.0), 0.0, 6.0))
    # in volts of the level sensors per second
    pump = draw(0.02, 0.04)
    outlet = 3.0 * pump / np.sqrt(draw(4.0, 6.0))
    return Stores(tuple(pumps), (outlet, outlet * draw(0.9, 1.15)), pump, draw(0.3, 0.8))


def _case(
    store: int, *, responses: tuple[str, ...] = ("h1", "h2"), colour: str = "white", returned: float | None = None
) -> Made:
    """`store` 0 or 1 spills at an edge that is size × 10 mV below the highest level of the fitted runs."""

    def made(generator: np.random.Generator) -> World:
        drawn = stores(generator)
        if returned is not None:
            drawn = replace(drawn, returned=returned)
        plain = [drawn.levels(run, every_s=FINE_S) for run in range(len(RUNS))]
        highest = max(float(part[:, store].max()) for part in plain[:-1])

        def ceilings(size: float) -> tuple[float, float]:
            edge = highest - 0.01 * size if size else 1e9
            return (edge, 1e9) if store == 0 else (1e9, edge)

        def recorded(size: float) -> Runs:
            return _runs(drawn, [drawn.levels(run, ceilings(size)) for run in range(len(RUNS))])

        effect = TrueEffect("flow.overflow", ("flow.overflow",), responses, CHANNELS[1 + store].place)
        return _world(drawn, recorded, lambda size: (effect,), responses, _noise(colour, generator), 10.0)

    return made


def _runs(drawn: Stores, found: Sequence[Matrix]) -> dict[str, list[Vector]]:
    return {
        "u": [np.round(part[:: round(PERIOD_S / FINE_S)], 3) for part in drawn.pumps],
        "h1": [part[:, 0] for part in found],
        "h2": [part[:, 1] for part in found],
    }


def _world(
    drawn: Stores,
    recorded: Callable[[float], Runs],
    effects: Callable[[float], tuple[TrueEffect, ...]],
    responses: tuple[str, ...],
    noise: Mapping[str, Noise],
    first: float,
) -> World:
    time = PERIOD_S * np.arange(ROWS, dtype=np.float64)
    said = _runs(drawn, [drawn.levels(run, coarse=4) for run in range(len(RUNS))])
    return World(
        tuple(channel for channel in CHANNELS if channel.name in ("u", *responses)),
        responses,
        dict.fromkeys(RUNS, time),
        dict.fromkeys(RUNS, time),
        recorded,
        lambda size: {name: said[name] for name in responses},
        {name: noise[name] for name in responses},
        effects,
        first,
    )


def _noise(colour: str, generator: np.random.Generator) -> dict[str, Noise]:
    sd = float(generator.uniform(0.02, 0.05))
    return {"h1": coloured(colour, sd, 0.001), "h2": coloured("white" if colour == "quantised" else colour, sd, 0.001)}


def _blocked(generator: np.random.Generator) -> World:
    """Something is swept into the upper outlet at random, and out again."""
    drawn = stores(generator)
    time = FINE_S * np.arange(round(PERIOD_S / FINE_S) * ROWS)
    shares, windows = [], []
    for run in RUNS:
        share = np.zeros_like(time)
        for start in generator.uniform(200.0, 3600.0, int(generator.integers(3, 6))):
            length, depth = generator.uniform(60.0, 250.0), generator.uniform(0.5, 1.0)
            share = np.maximum(share, depth * ((time >= start) & (time < start + length)))
            windows.append(Window(run, float(start), float(start + 2.0 * length)))
        shares.append(share)

    def recorded(size: float) -> Runs:
        found = [drawn.levels(run, blocked=np.clip(1.0 - 0.01 * size * shares[run], 0.0, 1.0)) for run in range(3)]
        return _runs(drawn, found)

    effect = TrueEffect("hidden.blocked", ("hidden.blocked",), ("h1", "h2"), None, tuple(windows))
    return _world(drawn, recorded, lambda size: (effect,), ("h1", "h2"), _noise("white", generator), 5.0)


_plan = partial(Plan, family="flow", kind="single")
_absorbed = partial(_plan, hidden=("absorbed",))
_PLANS: tuple[tuple[Plan, Made], ...] = (
    (_absorbed("flow.overflow/upper"), _case(0)),
    (
        _absorbed("flow.overflow/lower-seen", note="As in the benchmark: only the lower level is recorded."),
        _case(0, responses=("h2",)),
    ),
    (_plan("flow.overflow/lower"), _case(1, colour="ar")),
    (
        _plan("flow.overflow/lost", hidden=("rare",), note="What spills is gone."),
        _case(0, returned=0.0, colour="quantised"),
    ),
    (_plan("hidden.flow/blocked", kind="out-of-catalogue", note="An outlet that is blocked at random."), _blocked),
    (_plan("clean.flow/white", kind="clean"), _case(0)),
    (_plan("clean.flow/ar", kind="clean"), _case(0, colour="ar")),
)
SCENARIOS = scenarios_of(_PLANS, "flow.overflow/upper")
