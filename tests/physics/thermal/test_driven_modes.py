"""Modes that speed and hall drive, on simulated machines whose law of the hall is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError, OptionError
from selector.physics.thermal.modes import driven_model as fits
from selector.physics.thermal.modes.choice import choose_modes
from selector.physics.thermal.modes.driven import _evidence, _whitened_loop
from selector.physics.thermal.modes.driven_model import driven_model
from selector.physics.thermal.modes.heldout import few_factor
from selector.physics.thermal.modes.modes import AmbientCourse
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.prediction import predict
from tests.physics.thermal.driven_machines import (
    CYCLE,
    FASTEST_RPM,
    HALL_UM_PER_K,
    TAU_S,
    course_um,
    hall_at,
    long_record,
    truth_after,
)
from tests.physics.thermal.mode_machines import RESPONSES, heat_and_cool, modal_machine, random_bar, recorded
from tests.physics.thermal.segments import of_segments

PAIR = ("Z", "X")


@pytest.fixture(autouse=True, scope="module")
def fitted_once():
    """Models and predictions of the same tests share their fit, the same whatever the prediction asks."""
    known = {}

    def shared(tests, responses, *, whatever=False):
        key = (*map(id, tests), *responses)
        # the tests are kept with their fit, so that no others get their identity
        _, model = known.get(key, (tests, None))
        if model is None:
            model = driven_model(tests, responses, whatever=whatever)
            known[key] = tests, model
        return model

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fits, "driven_model", shared)
        yield shared


@pytest.fixture(scope="module")
def record():
    return long_record(np.random.default_rng(1))


@pytest.fixture(scope="module")
def model(record, fitted_once):
    return fitted_once([record[0]], PAIR)


@pytest.fixture(scope="module")
def three_speeds():
    """Tests of a machine in a hall of one temperature, each from rest."""
    machine = modal_machine([600.0, 4000.0], [[25.0, -8.0, 4.0], [35.0, 25.0, 8.0]], [1.2, 1.3])
    return recorded(machine, np.random.default_rng(4), 0.2, 60.0, heat_and_cool((800.0, 1250.0, 2000.0)))


@pytest.fixture(scope="module")
def one_response(three_speeds):
    """The first response of these tests, which is enough where all would do, and its model."""
    tests = [replace(one, displacement_um=one.displacement_um[:, :1]) for one in three_speeds]
    return tests, driven_model(tests, RESPONSES[:1], whatever=True)


@pytest.fixture(scope="module")
def wandering():
    test, end = long_record(np.random.default_rng(2), walk_um=0.5)
    return driven_model([test], PAIR), end


def ids(prediction):
    return [finding.id for finding in prediction.findings]


def test_a_long_record_is_cut_where_the_spindle_turns_after_a_rest(model):
    assert model.part_names == tuple(f"days test {k}" for k in range(1, 6))
    # each test begins with the last block at rest: of 10 min standing, blocks are below 12 min
    assert [part.from_s for part in model.parts] == pytest.approx([k * 480 * 60 for k in range(5)], abs=1800)


def test_breaks_of_an_intermittent_run_do_not_cut_it():
    rng = np.random.default_rng(0)
    machine = modal_machine((600, 5400), [[20, 10, 5], [30, -10, 15]], (1.2, 1.2))
    breaks = of_segments(*[(40.0, 2000.0), (20.0, 0.0)] * 6)
    assert driven_model(recorded(machine, rng, 0.1, 60.0, {"a": breaks}), RESPONSES) is None


def test_time_constants_and_the_law_of_the_hall_are_recovered(model):
    assert len(model.fit.tau_s) == 2
    # 95 % intervals, twice as wide: both of them miss once in 10 000 times
    spread = np.log(model.tau_high_s / model.tau_low_s)
    assert (np.abs(np.log(model.fit.tau_s / TAU_S)) < spread).all()
    steady = AmbientCourse(np.array([0.0, 1.0]), np.array([[20.0], [21.0]]), ("hall",))
    long = of_segments((3000.0, 0.0))
    moved = model.displacement_um(long, np.array([long.end_s]), steady, follows=False)[0]
    # a kelvin for 50 h; gauges of 0.1 µm and 2400 samples under 4 K of hall leave below 1 % of 3 µm
    np.testing.assert_allclose(moved, HALL_UM_PER_K.sum(axis=0), atol=0.05)


def test_the_duty_cycle_after_the_record_is_predicted_from_its_state(record, model):
    time, hall, true = truth_after(record[1])
    found = model.displacement_um(CYCLE, time, hall, follows=True)
    # 0.1 µm of noise on 20 µm; the law n^1.2 and both time constants are found
    assert np.abs(found - true).max() < 0.1
    cold = model.displacement_um(CYCLE, time, hall, follows=False)
    assert np.abs(cold - true).max() > 2.0  # what is left of five tests
    constant = model.displacement_um(CYCLE, time, None, follows=True)
    assert np.abs(constant - true).max() > 0.5  # what the hall does in five hours


def test_a_cold_duty_cycle_counts_from_equilibrium_with_its_hall(model):
    time = np.arange(0.0, CYCLE.end_s + 1.0, 60.0)
    degc = hall_at(time + 3e4)
    true, _ = course_um(CYCLE, time, degc)
    hall = AmbientCourse(time, degc[:, None], ("hall",))
    assert np.abs(model.displacement_um(CYCLE, time, hall, follows=False) - true).max() < 0.2  # as above, and steps


def test_tests_are_repeated(record, model):
    prediction = predict([record[0]], PAIR, CYCLE)
    assert [one.run for one in prediction.repeats] == list(model.part_names)
    # noise of 0.1 µm, the hall held within blocks of 12 min, and blocks of the start
    assert max(one.rmse_um.max() for one in prediction.repeats) < 0.2
    assert prediction.start == "tests"
    assert {"record-cut-into-tests", "start-of-the-duty-cycle", "unmeasured-drift"} <= set(ids(prediction))
    assert "time-constant-unbounded" not in ids(prediction)
    assert "run-begins-warm" not in ids(prediction)


def test_slow_drift_is_told_and_makes_no_time_constant(wandering):
    model, _ = wandering
    # 40 h of a walk tell its size within 20 % if nothing else moved; the modes take their share
    assert (np.abs(np.log(model.walk_um(3600.0) / 0.5)) < np.log(1.6)).all()
    assert np.isfinite(model.tau_high_s).all()
    assert (model.tau_low_s < TAU_S).all()
    assert (model.tau_high_s > TAU_S).all()


def test_the_claimed_error_is_that_of_unseen_duty_cycles(model, record, wandering):
    ratios = []
    for one, end in ((model, record[1]), wandering):
        time, hall, true = truth_after(end)
        found = one.displacement_um(CYCLE, time, hall, follows=True)
        claimed = one.error_um(CYCLE, time, hall, follows=True)
        ratios.append(np.sqrt(((found - true) ** 2).mean(axis=0) / (claimed**2).mean(axis=0)))
    # the walk goes on in what was claimed, not in this truth: claims may be too large, never far too small
    assert np.max(ratios) < 1.5


def test_without_a_hall_and_long_runs_nothing_changes(three_speeds):
    tests = three_speeds
    assert driven_model(tests, RESPONSES) is None
    still = [replace(test, ambient_degc=np.full(len(test.time_s), 21.0), ambients=("hall",)) for test in tests]
    assert driven_model(still, RESPONSES) is None
    foreseen = AmbientCourse(np.zeros(1), np.array([[25.0]]), ("hall",))
    cycle = of_segments((60, 1000.0))
    prediction = predict(still, RESPONSES, cycle, hall=foreseen)
    model = choose_modes(still, RESPONSES).model
    np.testing.assert_array_equal(prediction.displacement_um, model.displacement_um(cycle, prediction.time_s))
    assert "ambient-not-used" in ids(prediction)


def test_one_test_claims_nothing():
    test, _ = long_record(np.random.default_rng(3))
    first = test.time_s < 480 * 60
    one = ThermalTest("one", test.time_s[first], test.speed_rpm[first], test.displacement_um[first], None)
    prediction = predict([one], PAIR, of_segments((60, 1500.0)), start="tests")
    assert "claimed-error-unknown" in ids(prediction)
    assert not np.isfinite(prediction.claimed_um).any()
    assert prediction.as_dict()["accuracy"]["Z"]["claimed_um"] is None


def test_temperatures_are_told_in_kelvin(record):
    prediction = predict([record[0]], PAIR, CYCLE, temperatures=["X"], operations_s=[3600.0])
    told = prediction.as_dict()
    assert list(told["displacement_um"]) == ["Z"]
    assert list(told["temperature_k"]) == ["X"]
    assert {one["response"] for one in told["program"]} == {"Z"}
    (drift,) = [finding for finding in prediction.findings if finding.id == "unmeasured-drift"]
    assert " K in X" in drift.statement
    assert " µm in Z" in drift.statement


def test_what_cannot_be_used_is_refused(record):
    with pytest.raises(InputError, match="fastest tested"):
        predict([record[0]], PAIR, of_segments((60, 1.1 * FASTEST_RPM)))
    with pytest.raises(OptionError, match="begin warm"):
        predict([record[0]], PAIR, CYCLE, method="piecewise", start="tests")


def test_convection_that_grows_with_the_speed_is_followed():
    rng = np.random.default_rng(6)
    machine = random_bar(rng, film=1.0)
    speeds = (800.0, 2000.0, 1250.0, 1600.0)
    record = of_segments(*[part for n in speeds for part in ((10.0, 0.0), (200.0, n), (300.0, 0.0))])
    time, speed, states = machine.states(record, 60.0)
    read = states @ machine.output.T + rng.normal(0.0, 0.1, (len(time), 3))
    model = driven_model([ThermalTest("bar", time, speed, read)], RESPONSES)
    assert model.fit.spec.film == "growing"
    cycle = of_segments((40, 1800.0), (20, 0.0), (60, 1000.0), (30, 0.0), (40, 2000.0))
    time, _, true = machine.course(cycle, 60.0, states[-1])
    found = model.displacement_um(cycle, np.minimum(time, cycle.end_s), None, follows=True)
    # a continuum of modes by four at most: 2 % of 60 µm are asked for
    assert np.abs(found - (true - true[0]))[:, 0].max() < 0.02 * 60.0


def test_whitening_is_generalised_least_squares_upon_an_unknown_zero():
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(60.0, 900.0, 30))
    variance = rng.uniform(0.01, 0.1, 30)
    variance[:2] = np.inf  # rows that tell nothing
    values = rng.standard_normal((30, 3))
    found, logs = _whitened_loop(values, time, variance, 1e-4, 0.3, 1200.0, np.arange(30) == 0)
    since, values, variance = (time - time[2])[2:], values[2:], variance[2:]
    covariance = 1e-4 * (time[2] + np.minimum.outer(since, since)) + np.diag(variance)
    covariance += 0.3 * np.exp(-np.abs(np.subtract.outer(since, since)) / 1200.0)
    known = np.linalg.inv(covariance)
    of_zero = known.sum(axis=0)
    without_zero = known - np.outer(of_zero, of_zero) / of_zero.sum()
    np.testing.assert_allclose(found.T @ found, values.T @ without_zero @ values, rtol=1e-9)
    assert logs == pytest.approx(0.5 * (np.linalg.slogdet(covariance)[1] + np.log(of_zero.sum())), abs=1e-9)


def test_the_evidence_is_the_density_of_the_last_column_with_coefficients_about_zero():
    rng = np.random.default_rng(6)
    values, gain = rng.standard_normal((40, 4)), np.array([2.0, 0.3, 5.0])
    first = np.isin(np.arange(40), [0, 17])
    arguments = (np.arange(40.0) * 300.0, np.full(40, 0.1), 1e-4, 0.3, 900.0, first)
    rows, logs = _whitened_loop(values, *arguments)
    found, root, half = _evidence(rows, logs, gain)
    scaled, aim = rows[:, :-1] * gain, rows[:, -1]
    covariance = scaled @ scaled.T + np.eye(40)
    wanted = logs + 0.5 * (np.linalg.slogdet(covariance)[1] + aim @ np.linalg.solve(covariance, aim))
    assert found == pytest.approx(wanted, rel=1e-12)
    precision = scaled.T @ scaled + np.eye(3)
    np.testing.assert_allclose(root @ root.T, precision, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.solve(root.T, half), np.linalg.solve(precision, scaled.T @ aim), rtol=1e-9)


def test_where_gauge_and_thermometer_stood_at_first_does_not_matter(record, model):
    test = record[0]
    moved = replace(
        test, displacement_um=test.displacement_um + np.array([10.0, -300.0]), ambient_degc=test.ambient_degc + 5.0
    )
    other = driven_model([moved], PAIR)
    np.testing.assert_array_equal(other.fit.tau_s, model.fit.tau_s)
    time, hall, _ = truth_after(record[1])
    warmer = AmbientCourse(hall.time_s, hall.ambient_degc + 5.0, hall.names)
    here = model.displacement_um(CYCLE, time, hall, follows=True)
    there = other.displacement_um(CYCLE, time, warmer, follows=True)
    np.testing.assert_allclose(there, here, atol=1e-9)  # roundings


def test_runs_with_zeros_of_their_own_are_as_one_zero(one_response):
    tests, model = one_response
    moved = [replace(one, displacement_um=one.displacement_um + 100.0 * k) for k, one in enumerate(tests)]
    cycle = of_segments((60, 1000.0), (30, 0.0))
    time = np.linspace(0.0, cycle.end_s, 50)
    other = driven_model(moved, RESPONSES[:1], whatever=True)
    here, there = (one.displacement_um(cycle, time, None, follows=False) for one in (model, other))
    np.testing.assert_allclose(there, here, atol=1e-9)  # roundings


def test_a_claim_is_nearer_to_the_larger_of_what_tests_were_off_and_what_the_fit_expects(one_response):
    """Two thirds of the way, by ratio; of few tests, whose errors say little, so much more."""
    _, model = one_response
    cycle = of_segments((60, 1000.0), (30, 0.0))
    time = np.linspace(0.0, cycle.end_s, 50)

    def claimed(times):
        unseen = replace(model.unseen, error_um=times * model.unseen.error_um)
        return replace(model, unseen=unseen).error_um(cycle, time, None, follows=False)

    # exact but for rounding; the powers are those of two thirds and of one third
    np.testing.assert_allclose(claimed(8e6), 400.0 * claimed(1e3), rtol=1e-12)
    np.testing.assert_allclose(claimed(1e-3), 20.0 * claimed(1e-3 / 8e3), rtol=1e-12)
    few = replace(model, unseen=replace(model.unseen, error_um=np.where(np.arange(3) == 1, 1.0, np.nan)[:, None]))
    once = replace(model, unseen=replace(model.unseen, error_um=np.ones((3, 1))))
    raised, usual = (one.error_um(cycle, time, None, follows=False) for one in (few, once))
    np.testing.assert_allclose(raised, few_factor(1) / few_factor(3) * usual, rtol=1e-12)


def separate_tests(rng, *, warm):
    """Tests in runs of their own; warm ones begin where the one before ended."""
    tests, end = [], None
    for k, speed in enumerate((2000.0, 5000.0, 1000.0, 3500.0)):
        day = of_segments((10.0, 0.0), (150.0, speed), (120.0, 0.0))
        time = np.arange(0.0, day.end_s, 60.0)
        degc = hall_at(time + (day.end_s if warm else 3e4) * k)
        # the states count from the equilibrium with the hall at the start of the run
        course, end = course_um(day, time, degc, start_um=end if warm else None)
        read = course + rng.normal(0.0, 0.1, course.shape)
        tests.append(ThermalTest(f"r{k}", time, day.speed_at(time), read, degc[:, None], ("hall",)))
        end = end - (degc[-1] - degc[0]) * HALL_UM_PER_K
    return tests, end


def foreseen(from_s):
    """Times of the duty cycle that begins so late, and the hall then."""
    time = np.arange(0.0, CYCLE.end_s + 1.0, 60.0)
    degc = hall_at(time + from_s)
    return time, degc, AmbientCourse(time, degc[:, None], ("hall",))


def test_tests_that_begin_warm_are_told_and_what_that_may_cost_is_claimed():
    tests, end = separate_tests(np.random.default_rng(9), warm=True)
    time, degc, hall = foreseen(4 * 280 * 60.0)  # right after them
    untold, cold, after = (predict(tests, PAIR, CYCLE, hall=hall, start=start) for start in (None, "cold", "tests"))
    warm = {one.where.run for one in untold.findings if one.id == "start-not-at-rest"}
    # the first begins cold; the third follows the fastest speed
    assert "r0" not in warm
    assert "r2" in warm
    true, _ = course_um(CYCLE, time, degc, start_um=end)

    def left(prediction):
        found = np.column_stack([np.interp(time, prediction.time_s, one) for one in prediction.displacement_um.T])
        return np.sqrt(((found - (true - true[0])) ** 2).mean(axis=0))

    np.testing.assert_array_equal(untold.displacement_um, cold.displacement_um)
    assert (left(untold) < 1.5 * untold.claimed_um).all()  # the factor that is promised
    assert (untold.claimed_um > 1.5 * cold.claimed_um).all()
    named = {one.where.channel: one.evidence for one in untold.findings if one.id == "gain-uncertain"}
    moves = np.sqrt(np.mean(untold.displacement_um**2, axis=0))
    few = untold.claim_factor
    assert list(named) == ["X"]
    assert (untold.claimed_um * few > moves).tolist() == [False, True]
    assert (left(after) < 0.2 * left(untold)).all()  # the law is known but for the state


def test_separate_tests_in_a_hall_claim_an_error_that_is_borne_out():
    tests, _ = separate_tests(np.random.default_rng(8), warm=False)
    time, degc, hall = foreseen(2e5)
    true, _ = course_um(CYCLE, time, degc)
    prediction = predict(tests, PAIR, CYCLE, hall=hall)
    # the fastest is not left out: nobody asks beyond it
    assert set(prediction.left_out_um) == {"r0", "r2", "r3"}
    assert prediction.claim_factor == 2.0
    # what the error may be is a reason to record more only where it decides about a tolerance
    assert "few-tests" not in ids(prediction)
    between = float(np.sqrt(prediction.claim_factor) * prediction.claimed_um[0])
    allowed = predict(tests, PAIR, CYCLE, hall=hall, tolerance_um={PAIR[0]: between, PAIR[1]: 1000.0})
    (told,) = [finding for finding in allowed.findings if finding.id == "few-tests"]
    assert told.where.channel == PAIR[0]
    assert told.evidence["tests"] == 3
    assert told.evidence["claimed_um"] == pytest.approx(prediction.claimed_um[0], rel=0.05)  # another grid of times
    found = np.column_stack([np.interp(time, prediction.time_s, one) for one in prediction.displacement_um.T])
    off = np.sqrt(((found - true) ** 2).mean(axis=0)) / prediction.claimed_um
    # its law is among those of the fit, so that it may be much better than claimed, but not worse
    assert (off < prediction.claim_factor).all()
    assert not {"claimed-error-unknown", "start-not-at-rest"} & set(ids(prediction))


def test_a_hall_of_which_nobody_says_how_it_moves_is_part_of_the_error(record, model):
    time, hall, true = truth_after(record[1])
    told, unknown = (
        np.sqrt(np.mean(model.error_um(CYCLE, time, one, follows=True) ** 2, axis=0)) for one in (hall, None)
    )
    off = np.sqrt(np.mean((model.displacement_um(CYCLE, time, None, follows=True) - true) ** 2, axis=0))
    assert (off < 2.0 * unknown).all()
    assert (off > 2.0 * told).all()


def test_a_hall_that_is_only_assumed_to_stay_beside_others_is_part_of_the_error(model):
    time = np.arange(0.0, CYCLE.end_s + 1.0, 600.0)
    stays = np.full((1, 1), model.last_ambient_degc()[0])
    said, assumed, none = (
        model.error_um(CYCLE, time, one, follows=True)
        for one in (AmbientCourse(np.zeros(1), stays, ("hall",)), AmbientCourse(np.zeros(1), stays), None)
    )
    np.testing.assert_allclose(assumed, none)
    assert (assumed[-1] > 2.0 * said[-1]).all()
