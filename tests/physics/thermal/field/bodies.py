"""What tests of meshes ask a body."""

from __future__ import annotations

import numpy as np
from scipy import sparse


def pieces(body) -> int:
    """Number of bodies that no face joins; an edge or a corner in common is a hinge, not a joint."""
    beside = np.asarray(body.mesh.f2t)
    first, second = beside[:, beside[1] >= 0]
    n = len(body.cells)
    links = sparse.coo_array((np.ones(len(first)), (first, second)), shape=(n, n))
    return int(sparse.csgraph.connected_components(links, directed=False)[0])
