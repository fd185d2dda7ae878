"""The guard of the fixed-point program: wrong times, wrong tests, and what was put back after a restart."""

from __future__ import annotations

import numpy as np
import pytest

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, PositionPart, Term
from selector.controllers.replay.compiled import compiler
from tests.controllers.test_fixed_point import Compiled

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")


@pytest.mark.parametrize("wrong", [2**31 - 1, 10**9 + 1, 10**9, 61_000])
def test_one_wrong_time_makes_no_reading_believed(wrong, tmp_path):
    model = ModelFile(
        name="guarded",
        inputs=(Input(name="T1", valid_min=-1.0, valid_max=8.0, rate_limit_per_min=1.5),),
        outputs=(Output(name="Z", intercept=5.0, terms=(Term(powers={"T1": 1}, coefficient=1.0),)),),
    )
    run = Compiled(model, tmp_path)
    dt_ms = np.array([1000, wrong, *[1000] * 80, 1000, 1000, wrong, *[1000] * 80])
    readings = np.array([20_000] * 82 + [850_000] + [20_000] * 82)
    codes = run({"dt_ms": dt_ms, "reading_1": readings})["sensor_1"]
    for first in (0, 83):
        assert set(codes[first : first + 51]) == {2}
        assert set(codes[first + 62 : first + 81]) == {0}
    assert codes[82] == 4


@pytest.mark.parametrize("missing", [-(2**31), 2**31 - 1])
def test_both_ends_of_32_bits_are_missing_everywhere(missing, tmp_path):
    part = PositionPart(axis="Z", reference_m=0.0, valid_min_m=0.0, valid_max_m=0.5, intercept=40.0)
    model = ModelFile(
        name="ends",
        inputs=(Input(name="T1", valid_min=-1.0, valid_max=8.0),),
        outputs=(Output(name="Z", intercept=0.0, position=part), Output(name="Y", intercept=3.0)),
        guard=Guard(recover_after_s=0.0),
    )
    n = 200
    position, test_nm = np.full(n, 250_000), np.zeros(n, dtype=int)
    position[100:], test_nm[100:] = missing, missing
    found = Compiled(model, tmp_path)(
        {"dt_ms": [1000] * n, "reading_1": [20_000] * n, "position_1": position, "test_nm_1": test_nm}
    )
    assert set(found["mode"]) == {1}
    assert set(found["axis_1"][100:]) == {3}
    assert set(found["correction_1"][90:]) == {-10_000}
    assert found["correction_2"][-1] == -3000


@pytest.mark.parametrize("missing", [-(2**31), 2**31 - 1])
def test_an_end_of_32_bits_commands_nothing_beside_another_test(missing, tmp_path):
    model = ModelFile(
        name="two",
        inputs=(Input(name="T1", valid_min=-1.0, valid_max=8.0),),
        outputs=(Output(name="Z", intercept=2.0), Output(name="Y", intercept=3.0)),
    )
    n = 60
    tests = {"test_nm_1": np.where(np.arange(n) < 5, 0, missing), "test_nm_2": np.where(np.arange(n) < 5, 0, 1500)}
    found = Compiled(model, tmp_path)({"dt_ms": [1000] * n, "reading_1": [20_000] * n, **tests})
    assert (found["mode"][-1], found["correction_1"][-1], found["correction_2"][-1]) == (5, 0, 1500)


def test_a_sign_test_needs_a_zero_before_it_and_ends_by_itself(tmp_path):
    limits = (OutputLimits(output="Z", clamp_um=10.0, slew_um_per_s=1.0),)
    model = ModelFile(
        name="latch",
        inputs=(Input(name="T1", valid_min=-1.0, valid_max=8.0),),
        outputs=(Output(name="Z", intercept=2.0),),
        guard=Guard(recover_after_s=0.0, limits=limits),
    )
    n = 900
    test_nm, ready, restart = np.full(n, 1500), np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
    test_nm[[5, 20, 30, 40]], ready[10:15], restart[35] = 0, False, True
    found = Compiled(model, tmp_path)(
        {"dt_ms": [1000] * n, "reading_1": [20_000] * n, "test_nm_1": test_nm, "is_ready": ready, "is_restart": restart}
    )
    tested = found["mode"] == 5
    assert not tested[:6].any()
    assert tested[6:10].all()
    assert not tested[10:21].any(), "not ready, and no zero since"
    assert tested[21:30].all()
    assert tested[31:35].all()
    assert not tested[35:41].any(), "restart, and no zero since"
    assert tested[41 : 41 + 620].all()
    assert not tested[41 + 622 :].any()
    assert (found["mode"][-1], found["correction_1"][-1]) == (4, 0), "what is forgotten goes to zero"
