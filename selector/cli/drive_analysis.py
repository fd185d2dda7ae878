"""How are the numbers of a simulated feed drive told: the `drive` object of the JSON, and tables on the screen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from selector.cli import showing

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.drive.axis_summary import AxisSummary, LoopSummary
    from selector.physics.drive.circle_causes import Cause, CircleCauses
    from selector.physics.drive.circle_laws import Amount
    from selector.physics.drive.circle_quantities import CircleQuantities, Extreme, Roundness
    from selector.physics.drive.drive_model import DriveModel
    from selector.physics.drive.drive_summary import DriveSummary

_MICRO = 1e6
_MOST_ROWS = 12
_GOES_WITH = {
    "speed": "speed",
    "acceleration": "acceleration",
    "direction": "direction of travel",
    "constant": "nothing, always there",
    "rest": "none of these",
    "speed+direction": "motion (lag or friction)",
    "direction+constant": "friction or an offset",
    "speed+direction+constant": "motion (lag, friction, offset)",
}

_BACKLASH = "backlash"
_MEANING = "lost motion at the reversal: backlash, or wind-up by friction"
_BACKLASH_ON_SCREEN = "backlash or wind-up"


def drive_object(model: DriveModel, summary: DriveSummary) -> dict[str, Any]:
    """`drive` of `selector.simulation/1`."""
    names = list(dict.fromkeys(name for axes in summary.axes.values() for name in axes))
    return {
        "axes": [
            {
                "axis": name,
                "unit": _unit(model, name),
                "runs": [
                    {"run": run, **_axis_in_run(axes[name])} for run, axes in summary.axes.items() if name in axes
                ],
                "loop": _loop(summary.loops.get(name)),
            }
            for name in names
        ],
        "ball_bar": _ball_bar(summary) if summary.quantities else None,
    }


def show_analysis(console: Console, model: DriveModel, summary: DriveSummary) -> None:
    """Errors, loops and roundness as tables."""
    told = [(run, name, one) for run, axes in summary.axes.items() for name, one in axes.items()]
    title = "Tracking error"
    if len(told) > _MOST_ROWS:
        title = "Tracking error, worst run of each axis"
        worst: dict[str, tuple[str, str, AxisSummary]] = {}
        for row in told:
            if row[1] not in worst or row[2].max_m > worst[row[1]][2].max_m:
                worst[row[1]] = row
        told = list(worst.values())
    rows = [
        (
            run,
            name,
            one.max_m * _MICRO,
            one.rms_m * _MICRO,
            {"um": "µm", "urad": "µrad"}[_unit(model, name)],
            f"{_GOES_WITH[one.parts.largest]} ({_percent(one.parts.share(one.parts.largest))})",
            _percent(one.limited_share) if one.limited_share else None,
        )
        for run, name, one in told
    ]
    columns = ["run", "axis", "largest", "rms", "unit", "goes with", "at limits"]
    console.print(showing.table(title, columns, rows, numeric=["largest", "rms"]))
    if summary.loops:
        loops = [
            (
                name,
                "yes" if loop.stability.stable else "NO",
                loop.figures.bandwidth_hz,
                _finite(loop.figures.gain_margin_db),
                _finite(loop.figures.phase_margin_deg),
                loop.stability.gain_limits.get("position_gain_per_s"),
            )
            for name, loop in summary.loops.items()
        ]
        columns = ["axis", "stable", "bandwidth, Hz", "gain margin, dB", "phase margin, °", "Kp limit, times"]
        console.print(showing.table("Control loop", columns, loops, numeric=columns[2:]))
    if summary.quantities:
        circles = [
            (
                one.feed_mm_per_min,
                one.counter_clockwise.circular_deviation_um,
                one.clockwise.circular_deviation_um,
                one.both.circular_deviation_um,
                one.hysteresis.value_um,
                one.both.radial_max.value_um,
                one.both.radial_min.value_um,
                one.both.mean_radial_um,
            )
            for one in summary.quantities
        ]
        columns = ["mm/min", "G ccw", "G cw", "G(b)", "H", "F max", "F min", "D"]
        console.print(showing.table("Ball-bar, ISO 230-4, µm", columns, circles, numeric=columns))
    if summary.causes is not None:
        causes = [
            (feed.feed_mm_per_min, _cause_name(cause), cause.axis, cause.range_um, f"{round(100 * cause.share)} %")
            for feed in summary.causes.feeds
            for cause in feed.causes
            if cause.found
        ]
        columns = ["mm/min", "cause", "axis", "range, µm", "share"]
        against = any(cause.found and cause.share < 0 for feed in summary.causes.feeds for cause in feed.causes)
        title = "Causes; one with a negative share works against the others" if against else "Causes"
        console.print(showing.table(title, columns, causes, numeric=["mm/min", "range, µm", "share"]))
        if any(summary.wind_up_m.values()):
            sizes = ", ".join(f"{name} {_MICRO * size:.3g} µm" for name, size in summary.wind_up_m.items())
            console.print(f"Wind-up by the model's own friction, in what looks like backlash: {sizes}")


def _unit(model: DriveModel, name: str) -> str:
    return "urad" if model.file_axes[name].rotary else "um"


def _axis_in_run(one: AxisSummary) -> dict[str, Any]:
    return {
        "rms": one.rms_m * _MICRO,
        "max": one.max_m * _MICRO,
        "max_at_s": one.max_at_s,
        "parts_rms": {name: rms * _MICRO for name, rms in one.parts.rms_m.items()},
        "lag_ms": None if one.parts.lag_s is None else one.parts.lag_s * 1e3,
        "limited_share": one.limited_share,
        "stick_slip": None
        if one.stick_slip is None
        else {"creeping_share": one.stick_slip.creeping_share, "jumps": one.stick_slip.jumps},
        "stiffness_n_per_um": None if one.stiffness_n_per_m is None else [s * 1e-6 for s in one.stiffness_n_per_m],
        "damping_ns_per_m": list(one.damping_ns_per_m),
    }


def _loop(loop: LoopSummary | None) -> dict[str, Any] | None:
    if loop is None:
        return None
    found, figures = loop.stability, loop.figures
    return {
        "stable": found.stable,
        "margin_per_s": found.margin_per_s,
        "poles_per_s": [[pole.real, pole.imag] for pole in found.poles.tolist()],
        "gain_limits": dict(found.gain_limits),
        "gain_floors": dict(found.gain_floors),
        "bandwidth_hz": figures.bandwidth_hz,
        "peak": figures.peak,
        "peak_hz": figures.peak_hz,
        "gain_margin_db": figures.gain_margin_db,
        "phase_margin_deg": figures.phase_margin_deg,
    }


def _ball_bar(summary: DriveSummary) -> dict[str, Any]:
    return {
        "quantities": [_quantities(one) for one in summary.quantities],
        "causes": None if summary.causes is None else _causes(summary.causes, summary.wind_up_m),
    }


def _quantities(one: CircleQuantities) -> dict[str, Any]:
    return {
        "feed_mm_per_min": one.feed_mm_per_min,
        "counter_clockwise": _roundness(one.counter_clockwise),
        "clockwise": _roundness(one.clockwise),
        "both": _roundness(one.both),
        "hysteresis": _extreme(one.hysteresis),
    }


def _roundness(one: Roundness) -> dict[str, Any]:
    return {
        "circular_deviation_um": one.circular_deviation_um,
        "radial_max": _extreme(one.radial_max),
        "radial_min": _extreme(one.radial_min),
        "mean_radial_um": one.mean_radial_um,
        "centre_um": list(one.centre_um),
    }


def _extreme(one: Extreme) -> dict[str, float]:
    return {"um": one.value_um, "at_deg": math.degrees(one.angle_rad) % 360.0}


def _causes(causes: CircleCauses, wind_up_m: Mapping[str, float]) -> dict[str, Any]:
    return {
        "feeds": [
            {
                "feed_mm_per_min": feed.feed_mm_per_min,
                "remaining_rms_um": feed.remaining_rms_um,
                "remaining_share": feed.remaining_share,
                "causes": [
                    {
                        "cause": cause.kind,
                        "axis": cause.axis,
                        **_lost_motion(cause, wind_up_m),
                        "found": cause.found,
                        "range_um": cause.range_um,
                        "share": cause.share,
                        "amounts": {name: _amount(one) for name, one in cause.amounts.items()},
                    }
                    for cause in feed.causes
                ],
            }
            for feed in causes.feeds
        ],
        "through_feeds": {
            name: {**_amount(one), "found": one.found, "below": None if one.found else one.below}
            for name, one in causes.through_feeds.items()
        },
    }


def _cause_name(cause: Cause) -> str:
    return _BACKLASH_ON_SCREEN if cause.kind == _BACKLASH else cause.kind


def _lost_motion(cause: Cause, wind_up_m: Mapping[str, float]) -> dict[str, Any]:
    """What a backlash may be as well, and how much of it the model's own friction and springs make."""
    if cause.kind != _BACKLASH:
        return {}
    return {"meaning": _MEANING, "wind_up_um": _MICRO * wind_up_m.get(cause.axis or "", 0.0)}


def _amount(one: Amount) -> dict[str, Any]:
    return {"value": one.value, "standard_error": one.standard_error, "unit": one.unit}


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.095 or share == 0 else f"{100 * share:.2g} %"


def _finite(value: float) -> float | str:
    return value if math.isfinite(value) else "no limit" if value > 0 else "–"
