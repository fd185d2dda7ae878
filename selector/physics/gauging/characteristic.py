"""How a vibrating-contact gauge moves, which swing lasts while the allowance stays, and the voltage that belongs to it.

Characteristic and line: G eq. 15–20, fig. 2.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from selector.errors import InputError
from selector.findings import Finding
from selector.physics.gauging import _swing as at
from selector.physics.gauging.finding_table import FINDINGS
from selector.physics.gauging.transducer import (
    FAR_M,
    STEPS_PER_KNOT,
    STEPS_PER_ROUND,
    Contact,
    LinearGauge,
    Relay,
    Smoothing,
    Transducer,
    packed,
    refusal,
    round_s,
    widen_scales,
)
from selector.physics.ranges import true_stretches
from selector.types import Mask, Matrix, Vector

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
    # an irregular one for fewer rounds where they take many steps
    ran = repeats or int(min(max(_STEPS * swing.effort[1] // swing.effort[0], 2 * _BATCHES), IRREGULAR_ROUNDS))
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


POINTS = 60
_FALLS = 1e-6  #: A voltage that falls by less than this share of the largest one stands still.
#: Two swings at one allowance are the same if their voltages differ by less than this share of the largest one.
_SAME = 1e-3


@dataclass(frozen=True, eq=False)
class Characteristic:
    """Mean smoothed voltage over allowances that stay, monotone cubics (PCHIP) between the points."""

    #: allowance_um and voltage_v: (n_points,): Increasing [µm]; [V]
    allowance_um: Vector
    voltage_v: Vector
    crest_v: Vector | None = None  #: (n_points,): Highest smoothed voltage above its mean [V]
    #: A0, half the stroke without workpiece: how far the range of the gauge reaches beyond `touch_um`, at most [µm]
    free_amplitude_um: float | None = None
    #: Allowance at which the free swing just touches: below it the gauge shows nothing [µm]
    touch_um: float | None = None
    findings: tuple[Finding, ...] = ()  #: Swings that never repeat or are not the only one

    def __post_init__(self) -> None:
        for values in (self.allowance_um, self.voltage_v):
            values.flags.writeable = False

    @cached_property
    def _curve(self) -> PchipInterpolator:
        return PchipInterpolator(self.allowance_um, self.voltage_v)

    def voltage_at(self, allowance_um: ArrayLike) -> Vector:
        """Voltages at allowances of any shape [V]; beyond the points that of the nearest one."""
        within = np.clip(np.asarray(allowance_um, dtype=np.float64), self.allowance_um[0], self.allowance_um[-1])
        return np.asarray(self._curve(within), dtype=np.float64)

    def slope_at(self, allowance_um: ArrayLike) -> Vector:
        """Slopes at allowances of any shape [V/µm]; beyond the points 0."""
        at = np.asarray(allowance_um, dtype=np.float64)
        inside = (at >= self.allowance_um[0]) & (at <= self.allowance_um[-1])
        return np.where(inside, self._curve.derivative()(np.where(inside, at, self.allowance_um[0])), 0.0)

    @cached_property
    def monotone_um(self) -> tuple[float, float]:
        """The longest range of allowances over which the voltage falls all the way [µm].

        Raises InputError if it falls nowhere.
        """
        first, last = self._monotone
        return float(self.allowance_um[first]), float(self.allowance_um[last])

    @cached_property
    def _monotone(self) -> tuple[int, int]:
        falls = np.diff(self.voltage_v) < -_FALLS * np.abs(self.voltage_v).max()
        if not falls.any():
            raise InputError(
                f"a voltage that falls nowhere from {self.allowance_um[0]:g} to {self.allowance_um[-1]:g} µm",
                expected="a voltage that falls with the allowance",
                where="characteristic",
                advice="let the swing reach the workpiece: rest_gap_m, voltage_v of the magnet",
            )
        starts, stops = true_stretches(falls).T
        longest = int(np.argmax(self.allowance_um[stops] - self.allowance_um[starts]))
        return int(starts[longest]), int(stops[longest])

    def allowance_at(self, voltage_v: ArrayLike) -> Vector:
        """Allowances that belong to voltages, in the monotone range [µm].

        Raises InputError if a voltage belongs to none.
        """
        first, last = self._monotone
        high, low = self.voltage_v[first], self.voltage_v[last]
        wanted = np.asarray(voltage_v, dtype=np.float64)
        if not ((wanted >= low) & (wanted <= high)).all():
            outside = wanted[~((wanted >= low) & (wanted <= high))].flat[0]
            raise InputError(
                f"{outside:.6g} V",
                expected=f"a voltage from {low:.6g} V to {high:.6g} V, which is from {self.allowance_um[last]:.5g} µm "
                f"down to {self.allowance_um[first]:.5g} µm of allowance",
                where="characteristic",
                advice="stay within this range, or set the gauge nearer or farther (rest_gap_m)",
            )
        above_it = last - np.searchsorted(self.voltage_v[first : last + 1][::-1], wanted, side="right")
        piece = np.clip(above_it, first, last - 1)
        c3, c2, c1, c0 = (self._curve.c[n][piece] for n in range(4))
        below, above = np.zeros(wanted.shape), np.diff(self.allowance_um)[piece]
        for _ in range(52):
            middle = 0.5 * (below + above)
            over = ((c3 * middle + c2) * middle + c1) * middle + c0 > wanted
            below, above = np.where(over, middle, below), np.where(over, above, middle)
        return np.asarray(self.allowance_um[piece] + 0.5 * (below + above), dtype=np.float64)


def characteristic(transducer: Transducer) -> Characteristic:
    """Steady swings at allowances, come to from larger ones as in grinding; once more upwards, to find other swings.

    They are `POINTS`, from a little below the first touch to where the probe's rest position or the end of A = A0 − x
    is, closer where the swing begins to touch.

    Raises InputError if the free swing reaches a core.
    """
    free = steady_swing(transducer, None)
    rest_um, amplitude_um = 1e6 * transducer.rest_gap_m, 0.5 * free.stroke_um
    touch_um = rest_um - free.highest_um
    end = max(rest_um, touch_um + amplitude_um) + 0.01 * amplitude_um
    before = [touch_um - 0.05 * amplitude_um, touch_um]
    allowance = np.r_[before, touch_um + (end - touch_um) * np.linspace(0.0, 1.0, POINTS - 1)[1:] ** 1.5]
    fallen: list[SteadySwing] = []
    risen: list[SteadySwing] = []
    for swings, order in ((fallen, allowance[::-1]), (risen, allowance)):
        start = free.state
        for at_um in order:
            swing = steady_swing(transducer, float(at_um), start=start)
            start = swing.state
            swings.append(swing)
    fallen.reverse()
    return Characteristic(
        allowance_um=allowance,
        voltage_v=np.array([swing.voltage_v for swing in fallen]),
        crest_v=np.array([swing.crest_v for swing in fallen]),
        free_amplitude_um=amplitude_um,
        touch_um=touch_um,
        findings=tuple(_findings(fallen, risen, free.voltage_v)),
    )


def linear_gauge(characteristic: Characteristic, at_um: float, time_constant_s: float) -> LinearGauge:
    """The line that touches the characteristic at an allowance (G eq. 20).

    Raises InputError if the voltage does not fall there.
    """
    low, high = characteristic.monotone_um
    gain = float(characteristic.slope_at(at_um))
    if not low <= at_um <= high or gain >= 0.0:
        raise InputError(
            f"{at_um:g} µm, where the voltage does not fall with the allowance",
            expected=f"an allowance between {low:.5g} and {high:.5g} µm",
            where="at_um",
            advice="set the gauge nearer or farther (rest_gap_m), or choose another size",
        )
    return LinearGauge(gain, float(characteristic.voltage_at(at_um)) - gain * at_um, time_constant_s, at_um)


def linear_range_um(characteristic: Characteristic, gauge: LinearGauge, tolerance_um: float) -> tuple[float, float]:
    """Allowances around that of the line between which it is wrong by at most a tolerance of size [µm]."""

    def wrong(at_um: Vector) -> Mask:
        line = gauge.bias_v + gauge.gain_v_per_um * at_um
        return np.abs(characteristic.voltage_at(at_um) - line) > tolerance_um * abs(gauge.gain_v_per_um)

    middle = gauge.allowance_um
    low, high = (_edge(wrong, middle, float(end)) for end in characteristic.allowance_um[[0, -1]])
    return low, high


def _edge(wrong: Callable[[Vector], Mask], right_um: float, end_um: float) -> float:
    """The allowance nearest to a right one, on the way to the end of the points, behind which something is wrong."""
    way = np.linspace(right_um, end_um, 2001)
    first = int(np.argmax(np.concatenate([wrong(way), [True]])))
    if first == len(way):
        return end_um
    right, off = way[first - 1], way[first]
    for _ in range(50):
        middle = 0.5 * (right + off)
        right, off = (right, middle) if wrong(np.array([middle]))[0] else (middle, off)
    return float(right)


def _findings(fallen: Sequence[SteadySwing], risen: Sequence[SteadySwing], most_v: float) -> Iterator[Finding]:
    irregular = [swing for swing in fallen if swing.rounds == 0]
    if irregular:
        worst = max(swing.voltage_sd_v for swing in irregular)
        yield FINDINGS.finding(
            "irregular-swing",
            f"{_at(irregular)} the impacts never repeat: mean voltages over {IRREGULAR_ROUNDS} periods of the "
            f"pull, or fewer, are known to {1e3 * worst:.2g} mV only, and the smoothed voltage wanders.",
            evidence={"allowance_um": [swing.allowance_um for swing in irregular], "voltage_sd_v": worst},
        )
    several = [swing for swing in fallen if swing.rounds > 1]
    if several:
        most = max(swing.rounds for swing in several)
        yield FINDINGS.finding(
            "swing-of-several-rounds",
            f"{_at(several)} the swing repeats only after {'2' if most == 2 else f'2 to {most}'} periods of the "
            "pull: the probe does not touch in every one alike.",
            evidence={"allowance_um": [swing.allowance_um for swing in several], "rounds": most},
        )
    other = [
        (down, up)
        for down, up in zip(fallen, risen, strict=True)
        if abs(down.voltage_v - up.voltage_v) > _SAME * most_v + 4.0 * (down.voltage_sd_v + up.voltage_sd_v)
    ]
    if other:
        apart = max(abs(down.voltage_v - up.voltage_v) for down, up in other)
        yield FINDINGS.finding(
            "two-swings",
            f"{_at([down for down, _ in other])} two swings can last, up to {apart:.3g} V apart: the voltage "
            "depends on where the allowance came from. Shown is what comes of a larger one.",
            evidence={"allowance_um": [down.allowance_um for down, _ in other], "apart_v": apart},
        )


def _at(swings: Sequence[SteadySwing]) -> str:
    allowances = [swing.allowance_um for swing in swings]
    low, high = min(allowances), max(allowances)
    if len(allowances) == 1:
        return f"At {low:.4g} µm"
    return f"At {len(allowances)} allowances from {low:.4g} to {high:.4g} µm"
