from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.system import StateSpace, linearise, simulate


@dataclass(frozen=True)
class Pendulum:
    """x'' = −sin x − damping·x' + u: non-linear, with known derivatives everywhere."""

    damping: float = 0.3
    states: tuple[str, ...] = ("angle", "rate")
    inputs: tuple[str, ...] = ("torque",)
    outputs: tuple[str, ...] = ("height",)
    places: tuple[str, ...] = ("pivot",)

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
        states=("x", "v"),
        inputs=("u",),
        outputs=("y",),
    )


def test_a_held_input_gives_the_closed_form_at_any_spacing_of_times():
    # x'' = 4(1 − x) from rest: x = 1 − cos 2t, however far apart the times are
    time = np.array([0.0, 0.1, 0.7, 3.0, 50.0])
    result = simulate(oscillator(), time, np.ones((5, 1)), [0.0, 0.0])
    # 100 rad of phase from one matrix exponential: a few hundred roundings
    np.testing.assert_allclose(result.states[:, 0], 1 - np.cos(2 * time), atol=1e-12)
    np.testing.assert_allclose(result.outputs[:, 0], 1 - np.cos(2 * time) + 0.5, atol=1e-12)


def test_an_input_acts_from_its_own_time_to_the_next():
    time = np.array([0.0, 1.0, 2.5, 4.0])
    integrator = StateSpace(
        np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)), ("x",), ("u",), ("y",)
    )
    result = simulate(integrator, time, [[2.0], [-1.0], [0.0], [77.0]], [10.0])
    # exact in floating point up to the rounding of expm
    np.testing.assert_allclose(result.states[:, 0], [10.0, 12.0, 10.5, 10.5], rtol=1e-14)


def test_the_solver_for_any_system_agrees_with_exact_steps():
    exact = oscillator(0.5)

    @dataclass(frozen=True)
    class Hidden:
        """The same equations, not known to be linear."""

        states = exact.states
        inputs = exact.inputs
        outputs = exact.outputs
        places = exact.places
        derivative = staticmethod(exact.derivative)
        output = staticmethod(exact.output)

    time = np.linspace(0.0, 20.0, 81)
    inputs = np.where(time[:, None] < 7.3, 1.0, -0.5)
    expected = simulate(exact, time, inputs, [0.2, 0.0])
    for solver in ("LSODA", "Radau", "BDF"):
        found = simulate(Hidden(), time, inputs, [0.2, 0.0], solver=solver)
        # a local tolerance of 1e-8 over some hundred steps
        np.testing.assert_allclose(found.states, expected.states, atol=2e-5, err_msg=solver)
    np.testing.assert_allclose(found.outputs, expected.outputs, atol=2e-5)


def test_no_step_reaches_over_a_short_pulse():
    # a solver that steps over changes misses a pulse of 1 ms in 1000 s of silence
    @dataclass(frozen=True)
    class Sum:
        states = ("x",)
        inputs = ("u",)
        outputs = ()
        places = ()

        def derivative(self, t_s, x, u):
            return u

        def output(self, t_s, x, u):
            return np.zeros(0)

    result = simulate(Sum(), [0.0, 500.0, 500.001, 1000.0], [[0.0], [1000.0], [0.0], [0.0]], [0.0])
    assert result.states[-1, 0] == pytest.approx(1.0, rel=1e-7)
    assert result.outputs.shape == (4, 0)


@pytest.mark.parametrize(("angle", "torque"), [(0.0, 0.0), (1.2, 0.4), (np.pi, -3.0)])
def test_linearised_pendulum_has_the_known_derivatives(angle, torque):
    found = linearise(Pendulum(), [angle, 0.1], [torque])
    # a central difference of step 6e-6 has an error of about 1e-10
    np.testing.assert_allclose(found.A, [[0, 1], [-np.cos(angle), -0.3]], atol=1e-9)
    np.testing.assert_allclose(found.B, [[0], [1]], atol=1e-9)
    np.testing.assert_allclose(found.C, [[np.sin(angle), 0]], atol=1e-9)
    np.testing.assert_allclose(found.D, [[2]], atol=1e-9)
    assert (found.states, found.inputs, found.places) == (("angle", "rate"), ("torque",), ("pivot",))


def test_small_swings_follow_the_linear_system():
    time = np.linspace(0, 10, 101)
    inputs = np.zeros((101, 1))
    small = 1e-3
    full = simulate(Pendulum(), time, inputs, [small, 0.0])
    linear = simulate(linearise(Pendulum(), [0, 0], [0]), time, inputs, [small, 0.0])
    # what is left out of the sine: x³/6 relative to x, over ten seconds
    np.testing.assert_allclose(full.states, linear.states, atol=small * small**2)


def test_poles_and_time_constants():
    system = StateSpace(
        np.diag([-0.5, 0.0, -0.01, 0.2]), np.zeros((4, 0)), np.zeros((0, 4)), np.zeros((0, 0)), tuple("abcd"), (), ()
    )
    np.testing.assert_allclose(system.poles, [0.2, 0.0, -0.01, -0.5], atol=1e-15)
    np.testing.assert_allclose(system.time_constants_s, [-5.0, np.inf, 100.0, 2.0], rtol=1e-12)
    np.testing.assert_allclose(np.sort(oscillator(0.4).poles.imag), [-np.sqrt(3.96), np.sqrt(3.96)], rtol=1e-12)


def test_matrices_are_read_only_and_fit_their_names():
    system = oscillator()
    with pytest.raises(ValueError, match="read-only"):
        system.A[0, 0] = 1.0
    with pytest.raises(ValueError, match="B has the shape"):
        StateSpace(np.eye(2), np.ones((2, 2)), np.ones((1, 2)), np.ones((1, 1)), ("x", "v"), ("u",), ("y",))


@pytest.mark.parametrize(
    ("time", "inputs", "start", "found"),
    [
        ([0.0, 1.0, 1.0], np.zeros((3, 1)), [0.0, 0.0], "do not increase"),
        ([0.0], np.zeros((1, 1)), [0.0, 0.0], "fewer than two"),
        ([0.0, np.nan], np.zeros((2, 1)), [0.0, 0.0], "do not increase"),
        ([0.0, 1.0], np.zeros((3, 1)), [0.0, 0.0], "inputs of shape"),
        ([0.0, 1.0], [[0.0], [np.nan]], [0.0, 0.0], "missing values"),
        ([0.0, 1.0], np.zeros((2, 1)), [0.0], "start of shape"),
    ],
)
def test_unusable_requests_are_refused(time, inputs, start, found):
    with pytest.raises(InputError, match=found):
        simulate(oscillator(), time, inputs, start)


def test_states_that_run_away_are_told():
    @dataclass(frozen=True)
    class Escape:
        """x' = x² + u leaves every bound at t = 1."""

        states = ("x",)
        inputs = ("u",)
        outputs = ("x",)
        places = ()

        def derivative(self, t_s, x, u):
            return np.minimum(x, 1e150) ** 2 + u

        def output(self, t_s, x, u):
            return x

    with pytest.raises(InputError, match="no solution from 0 s on"):
        simulate(Escape(), [0.0, 2.0], [[0.0], [0.0]], [1.0], solver="Radau")
