from __future__ import annotations

import numpy as np
import pytest

from selector.errors import InputError, OptionError
from selector.physics.checks import errors_name, require_within


def refused(where: str) -> InputError:
    return OptionError("0", expected="more", where=where, advice="correct it")


def test_errors_say_what_they_are_about():
    with pytest.raises(OptionError) as caught, errors_name("run a"), errors_name("axis X"):
        raise refused("recorded course")
    assert caught.value.where == "run a, axis X, recorded course"


def test_keys_of_a_file_stay_in_front():
    with pytest.raises(OptionError) as caught, errors_name("run a", of_keys=True), errors_name("axis X"):
        raise refused("key run.step_s")
    assert caught.value.where == "key run.step_s, run a"


def test_courses_within_and_beyond():
    time_s = np.array([0.0, 0.5, 1.0])
    require_within(np.array([1.0, np.nan, -1e4]), time_s, 1e4, "m")
    with pytest.raises(InputError, match=r"1e\+300 m at 0\.5 s \(row 2\)"):
        require_within(np.array([1.0, 1e300, 1e301]), time_s, 1e4, "m")
