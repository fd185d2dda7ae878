"""The finite-element model of the C-frame machining centre, and its fields for other programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError, OptionError
from selector.physics.thermal.field.geometry import (
    MachineGeometry,
    feet,
    heated_parts,
    heated_surfaces,
    machine_blocks,
    surfaces,
)
from selector.physics.thermal.field.mesh import BlockMesh, Point, block_mesh, probe_row
from selector.physics.thermal.field.thermoelasticity import (
    MATERIALS,
    Elasticity,
    Material,
    conduction_matrices,
    elasticity,
    film,
    rigid_motion_reading,
    surface_source,
    volume_source,
)
from selector.physics.thermal.network.heat_system import HeatSystem
from selector.types import Vector

CELL_M = 0.04
"""Longest cell at refinement 1 [m]: one cell in a wall, about 20 000 nodes."""

FOOT_N_PER_M = (1e8, 1e8, 5e8)
"""Stiffness of one foot along X, Y, Z [N/m]: an assumption; docs/explanation/thermal-field.md says what hangs on it."""

BAR_M = (0.30, 0.05)
"""How far below the spindle face the lower and the upper gauge touch the test bar [m]; 250 mm apart (P)."""


@dataclass(frozen=True)
class FieldMachine:
    """A machine as a field."""

    geometry: MachineGeometry  #: Its lengths
    mesh: BlockMesh  #: Its mesh; `mesh.nodes_m` are the places of the states of `system`
    system: HeatSystem  #: Conduction with films, sources, probes, and the displacements of the tool against the table
    elasticity: Elasticity  #: Its factorised stiffness

    def deformation(self, temperature_degc: Vector, reference_degc: float = 20.0) -> Vector:
        """Displacement of every node, of shape (n_nodes, 3) [µm], for the temperatures of the nodes [°C].

        Raises InputError if there is not one finite temperature for every node.
        """
        temperature = np.asarray(temperature_degc, dtype=np.float64)
        if temperature.shape != (self.system.size,) or not np.isfinite(temperature).all():
            raise InputError(
                f"temperatures of shape {temperature.shape}"
                + ("" if np.isfinite(temperature).all() else ", some of them no number"),
                expected=f"one finite temperature [°C] for each of {self.system.size} nodes",
                where="field",
                advice="pass a state of the unreduced system, FieldMachine.system",
            )
        return self.elasticity.displacement_um(temperature - reference_degc)


def field_machine(
    geometry: MachineGeometry | None = None,
    refinement: float = 1.0,
    probes: Mapping[str, Point] | None = None,
    materials: Mapping[str, Material] = MATERIALS,
    foot_n_per_m: tuple[float, float, float] = FOOT_N_PER_M,
) -> FieldMachine:
    """The machine meshed, assembled and factorised.

    Displacements of the tool against the table [µm]: X and Y along their axes, Z counted positive towards the table;
    `Y_lower` and `Y_upper` on a test bar (rigid, cold) in the spindle, `Y` their mean. X and Z are those of the
    middle of the spindle face.

    No cell is longer than 40 mm / refinement: 1 gives about 20 000 nodes, 0.2 8 000, 1.25 50 000. `probes` are places
    of virtual sensors [m], in the body or at most 30 mm outside.

    Raises OptionError if the lengths do not fit together or the refinement is not above 0. Raises InputError if a
    sensor is too far from the body.
    """
    if not refinement > 0 or not np.isfinite(refinement):
        raise OptionError(
            f"refinement {refinement:g}", expected="a number above 0", where="mesh", advice="use 1, or 0.5 for a try"
        )
    geometry = MachineGeometry() if geometry is None else geometry
    body = block_mesh(machine_blocks(geometry), CELL_M / refinement)
    elastic = elasticity(body, materials, foot_springs(body, geometry, foot_n_per_m))
    rows = {name: elastic.row_um_per_k(reading) for name, reading in displacement_readings(body, geometry).items()}
    rows["Y"] = (rows["Y_lower"] + rows["Y_upper"]) / 2
    capacity, conduction = conduction_matrices(body, materials)
    films = {name: film(body, facets) for name, facets in surfaces(body, geometry).items()}
    sources = {name: volume_source(body, body.cells_of(*parts)) for name, parts in heated_parts().items()}
    sources |= {name: surface_source(body, facets) for name, facets in heated_surfaces(body, geometry).items()}
    system = HeatSystem(
        capacity=capacity,
        conduction=conduction,
        films={name: matrix for name, (matrix, _) in films.items()},
        film_loads={name: load for name, (_, load) in films.items()},
        sources=sources,
        probes={name: probe_row(body, place, name) for name, place in (probes or {}).items()},
        displacements=rows,
        uniform=np.ones(len(body.nodes_m)),
    )
    return FieldMachine(geometry, body, system, elastic)


def foot_springs(
    body: BlockMesh, geometry: MachineGeometry, foot_n_per_m: tuple[float, float, float] = FOOT_N_PER_M
) -> Vector:
    """Stiffness [N/m] of the feet at every node, along X, Y, Z, of shape (n_nodes, 3)."""
    springs = np.zeros((len(body.nodes_m), 3))
    for facets in feet(body, geometry).values():
        springs += surface_source(body, facets)[:, None] * np.array(foot_n_per_m)
    return springs


def displacement_readings(body: BlockMesh, geometry: MachineGeometry) -> dict[str, Vector]:
    """Readings of shape (3·n_nodes,) of the tool against the table.

    The bar moves rigidly with the face of the spindle, the stand of the gauges with the top of the table; so a
    motion of the whole machine on its feet is not seen. `Y` is the mean of `Y_lower` and `Y_upper`.
    """
    g = geometry
    nose = surface_source(body, body.surface_of(["spindle"], lambda c: np.isclose(c[:, 2], g.nose_z_m)))
    table = surface_source(body, body.surface_of(["table"], lambda c: np.isclose(c[:, 2], g.table_top_m)))

    def against_table(below_m: float, axis: int) -> Vector:
        at = (0.0, g.spindle_y_m, g.nose_z_m - below_m)
        return rigid_motion_reading(body, nose, at, axis) - rigid_motion_reading(body, table, at, axis)

    lower, upper = (against_table(below, 1) for below in BAR_M)
    return {
        "X": against_table(0.0, 0),
        "Z": -against_table(0.0, 2),
        "Y_lower": lower,
        "Y_upper": upper,
    }


# VTK counts the corners of a hexahedron around the bottom, then around the top; scikit-fem by coordinates
_VTK_CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


def write_vtu(
    machine: FieldMachine, temperature_degc: NDArray[np.float64], path: str | Path, reference_degc: float = 20.0
) -> None:
    """Write ``temperature`` [°C], ``displacement`` [µm] of the nodes and ``part`` (a number) of the cells.

    Raises InputError if the temperatures are not one finite number for every node, or the file cannot be written.
    """
    import meshio
    from skfem import ElementHex1

    body = machine.mesh
    displacement = machine.deformation(temperature_degc, reference_degc)
    here = [tuple(corner) for corner in ElementHex1.doflocs.astype(int)]
    order = [here.index(corner) for corner in _VTK_CORNERS]
    parts = list(dict.fromkeys(body.parts))
    number = np.array([parts.index(part) for part in body.parts])[body.kind]
    mesh = meshio.Mesh(
        body.nodes_m,
        [("hexahedron", body.cells[:, order])],
        point_data={"temperature": np.asarray(temperature_degc, dtype=np.float64), "displacement": displacement},
        cell_data={"part": [number]},
    )
    try:
        mesh.write(path, file_format="vtu")
    except OSError as error:
        raise InputError(
            f"{path} cannot be written ({error.strerror})",
            expected="a file that can be written",
            where="VTU file",
            advice="name a folder that exists and may be written to",
        ) from error
