"""Simulated machines whose truth is known: hidden modes, networks of lumps and bars, with tests and duty cycles."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm
from threadpoolctl import threadpool_limits

from selector.physics.thermal.modes.fit import Fit, Law, ModeSpec, block_weights, grown
from selector.physics.thermal.modes.thermal_test import ModeData, ThermalTest, mode_data
from tests.physics.thermal.segments import of_segments

RESPONSES = ("Z", "Y", "X")
SPEEDS = (800.0, 1000.0, 1250.0, 1600.0, 2000.0)


@dataclass
class Machine:
    """T' = −(K + Σ h(n) F) T + b(n), δ = d·T; exact between changes of speed. Scaled to a peak of 60 µm."""

    stiff: np.ndarray  # (n, n), 1/s
    film: np.ndarray  # (n, n), 1/s at the reference speed, or zeros
    heat: np.ndarray  # (n, n_sources), at the reference speed
    exponents: np.ndarray  # (n_sources,)
    output: np.ndarray  # (n_responses, n)
    film_exponent: float = 0.8
    reference_rpm: float = 2000.0
    cached: dict = field(default_factory=dict)

    def parts(self, speed):
        share = speed / self.reference_rpm
        a = -self.stiff - share**self.film_exponent * self.film if speed > 0 else -self.stiff
        return a, self.heat @ share**self.exponents if speed > 0 else np.zeros(len(a))

    def step(self, speed, dt):
        key = (speed, round(dt, 9))
        if key not in self.cached:
            a, b = self.parts(speed)
            left = expm(a * dt)
            self.cached[key] = left, np.linalg.solve(a, (left - np.eye(len(a))) @ b)
        return self.cached[key]

    def states(self, cyclogram, step_s, start=None):
        n = round(cyclogram.end_s / step_s)
        time = np.arange(n + 1) * step_s
        speed = cyclogram.speed_at(time)
        x = np.zeros((n + 1, len(self.stiff)))
        if start is not None:
            x[0] = start
        for i in range(n):
            left, add = self.step(speed[i], step_s)
            x[i + 1] = left @ x[i] + add
        return time, speed, x

    def course(self, cyclogram, step_s, start=None):
        time, speed, x = self.states(cyclogram, step_s, start)
        return time, speed, x @ self.output.T

    def test(self, name, cyclogram, step_s, noise_um, rng, start=None):
        time, speed, clean = self.course(cyclogram, step_s, start)
        return ThermalTest(name, time, speed, clean + noise_um * rng.standard_normal(clean.shape))

    def scaled(self, peak_um=60.0):
        steady = self.output @ np.linalg.solve(-self.parts(self.reference_rpm)[0], self.parts(self.reference_rpm)[1])
        factor = peak_um * np.array([1.0, 0.5, 0.3])[: len(steady)] / np.maximum(np.abs(steady), 1e-12)
        self.output = self.output * factor[:, None]
        return self


def modal_machine(tau_s, gains, exponents, reference_rpm=2000.0):
    """Hidden modes; gains (n_modes, n_responses) [µm] at the reference speed, one exponent a mode."""
    rate = np.diag(1.0 / np.asarray(tau_s))
    return Machine(rate, np.zeros_like(rate), rate, np.asarray(exponents, float), np.asarray(gains, float).T)


def random_modal(rng):
    k = int(rng.integers(2, 5))
    while True:
        tau = np.sort(np.exp(rng.uniform(np.log(180), np.log(9000), k)))
        if (np.diff(np.log(tau)) > np.log(2.5)).all():
            break
    gains = rng.uniform(0.3, 1.0, (k, 3)) * np.array([60, 40, 25]) / k
    gains *= np.where(rng.random((k, 3)) < [0.1, 0.3, 0.3], -1, 1)
    return modal_machine(tau, gains, rng.uniform(1.0, 1.5, k))


