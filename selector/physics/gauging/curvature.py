"""By how much a characteristic that is no line moves the mean size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.physics.gauging.gauged_grinding import GaugedGrinding
from selector.physics.gauging.mean_course import on_line, threshold_readings_um
from selector.physics.gauging.surface_ripple import mean_surface_um, surface_um

Vector = NDArray[np.float64]

_TURNS, _HALVINGS = 61, 50
_DELAYS, _NOISES = np.polynomial.laguerre.laggauss(12), np.polynomial.hermite_e.hermegauss(9)


def curvature_um(setup: GaugedGrinding) -> float:
    """Finished size where the mean voltage meets the last threshold, minus the same by the line; 0 for a line [µm].

    The mean is taken over what the filter remembers of the falling allowance (exponential with T_Φ), over noise and
    surface. For a weak curve −S''/S'·(a²·T_Φ² + D_x/2). Positive: parts are larger than the line has it. Of a threshold
    that the characteristic does not show, the distance to its nearer end.
    """
    curve = setup.characteristic
    if curve is None:
        return 0.0
    (lag, share), (noise, weight) = _DELAYS, _NOISES
    ahead = setup.rates_um_per_s[-1] * setup.gauge.time_constant_s
    met = surface_um(setup.surface, np.arange(_TURNS) / _TURNS)
    offsets = (ahead * lag)[:, None, None] + (setup.noise.sd_um * noise)[:, None] + met
    weights = share[:, None, None] * (weight / weight.sum())[:, None] * np.full(_TURNS, 1.0 / _TURNS)
    threshold = setup.mean_thresholds_v[-1]
    rising = setup.gauge.gain_v_per_um > 0

    def above(allowance_um: float) -> bool:
        """Whether at this allowance the mean voltage is not yet at the threshold."""
        mean_v = float(np.sum(weights * curve.voltage_at(allowance_um + offsets)))
        return (mean_v > threshold) == rising

    low, high = float(curve.allowance_um[0]), float(curve.allowance_um[-1])
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if above(middle) else (middle, high)
    by_line = threshold_readings_um(setup)[-1] - ahead - mean_surface_um(on_line(setup).surface)
    return 0.5 * (low + high) - by_line
