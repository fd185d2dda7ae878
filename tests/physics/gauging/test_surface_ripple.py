"""Grooves and run-out behind the filter, against the filter itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from selector.physics.gauging.transducer import Surface, mean_surface_um, smoothed_surface, surface_um

SURFACES = [
    Surface(150.0, runout_um=2.0),
    Surface(150.0, 1, 0.064, 40.0),
    Surface(600.0, 4, 0.3, 5.0, 1.0),
    Surface(30.0, 6, 0.5, 3.0, 0.5),
]


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("filter_s", [0.01, 0.3])
def test_smoothed_surface_is_what_the_filter_makes_of_the_surface(surface, filter_s):
    per_s = surface.workpiece_rpm / 60.0
    step_s = 1.0 / per_s / 20_000
    time = np.arange(int((12 * filter_s + 2.0 / per_s) / step_s)) * step_s
    held = surface_um(surface, per_s * (time + 0.5 * step_s))
    keep = np.exp(-step_s / filter_s)
    filtered = lfilter([1.0 - keep], [1.0, -keep], held)
    value, rate = smoothed_surface(surface, filter_s, per_s * (time + step_s))
    last = time > time[-1] - 1.0 / per_s
    size = surface.groove_depth_um + surface.runout_um
    # a held input is wrong by half a step at an edge of a groove; exp(−12) of the start is left
    atol = size * (step_s / filter_s + 1e-5)
    np.testing.assert_allclose(value[last], filtered[last], atol=atol)
    # T_Φ·y' + y = input
    met = surface_um(surface, per_s * (time + step_s))
    np.testing.assert_allclose(filter_s * rate + value, met, atol=1e-9 * size)
    # a mean over whole turns of evenly spaced points; a groove is off by one of them at each edge
    assert value[last].mean() == pytest.approx(mean_surface_um(surface), abs=2 * size * surface.grooves / 20_000 + 1e-9)


def test_a_whole_surface_adds_nothing():
    value, rate = smoothed_surface(Surface(), 0.1, np.linspace(0, 3, 7))
    assert not value.any()
    assert not rate.any()
