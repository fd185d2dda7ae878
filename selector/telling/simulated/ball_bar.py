"""What is told of a circular test, simulated or measured: how round it is at every feed, which causes are behind it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from selector.findings import Finding
from selector.json_text import fields_of
from selector.number_text import number_text
from selector.physics.drive.ball_bar.causes import Amount, Cause, CircleCauses, Compensations, FeedCauses
from selector.physics.drive.ball_bar.circle import BallBarTrace, CircleQuantities, Extreme, Roundness, paired
from selector.physics.drive.drive_summary import DriveSummary
from selector.telling.account import Account, Captioned, Drawing, Table, legend, remarks_of, section, sections, table
from selector.telling.numbers import NONE, uncertain_text

_MICRO = 1e6
_BACKLASH = "backlash"
_MEANING = "lost motion at the reversal: backlash, or wind-up by friction"

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


def ball_bar_sentences(shown: DriveSummary) -> list[str]:
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
    return told


def cause_name(cause: Cause) -> str:
    """A cause in words, with its axis."""
    return WORDS[cause.kind] + (f" of {cause.axis}" if cause.axis else "")


def ball_bar_tables(shown: DriveSummary) -> list[Captioned]:
    """Quantities, causes at every feed, and what all feeds share."""
    told = [Captioned("Quantities after ISO 230-4", quantities_table(shown.quantities))]
    if shown.causes is not None:
        told += [
            Captioned(f"Causes at {_feed(feed.feed_mm_per_min)} mm/min", _causes_table(feed, shown.wind_up_m))
            for feed in reversed(shown.causes.feeds)
        ]
        told.append(Captioned("Through all feeds", _overall_table(shown.causes)))
    return told


def quantities_table(quantities: Sequence[CircleQuantities]) -> Table:
    """The quantities of ISO 230-4 at every feed [µm]."""
    rows: list[tuple[str | float, ...]] = [
        (
            _feed(one.feed_mm_per_min),
            *(path.circular_deviation_um for path in (one.counter_clockwise, one.clockwise, one.both)),
            *map(_at, (one.hysteresis, one.both.radial_max, one.both.radial_min)),
            one.both.mean_radial_um,
        )
        for one in quantities
    ]
    return table(
        [">mm/min", ">G ccw", ">G cw", ">G(b)", ">H", ">F max", ">F min", ">D"], rows, legend("ball-bar.quantities")
    )


def _at(extreme: Extreme) -> str:
    return f"{number_text(extreme.value_um)} ({math.degrees(extreme.angle_rad) % 360:.0f}°)"


def _causes_table(feed: FeedCauses, wind_up_m: Mapping[str, float] | None) -> Table:
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
    return table(["cause", "size", ">range [µm]", ">share"], rows, legend("ball-bar.causes"))


def _of_it(cause: Cause, wind_up_m: Mapping[str, float] | None) -> list[str]:
    """How much of a lost motion is wind-up, which the model knows and a real test does not."""
    size = (wind_up_m or {}).get(cause.axis or "", 0.0) if cause.kind == "backlash" else 0.0
    return [f"of it wind-up by the model's friction {number_text(1e6 * size)} µm"] if size > 0 else []


def _overall_table(causes: CircleCauses) -> Table:
    rows = [
        (name, amount_text(one) if one.found else f"not found (below {number_text(one.below, 2)} {one.unit})")
        for name, one in causes.through_feeds.items()
    ]
    return table(["", ">value"], rows, legend("ball-bar.shared"))


def amount_text(amount: Amount) -> str:
    """A number ± its standard error with its unit."""
    return f"{uncertain_text(amount.value, amount.standard_error)} {amount.unit.removesuffix(NONE)}".rstrip()


def _feed(feed_mm_per_min: float) -> str:
    # as it is programmed: 100, not 100.0
    return f"{feed_mm_per_min:.6g}"


def _percent(share: float) -> str:
    # rounded first, so that there is no −0
    return f"{round(100 * share):d} %".replace("-", "−")


def ball_bar_data(summary: DriveSummary) -> dict[str, Any] | None:
    """`ball_bar` of the JSON; None if the axes did not go in circles."""
    if not summary.quantities:
        return None
    return {
        "quantities": [_quantities_data(one) for one in summary.quantities],
        "causes": None if summary.causes is None else _causes_data(summary.causes, summary.wind_up_m),
    }


def _quantities_data(one: CircleQuantities) -> dict[str, Any]:
    ways = ("counter_clockwise", "clockwise", "both")
    return {
        "feed_mm_per_min": one.feed_mm_per_min,
        **{way: _roundness_data(getattr(one, way)) for way in ways},
        "hysteresis": _extreme_data(one.hysteresis),
    }


def _roundness_data(one: Roundness) -> dict[str, Any]:
    return {
        "circular_deviation_um": one.circular_deviation_um,
        "radial_max": _extreme_data(one.radial_max),
        "radial_min": _extreme_data(one.radial_min),
        **fields_of(one, "mean_radial_um", "centre_um"),
    }


def _extreme_data(one: Extreme) -> dict[str, float]:
    return {"um": one.value_um, "at_deg": math.degrees(one.angle_rad) % 360.0}


def _causes_data(causes: CircleCauses, wind_up_m: Mapping[str, float] | None) -> dict[str, Any]:
    return {
        "feeds": [
            {
                **fields_of(feed, "feed_mm_per_min", "remaining_rms_um", "remaining_share"),
                "causes": [
                    {
                        "cause": cause.kind,
                        "axis": cause.axis,
                        **_lost_motion_data(cause, wind_up_m),
                        **fields_of(cause, "found", "range_um", "share"),
                        "amounts": {name: dict(vars(one)) for name, one in cause.amounts.items()},
                    }
                    for cause in feed.causes
                ],
            }
            for feed in causes.feeds
        ],
        "through_feeds": {
            name: {**vars(one), "below": None if one.found else one.below} for name, one in causes.through_feeds.items()
        },
    }


def _lost_motion_data(cause: Cause, wind_up_m: Mapping[str, float] | None) -> dict[str, Any]:
    """What a backlash may be as well, and how much of it the model's own friction and springs make."""
    if cause.kind != _BACKLASH:
        return {}
    told: dict[str, Any] = {"meaning": _MEANING}
    return told if wind_up_m is None else told | {"wind_up_um": _MICRO * wind_up_m.get(cause.axis or "", 0.0)}


