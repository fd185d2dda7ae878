"""How thermal effects are said: places of channels, delays, what an effect is worth, parameters with intervals."""

from __future__ import annotations

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity
from selector.diagnosis.shapes.heating import shown_unit
from selector.quality.wording import duration


def with_place(comparison: Comparison, name: str) -> str:
    """A channel with its place, e.g. ``"T2 (rear bearing)"``."""
    place = place_of(comparison, name)
    return f"{name} ({place})" if place else name


def place_of(comparison: Comparison, name: str) -> str | None:
    """Where a channel sits, in the words of the machine file; None if it says nothing."""
    return next((channel.place for channel in comparison.channels if channel.name == name), None)


def delay(tau_s: float) -> str:
    """``"with a delay of 41 min"``, or ``"at once"``."""
    return f"with a delay of {duration(tau_s)}" if tau_s > 0.0 else "at once"


def delay_of(fitted: Fitted) -> str:
    """The delays of the fitted variant: one, or two that act together."""
    shape = fitted.variant.shape
    if "tau_s" not in shape:
        return "at once"
    text = delay(shape["tau_s"].value)
    if "tau_s" in fitted.shape_intervals:
        low, high = fitted.shape_intervals["tau_s"]
        text += f" ({duration(low)} to {duration(high)})"
    elif shape["tau_s"].value > 0.0:
        text = f"with a delay of about {duration(shape['tau_s'].value)}"
    return f"{text} and one of {duration(shape['slow_tau_s'].value)}" if "slow_tau_s" in shape else text


def worth(fitted: Fitted) -> str:
    """``"worth 12 µm at most"``."""
    return f"worth {fitted.largest:.3g} {shown_unit(fitted.unit)} at most"


def quantities(fitted: Fitted, comparison: Comparison) -> dict[str, Quantity]:
    """The shape parameters with their intervals, and `largest`: the most that the effect moved the response."""
    found = {}
    for name, quantity in fitted.variant.shape.items():
        low, high = fitted.shape_intervals.get(name, (quantity.low, quantity.high))
        found[name] = Quantity(quantity.value, quantity.unit, low, high)
    return found | {"largest": Quantity(fitted.largest, comparison.channel(fitted.response).unit)}
