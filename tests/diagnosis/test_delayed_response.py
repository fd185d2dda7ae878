"""A delay by a part of a sample is recalibration, also where the course bends within the sample."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.evidence.response import bench_of, recalibration_columns
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel
from tests.diagnosis.made import RUNS, STEP_S, comparison


@pytest.mark.parametrize("delay_s", [7e-4, -7e-4])
def test_a_quick_course_that_comes_late_is_recalibrated(delay_s: float) -> None:
    time = 2e-3 * np.arange(3000)

    def course(at: np.ndarray) -> np.ndarray:
        return np.sum([np.tanh((at - turn) / 5e-3) for turn in (0.5, 1.7, 3.1, 4.4)], axis=0)

    comparison = Comparison(
        runs=("r1",), starts=(0, len(time)), time_s=time, channels=(Channel("I", "current", "A"),),
        recorded={"I": course(time - delay_s)}, simulated={"I": course(time)}, responses=("I",),
        held_out=np.zeros(len(time), dtype=bool),
    )  # fmt: skip
    seen = np.ones(len(time), dtype=bool)
    columns, names = recalibration_columns(comparison, "I", seen)
    difference = comparison.difference("I")
    found = least_squares(columns, difference)
    assert found[names.index("delay")] == pytest.approx(delay_s, rel=0.02)
    assert np.std(difference - columns @ found) < 0.02 * np.std(difference)


def of_one_run(time: np.ndarray, recorded: np.ndarray, simulated: np.ndarray) -> Comparison:
    return Comparison(
        runs=("r1",), starts=(0, len(time)), time_s=time, channels=(Channel("T", "temperature", "degC"),),
        recorded={"T": recorded}, simulated={"T": simulated}, responses=("T",),
        held_out=np.zeros(len(time), dtype=bool),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("course", "names"),
    [
        ("stands", ("offset",)),
        # its derivative is itself, but for an offset
        ("exponential", ("offset", "gain")),
        ("two exponentials", ("offset", "gain", "delay")),
    ],
)
def test_a_simulation_has_the_recalibration_that_it_moves_enough_for(course: str, names: tuple[str, ...]) -> None:
    time = np.arange(2000.0)
    rng = np.random.default_rng(3)
    moves = {
        "stands": 20.0 + 1e-8 * rng.standard_normal(2000),
        "exponential": 20.0 + 5.0 * np.exp(-time / 300.0),
        "two exponentials": 20.0 + 5.0 * np.exp(-time / 300.0) + 5.0 * np.exp(-time / 60.0),
    }[course]
    recorded = moves + rng.standard_normal(2000)
    assert recalibration_columns(of_one_run(time, recorded, moves), "T", np.ones(2000, dtype=bool))[1] == names


def test_friction_by_speed_is_a_gain_of_a_simulated_speed() -> None:
    time = 0.01 * np.arange(4000)
    simulated = 0.2 * np.sin(1.3 * time) + 0.1 * np.sin(0.31 * time)
    dry = 0.02 * np.sign(simulated)
    noise = 1e-3 * np.random.default_rng(5).standard_normal(len(time))
    comparison = Comparison(
        runs=("r1", "r2"), starts=(0, 2000, 4000), time_s=np.tile(time[:2000], 2),
        channels=(Channel("v", "velocity", "m/s", axis="X"),), recorded={"v": simulated - dry + noise},
        simulated={"v": simulated}, responses=("v",), held_out=np.arange(4000) >= 2000,
    )  # fmt: skip
    bench, untested = bench_of(comparison, "v", catalogue())
    assert "drive.viscous" not in bench.own
    assert "gain" in untested["drive.viscous"]
    assert [effect.id for effect in diagnosis(comparison, seed=0).effects] == ["drive.coulomb"]


@pytest.mark.parametrize("samples", [2.0, 7.0, -7.0, 45.0])
def test_a_delay_of_several_samples_is_calibration_and_no_memory(samples):
    made = comparison({"Z": 0.01 * np.random.default_rng(3).standard_normal(1800)})
    runs = made.simulated["Z"].reshape(3, -1)
    number = np.arange(runs.shape[1])
    late = np.concatenate([np.interp(number - samples, number, run) for run in runs])
    noise = made.recorded["Z"] - made.simulated["Z"]
    answer = diagnosis(replace(made, recorded={**made.recorded, "Z": late + noise}))
    assert answer.verdict == "miscalibrated"
    assert answer.recalibration["Z"]["delay"].value == pytest.approx(30.0 * samples, rel=0.03)


def late(course: np.ndarray, samples: float) -> np.ndarray:
    """Each of three runs later, from where it starts."""
    runs = course.reshape(3, -1)
    number = np.arange(runs.shape[1])
    return np.concatenate([np.interp(number - samples, number, run) for run in runs])


@pytest.mark.parametrize("samples", [14.0, 60.0])
def test_a_force_that_comes_many_samples_late_is_no_resonance(samples):
    rng = np.random.default_rng(1)
    wanted = np.repeat(rng.uniform(-0.3, 0.3, 15), 120)
    speed = np.concatenate([lfilter([0.08], [1.0, -0.92], run) for run in wanted.reshape(3, -1)])
    force = 80.0 * np.gradient(speed, 2e-3) + 60.0 * speed
    recorded = late(force, samples)
    noise = 0.05 * np.std(recorded - force) * rng.standard_normal(len(force))
    asked = Comparison(
        runs=("r1", "r2", "r3"), starts=(0, 600, 1200, 1800), time_s=np.tile(2e-3 * np.arange(600), 3),
        channels=(Channel("F", "force", "N"),), recorded={"F": recorded + noise}, simulated={"F": force},
        responses=("F",), held_out=np.arange(1800) >= 1200,
    )  # fmt: skip
    answer = diagnosis(asked)
    assert answer.verdict == "miscalibrated"
    assert answer.recalibration["F"]["delay"].value == pytest.approx(2e-3 * samples, rel=0.02)


def test_a_force_that_follows_with_a_lag_is_named():
    rng = np.random.default_rng(1)
    throttle = np.repeat(rng.uniform(0.0, 1.0, 15), 120)
    follows = np.concatenate([lfilter([0.05], [1.0, -0.95], run) for run in throttle.reshape(3, -1)])
    noise = 0.5 * rng.standard_normal(len(throttle))
    asked = Comparison(
        runs=("r1", "r2", "r3"), starts=(0, 600, 1200, 1800), time_s=np.tile(0.05 * np.arange(600), 3),
        channels=(Channel("F", "force", "N"), Channel("u", "state", "1")),
        recorded={"F": 20.0 * follows + noise, "u": throttle}, simulated={"F": 20.0 * throttle},
        responses=("F",), held_out=np.arange(1800) >= 1200,
    )  # fmt: skip
    (effect,) = diagnosis(asked).effects
    assert effect.id == "gauging.lag"
    assert effect.parameters["tau_s"].value == pytest.approx(1.0, rel=0.2)


def of_forces(simulated: np.ndarray, recorded: np.ndarray) -> Comparison:
    """Three runs of a force, shapes (3, n), at 100 Hz, the last one not fitted."""
    runs, n = simulated.shape
    return Comparison(
        runs=("r1", "r2", "r3"), starts=(0, n, 2 * n, 3 * n), time_s=np.tile(0.01 * np.arange(n), runs),
        channels=(Channel("F", "force", "N"),), recorded={"F": recorded.ravel()}, simulated={"F": simulated.ravel()},
        responses=("F",), held_out=np.arange(runs * n) >= 2 * n,
    )  # fmt: skip


def delay_samples(asked: Comparison) -> float:
    """The delay that recalibration finds."""
    fitted = ~asked.held_out
    columns, names = recalibration_columns(asked, "F", fitted)
    found = least_squares(columns[fitted], asked.difference("F")[fitted])
    return float(found[names.index("delay")]) / asked.period_s


@pytest.mark.parametrize(("period", "samples"), [(12.4, 1.5), (18.4, 6.0), (150.0, 20.0)])
def test_the_delay_of_a_course_that_comes_back_is_short_and_does_not_turn_it_round(period, samples):
    angle = 2.0 * np.pi * np.arange(400) / period + np.array([[0.4], [2.9], [5.1]])
    late_by = 2.0 * np.pi * samples / period
    simulated, recorded = (
        np.sin(phase) + 0.3 * np.sin(3.0 * phase + 1.3 + np.array([[0.0], [1.0], [2.0]]))
        for phase in (angle, angle - late_by)
    )
    noise = 0.01 * np.random.default_rng(1).standard_normal(recorded.shape)
    assert delay_samples(of_forces(simulated, recorded + noise)) == pytest.approx(samples, rel=0.1)


def test_a_long_delay_of_a_quick_course_is_found():
    rng = np.random.default_rng(2)
    simulated = lfilter([1.0], [1.0, -0.4], rng.standard_normal((3, 600)))
    recorded = late(simulated.ravel(), 61.0).reshape(3, -1) + 0.01 * rng.standard_normal((3, 600))
    assert delay_samples(of_forces(simulated, recorded)) == pytest.approx(61.0, abs=0.5)


def switched(rng: np.random.Generator, tau: float, n: int = 400) -> np.ndarray:
    """Three runs of levels behind a time constant [samples], shape (3, n)."""
    levels = np.repeat(rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0], 3 * n // 40), 40).reshape(3, n)
    keep = np.exp(-1.0 / tau)
    return lfilter([1.0 - keep], [1.0, -keep], levels)


def test_a_delay_is_found_under_noise_as_large_as_what_it_makes_and_no_lag_is_taken_for_one():
    rng = np.random.default_rng(4)
    simulated = switched(rng, 6.0)
    delayed = late(simulated.ravel(), 20.0).reshape(3, -1)
    noise = np.std(delayed - simulated) * rng.standard_normal(simulated.shape)
    assert delay_samples(of_forces(simulated, delayed + noise)) == pytest.approx(20.0, rel=0.05)
    keep = np.exp(-1.0 / 20.0)
    lagged = lfilter([1.0 - keep], [1.0, -keep], simulated)
    noise = 0.3 * np.std(lagged - simulated) * rng.standard_normal(simulated.shape)
    (effect,) = diagnosis(of_forces(simulated, lagged + noise)).effects
    assert effect.id == "gauging.lag"


@pytest.mark.parametrize("off", [0.95, 1.02])
def test_a_time_constant_that_is_a_little_off_is_no_lag(off):
    for seed in range(3):
        simulated, true = (switched(np.random.default_rng(seed), tau) for tau in (10.0, 10.0 * off))
        noise = 0.005 * np.std(simulated) * np.random.default_rng(seed).standard_normal(true.shape)
        assert "gauging.lag" not in [effect.id for effect in diagnosis(of_forces(simulated, true + noise)).effects]


def test_a_lag_beside_a_gain_that_was_fitted_without_it():
    """Of what follows at 0.2 s a straight line at once has a quarter of the gain."""
    n, dt_s, tau_s = 800, 0.01, 0.2
    t, share = np.arange(n) * dt_s, dt_s / (tau_s + dt_s)
    swept = [(3.0 + k) * np.sign(np.sin(2.0 * np.pi * (0.3 + 0.3 * k) * t * (1.0 + t / 4.0))) for k in range(3)]
    follows = np.concatenate([lfilter([share], [1.0, share - 1.0], u) for u in swept])
    u, v = np.concatenate(swept), follows + 0.02 * np.random.default_rng(0).standard_normal(3 * n)
    at_once = u * float(u[: 2 * n] @ v[: 2 * n] / (u[: 2 * n] @ u[: 2 * n]))
    channels = (Channel("u", "voltage", "V"), Channel("v", "velocity", "m/s"))
    of_runs = (RUNS, (0, n, 2 * n, 3 * n), np.tile(t, 3), channels)
    asked = Comparison(*of_runs, {"u": u, "v": v}, {"v": at_once}, ("v",), np.arange(3 * n) >= 2 * n)
    [lag] = diagnosis(asked).effects
    assert lag.id == "gauging.lag"
    assert lag.share > 0.99
    assert lag.parameters["tau_s"].value == pytest.approx(tau_s, rel=0.05)


@pytest.mark.parametrize("samples", [1, 2])
def test_one_run_that_is_late_by_a_sample_or_two_where_the_course_leaps(samples):
    n = 600
    made = comparison({"Z": 0.05 * np.random.default_rng(0).standard_normal(3 * n)})
    course = made.simulated["Z"] / np.std(made.simulated["Z"]) + made.recorded["n"] / 2000.0
    late = course.reshape(3, n).copy()
    late[1, samples:] = course.reshape(3, n)[1, :-samples]
    recorded = made.recorded | {"Z": late.ravel() + made.difference("Z")}
    [fault] = diagnosis(replace(made, simulated={"Z": course}, recorded=recorded)).effects
    assert (fault.id, fault.acts) == ("data.clock", ("r2", None, None))
    assert fault.parameters["shift_s"].value == pytest.approx(samples * STEP_S, rel=0.05)
