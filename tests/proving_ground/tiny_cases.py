"""Tiny scenarios and answerers with known answers, for the tests of the harness."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from proving_ground.case import Case, HeldOut, Scenario, TrueEffect, Truth, Window
from selector.diagnosis.comparison import Comparison
from selector.recording import Channel, Recording

ROWS, RUNS = 120, ("r1", "r2", "r3")
CHANNELS = (Channel("n", "spindle_speed", "rpm"), Channel("Z", "displacement", "um", axis="Z"))


def recording(values: Mapping[str, np.ndarray], channels: tuple[Channel, ...]) -> Recording:
    """Runs of one minute a sample; `values` has the samples of all runs, one after the other."""
    index = pd.Index(60.0 * np.arange(ROWS), name="time_s")
    runs = {
        run: pd.DataFrame({c.name: values[c.name][k * ROWS : (k + 1) * ROWS] for c in channels}, index=index)
        for k, run in enumerate(RUNS)
    }
    return Recording.from_runs(runs, channels)


def case(seed: int, d_prime: float | None, kind: str, truth: Truth) -> Case:
    """Growth with the square of speed on top of what the simulation has, as large as `d_prime`; None: nothing."""
    draw = np.random.default_rng(seed)
    n = ROWS * len(RUNS)
    speed = np.repeat(draw.choice([0.0, 1000.0, 2000.0, 3000.0], n // 20), 20)
    simulated = 5.0 * np.sin(np.arange(n) / 40.0)
    effect = (speed / 3000.0) ** 2
    size = 0.0 if d_prime is None else d_prime / float(np.linalg.norm(effect - effect.mean()))
    z = simulated + size * effect + draw.normal(0.0, 1.0, n)
    return Case(
        name=f"tiny/{kind}",
        family="thermal",
        kind=kind,
        recording=recording({"n": speed, "Z": z}, CHANNELS),
        simulation=recording({"Z": simulated}, CHANNELS[1:]),
        responses=("Z",),
        truth=truth,
    )


EFFECT = TrueEffect("thermal.instant_speed", ("thermal.instant_speed",), ("Z",))
DOOR = TrueEffect("hidden.door", ("hidden.door",), ("Z",), windows=(Window("r1", 0.0, 3000.0),))
GAP = {"Z": HeldOut(before=2.0, recalibrated=1.5, oracle=1.0, noise_floor=1.0)}


def _single(seed: int, d_prime: float | None) -> Case:
    return case(seed, d_prime, "single", Truth(("missing-physics",), (EFFECT,), d_prime=d_prime, held_out=GAP))


def _clean(seed: int, d_prime: float | None) -> Case:
    assert d_prime is None
    return case(seed, None, "clean", Truth(("nothing-missing",)))


def _broken(seed: int, d_prime: float | None) -> Case:
    raise RuntimeError("the machine fell over")


SINGLE = Scenario("tiny/single", "thermal", "single", _single)
CLEAN = Scenario("tiny/clean", "thermal", "clean", _clean)
BROKEN = Scenario("tiny/broken", "thermal", "single", _broken)


def answer(verdict: str, *effects: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """An answer in the JSON form of the contract."""
    return {"verdict": verdict, "effects": list(effects), "where": [], "fit": {}} | more


def effect(id: str, *others: str, channel: str = "Z", confidence: float = 0.9) -> dict[str, Any]:  # noqa: A002
    """An effect of such an answer."""
    return {"id": id, "channel": channel, "confidence": confidence, "cannot_be_told_from": list(others)}


def by_correlation(comparison: Comparison, seed: int) -> Mapping[str, Any]:
    """Names growth with speed where the residual goes with the square of speed; so that answers depend on the case."""
    residual = comparison.difference("Z")[~comparison.held_out]
    r = float(np.corrcoef(residual, comparison.recorded["n"][~comparison.held_out] ** 2)[0, 1])
    if r < 0.15:
        return answer("nothing-missing")
    return answer("missing-physics", effect("thermal.instant_speed", confidence=min(0.5 + r, 1.0)))


def stumbling(comparison: Comparison, seed: int) -> Mapping[str, Any]:
    """Raises on odd seeds."""
    if seed % 2:
        raise ZeroDivisionError("odd")
    return by_correlation(comparison, seed)
