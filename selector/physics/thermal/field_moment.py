"""What the field machine of a model file looks like at one moment: temperature and deformation of every node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.field import MATERIALS, MachineGeometry, elasticity
from selector.physics.thermal.field.machine import foot_springs
from selector.physics.thermal.field_model import field_of, laws_of
from selector.physics.thermal.laws import Conditions
from selector.physics.thermal.model_file import FieldFile
from selector.physics.thermal.reduction import projected
from selector.physics.thermal.schedule import condensed
from selector.physics.thermal.transient import simulate_heat

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class FieldMoment:
    """A machine at one moment.

    Attributes
    ----------
    at_s : float
        When it is, from the start of the run [s].
    nodes_m : ndarray of shape (n_nodes, 3)
        Places of the nodes [m].
    triangles : ndarray of shape (n_triangles, 3)
        Nodes of the triangles of the surface.
    temperature_degc : ndarray of shape (n_nodes,)
        Temperature [°C].
    deformation_um : ndarray of shape (n_nodes, 3)
        Displacement since the start of the run [µm].
    """

    at_s: float
    nodes_m: Vector
    triangles: NDArray[np.int64]
    temperature_degc: Vector
    deformation_um: Vector


def field_moment(file: FieldFile, conditions: Conditions, at_s: float) -> FieldMoment:
    """The moment `at_s` [s] of the run that these conditions make of the machine; its stiffness is factorised anew.

    Raises
    ------
    InputError
        The time is outside the conditions.
    """
    laws = laws_of(file)
    full, basis, mesh = field_of(file, laws)
    start_degc = float(conditions.ambient_degc[0]) if file.run.start_degc is None else file.run.start_degc
    history = simulate_heat(
        projected(full, basis),
        laws,
        condensed(conditions, file.run.step_s),
        time_s=[],
        step_s=file.run.step_s,
        start_degc=start_degc,
        keep_states_at_s=[at_s],
    )
    degc = basis[: len(mesh.nodes_m)] @ history.states[0]
    geometry = MachineGeometry(**dict(file.field.geometry))
    elastic = elasticity(mesh, MATERIALS, foot_springs(mesh, geometry))
    return FieldMoment(at_s, mesh.nodes_m, mesh.triangles(), degc, elastic.displacement_um(degc - start_degc))
