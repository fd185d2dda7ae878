"""What the report says of a circular test: how round it is at every feed, and which causes are behind it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from selector.figures.ball_bar import ball_bar_figure
from selector.physics.drive.ball_bar import BallBarTrace
from selector.physics.drive.circle_causes import Cause, CircleCauses, FeedCauses
from selector.physics.drive.circle_laws import Amount
from selector.physics.drive.circle_quantities import CircleQuantities, Extreme, paired
from selector.report.numbers import NONE, number_text, uncertain_text
from selector.report.page import Pictures
from selector.report.tables import Table, table

WORDS = {
    "radius": "radius",
    "gain-mismatch": "position gains that differ",
    "rotary-lag": "lag against the linear axes",
    "squareness": "squareness",
    "scale-mismatch": "scales that differ",
    "straightness": "straightness",
    "backlash": "lost motion (backlash or wind-up)",
    "reversal-spike": "reversal spikes",
    "cyclic-pitch": "cyclic error of the pitch",
}


@dataclass(frozen=True)
class BallBarOnPage:
    """A circular test: its traces, their quantities, and their causes.

    `wind_up_m` says how much of the lost motion of an axis its own friction and springs make [m].
    """

    traces: tuple[BallBarTrace, ...]
    quantities: tuple[CircleQuantities, ...]
    causes: CircleCauses | None = None
    wind_up_m: Mapping[str, float] = field(default_factory=dict)


def ball_bar_sentences(shown: BallBarOnPage) -> list[str]:
    """How round the circle is at the fastest and the slowest feed, and the largest causes."""
    slowest, fastest = shown.quantities[0], shown.quantities[-1]
    first = (
        f"At {_feed(fastest.feed_mm_per_min)} mm/min the circle is out of round by "
        f"{number_text(fastest.both.circular_deviation_um)} µm, both directions together (ISO 230-4)"
    )
    if len(shown.quantities) > 1:
        first += f"; at {_feed(slowest.feed_mm_per_min)} mm/min by {number_text(slowest.both.circular_deviation_um)} µm"
    told = [f"{first}."]
    if shown.causes is not None:
        for feed in dict.fromkeys((shown.causes.feeds[-1], shown.causes.feeds[0])):
            found = [cause for cause in feed.causes if cause.found and cause.kind != "radius"][:3]
            if found:
                words = "; ".join(f"{cause_name(cause)} {number_text(cause.range_um)} µm" for cause in found)
                told.append(f"Causes at {_feed(feed.feed_mm_per_min)} mm/min, largest first: {words}.")
    far = max(shown.quantities, key=lambda one: abs(one.both.mean_radial_um))
    told.append(
        f"At {_feed(far.feed_mm_per_min)} mm/min the mean radius is "
        f"{number_text(abs(far.both.mean_radial_um))} µm "
        f"{'larger' if far.both.mean_radial_um > 0 else 'smaller'} than nominal."
    )
    return told


def cause_name(cause: Cause) -> str:
    """A cause in words, with its axis."""
    return WORDS[cause.kind] + (f" of {cause.axis}" if cause.axis else "")


def ball_bar_part(pictures: Pictures, shown: BallBarOnPage) -> dict[str, Any]:
    """Pictures and tables of the test."""
    drawn = [pictures.add(ball_bar_figure(pair), _POLAR) for pair in reversed(paired(shown.traces))]
    causes: list[tuple[str, Table]] = []
    if shown.causes is not None:
        causes += [
            (f"Causes at {_feed(feed.feed_mm_per_min)} mm/min", _causes_table(feed, shown.wind_up_m))
            for feed in reversed(shown.causes.feeds)
        ]
        causes.append(("Through all feeds", _overall_table(shown.causes)))
    return {"pictures": drawn, "quantities": quantities_table(shown.quantities), "causes": causes}


def quantities_table(quantities: Sequence[CircleQuantities]) -> Table:
    """The quantities of ISO 230-4 at every feed [µm]."""
    rows = [
        (
            _feed(one.feed_mm_per_min),
            number_text(one.counter_clockwise.circular_deviation_um),
            number_text(one.clockwise.circular_deviation_um),
            number_text(one.both.circular_deviation_um),
            _at(one.hysteresis),
            _at(one.both.radial_max),
            _at(one.both.radial_min),
            number_text(one.both.mean_radial_um),
        )
        for one in quantities
    ]
    note = (
        "G: circular deviation counter-clockwise and clockwise, G(b): both together, narrowest ring; H: hysteresis; "
        "F: farthest from the nominal radius, about the least-squares centre; D: mean radius minus nominal; all in µm, "
        "in brackets where."
    )
    return table([">mm/min", ">G ccw", ">G cw", ">G(b)", ">H", ">F max", ">F min", ">D"], rows, note)


def _at(extreme: Extreme) -> str:
    return f"{number_text(extreme.value_um)} ({math.degrees(extreme.angle_rad) % 360:.0f}°)"


def _causes_table(feed: FeedCauses, wind_up_m: Mapping[str, float]) -> Table:
    rows = [
        (
            cause_name(cause),
            "; ".join([f"{name} {amount_text(one)}" for name, one in cause.amounts.items()] + _of_it(cause, wind_up_m)),
            number_text(cause.range_um),
            _percent(cause.share),
        )
        for cause in feed.causes
        if cause.found
    ]
    rows.append(("what remains", "", f"{number_text(feed.remaining_rms_um)} rms", _percent(feed.remaining_share)))
    note = (
        "± one standard error, from what remains. Causes that do not stand out of it are left out. Shares are of the "
        "sum of squares of the deviation and make 100 % with what remains; one is negative where a cause works against "
        "the others, so that the circle is rounder with it."
    )
    return table(["cause", "size", ">range [µm]", ">share"], rows, note)


def _of_it(cause: Cause, wind_up_m: Mapping[str, float]) -> list[str]:
    """How much of a lost motion is wind-up, which the model knows and a real test does not."""
    size = wind_up_m.get(cause.axis or "", 0.0) if cause.kind == "backlash" else 0.0
    return [f"of it wind-up by the model's friction {number_text(1e6 * size)} µm"] if size > 0 else []


def _overall_table(causes: CircleCauses) -> Table:
    rows = [
        (name, amount_text(one) if one.found else f"not found (below {number_text(one.below, 2)} {one.unit})")
        for name, one in causes.through_feeds.items()
    ]
    note = (
        "Constants of geometry and control that all feeds share. The gain by the radius is that of a first-order loop: "
        "a slow velocity loop makes the circle shrink less, feed-forward more than the lag lets expect."
    )
    return table(["", ">value"], rows, note)


def amount_text(amount: Amount) -> str:
    """A number ± its standard error with its unit."""
    return f"{uncertain_text(amount.value, amount.standard_error)} {amount.unit.removesuffix(NONE)}".rstrip()


def _feed(feed_mm_per_min: float) -> str:
    # as it is programmed: 100, not 100.0
    return f"{feed_mm_per_min:.6g}"


def _percent(share: float) -> str:
    # rounded first, so that there is no −0
    return f"{round(100 * share):d} %".replace("-", "−")


_POLAR = "Distance of the two balls against the nominal radius, both directions; the rings say how many µm."
