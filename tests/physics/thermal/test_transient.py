from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from selector.errors import InputError
from selector.physics.thermal.network.heat_system import Conditions, FilmLaw, HeatLaw, HeatSystem, Laws, Network
from selector.physics.thermal.network.transient import simulate_heat
from tests.physics.thermal.drawn_networks import courses, laws_of, networks
from tests.physics.thermal.heat_balances import rates

HEADSTOCK = Network(
    {"bearing": 2000.0, "housing": 30000.0, "column": 2e5},
    [("bearing", "housing", 20.0), ("housing", "column", 15.0)],
    {"walls": {"housing": 0.5, "column": 2.0}},
    {"friction": {"bearing": 1.0}},
    {"bearing": {"Z": 1.0}, "housing": {"Z": 3.0}, "column": {"Z": -1.0}},
)
FRICTION = HeatLaw("friction", speed_w=100.0, exponent=1.5)
SOFTENING = dataclasses.replace(FRICTION, softening_per_k=0.02, at="bearing")
WALLS = FilmLaw("walls", 10.0, 2.0, exponent=0.7)
SHIFT = Conditions([0.0, 3600.0, 7200.0, 10800.0], spindle_speed=[1000.0, 3000.0, 0.0, 0.0], ambient_degc=21.0)


def history(heat, conditions=SHIFT, *, time_s=(0.0, 1800.0, 3600.0, 3700.0, 10800.0), step_s=10.0, **options):
    options = {"start_degc": 22.0} | options
    system = HEADSTOCK.heat_system()
    return simulate_heat(system, Laws((heat,), (WALLS,)), conditions, time_s=time_s, step_s=step_s, **options)


def one_node():
    return Network({"block": 5000.0}, area_m2={"air": {"block": 0.5}}, shares={"heater": {"block": 1.0}})


def test_one_node_warms_with_one_exponential():
    laws = Laws((HeatLaw("heater", on_w=100.0),), (FilmLaw("air", 20.0),))
    at = np.array([0.0, 1.0, 60.0, 500.0, 5000.0])
    found = simulate_heat(
        one_node().heat_system(), laws, Conditions([0.0, 5000.0]), time_s=at, step_s=1e9, start_degc=20.0
    )
    tau_s, steady_k = 5000.0 / (20.0 * 0.5), 100.0 / (20.0 * 0.5)
    # closed form; a few roundings of 30 °C
    np.testing.assert_allclose(found.probe_degc[:, 0], 20 + steady_k * (1 - np.exp(-at / tau_s)), rtol=1e-14)


def test_two_nodes_follow_their_closed_form():
    c1, c2, g, h = 800.0, 20000.0, 12.0, 6.0
    network = Network({"a": c1, "b": c2}, [("a", "b", g)], {"air": {"b": 1.0}}, {"q": {"a": 1.0}})
    laws = Laws((HeatLaw("q", on_w=50.0),), (FilmLaw("air", h),))
    at = np.linspace(0, 20000, 41)
    found = simulate_heat(
        network.heat_system(), laws, Conditions([0.0, 20000.0]), time_s=at, step_s=10.0, start_degc=20.0
    )
    # λ² − (g/c1 + (g + h)/c2)·λ + g·h/(c1·c2) = 0, then the amplitudes of both exponentials from start and first slope
    total, product = g / c1 + (g + h) / c2, g * h / (c1 * c2)
    fast = 0.5 * (total + np.sqrt(total**2 - 4 * product))
    slow = product / fast
    steady = np.array([50 / h + 50 / g, 50 / h])
    slope = np.array([50 / c1, 0.0])
    on_slow = (slope - fast * steady) / (fast - slow)
    on_fast = -steady - on_slow
    rise = steady + np.exp(-np.outer(at, [slow])) * on_slow + np.exp(-np.outer(at, [fast])) * on_fast
    np.testing.assert_allclose(found.probe_degc - 20, rise, atol=1e-12)  # roundings of 20 °C


