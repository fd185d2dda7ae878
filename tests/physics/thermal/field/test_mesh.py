"""Bodies of boxes: volume, surface, parts, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError, OptionError
from selector.physics.thermal.field.mesh import (
    MATERIALS,
    VOID,
    Block,
    block_mesh,
    conduction_matrices,
    film,
    probe_row,
    surface_source,
    volume_source,
)

LENGTHS = st.integers(0, 6)


@st.composite
def bodies(draw):
    """One to four overlapping boxes of two materials on a grid of 50 mm, in cells of 40 mm at most."""
    blocks = []
    for number in range(draw(st.integers(1, 4))):
        low = [draw(LENGTHS) for _ in range(3)]
        high = [at + draw(st.integers(1, 4)) for at in low]
        material = draw(st.sampled_from(["cast iron", "steel"]))
        blocks.append(Block(f"part {number}", material, tuple(0.05 * x for x in low), tuple(0.05 * x for x in high)))
    return block_mesh(blocks, draw(st.sampled_from([0.04, 0.2])))


def ones(body):
    return np.ones(len(body.nodes_m))


@settings(max_examples=25)
@given(bodies())
def test_sums_over_any_body_are_those_of_the_body(body):
    capacity, conduction = conduction_matrices(body, MATERIALS)
    heat = [MATERIALS[name].density_kg_per_m3 * MATERIALS[name].specific_heat_j_per_kg_k for name in body.materials]
    facets = body.surface_of(body.parts)
    area, load = film(body, facets)
    # round-off of sums over some thousand cells
    assert capacity.sum() == pytest.approx(np.array(heat)[body.kind] @ body.volume_m3, rel=1e-12)
    assert np.abs(conduction @ ones(body)).max() < 1e-12 * conduction.max()
    assert abs(conduction - conduction.T).max() == 0.0
    np.testing.assert_allclose(area @ ones(body), load, rtol=1e-12)
    corners = body.nodes_m[body.triangles()]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert load.sum() == pytest.approx(np.linalg.norm(cross, axis=1).sum() / 2, rel=1e-12)
    # the divergence theorem: the triangles close the body and point outward
    assert np.einsum("ij,ij->", corners[:, 0], cross) / 6 == pytest.approx(body.volume_m3.sum(), rel=1e-12)
    assert volume_source(body, np.arange(len(body.cells))).sum() == pytest.approx(1.0, abs=1e-12)
    # of even heat over a surface, every node gets as much as it has of the film's area
    np.testing.assert_allclose(surface_source(body, facets) * load.sum(), load, rtol=1e-12, atol=1e-15)


@settings(max_examples=25)
@given(bodies(), st.integers(0, 10**6), st.tuples(*[st.floats(0, 1)] * 3))
def test_a_probe_reads_a_linear_field_exactly(body, number, inside):
    cell = number % len(body.cells)
    place = body.low_m[cell] + np.array(inside) * (body.high_m[cell] - body.low_m[cell])
    row = probe_row(body, tuple(place))
    assert row.sum() == pytest.approx(1.0, abs=1e-12)
    assert row.min() >= -1e-12  # a mean of corners, so within what they have
    np.testing.assert_allclose(row @ body.nodes_m, place, atol=1e-12)


def test_a_probe_just_outside_sits_on_the_surface_and_one_far_away_is_refused():
    body = block_mesh([Block("bar", "steel", (0.0, 0.0, 0.0), (0.5, 0.1, 0.1))], 0.05)
    np.testing.assert_allclose(probe_row(body, (0.33, 0.05, 0.12)) @ body.nodes_m, (0.33, 0.05, 0.1), atol=1e-12)
    with pytest.raises(InputError) as refused:
        probe_row(body, (0.33, 0.05, 0.2), "T9")
    assert "'T9'" in refused.value.where
    assert " 100 mm " in refused.value.found
    # the nearest point
    assert "(0.330, 0.050, 0.100)" in refused.value.advice
    with pytest.raises(InputError, match="nan mm"):
        probe_row(body, (np.nan, 0.05, 0.2))


def test_later_blocks_take_the_room_of_earlier_ones_and_void_cuts():
    blocks = [
        Block("case", "cast iron", (0.0, 0.0, 0.0), (0.4, 0.4, 0.4)),
        Block(VOID, "", (0.1, 0.1, 0.1), (0.3, 0.3, 0.3)),
        Block("core", "steel", (0.1, 0.1, 0.1), (0.2, 0.2, 0.2)),
    ]
    body = block_mesh(blocks, 0.05)
    assert body.volume_m3[body.cells_of("core")].sum() == pytest.approx(1e-3)
    assert body.volume_m3[body.cells_of("case")].sum() == pytest.approx(0.4**3 - 0.2**3)
    assert len(body.cells_of("lid")) == 0
    assert body.pieces().max() == 0
    apart = [*blocks[:2], Block("core", "steel", (0.15, 0.15, 0.15), (0.25, 0.25, 0.25))]
    assert block_mesh(apart, 0.05).pieces().max() == 1
    corner_to_corner = [Block("a", "steel", (0.0, 0.0, 0.0), (0.1,) * 3), Block("b", "steel", (0.1,) * 3, (0.2,) * 3)]
    assert block_mesh(corner_to_corner, 0.05).pieces().max() == 1


def test_blocks_inside_out_are_refused():
    with pytest.raises(OptionError, match=r"\(0\.5, 0\.0, 0\.1\) m") as refused:
        Block("bar", "steel", (0.0, 0.0, 0.0), (0.5, 0.0, 0.1))
    assert "'bar'" in refused.value.where
