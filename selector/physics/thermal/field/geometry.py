"""The C-frame machining centre as boxes, which of its surfaces meet a fluid, and which parts are heated."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from selector.errors import OptionError
from selector.physics.thermal.field.mesh import VOID, Block, SolidMesh
from selector.types import Indices, Mask, Vector

_IRON, _STEEL = "cast iron", "steel"


@dataclass(frozen=True)
class MachineGeometry:
    """Lengths of a vertical machining centre [m]; about 5 t, as large as the machine of P."""

    #: bed_width_m, bed_back_m, bed_front_m and bed_top_m: Bed: width, Y of its back and front, Z of its top. It is a
    #: ribbed box, open below.
    bed_width_m: float = 0.80
    bed_back_m: float = -0.39
    bed_front_m: float = 1.00
    bed_top_m: float = 0.36
    #: column_width_m, column_back_m, column_front_m and column_top_m: Column: width, Y of its back and front, Z of its
    #: top. It is a box with three diaphragms and an upright rib.
    column_width_m: float = 0.60
    column_back_m: float = -0.35
    column_front_m: float = 0.05
    column_top_m: float = 1.70
    wall_m: float = 0.04  #: Thickness of walls and ribs
    #: headstock_width_m, headstock_back_m, headstock_front_m, headstock_bottom_m and headstock_top_m: Headstock: a box
    #: that carries the spindle between two floors, on a slide as wide as the guideways
    headstock_width_m: float = 0.32
    headstock_back_m: float = 0.12
    headstock_front_m: float = 0.66
    headstock_bottom_m: float = 0.92
    headstock_top_m: float = 1.46
    #: spindle_y_m, spindle_width_m and nose_m: Y of the spindle axis, side of the (square) spindle, how far it comes
    #: out below the headstock
    spindle_y_m: float = 0.55
    spindle_width_m: float = 0.10
    nose_m: float = 0.06
    #: guideway_inner_m and guideway_outer_m: Distance from the middle to the inner and outer side of the Y and Z
    #: guideways
    guideway_inner_m: float = 0.16
    guideway_outer_m: float = 0.26
    screw_width_m: float = 0.04  #: Side of the (square) ball screws
    #: saddle_width_m, saddle_back_m, saddle_front_m, saddle_bottom_m and saddle_top_m: Saddle on the bed
    saddle_width_m: float = 0.60
    saddle_back_m: float = 0.34
    saddle_front_m: float = 0.86
    saddle_bottom_m: float = 0.42
    saddle_top_m: float = 0.54
    #: table_width_m, table_bottom_m and table_top_m: Table on the saddle; it is as deep as the saddle
    table_width_m: float = 0.80
    table_bottom_m: float = 0.60
    table_top_m: float = 0.70
    #: motor_width_m, motor_back_m, motor_front_m and motor_top_m: Main motor on top of the headstock
    motor_width_m: float = 0.24
    motor_back_m: float = 0.26
    motor_front_m: float = 0.46
    motor_top_m: float = 1.84

    def __post_init__(self) -> None:
        increasing = (
            ("column_back_m", "column_front_m", "headstock_back_m", "spindle_y_m", "headstock_front_m"),
            ("bed_back_m", "column_back_m", "saddle_back_m", "spindle_y_m", "saddle_front_m", "bed_front_m"),
            ("bed_top_m", "saddle_bottom_m", "saddle_top_m", "table_bottom_m", "table_top_m", "headstock_bottom_m"),
            ("headstock_bottom_m", "headstock_top_m", "column_top_m"),
            ("headstock_back_m", "motor_back_m", "motor_front_m", "headstock_front_m"),
            ("screw_width_m", "spindle_width_m", "guideway_inner_m", "guideway_outer_m"),
        )
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name not in ("bed_back_m", "column_back_m", "column_front_m") and not value > 0:
                self._refuse(f"{field.name} = {value:g} m", "a length above 0 m")
        for names in increasing:
            for lower, upper in pairwise(names):
                if not getattr(self, lower) < getattr(self, upper):
                    found = f"{lower} = {getattr(self, lower):g} m and {upper} = {getattr(self, upper):g} m"
                    self._refuse(found, f"{lower} below {upper}")
        for name in ("headstock_width_m", "column_width_m", "saddle_width_m", "bed_width_m"):
            width, rails = getattr(self, name), 2 * self.guideway_outer_m
            if (width > rails) if name == "headstock_width_m" else (width < rails):
                side = "narrower" if name == "headstock_width_m" else "wider"
                self._refuse(f"{name} = {width:g} m, guideways {rails:g} m apart", f"a part {side} than the guideways")

    @staticmethod
    def _refuse(found: str, expected: str) -> None:
        advice = "correct the length; the defaults of MachineGeometry are a machine that fits together"
        raise OptionError(found, expected=expected, where="geometry of the machine", advice=advice)

    @property
    def nose_z_m(self) -> float:
        """Z of the spindle face [m]."""
        return self.headstock_bottom_m - self.nose_m


def machine_blocks(geometry: MachineGeometry) -> tuple[Block, ...]:
    """The boxes of the machine, in the order in which they take room from each other."""
    g = geometry
    return (*_bed(g), *_column(g), *_headstock(g), *_spindle(g), *_z_axis(g), *_y_axis(g), *_x_axis(g))


def _box(part: str, material: str, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Block:
    return Block(part, material, (x[0], y[0], z[0]), (x[1], y[1], z[1]))


def _pair(
    part: str, material: str, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]
) -> tuple[Block, Block]:
    """A box and its mirror image at the plane X = 0."""
    return _box(part, material, x, y, z), _box(part, material, (-x[1], -x[0]), y, z)


def _bed(g: MachineGeometry) -> tuple[Block, ...]:
    half, w = g.bed_width_m / 2, g.wall_m
    room = (g.column_back_m, g.column_front_m - w)
    front = (g.column_front_m, g.bed_front_m - w)
    return (
        _box("bed", _IRON, (-half, half), (g.bed_back_m, g.bed_front_m), (0.0, g.bed_top_m)),
        # chambers between the walls, one rib in the middle, ribs under the guideways and under the column's front
        *_pair(VOID, "", (w / 2, g.guideway_inner_m), room, (0.0, g.bed_top_m - w)),
        *_pair(VOID, "", (g.guideway_inner_m + w, half - w), room, (0.0, g.bed_top_m - w)),
        *_pair(VOID, "", (w / 2, g.guideway_inner_m), front, (0.0, g.bed_top_m - w)),
        *_pair(VOID, "", (g.guideway_inner_m + w, half - w), front, (0.0, g.bed_top_m - w)),
        *(
            _box("bed", _IRON, (-half, half), (y, y + w), (0.0, g.bed_top_m - w))
            for y in (g.saddle_back_m, g.spindle_y_m + 0.07)
        ),
    )


def _column(g: MachineGeometry) -> tuple[Block, ...]:
    half, w = g.column_width_m / 2, g.wall_m
    clear = (g.column_top_m - g.bed_top_m - 4 * w) / 4
    floors = [g.bed_top_m + i * (clear + w) for i in range(4)]
    return (
        _box("column", _IRON, (-half, half), (g.column_back_m, g.column_front_m), (g.bed_top_m, g.column_top_m)),
        *(
            _box(VOID, "", (w - half, half - w), (g.column_back_m + w, g.column_front_m - w), (z, z + clear))
            for z in floors
        ),
        # a rib upright in the middle
        _box("column", _IRON, (-w / 2, w / 2), (g.column_back_m, g.column_front_m), (g.bed_top_m, g.column_top_m)),
    )


def _headstock(g: MachineGeometry) -> tuple[Block, ...]:
    half, w, slide = g.headstock_width_m / 2, g.wall_m, g.headstock_back_m + 0.06
    inside = half - w
    rear = g.motor_back_m
    front = g.headstock_front_m - w
    low_floor, high_floor = _floors(g)
    box_z = (g.headstock_bottom_m, g.headstock_top_m)
    flange = (g.headstock_top_m, g.headstock_top_m + 0.08)
    motor_x = (-g.motor_width_m / 2, g.motor_width_m / 2)
    motor_y = (g.motor_back_m, g.motor_front_m)
    return (
        _box("headstock slide", _IRON, (-g.guideway_outer_m, g.guideway_outer_m), (g.headstock_back_m, slide), box_z),
        _box("headstock", _IRON, (-half, half), (slide, g.headstock_front_m), box_z),
        # behind the rear wall, between the floors, under the cover
        _box(VOID, "", (-inside, inside), (slide, rear), (g.headstock_bottom_m, g.headstock_top_m - w)),
        _box(VOID, "", (-inside, inside), (rear + w, front), (low_floor, high_floor - 0.08)),
        _box(VOID, "", (-inside, inside), (rear + w, front), (high_floor, g.headstock_top_m - w)),
        _box("gearbox", _IRON, (-inside, inside), (rear + w, g.motor_front_m), (high_floor, g.headstock_top_m - w)),
        _box("motor flange", _IRON, motor_x, motor_y, flange),
        _box("motor", "motor", motor_x, motor_y, (flange[1], g.motor_top_m)),
    )


def _floors(g: MachineGeometry) -> tuple[float, float]:
    """Z of the upper faces of the headstock's lower and upper floor, in which the bearings sit."""
    return g.headstock_bottom_m + 0.10, g.headstock_top_m - 0.10


