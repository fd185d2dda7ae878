"""The guard at the machine: the first readings, wrong times, positions that are lost, slow slews."""

from __future__ import annotations

import math

import numpy as np
import pytest

from selector.controllers import PositionPart
from selector.controllers.c_compiler import compiler
from selector.controllers.guard.decided import Mode, SensorCode, decided_limits
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.replay.parts import Answers, reference_answers
from selector.controllers.replay.replayed import faulty_share
from tests.controllers import hostile
from tests.controllers.model_builders import guarded, starts_of

needs_cc = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")
GOOD = {"T1": 20.0, "T3": 20.0}


# the first readings


def test_a_wrong_first_reading_is_no_start_reading():
    model = guarded(rate=2.0)
    model.step(1.0, {"T1": 0.0, "T3": 20.0})
    codes = [model.step(1.0, GOOD).sensors[0] for _ in range(120)]
    assert codes[0] == SensorCode.JUMP
    assert codes[1:61] == [SensorCode.RECOVERING] * 60
    assert set(codes[61:]) == {SensorCode.OK}
    assert starts_of(model) == [*GOOD.values()]


def test_without_a_rate_limit_a_first_reading_further_off_than_the_valid_range_is_wide_is_none():
    model = guarded()
    model.step(1.0, {"T1": 0.0, "T3": 20.0})
    for _ in range(120):
        model.step(1.0, GOOD)
    assert starts_of(model) == [*GOOD.values()]


def test_the_rise_counts_from_the_first_good_reading_not_from_when_it_was_believed():
    model = guarded(slew=1e6)
    for k in range(61):
        found = model.step(1.0, {"T1": 20.0 + 0.01 * k, "T3": 20.0})
        assert (found.mode == Mode.MODEL) is (k == 60)
    assert starts_of(model) == [*GOOD.values()]
    # T1: z = (0.6 - 4) / 2; T3: z = -2
    z1, z3 = (0.01 * 60 - 4.0) / 2.0, -2.0
    assert found.correction_um["Z"] == pytest.approx(-(1.0 + 3.0 * z1 - 2.0 * z3 + 0.5 * z1 * z3), abs=1e-12)


def test_a_jump_of_a_sensor_that_was_believed_stays_a_fault_but_a_wrong_first_reading_after_a_restart_does_not():
    model = guarded(rate=2.0)
    for _ in range(100):
        model.step(1.0, GOOD)
    model.restart(60.0)
    model.step(1.0, {"T1": 0.0, "T3": 20.0})
    for _ in range(100):
        found = model.step(1.0, GOOD)
    assert found.mode == Mode.MODEL
    assert {model.step(1.0, {"T1": 70.0, "T3": 20.0}).sensors[0] for _ in range(1000)} == {SensorCode.JUMP}


def test_memory_begins_with_the_first_good_reading():
    plain = hostile.model(on_fault="hold", has_slope=False, stuck_after_s=None)
    late, at_once = (
        GuardedModel(plain.model_copy(update={"guard": plain.guard.model_copy(update={"recover_after_s": seconds})}))
        for seconds in (60.0, 0.0)
    )
    for k in range(120):
        readings = {"T1": 22.0 + 0.005 * k, "T2": 26.0, "n": 3000.0}
        found = [one.step(1.0, readings) for one in (late, at_once)]
    # one step of 60 s instead of 60 steps of 1 s: 0.01 K of a memory of 900 s
    assert found[0].k0_um["Z"] == pytest.approx(found[1].k0_um["Z"], abs=0.05)


def test_the_start_is_no_fault_of_a_run_and_a_dead_sensor_is():
    def answers(mode, sensors):
        found = Answers.empty(len(mode), 1, 1, 0)
        found.mode[:], found.sensors[:, 0] = mode, sensors
        return found

    for mode, codes, share in (
        ([2, 2, 1, 1], [2, 2, 0, 1], 0.0),
        ([2, 2, 1, 2], [2, 3, 0, 3], 0.5),
        ([2, 2], [3, 3], 1.0),
        ([], [], 0.0),
    ):
        whole = answers(mode, codes)
        assert faulty_share(whole, whole) == share


# one wrong time since the last call


WRONG_TIMES = [math.inf, 1e300, 1e6, 1e5, 61.0]


@pytest.mark.parametrize("wrong", WRONG_TIMES)
@pytest.mark.parametrize("number", [float, np.float32])
def test_one_wrong_time_ends_no_recovery_and_takes_no_start_reading(wrong, number):
    model = guarded(number=number)
    model.step(1.0, {"T1": 17.0, "T3": 20.0})
    codes = [model.step(wrong, {"T1": 17.0, "T3": 20.0}).sensors[0]]
    codes += [model.step(1.0, {"T1": math.nan, "T3": 20.0}).sensors[0]]
    assert codes == [SensorCode.RECOVERING, SensorCode.MISSING]
    for _ in range(61):
        model.step(1.0, GOOD)
    assert starts_of(model) == [*GOOD.values()]
    model.step(1.0, {"T1": 850.0, "T3": 20.0})
    codes = [model.step(dt_s, GOOD).sensors[0] for dt_s in (1.0, wrong, *[1.0] * 49)]
    assert codes == [SensorCode.RECOVERING] * 51


