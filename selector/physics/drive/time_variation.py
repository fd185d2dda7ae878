"""How much it matters that stiffness and damping change along a motion: F's figures 6 to 9 for any parts and servo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.drive.loop.stability import LoopFigures, frequency_response, frozen, loop_figures
from selector.physics.drive.parts.axis import Axis, Friction, Servo, ThreeMassMechanics
from selector.physics.drive.parts.catalogue import Parts
from selector.physics.drive.parts.stiffness import Reading, dry_friction, parameter_course, three_mass_mechanics
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import Motion, ParameterCourse, Reference, sine
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
    instants_s: tuple[float, ...]  #: Instants of the frozen frequency responses [s] (F fig. 8)
    frequency_hz: Vector  #: (n_frequencies,): Their frequencies [Hz]
    responses: NDArray[np.complex128]  #: (n_instants, n_frequencies): Table over reference at each instant
    figures: tuple[LoopFigures, ...]  #: Bandwidth, resonance and margins at each instant

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
    instants_s: Sequence[float] = (0.0, 0.125, 0.25),
    highest_hz: float = 500.0,
) -> TimeVariation:
    """The axis from rest along a reference, with the parameters of `parameter_course` and with constants.

    `constants` of the other model: ``"unloaded"``, Ke at rest at table position 0 and viscous friction alone, as one
    identifies it standing; ``"mean"``, the means of the course; ``"friction"``, unloaded, with the dry friction of the
    guide as such instead of as damping. The friction of the screw is in neither.

    InputError if `from_s` or an instant is outside the reference, or the nut leaves the screw.
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
    axis = Axis(mechanics, servo)
    frequency_hz = np.geomspace(1.0, highest_hz, 400)
    frozen_axes = [frozen(axis, course, instant) for instant in instants_s]
    return TimeVariation(
        course=course,
        varying=simulate_axis(axis, reference, step_s=step_s, course=course),
        constant=simulate_axis(_constant(parts, servo, mechanics, course, constants), reference, step_s=step_s),
        from_s=from_s,
        instants_s=tuple(instants_s),
        frequency_hz=frequency_hz,
        responses=np.array([frequency_response(one, frequency_hz) for one in frozen_axes]),
        figures=tuple(loop_figures(one) for one in frozen_axes),
    )


def _constant(
    parts: Parts, servo: Servo, mechanics: ThreeMassMechanics, course: ParameterCourse, constants: Constants
) -> Axis:
    if constants == "friction":
        return Axis(mechanics, servo, friction=Friction(coulomb_n=dry_friction(parts).coulomb_n))
    if constants == "mean":
        assert course.axial_stiffness_n_per_m is not None
        assert course.guide_damping_ns_per_m is not None
        mechanics = replace(
            mechanics,
            axial_stiffness_n_per_m=float(np.mean(course.axial_stiffness_n_per_m)),
            guide_damping_ns_per_m=float(np.mean(course.guide_damping_ns_per_m)),
        )
    return Axis(mechanics, servo)
