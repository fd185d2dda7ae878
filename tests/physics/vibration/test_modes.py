from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg, signal

from selector.errors import InputError
from selector.physics.vibration.structure import (
    GROUND,
    Joint,
    Member,
    Structure,
    masses_kg,
    receptance,
    stiffness_matrix,
    structure_modes,
)
from tests.physics.vibration.modal_sum import receptance_by_modes
from tests.physics.vibration.test_coupled import HZ, RING, TWO, UNDAMPED, structures
from tests.physics.vibration.viscous import state_space

CLOSE = 1e-10
"""Rounding, times squared ratios of frequencies of some thousand."""


def largest_difference(structure: Structure, of: str, at: str) -> float:
    """By modes against direct, relative to the largest amplitude of the forced member: far off, modes cancel."""
    difference = receptance_by_modes(structure, HZ, of=of, at=at) - receptance(structure, HZ, of=of, at=at)
    return float(np.abs(difference).max() / np.abs(receptance(structure, HZ, of=at, at=at)).max())


@pytest.mark.parametrize("structure", [TWO, RING])
def test_modes_solve_the_pencil_and_are_normalised_without_conjugation(structure):
    modes = structure_modes(structure)
    mass, stiffness = np.diag(masses_kg(structure)), stiffness_matrix(structure)
    left = stiffness @ modes.shapes - mass @ modes.shapes * modes.eigenvalues_per_s2
    assert np.abs(left).max() < CLOSE * np.abs(stiffness @ modes.shapes).max()
    assert np.abs(modes.shapes.T @ mass @ modes.shapes - np.eye(len(structure.members))).max() < CLOSE
    assert np.abs(modes.shapes.imag).max() > 1e-3  # ψ differs: the shapes are complex indeed
    assert modes.complete
    assert (np.diff(modes.frequency_hz) > 0).all()
    root = np.sqrt(modes.eigenvalues_per_s2)
    assert modes.frequency_hz == pytest.approx(root.real / (2 * math.pi), rel=1e-15)
    assert modes.loss_factor == pytest.approx(modes.eigenvalues_per_s2.imag / modes.eigenvalues_per_s2.real, rel=1e-15)


@given(structures(), st.data())
def test_modes_add_up_to_the_direct_solution(structure, data):
    of, at = (data.draw(st.sampled_from(structure.names)) for _ in range(2))
    # of the direct solution: rounding times the ratio of the largest to the smallest eigenvalue, here up to some 1e6
    assert largest_difference(structure, of, at) < 1e-9


@pytest.mark.parametrize(("of", "at"), [("tool", "tool"), ("slide", "tool"), ("slide", "slide")])
def test_modes_of_two_members_add_up_to_many_digits(of, at):
    assert largest_difference(TWO, of, at) < CLOSE


@pytest.mark.parametrize("of", RING.names)
def test_modes_of_a_ring_add_up_to_many_digits(of):
    assert largest_difference(RING, of, "a") < CLOSE


def test_one_share_of_energy_everywhere_gives_the_real_shapes_of_the_undamped_structure():
    same = Structure(RING.members, tuple(replace(joint, dissipation=0.6) for joint in RING.joints))
    modes = structure_modes(same)
    squares = linalg.eigh(stiffness_matrix(same).real, np.diag(masses_kg(same)), eigvals_only=True)
    eta = 0.6 / (2 * math.pi)
    assert not modes.shapes.imag.any()
    assert modes.loss_factor == pytest.approx(np.full(5, eta), rel=1e-14)
    # Re √(ω²(1 + iη)); eigenvalues of the pencil to rounding
    assert modes.frequency_hz == pytest.approx(np.sqrt(squares * (1 + 1j * eta)).real / (2 * math.pi), rel=CLOSE)


def test_without_dissipation_nothing_is_lost():
    modes = structure_modes(UNDAMPED)
    assert not modes.loss_factor.any()
    assert not modes.shapes.imag.any()


def twins(dissipations: tuple[float, float, float]) -> Structure:
    """Three equal masses on a fourth one: two modes with the same frequency, in which the fourth rests."""
    return Structure(
        tuple(Member(name, 10.0) for name in "abcd"),
        (
            *(Joint((name, "d"), 1e6, psi) for name, psi in zip("abc", dissipations, strict=True)),
            Joint(("d", GROUND), 1e6, 0.9),
        ),
    )


