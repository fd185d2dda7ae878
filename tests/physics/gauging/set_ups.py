"""Small gauged grindings that the tests of sizes share."""

from __future__ import annotations

from selector.physics.gauging.gauged_grinding import GaugedGrinding
from selector.physics.gauging.transducer import Grinding, LinearGauge, Noise, Relay, Stage, Surface

GAUGE = LinearGauge(-0.01, 3.0, 0.05)
TWO_STAGES = Grinding(22.0, (Stage(20.0, 12.0), Stage(5.0, 2.0)), allowance_sd_um=1.0)


def set_up(
    grinding: Grinding = TWO_STAGES,
    *,
    noise: Noise | None = None,
    relay: Relay | None = None,
    surface: Surface | None = None,
    gauge: LinearGauge = GAUGE,
) -> GaugedGrinding:
    """Two stages by a line of 10 mV/µm, T_Φ = 50 ms, the relay late by 20 ms; nothing disturbs unless said."""
    return GaugedGrinding(
        gauge,
        grinding,
        Relay(0.02) if relay is None else relay,
        Surface() if surface is None else surface,
        Noise() if noise is None else noise,
    )
