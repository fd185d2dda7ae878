"""What the report of gauging says in words and tables: sizes, capability, filter and threshold, the gauge."""

from __future__ import annotations

import math

from selector.figures import style
from selector.physics.gauging.capability import Capability
from selector.physics.gauging.finished_sizes import FinishedSizes
from selector.physics.gauging.gauging_advice import gauging_settings
from selector.physics.gauging.gauging_summary import GaugingSummary
from selector.physics.gauging.process import Tolerance
from selector.physics.gauging.size_distribution import SizeDistribution
from selector.report.numbers import NONE, number_text
from selector.report.tables import Table, table

_MATTERS = 0.9
"""An error that falls to less than this share of itself is worth a change."""

_OFF_CENTRE = 0.05
_ROUNDING_UM = 1e-4
SETTINGS = {
    "present": "as it is",
    "centred": "last threshold centred",
    "best-filter": "best filter, threshold by eq. 23",
    "best-filter-centred": "best filter, threshold centred",
}
_METHODS = {"linear": "by formula, linear (G eq. 25)", "first-passage": "by formula, first passage"}


def size_sentences(
    summary: GaugingSummary, wanted_um: float, tolerance: Tolerance | None, *, is_ground: bool = True
) -> list[str]:
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
    told = [f"{first}; {advice}.", *more]
    if capable is not None and tolerance is not None:
        told.append(_capability_sentence(capable, tolerance))
        middle = (tolerance.lower_um + tolerance.upper_um) / 2.0
        if abs(wanted_um - middle) > _OFF_CENTRE * (tolerance.upper_um - tolerance.lower_um):
            told.append(
                f"The wanted size, {number_text(wanted_um)} µm, is not the middle of the tolerance, "
                f"{number_text(middle)} µm: parts that are as wanted are still nearer to one limit."
            )
    given_up = len(sizes.size_um) - len(sizes.finished_um)
    if given_up:
        told.append(f"Of {len(sizes.size_um)} parts {given_up} never reached a threshold; they are not counted above.")
    return told


def sizes_title(summary: GaugingSummary) -> str:
    """What the histogram shows, as plain text for a figure."""
    sizes, formula = summary.sizes, summary.formula
    return (
        f"Simulated: mean size {spread_text(sizes.mean_um, sizes.sd_um)} µm (standard deviation); by formula "
        f"{spread_text(formula.mean_um, formula.sd_um)} µm"
    )


def parts_title(ground: FinishedSizes) -> str:
    """What the chart over the parts shows, as plain text for a figure."""
    low, high = float(ground.size_um.min()), float(ground.size_um.max())
    return f"Simulated: {len(ground.size_um)} parts of {style.number(low)} to {style.number(high)} µm"


def filter_title(summary: GaugingSummary) -> str:
    """What the trade-off shows, as plain text for a figure."""
    one = summary.trade_off
    text = f"Computed: {style.number(one.present_rms_um)} µm (rms) with the filter of {_ms(one.present_s)}"
    if one.best_rms_um > _MATTERS * one.present_rms_um:
        return f"{text}; the best one would make little difference"
    edge = " or beyond" if one.at_edge else ""
    return f"{text}, {style.number(one.best_rms_um)} µm with {_ms(one.best_s)}{edge}"


