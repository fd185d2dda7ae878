"""Machines with one effect in them, simulated by other code than that of the effects: fine steps, noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numba import njit

from selector.diagnosis.comparison import Comparison
from selector.recording import Channel

Courses = Mapping[str, np.ndarray]
_UNITS = {"displacement": "um", "force": "N", "spindle_speed": "rpm", "feed_rate": "mm/min", "state": "1", "size": "um"}
_UNITS |= {
    "voltage": "V",
    "position": "m",
    "position_command": "m",
    "flow": "m^3/s",
    "acceleration": "m/s^2",
    "amplitude": "um",
    "frequency": "Hz",
}


def comparison_of(
    runs: list[tuple[np.ndarray, Courses, Courses]], roles: Mapping[str, str], responses: tuple[str, ...]
) -> Comparison:
    """Runs of (time, recorded, simulated); the last one is held out."""
    starts = np.cumsum([0, *(len(run[0]) for run in runs)])
    held_out = np.arange(starts[-1]) >= starts[-2]

    def joined(k: int) -> dict[str, np.ndarray]:
        return {name: np.concatenate([run[k][name] for run in runs]) for name in runs[0][k]}

    channels = tuple(Channel(name, role, _UNITS[role], place=f"member {name}") for name, role in roles.items())
    time = np.concatenate([run[0] for run in runs])
    names = tuple(f"r{k + 1}" for k in range(len(runs)))
    return Comparison(names, tuple(int(s) for s in starts), time, channels, joined(1), joined(2), responses, held_out)


# --- a structure of one or two masses, shaken by a recorded force -----------------------------------------------------

FS = 1000.0
M1, F1, Z1 = 20.0, 38.0, 0.04
M2, F2, Z2 = 4.0, 61.0, 0.03
K1, C1 = M1 * (2 * np.pi * F1) ** 2, 2 * Z1 * M1 * 2 * np.pi * F1
K2, C2 = M2 * (2 * np.pi * F2) ** 2, 2 * Z2 * M2 * 2 * np.pi * F2
UM = 1e6
_SUBSTEPS = 4


def structure(effect: str | None, *, seed: int = 0, n: int = 1500, n_runs: int = 3, noise: float = 0.03) -> Comparison:
    """Two masses; `effect` is one of the six ids without its family, or None for the clean twin."""
    rng = np.random.default_rng(seed)
    runs = []
    for k in range(n_runs):
        time = np.arange(n) / FS
        force = _force(rng, time) * (1.0, 0.6, 0.8)[k % 3]
        speed = _speed(rng, time, k)
        truth = _solved(effect, time, force, speed, rng)
        plain = _solved(None, time, force, speed, rng)
        recorded = {"F": force, "n": np.round(speed, 1)}
        recorded |= {x: v + noise * v.std() * rng.normal(size=n) for x, v in truth.items()}
        runs.append((time, recorded, {x: np.round(v, 4) for x, v in plain.items()}))
    roles = {"F": "force", "n": "spindle_speed", "x1": "displacement", "x2": "displacement"}
    return comparison_of(runs, roles, ("x1", "x2"))


def _force(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    sweep = np.sin(2 * np.pi * (8.0 * time + 0.5 * 70.0 * time**2 / time[-1]))
    rough = np.convolve(rng.normal(size=len(time)), np.hanning(9), mode="same")
    return 60.0 * sweep + 25.0 * rough


def _speed(rng: np.random.Generator, time: np.ndarray, k: int) -> np.ndarray:
    low = 900.0 + 250.0 * k
    return low + 900.0 * time / time[-1]


def _solved(
    effect: str | None, time: np.ndarray, force: np.ndarray, speed: np.ndarray, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    fine = np.linspace(time[0], time[-1], 2 * _SUBSTEPS * (len(time) - 1) + 1)
    angle = np.concatenate([[0.0], np.cumsum(np.interp(fine, time, speed)[:-1] / 60.0 * np.diff(fine))]) * 2 * np.pi
    extra, phase = np.zeros(len(fine)), rng.uniform(0, 6.28)
    if effect == "line":
        extra = 14.0 * np.sin(2 * np.pi * 27.3 * fine + phase)
    if effect == "imbalance":
        extra = 14.0 * (np.gradient(angle, fine) / 200.0) ** 2 * np.sin(angle + phase)
    back = float(effect == "back_reaction")
    cubic = 0.12 * K1 / (150e-6) ** 2 if effect == "hardening" else 0.0
    bouc_wen = 0.12 * K1 * 60e-6 if effect == "hysteresis" else 0.0
    x1, x2, q = _runge_kutta(np.interp(fine, time, force), extra, fine[1] - fine[0], back, cubic, bouc_wen)
    return {"x1": (x1 + (q if effect == "mode" else 0.0)) * UM, "x2": x2 * UM}


@njit(cache=True)
def _runge_kutta(force, extra, half, back, cubic, bouc_wen):
    n = (len(force) - 1) // (2 * _SUBSTEPS) + 1
    out = np.zeros((3, n))
    state = np.zeros(7)
    for i in range((n - 1) * _SUBSTEPS):
        j = 2 * i
        a = _rates(state, force[j], extra[j], back, cubic, bouc_wen)
        b = _rates(state + half * a, force[j + 1], extra[j + 1], back, cubic, bouc_wen)
        c = _rates(state + half * b, force[j + 1], extra[j + 1], back, cubic, bouc_wen)
        d = _rates(state + 2 * half * c, force[j + 2], extra[j + 2], back, cubic, bouc_wen)
        state = state + half / 3 * (a + 2 * b + 2 * c + d)
        if (i + 1) % _SUBSTEPS == 0:
            out[0, (i + 1) // _SUBSTEPS] = state[0]
            out[1, (i + 1) // _SUBSTEPS] = state[2]
            out[2, (i + 1) // _SUBSTEPS] = state[5]
    return out


@njit(cache=True)
def _rates(state, force, extra, back, cubic, bouc_wen):
    """Two masses in a row, a Bouc–Wen element (n = 2, unlike the catalogue's), and a mode of its own."""
    x1, v1, x2, v2, z, q, p = state
    joint = K2 * (x2 - x1) + C2 * (v2 - v1)
    a1 = (force + extra + back * joint - K1 * x1 - C1 * v1 - cubic * x1**3 - bouc_wen * z) / M1
    slip = (v1 - 0.7 * abs(v1) * abs(z) * z - 0.3 * v1 * z * z) / 30e-6
    w3 = 2 * np.pi * 88.0
    return np.array([v1, a1, v2, -joint / M2, slip, p, force / 300.0 - 2 * 0.02 * w3 * p - w3**2 * q])


# --- gauged grinding --------------------------------------------------------------------------------------------------


def gauge_in_time(effect: str | None, *, seed: int = 0, n: int = 1500, n_runs: int = 3) -> Comparison:
    """Reading of a gauge at 100 Hz while parts are ground down in three feeds, with plain and grooved parts."""
    rng = np.random.default_rng(seed)
    runs = []
    for _ in range(n_runs):
        time = np.arange(n) * 0.01
        feed, contact, grooved, allowance = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
        k, left = 0, 60.0
        rough, fine = rng.uniform(18, 30), rng.uniform(2, 6)
        pause = 0
        for i in range(n):
            if pause:
                pause -= 1
                left = 60.0
            else:
                rate = rough if left > 15.0 else fine
                feed[i], contact[i] = rate, 1.0
                left -= rate * 0.01
                if left <= 0.0:
                    pause, k, rough, fine = 60, k + 1, rng.uniform(18, 30), rng.uniform(2, 6)
            allowance[i] = left
            grooved[i] = float(k % 3 == 1)
        reading = allowance.copy()
        if effect == "interrupted":
            reading = reading + grooved * 1.5 * (1.0 + 0.2 * rng.normal(size=n))
        if effect == "wear":
            reading = reading - 0.2 * np.cumsum(contact) * 0.01
        tau = 0.12 if effect == "lag" else 0.05
        recorded, simulated = _filtered(reading, 0.01, tau), _filtered(allowance, 0.01, 0.05)
        channels = {"feed": feed * 60.0 / 1000.0, "grooved": grooved, "contact": contact}
        channels |= {"x": recorded + 0.3 * rng.normal(size=n)}
        runs.append((time, channels, {"x": simulated}))
    roles = {"feed": "feed_rate", "grooved": "state", "contact": "state", "x": "displacement"}
    return comparison_of(runs, roles, ("x",))


def gauged_parts(effect: str | None, *, seed: int = 0, n: int = 120, n_runs: int = 3) -> Comparison:
    """Finished sizes part by part; infeed, grooves and dressing known."""
    rng = np.random.default_rng(seed)
    runs = []
    for _ in range(n_runs):
        part = np.arange(n, dtype=float)
        feed = rng.choice([0.12, 0.24, 0.36], n)
        grooved = (rng.random(n) < 0.3).astype(float)
        dressed = (part % 40 == 39).astype(float)
        since = part % 40
        size = rng.normal(0, 0.3, n)
        simulated = 0.2 * np.sin(part / 7.0)
        size = size + simulated
        if effect == "lag":
            size = size - 0.08 * feed * 1000 / 60
        if effect == "wear":
            size = size + 0.9 * (1.0 - np.exp(-since / 30.0)) + 0.006 * part
        if effect == "interrupted":
            size = size + 0.5 * grooved
        recorded = {"feed": feed, "grooved": grooved, "dressed": dressed, "size": np.round(size, 2)}
        runs.append((part * 30.0, recorded, {"size": simulated}))
    roles = {"feed": "feed_rate", "grooved": "state", "dressed": "state", "size": "size"}
    return comparison_of(runs, roles, ("size",))


@njit(cache=True)
def _filtered(values, step_s, tau_s):
    y, out = values[0], np.empty(len(values))
    for i in range(len(values)):
        x = values[i]
        for _ in range(10):
            y += step_s / 10 / tau_s * (x - y)
        out[i] = y
    return out


# --- two tanks --------------------------------------------------------------------------------------------------------


def tanks(effect: str | None, *, seed: int = 0, n: int = 700, n_runs: int = 3) -> Comparison:
    """Cascaded tanks with outflow by the square root; either spills at 0.1 m when `effect` is ``"overflow"``."""
    rng = np.random.default_rng(seed)
    brim = 0.1 if effect == "overflow" else np.inf
    runs = []
    for _ in range(n_runs):
        time = np.arange(n) * 4.0
        knots = np.arange(0, time[-1] + 200, 120.0)
        pump = np.interp(time, knots, rng.uniform(0.4, 1.45, len(knots)))
        simulated, truth = (_levels(pump, 4.0, limit) for limit in (np.inf, brim))
        runs.append((time, {"q": pump * 1e-6, "h": truth * 1e6 + rng.normal(0, 500, n)}, {"h": simulated * 1e6}))
    return comparison_of(runs, {"q": "flow", "h": "displacement"}, ("h",))


@njit(cache=True)
def _levels(pump, step_s, brim):
    h1 = h2 = 0.04
    out = np.empty(len(pump))
    for i in range(len(pump)):
        u = pump[i]
        for _ in range(20):
            q1, q2 = 0.0042 * np.sqrt(max(h1, 0.0)), 0.0042 * np.sqrt(max(h2, 0.0))
            h1n = h1 + step_s / 20 * (0.00118 * u - q1)
            spill = max(h1n - brim, 0.0)
            h1 = h1n - spill
            h2 = min(h2 + step_s / 20 * (q1 - q2) + 0.3 * spill, brim)
        out[i] = h2
    return out


TRUTHS: dict[str, tuple[Callable[..., Comparison], str]] = {
    **{
        f"vibration.{e}": (structure, e)
        for e in ("line", "imbalance", "mode", "back_reaction", "hardening", "hysteresis")
    },
    **{f"gauging.{e}": (gauge_in_time, e) for e in ("lag", "wear", "interrupted")},
    "flow.overflow": (tanks, "overflow"),
}
"""Id → (what builds the comparison, the effect in it)."""
