"""`flow.overflow`: a store that spills at a level."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.record_kind import no_flow
from selector.diagnosis.signals import course, excited, filled, lagged, time_constants

Vector = NDArray[np.float64]

_FALLING = ((-1e300, 0.0),)
_UPPER_SHARES = (0.6, 0.7, 0.8, 0.87, 0.94)
"""Quantiles of an upper store's level at which it may spill."""


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    if _testable(comparison, response) is not None:
        return
    simulated = filled(comparison, comparison.simulated[response])
    taus = time_constants(comparison, 12)
    taus = taus[taus <= 0.35 * comparison.longest_s][-6:]
    own: list[tuple[float, float, Vector]] = []
    for ceiling in _ceilings(comparison, response, simulated):
        for tau_s in (*taus[1::2], np.inf):
            lost = spilled(comparison, simulated, ceiling, float(tau_s))
            if np.any(lost):
                own.append((ceiling, float(tau_s), lost))
    unit = comparison.channel(response).unit
    for ceiling, tau_s, lost in own:
        shape = {"ceiling": Quantity(ceiling, unit)} | _lag(tau_s)
        yield Variant(lost[:, None], (f"spills at {ceiling:.3g} {unit}",), shape, bounds=((0.0, 1e300),))
    uppers = list(_uppers(comparison, response, taus))
    for name, level, lost in uppers:
        shape = {"upper_ceiling": Quantity(level, "1")}
        yield Variant(
            lost[:, None],
            (f"inflow lost as {name} spills above",),
            shape,
            bounds=_FALLING,
            sources=_recorded(comparison, name),
        )
    likeliest = own[:: max(len(own) // 5, 1)][:5]
    for ceiling, tau_s, lost in likeliest:
        for name, level, upper in uppers[:: max(len(uppers) // 10, 1)][:10]:
            columns = np.column_stack([lost, upper])
            names = (f"spills at {ceiling:.3g} {unit}", f"inflow lost as {name} spills above")
            shape = {"ceiling": Quantity(ceiling, unit), "upper_ceiling": Quantity(level, "1")} | _lag(tau_s)
            yield Variant(columns, names, shape, bounds=((0.0, 1e300), *_FALLING), sources=_recorded(comparison, name))


def spilled(comparison: Comparison, level: Vector, ceiling: float, tau_s: float) -> Vector:
    """What a simulated level loses by spilling at a ceiling [its unit], ≤ 0: at once there, forgotten with `tau_s`."""
    result = np.zeros(len(level))
    for _, rows in comparison.rows_of_runs():
        result[rows] = _reflected(np.ascontiguousarray(level[rows]), comparison.time_s[rows], ceiling, tau_s)
    return result


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
    tops = np.unique(np.quantile(seen, (0.85, 0.9, 0.94, 0.97, 0.985, 0.995)))
    return [float(top) for top in tops if float(np.mean(simulated[fitted] > top)) > 0.005]


def _uppers(comparison: Comparison, response: str, taus: Vector) -> Iterator[tuple[str, float, Vector]]:
    """(channel, level, course) of what the response loses because a store above it spills.

    The level above is recorded, simulated alone, or the inflow lagged; what is lost reaches the response late.
    """
    levels: list[tuple[str, Vector]] = []
    for name in (
        *comparison.with_role("flow", "voltage", "displacement", "position", "size"),
        *_only_simulated(comparison),
    ):
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


def _only_simulated(comparison: Comparison) -> tuple[str, ...]:
    return tuple(name for name in comparison.simulated if name not in comparison.recorded)


def _lag(tau_s: float) -> dict[str, Quantity]:
    return {"tau_s": Quantity(tau_s, "s")} if np.isfinite(tau_s) else {}


def _recorded(comparison: Comparison, name: str) -> tuple[str, ...]:
    return (name,) if name in comparison.recorded else ()


def _testable(comparison: Comparison, response: str) -> str | None:
    reason = no_flow(comparison, response)
    if reason is None and not excited(filled(comparison, comparison.simulated[response])):
        return f"the simulated {response} does not move"
    return reason


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    shape = fitted.variant.shape
    parameters = {"largest": Quantity(fitted.largest, fitted.unit)}
    parts = []
    if "ceiling" in shape:
        low, high = fitted.shape_intervals.get("ceiling", (None, None))
        parameters["ceiling"] = Quantity(shape["ceiling"].value, fitted.unit, low, high)
        parts.append(f"spills at {shape['ceiling'].value:.3g} {fitted.unit}")
    if "upper_ceiling" in shape:
        parts.append("loses inflow while the store above it spills")
    text = f"{fitted.response} {' and '.join(parts)}; this takes up to {fitted.largest:.3g} {fitted.unit}"
    return Reading(text, parameters)


EFFECT = Effect(
    id="flow.overflow",
    title="A store spills at a level",
    physics=(
        "A tank is full at a level; what flows in beyond is lost or falls past the next store. The level stays at its ceiling "
        "while inflow goes on, and is lower than simulated for a time afterwards, in the store below too."
    ),
    reference="Schoukens, Mattsson, Wigren, Noël: Cascaded tanks benchmark combining soft and hard nonlinearities, 2016",
    enters="limit",
    acts_at="every store with a recorded level, and a store above it",
    parameters=(
        ShapeParameter("ceiling", "unit of the response", -1e12, 1e12, "level at which it spills"),
        ShapeParameter("tau_s", "s", 0.0, 1e9, "time after which the lost amount is no longer seen"),
        ShapeParameter("largest", "unit of the response", 0.0, 1e12, "largest amount in the response"),
    ),
    needs="an inflow that fills the store to the brim",
    confounders=("drive.saturation", "data.stuck", "data.gain"),
    refuted_by="the recorded level exceeds the ceiling at any time, or no liquid leaves over the brim",
    experiment="Hold the inflow at its highest until the level stands, then at its lowest until the store is empty; twice.",
    variants=_variants,
    testable=_testable,
    reading=_reading,
)
