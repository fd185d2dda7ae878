"""The guard: what it believes, what it follows, and that nothing whatsoever takes it out of its limits."""

from __future__ import annotations

import math
import os
import shlex

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.controllers import Guard, OutputLimits
from selector.controllers.guard.decided import Mode, SensorCode, decided_limits
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.replay.parts import reference_answers
from tests.controllers import hostile
from tests.controllers.model_builders import rich_model, rise_model, starts_of
from tests.controllers.stepwise import Evaluator

FAST = OutputLimits(output="Z", clamp_um=100.0, slew_um_per_s=1e6)


def guarded(**guard: object) -> GuardedModel:
    return GuardedModel(rise_model(guard=Guard.model_validate({"limits": (FAST,), "recover_after_s": 0.0, **guard})))


def after(model: GuardedModel, t1: float, t3: float, dt_s: float = 60.0, **switches: bool):
    return model.step(dt_s, {"T1": t1, "T3": t3}, **switches)


def test_without_faults_it_is_the_negative_of_the_model():
    model = rich_model()
    limits = tuple(OutputLimits(output=o.name, clamp_um=1e6, slew_um_per_s=1e6) for o in model.outputs)
    model = model.model_copy(update={"guard": Guard(limits=limits, recover_after_s=0.0)})
    plain, guard = Evaluator(model), GuardedModel(model)
    rng = np.random.default_rng(0)
    temperature = 20.0 + np.cumsum(rng.uniform(0.0, 0.1, 60))
    for k in range(60):
        readings = {"T1": temperature[k], "T амб": 22.0 + 0.01 * k, "n": 40.0 * k}
        expected = plain.step(10.0 * k, readings)
        found = guard.step(0.0 if k == 0 else 10.0, readings)
        assert found.mode == Mode.MODEL
        # nothing moves in no time; 1e-12 of 100 µm: the memory adds up the same steps, from another zero of time
        assert k == 0 or found.k0_um == pytest.approx({name: -value for name, value in expected.items()}, rel=1e-12)


@pytest.mark.parametrize(
    ("reading", "code"),
    [
        (math.nan, SensorCode.MISSING),
        (math.inf, SensorCode.MISSING),
        (1e12, SensorCode.MISSING),
        (850.0, SensorCode.BREAK_CODE),
        (850.0004, SensorCode.BREAK_CODE),
        (-9999.0, SensorCode.BREAK_CODE),
        (24.0, SensorCode.OK),
        (33.0, SensorCode.LIMITED),
    ],
)
def test_what_a_reading_is_taken_for(reading, code):
    model = guarded()
    after(model, 20.0, 20.0)
    assert after(model, reading, 21.0).sensors == (code, SensorCode.OK)


def test_a_reading_beyond_the_range_counts_as_its_end():
    one, other = guarded(), guarded()
    for model in (one, other):
        after(model, 20.0, 20.0)
    assert after(one, 33.0, 21.0).correction_um == after(other, 30.0, 21.0).correction_um


def test_a_jump_is_a_fault_and_noise_is_none():
    item = rise_model().inputs[0].model_copy(update={"rate_limit_per_min": 2.0})
    model = GuardedModel(rise_model(inputs=(item, rise_model().inputs[1]), guard=Guard(limits=(FAST,))))
    for k in range(120):
        code = after(model, 20.0 + 1.9 * (k % 2), 20.0, dt_s=1.0).sensors[0]
        assert code == (SensorCode.RECOVERING if k < 60 else SensorCode.OK)
    assert after(model, 22.5, 20.0, dt_s=1.0).sensors[0] == SensorCode.JUMP
    # a sensor that was really moved is believed again when it has had the time, and 60 s more
    codes = [after(model, 26.0, 20.0, dt_s=10.0).sensors[0] for _ in range(60)]
    assert codes[0] == SensorCode.JUMP
    assert SensorCode.RECOVERING in codes
    assert codes[-1] == SensorCode.OK


def test_a_sensor_that_stands_still_is_a_fault_until_it_moves():
    model = guarded(stuck_after_s=600.0, recover_after_s=0.0)
    codes = [after(model, 20.0, 20.0 + 0.01 * k).sensors[0] for k in range(13)]
    assert codes == [SensorCode.OK] * 11 + [SensorCode.STUCK] * 2
    assert after(model, 20.1, 21.0).sensors[0] == SensorCode.OK


def test_hold_then_ramp_then_recover():
    model = guarded(on_fault="hold", hold_at_most_s=100.0, recover_after_s=60.0)
    for _ in range(7):
        after(model, 20.0, 20.0)
    before = after(model, 24.0, 22.0).correction_um["Z"]
    assert before != 0.0
    held = after(model, math.nan, 22.0)
    assert (held.mode, held.correction_um["Z"]) == (Mode.HOLD, before)
    ramped = after(model, math.nan, 22.0)
    assert (ramped.mode, ramped.correction_um["Z"]) == (Mode.RAMP_TO_ZERO, 0.0)
    # a minute apart, but six more readings
    assert {after(model, 24.0, 22.0).sensors[0] for _ in range(6)} == {SensorCode.RECOVERING}
    assert after(model, 24.0, 22.0).mode == Mode.MODEL


