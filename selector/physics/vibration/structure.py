"""What vibrates: masses that move along one line, joined by springs that take a share of the energy in every cycle.

A joint has the complex stiffness j·(1 + iη) with the loss factor η = ψ/2π (V: relative energy dissipation ψ).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from selector.errors import InputError
from selector.physics.checks import require_not_negative, require_positive

GROUND = "ground"
"""What does not move: the foundation."""


@dataclass(frozen=True)
class Member:
    """A part of the machine that moves as one mass.

    Attributes
    ----------
    name : str
    mass_kg : float
        m [kg].
    """

    name: str
    mass_kg: float

    def __post_init__(self) -> None:
        require_positive(self, "mass_kg")
        if self.name == GROUND or not self.name:
            raise InputError(
                f"a member called {self.name!r}",
                expected=f"another name: {GROUND!r} is what does not move",
                where="name",
                advice="call the part what it is",
            )


@dataclass(frozen=True)
class Joint:
    """Spring and damping between two members, or between a member and `GROUND`.

    Attributes
    ----------
    between : tuple of two str
        Names of what it joins.
    stiffness_n_per_m : float
        j [N/m].
    dissipation : float
        ψ, energy lost in a cycle over the largest energy stored in it; 0: none.
    """

    between: tuple[str, str]
    stiffness_n_per_m: float
    dissipation: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "stiffness_n_per_m")
        require_not_negative(self, "dissipation")
        if self.between[0] == self.between[1]:
            raise InputError(
                f"a joint of {self.between[0]!r} with itself",
                expected="two different members",
                where="between",
                advice="name the other side of the joint",
            )

    @property
    def loss_factor(self) -> float:
        """η = ψ/2π."""
        return self.dissipation / (2.0 * math.pi)

    @property
    def complex_stiffness_n_per_m(self) -> complex:
        """j·(1 + iη) [N/m]."""
        return self.stiffness_n_per_m * complex(1.0, self.loss_factor)


@dataclass(frozen=True)
class Structure:
    """Members and the joints between them.

    Attributes
    ----------
    members : tuple of Member
    joints : tuple of Joint

    Raises
    ------
    InputError
        A name stands twice, a joint names an unknown member, or a member has no way to the ground.
    """

    members: tuple[Member, ...]
    joints: tuple[Joint, ...]

    def __post_init__(self) -> None:
        names = self.names
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None or not names:
            raise InputError(
                f"two members called {twice!r}" if names else "no member",
                expected="members, each with its own name",
                where="members",
                advice="name every part once",
            )
        for number, joint in enumerate(self.joints):
            for name in joint.between:
                if name != GROUND and name not in names:
                    raise InputError(
                        f"a joint with {name!r}",
                        expected=f"one of {', '.join(names)}, or {GROUND}",
                        where=f"joints[{number + 1}].between",
                        advice="correct the name, or add the member",
                    )
        loose = [name for name in names if name not in self._held()]
        if loose:
            raise InputError(
                f"no way from {', '.join(loose)} to the ground",
                expected="joints that hold every member",
                where="joints",
                advice=f'add the joint that is missing; what stands on the foundation is joined with "{GROUND}"',
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the members."""
        return tuple(member.name for member in self.members)

    def position(self, name: str) -> int:
        """Place of a member among the members; KeyError where there is none."""
        try:
            return self.names.index(name)
        except ValueError:
            raise KeyError(name) from None

    def _held(self) -> set[str]:
        """What is joined with the ground, straight or through others."""
        held, found = {GROUND}, {GROUND}
        while found:
            found = {
                other
                for joint in self.joints
                for one, other in (joint.between, joint.between[::-1])
                if one in held and other not in held
            }
            held |= found
        return held