@pytest.mark.parametrize(
    ("structure", "modes_together"),
    [
        (twins((0.3, 0.3, 0.3)), 2),
        (twins((0.3, 0.3, 0.3000001)), 1),
        (Structure(tuple(Member(n, 2.0) for n in "ab"), tuple(Joint((n, GROUND), 1e5, 0.2) for n in "ab")), 2),
        # as the last, beside a third with another damping: the way of unequal ψ
        (
            Structure(
                tuple(Member(n, 2.0) for n in "abc"),
                tuple(Joint((n, GROUND), 1e5, psi) for n, psi in zip("abc", (0.2, 0.2, 0.5), strict=True)),
            ),
            2,
        ),
    ],
)
def test_repeated_modes_are_told_apart_by_their_shapes(structure, modes_together):
    modes = structure_modes(structure)
    close = np.abs(modes.eigenvalues_per_s2[:, None] / modes.eigenvalues_per_s2 - 1) < 1e-12
    assert close.sum(axis=0).max() == modes_together
    assert modes.complete
    product = modes.shapes.T @ np.diag(masses_kg(structure)) @ modes.shapes
    # eigenvalues that differ by 1e-8 leave vectors with 1e-16/1e-8 of each other; squared they are lost
    assert np.abs(product - np.eye(len(structure.members))).max() < 1e-9
    for of in structure.names:
        assert largest_difference(structure, of, "a") < CLOSE


def exceptional(beside: float) -> Structure:
    """Two equal masses, one of them damped, joined by a spring that makes both modes one (but for `beside`)."""
    stiffness, eta = 1e6, 0.2
    return Structure(
        (Member("a", 10.0), Member("b", 10.0)),
        (
            Joint(("a", GROUND), stiffness, 2 * math.pi * eta),
            Joint(("b", GROUND), stiffness),
            # (a11 − a22)² + 4·a12² = 0 for a12 = −j·η/2
            Joint(("a", "b"), stiffness * eta / 2 * (1 + beside)),
        ),
    )


@pytest.mark.parametrize("beside", [0.0, 1e-14, 1e-10, 1e-6, 1e-3, -1e-6])
def test_modes_that_fall_together_in_shape_break_nothing(beside):
    structure = exceptional(beside)
    modes = structure_modes(structure)
    for values in (modes.frequency_hz, modes.loss_factor, modes.shapes, modes.eigenvalues_per_s2):
        assert np.isfinite(values).all()
    assert modes.complete == (abs(beside) > 1e-4)
    # 52.8 Hz: √((1e6 + 1e5 + 0.1e6·i)/10)/2π; near the point of coincidence eigenvalues go with the root of changes
    expected = np.sqrt(complex(1.1e6, 1e5) / 10).real / (2 * math.pi)
    assert modes.frequency_hz == pytest.approx([expected] * 2, rel=0.2 * math.sqrt(abs(beside)) + 1e-6)
    for of, at in (("a", "a"), ("b", "a"), ("b", "b")):
        assert largest_difference(structure, of, at) < CLOSE


def test_the_triangular_form_answers_for_complete_modes_too():
    modes = structure_modes(RING)
    both = [
        receptance_by_modes(RING, HZ, of="e", at="a", against="b", modes=m)
        for m in (modes, replace(modes, complete=False))
    ]
    assert np.abs(both[0] - both[1]).max() < CLOSE * np.abs(both[0]).max()


def test_a_resonance_that_nothing_damps_is_refused():
    frequency_hz = structure_modes(UNDAMPED).frequency_hz[0]
    with pytest.raises(InputError, match=rf"{frequency_hz:.6g} Hz .*'spindle'"):
        receptance_by_modes(UNDAMPED, [frequency_hz], of="bed", at="bed")


def test_stiffnesses_that_rounding_cannot_hold_are_refused():
    far = Structure(
        (Member("a", 1.0), Member("b", 1.0)), (Joint(("a", "b"), 1e22, 0.1), Joint(("b", GROUND), 1e6, 0.1))
    )
    with pytest.raises(InputError, match="rounding"):
        structure_modes(far)


def test_viscous_dampers_take_in_time_what_the_joints_take():
    """Simulated at its frequency until the start has died away, the motion is that of the coupled solution."""
    at_hz = 95.0
    system = state_space(TWO, at_hz, inputs=["tool"], outputs=["slide"])
    step_s = 1 / at_hz / 400
    time_s = np.arange(0.0, 40 / at_hz, step_s)
    # a force that is held over each step is late by half of one
    force = np.sin(2 * math.pi * at_hz * (time_s + step_s / 2))
    motion = signal.lsim((system.A, system.B, system.C, system.D), force, time_s, interp=False)[1]
    last = time_s > 30 / at_hz
    expected = receptance(TWO, [at_hz], of="slide", at="tool")[0]
    drawn = (expected * np.exp(2j * math.pi * at_hz * time_s)).imag
    # (π/400)²/6 = 1e-5 of a held sine, and what is left of the start after 30 cycles of η ≥ 0.05: e^{−π·0.05·30} = 1 %
    assert np.abs(motion - drawn)[last].max() < 0.01 * abs(expected)
