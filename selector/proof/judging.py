"""Is one answer right? Names, sets, windows, channels and gains of one case against its sealed truth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from selector.proof.case import TrueEffect, Truth, Window
from selector.proof.stated import FAILED, Named, Stated, windows_of

Credit = Literal["exact", "first", "set", "missed"]
SMALLEST_GAP = 0.01
"""Of the recalibrated error: gaps below this are not scored, nothing is left there to be closed."""


@dataclass(frozen=True)
class Judged:
    """One answer, judged.

    Attributes
    ----------
    verdict_right : bool
    credits : tuple of {"exact", "first", "set", "missed"}
        Of every true effect of the catalogue: its id alone, its id with others that it is not told from, another id
        with it in the set, or neither.
    false_names : tuple of str
        Named, and neither right nor tolerated.
    unexplained_right : bool or None
        Outside the catalogue: said to be unexplained, without a false name; None of other cases.
    channel_right : bool or None
        Whether effects found, or the place pointed at first, are in a channel in which they show; None: nothing stated.
    window_iou : float or None
        Intersection over union of the windows pointed at and the true ones; None where the truth has no windows.
    gap_closed : float or None
        Share of the held-out gap from the recalibrated to the oracle's error; None where there is none.
    placebo : tuple of (value, low, high)
    confidences : tuple of (confidence, right)
        Of every named effect that is not merely tolerated.
    """

    verdict_right: bool
    credits: tuple[Credit, ...] = ()
    false_names: tuple[str, ...] = ()
    unexplained_right: bool | None = None
    channel_right: bool | None = None
    window_iou: float | None = None
    gap_closed: float | None = None
    placebo: tuple[tuple[float, float, float], ...] = ()
    confidences: tuple[tuple[float, bool], ...] = ()


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
