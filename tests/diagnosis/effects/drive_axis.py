"""A feed axis of its own making, stepped at 0.1 ms, on which drive effects are told apart.

Motor and table are two masses with a screw between them (or one mass); the guide is a LuGre bristle; the control is a
sampled P/PI cascade on the motor with feed-forward of speed, and a first-order current loop. Recorded at 2 ms, rounded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from selector.diagnosis.comparison import Comparison
from selector.recording import Channel

STEP_S = 1e-4


@dataclass(frozen=True)
class AxisTruth:
    """SI units, all referred to the table. `stiffness` 0: one mass. Effects are off at 0."""

    motor_kg: float = 250.0
    table_kg: float = 350.0
    stiffness: float = 1.2e8
    screw_damping: float = 8e3
    force_per_a: float = 620.0
    viscous: float = 1500.0
    coulomb: float = 0.0
    coulomb_difference: float = 0.0
    stribeck: float = 0.0
    stribeck_speed: float = 0.004
    play: float = 0.0
    softening: float = 0.0
    damping_growth: float = 0.0
    lead_error: float = 0.0
    lead: float = 0.01
    lead_slope: float = 0.0
    ripple: float = 0.0
    ripple_lead: float = 0.016
    delay_s: float = 0.0
    limit_a: float = 1e9
    offset: float = 0.0
    proportional: float = 50.0
    speed_gain: float = 1.5e5
    reset_s: float = 0.02
    feed_forward: float = 0.97
    on_table: bool = False
    acceleration_ff: float = 0.0


def moves(seed: int, *, duration_s: float = 5.0, top: float = 0.12, one_way: bool = False) -> np.ndarray:
    """Command [m] every 0.1 ms: random strokes with sin² accelerations and dwells."""
    random = np.random.default_rng(seed)
    speed: list[np.ndarray] = [np.zeros(2000)]
    place, n = 0.05, 2000
    while n < duration_s / STEP_S:
        target = (
            random.uniform(0.1, 0.3)
            if random.random() < 0.5
            else float(np.clip(place + random.uniform(-0.06, 0.06), 0.03, 0.37))
        )
        if one_way:
            target = min(place + random.uniform(0.02, 0.1), 0.37)
        v = random.choice([0.03, 0.06, 1.0 * top, 0.8 * top]) * np.sign(target - place)
        ramp = int(random.choice([0.04, 0.07, 0.12]) / STEP_S)
        hold = max(int(abs(target - place) / abs(v) / STEP_S) - ramp, 0)
        up = np.sin(0.5 * np.pi * (np.arange(ramp) + 0.5) / ramp) ** 2
        part = v * np.r_[up, np.ones(hold), up[::-1], np.zeros(int(random.choice([0.0, 0.1, 0.25]) / STEP_S))]
        speed.append(part)
        place += part.sum() * STEP_S
        n += len(part)
    return 0.05 + np.cumsum(np.concatenate(speed)[: int(duration_s / STEP_S)]) * STEP_S


def driven(axis: AxisTruth, command: np.ndarray) -> dict[str, np.ndarray]:
    """Table position minus command [µm], current [A], table speed [m/s], every 0.1 ms."""
    rigid = axis.stiffness == 0.0
    numbers = [float(v) for v in vars(axis).values()]
    table, motor, speed, current = _stepped(np.array(numbers), command, rigid)
    return {"E": (table - command) * 1e6, "I": current, "v": speed, "m": motor, "x": table}


@njit(cache=True)
def _stepped(p, r, rigid):
    (
        mm,
        mt,
        k,
        d,
        kf,
        c,
        fc,
        df,
        fs,
        vs,
        play,
        soft,
        grow,
        le,
        lead,
        slope,
        rip,
        rlead,
        delay,
        limit,
        off,
        kp,
        kv,
        ti,
        ff,
    ) = p[:25]
    on_table, aff = p[25] > 0.5, p[26]
    n = len(r)
    h = 1e-4
    x = np.empty(n)
    m = np.empty(n)
    w = np.empty(n)
    cur = np.empty(n)
    xm = r[0]
    vm = 0.0
    xt = r[0]
    vt = 0.0
    z = 0.0
    integral = 0.0
    i_set = 0.0
    i_act = 0.0
    buffer = np.zeros(400)
    late = round(delay / h)
    sigma0 = 4e7 if fc + fs > 0 else 0.0
    r_last = r[0]
    vr_last = 0.0
    err = 0.0
    ref0 = r[0]
    for j in range(n):
        if j % 5 == 0:
            hh = 5 * h
            vr = (r[j] - r_last) / hh
            ar = (vr - vr_last) / hh
            vr_last = vr
            r_last = r[j]
            seen = xt if on_table else xm
            want = kp * (r[j] - seen) + ff * vr
            e = want - vm
            free = kv * (e + integral) / kf + aff * ar
            i_set = min(max(free, -limit), limit)
            if free == i_set:
                integral += e * hh / ti
        buffer[j % 400] = i_set
        i_in = buffer[(j - late) % 400] if late > 0 else i_set
        i_act += (i_in - i_act) * (h / 5e-4)
        motor_force = kf * i_act + rip * np.sin(2 * np.pi * xm / rlead) - rip * np.sin(2 * np.pi * ref0 / rlead)
        # friction of the guide
        here = fc + (df if vt > 0 else -df) + fs * np.exp(-((vt / vs) ** 2))
        fr = 0.0
        if fc + fs > 0:
            dz = vt - sigma0 * abs(vt) / max(here, 1e-6) * z
            z += dz * h
            lim = here / sigma0
            if z > lim:
                z = lim
            if z < -lim:
                z = -lim
            fr = sigma0 * z + 2e3 * dz * np.exp(-((vt / 0.01) ** 2))
        fr += c * (1.0 + grow * (xt - 0.2)) * vt + off
        err = le * np.sin(2 * np.pi * xm / lead) - le * np.sin(2 * np.pi * ref0 / lead) + slope * (xm - ref0)
        derr = (le * 2 * np.pi / lead * np.cos(2 * np.pi * xm / lead) + slope) * vm
        if rigid:
            vm += (motor_force - fr) / (mm + mt) * h
            xm += vm * h
            xt = xm + err
            vt = vm
        else:
            gap = xm + err - xt
            rate = vm + derr - vt
            if gap > 0.5 * play:
                gap -= 0.5 * play
            elif gap < -0.5 * play:
                gap += 0.5 * play
            else:
                gap = 0.0
                rate *= 0.05
            spring = k * (1.0 - soft * (xt - 0.05)) * gap + d * rate
            vm += (motor_force - spring) / mm * h
            vt += (spring - fr) / mt * h
            xm += vm * h
            xt += vt * h
        x[j] = xt
        m[j] = xm
        w[j] = vt
        cur[j] = i_act
    return x, m, w, cur


@dataclass(frozen=True)
class Noise:
    e_um: float = 0.35
    i_a: float = 0.05
    v_m_per_s: float = 2e-5


def compared(
    truth: AxisTruth, model: AxisTruth, *, seed: int = 0, noise: Noise = Noise(), every: int = 20, n_runs: int = 3
) -> Comparison:
    """Runs of the truth, with noise, beside the same runs of the model."""
    random = np.random.default_rng(1000 + seed)
    rec: dict[str, list[np.ndarray]] = {"r": [], "v": [], "E": [], "I": []}
    sim: dict[str, list[np.ndarray]] = {"E": [], "I": []}
    times, starts = [], [0]
    for run in range(n_runs):
        command = moves(10 * seed + run)
        real, told = driven(truth, command), driven(model, command)
        rows = slice(None, None, every)
        n = len(command[rows])
        rec["r"].append(np.round(command[rows], 7))
        rec["v"].append(np.round(real["v"][rows] + noise.v_m_per_s * random.standard_normal(n), 5))
        rec["E"].append(np.round(real["E"][rows] + noise.e_um * random.standard_normal(n), 2))
        rec["I"].append(np.round(real["I"][rows] + noise.i_a * random.standard_normal(n), 3))
        sim["E"].append(np.round(told["E"][rows], 3))
        sim["I"].append(np.round(told["I"][rows], 4))
        times.append(np.arange(n) * every * STEP_S)
        starts.append(starts[-1] + n)
    channels = (
        Channel("r", "position_command", "m", axis="X"),
        Channel("v", "velocity", "m/s", axis="X"),
        Channel("E", "displacement", "um", axis="X"),
        Channel("I", "current", "A"),
    )
    held = np.arange(starts[-1]) >= starts[-2]
    return Comparison(
        runs=tuple(f"r{k + 1}" for k in range(n_runs)),
        starts=tuple(starts),
        time_s=np.concatenate(times),
        channels=channels,
        recorded={name: np.concatenate(parts) for name, parts in rec.items()},
        simulated={name: np.concatenate(parts) for name, parts in sim.items()},
        responses=("E", "I"),
        held_out=held,
    )


VISCOUS_ONLY = AxisTruth()
WITH_FRICTION = AxisTruth(coulomb=120.0)
PAIRS: dict[str, tuple[AxisTruth, AxisTruth]] = {}
"""Effect → (truth, model without it)."""


def _pair(name: str, model: AxisTruth, **on: float) -> None:
    PAIRS[name] = (replace(model, **on), model)


_pair("drive.coulomb", VISCOUS_ONLY, coulomb=45.0)
_pair("drive.asymmetric_friction", WITH_FRICTION, coulomb_difference=25.0)
_pair("drive.stribeck", WITH_FRICTION, stribeck=50.0, stribeck_speed=0.012)
_pair("drive.viscous", WITH_FRICTION, viscous=2300.0)
_pair("drive.backlash", WITH_FRICTION, play=2e-6)
PAIRS["drive.elasticity"] = (replace(WITH_FRICTION, stiffness=1.2e8), replace(WITH_FRICTION, stiffness=0.0))
_pair("drive.varying_stiffness", WITH_FRICTION, softening=1.5)
_pair("drive.varying_damping", WITH_FRICTION, damping_growth=2.0)
_pair("drive.pitch_error", WITH_FRICTION, lead_error=0.4e-6)
_pair("drive.ripple", WITH_FRICTION, ripple=25.0)
_pair("drive.delay", WITH_FRICTION, delay_s=4e-4)
_pair("drive.saturation", WITH_FRICTION, limit_a=2.0)
_pair("drive.offset_force", WITH_FRICTION, offset=60.0)
_pair("drive.mass", WITH_FRICTION, table_kg=380.0)
