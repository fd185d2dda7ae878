"""Chains from a source to tool or workpiece (V eq. 3–9): how far a force shakes their ends, and where that is good.

Errors are those of the complex amplitude, |X_chain/X_coupled − 1|: a wrong phase counts, since motions of several
sources and chains are added.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError, Misfit
from selector.physics.checks import Checked
from selector.physics.ranges import above, true_stretches
from selector.physics.vibration import structure as structures
from selector.types import Array, Complex, Mask, Vector

Range = Literal["high", "low"]
Group = tuple[str, ...]  #: Members that move as one mass.


@dataclass(frozen=True)
class Chain(Checked):
    """One way from sources to a final member."""

    name: str
    range: Range  #: {"high", "low"}: Part of the spectrum that it is meant for: roughness, or waviness and lobing
    sources: tuple[str, ...]  #: Sources that act on the first group of the path
    path: tuple[Group, ...]  #: Groups from the source towards the ground
    final: str  #: Member whose motion is asked for: of the branch's last group, or of the path's first
    #: Groups from the one that hangs on the path to the final one; empty: the motion of the path's first group counts
    branch: tuple[Group, ...] = ()
    held: str = (
        structures.GROUND
    )  #: What the path ends at and is taken as standing still: `GROUND`, or a member that is a barrier

    def _misfits(self) -> Iterator[Misfit]:
        groups = (*self.path, *self.branch)
        names = [name for group in groups for name in group]
        twice = next((name for name in names if names.count(name) > 1), None)
        end = self.branch[-1] if self.branch else self.path[0] if self.path else ()
        expected = "every member once, the final one at the end of the branch, or first without one"
        advice = f"correct the chain {self.name!r}"
        if not self.path or not all(groups):
            yield "a path without members", expected, "path", advice
        if twice is not None:
            yield f"{twice!r} twice", expected, "path", advice
        if self.held in names:
            yield f"{self.held!r}, which moves in this chain", expected, "held", advice
        if self.final not in end:
            yield f"{self.final!r}, which is not in ({', '.join(end)})", expected, "final", advice


def in_range(chain_range: Range, frequency_hz: Array, split_hz: float | None) -> Mask:
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

    links: tuple[Link, ...]  #: Of the path from the source on, then of the branch outwards
    #: dynamic_factor and lag_rad: (n_links, n_freq): μ (V eq. 4) and φ in [0, π] (eq. 6) of every link
    dynamic_factor: Array
    lag_rad: Array
    #: (n_path_links, n_freq): Motion of every group of the path against the next [m/N] (V eq. 3, with its phase as in
    #: eq. 7)
    relative: Complex
    absolute: Complex  #: (n_links, n_freq): Motion of every group against what is held [m/N]
    final: Complex  #: (n_freq,): Motion that is asked for: of the path's first group, or of the branch's last [m/N]


def chain_receptance(
    structure: structures.Structure, chain: Chain, frequency_hz: ArrayLike, *, dampers_carry: bool = False
) -> ChainReceptance:
    """Motions of a chain per unit force on its first group, by the published method.

    `dampers_carry` passes the force of a joint's damper on as well, (1 + iη) times the published force.

    Raises InputError if neighbours of the chain have no joint, a member is unknown, or a group is forced at a resonance
    that nothing damps.
    """
    frequency = np.asarray(frequency_hz, dtype=np.float64)
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
        links=links,
        dynamic_factor=np.abs(answers),
        lag_rad=np.abs(np.angle(answers)),
        relative=relative,
        absolute=absolute,
        final=absolute[-1] if branch else absolute[0],
    )


def chain_links(structure: structures.Structure, chain: Chain) -> tuple[tuple[Link, ...], tuple[Link, ...]]:
    """Links of the path, from the source on, and of the branch, outwards from the group that carries it.

    InputError if neighbours have no joint, or not exactly one group of the path carries the branch.
    """
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


def chain_structure(structure: structures.Structure, chain: Chain) -> structures.Structure:
    """The chain alone as a structure to be solved coupled: groups merged, what is held as ground, its links only.

    Members are called as their group's, joined by " + ". Errors: as `chain_links`.
    """
    links = sum(chain_links(structure, chain), ())
    return structures.Structure(
        members=tuple(structures.Member(merged_name(link.group), link.mass_kg) for link in links),
        joints=tuple(
            structures.Joint(
                (merged_name(link.group), structures.GROUND if link.on == (chain.held,) else merged_name(link.on)),
                link.stiffness_n_per_m,
                2.0 * math.pi * link.loss_factor,
            )
            for link in links
        ),
    )


def merged_name(group: Group) -> str:
    """What a group is called as one member."""
    return " + ".join(group)


def force_sign(chain: Chain, source: structures.Source) -> int:
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


def _answer(link: Link, frequency_hz: Array, chain: Chain) -> Complex:
    """μ·e^{−iφ} of a link (V eq. 4, 6)."""
    beside = 1.0 - (frequency_hz / link.natural_hz) ** 2
    size = np.hypot(beside, link.loss_factor)
    resonant = np.flatnonzero(size < structures.UNDAMPED)
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


def _link(structure: structures.Structure, group: Group, on: Group, where: str) -> Link:
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


def _joints_between(structure: structures.Structure, group: Group, on: Group) -> list[structures.Joint]:
    return [
        joint
        for joint in structure.joints
        if any(one in group and other in on for one, other in (joint.between, joint.between[::-1]))
    ]


WITHIN = 0.1  #: Limit of the error within which the chains count as good.
#: Share of its largest amplitude below which a reference is an antiresonance that no ratio is taken to.
NOTHING = 1e-20


@dataclass(frozen=True)
class Agreement:
    """One solution beside another, over frequency."""

    #: (n_freq,): Amplitude by the one over that by the other; at an undamped antiresonance of the other over 10⁻²⁰ of
    #: its largest
    ratio: Complex
    share_within: float  #: Share of the frequencies at which the error is within the limit
    rms_db: float  #: Root mean square of 20·log10|ratio| [dB]: of the amplitude alone
    #: largest_error and largest_at_hz: Largest error |ratio − 1|, and where
    largest_error: float
    largest_at_hz: float
    bands_hz: tuple[tuple[float, float], ...]  #: From where to where the error is within the limit [Hz]


@dataclass(frozen=True)
class ChainAccuracy:
    """How good one chain is for one source; ratios multiply: published = one_way · cut_out."""

    #: chain and final: Names of the chain and of the member whose motion is judged
    chain: str
    final: str
    source: str | None  #: Source whose place the force has; None: spread over the chain's first group by mass
    frequency_hz: Vector  #: (n_freq,): Frequencies of the chain's range [Hz]
    published: Agreement  #: Published method beside the coupled solution of the whole structure
    one_way: Agreement  #: Published method beside the coupled solution of the chain alone: what its links leave out
    #: Coupled solution of the chain alone beside that of the whole structure: what merging, holding and leaving out
    #: members does
    cut_out: Agreement


def chain_accuracy(
    structure: structures.Structure,
    chains: Sequence[Chain],
    frequency_hz: ArrayLike,
    *,
    sources: Sequence[structures.Source] = (),
    split_hz: float | None = None,
    dampers_carry: bool = False,
) -> tuple[ChainAccuracy, ...]:
    """How good every chain is, for every source of it that is given; a chain without any: force spread by mass.

    The same unit force acts in the chain and in the whole structure: on the member of the chain's first group that
    the source pushes, or pushes against; what it does to its other side is the affair of other chains.

    Judged at `frequency_hz`, increasing [Hz], in the spacing in which they shall count: high chains above `split_hz`,
    low ones up to it, all everywhere without it; a chain without a frequency in its range is left out of the result.
    `dampers_carry` is of `chain_receptance`.

    InputError at an undamped resonance; for chains that are no way through the structure, or on which a source does not
    act.
    """
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    if not chains:
        return ()
    alone_of = {chain.name: chain_structure(structure, chain) for chain in chains}
    cases = [(chain, source) for chain in chains for source in _acting(chain, sources)]
    motion = structures.receptances(structure, frequency, np.array([_spread(structure, *case) for case in cases]))
    judged = []
    for (chain, source), whole in zip(cases, motion, strict=True):
        counts = in_range(chain.range, frequency, split_hz)
        at_hz = frequency[counts]
        if not len(at_hz):
            continue
        published = chain_receptance(structure, chain, at_hz, dampers_carry=dampers_carry).final
        end = merged_name(chain.branch[-1] if chain.branch else chain.path[0])
        alone = structures.receptance(alone_of[chain.name], at_hz, of=end, at=merged_name(chain.path[0]))
        exact = whole[counts, structure.position(chain.final)]
        judged.append(
            ChainAccuracy(
                chain=chain.name,
                final=chain.final,
                source=None if source is None else source.name,
                frequency_hz=at_hz,
                published=_agreement(at_hz, published, exact),
                one_way=_agreement(at_hz, published, alone),
                cut_out=_agreement(at_hz, alone, exact),
            )
        )
    return tuple(judged)


def _agreement(frequency_hz: Vector, amplitude: Complex, reference: Complex) -> Agreement:
    """One complex amplitude beside another, both of shape (n_freq,)."""
    # 1e-280: where even the largest amplitude is no number any more
    floor = max(NOTHING * float(np.abs(reference).max()), 1e-280)
    ratio = amplitude / np.where(np.abs(reference) < floor, floor, reference)
    error = np.abs(ratio - 1.0)
    inside = error <= WITHIN
    largest = int(np.argmax(error))
    ratio.setflags(write=False)
    return Agreement(
        ratio=ratio,
        share_within=float(inside.mean()),
        rms_db=float(np.sqrt((decibel(ratio) ** 2).mean())),
        largest_error=float(error[largest]),
        largest_at_hz=float(frequency_hz[largest]),
        bands_hz=tuple(
            (float(frequency_hz[begin]), float(frequency_hz[end - 1])) for begin, end in true_stretches(inside)
        ),
    )


def decibel(ratio: Complex) -> Vector:
    """Size of a ratio [dB], shape of `ratio`; 300 dB: as good as nothing."""
    return 20.0 * np.log10(np.clip(np.abs(ratio), 1e-15, 1e15))


def _acting(chain: Chain, sources: Sequence[structures.Source]) -> list[structures.Source | None]:
    """Those of the sources that the chain names; None where it names none of them."""
    named: list[structures.Source | None] = [source for source in sources if source.name in chain.sources]
    return named or [None]


def _spread(structure: structures.Structure, chain: Chain, source: structures.Source | None) -> Vector:
    """Unit force on the members: where the source acts in the chain's first group, or over the group by mass."""
    group = chain.path[0]
    if source is not None:
        pushed = source.member if force_sign(chain, source) > 0 else source.against
        group = (pushed,) if pushed is not None else group
    mass = np.array([member.mass_kg if member.name in group else 0.0 for member in structure.members])
    return mass / mass.sum()
