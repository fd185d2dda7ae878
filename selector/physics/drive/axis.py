"""A feed axis as a whole: mechanics, friction, transmission, servo and sensing in SI units.

One form serves the rigid and the three-mass structure; gains of the servo count per unit of motor speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

from selector.errors import InputError
from selector.physics.checks import require_positive
from selector.physics.drive.friction import Friction, Ripple
from selector.physics.drive.mechanics import Mechanics, RigidMechanics
from selector.physics.drive.servo import Sensing, Servo
from selector.physics.drive.transmission import AxialCompliance, Transmission


@dataclass(frozen=True)
class Axis:
    """A feed axis: `servo` None leaves it to itself (free motion, or driven by given commands).

    Raises
    ------
    InputError
        If a part needs a structure or a servo that the axis has not.
    """

    mechanics: Mechanics
    servo: Servo | None = None
    friction: Friction = field(default_factory=Friction)
    transmission: Transmission = field(default_factory=Transmission)
    ripple: tuple[Ripple, ...] = ()
    ripple_period: float = 2.0 * math.pi
    compliance: AxialCompliance | None = None
    sensing: Sensing = field(default_factory=Sensing)

    def __post_init__(self) -> None:
        require_positive(self, "ripple_period")
        rigid = isinstance(self.mechanics, RigidMechanics)
        for is_there, what in (
            (self.transmission.backlash_m > 0, "backlash"),
            (self.compliance is not None, "an axial compliance"),
            (self.friction.screw_coulomb_nm > 0, "friction of the screw"),
        ):
            if rigid and is_there:
                raise _unfit(f"{what} in a rigid axis", "a three-mass axis", "describe motor, screw and table")
        if self._least_travel <= 0.0:
            raise InputError(
                f"a pitch error that turns the travel back (least slope {self._least_travel:.3g})",
                expected="errors that change by less than the travel",
                where="transmission",
                advice="give pitch errors in metres: 5 µm are 5e-6",
            )
        sampled = self.servo is not None and self.servo.sample_s > 0
        for is_there, what in (
            (self.servo is not None and self.servo.delay_s > 0, "a delay"),
            (self.sensing != Sensing(), "an encoder or noise"),
        ):
            if is_there and not sampled:
                raise _unfit(f"{what} without a sampled servo", "sample_s above 0", "give the servo's sample time")

    @property
    def _least_travel(self) -> float:
        """A bound of the true travel per nominal one."""
        pitch, radius = self.transmission, self.mechanics.travel_per_motion
        rate = 2.0 * math.pi / self.ripple_period if isinstance(self.mechanics, RigidMechanics) else 1.0
        falls = [
            (error - before) / (at - since)
            for (since, before), (at, error) in pairwise(zip(pitch.pitch_position_m, pitch.pitch_error_m, strict=True))
        ]
        return 1.0 + pitch.pitch_slope + min(falls, default=0.0) - pitch.pitch_amplitude_m * rate / radius


def _unfit(found: str, expected: str, advice: str) -> InputError:
    return InputError(found, expected=expected, where="feed axis", advice=advice)
