from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.vibration.structure import (
    GROUND,
    Joint,
    Member,
    Structure,
    masses_kg,
    receptance,
    receptances,
    stiffness_matrix,
)
from tests.physics.vibration.viscous import state_space

TWO = Structure(
    (Member("tool", 12.0), Member("slide", 150.0)),
    (Joint(("tool", "slide"), 4e7, 0.3), Joint(("slide", GROUND), 9e7, 0.8)),
)
# more than a chain: a ring of joints, and two of them side by side
RING = Structure(
    tuple(Member(name, mass) for name, mass in zip("abcde", (3.0, 40.0, 8.0, 200.0, 15.0), strict=True)),
    tuple(
        Joint((one, other), stiffness, psi)
        for one, other, stiffness, psi in (
            ("a", "b", 3e7, 0.2), ("b", "c", 6e7, 0.5), ("c", "d", 5e7, 0.1), ("d", "a", 2e7, 0.9),
            ("e", "d", 9e7, 0.3), ("d", GROUND, 3e8, 0.6), ("b", GROUND, 1e7, 0.4), ("b", "c", 2e7, 0.0),
        )
    ),
)  # fmt: skip
HZ = np.geomspace(1.0, 2000.0, 400)
CLOSE = 1e-10
"""Solutions of a few equations: rounding, times condition numbers up to some thousand."""


@st.composite
def structures(draw: st.DrawFn) -> Structure:
    """Up to six members, each joined with one before it or with the ground, and a few joints more."""
    count = draw(st.integers(1, 6))
    names = [f"m{number}" for number in range(count)]
    places = [GROUND, *names]
    pairs = [(name, places[draw(st.integers(0, number))]) for number, name in enumerate(names)]
    if count > 1:
        free = st.lists(st.tuples(st.sampled_from(names), st.sampled_from(places)), max_size=3)
        pairs += [pair for pair in draw(free) if pair[0] != pair[1]]
    joint = st.tuples(st.floats(1e6, 1e9), st.floats(0.05, 1.5))
    return Structure(
        tuple(Member(name, draw(st.floats(0.5, 500.0))) for name in names),
        tuple(Joint(pair, *draw(joint)) for pair in pairs),
    )


def response(structure, frequency_hz, force_n):
    """Motion of every member [m] by the same forces at all frequencies, (n_freq, n_members)."""
    return receptances(structure, frequency_hz, np.asarray(force_n)[None])[0]


def test_matrices_of_two_members():
    soft, hard = (joint.complex_stiffness_n_per_m for joint in TWO.joints)
    assert masses_kg(TWO).tolist() == [12.0, 150.0]
    assert np.array_equal(stiffness_matrix(TWO), [[soft, -soft], [-soft, soft + hard]])


def test_two_members_have_the_closed_form():
    soft, hard = (joint.complex_stiffness_n_per_m for joint in TWO.joints)
    square = (2 * math.pi * HZ) ** 2
    below, above = soft - 12 * square, soft + hard - 150 * square
    determinant = below * above - soft**2
    force = np.column_stack([np.full(len(HZ), 3 - 1j), np.linspace(0, 2, len(HZ))])
    # every column of the force for itself: linear
    motion = sum(force[:, [k]] * response(TWO, HZ, np.eye(2)[k]) for k in (0, 1))
    expected = np.column_stack(
        [
            (above * force[:, 0] + soft * force[:, 1]) / determinant,
            (soft * force[:, 0] + below * force[:, 1]) / determinant,
        ]
    )
    assert np.abs(motion / expected - 1).max() < CLOSE


@pytest.mark.parametrize("at_hz", [20.0, 111.0, 300.0, 900.0])
def test_at_one_frequency_it_is_a_viscous_system_of_python_control(at_hz):
    import control  # with all of matplotlib

    states = state_space(RING, at_hz)
    system = control.ss(states.A, states.B, states.C, states.D)
    expected = system(2j * math.pi * at_hz)
    assert np.abs(receptances(RING, [at_hz], np.eye(5))[:, 0].T / expected - 1).max() < CLOSE


@given(structures(), st.floats(1.0, 3000.0))
def test_what_moves_what_does_not_matter(structure, frequency_hz):
    motion = receptances(structure, [frequency_hz], np.eye(len(structure.members)))[:, 0]
    # entries far from each other in a structure are small beside others that are solved for with them
    assert np.allclose(motion, motion.T, rtol=1e-9, atol=1e-12 * np.abs(motion).max())


