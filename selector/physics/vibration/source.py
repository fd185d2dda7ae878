"""What shakes the machine: forces at the frequencies of a spectrum, fixed or following a shaft."""

from __future__ import annotations

from dataclasses import dataclass

from selector.errors import InputError
from selector.physics.checks import require_finite, require_not_negative, require_positive


@dataclass(frozen=True)
class Line:
    """One line of a spectrum: amplitude·sin(ωt + phase).

    Attributes
    ----------
    frequency_hz : float or None
        Where the frequency is fixed [Hz].
    order : float or None
        Where it follows a shaft: periods per revolution.
    force_n : float
        Amplitude of the force, the same at every speed [N].
    unbalance_kg_m : float
        Mass times eccentricity of what turns [kg·m]: a force of unbalance·ω² beside `force_n`.
    phase_rad : float
        Phase against the other lines of its source [rad].
    """

    frequency_hz: float | None = None
    order: float | None = None
    force_n: float = 0.0
    unbalance_kg_m: float = 0.0
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "frequency_hz", "order")
        require_not_negative(self, "force_n", "unbalance_kg_m")
        require_finite(self, "phase_rad")
        if (self.frequency_hz is None) == (self.order is None):
            raise InputError(
                "both frequency_hz and order" if self.order is not None else "neither frequency_hz nor order",
                expected="one of them",
                where="frequency_hz",
                advice="give the frequency where it is fixed, the order where it follows a shaft",
            )
        if self.force_n == 0 and self.unbalance_kg_m == 0:
            raise InputError(
                "a line without force",
                expected="force_n or unbalance_kg_m above 0",
                where="force_n",
                advice="give its size, or leave the line out",
            )


@dataclass(frozen=True)
class Source:
    """A source of vibration: it pushes a member, and with the same force the other way what it pushes against.

    Attributes
    ----------
    name : str
        IK1 cutting, IK2 spindle unit, IK3 main motor, IK4 cross-feed motor, IK5 longitudinal-feed motor in V.
    member : str
        Member on which the force acts.
    lines : tuple of Line
        Its spectrum.
    against : str or None
        Member on which the opposite force acts; None: the ground.
    shaft : str or None
        Shaft whose speed the orders belong to.
    """

    name: str
    member: str
    lines: tuple[Line, ...]
    against: str | None = None
    shaft: str | None = None

    def __post_init__(self) -> None:
        wrong = (
            "no lines"
            if not self.lines
            else "orders without a shaft"
            if self.shaft is None and any(line.order is not None for line in self.lines)
            else f"{self.member!r} pushing against itself"
            if self.against == self.member
            else None
        )
        if wrong is not None:
            raise InputError(
                wrong,
                expected="lines of a spectrum, a shaft for those that follow one, and two sides of the force",
                where="lines" if "lines" in wrong else "shaft" if "shaft" in wrong else "against",
                advice=f"correct the source {self.name!r}",
            )
