"""`flow.overflow`: a store that spills at a level."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numba import njit

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.shapes.reservoirs import Brims, Stores, refitted, stores_of
from selector.diagnosis.shapes.residual import Remainder
from selector.diagnosis.shapes.signals import by_run, course, excited, filled, lagged, no_flow, time_constants
from selector.types import Vector

_FALLING = ((-np.inf, 0.0),)
_RISING = ((0.0, np.inf),)
_WHOLE = ((0.0, 1.5),)
"""What spills is lost whole; half as much again where the brim lies between the levels that are tried."""
_MOST = 30
_BETTER = 0.8
"""With brims the refitted stores have to err by less than this, over the error of those refitted without."""
_UPPER_SHARES = (0.6, 0.7, 0.8, 0.87, 0.94)
"""Quantiles of an upper store's level at which it may spill."""
_HIGH_SHARES = (0.975, 0.99, 0.997)
"""The same of a store that is known well enough for a spill that is seldom."""
_TUNED = 4.0
"""What a brim pays that was moved between the levels that are tried to where it explains most."""


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    simulated = filled(comparison, comparison.simulated[response])
    ceilings = _ceilings(comparison, response, simulated)
    unit = comparison.channel(response).unit
    for name in inflows(comparison, response):
        stores = stores_of(comparison, simulated, course(comparison, name))
        if stores is not None:
            yield from _of_stores(comparison, response, stores, ceilings, name)
            return
    taus = time_constants(comparison, 12)
    taus = taus[taus <= 0.35 * comparison.longest_s][-6:]
    for ceiling in ceilings:
        for tau_s in (*taus[1::2], np.inf):
            lost = spilled(comparison, simulated, ceiling, float(tau_s))
            if np.any(lost):
                lag = {"tau_s": Quantity(float(tau_s), "s")} if np.isfinite(tau_s) else {}
                shape = {"ceiling": Quantity(ceiling, unit)} | lag
                yield Variant(lost[:, None], (f"spills at {ceiling:.3g} {unit}",), shape, bounds=_RISING)
    for name, level, lost in _uppers(comparison, response, taus):
        shape = {"upper_ceiling": Quantity(level, "1")}
        names = (f"inflow lost as {name} spills above",)
        yield Variant(lost[:, None], names, shape, bounds=_FALLING, sources=_recorded(comparison, name))


def inflows(comparison: Comparison, response: str) -> tuple[str, ...]:
    """Channels that may fill the store: flows before voltages of pumps, then levels of other stores."""
    names = comparison.with_role("flow") + comparison.with_role("voltage")
    names += comparison.with_role("displacement", "position", "size", "state")
    return tuple(n for n in names if n != response and excited(course(comparison, n)))[:3]


def _of_stores(
    comparison: Comparison, response: str, stores: Stores, ceilings: list[float], inflow: str
) -> Iterator[Variant]:
    """The same stores with brims: on a grid, and where they explain most."""
    remainder, unit = Remainder(comparison, response), comparison.channel(response).unit
    whole, plain = stores.levels(comparison)
    fitted = ~comparison.held_out
    shares = (*_UPPER_SHARES, *_HIGH_SHARES)
    uppers = [np.inf, *np.quantile(whole[fitted], shares)] if stores.n == 2 else [np.inf]
    tried: list[tuple[float, Brims]] = []

    def lost(brims: Brims) -> Vector:
        return stores.levels(comparison, *brims)[1] - plain

    for upper in uppers:
        for lower in (*ceilings, np.inf):
            for caught in (0.0, 0.5) if np.isfinite(upper) else (0.0,):
                if np.isfinite(upper) or np.isfinite(lower):
                    brims = (float(upper), float(lower), caught)
                    tried.append((remainder.share(lost(brims), most=1.0), brims))
    tried = sorted(tried, key=lambda pair: -pair[0])[:_MOST]
    firsts: dict[tuple[bool, bool], Brims] = {}
    for _, brims in reversed(tried):
        firsts[bool(np.isfinite(brims[0])), bool(np.isfinite(brims[1]))] = brims
    best = [_refined(remainder, lost, first, float(np.ptp(whole)), float(np.ptp(plain))) for first in firsts.values()]
    on_grid = [brims for _, brims in tried]
    for brims in dict.fromkeys((*best, *on_grid)):
        column = lost(brims)
        if np.any(column):
            looked_at = 1.0 if brims in on_grid else _TUNED
            yield _with_brims(comparison, unit, column, brims, whole, inflow, looked_at)
    recorded = comparison.recorded[response]
    without, _, _ = refitted(comparison, stores, recorded, None)
    for brims in best:
        error, anew, moved = refitted(comparison, stores, recorded, brims)
        if moved is not None and error < _BETTER * without:
            whole, course_ = anew.levels(comparison)[0], anew.levels(comparison, *moved)[1]
            yield _with_brims(comparison, unit, course_ - plain, moved, whole, inflow, _TUNED)


def _refined(
    remainder: Remainder, lost: Callable[[Brims], Vector], brims: Brims, upper_size: float, lower_size: float
) -> Brims:
    """Brims moved one by one, by ever smaller steps, as long as they explain more."""
    best, score = brims, remainder.share(lost(brims), most=1.0)
    for step in (0.1, 0.05, 0.025, 0.012):
        for k, size in ((0, upper_size), (1, lower_size), (2, 3.0)):
            for sign in (-1.0, 1.0):
                if not np.isfinite(best[k]):
                    continue
                moved = list(best)
                moved[k] += sign * step * size
                moved[2] = min(max(moved[2], 0.0), 1.0)
                trial = (moved[0], moved[1], moved[2])
                gain = remainder.share(lost(trial), most=1.0)
                if gain > score:
                    best, score = trial, gain
    return best


