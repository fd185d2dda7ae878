from __future__ import annotations

import pytest

from selector.errors import InputError
from selector.physics.drive.drive_model import require_few_steps
from selector.physics.drive.parts.axis import Axis, RigidMechanics, Servo


def axis(sample_s: float) -> Axis:
    return Axis(RigidMechanics(100.0, 200.0), Servo(60.0, 2e4, sample_s=sample_s))


def test_steps_are_counted_as_they_are_laid():
    # 400 samples of the reference, each with a million of the control: steps of 1000 s are none
    with pytest.raises(InputError) as caught:
        require_few_steps("X", axis(1e-3), 4e5, 1000.0, period_s=1000.0)
    assert caught.value.where == "key axes.X.servo.sample_s"
    assert "4e+08 steps of 0.001 s" in caught.value.found
    # samples of the reference and of the control that share 0.1 ms
    with pytest.raises(InputError, match=r"3\.5e\+07 steps of 0\.0001 s"):
        require_few_steps("X", axis(1e-3), 3500.0, 7e-4, period_s=7e-4)
    require_few_steps("X", axis(1e-3), 1500.0, 7e-4, period_s=7e-4)


def test_a_step_that_is_too_short_is_named():
    with pytest.raises(InputError) as caught:
        require_few_steps("X", axis(0.0), 10.0, 1e-8)
    assert caught.value.where == "key run.step_s"
    require_few_steps("X", axis(0.0), 10.0, 1e-6)
