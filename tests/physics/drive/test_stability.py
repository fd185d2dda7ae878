from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.drive.closed_loop import closed_loop
from selector.physics.drive.parts.axis import Axis, RigidMechanics, Servo
from selector.physics.drive.parts.catalogue import thc6350_servo, thc6350_x_axis
from selector.physics.drive.parts.stiffness import three_mass_mechanics
from selector.physics.drive.stability import stability, stability_findings

MECHANICS = three_mass_mechanics(thc6350_x_axis())
AXIS = Axis(MECHANICS, thc6350_servo())


@settings(max_examples=25)
@given(st.floats(1.0, 200.0), st.floats(1.0, 100.0), st.floats(1.0, 1e4), st.floats(0.0, 20.0))
def test_limits_of_a_rigid_axis_are_those_of_hurwitz(kp, kvp, kvi, damping):
    # M·s³ + (C + Kvp)·s² + (Kvi + Kp·Kvp)·s + Kp·Kvi with M = 10 kg, stable while (C+Kvp)(Kvi+Kp·Kvp) > M·Kp·Kvi
    found = stability(Axis(RigidMechanics(10.0, damping), Servo(kp, kvp, kvi)))
    drag = damping + kvp
    surplus = drag * (kvi + kp * kvp) - 10.0 * kp * kvi
    if abs(surplus) > 1e-6 * kp * kvi:
        assert found.stable == (surplus > 0)
        assert (found.margin_per_s > 0) == found.stable
    # in Kp: (C+Kvp)·Kvi > Kp·(M·Kvi − (C+Kvp)·Kvp)
    slope = 10.0 * kvi - drag * kvp
    limit = drag * kvi / slope / kp if slope > 0 else math.inf
    if 1e-3 < limit < 1e3:
        # found where the growth of an eigenvalue is 0
        assert found.gain_limits["position_gain_per_s"] == pytest.approx(limit, rel=1e-5)
    elif limit == math.inf:
        assert found.gain_limits["position_gain_per_s"] is None


@pytest.mark.parametrize("sample_s", [0.0, 5e-4])
@pytest.mark.parametrize("gain", ["position_gain_per_s", "velocity_gain", "velocity_integral_gain"])
def test_beyond_the_limit_a_pole_grows_and_before_it_none(gain, sample_s):
    servo = replace(thc6350_servo(), sample_s=sample_s, delay_s=0.4 * sample_s)
    limit = stability(replace(AXIS, servo=servo)).gain_limits[gain]
    assert limit is not None
    for factor, stable in ((0.999 * limit, True), (1.001 * limit, False)):
        changed = replace(AXIS, servo=replace(servo, **{gain: factor * getattr(servo, gain)}))
        assert stability(changed).stable is stable


def test_too_little_velocity_gain_has_a_floor():
    found = stability(AXIS)
    floor = found.gain_floors["velocity_gain"]
    assert floor is not None
    assert 0 < floor < 1
    assert not stability(replace(AXIS, servo=replace(thc6350_servo(), velocity_gain=0.99 * floor * 6.0))).stable
    assert found.gain_floors["position_gain_per_s"] is None


def test_poles_of_the_continuous_loop_and_of_fast_samples():
    found = stability(AXIS)
    np.testing.assert_array_equal(np.sort(found.poles), np.sort(closed_loop(AXIS).poles))
    assert found.margin_per_s == -found.poles[0].real
    quick = stability(replace(AXIS, servo=replace(thc6350_servo(), sample_s=1e-5)))
    # first order in the sample time
    assert quick.margin_per_s == pytest.approx(found.margin_per_s, rel=1e-3)


def test_a_gain_that_is_off_has_no_limit():
    found = stability(replace(AXIS, servo=replace(thc6350_servo(), velocity_integral_gain=0.0)))
    assert set(found.gain_limits) == {"position_gain_per_s", "velocity_gain"}


