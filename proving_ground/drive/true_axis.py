"""How does the true axis move, what is it told to do and how is it recorded, and what would a simulation of it say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np
from numba import njit
from scipy.linalg import expm

from proving_ground.concealment import Noise, coloured
from selector.types import Matrix, Vector

STEP_S = 1e-4
"""Step of the true axis [s]."""
SPEED_LOOP_S = 5e-4
"""Sampling of the speed loop [s]."""
COMMAND_S = 1e-3
"""Sampling of the command and of the position loop [s]."""


class TrueAxis(NamedTuple):
    """Parameters of the true axis, in SI units; all are numbers, so that compiled code takes them as they are.

    Masses are those of the motor (seen along the axis) and of the table. The screw has a stiffness whose compliance
    grows with the position (`compliance_per_m`, share per metre from `middle_m`), a damping, a play, and errors of its
    lead: a wave and a bow over the travel. Friction is of bristles (LuGre, `slips` 0) or of several springs that slip
    one after the other (`slips` 1): Coulomb level, its share by direction, peak at rest with the speed at which it has
    gone, viscous by direction and by position. The loop: position gain, feed-forward of speed, speed gain and integral
    time, lag, dead time and limit of the current, force per current; `on_scale` 1 closes it on the table, 0 on the
    motor.
    """

    motor_kg: float = 60.0
    table_kg: float = 150.0
    stiffness_n_per_m: float = 1.5e8
    screw_damping_ns_per_m: float = 2.0e4
    compliance_per_m: float = 0.0
    middle_m: float = 0.2
    play_m: float = 0.0
    lead_m: float = 0.0
    lead_pitch_m: float = 0.01
    lead_phase: float = 0.0
    lead_bow_per_m: float = 0.0
    slips: float = 0.0
    coulomb_n: float = 0.0
    coulomb_by_direction: float = 0.0
    break_away_n: float = 0.0
    stribeck_m_per_s: float = 0.005
    presliding_m: float = 3e-6
    viscous_ns_per_m: float = 300.0
    viscous_by_direction: float = 0.0
    viscous_by_position_per_m: float = 0.0
    ripple_n: float = 0.0
    ripple_m: float = 0.0025
    ripple_phase: float = 0.0
    offset_n: float = 0.0
    position_gain_per_s: float = 50.0
    feed_forward: float = 0.97
    speed_gain_ns_per_m: float = 6.0e4
    integral_time_s: float = 0.02
    current_lag_s: float = 6e-4
    dead_time_s: float = 0.0
    limit_a: float = 1e3
    force_per_a: float = 80.0
    on_scale: float = 1.0
    encoder_m: float = 5e-9


def true_motion(axis: TrueAxis, command_m: Vector, force_n: Vector, delay_s: float = 0.0) -> tuple[Vector, ...]:
    """(motor position, motor speed, table position, current) [m, m/s, m, A] every `STEP_S`.

    `command_m` is given every `COMMAND_S`, `force_n` every `STEP_S` (on the table, besides friction); the drive sees
    the command later by `delay_s`.
    """
    grid = np.arange(len(command_m)) * COMMAND_S
    seen = np.interp(grid - delay_s, grid, command_m) if delay_s else command_m
    return tuple(_motion(axis, seen, np.gradient(seen, COMMAND_S), force_n))


@njit(cache=True, nogil=True)
def _motion(axis, command, speed, force):  # type: ignore[no-untyped-def]
    h = STEP_S
    per_command = round(COMMAND_S / h)
    per_loop = round(SPEED_LOOP_S / h)
    n = len(command) * per_command
    x_motor, v_motor, x_table, amps = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    xm = xt = command[0]
    vm = vt = 0.0
    bristle = 0.0
    springs = np.zeros(6)
    shares = np.array([0.30, 0.22, 0.18, 0.13, 0.10, 0.07])
    reach = np.array([0.25, 0.5, 0.9, 1.4, 2.0, 3.0])
    integral = axis.offset_n / axis.force_per_a
    current = integral
    wanted = integral
    dead = round(axis.dead_time_s / h)
    queue = np.full(dead + 1, integral)
    head = 0
    v_wanted = pull_motor = pull_table = 0.0
    # at rest: what the constant force stretches, and play on the side to which it pushes
    xm += axis.offset_n / axis.stiffness_n_per_m + (0.5 * axis.play_m if axis.offset_n >= 0.0 else -0.5 * axis.play_m)
    origin = xm - command[0]
    bow = axis.lead_bow_per_m * (xm - axis.middle_m) ** 2
    lead = axis.lead_m * np.sin(2.0 * np.pi * xm / axis.lead_pitch_m + axis.lead_phase) + bow
    rest = lead
    for k in range(n):
        x_motor[k], v_motor[k], x_table[k], amps[k] = xm - origin, vm, xt, current
        if k % per_command == 0:
            j = k // per_command
            seen = xt if axis.on_scale > 0.5 else xm - origin
            seen = axis.encoder_m * np.floor(seen / axis.encoder_m + 0.5)
            v_wanted = axis.position_gain_per_s * (command[j] - seen) + axis.feed_forward * speed[j]
        if k % per_loop == 0:
            error = (v_wanted - vm) * axis.speed_gain_ns_per_m / axis.force_per_a
            total = error + integral
            wanted = min(max(total, -axis.limit_a), axis.limit_a)
            # beyond the limit the integral follows what the limit lets through
            integral += (error + (wanted - total)) * SPEED_LOOP_S / axis.integral_time_s
        queue[head] = wanted
        head = (head + 1) % (dead + 1)
        # positions and current in the middle of the step, then speeds, then the rest: second order in the step
        half_lag = 1.0 - np.exp(-0.5 * h / axis.current_lag_s)
        current += half_lag * (queue[head] - current)
        xm += 0.5 * h * vm
        xt += 0.5 * h * vt
        vm_mid, vt_mid = vm + 0.5 * h * pull_motor, vt + 0.5 * h * pull_table

        bow = axis.lead_bow_per_m * (xm - axis.middle_m) ** 2
        lead = axis.lead_m * np.sin(2.0 * np.pi * xm / axis.lead_pitch_m + axis.lead_phase) + bow
        slack = xm + lead - rest - xt
        half = 0.5 * axis.play_m
        if slack > half:
            slack -= half
        elif slack < -half:
            slack += half
        else:
            slack = 0.0
        joint = 0.0
        if slack != 0.0 or axis.play_m == 0.0:
            soft = 1.0 + axis.compliance_per_m * (xt - axis.middle_m)
            joint = axis.stiffness_n_per_m * slack / soft + axis.screw_damping_ns_per_m * (vm_mid - vt_mid)

        side = 1.0 if vt_mid > 0.0 else -1.0
        level = axis.coulomb_n * (1.0 + side * axis.coulomb_by_direction)
        peak = level + axis.break_away_n * np.exp(-((vt_mid / axis.stribeck_m_per_s) ** 2))
        friction = 0.0
        if peak > 0.0:
            if axis.slips > 0.5:
                for i in range(6):
                    limit = reach[i] * axis.presliding_m
                    before = springs[i]
                    springs[i] = min(max(springs[i] + vt_mid * h, -limit), limit)
                    friction += 0.5 * peak * shares[i] * (before + springs[i]) / limit
            else:
                # deflection of the bristles as a share of its limit: exact over a step of constant speed
                stiffness = max(axis.coulomb_n, axis.break_away_n) / axis.presliding_m
                end = side * peak / stiffness
                before = bristle
                bristle = end + (bristle - end) * np.exp(-stiffness * abs(vt_mid) * h / peak)
                friction = 0.5 * stiffness * (before + bristle)
        viscous = axis.viscous_ns_per_m * (1.0 + side * axis.viscous_by_direction)
        friction += viscous * (1.0 + axis.viscous_by_position_per_m * (xt - axis.middle_m)) * vt_mid

        ripple = axis.ripple_n * np.sin(2.0 * np.pi * xm / axis.ripple_m + axis.ripple_phase)
        drive = axis.force_per_a * current - ripple
        pull_motor = (drive - joint) / axis.motor_kg
        pull_table = (joint - friction - axis.offset_n - force[k]) / axis.table_kg
        vm += h * pull_motor
        vt += h * pull_table
        xm += 0.5 * h * vm
        xt += 0.5 * h * vt
        current += half_lag * (queue[head] - current)
    return x_motor, v_motor, x_table, amps


GIVEN_STEP_S = 1.25e-4
"""Step of the simulation that is given to the tool [s]."""


def given_motion(axis: TrueAxis, command_m: Vector) -> tuple[Vector, Vector, Vector]:
    """(motor speed, table position, current) [m/s, m, A] every `COMMAND_S`, of a command given as often.

    The simulation knows masses, stiffness and damping of the screw, loop and lag; its guide has one Coulomb level,
    approached along `presliding_m`, and viscous friction, and nothing else of the true axis.
    """
    step, into = _one_step(axis)
    loop = np.array(
        [
            axis.position_gain_per_s,
            axis.feed_forward,
            axis.speed_gain_ns_per_m / axis.force_per_a,
            axis.integral_time_s,
            axis.coulomb_n,
            axis.presliding_m,
        ]
    )
    found = _given_motion(step, into, loop, axis.on_scale > 0.5, command_m, np.gradient(command_m, COMMAND_S))
    return found[0], found[1], found[2]


def _one_step(axis: TrueAxis) -> tuple[Matrix, Matrix]:
    """Exact step of (current, motor position, motor speed, table position, table speed), and of what drives it."""
    a, b = np.zeros((5, 5)), np.zeros((5, 2))
    a[0, 0], b[0, 0] = -1.0 / axis.current_lag_s, 1.0 / axis.current_lag_s
    a[1, 2] = a[3, 4] = 1.0
    k, d = axis.stiffness_n_per_m, axis.screw_damping_ns_per_m
    a[2] = np.array([axis.force_per_a, -k, -d, k, d]) / axis.motor_kg
    a[4] = np.array([0.0, k, d, -k, -d - axis.viscous_ns_per_m]) / axis.table_kg
    b[4, 1] = -1.0 / axis.table_kg
    whole = expm(np.block([[a, b], [np.zeros((2, 7))]]) * GIVEN_STEP_S)
    return np.ascontiguousarray(whole[:5, :5]), np.ascontiguousarray(whole[:5, 5:])


@njit(cache=True, nogil=True)
def _given_motion(step, into, loop, on_scale, command, speed):  # type: ignore[no-untyped-def]
    h = GIVEN_STEP_S
    per_command = round(COMMAND_S / h)
    per_loop = round(SPEED_LOOP_S / h)
    n = len(command)
    v_motor, x_table, amps = np.empty(n), np.empty(n), np.empty(n)
    x = np.zeros(5)
    new = np.zeros(5)
    integral = wanted = v_wanted = bent = last = 0.0
    level, reach = loop[4], loop[5]
    for k in range(n * per_command):
        j = k // per_command
        if k % per_command == 0:
            v_motor[j], x_table[j], amps[j] = x[2], x[3] + command[0], x[0]
            seen = (x[3] if on_scale else x[1]) + command[0]
            v_wanted = loop[0] * (command[j] - seen) + loop[1] * speed[j]
        if k % per_loop == 0:
            error = (v_wanted - x[2]) * loop[2]
            wanted = error + integral
            integral += error * SPEED_LOOP_S / loop[3]
        friction = 0.0
        if level > 0.0:
            # deflection of the guide, carried along with the table until it slips: exact for constant speed
            middle = x[4] + 0.5 * (x[4] - last)
            last = x[4]
            end = reach if middle > 0.0 else -reach
            before = bent
            bent = end + (bent - end) * np.exp(-abs(middle) * h / reach)
            friction = 0.5 * level * (before + bent) / reach
        for row in range(5):
            total = into[row, 0] * wanted + into[row, 1] * friction
            for column in range(5):
                total += step[row, column] * x[column]
            new[row] = total
        x, new = new, x
    return v_motor, x_table, amps


Style = Literal["strokes", "one way", "one speed", "creeping", "sines", "other", "gentle", "cycles"]
Move = tuple[float, float]
"""Speed [m/s] and time at that speed [s]."""

LENGTH_S = 7.0
CYCLE_S = 0.9
"""Time after which a programme of cycles repeats."""
_REST_S = 0.25


def command(
    moves: Sequence[Move], generator: np.random.Generator, acceleration: float, rounded_s: float = 0.045
) -> Vector:
    """Positions [m] every `COMMAND_S` over `LENGTH_S` of moves with ramps of `acceleration` [m/s²].

    Jerk is rounded over about `rounded_s`. The axis stays within 0.05 to 0.55 m: a move that would leave this is
    driven the other way.
    """
    n = round(LENGTH_S / COMMAND_S)
    speed = np.zeros(n)
    position, now, k = 0.05 + 0.05 * generator.random(), 0.0, int(_REST_S / COMMAND_S)
    begin = position
    stop = n - int(0.25 / COMMAND_S)
    for wanted, time_s in moves:
        if k >= stop:
            break
        end = position + wanted * time_s
        target = -wanted if not 0.05 <= end <= 0.55 else wanted
        ramp = max(int(abs(target - now) / acceleration / COMMAND_S), 1)
        hold = int(time_s / COMMAND_S)
        part = np.concatenate([np.linspace(now, target, ramp, endpoint=False), np.full(hold, target)])[: stop - k]
        speed[k : k + len(part)] = part
        position += float(part.sum()) * COMMAND_S
        k, now = k + len(part), float(part[-1])
    ramp = min(max(int(abs(now) / acceleration / COMMAND_S), 1), n - k)
    speed[k : k + ramp] = np.linspace(now, 0.0, ramp)
    window = np.hanning(2 * int(0.5 * rounded_s * generator.uniform(0.67, 1.33) / COMMAND_S) + 3)
    smooth = np.convolve(speed, window / window.sum(), mode="same")
    return np.asarray(begin + np.cumsum(smooth) * COMMAND_S)


def sine(amplitude_m: float, rises_s: float, turns_per_s: float, generator: np.random.Generator) -> Vector:
    """A circle's sine: positions [m] that swing to `amplitude_m` within `rises_s` and stand still at both ends."""
    time = np.arange(round(LENGTH_S / COMMAND_S)) * COMMAND_S
    inside = np.clip((time - _REST_S) / rises_s, 0.0, 1.0) * np.clip((LENGTH_S - _REST_S - time) / rises_s, 0.0, 1.0)
    envelope = inside**2 * (3.0 - 2.0 * inside)
    middle = 0.2 + 0.1 * generator.random()
    return np.asarray(middle + amplitude_m * envelope * np.sin(2.0 * np.pi * turns_per_s * (time - _REST_S)))


