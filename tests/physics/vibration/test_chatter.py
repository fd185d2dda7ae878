"""Regenerative chatter: a published structure, its delay equation solved another way, and what must not be there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from selector.physics.vibration.periodic_error import Cutting, stability_limit
from selector.physics.vibration.structure import Joint, Member, Structure, structure_modes

#: Shaping with two flexibilities (Altintas, Manufacturing Automation): f [Hz], ζ, k [N/m], angle to the thickness.
PUBLISHED = ((250.0, 0.012, 2.26e8, math.radians(30.0)), (150.0, 0.010, 2.13e8, math.radians(-45.0)))
K_F = 1000e6  #: Its cutting constant [N/m²]
#: A law of the force with ∂P/∂S = 1000 N/mm² · t, so that depths are widths of its chip.
LAW = Cutting(100.0, 6000.0, 1.0, 100.0, 1.0, 1.0, 0.0)


def oriented() -> list[tuple[float, float, float]]:
    """Mass [kg], damping [N·s/m] and stiffness [N/m] of each flexibility as seen along the thickness of the chip."""
    found = []
    for frequency, damping, stiffness, angle in PUBLISHED:
        along = stiffness / math.cos(angle) ** 2
        omega = 2.0 * math.pi * frequency
        found.append((along / omega**2, 2.0 * damping * along / omega, along))
    return found


def lathe() -> Structure:
    """One flexibility under the tool, the other under the workpiece: their compliances add up."""
    (m1, _, k1), (m2, _, k2) = oriented()
    psi = [4.0 * math.pi * damping for _, damping, _, _ in PUBLISHED]
    return Structure(
        (Member("tool", m1), Member("workpiece", m2)),
        (Joint(("tool", "ground"), k1, psi[0]), Joint(("workpiece", "ground"), k2, psi[1])),
    )


def limit(structure: Structure, law: Cutting = LAW):
    return stability_limit(structure, structure_modes(structure), law, tool="tool", workpiece="workpiece")


def published_depth_mm() -> float:
    """−1/(2·K_f·Re Φ) at its least, of the published Φ with viscous damping."""
    frequency = np.linspace(100.0, 400.0, 300_001)
    real = sum(
        math.cos(angle) ** 2 / stiffness * (1.0 / (1.0 - (frequency / own) ** 2 + 2j * damping * frequency / own)).real
        for own, damping, stiffness, angle in PUBLISHED
    )
    return 1e3 * float(-1.0 / (2.0 * K_F * real.min()))


def stable_by_steps(depth_mm: float, speed_rpm: float, steps: int = 160) -> bool:
    """Semi-discretisation of the delay equation (Insperger, Stépán 2002): all roots of one turn inside the circle."""
    turn_s = 60.0 / speed_rpm
    h = turn_s / steps
    cut = K_F * depth_mm * 1e-3
    a, b = np.zeros((4, 4)), np.zeros(4)
    look = np.array([1.0, 0.0, 1.0, 0.0])  # motions towards each other add up
    for row, (mass, damping, stiffness) in enumerate(oriented()):
        at = 2 * row
        a[at, at + 1] = 1.0
        a[at + 1, at], a[at + 1, at + 1] = -stiffness / mass, -damping / mass
        b[at + 1] = cut / mass
    a -= np.outer(b, look)
    # x' = a·x + b·(delayed motion, linear within a step)
    whole = np.zeros((6, 6))
    whole[:4, :4], whole[:4, 4], whole[4, 5] = a, b, 1.0
    step = expm(h * whole)
    now, level, slope = step[:4, :4], step[:4, 4], step[:4, 5] / h
    size = 4 + steps
    map_ = np.zeros((size, size))
    map_[:4, :4] = now
    map_[:4, size - 1] += level - slope  # look·x a turn ago, and one step later
    map_[:4, size - 2] += slope
    map_[4, :4] = look
    map_[5:, 4:-1] = np.eye(steps - 1)
    return bool(np.abs(np.linalg.eigvals(map_)).max() < 1.0)


def test_the_least_depth_is_that_of_a_published_structure():
    found = limit(lathe())
    least = float(found.depth_mm(found.least[0], 600.0))
    # damping by energy a cycle instead of by speed changes little near a resonance: 2 % are asked for
    assert least == pytest.approx(published_depth_mm(), rel=0.02)
    # of 400 speeds one is nearer to the lowest point of a lobe than this
    assert found.lobes[1].min() == pytest.approx(least, rel=0.01)


@pytest.mark.parametrize("speed_rpm", [4000.0, 5300.0, 8000.0, 12000.0])
def test_lobes_are_where_the_delay_equation_loses_its_stability(speed_rpm):
    depth, _ = limit(lathe()).at_speed(speed_rpm)
    # 160 steps a turn leave 0.1 % of a frequency; the two dampings differ by 2 %
    assert stable_by_steps(0.95 * depth, speed_rpm)
    assert not stable_by_steps(1.05 * depth, speed_rpm)


def test_one_mass_has_the_closed_form():
    structure = Structure((Member("tool", 2.0), Member("workpiece", 1e9)), (
        Joint(("tool", "ground"), 2e7, 0.4), Joint(("workpiece", "ground"), 1e15, 0.4),
    ))  # fmt: skip
    eta = 0.4 / (2.0 * math.pi)
    found = limit(structure)
    # Re G = (1/k)·(1 − r)/((1 − r)² + η²) with r = (f/f0)²: least −1/(2·η·k)
    # frequencies stand a tenth of the half width apart: off by 0.05² / 2 at most
    assert found.least[0] == pytest.approx(eta * 2e7, rel=2e-3)


@pytest.mark.parametrize(("psi", "rpm"), [(0.05, 30660.0), (0.05, 15210.0), (0.377, 31500.0), (0.377, 15500.0)])
def test_above_the_best_speed_of_a_lobe_the_depth_falls_at_once(psi, rpm):
    """There Re G goes to 0: lobes drawn with 400 000 frequencies close to the natural one, by another formula."""
    mass, stiffness = 2.0, 2e7
    structure = Structure((Member("tool", mass), Member("workpiece", 1e9)), (
        Joint(("tool", "ground"), stiffness, psi), Joint(("workpiece", "ground"), 1e15, 0.4),
    ))  # fmt: skip
    omega = math.sqrt(stiffness / mass) * (1.0 + np.geomspace(1e-7, 3.0, 400_000))
    compliance = 1.0 / (stiffness * (1.0 + 1j * psi / 2.0 / math.pi) - mass * omega**2)
    inside = compliance.real < 0.0
    omega, compliance = omega[inside], compliance[inside]
    depths = []
    for waves in range(4):
        # the speed at which such a frequency has so many waves a turn
        off = 60.0 * omega / (2.0 * math.pi * waves + 3.0 * math.pi + 2.0 * np.angle(compliance)) - rpm
        at = np.flatnonzero(off[1:] * off[:-1] < 0.0)
        share = off[at] / (off[at] - off[at + 1])
        real = compliance.real[at] + share * (compliance.real[at + 1] - compliance.real[at])
        depths += (1e3 * -0.5 / real / K_F).tolist()
    depth, _ = limit(structure).at_speed(rpm)
    assert depth == pytest.approx(min(depths), rel=1e-3)
    assert stability_is_lost(structure, depth, rpm)


def stability_is_lost(structure: Structure, depth_mm: float, rpm: float) -> bool:
    """Whether 1 + k·G·(1 − e^(−iωT)) goes round 0 at 1.02 of a depth, and not at 0.98 (Nyquist)."""
    turn_s, omega = 60.0 / rpm, 2.0 * math.pi * np.linspace(1.0, 3000.0, 2_000_000)
    joint, mass = structure.joints[0], structure.members[0].mass_kg
    compliance = 1.0 / (joint.stiffness_n_per_m * (1.0 + 1j * joint.dissipation / 2.0 / math.pi) - mass * omega**2)
    turns = []
    for share in (0.98, 1.02):
        curve = 1.0 + share * depth_mm * 1e-3 * K_F * compliance * (1.0 - np.exp(-1j * omega * turn_s))
        turns.append(round(float(np.unwrap(np.angle(curve))[-1]) / (2.0 * math.pi)))
    return turns[0] == 0 and turns[1] != 0


def test_depth_follows_the_law_of_the_force():
    structure = lathe()
    law = replace(LAW, depth_exponent=0.9, feed_exponent=0.75, speed_exponent=-0.15, feed_mm_per_rev=0.2)
    found = limit(structure, law)
    depth = float(found.depth_mm(np.float64(5e6), 900.0))
    speed = math.pi * 0.1 * 900.0

    def force(feed):
        return 10.0 * 100.0 * depth**0.9 * feed**0.75 * speed**-0.15

    assert (force(0.2 + 1e-6) - force(0.2 - 1e-6)) / 2e-6 == pytest.approx(5e3, rel=1e-6)


def test_a_force_that_does_not_grow_with_the_chip_has_no_limit():
    assert limit(lathe(), replace(LAW, feed_exponent=0.0)) is None


def test_of_a_mode_that_nothing_damps_nothing_is_said():
    plain = lathe()
    joints = (plain.joints[0], replace(plain.joints[1], dissipation=0.0))
    assert limit(Structure(plain.members, joints)) is None


def test_a_depth_beyond_the_radius_is_none():
    depth, frequency = limit(lathe(), replace(LAW, diameter_mm=1.0)).at_speed(5300.0)
    assert math.isinf(depth)
    assert math.isnan(frequency)


def test_far_above_all_lobes_nothing_chatters():
    depth, frequency = limit(lathe()).at_speed(1e6)
    assert math.isinf(depth)
    assert math.isnan(frequency)
