"""The field at one moment agrees with what thermometers and gauges of the same simulation read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.thermal import field_model
from selector.physics.thermal.field import mesh
from selector.physics.thermal.field.geometry import MachineGeometry
from selector.physics.thermal.field.machine import displacement_readings
from selector.physics.thermal.field.mesh import Elasticity, elasticity, elasticity_to_keep, probe_row
from selector.physics.thermal.field_model import field_moment, field_of, laws_of
from selector.physics.thermal.model_file import FieldFile, parsed_model_file
from selector.physics.thermal.schedule import scheduled
from selector.physics.thermal.thermal_model import thermal_model

MODEL = """
[model]
kind = "field"
name = "small"
[run]
duration_min = 90
period_s = 300
start_degc = 22.0
[conditions]
spindle_speed_rpm = [[0, 3000], [60, 0]]
ambient_degc = 21.0
[field]
physics = "linear"
refinement = 0.1
[[sensors]]
name = "wall"
xyz = [0.0, 0.62, 0.98]
[[gauges]]
name = "Z"
[[gauges]]
name = "Y"
"""


@pytest.fixture(scope="module")
def run():
    file = parsed_model_file(MODEL)
    assert isinstance(file, FieldFile)
    machine = thermal_model(file)
    conditions = scheduled(file.conditions, {}, duration_s=5400.0, period_s=300.0)
    return file, conditions, machine.simulate(conditions, instruments=False)


def test_thermometers_and_gauges_read_the_same_field(run):
    file, conditions, recording = run
    moment = field_moment(file, conditions, 3600.0)
    k = int(np.flatnonzero(recording.time_s("simulation") == 3600.0)[0])
    mesh = field_of(file, laws_of(file)).mesh
    wall = float(probe_row(mesh, (0.0, 0.62, 0.98), "wall") @ moment.temperature_degc)
    # the same reduced states, read through the same rows
    assert recording.values("simulation", ["wall"])[k, 0] == pytest.approx(wall, abs=1e-6)
    assert moment.temperature_degc.max() > 25.0
    readings = displacement_readings(mesh, MachineGeometry())
    z_um = float(readings["Z"] @ moment.deformation_um.ravel())
    # both count from the start; the adjoint row and the direct solution differ by rounding of the factorisation
    assert recording.values("simulation", ["Z"])[k, 0] == pytest.approx(z_um, rel=1e-6)
    assert abs(z_um) > 5.0
    assert moment.triangles.max() < len(moment.nodes_m) == len(moment.temperature_degc) == len(moment.deformation_um)


def test_factors_that_are_kept_change_no_bit(run, monkeypatch):
    file, conditions, _ = run
    machine = field_of(file, laws_of(file))
    elastic = elasticity(machine.mesh, machine.materials, machine.springs_n_per_m)
    found = []
    for one in (elasticity_to_keep(elastic, machine.mesh), None):
        monkeypatch.setattr(field_model, "field_of", lambda *_, elastic=one: replace(machine, elastic=elastic))
        found.append(field_moment(file, conditions, 3600.0).deformation_um)
    assert np.array_equal(*found)


def test_large_factors_are_not_kept(run, monkeypatch):
    machine = field_of(run[0], laws_of(run[0]))
    elastic = Elasticity(*[None] * 3)
    assert elasticity_to_keep(elastic, machine.mesh) is elastic
    monkeypatch.setattr(mesh, "KEPT_NODES", len(machine.mesh.nodes_m) - 1)
    assert elasticity_to_keep(elastic, machine.mesh) is None


def test_nothing_has_moved_at_the_start(run):
    file, conditions, _ = run
    moment = field_moment(file, conditions, 0.0)
    # the basis holds a uniform temperature exactly, up to rounding of 22 °C in 8 000 nodes
    np.testing.assert_allclose(moment.temperature_degc, 22.0, atol=1e-9)
    assert np.abs(moment.deformation_um).max() < 1e-6


def test_a_moment_after_the_end_is_refused(run):
    file, conditions, _ = run
    with pytest.raises(InputError):
        field_moment(file, conditions, 5500.0)
