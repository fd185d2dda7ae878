"""How much lost motion does the friction of an axis make at a reversal, without any backlash."""

from __future__ import annotations

from selector.physics.drive.axis import Axis
from selector.physics.drive.mechanics import ThreeMassMechanics


def wind_up_m(axis: Axis) -> float | None:
    """Twice what dry friction winds up shaft, nut, bearings and coupling before the table follows [m].

    The guide bends the axial spring and twists the torsional one through the screw, the friction of the screw twists it
    alone: 2·(F/Ke + R·(R·F + Ts)/Kθ), F the mean of the two directions. None where it does not show as lost motion:
    one mass has no spring, and a control that sees the table takes it out again.
    """
    mechanics, servo = axis.mechanics, axis.servo
    if not isinstance(mechanics, ThreeMassMechanics) or servo is None or servo.feedback == "table":
        return None
    radius = mechanics.travel_per_motion
    (up, _), (down, _) = axis.friction.directions
    force = (up + down) / 2.0
    twisted = radius * force + axis.friction.screw_coulomb_nm
    turned = twisted / mechanics.torsional_stiffness_nm_per_rad
    return 2.0 * (force / mechanics.axial_stiffness_n_per_m + radius * turned)
