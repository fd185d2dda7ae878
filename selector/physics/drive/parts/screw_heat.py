"""A screw that its own friction warms: how warm it gets, and how its pitch grows by that."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from selector.physics.checks import ABOVE_0, FINITE, FROM_0, Checked
from selector.physics.drive.parts.axis import Axis, ThreeMassMechanics
from selector.physics.drive.trajectory import Motion
from selector.physics.model_fields import Limits, Unit, Usual

STEEL_PER_K = 11.5e-6  #: Expansion of steel [1/K].


@dataclass(frozen=True)
class ScrewHeat(Checked):
    """Heat of a screw as one body: C·T' = share·Q − G·T, T over the temperature at which the pitch was measured.

    Q is the mean friction of nut, screw and bearings in the motion, done over and over. It lengthens the screw from
    its fixed bearing: an error of expansion·T·(x − x_fixed) at the nut.
    """

    heat_capacity_j_per_k: Annotated[float, ABOVE_0, Unit("J/K"), Limits(1e-3, 1e9), Usual(10.0, 1e6, {"kJ/K": 1e3})]
    loss_w_per_k: Annotated[float, ABOVE_0, Unit("W/K"), Limits(1e-6, 1e6)]  #: G, at the speed of the motion
    share: Annotated[float, FROM_0, Limits(0.0, 1.0)] = 1.0  #: Of the friction that stays in the screw
    #: Of a screw that is stretched between two fixed bearings less, by what they give way
    expansion_per_k: Annotated[float, FROM_0, Unit("1/K"), Limits(0.0, 1e-4)] = STEEL_PER_K
    #: x_fixed: position of the table at which the nut would stand at the fixed bearing [m]
    fixed_bearing_m: Annotated[float, FINITE, Unit("m"), Limits(-1e3, 1e3), Usual(-20.0, 20.0, {"mm": 1e-3})] = 0.0

    def rise_k(self, friction_w: float, after_s: float) -> float:
        """T after the motion was done over and over for so long, from T = 0 [K]."""
        settled = self.share * friction_w / self.loss_w_per_k
        return -settled * math.expm1(-after_s * self.loss_w_per_k / self.heat_capacity_j_per_k)


def screw_friction_w(axis: Axis, motion: Motion) -> float:
    """Mean power that nut, screw and bearings turn into heat in a motion [W]; 0 where nothing is known of the screw.

    |ω|·(R·|Fa|·(1/η − 1) + Ts) + Cl·ω², the friction of the screw as it acts in the simulation.
    """
    mechanics, friction = axis.mechanics, axis.friction
    if not isinstance(mechanics, ThreeMassMechanics) or motion.screw_speed is None:
        return 0.0
    speed = np.abs(motion.screw_speed)
    nut = mechanics.travel_per_motion * np.abs(motion.axial_force_n) * (1.0 / friction.nut_efficiency - 1.0)
    return float(np.mean(speed * (nut + friction.screw_coulomb_nm) + mechanics.screw_damping_nms_per_rad * speed**2))


def warm_axis(axis: Axis, heat: ScrewHeat, rise_k: float) -> Axis:
    """The axis with a screw that is warmer by so many K than where its pitch was measured."""
    grown, pitch = heat.expansion_per_k * rise_k, axis.transmission
    errors = np.array(pitch.pitch_error_m or (0.0,)) - grown * heat.fixed_bearing_m
    warm = replace(
        pitch,
        pitch_slope=pitch.pitch_slope + grown,
        pitch_position_m=pitch.pitch_position_m or (0.0,),
        pitch_error_m=tuple(errors.tolist()),
    )
    return replace(axis, transmission=warm)