@given(structures(), st.floats(1.0, 3000.0))
def test_power_in_is_what_the_joints_take(structure, frequency_hz):
    force = np.array([complex(1 + place, 2 - place) for place in range(len(structure.members))])
    motion = response(structure, [frequency_hz], force)[0]
    # work of Im(F·e^{iωt}) on Im(X·e^{iωt}) in a cycle
    work = -math.pi * float((force.conj() * motion).imag.sum())
    at = {GROUND: 0j, **dict(zip(structure.names, motion, strict=True))}
    taken = sum(
        joint.dissipation * joint.stiffness_n_per_m / 2 * abs(at[joint.between[0]] - at[joint.between[1]]) ** 2
        for joint in structure.joints
    )
    # of ψ ≥ 0.05: the part of F·X that is not in phase is at least some 1e-5 of it off the resonances
    assert work == pytest.approx(taken, rel=1e-7)
    assert work > 0


def test_at_rest_it_is_a_spring():
    # 5 N on the tool press both joints, one behind the other; on the slide only the second one
    soft, hard = (joint.complex_stiffness_n_per_m for joint in TWO.joints)
    motion = response(TWO, [0.0], [5.0, 0.0])[0]
    assert motion == pytest.approx([5 / soft + 5 / hard, 5 / hard], rel=1e-14)
    # and near rest nearly: (f/f1)² = (1e-3/100)²
    assert response(TWO, [1e-3], [5.0, 0.0])[0] == pytest.approx(motion, rel=1e-9)


def test_far_above_all_resonances_it_is_free_masses():
    square = (2 * math.pi * 1e6) ** 2
    # joints over inertia, (f2/f)² = (3e2/1e6)²
    assert response(TWO, [1e6], [1.0, 1.0])[0] == pytest.approx([-1 / (12 * square), -1 / (150 * square)], rel=1e-6)


def test_a_force_between_two_members_is_two_forces():
    both = receptance(RING, HZ, of="e", at="a", against="c")
    apart = receptance(RING, HZ, of="e", at="a") - receptance(RING, HZ, of="e", at="c")
    assert np.abs(both - apart).max() < 1e-14 * np.abs(apart).max()
    assert np.array_equal(receptance(RING, HZ, of="e", at="a", against=GROUND), receptance(RING, HZ, of="e", at="a"))


def test_many_frequencies_are_solved_in_parts_alike(monkeypatch):
    whole = response(RING, HZ, np.arange(5.0))
    monkeypatch.setattr("selector.physics.vibration.structure.NUMBERS_AT_ONCE", 100)
    assert np.array_equal(response(RING, HZ, np.arange(5.0)), whole)


def test_no_frequency_is_no_motion():
    assert response(TWO, [], [1.0, 0.0]).shape == (0, 2)


UNDAMPED = Structure(
    (Member("spindle", 10.0), Member("bed", 1000.0)),
    (Joint(("spindle", "bed"), 4e8, 0.0), Joint(("bed", GROUND), 1e9, 0.0)),
)


def test_a_resonance_that_nothing_damps_is_refused_with_frequency_member_and_joint():
    # (6324.6 − …)² of both modes: 1/2·(a + d ± √((a − d)² + 4·b²)) of K/M
    a, d, b = 4e7, 1.4e6, 4e6
    fast = math.sqrt((a + d + math.sqrt((a - d) ** 2 + 4 * b**2)) / 2) / (2 * math.pi)
    with pytest.raises(InputError) as refused:
        receptance(UNDAMPED, [10.0, fast], of="bed", at="bed")
    assert f"{fast:.6g} Hz" in refused.value.found
    assert "'spindle' moves most" in refused.value.found
    assert "spindle – bed" in refused.value.advice
    assert refused.value.where == "joints"
    # one part in a million beside it the motion is large but known
    motion = receptance(UNDAMPED, [fast * (1 + 1e-6)], of="spindle", at="spindle")
    assert 1e-4 < abs(motion[0]) < 1e-2


def test_damping_anywhere_is_enough():
    damped = Structure(UNDAMPED.members, (UNDAMPED.joints[0], Joint(("bed", GROUND), 1e9, 0.1)))
    assert np.isfinite(response(damped, np.linspace(0, 2000, 2001), [1.0, 0.0])).all()


def test_stiffnesses_that_rounding_cannot_hold_are_refused():
    far = Structure(
        (Member("a", 1.0), Member("b", 1.0)), (Joint(("a", "b"), 1e22, 0.1), Joint(("b", GROUND), 1e6, 0.1))
    )
    with pytest.raises(InputError, match=r"rounding .*at 3 Hz"):
        receptance(far, [3.0], of="a", at="a")


def test_the_largest_forces_leave_no_missing_number():
    assert np.isfinite(response(TWO, [1.0], [1e308, 1e308])).all()


@pytest.mark.parametrize("names", [{"of": "x", "at": "tool"}, {"of": "tool", "at": "x"}, {"of": GROUND, "at": "tool"}])
def test_unknown_members_are_named(names):
    with pytest.raises(InputError, match="tool, slide"):
        receptance(TWO, [1.0], **names)
