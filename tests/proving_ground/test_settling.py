"""A run more on the true machine: what was recorded stays, the new run stands before the held-out one."""

import numpy as np
import pytest

from proving_ground.scenarios import scenarios
from proving_ground.settling import settled

HOUR_S, STEP_S = 3600.0, 60.0


def case(name, seed=7, d_prime=12.0):
    return scenarios(names=(name,))[0].build(seed, d_prime)


@pytest.fixture(scope="module")
def heated():
    return case("thermal.second_source/feed")


def turning(rows, rpm):
    return {"n": np.r_[np.full(rows // 2, rpm), np.zeros(rows - rows // 2)]}


def test_old_runs_stay_and_the_new_one_does_what_is_told(heated):
    longer = heated.with_run(turning(240, 6000.0), STEP_S, 1)

    assert longer.recording.runs == ("r1", "r2", "r4", "r3") == longer.simulation.runs
    for run in heated.recording.runs:
        for before, after in ((heated.recording, longer.recording), (heated.simulation, longer.simulation)):
            assert np.array_equal(after.values(run, after.names), before.values(run, before.names))
    speed = longer.recording.values("r4", ["n"])[:, 0]
    time = longer.recording.time_s("r4")
    assert set(np.unique(speed)) == {0.0, 6000.0}
    assert np.ptp(time) == pytest.approx(4.0 * HOUR_S, abs=2 * STEP_S)
    assert time[speed > 0].max() == pytest.approx(2.0 * HOUR_S, abs=STEP_S)


def test_the_effect_acts_in_the_new_run_as_well(heated):
    fed = heated.with_run({"f": np.full(300, 9000.0)}, STEP_S, 1)
    still = heated.with_run({"f": np.zeros(300)}, STEP_S, 1)

    name = heated.truth.effects[0].channels[0]
    simulated, recorded = (
        [of.values("r4", [name])[:, 0] for of in both]
        for both in ((fed.simulation, still.simulation), (fed.recording, still.recording))
    )
    assert np.array_equal(*simulated)
    # the same noise in both: what feeding does is left, but for rounding
    course = recorded[0] - recorded[1]
    assert abs(course[0]) < 0.05 < 0.2 < abs(course[-50:].mean())


def test_what_nobody_can_set_is_refused(heated):
    with pytest.raises(ValueError, match="T10"):
        heated.with_run({"T10": np.full(300, 30.0)}, STEP_S, 1)


def test_a_fault_of_the_data_has_no_run_more():
    assert case("data.step/one-run", d_prime=6.0).with_run is None


def test_an_axis_makes_the_told_strokes():
    axis = case("drive.coulomb/small", d_prime=6.0)
    place = 0.2 + 0.05 * np.sin(np.linspace(0.0, 6 * np.pi, 1500))
    longer = axis.with_run({"r": place}, 2e-3, 1)

    command = longer.recording.values("r4", ["r"])[:, 0]
    assert longer.recording.runs == ("r1", "r2", "r4", "r3")
    assert command == pytest.approx(place[: len(command)], abs=1e-6)
    with pytest.raises(ValueError, match="nobody can set v"):
        axis.with_run({"v": place}, 2e-3, 1)


def test_a_set_is_settled_by_the_proposed_run():
    one = settled(case("thermal.second_source/cabinet", 62, 6.0), 62)

    assert one.named_before == (("thermal.second_source",), ("thermal.ambient", "data.step"))
    assert set(one.separates) == {"thermal.ambient", "data.step"}
    assert one.after.credits == ("exact",)
    assert not one.after.false_names
