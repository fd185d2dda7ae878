"""Filter and threshold: bias and variance against T_Φ, their best, and Monte Carlo at some of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.physics.gauging.gauge.transducer import Relay
from selector.physics.gauging.grinding.gauged_grinding import finished_sizes
from selector.physics.gauging.process import Grinding, Noise, Stage
from selector.physics.gauging.sizes.size_distribution import size_distribution, trade_off
from tests.physics.gauging.set_ups import set_up

SETUP = set_up(Grinding(30.0, (Stage(20.0, 12.0), Stage(5.0, 2.0)), feed_sd=0.05), noise=Noise(0.5, 30.0))


def rms_um(found):
    return np.hypot(found.bias_um, found.sd_um)


def test_errors_are_those_of_monte_carlo():
    """2000 parts with each filter; first passage has the mean to 4 % of the spread, the spread to 2 %."""
    filters = np.array([0.003, 0.03, 0.1, 0.3])
    found = trade_off(SETUP, time_constants_s=filters)
    batches = [finished_sizes(SETUP.with_filter(one), 2000, seed=1).finished_um for one in filters.tolist()]
    wrong = [(sizes - SETUP.wanted_um) ** 2 for sizes in batches]
    squares = np.array([one.mean() for one in wrong])
    errors = np.array([one.std() / np.sqrt(len(one)) for one in wrong])
    off = 2 * (0.04 * np.abs(found.bias_um) * found.sd_um + 0.02 * found.sd_um**2)
    assert (np.abs(rms_um(found) ** 2 - squares) < 4 * errors + off).all()


def test_the_best_is_better_than_its_neighbours():
    found = trade_off(SETUP)
    assert not found.at_edge
    assert found.best_rms_um <= rms_um(found).min() * (1 + 1e-6)
    # the best lies on a smooth curve between points that are 20 % apart
    assert found.best_rms_um == pytest.approx(rms_um(found).min(), rel=0.01)
    around = trade_off(SETUP, time_constants_s=found.best_s * np.array([0.8, 1.0, 1.25]))
    assert rms_um(around)[1] <= rms_um(around)[[0, 2]].min()
    assert rms_um(around)[1] == pytest.approx(found.best_rms_um, rel=1e-9)
    assert found.present_s == 0.05
    assert found.present_rms_um > found.best_rms_um
    # bias falls with T_Φ, as far as noise alone makes it
    early = found.time_constant_s < 0.1
    assert (np.diff(found.bias_um[early]) < 0).all()


def test_variance_grows_with_the_spread_of_the_feed():
    steady = trade_off(replace(SETUP, grinding=replace(SETUP.grinding, feed_sd=0.0)))
    spread = trade_off(replace(SETUP, grinding=replace(SETUP.grinding, feed_sd=0.15)))
    assert spread.best_s < trade_off(SETUP).best_s
    np.testing.assert_array_equal(steady.time_constant_s, spread.time_constant_s)
    assert (spread.sd_um > steady.sd_um).all()


def test_a_centred_threshold_centres():
    setup = replace(SETUP, noise=Noise(1.0, 30.0))
    last_v = trade_off(setup, time_constants_s=[0.05, 0.1]).centred_threshold_v[0]
    centred = replace(setup, thresholds_v=(*setup.thresholds_v[:-1], last_v))
    assert setup.thresholds_v[0] == centred.thresholds_v[0]
    assert size_distribution(setup).mean_um - 2.0 > 0.2
    assert size_distribution(centred).mean_um == pytest.approx(2.0, abs=1e-6)
    sizes = finished_sizes(centred, 2000, seed=2)
    # first passage has the mean to 4 % of the spread
    assert abs(sizes.mean_um - 2.0) < 0.04 * sizes.sd_um + 4 * sizes.mean_error_um
    found = trade_off(setup)
    assert found.centred_rms_um == pytest.approx(found.sd_um.min(), rel=0.01)
    assert found.centred_rms_um <= found.best_rms_um
    at = int(np.argmin(np.abs(found.time_constant_s - 0.05)))
    shift = (found.centred_threshold_v - found.threshold_v)[at] / setup.gauge.gain_v_per_um
    assert shift == pytest.approx(-found.bias_um[at], rel=1e-12)


def test_an_edge_is_told_of_the_centred_optimum_too():
    """Noise of the relay: the centred optimum is the quickest filter, that of eq. 23 lies within."""
    found = trade_off(set_up(replace(SETUP.grinding, feed_sd=0.1), relay=Relay(0.02, 0.005)))
    ends = found.time_constant_s[[0, -1]]
    assert found.best_s not in ends or found.centred_s in ends
    assert found.centred_s in ends
    assert found.at_edge


def test_the_same_bits_every_time():
    first, again = trade_off(SETUP), trade_off(SETUP)
    for name, value in vars(first).items():
        np.testing.assert_array_equal(value, getattr(again, name))


def test_no_noise_asks_for_no_filter():
    quiet = set_up(replace(SETUP.grinding, feed_sd=0.1), relay=Relay())
    found = trade_off(quiet)
    assert found.at_edge
    assert found.best_s == found.time_constant_s[0]
