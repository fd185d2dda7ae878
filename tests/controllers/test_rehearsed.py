"""Faults on recorded readings: what a program does then is what the guard does, and what it costs is told."""

from __future__ import annotations

import numpy as np
import pytest

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, Term
from selector.controllers.guard.decided import with_decided_limits
from selector.controllers.replay.replayed import KINDS, rehearsal_findings, replay_findings, replayed
from selector.controllers.writers.targets import TARGETS
from tests.controllers.model_builders import recording_of, run_table


def model(**guard: object) -> ModelFile:
    """Z = 3·ΔT1 + 2·ΔT2; without T1 it is 5·ΔT2."""
    inputs = tuple(
        Input(name=name, valid_min=-1.0, valid_max=10.0, rate_limit_per_min=2.0, reading_min=0.0, reading_max=60.0)
        for name in ("T1", "T2")
    )
    limits = (OutputLimits(output="Z", clamp_um=80.0, slew_um_per_s=1.0),)
    terms = tuple(Term(powers={name: 1}, coefficient=of) for name, of in (("T1", 3.0), ("T2", 2.0)))
    alone = Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={"T2": 1}, coefficient=5.0),))
    return ModelFile(
        name="two",
        inputs=inputs,
        outputs=(Output(name="Z", axis="Z", intercept=0.0, terms=terms),),
        guard=Guard.model_validate({"limits": limits, "on_fault": "fallback"} | guard),
        fallbacks=({"without": ["T1"], "inputs": (inputs[1],), "outputs": (alone,)},),
    )


def rehearsal(target: str, **guard: object):
    time_s = np.arange(400) * 60.0
    warm = 20.0 + 8.0 * (1.0 - np.exp(-time_s / 7200.0))
    table = run_table(time_s, {"T1": warm, "T2": warm + 0.01 * np.sin(time_s), "Z": 5.0 * (warm - 20.0)})
    of = with_decided_limits(model(**guard))
    files = TARGETS[target].write(of).files
    proof = replayed(of, files, recording_of({"r": table}), TARGETS[target].parts)
    return {(one.fault, one.sensor): one for one in proof.rehearsal}, proof


def test_every_fault_of_every_sensor_is_there_once():
    found, _ = rehearsal("python")
    whole = {"power cycle", "clock forward", "clock back", "stopped and resumed"}
    assert set(found) == {(k, s) for k in set(KINDS) - whole for s in ("T1", "T2")} | {(k, None) for k in whole}
    assert all(one.max_abs_difference_um == 0.0 for one in found.values())


def test_a_dead_sensor_is_noticed_at_once_and_the_fallback_takes_over():
    found, _ = rehearsal("python")
    dead = found["dead", "T1"]
    assert (dead.mode, dead.reacts_after_s) == ("fallback without T1", 0.0)
    # the fallback is as good on this machine
    assert dead.left.max_um == pytest.approx(0.0, abs=0.2)
    other = found["dead", "T2"]
    assert other.mode == "ramp to zero"
    assert other.left.max_um == pytest.approx(other.left.before_max_um)


def test_a_sensor_that_stands_still_is_noticed_only_where_the_guard_looks_for_it():
    for after_s, reacts_s in ((None, None), (1800.0, 1860.0)):
        found, proof = rehearsal("python", stuck_after_s=after_s)
        assert found["stuck", "T1"].reacts_after_s == reacts_s
        assert {finding.id for finding in rehearsal_findings(proof.rehearsal)} == {"fault-costs"}


def test_power_cycle_and_stop_are_corrected_anew_from_zero():
    found, _ = rehearsal("python")
    for kind in ("power cycle", "stopped and resumed"):
        assert found[kind, None].left.max_um > 25.0
        assert found[kind, None].left.rmse_um < 10.0
    assert found["clock back", None].left.max_um < 2.0


def test_the_macro_is_what_the_guard_is_when_something_fails():
    found, proof = rehearsal("fanuc")
    assert all(one.max_abs_difference_um <= one.allowed_um for one in found.values())
    assert found["dead", "T1"].mode == "fallback without T1"
    assert proof.as_dict()["rehearsal"][0]["fault"] == "dead"


def test_apply_and_program_stand_side_by_side_with_the_reason():
    time_s = np.arange(400) * 60.0
    warm = 20.0 + 14.0 * (1.0 - np.exp(-time_s / 7200.0))
    table = run_table(time_s, {"T1": warm, "T2": warm, "Z": 5.0 * (warm - 20.0)})
    of = with_decided_limits(model())
    (run,) = replayed(of, TARGETS["python"].write(of).files, recording_of({"hot": table}), TARGETS["python"].parts).runs
    assert run.applied["Z"].rmse_um == pytest.approx(0.0, abs=0.1)
    assert run.accuracy["Z"].rmse_um > 5.0
    assert any("T1 " in why and " 3" in why for why in run.because["Z"])


def test_a_smaller_guard_is_no_reason_for_what_a_sensor_costs():
    time_s = np.arange(400) * 60.0
    warm = 20.0 + 8.0 * (1.0 - np.exp(-time_s / 7200.0))
    lost = np.where((time_s > 6000.0) & (time_s < 9000.0), np.nan, warm)
    table = run_table(time_s, {"T1": lost, "T2": warm, "Z": 5.0 * (warm - 20.0)})
    of, target = with_decided_limits(model(on_fault="ramp-to-zero")), TARGETS["fanuc"]
    (run,) = replayed(of, target.write(of).files, recording_of({"lost": table}), target.parts).runs
    assert run.accuracy["Z"].rmse_um > 5.0
    assert any("not believed" in why for why in run.because["Z"])
    assert not any("guard is smaller" in why for why in run.because["Z"])


@pytest.mark.parametrize(("beyond", "level", "advises"), [(1, "info", False), (200, "warning", True)])
def test_of_a_few_samples_beyond_the_range_nothing_is_advised(beyond, level, advises):
    time_s = np.arange(400) * 60.0
    warm = 20.0 + np.where(np.arange(400) >= 400 - beyond, 10.5, np.minimum(0.5 * np.arange(400), 9.9))
    table = run_table(time_s, {"T1": warm, "T2": 20.0 + 0.0 * warm, "Z": 3.0 * (warm - 20.0)})
    of, target = with_decided_limits(model()), TARGETS["python"]
    proof = replayed(of, target.write(of).files, recording_of({"r": table}), target.parts)
    (finding,) = [one for one in replay_findings(proof, has_guard=True) if one.id == "outside-valid-range"]
    assert (finding.level, bool(finding.suggestion)) == (level, advises)
