"""The workflow of a prediction: both methods against simulated machines, ends of duty cycles, programs, findings."""

from __future__ import annotations

import numpy as np
import pytest

from selector.errors import InputError
from selector.findings import Finding
from selector.physics.thermal.modes import choice
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.prediction import cyclogram_of_rows, predict
from tests.physics.thermal.mode_machines import RESPONSES, heat_and_cool, modal_machine, recorded
from tests.physics.thermal.segments import of_segments

CYCLE = of_segments((40, 1250), (50, 500), (30, 2000), (20, 0), (60, 900), (40, 1800))
OPERATIONS_S = [3000.0, 4200.0, 7200.0]


@pytest.fixture(scope="module")
def machine():
    return modal_machine([600.0, 4000.0], [[25.0, -8.0, 4.0], [35.0, 25.0, 8.0]], [1.2, 1.3])


@pytest.fixture(scope="module")
def tests(machine):
    return recorded(machine, np.random.default_rng(4), 0.2, 60.0, heat_and_cool((800.0, 1250.0, 2000.0)))


@pytest.fixture(scope="module", autouse=True)
def fit(tests):
    """The modes are fitted once: the tests are the same everywhere here."""
    found = choice.choose_modes(tests, RESPONSES)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choice, "choose_modes", lambda *_: found)
        yield found


@pytest.fixture(scope="module")
def modal(tests, fit):
    return predict(tests, RESPONSES, CYCLE, operations_s=OPERATIONS_S, tolerance_um=5.0)


@pytest.fixture(scope="module")
def piecewise(tests):
    return predict(tests, RESPONSES, CYCLE, method="piecewise", operations_s=OPERATIONS_S, tolerance_um=5.0)


def errors(machine, prediction):
    time, _, true = machine.course(CYCLE, 10.0)
    got = np.column_stack(
        [np.interp(time, prediction.time_s, prediction.displacement_um[:, r]) for r in range(len(RESPONSES))]
    )
    return np.abs(got - true).max(axis=0) / np.abs(true).max(axis=0)


def test_modal_prediction(machine, modal):
    # the project's aim for random duty cycles at untested speeds: 2 % along the spindle, 5 % in other axes
    assert errors(machine, modal)[0] < 0.02
    assert errors(machine, modal).max() < 0.05
    for mode, tau in zip(modal.modes, [600.0, 4000.0], strict=True):
        assert mode.tau_s == pytest.approx(tau, rel=0.05)
        assert mode.low < mode.tau_s < mode.high


def test_piecewise_prediction_is_coarser(machine, modal, piecewise):
    along = errors(machine, piecewise)[0]
    assert errors(machine, modal)[0] < along < 0.20  # twice what its source claims: two modes far apart
    assert piecewise.modes == ()


@pytest.mark.parametrize("method", ["modal", "piecewise"])
def test_grid(method, request):
    prediction = request.getfixturevalue(method)
    time = prediction.time_s
    assert (np.diff(time) > 0).all()
    assert np.diff(time).max() <= 60.0 + 1e-9
    assert np.isin(np.r_[CYCLE.start_s, CYCLE.end_s, np.cumsum(OPERATIONS_S)], time).all()


def test_course_is_straight_between_its_times(fit, modal):
    fine = np.linspace(0, CYCLE.end_s, 20_001)
    exact = fit.model.displacement_um(CYCLE, fine)
    for r in range(3):
        chord = np.interp(fine, modal.time_s, modal.displacement_um[:, r])
        # 2e-5 of the peak where it was looked at, the middle of each step, which is where a smooth bend is furthest
        assert np.abs(chord - exact[:, r]).max() < 3e-5 * np.abs(exact).max()


def test_drift_is_within_the_tolerance_when_the_prediction_is_exact(modal):
    for r, name in enumerate(RESPONSES):
        _, left = modal.programs[name].drift_left_um(modal.time_s, modal.displacement_um[:, r])
        assert np.abs(left).max() <= 5.0 * (1 + 1e-8)  # rounding of the times


def test_honest_excess(machine, modal, piecewise):
    time, _, true = machine.course(CYCLE, 60.0)
    for prediction in (modal, piecewise):
        off = np.abs(np.interp(time, prediction.time_s, prediction.displacement_um[:, 0]) - true[:, 0]).max()
        _, left = prediction.programs["Z"].drift_left_um(time, true[:, 0])
        # the zero of an operation and the displacement are both off by the prediction's error at most
        assert np.abs(left).max() <= 5.0 + 2 * off + 1e-6
    assert "drift-beyond-tolerance" in {finding.id for finding in modal.findings}


def test_ends_of_duty_cycles():
    time, speed = np.array([0.0, 3600.0, 7200.0]), np.array([1000.0, 0.0, 2000.0])
    cycle, findings = cyclogram_of_rows(time, speed)
    assert (cycle.end_s, cycle.speed_rpm.tolist()) == (7200.0, [1000.0, 0.0])
    assert [finding.id for finding in findings] == ["last-row-is-the-end"]
    cycle, findings = cyclogram_of_rows(time, speed, [3600.0, 7200.0])
    assert (cycle.end_s, cycle.speed_rpm.tolist()) == (10800.0, [1000.0, 0.0, 2000.0])
    assert [finding.id for finding in findings] == ["last-speed-held"]
    cycle, findings = cyclogram_of_rows(time, np.array([1000.0, 0.0, 0.0]), [600.0])
    assert (cycle.end_s, findings) == (7200.0, ())
    cycle, _ = cyclogram_of_rows(np.zeros(1), np.array([800.0]), [600.0])
    assert (cycle.end_s, cycle.speed_rpm.tolist()) == (600.0, [800.0])
    with pytest.raises(InputError, match="operations"):
        cyclogram_of_rows(np.zeros(1), np.array([800.0]))


def test_what_was_assumed_is_told(tests):
    ids = {
        finding.id for finding in predict(tests, RESPONSES, CYCLE, method="piecewise", operations_s=[600.0]).findings
    }
    assert {"usual-tolerance", "operations-end-early", "sign-not-verified"} <= ids
    prediction = predict(tests, RESPONSES, CYCLE, method="piecewise", tolerance_um=3.0)
    assert "one-operation" in {finding.id for finding in prediction.findings}
    assert prediction.programs["Z"].operations[0].end_s == CYCLE.end_s


def test_findings_of_earlier_steps_stand_first_and_none_twice(tests):
    earlier = Finding("gap", "info", "A gap.")
    for method in ("modal", "piecewise"):
        findings = predict(tests, RESPONSES, CYCLE, method=method, tolerance_um=3.0, told=[earlier]).findings
        assert findings[0] is earlier
        said = [(finding.id, finding.where, finding.statement) for finding in findings]
        assert len(said) == len(set(said))


def test_runs_without_readings_are_left_out_and_told(tests):
    empty = ThermalTest(
        "gauge off", tests[0].time_s, tests[0].speed_rpm, np.full_like(tests[0].displacement_um, np.nan)
    )
    prediction = predict([empty, *tests], RESPONSES, CYCLE, method="piecewise")
    assert [finding.where.run for finding in prediction.findings if finding.id == "test-left-out"] == ["gauge off"]
    with pytest.raises(InputError) as refused:
        predict([empty], RESPONSES, CYCLE)
    assert refused.value.where == "the tests"
    assert all(response in refused.value.found for response in RESPONSES)


def test_a_machine_that_stands_stays_at_zero(tests):
    idle = of_segments((60, 0.0))
    for method in ("modal", "piecewise"):
        assert np.abs(predict(tests, RESPONSES, idle, method=method).displacement_um).max() == 0.0