def _spindle(g: MachineGeometry) -> tuple[Block, ...]:
    half, y = g.spindle_width_m / 2, g.spindle_y_m
    seat = half + 0.02
    low_floor, high_floor = _floors(g)
    around = (y - seat, y + seat)
    return (
        _box("lower bearing", "bearing", (-seat, seat), around, (g.headstock_bottom_m, low_floor)),
        _box("upper bearing", "bearing, floating", (-seat, seat), around, (high_floor - 0.08, high_floor)),
        _box("spindle", _STEEL, (-half, half), (y - half, y + half), (g.nose_z_m, high_floor)),
    )


def _z_axis(g: MachineGeometry) -> tuple[Block, ...]:
    half = g.screw_width_m / 2
    rail, gap = g.column_front_m + 0.03, g.headstock_back_m
    screw_y = (gap - g.screw_width_m, gap)
    middle = (g.headstock_bottom_m + g.headstock_top_m) / 2
    nut = (middle - 0.08, middle + 0.02)
    slide = (g.headstock_back_m, g.headstock_back_m + 0.06)
    span = (g.guideway_inner_m, g.guideway_outer_m)
    rail_z = (g.bed_top_m + 0.20, g.column_top_m)
    top = (g.column_top_m, g.column_top_m + 0.10)
    return (
        *_pair("column", _IRON, span, (g.column_front_m, rail), rail_z),
        *_pair("Z guideways", "guideway z", span, (rail, gap), (g.headstock_bottom_m, g.headstock_top_m)),
        _box(VOID, "", (-0.05, 0.05), slide, (g.headstock_bottom_m, g.headstock_top_m)),
        _box("Z nut", _STEEL, (-0.05, 0.05), slide, nut),
        _box("Z screw bearing", _STEEL, (-0.05, 0.05), (g.column_front_m - g.wall_m, gap), top),
        _box("Z screw", _STEEL, (-half, half), screw_y, (nut[0], g.column_top_m)),
    )


