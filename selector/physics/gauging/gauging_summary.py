"""What does a simulated gauge amount to, what is odd about the sizes that come out, and what would make them better."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from selector.errors import InputError, ModelFileError
from selector.findings import Finding
from selector.physics.gauging.characteristic import Characteristic, linear_range_um
from selector.physics.gauging.finding_table import FINDINGS
from selector.physics.gauging.gauged_grinding import FEWEST_SIZES, FinishedSizes, finished_sizes, usual_steps
from selector.physics.gauging.gauging_model import GaugingModel, GaugingSimulation, gauging_model, mattering_um
from selector.physics.gauging.model_file import checked_model_file
from selector.physics.gauging.sizes import Capability, SizesByFormula, capability, on_line, sizes_by_formula
from selector.physics.gauging.transducer import LinearGauge, mean_surface_um, smoothed_surface
from selector.physics.model_text import plain_values
from selector.physics.simulation_kind import Progress, unheard

PRESENT, UNCORRECTED, CENTRED, BEST_CENTRED = "present", "uncorrected", "centred", "best-filter-centred"

_NEAR = 0.4  #: Share of the standard error of a mean to which it is centred.
_FINE_UM = 1e-3
_MOST_STEPS = 4
_FILTER_DIGITS = 2
#: Filters that are looked at: up to this share of the last stage, which has to be long against its filter, or so many
#: times the present one.
_FILTERS, _SHARE_OF_STAGE, _DECADES, _ROUND_PRESENT = 12, 0.3, 2.5, 3.0
_MISSED = 0.01  #: Share of the parts that may miss a threshold more than do now.


@dataclass(frozen=True)
class Setting:
    """A filter and thresholds, and what sizes parts have that are ground with them, by Monte Carlo."""

    name: str  #: ``"present"``, ``"uncorrected"``, ``"centred"`` or ``"best-filter-centred"``
    time_constant_s: float  #: T_Φ [s]
    thresholds_v: tuple[float, ...]  #: Of all stages, as they go into a model file [V]
    parts: int  #: That were ground
    #: bias_um and bias_error_um: Mean size minus the wanted one; its standard error [µm]
    bias_um: float
    bias_error_um: float
    sd_um: float  #: Standard deviation of the sizes [µm]
    #: Whether T_Φ is the longest or shortest that was looked at, so that a better one may lie beyond
    at_limit: bool = False

    @property
    def threshold_v(self) -> float:
        """Voltage of the last command [V]."""
        return self.thresholds_v[-1]

    @property
    def rms_um(self) -> float:
        """√(bias² + variance) [µm]."""
        return math.hypot(self.bias_um, self.sd_um)


def volts_text(setting: Setting) -> str:
    """What to write into the model file, all thresholds of it."""
    return f"thresholds.volts = [{', '.join(f'{volts:.10g}' for volts in setting.thresholds_v)}]"


#: Parts ground as a model says, all with the same noise, feeds and starts; few of them if so said.
Sizes = Callable[[GaugingModel, bool], FinishedSizes]


def gauging_settings(
    model: GaugingModel, present: FinishedSizes, sizes_of: Sizes
) -> tuple[tuple[Setting, ...], tuple[Setting, ...]]:
    """Filters with thresholds of eq. 23, T_Φ increasing, by few parts; and the settings that are worth comparing.

    These are: as it is; without its correction by measured parts; its last threshold moved until the mean is as wanted;
    and the filter that spreads least, so centred. What no file may say is left out, such as thresholds that do not rise
    or that the gauge does not show, and settings with which more parts miss a threshold.
    """
    bench = _Bench(model, present, sizes_of)
    now = _setting(PRESENT, model, present)
    looked = [bench.looked_at(at_s) for at_s in _filters_s(model)]
    filters = tuple(one for one in looked if one is not None)
    best, steady = min(filters, key=lambda one: one.sd_um, default=None), None
    if best is not None and (other := bench.with_filter(best.time_constant_s)) is not None:
        steady = bench.centred(BEST_CENTRED, other, best, at_limit=best in (filters[0], filters[-1]))
    # where thresholds follow the parts, these are centred already
    centred = bench.centred(CENTRED, model, now) if model.values.correction is None else None
    settings = (now, bench.uncorrected(), centred, steady)
    return filters, tuple(one for one in settings if one is not None)


def _filters_s(model: GaugingModel) -> list[float]:
    """Round time constants on an even logarithmic scale, around the present one."""
    setup = model.setup
    ends = [setup.grinding.allowance_um, *(stage.until_um for stage in setup.grinding.stages)]
    lasts_s = (ends[-2] - ends[-1]) / setup.rates_um_per_s[-1]
    present = setup.gauge.time_constant_s
    high = max(_SHARE_OF_STAGE * lasts_s, _ROUND_PRESENT * present)
    low = min(high * 10.0**-_DECADES, present / _ROUND_PRESENT)
    return sorted({float(f"{one:.{_FILTER_DIGITS}g}") for one in np.geomspace(low, high, _FILTERS)})


class _Bench:
    """Grinds parts with other thresholds and filters."""

    def __init__(self, model: GaugingModel, present: FinishedSizes, sizes_of: Sizes) -> None:
        self._model, self._present, self._sizes_of = model, present, sizes_of
        fine_um = max(_NEAR * present.mean_error_um, _FINE_UM)
        # the digit of a voltage that moves a size by less than that
        self._decimals = math.ceil(-math.log10(0.5 * fine_um * abs(model.setup.gauge.gain_v_per_um)))

    def rounded(self, volts: Sequence[float]) -> tuple[float, ...]:
        return tuple(round(one, self._decimals) for one in volts)

    def with_filter(self, time_constant_s: float) -> GaugingModel | None:
        """The model with another T_Φ and thresholds of eq. 23; None if no file may say so."""
        plain = _unbound(self._model)
        gauge = plain["transducer"]["smoothing"] if "transducer" in plain else plain["linear"]
        gauge["time_constant_s"] = time_constant_s
        plain.pop("thresholds", None)
        return _made(plain)

    def uncorrected(self) -> Setting | None:
        """What these thresholds give where they stay, None if they do."""
        plain = _unbound(self._model)
        if plain.pop("correction", None) is None or (made := _made(plain)) is None:
            return None
        return _setting(UNCORRECTED, made, self._sizes_of(made, False))

    def looked_at(self, time_constant_s: float) -> Setting | None:
        """What this filter gives with thresholds of eq. 23, by few parts."""
        made = self.with_filter(time_constant_s)
        if made is None:
            return None
        return self.setting("", made, self.rounded(made.advised_thresholds_v), few=True)

    def setting(
        self, name: str, model: GaugingModel, volts: tuple[float, ...], *, at_limit: bool = False, few: bool = False
    ) -> Setting | None:
        """What these thresholds give; None if no file may say them, or if more parts miss one than do now."""
        made = _made(_unbound(model) | {"thresholds": {"volts": list(volts)}})
        if made is None:
            return None
        sizes = self._sizes_of(made, few)
        if _missed(sizes) > _missed(self._present) + _MISSED:
            return None
        return _setting(name, made, sizes, at_limit=at_limit)

    def centred(self, name: str, model: GaugingModel, begin: Setting, *, at_limit: bool = False) -> Setting | None:
        """The setting whose last threshold makes the mean as wanted; searched by the secant from what is known.

        That of `begin` where thresholds follow the parts.
        """
        slope, best = 1.0 / model.setup.gauge.gain_v_per_um, None
        last, volts, most = begin, begin.threshold_v - begin.bias_um / slope, _MOST_STEPS
        if model.values.correction is not None:
            volts, most = begin.threshold_v, 1
        for number in range(most):
            one = self.setting(name, model, self.rounded((*begin.thresholds_v[:-1], volts)), at_limit=at_limit)
            if one is None:
                break
            if best is None or abs(one.bias_um) < abs(best.bias_um):
                best = one
            if abs(one.bias_um) <= max(_NEAR * one.bias_error_um, _FINE_UM):
                break
            # of what was known before the first the parts may be others
            if number > 0 and one.threshold_v != last.threshold_v and one.bias_um != last.bias_um:
                slope = (one.bias_um - last.bias_um) / (one.threshold_v - last.threshold_v)
            last, volts = one, one.threshold_v - one.bias_um / slope
        return best


def _setting(name: str, model: GaugingModel, sizes: FinishedSizes, *, at_limit: bool = False) -> Setting:
    setup = model.setup
    found = len(sizes.finished_um), sizes.mean_um - setup.wanted_um, sizes.mean_error_um, sizes.sd_um
    return Setting(name, setup.gauge.time_constant_s, setup.thresholds_v, *found, at_limit)


def _missed(sizes: FinishedSizes) -> float:
    """Share of the parts that no threshold stopped, or that a stage had nothing to do with."""
    return float(np.mean(~sizes.tripped | sizes.at_once))


def _unbound(model: GaugingModel) -> dict[str, Any]:
    """The file as plain values without what would forbid other settings; tables may be changed."""
    plain = {key: value for key, value in plain_values(model.file).items() if key != "bounds"}
    for section in ("linear", "transducer"):
        if section in plain:
            plain[section] = {
                key: dict(value) if isinstance(value, dict) else value for key, value in plain[section].items()
            }
    return plain


def _made(plain: dict[str, Any]) -> GaugingModel | None:
    try:
        return gauging_model(checked_model_file(plain))
    except InputError:
        return None


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
    #: What other filters and last thresholds give, by Monte Carlo; see `gauging_settings`
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
