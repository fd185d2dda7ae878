"""Paths of forces in simulations that know an imbalance, or whose stiffness and damping were fitted to the machine."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.shapes.linear_response import LinearResponse, linear_responses, resonances_of, resonator
from selector.diagnosis.shapes.signals import rate
from selector.diagnosis.shapes.spectral_lines import Line, aligned
from selector.diagnosis.workflow import diagnosis
from tests.diagnosis.effects.concealed_truths import F1, Z1, comparison_of, structure
from tests.diagnosis.made import comparison

BACK_REACTION = effect_of("vibration.back_reaction")
IMBALANCE = effect_of("vibration.imbalance")
LINE = effect_of("vibration.line")
MODE = effect_of("vibration.mode")


def _shaken_and_turning(gain: float, imbalance: float) -> Comparison:
    """A resonance driven by a recorded force and by an imbalance that begins at another angle in every run."""
    rng = np.random.default_rng(5)
    b, a = resonator(40.0, 0.03, 1e-3)
    path = LinearResponse("F", gain * b[0], a, 0.0)
    runs = []
    for k in range(3):
        time = np.arange(1200) * 1e-3
        force = np.convolve(rng.normal(size=1200), np.ones(3), mode="same")
        rpm = 1500.0 + 1800.0 * time / time[-1] + 100.0 * k
        turned = 2 * np.pi * np.cumsum(rpm / 60.0) * 1e-3 + rng.uniform(0, 6.28)
        whole = force + imbalance * (rpm / 3000.0) ** 2 * np.cos(turned)
        alone = comparison_of([(time, {"F": force}, {"F": force})], {"F": "force"}, ("F",))
        moved = path.passed(alone, whole)
        runs.append((time, {"F": force, "n": rpm, "x": moved}, {"x": moved}))
    return comparison_of(runs, {"F": "force", "n": "spindle_speed", "x": "displacement"}, ("x",))


@pytest.mark.parametrize("imbalance", [0.0, 1.0, 30.0])
def test_an_imbalance_that_the_simulation_knows_does_not_hide_the_path_of_the_force(imbalance: float) -> None:
    (found,) = linear_responses(_shaken_and_turning(0.2, imbalance), "x")
    assert found.source == "F"
    # the angle is summed from the speed: an error of its rule is what is left
    assert found.misfit < 0.01
    assert found.static_gain == pytest.approx(0.2, rel=0.01)


def test_a_member_that_acts_back_is_seen_beside_a_stiffness_that_was_fitted_with_it() -> None:
    comparison = structure("back_reaction", noise=0.0)
    simulated, fitted = comparison.simulated["x1"], ~comparison.held_out
    b, a = resonator(F1, Z1, 1e-3)
    path = LinearResponse("F", b[0], a, 0.0)
    moved = np.column_stack([path.passed(comparison, v) for v in (simulated, rate(comparison, simulated))])
    difference = comparison.difference("x1")
    share = 0.02
    small = share * difference
    taken = np.linalg.lstsq(moved[fitted], small[fitted], rcond=None)[0]
    refitted = {"x1": simulated + moved @ taken, "x2": comparison.simulated["x2"]}
    recorded = dict(comparison.recorded) | {"x1": simulated + small}
    hidden = dataclasses.replace(comparison, simulated=refitted, recorded=recorded)
    target = hidden.difference("x1")[fitted]
    explained = {}
    for variant in BACK_REACTION.variants(hidden, "x1"):
        column = variant.columns[fitted]
        left = target - column @ np.linalg.lstsq(column, target, rcond=None)[0]
        kind = "fitted" in variant.names[0]
        explained[kind] = max(explained.get(kind, 0.0), 1.0 - float(left @ left / (target @ target)))
    print(explained)
    assert explained[True] > 0.9
    assert explained[True] > explained[False] + 0.2


def test_a_faint_line_is_offered_and_a_wandering_one_is_not() -> None:
    offered = {"steady": 0, "wandering": 0}
    for seed in range(12):
        rng = np.random.default_rng(seed)
        runs: dict[str, list] = {kind: [] for kind in offered}
        for _ in range(3):
            time = np.arange(1500) * 1e-3
            pitch = np.interp(time, np.linspace(0.0, 1.5, 8), rng.uniform(60.0, 130.0, 8))
            # as strong as d′ = 7 in two runs of white noise, and much stronger
            courses = {"steady": 0.18 * np.sin(2 * np.pi * 90.0 * time + rng.uniform(0, 6.28))}
            courses["wandering"] = 1.0 * np.sin(2 * np.pi * np.cumsum(pitch) * 1e-3)
            for kind, course in courses.items():
                swing = np.sin(2 * np.pi * 7.0 * time)
                runs[kind].append((time, {"x": swing + course + rng.normal(size=1500)}, {"x": swing}))
        for kind in offered:
            comparison = comparison_of(runs[kind], {"x": "displacement"}, ("x",))
            found = [v.shape["frequency_hz"].value for v in LINE.variants(comparison, "x")]
            offered[kind] += any(abs(f - 90.0) < 0.5 if kind == "steady" else 55.0 < f < 135.0 for f in found)
    assert offered["steady"] >= 9
    assert offered["wandering"] <= 3


def test_a_line_where_the_structure_rings_pays_more() -> None:
    comparison = _shaken_and_turning(1.0, 0.0)
    assert resonances_of(comparison, "x")[0] == pytest.approx((40.0, 0.03), rel=1e-3)
    prices = {}
    for tone in (40.0, 90.0):
        size = float(np.std(comparison.simulated["x"]))
        noise = 0.02 * size * np.random.default_rng(1).normal(size=len(comparison.time_s))
        line = 0.02 * size * np.sin(2 * np.pi * tone * comparison.time_s)
        recorded = dict(comparison.recorded) | {"x": comparison.simulated["x"] + line + noise}
        hidden = dataclasses.replace(comparison, recorded=recorded)
        offered = [v for v in LINE.variants(hidden, "x") if "phase" in v.names[0] and v.run is None]
        found = min(offered, key=lambda v: abs(v.shape["frequency_hz"].value - tone))
        assert found.shape["frequency_hz"].value == pytest.approx(tone, abs=0.1)
        prices[tone] = found.looked_at / tone
    assert prices[40.0] == pytest.approx(25.0 * prices[90.0], rel=0.01)


def test_imbalance_through_the_simulated_structure_needs_no_line_of_its_own() -> None:
    comparison = _shaken_and_turning(1.0, 0.0)
    noise = np.random.default_rng(1).normal(size=len(comparison.time_s)) * np.std(comparison.simulated["x"])
    hidden = dataclasses.replace(
        comparison, recorded=dict(comparison.recorded) | {"x": comparison.simulated["x"] + noise}
    )
    laws = [v.names[0].partition(", ")[2] for v in IMBALANCE.variants(hidden, "x")]
    assert laws.count("through the simulated structure") == 1


def test_a_phase_that_was_read_off_the_residual_is_paid_for() -> None:
    comparison = _shaken_and_turning(1.0, 0.0)
    noise = np.random.default_rng(1).normal(size=len(comparison.time_s)) * np.std(comparison.simulated["x"])
    hidden = dataclasses.replace(
        comparison, recorded=dict(comparison.recorded) | {"x": comparison.simulated["x"] + noise}
    )
    assert all(v.looked_at >= np.e for v in IMBALANCE.variants(hidden, "x"))


def test_a_mode_where_the_structure_rings_pays_more_and_every_mode_for_its_frequency() -> None:
    comparison = _shaken_and_turning(1.0, 0.0)
    prices = {}
    for hz in (40.0, 120.0):
        b, a = resonator(hz, 0.02, 1e-3)
        added = LinearResponse("F", b[0], a, 0.0).passed(comparison, comparison.recorded["F"])
        noise = 0.3 * np.std(added) * np.random.default_rng(1).normal(size=len(added))
        hidden = dataclasses.replace(
            comparison, recorded=dict(comparison.recorded) | {"x": comparison.simulated["x"] + added + noise}
        )
        offered = [v for v in MODE.variants(hidden, "x") if v.sources == ("F",)]
        found = min(offered, key=lambda v: abs(v.shape["frequency_hz"].value - hz))
        prices[hz] = found.looked_at
    assert prices[120.0] > 50.0
    assert prices[40.0] > 5.0 * prices[120.0]


def test_a_sharp_resonance_that_dominates_is_met_by_least_squares() -> None:
    comparison = _shaken_and_turning(1.0, 0.0)
    b, a = resonator(123.4, 0.004, 1e-3)
    ringing = LinearResponse("F", b[0], a, 0.0).passed(comparison, comparison.recorded["F"])
    hidden = dataclasses.replace(
        comparison, recorded=dict(comparison.recorded) | {"x": comparison.simulated["x"] + ringing}
    )
    rows, left = ~hidden.held_out, 1.0
    for shape in MODE.variants(hidden, "x"):
        columns = shape.columns[rows]
        rest = ringing[rows] - columns @ np.linalg.lstsq(columns, ringing[rows], rcond=None)[0]
        left = min(left, float(np.std(rest) / np.std(ringing[rows])))
    # of what was scanned alone 0.1 or more is left
    assert left < 0.03


def test_an_unseen_run_up_shows_its_phase_where_it_is_fast_enough():
    made = comparison({"Z": 0.05 * np.random.default_rng(2).standard_normal(1800)})
    size = np.where(np.arange(1800) % 600 < 300, 0.0, 1.0)
    turn = 0.9 * np.arange(1800) + np.repeat([0.0, 1.0, 2.5], 600)
    cosine, sine = size * np.cos(0.9 * np.arange(1800)), size * np.sin(0.9 * np.arange(1800))
    left = made.difference("Z") + size * np.cos(turn)
    found, _ = aligned(made, left, cosine, sine, Line(1.0, (0.0, 0.0, 0.0), 0.0), is_known=True)
    assert np.corrcoef(found[1500:], np.cos(turn)[1500:])[0, 1] > 0.99


@pytest.mark.parametrize("from_rest", [True, False])
def test_a_resonance_is_found_beside_a_simulation_that_follows_at_once(from_rest: bool) -> None:
    """Far above the resonance the machine does not follow, which is no other resonance."""
    rng = np.random.default_rng(7)
    b, a = resonator(2.0, 0.15, 0.01)
    path, runs = LinearResponse("u", b[0], a, 0.0), []
    for _ in range(3):
        levels = rng.uniform(0.0, 1.0, 10)
        pushed = np.repeat(np.r_[0.0, levels] if from_rest else 5.0 + levels, 200)
        time = 0.01 * np.arange(len(pushed))
        alone = comparison_of([(time, {"u": pushed}, {"u": pushed})], {"u": "voltage"}, ("u",))
        moved = path.passed(alone, pushed, settled=not from_rest) + 0.01 * rng.normal(size=len(pushed))
        runs.append((time, {"u": pushed, "x": moved}, {"x": pushed}))
    asked = comparison_of(runs, {"u": "voltage", "x": "displacement"}, ("x",))
    effect = diagnosis(asked).effects[0]
    assert effect.id == "vibration.mode"
    assert effect.parameters["frequency_hz"].value == pytest.approx(2.0, rel=0.05)


def test_what_an_axis_shakes_is_looked_for_in_an_accelerometer() -> None:
    time = 1e-3 * np.arange(400)
    run = (time, {"p": np.sin(20.0 * time), "a": np.sin(300.0 * time)}, {"a": 0.1 * np.sin(20.0 * time)})
    asked = comparison_of([run, run], {"p": "position_command", "a": "acceleration"}, ("a",))
    assert MODE.testable(asked, "a") is None
