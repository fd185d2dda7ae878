"""What is ground and gauged together: gauge, relay, grinding, surface and noise, with the thresholds of the relay."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from selector.physics.gauging.gauge.characteristic import Characteristic
from selector.physics.gauging.gauge.threshold import (
    RippleCrest,
    removal_rate_um_per_s,
    stage_thresholds_v,
    voltage_rate_sd_v_per_s,
    wear_share,
)
from selector.physics.gauging.gauge.transducer import LinearGauge, Relay
from selector.physics.gauging.process import Grinding, Noise, Surface

MOST_FEED_SD = 0.25
"""Spread of a feed over parts beyond which some part would hardly be fed at all."""


_CREST_ROUNDS = 3
"""Peaks change with the allowance by less than a hundredth of what the voltage does."""


@dataclass(frozen=True)
class GaugedGrinding:
    """Grinding that a gauge stops."""

    gauge: LinearGauge  #: T_Φ, and the line by which thresholds and formulas go
    grinding: Grinding
    relay: Relay = field(default_factory=Relay)
    surface: Surface = field(default_factory=Surface)
    noise: Noise = field(default_factory=Noise)
    #: What the gauge shows in a simulation; beyond its ends it stays as it is there. None: the line.
    characteristic: Characteristic | None = None
    thresholds_v: tuple[float, ...] = ()  #: One a stage [V]; empty: those of G eq. 23, which then stand here
    #: Ripple of the smoothed voltage: the relay compares its peaks. None: there is none.
    crest: RippleCrest | None = None

    def __post_init__(self) -> None:
        if not self.thresholds_v:
            gauges = (self.gauge,) * len(self.grinding.stages)
            object.__setattr__(self, "thresholds_v", stage_thresholds_v(gauges, self.grinding, self.relay))

    @property
    def wanted_um(self) -> float:
        """x_k, the allowance at which a part is finished [µm]."""
        return self.grinding.stages[-1].until_um

    @property
    def ahead_s(self) -> float:
        """Time by which the last command must be ahead: T_Φ, delay of the relay, lag of the removal [s]."""
        return self.gauge.time_constant_s + self.relay.delay_s + self.grinding.lag_s

    @property
    def rates_um_per_s(self) -> tuple[float, ...]:
        """How fast the allowance falls in each stage, the wheel being fresh [µm/s]."""
        wear = wear_share(self.grinding)
        return tuple(removal_rate_um_per_s(stage.feed_um_per_s, wear) for stage in self.grinding.stages)

    @property
    def mean_thresholds_v(self) -> tuple[float, ...]:
        """Mean voltage when the peaks of the ripple are at each threshold, at the allowance that is then met [V].

        That allowance is of the line, T_Φ late, and at the bottom of grooves, where the relay trips on its peaks.
        """
        if self.crest is None:
            return self.thresholds_v
        gauge, surface = self.gauge, self.surface
        deep_um = surface.groove_depth_um if surface.grooves > 0 else 0.0
        found = []
        for volts, rate in zip(self.thresholds_v, self.rates_um_per_s, strict=True):
            mean_v = volts
            for _ in range(_CREST_ROUNDS):
                met_um = (mean_v - gauge.bias_v) / gauge.gain_v_per_um - rate * gauge.time_constant_s - deep_um
                crest_v = float(self.crest.crest_at(met_um, gauge.time_constant_s))
                mean_v = volts + math.copysign(crest_v, gauge.gain_v_per_um)
            found.append(mean_v)
        return tuple(found)

    @property
    def restlessness(self) -> float:
        """Rate of the smoothed noise over that of the voltage in the last stage, σ_ẏ/(|K|·a).

        Far below 1 the voltage passes its threshold once; above, noise reaches it early.
        """
        steady = abs(self.gauge.gain_v_per_um) * self.rates_um_per_s[-1]
        return voltage_rate_sd_v_per_s(self.gauge, self.noise) / steady

    def with_filter(self, time_constant_s: float) -> GaugedGrinding:
        """The same with another T_Φ and the thresholds of eq. 23 for it."""
        return replace(self, gauge=replace(self.gauge, time_constant_s=time_constant_s), thresholds_v=())