@given(data=st.data())
@settings(max_examples=30)
def test_energy_closes_for_any_machine_with_the_exact_stepper(data):
    network = data.draw(networks())
    laws = data.draw(laws_of(network, softening=data.draw(st.booleans())))
    conditions = data.draw(courses())
    found = simulate_heat(
        network.heat_system(), laws, conditions, time_s=[0.0], step_s=200.0, start_degc=20.0, method="exact"
    )
    # promised: 1e-9 of the turnover. The floor: machines that exchange next to nothing; rounding of 1e7 J/K
    assert abs(found.balance.missing_j) <= 1e-9 * found.balance.turnover_j + 1e-6


@given(data=st.data())
@settings(max_examples=30)
def test_energy_closes_for_any_machine_with_the_implicit_stepper(data):
    network = data.draw(networks())
    laws = data.draw(laws_of(network, softening=data.draw(st.booleans())))
    conditions = data.draw(courses())
    found = simulate_heat(
        network.heat_system(), laws, conditions, time_s=[0.0], step_s=100.0, start_degc=20.0, method="implicit"
    )
    # the sums of the steps balance whatever the step; what is left is the solver's rounding, added up over the steps
    assert abs(found.balance.missing_j) <= 1e-10 * found.balance.turnover_j + 1e-6


def test_every_joule_of_the_balance_is_the_integral_that_it_is_called():
    at = np.arange(0.0, 10800.5, 1.0)
    found = history(FRICTION, time_s=at)
    rise = found.probe_degc - 21.0
    speed = SHIFT.spindle_speed[np.clip(np.searchsorted(SHIFT.time_s, at, "right") - 1, 0, 2)]
    film = 10.0 + 2.0 * (speed / 1000.0) ** 0.7
    to_air = [
        np.trapezoid(film[a] * (rise[a : b + 1] @ [0.0, 0.5, 2.0]), at[a : b + 1])
        for a, b in ((0, 3600), (3600, 7200), (7200, 10800))
    ]
    # the trapezoidal rule with 1 s in 93 s: 1/12·(1/93)² where temperature bends most
    assert found.balance.films_j["walls"] == pytest.approx(sum(to_air), rel=1e-5)
    assert found.balance.sources_j["friction"] == pytest.approx(3600 * 100.0 * (1 + 3**1.5), rel=1e-12)
    capacities = [2000.0, 30000.0, 2e5]
    assert found.balance.stored_j == pytest.approx((found.end_state - 22.0) @ capacities, rel=1e-9)


@given(data=st.data())
@settings(max_examples=30)
def test_nothing_gets_warmer_than_what_warms_it(data):
    """Maximum principle: without heat, temperatures stay between the coldest and the warmest of start and fluids."""
    network, conditions = data.draw(networks()), data.draw(courses(quiet=True))
    laws = data.draw(laws_of(network))
    start = np.array([data.draw(st.floats(0, 60)) for _ in network.heat_capacity_j_per_k])
    at = np.linspace(0, conditions.time_s[-1], 50)
    found = simulate_heat(
        network.heat_system(), laws, conditions, time_s=at, step_s=100.0, start_state=start, method="exact"
    )
    bounds = np.r_[start, conditions.ambient_degc, conditions.coolant_degc]
    # rounding of 60 °C through a badly scaled capacity matrix (1e5)
    assert found.probe_degc.min() >= bounds.min() - 1e-9
    assert found.probe_degc.max() <= bounds.max() + 1e-9


@given(data=st.data())
@settings(max_examples=20)
def test_heat_cools_nothing(data):
    """Positivity: with sources on, no node is ever colder than in the same run without them."""
    network, conditions = data.draw(networks()), data.draw(courses())
    laws = data.draw(laws_of(network))
    at = np.linspace(0, conditions.time_s[-1], 30)
    options = {"time_s": at, "step_s": 100.0, "start_degc": 20.0, "method": "exact"}
    warm = simulate_heat(network.heat_system(), laws, conditions, **options)
    cold = simulate_heat(network.heat_system(), dataclasses.replace(laws, heat=()), conditions, **options)
    # rounding relative to the temperatures reached (some thousand °C in small nodes)
    assert (warm.probe_degc - cold.probe_degc).min() >= -1e-11 * np.abs(warm.probe_degc).max()


