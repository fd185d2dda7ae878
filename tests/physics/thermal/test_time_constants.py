"""The slowest time constants of a machine while it stands, turns, and is flooded with coolant."""

from __future__ import annotations

import numpy as np

from selector.physics.thermal.modes.modes import ModalModel, SpeedLaw
from selector.physics.thermal.network.heat_system import Conditions, FilmLaw, Laws, Network
from selector.physics.thermal.thermal_model import HeatMachine, slowest_time_constants


def block(*films: FilmLaw) -> HeatMachine:
    """One body of 10 kJ/K with 1 m² at every film: its time constant is 10 000/Σh."""
    network = Network({"block": 1e4}, area_m2={law.film: {"block": 1.0} for law in films})
    return HeatMachine(network.heat_system(), Laws((), films), ("block",))


AIR = FilmLaw("air", still_w_per_m2_k=10.0, speed_w_per_m2_k=30.0, reference_rpm=1000.0, exponent=1.0)
FLOOD = FilmLaw("flood", still_w_per_m2_k=60.0, while_coolant=True, fluid="coolant")


def test_one_body_has_the_time_constant_of_its_films():
    conditions = Conditions(np.array([0.0, 10.0, 20.0]), spindle_speed=[0.0, 500.0, 0.0], coolant_on=[0.0, 1.0, 0.0])
    found = slowest_time_constants(block(AIR, FLOOD), conditions)
    expected = {"standing": 1e4 / 10, "at 500 r/min": 1e4 / 25, "at 500 r/min with coolant": 1e4 / 85}
    assert list(found) == list(expected)
    for name, tau_s in expected.items():
        np.testing.assert_allclose(found[name], [tau_s], rtol=1e-12)  # one division


def test_states_with_the_same_films_are_told_once():
    still = FilmLaw("air", still_w_per_m2_k=10.0)
    conditions = Conditions(np.array([0.0, 10.0]), spindle_speed=[500.0, 500.0])
    assert list(slowest_time_constants(block(still), conditions)) == ["standing"]


def test_a_body_that_no_fluid_reaches_never_forgets():
    conditions = Conditions(np.array([0.0, 10.0]), spindle_speed=[0.0, 0.0])
    closed = FilmLaw("air", still_w_per_m2_k=0.0)
    assert np.isinf(slowest_time_constants(block(closed), conditions)["standing"][0])


def test_modes_say_theirs_slowest_first():
    modes = ModalModel(
        ("Z",), np.array([60.0, 600.0]), np.ones((1, 2, 1)), SpeedLaw((1.0,), 1000.0), 1000.0, np.zeros(2)
    )
    conditions = Conditions(np.array([0.0, 10.0]), spindle_speed=[0.0, 0.0])
    assert slowest_time_constants(modes, conditions)["standing"].tolist() == [600.0, 60.0]