@pytest.mark.parametrize("wrong", WRONG_TIMES)
def test_one_wrong_time_excuses_no_jump(wrong):
    model = guarded(rate=2.0)
    for _ in range(100):
        model.step(1.0, GOOD)
    # two minutes' worth of 2 K/min is the most that one sample can excuse
    found = [model.step(dt_s, {"T1": 24.1, "T3": 20.0}).sensors[0] for dt_s in (wrong, 1.0)]
    assert found[-1] == SensorCode.JUMP


@pytest.mark.parametrize("wrong", [math.inf, -math.inf, math.nan, 1e300, 1.1e6, -1.0])
def test_what_is_no_time_is_none(wrong):
    one, other = guarded(rate=2.0), guarded(rate=2.0)
    for k in range(200):
        readings = {"T1": 20.0 + 0.01 * k, "T3": 20.0}
        dt_s = wrong if k % 3 == 0 else 1.0
        assert one.step(dt_s, readings) == other.step(0.0 if k % 3 == 0 else dt_s, readings)


@pytest.mark.parametrize(("period_s", "samples"), [(1.0, 60), (10.0, 6), (60.0, 6), (600.0, 6)])
def test_a_reading_is_believed_after_a_minute_and_six_more_samples_at_any_rhythm(period_s, samples):
    model = guarded(rate=2.0)
    modes = [model.step(period_s, {"T1": 20.0 + 0.03 * period_s * k / 60.0, "T3": 20.0}).mode for k in range(100)]
    assert modes == [Mode.HOLD] * samples + [Mode.MODEL] * (100 - samples)


# positions


def along():
    return PositionPart(axis="Z", reference_m=0.0, valid_min_m=0.0, valid_max_m=0.5, intercept=40.0)


def test_a_position_that_was_lost_has_a_code_and_its_return_is_slewed():
    model = guarded(part=along(), recover_after_s=0.0)
    for _ in range(100):
        before = model.step(1.0, GOOD, {"Z": 0.5})
    assert before.axes == {"Z": SensorCode.OK}
    lost = [model.step(1.0, GOOD, {"Z": bad}) for bad in (math.nan, math.inf, 1e12)]
    assert {one.axes["Z"] for one in lost} == {SensorCode.MISSING}
    assert {one.correction_um["Z"] for one in lost} == {before.correction_um["Z"]}
    # it moved by 0.5 m meanwhile, 20 µm of correction
    course = [before.correction_um["Z"], *(model.step(1.0, GOOD, {"Z": 0.0}).correction_um["Z"] for _ in range(30))]
    assert np.abs(np.diff(course)).max() <= 1.0 + 1e-12
    assert course[-1] == pytest.approx(before.correction_um["Z"] + 20.0)
    assert model.step(1.0, GOOD, {"Z": 0.7}).axes == {"Z": SensorCode.LIMITED}


def test_an_axis_that_moves_takes_its_correction_along_at_once():
    model = guarded(part=along(), recover_after_s=0.0)
    for _ in range(100):
        before = model.step(1.0, GOOD, {"Z": 0.5})
    assert model.step(0.001, GOOD, {"Z": 0.0}).correction_um["Z"] == pytest.approx(before.correction_um["Z"] + 20.0)


@pytest.mark.parametrize("number", [float, np.float32])
def test_clamp_and_slew_hold_with_positions_on_hostile_rows(number):
    model = hostile.model()
    rows = hostile.rows(6000, 31)
    found, limit = reference_answers(model, rows, number), decided_limits(model)[0]["Z"]
    slack = 1e-9 if number is float else 2e-5  # binary32 resolves 2e-6 µm at 20 µm
    assert np.abs(found.correction_um[:, 0]).max() <= limit.clamp_um
    position = rows.positions_m[:, 0]
    is_there = np.abs(np.nan_to_num(position, nan=np.inf)) <= 1e9
    where = np.full(len(rows), 0.1)
    for k in range(len(rows)):
        where[k] = np.clip(position[k], -0.2, 0.5) if is_there[k] else where[k - 1] if k else 0.1
    both = is_there[1:] & is_there[:-1]
    carried = np.where(both, found.slope_um_per_m[:-1, 0] * np.diff(where), 0.0)
    base = np.clip(found.correction_um[:-1, 0] + carried, -limit.clamp_um, limit.clamp_um)
    passed_s = np.clip(np.nan_to_num(rows.dt_s[1:], nan=0.0, posinf=10.0), 0.0, 10.0)
    excess = np.abs(found.correction_um[1:, 0] - base) - limit.slew_um_per_s * passed_s
    free = (found.mode[1:] != Mode.OFF) & ~rows.is_restart[1:]
    came_back = free & is_there[1:] & ~is_there[:-1]
    assert came_back.sum() > 50
    assert excess[free].max() <= slack


# slow slews


@pytest.mark.parametrize("slew", [0.003, 0.0001])
def test_a_slow_slew_at_a_millisecond_is_right_in_single_precision(slew):
    single = guarded(slew=slew, number=np.float32)
    single.step(0.0, GOOD)
    for _ in range(2000):
        single.step(1.0, GOOD, test_um={"Z": 6.0})
    begun = float(single.step(0.0, GOOD, test_um={"Z": 99.0}).k0_um["Z"])
    for _ in range(20_000):
        found = single.step(0.001, GOOD, test_um={"Z": 99.0})
    # the value itself has steps of 5e-7 µm at 6 µm
    assert float(found.k0_um["Z"]) - begun == pytest.approx(20.0 * slew, rel=1e-5, abs=5e-7)
