"""Structures, grinders, stores and readings of the proving ground behave as their physics says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from proving_ground.data import faults
from proving_ground.flow.reservoirs import FINE_S, stores
from proving_ground.gauging.batches import ground_sizes, read_course
from proving_ground.vibration.structure import STEP_S, Structure, given_swing, true_swing

HALF = 0.5 * STEP_S * np.arange(4001)


def tone(hz, newton):
    return newton * np.sin(2 * np.pi * hz * HALF)


def test_hardening_spring_is_that_of_another_solver():
    structure = Structure(hardening_per_m2=2e10)
    force = tone(60.0, 30.0)

    def rates(time, x):
        y, v = x
        pull = structure.stiffness_n_per_m * y * (1 + structure.hardening_per_m2 * y**2)
        return v, (30.0 * np.sin(2 * np.pi * 60.0 * time) - pull - structure.damping_ns_per_m * v) / structure.mass_kg

    times = HALF[:-1:2]
    expected = solve_ivp(rates, (0.0, times[-1]), (0.0, 0.0), t_eval=times, rtol=1e-9, atol=1e-15).y[0]
    # fourth order with 12 rad/s·step of 0.05: far below noise of 0.05 µm on 3 µm
    assert true_swing(structure, force)[:, 0] == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("back", [0.0, 1.0])
def test_linear_simulation_is_the_true_structure_without_effects(back):
    structure = Structure(back=back, mode_kg=400.0)
    force = tone(45.0, 20.0) + tone(120.0, 10.0)
    true, given = true_swing(structure, force), given_swing(structure, force)
    # the simulation takes the force as straight between steps: (ωh)²/12 of the highest tone, which is 5e-4
    assert np.abs(true[:, :2] - given[:, :2]).max() < 1e-3 * np.abs(true[:, :2]).max()


def test_sliders_hold_no_more_than_their_limits():
    stiff = Structure(sliders_n_per_m=2e6, slip_m=1e-6)
    still = np.zeros_like(HALF)
    slow = 40.0 * np.minimum(HALF / HALF[-1] * 4.0, 1.0)
    bent = true_swing(stiff, slow)[-1, 0]
    shares, reach = np.array([0.3, 0.25, 0.2, 0.15, 0.1]), np.array([0.3, 0.6, 1.0, 1.5, 2.2])
    held = np.sum(2e6 * shares * np.minimum(reach * 1e-6, bent))
    # what swings is left is damped out within the run to some per cent
    assert bent == pytest.approx((40.0 - held) / stiff.stiffness_n_per_m, rel=0.05)
    assert not true_swing(stiff, still).any()


@pytest.mark.parametrize("feed", [5.0, 8.0])
def test_lag_costs_feed_times_delay(feed):
    one = np.ones(1)
    size = ground_sizes(80.0 * one, feed * one, 0.12, 0.0 * one)[0]
    # the wheel has settled to the fine feed long before; half a step of 4 ms
    assert size == pytest.approx(-feed * 0.12, abs=feed * 0.004)


def test_perfect_gauge_stops_at_the_target():
    one = np.ones(3)
    assert ground_sizes(np.array([60.0, 80.0, 110.0]), 6.0 * one, 0.0, 0.0 * one) == pytest.approx(0.0)


def test_grooves_stop_early_and_by_less_than_their_depth():
    many = np.ones(50)
    sizes = ground_sizes(np.linspace(60.0, 110.0, 50), 6.0 * many, 0.0, 3.0 * many)
    assert np.all(sizes > 0.5)
    assert np.all(sizes <= 3.0)
    assert np.std(sizes) < 0.2 * np.mean(sizes)  # the groove that stops it comes 23 times a second


def test_reading_lags_behind_the_part():
    part, read = (read_course(80.0, 6.0, lag, 500, 0.02) for lag in (0.0, 0.1))
    fine = slice(220, 260)
    # two lags in a row: their sum once settled, less at most a step of 4 ms, and what is left of the coarse feed
    assert read[fine] - part[fine] == pytest.approx(0.1 * 6.0, rel=0.06)


def test_stores_lose_nothing_but_what_spills():
    made = stores(np.random.default_rng(3))
    free = made.levels(0, every_s=FINE_S)
    inflow = made.pump * made.pumps[0]
    out = made.outlets[1] * np.sqrt(free[:, 1])
    kept = free.sum(axis=1) - free.sum(axis=1)[0]
    # rectangles of 0.2 s against the midpoint rule, over an hour
    assert kept[-1] == pytest.approx(FINE_S * float(np.sum(inflow - out)), abs=0.02)
    edge = float(np.quantile(free[:, 0], 0.9))
    spilled = made.levels(0, (edge, 1e9), every_s=FINE_S)
    assert spilled[:, 0].max() == pytest.approx(edge)
    assert np.all(spilled[:, 0] <= free[:, 0] + 1e-9)


def test_coarse_steps_of_the_simulation_are_fine_enough():
    made = stores(np.random.default_rng(4))
    # against noise of 20 mV
    assert np.abs(made.levels(1) - made.levels(1, coarse=4)).max() < 2e-3


def test_faults_do_what_their_names_say():
    time = np.arange(0.0, 100.0)
    course = 0.1 * time
    late = faults.late(100.0, 2.0, 40.0).reading(time, course, 1.0)
    assert late[:40] == pytest.approx(course[:40])
    assert late[50] == pytest.approx(course[48])
    assert faults.slow(100.0, 5.0).reading(time, course, 1.0)[-1] == pytest.approx(course[-1] * 0.95)
    assert faults.stretched(100.0, 0.1).reading(time, course, 2.0) == pytest.approx(1.2 * course)
    drift = faults.running_away(100.0, 3.0, 40.0).reading(time, course, 1.0) - course
    assert drift[:41] == pytest.approx(0.0)
    assert drift[70] == pytest.approx(1.5)
    frozen = faults.frozen(100.0, 10.0, 30.0)
    held = frozen.reading(time, course, 2.0)
    assert frozen.to_s(2.0) == 50.0
    assert held[30:50] == pytest.approx(course[30])
    assert held[50:] == pytest.approx(course[50:])
