"""What does a simulated gauge amount to, what is odd about the sizes that come out, and what would make them better."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields

import numpy as np

from selector.errors import ModelFileError
from selector.findings import Finding
from selector.physics.gauging.finding_table import FINDINGS
from selector.physics.gauging.gauge.characteristic import Characteristic, linear_range_um
from selector.physics.gauging.gauge.transducer import LinearGauge
from selector.physics.gauging.gauging_advice import (
    BEST_CENTRED,
    CENTRED,
    PRESENT,
    Setting,
    gauging_settings,
    volts_text,
)
from selector.physics.gauging.gauging_model import GaugingModel, GaugingSimulation, mattering_um
from selector.physics.gauging.grinding.gauged_grinding import FEWEST_SIZES, FinishedSizes, finished_sizes, usual_steps
from selector.physics.gauging.process import mean_surface_um, smoothed_surface
from selector.physics.gauging.sizes import Capability, SizesByFormula, capability, on_line, sizes_by_formula
from selector.physics.simulation_kind import Progress, unheard

_TURNS = 2048
_EARLY_SHARE = 0.1  #: Share of the standard deviation from which on an early command is told.
#: Standard errors, share of the standard deviation and length by which formula and Monte Carlo differ to be told.
_EARLY_ERRORS, _SHARE, _LEAST_EARLY_UM = 4.0, 0.15, 1e-3


def formula_holds(model: GaugingModel, formula: SizesByFormula, sizes: FinishedSizes) -> bool:
    """Whether mean and spread by eq. 25 are those of parts that are ground, as far as matters and these can tell."""
    least = max(min(_SHARE * sizes.sd_um, 0.5 * mattering_um(model)), _LEAST_EARLY_UM)
    off = (
        (sizes.mean_um - formula.mean_um - formula.curvature_um, sizes.mean_error_um),
        (sizes.sd_um - formula.sd_um, sizes.sd_error_um),
    )
    return all(abs(one) <= max(_EARLY_ERRORS * error, least) for one, error in off)


def formula_findings(model: GaugingModel, formula: SizesByFormula, sizes: FinishedSizes) -> Iterator[Finding]:
    """Why parts come out otherwise than by eq. 25: surfaces and noise that trip the relay early, or what is left."""
    early_um = sizes.mean_um - formula.mean_um - formula.curvature_um
    least_um = max(_EARLY_SHARE * formula.sd_um, _EARLY_ERRORS * sizes.mean_error_um, _LEAST_EARLY_UM)
    if formula.ripple_rate >= 1.0:
        yield _of_surface(model, formula, early_um)
    elif early_um > least_um and max(formula.restlessness, model.setup.relay.noise_v) > 0:
        yield _of_noise(model, formula, sizes, early_um)
    elif not formula_holds(model, formula, sizes):
        by_formula = formula.mean_um + formula.curvature_um
        yield FINDINGS.finding(
            "formula-differs",
            f"The formula says {by_formula:.3g} ± {formula.sd_um:.3g} µm (mean and standard deviation), Monte Carlo "
            f"{sizes.mean_um:.3g} ± {sizes.sd_um:.3g} µm; the latter counts, with standard errors of "
            f"{sizes.mean_error_um:.1g} and {sizes.sd_error_um:.1g} µm.",
            evidence={
                "formula_um": by_formula,
                "formula_sd_um": formula.sd_um,
                "mean_um": sizes.mean_um,
                "sd_um": sizes.sd_um,
            },
        )


def _of_noise(model: GaugingModel, formula: SizesByFormula, sizes: FinishedSizes, early_um: float) -> Finding:
    relay, causes, helps = model.setup.relay, [], []
    if formula.restlessness > 0:
        causes.append(
            f"noise that the gauge sees moves the smoothed voltage {formula.restlessness:.2g} times as fast as the "
            "feed does"
        )
        helps.append("give the filter more time")
    if relay.noise_v > 0:
        causes.append(
            f"noise of the relay, {1e3 * relay.noise_v:.3g} mV and new every {1e3 * relay.noise_hold_s:.3g} ms, makes "
            "one of many comparisons early"
        )
        helps.append("quiet the relay or let it average")
    said = " and ".join(causes)
    return FINDINGS.finding(
        "noise-trips-early",
        f"{said[0].upper()}{said[1:]}: parts are {early_um:.2g} µm larger than the calculated threshold (eq. 23) "
        f"has it. The linear spread (eq. 25) is {formula.sd_um:.3g} µm; with early commands it is "
        f"{sizes.sd_um:.3g} µm.",
        evidence={"restlessness": formula.restlessness, "early_um": early_um, "sd_by_eq_25_um": formula.sd_um},
        suggestion=f"{', '.join(helps)}, feed faster in the last stage, or move the last threshold",
        level="info" if early_um < mattering_um(model) else "warning",
    )


def _of_surface(model: GaugingModel, formula: SizesByFormula, early_um: float) -> Finding:
    setup = model.setup
    surface = on_line(setup).surface
    mean_um = -mean_surface_um(surface)
    behind, _ = smoothed_surface(surface, setup.gauge.time_constant_s, np.arange(_TURNS) / _TURNS)
    swing_um = float(np.abs(behind + mean_um).max())
    return FINDINGS.finding(
        "surface-trips-early",
        f"Behind the filter grooves and run-out still move the reading by up to {swing_um:.3g} µm from its mean, "
        f"{formula.ripple_rate:.3g} times as fast as the feed does: the relay trips on the peaks"
        + (f", {early_um:.2g} µm early" if early_um > 0 else "")
        + (f", and the mean of the grooves adds {mean_um:.2g} µm." if mean_um else "."),
        evidence={"ripple_um": swing_um, "ripple_rate": formula.ripple_rate, "early_um": early_um, "mean_um": mean_um},
    )


CAPABLE = 1.33  #: Cpk from which on a process is called capable: four standard deviations to the nearer limit.
_ERRORS = 4.0  #: Standard errors by which sizes must be off to be told.
#: A filter is better that leaves at most this share of the error, and so much less of it [µm].
_BETTER, _LEAST_UM = 0.9, 1e-3


def _off(model: GaugingModel, sizes: FinishedSizes, centred: Setting | None) -> Iterator[Finding]:
    off_um = sizes.mean_um - model.setup.wanted_um
    if abs(off_um) <= max(mattering_um(model), _ERRORS * sizes.mean_error_um):
        return
    advice = "no last threshold centres them: look at the stages, the reach of the gauge and the filter"
    if model.values.correction is not None:
        advice = "correct by a larger share: thresholds follow the parts too slowly"
    elif centred is not None:
        advice = (
            f"set {volts_text(centred)}: parts that are ground with it are off by {centred.bias_um:.2g} µm on average"
        )
    yield FINDINGS.finding(
        "sizes-off-what-is-wanted",
        f"Parts come out {abs(off_um):.3g} µm {'larger' if off_um > 0 else 'smaller'} than wanted, on average.",
        evidence={
            "off_um": off_um,
            "standard_error_um": sizes.mean_error_um,
            "centred_v": None if centred is None else centred.threshold_v,
            "left_um": None if centred is None else centred.bias_um,
        },
        suggestion=advice,
    )


def _capability(
    model: GaugingModel, formula: SizesByFormula, known: Capability | None, steady: Setting | None
) -> Iterator[Finding]:
    tolerance = model.values.tolerance
    if known is None or tolerance is None or known.cpk >= CAPABLE:
        return
    half_um = 0.5 * (tolerance.upper_um - tolerance.lower_um)
    best = half_um / (3.0 * steady.sd_um) if steady is not None and steady.sd_um > 0 else None
    if known.cp >= CAPABLE:
        advice = f"centre the sizes in the tolerance: Cp is {known.cp:.3g}, and Cpk then too"
    elif steady is not None and best is not None and best >= CAPABLE:
        advice = f"take T_Φ = {steady.time_constant_s:g} s with {volts_text(steady)}: Cp {best:.3g}"
    elif formula.between_um > formula.within_um and model.is_wearing:
        advice = "dress more often and set the gauge again for its worn tip: most of the spread is between parts"
    else:
        advice = "no filter makes it capable: feed slower in the last stage, steady the feed, lower the noise"
        if model.values.correction is not None:
            advice += ", or correct by a smaller share"
    yield FINDINGS.finding(
        "low-capability",
        f"Cpk is {known.cpk:.3g} ({known.cpk_low:.3g} to {known.cpk_high:.3g}), below {CAPABLE:g}: "
        f"{100 * known.share_outside:.3g} % of {known.count} parts are out of tolerance.",
        evidence={"cp": known.cp, "cpk": known.cpk, "share_outside": known.share_outside, "best_cp": best},
        suggestion=advice,
    )


def _filter(by_name: Mapping[str, Setting]) -> Iterator[Finding]:
    """A filter with which the error is less once the last threshold is centred."""
    now, best = by_name[PRESENT], by_name.get(BEST_CENTRED)
    least = min(now.rms_um, by_name[CENTRED].rms_um if CENTRED in by_name else now.rms_um)
    if best is None or best.rms_um > min(_BETTER * least, least - _LEAST_UM):
        return
    yield FINDINGS.finding(
        "better-filter",
        f"With T_Φ = {now.time_constant_s:.3g} s sizes are off by {now.rms_um:.3g} µm (rms); "
        f"{best.time_constant_s:g} s leaves {best.rms_um:.3g} µm with thresholds that centre them.",
        evidence={
            "present_s": now.time_constant_s,
            "present_rms_um": now.rms_um,
            "settings": [
                {
                    "time_constant_s": best.time_constant_s,
                    "volts": list(best.thresholds_v),
                    "rms_um": best.rms_um,
                    "at_limit": best.at_limit,
                }
            ],
        },
        suggestion=f"with {best.time_constant_s:g} s set {volts_text(best)}",
    )


#: Steps of all parts of one trial of other thresholds, and parts that it has at least: a second or so for a setting
#: that is told, a fifth of it for a filter that is only looked at.
_TRIAL, _FEW = (10_000_000, 200), (2_000_000, 100)


@dataclass(frozen=True)
class StageSummary:
    """One feed, and the voltage that ends it."""

    until_um: float  #: Allowance at which it is to end [µm]
    #: feed_um_per_s and rate_um_per_s: Infeed, and how fast the allowance falls by it: a [µm/s]
    feed_um_per_s: float
    rate_um_per_s: float
    threshold_v: float  #: Voltage of the relay [V]


@dataclass(frozen=True)
class GaugingSummary:
    """What a simulation of gauging amounts to."""

    gauge: LinearGauge  #: The line at the end of the last stage
    characteristic: Characteristic | None  #: Of a whole gauge; None of a linear one
    stages: tuple[StageSummary, ...]  #: In the order of the grinding
    formula: SizesByFormula  #: Of finished sizes, by eq. 25
    formula_holds: bool  #: Whether `sizes` are as it says
    sizes: FinishedSizes  #: By Monte Carlo: of the parts of the file, or of as many such batches as make 2000 parts
    capability: Capability | None  #: None where the file has no tolerance
    filters: tuple[Setting, ...]  #: Other T_Φ, increasing, with their thresholds of eq. 23, by few parts
    #: What other filters and last thresholds give, by Monte Carlo; see `gauging_advice.gauging_settings`
    settings: tuple[Setting, ...]
    #: Allowances between which the line is within `linear_within_um` of size; of a linear gauge all that is ground [µm]
    linear_range_um: tuple[float, float]
    linear_within_um: float  #: A tenth of the tolerance, 1 µm without one [µm]
    findings: tuple[Finding, ...]  #: What is odd about the sizes


def gauging_summary(
    model: GaugingModel, simulation: GaugingSimulation | None = None, *, progress: Progress = unheard
) -> GaugingSummary:
    """What gauging by this model amounts to; `simulation` of it lends its seed.

    `progress` is told how many parts of how many are done, and what is being done.

    Raises ModelFileError: no part reaches its thresholds.
    """
    setup, parts = model.setup, model.file.run.parts
    told = None if simulation is None else simulation.recording.provenance["simulated"]["seed"]
    seed = model.file.run.seed if told is None else int(told)
    sizes = _sizes(model, seed, progress)
    if not sizes.tripped.any():
        raise ModelFileError(
            "thresholds that no part reaches",
            expected="voltages that the gauge shows while parts are ground",
            where="key thresholds.volts" if model.file.thresholds is not None else "key grinding.stages",
            advice="lower the thresholds, or leave them out: they are then calculated (eq. 23)",
        )
    formula = sizes_by_formula(setup, parts=parts)
    tolerance, curve = model.values.tolerance, model.characteristic
    known = None if tolerance is None else capability(sizes.finished_um, tolerance)
    filters, settings = gauging_settings(
        model, sizes, lambda other, few: _sizes(other, seed, progress, trial=_FEW if few else _TRIAL)
    )
    by_name = {one.name: one for one in settings}
    return GaugingSummary(
        gauge=setup.gauge,
        characteristic=curve,
        stages=tuple(
            StageSummary(stage.until_um, stage.feed_um_per_s, rate, volts)
            for stage, rate, volts in zip(setup.grinding.stages, setup.rates_um_per_s, setup.thresholds_v, strict=True)
        ),
        formula=formula,
        formula_holds=formula_holds(model, formula, sizes),
        sizes=sizes,
        capability=known,
        filters=filters,
        settings=settings,
        linear_range_um=(setup.wanted_um, setup.grinding.allowance_um)
        if curve is None
        else linear_range_um(curve, setup.gauge, mattering_um(model)),
        linear_within_um=mattering_um(model),
        findings=(
            *formula_findings(model, formula, sizes),
            *_off(model, sizes, by_name.get(CENTRED)),
            *_capability(model, formula, known, by_name.get(BEST_CENTRED)),
            *_filter(by_name),
        ),
    )


def _sizes(
    model: GaugingModel, seed: int, progress: Progress, *, trial: tuple[int, int] | None = None
) -> FinishedSizes:
    """Batches of the file's parts; where no part differs from the next, one long batch; of a trial some seconds' worth.

    Each part has the noise, feed and start that belong to its number, whatever the model.
    """
    parts, enough = model.file.run.parts, FEWEST_SIZES
    if trial is not None:
        steps, fewest = trial
        enough = int(np.clip(steps / max(usual_steps(model.setup), 1.0), fewest, FEWEST_SIZES))
    batch = max(parts, enough) if trial is None else enough
    if model.is_wearing or model.values.correction is not None:
        batch = parts
    batches = math.ceil(enough / batch)
    seeds = (seed, *np.random.SeedSequence(seed).generate_state(batches - 1, np.uint64))

    found: list[FinishedSizes] = []

    def told(done: int, of: int) -> None:
        progress(len(found) * of + done, batches * of, "sizes" if trial is None else "settings")

    for one in seeds:
        found.append(finished_sizes(model.setup, batch, seed=int(one), progress=told))
    columns = {one.name: [getattr(batch, one.name) for batch in found] for one in fields(FinishedSizes)}
    return FinishedSizes(**{name: np.concatenate(values) for name, values in columns.items()})
