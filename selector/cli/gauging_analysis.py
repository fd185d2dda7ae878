"""How are the numbers of simulated gauging told: the `gauging` object of the JSON, and tables on the screen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from selector.cli import showing

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.gauging.capability import Capability
    from selector.physics.gauging.finished_sizes import FinishedSizes
    from selector.physics.gauging.gauging_model import GaugingModel, GaugingSimulation
    from selector.physics.gauging.gauging_summary import GaugingSummary
    from selector.physics.gauging.size_distribution import SizeDistribution

_SETTINGS = {
    "present": "as it is",
    "centred": "threshold centred",
    "best-filter": "best filter, eq. 23",
    "best-filter-centred": "best filter, centred",
}
_ROUNDING_UM = 1e-4
_METHODS = {"linear": "formula, passed once (eq. 25)", "first-passage": "formula, early trips counted"}


def gauging_object(model: GaugingModel, simulation: GaugingSimulation, summary: GaugingSummary) -> dict[str, Any]:
    """`gauging` of `selector.simulation/1`."""
    gauge, curve, one = summary.gauge, summary.characteristic, summary.trade_off
    return {
        "gauge": {
            "gain_v_per_um": gauge.gain_v_per_um,
            "bias_v": gauge.bias_v,
            "time_constant_s": gauge.time_constant_s,
            "allowance_um": gauge.allowance_um,
            "linear_range_um": list(summary.linear_range_um),
            "linear_within_um": summary.linear_within_um,
        },
        "characteristic": None
        if curve is None
        else {
            "allowance_um": curve.allowance_um,
            "voltage_v": curve.voltage_v,
            "monotone_um": list(curve.monotone_um),
            "free_amplitude_um": curve.free_amplitude_um,
        },
        "stages": [
            {
                "until_um": stage.until_um,
                "feed_um_per_s": stage.feed_um_per_s,
                "rate_um_per_s": stage.rate_um_per_s,
                "threshold_v": stage.threshold_v,
            }
            for stage in summary.stages
        ],
        "wanted_um": model.setup.wanted_um,
        "parts": None if simulation.sizes is None else _parts(simulation.sizes),
        "monte_carlo": _monte_carlo(summary.sizes),
        "formula": _formula(summary.formula),
        "capability": None if summary.capability is None else _capability(summary.capability),
        "trade_off": {
            "time_constant_s": one.time_constant_s,
            "bias_um": one.bias_um,
            "sd_um": one.sd_um,
            "threshold_v": one.threshold_v,
            "centred_threshold_v": one.centred_threshold_v,
            "at_edge": one.at_edge,
            "settings": [
                {
                    "setting": setting.name,
                    "by": "Monte Carlo",
                    "parts": setting.parts,
                    "time_constant_s": setting.time_constant_s,
                    "threshold_v": setting.threshold_v,
                    "thresholds_v": list(setting.thresholds_v),
                    "at_limit": setting.at_limit,
                    "bias_um": setting.bias_um,
                    "bias_standard_error_um": setting.bias_error_um,
                    "sd_um": setting.sd_um,
                    "rms_um": setting.rms_um,
                }
                for setting in summary.settings
            ],
        },
    }


def show_analysis(console: Console, model: GaugingModel, summary: GaugingSummary) -> None:
    """Gauge and stages, finished sizes, capability, and what other filters and thresholds would do, as tables."""
    gauge, (low, high) = summary.gauge, summary.linear_range_um
    line = f"K = {1e3 * gauge.gain_v_per_um:.4g} mV/µm, T_Φ = {1e3 * gauge.time_constant_s:.4g} ms"
    if summary.characteristic is not None:
        line += f"; the line holds within {summary.linear_within_um:.2g} µm from {low:.4g} to {high:.4g} µm"
    rows: list[tuple[object, ...]] = [
        (number, stage.feed_um_per_s, stage.rate_um_per_s, stage.until_um, f"{stage.threshold_v:.5g}")
        for number, stage in enumerate(summary.stages, start=1)
    ]
    columns = ["stage", "feed, µm/s", "falls at, µm/s", "until, µm", "threshold, V"]
    console.print(showing.table(f"Gauge: {line}", columns, rows, numeric=columns))
    sizes, formula = summary.sizes, summary.formula
    wanted = model.setup.wanted_um
    rows = [
        (
            f"Monte Carlo, {len(sizes.finished_um)} parts",
            *(sizes.mean_um, sizes.mean_error_um, sizes.mean_um - wanted),
            *(sizes.sd_um, sizes.sd_error_um),
        ),
        (_METHODS[formula.method], _seen(formula.mean_um), None, _seen(formula.mean_um - wanted), formula.sd_um, None),
    ]
    columns = ["", "mean", "±", "off wanted", "sd", "±"]
    console.print(showing.table("Finished sizes, µm", columns, rows, numeric=columns[1:]))
    if summary.capability is not None:
        _show_capability(console, summary.capability)
    rows = [
        (
            _SETTINGS[one.name] + (" *" if one.at_limit else ""),
            1e3 * one.time_constant_s,
            " ".join(f"{volts:.6g}" for volts in one.thresholds_v),
            _seen(one.bias_um),
            one.bias_error_um,
            one.sd_um,
        )
        for one in summary.settings
    ]
    columns = ["filter and threshold", "T_Φ, ms", "volts", "off, µm", "±", "sd, µm"]
    console.print(showing.table("What would be better, by Monte Carlo", columns, rows, numeric=columns[1:]))
    notes = [
        "off: mean size minus the wanted one; volts: of all stages, for [thresholds]. Eq. 23 calculates them: the "
        "voltage of the wanted size, ahead by what is ground off while filter, relay and springs are late."
    ]
    if any(one.at_limit for one in summary.settings):
        shortest, longest = (1e3 * float(end) for end in summary.trade_off.time_constant_s[[0, -1]])
        notes.append(
            f"* the end of what was looked at, {shortest:.3g} to {longest:.4g} ms, because the last stage has to be "
            "long against its filter."
        )
    for note in notes:
        console.print(note, style="dim", markup=False)


def _seen(value_um: float) -> float:
    """What is below a tenth of a nanometre is 0."""
    return value_um if abs(value_um) >= _ROUNDING_UM else 0.0


def _show_capability(console: Console, one: Capability) -> None:
    row = (
        f"{one.cp:.3g} ({one.cp_low:.3g} to {one.cp_high:.3g})",
        f"{one.cpk:.3g} ({one.cpk_low:.3g} to {one.cpk_high:.3g})",
        one.cpk_quantiles,
        f"{100 * one.share_outside:.3g} % ({100 * one.share_outside_low:.3g} to {100 * one.share_outside_high:.3g} %)",
    )
    columns = ["Cp", "Cpk", "Cpk by quantiles", "out of tolerance"]
    console.print(showing.table(f"Capability, {100 * one.confidence:.3g} % intervals", columns, [row]))


def _parts(sizes: FinishedSizes) -> list[dict[str, Any]]:
    return [
        {"part": number, "size_um": size, "duration_s": duration, "tripped": tripped, "at_once": at_once}
        for number, (size, duration, tripped, at_once) in enumerate(
            zip(
                sizes.size_um.tolist(),
                sizes.duration_s.tolist(),
                sizes.tripped.tolist(),
                sizes.at_once.tolist(),
                strict=True,
            ),
            start=1,
        )
    ]


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


def _formula(one: SizeDistribution) -> dict[str, Any]:
    return {
        "method": one.method,
        "mean_um": one.mean_um,
        "sd_um": one.sd_um,
        "within_um": one.within_um,
        "between_um": one.between_um,
        "restlessness": one.restlessness,
        "ripple_rate": one.ripple_rate,
        "curvature_um": one.curvature_um,
        "linear_holds": one.linear_holds,
        "passage_holds": one.passage_holds,
    }


def _capability(one: Capability) -> dict[str, Any]:
    return {
        "parts": one.count,
        "confidence": one.confidence,
        "cp": one.cp,
        "cp_interval": [one.cp_low, one.cp_high],
        "cpk": one.cpk,
        "cpk_interval": [one.cpk_low, one.cpk_high],
        "cp_quantiles": one.cp_quantiles,
        "cpk_quantiles": one.cpk_quantiles,
        "share_below": one.share_below,
        "share_above": one.share_above,
        "share_outside": one.share_outside,
        "share_outside_interval": [one.share_outside_low, one.share_outside_high],
    }
