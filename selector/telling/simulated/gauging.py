"""What is told of simulated gauging: sizes, capability, filter and threshold, parts in time, the gauge."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from selector.json_text import fields_of
from selector.number_text import listed, number_text
from selector.physics.gauging.gauged_grinding import FinishedSizes
from selector.physics.gauging.gauging_model import ALLOWANCE, GAUGE, MEASURED, GaugingModel, GaugingSimulation
from selector.physics.gauging.gauging_summary import (
    BEST_CENTRED,
    CAPABLE,
    CENTRED,
    PRESENT,
    UNCORRECTED,
    GaugingSummary,
    Setting,
)
from selector.physics.gauging.sizes import CONFIDENCE, Capability, SizesByFormula
from selector.physics.gauging.transducer import Tolerance
from selector.telling.account import (
    Account,
    Block,
    Captioned,
    Drawing,
    Note,
    Table,
    Verdict,
    captioned,
    legend,
    section,
    table,
)
from selector.telling.numbers import NONE, ms_text, uncertain_text
from selector.telling.simulated.result import THINNED, SimulationResult, simulation_account
from selector.types import Vector

MATTERS = 0.9  #: An error that falls to less than this share of itself is worth a change.
_OFF_CENTRE = 0.05
_MOST_DECIMALS = 6
_ROUNDING_UM = 1e-4
_SCRAP = 1.0  #: Cpk below which parts are scrap day by day.
MOST_PARTS, MOST_RUNS = 1, 3  #: Parts that are drawn in time; recorded runs that are.
_DENSITY_POINTS, _DENSITY_SIGMAS = 161, 4.0

SETTINGS = {
    PRESENT: "as it is",
    UNCORRECTED: "without correction by measured parts",
    CENTRED: "last threshold centred",
    BEST_CENTRED: "best filter, last threshold centred",
}


def gauging_account(result: SimulationResult, drawn: bool) -> Account:
    """What is told of simulated gauging: which sizes come out, what other filters would do, how it went."""
    model, done, summary = result.simulated.model, result.simulated.details, result.summary
    wanted_um, tolerance = model.setup.wanted_um, model.values.tolerance
    drawings = _drawings(result) if drawn else {}
    capable = summary.capability
    return simulation_account(
        result,
        list(size_sentences(summary, wanted_um, tolerance, is_ground=done.sizes is not None)),
        (
            section(
                "sizes",
                "Finished sizes",
                *drawings.get("sizes", ()),
                Captioned("Finished sizes", sizes_table(summary, wanted_um)),
                captioned("Capability", None if capable is None else capability_table(capable)),
            ),
            section(
                "filter",
                "Filter and threshold",
                *drawings.get("filter", ()),
                Captioned("Filter and last threshold", trade_off_table(summary)),
                link="Filter",
            ),
            section("parts", "Parts", *drawings.get("parts", ())),
            section("gauge", "Gauge", *drawings.get("gauge", ()), Captioned("Stages", stages_table(summary))),
        ),
        drawings=drawings,
        facts={
            "time between samples [s]": model.period_s,
            "parts of the Monte Carlo calculation": len(summary.sizes.size_um),
        },
        data=_data(model, done, summary),
        verdict=verdict(summary),
    )


def size_sentences(
    summary: GaugingSummary, wanted_um: float, tolerance: Tolerance | None, *, is_ground: bool = True
) -> Iterator[str]:
    """Mean, spread, capability and what would improve it, the most important first.

    `is_ground` is False of recorded runs: the sizes are then not theirs.
    """
    sizes = summary.sizes
    off = sizes.mean_um - wanted_um
    where = f"{number_text(abs(off), 2)} µm {'larger' if off >= 0 else 'smaller'} than wanted"
    who = "Finished parts" if is_ground else "Parts that are ground as the model file says"
    first = f"{who} are {where} on average and spread by {number_text(sizes.sd_um, 2)} µm (standard deviation)"
    capable = summary.capability
    if capable is not None:
        first += f": Cpk is {number_text(capable.cpk)}, and {_out_of_tolerance(capable)} out of tolerance"
    advice, *more = _advice(summary)
    yield f"{first}; {advice}."
    yield from more
    if capable is not None and tolerance is not None:
        middle = (tolerance.lower_um + tolerance.upper_um) / 2.0
        if abs(wanted_um - middle) > _OFF_CENTRE * (tolerance.upper_um - tolerance.lower_um):
            yield (
                f"The wanted size, {number_text(wanted_um)} µm, is not the middle of the tolerance, "
                f"{number_text(middle)} µm: parts that are as wanted are still nearer to one limit."
            )
    given_up = len(sizes.size_um) - len(sizes.finished_um)
    if given_up:
        yield f"Of {len(sizes.size_um)} parts {given_up} never reached a threshold; they are not counted above."


def verdict(summary: GaugingSummary) -> Verdict:
    """How the page takes it: ``"good"`` is capable, ``"bad"`` makes scrap, ``"plain"`` is between or not known."""
    known = summary.capability
    if known is None:
        return "plain"
    return "good" if known.cpk >= CAPABLE else "bad" if known.cpk < _SCRAP else "plain"


def sizes_table(summary: GaugingSummary, wanted_um: float) -> Table:
    """Mean and spread by Monte Carlo with standard errors, and by eq. 25."""
    sizes, formula = summary.sizes, summary.formula
    # counted from the wanted size too, where that is another number
    zeros = (0.0,) if wanted_um == 0 else (0.0, wanted_um)
    rows = [
        (
            f"Monte Carlo, {len(sizes.finished_um)} parts",
            *(uncertain_text(sizes.mean_um - zero, sizes.mean_error_um, least=0) for zero in zeros),
            uncertain_text(sizes.sd_um, sizes.sd_error_um, least=0),
            *(NONE,) * 2,
        ),
        (
            "by eq. 25" if summary.formula_holds else "by eq. 25, which does not hold here",
            *(_um(formula.mean_um - zero) for zero in zeros),
            *map(_um, (formula.sd_um, formula.within_um, formula.between_um)),
        ),
    ]
    heads = [">mean [µm]", ">off wanted [µm]"][: len(zeros)]
    return table(["", *heads, ">sd [µm]", ">within [µm]", ">between [µm]"], rows, legend("gauging.sizes"))


def capability_table(one: Capability) -> Table:
    """Cp and Cpk with intervals, and shares out of tolerance."""
    counted = " to ".join(map(percent, (one.share_outside_low, one.share_outside_high)))
    rows = [
        ("Cp", number_text(one.cp), f"{number_text(one.cp_low)} to {number_text(one.cp_high)}"),
        ("Cpk", number_text(one.cpk), f"{number_text(one.cpk_low)} to {number_text(one.cpk_high)}"),
        ("Cp by quantiles", number_text(one.cp_quantiles), NONE),
        ("Cpk by quantiles", number_text(one.cpk_quantiles), NONE),
        ("too small, of normal sizes", percent(one.share_below), NONE),
        ("too large, of normal sizes", percent(one.share_above), NONE),
        ("out of tolerance, counted", percent(one.share_outside), counted),
    ]
    return table(
        ["", f">of {one.count} parts", f">{100 * CONFIDENCE:.3g} % interval"], rows, legend("gauging.capability")
    )


def trade_off_table(summary: GaugingSummary) -> Table:
    """Filter and thresholds as they are, and what others give."""
    # thresholds that follow the parts are not centred
    follow = UNCORRECTED in {one.name for one in summary.settings}
    rows = [
        (
            "best filter" if follow and one.name == BEST_CENTRED else SETTINGS[one.name],
            number_text(1e3 * one.time_constant_s),
            volts_text(one),
            uncertain_text(one.bias_um, one.bias_error_um, least=0),
            _um(one.sd_um),
            _um(one.rms_um),
        )
        for one in summary.settings
    ]
    note = legend("gauging.settings") + ("" if follow else " A centred threshold is moved until the mean is as wanted.")
    heads = ["", ">T_Φ [ms]", ">thresholds [V]", ">off wanted [µm]", ">sd [µm]", ">rms error [µm]"]
    return table(heads, rows, note)


def stages_table(summary: GaugingSummary) -> Table:
    """The stages of the grinding with their thresholds."""
    stages = [
        (str(number), stage.feed_um_per_s, stage.rate_um_per_s, stage.until_um, number_text(stage.threshold_v, 5))
        for number, stage in enumerate(summary.stages, start=1)
    ]
    headings = [">stage", ">feed [µm/s]", ">allowance falls at [µm/s]", ">until [µm]", ">threshold [V]"]
    return table(headings, stages, legend("gauging.stages"))


def _um(value: float) -> str:
    """A length; what is below a tenth of a nanometre is 0."""
    return number_text(value if abs(value) >= _ROUNDING_UM else 0.0)


def percent(share: float) -> str:
    """A share as a percentage with two digits; very small ones in parts per million."""
    if 0 < share < 1e-4:
        return "below 0.1 ppm" if share < 1e-7 else f"{number_text(1e6 * share, 2)} ppm"
    return f"{number_text(100 * share, 2)} %"


def _out_of_tolerance(one: Capability) -> str:
    if one.share_outside == 0:
        return f"none of {one.count} is"
    return f"{percent(one.share_outside)} of them are"


def _advice(summary: GaugingSummary) -> list[str]:
    """What would make the error smaller: the last threshold, the filter, or nothing of it; then whole sentences."""
    by_name = {one.name: one for one in summary.settings}
    present, centred, both = by_name[PRESENT], by_name.get(CENTRED), by_name.get(BEST_CENTRED)
    narrower = both if both is not None and both.sd_um < MATTERS * present.sd_um else None
    found = []
    if centred is not None and centred.rms_um < MATTERS * present.rms_um:
        off = uncertain_text(centred.bias_um, centred.bias_error_um, least=0)
        found.append(
            f"{_thresholds(centred)} in place of {volts_text(present, like=centred)} V would centre them (simulated: "
            f"off by {off} µm; rms error {number_text(present.rms_um, 2)} → "
            f"{number_text(centred.rms_um, 2)} µm)"
        )
    if narrower is not None:
        found.append(
            f"a filter of {ms_text(narrower.time_constant_s)} in place of {ms_text(present.time_constant_s)}, with "
            f"{_thresholds(narrower)}, would narrow the spread to {number_text(narrower.sd_um, 2)} µm (simulated)"
        )
    thing = "no other filter" if UNCORRECTED in by_name else "neither another filter nor another last threshold"
    first, *more = found or [f"{thing} would make them much better"]
    return [first, *(f"{one[0].upper()}{one[1:]}." for one in more)]


def volts_text(one: Setting, like: Setting | None = None) -> str:
    """All thresholds of a setting as a model file has them, with at most as many decimals as those of `like`."""
    decimals = max(len(f"{volts:.10g}".partition(".")[2]) for volts in (like or one).thresholds_v)
    decimals = min(decimals, _MOST_DECIMALS)
    told = [f"{round(volts, decimals):.{decimals}f}" for volts in one.thresholds_v]
    return listed([text.rstrip("0").rstrip(".").replace("-", "−") if "." in text else text for text in told])


def _thresholds(one: Setting) -> str:
    return f"{'thresholds' if len(one.thresholds_v) > 1 else 'a threshold'} of {volts_text(one)} V"


def _drawings(result: SimulationResult) -> dict[str, list[Block]]:
    """Section of the account → its drawings."""
    return {
        "sizes": _sizes(result),
        "filter": _filter(result.summary),
        "parts": _parts(result),
        "gauge": _gauge(result),
    }


def _sizes(result: SimulationResult) -> list[Block]:
    from selector.figures.simulated.gauging import size_histogram, sizes_over_parts

    model, summary, ground = result.simulated.model, result.summary, result.simulated.details.sizes
    tolerance, wanted_um = model.values.tolerance, model.setup.wanted_um
    limits = None if tolerance is None else (tolerance.lower_um, tolerance.upper_um)
    curve = size_density(summary.formula) if summary.formula.sd_um > 0 else None
    sizes, formula = summary.sizes, summary.formula
    of_formula = uncertain_text(formula.mean_um + formula.curvature_um, formula.sd_um, least=0)
    title = f"Simulated: mean size {uncertain_text(sizes.mean_um, sizes.sd_um, least=0)} µm (standard deviation); "
    histogram = size_histogram(sizes.finished_um, curve, limits, wanted_um, f"{title}by formula {of_formula} µm")
    drawn: list[Block] = [Drawing(histogram, legend("gauging.histogram"))]
    if ground is not None and len(ground.size_um) > 1:
        grinding = model.values.grinding
        every = grinding.dress_every if grinding.wheel_wear > 0 else 0
        dressed = range(every + 1, len(ground.size_um) + 1, every) if every > 0 else ()
        low, high = number_text(float(ground.size_um.min())), number_text(float(ground.size_um.max()))
        title = f"Simulated: {len(ground.size_um)} parts of {low} to {high} µm"
        chart = sizes_over_parts(ground.size_um, limits, wanted_um, dressed, title)
        drawn.append(Drawing(chart, legend("gauging.chart-dressed") if dressed else legend("gauging.chart")))
    return drawn


def _parts(result: SimulationResult) -> list[Block]:
    """The first part; of recorded runs the first ones."""
    from selector.figures.simulated.gauging import part_in_time

    done, summary, parts = result.simulated.details, result.summary, _in_time(result)
    thresholds = [(stage.until_um, stage.threshold_v) for stage in summary.stages]
    shown = dict(list(parts.items())[: MOST_PARTS if done.sizes is not None else MOST_RUNS])
    drawn: list[Block] = []
    for run, (courses, ends_s, is_finished) in shown.items():
        name = run if len(parts) > 1 else ""
        whole = part_in_time(*courses, thresholds, ends_s, is_finished=is_finished, name=name)
        drawn.append(Drawing(whole, f"{legend('gauging.part')} {THINNED}"))
    more = len(done.recording.runs) - (done.waveform is not None) - len(shown)
    return [*drawn, Note(f"{more} more parts were recorded; they are in their files.")] if drawn and more else drawn


def _gauge(result: SimulationResult) -> list[Block]:
    from selector.figures.simulated.gauging import gauge_characteristic

    summary, curve = result.summary, result.summary.characteristic
    if curve is None:
        return []
    thresholds = [(stage.until_um, stage.threshold_v) for stage in summary.stages]
    picture = gauge_characteristic(
        curve.allowance_um, curve.voltage_v, summary.gauge, summary.linear_range_um, thresholds
    )
    return [Drawing(picture, legend("gauging.curve"))]


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
    from selector.figures.simulated.gauging import filter_trade_off

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
    return [Drawing(filter_trade_off(summary.filters, best, present, title), legend("gauging.filter"))]


def size_density(one: SizesByFormula) -> tuple[Vector, Vector]:
    """Sizes and the density there, normal about the mean with its curvature [µm], [1/µm]."""
    at = np.linspace(-_DENSITY_SIGMAS, _DENSITY_SIGMAS, _DENSITY_POINTS)
    density = np.exp(-0.5 * at**2) / (math.sqrt(2.0 * math.pi) * one.sd_um)
    return one.mean_um + one.curvature_um + one.sd_um * at, density


def _data(model: GaugingModel, simulation: GaugingSimulation, summary: GaugingSummary) -> dict[str, Any]:
    """`gauging` of `selector.simulation/1`."""
    curve, filters = summary.characteristic, summary.filters
    gain = model.setup.gauge.gain_v_per_um
    within = {"linear_range_um": list(summary.linear_range_um), "linear_within_um": summary.linear_within_um}
    return {
        "gauge": {**vars(summary.gauge), **within},
        "characteristic": None
        if curve is None
        else fields_of(curve, "allowance_um", "voltage_v", "monotone_um", "free_amplitude_um"),
        "stages": [dict(vars(stage)) for stage in summary.stages],
        "wanted_um": model.setup.wanted_um,
        "parts": None if simulation.sizes is None else _parts_data(simulation.sizes),
        "monte_carlo": _monte_carlo(summary.sizes),
        "formula": {"method": "linear", **vars(summary.formula), "linear_holds": summary.formula_holds},
        "capability": None if summary.capability is None else _capability_data(summary.capability),
        "trade_off": {
            **{name: [getattr(one, name) for one in filters] for name in _OF_TRADE_OFF},
            "centred_threshold_v": [one.threshold_v - gain * one.bias_um for one in filters],
            "at_edge": any(one.at_limit for one in summary.settings),
            "settings": [
                {
                    "setting": setting.name,
                    "by": "Monte Carlo",
                    **fields_of(setting, "parts", "time_constant_s", "threshold_v", "thresholds_v", "at_limit"),
                    "bias_um": setting.bias_um,
                    "bias_standard_error_um": setting.bias_error_um,
                    **fields_of(setting, "sd_um", "rms_um"),
                }
                for setting in summary.settings
            ],
        },
    }


_OF_TRADE_OFF = ("time_constant_s", "bias_um", "sd_um", "threshold_v")
_OF_PART = ("size_um", "duration_s", "tripped", "at_once")
_OF_CAPABILITY = ("cp", "cpk", "share_outside")  #: Those with an interval.


def _parts_data(sizes: FinishedSizes) -> list[dict[str, Any]]:
    names = (*_OF_PART, *(("offset_um",) if sizes.offset_um.any() else ()))
    rows = zip(*(getattr(sizes, name).tolist() for name in names), strict=True)
    return [{"part": number, **dict(zip(names, row, strict=True))} for number, row in enumerate(rows, start=1)]


def _monte_carlo(sizes: FinishedSizes) -> dict[str, Any]:
    return {
        "parts": len(sizes.size_um),
        "never_tripped": int((~sizes.tripped).sum()),
        "at_once": int(sizes.at_once.sum()),
        "mean_um": sizes.mean_um,
        "mean_standard_error_um": sizes.mean_error_um,
        "sd_um": sizes.sd_um,
        "sd_standard_error_um": sizes.sd_error_um,
    }


def _capability_data(one: Capability) -> dict[str, Any]:
    told: dict[str, Any] = {"parts": one.count, "confidence": CONFIDENCE}
    for name, value in vars(one).items():
        if name in _OF_CAPABILITY:
            told |= {name: value, f"{name}_interval": [getattr(one, f"{name}_{end}") for end in ("low", "high")]}
        elif name not in ("count", "mean_um", "sd_um") and not name.endswith(("_low", "_high")):
            told[name] = value
    return told
