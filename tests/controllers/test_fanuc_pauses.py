"""The macro when nobody calls it for a night, a coffee or a fortnight: nothing is believed at once."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from selector.controllers import read_model
from selector.controllers.guard.decided import Mode
from selector.controllers.replay.macro_b_executed import MacroB, macro_b_answers, macro_corrections_um
from selector.controllers.writers.fanuc import FILE, STATUS, fanuc_export, macro_variables
from tests.controllers.test_fanuc import PATENT, rich, warm_up

NAMES = macro_variables(read_model(PATENT)).program
HAS_BEGUN, START = NAMES["has_start_1"], NAMES["start_1"]


def called(macro, times_s, reading):
    """Status after each call."""
    found = []
    for time_s in times_s:
        macro.variables |= {100: float(time_s), 101: reading, 102: 20.0}
        macro.call()
        found.append(macro.variables[STATUS])
    return found


NIGHTS = [601.0, 43_200.0, 999_999.0, 1.3e6, -5000.0]


@pytest.mark.parametrize("night_s", NIGHTS)
def test_the_evening_is_no_start_of_the_morning(night_s):
    macro = MacroB(fanuc_export(read_model(PATENT)).files[FILE])
    assert called(macro, range(0, 41, 1), 25.0) == [Mode.HOLD] * 41
    morning = 40 + night_s
    # the first call believes nothing, the next begins, six more are needed
    codes = called(macro, [morning + 10 * k for k in range(8)], 19.0)
    assert codes == [Mode.HOLD] * 7 + [Mode.MODEL]
    assert (macro.variables[HAS_BEGUN], macro.variables[START]) == (1.0, 19.0)


@pytest.mark.parametrize("night_s", NIGHTS)
def test_after_a_good_day_the_first_reading_of_the_morning_is_not_believed_at_once(night_s):
    macro = MacroB(fanuc_export(read_model(PATENT)).files[FILE])
    called(macro, range(0, 300, 5), 20.0)
    before = dict(macro.offsets)
    codes = called(macro, [295 + night_s + 10 * k for k in range(8)], 28.0)
    assert codes == [Mode.HOLD] * 7 + [Mode.MODEL]
    assert macro.variables[START] == 20.0
    assert before != macro.offsets


@pytest.mark.parametrize("pause_s", [10.0, 61.0, 600.0])
def test_calls_between_long_cuts_are_enough(pause_s):
    macro = MacroB(fanuc_export(read_model(PATENT)).files[FILE])
    assert called(macro, np.arange(12) * pause_s, 20.0) == [Mode.HOLD] * 6 + [Mode.MODEL] * 6


def test_the_replay_knows_pauses():
    rows = warm_up()
    rows.dt_s[[150, 250]] = 43_200.0, 700.0
    rows = dataclasses.replace(rows, readings=np.minimum(rows.readings, [29.0, 26.0, 3000.0]))
    model = rich(recover_after_s=60.0)
    found = macro_b_answers(model, rows, fanuc_export(model).files)
    np.testing.assert_allclose(found.correction_um, macro_corrections_um(model, rows), rtol=0.0, atol=1e-9)
    assert set(found.mode[[149, 150, 151, 249, 250, 251]]) == {Mode.MODEL, Mode.HOLD}