def cycles(fastest: float, generator: np.random.Generator) -> Vector:
    """A smooth course that repeats every `CYCLE_S`, of another shape and size in every run [m]."""
    time = np.arange(round(LENGTH_S / COMMAND_S)) * COMMAND_S
    speed = np.zeros_like(time)
    for k, height in enumerate((1.0, 0.5 * generator.random(), 0.3 * generator.random()), start=1):
        speed += height * np.cos(2.0 * np.pi * k * time / CYCLE_S + generator.uniform(0.0, 2.0 * np.pi))
    rise = np.clip(time / CYCLE_S, 0.0, 1.0)
    course = generator.uniform(0.5, 1.0) * fastest * speed / np.abs(speed).max() * rise**2 * (3.0 - 2.0 * rise)
    return np.asarray(0.25 + np.cumsum(course) * COMMAND_S)


def programme(
    style: Style, generator: np.random.Generator, fastest: float, acceleration: float, rounded_s: float = 0.045
) -> Vector:
    """The command of one run in a style, with speeds up to `fastest` [m/s], different for every draw."""
    speeds = fastest * np.array([1.0, 0.55, 0.3, 0.15, 0.06])
    moves: list[Move] = []
    if style == "sines":
        turns = generator.uniform(0.4, 0.9)
        return sine(fastest / (2.0 * np.pi * turns), generator.uniform(0.6, 1.2), turns, generator)
    if style == "cycles":
        return cycles(fastest, generator)
    if style == "strokes":
        for speed in generator.permutation(np.tile(speeds[:4], 2)):
            time_s = generator.uniform(0.25, 0.45)
            moves += [(speed, time_s), (0.0, generator.uniform(0.02, 0.15)), (-speed, time_s)]
    elif style == "one speed":
        for _ in range(9):
            moves += [(speeds[0], generator.uniform(0.4, 0.7)), (-speeds[0], generator.uniform(0.4, 0.7))]
    elif style == "one way":
        for speed in generator.permutation(np.tile(speeds[1:4], 4)):
            moves += [(0.6 * speed, generator.uniform(0.3, 0.6)), (0.0, generator.uniform(0.05, 0.2))]
        moves = [move if k < 18 else (-move[0], move[1]) for k, move in enumerate(moves)]
    elif style == "creeping":
        slow = fastest * np.array([0.01, 0.02, 0.04, 0.25, 0.6])
        for speed in generator.permutation(np.tile(slow, 2)):
            time_s = generator.uniform(0.2, 0.35)
            moves += [(speed, time_s), (-speed, time_s)]
    elif style == "gentle":
        for speed in generator.permutation(np.tile(speeds[2:], 3)):
            moves += [(speed, generator.uniform(0.3, 0.8)), (-speed, generator.uniform(0.3, 0.8))]
    else:
        for speed in generator.permutation(np.tile(fastest * np.array([0.8, 0.4, 0.2, 0.1, 0.03]), 2)):
            back = speed * generator.uniform(0.5, 1.5)
            moves += [(speed, generator.uniform(0.2, 0.6)), (-min(back, fastest), generator.uniform(0.2, 0.5))]
    return command(moves, generator, acceleration, rounded_s)