def _with_brims(
    comparison: Comparison, unit: str, column: Vector, brims: Brims, whole: Vector, inflow: str, looked_at: float
) -> Variant:
    shape, words = {}, []
    if np.isfinite(brims[1]):
        shape["ceiling"] = Quantity(float(brims[1]), unit)
        words.append(f"spills at {brims[1]:.3g} {unit}")
    if np.isfinite(brims[0]):
        share = float(brims[0]) / float(whole.max())
        shape["upper_ceiling"] = Quantity(share, "1")
        shape["caught"] = Quantity(float(brims[2]), "1")
        words.append(f"the store above spills at {100 * share:.3g} % of its highest level")
    sources = _recorded(comparison, inflow)
    return Variant(column[:, None], (", ".join(words),), shape, sources=sources, bounds=_WHOLE, looked_at=looked_at)


def spilled(comparison: Comparison, level: Vector, ceiling: float, tau_s: float) -> Vector:
    """What a simulated level loses by spilling at a ceiling [its unit], ≤ 0: at once there, forgotten with `tau_s`."""
    return by_run(comparison, lambda y, t: _reflected(y, t, ceiling, tau_s), level, comparison.time_s)


@njit(cache=True, nogil=True)
def _reflected(level, time_s, ceiling, tau_s):  # type: ignore[no-untyped-def]
    lost = np.zeros(len(level))
    d = 0.0
    for k in range(len(level)):
        if k > 0:
            d *= np.exp(-(time_s[k] - time_s[k - 1]) / tau_s)
        d = min(d, ceiling - level[k])
        lost[k] = d
    return lost


def _ceilings(comparison: Comparison, response: str, simulated: Vector) -> list[float]:
    """Levels that the recording hardly exceeds and the simulation does; the recording's own levels at its top."""
    recorded = comparison.recorded[response]
    fitted = np.isfinite(recorded) & ~comparison.held_out
    if not fitted.any():
        return []
    seen = recorded[fitted]
    tops = np.unique(np.quantile(seen, (0.85, 0.9, 0.94, 0.97, 0.985, 0.995, 0.9985)))
    return [float(top) for top in tops if float(np.mean(simulated[fitted] > top)) > 0.002]


def _uppers(comparison: Comparison, response: str, taus: Vector) -> Iterator[tuple[str, float, Vector]]:
    """(channel, level, course) of what the response loses because a store above it spills.

    The level above is recorded, simulated alone, or the inflow lagged; what is lost reaches the response late.
    """
    levels: list[tuple[str, Vector]] = []
    names = comparison.with_role("flow", "voltage", "displacement", "position", "size")
    for name in (*names, *(name for name in comparison.simulated if name not in comparison.recorded)):
        values = course(comparison, name)
        if not excited(values):
            continue
        if name in comparison.recorded:
            levels += [(name, lagged(comparison, values, float(tau), settled=True)) for tau in taus[1::2]]
        else:
            levels.append((name, values))
    for name, level in levels:
        for share in _UPPER_SHARES:
            ceiling = float(np.quantile(level[~comparison.held_out], share))
            excess = np.maximum(level - ceiling, 0.0)
            for tau in taus[2::2]:
                lost = lagged(comparison, excess, float(tau))
                if np.any(lost):
                    yield name, ceiling, lost


def _recorded(comparison: Comparison, name: str) -> tuple[str, ...]:
    return (name,) if name in comparison.recorded else ()


def _testable(comparison: Comparison, response: str) -> str | None:
    reason = no_flow(comparison, response)
    if reason is None and not excited(filled(comparison, comparison.simulated[response])):
        return f"the simulated {response} does not move"
    return reason


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    shape = fitted.variant.shape
    parameters, parts = fitted.size, []
    if "ceiling" in shape:
        parameters["ceiling"] = replace(fitted.parameter("ceiling"), unit=fitted.unit)
        parts.append(f"spills at {shape['ceiling'].value:.3g} {fitted.unit}")
    if "caught" in shape:
        parameters |= {"upper_ceiling": shape["upper_ceiling"], "caught": shape["caught"]}
    if "upper_ceiling" in shape:
        parts.append("loses inflow while the store above it spills")
    text = f"{fitted.response} {' and '.join(parts)}; this takes up to {fitted.up_to}"
    return Reading(text, parameters)


EFFECT = Effect(
    id="flow.overflow",
    title="A store spills at a level",
    physics="A tank is full at a level; what flows in beyond is lost or falls past the next store. The level stays at "
    "its ceiling while inflow goes on, and is lower than simulated for a time afterwards, in the store below too.",
    reference="Schoukens, Mattsson, Wigren, Noël: Cascaded tanks benchmark combining soft and hard nonlinearities, "
    "2016",
    enters="limit",
    acts_at="every store with a recorded level, and a store above it",
    parameters=(
        ShapeParameter("ceiling", "unit of the response", -1e12, 1e12, "level at which it spills"),
        ShapeParameter("upper_ceiling", "1", 0.0, 1e12, "level at which the store above spills, over its highest"),
        ShapeParameter("caught", "1", 0.0, 1.0, "share of what it spills that the store below gets"),
        ShapeParameter("tau_s", "s", 0.0, 1e9, "time after which the lost amount is no longer seen"),
        ShapeParameter("largest", "unit of the response", 0.0, 1e12, "largest amount in the response"),
    ),
    needs="an inflow that fills the store to the brim",
    confounders=("drive.saturation", "data.stuck", "data.gain"),
    refuted_by="the recorded level exceeds the ceiling at any time, or no liquid leaves over the brim",
    experiment="Hold the inflow at its highest until the level stands, then at its lowest until the store is empty; "
    "twice.",
    variants=_variants,
    testable=_testable,
    reading=_reading,
)
