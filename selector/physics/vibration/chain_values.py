"""Which way does the force of a source take to the tool or the workpiece: the chains of V as values.

A *chain* is the path of merged members from the one on which the source acts to what is held still. The motion that is
asked for is that of the member on which the source acts (V: first kind, Fig. 2), or that of a *branch* which hangs on
one of the path's members (second kind, Fig. 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.vibration.sameness import above
from selector.physics.vibration.structure import GROUND

Range = Literal["high", "low"]
Group = tuple[str, ...]
"""Members that move as one mass."""


@dataclass(frozen=True)
class Chain:
    """One way from sources to a final member.

    Attributes
    ----------
    name : str
    range : {"high", "low"}
        Part of the spectrum that it is meant for: roughness, or waviness and lobing.
    sources : tuple of str
        Sources that act on the first group of the path.
    path : tuple of tuple of str
        Groups from the source towards the ground.
    branch : tuple of tuple of str
        Groups from the one that hangs on the path to the final one; empty: the motion of the path's first group counts.
    final : str
        Member whose motion is asked for: of the branch's last group, or of the path's first.
    held : str
        What the path ends at and is taken as standing still: `GROUND`, or a member that is a barrier.
    """

    name: str
    range: Range
    sources: tuple[str, ...]
    path: tuple[Group, ...]
    final: str
    branch: tuple[Group, ...] = ()
    held: str = GROUND

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