def compensation_table(needed: Compensations) -> Captioned:
    """What the control needs to take the causes away."""
    rows: list[tuple[str | float | None, ...]] = [
        (f"backlash of {axis}", amount_text(amount), None, "every reversal") for axis, amount in needed.backlash.items()
    ]
    if needed.delay is not None:
        ahead, amount = needed.delay
        rows.append((f"delay of {ahead}, ahead", amount_text(amount), None, "always"))
    for one in needed.pulses:
        where = f"{_feed(one.feed_mm_per_min)} mm/min, {number_text(one.acceleration_m_per_s2)} m/s²"
        size = None if one.amplitude is None else amount_text(one.amplitude)
        rows.append((f"speed pulse of {one.axis}", size, amount_text(one.height_um), where))
    return Captioned(
        "For the compensations of the control",
        table(["compensation", ">value", ">of spike", "where"], rows, legend("ball-bar.compensations")),
    )


def _compensation_data(needed: Compensations) -> dict[str, Any]:
    return {
        "backlash": {axis: dict(vars(one)) for axis, one in needed.backlash.items()},
        "delay": None if needed.delay is None else {"axis": needed.delay[0], **vars(needed.delay[1])},
        "pulses": [asdict(one) for one in needed.pulses],
    }


def measured_circles_account(
    summary: DriveSummary,
    needed: Compensations,
    read: Sequence[tuple[BallBarTrace, str, Sequence[str], bool]],
    findings: Sequence[Finding],
    *,
    drawn: bool = False,
) -> Account:
    """All that is told of measured circles, and what is `needed` of the control.

    `read`: each circle with its file, its columns, and whether it was turned round.

    The summary of measured circles has neither axes nor loops, and no wind-up. A page is `drawn`.
    """
    traces = [trace for trace, *_ in read]
    radius_mm = 1e3 * traces[0].radius_m
    rows = [
        (
            file,
            ", ".join(columns),
            "counter-clockwise" if one.direction > 0 else "clockwise",
            _feed(one.feed_mm_per_min),
            str(len(one.angle_rad)),
            "turned round: it stood sorted by angle" if is_turned else "as read",
        )
        for one, file, columns, is_turned in read
    ]
    quantities, *of_feeds, overall = ball_bar_tables(summary)
    pictures: list[Drawing] = []
    if drawn:
        from selector.figures.simulated.drive import ball_bar_figure

        pictures = [Drawing(ball_bar_figure(pair), legend("ball-bar.polar")) for pair in reversed(paired(traces))]
    columns = ["file", "columns", "direction", ">mm/min", ">samples", "order"]
    return Account(
        title=f"Ball-bar: {' and '.join(traces[0].axes)}, radius {number_text(radius_mm)} mm",
        sentences=tuple(ball_bar_sentences(summary)),
        front=tuple(pictures[:1]),
        sections=sections(
            section("round", "How round, and why", quantities, overall, *pictures[1:]),
            section("control", "", compensation_table(needed), link="Compensations") if needed.any else None,
            section("causes", "Causes at each feed", *of_feeds),
            section("findings", "All findings", remarks_of(findings)) if findings else None,
            section("read", "What was read", Captioned("Circles", table(columns, rows), on_screen=False)),
        ),
        brief=("round", "control"),
        data={
            "schema": "selector.ballbar/1",
            "radius_mm": radius_mm,
            "axes": list(traces[0].axes),
            "circles": [
                {
                    "file": file,
                    "columns": list(columns),
                    "direction": "ccw" if one.direction > 0 else "cw",
                    "feed_mm_per_min": one.feed_mm_per_min,
                    "samples": len(one.angle_rad),
                    "turned_round": is_turned,
                }
                for one, file, columns, is_turned in read
            ],
            **(ball_bar_data(summary) or {}),
            "compensation": _compensation_data(needed),
            "findings": [one.as_dict() for one in findings],
        },
    )
