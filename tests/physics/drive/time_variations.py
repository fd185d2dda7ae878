"""How much it matters that stiffness and damping change along a motion: F's figures 6, 7, 9 for any parts and servo."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from selector.errors import InputError
from selector.physics.drive.parts.axis import Axis, Friction, Servo
from selector.physics.drive.parts.catalogue import Parts
from selector.physics.drive.parts.stiffness import Reading, dry_friction, parameter_course, three_mass_mechanics
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import COURSES, Motion, ParameterCourse, Reference, sine
from selector.types import Vector

Constants = Literal["unloaded", "mean", "friction"]


@dataclass(frozen=True)
class TimeVariation:
    """One motion with varying and with constant parameters."""

    course: ParameterCourse  #: Ke(t), Ct(t) of the varying model (F figs. 6, 7)
    #: varying and constant: What the axis does with them and with constants (F fig. 9).
    varying: Motion
    constant: Motion
    #: The two are compared from this time on up to, but without, the last sample [s]: of a whole period the two ends
    #: are one instant
    from_s: float

    @property
    def share_larger(self) -> float:
        """Share of the compared samples at which the tracking error of the varying model is larger in amount."""
        return float(np.mean(np.abs(self._error(self.varying)) > np.abs(self._error(self.constant))))

    @property
    def rms_difference_m(self) -> float:
        """Root mean square distance of the two table positions [m]."""
        return float(np.sqrt(np.mean((self._error(self.varying) - self._error(self.constant)) ** 2)))

    def _error(self, motion: Motion) -> Vector:
        # samples are written with the rounding of k·period
        return motion.tracking_error_m[:-1][motion.time_s[:-1] >= self.from_s - 1e-9]


def published_sine(duration_s: float = 1.0, period_s: float = 1e-3) -> Reference:
    """F's command r(t) = 100·sin(2πt) mm; it begins with its full speed, which no axis at rest has."""
    return sine(0.1, 1.0, duration_s, period_s)


def time_variation(
    parts: Parts,
    servo: Servo,
    reference: Reference,
    *,
    step_s: float = 5e-5,
    from_s: float = 0.0,
    constants: Constants = "unloaded",
    stiffness: Literal["two-sided", "published"] = "two-sided",
    damping: Reading = "instant",
) -> TimeVariation:
    """The axis from rest along a reference, with the parameters of `parameter_course` and with constants.

    `constants` of the other model: ``"unloaded"``, Ke at rest at table position 0 and viscous friction alone, as one
    identifies it standing; ``"mean"``, the means of the course; ``"friction"``, unloaded, with the dry friction of the
    guide as such instead of as damping. The friction of the screw is in neither.

    InputError if `from_s` is outside the reference, or the nut leaves the screw.
    """
    times_s = reference.time_s
    if not 0.0 <= from_s < times_s[-1]:
        raise InputError(
            f"{from_s:g} s",
            expected=f"a time from 0 to before {times_s[-1]:g} s",
            where="from_s",
            advice="give a longer reference, or compare from an earlier time on",
        )
    course = parameter_course(parts, reference, stiffness=stiffness, damping=damping)
    mechanics = three_mass_mechanics(parts)
    varying = simulate_axis(Axis(mechanics, servo), reference, step_s=step_s, course=course)
    rubbing = Friction(coulomb_n=dry_friction(parts).coulomb_n if constants == "friction" else 0.0)
    if constants == "mean":
        means = {name: float(np.mean(getattr(course, name))) for name in COURSES}
        mechanics = replace(mechanics, **means)
    constant = simulate_axis(Axis(mechanics, servo, rubbing), reference, step_s=step_s)
    return TimeVariation(course, varying, constant, from_s)
