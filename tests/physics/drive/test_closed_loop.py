from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.closed_loop import StateSpace, closed_loop, inertia_at_motor, plant, small_signal_mechanics
from selector.physics.drive.parts.axis import Axis, RigidMechanics
from selector.physics.drive.parts.catalogue import thc6350_servo, thc6350_x_axis
from selector.physics.drive.parts.stiffness import axial_compliance, three_mass_mechanics
from tests.physics.drive.loops import by_impedances

MECHANICS = replace(
    three_mass_mechanics(thc6350_x_axis()), torsional_damping_nms_per_rad=2.0, axial_damping_ns_per_m=2e4
)
RIGID = RigidMechanics(95.0, 200.0)
S = 2j * np.pi * np.array([0.5, 5.0, 20.0, 40.0, 60.0, 90.0, 150.0, 300.0])


def response(system: StateSpace, source: int, row: int = 0) -> np.ndarray:
    size = np.eye(len(system.A))
    return np.array(
        [system.C[row] @ np.linalg.solve(s * size - system.A, system.B[:, source]) + system.D[row, source] for s in S]
    )


@pytest.mark.parametrize("mechanics", [MECHANICS, RIGID], ids=["three masses", "rigid"])
@pytest.mark.parametrize("feedback", ["table", "motor"])
@pytest.mark.parametrize("integral", [0.0, 300.0])
@pytest.mark.parametrize("shares", [(0.0, 0.0), (1.0, 0.6)])
def test_impedances_and_states_are_the_same_loop(mechanics, feedback, integral, shares):
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
    system = closed_loop(axis)
    by_states = response(system, 0) + S * response(system, 1) + S**2 * response(system, 2)
    # entries from 1e-3 to 1e11 lose about six digits
    np.testing.assert_allclose(by_states, by_impedances(axis, S)[0], rtol=1e-8)
    assert len(system.poles) == (6 if mechanics is MECHANICS else 2) + (integral > 0)
    # an axis that rests is where its reference is
    assert system.D[0, 0] - system.C[0] @ np.linalg.solve(system.A, system.B[:, 0]) == pytest.approx(1.0, rel=1e-9)


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
    with pytest.raises(InputError, match="servo"):
        closed_loop(Axis(MECHANICS))
