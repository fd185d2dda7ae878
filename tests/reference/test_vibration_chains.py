"""V eq. 3–9 by hand: chains of two and three members, first and second kind, with merged groups.

Every number is worked out here from the formulas as a reader would with a pocket calculator (the intermediate ones
are written down and held to six digits); nothing of the package is used for that.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from selector.physics.vibration.chains import Chain, chain_receptance
from selector.physics.vibration.structure import GROUND, Joint, Member, Structure

DIGITS = {"rel": 5e-6}
"""Numbers that are written down have six digits."""
ROUNDING = {"rel": 1e-12}
"""The same formulas in another order of operations."""


def test_two_members_of_the_first_kind():
    # 1 (2 kg) on 2 (80 kg) on the ground; j12 = 8 N/µm, j20 = 80 N/µm; ψ12 = 0.4π, ψ20 = 0.2π; ω = 1200 1/s, ΔP = 100 N
    # p1 = √(8e6/2) = 2000 1/s, p2 = √(8e7/80) = 1000 1/s
    mu_1 = 1 / math.sqrt((1 - 1200**2 / 2000**2) ** 2 + (0.4 * math.pi / (2 * math.pi)) ** 2)
    mu_2 = 1 / math.sqrt((1 - 1200**2 / 1000**2) ** 2 + (0.2 * math.pi / (2 * math.pi)) ** 2)
    assert mu_1 == pytest.approx(1.49138, **DIGITS)  # 1/√(0.64² + 0.2²)
    assert mu_2 == pytest.approx(2.21621, **DIGITS)  # 1/√(0.44² + 0.1²)
    # tan φ1 = 0.2/0.64; tan φ2 = 0.1/(−0.44): above the resonance, so 180° − 12.8043°
    phi_1, phi_2 = math.degrees(math.atan(0.2 / 0.64)), 180 - math.degrees(math.atan(0.1 / 0.44))
    assert (phi_1, phi_2) == (pytest.approx(17.3540, **DIGITS), pytest.approx(167.196, **DIGITS))
    # eq. 3: A12 = ΔP·μ1/j12, A20 = ΔP·μ1·μ2/j20
    a_12, a_20 = 100 * mu_1 / 8e6, 100 * mu_1 * mu_2 / 8e7
    assert (1e6 * a_12, 1e6 * a_20) == (pytest.approx(18.6422, **DIGITS), pytest.approx(4.13151, **DIGITS))
    # eq. 7 as a vector sum: A12 at −17.354°, A20 at −184.550°
    east = a_12 * math.cos(math.radians(phi_1)) + a_20 * math.cos(math.radians(phi_1 + phi_2))
    south = a_12 * math.sin(math.radians(phi_1)) + a_20 * math.sin(math.radians(phi_1 + phi_2))
    assert 1e6 * math.hypot(east, south) == pytest.approx(14.6421, **DIGITS)
    assert math.degrees(math.atan2(south, east)) == pytest.approx(20.9393, **DIGITS)

    structure = Structure(
        (Member("1", 2.0), Member("2", 80.0)),
        (Joint(("1", "2"), 8e6, 0.4 * math.pi), Joint((GROUND, "2"), 8e7, 0.2 * math.pi)),
    )
    chain = Chain("hand", "high", (), (("1",), ("2",)), "1")
    found = chain_receptance(structure, chain, [1200 / (2 * math.pi)])
    assert [link.natural_hz for link in found.links] == pytest.approx(
        [2000 / (2 * math.pi), 1000 / (2 * math.pi)], **ROUNDING
    )
    assert found.dynamic_factor[:, 0] == pytest.approx([mu_1, mu_2], **ROUNDING)
    assert np.degrees(found.lag_rad[:, 0]) == pytest.approx([phi_1, phi_2], **ROUNDING)
    assert 100 * np.abs(found.relative[:, 0]) == pytest.approx([a_12, a_20], **ROUNDING)
    assert 100 * found.final[0] == pytest.approx(complex(east, -south), **ROUNDING)
    # the ordinates of eq. 7 at some instants, as drawn in V Fig. 3
    for time_s in (0.0, 0.0007, 0.0031):
        ordinate = a_12 * math.sin(1200 * time_s - math.radians(phi_1)) + a_20 * math.sin(
            1200 * time_s - math.radians(phi_1 + phi_2)
        )
        drawn = (100 * found.final[0] * np.exp(1200j * time_s)).imag
        # of sums that may nearly cancel
        assert drawn == pytest.approx(ordinate, rel=1e-10)


def test_three_members_of_the_first_kind_the_second_one_in_resonance():
    # p1 = √(6e7/15) = 2000, p2 = √(2e7/20) = 1000, p3 = √(1e8/400) = 500 1/s, ω = 1000 1/s; η = ψ/2π = 0.05, 0.08, 0.15
    # 1 − ω²/p² = 0.75, 0, −3
    mu = (1 / math.sqrt(0.5625 + 0.0025), 1 / 0.08, 1 / math.sqrt(9 + 0.0225))
    phi = (math.degrees(math.atan(0.05 / 0.75)), 90.0, 180 - math.degrees(math.atan(0.15 / 3)))
    assert mu == (pytest.approx(1.33038, **DIGITS), 12.5, pytest.approx(0.332917, **DIGITS))
    assert phi == (pytest.approx(3.81407, **DIGITS), 90.0, pytest.approx(177.138, **DIGITS))
    # per newton: A12 = μ1/j12, A23 = μ1·μ2/j23, A30 = μ1·μ2·μ3/j30
    a = (mu[0] / 6e7, mu[0] * 12.5 / 2e7, mu[0] * 12.5 * mu[2] / 1e8)
    assert [1e9 * one for one in a] == pytest.approx([22.1730, 831.488, 55.3633], **DIGITS)
    # delays add up: φ1, φ1 + φ2, φ1 + φ2 + φ3 = 3.814°, 93.814°, 270.952°
    late = [math.radians(angle) for angle in (phi[0], phi[0] + 90.0, phi[0] + 90.0 + phi[2])]
    east, south = (sum(one * turn(at) for one, at in zip(a, late, strict=True)) for turn in (math.cos, math.sin))
    assert 1e9 * math.hypot(east, south) == pytest.approx(776.436, **DIGITS)

    structure = Structure(
        (Member("1", 15.0), Member("2", 20.0), Member("3", 400.0)),
        (
            Joint(("1", "2"), 6e7, 0.1 * math.pi),
            Joint(("3", "2"), 2e7, 0.16 * math.pi),
            Joint(("3", GROUND), 1e8, 0.3 * math.pi),
        ),
    )
    chain = Chain("hand", "high", (), (("1",), ("2",), ("3",)), "1")
    found = chain_receptance(structure, chain, [1000 / (2 * math.pi)])
    # near its resonance a link amplifies the rounding of ω by 2/η = 25
    close = {"rel": 1e-11}
    assert np.degrees(found.lag_rad[:, 0]) == pytest.approx(phi, **close)
    assert np.abs(found.relative[:, 0]) == pytest.approx(a, **close)
    assert found.final[0] == pytest.approx(complex(east, -south), **close)


def test_a_branch_on_the_forced_member():
    # second kind, V Fig. 4: 1 (50 kg) on the ground by 2e8 N/m, η 0.1; on it 2 (5 kg) by 4.5e7 N/m, η 0.06; on that
    # 3 (1 kg) by 2.5e7 N/m, η 0.04; ω = 1500 1/s. p² = 4e6, 9e6, 25e6 1/s²; 1 − ω²/p² = 0.4375, 0.75, 0.91
    mu = [1 / math.hypot(beside, eta) for beside, eta in ((0.4375, 0.1), (0.75, 0.06), (0.91, 0.04))]
    phi = [math.degrees(math.atan2(eta, beside)) for beside, eta in ((0.4375, 0.1), (0.75, 0.06), (0.91, 0.04))]
    assert mu == pytest.approx([2.22825, 1.32909, 1.09784], **DIGITS)
    assert phi == pytest.approx([12.8750, 4.57392, 2.51688], **DIGITS)
    # A1 = μ1/j10. The force A1·j12 on 2, if 1 stood still, moves it by A1·j12·μ2/j12 = A1·μ2; likewise 3 by A1·μ2·μ3
    a_1 = mu[0] / 2e8
    a_2, a_3 = a_1 * mu[1], a_1 * mu[1] * mu[2]
    assert [1e9 * one for one in (a_1, a_2, a_3)] == pytest.approx([11.1412, 14.8077, 16.2565], **DIGITS)
    late = math.radians(sum(phi))
    assert math.degrees(late) == pytest.approx(19.9658, **DIGITS)

    structure = Structure(
        (Member("3", 1.0), Member("1", 50.0), Member("2", 5.0)),
        (
            Joint(("3", "2"), 2.5e7, 0.08 * math.pi),
            Joint(("2", "1"), 4.5e7, 0.12 * math.pi),
            Joint(("1", GROUND), 2e8, 0.2 * math.pi),
        ),
    )
    chain = Chain("hand", "high", (), (("1",),), "3", branch=(("2",), ("3",)))
    found = chain_receptance(structure, chain, [1500 / (2 * math.pi)])
    assert np.abs(found.absolute[:, 0]) == pytest.approx([a_1, a_2, a_3], **ROUNDING)
    assert found.final[0] == pytest.approx(a_3 * complex(math.cos(late), -math.sin(late)), **ROUNDING)


def test_merged_members_with_a_branch_in_the_middle_of_the_path():
    # (a 3 kg, b 7 kg) on (c) by two joints, a–c 1e7 N/m with η 0.1 and b–c 3e7 N/m with η 0.2: 4e7 N/m, η = 7e6/4e7;
    # a–b moves as one, so its joint does not count. c 90 kg on d, which is held, by 9e7 N/m, η 0.3.
    # On c the branch (e 2 kg, f 3 kg) by 2e7 N/m, η 0.1. ω = 1000 1/s.
    # p² = 4e7/10 = 4e6, 9e7/90 = 1e6, 2e7/5 = 4e6 1/s²
    eta = 7e6 / 4e7
    assert eta == pytest.approx(0.175, rel=1e-15)
    mu_1, phi_1 = 1 / math.hypot(0.75, 0.175), math.atan(0.175 / 0.75)
    mu_2, phi_2 = 1 / 0.3, math.pi / 2
    mu_3, phi_3 = 1 / math.hypot(0.75, 0.1), math.atan(0.1 / 0.75)
    assert (mu_1, mu_2, mu_3) == pytest.approx((1.29845, 3.33333, 1.32164), **DIGITS)
    degrees = [math.degrees(angle) for angle in (phi_1, phi_2, phi_3)]
    assert degrees == pytest.approx([13.1340, 90.0, 7.59464], **DIGITS)
    # what carries the branch is c: links from c on, A = μ1·μ2/9e7; the end of the branch is μ3 times that
    final = mu_1 * mu_2 * mu_3 / 9e7
    assert 1e9 * final == pytest.approx(63.5588, **DIGITS)
    late = phi_1 + phi_2 + phi_3

    structure = Structure(
        (
            Member("a", 3.0), Member("b", 7.0), Member("c", 90.0),
            Member("d", 500.0), Member("e", 2.0), Member("f", 3.0),
        ),
        (
            Joint(("a", "b"), 5e8, 0.1),
            Joint(("a", "c"), 1e7, 0.2 * math.pi),
            Joint(("c", "b"), 3e7, 0.4 * math.pi),
            Joint(("c", "d"), 9e7, 0.6 * math.pi),
            Joint(("e", "c"), 2e7, 0.2 * math.pi),
            Joint(("f", "e"), 6e8, 0.1),
            Joint(("d", GROUND), 1e9, 0.3),
        ),
    )  # fmt: skip
    chain = Chain("hand", "low", (), (("a", "b"), ("c",)), "f", branch=(("e", "f"),), held="d")
    found = chain_receptance(structure, chain, [1000 / (2 * math.pi)])
    assert [link.mass_kg for link in found.links] == [10.0, 90.0, 5.0]
    # c is in resonance: 2/η = 7 times the rounding of ω
    assert found.final[0] == pytest.approx(final * complex(math.cos(late), -math.sin(late)), rel=1e-11)
    # with the dampers' forces passed on: from (a, b) to c, and from c to (e, f)
    carried = chain_receptance(structure, chain, [1000 / (2 * math.pi)], dampers_carry=True)
    assert carried.final[0] / found.final[0] == pytest.approx(complex(1, 0.175) * complex(1, 0.1), **ROUNDING)
