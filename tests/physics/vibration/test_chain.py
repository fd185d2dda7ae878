"""Numbers worked out by hand: tests/reference/test_vibration_chains.py."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.vibration.chains import Chain, chain_links, chain_receptance, chain_structure, force_sign
from selector.physics.vibration.structure import GROUND, Joint, Line, Member, Source, Structure, receptance

LATHE = Structure(
    tuple(
        Member(name, mass)
        for name, mass in {"chuck": 30.0, "spindle": 60.0, "head": 400.0, "bed": 2500.0, "slide": 200.0}.items()
    ),
    (
        Joint(("chuck", "spindle"), 9e8, 0.3),
        Joint(("spindle", "head"), 4e8, 0.4),
        Joint(("bed", "head"), 2e9, 0.5),
        Joint(("slide", "bed"), 2e7, 0.8),
        Joint(("slide", "head"), 1e7, 0.2),
        Joint(("bed", GROUND), 6e8, 0.6),
    ),
)
HZ = np.geomspace(1.0, 2000.0, 300)


def stack(light: float, *, hz: list[float], dissipation: list[float]) -> Structure:
    """Members m0, m1, … on the ground, each `light` times the next, with these natural frequencies one by one."""
    mass = [10.0 * light**-place for place in range(len(hz))]
    names = [*(f"m{place}" for place in range(len(hz))), GROUND]
    return Structure(
        tuple(Member(name, one) for name, one in zip(names, mass, strict=False)),
        tuple(
            Joint((names[place], names[place + 1]), mass[place] * (2 * math.pi * hz[place]) ** 2, psi)
            for place, psi in enumerate(dissipation)
        ),
    )


def stack_chain(count: int, forced: int) -> Chain:
    """The chain of a stack whose member `forced` is pushed and whose lightest member is asked for."""
    groups = [(f"m{place}",) for place in range(count)]
    branch = groups[:forced][::-1]
    return Chain("stack", "high", ("S",), tuple(groups[forced:]), "m0", branch=tuple(branch))


@st.composite
def stacks(draw: st.DrawFn) -> tuple[list[float], list[float], int]:
    """Natural frequencies, dissipations, and which member is forced."""
    count = draw(st.integers(2, 4))
    hz = draw(st.lists(st.floats(20.0, 500.0), min_size=count, max_size=count))
    psi = draw(st.lists(st.floats(0.3, 1.5), min_size=count, max_size=count))
    return hz, psi, draw(st.integers(0, count - 1))


def errors(light: float, case: tuple[list[float], list[float], int], *, dampers_carry: bool) -> np.ndarray:
    """|chain/coupled − 1| of every group at three frequencies, shape (n_links, 3)."""
    hz, psi, forced = case
    structure = stack(light, hz=hz, dissipation=psi)
    at_hz = [15.0, 120.0, 600.0]
    found = chain_receptance(structure, stack_chain(len(hz), forced), at_hz, dampers_carry=dampers_carry)
    exact = [receptance(structure, at_hz, of=link.group[0], at=f"m{forced}") for link in found.links]
    return np.abs(found.absolute / np.array(exact) - 1)


@given(stacks())
def test_with_dampers_that_carry_every_member_nears_the_coupled_solution_in_first_order(case):
    coarse, fine = errors(1e-6, case, dampers_carry=True), errors(1e-7, case, dampers_carry=True)
    # η ≥ 0.05: a light member changes the answer of a heavy one by mass ratio · μ, up to 20, times (p1/p2)² up to 625
    assert fine.max() < 1e-7 * 20 * 20 * 625 * 4
    # ten times lighter, ten times nearer: order 1; the next term is 1e-6 · 20 · 625 of it, several times
    assert fine.max() == pytest.approx(coarse.max() / 10, rel=0.05, abs=1e-9)


@given(stacks())
def test_as_published_the_forced_member_nears_the_coupled_solution_in_first_order(case):
    case = (*case[:2], 0)
    coarse, fine = (errors(light, case, dampers_carry=False)[0].max() for light in (1e-6, 1e-7))
    assert fine < 1e-7 * 20 * 20 * 625 * 4
    assert fine == pytest.approx(coarse / 10, rel=0.05, abs=1e-9)


@given(stacks())
def test_as_published_members_behind_joints_lack_the_part_of_the_dampers(case):
    hz, psi, forced = case
    structure = stack(1e-9, hz=hz, dissipation=psi)
    found = chain_receptance(structure, stack_chain(len(hz), forced), [120.0])
    for link, absolute in zip(found.links, found.absolute, strict=True):
        place = int(link.group[0][1:])
        # joints between the forced member and this one, whichever lies nearer to the ground
        passed = psi[min(forced, place) : max(forced, place)]
        lacking = math.prod(complex(1, one / (2 * math.pi)) for one in passed)
        exact = receptance(structure, [120.0], of=link.group[0], at=f"m{forced}")
        assert absolute * lacking == pytest.approx(exact, rel=1e-9 * 20 * 20 * 625 * 4)


@given(st.floats(1e-9, 0.5), st.floats(20.0, 500.0), st.floats(20.0, 500.0), st.floats(5.0, 800.0))
def test_undamped_one_light_branch_member_follows_its_carrier_exactly(light, hz_0, hz_1, at_hz):
    structure = stack(light, hz=[hz_0, hz_1], dissipation=[0.0, 0.0])
    if min(abs(at_hz / hz_0 - 1), abs(at_hz / hz_1 - 1)) < 1e-3:
        return
    chain = stack_chain(2, 1)
    found = chain_receptance(structure, chain, [at_hz])
    # whatever the carrier does, in the coupled structure the branch moves so against it
    try:
        exact = [receptance(structure, [at_hz], of=name, at="m1")[0] for name in ("m1", "m0")]
    except InputError:
        return
    # 1/|1 − r²| up to 500 times rounding
    assert found.final[0] / found.absolute[0, 0] == pytest.approx(exact[1] / exact[0], rel=1e-11)


def test_a_single_link_is_exact():
    one = Structure((Member("bed", 2500.0),), (Joint(("bed", GROUND), 6e8, 0.6), Joint((GROUND, "bed"), 2e8, 0.2)))
    chain = Chain("one", "low", (), (("bed",),), "bed")
    exact = receptance(one, HZ, of="bed", at="bed")
    assert np.abs(chain_receptance(one, chain, HZ).final / exact - 1).max() < 1e-13


def test_at_rest_the_branch_rides_along():
    chain = Chain("ride", "low", (), (("head", "bed"),), "chuck", branch=(("spindle",), ("chuck",)))
    found = chain_receptance(LATHE, chain, [0.0], dampers_carry=True)
    assert found.absolute[:, 0] == pytest.approx(np.full(3, found.absolute[0, 0]), rel=1e-15)


def test_the_phase_lies_between_0_and_180_degrees_also_above_the_resonance():
    bed = Structure((Member("bed", 100.0),), (Joint(("bed", GROUND), 1e8, 0.2),))
    found = chain_receptance(bed, Chain("c", "low", (), (("bed",),), "bed"), HZ)
    assert (np.diff(found.lag_rad[0]) > 0).all()
    assert found.lag_rad[0, 0] == pytest.approx(0.2 / (2 * math.pi), rel=1e-3)  # atan η at rest
    assert math.pi - 0.01 < found.lag_rad[0, -1] < math.pi


def test_links_and_the_chain_alone():
    chain = Chain("c", "low", ("S",), (("spindle", "chuck"), ("head",)), "slide", branch=(("slide",),), held="bed")
    path, branch = chain_links(LATHE, chain)
    assert [(link.group, link.on, link.mass_kg) for link in (*path, *branch)] == [
        (("spindle", "chuck"), ("head",), 90.0),
        (("head",), ("bed",), 400.0),
        (("slide",), ("head",), 200.0),
    ]
    alone = chain_structure(LATHE, chain)
    assert alone.names == ("spindle + chuck", "head", "slide")
    assert [joint.between for joint in alone.joints] == [
        ("spindle + chuck", "head"),
        ("head", GROUND),
        ("slide", "head"),
    ]
    assert [joint.dissipation for joint in alone.joints] == pytest.approx([0.4, 0.5, 0.2], rel=1e-14)


def test_force_sign_says_which_side_of_the_source_the_chain_begins_at():
    chain = Chain("c", "high", ("S",), (("spindle", "chuck"), ("head",)), "spindle", held="bed")
    lines = (Line(frequency_hz=1.0, force_n=1.0),)
    assert force_sign(chain, Source("S", "chuck", lines, against="slide")) == 1
    assert force_sign(chain, Source("S", "slide", lines, against="chuck")) == -1
    assert force_sign(chain, Source("S", "chuck", lines)) == 1
    for member, against, how in (
        ("head", "bed", "outside of"),
        ("bed", None, "outside of"),
        ("chuck", "spindle", "within"),
    ):
        with pytest.raises(InputError, match=rf"'S', which acts {how} \(spindle, chuck\)") as refused:
            force_sign(chain, Source("S", member, lines, against=against))
        assert refused.value.where == "chains.c.sources"


@pytest.mark.parametrize(
    ("chain", "where", "found"),
    [
        (Chain("c", "low", (), (("chuck",), ("head",)), "chuck"), "path", r"no joint between \(chuck\) and \(head\)"),
        (Chain("c", "low", (), (("head",),), "head"), "path", r"no joint between \(head\) and \(ground\)"),
        (Chain("c", "low", (), (("bed",),), "bed", held="chuck"), "path", r"no joint between \(bed\) and \(chuck\)"),
        (
            Chain("c", "low", (), (("bed",),), "chuck", branch=(("head",), ("chuck",))),
            "branch",
            r"\(chuck\) and \(head\)",
        ),
        (
            Chain("c", "low", (), (("bed",),), "chuck", branch=(("chuck",),)),
            "branch",
            "joined with no group of the path",
        ),
        (
            Chain("c", "low", (), (("head",), ("bed",)), "slide", branch=(("slide",),)),
            "branch",
            r"\(slide\) joined with \(head\) and \(bed\)",
        ),
        (Chain("c", "low", (), (("x",), ("bed",)), "x"), "path", r"between \(x\)"),
        (Chain("c", "low", (), (("bed",),), "x", branch=(("x",),)), "branch", r"\(x\)"),
        (Chain("c", "low", (), (("bed",),), "bed", held="x"), "path", r"and \(x\)"),
    ],
)
def test_what_is_no_chain_of_the_structure_is_refused_by_name(chain, where, found):
    for function in (chain_links, chain_structure):
        with pytest.raises(InputError, match=found) as refused:
            function(LATHE, chain)
        assert refused.value.where == f"chains.c.{where}"
    with pytest.raises(InputError, match=found):
        chain_receptance(LATHE, chain, [1.0])


def test_a_resonance_that_nothing_damps_is_refused_with_member_and_frequency():
    # spindle alone: √(4e8/60)/2π = 410.936 Hz
    stiff = replace(LATHE, joints=tuple(replace(joint, dissipation=0.0) for joint in LATHE.joints))
    chain = Chain("c", "high", (), (("spindle",), ("head",)), "spindle", held="bed")
    at_hz = math.sqrt(4e8 / 60) / (2 * math.pi)
    with pytest.raises(InputError, match=r"410\.936 Hz.*\(spindle\).*\(head\)") as refused:
        chain_receptance(stiff, chain, [100.0, at_hz])
    assert refused.value.where == "chains.c"
    assert np.isfinite(chain_receptance(stiff, chain, [at_hz * (1 + 1e-6)]).final).all()
    assert np.isfinite(chain_receptance(LATHE, chain, [at_hz]).final).all()
