"""What the parts of a machine are made of: constants of heat conduction and thermoelasticity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

SLIDING_STIFFNESS = 1e-4
"""Share of the stiffness that a sliding layer keeps along its sliding direction: small, but the body stays held."""


@dataclass(frozen=True)
class Material:
    """An isotropic solid, or a thin layer of rolling elements that slides along one axis.

    Attributes
    ----------
    conductivity_w_per_m_k, specific_heat_j_per_kg_k, density_kg_per_m3 : float
        k [W/(m·K)], c [J/(kg·K)], ρ [kg/m³].
    expansion_per_k, young_pa, poisson : float
        α [1/K], E [Pa], ν.
    slides : {"", "x", "y", "z"}
        Axis along which the layer transmits (almost) no force; empty for a solid.
    """

    conductivity_w_per_m_k: float
    specific_heat_j_per_kg_k: float
    density_kg_per_m3: float
    expansion_per_k: float
    young_pa: float
    poisson: float
    slides: str = ""

    def stiffness_pa(self) -> NDArray[np.float64]:
        """Stiffness of shape (6, 6) [Pa]; strains in the order xx, yy, zz, yz, zx, xy (shear as angles)."""
        shear = 2 * (1 + self.poisson)
        compliance = np.diag([1.0, 1.0, 1.0, shear, shear, shear])
        compliance[:3, :3] -= self.poisson * (1 - np.eye(3))
        if self.slides:
            along = "xyz".index(self.slides)
            others = [axis for axis in range(3) if axis != along]
            compliance[along, others] = compliance[others, along] = 0.0
            soft = [along, *(3 + axis for axis in others)]  # shear yz, zx, xy is number 3 + the axis it leaves out
            compliance[soft, soft] /= SLIDING_STIFFNESS
        return np.asarray(np.linalg.inv(compliance) * self.young_pa)


_GREY_IRON = Material(48.0, 500.0, 7200.0, 10.5e-6, 110e9, 0.26)
_STEEL = Material(46.0, 470.0, 7850.0, 11.7e-6, 210e9, 0.30)

MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        # grey iron of 250 MPa and structural steel, rounded within what tables of materials give at room temperature
        "cast iron": _GREY_IRON,
        "steel": _STEEL,
        # a motor is half copper and laminations, half gaps
        "motor": Material(20.0, 450.0, 5000.0, 13e-6, 30e9, 0.30),
        # rings and rolling elements: contacts conduct badly, see docs/explanation/thermal-field.md
        "bearing": Material(8.0, 470.0, 7000.0, 11.7e-6, 40e9, 0.30),
        "bearing, floating": Material(8.0, 470.0, 7000.0, 11.7e-6, 40e9, 0.30, slides="z"),
        "guideway x": Material(6.0, 470.0, 6000.0, 11.0e-6, 40e9, 0.30, slides="x"),
        "guideway y": Material(6.0, 470.0, 6000.0, 11.0e-6, 40e9, 0.30, slides="y"),
        "guideway z": Material(6.0, 470.0, 6000.0, 11.0e-6, 40e9, 0.30, slides="z"),
    }
)
"""The materials that `machine_blocks` names."""
