"""The guard of the fixed-point program: wrong times, wrong tests, and what was put back after a restart."""

from __future__ import annotations

import numpy as np
import pytest

from selector.controllers import Input, ModelFile, Output, Term
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
