from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from selector.physics.drive.closed_loop import StateSpace
from tests.physics.drive.axis_system import linearise


@dataclass(frozen=True)
class Pendulum:
    """x'' = −sin x − damping·x' + u: non-linear, with known derivatives everywhere."""

    damping: float = 0.3
    states: tuple[str, ...] = ("angle", "rate")
    inputs: tuple[str, ...] = ("torque",)
    outputs: tuple[str, ...] = ("height",)

    def derivative(self, t_s, x, u):
        return np.array([x[1], -np.sin(x[0]) - self.damping * x[1] + u[0]])

    def output(self, t_s, x, u):
        return np.array([1.0 - np.cos(x[0]) + 2.0 * u[0]])


def oscillator(damping=0.0):
    return StateSpace(
        A=np.array([[0.0, 1.0], [-4.0, -damping]]),
        B=np.array([[0.0], [4.0]]),
        C=np.array([[1.0, 0.0]]),
        D=np.array([[0.5]]),
    )


def test_a_held_input_gives_the_closed_form_at_any_length_of_step():
    # x'' = 4(1 − x) from rest: x = 1 − cos 2t, however far the time is
    for time in (0.1, 0.7, 3.0, 50.0):
        decay, load = oscillator().step_matrices(time)
        # 100 rad of phase from one matrix exponential: a few hundred roundings
        assert load[0, 0] == pytest.approx(1 - np.cos(2 * time), abs=1e-12)
        np.testing.assert_allclose(decay[0], [np.cos(2 * time), np.sin(2 * time) / 2], atol=1e-12)


@pytest.mark.parametrize(("angle", "torque"), [(0.0, 0.0), (1.2, 0.4), (np.pi, -3.0)])
def test_linearised_pendulum_has_the_known_derivatives(angle, torque):
    found = linearise(Pendulum(), [angle, 0.1], [torque])
    # a central difference of step 6e-6 has an error of about 1e-10
    np.testing.assert_allclose(found.A, [[0, 1], [-np.cos(angle), -0.3]], atol=1e-9)
    np.testing.assert_allclose(found.B, [[0], [1]], atol=1e-9)
    np.testing.assert_allclose(found.C, [[np.sin(angle), 0]], atol=1e-9)
    np.testing.assert_allclose(found.D, [[2]], atol=1e-9)


def test_poles():
    system = StateSpace(np.diag([-0.5, 0.0, -0.01, 0.2]), np.zeros((4, 0)), np.zeros((0, 4)), np.zeros((0, 0)))
    np.testing.assert_allclose(np.sort(system.poles), [-0.5, -0.01, 0.0, 0.2], atol=1e-15)
    np.testing.assert_allclose(np.sort(oscillator(0.4).poles.imag), [-np.sqrt(3.96), np.sqrt(3.96)], rtol=1e-12)
