"""Noise that wanders slowly is told and is no structure; what recalibration gains is shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from selector.diagnosis.mismatch.background import spectrum, wandering
from selector.diagnosis.mismatch.omnibus import told_of_wandering
from selector.diagnosis.workflow import diagnosis
from tests.diagnosis.made import STEP_S, coloured, comparison

N = 400
MEMORY = 40.0


def wanders(seed, n=3 * N):
    kept = np.exp(-1.0 / MEMORY)
    drawn = np.random.default_rng(seed).standard_normal(n + 400)
    return np.asarray(lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], drawn))[400:]


def test_variances_and_memories_are_those_of_the_noise():
    noise = 0.5 * np.random.default_rng(1).standard_normal(20_000) + wanders(2, 20_000)
    (variance,), memory = wandering(spectrum(noise[None, :], [np.arange(20_000)]))
    slow = memory > 10.0
    # 20 000 samples are 250 memories: the variance is known to about 9 %.
    assert variance[slow].sum() == pytest.approx(1.0, rel=0.25)
    # Of what is quicker only periods above 6.5 samples are fitted; white and a memory of a sample differ little there.
    assert variance[~slow].sum() == pytest.approx(0.25, rel=0.2)
    assert np.exp(np.log(memory[slow]) @ variance[slow] / variance[slow].sum()) == pytest.approx(MEMORY, rel=0.3)


def test_what_wanders_is_told_with_its_memory_and_white_noise_is_not():
    noise = {"Z": wanders(3), "Y": coloured("white", 3 * N, np.random.default_rng(4))}
    (found,) = told_of_wandering(comparison(noise), noise, set())
    assert (found.id, found.where.channel) == ("slow-remainder", "Z")
    # 30 memories say the time to a factor of about two.
    assert 0.4 < found.evidence["correlation_time_s"] / (MEMORY * STEP_S) < 2.5


def test_a_wrong_gain_under_noise_that_wanders_is_miscalibration():
    of = comparison({"Z": 0.05 * wanders(5)})
    of = replace(of, simulated={"Z": 0.8 * of.simulated["Z"] + 3.0})
    found = diagnosis(of)
    assert (found.verdict, found.effects) == ("miscalibrated", ())
    held = found.fit["Z"].heldout
    assert held.rmse_after == found.fit["Z"].recalibrated_heldout < 0.1 * held.rmse_before
    assert [one.id for one in found.findings] == ["slow-remainder"]


def test_recalibration_gains_also_where_something_is_unexplained():
    rng = np.random.default_rng(6)
    course = np.zeros(3 * N)
    for first in rng.integers(10, 3 * N - 20, 25):
        course[first : first + 5] = rng.choice([-1.0, 1.0])
    of = comparison({"Z": 0.6 * course + 0.2 * coloured("white", 3 * N, rng)})
    of = replace(of, simulated={"Z": 0.8 * of.simulated["Z"] + 3.0})
    found = diagnosis(of)
    assert found.verdict == "unexplained"
    assert found.fit["Z"].heldout.rmse_after < 0.5 * found.fit["Z"].heldout.rmse_before
