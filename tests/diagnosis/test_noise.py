"""The noise of a channel and the filter that makes it white."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.noise import noise_model, stretches, whitened


def coloured(phi, sd, n, seed):
    return lfilter([sd], np.r_[1.0, -np.asarray(phi)], np.random.default_rng(seed).standard_normal(n))


def comparison(time_s):
    n = len(time_s)
    return Comparison(("r1",), (0, n), np.asarray(time_s, float), (), {}, {"Z": np.zeros(n)}, (), np.zeros(n, bool))


@pytest.mark.parametrize("phi", [[], [0.85], [1.2, -0.4], [0.98]])
def test_the_filter_leaves_white_noise_of_variance_1(phi):
    noise = coloured(phi, 0.7, 6000, 3)
    parts = [slice(0, 6000)]
    model = noise_model(noise, parts)
    white = whitened(model, noise[:, None], parts)[len(model.phi) :, 0]
    assert np.std(white) == pytest.approx(1.0, abs=0.01)  # its own variance: 1 but for the few rows without a past
    correlations = [abs(np.corrcoef(white[lag:], white[:-lag])[0, 1]) for lag in range(1, 6)]
    assert max(correlations) < 4.0 / np.sqrt(6000)  # 4 standard errors of a correlation of white noise


def test_the_memory_of_the_noise_is_known():
    model = noise_model(coloured([0.85], 1.0, 20_000, 1), [slice(0, 20_000)])
    assert model.correlation_samples == pytest.approx(1.85 / 0.15, rel=0.15)  # (1 + φ)/(1 − φ); φ is known to 0.004


def test_a_burst_does_not_decide_what_the_noise_is():
    noise = coloured([0.5], 1.0, 5000, 2)
    noise[2000:2020] += 80.0
    assert noise_model(noise, [slice(0, 5000)]).phi.sum() == pytest.approx(0.5, abs=0.15)  # unclipped: 0.95


def test_gaps_end_a_stretch_and_lost_samples_do_not():
    time = np.r_[np.arange(100.0), np.arange(102.0, 199.0), np.arange(400.0, 450.0)]
    found = stretches(comparison(time), np.ones(len(time), bool))
    assert found == [slice(0, 197), slice(197, 247)]


def test_a_course_without_noise_is_no_defect():
    model = noise_model(np.zeros(200), [slice(0, 200)])
    assert model.sd == 0.0
    # what divides by it divides by what rounding leaves
    assert noise_model(np.zeros(200), [slice(0, 200)], rounding=1e-12).sd == 1e-12
