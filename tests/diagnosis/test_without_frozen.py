"""Responses that freeze: named, and nothing is fitted to what stands still."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.frozen import frozen_responses
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel
from tests.diagnosis.made import RUNS, STEP_S, coloured, comparison

N = 360


def clean(seed=0):
    random = np.random.default_rng(seed)
    return comparison({name: 0.5 * coloured("white", 3 * N, random) for name in ("Z", "Y")})


def frozen_from(given, moments, name="Z", to=N):
    """The response stands at its reading of these moments, run by run (None: it goes on), up to sample `to`."""
    course = given.recorded[name].copy()
    for k, moment in enumerate(moments):
        if moment is not None:
            course[k * N + moment : k * N + to] = course[k * N + moment]
    return dataclasses.replace(given, recorded={**given.recorded, name: course})


def windows(answer):
    return sorted((e.acts[0], e.acts[1], e.acts[2]) for e in answer.effects if e.acts is not None)


def test_a_response_that_froze_in_every_run_is_found_and_left_out():
    moments = (100, 90, 110)
    dead = frozen_from(clean(), moments)
    answer = diagnosis(dead)
    assert answer.verdict == "data-fault"
    assert {(effect.id, effect.channel) for effect in answer.effects} == {("data.stuck", "Z")}
    assert windows(answer) == [
        (run, moment * STEP_S, (N - 1) * STEP_S) for run, moment in zip(RUNS, moments, strict=True)
    ]
    # the error is that of the living part, and no correction makes it worse
    assert answer.fit["Z"].heldout.rmse_after < 0.6
    assert np.array_equal(answer.comparison.recorded["Z"], dead.recorded["Z"])
    assert "error of Z" in answer.headline


def test_the_dead_part_does_not_touch_the_fit_of_the_rest():
    living = clean()
    answer = diagnosis(frozen_from(living, (150, 150, None)))
    assert answer.verdict == "data-fault"
    assert {effect.id for effect in answer.effects} == {"data.stuck"}
    held = answer.fit["Z"].heldout
    assert held.rmse_after == pytest.approx(held.rmse_before, rel=0.03)


def test_a_response_of_which_nothing_is_left_is_not_compared_any_further():
    answer = diagnosis(frozen_from(clean(), (12, 12, 12)))
    assert answer.verdict == "data-fault"
    assert [finding.where.channel for finding in answer.findings if finding.id == "not-compared"] == ["Z"]
    assert answer.fit["Z"].gap_closed is None
    assert answer.fit["Y"].heldout.noise_floor == pytest.approx(0.5, rel=0.1)


def test_where_nothing_is_left_of_any_response_the_frozen_readings_are_the_answer():
    dead = frozen_from(frozen_from(clean(), (12, 12, 12)), (12, 12, 12), "Y")
    answer = diagnosis(dead)
    assert answer.verdict == "data-fault"
    assert {(effect.id, effect.channel) for effect in answer.effects} == {("data.stuck", "Z"), ("data.stuck", "Y")}
    assert sorted(f.where.channel for f in answer.findings if f.id == "not-compared") == ["Y", "Z"]
    assert answer.headline


@pytest.mark.parametrize("is_back", [False, True])
def test_what_moves_on_from_where_it_rested_was_not_frozen(is_back):
    given, random = clean(), np.random.default_rng(3)
    course = given.simulated["Z"] + 0.5 * random.standard_normal(3 * N)
    for k in range(3):
        run = course[k * N : (k + 1) * N]
        run[100:300] = run[100]
        # back where it ought to be, or with a noise of its own from where it stood
        run[300:] = run[300:] if is_back else run[100] + 0.5 * np.r_[0.0, random.standard_normal(N - 301)]
    stood = dataclasses.replace(given, recorded={**given.recorded, "Z": course})
    found = [(fault.run, fault.from_s, fault.to_s) for fault in frozen_responses(stood)]
    leaps = [run for k, run in enumerate(RUNS) if abs(course[k * N + 300] - course[k * N + 299]) > 2.0]
    assert found == [(run, 100 * STEP_S, 299 * STEP_S) for run in leaps]
    assert len(leaps) == (2 if is_back else 0)


def test_what_has_arrived_while_a_poor_simulation_creeps_on_is_not_frozen():
    given, random = clean(), np.random.default_rng(5)
    course = given.simulated["Z"] + 0.5 * random.standard_normal(3 * N)
    span = float(np.ptp(given.simulated["Z"]))
    for k in range(3):
        run = course[k * N : (k + 1) * N]
        # the simulation is off by a wave as large as its movement, but hardly where the reading stands
        run[300:] += 0.5 * span * np.sin(np.arange(N - 300) / 9.0)
        run[100:300] = np.mean(run[100:300])
        run[300:] += run[299] - run[300]
    assert not frozen_responses(dataclasses.replace(given, recorded={**given.recorded, "Z": course}))


def test_what_starts_to_move_by_its_usual_step_was_at_rest_beside_a_poor_simulation():
    """An axis goes to and fro at one speed and rests once a run; a simulation that is late creeps on meanwhile."""
    given, random = clean(), np.random.default_rng(6)
    speed = np.tile(np.repeat([1.0, -1.0], 75), 3 * N // 150 + 1)[: 3 * N]
    for k in range(3):
        speed[k * N + 150 : k * N + 300 + 10 * k] = 0.0
    course = np.cumsum(speed) + 0.02 * random.standard_normal(3 * N) * (speed != 0.0)
    for k in range(3):
        rest = slice(k * N + 150, k * N + 300 + 10 * k)
        course[rest] = course[rest.start]
    late = lfilter([0.1], [1.0, -0.9], np.cumsum(speed))
    changed = {
        name: {**of, "Z": z}
        for name, of, z in (("recorded", given.recorded, course), ("simulated", given.simulated, late))
    }
    assert not frozen_responses(dataclasses.replace(given, **changed))


def test_a_reading_that_wakes_up_with_a_leap_was_frozen_beside_a_poor_simulation_too():
    given = clean()
    wave = np.tile(0.3 * np.ptp(given.simulated["Z"]) * np.sin(np.arange(N) / 9.0), 3)
    poor = dataclasses.replace(given, recorded={**given.recorded, "Z": given.recorded["Z"] + wave})
    (fault,) = frozen_responses(frozen_from(poor, (60, None, None), to=120))
    assert (fault.run, fault.from_s, fault.to_s) == (RUNS[0], 60 * STEP_S, 119 * STEP_S)


def test_equal_readings_while_the_simulation_hardly_moves_prove_no_frozen_sensor():
    """Means of readings on a coarse grid stand still now and then."""
    living = clean()
    course = living.simulated["Z"].copy()
    for k in range(3):
        rest = slice(k * N + 200, k * N + 215)
        course[rest] = np.linspace(course[rest.start], course[rest.start] + 0.02 * np.ptp(course), 15)
    slow = dataclasses.replace(living, simulated={**living.simulated, "Z": course})
    short = frozen_from(slow, (200, None, None), to=215)
    assert frozen_responses(short) == ()


def test_what_moves_on_from_where_it_stood_was_held_and_what_leaps_had_frozen():
    """Friction holds a pendulum while its simulation swings on."""
    living = clean()
    gone = 0.4 * np.ptp(living.simulated["Z"])
    steep = living.simulated["Z"].copy()
    steep[200:215] = steep[200] + np.linspace(0.0, gone, 15)
    held = frozen_from(living, (200, None, None), to=215)
    held = dataclasses.replace(held, simulated={**held.simulated, "Z": steep})
    assert frozen_responses(held) == ()
    leapt = held.recorded["Z"].copy()
    leapt[215:N] += gone
    (fault,) = frozen_responses(dataclasses.replace(held, recorded={**held.recorded, "Z": leapt}))
    assert (fault.id, fault.run, fault.to_s) == ("data.stuck", RUNS[0], 214 * STEP_S)


@pytest.mark.parametrize(
    ("reading", "until", "is_frozen"),
    [(0.02, 155, False), (0.4, 155, True), (0.0, 260, True)],
    ids=["rest", "frozen", "dead-for-a-cycle"],
)
def test_a_speed_that_stands_near_zero_is_at_rest_for_less_than_a_cycle(reading, until, is_frozen):
    random = np.random.default_rng(1)
    t = np.arange(400) * 1.0
    simulated = np.sin(2.0 * np.pi * t / 100.0)
    recorded = simulated + 0.01 * random.standard_normal(400)
    recorded[145:until] = reading
    asked = Comparison(
        runs=("r1",),
        starts=(0, 400),
        time_s=t,
        channels=(Channel("v", "velocity", "m/s"),),
        recorded={"v": recorded},
        simulated={"v": simulated},
        responses=("v",),
        held_out=t >= 300.0,
    )
    assert bool(frozen_responses(asked)) == is_frozen
