"""What does a simulated gauge amount to: its line, thresholds, finished sizes, capability, and the best filter."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from selector.errors import ModelFileError
from selector.findings import Finding
from selector.physics.gauging.capability import Capability, capability
from selector.physics.gauging.characteristic import Characteristic, linear_range_um
from selector.physics.gauging.finished_sizes import FinishedSizes, finished_sizes
from selector.physics.gauging.gauging_advice import Setting, gauging_settings
from selector.physics.gauging.gauging_model import GaugingModel, GaugingSimulation, Progress
from selector.physics.gauging.model_findings import mattering_um
from selector.physics.gauging.part_steps import FEWEST_SIZES, feeds_s, longest_step_s, steps_in
from selector.physics.gauging.size_distribution import SizeDistribution, size_distribution
from selector.physics.gauging.size_findings import size_findings
from selector.physics.gauging.stage_ends import threshold_findings
from selector.physics.gauging.trade_off import TradeOff, trade_off
from selector.physics.gauging.transducer import LinearGauge

_TRIAL_STEPS, _FEWEST_TRIALS = 10_000_000, 200
"""Steps of all parts of one trial of other thresholds: a second or so; and parts that it has at least."""


@dataclass(frozen=True)
class StageSummary:
    """One feed, and the voltage that ends it.

    Attributes
    ----------
    until_um : float
        Allowance at which it is to end [µm].
    feed_um_per_s, rate_um_per_s : float
        Infeed, and how fast the allowance falls by it: a [µm/s].
    threshold_v : float
        Voltage of the relay [V].
    """

    until_um: float
    feed_um_per_s: float
    rate_um_per_s: float
    threshold_v: float


@dataclass(frozen=True)
class GaugingSummary:
    """What a simulation of gauging amounts to.

    Attributes
    ----------
    gauge : LinearGauge
        The line at the end of the last stage.
    characteristic : Characteristic or None
        Of a whole gauge; None of a linear one.
    stages : tuple of StageSummary
        In the order of the grinding.
    formula : SizeDistribution
        Of finished sizes, by first passage.
    sizes : FinishedSizes
        By Monte Carlo: of the parts of the file, or of as many such batches as make 2000 parts.
    capability : Capability or None
        None where the file has no tolerance.
    trade_off : TradeOff
        Error of the finished size against T_Φ.
    settings : tuple of Setting
        What other filters and last thresholds give, by Monte Carlo; see `gauging_advice.gauging_settings`.
    linear_range_um : tuple of float
        Allowances between which the line is within `linear_within_um` of size; of a linear gauge all that is ground
        [µm].
    linear_within_um : float
        A tenth of the tolerance, 1 µm without one [µm].
    findings : tuple of Finding
        What is odd about the sizes.
    """

    gauge: LinearGauge
    characteristic: Characteristic | None
    stages: tuple[StageSummary, ...]
    formula: SizeDistribution
    sizes: FinishedSizes
    capability: Capability | None
    trade_off: TradeOff
    settings: tuple[Setting, ...]
    linear_range_um: tuple[float, float]
    linear_within_um: float
    findings: tuple[Finding, ...]


def gauging_summary(
    model: GaugingModel, simulation: GaugingSimulation | None = None, *, progress: Progress | None = None
) -> GaugingSummary:
    """What gauging by this model amounts to; `simulation` of it lends its seed.

    `progress` is told how many parts of how many are done, and what is being done.

    Raises
    ------
    ModelFileError
        No part reaches its thresholds.
    InputError
        As `size_distribution` and `trade_off`.
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
    formula = size_distribution(setup, parts=parts)
    tolerance, curve = model.values.tolerance, model.characteristic
    known = None if tolerance is None else capability(sizes.finished_um, tolerance)
    filters = trade_off(setup, parts=parts)
    settings = gauging_settings(model, sizes, filters, lambda other: _sizes(other, seed, progress, is_trial=True))
    return GaugingSummary(
        gauge=setup.gauge,
        characteristic=curve,
        stages=tuple(
            StageSummary(stage.until_um, stage.feed_um_per_s, rate, volts)
            for stage, rate, volts in zip(setup.grinding.stages, setup.rates_um_per_s, setup.thresholds_v, strict=True)
        ),
        formula=formula,
        sizes=sizes,
        capability=known,
        trade_off=filters,
        settings=settings,
        linear_range_um=(setup.wanted_um, setup.grinding.allowance_um)
        if curve is None
        else linear_range_um(curve, setup.gauge, mattering_um(model)),
        linear_within_um=mattering_um(model),
        findings=(*threshold_findings(model, seed), *size_findings(model, formula, sizes, known, settings)),
    )


def _sizes(model: GaugingModel, seed: int, progress: Progress | None, *, is_trial: bool = False) -> FinishedSizes:
    """Batches of the file's parts; where no part differs from the next, one long batch; of a trial some seconds' worth.

    Each part has the noise, feed and start that belong to its number, whatever the model.
    """
    parts, enough = model.file.run.parts, FEWEST_SIZES
    if is_trial:
        enough = int(np.clip(_TRIAL_STEPS / _steps_of_part(model), _FEWEST_TRIALS, FEWEST_SIZES))
    batch = parts if model.is_wearing else enough if is_trial else max(parts, enough)
    batches = math.ceil(enough / batch)
    seeds = (seed, *np.random.SeedSequence(seed).generate_state(batches - 1, np.uint64))

    def told(done: int, of: int) -> None:
        if progress is not None:
            progress(len(found) * of + done, batches * of, "settings" if is_trial else "sizes")

    found: list[FinishedSizes] = []
    for one in seeds:
        found.append(finished_sizes(model.setup, batch, seed=int(one), progress=told))
    columns = {one.name: [getattr(batch, one.name) for batch in found] for one in fields(FinishedSizes)}
    return FinishedSizes(**{name: np.concatenate(values) for name, values in columns.items()})


def _steps_of_part(model: GaugingModel) -> float:
    made = model.values
    duration_s = feeds_s(made.grinding, made.relay, [stage.until_um for stage in made.grinding.stages])
    step_s = longest_step_s(made.filter_s, made.grinding, made.surface, made.noise)
    return max(steps_in(duration_s, step_s, made.surface, made.relay), 1.0)


__all__ = ["FEWEST_SIZES", "GaugingSummary", "StageSummary", "gauging_summary"]
