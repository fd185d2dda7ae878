"""Every thermal scenario makes a case, of the wanted strength, hidden as it says, the same from the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from proving_ground.scenarios import scenarios

SCENARIOS = scenarios(("thermal",))
EFFECTIVE = [one for one in SCENARIOS if one.kind not in ("clean", "miscalibrated")]
IDS = ("memory", "ambient", "coolant", "speed_heating", "second_source", "convection", "interaction", "instant_speed")
SEED = 3


def test_every_id_has_three_ways_to_be_hidden():
    names = [one.name for one in SCENARIOS]
    for id_ in IDS:
        assert sum(name.startswith(f"thermal.{id_}/") for name in names) >= 3
    assert len(names) == len(set(names))
    assert {one.kind for one in SCENARIOS} >= {"single", "several", "clean", "miscalibrated", "undecidable", "decoy"}


@pytest.mark.parametrize("one", SCENARIOS, ids=lambda one: one.name)
def test_a_case_is_whole_hidden_as_it_says_and_as_strong_as_was_wanted(one):
    case = one.build(SEED, 6.0 if one in EFFECTIVE else None)
    assert case.name == one.name
    assert case.kind == one.kind
    assert case.responses == ("Z", "Y")
    assert case.recording.runs == case.simulation.runs
    assert np.isfinite(case.recording.frame.to_numpy()).all()
    assert np.isfinite(case.simulation.frame.to_numpy()).all()
    assert bool(case.truth.effects) == (one in EFFECTIVE)
    assert set(case.truth.held_out) == {"Z", "Y"}
    assert [hidden for hidden in case.truth.concealed if not hidden.holds] == []
    if one in EFFECTIVE:
        factor = {"out-of-catalogue": 4.0}.get(one.kind, 1.0)
        assert case.truth.d_prime == pytest.approx(6.0 * factor, rel=0.05)  # what scale_for keeps is 0.01
        for errors in case.truth.held_out.values():
            # the oracle fits offset, gain and delay to noise: with AR(1) 0.85 and an extrapolated gain some per cent
            assert errors.oracle <= 1.25 * errors.noise_floor + 0.05


def test_same_seed_gives_the_same_case_and_another_another():
    one = next(one for one in SCENARIOS if one.name == "thermal.coolant/flow")
    first, second, other = one.build(5, 6.0), one.build(5, 6.0), one.build(6, 6.0)
    assert first.recording.frame.equals(second.recording.frame)
    assert first.simulation.frame.equals(second.simulation.frame)
    assert first.truth == second.truth
    assert len(first.recording.frame) != len(other.recording.frame) or not np.array_equal(
        first.recording.frame["Z"], other.recording.frame["Z"]
    )


@pytest.mark.parametrize("strength", [3.0, 12.0])
@pytest.mark.parametrize("name", ["thermal.convection/natural", "thermal.coolant/seldom", "thermal.memory/tail"])
def test_other_strengths_are_reached_too(name, strength):
    one = next(one for one in SCENARIOS if one.name == name)
    assert one.build(1, strength).truth.d_prime == pytest.approx(strength, rel=0.05)


def test_twins_differ_by_the_effect_alone():
    one = next(one for one in SCENARIOS if one.name == "thermal.second_source/feed")
    twin = next(one for one in SCENARIOS if one.name == "clean.thermal/off second_source/feed")
    case, off = one.build(2, 6.0), twin.build(2, None)
    for name in ("n", "f", "Tamb"):
        assert np.array_equal(case.recording.frame[name], off.recording.frame[name])
    difference = (case.recording.frame["Z"] - off.recording.frame["Z"]).to_numpy()
    assert np.any(difference)
    # both carry the same noise, or the difference of two readings of 0.4 to 0.8 µm of noise would be rough
    assert np.std(np.diff(difference)) < 0.02
    assert off.truth.effects == ()
    assert off.truth.verdicts == ("nothing-missing",)
