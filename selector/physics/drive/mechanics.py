"""What turns and slides: one mass, or motor, screw and table.

In the *three-mass* axis (F eq. 1) the motor turns: its speed is in rad/s and the actuator makes a torque. In the
*rigid* axis there is one mass: the motor's position is that of the mass in metres, and the actuator makes a force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from selector.physics.checks import require_not_negative, require_positive


@dataclass(frozen=True)
class RigidMechanics:
    """One mass: M·v' = force − viscous·v − friction.

    Attributes
    ----------
    mass_kg : float
        Everything that moves, rotating parts included as J/R² [kg].
    guide_damping_ns_per_m : float
        Viscous friction [N·s/m].
    """

    mass_kg: float
    guide_damping_ns_per_m: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "mass_kg")
        require_not_negative(self, "guide_damping_ns_per_m")

    @property
    def travel_per_motion(self) -> float:
        """Table travel per unit of motor position: 1, both are metres."""
        return 1.0


@dataclass(frozen=True)
class ThreeMassMechanics:
    """Motor, screw, table (F eq. 1), R = lead/2π, with damping in the two springs added.

    ``Jm·θm'' = T − Kθ(θm − θl) − Dθ(θm' − θl')``,
    ``Jl·θl'' = Kθ(θm − θl) + Dθ(θm' − θl') − Cl·θl' − R·Fa``, ``Mt·xt'' = Fa − Ct·xt' − friction``,
    ``Fa = Ke(R·θl − xt) + De(R·θl' − xt')``.

    Attributes
    ----------
    motor_inertia_kg_m2, screw_inertia_kg_m2 : float
        Jm (motor and coupling), Jl (screw) [kg·m²].
    table_mass_kg : float
        Mt, with what lies on it [kg].
    lead_m : float
        Travel per revolution [m]; negative for a left-handed screw is not meant.
    torsional_stiffness_nm_per_rad, axial_stiffness_n_per_m : float
        Kθ, Ke.
    screw_damping_nms_per_rad, guide_damping_ns_per_m : float
        Cl, Ct.
    torsional_damping_nms_per_rad, axial_damping_ns_per_m : float
        Dθ, De: damping inside the springs; 0 in the source.
    """

    motor_inertia_kg_m2: float
    screw_inertia_kg_m2: float
    table_mass_kg: float
    lead_m: float
    torsional_stiffness_nm_per_rad: float
    axial_stiffness_n_per_m: float
    screw_damping_nms_per_rad: float = 0.0
    guide_damping_ns_per_m: float = 0.0
    torsional_damping_nms_per_rad: float = 0.0
    axial_damping_ns_per_m: float = 0.0

    def __post_init__(self) -> None:
        require_positive(
            self,
            "motor_inertia_kg_m2",
            "screw_inertia_kg_m2",
            "table_mass_kg",
            "lead_m",
            "torsional_stiffness_nm_per_rad",
            "axial_stiffness_n_per_m",
        )
        require_not_negative(
            self,
            "screw_damping_nms_per_rad",
            "guide_damping_ns_per_m",
            "torsional_damping_nms_per_rad",
            "axial_damping_ns_per_m",
        )

    @property
    def travel_per_motion(self) -> float:
        """R: table travel per radian of the motor [m/rad]."""
        return self.lead_m / (2.0 * math.pi)


Mechanics = RigidMechanics | ThreeMassMechanics
