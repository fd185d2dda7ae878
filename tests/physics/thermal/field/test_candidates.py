"""Candidates sit on outer, flat, free surfaces, evenly; the outline is that of the machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import OptionError
from selector.physics.thermal.field import machine_outline
from selector.physics.thermal.field.geometry import MachineGeometry, machine_blocks, surfaces
from selector.physics.thermal.field.machine import ACCESSIBLE, FOOT_M, MOST_CANDIDATES, ROOM_M, sensor_candidates
from selector.physics.thermal.field.mesh import block_mesh
from selector.physics.thermal.model_file import MOST_SENSORS, CandidatesSection

OUTWARD = {
    "left": (-1, 0, 0),
    "right": (1, 0, 0),
    "rear": (0, -1, 0),
    "front": (0, 1, 0),
    "underside": (0, 0, -1),
    "top": (0, 0, 1),
}
COLUMN_WALLS = {"rear": 0.60 * 1.34, "left": 0.40 * 1.34, "right": 0.40 * 1.34}
"""Area of the free walls of the column [m²]: widths of the default geometry times its height above the bed."""


def in_body(body, points_m):
    """Whether points are in a cell or on its faces."""
    inside = np.ones((len(points_m), len(body.cells)), dtype=bool)
    for axis in range(3):
        at = points_m[:, axis, None]
        inside &= (at > body.low_m[:, axis] - 1e-9) & (at < body.high_m[:, axis] + 1e-9)
    return inside.any(axis=1)


lengths = st.fixed_dictionaries(
    {
        "column_top_m": st.floats(1.5, 2.2),
        "column_width_m": st.floats(0.56, 0.8),
        "bed_front_m": st.floats(0.9, 1.3),
        "headstock_width_m": st.floats(0.24, 0.40),
    }
)


@settings(max_examples=10)
@given(spacing_m=st.floats(0.2, 1.0), changes=lengths)
def test_every_place_is_on_the_surface_with_air_before_it_and_iron_behind_it(spacing_m, changes):
    geometry = replace(MachineGeometry(), **changes)
    body = block_mesh(machine_blocks(geometry), 1.0)
    found = sensor_candidates(geometry, spacing_m)
    at = np.array([sensor.xyz_m for sensor in found.values()])
    outward = np.array([OUTWARD[sensor.place.split(", ")[1]] for sensor in found.values()])
    # coordinates are rounded to 0.1 mm; 1 mm is off any rounding, and thinner than any wall
    assert in_body(body, at - 1e-3 * outward).all()
    # 6 mm: the room is looked at every 5 mm
    for depth_m in (1e-3, ROOM_M / 2, ROOM_M - 6e-3):
        ahead = at + depth_m * outward
        assert not in_body(body, ahead).any()
        assert (ahead[:, 2] > 0).all()
    across = np.where(outward[:, None, :] == 0, np.eye(3), 0)
    for sign in (-1, 1):
        for axis in range(3):
            foot = at + sign * (FOOT_M / 2 - 1e-3) * across[:, axis]
            assert in_body(body, foot - 1e-3 * outward).all()


@settings(max_examples=10)
@given(spacing_m=st.floats(0.12, 1.0))
def test_places_keep_their_distance_and_their_names(spacing_m):
    found = sensor_candidates(spacing_m=spacing_m, surfaces=("column", "headstock"))
    at = np.array([sensor.xyz_m for sensor in found.values()])
    gaps = np.linalg.norm(at[:, None] - at, axis=2) + 10 * np.eye(len(at))
    assert gaps.min() > spacing_m / 2 - 2e-4  # coordinates are rounded to 0.1 mm
    assert list(found) == sorted(found)
    assert list(found) == list(sensor_candidates(spacing_m=spacing_m, surfaces=("column", "headstock")))


@pytest.mark.parametrize("spacing_m", [0.3, 0.15, 0.075])
def test_a_wall_has_about_one_place_for_each_square_of_the_spacing(spacing_m):
    sensors = sensor_candidates(spacing_m=spacing_m, surfaces=("column",)).values()
    for side, area_m2 in COLUMN_WALLS.items():
        level = {"rear": (1, -0.35), "left": (0, -0.30), "right": (0, 0.30)}[side]
        count = sum(s.place.startswith(f"column, {side},") and s.xyz_m[level[0]] == level[1] for s in sensors)
        # rows and columns are rounded to whole numbers: at 0.4 m and 0.3 m a third either way
        assert count == pytest.approx(area_m2 / spacing_m**2, rel=0.35)


def test_walls_inside_and_gaps_have_no_places():
    sensors = sensor_candidates(spacing_m=0.1).values()
    g = MachineGeometry()
    # the slit between headstock slide and column is 70 mm deep, that between saddle and table 60 mm
    behind = [s for s in sensors if s.place.startswith("column, front") and g.headstock_bottom_m < s.xyz_m[2] < 1.46]
    assert all(abs(s.xyz_m[0]) > g.guideway_outer_m for s in behind)
    assert not [s for s in sensors if s.place.startswith("saddle, top")]
    assert not [s for s in sensors if s.xyz_m[2] < FOOT_M / 2]


def test_only_the_named_surfaces_are_used():
    parts = {s.place.split(",")[0] for s in sensor_candidates(surfaces=("table", "motor")).values()}
    assert parts == {"table", "X nut", "motor", "motor flange"}
    body = block_mesh(machine_blocks(MachineGeometry()), 1.0)
    assert set(ACCESSIBLE) < set(surfaces(body, MachineGeometry()))
    assert CandidatesSection().surfaces == ACCESSIBLE
    assert MOST_SENSORS == MOST_CANDIDATES


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"spacing_m": 0.0}, "0 m between"),
        ({"spacing_m": float("nan")}, "nan m between"),
        ({"spacing_m": 0.03}, "more than 1000"),
        ({"surfaces": ("colum",)}, "colum"),
        ({"surfaces": ("column inside",)}, "column inside"),
        ({"surfaces": ()}, "no place"),
    ],
)
def test_what_cannot_be_placed_is_refused(options, word):
    with pytest.raises(OptionError, match=word):
        sensor_candidates(**options)


def test_outline_spans_the_machine_and_is_made_of_its_edges():
    g = MachineGeometry()
    lines = machine_outline(g)
    ends = np.array(lines)
    assert ends.shape[1:] == (2, 3)
    # every line runs along one axis
    assert ((np.abs(ends[:, 1] - ends[:, 0]) > 0).sum(axis=1) == 1).all()
    low, high = ends.reshape(-1, 3).min(axis=0), ends.reshape(-1, 3).max(axis=0)
    assert low == pytest.approx([-g.table_width_m / 2, g.bed_back_m, 0.0])
    assert high == pytest.approx([g.table_width_m / 2, g.bed_front_m, g.motor_top_m])
    half = g.column_width_m / 2
    corner = [line for line in lines if (line[:, 0] == -half).all() and (line[:, 1] == g.column_back_m).all()]
    # the rear left edge of the column, whole, from the bed to its top
    assert [sorted(line[:, 2]) for line in corner] == [[g.bed_top_m, g.column_top_m]]
    # the diaphragms inside the column are not drawn
    inside = (np.abs(ends[:, :, 0]) < half - 0.01) & (ends[:, :, 1] > g.column_back_m + 0.01) & (ends[:, :, 1] < 0.0)
    chamber = inside & (ends[:, :, 2] > g.bed_top_m + 0.01) & (ends[:, :, 2] < g.column_top_m - 0.01)
    assert not chamber.any()