def _y_axis(g: MachineGeometry) -> tuple[Block, ...]:
    half, y = g.screw_width_m / 2, g.spindle_y_m
    screw_z = (g.saddle_bottom_m - g.screw_width_m, g.saddle_bottom_m)
    slot = (g.saddle_bottom_m, g.saddle_bottom_m + 0.04)
    saddle_x = (-g.saddle_width_m / 2, g.saddle_width_m / 2)
    saddle_y = (g.saddle_back_m, g.saddle_front_m)
    span = (g.guideway_inner_m, g.guideway_outer_m)
    rail = g.bed_top_m + 0.02
    bearing = (g.bed_front_m - 0.10, g.bed_front_m - g.wall_m)
    return (
        *_pair("bed", _IRON, span, (g.saddle_back_m - 0.10, bearing[1]), (g.bed_top_m, rail)),
        *_pair("Y guideways", "guideway y", span, saddle_y, (rail, g.saddle_bottom_m)),
        _box("saddle", _IRON, saddle_x, saddle_y, (g.saddle_bottom_m, g.saddle_top_m)),
        _box(VOID, "", (-0.05, 0.05), saddle_y, slot),
        _box("Y nut", _STEEL, (-0.05, 0.05), (y - 0.05, y + 0.05), slot),
        _box("Y screw bearing", _STEEL, (-0.05, 0.05), bearing, (g.bed_top_m, g.saddle_bottom_m)),
        _box("Y screw", _STEEL, (-half, half), (y - 0.05, bearing[0]), screw_z),
    )


