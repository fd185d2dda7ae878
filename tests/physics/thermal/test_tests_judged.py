"""What is doubtful about tests is told with the names of run and channel, and nothing about good ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.thermal.modes.modes import ModalModel, SpeedLaw
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.answer import (
    RepeatedTest,
    contradiction_findings,
    movement_findings,
    speed_findings,
    warm_start_findings,
)
from selector.physics.thermal.prediction.prediction import predict
from tests.physics.thermal.mode_machines import RESPONSES, heat_and_cool, modal_machine, recorded
from tests.physics.thermal.segments import of_segments


@pytest.fixture(scope="module")
def tests():
    machine = modal_machine([600.0, 4000.0], [[25.0, -8.0, 4.0], [35.0, 25.0, 8.0]], [1.2, 1.3])
    return recorded(machine, np.random.default_rng(4), 0.2, 60.0, heat_and_cool((800.0, 1250.0, 2000.0)))


def cut(test, rows):
    time = test.time_s[rows]
    return ThermalTest(test.run, time - time[0], test.speed_rpm[rows], test.displacement_um[rows])


def repeats(tests, error_um):
    return [
        RepeatedTest(one.run, one.time_s, one.speed_rpm, one.displacement_um, one.displacement_um + off)
        for one, off in zip(tests, error_um, strict=True)
    ]


def test_nothing_is_told_of_good_tests(tests):
    assert list(movement_findings(tests, RESPONSES)) == []
    assert list(warm_start_findings(tests, RESPONSES)) == []
    assert list(contradiction_findings(tests, repeats(tests, [0.2, 0.3, 0.2]), RESPONSES)) == []
    assert [f.id for f in speed_findings(tests, of_segments((60, 1000), (60, 0)))] == ["no-speed-tested-twice"]


@pytest.mark.parametrize("level", [0.0, 5.3])
@pytest.mark.parametrize("method", ["modal", "piecewise"])
def test_a_dead_gauge_is_refused(tests, level, method):
    dead = []
    for test in tests:
        displacement = test.displacement_um.copy()
        displacement[:, 1] = level
        dead.append(replace(test, displacement_um=displacement))
    with pytest.raises(InputError) as refused:
        predict(dead, RESPONSES, of_segments((60, 1000)), method=method)
    assert refused.value.found.startswith("Y ")
    assert " 0 µm " in refused.value.found


def test_noise_alone_is_told(tests):
    rng = np.random.default_rng(1)
    noise = [replace(test, displacement_um=rng.normal(0.0, 0.3, (len(test.time_s), 1))) for test in tests]
    assert [finding.id for finding in movement_findings(noise, ["Z"])] == ["no-thermal-movement"]


def test_warm_starts_are_named(tests):
    # 100 minutes of heating are cut off
    warm = [cut(tests[0], slice(100, None)), *tests[1:]]
    assert [(f.id, f.where.run) for f in warm_start_findings(warm, RESPONSES)] == [("run-begins-warm", tests[0].run)]


@pytest.mark.parametrize(("missing", "ids"), [(2, ["run-begins-warm"]), (30, [])])
def test_of_a_gauge_that_begins_long_after_the_spindle_no_start_is_known(tests, missing, ids):
    warm = cut(tests[0], slice(100, None))
    displacement = warm.displacement_um.copy()
    displacement[:missing] = np.nan
    assert [f.id for f in warm_start_findings([replace(warm, displacement_um=displacement)], RESPONSES)] == ids


def test_a_reversed_gauge_is_named(tests):
    turned = [replace(tests[0], displacement_um=-tests[0].displacement_um), *tests[1:]]
    found = list(contradiction_findings(turned, repeats(turned, [0.2] * 3), ["Z"]))
    assert [(f.id, f.where.run, f.where.channel) for f in found] == [("run-contradicts-others", tests[0].run, "Z")]


def test_a_run_far_beyond_the_others_is_named(tests):
    found = list(contradiction_findings(tests, repeats(tests, [0.2, 30.0, 0.3]), ["Z"]))
    assert [f.where.run for f in found] == [tests[1].run]


def test_speeds_that_the_tests_say_little_about(tests):
    other = of_segments((60, 1000), (60, 2000))
    assert [f.id for f in speed_findings(tests[2:], other)] == ["one-speed-tested"]
    assert list(speed_findings(tests[2:], of_segments((60, 2000), (60, 0)))) == []
    slow = list(speed_findings(tests, of_segments((60, 1.5))))
    assert [f.id for f in slow] == ["no-speed-tested-twice", "slower-than-tests"]
    assert "1.5 r/min" in slow[1].statement
    assert "800 r/min" in slow[1].statement


def test_tests_without_any_cooling(tests):
    heating = [cut(test, test.speed_rpm > 0) for test in tests]
    found = predict(heating, RESPONSES, of_segments((60, 1000), (30, 0)), method="piecewise").findings
    assert "cooling-assumed" in {finding.id for finding in found}


@pytest.mark.parametrize("method", ["modal", "piecewise"])
def test_twelve_samples(tests, method):
    short = [cut(test, slice(0, 12)) for test in tests]
    found = predict(short, RESPONSES, of_segments((10, 1000)), method=method).findings
    assert not any("nan" in finding.statement for finding in found)


def test_the_end_of_a_duty_cycle_may_be_off_by_rounding():
    law = SpeedLaw((1.2,), 2000.0)
    model = ModalModel(("Z",), np.array([600.0]), np.array([[[30.0]]]), law, 2000.0, np.zeros(1))
    cycle = of_segments((60, 1000))
    beyond, end = model.displacement_um(cycle, cycle.end_s * np.array([1.0 + 5e-10, 1.0]))
    assert beyond == pytest.approx(end, rel=1e-6)  # 1e-9 of an hour is no time for modes of minutes
