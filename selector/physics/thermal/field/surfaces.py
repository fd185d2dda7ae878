"""Which surfaces of the machining centre meet a fluid, which parts are heated, and where it stands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.field.geometry import MachineGeometry
from selector.physics.thermal.field.mesh import BlockMesh

Vector = NDArray[np.float64]
Indices = NDArray[np.int64]

_SPINDLE = ("spindle", "lower bearing", "upper bearing")
_HEAD = ("headstock", "headstock slide", "gearbox", "Z nut")
_FOOT_M = 0.16


def surfaces(body: BlockMesh, geometry: MachineGeometry) -> dict[str, Indices]:
    """Facets of every surface that can meet a fluid; each boundary facet belongs to exactly one.

    ``… inside`` are the walls of chambers; ``bed top``, ``table top`` and ``spindle nose`` are washed by coolant; the
    bed's lower edge stands on feet and is in ``bed inside``.
    """
    g = geometry
    half_bed, half_column, half_head = g.bed_width_m / 2, g.column_width_m / 2, g.headstock_width_m / 2
    bed = ((-half_bed, half_bed), (g.bed_back_m, g.bed_front_m), (0.0, np.inf))
    column = ((-half_column, half_column), (g.column_back_m, g.column_front_m), (-np.inf, g.column_top_m))
    head = ((-half_head, half_head), (g.headstock_back_m + 0.06, g.headstock_front_m), (-np.inf, g.headstock_top_m))
    # the shaft between its bearings turns in the headstock's chamber
    nose_z = g.headstock_bottom_m
    rules: dict[str, tuple[tuple[str, ...], Callable[[Vector], NDArray[np.bool_]] | None]] = {
        "bed": (("bed",), lambda c: ~_within(c, bed) & ~_at_top(c, g)),
        "bed inside": (("bed",), lambda c: _within(c, bed) & ~_at_top(c, g)),
        "bed top": (("bed",), lambda c: _at_top(c, g)),
        "column": (("column",), lambda c: ~_within(c, column)),
        "column inside": (("column",), lambda c: _within(c, column)),
        "headstock": (_HEAD, lambda c: ~_within(c, head)),
        "headstock inside": (_HEAD, lambda c: _within(c, head)),
        "motor": (("motor", "motor flange"), None),
        "spindle nose": (_SPINDLE, lambda c: c[:, 2] <= nose_z + 1e-9),
        "spindle inside": (_SPINDLE, lambda c: c[:, 2] > nose_z + 1e-9),
        "saddle": (("saddle", "Y nut"), None),
        "table": (("table", "X nut"), lambda c: c[:, 2] < g.table_top_m - 1e-9),
        "table top": (("table",), lambda c: c[:, 2] >= g.table_top_m - 1e-9),
        "guideways": (("Z guideways", "Y guideways", "X guideways"), None),
        "screws": (tuple(f"{axis} screw{end}" for axis in "XYZ" for end in ("", " bearing")), None),
    }
    return {name: body.surface_of(parts, where) for name, (parts, where) in rules.items()}


def heated_parts() -> dict[str, tuple[str, ...]]:
    """Source → parts over whose volume its heat is spread."""
    axes = {f"{axis} {part}": (f"{axis} {part}",) for axis in "XYZ" for part in ("nut", "screw bearing", "guideways")}
    return {
        "lower bearing": ("lower bearing",),
        "upper bearing": ("upper bearing",),
        "gearbox": ("gearbox",),
        "motor": ("motor",),
        "motor flange": ("motor flange",),
        "spindle": ("spindle",),
        **axes,
    }


def heated_surfaces(body: BlockMesh, geometry: MachineGeometry) -> dict[str, Indices]:
    """Source → facets over which its heat is spread: the hydraulic line along the headstock's left side."""
    g = geometry
    left, half = -g.headstock_width_m / 2, (g.headstock_bottom_m + g.headstock_top_m) / 2
    line = body.surface_of(
        ["headstock"],
        lambda c: np.isclose(c[:, 0], left) & (c[:, 1] < g.motor_front_m) & (abs(c[:, 2] - half) < 0.15),
    )
    return {"hydraulic line": line}


def feet(body: BlockMesh, geometry: MachineGeometry) -> dict[str, Indices]:
    """Facets of the six feet on the lower edge of the bed."""
    g = geometry
    half = g.bed_width_m / 2
    middle = (g.bed_back_m + g.bed_front_m) / 2
    rows = {"back": g.bed_back_m + _FOOT_M / 2, "middle": middle, "front": g.bed_front_m - _FOOT_M / 2}

    def foot(side: int, y: float) -> Indices:
        return body.surface_of(
            ["bed"],
            lambda c: np.isclose(c[:, 2], 0.0) & (c[:, 0] * side > half - g.wall_m) & (abs(c[:, 1] - y) < _FOOT_M / 2),
        )

    return {f"{row} {name}": foot(side, y) for row, y in rows.items() for name, side in (("left", -1), ("right", 1))}


def _at_top(centres_m: Vector, g: MachineGeometry) -> NDArray[np.bool_]:
    """The bed's upper face in front of the column, where coolant and chips fall."""
    return (centres_m[:, 2] >= g.bed_top_m - 1e-9) & (centres_m[:, 1] > g.column_front_m)


def _within(centres_m: Vector, box: tuple[tuple[float, float], ...]) -> NDArray[np.bool_]:
    """Whether facets lie inside the outer shape of a part, and not on it: in its chambers."""
    inside = np.ones(len(centres_m), dtype=np.bool_)
    for axis, (low, high) in enumerate(box):
        inside &= (centres_m[:, axis] > low + 1e-9) & (centres_m[:, axis] < high - 1e-9)
    return inside
