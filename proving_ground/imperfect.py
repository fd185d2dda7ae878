"""Cases of the other families whose simulation is a little wrong in a way that is nobody's, or whose clocks are uneven.

A real simulation is never wrong in one way only. What is added here is a function of the simulated state (where it is,
and how it got there) that repeats in every run and is no effect of the catalogue: a sum of waves of random direction
over the response and its memories (random features: A. Rahimi, B. Recht, NIPS 20, 2007).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from proving_ground.case import Case, Scenario, Truth
from proving_ground.scenarios import scenarios
from selector.recording import Recording
from selector.types import Vector

SHARES = (0.001, 0.003, 0.01, 0.03, 0.1)
"""Sizes of the misfit: root mean square in parts of that of the movement of a simulated response."""
_WAVES = 6
_MEMORIES = (0.01, 0.08)
"""Time constants of what the misfit remembers, in parts of a run."""
_LOST = 0.3
_JITTER = 0.2
"""Share of rows that were never written, and of a period by which a stamp is off, on an uneven clock."""
_COUNT = 0.32258
"""Kelvin a count of a coarse converter, whose readings are written with two decimals."""

_CLEAN = ("clean.thermal/white", "clean.drive/ar", "clean.vibration/ar", "clean.gauging/quantised", "clean.flow/ar")
_WITH_EFFECT = (
    "thermal.memory/one axis",
    "thermal.ambient/gate",
    "drive.coulomb/small",
    "vibration.hardening/absorbed",
    "flow.overflow/lower",
)
_NO_NAME = ("nothing-missing", "miscalibrated", "unexplained")
"""Of a misfit that is nobody's each of these is an honest verdict; a name is not."""


def _with_misfit(case: Case, generator: np.random.Generator, *, share: float) -> Case:
    frame = case.simulation.frame.copy()
    for name in case.responses:
        waves = generator.normal(scale=1.5, size=(_WAVES, 1 + len(_MEMORIES)))
        heights, phases = generator.normal(size=_WAVES), generator.uniform(0.0, 2.0 * np.pi, _WAVES)
        states = {run: _states(case.simulation.values(run, (name,))[:, 0]) for run in case.simulation.runs}
        whole = np.concatenate(list(states.values()))
        middle, spread = whole.mean(axis=0), np.maximum(whole.std(axis=0), 1e-300)
        misfit = np.sin((whole - middle) / spread @ waves.T + phases) @ heights
        size = share * float(spread[0]) / max(float(misfit.std()), 1e-300)
        frame[name] = frame[name].to_numpy() + size * (misfit - misfit.mean())
    return replace(case, simulation=case.simulation.with_values(frame))


def _states(course: Vector) -> Vector:
    """(n, p): Where a course is, and where it was of late."""
    rest = course - course[0]
    gains = [1.0 / max(part * len(course), 1.0) for part in _MEMORIES]
    lagged = [lfilter([gain], [1.0, gain - 1.0], rest) for gain in gains]
    return np.column_stack([rest, *lagged])


def _unevenly(case: Case, generator: np.random.Generator) -> Case:
    """Rows are missing, stamps are off by parts of a period, and temperatures stand on a coarse, rounded grid."""
    coarse = case.recording.with_role("temperature")
    frames = {}
    for run in case.recording.runs:
        time_s = case.recording.time_s(run)
        table = pd.DataFrame(case.recording.values(run, case.recording.names), columns=list(case.recording.names))
        for name in coarse:
            table[name] = np.round(np.round(table[name] / _COUNT) * _COUNT, 2)
        stamps = time_s + _JITTER * np.median(np.diff(time_s)) * generator.uniform(-1.0, 1.0, len(time_s))
        kept = generator.uniform(size=len(time_s)) > _LOST
        kept[[0, -1]] = True
        frames[run] = table[kept].set_index(pd.Index(stamps[kept], name="time_s"))
    return replace(case, recording=Recording.from_runs(frames, case.recording.channels))


def _changed(
    base: Callable[[], Sequence[Scenario]],
    name: str,
    change: Callable[[Case, np.random.Generator], Case],
    *,
    is_clean: bool,
) -> Scenario:
    """A scenario whose cases are those of another one, changed."""

    def build(seed: int, d_prime: float | None) -> Case:
        case = base()[0].build(seed, d_prime)
        generator = np.random.default_rng([seed, zlib.crc32(name.encode())])
        verdicts = _NO_NAME if is_clean else (*case.truth.verdicts, "unexplained")
        truth = Truth(verdicts, case.truth.effects, case.truth.tolerated, case.truth.d_prime)
        return replace(change(case, generator), name=name, family="imperfect", truth=truth)

    return Scenario(name, "imperfect", "clean" if is_clean else "single", build, has_strength=not is_clean)


def _all() -> Iterator[Scenario]:
    for bases, is_clean in ((_CLEAN, True), (_WITH_EFFECT, False)):
        for name in bases:
            # the other families are imported when a case is built
            base = partial(scenarios, (), (name,))
            for share in SHARES:
                change = partial(_with_misfit, share=share)
                yield _changed(base, f"misfit {share:.1%}: {name}", change, is_clean=is_clean)
            yield _changed(base, f"uneven: {name}", _unevenly, is_clean=is_clean)


SCENARIOS = tuple(_all())