RUNS = ("r1", "r2", "r3")
PERIOD_S = 2e-3


@dataclass(frozen=True, eq=False)
class Bench:
    """An axis with what it is told and how it is recorded."""

    machine: TrueAxis  #: Without the effect
    commands: tuple[Vector, ...]  #: Of every run, every millisecond [m]
    stamps: tuple[Vector, ...]  #: Times of the recorded rows [s]
    jitter: tuple[Vector, ...]  #: How much later than its stamp every row was read [s]
    noise: dict[str, Noise]  #: Of every quantity that may be a response
    speed_noise: float  #: Of the recorded speed [m/s]
    runs: tuple[str, ...] = RUNS

    def with_command(self, told: Vector, period_s: float, generator: np.random.Generator) -> Bench:
        """The bench with a run more, in front of the last one; positions are told every `period_s` [m]."""
        fine = np.arange(0.0, len(told) * period_s, COMMAND_S)
        stamps = PERIOD_S * np.arange(int(fine[-1] / PERIOD_S) - 25, dtype=np.float64)
        spread = float(np.std(self.jitter[0]))
        late = spread * np.clip(generator.standard_normal(len(stamps)), -3.0, 3.0)

        def inserted(known: Sequence[Any], one: Any) -> tuple[Any, ...]:
            return (*known[:-1], one, known[-1])

        return replace(
            self,
            commands=inserted(self.commands, np.interp(fine, period_s * np.arange(len(told)), told)),
            stamps=inserted(self.stamps, stamps),
            jitter=inserted(self.jitter, late),
            runs=inserted(self.runs, f"r{len(self.runs) + 1}"),
        )


