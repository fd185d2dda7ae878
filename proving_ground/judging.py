"""Is one answer right? What it says, and its names, sets, windows, channels and gains against the sealed truth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from proving_ground.case import TrueEffect, Truth, Window

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
    """An answer, as far as it is scored."""

    verdict: str  #: Of the contract, or `FAILED`
    effects: tuple[Named, ...] = ()  #: In the order of the answer
    where: tuple[Pointed, ...] = ()
    #: Response → root mean square error of the improved model on held-out rows [its unit]
    heldout_after: Mapping[str, float] = field(default_factory=dict)
    #: Response → what wrong effects of the same size closed of the gap, with its interval
    placebo: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    error: str = ""  #: What was raised, with the place in the program; empty if nothing was


def stated(answer: Mapping[str, Any]) -> Stated:
    """The scored part of an answer in the JSON form of ``selector.diagnosis/1``."""
    fits: Mapping[str, Any] = answer.get("fit") or {}
    after = {name: _finite(fit["heldout"]["rmse_after"]) for name, fit in fits.items() if fit.get("heldout")}
    placebo = {name: _interval(fit["placebo_gain"]) for name, fit in fits.items() if fit.get("placebo_gain")}
    return Stated(
        verdict=str(answer["verdict"]),
        effects=tuple(
            Named(
                id=str(one["id"]),
                channel=str(one["channel"]),
                cannot_be_told_from=tuple(one.get("cannot_be_told_from") or ()),
                confidence=_finite(one.get("confidence")),
                suspected=bool(one.get("suspected", False)),
            )
            for one in answer.get("effects") or ()
        ),
        where=tuple(
            Pointed(
                channel=str(one["channel"]),
                run=one.get("run"),
                from_s=_finite(one.get("from_s")),
                to_s=_finite(one.get("to_s")),
                share=_finite(one.get("share")) or 0.0,
            )
            for one in answer.get("where") or ()
        ),
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


def _interval(quantity: Mapping[str, Any]) -> tuple[float, float, float] | None:
    value, low, high = (_finite(quantity.get(key)) for key in ("value", "low", "high"))
    return None if value is None or low is None or high is None else (value, low, high)


def _finite(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


Credit = Literal["exact", "first", "set", "missed"]
SMALLEST_GAP = 0.01
"""Of the recalibrated error: gaps below this are not scored, nothing is left there to be closed."""


@dataclass(frozen=True)
class Judged:
    """One answer, judged."""

    verdict_right: bool
    #: Of every true effect of the catalogue: its id alone, its id with others that it is not told from, another id with
    #: it in the set, or neither
    credits: tuple[Credit, ...] = ()
    false_names: tuple[str, ...] = ()  #: Named, and neither right nor tolerated
    #: Outside the catalogue: said to be unexplained, without a false name; None of other cases
    unexplained_right: bool | None = None
    #: Whether effects found, or the place pointed at first, are in a channel in which they show; None: nothing stated
    channel_right: bool | None = None
    #: Intersection over union of the windows pointed at and the true ones; None where the truth has no windows
    window_iou: float | None = None
    #: Share of the held-out gap from the recalibrated to the oracle's error; None where there is none
    gap_closed: float | None = None
    placebo: tuple[tuple[float, float, float], ...] = ()
    confidences: tuple[tuple[float, bool], ...] = ()  #: Of every named effect that is not merely tolerated


def judged(answer: Stated, truth: Truth, spans: Mapping[str, tuple[float, float]]) -> Judged:
    """The answer to a case against its truth; `spans` has the first and last time of every run [s]."""
    inside = tuple(effect for effect in truth.effects if not is_hidden(effect))
    outside = tuple(effect for effect in truth.effects if is_hidden(effect))
    accepted = {one for effect in truth.effects for one in effect.accept}
    right = [bool(accepted & set(named.ids)) for named in answer.effects]
    wrong = tuple(
        named.id
        for named, is_right in zip(answer.effects, right, strict=True)
        if not is_right and named.id not in truth.tolerated
    )
    verdict_right = answer.verdict in truth.verdicts
    return Judged(
        verdict_right=verdict_right,
        credits=tuple(_credit(effect, answer.effects) for effect in inside),
        false_names=wrong,
        unexplained_right=verdict_right and not wrong if outside and not inside else None,
        channel_right=_channel_right(answer, truth.effects),
        window_iou=_window_iou(answer, truth.effects, spans),
        gap_closed=_gap_closed(answer, truth),
        placebo=tuple(answer.placebo.values()),
        confidences=tuple(
            (named.confidence, is_right)
            for named, is_right in zip(answer.effects, right, strict=True)
            if named.confidence is not None and (is_right or named.id not in truth.tolerated)
        ),
    )


def is_hidden(effect: TrueEffect) -> bool:
    """Whether no id of the catalogue is right for this effect."""
    return all(accepted.startswith("hidden.") for accepted in effect.accept)


def overlap(stated: Sequence[Window], true: Sequence[Window]) -> float:
    """Length of the intersection over length of the union of two sets of windows, over all runs together."""
    both = either = 0.0
    for run in {window.run for window in (*stated, *true)}:
        ours = _joined(window for window in stated if window.run == run)
        theirs = _joined(window for window in true if window.run == run)
        shared = sum(max(0.0, min(b, d) - max(a, c)) for a, b in ours for c, d in theirs)
        both += shared
        either += sum(b - a for a, b in (*ours, *theirs)) - shared
    return both / either if either > 0 else 0.0


def _joined(windows: Iterable[Window]) -> list[tuple[float, float]]:
    joined: list[tuple[float, float]] = []
    for start, end in sorted((window.from_s, window.to_s) for window in windows if window.to_s > window.from_s):
        if joined and start <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(end, joined[-1][1]))
        else:
            joined.append((start, end))
    return joined


def _credit(effect: TrueEffect, named: Sequence[Named]) -> Credit:
    accepted = set(effect.accept)
    if any(one.id in accepted and set(one.ids) <= accepted for one in named):
        return "exact"
    if any(one.id in accepted for one in named):
        return "first"
    return "set" if any(accepted & set(one.ids) for one in named) else "missed"


def _channel_right(answer: Stated, effects: Sequence[TrueEffect]) -> bool | None:
    if not effects or answer.verdict == FAILED:
        return None
    checks = [
        one.channel in effect.channels
        for effect in effects
        for one in answer.effects
        if set(effect.accept) & set(one.ids)
    ]
    if checks:
        return all(checks)
    first = max(answer.where, key=lambda place: place.share, default=None)
    return None if first is None else any(first.channel in effect.channels for effect in effects)


def _window_iou(
    answer: Stated, effects: Sequence[TrueEffect], spans: Mapping[str, tuple[float, float]]
) -> float | None:
    """In the channel that has most of what was pointed at; 0 if nothing was pointed at."""
    if not any(effect.windows for effect in effects):
        return None
    best: tuple[float, float] | None = None
    for channel in dict.fromkeys(name for effect in effects for name in effect.channels):
        shown = [effect for effect in effects if channel in effect.channels]
        if not all(effect.windows for effect in shown):
            continue
        share = sum(place.share for place in answer.where if place.channel == channel)
        windows = windows_of(answer.where, (channel,), spans)
        iou = overlap(windows, [window for effect in shown for window in effect.windows])
        if windows and (best is None or share > best[0]):
            best = (share, iou)
    return 0.0 if best is None else best[1]


def _gap_closed(answer: Stated, truth: Truth) -> float | None:
    """Over the responses together, each in units of its recalibrated error."""
    gap = closed = 0.0
    for response, errors in truth.held_out.items():
        if errors.recalibrated - errors.oracle < SMALLEST_GAP * errors.recalibrated:
            continue
        after = answer.heldout_after.get(response, errors.recalibrated)
        gap += (errors.recalibrated - errors.oracle) / errors.recalibrated
        closed += (errors.recalibrated - after) / errors.recalibrated
    return closed / gap if gap > 0 else None