def test_an_unstable_loop_is_told_with_its_poles_and_limits():
    servo = replace(thc6350_servo(), position_gain_per_s=800.0)
    (finding,) = stability_findings(Axis(MECHANICS, servo), "X")
    assert (finding.id, finding.level, finding.where.channel) == ("unstable-loop", "error", "X")
    growing = max(closed_loop(Axis(MECHANICS, servo)).poles, key=np.real)
    hz = abs(growing.imag) / (2 * math.pi)
    assert f"{hz:.3g} Hz" in finding.statement
    assert finding.evidence["frequency_hz"] == [pytest.approx(hz)]
    # the limit in the gain's own unit is that of the stable loop
    limit = 40.0 * stability(AXIS).gain_limits["position_gain_per_s"]
    for said in ("position_gain_per_s", f" {limit:.4g} ", f"({limit / 800:.3g} "):
        assert said in finding.suggestion
    # two roots, each found to 1e-12 in the logarithm of the factor
    assert finding.evidence["gain_limits"]["position_gain_per_s"] == pytest.approx(limit / 800, rel=1e-8)


def test_little_margin_is_a_warning_and_enough_is_silence():
    servo = replace(thc6350_servo(), position_gain_per_s=450.0)
    (finding,) = stability_findings(Axis(MECHANICS, servo), "axis X")
    assert (finding.id, finding.level) == ("little-stability-margin", "warning")
    assert f"{finding.evidence['gain_margin_db']:.1f} dB" in finding.statement
    assert finding.evidence["gain_margin_db"] < 6
    assert not list(stability_findings(AXIS, "X"))
    assert not list(stability_findings(Axis(MECHANICS), "X"))


def test_stability_needs_a_servo():
    with pytest.raises(InputError, match="servo"):
        stability(Axis(MECHANICS))


def test_when_no_factor_helps_it_is_said():
    # 1.5 s of delay at 400 1/s: no single gain of the others repairs it
    servo = Servo(400.0, 5.0, 0.0, sample_s=0.1, delay_s=1.5)
    found = stability(Axis(RigidMechanics(1.0), servo))
    assert not found.stable
    assert set(found.gain_limits.values()) == {0.0}
    (finding,) = stability_findings(Axis(RigidMechanics(1.0), servo), "Y")
    assert all(said in finding.suggestion for said in ("No gain", "delay_s (1.5 s)", "sample_s (100 ms)"))


def test_a_delay_that_no_gain_repairs_is_told_with_gains_that_do():
    servo = Servo(60.0, 2e4, 1e5, sample_s=1e-3, delay_s=0.01)
    axis = Axis(RigidMechanics(100.0, 200.0), servo)
    assert set(stability(axis).gain_limits.values()) == {0.0}
    (finding,) = stability_findings(axis, "X")
    assert "delay_s (10 ms) and sample_s (1 ms)" in finding.suggestion
    gains = {name: float(value) for name, value in re.findall(r"(\w+_gain\w*) ([\d.e+]+\d)", finding.suggestion)}
    assert set(gains) == {"position_gain_per_s", "velocity_gain", "velocity_integral_gain"}
    assert stability(replace(axis, servo=replace(servo, **gains))).stable


def test_a_pole_that_swings_from_sample_to_sample_is_one():
    # z = 1 − Kvp·T/M = −1.5
    axis = Axis(RigidMechanics(1.0), Servo(1e-3, 2500.0, sample_s=1e-3))
    (finding,) = stability_findings(axis, "X")
    # 1 ms/ln(1.5)
    assert all(said in finding.statement for said in ("z = -1.5", "2.47 ms"))
    assert finding.evidence["frequency_hz"] == [pytest.approx(500.0)]


@pytest.mark.parametrize("more", [{"velocity_integral_gain": 1e-5}, {"position_gain_per_s": 1e-7}])
def test_very_slow_poles_are_no_instability(more):
    # both decay, with 5e-10 and 1e-7 1/s, less than the rounding of eigenvalues of 2e4 1/s
    found = stability(Axis(RigidMechanics(100.0, 200.0), replace(Servo(60.0, 2e4, 1e5, sample_s=1e-3), **more)))
    assert found.stable
    assert found.margin_per_s >= 0.0
    assert all(high > 1.0 for high in found.gain_limits.values())


def test_findings_are_json_where_a_margin_is_infinite():
    # second order with little damping: no frequency turns the phase by 180 degrees
    (finding,) = stability_findings(Axis(RigidMechanics(1.0), Servo(1000.0, 40.0)), "X")
    assert f"{finding.evidence['phase_margin_deg']:.1f} degrees" in finding.statement
    assert "dB" not in finding.statement
    assert finding.evidence["gain_margin_db"] is None
    assert json.loads(json.dumps(finding.as_dict(), allow_nan=False))["level"] == "warning"
