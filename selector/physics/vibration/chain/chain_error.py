"""Where is the published chain method good: its error against the coupled solution, as a map and for given chains.

Errors are those of the complex amplitude, |X_chain/X_coupled − 1|: a wrong phase counts, since motions of several
sources and chains are added.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.vibration.chain.chain import (
    Chain,
    chain_receptance,
    chain_structure,
    force_sign,
    in_range,
    merged_name,
)
from selector.physics.vibration.structure.source import Source
from selector.physics.vibration.structure.structure import Structure, checked_frequencies, receptance, receptances
from selector.types import Complex, Vector

Kind = Literal["first", "second"]

NOTHING = 1e-20
"""Share of its largest amplitude below which a reference is an antiresonance that no ratio is taken to."""


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

    @property
    def error(self) -> Vector:
        """|ratio − 1|, shape (n_freq,)."""
        return np.abs(self.ratio - 1.0)


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


@dataclass(frozen=True)
class ChainErrorMap:
    """Error of a chain of two members over a band, one row a mass ratio and one column a frequency ratio."""

    mass_ratio: Vector  #: (n_mass,): m1/m2: forced or hanging member over the one on the ground
    frequency_ratio: Vector  #: (n_freq,): p1/p2, each alone on its joint
    #: share_within, rms_db and largest_error: (n_mass, n_freq): As in `Agreement`
    share_within: Vector
    rms_db: Vector
    largest_error: Vector


def two_member_ratio(
    mass_ratio: ArrayLike,
    frequency_ratio: ArrayLike,
    forcing_ratio: ArrayLike,
    *,
    dissipation: tuple[float, float],
    kind: Kind = "first",
    dampers_carry: bool = False,
) -> Complex:
    """Motion of member 1 by the chain over the coupled one, for members 1 – 2 – ground; the arguments broadcast.

    With dampers that carry it is 1 − ε, ε = (1 + iη1)·m1/m2·(ω/p2)²·H1·H2 with H = μ·e^{−iφ}: of both kinds alike.

    The ratios are m1/m2, p1/p2 and ω/p1; `dissipation` is ψ of the joint 1 – 2 and of that of 2 with the ground. Of the
    first kind the force acts on member 1, of the second on member 2, of which member 1 is the branch.

    InputError at an undamped resonance, and for ratios that are not above 0.
    """
    mass, frequency, forcing = (
        np.asarray(ratio, dtype=np.float64) for ratio in (mass_ratio, frequency_ratio, forcing_ratio)
    )
    for name, ratio, allowed in (
        ("mass_ratio", mass, mass > 0.0),
        ("frequency_ratio", frequency, frequency > 0.0),
        ("forcing_ratio", forcing, forcing >= 0.0),
    ):
        if not (np.isfinite(ratio) & allowed).all():
            raise InputError(
                "a ratio of masses or frequencies that cannot be",
                expected="numbers above 0; 0 is allowed for forcing at rest",
                where=name,
                advice="correct the ratios",
            )
    first, second = (np.complex128(complex(1.0, psi / (2.0 * math.pi))) for psi in dissipation)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        answer_1, answer_2 = 1.0 / (first - forcing**2), 1.0 / (second - (forcing * frequency) ** 2)
        # exact: what member 1 does to member 2 comes back as this share of the motion
        found = 1.0 - first * mass * (forcing * frequency) ** 2 * answer_1 * answer_2
        # X2/F·j1 of V, without the force of the damper
        behind = mass * frequency**2 * answer_2
        if not dampers_carry:
            found = found * (1.0 + behind) / (1.0 + first * behind) if kind == "first" else found / first
    if not np.isfinite(found).all():
        raise InputError(
            "a force at a resonance that nothing damps",
            expected="ψ above 0, or forcing off the resonances",
            where="dissipation",
            advice="give both joints a dissipation",
        )
    return np.asarray(found)


def chain_error_map(
    mass_ratio: ArrayLike,
    frequency_ratio: ArrayLike,
    *,
    dissipation: tuple[float, float],
    forcing_ratio: ArrayLike,
    kind: Kind = "first",
    dampers_carry: bool = False,
    within: float = 0.1,
) -> ChainErrorMap:
    """Errors of the chain of two members over all mass ratios and frequency ratios, each over a band of ω/p1.

    `forcing_ratio` holds the frequencies of the band, in the spacing in which they shall count; one of them alone
    gives the error there. `within` is the limit of the error. Else as `two_member_ratio`.
    """
    mass, frequency, forcing = (
        np.atleast_1d(np.asarray(values, np.float64)) for values in (mass_ratio, frequency_ratio, forcing_ratio)
    )
    ratio = two_member_ratio(
        mass[:, None, None],
        frequency[:, None],
        forcing,
        dissipation=dissipation,
        kind=kind,
        dampers_carry=dampers_carry,
    )
    error = np.abs(ratio - 1.0)
    return ChainErrorMap(
        mass_ratio=mass,
        frequency_ratio=frequency,
        share_within=(error <= within).mean(axis=2),
        rms_db=np.sqrt((_decibel(ratio) ** 2).mean(axis=2)),
        largest_error=error.max(axis=2),
    )


def chain_accuracy(
    structure: Structure,
    chains: Sequence[Chain],
    frequency_hz: ArrayLike,
    *,
    sources: Sequence[Source] = (),
    split_hz: float | None = None,
    within: float = 0.1,
    dampers_carry: bool = False,
) -> tuple[ChainAccuracy, ...]:
    """How good every chain is, for every source of it that is given; a chain without any: force spread by mass.

    The same unit force acts in the chain and in the whole structure: on the member of the chain's first group that
    the source pushes, or pushes against; what it does to its other side is the affair of other chains.

    Judged at `frequency_hz`, increasing [Hz], in the spacing in which they shall count: high chains above `split_hz`,
    low ones up to it, all everywhere without it; a chain without a frequency in its range is left out of the result.
    `within` is the limit of the error, as a share; `dampers_carry` is of `chain_receptance`.

    InputError at an undamped resonance; for chains that are no way through the structure, or on which a source does not
    act.
    """
    frequency = checked_frequencies(frequency_hz)
    if not chains:
        return ()
    alone_of = {chain.name: chain_structure(structure, chain) for chain in chains}
    cases = [(chain, source) for chain in chains for source in _acting(chain, sources)]
    motion = receptances(structure, frequency, np.array([_spread(structure, *case) for case in cases]))
    judged = []
    for (chain, source), whole in zip(cases, motion, strict=True):
        counts = in_range(chain.range, frequency, split_hz)
        at_hz = frequency[counts]
        if not len(at_hz):
            continue
        published = chain_receptance(structure, chain, at_hz, dampers_carry=dampers_carry).final
        end = merged_name(chain.branch[-1] if chain.branch else chain.path[0])
        alone = receptance(alone_of[chain.name], at_hz, of=end, at=merged_name(chain.path[0]))
        exact = whole[counts, structure.position(chain.final)]
        judged.append(
            ChainAccuracy(
                chain=chain.name,
                final=chain.final,
                source=None if source is None else source.name,
                frequency_hz=at_hz,
                published=_agreement(at_hz, published, exact, within),
                one_way=_agreement(at_hz, published, alone, within),
                cut_out=_agreement(at_hz, alone, exact, within),
            )
        )
    return tuple(judged)


def _agreement(frequency_hz: Vector, amplitude: Complex, reference: Complex, within: float) -> Agreement:
    """One complex amplitude beside another, both of shape (n_freq,); `within` is the limit of the error."""
    # 1e-280: where even the largest amplitude is no number any more
    floor = max(NOTHING * float(np.abs(reference).max()), 1e-280)
    ratio = amplitude / np.where(np.abs(reference) < floor, floor, reference)
    error = np.abs(ratio - 1.0)
    inside = error <= within
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
    largest = int(np.argmax(error))
    ratio.setflags(write=False)
    return Agreement(
        ratio=ratio,
        share_within=float(inside.mean()),
        rms_db=float(np.sqrt((_decibel(ratio) ** 2).mean())),
        largest_error=float(error[largest]),
        largest_at_hz=float(frequency_hz[largest]),
        bands_hz=tuple(
            (float(frequency_hz[begin]), float(frequency_hz[end - 1])) for begin, end in list(pairwise(edges))[::2]
        ),
    )


def _decibel(ratio: Complex) -> Vector:
    # 300 dB: as good as nothing
    return 20.0 * np.log10(np.clip(np.abs(ratio), 1e-15, 1e15))


def _acting(chain: Chain, sources: Sequence[Source]) -> list[Source | None]:
    """Those of the sources that the chain names; None where it names none of them."""
    named: list[Source | None] = [source for source in sources if source.name in chain.sources]
    return named or [None]


def _spread(structure: Structure, chain: Chain, source: Source | None) -> Vector:
    """Unit force on the members: where the source acts in the chain's first group, or over the group by mass."""
    group = chain.path[0]
    if source is not None:
        pushed = source.member if force_sign(chain, source) > 0 else source.against
        group = (pushed,) if pushed is not None else group
    mass = np.array([member.mass_kg if member.name in group else 0.0 for member in structure.members])
    return mass / mass.sum()
