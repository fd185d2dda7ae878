"""Recorded forces that were already there: static, steady, and with what is not known at both ends."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import fft, linalg, signal

from selector.physics.vibration.final_motion import final_receptance
from selector.physics.vibration.recorded_force import FADED, force_answer, ring_time_s
from selector.physics.vibration.structure import (
    GROUND,
    Joint,
    Line,
    Member,
    Source,
    Structure,
    masses_kg,
    stiffness_matrix,
)

STEP_S = 5e-4
TIME_S = np.arange(4000) * STEP_S
FINALS = {"tool": "tool", "workpiece": "workpiece"}
STRUCTURE = Structure(
    (Member("workpiece", 400.0), Member("tool", 250.0)),
    (
        Joint(("workpiece", GROUND), 2e8, 0.5),
        Joint(("tool", "workpiece"), 2.5e7, 0.3),
        Joint(("tool", GROUND), 1e7, 0.6),
    ),
)
SOURCE = Source("motor", "tool", (Line(frequency_hz=1.0, force_n=1.0),))


def answer(force_n, step_s=STEP_S):
    return force_answer(STRUCTURE, SOURCE, force_n, step_s, FINALS)


def response(frequency_hz):
    return final_receptance(STRUCTURE, SOURCE, np.atleast_1d(frequency_hz), FINALS).motion_m_per_n


def test_a_constant_or_growing_force_deflects_statically_from_the_first_sample_to_the_last():
    static = np.linalg.inv(stiffness_matrix(STRUCTURE))[::-1, 1].real  # tool, workpiece
    for force in (np.full(4000, 10.0), 5.0 - 3.0 * TIME_S, np.full(3, 10.0), np.full(1, 10.0)):
        found = answer(force)
        # compliance in step with the force; rounding
        assert found == pytest.approx(np.outer(static, force), rel=1e-9)


@pytest.mark.parametrize("frequency_hz", [31.0, 48.0, 300.0, 900.0])
def test_a_sine_is_steady_from_the_first_sample_to_the_last(frequency_hz):
    turning = np.exp(2j * np.pi * frequency_hz * TIME_S + 0.4j)
    found = answer(50.0 + 20.0 * turning.imag)
    exact = 50.0 * response(0.0).real + 20.0 * (response(frequency_hz) * turning).imag
    # 1e-3 of what comes up twice a ring-down before; the level of the static force takes in a part of a period of the
    # sine, answered without loss: 20 N/(2π·31 Hz·0.5 s) of η = 10 %
    assert np.abs(found - exact).max() < 3e-3 * 20.0 * np.abs(response(frequency_hz)).max()


def test_noise_is_exact_but_for_what_acted_before_and_after():
    random = np.random.default_rng(3)
    ring = int(ring_time_s(STRUCTURE) / STEP_S)
    long = random.normal(size=1 << 16)
    exact = fft.irfft(response(fft.rfftfreq(len(long), STEP_S)) * fft.rfft(long), len(long))
    largest = np.abs(exact).max(axis=1)
    for first in range(8000, 56000, 8000):
        off = np.abs(answer(long[first : first + 4000]) - exact[:, first : first + 4000]) / largest[:, None]
        # what acted before has faded
        assert off[:, ring:-ring].max() < 4.0 * FADED
        assert off[:, :ring].max() > 0.05 > 0.02 > off[:, -1].max()


def test_noise_moves_it_as_a_simulation_in_time_with_the_same_loss_of_every_mode():
    mass, stiffness = masses_kg(STRUCTURE), stiffness_matrix(STRUCTURE)
    squares, shapes = linalg.eigh(stiffness.real, np.diag(mass))
    loss = np.diag(shapes.T @ stiffness.imag @ shapes) / squares
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag(squares), -np.diag(loss * np.sqrt(squares))]])
    b = np.concatenate((np.zeros(2), shapes[1]))[:, None]
    c = np.hstack((shapes[::-1], np.zeros((2, 2))))
    random = np.random.default_rng(5).normal(size=8000)
    # slow against the sampling, so that straight lines between samples, which lsim takes, and the transform agree
    force = signal.sosfiltfilt(signal.butter(4, 100.0, fs=1 / STEP_S, output="sos"), random)
    exact = signal.lsim((a, b, c, np.zeros((2, 1))), force, np.arange(8000) * STEP_S)[1].T
    found = answer(force)
    ring = int(ring_time_s(STRUCTURE) / STEP_S)
    # below its resonance a hysteretic mode loses more than a viscous one: shares of η = 5 to 8 %
    assert np.abs(found - exact)[:, ring:].max() < 0.1 * np.abs(exact).max()
    assert np.std((found - exact)[0, ring:]) < 0.05 * np.std(exact[0])


def test_a_step_is_answered_by_what_was_before_and_what_is_behind_it():
    force = np.where(TIME_S < 1.0, 0.0, 100.0)
    found, after = answer(force), 100.0 * response(0.0).real
    # joints that lose the same at every frequency creep for ever, η/π of the motion for every e-fold of the time: 3 %;
    # that the answer comes before its cause is the same
    assert np.abs(found[:, -1:] - after).max() < 0.1 * after.max()
    assert np.abs(found[:, 0]).max() < 0.1 * after.max()


def test_a_blow_at_the_beginning_is_not_taken_for_one_of_many():
    blow = np.where(TIME_S < 0.004, 100.0 * np.sin(np.pi * TIME_S / 0.004) ** 2, 0.0)
    later = np.roll(blow, 1000)
    early, late = answer(blow), answer(later)
    # half a second before the blow nothing moves but the trace that hysteretic joints have: 1e-3
    assert np.abs(late[:, 1000:] - early[:, :-1000]).max() < 0.01 * np.abs(late).max()
