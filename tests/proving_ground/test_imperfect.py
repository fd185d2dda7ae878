"""Cases whose simulation is a little wrong in a way that is nobody's, or whose clocks are uneven."""

from __future__ import annotations

import numpy as np
import pytest

from proving_ground.imperfect import SCENARIOS, SHARES
from proving_ground.scenarios import scenarios
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.workflow import diagnosis

SEED = 3


def built(name, seed=SEED):
    one = next(one for one in SCENARIOS if one.name == name)
    return one.build(seed, 6.0 if one.has_strength else None)


def base(name, seed=SEED):
    one = scenarios((), (name,))[0]
    return one.build(seed, None if one.kind == "clean" else 6.0)


def test_every_size_with_and_without_an_effect():
    names = {one.name for one in SCENARIOS}
    assert len(names) == len(SCENARIOS)
    for kind in ("clean", "single"):
        of_kind = [one for one in SCENARIOS if one.kind == kind]
        assert len(of_kind) == 5 * (len(SHARES) + 1)
    assert {one.family for one in SCENARIOS} == {"imperfect"}


@pytest.mark.parametrize(("share", "words"), [(0.001, "0.1%"), (0.1, "10.0%")])
def test_the_misfit_has_its_size_and_nothing_else_is_changed(share, words):
    case, was = built(f"misfit {words}: clean.thermal/white"), base("clean.thermal/white")
    for name in case.responses:
        moved = was.simulation.frame[name].to_numpy()
        off = case.simulation.frame[name].to_numpy() - moved
        assert off.std() == pytest.approx(share * moved.std(), rel=0.05)
        # no offset, gain or delay: those a recalibration would put right
        table = np.column_stack([np.ones(len(moved)), moved, np.gradient(moved)])
        left = off - table @ np.linalg.lstsq(table, off, rcond=None)[0]
        assert left.std() > 0.3 * off.std()
    assert case.recording.frame.equals(was.recording.frame)
    assert "missing-physics" not in case.truth.verdicts


def test_an_effect_stays_the_truth_beside_a_misfit():
    case, was = built("misfit 1.0%: thermal.memory/one axis"), base("thermal.memory/one axis")
    assert case.truth.effects == was.truth.effects
    assert "missing-physics" in case.truth.verdicts


def test_an_uneven_clock_loses_rows_and_goes_on():
    case, was = built("uneven: clean.thermal/white"), base("clean.thermal/white")
    for run in case.recording.runs:
        time_s, before = case.recording.time_s(run), was.recording.time_s(run)
        assert 0.6 < len(time_s) / len(before) < 0.8
        assert (np.diff(time_s) > 0.0).all()
        assert np.std(np.diff(time_s)) > 0.1 * np.median(np.diff(before))
    for name in case.recording.with_role("temperature"):
        counts = case.recording.frame[name].to_numpy() / 0.32258
        # written with two decimals: a 32nd of a count
        assert np.abs(counts - np.round(counts)).max() < 0.02


def test_the_same_seed_gives_the_same_case():
    one, again = (built("misfit 3.0%: flow.overflow/lower") for _ in range(2))
    assert one.simulation.frame.equals(again.simulation.frame)
    assert not one.simulation.frame.equals(built("misfit 3.0%: flow.overflow/lower", seed=4).simulation.frame)


def test_a_smooth_misfit_of_a_per_cent_is_no_sure_effect():
    """An overflow that gained 11 nats and explains a thirtieth, with no unseen row to judge it by, was 0.95 sure."""
    case = built("misfit 0.3%: clean.flow/ar", seed=80)
    found = diagnosis(comparison_of(case.recording, case.simulation, responses=case.responses))
    assert all(effect.confidence <= 0.75 for effect in found.effects)
