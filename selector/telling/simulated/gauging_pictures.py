"""The drawings of simulated gauging: sizes, filters, parts in time, and the gauge."""

import math

import numpy as np

from selector.figures.simulated.gauging import (
    filter_trade_off,
    gauge_characteristic,
    part_in_time,
    size_histogram,
    sizes_over_parts,
)
from selector.number_text import number_text
from selector.physics.gauging.gauging_advice import BEST_CENTRED, PRESENT
from selector.physics.gauging.gauging_model import ALLOWANCE, GAUGE, MEASURED
from selector.physics.gauging.gauging_summary import GaugingSummary
from selector.physics.gauging.sizes import SizesByFormula
from selector.telling.account import Block, Drawing, Note
from selector.telling.numbers import ms_text, uncertain_text
from selector.telling.simulated.gauging import MATTERS
from selector.telling.simulated.result import SimulationResult
from selector.types import Vector

MOST_PARTS, MOST_RUNS = 1, 3  #: Parts that are drawn in time, as a whole and near the stop; recorded runs that are.
_BEFORE_S = 12.0  #: So many times T_Φ and delay before the stop, the end of a part is drawn once more, enlarged.
_SHARE_OF_PART = 0.5
_DENSITY_POINTS, _DENSITY_SIGMAS = 161, 4.0


def drawings(result: SimulationResult) -> dict[str, list[Block]]:
    """Section of the account → its drawings."""
    return {
        "sizes": _sizes(result),
        "filter": _filter(result.summary),
        "parts": _parts(result),
        "gauge": _gauge(result),
    }


def _sizes(result: SimulationResult) -> list[Block]:
    model, summary, ground = result.simulated.model, result.summary, result.simulated.details.sizes
    tolerance, wanted_um = model.values.tolerance, model.setup.wanted_um
    limits = None if tolerance is None else (tolerance.lower_um, tolerance.upper_um)
    curves = {"eq. 25": size_density(summary.formula)} if summary.formula.sd_um > 0 else {}
    sizes, formula = summary.sizes, summary.formula
    of_formula = uncertain_text(formula.mean_um + formula.curvature_um, formula.sd_um, least=0)
    title = f"Simulated: mean size {uncertain_text(sizes.mean_um, sizes.sd_um, least=0)} µm (standard deviation); "
    histogram = size_histogram(sizes.finished_um, curves, limits, wanted_um, f"{title}by formula {of_formula} µm")
    drawn: list[Block] = [Drawing(histogram, _HISTOGRAM)]
    if ground is not None and len(ground.size_um) > 1:
        grinding = model.values.grinding
        every = grinding.dress_every if grinding.wheel_wear > 0 else 0
        dressed = range(every + 1, len(ground.size_um) + 1, every) if every > 0 else ()
        low, high = number_text(float(ground.size_um.min())), number_text(float(ground.size_um.max()))
        title = f"Simulated: {len(ground.size_um)} parts of {low} to {high} µm"
        chart = sizes_over_parts(ground.size_um, limits, wanted_um, dressed, title)
        drawn.append(Drawing(chart, _CHART_DRESSED if dressed else _CHART))
    return drawn


def _parts(result: SimulationResult) -> list[Block]:
    """The first part, whole and near its stop; of recorded runs the first ones."""
    done, summary, parts = result.simulated.details, result.summary, _in_time(result)
    thresholds = [(stage.until_um, stage.threshold_v) for stage in summary.stages]
    shown = dict(list(parts.items())[: MOST_PARTS if done.sizes is not None else MOST_RUNS])
    drawn: list[Block] = []
    for run, (courses, ends_s, is_finished) in shown.items():
        name = run if len(parts) > 1 else ""
        whole = part_in_time(*courses, thresholds, ends_s, is_finished=is_finished, name=name)
        drawn.append(Drawing(whole, _PART))
        if is_finished and ends_s:
            from_s = ends_s[-1] - _BEFORE_S * summary.gauge.time_constant_s
            if from_s > _SHARE_OF_PART * ends_s[-1]:
                near = part_in_time(*courses, thresholds, ends_s, from_s=from_s, name=name)
                drawn.append(Drawing(near, _NEAR))
    more = len(done.recording.runs) - (done.waveform is not None) - len(shown)
    return [*drawn, Note(f"{more} more parts were recorded; they are in their files.")] if drawn and more else drawn


