"""The machining centre: energy, surfaces, displacements of the tool, and what is refused."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError, OptionError
from selector.physics.thermal.field import field_machine
from selector.physics.thermal.field.geometry import (
    MachineGeometry,
    feet,
    heated_parts,
    heated_surfaces,
    machine_blocks,
    surfaces,
)
from selector.physics.thermal.field.machine import CELL_M, displacement_readings
from selector.physics.thermal.field.mesh import MATERIALS, block_mesh, rigid_motions
from selector.physics.thermal.network.heat_system import solver_of

COARSE = 0.2
ONE_ALPHA = {name: replace(material, expansion_per_k=11e-6) for name, material in MATERIALS.items()}
BESIDE_THE_MACHINE = ("T15", "T37")  # hydraulic unit and coolant tank


@pytest.fixture(scope="module")
def places():
    root = Path(__file__).resolve().parents[4]
    channels = tomllib.loads((root / "fixtures/vmc37/machine.toml").read_text(encoding="utf-8"))["channels"]
    return {name: tuple(c["xyz"]) for name, c in channels.items() if c["role"] == "temperature"}


@pytest.fixture(scope="module")
def machine(places):
    on_it = {name: place for name, place in places.items() if name not in BESIDE_THE_MACHINE}
    return field_machine(refinement=COARSE, probes=on_it)


@pytest.fixture(scope="module")
def free_machine():
    """One expansion coefficient, and feet so soft that they do not hinder."""
    return field_machine(refinement=COARSE, materials=ONE_ALPHA, foot_n_per_m=(1.0, 1.0, 1.0))


def test_the_default_mesh_has_20_000_nodes_and_is_one_body():
    body = block_mesh(machine_blocks(MachineGeometry()), CELL_M)
    assert len(body.nodes_m) >= 20_000
    assert body.pieces().max() == 0


def test_energy_is_counted_once(machine):
    system, body = machine.system, machine.mesh
    # round-off of sums over 8 000 nodes
    assert np.abs(system.conduction @ system.uniform).max() < 1e-12 * system.conduction.max()
    materials = [MATERIALS[name] for name in body.materials]
    heat = np.array([m.density_kg_per_m3 * m.specific_heat_j_per_kg_k for m in materials])[body.kind]
    assert system.capacity.sum() == pytest.approx(heat @ body.volume_m3, rel=1e-12)
    for name in machine.system.sources:
        assert system.sources[name].sum() == pytest.approx(1.0, abs=1e-12)
        assert system.sources[name].min() >= 0.0
    corners = body.nodes_m[machine.mesh.triangles()]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert sum(system.film_loads[name].sum() for name in machine.system.films) == pytest.approx(area.sum(), rel=1e-12)


def test_table_top_is_as_large_as_the_table(machine):
    g = machine.geometry
    expected = g.table_width_m * (g.saddle_front_m - g.saddle_back_m)
    assert machine.system.film_loads["table top"].sum() == pytest.approx(expected, rel=1e-12)


@settings(max_examples=10)
@given(
    st.builds(
        MachineGeometry,
        column_top_m=st.floats(1.6, 2.2),
        spindle_y_m=st.floats(0.54, 0.56),
        table_width_m=st.floats(0.7, 1.0),
        bed_front_m=st.floats(0.98, 1.3),
        wall_m=st.floats(0.025, 0.042),
        headstock_width_m=st.floats(0.3, 0.318),
    )
)
def test_any_machine_is_one_body_and_every_facet_has_one_surface(geometry):
    body = block_mesh(machine_blocks(geometry), 0.5)
    assert body.pieces().max() == 0
    facets = np.concatenate(list(surfaces(body, geometry).values()))
    np.testing.assert_array_equal(np.sort(facets), np.sort(np.asarray(body.mesh.boundary_facets())))
    assert all(len(facets) for facets in feet(body, geometry).values())
    assert all(len(facets) for facets in heated_surfaces(body, geometry).values())
    assert all(len(body.cells_of(*parts)) for parts in heated_parts().values())


def test_a_machine_of_one_material_only_grows_when_it_warms_evenly(free_machine):
    g, rows = free_machine.geometry, free_machine.system.displacements
    um_per_m = 11.0
    table_y = (g.saddle_back_m + g.saddle_front_m) / 2
    # feet of 1 N/m against a body of about 1e8 N/m, and round-off
    assert rows["X"].sum() == pytest.approx(0.0, abs=1e-5)
    for name in ("Y", "Y_lower", "Y_upper"):
        assert rows[name].sum() == pytest.approx(um_per_m * (g.spindle_y_m - table_y), abs=1e-5)
    assert rows["Z"].sum() == pytest.approx(-um_per_m * (g.nose_z_m - g.table_top_m), abs=1e-5)
    warm = free_machine.deformation(np.full(free_machine.system.size, 21.0))
    grown = warm - warm.mean(axis=0)
    expected = um_per_m * (free_machine.mesh.nodes_m - free_machine.mesh.nodes_m.mean(axis=0))
    motions = rigid_motions(free_machine.mesh.nodes_m)
    rest = (grown - expected).ravel()
    rest -= motions @ np.linalg.lstsq(motions, rest, rcond=None)[0]
    assert np.abs(rest).max() < 1e-5


def test_rows_are_the_readings_of_the_deformation(machine):
    field = 20.0 + np.random.default_rng(3).uniform(-5, 15, machine.system.size)
    moved = machine.deformation(field, reference_degc=22.0).ravel()
    for name, reading in displacement_readings(machine.mesh, machine.geometry).items():
        row = machine.system.displacements[name]
        # two ways through the same factors: round-off times the condition number, some 1e6
        assert row @ (field - 22.0) == pytest.approx(reading @ moved, abs=1e-6)
    mean = (machine.system.displacements["Y_lower"] + machine.system.displacements["Y_upper"]) / 2
    np.testing.assert_allclose(machine.system.displacements["Y"], mean, rtol=1e-12, atol=1e-15)


def test_gauges_do_not_see_the_machine_move_as_a_whole(machine):
    motions = rigid_motions(machine.mesh.nodes_m)
    for reading in displacement_readings(machine.mesh, machine.geometry).values():
        assert np.abs(reading @ motions).max() < 1e-12  # round-off


def test_the_upper_gauge_sees_less_of_a_tilt_by_the_250_mm_between_the_gauges(machine):
    readings = displacement_readings(machine.mesh, machine.geometry)
    nose = np.isin(np.arange(len(machine.mesh.nodes_m)), machine.mesh.cells[machine.mesh.cells_of("spindle")])
    tilt = np.zeros((len(machine.mesh.nodes_m), 3))
    tilt[nose] = np.cross([1e-5, 0.0, 0.0], machine.mesh.nodes_m[nose])  # 10 µm/m about X
    difference = (readings["Y_lower"] - readings["Y_upper"]) @ tilt.ravel()
    assert difference == pytest.approx(1e-5 * 0.25, rel=1e-9)


def heated(machine, name, heat_w=100.0):
    """Steady temperature rise in a hall, 8 W/(m²·K) everywhere."""
    matrix = machine.system.conduction + 8.0 * sum(machine.system.films[patch] for patch in machine.system.films)
    return solver_of(matrix.tocsr()).solve(heat_w * machine.system.sources[name])


def test_heat_goes_out_where_it_can_and_warms_what_is_near(machine):
    rise = heated(machine, "lower bearing")
    out = 8.0 * sum(machine.system.film_loads[patch] for patch in machine.system.films) @ rise
    assert out == pytest.approx(100.0, rel=1e-9)  # all of it, to round-off of the solve
    # trilinear cells keep the maximum principle only nearly: 1 % of the peak below the hall at most
    assert rise.min() > -0.01 * rise.max()
    nose = machine.mesh.nodes_m[np.argmax(rise)]
    assert abs(nose[2] - 0.97) < 0.1
    assert abs(nose[1] - 0.55) < 0.1


def test_a_warm_spindle_grows_towards_the_table_and_a_warm_column_lifts_it(machine):
    rows, mesh = machine.system.displacements, machine.mesh

    def of(part, name):
        nodes = np.zeros(len(mesh.nodes_m))
        nodes[np.unique(mesh.cells[mesh.cells_of(part)])] = 1.0
        return rows[name] @ nodes

    # 0.06 m of nose and half the lower bearing below the fixed bearing's middle: 0.6 to 1.3 µm/K
    assert 0.5 < of("spindle", "Z") < 1.5
    # the column carries the Z screw's bearing, 1.34 m above the bed; the bed below arches and adds some
    assert of("column", "Z") == pytest.approx(-10.5 * 1.34, rel=0.25)
    # the screw hangs from it down to the nut, 0.6 m
    assert 4.0 < of("Z screw", "Z") < 8.0
    # the headstock reaches from the guideway to the spindle, 0.43 m
    assert of("headstock", "Y") + of("headstock slide", "Y") == pytest.approx(10.5 * 0.43, rel=0.3)


def test_the_machine_is_symmetric_but_for_the_x_screw(machine):
    rise = heated(machine, "upper bearing")
    sideways = machine.system.displacements["X"] @ rise
    along = machine.system.displacements["Z"] @ rise
    assert abs(sideways) < 0.02 * abs(along)


def test_sensors_of_the_shipped_machine_file_find_their_parts(machine, places):
    assert len(machine.system.probes) == 35
    assert set(places) - set(machine.system.probes) == set(BESIDE_THE_MACHINE)
    for name, row in machine.system.probes.items():
        assert np.linalg.norm(row @ machine.mesh.nodes_m - places[name]) < 0.005  # as the places are rounded
    for name in BESIDE_THE_MACHINE:
        with pytest.raises(InputError, match=f"sensor {name!r}"):
            field_machine(refinement=COARSE, probes={name: places[name]})


@pytest.mark.parametrize("refinement", [0.0, -1.0, np.nan, np.inf])
def test_no_refinement_is_refused(refinement):
    with pytest.raises(OptionError, match="refinement"):
        field_machine(refinement=refinement)


@pytest.mark.parametrize(
    "lengths",
    [
        {"wall_m": 0.0},
        {"wall_m": -0.04},
        {"column_top_m": np.nan},
        {"table_top_m": 1.0},
        {"spindle_y_m": 0.7},
        {"bed_back_m": -0.2},
        {"column_width_m": 0.3},
        {"saddle_width_m": 0.5},
        {"bed_width_m": 0.5},
        {"headstock_width_m": 0.6},
        {"motor_back_m": 0.5, "motor_front_m": 0.52, "headstock_top_m": 1.0},
    ],
)
def test_lengths_that_do_not_fit_together_are_refused(lengths):
    with pytest.raises(OptionError) as refused:
        machine_blocks(MachineGeometry(**lengths))
    assert refused.value.where in ("geometry of the machine", "block of the part 'void'")
