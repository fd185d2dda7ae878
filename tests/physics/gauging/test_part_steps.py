"""Parts that nobody waits for are refused before the first is ground."""

from __future__ import annotations

import pytest

from selector.errors import InputError
from selector.physics.gauging.gauged_grinding import MOST_STEPS_OF_PART, finished_sizes, steps_per_part
from selector.physics.gauging.gauging_model import gauging_model
from selector.physics.gauging.model_file import checked_model_file
from selector.physics.gauging.transducer import Grinding, Noise, Stage
from tests.physics.gauging.set_ups import set_up
from tests.physics.gauging.test_model_file import LINEAR, changed
from tests.work import counted_calls

ENDLESS = {
    "quick noise": (("noise", {"sd_um": 0.1, "rate_per_s": 1e7}), "grinding.stages"),
    "quick noise for 2000 parts": (("noise", {"sd_um": 0.1, "rate_per_s": 1e4}), "run.parts"),
    "a relay of 1 GHz": (("relay", {"noise_v": 0.01, "noise_hold_s": 1e-9}), "grinding.stages"),
    "grooves without end": (
        ("surface", {"workpiece_rpm": 1e5, "grooves": 10_000, "groove_share": 0.1, "groove_depth_um": 1.0}),
        "grinding.stages",
    ),
    "run-out of a turbine": (("surface", {"workpiece_rpm": 1e6, "runout_um": 1.0}), "grinding.stages"),
    "volts for mV": (("thresholds.volts", [0.745, 1e6]), "thresholds.volts"),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDLESS)
def test_what_asks_for_too_many_steps_is_refused_before_it_begins(name):
    change, key = ENDLESS[name]
    setup = gauging_model(checked_model_file(changed(LINEAR, ("run.period_s", 1.0), change))).setup
    with counted_calls() as calls, pytest.raises(InputError) as caught:
        finished_sizes(setup, 2000)
    # to grind one of these would take millions of steps
    assert calls.count < 50_000
    assert caught.value.where == f"key {key}"


def test_steps_are_about_those_that_are_taken():
    """A part of 2.54 s in steps of T_Φ/8 or 1/(4β), whichever is less."""
    grinding = Grinding(22.0, (Stage(20.0, 12.0), Stage(5.0, 2.0)))
    # 10/20 + 10/5 s and two delays of 20 ms
    for noise, step_s in ((Noise(), 0.05 / 8), (Noise(0.01, 1000.0), 0.25e-3)):
        assert steps_per_part(set_up(grinding, noise=noise)) == pytest.approx(2.54 / step_s, rel=1e-9)


def test_the_longest_part_is_over_before_anybody_misses_ctrl_c():
    grinding = Grinding(22.0, (Stage(20.0, 12.0), Stage(5.0, 2.0)))
    setup = set_up(grinding, noise=Noise(0.1, 0.9 * MOST_STEPS_OF_PART / 2.54 / 4.0))
    told: list[int] = []
    finished_sizes(setup, 2, progress=lambda done, of: told.append(done))
    # one part a chunk, of 25 million steps at most: 0.4 s where nothing else runs
    assert told == [1, 2]
    assert 0.5 * MOST_STEPS_OF_PART < steps_per_part(setup) <= MOST_STEPS_OF_PART