def sizes_table(summary: GaugingSummary, linear: SizeDistribution, wanted_um: float) -> Table:
    """Mean and spread by Monte Carlo with standard errors, and by both formulas."""
    sizes = summary.sizes
    formulas = {one.method: one for one in (summary.formula, linear)}
    formula = summary.formula
    # counted from the wanted size too, where that is another number
    zeros = (0.0,) if wanted_um == 0 else (0.0, wanted_um)
    rows = [
        (
            f"Monte Carlo, {len(sizes.finished_um)} parts",
            *(spread_text(sizes.mean_um - zero, sizes.mean_error_um) for zero in zeros),
            spread_text(sizes.sd_um, sizes.sd_error_um),
            *(NONE,) * 2,
        )
    ]
    rows += [
        (
            _METHODS[method],
            *(_um(one.mean_um - zero) for zero in zeros),
            _um(one.sd_um),
            _um(one.within_um),
            _um(one.between_um),
        )
        for method, one in formulas.items()
    ]
    heads = [">mean [µm]", ">less wanted [µm]"][: len(zeros)]
    note = (
        "± one standard error. Within: the same part ground again and again; between: what differs from part to part. "
        "The linear formula lets the reading pass its threshold once. It holds where σ of the rate of the smoothed "
        f"noise is far below the rate at which the voltage rises: it is {number_text(formula.restlessness, 2)} of it."
    )
    if formula.ripple_rate > 0:
        note += (
            f" Grooves and run-out change the smoothed reading {number_text(formula.ripple_rate, 2)} times as fast as "
            "the allowance falls; from 1 on it reaches the threshold more than once."
        )
    if summary.characteristic is not None:
        note += f" The curved characteristic moves the mean by {_um(formula.curvature_um, 2)} µm, which no formula has."
    return table(["", *heads, ">sd [µm]", ">within [µm]", ">between [µm]"], rows, note)


def capability_table(one: Capability) -> Table:
    """Cp and Cpk with intervals, and shares out of tolerance."""
    level = f"{100 * one.confidence:.3g} %"
    rows = [
        ("Cp", number_text(one.cp), f"{number_text(one.cp_low)} to {number_text(one.cp_high)}"),
        ("Cpk", number_text(one.cpk), f"{number_text(one.cpk_low)} to {number_text(one.cpk_high)}"),
        ("Cp by quantiles", number_text(one.cp_quantiles), NONE),
        ("Cpk by quantiles", number_text(one.cpk_quantiles), NONE),
        ("too small, of normal sizes", percent(one.share_below), NONE),
        ("too large, of normal sizes", percent(one.share_above), NONE),
        (
            "out of tolerance, counted",
            percent(one.share_outside),
            f"{percent(one.share_outside_low)} to {percent(one.share_outside_high)}",
        ),
    ]
    note = (
        "Intervals: chi-square for Cp, Bissell for Cpk, Clopper and Pearson for the count; they say what a sample of "
        "so many parts leaves open. By quantiles: for sizes that are not normal (ISO 22514-2)."
    )
    return table(["", f">of {one.count} parts", f">{level} interval"], rows, note)


def trade_off_table(summary: GaugingSummary) -> Table:
    """Filter and last threshold as they are, and what others would do."""
    rows = [
        (
            SETTINGS[one.name],
            one.by,
            number_text(1e3 * one.time_constant_s),
            number_text(one.threshold_v, 5),
            _um(one.bias_um),
            _um(one.sd_um),
            _um(one.rms_um),
        )
        for one in gauging_settings(summary)
    ]
    note = (
        "Less wanted: mean size minus the wanted one. Eq. 23 is calculated from gain, filter and feed; a centred "
        "threshold is moved until the mean of the parts is as wanted."
    )
    if summary.trade_off.at_edge:
        note += " The best filter is at the end of those that were tried: a longer stage would allow a longer one."
    heads = ["", "by", ">T_Φ [ms]", ">last threshold [V]", ">less wanted [µm]", ">sd [µm]", ">rms error [µm]"]
    return table(heads, rows, note)


