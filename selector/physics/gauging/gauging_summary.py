"""What does a simulated gauge amount to: its line, thresholds, finished sizes, capability, and the best filter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from selector.findings import Finding
    from selector.physics.gauging.capability import Capability
    from selector.physics.gauging.characteristic import Characteristic
    from selector.physics.gauging.finished_sizes import FinishedSizes
    from selector.physics.gauging.size_distribution import SizeDistribution
    from selector.physics.gauging.trade_off import TradeOff
    from selector.physics.gauging.transducer import LinearGauge


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
        Of finished sizes, by formula.
    sizes : FinishedSizes
        By Monte Carlo.
    capability : Capability or None
        None where the file has no tolerance.
    trade_off : TradeOff
        Error of the finished size against T_Φ.
    linear_range_um : tuple of float
        Allowances between which the line is within a micrometre of size, or a tenth of the tolerance [µm].
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
    linear_range_um: tuple[float, float]
    findings: tuple[Finding, ...]
