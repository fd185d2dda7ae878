from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.physics.thermal.network.heat_system import Conditions, FilmLaw, HeatLaw, Laws, Network, time_constants_s
from selector.physics.thermal.network.transient import simulate_heat
from tests.physics.thermal.drawn_networks import courses, laws_of, networks
from tests.physics.thermal.heat_balances import steady_state

PAIR = Network(
    {"spindle": 800.0, "column": 20000.0},
    [("spindle", "column", 12.0)],
    {"walls": {"column": 1.5}},
    {"friction": {"spindle": 0.7, "column": 0.3}},
    {"spindle": {"Z": 2.0, "Y": 0.5}, "column": {"Y": 4}},
)
HELD = Conditions([0.0, 1.0], spindle_speed=1000.0)


def test_a_network_as_matrices():
    system = PAIR.heat_system()
    np.testing.assert_array_equal(system.capacity, [[800, 0], [0, 20000]])
    np.testing.assert_array_equal(system.conduction, [[12, -12], [-12, 12]])
    np.testing.assert_array_equal(system.films["walls"], [[0, 0], [0, 1.5]])
    np.testing.assert_array_equal(system.film_loads["walls"], [0, 1.5])
    np.testing.assert_array_equal(system.sources["friction"], [0.7, 0.3])
    np.testing.assert_array_equal(system.displacements["Y"], [0.5, 4.0])
    np.testing.assert_array_equal(system.probes["column"], [0, 1])
    assert system.states == ("spindle", "column")


def test_links_of_the_same_nodes_add_up():
    twice = dataclasses.replace(PAIR, links=[("spindle", "column", 5.0), ("column", "spindle", 7.0)])
    np.testing.assert_array_equal(twice.heat_system().conduction, PAIR.heat_system().conduction)


@given(network=networks())
@settings(max_examples=30)
def test_a_uniform_temperature_moves_no_heat(network):
    system = network.heat_system()
    largest = np.abs(system.conduction).max() if len(network.heat_capacity_j_per_k) > 1 else 1.0
    # one rounding for every link of a node
    np.testing.assert_allclose(system.conduction @ system.uniform, 0.0, atol=1e-14 * largest)
    np.testing.assert_array_equal(system.conduction, system.conduction.T)
    for name, film in system.films.items():
        np.testing.assert_allclose(film @ system.uniform, system.film_loads[name], rtol=1e-15)
    for share in system.sources.values():
        assert share.sum() == pytest.approx(1.0, abs=1e-12)


def test_time_constants_in_closed_form():
    one = Network({"block": 5000.0}, area_m2={"air": {"block": 0.5}}).heat_system()
    assert time_constants_s(one, {"air": 20.0}) == pytest.approx([5000.0 / 10.0], rel=1e-14)
    g, h, c1, c2 = 12.0, 8.0 * 1.5, 800.0, 20000.0
    total, product = g / c1 + (g + h) / c2, g * h / (c1 * c2)
    fast = 0.5 * (total + np.sqrt(total**2 - 4 * product))
    found = time_constants_s(PAIR.heat_system(), {"walls": 8.0})
    # the quadratic's own rounding
    np.testing.assert_allclose(found, [fast / product, 1 / fast], rtol=1e-12)


@given(network=networks())
@settings(max_examples=20)
def test_more_cooling_makes_every_mode_quicker(network):
    system = network.heat_system()
    tau_s, quicker_s = (time_constants_s(system, {"air": coefficient}) for coefficient in (10.0, 20.0))
    assert (np.diff(tau_s) <= 0).all()
    assert (tau_s > 0).all()
    # each of them (Courant–Fischer); rounding of the quickest
    assert (1 / quicker_s >= 1 / tau_s - 1e-12 / tau_s[-1]).all()


def test_a_part_that_no_fluid_reaches_never_forgets():
    apart = dataclasses.replace(PAIR, links=()).heat_system()
    assert time_constants_s(apart, {"walls": 8.0})[0] == np.inf


def test_steady_state_in_closed_form():
    laws = Laws((HeatLaw("friction", speed_w=120.0),), (FilmLaw("walls", 8.0),))
    column = 20.0 + 120.0 / (8.0 * 1.5)
    # all heat leaves through the column, 0.7 of it through the link
    expected = [column + 0.7 * 120.0 / 12.0, column]
    np.testing.assert_allclose(steady_state(PAIR.heat_system(), laws, HELD), expected, rtol=1e-13)


@given(data=st.data())
@settings(max_examples=30)
def test_steady_state_is_where_a_long_run_ends(data):
    network = data.draw(networks())
    laws = data.draw(laws_of(network, softening=data.draw(st.booleans())))
    system = network.heat_system()
    course = data.draw(courses())
    held = Conditions([0.0, 1.0], **{k: v[0] for k, v in vars(course).items() if k != "time_s"})
    settled = steady_state(system, laws, held)
    for method in ("exact", "implicit"):
        day = Conditions([0.0, 86400.0], **{k: v[0] for k, v in vars(course).items() if k != "time_s"})
        found = simulate_heat(system, laws, day, time_s=[], step_s=3600.0, start_state=settled, method=method)
        # a Newton tolerance of 1e-7 and its square; implicit sums of some hundred K round
        np.testing.assert_allclose(found.end_state, settled, atol=1e-8 * (1 + np.abs(settled).max()), err_msg=method)


@given(data=st.data())
@settings(max_examples=20)
def test_what_heat_goes_in_comes_out_at_the_steady_state(data):
    network = data.draw(networks())
    laws = data.draw(laws_of(network))
    system = network.heat_system()
    settled = steady_state(system, laws, HELD)
    films = {"air": laws.films[0].still_w_per_m2_k + laws.films[0].speed_w_per_m2_k}
    out = sum(h * (system.film_loads[name] @ (settled - 20.0)) for name, h in films.items())
    heat = laws.heat[0].speed_w + laws.heat[0].turning_w + laws.heat[1].on_w
    # rounding of conductances up to 1e3 W/K times the temperatures
    assert out == pytest.approx(heat, rel=1e-9, abs=1e-9 * np.abs(settled).max())


def test_two_softening_lubricants_settle_together():
    laws = Laws(
        (
            HeatLaw("friction", speed_w=400.0, softening_per_k=0.03, at="spindle"),
            HeatLaw("friction", speed_w=900.0, softening_per_k=0.05, at="column"),
        ),
        (FilmLaw("walls", 8.0),),
    )
    system = PAIR.heat_system()
    spindle, column = steady_state(system, laws, HELD)
    heat = 400.0 * np.exp(-0.03 * (spindle - 20)) + 900.0 * np.exp(-0.05 * (column - 20))
    assert 12.0 * (column - 20.0) == pytest.approx(heat, rel=1e-9)  # Newton's last change squared
    assert 12.0 * (spindle - column) == pytest.approx(0.7 * heat, rel=1e-9)