def test_the_fallback_without_the_broken_sensor_is_taken():
    model = GuardedModel(hostile.model(has_slope=False, recover_after_s=0.0))
    readings = {"T1": 22.0, "T2": 26.0, "n": 3000.0}
    model.step(0.0, readings)
    assert model.step(10.0, {**readings, "T2": math.nan}).mode == Mode.FALLBACK
    assert model.step(10.0, {**readings, "T1": math.nan, "T2": math.nan}).mode == Mode.HOLD


def test_off_is_zero_at_once_and_comes_back_slowly():
    limits = OutputLimits(output="Z", clamp_um=100.0, slew_um_per_s=0.1)
    model = guarded(limits=(limits,))
    after(model, 20.0, 20.0, dt_s=1.0)
    for _ in range(200):
        there = after(model, 27.0, 20.0, dt_s=1.0).correction_um["Z"]
    assert abs(there) > 5.0
    assert after(model, 27.0, 20.0, dt_s=1.0, is_ready=False).correction_um["Z"] == 0.0
    assert abs(after(model, 27.0, 20.0, dt_s=1.0).correction_um["Z"]) == pytest.approx(0.1)
    assert after(model, 27.0, 20.0, dt_s=1.0, is_wanted=False).mode == Mode.SWITCHED_OFF


@pytest.mark.parametrize(("off_s", "kept"), [(1000.0, True), (5000.0, False)])
def test_a_restart_keeps_the_start_readings_until_the_machine_is_cold(off_s, kept):
    model = guarded(new_start_after_s=3600.0)
    after(model, 20.0, 20.0)
    after(model, 24.0, 22.0)
    model.restart(off_s)
    warm = after(model, 24.0, 22.0)
    assert starts_of(model) == ([20.0, 20.0] if kept else [24.0, 22.0])
    assert warm.mode == Mode.MODEL


def test_a_dead_band_holds_small_changes_back():
    model = guarded(limits=(FAST.model_copy(update={"dead_band_um": 1.0}),))
    after(model, 20.0, 20.0)
    first = after(model, 24.0, 22.0).correction_um["Z"]
    assert after(model, 24.2, 22.0).correction_um["Z"] == first
    assert after(model, 26.0, 22.0).correction_um["Z"] != first


def test_limits_that_nobody_decided_are_cautious_and_told():
    model = rise_model()
    limits, findings = decided_limits(model)
    # |1| + |3·3| + |2·3.33| + |0.5·3·3.33| = 21.67
    assert limits["Z"].clamp_um == 22.0
    assert limits["Z"].slew_um_per_s == 1.0
    assert [finding.id for finding in findings] == ["limit-not-decided"]
    decided = Guard(limits=(OutputLimits(output="Z", clamp_um=5.0, slew_um_per_s=2.0),))
    assert decided_limits(model.model_copy(update={"guard": decided}))[1] == ()


@pytest.mark.parametrize(
    ("given", "open_is"),
    [({}, "how far and how fast"), ({"clamp_um": 5.0}, "how fast"), ({"slew_um_per_s": 2.0}, "how far")],
)
def test_what_was_decided_is_not_called_open(given, open_is):
    guard = Guard(limits=(OutputLimits(output="Z", **given),))
    (finding,) = decided_limits(rise_model().model_copy(update={"guard": guard}))[1]
    assert finding.statement.startswith(f"Nobody has decided {open_is} Z may")


@pytest.mark.skipif(os.name == "nt", reason="shlex reads the words of another shell")
def test_the_options_that_a_finding_asks_for_can_be_pasted():
    model = rise_model()
    (output,) = model.outputs
    spaced = model.model_copy(update={"outputs": (output.model_copy(update={"name": "Verlagerung Z"}),)})
    (finding,) = decided_limits(spaced)[1]
    words = shlex.split(finding.suggestion.partition("say so: ")[2].partition(";")[0])
    assert words == ["--clamp", "Verlagerung Z=22", "--slew", "Verlagerung Z=1"]


ANY = st.floats(width=64) | st.sampled_from([*hostile.BAD.tolist(), 20.0, 22.5])