@given(data=st.data())
@settings(max_examples=20)
def test_reciprocity_at_every_instant(data):
    """1 W in node i warms node j as 1 W in node j warms node i, at every time."""
    network = data.draw(networks())
    names = list(network.heat_capacity_j_per_k)
    pair = [data.draw(st.sampled_from(names)) for _ in range(2)]
    shares = {f"in {k}": {name: 1.0} for k, name in enumerate(pair)}
    system = dataclasses.replace(network, shares=shares).heat_system()
    films = (FilmLaw("air", 8.0),)
    at = [1.0, 30.0, 1000.0, 50000.0]
    rise = [
        simulate_heat(
            system,
            Laws((HeatLaw(f"in {k}", on_w=1.0),), films),
            Conditions([0.0, 50000.0]),
            time_s=at,
            step_s=10.0,
            start_degc=20.0,
        ).probe_degc[:, names.index(pair[1 - k])]
        - 20.0
        for k in range(2)
    ]
    # rounding of 20 °C
    np.testing.assert_allclose(rise[0], rise[1], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("method", ["exact", "implicit"])
def test_agrees_with_the_general_solver_that_shares_no_code_with_the_steppers(method):
    system, laws = HEADSTOCK.heat_system(), Laws((SOFTENING,), (WALLS,))
    expected = [np.full(3, 22.0)]
    for begin, end, speed in zip(SHIFT.time_s[:-1], SHIFT.time_s[1:], SHIFT.spindle_speed[:-1], strict=True):
        held = Conditions([0.0, 1.0], spindle_speed=speed, ambient_degc=21.0)
        rate = partial(rates, system, laws, held)
        course = solve_ivp(lambda t, x, rate=rate: rate(x), (begin, end), expected[-1], "LSODA", rtol=1e-10, atol=1e-10)
        expected.append(course.y[:, -1])
    found = history(SOFTENING, time_s=SHIFT.time_s, step_s=2.0, method=method)
    # both steppers: second order with 2 s in time constants of 93 s and up
    np.testing.assert_allclose(found.probe_degc, expected, atol=1e-4)
    np.testing.assert_allclose(found.displacement_um[:, 0], (np.array(expected) - 20.0) @ [1.0, 3.0, -1.0], atol=3e-4)


def test_agrees_with_the_matrix_exponential():
    system, laws = HEADSTOCK.heat_system(), Laws((FRICTION,), (WALLS,))
    at, start = np.linspace(0, 7200, 25), np.full(3, 22.0)
    conditions = Conditions([0.0, 7200.0], spindle_speed=1500.0, ambient_degc=21.0)
    found = simulate_heat(system, laws, conditions, time_s=at, step_s=10.0, start_degc=22.0)
    rate = rates(system, laws, conditions, start)
    # without softening the rates are linear, and differences of them exact
    slopes = np.column_stack([rates(system, laws, conditions, start + one) - rate for one in np.eye(3)])
    settled = -np.linalg.solve(slopes, rate)
    rise = [settled - expm(slopes * t) @ settled for t in at]
    # rounding of rates at 22 °C, summed over 7200 s
    np.testing.assert_allclose(found.probe_degc - 22.0, rise, atol=1e-9)


@pytest.mark.parametrize("method", ["exact", "implicit"])
def test_second_order_in_the_step(method):
    finest = history(SOFTENING, step_s=0.5, method="exact").probe_degc
    errors = [np.abs(history(SOFTENING, step_s=step, method=method).probe_degc - finest).max() for step in (20, 10, 5)]
    ratios = np.array(errors[:-1]) / errors[1:]
    # second order quarters; third order terms still count at 20 s against the quickest 93 s
    assert (ratios > 3.2).all()
    assert (ratios < 5.5).all()


def test_without_heat_that_depends_on_temperature_the_step_does_not_matter():
    coarse, fine = history(FRICTION, step_s=1e6), history(FRICTION, step_s=1.0)
    # one step an interval in both
    np.testing.assert_array_equal(coarse.probe_degc, fine.probe_degc)


@pytest.mark.parametrize("heat", [FRICTION, SOFTENING])
@pytest.mark.parametrize("method", ["exact", "implicit"])
def test_readings_do_not_depend_on_which_others_are_asked_for(heat, method):
    at = np.array([0.0, 3.0, 17.3, 3599.0, 3600.0, 3601.5, 9000.0, 10800.0])
    every = history(heat, time_s=at, method=method)
    for k, moment in enumerate(at):
        alone = history(heat, time_s=[moment], method=method)
        np.testing.assert_allclose(alone.probe_degc[0], every.probe_degc[k], rtol=1e-13)  # order of summation
    kept = history(heat, time_s=[], keep_states_at_s=at, method=method)
    np.testing.assert_allclose(kept.states, every.probe_degc, rtol=1e-13)  # the probes of a network are its states
    assert kept.probe_degc.shape == (0, 3)


def test_between_implicit_steps_the_readings_stay_of_second_order():
    at = np.arange(0.0, 10800.0, 3.7)
    exact = history(FRICTION, time_s=at).probe_degc
    errors = [
        np.abs(history(FRICTION, time_s=at, step_s=step, method="implicit").probe_degc - exact).max()
        for step in (20.0, 10.0, 5.0)
    ]
    assert errors[2] < 0.02  # K, of 30 K
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


def test_steps_far_longer_than_the_quickest_time_constant_do_not_ring():
    network = Network({"tip": 1.0, "body": 1e5}, [("tip", "body", 50.0)], {"air": {"body": 1.0}})
    found = simulate_heat(
        network.heat_system(), Laws((), (FilmLaw("air", 10.0),)), Conditions([0.0, 6000.0]),
        time_s=np.arange(0.0, 6001.0, 100.0), step_s=100.0, start_state=[80.0, 20.0], method="implicit",
    )  # fmt: skip
    # 5000 time constants a step: what is left of 60 K after a step of an L-stable method is of the order of 1/5000
    assert np.abs(found.probe_degc[1:, 0] - 20.0).max() < 0.1


def test_a_run_goes_on_where_the_run_before_ended():
    whole = history(SOFTENING, time_s=[7200.0, 10800.0])
    first = history(SOFTENING, Conditions([0.0, 3600.0], spindle_speed=1000.0, ambient_degc=21.0), time_s=[])
    rest = dataclasses.replace(SHIFT, **{name: getattr(SHIFT, name)[1:] for name in vars(SHIFT)})
    second = history(SOFTENING, rest, time_s=[7200.0, 10800.0], start_degc=None, start_state=first.end_state)
    np.testing.assert_allclose(second.probe_degc, whole.probe_degc, rtol=1e-12)  # another datum: rounding


def test_rows_that_change_nothing_change_nothing():
    fine = np.arange(0.0, 10801.0, 60.0)
    speed = SHIFT.spindle_speed[np.clip(np.searchsorted(SHIFT.time_s, fine, "right") - 1, 0, 2)]
    same = Conditions(fine, spindle_speed=speed, ambient_degc=21.0)
    np.testing.assert_array_equal(history(SOFTENING, same).probe_degc, history(SOFTENING).probe_degc)


def test_displacement_counts_from_the_reference_temperature():
    cold = history(FRICTION, Conditions([0.0, 10.0], ambient_degc=25.0), time_s=[0.0, 10.0], start_degc=25.0)
    np.testing.assert_allclose(cold.displacement_um[:, 0], 5.0 * (1 + 3 - 1), rtol=1e-13)  # rounding
    zero = history(
        FRICTION, Conditions([0.0, 10.0], ambient_degc=25.0), time_s=[0.0], start_degc=25.0, reference_degc=25.0
    )
    assert zero.displacement_um[0, 0] == 0.0


def test_switched_off_terms_leave_the_simpler_machine():
    plain = history(FRICTION).probe_degc
    at_zero = dataclasses.replace(FRICTION, softening_per_k=0.0, at="bearing", torque_share=0.3, coolant_w=80.0)
    np.testing.assert_array_equal(history(at_zero).probe_degc, plain)
    # a lubricant that hardly softens is the limit of one that does not: 1e-9 of 100 W per K
    nearly = dataclasses.replace(SOFTENING, softening_per_k=1e-9)
    np.testing.assert_allclose(history(nearly, step_s=5.0).probe_degc, plain, atol=1e-5)
    # a washed surface without coolant is a dry one
    washed = dataclasses.replace(HEADSTOCK, area_m2={**HEADSTOCK.area_m2, "wash": {"column": 1.0}})
    dry = simulate_heat(
        washed.heat_system(), Laws((FRICTION,), (WALLS, FilmLaw("wash", 500.0, while_coolant=True, fluid="coolant"))),
        SHIFT, time_s=[0.0, 1800.0, 3600.0, 3700.0, 10800.0], step_s=10.0, start_degc=22.0,
    )  # fmt: skip
    np.testing.assert_array_equal(dry.probe_degc, plain)


def test_laws_of_one_source_and_of_one_film_add_up():
    halves = tuple(dataclasses.replace(FRICTION, speed_w=w) for w in (30.0, 70.0))
    films = tuple(dataclasses.replace(WALLS, still_w_per_m2_k=h, speed_w_per_m2_k=1.0) for h in (4.0, 6.0))
    split = simulate_heat(
        HEADSTOCK.heat_system(), Laws(halves, films), SHIFT, time_s=[3600.0, 10800.0], step_s=10.0, start_degc=22.0
    )
    whole = history(FRICTION, time_s=[3600.0, 10800.0])
    np.testing.assert_allclose(split.probe_degc, whole.probe_degc, rtol=1e-12)  # order of summation
    assert split.balance.sources_j["friction"] == pytest.approx(whole.balance.sources_j["friction"], rel=1e-12)
    assert split.balance.films_j["walls"] == pytest.approx(whole.balance.films_j["walls"], rel=1e-10)


def test_a_film_may_meet_another_fluid_while_coolant_runs():
    both = Laws((), (FilmLaw("walls", 10.0), FilmLaw("walls", 300.0, while_coolant=True, fluid="coolant")))
    on = simulate_heat(
        HEADSTOCK.heat_system(), both,
        Conditions([0.0, 1e7], coolant_on=1.0, coolant_degc=15.0, ambient_degc=25.0),
        time_s=[1e7], step_s=10.0, start_degc=20.0,
    )  # fmt: skip
    expected = (10 * 25 + 300 * 15) / 310
    np.testing.assert_allclose(on.probe_degc, expected, rtol=1e-9)  # e^(−1e7 s/9000 s) and rounding


def bar(nodes):
    """An iron bar as finite volumes: sparse, and its twin as dense matrices."""
    conduction = sparse.diags_array(
        [np.r_[1.0, np.full(nodes - 2, 2.0), 1.0], -np.ones(nodes - 1), -np.ones(nodes - 1)], offsets=[0, 1, -1]
    )
    area = np.full(nodes, 0.4 / nodes)
    parts = {
        "film_loads": {"air": area},
        "sources": {"end": np.eye(1, nodes, 0)[0]},
        "probes": {"near": np.eye(1, nodes, 3)[0], "far": np.eye(1, nodes, nodes - 1)[0]},
        "displacements": {"length": np.full(nodes, 11.0 / nodes)},
        "uniform": np.ones(nodes),
    }
    capacity, film = sparse.diags_array(np.full(nodes, 3.0e4 / nodes)), sparse.diags_array(area)
    k = 0.05 * nodes * conduction
    return (
        HeatSystem(sparse.csr_array(capacity), sparse.csr_array(k), {"air": sparse.csr_array(film)}, **parts),
        HeatSystem(capacity.toarray(), k.toarray(), {"air": film.toarray()}, **parts),
    )


def test_large_sparse_bodies_are_stepped_implicitly_and_rightly():
    large, twin = bar(400)
    laws = Laws((HeatLaw("end", speed_w=50.0),), (FilmLaw("air", 10.0, 5.0),))
    conditions = Conditions([0.0, 1800.0, 3600.0, 5400.0], spindle_speed=[1000.0, 0.0, 2000.0, 0.0])
    at = np.arange(0.0, 5401.0, 60.0)
    found = simulate_heat(large, laws, conditions, time_s=at, step_s=10.0, start_degc=20.0)
    exact = simulate_heat(twin, laws, conditions, time_s=at, step_s=10.0, start_degc=20.0)
    assert (found.method, exact.method) == ("implicit", "exact")
    peak = np.ptp(exact.probe_degc[:, 0])
    # 10 s, a step load on a bar whose quickest modes take 0.01 s
    np.testing.assert_allclose(found.probe_degc, exact.probe_degc, atol=2e-3 * peak)
    np.testing.assert_allclose(found.displacement_um, exact.displacement_um, atol=1e-3)
    assert found.balance.missing_share < 1e-11  # the solver's rounding
    assert exact.balance.missing_share < 1e-9  # promised


def test_films_that_never_repeat_are_stepped_implicitly():
    """A ramp of speed gives every second its own film coefficients; eigenmodes for all of them would take minutes."""
    rng = np.random.default_rng(1)
    n = 60
    matrix = rng.uniform(0, 1, (n, n))
    links = np.triu(matrix, 1) + np.triu(matrix, 1).T
    area = np.full(n, 0.05)
    system = HeatSystem(
        np.diag(rng.uniform(500, 5000, n)), np.diag(links.sum(axis=1)) - links, {"air": np.diag(area)}, {"air": area},
        {"q": np.eye(n)[0]}, {"T": np.eye(n)[0]}, {}, np.ones(n),
    )  # fmt: skip
    at = np.arange(0.0, 3601.0, 1.0)
    conditions = Conditions(at, spindle_speed=at)
    laws = Laws((HeatLaw("q", speed_w=100.0),), (FilmLaw("air", 10.0, 10.0),))
    found = simulate_heat(system, laws, conditions, time_s=at[::60], step_s=10.0, start_degc=20.0)
    assert found.method == "implicit"
    exact = simulate_heat(
        system, laws, Conditions(at[:301], spindle_speed=at[:301]), time_s=at[:301:60], step_s=10.0,
        start_degc=20.0, method="exact",
    )  # fmt: skip
    np.testing.assert_allclose(found.probe_degc[:6], exact.probe_degc, atol=1e-4)  # 1 s steps of second order


def test_a_shift_of_a_reduced_model_is_stepped_exactly_at_every_sample():
    rng = np.random.default_rng(2)
    n = 100
    matrix = rng.uniform(0, 1, (n, n))
    links = np.triu(matrix, 1) + np.triu(matrix, 1).T
    area = rng.uniform(0, 0.1, n)
    system = HeatSystem(
        np.diag(10 ** rng.uniform(2, 5, n)), np.diag(links.sum(axis=1)) - links, {"air": np.diag(area)}, {"air": area},
        {"q": np.eye(n)[0]}, {f"T{k}": np.eye(n)[k] for k in range(37)}, {"Z": np.ones(n)}, np.ones(n),
    )  # fmt: skip
    changes = np.arange(0.0, 28801.0, 900.0)
    conditions = Conditions(changes, spindle_speed=rng.choice([0.0, 1000.0, 2000.0, 3000.0], len(changes)))
    laws = Laws((HeatLaw("q", speed_w=100.0, softening_per_k=0.02, at="T0"),), (FilmLaw("air", 10.0, 10.0),))
    # two seconds are promised for it: benchmarks/bench_promises.py
    found = simulate_heat(system, laws, conditions, time_s=np.arange(0.0, 28801.0, 10.0), step_s=10.0, start_degc=20.0)
    assert found.method == "exact"


def test_matrices_that_make_heat_on_the_way_are_refused():
    system = HEADSTOCK.heat_system()
    wrong = np.array(system.conduction)
    wrong[0, 1] *= 2
    with pytest.raises(ValueError, match=r"'conduction'.*symmetric"):
        simulate_heat(
            dataclasses.replace(system, conduction=wrong),
            Laws((), ()),
            SHIFT,
            time_s=[0.0],
            step_s=1.0,
            start_degc=20.0,
        )


@pytest.mark.parametrize(
    ("options", "found"),
    [
        ({"time_s": [0.0, 20000.0]}, "time_s reaches 20000 s"),
        ({"time_s": [-1.0]}, "time_s reaches -1 s"),
        ({"time_s": [5.0, 1.0]}, "runs backwards"),
        ({"keep_states_at_s": [float("nan")]}, "keep_states_at_s that is missing"),
    ],
)
def test_unusable_requests_are_refused(options, found):
    with pytest.raises(InputError, match=found):
        history(FRICTION, **options)
