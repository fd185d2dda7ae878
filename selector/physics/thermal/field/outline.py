"""Which lines draw the machine: the edges of its outer surfaces, as few straight pieces."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.field.candidates import COARSE_M
from selector.physics.thermal.field.geometry import MachineGeometry, machine_blocks
from selector.physics.thermal.field.mesh import block_mesh
from selector.physics.thermal.field.surfaces import surfaces

Vector = NDArray[np.float64]


def machine_outline(geometry: MachineGeometry | None = None) -> tuple[Vector, ...]:
    """Edges of the machine without its chambers: straight lines of shape (2, 3) [m].

    An edge is where two outer faces meet at an angle, or where an outer face ends.
    """
    geometry = MachineGeometry() if geometry is None else geometry
    body = block_mesh(machine_blocks(geometry), COARSE_M)
    outer = [facets for name, facets in surfaces(body, geometry).items() if not name.endswith(" inside")]
    corners = np.asarray(body.mesh.facets)[:, np.concatenate(outer)].T
    places = body.nodes_m[corners]
    normal = np.argmin(np.ptp(places, axis=1), axis=1)
    meeting: dict[tuple[int, int], list[int]] = defaultdict(list)
    for facet, axis, points in zip(corners, normal, places, strict=True):
        for i in range(4):
            for j in range(i):
                # corners that differ along one axis only are the ends of a side
                if (np.abs(points[i] - points[j]) > 1e-9).sum() == 1:
                    first, last = sorted((int(facet[i]), int(facet[j])))
                    meeting[first, last].append(int(axis))
    pieces: dict[tuple[int, float, float], list[tuple[float, float]]] = defaultdict(list)
    for (first, last), axes in meeting.items():
        if len(axes) > 1 and len(set(axes)) == 1:
            continue
        start, end = body.nodes_m[first], body.nodes_m[last]
        along = int(np.argmax(np.abs(end - start)))
        u, v = (round(float(start[other]), 9) for other in range(3) if other != along)
        pieces[along, u, v].append((float(min(start[along], end[along])), float(max(start[along], end[along]))))
    lines = []
    for (along, u, v), spans in sorted(pieces.items()):
        for low, high in _joined(spans):
            lines.append(np.insert(np.array([[u, v], [u, v]]), along, [low, high], axis=1))
    return tuple(lines)


def _joined(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Pieces of a line that touch, as one."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted(spans):
        if joined and low <= joined[-1][1] + 1e-9:
            joined[-1] = (joined[-1][0], max(joined[-1][1], high))
        else:
            joined.append((low, high))
    return joined
