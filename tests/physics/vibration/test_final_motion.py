"""Motion of tool and workpiece, line by line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.vibration.chains import chain_receptance
from selector.physics.vibration.final_motion import ChainMethod, final_motions, final_receptance
from selector.physics.vibration.structure import excitation
from tests.physics.vibration.small_lathe import BRANCH, FINALS, HIGH, LOW, SOURCES, SPINDLE, STRUCTURE

LINES = excitation(SOURCES, {"spindle": 1200.0})


def by_hand(frequency_hz: float, force: list[complex]) -> np.ndarray:
    """Motion of workpiece, tool and bed from the matrices, written out."""
    w = 2 * np.pi * frequency_hz
    k1, k2, k3 = (j * (1 + 1j * psi / (2 * np.pi)) for j, psi in ((2e8, 0.3), (1e8, 0.25), (5e8, 0.4)))
    stiffness = np.array([[k1, 0, -k1], [0, k2, -k2], [-k1, -k2, k1 + k2 + k3]])
    return np.linalg.solve(stiffness - w**2 * np.diag([20.0, 5.0, 800.0]), force)


def test_coupled_motion_is_that_of_the_matrices_with_the_force_both_ways():
    found = final_motions(STRUCTURE, SOURCES, LINES, FINALS)
    assert found.finals == ("tool", "workpiece")
    for row, (f, force) in enumerate(zip(LINES.frequency_hz, LINES.force_n, strict=True)):
        pushed = [force, 0, -force] if LINES.source[row] == 0 else [0, 0, force]
        workpiece, tool, _ = by_hand(f, pushed)
        # 1e-12: two ways of solving a well-conditioned system of three
        assert found.motion_m[:, row] == pytest.approx([tool, workpiece], rel=1e-12)
        assert found.moment_kg_m[:, row] == pytest.approx([5.0 * tool, 20.0 * workpiece], rel=1e-12)
    assert found.carried.all()
    assert found.of("tool", "workpiece") == pytest.approx(found.motion_m[0] - found.motion_m[1], rel=1e-15)
    assert (found.of("workpiece") == found.motion_m[1]).all()


def test_chains_of_the_range_are_added_up_with_their_signs_and_masses():
    found = final_motions(STRUCTURE, SOURCES, LINES, FINALS, ChainMethod((LOW, HIGH, BRANCH), 100.0))
    low = chain_receptance(STRUCTURE, LOW, np.array([20.0])).final[0]
    high = chain_receptance(STRUCTURE, HIGH, np.array([186.0])).final[0]
    branch = chain_receptance(STRUCTURE, BRANCH, np.array([50.0, 20.0])).final
    # same numbers, multiplied in another order
    assert found.motion_m[1, :2] == pytest.approx(np.array([low, high]) * LINES.force_n[:2], rel=1e-14)
    assert found.motion_m[0, 2:] == pytest.approx(branch * LINES.force_n[2:], rel=1e-14)
    assert found.moment_kg_m[1, 0] == pytest.approx(20.0 * found.motion_m[1, 0], rel=1e-14)
    assert found.carried.tolist() == [[False, False, True, True], [True, True, False, False]]
    assert not found.motion_m[~found.carried].any()


def test_the_mass_of_a_chain_is_that_of_its_final_group():
    merged = replace(LOW, path=(("workpiece", "tool"), ("bed",)))
    found = final_receptance(STRUCTURE, SPINDLE, [20.0], FINALS, ChainMethod((merged,)))
    assert found.moment_kg_m_per_n[1] == pytest.approx(25.0 * found.motion_m_per_n[1], rel=1e-14)


def test_a_source_that_pushes_against_the_chain_moves_it_the_other_way():
    turned = replace(SPINDLE, member="bed", against="workpiece")
    one, other = (
        final_receptance(STRUCTURE, source, [20.0], FINALS, ChainMethod((LOW,))).motion_m_per_n[1]
        for source in (SPINDLE, turned)
    )
    assert one[0] == -other[0] != 0


def test_the_split_itself_belongs_to_the_low_chains_and_one_range_alone_needs_none():
    low, high = (replace(LOW, name="a"), replace(LOW, name="b", range="high"))
    at_split = final_receptance(
        STRUCTURE, SPINDLE, [100.0, 100.1], FINALS, ChainMethod((low, replace(HIGH)), 100.0)
    ).motion_m_per_n[1]
    assert at_split[0] == chain_receptance(STRUCTURE, low, np.array([100.0])).final[0]
    assert at_split[1] == chain_receptance(STRUCTURE, HIGH, np.array([100.1])).final[0]
    for chain in (low, high):
        alone = final_receptance(STRUCTURE, SPINDLE, [20.0, 5e3], FINALS, ChainMethod((chain,)))
        assert alone.carried[1].all()


def test_no_lines_make_no_motion():
    none = excitation((SPINDLE,), {"spindle": 0.0})
    assert final_motions(STRUCTURE, (SPINDLE,), none, FINALS).motion_m.shape == (2, 0)


@pytest.mark.parametrize(
    ("change", "options", "where"),
    [
        ({"member": "table"}, {}, "at"),
        ({"against": "table"}, {}, "against"),
        ({}, {"finals": {"tool": "table"}}, "finals"),
    ],
)
def test_what_does_not_fit_is_refused(change, options, where):
    source = replace(SPINDLE, **change)
    with pytest.raises(InputError) as caught:
        final_receptance(STRUCTURE, source, [20.0], options.pop("finals", FINALS), **options)
    assert caught.value.where == where
