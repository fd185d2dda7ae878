"""Every scenario of drives, readings, vibration, gauging and flow makes right cases of the wanted strength."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from proving_ground.concealment import d_prime, recalibration
from proving_ground.drive.decisions import UNDECIDABLE
from proving_ground.scenarios import scenarios
from proving_ground.world import _Strength
from tests.proving_ground import concealed

SEED = 5
FAMILIES = ("drive", "data", "vibration", "gauging", "flow")
SCENARIOS = [one for one in scenarios(FAMILIES) if one.family in FAMILIES]
EACH = pytest.mark.parametrize("one", SCENARIOS, ids=lambda one: one.name)
MANY_WAYS = {
    "drive": (
        "coulomb asymmetric_friction stribeck viscous backlash elasticity varying_stiffness varying_damping "
        "pitch_error ripple delay saturation offset_force mass"
    ),
    "data": "clock gain zero drift stuck step swapped",
    "vibration": "line imbalance mode back_reaction hardening hysteresis",
    "gauging": "lag wear interrupted",
    "flow": "overflow",
}


@cache
def case_of(name):
    return concealed.build(next(one for one in SCENARIOS if one.name == name), SEED)


def test_every_id_is_hidden_in_two_ways():
    names = [one.name for one in SCENARIOS]
    assert len(names) == len(set(names))
    for family, ids in MANY_WAYS.items():
        for word in ids.split():
            assert sum(name.startswith(f"{family}.{word}/") for name in names) >= 2, word
    kinds = {one.kind for one in SCENARIOS}
    assert kinds >= {"single", "several", "clean", "miscalibrated", "data", "undecidable", "out-of-catalogue"}


@EACH
def test_case(one):
    case = case_of(one.name)
    concealed.assert_whole(one, case)
    concealed.assert_labelled(one, case)
    concealed.assert_hidden(case)
    concealed.assert_strong(one, case)
    concealed.assert_oracle_near_noise(case)


@pytest.mark.parametrize("name", ["drive.stribeck/rare", "data.stuck/input", "vibration.mode/between"])
def test_same_seed_same_case(name):
    one = next(one for one in SCENARIOS if one.name == name)
    concealed.assert_same(concealed.build(one, SEED), case_of(name))
    again = concealed.build(one, SEED + 1)
    assert not again.recording.frame.equals(case_of(name).recording.frame)


@pytest.mark.parametrize("name", ["drive.backlash/small", "data.clock/rate"])
def test_twin_has_the_same_machine_and_noise(name):
    one = next(one for one in SCENARIOS if one.name == name)
    family, _, rest = name.partition(".")
    twin = next(other for other in SCENARIOS if other.name == f"clean.{family}/off {rest}")
    off, on = twin.build(SEED, None), case_of(one.name)
    assert off.truth.effects == ()
    assert off.simulation.frame.equals(on.simulation.frame)
    for response in on.responses:
        gap = on.recording.frame[response] - off.recording.frame[response]
        # only the effect is between them, which is far below the noise of a sample
        assert np.std(gap) < np.std(off.recording.frame[response] - off.recording.frame[response].mean())
        assert np.std(gap) < 2.0 * off.truth.held_out[response].noise_floor
    other = off.recording.frame["v" if "v" in off.recording.names else "T1"]
    assert np.allclose(other, on.recording.frame[other.name], atol=1e-3)


@pytest.mark.parametrize("wanted", [3.0, 12.0])
@pytest.mark.parametrize("name", ["drive.saturation/current", "flow.overflow/upper", "hidden.drive/floor-shocks"])
def test_weak_and_strong(name, wanted):
    one = next(one for one in SCENARIOS if one.name == name)
    concealed.assert_strong(one, concealed.build(one, SEED, wanted), wanted)


def test_strength_is_that_of_the_definition():
    drive = next(drive for drive in UNDECIDABLE if drive.plan.name == "undecidable.drive/one-speed")
    world = drive.made(np.random.default_rng(SEED))
    strength = _Strength(world)
    courses = strength.effect(0.3)
    nuisances = {
        name: recalibration(strength.off.simulated[name], strength.time_s, strength.starts) for name in courses
    }
    expected = d_prime(courses, world.noise, nuisances, strength.starts)
    assert strength.detected(courses) == pytest.approx(expected, rel=1e-9)  # the same sums in another order
