"""How thermal effects are said: places of channels, delays, what an effect is worth, parameters with intervals."""

from collections.abc import Mapping, Sequence
from math import isfinite

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant
from selector.diagnosis.shapes.heating import shown_unit
from selector.diagnosis.shapes.signals import lagged
from selector.number_text import span_text
from selector.types import Vector

_BOTH_WAYS = 0.2  #: Of the larger way, from which on the smaller one is said as well.


def with_place(comparison: Comparison, name: str) -> str:
    """A channel with its place, e.g. ``"T2 (rear bearing)"``."""
    place = place_of(comparison, name)
    return f"{name} ({place})" if place else name


def late(
    comparison: Comparison,
    name: str,
    parts: Sequence[tuple[str, Vector, float]],
    shape: Mapping[str, Quantity] | None = None,
    *,
    taus_s: Sequence[float] = (),
    place: str | None = None,
    regime: str | None = None,
    settled: bool = False,
) -> Variant:
    """Heats that a channel stands for behind lags: (what, course, lag [s]) of every column, with the place of it.

    `taus_s`, by default the lags of all columns, are the delays of the answer: the first, and the last of several.
    With `settled` the lags start at the first value of every run, else at 0.
    """
    lags = [float(tau_s) for tau_s in taus_s or [part[-1] for part in parts]]
    delays = {"tau_s": Quantity(lags[0], "s")} | ({"slow_tau_s": Quantity(lags[-1], "s")} if len(lags) > 1 else {})
    return Variant(
        np.column_stack([lagged(comparison, heat, float(tau_s), settled=settled) for _, heat, tau_s in parts]),
        tuple(f"{words} delayed by {tau_s / 60:.3g} min" if tau_s else words for words, _, tau_s in parts),
        {**(shape or {}), **delays},
        place=place or place_of(comparison, name),
        sources=(name,),
        regime=regime,
    )


def place_of(comparison: Comparison, name: str) -> str | None:
    """Where a channel sits, in the words of the machine file; None if it says nothing."""
    return next((channel.place for channel in comparison.channels if channel.name == name), None)


def delay_of(fitted: Fitted) -> str:
    """The delays of the fitted variant: one, or two that act together."""
    shape = fitted.variant.shape
    tau_s = shape["tau_s"].value if "tau_s" in shape else 0.0
    known = fitted.shape_intervals.get("tau_s")
    text = f"with a delay of {'about ' if known is None else ''}{span_text(tau_s)}" if tau_s > 0.0 else "at once"
    if known is not None:
        text += f" ({_interval(*known)})"
    if "slow_tau_s" not in shape:
        return text
    text += f" and one of {span_text(shape['slow_tau_s'].value)}"
    slow = fitted.shape_intervals.get("slow_tau_s")
    return text if slow is None else f"{text} ({_interval(*slow)})"


def _interval(low: float, high: float) -> str:
    """An interval of delays, which may be open at an end."""
    if not isfinite(high):
        return f"at least {span_text(low)}" if low > 0.0 else "of any length"
    return f"{span_text(low)} to {span_text(high)}" if low > 0.0 else f"at most {span_text(high)}"


def worth(fitted: Fitted) -> str:
    """Which way the effect moves the response: ``"it moves Z by up to −9 µm"``, or both ways ``"by −3 to +4 µm"``."""
    low, high = fitted.extremes
    unit = shown_unit(fitted.unit)
    if low == high == 0.0:
        return f"worth {fitted.largest:.3g} {unit} at most"
    if min(-low, high) > _BOTH_WAYS * max(-low, high):
        return f"it moves {fitted.response} by {_signed(low)} to {_signed(high)} {unit} since the start of a run"
    most = low if -low > high else high
    return f"it moves {fitted.response} by up to {_signed(most)} {unit} since the start of a run"


def _signed(value: float) -> str:
    return f"{value:+.3g}".replace("-", "−")


def told(fitted: Fitted, text: str, **more: Quantity) -> Reading:
    """What an effect does, and what it is worth; parameters: those of its shape, how far it moved, and `more`.

    `largest` is the amount, `lowest` and `highest` are signed and count from the start of a run.
    """
    found = {name: fitted.parameter(name) for name in fitted.variant.shape} | fitted.size
    if fitted.extremes != (0.0, 0.0):
        found |= {
            key: Quantity(end, fitted.unit) for key, end in zip(("lowest", "highest"), fitted.extremes, strict=True)
        }
    return Reading(f"{text}; {worth(fitted)}.", found | more)
