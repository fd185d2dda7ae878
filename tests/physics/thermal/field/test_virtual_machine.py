"""The virtual machining centre: as the full field within 1 %, of the size of a machine, with memory to be found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.thermal import field_model
from selector.physics.thermal.field.geometry import MachineGeometry
from selector.physics.thermal.field.machine import (
    MAX_RPM,
    SENSORS,
    film_sets,
    machine_laws,
    parts_beside,
    virtual_machining_centre,
)
from selector.physics.thermal.network.heat_system import Conditions, projected
from selector.physics.thermal.network.transient import simulate_heat
from tests.physics.thermal.reductions import reduction_error

SHIFT_S = np.arange(0.0, 8 * 3600 + 1, 60.0)


@pytest.fixture(scope="module")
def machine():
    # 8 000 nodes, the machine of fixtures/thermal/field.toml, which other files of tests have made
    return field_model.virtual_machining_centre("everything", geometry=MachineGeometry(), refinement=0.2)


@pytest.fixture(scope="module")
def patent_shift(machine):
    """1500 to 3000 r/min in steps of two hours."""
    speed = np.array([1500.0, 2000.0, 2500.0, 3000.0])[np.minimum(SHIFT_S // 7200, 3).astype(int)]
    return run(machine, Conditions(SHIFT_S, spindle_speed=speed), time_s=SHIFT_S)


def run(machine, conditions, *, start_degc=20.0, **more):
    return simulate_heat(machine.system, machine.laws, conditions, step_s=20.0, start_degc=start_degc, **more)


def random_shift(seed):
    draw = np.random.RandomState(seed)
    speed = draw.choice([0.0, 500.0, 1250.0, 2000.0, 3000.0], 32)[np.minimum(SHIFT_S // 900, 31).astype(int)]
    wet = (draw.rand(8) < 0.5)[np.minimum(SHIFT_S // 3600, 7).astype(int)]
    hall = 20.0 + 1.5 * np.sin(SHIFT_S / 6000.0 + seed)
    return Conditions(SHIFT_S, spindle_speed=speed, ambient_degc=hall, coolant_on=wet.astype(float), coolant_degc=19.0)


def column(history, name):
    if name in history.displacements:
        return history.displacement_um[:, history.displacements.index(name)]
    return history.probe_degc[:, history.probes.index(name)]


def test_the_reduced_shift_is_that_of_the_full_field(machine):
    conditions, time_s = random_shift(1), SHIFT_S[:241]  # four hours with 16 speeds, wet and dry
    full = simulate_heat(
        machine.full, machine.laws, conditions, time_s=time_s, step_s=60.0, start_degc=20.0, method="implicit"
    )
    small = run(machine, conditions, time_s=time_s)
    for name in (*full.displacements, *full.probes):
        true, near = column(full, name), column(small, name)
        # the promise is 1 % of the peak; displacements stay below 0.3 %, most of which is the full model's stepping
        limit = 0.01 if name in full.probes else 0.003
        assert np.abs(near - true).max() < limit * np.abs(true - true[0]).max(), name


def test_error_is_told_where_the_basis_was_not_made(machine):
    sets = film_sets(replace(machine.laws, films=machine_laws("linear").films))
    told = reduction_error(machine.full, machine.system, sets[:1], [150.0, 4000.0, np.inf])
    assert max(told.values()) < 0.01  # the promise


def test_rises_and_displacements_of_a_machine_of_this_size(patent_shift):
    rise = {
        name: np.ptp(column(patent_shift, name)) for name in ("lower bearing", "upper bearing", "T01", "T19", "T32")
    }
    # what makers and the literature state for grease-lubricated spindles of this size: 10–20 K, some tens of µm
    assert 10 < rise["lower bearing"] < 20
    assert 10 < rise["upper bearing"] < 20
    assert rise["lower bearing"] > rise["T01"] * 0.9 > rise["T19"] > rise["T32"] > 0
    assert 40 < np.ptp(column(patent_shift, "Z")) < 90
    assert 20 < np.ptp(column(patent_shift, "Y")) < 60
    assert np.ptp(column(patent_shift, "X")) < 10  # nearly a plane of symmetry
    y_mean = (column(patent_shift, "Y_lower") + column(patent_shift, "Y_upper")) / 2
    np.testing.assert_allclose(column(patent_shift, "Y"), y_mean, atol=1e-9)  # round-off of 50 µm


def test_sensors_are_in_the_order_of_the_recording(patent_shift):
    assert patent_shift.probes[:37] == tuple(SENSORS)
    assert len({sensor.xyz_m for sensor in SENSORS.values()}) == 37


def test_energy_closes(patent_shift):
    assert patent_shift.balance.missing_share < 1e-9  # the promise of the exact stepper
    assert patent_shift.balance.sources_j["lower bearing"] > 0


def test_a_machine_that_is_off_takes_the_temperature_of_the_hall_and_keeps_it(machine):
    off = Conditions([0.0, 7200.0], machine_on=0.0, ambient_degc=17.0, coolant_degc=17.0, coolant_on=1.0)
    history = run(machine, off, time_s=[0.0, 7200.0], start_degc=17.0)
    # round-off of 17 °C through 200 states
    np.testing.assert_allclose(history.probe_degc, 17.0, atol=1e-9)
    # 3 K below the reference, everywhere: each reading is its expansion coefficient
    per_k = np.array([row @ machine.system.uniform for row in machine.system.displacements.values()])
    np.testing.assert_allclose(history.displacement_um[-1], -3.0 * per_k, atol=1e-8)


def test_one_temperature_goes_with_different_displacements(machine):
    """Thermal memory (C): while it warms and while it cools, the bearing seat passes the same temperature."""
    speed = np.where(SHIFT_S < 4 * 3600, MAX_RPM, 0.0)
    history = run(machine, Conditions(SHIFT_S, spindle_speed=speed), time_s=SHIFT_S)
    seat, z = column(history, "T01"), column(history, "Z")
    top = int(np.argmax(seat))
    level = seat[0] + 0.5 * (seat[top] - seat[0])
    up, down = int(np.argmax(seat > level)), top + int(np.argmax(seat[top:] < level))
    # a sixth of the largest displacement is far more than any sensor or rounding explains
    assert abs(z[down] - z[up]) > np.ptp(z) / 6


def warmer_hall(machine, physics, speed_rpm):
    """What 5 K more in the hall and the coolant change at the nose after 4 hours [K]."""
    runs, laws = [], machine_laws(physics)
    for degc in (20.0, 25.0):
        conditions = Conditions([0.0, 14400.0], spindle_speed=speed_rpm, ambient_degc=degc, coolant_degc=degc)
        history = simulate_heat(machine.system, laws, conditions, time_s=[14400.0], step_s=60.0, start_degc=20.0)
        runs.append(history.probe_degc[0])
    return runs[1] - runs[0]


def test_what_each_physics_adds(machine):
    slow, fast = (warmer_hall(machine, "linear", speed) for speed in (0.0, MAX_RPM))
    np.testing.assert_allclose(fast, slow, atol=1e-9)  # linear: the hall adds the same at any speed; round-off
    slow, fast = (warmer_hall(machine, "convection", speed) for speed in (0.0, MAX_RPM))
    bearing = list(machine.system.probes).index("lower bearing")
    assert fast[bearing] > slow[bearing] + 0.05  # films grow with the speed: the hall comes in faster
    soft = warmer_hall(machine, "everything", MAX_RPM)
    assert soft[bearing] < fast[bearing] - 0.01  # a warmer lubricant gives less heat


def test_coolant_and_hydraulics_are_felt(machine):
    def after(**changes):
        history = run(machine, Conditions([0.0, 14400.0], **changes), time_s=[14400.0], start_degc=20.0)
        return dict(zip(history.probes, history.probe_degc[0], strict=True)), history.displacement_um[0]

    dry, dry_um = after(spindle_speed=2000.0)
    wet, wet_um = after(spindle_speed=2000.0, coolant_on=1.0, coolant_degc=17.0)
    assert wet["T36"] < dry["T36"] - 1.5
    assert wet["T37"] == pytest.approx(17.0, abs=0.05)  # the tank is the coolant's, but for a film
    assert np.abs(wet_um - dry_um).max() > 5.0
    idle, _ = after(machine_on=0.0)
    assert dry["T15"] > idle["T15"] + 3.0


def test_temperatures_of_all_nodes(machine):
    conditions = random_shift(2)
    history = run(machine, conditions, time_s=[14400.0], start_degc=20.0, keep_states_at_s=[14400.0])
    count = len(machine.mesh.nodes_m)
    nodes = history.states[0] @ machine.basis[:count].T
    assert nodes.shape == (count,)
    of_field = {name: row for name, row in machine.full.probes.items() if not row[count:].any()}
    read = {name: float(row[:count] @ nodes) for name, row in of_field.items()}
    for name, degc in read.items():
        assert degc == pytest.approx(column(history, name)[0], abs=1e-9)  # the same sum in another order
    # no node is below the hall or the coolant, up to the error of the reduction: 1 % of a rise of 20 K
    assert nodes.min() > 18.3 - 0.2


def test_virtual_sensors_anywhere():
    own = virtual_machining_centre(refinement=0.1, sensors={"mid wall": (0.2, 0.05, 1.0)}, tolerance=0.05)
    assert next(iter(own.system.probes)) == "mid wall"
    assert "T01" not in own.system.probes
    assert own.elastic is not None
    same = projected(own.full, own.basis)
    np.testing.assert_allclose(same.conduction, own.system.conduction)


def test_bad_options_are_told():
    with pytest.raises(InputError, match="away"):
        virtual_machining_centre(refinement=0.2, sensors={"roof": (0.0, 0.0, 3.0)})


def test_every_source_and_film_has_a_law(machine):
    laws = machine_laws()
    network, _ = parts_beside()
    heated = {law.source for law in laws.heat}
    assert heated <= set(machine.system.sources)
    # the hydraulic line is where the oil's heat enters, and has none of its own
    assert set(machine.system.sources) - heated == {"hydraulic line"}
    assert {law.film for law in laws.films} == set(machine.system.films)
    assert set(network.heat_capacity_j_per_k) == {"hydraulic unit", "coolant tank"}
