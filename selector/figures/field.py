"""The machine as a field: its temperatures, and its deformation drawn larger than it is."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style

_HEIGHT = 640
_SHOWN_SHARE = 0.08
_HEAT_SCALE = ((0.0, "#f2f0ea"), (0.3, "#f6c667"), (0.6, "#e2652a"), (1.0, "#6b0f1a"))
_SIZE_SCALE = ((0.0, "#f7fbff"), (0.35, "#b5d4e9"), (0.7, "#3787c0"), (1.0, "#08306b"))
_CAMERA = {"eye": {"x": 1.25, "y": 1.45, "z": 0.75}, "center": {"x": 0, "y": 0, "z": -0.05}}


def machine_field(
    nodes_m: NDArray[np.float64],
    triangles: NDArray[np.int64],
    temperature_degc: NDArray[np.float64],
    deformation_um: NDArray[np.float64],
    title: str,
) -> go.Figure:
    """Temperature of the surface beside its deformation, which is scaled so that it can be seen; the scale is stated.

    Parameters
    ----------
    nodes_m : ndarray of shape (n_nodes, 3)
        Places of the nodes [m], Z upwards.
    triangles : ndarray of shape (n_triangles, 3)
        Nodes of the triangles of the surface.
    temperature_degc : ndarray of shape (n_nodes,)
    deformation_um : ndarray of shape (n_nodes, 3)
    title : str
        When this is, and under which load.
    """
    nodes, corners = np.unique(triangles, return_inverse=True)
    corners = corners.reshape(triangles.shape)
    place, moved = nodes_m[nodes], deformation_um[nodes]
    size = np.linalg.norm(moved, axis=1)
    extent = float(np.ptp(place, axis=0).max())
    scale = _round_scale(_SHOWN_SHARE * extent / max(float(size.max()) * 1e-6, 1e-12))
    drawn = style.figure(style.label(title, 200), _HEIGHT)
    parts = (
        ("scene", place, temperature_degc[nodes], _HEAT_SCALE, "temperature [°C]", 0.44, "%{intensity:.2f} °C"),
        ("scene2", place + moved * 1e-6 * scale, size, _SIZE_SCALE, "displacement [µm]", 1.0, "%{intensity:.1f} µm"),
    )
    for scene, points, values, colours, text, bar_at, hover in parts:
        drawn.add_mesh3d(
            x=points[:, 0].astype(np.float32),
            y=points[:, 1].astype(np.float32),
            z=points[:, 2].astype(np.float32),
            i=corners[:, 0].astype(np.int32),
            j=corners[:, 1].astype(np.int32),
            k=corners[:, 2].astype(np.int32),
            intensity=values.astype(np.float32),
            colorscale=colours,
            colorbar={"title": {"text": text, "side": "right"}, "thickness": 14, "len": 0.7, "x": bar_at},
            flatshading=True,
            lighting={"ambient": 0.75, "diffuse": 0.5, "specular": 0.05},
            hovertemplate=hover + "<extra></extra>",
            scene=scene,
        )
    axes = {name: {"title": {"text": f"{name[0].upper()} [m]"}} for name in ("xaxis", "yaxis", "zaxis")}
    drawn.update_layout(
        scene={"domain": {"x": [0.0, 0.44]}, "aspectmode": "data", "camera": _CAMERA, **axes},
        scene2={"domain": {"x": [0.54, 0.98]}, "aspectmode": "data", "camera": _CAMERA, **axes},
        margin={"l": 0, "r": 0, "b": 10},
    )
    for at, text in ((0.22, "temperature"), (0.76, f"deformation, drawn {scale:,.0f} times larger".replace(",", " "))):
        drawn.add_annotation(
            text=text, x=at, y=0.0, xref="paper", yref="paper", xanchor="center", yanchor="bottom", showarrow=False
        )
    return drawn


def _round_scale(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above the value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(factor * power for factor in (1, 2, 5) if factor * power <= value * (1 + 1e-12)))
