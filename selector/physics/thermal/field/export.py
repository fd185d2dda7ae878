"""Fields for other programs: temperature and deformation of the machine as a VTU file for ParaView."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.thermal.field.machine import FieldMachine

# VTK counts the corners of a hexahedron around the bottom, then around the top; scikit-fem by coordinates
_VTK_CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


def write_vtu(
    machine: FieldMachine, temperature_degc: NDArray[np.float64], path: str | Path, reference_degc: float = 20.0
) -> None:
    """Write ``temperature`` [°C], ``displacement`` [µm] of the nodes and ``part`` (a number) of the cells.

    Raises
    ------
    InputError
        If the temperatures are not one finite number for every node, or the file cannot be written.
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
