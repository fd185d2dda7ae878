"""F eq. 2: the closed loop of the three-mass axis, derived by elimination, beside what F prints of it."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from selector.physics.drive.closed_loop import closed_loop
from selector.physics.drive.parts.axis import Axis, Servo, ThreeMassMechanics

NAMES = "Jm Jl Mt R Ktheta Ke Cl Ct Kf Kpp Kvp Kvi Dtheta De s"
Jm, Jl, Mt, R, Kth, Ke, Cl, Ct, Kf, Kpp, Kvp, Kvi, Dth, De, s = sp.symbols(NAMES, positive=True)

# as printed, term by term in its order (feed-drive.zh.txt, after eq. 2)
PRINTED = {
    0: Ke * Kf * Kth * Kvi,
    1: Ke * Kf * Kth * Kvi + Ke * Kf * Kpp * Kth * Kvp,
    2: Cl * Ke * Kth
    + Cl * Ke * Kf * Kvi
    + Ct * Kf * Kth * Kvi
    + Ke * Kf * Kth * Kvp
    + Ct * Ke * Kth * R**2
    + Ct * Ke * Kf * Kvi * R**2,
    3: Cl * Ct * Kth
    + Jl * Ke * Kth
    + Jm * Ke * Kth
    + Cl * Ct * Kf * Kvi
    + Cl * Ke * Kf * Kvp
    + Ct * Kf * Kth * Kvp
    + Jl * Ke * Kf * Kvi
    + Kf * Kth * Kvi * Mt
    + Ke * Kth * Mt * R**2
    + Ct * Ke * Kf * Kvp * R**2
    + Ke * Kf * Kvi * Mt * R**2,
    4: Cl * Jm * Ke
    + Ct * Jl * Kth
    + Ct * Jm * Kth
    + Cl * Kth * Mt
    + Cl * Ct * Kf * Kvp
    + Ct * Jl * Kf * Kvi
    + Cl * Kf * Kvi * Mt
    + Jl * Ke * Kf * Kvp
    + Kf * Kth * Kvp * Mt
    + Ct * Jm * Ke * R**2
    + Ke * Kf * Kvp * Mt * R**2,
    5: Jm * Ke * Mt * R**2
    + Cl * Ct * Jm
    + Jl * Jm * Ke
    + Jl * Kth * Mt
    + Jm * Kth * Mt
    + Ct * Jl * Kf * Kvp
    + Cl * Kf * Kvp * Mt
    + Jl * Kf * Kvi * Mt,
    6: Ct * Jl * Jm + Cl * Jm * Mt + Jl * Kf * Kvp * Mt,
    7: Jl * Jm * Mt,
}
PRINTED_NUMERATOR = {1: Ke * Kf * Kth * Kvi, 0: Ke * Kf * Kpp * Kth * Kvp}


def derived(damped: bool) -> tuple[sp.Poly, sp.Poly]:
    """Numerator and denominator of table over reference: the equations of motion with the states eliminated."""
    motor, screw, table, reference = sp.symbols("motor screw table reference")
    torsion, axial = (Kth + s * Dth, Ke + s * De) if damped else (Kth, Ke)
    torque = Kf * (Kvp + Kvi / s) * (Kpp * (reference - table) - s * motor)
    equations = [
        Jm * s**2 * motor - torque + torsion * (motor - screw),
        Jl * s**2 * screw + Cl * s * screw - torsion * (motor - screw) + R * axial * (R * screw - table),
        Mt * s**2 * table + Ct * s * table - axial * (R * screw - table),
    ]
    solution = sp.solve(equations, [motor, screw, table], dict=True)[0][table]
    numerator, denominator = sp.fraction(sp.together(solution / reference))
    scale = sp.cancel(sp.LC(sp.Poly(denominator, s)) / (Jl * Jm * Mt))
    return sp.Poly(sp.expand(sp.cancel(numerator / scale)), s), sp.Poly(sp.expand(sp.cancel(denominator / scale)), s)


@pytest.fixture(scope="module")
def undamped() -> tuple[sp.Poly, sp.Poly]:
    return derived(damped=False)


@pytest.mark.parametrize("power", [2, 3, 4, 5, 6, 7])
def test_printed_coefficients_from_b2_on_are_right(undamped, power):
    assert sp.expand(undamped[1].coeff_monomial(s**power) - PRINTED[power]) == 0


def test_printed_b0_b1_and_numerator_are_misprints(undamped):
    numerator, denominator = undamped
    right = {0: Ke * Kf * Kpp * Kth * Kvi * R, 1: Ke * Kf * Kpp * Kth * Kvp * R + Ke * Kf * Kth * Kvi}
    for power in (0, 1):
        assert sp.expand(denominator.coeff_monomial(s**power) - right[power]) == 0
        assert sp.expand(denominator.coeff_monomial(s**power) - PRINTED[power]) != 0
    assert sp.expand(numerator.as_expr() - Ke * Kf * Kpp * Kth * R * (Kvp * s + Kvi)) == 0
    assert sp.expand(numerator.as_expr() - sum(value * s**power for power, value in PRINTED_NUMERATOR.items())) != 0
    # at rest the table is where the reference is; by the printed numbers it would not be
    assert numerator.eval(0) == denominator.eval(0)
    assert sp.simplify(PRINTED_NUMERATOR[0] - PRINTED[0]) != 0


def test_damping_in_the_springs_extends_the_polynomials_and_zero_gives_those_of_the_source(undamped):
    damped = derived(damped=True)
    for with_damping, without in zip(damped, undamped, strict=True):
        assert sp.expand(with_damping.as_expr().subs({Dth: 0, De: 0}) - without.as_expr()) == 0
        assert {Dth, De} <= with_damping.free_symbols


@pytest.mark.parametrize("damping", [0.0, 1.0])
@pytest.mark.parametrize("integral", [0.0, 300.0])
def test_numbers_of_the_package_are_those_of_the_derivation(damping, integral):
    mechanics = ThreeMassMechanics(
        0.0062, 0.0026, 1000.0, 0.02, 13500.0, 3e8, 0.004, 600.0, 2.0 * damping, 2e4 * damping
    )
    servo = Servo(40.0, 6.0, integral, actuator_gain=0.79)
    axis = Axis(mechanics, servo)
    m, radius = mechanics, mechanics.travel_per_motion
    values = {
        Jm: m.motor_inertia_kg_m2, Jl: m.screw_inertia_kg_m2, Mt: m.table_mass_kg, R: radius,
        Kth: m.torsional_stiffness_nm_per_rad, Ke: m.axial_stiffness_n_per_m, Cl: m.screw_damping_nms_per_rad,
        Ct: m.guide_damping_ns_per_m, Dth: m.torsional_damping_nms_per_rad, De: m.axial_damping_ns_per_m,
        Kf: servo.actuator_gain, Kpp: servo.position_gain_per_s / radius, Kvp: servo.velocity_gain,
        Kvi: servo.velocity_integral_gain,
    }  # fmt: skip
    numerator, denominator = (
        np.array([float(c.subs(values)) for c in polynomial.all_coeffs()]) for polynomial in derived(damped=True)
    )
    if damping == 0.0:
        numerator = np.trim_zeros(numerator, "f")
    if integral == 0.0:
        numerator, denominator = numerator[:-1], denominator[:-1]
    # the same loop as states; those of a matrix with entries from 1e-3 to 1e11 keep about nine digits
    s_values = 2j * np.pi * np.array([0.1, 1.0, 3.0, 10.0, 30.0, 60.0, 120.0, 500.0])
    states = closed_loop(axis)
    np.testing.assert_allclose(
        np.sort_complex(states.poles), np.sort_complex(np.roots(denominator)), rtol=1e-6, atol=1e-6
    )
    response = [
        (states.C[0] @ np.linalg.solve(value * np.eye(len(states.A)) - states.A, states.B[:, 0])) for value in s_values
    ]
    np.testing.assert_allclose(response, np.polyval(numerator, s_values) / np.polyval(denominator, s_values), rtol=1e-8)
