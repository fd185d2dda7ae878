"""Virtual sensors: the temperature anywhere in the body as a row over its nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.thermal.field.mesh import BlockMesh, Point

Vector = NDArray[np.float64]

REACH_M = 0.03
"""How far from the body a sensor may be named and still be put on its surface [m]."""


def probe_row(body: BlockMesh, place_m: Point, name: str = "probe") -> Vector:
    """Row of shape (n_nodes,) that reads the temperature at a place; outside, at the nearest point of the surface.

    Raises
    ------
    InputError
        If the place is more than `REACH_M` away from the body.
    """
    place = np.asarray(place_m, dtype=np.float64)
    nearest = np.clip(place, body.low_m, body.high_m)
    away = np.linalg.norm(nearest - place, axis=1)
    cell = int(np.argmin(away))
    if not away[cell] <= REACH_M:
        raise InputError(
            f"a place ({', '.join(f'{x:g}' for x in place)}) m, {away[cell] * 1000:.0f} mm away from the body",
            expected=f"a place in the body or at most {REACH_M * 1000:.0f} mm outside",
            where=f"sensor {name!r}",
            advice="correct the coordinates [m]; the nearest point of the body is "
            f"({', '.join(f'{x:.3f}' for x in nearest[cell])})",
        )
    corners = body.nodes_m[body.cells[cell]]
    inside = (nearest[cell] - body.low_m[cell]) / (body.high_m[cell] - body.low_m[cell])
    upper = corners > body.low_m[cell]
    row = np.zeros(len(body.nodes_m))
    row[body.cells[cell]] = np.where(upper, inside, 1 - inside).prod(axis=1)
    return row