def _x_axis(g: MachineGeometry) -> tuple[Block, ...]:
    half, y = g.screw_width_m / 2, g.spindle_y_m
    screw_z = (g.table_bottom_m - g.screw_width_m, g.table_bottom_m)
    slot = (g.table_bottom_m, g.table_bottom_m + 0.04)
    table_x = (-g.table_width_m / 2, g.table_width_m / 2)
    saddle_half = g.saddle_width_m / 2
    depth = (g.saddle_back_m, g.saddle_front_m)
    rail = g.saddle_top_m + 0.02
    spans = ((g.saddle_back_m + 0.04, g.saddle_back_m + 0.12), (g.saddle_front_m - 0.12, g.saddle_front_m - 0.04))
    bearing = (saddle_half - 0.04, saddle_half)
    return (
        *(_box("saddle", _IRON, (-saddle_half, saddle_half), span, (g.saddle_top_m, rail)) for span in spans),
        *(
            _box("X guideways", "guideway x", (-saddle_half, saddle_half), span, (rail, g.table_bottom_m))
            for span in spans
        ),
        _box("table", _IRON, table_x, depth, (g.table_bottom_m, g.table_top_m)),
        _box(VOID, "", table_x, (y - 0.05, y + 0.05), slot),
        _box("X nut", _STEEL, (-0.05, 0.05), (y - 0.05, y + 0.05), slot),
        _box("X screw bearing", _STEEL, bearing, (y - 0.05, y + 0.05), (g.saddle_top_m, g.table_bottom_m)),
        _box("X screw", _STEEL, (-0.05, bearing[0]), (y - half, y + half), screw_z),
    )


_SPINDLE = ("spindle", "lower bearing", "upper bearing")
_HEAD = ("headstock", "headstock slide", "gearbox", "Z nut")
_FOOT_M = 0.16


def surfaces(body: SolidMesh, geometry: MachineGeometry) -> dict[str, Indices]:
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
    rules: dict[str, tuple[tuple[str, ...], Callable[[Vector], Mask] | None]] = {
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
    moved = [f"{axis} {part}" for axis in "XYZ" for part in ("nut", "screw bearing", "guideways")]
    alone = ("lower bearing", "upper bearing", "gearbox", "motor", "motor flange", "spindle", *moved)
    return {name: (name,) for name in alone}


def heated_surfaces(body: SolidMesh, geometry: MachineGeometry) -> dict[str, Indices]:
    """Source → facets over which its heat is spread: the hydraulic line along the headstock's left side."""
    g = geometry
    left, half = -g.headstock_width_m / 2, (g.headstock_bottom_m + g.headstock_top_m) / 2
    line = body.surface_of(
        ["headstock"], lambda c: np.isclose(c[:, 0], left) & (c[:, 1] < g.motor_front_m) & (abs(c[:, 2] - half) < 0.15)
    )
    return {"hydraulic line": line}


def feet(body: SolidMesh, geometry: MachineGeometry) -> dict[str, Indices]:
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


def _at_top(centres_m: Vector, g: MachineGeometry) -> Mask:
    """The bed's upper face in front of the column, where coolant and chips fall."""
    return (centres_m[:, 2] >= g.bed_top_m - 1e-9) & (centres_m[:, 1] > g.column_front_m)


def _within(centres_m: Vector, box: tuple[tuple[float, float], ...]) -> Mask:
    """Whether facets lie inside the outer shape of a part, and not on it: in its chambers."""
    inside = np.ones(len(centres_m), dtype=np.bool_)
    for axis, (low, high) in enumerate(box):
        inside &= (centres_m[:, axis] > low + 1e-9) & (centres_m[:, axis] < high - 1e-9)
    return inside
