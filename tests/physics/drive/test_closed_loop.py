from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.catalogue import thc6350_servo, thc6350_x_axis
from selector.physics.drive.closed_loop import (
    TransferFunction,
    closed_loop,
    closed_loop_transfer_function,
    inertia_at_motor,
    opened_position_loop,
    plant,
    small_signal_mechanics,
)
from selector.physics.drive.mechanics import RigidMechanics
from selector.physics.drive.stiffness import axial_compliance, three_mass_mechanics
from selector.physics.system import StateSpace

MECHANICS = replace(
    three_mass_mechanics(thc6350_x_axis()), torsional_damping_nms_per_rad=2.0, axial_damping_ns_per_m=2e4
)
RIGID = RigidMechanics(95.0, 200.0)
S = 2j * np.pi * np.array([0.5, 5.0, 40.0, 90.0, 300.0])


def response(system: StateSpace, source: int, row: int = 0) -> np.ndarray:
    size = np.eye(len(system.A))
    return np.array(
        [system.C[row] @ np.linalg.solve(s * size - system.A, system.B[:, source]) + system.D[row, source] for s in S]
    )


@pytest.mark.parametrize("mechanics", [MECHANICS, RIGID], ids=["three masses", "rigid"])
@pytest.mark.parametrize("feedback", ["table", "motor"])
@pytest.mark.parametrize("integral", [0.0, 300.0])
@pytest.mark.parametrize("shares", [(0.0, 0.0), (1.0, 0.6)])
def test_polynomials_and_states_are_the_same_loop(mechanics, feedback, integral, shares):
    gain = 6.0 if mechanics is MECHANICS else 3000.0
    servo = replace(
        thc6350_servo(),
        velocity_gain=gain,
        velocity_integral_gain=integral,
        feedback=feedback,
        velocity_feedforward=shares[0],
        acceleration_feedforward=shares[1],
    )
    axis = Axis(mechanics, servo)
    system, function = closed_loop(axis), closed_loop_transfer_function(axis)
    by_states = response(system, 0) + S * response(system, 1) + S**2 * response(system, 2)
    # entries from 1e-3 to 1e11 lose about six digits
    np.testing.assert_allclose(by_states, function.at(S), rtol=1e-8)
    np.testing.assert_allclose(
        np.sort_complex(system.poles), np.sort_complex(np.roots(function.denominator)), rtol=1e-6, atol=1e-6
    )
    assert len(function.denominator) - 1 == len(system.states) == len(system.poles)
    # an axis that rests is where its reference is
    assert function.numerator[-1] == pytest.approx(function.denominator[-1], rel=1e-9)


def test_order_is_seven_with_three_masses_and_pi():
    assert len(closed_loop_transfer_function(Axis(MECHANICS, thc6350_servo())).denominator) == 8


@pytest.mark.parametrize("mechanics", [MECHANICS, RIGID], ids=["three masses", "rigid"])
def test_opened_loop_closed_again(mechanics):
    axis = Axis(mechanics, thc6350_servo())
    opened, closed = opened_position_loop(axis), closed_loop(axis)
    loop = response(opened, 0)
    # measured at the table, so opened/(1 + opened) is the closed loop
    np.testing.assert_allclose(loop / (1 + loop), response(closed, 0), rtol=1e-7)


def test_plant_conserves_momentum_and_energy_without_damping():
    free = replace(
        MECHANICS, torsional_damping_nms_per_rad=0.0, axial_damping_ns_per_m=0.0, screw_damping_nms_per_rad=0.0,
        guide_damping_ns_per_m=0.0,
    )  # fmt: skip
    system = plant(free)
    # lossless: poles on the imaginary axis; rounding of eigenvalues of 3000 1/s
    assert np.abs(system.poles.real).max() < 1e-3
    # a torque turns all of it, after the springs: θ'' = T / inertia of the axis
    weights = np.array([free.motor_inertia_kg_m2, free.screw_inertia_kg_m2, free.table_mass_kg])
    ratio = np.array([1.0, 1.0, free.travel_per_motion])
    momentum = (ratio * weights) @ system.A[3:]
    np.testing.assert_allclose(momentum, 0.0, atol=1e-6 * np.abs(system.A).max() * weights.max())
    assert (ratio * weights) @ system.B[3:, 0] == pytest.approx(1.0)
    assert (ratio * weights) @ ratio == pytest.approx(inertia_at_motor(free))


def test_a_compliance_counts_as_its_unloaded_stiffness():
    parts = thc6350_x_axis()
    soft = replace(MECHANICS, axial_stiffness_n_per_m=1e6)
    axis = Axis(soft, thc6350_servo(), compliance=axial_compliance(parts))
    # the middle cells of the table are 0.02 % wide in stiffness
    assert small_signal_mechanics(axis).axial_stiffness_n_per_m == pytest.approx(
        three_mass_mechanics(parts).axial_stiffness_n_per_m, rel=5e-4
    )
    assert small_signal_mechanics(replace(axis, compliance=None)) == soft


def test_a_loop_needs_a_servo():
    for asked in (closed_loop, opened_position_loop, closed_loop_transfer_function):
        with pytest.raises(InputError, match="servo"):
            asked(Axis(MECHANICS))


def test_leading_zeros_do_not_count():
    function = TransferFunction([0.0, 0.0, 2.0], [0.0, 1.0, 1.0])
    assert (len(function.numerator), len(function.denominator)) == (1, 2)
    assert function.at(1.0) == pytest.approx(1.0)
    assert not function.numerator.flags.writeable
