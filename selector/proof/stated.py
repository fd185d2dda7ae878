"""What does an answer say, as far as it is scored: read from the JSON of the contract, whoever gave it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from selector.proof.case import Window

FAILED = "failed"
"""Verdict of an answer that was never given, because the program raised."""


@dataclass(frozen=True)
class Named:
    """An effect that the answer names: id, what it cannot be told from, channel, and how sure the answer is."""

    id: str
    channel: str
    cannot_be_told_from: tuple[str, ...] = ()
    confidence: float | None = None
    suspected: bool = False

    @property
    def ids(self) -> tuple[str, ...]:
        """The id and those that it cannot be told from."""
        return (self.id, *(other for other in self.cannot_be_told_from if other != self.id))


@dataclass(frozen=True)
class Pointed:
    """A place that the answer points at; None in a field of the window = from the start, to the end, in every run."""

    channel: str
    run: str | None = None
    from_s: float | None = None
    to_s: float | None = None
    share: float = 0.0


@dataclass(frozen=True)
class Stated:
    """An answer, as far as it is scored.

    Attributes
    ----------
    verdict : str
        Of the contract, or `FAILED`.
    effects : tuple of Named
        In the order of the answer.
    where : tuple of Pointed
    heldout_after : mapping of str to float
        Response → root mean square error of the improved model on held-out rows [its unit].
    placebo : mapping of str to (value, low, high)
        Response → what wrong effects of the same size closed of the gap, with its interval.
    error : str
        What was raised, with the place in the program; empty if nothing was.
    """

    verdict: str
    effects: tuple[Named, ...] = ()
    where: tuple[Pointed, ...] = ()
    heldout_after: Mapping[str, float] = field(default_factory=dict)
    placebo: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    error: str = ""


def stated(answer: Mapping[str, Any]) -> Stated:
    """The scored part of an answer in the JSON form of ``selector.diagnosis/1``."""
    fits: Mapping[str, Any] = answer.get("fit") or {}
    after = {name: _finite(fit["heldout"]["rmse_after"]) for name, fit in fits.items() if fit.get("heldout")}
    placebo = {name: _interval(fit["placebo_gain"]) for name, fit in fits.items() if fit.get("placebo_gain")}
    return Stated(
        verdict=str(answer["verdict"]),
        effects=tuple(_named(one) for one in answer.get("effects") or ()),
        where=tuple(_pointed(one) for one in answer.get("where") or ()),
        heldout_after={name: value for name, value in after.items() if value is not None},
        placebo={name: interval for name, interval in placebo.items() if interval is not None},
    )


def windows_of(
    where: Sequence[Pointed], channels: Sequence[str], spans: Mapping[str, tuple[float, float]]
) -> list[Window]:
    """The windows pointed at in these channels, with the first and last time of the runs put in for None."""
    found = []
    for one in where:
        if one.channel not in channels:
            continue
        for run in spans if one.run is None else [one.run]:
            if run in spans:
                first, last = spans[run]
                start = first if one.from_s is None else one.from_s
                found.append(Window(run, start, last if one.to_s is None else one.to_s))
    return found


def _named(effect: Mapping[str, Any]) -> Named:
    return Named(
        id=str(effect["id"]),
        channel=str(effect["channel"]),
        cannot_be_told_from=tuple(effect.get("cannot_be_told_from") or ()),
        confidence=_finite(effect.get("confidence")),
        suspected=bool(effect.get("suspected", False)),
    )


def _pointed(place: Mapping[str, Any]) -> Pointed:
    return Pointed(
        channel=str(place["channel"]),
        run=place.get("run"),
        from_s=_finite(place.get("from_s")),
        to_s=_finite(place.get("to_s")),
        share=_finite(place.get("share")) or 0.0,
    )


def _interval(quantity: Mapping[str, Any]) -> tuple[float, float, float] | None:
    parts = [_finite(quantity.get(key)) for key in ("value", "low", "high")]
    value, low, high = parts
    return None if value is None or low is None or high is None else (value, low, high)


def _finite(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
