"""Which filters and last thresholds are worth comparing: what there is, and what would make sizes better."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from selector.physics.gauging.gauging_summary import GaugingSummary

MONTE_CARLO, FORMULA = "Monte Carlo", "formula"


@dataclass(frozen=True)
class Setting:
    """A filter and a last threshold, and what they make of the sizes.

    Attributes
    ----------
    name : str
        ``"present"``, ``"centred"``, ``"best-filter"`` or ``"best-filter-centred"``.
    by : str
        `MONTE_CARLO` or `FORMULA`: where bias and standard deviation are from.
    time_constant_s, threshold_v : float
        T_Φ [s]; voltage of the last command [V].
    bias_um, sd_um : float
        Mean size less the wanted one; standard deviation [µm].
    """

    name: str
    by: str
    time_constant_s: float
    threshold_v: float
    bias_um: float
    sd_um: float

    @property
    def rms_um(self) -> float:
        """√(bias² + variance) [µm]."""
        return math.hypot(self.bias_um, self.sd_um)


def gauging_settings(summary: GaugingSummary) -> tuple[Setting, Setting, Setting, Setting]:
    """As it is; its last threshold moved so that the mean is as wanted; the best filter, by eq. 23 and centred.

    The first two are by Monte Carlo, the others by the formula of the trade-off.
    """
    one, sizes, stage = summary.trade_off, summary.sizes, summary.stages[-1]
    bias_um = sizes.mean_um - stage.until_um
    at = np.log(one.time_constant_s)
    best_bias_um = float(np.interp(math.log(one.best_s), at, one.bias_um))
    best_sd_um = math.sqrt(max(one.best_rms_um**2 - best_bias_um**2, 0.0))
    centred_v = stage.threshold_v - summary.gauge.gain_v_per_um * bias_um
    return (
        Setting("present", MONTE_CARLO, one.present_s, stage.threshold_v, bias_um, sizes.sd_um),
        Setting("centred", MONTE_CARLO, one.present_s, centred_v, 0.0, sizes.sd_um),
        Setting("best-filter", FORMULA, one.best_s, one.best_threshold_v, best_bias_um, best_sd_um),
        Setting("best-filter-centred", FORMULA, one.centred_s, one.centred_best_v, 0.0, one.centred_rms_um),
    )