def random_network(rng, film=0.0):
    """6–10 lumps; film = growth of the loss of the warm lumps from standing to the reference speed."""
    n = int(rng.integers(6, 11))
    capacity = np.exp(rng.uniform(np.log(2e3), np.log(6e4), n))
    link = np.zeros((n, n))
    for i in range(1, n):  # a tree, with some more links
        j = int(rng.integers(max(0, i - 2), i))
        link[i, j] = link[j, i] = np.exp(rng.uniform(np.log(8), np.log(60)))
    for _ in range(n // 3):
        i, j = rng.choice(n, 2, replace=False)
        link[i, j] = link[j, i] = np.exp(rng.uniform(np.log(3), np.log(20)))
    loss = np.exp(rng.uniform(np.log(0.5), np.log(5), n))
    conduction = np.diag(link.sum(1)) - link + np.diag(loss)
    warm = np.zeros(n)
    warm[: n // 2] = loss[: n // 2] * film
    heat = np.zeros((n, 2))
    heat[0, 0], heat[int(rng.integers(1, n)), 1] = 300.0, rng.uniform(30, 150)
    output = rng.uniform(0.3, 1.0, (3, n)) * np.where(rng.random((3, n)) < [[0.0], [0.2], [0.2]], -1, 1)
    inverse = 1.0 / capacity[:, None]
    return Machine(
        inverse * conduction, inverse * np.diag(warm), inverse * heat, rng.uniform(1.0, 1.5, 2), output
    ).scaled()


def random_bar(rng, film=0.0):
    """A bar heated at one end and a little along it, that loses heat along its length: a continuum of modes."""
    n, length = 40, rng.uniform(0.4, 0.9)
    h = length / n
    diffusivity = 1.3e-5
    stiff = (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) * diffusivity / h**2
    stiff[0, 0] = stiff[-1, -1] = diffusivity / h**2
    stiff += np.eye(n) / rng.uniform(4000, 12000)
    heat = np.zeros((n, 2))
    heat[:3, 0] = 1 / 3
    heat[n // 3 : n // 2, 1] = rng.uniform(0.02, 0.06)
    place = (np.arange(n) + 0.5) / n
    output = np.array([np.ones(n), 1 - 0.8 * place, place + 0.1])
    warm = np.diag(np.where(place < 0.3, film / 4000, 0.0))
    return Machine(stiff, warm, heat, rng.uniform(1.0, 1.5, 2), output).scaled()


def heat_and_cool(speeds=SPEEDS, heat_min=240, cool_min=420, only_heating=()):
    return {
        f"n{speed:g}": of_segments((heat_min, speed), *([] if speed in only_heating else [(cool_min, 0.0)]))
        for speed in speeds
    }


def recorded(machine, rng, noise_um=0.3, step_s=10.0, schedule=None):
    return [machine.test(name, cycle, step_s, noise_um, rng) for name, cycle in (schedule or heat_and_cool()).items()]


def duty_cycles(rng, fastest=2000.0, count=13):
    """Rising, intermittent, falling and random duty cycles, `count` of each, at tested and untested speeds."""
    cycles = []
    speeds = np.array([200, 400, 500, 700, 800, 900, 1000, 1100, 1250, 1400, 1600, 1800, 2000.0])
    for _ in range(count):
        some = np.sort(rng.choice(speeds, 4, replace=False))
        cycles.append(("rising", of_segments(*[(60.0, n) for n in some])))
        cycles.append(("falling", of_segments(*[(60.0, n) for n in some[::-1]], (60.0, 0.0))))
        on, off = rng.choice([(30, 15), (20, 10), (60, 30)])
        n = float(rng.choice(speeds[2:]))
        pairs = [(float(on), n), (float(off), 0.0)] * int(315 // (on + off))
        cycles.append(("intermittent", of_segments(*pairs)))
        lengths = rng.dirichlet(np.ones(7)) * 280 + 20 / 7
        course = [(float(np.ceil(m)), float(rng.choice([0.0, *speeds]))) for m in lengths]
        course[int(rng.integers(0, 3))] = (45.0, float(rng.choice(speeds[4:])))
        cycles.append(("random", of_segments(*course)))
    return cycles


def relative_errors(machine, model, cycles, step_s=60.0):
    """Largest error of every cycle relative to the peak, shape (n_cycles, n_responses)."""
    errors = []
    for _, cycle in cycles:
        time, _, true = machine.course(cycle, step_s)
        error = np.abs(model.displacement_um(cycle, np.minimum(time, cycle.end_s)) - true).max(axis=0)
        errors.append(error / np.abs(true).max(axis=0))
    return np.array(errors)


def fitted_modes(tests: list[ThermalTest], n_modes: int, law_kind: Law = "powers") -> tuple[Fit, ModeData]:
    """As many modes as told, without a film: what `choose_modes` chooses among."""
    data = mode_data(tests)
    weights, fit = block_weights(data), None
    with threadpool_limits(1, "blas"):
        for k in range(1, n_modes + 1):
            fit = grown(fit, ModeSpec(k, law_kind), data, weights)
    return fit, data
