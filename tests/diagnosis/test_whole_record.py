"""What is the same in all runs is a fault of the recording only where one response is off and the others are right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.naming import whole_record_effect
from selector.diagnosis.evidence.recalibration import Recalibrated, whole_record_names
from selector.diagnosis.evidence.response import bench_of
from selector.diagnosis.workflow import _STAGES, _Asked, _named, _off_in_unseen, _recalibrated, _State
from selector.recording import Channel
from selector.units import CANONICAL_UNITS
from tests.diagnosis.made import coloured, comparison


def recalibrated(*, error: float = 0.002, **values: float) -> Recalibrated:
    quantities = {
        word: Quantity(value, "1", value - 1.96 * error, value + 1.96 * error) for word, value in values.items()
    }
    return Recalibrated(p_value=1e-9, gain=100.0, share=0.5, quantities=quantities)


def names(z: Recalibrated, y: Recalibrated) -> set[str]:
    nothing = np.zeros(1200)
    return set(whole_record_names(comparison({"Z": nothing, "Y": nothing}), {"Z": z, "Y": y}))


def test_one_response_of_another_scale_than_the_others_is_a_gain():
    assert names(recalibrated(gain=1.05), recalibrated(gain=1.001)) == {"data.gain"}


@pytest.mark.parametrize(
    ("gain", "error"),
    [(1.05, 0.002), (1.05, 0.01), (0.99, 0.002), (1.0, 0.02)],
    ids=["the same", "the same, less sure", "off the other way", "not known"],
)
def test_responses_that_are_off_together_or_not_known_are_no_gain(gain, error):
    assert names(recalibrated(gain=1.05), recalibrated(gain=gain, error=error)) == set()


@pytest.mark.parametrize(
    ("role", "gain", "is_fault"), [("position", 1.05, False), ("position", 25.4, True), ("spindle_speed", 1.05, True)]
)
def test_the_scale_of_an_axis_force_is_a_parameter_of_the_simulation(role, gain, is_fault):
    made = comparison({"Z": np.zeros(1200), "Y": np.zeros(1200)})
    roles = {"Z": "current", "n": role}
    held = {one.name: roles.get(one.name, one.role) for one in made.channels}
    given = replace(made, channels=tuple(Channel(name, role, CANONICAL_UNITS[role]) for name, role in held.items()))
    found = whole_record_names(given, {"Z": recalibrated(gain=gain), "Y": recalibrated(gain=1.001)})
    assert set(found) == ({"data.gain"} if is_fault else set())


def test_a_simulation_that_comes_late_in_all_responses_is_no_clock():
    assert names(recalibrated(delay=18.0, error=2.0), recalibrated(delay=19.0, error=5.0)) == set()
    assert names(recalibrated(delay=18.0, error=2.0), recalibrated(delay=1.0, error=3.0)) == {"data.clock"}


def test_the_factor_of_a_unit_is_a_gain_wherever_it_is_seen():
    assert names(recalibrated(gain=25.4), recalibrated(gain=25.4)) == {"data.gain"}


@pytest.mark.parametrize(("share", "is_sure"), [(0.3, False), (0.9, True)])
def test_a_gain_that_leaves_most_of_the_mismatch_is_half_sure(share, is_sure):
    made = comparison({"Z": np.random.default_rng(0).standard_normal(1200)})
    again = {"Z": replace(recalibrated(gain=1.05), share=share)}
    told = whole_record_effect(made, {"Z": bench_of(made, "Z", ())[0]}, again, "data.gain", {"Z": "gain"})
    assert (told.confidence > 0.5) == is_sure


def test_what_unseen_rows_speak_against_is_asked_without_what_is_no_name():
    made = comparison({"Z": coloured("ar", 1800, np.random.default_rng(5))})
    state = _State(made, _Asked(0, 0.02, catalogue(), lambda done, total, text: None))
    for stage in _STAGES[: _STAGES.index(_named)]:
        state = stage(state)
    state = replace(state, effects=(), structures=(), search=replace(state.search, named={}))
    drift = next(v for v, one in enumerate(state.search.benches["Z"].candidates) if one.effect.id == "data.drift")
    alone = _recalibrated(state)
    beside = _recalibrated(replace(state, search=replace(state.search, named={"data.drift": {"Z": drift}})))
    assert beside.again["Z"].share != alone.again["Z"].share
    told = _off_in_unseen(beside)
    assert told.search.named == {}
    assert told.again["Z"].share == alone.again["Z"].share