def _gauge(result: SimulationResult) -> list[Block]:
    summary, curve = result.summary, result.summary.characteristic
    if curve is None:
        return []
    thresholds = [(stage.until_um, stage.threshold_v) for stage in summary.stages]
    picture = gauge_characteristic(
        curve.allowance_um, curve.voltage_v, summary.gauge, summary.linear_range_um, thresholds
    )
    return [Drawing(picture, _CURVE)]


_InTime = tuple[tuple[Vector, Vector, Vector, Vector, Vector | None], tuple[float, ...], bool]


def _in_time(result: SimulationResult) -> dict[str, _InTime]:
    """Parts that were ground, or recorded runs as the gauge would have seen them.

    Run → time [s], allowance, measured allowance [µm], voltage [V], feed [µm/s] if known; when stages ended [s];
    whether the gauge stopped it, so that its last allowance is a size.
    """
    model, done = result.simulated.model, result.simulated.details
    if done.courses:
        return {
            name: (
                (one.time_s, one.allowance_um, model.measured_um(one.voltage_v), one.voltage_v, one.feed_um_per_s),
                one.stage_end_s,
                one.tripped,
            )
            for name, one in done.courses.items()
        }
    recording = done.recording
    # channels stand in the order of `gauging_driving`
    sizes, voltages = recording.with_role(ALLOWANCE.role), recording.with_role(GAUGE.role)
    assert MEASURED.role == ALLOWANCE.role
    found: dict[str, _InTime] = {}
    for run in recording.runs[:MOST_RUNS]:
        time_s = recording.time_s(run)
        allowance, measured, voltage = recording.values(run, [*sizes[:2], *voltages[:1]]).T
        found[run] = (time_s - time_s[0], allowance, measured, voltage, None), (), False
    return found


def _filter(summary: GaugingSummary) -> list[Block]:
    if not summary.filters:
        return []
    by_name = {one.name: one for one in summary.settings}
    present = by_name[PRESENT]
    best = by_name.get(BEST_CENTRED, present)
    title = f"Simulated: {number_text(present.rms_um)} µm (rms) with the filter of {ms_text(present.time_constant_s)}"
    if best.rms_um > MATTERS * present.rms_um:
        title += "; the best one would make little difference"
    else:
        title += f", {number_text(best.rms_um)} µm with {ms_text(best.time_constant_s)} and centred thresholds"
    return [Drawing(filter_trade_off(summary.filters, best, present, title), _FILTER)]


def size_density(one: SizesByFormula) -> tuple[Vector, Vector]:
    """Sizes and the density there, normal about the mean with its curvature [µm], [1/µm]."""
    at = np.linspace(-_DENSITY_SIGMAS, _DENSITY_SIGMAS, _DENSITY_POINTS)
    density = np.exp(-0.5 * at**2) / (math.sqrt(2.0 * math.pi) * one.sd_um)
    return one.mean_um + one.curvature_um + one.sd_um * at, density


_HISTOGRAM = (
    "Bars: parts of the Monte Carlo calculation that the gauge has stopped. Line: eq. 25, which lets the reading pass "
    "its threshold once."
)
_CHART = "In the order of grinding."
_CHART_DRESSED = "In the order of grinding. Dotted: the wheel is dressed."
_FILTER = (
    "Simulated: error of the size against the wanted one, with thresholds calculated for each filter (eq. 23); the "
    "present one with the threshold that it has, the best one with centred ones. A longer filter quiets the noise, but "
    "makes the gauge late, and how much that is in size depends on the feed of the part."
)
_PART = (
    "Allowance counts from the nominal size; where the feed stands it is the size of the part. Dotted: thresholds of "
    "the relay, and when the stages ended. Long courses are drawn with the lowest and highest sample of each of 300 "
    "stretches."
)
_NEAR = "The gauge reads more than is there: it is late by the filter. The threshold is set ahead by that much."
_CURVE = (
    "Grinding goes from right to left. Shaded: where the line holds. Points: where the voltage of a stage's threshold "
    "lies, ahead of the allowance that is wanted by what the filter is late. Below: what the line reads less what is "
    "there."
)
