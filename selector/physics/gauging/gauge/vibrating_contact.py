"""How a vibrating-contact gauge moves in time, and which swing lasts while the allowance stays (G fig. 2)."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.physics.gauging.gauge import _swing as at
from selector.physics.gauging.gauge.transducer import (
    FAR_M,
    STEPS_PER_KNOT,
    STEPS_PER_ROUND,
    Contact,
    Relay,
    Smoothing,
    Transducer,
    packed,
    refusal,
    round_s,
    widen_scales,
)
from selector.types import Matrix, Vector

RELATIVE_TOLERANCE = 1e-8  #: Error of a step as a share of the free swing.


@dataclass(frozen=True)
class GaugeState:
    """Where everything in a gauge is at one time."""

    #: probe_m and probe_m_per_s: z, z' [m], [m/s]
    probe_m: float = 0.0
    probe_m_per_s: float = 0.0
    current_a: float | None = None  #: i of the electromagnet [A]; None: that of a coil that was switched on long ago
    #: generator_v and smoothed_v: u, S [V]; u does not matter where the generator has no time constant
    generator_v: float = 0.0
    smoothed_v: float = 0.0


@dataclass(frozen=True, eq=False)
class GaugeMotion:
    """What goes on in a gauge, each an ndarray of shape (n_samples,)."""

    time_s: Vector  #: [s]
    current_a: Vector  #: i of the electromagnet [A]
    #: probe_m and probe_m_per_s: z, z' [m], [m/s]
    probe_m: Vector
    probe_m_per_s: Vector
    contact_n: Vector  #: Force of the workpiece on the tip, 0 or more [N]
    generator_v: Vector  #: u, before the rectifier [V]
    smoothed_v: Vector  #: S, behind the filter [V]

    def state(self, sample: int) -> GaugeState:
        """Where everything is at a sample: a start for what follows."""
        return GaugeState(
            *(
                float(course[sample])
                for course in (self.probe_m, self.probe_m_per_s, self.current_a, self.generator_v, self.smoothed_v)
            )
        )


def simulate_transducer(
    transducer: Transducer,
    allowance_um: ArrayLike,
    time_s: ArrayLike,
    *,
    start: GaugeState | None = None,
    relative_tolerance: float = RELATIVE_TOLERANCE,
) -> GaugeMotion:
    """What goes on in a gauge while the allowance changes; see docs/explanation/vibrating-contact-gauge.md.

    Steps are as long as the tolerance allows; touches are located in time. The supply is V0·sin(ω0·time_s). Relay and
    its noise are left to what compares the smoothed voltage.

    `allowance_um` is one number, or one a sample, straight between them [µm]. Without a `start` the probe is at rest,
    or pushed back to the surface, and the coil is switched on at the first sample.

    Raises InputError if the probe reaches a core, or nothing can follow contact or generator.
    """
    time = np.array(time_s, dtype=np.float64)
    allowance = np.broadcast_to(np.asarray(allowance_um, dtype=np.float64), time.shape)
    plane = transducer.rest_gap_m - 1e-6 * allowance
    p = packed(transducer, relative_tolerance)
    p[at.PHASE] = math.fmod(p[at.PHASE] - p[at.MAINS] * time[0], 2.0 * math.pi)
    begin = start or GaugeState(probe_m=min(0.0, float(plane[0])), current_a=0.0)
    y = _states(p, begin)
    if transducer.electromagnet.inductance_h > 0:
        p[at.SWITCHED] = y[at.AMPERES] + p[at.CURRENT] * math.sin(p[at.PHASE])
        p[at.SWITCHED_RATE] = transducer.electromagnet.resistance_ohm / transducer.electromagnet.inductance_h
    for core, ended in ((at.MAGNET, at.MAGNET_REACHED), (at.CORE, at.CORE_REACHED)):
        if begin.probe_m * p[core] > 1.0 - at.CLOSED:
            raise refusal(ended, transducer)
    widen_scales(p, begin.probe_m, begin.probe_m_per_s, float(plane.min()))
    since = time - time[0]
    slope = np.diff(plane) / np.diff(time)
    bends = np.flatnonzero(np.abs(np.diff(slope)) > 1e-9 * np.abs(slope).max(initial=0.0)) + 1
    knots = np.concatenate([[0], bends, [len(time) - 1]])
    if p[at.COIL_S] == 0:
        y[at.U] = -p[at.INDUCED] * y[at.V] / (1.0 - y[at.Z] * p[at.CORE]) ** 2
    out = np.empty((len(time), at.STATES))
    most = STEPS_PER_ROUND * math.ceil(since[-1] / round_s(transducer)) + STEPS_PER_KNOT * len(knots)
    ended, _ = at.course(
        y, p, np.array([0, 0, most, 0]), np.array([p[at.LONGEST] / 8, 0.0, 0.0]), since, plane, knots, out
    )
    if ended != at.DONE:
        raise refusal(ended, transducer)
    if p[at.VOLTS] > 0:
        current = out[:, at.AMPERES]
    else:
        current = p[at.CURRENT] * np.sin(p[at.MAINS] * since - p[at.PHASE])
        current += p[at.SWITCHED] * np.exp(-p[at.SWITCHED_RATE] * since)
    away = np.concatenate([slope[:1], slope])
    force = contact_force_n(transducer.contact, out[:, at.Z] - plane, out[:, at.V] - away)
    return GaugeMotion(time, current, out[:, at.Z], out[:, at.V], force, out[:, at.U], out[:, at.S])


def _states(p: Vector, begin: GaugeState) -> Vector:
    """What the compiled swing begins with; a current that is not known is that of a probe that has been at rest."""
    current_a = -p[at.CURRENT] * math.sin(p[at.PHASE]) if begin.current_a is None else begin.current_a
    return np.array([begin.probe_m, begin.probe_m_per_s, begin.generator_v, begin.smoothed_v, current_a])


def contact_force_n(contact: Contact, overlap_m: Vector, overlap_m_per_s: Vector) -> Vector:
    """Force of a contact at overlaps and their rates: k·δ^p·(1 + λ·δ'), 0 or more [N]."""
    elastic = contact.stiffness * np.maximum(overlap_m, 0.0) ** contact.exponent
    return elastic * np.maximum(1.0 + contact.damping_s_per_m * overlap_m_per_s, 0.0)


MOST_ROUNDS_TO_REPEAT = 8  #: A swing that does not repeat within so many rounds counts as irregular.
IRREGULAR_ROUNDS = 400  #: Rounds over which an irregular swing is averaged, at most.
_BLOCK = 24
_BLOCKS = 16
_REPEATS = 3e-7  #: Change from round to round that counts as none, as a share of the free swing.
_APART = 1e-4  #: Rounds that differ by more do not repeat one another.
_SAMPLES = 256
_BATCHES = 20
_STEPS = 200_000  #: Steps within which a swing is looked for: more than any needs that contact damps.


@dataclass(frozen=True)
class SteadySwing:
    """The swing that lasts at one allowance."""

    allowance_um: float  #: [µm]
    #: voltage_v and voltage_sd_v: Mean of the smoothed voltage, and how uncertain it is because the swing is irregular
    #: [V]
    voltage_v: float
    voltage_sd_v: float
    crest_v: float  #: How far the highest smoothed voltage is above the mean [V]
    #: stroke_um and highest_um: Between the turning points over all rounds; the highest of them, from the probe's rest
    #: [µm]
    stroke_um: float
    highest_um: float
    rounds: int  #: After how many periods of the pull it repeats; 0: never
    state: GaugeState  #: At a zero crossing of the supply that rises


class _Rounds(NamedTuple):
    """A transducer whose filter sums up the rectified voltage over a round."""

    transducer: Transducer
    p: Vector
    plane_m: float
    effort: NDArray[np.int64]

    def run(self, state: Vector, count: int) -> Matrix:
        out = np.empty((count, at.STATES + 3))
        y, counted = state.copy(), np.array([0, 0, STEPS_PER_ROUND * count, 0])
        hint = np.array([self.p[at.LONGEST] / 8, 0.0, 0.0])
        ended = at.rounds(y, self.p, counted, hint, self.plane_m, round_s(self.transducer), out)
        self.effort[:] += (counted[at.STEPS], count)
        if ended != at.DONE:
            raise refusal(ended, self.transducer)
        return out

    def affordable(self, rounds: int) -> int:
        """So many rounds, or fewer where they take many steps."""
        return int(min(max(_STEPS * self.effort[1] // self.effort[0], 2 * _BATCHES), rounds))

    @property
    def moving(self) -> list[int]:
        """States that act on the motion; voltages follow it."""
        return [at.Z, at.V, at.AMPERES] if self.p[at.VOLTS] > 0 else [at.Z, at.V]

    @property
    def scale(self) -> Vector:
        return self.p[at.SCALES :][self.moving]

    def distance(self, a: Vector, b: Vector) -> float:
        return float(np.max(np.abs(a[self.moving] - b[self.moving]) / self.scale))


def steady_swing(transducer: Transducer, allowance_um: float | None, *, start: GaugeState | None = None) -> SteadySwing:
    """The swing that lasts, come to from `start`; an allowance of None: a workpiece out of reach.

    Rounds are run until they repeat within 3e-7 of the free swing; Newton's method on the states of a round is tried
    where that takes long, and kept if the swing it finds is stable.

    Raises InputError if the probe reaches a core, or nothing can follow contact or generator.
    """
    swing, state, rounds = _lasting(_behind_any_filter(transducer), allowance_um, start or GaugeState())
    p, plane = packed(transducer, RELATIVE_TOLERANCE), _plane_m(transducer, allowance_um)
    widen_scales(p, 0.0, 0.0, plane)
    return replace(swing, crest_v=_crest_v(transducer, plane, p, state, rounds, swing))


def _plane_m(transducer: Transducer, allowance_um: float | None) -> float:
    return FAR_M if allowance_um is None else transducer.rest_gap_m - 1e-6 * allowance_um


@lru_cache(maxsize=64)
def _behind_any_filter(transducer: Transducer) -> Transducer:
    return replace(transducer, smoothing=Smoothing(1.0), relay=Relay())


@lru_cache(maxsize=2048)  # 17 characteristics
def _lasting(transducer: Transducer, allowance_um: float | None, start: GaugeState) -> tuple[SteadySwing, Vector, int]:
    """The swing but for its crest, its states, and over how many rounds that is looked for.

    Neither filter nor relay acts on the motion or on the mean voltage: tries of other filters find it here.
    """
    plane = _plane_m(transducer, allowance_um)
    summing = packed(transducer, RELATIVE_TOLERANCE)
    widen_scales(summing, 0.0, 0.0, plane)
    summing[at.RATE], summing[at.LEAK] = 1.0 / round_s(transducer), 0.0
    swing = _Rounds(transducer, summing, plane, np.zeros(2, dtype=np.int64))
    state, repeats = _settled(swing, _states(summing, replace(start, probe_m=min(start.probe_m, plane))))
    ran = repeats or swing.affordable(IRREGULAR_ROUNDS)
    state[at.U] = _settled_voltage(swing, state, ran)
    out = swing.run(state, ran)
    mean_v = float(out[:, at.S].mean())
    current_a = float(state[at.AMPERES]) if summing[at.VOLTS] > 0 else None
    state.flags.writeable = False
    found = SteadySwing(
        allowance_um=math.inf if allowance_um is None else float(allowance_um),
        voltage_v=mean_v,
        voltage_sd_v=0.0 if repeats else _sd_of_mean(out[:, at.S]),
        crest_v=math.nan,
        stroke_um=1e6 * float(out[:, -3].max() - out[:, -2].min()),
        highest_um=1e6 * float(out[:, -3].max()),
        rounds=repeats,
        state=GaugeState(float(state[at.Z]), float(state[at.V]), current_a, float(state[at.U]), mean_v),
    )
    return found, state, min(ran, MOST_ROUNDS_TO_REPEAT)


def _settled(swing: _Rounds, state: Vector) -> tuple[Vector, int]:
    """A state of the swing that lasts, and after how many rounds it repeats."""
    tail = np.array([state])
    for block in range(_BLOCKS):
        tail = np.concatenate([tail, swing.run(tail[-1], _BLOCK)[:, :-3]])[-3 * MOST_ROUNDS_TO_REPEAT :]
        for count in range(1, MOST_ROUNDS_TO_REPEAT + 1):
            change = swing.distance(tail[-1], tail[-1 - count])
            before = swing.distance(tail[-1 - count], tail[-1 - 2 * count])
            shrinks = min(change / before, 1.0) if before > 0 else 0.0
            # what is still to come, if it goes on to shrink like that
            if change < 0.1 * _REPEATS or (shrinks < 1.0 and change * shrinks / (1.0 - shrinks) < _REPEATS):
                return tail[-1].copy(), count
            if change < _APART:
                # fewer rounds will do, once this has shrunk
                break
        if swing.effort[0] > _STEPS:
            break
        if block in (1, 4):
            found = _by_newton(swing, tail[-1])
            if found is not None:
                return found, 1
    return tail[-1].copy(), 0


def _by_newton(swing: _Rounds, state: Vector) -> Vector | None:
    """A state that repeats after a round and that small disturbances fade to, near this one; None if none is found."""
    moving, scale = swing.moving, swing.scale
    at_present = state.copy()
    for _ in range(8):
        end = swing.run(at_present, 1)[0, :-3]
        slope = np.empty((len(moving), len(moving)))
        for column, n in enumerate(moving):
            moved = at_present.copy()
            moved[n] += 1e-4 * scale[column]
            slope[:, column] = (swing.run(moved, 1)[0, moving] - end[moving]) / scale / 1e-4
        if swing.distance(end, at_present) < 0.1 * _REPEATS:
            return end if np.abs(np.linalg.eigvals(slope)).max() < 1.0 - 1e-4 else None
        if abs(np.linalg.det(slope - np.eye(len(moving)))) < 1e-9:
            return None
        step = np.linalg.solve(np.eye(len(moving)) - slope, (end[moving] - at_present[moving]) / scale)
        if not np.abs(step).max() < 2.0:
            return None
        at_present[moving] += step * scale
        at_present[at.U] = end[at.U]
    return None


def _settled_voltage(swing: _Rounds, state: Vector, rounds: int) -> float:
    """Voltage of the generator at a state that repeats: what is left of it after the rounds, and what they add."""
    time_constant = swing.transducer.generator.time_constant_s
    if time_constant == 0:
        return 0.0
    left = math.exp(-rounds * round_s(swing.transducer) / time_constant)
    uncharged = state.copy()
    uncharged[at.U] = 0.0
    added = swing.run(uncharged, rounds)[-1, at.U]
    return float(added / (1.0 - left))


def _crest_v(
    transducer: Transducer, plane_m: float, p: Vector, state: Vector, rounds: int, swing: SteadySwing
) -> float:
    """The highest smoothed voltage above its mean."""
    time = np.linspace(0.0, rounds * round_s(transducer), _SAMPLES * rounds + 1)
    out, begin = np.empty((len(time), at.STATES)), state.copy()
    begin[at.S] = 0.0
    knots, plane = np.array([0, len(time) - 1]), np.full(len(time), plane_m)
    ended, _ = at.course(
        begin, p, np.array([0, 0, STEPS_PER_ROUND * rounds, 0]),
        np.array([p[at.LONGEST] / 8, 0.0, 0.0]), time, plane, knots, out,
    )  # fmt: skip
    if ended != at.DONE:
        raise refusal(ended, transducer)
    fading = np.exp(-time * p[at.RATE])
    first = out[-1, at.S] / (1.0 - fading[-1]) if swing.rounds else swing.voltage_v
    course = out[:, at.S] + first * fading
    return float(course.max() - course[:-1].mean())


def _sd_of_mean(values: Vector) -> float:
    """Standard error of the mean of a course with memory, by means of batches."""
    batches = values[: len(values) // _BATCHES * _BATCHES].reshape(_BATCHES, -1).mean(axis=1)
    return float(batches.std(ddof=1) / math.sqrt(len(batches)))
