"""The thermal truth: heat that goes in is there or has left, steps are fine enough, what is off leaves no trace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from proving_ground.thermal.duty import STEP_S, STYLES, duty, speed_programme
from proving_ground.thermal.machine import Body, Heat, guessed, machine, temperatures
from proving_ground.thermal.scene import Scene, Stage
from proving_ground.thermal.sources import growth, heating


def steady(n: int, level: float = 20.0) -> Heat:
    bath = np.full(n, level)
    still = np.ones(n)
    return Heat({}, {"hall": bath, "floor": bath}, {"hall": still, "floor": still})


def test_machine_in_a_steady_hall_stays_as_it_is():
    found = temperatures(machine(np.random.default_rng(1)).body, steady(400), 20.0, STEP_S, 2)
    assert found == pytest.approx(20.0, abs=1e-12)  # rounding


def test_heat_that_goes_in_stays_in_without_baths():
    body = machine(np.random.default_rng(2)).body
    n = 500
    heat = replace(
        steady(n),
        power_w={"front bearing": np.full(n, 60.0)},
        bath_factor=dict.fromkeys(("hall", "floor"), np.zeros(n)),
    )
    found = temperatures(body, heat, 20.0, STEP_S, 1)
    stored = (found[-1] - 20.0) @ body.capacity_j_per_k
    assert stored == pytest.approx(60.0 * STEP_S * (n - 1), rel=1e-10)  # rounding of 500 steps


def test_settled_machine_gives_to_its_baths_what_goes_in():
    body = machine(np.random.default_rng(3)).body
    n = 60_000  # 83 h: tens of the slowest time constant
    heat = replace(steady(n), power_w={"rear bearing": np.full(n, 40.0)})
    last = temperatures(body, heat, 20.0, STEP_S, 10)[-1] - 20.0
    given = last @ (body.film_w_per_k["hall"] + body.film_w_per_k["floor"])
    assert given == pytest.approx(40.0, rel=1e-3)  # e^-7 of a slowest time constant of about 12 h


def test_one_volume_cools_as_the_exponential_says():
    body = Body(np.array([4000.0]), np.zeros((0, 2), dtype=np.int64), np.zeros(0), {"hall": np.array([2.0])}, {})
    n = 800
    found = temperatures(body, Heat({}, {"hall": np.full(n, 10.0)}, {"hall": np.ones(n)}), 30.0, 5.0, 1)[:, 0]
    exact = 10.0 + 20.0 * np.exp(-5.0 * np.arange(n) / 2000.0)
    assert found == pytest.approx(exact, abs=0.01)  # Euler: half a step over τ of 20 K at t = τ is 0.009 K


def test_step_is_fine_enough_for_every_machine():
    assert min(machine(np.random.default_rng(seed)).body.quickest_s() for seed in range(60)) > 2.0 * STEP_S


def test_step_that_is_too_long_is_refused():
    with pytest.raises(ValueError, match="quickest volume"):
        temperatures(machine(np.random.default_rng(1)).body, steady(10), 20.0, 200.0, 1)


@pytest.mark.parametrize("style", STYLES)
def test_programmes_differ_by_seed_and_stay_within_speed(style):
    runs = [duty(np.random.default_rng(seed), "r1", style, 6.0, 8000.0) for seed in (1, 2)]
    assert all(run["speed"].min() >= 0.0 and run["speed"].max() <= 8000.0 for run in runs)
    assert runs[0]["speed"].max() > 0.3 * 8000.0
    assert not np.array_equal(runs[0]["speed"], runs[1]["speed"])


def test_unknown_programme_is_refused():
    with pytest.raises(ValueError, match="waltz"):
        speed_programme(np.random.default_rng(0), "waltz", 100, 8000.0)


def test_effects_that_are_off_leave_no_trace():
    stage = Stage(Scene((heating({"front bearing": 40.0}, 2.5),)), np.random.default_rng(4))
    for run in range(len(stage.duties)):
        assert all(not np.any(course) for course in stage.effect(0, run, 0.0).values())


def test_linear_effects_grow_with_their_size():
    stage = Stage(Scene((growth(2.0, {"Z": 1.0}),)), np.random.default_rng(4))
    once, twice = stage.effect(0, 1, 1.0)["Z"], stage.effect(0, 1, 2.0)["Z"]
    assert twice == pytest.approx(2.0 * once)
    assert not np.any(stage.effect(0, 1, 1.0)["Y"])


def test_a_body_with_values_that_are_a_little_wrong_is_off_by_as_much_and_no_more():
    body = machine(np.random.default_rng(5)).body
    drawn = [guessed(body, 0.05, np.random.default_rng(seed)) for seed in range(200)]
    for of in ("capacity_j_per_k", "conductance_w_per_k"):
        shares = np.array([getattr(one, of) / getattr(body, of) - 1.0 for one in drawn])
        assert np.abs(shares).max() <= 0.08 + 1e-12
        assert shares.std() == pytest.approx(0.05, rel=0.2)
    assert drawn[0].links is body.links
