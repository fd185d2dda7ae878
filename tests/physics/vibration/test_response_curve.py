"""A response over a range of frequencies, as a curve."""

from __future__ import annotations

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.vibration.final_motion import TOLERANCE, response_curve


def resonances(frequency_hz, places=(40.0, 41.0, 333.0), loss=(0.01, 0.02, 0.003), size=(1.0, -2.0, 1e-3)):
    """Two outputs of three resonances each, one of them small and sharp."""
    parts = [a / (1.0 + 1j * eta - (frequency_hz / f0) ** 2) for f0, eta, a in zip(places, loss, size, strict=True)]
    return np.array([sum(parts), parts[0] - 1j * parts[2]])


def error(curve, solved, low, high):
    """Largest difference at frequencies that the curve was not made at, as a share of the largest response."""
    frequency = np.random.default_rng(1).uniform(low, high, 20_000)
    exact = solved(frequency)
    return (np.abs(curve.at(frequency) - exact).max(axis=1) / np.abs(exact).max(axis=1)).max()


@pytest.mark.parametrize(("low", "high"), [(5.0, 600.0), (0.0, 600.0), (39.9, 40.1), (332.0, 332.5), (450.0, 451.0)])
def test_as_good_as_solving_everywhere(low, high):
    curve = response_curve(resonances, low, high, loss_factor=0.003)
    # between midpoints a cubic spline is at most a little worse than at them
    assert error(curve, resonances, low, high) < 2.0 * TOLERANCE
    assert curve.points < 12_000


def test_a_jump_stays_a_jump():
    def solved(frequency):
        return np.where(frequency > 100.0, 2.0 + 0.01j * frequency, 1.0)[None]

    curve = response_curve(solved, 50.0, 200.0, loss_factor=0.05, jump_hz=100.0)
    at = np.array([150.0, 50.0, 100.0, 100.0 * (1.0 + 1e-8), 200.0, 75.0])
    assert curve.at(at) == pytest.approx(solved(at), rel=1e-9)
    assert len(curve.pieces) == 2
    for jump_hz in (10.0, 200.0, 500.0):
        assert len(response_curve(resonances, 50.0, 200.0, loss_factor=0.05, jump_hz=jump_hz).pieces) == 1


def test_one_frequency_is_a_curve_too():
    for at in (40.0, 0.0):
        curve = response_curve(resonances, at, at, loss_factor=0.01)
        assert curve.at(np.array([at])) == pytest.approx(resonances(np.array([at])), rel=1e-12)


def test_a_peak_without_end_is_refused():
    def solved(frequency):
        return (1.0 / (1.0 - (frequency / np.pi) ** 2 + 0j))[None]

    with pytest.raises(InputError, match=r"near 3\.14159") as caught:
        response_curve(solved, 1.0, 10.0, loss_factor=0.0)
    assert caught.value.where == "joints"