def bench(
    generator: np.random.Generator,
    *,
    styles: Sequence[Style] = ("strokes", "sines", "other"),
    friction: bool = True,
    on_scale: bool = True,
    colour: str = "white",
    jitter_s: float = 2e-6,
    fastest: float | None = None,
    coarse_scale: bool = False,
    slips: bool = False,
    rounded_s: float = 0.045,
    start: Mapping[str, float] = MappingProxyType({}),
) -> Bench:
    """An axis of a machining centre with its loop, three runs, and noise of a colour.

    `friction` False makes the guide hydrostatic: viscous only. With `slips` bristles give way to springs that slip one
    after the other; `coarse_scale` has thrice the noise in the displacement. `colour`: white, ar, heavy-tailed,
    quantised, coarse (readings repeat), cycle-locked. `start` are parameters that are set whatever was drawn.
    """
    draw = generator.uniform
    table, motor = draw(80.0, 300.0), draw(40.0, 100.0)
    axis = TrueAxis(
        motor_kg=motor,
        table_kg=table,
        stiffness_n_per_m=draw(0.8e8, 2.2e8),
        screw_damping_ns_per_m=draw(1.5e4, 4e4),
        slips=1.0 if slips else 0.0,
        coulomb_n=draw(40.0, 160.0) if friction else 0.0,
        presliding_m=draw(2e-6, 6e-6),
        viscous_ns_per_m=draw(150.0, 600.0),
        position_gain_per_s=draw(30.0, 70.0),
        feed_forward=draw(0.9, 1.0),
        speed_gain_ns_per_m=(motor + table) * draw(180.0, 320.0),
        integral_time_s=draw(0.012, 0.03),
        current_lag_s=draw(4e-4, 9e-4),
        force_per_a=draw(50.0, 120.0),
        on_scale=1.0 if on_scale else 0.0,
    )
    top = draw(0.08, 0.2) if fastest is None else fastest
    pull = draw(1.0, 2.5)
    commands = tuple(programme(style, generator, top, pull, rounded_s) for style in styles)
    n = int(LENGTH_S / PERIOD_S) - 25
    middle = float(np.mean(np.concatenate(commands)))
    return Bench(
        axis._replace(middle_m=middle)._replace(**start),
        commands,
        tuple(PERIOD_S * np.arange(n, dtype=np.float64) for _ in styles),
        tuple(jitter_s * np.clip(generator.standard_normal(n), -3.0, 3.0) for _ in styles),
        {
            "E": noise_of(colour, draw(0.2, 0.5) * (3.0 if coarse_scale else 1.0), generator),
            "I": noise_of(colour, draw(0.03, 0.08), generator),
            "F": noise_of(colour, axis.force_per_a * draw(0.03, 0.08), generator),
            "a": noise_of(colour, draw(0.03, 0.08), generator),
            "x": noise_of(colour, draw(0.2e-6, 0.5e-6), generator),
        },
        draw(5e-6, 3e-5),
    )


def noise_of(colour: str, sd: float, generator: np.random.Generator) -> Noise:
    """Noise of a colour with about this standard deviation."""
    if colour == "coarse":
        return Noise(0.3 * sd, step=2.0 * sd)
    if colour == "cycle-locked":
        return Noise(sd, cycle_samples=round(CYCLE_S / PERIOD_S), cycle_sd=sd, step=sd / 20.0)
    return coloured(colour, sd, sd / 20.0, float(generator.uniform(0.3, 0.6)) if colour == "ar" else 0.0)


def command_times(commands: Vector) -> Vector:
    """Times of the samples of a command [s]."""
    return np.asarray(np.arange(len(commands)) * COMMAND_S)