def gauge_tables(summary: GaugingSummary) -> list[tuple[str, Table]]:
    """The line of the gauge, and its stages with their thresholds."""
    gauge = summary.gauge
    low, high = summary.linear_range_um
    rows = [
        ("gain K", number_text(1e3 * gauge.gain_v_per_um, 4), "mV/µm"),
        ("bias, voltage of the line at 0 µm", number_text(gauge.bias_v, 5), "V"),
        ("filter T_Φ", number_text(1e3 * gauge.time_constant_s, 4), "ms"),
        ("line touches the characteristic at", number_text(gauge.allowance_um), "µm"),
        ("line holds from", number_text(low), "µm"),
        ("line holds to", number_text(high), "µm"),
    ]
    curve = summary.characteristic
    if curve is None:
        rows = [row for row in rows if not row[0].startswith("line")]
    stages = [
        (
            str(number),
            number_text(stage.feed_um_per_s),
            number_text(stage.rate_um_per_s),
            number_text(stage.until_um),
            number_text(stage.threshold_v, 5),
        )
        for number, stage in enumerate(summary.stages, start=1)
    ]
    return [
        ("Line of the gauge", table(["", ">value", "unit"], rows)),
        (
            "Stages",
            table(
                [">stage", ">feed [µm/s]", ">allowance falls at [µm/s]", ">until [µm]", ">threshold [V]"],
                stages,
                "A threshold is ahead of the allowance at which the stage is to end by what the filter, the relay "
                "and, at the last one, the springs of the machine are late.",
            ),
        ),
    ]


def spread_text(value: float, spread: float) -> str:
    """A value ± its spread or error, both with as many decimals as two digits of that need."""
    if not spread > 0:
        return number_text(value)
    decimals = min(max(0, 1 - math.floor(math.log10(spread))), 9)
    rounded = f"{value:.{decimals}f}"
    # no minus sign before zeros
    text = rounded.removeprefix("-") if float(rounded) == 0 else rounded.replace("-", "−")
    return f"{text} ± {spread:.{decimals}f}"


def _um(value: float, digits: int = 3) -> str:
    """A length; what is below a tenth of a nanometre is 0."""
    return number_text(value if abs(value) >= _ROUNDING_UM else 0.0, digits)


def percent(share: float) -> str:
    """A share as a percentage with two digits; very small ones in parts per million."""
    if 0 < share < 1e-4:
        return "below 0.1 ppm" if share < 1e-7 else f"{number_text(1e6 * share, 2)} ppm"
    return f"{number_text(100 * share, 2)} %"


def _out_of_tolerance(one: Capability) -> str:
    if one.share_outside == 0:
        return f"none of {one.count} is"
    return f"{percent(one.share_outside)} of them are"


def _capability_sentence(one: Capability, tolerance: Tolerance) -> str:
    width = tolerance.upper_um - tolerance.lower_um
    text = (
        f"The tolerance, {number_text(tolerance.lower_um)} to {number_text(tolerance.upper_um)} µm, is "
        f"{number_text(width / one.sd_um)} standard deviations wide: Cp {number_text(one.cp)}"
    )
    lost = one.cp - one.cpk
    return text + (
        f"; of it the mean, which is not in the middle, takes {number_text(lost, 2)}."
        if lost > 0.05
        else ", and the mean is about in the middle."
    )


def _advice(summary: GaugingSummary) -> list[str]:
    """What would make the error smaller: the last threshold, the filter, or nothing of it; then whole sentences."""
    present, centred, _, both = gauging_settings(summary)
    spread_um = summary.trade_off.present_sd_um
    edge = " or more" if summary.trade_off.at_edge and both.time_constant_s > present.time_constant_s else ""
    filters = (
        f"a filter of {_ms(both.time_constant_s)}{edge} in place of {_ms(present.time_constant_s)}, with a last "
        f"threshold of {number_text(both.threshold_v, 4)} V, would narrow the spread to {number_text(both.sd_um, 2)} µm"
        if both.sd_um < _MATTERS * spread_um
        else ""
    )
    if centred.rms_um < _MATTERS * present.rms_um:
        first = (
            f"a last threshold of {number_text(centred.threshold_v, 4)} V in place of "
            f"{number_text(present.threshold_v, 4)} V would centre them (rms error {number_text(present.rms_um, 2)} → "
            f"{number_text(centred.rms_um, 2)} µm)"
        )
        return [first, f"By formula, {filters}."] if filters else [first]
    return [filters or "neither another filter nor another last threshold would make them much better"]


def _ms(seconds: float) -> str:
    return f"{style.number(1e3 * seconds)} ms"
