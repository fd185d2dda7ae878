"""Chains from a source to tool or workpiece, and how far a force shakes their ends as published (V eq. 3–9)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.vibration.rounding import above
from selector.physics.vibration.structure.source import Source
from selector.physics.vibration.structure.structure import (
    GROUND,
    UNDAMPED,
    Joint,
    Member,
    Structure,
    checked_frequencies,
)
from selector.types import Complex

Range = Literal["high", "low"]
Group = tuple[str, ...]
"""Members that move as one mass."""


@dataclass(frozen=True)
class Chain:
    """One way from sources to a final member."""

    name: str
    range: Range  #: {"high", "low"}: Part of the spectrum that it is meant for: roughness, or waviness and lobing
    sources: tuple[str, ...]  #: Sources that act on the first group of the path
    path: tuple[Group, ...]  #: Groups from the source towards the ground
    final: str  #: Member whose motion is asked for: of the branch's last group, or of the path's first
    #: Groups from the one that hangs on the path to the final one; empty: the motion of the path's first group counts
    branch: tuple[Group, ...] = ()
    held: str = GROUND  #: What the path ends at and is taken as standing still: `GROUND`, or a member that is a barrier

    def __post_init__(self) -> None:
        groups = (*self.path, *self.branch)
        names = [name for group in groups for name in group]
        twice = next((name for name in names if names.count(name) > 1), None)
        end = self.branch[-1] if self.branch else self.path[0] if self.path else ()
        wrong = (
            ("a path without members", "path")
            if not self.path or not all(groups)
            else (f"{twice!r} twice", "path")
            if twice is not None
            else (f"{self.held!r}, which moves in this chain", "held")
            if self.held in names
            else (f"{self.final!r}, which is not in ({', '.join(end)})", "final")
            if self.final not in end
            else None
        )
        if wrong is not None:
            raise InputError(
                wrong[0],
                expected="every member once, the final one at the end of the branch, or first without one",
                where=wrong[1],
                advice=f"correct the chain {self.name!r}",
            )


def in_range(chain_range: Range, frequency_hz: NDArray[np.float64], split_hz: float | None) -> NDArray[np.bool_]:
    """Whether chains of this range hold at these frequencies [Hz]: high ones above `split_hz`; None: everywhere."""
    if split_hz is None:
        return np.ones(len(frequency_hz), dtype=np.bool_)
    high = above(frequency_hz, split_hz)
    return high if chain_range == "high" else ~high


@dataclass(frozen=True)
class Link:
    """Merged members on what joins them with their neighbour."""

    group: Group  #: Members that move as one mass
    on: Group  #: What they are joined with: the next group towards what is held, or the one before in a branch
    mass_kg: float  #: Sum of the masses [kg]
    stiffness_n_per_m: float  #: j, sum over the joints between the two [N/m]
    loss_factor: float  #: η of these joints in parallel

    @property
    def natural_hz(self) -> float:
        """p/2π, natural frequency of the group on a joint that stands still [Hz]: p = √(j/m)."""
        return math.sqrt(self.stiffness_n_per_m / self.mass_kg) / (2.0 * math.pi)


@dataclass(frozen=True)
class ChainReceptance:
    """Motions of a chain per unit force on its first group; rows belong to `links`: the path's, then the branch's."""

    frequency_hz: NDArray[np.float64]  #: (n_freq,): [Hz]
    links: tuple[Link, ...]  #: Of the path from the source on, then of the branch outwards
    #: dynamic_factor and lag_rad: (n_links, n_freq): μ (V eq. 4) and φ in [0, π] (eq. 6) of every link
    dynamic_factor: NDArray[np.float64]
    lag_rad: NDArray[np.float64]
    #: (n_path_links, n_freq): Motion of every group of the path against the next [m/N] (V eq. 3, with its phase as in
    #: eq. 7)
    relative: Complex
    absolute: Complex  #: (n_links, n_freq): Motion of every group against what is held [m/N]
    final: Complex  #: (n_freq,): Motion that is asked for: of the path's first group, or of the branch's last [m/N]


def chain_receptance(
    structure: Structure, chain: Chain, frequency_hz: ArrayLike, *, dampers_carry: bool = False
) -> ChainReceptance:
    """Motions of a chain per unit force on its first group, by the published method.

    `dampers_carry` passes the force of a joint's damper on as well, (1 + iη) times the published force.

    Raises InputError if neighbours of the chain have no joint, a member is unknown, or a group is forced at a resonance
    that nothing damps.
    """
    frequency = checked_frequencies(frequency_hz)
    path, branch = chain_links(structure, chain)
    links = (*path, *branch)
    answers = np.array([_answer(link, frequency, chain) for link in links]).reshape(len(links), len(frequency))
    passed_on = np.array([complex(1.0, link.loss_factor if dampers_carry else 0.0) for link in links])[:, None]
    stiffness = np.array([link.stiffness_n_per_m for link in links])[:, None]
    relative = np.empty((len(path), len(frequency)), dtype=np.complex128)
    force = np.ones(len(frequency), dtype=np.complex128)
    for row in range(len(path)):
        relative[row] = force * answers[row] / stiffness[row]
        force = force * answers[row] * passed_on[row]
    absolute = np.empty(answers.shape, dtype=np.complex128)
    absolute[: len(path)] = np.cumsum(relative[::-1], axis=0)[::-1]
    for row in range(len(path), len(links)):
        carrier = [link.group for link in links].index(links[row].on)
        absolute[row] = absolute[carrier] * passed_on[row] * answers[row]
    return ChainReceptance(
        frequency_hz=frequency,
        links=links,
        dynamic_factor=np.abs(answers),
        lag_rad=np.abs(np.angle(answers)),
        relative=relative,
        absolute=absolute,
        final=absolute[-1] if branch else absolute[0],
    )


def chain_links(structure: Structure, chain: Chain) -> tuple[tuple[Link, ...], tuple[Link, ...]]:
    """Links of the path, from the source on, and of the branch, outwards from the group that carries it.

    InputError if a member is unknown, neighbours have no joint, or not exactly one group of the path carries the
    branch.
    """
    for key, names in (
        ("path", sum(chain.path, ())),
        ("branch", sum(chain.branch, ())),
        ("held", () if chain.held == GROUND else (chain.held,)),
    ):
        unknown = [name for name in names if name not in structure.names]
        if unknown:
            raise InputError(
                f"a member {unknown[0]!r}",
                expected=f"one of {', '.join(structure.names)}",
                where=f"chains.{chain.name}.{key}",
                advice="correct the name, or add the member",
            )
    onto = (*chain.path[1:], (chain.held,))
    path = tuple(
        _link(structure, group, on, f"chains.{chain.name}.path") for group, on in zip(chain.path, onto, strict=True)
    )
    if not chain.branch:
        return path, ()
    where = f"chains.{chain.name}.branch"
    carriers = [group for group in chain.path if _joints_between(structure, chain.branch[0], group)]
    if len(carriers) != 1:
        raise InputError(
            f"({', '.join(chain.branch[0])}) joined with "
            + (" and ".join(f"({', '.join(group)})" for group in carriers) or "no group of the path"),
            expected="a first group of the branch that is joined with exactly one group of the path",
            where=where,
            advice="begin the branch at the member that hangs on the path, or merge the groups that carry it",
        )
    onto = (carriers[0], *chain.branch[:-1])
    return path, tuple(_link(structure, group, on, where) for group, on in zip(chain.branch, onto, strict=True))


def chain_structure(structure: Structure, chain: Chain) -> Structure:
    """The chain alone as a structure to be solved coupled: groups merged, what is held as ground, its links only.

    Members are called as their group's, joined by " + ". Errors: as `chain_links`.
    """
    links = sum(chain_links(structure, chain), ())
    return Structure(
        members=tuple(Member(merged_name(link.group), link.mass_kg) for link in links),
        joints=tuple(
            Joint(
                (merged_name(link.group), GROUND if link.on == (chain.held,) else merged_name(link.on)),
                link.stiffness_n_per_m,
                2.0 * math.pi * link.loss_factor,
            )
            for link in links
        ),
    )


def merged_name(group: Group) -> str:
    """What a group is called as one member."""
    return " + ".join(group)


def force_sign(chain: Chain, source: Source) -> int:
    """+1 if the source pushes the chain's first group, −1 if it pushes against it.

    InputError if it does neither or both.
    """
    pushes, pushed_against = source.member in chain.path[0], source.against in chain.path[0]
    if pushes == pushed_against:
        raise InputError(
            f"{source.name!r}, which acts " + ("within" if pushes else "outside of") + f" ({', '.join(chain.path[0])})",
            expected="a source that pushes the first group of the path, or pushes against it",
            where=f"chains.{chain.name}.sources",
            advice="leave the source out of this chain, or begin the path where it acts",
        )
    return 1 if pushes else -1


def _answer(link: Link, frequency_hz: NDArray[np.float64], chain: Chain) -> Complex:
    """μ·e^{−iφ} of a link (V eq. 4, 6)."""
    beside = 1.0 - (frequency_hz / link.natural_hz) ** 2
    size = np.hypot(beside, link.loss_factor)
    resonant = np.flatnonzero(size < UNDAMPED)
    if len(resonant):
        raise InputError(
            f"a force at {frequency_hz[resonant[0]]:.6g} Hz, the natural frequency of ({', '.join(link.group)}) on its "
            f"joint with ({', '.join(link.on)}), which nothing damps",
            expected="frequencies off the undamped resonances, or joints that take energy",
            where=f"chains.{chain.name}",
            advice="give this joint its dissipation (ψ above 0), or move the frequency",
        )
    # φ by arctan2: the published arctan jumps back by π above the resonance
    return np.asarray(np.exp(-1j * np.arctan2(link.loss_factor, beside)) / size)


def _link(structure: Structure, group: Group, on: Group, where: str) -> Link:
    joints = _joints_between(structure, group, on)
    if not joints:
        raise InputError(
            f"no joint between ({', '.join(group)}) and ({', '.join(on)})",
            expected="a joint between neighbours of a chain, and between its last group and what is held",
            where=where,
            advice="add the joint to the structure, or name the members that lie between",
        )
    stiffness = sum(joint.complex_stiffness_n_per_m for joint in joints)
    return Link(
        group=group,
        on=on,
        mass_kg=sum(structure.members[structure.position(name)].mass_kg for name in group),
        stiffness_n_per_m=stiffness.real,
        loss_factor=stiffness.imag / stiffness.real,
    )


def _joints_between(structure: Structure, group: Group, on: Group) -> list[Joint]:
    return [
        joint
        for joint in structure.joints
        if any(one in group and other in on for one, other in (joint.between, joint.between[::-1]))
    ]
