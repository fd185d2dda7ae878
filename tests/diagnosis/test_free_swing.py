"""What swings freely, beside a linear simulation of it: a pendulum's stiffness falls with its amplitude."""

import numpy as np
from scipy.integrate import solve_ivp

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.workflow import diagnosis
from tests.diagnosis.effects.concealed_truths import comparison_of

_AMPLITUDES_RAD = (0.9, 0.5, 0.7)
_NOISE_RAD = 0.003
_STEP_S = 0.01


def _swings(*, gravity_by_the_sine: bool, seed: int = 0) -> Comparison:
    """Three swings of 15 s, let go at rest; the simulation is the linear oscillator of small amplitudes."""
    generator = np.random.default_rng(seed)
    w, damping = 2.0 * np.pi * generator.uniform(0.8, 1.2), generator.uniform(0.004, 0.012)
    time = np.arange(1500) * _STEP_S
    runs = []
    for amplitude in _AMPLITUDES_RAD:
        linear, true = (_angle(time, amplitude, w, damping, sine) for sine in (False, gravity_by_the_sine))
        runs.append((time, {"angle": true + generator.normal(0.0, _NOISE_RAD, len(time))}, {"angle": linear}))
    return comparison_of(runs, {"angle": "position"}, ("angle",))


def _angle(time: np.ndarray, amplitude: float, w: float, damping: float, sine: bool) -> np.ndarray:
    def rates(_: float, state: np.ndarray) -> list[float]:
        angle, speed = state
        return [speed, -w * w * (np.sin(angle) if sine else angle) - 2.0 * damping * w * speed]

    return solve_ivp(rates, (0.0, time[-1]), [amplitude, 0.0], t_eval=time, rtol=1e-8, atol=1e-10, max_step=_STEP_S).y[
        0
    ]


def test_a_pendulum_beside_a_linear_oscillator_is_softer_at_large_amplitude() -> None:
    answer = diagnosis(_swings(gravity_by_the_sine=True))
    assert answer.verdict == "missing-physics"
    assert [effect.id for effect in answer.effects] == ["vibration.hardening"]
    # sin θ = θ − θ³/6: a slope of 1 − θ²/2 at 0.9 rad, whose next term θ⁴/24 adds a fifteenth
    softer = answer.effects[0].parameters["stiffening"]
    assert -100.0 * 0.9**2 / 2.0 < softer.value < 0.85 * -100.0 * 0.9**2 / 2.0
    # what is left unseen is the noise and the terms of higher order; recalibration alone leaves forty times as much
    fit = answer.fit["angle"]
    assert fit.heldout.rmse_after < 2.0 * _NOISE_RAD < 0.05 * fit.recalibrated_heldout
    assert "falls with amplitude" in answer.effects[0].statement


def test_a_linear_oscillator_beside_its_own_simulation_lacks_nothing() -> None:
    answer = diagnosis(_swings(gravity_by_the_sine=False))
    assert answer.verdict == "nothing-missing"