@settings(max_examples=30)
@given(
    on_fault=st.sampled_from(["hold", "ramp-to-zero", "fallback"]),
    outside=st.sampled_from(["limit-input", "fault"]),
    number=st.sampled_from([float, np.float32]),
    steps=st.lists(st.tuples(ANY, ANY, ANY, ANY, ANY, st.booleans(), st.booleans(), st.booleans()), max_size=40),
)
def test_for_any_input_whatsoever_the_correction_is_finite_clamped_and_slewed(on_fault, outside, number, steps):
    model = hostile.model(on_fault=on_fault, outside_valid_range=outside)
    limits, _ = decided_limits(model)
    guard = GuardedModel(model, number)
    before = dict.fromkeys(limits, 0.0)
    for dt_s, t1, t2, n, position, is_ready, is_wanted, is_restart in steps:
        if is_restart:
            guard.restart(dt_s)
            before = dict.fromkeys(limits, 0.0)
        found = guard.step(dt_s, {"T1": t1, "T2": t2, "n": n}, {"Z": position}, is_ready=is_ready, is_wanted=is_wanted)
        for name, limit in limits.items():
            # float32 resolves 1e-6 µm at 20 µm
            assert abs(float(found.correction_um[name])) <= limit.clamp_um + 1e-5
            if is_ready:
                passed_s = min(dt_s, 10.0) if 0 < dt_s <= 1e6 else 0.0
                most = limit.own_slew_um_per_s * passed_s
                assert abs(float(found.k0_um[name]) - before[name]) <= most + 1e-5
            before[name] = float(found.k0_um[name])


def test_memory_of_hours_does_not_stand_still_in_single_precision():
    model = hostile.model(on_fault="hold", has_slope=False, recover_after_s=0.0)
    single, double = GuardedModel(model, np.float32), GuardedModel(model)
    readings = {"T1": 22.0, "T2": 26.0, "n": 3000.0}
    for guard in (single, double):
        guard.step(0.0, readings)
    for _ in range(30_000):
        found = [guard.step(0.01, {**readings, "T1": 22.5}) for guard in (single, double)]
    left, right = (float(one.correction_um["Z"]) for one in found)
    # 300 s of 900 s; single precision adds 30 000 steps of 1e-7 relative, of any sign
    assert left == pytest.approx(right, abs=0.002)


@pytest.mark.parametrize("seed", range(3))
def test_hostile_rows_stay_finite_and_inside(seed):
    model = hostile.model()
    answers = reference_answers(model, hostile.rows(3000, seed))
    assert np.isfinite(answers.correction_um).all()
    for k, limit in enumerate(decided_limits(model)[0].values()):
        assert 1.0 < np.abs(answers.correction_um[:, k]).max() <= limit.clamp_um
    assert len(np.unique(answers.mode)) >= 6
    assert len(np.unique(answers.sensors)) >= 7


def test_what_jumped_too_far_is_never_believed_again():
    item = rise_model().inputs[0].model_copy(update={"rate_limit_per_min": 2.0})
    model = GuardedModel(rise_model(inputs=(item, rise_model().inputs[1]), guard=Guard(limits=(FAST,))))
    for _ in range(7):
        after(model, 20.0, 20.0)
    codes = {after(model, 80.0, 20.0).sensors[0] for _ in range(600)}
    assert codes == {SensorCode.JUMP}


def test_the_straight_line_keeps_the_clamp_at_the_end_of_the_axis():
    model = hostile.model(limits=(OutputLimits(output="Z", clamp_um=6.0, slew_um_per_s=1e5),), recover_after_s=0.0)
    guard, limit = GuardedModel(model), decided_limits(model)[0]["Z"]
    for k in range(200):
        found = guard.step(10.0, {"T1": 22.0 + 0.04 * k, "T2": 26.0 + 0.08 * k, "n": 3000.0}, {"Z": 0.5})
        assert abs(found.k0_um["Z"]) + abs(found.slope_um_per_m["Z"]) * limit.reach_m <= limit.clamp_um + 1e-9
    assert found.slope_um_per_m["Z"] != 0.0


def test_memory_over_a_standstill_is_nearly_what_it_would_have_been():
    model = hostile.model(
        on_fault="hold", has_slope=False, new_start_after_s=None, stuck_after_s=None, recover_after_s=0.0
    )
    readings = {"T1": 22.0, "T2": 26.0, "n": 3000.0}
    through, stopped = GuardedModel(model), GuardedModel(model)
    for guard in (through, stopped):
        guard.step(0.0, readings)
        for k in range(100):
            guard.step(60.0, {**readings, "T1": 22.0 + 0.03 * k})
    for _ in range(60):
        there = through.step(60.0, readings)
    stopped.restart(3540.0)
    for _ in range(60):
        here = stopped.step(1.0, readings)
    # tau 900 s: of the memory 2 % are left, 4 % in 16 steps; 10 % of it in one
    assert here.k0_um["Y"] == pytest.approx(there.k0_um["Y"], abs=0.5)
    assert here.k0_um["Z"] == pytest.approx(there.k0_um["Z"], abs=0.5)


def test_an_input_that_nobody_has_written_is_missing_and_no_start_reading():
    from selector.controllers.writers.python_module import CLASS, python_files

    names: dict = {}
    exec(python_files(rise_model())["thermal_correction.py"], names)
    program = names[CLASS]()
    program.dt_s = 1.0
    program.step()
    assert (program.sensor_1, program.has_start_1) == (SensorCode.MISSING, False)
