"""What is ground and gauged together, step by step: one part over time, and the sizes of a batch by Monte Carlo."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError, Misfit, refuse
from selector.findings import Finding
from selector.physics.gauging import transducer as transducers
from selector.physics.gauging._part_kernel import (
    ALLOWANCE,
    AT_ONCE,
    COLUMNS,
    FEED,
    NEVER,
    SEEN,
    STAGE,
    VOLTAGE,
    Plan,
    grind,
)
from selector.physics.gauging.characteristic import Characteristic, GaugeMotion, GaugeState, simulate_transducer
from selector.physics.gauging.finding_table import FINDINGS
from selector.types import Array, Mask, Vector

_CREST_ROUNDS = 3  #: Peaks change with the allowance by less than a hundredth of what the voltage does.

#: Fewer values than these are taken for independent ones: their batches would say less than that.
LEAST_BATCHED = 200


def worth(values: Vector) -> float:
    """Independent values that tell the mean of these, (n,), as well; at most n. By batch means.

    A correction that follows finished parts makes each part resemble those before it.
    """
    count = len(values)
    if count < LEAST_BATCHED or not np.ptp(values):
        return float(count)
    size = count // math.isqrt(count)
    means = values[: count // size * size].reshape(-1, size).mean(axis=1)
    return float(min(count, np.var(values, ddof=1) / max(np.var(means, ddof=1) / len(means), 1e-300)))


def spread_freedoms(values: Vector) -> float:
    """Degrees of freedom that the variance of the values, (n,), has: n − 1 of independent normal ones, else fewer."""
    squares = (values - values.mean()) ** 2
    count = len(values)
    if count < LEAST_BATCHED or not np.ptp(squares):
        return count - 1.0
    return float(min(count - 1.0, 2.0 * squares.mean() ** 2 * worth(squares) / np.var(squares, ddof=1)))


@dataclass(frozen=True)
class GaugedGrinding:
    """Grinding that a gauge stops."""

    gauge: transducers.LinearGauge  #: T_Φ, and the line by which thresholds and formulas go
    grinding: transducers.Grinding
    relay: transducers.Relay = field(default_factory=transducers.Relay)
    surface: transducers.Surface = field(default_factory=transducers.Surface)
    noise: transducers.Noise = field(default_factory=transducers.Noise)
    #: What the gauge shows in a simulation; beyond its ends it stays as it is there. None: the line.
    characteristic: Characteristic | None = None
    thresholds_v: tuple[float, ...] = ()  #: One a stage [V]; empty: those of G eq. 23, which then stand here
    #: Ripple of the smoothed voltage: the relay compares its peaks. None: there is none.
    crest: transducers.RippleCrest | None = None
    correction: transducers.Correction | None = (
        None  #: How thresholds follow finished parts that are measured. None: they stay.
    )

    def __post_init__(self) -> None:
        if not self.thresholds_v:
            gauges = (self.gauge,) * len(self.grinding.stages)
            object.__setattr__(self, "thresholds_v", transducers.stage_thresholds_v(gauges, self.grinding, self.relay))

    @property
    def wanted_um(self) -> float:
        """x_k, the allowance at which a part is finished [µm]."""
        return self.grinding.stages[-1].until_um

    @property
    def ahead_s(self) -> float:
        """Time by which the last command must be ahead: T_Φ, delay of the relay, lag of the removal [s]."""
        return self.gauge.time_constant_s + self.relay.delay_s + self.grinding.lag_s

    @property
    def rates_um_per_s(self) -> tuple[float, ...]:
        """How fast the allowance falls in each stage, the wheel being fresh [µm/s]."""
        wear = transducers.wear_share(self.grinding)
        return tuple(transducers.removal_rate_um_per_s(stage.feed_um_per_s, wear) for stage in self.grinding.stages)

    @property
    def mean_thresholds_v(self) -> tuple[float, ...]:
        """Mean voltage when the peaks of the ripple are at each threshold, at the allowance that is then met [V].

        That allowance is of the line, T_Φ late, and at the bottom of grooves, where the relay trips on its peaks.
        """
        if self.crest is None:
            return self.thresholds_v
        gauge, surface = self.gauge, self.surface
        deep_um = surface.groove_depth_um if surface.grooves > 0 else 0.0
        found = []
        for volts, rate in zip(self.thresholds_v, self.rates_um_per_s, strict=True):
            mean_v = volts
            for _ in range(_CREST_ROUNDS):
                met_um = (mean_v - gauge.bias_v) / gauge.gain_v_per_um - rate * gauge.time_constant_s - deep_um
                crest_v = float(self.crest.crest_at(met_um, gauge.time_constant_s))
                mean_v = volts + math.copysign(crest_v, gauge.gain_v_per_um)
            found.append(mean_v)
        return tuple(found)

    @property
    def restlessness(self) -> float:
        """Rate of the smoothed noise over that of the voltage in the last stage, σ_ẏ/(|K|·a).

        Far below 1 the voltage passes its threshold once; above, noise reaches it early.
        """
        steady = abs(self.gauge.gain_v_per_um) * self.rates_um_per_s[-1]
        return transducers.voltage_rate_sd_v_per_s(self.gauge, self.noise) / steady


#: Steps in 1/β, T_Φ, lag_s and a turn with run-out: more of them change sizes by less than 20 000 parts can tell.
STEPS_PER_CORRELATION, STEPS_PER_FILTER, STEPS_PER_LAG, STEPS_PER_TURN = 4.0, 8.0, 8.0, 64.0
MOST_STEPS = 500_000_000  #: Of all parts together: about a minute.
FEWEST_SIZES = 2000  #: Parts from which sizes are told, where a file has fewer.
MOST_STEPS_OF_PART = 3_000_000  #: Half a second, in which nothing hears Ctrl-C.


def longest_step_s(setup: GaugedGrinding) -> float:
    """The longest step that resolves filter, noise, lag and run-out [s]."""
    grinding, surface, noise = setup.grinding, setup.surface, setup.noise
    longest = setup.gauge.time_constant_s / STEPS_PER_FILTER
    if noise.sd_um > 0:
        longest = min(longest, 1.0 / (STEPS_PER_CORRELATION * noise.rate_per_s))
    if grinding.lag_s > 0:
        longest = min(longest, max(grinding.lag_s, longest) / STEPS_PER_LAG)
    if surface.runout_um > 0:
        longest = min(longest, 60.0 / (STEPS_PER_TURN * surface.workpiece_rpm))
    return longest


def feeds_s(grinding: transducers.Grinding, relay: transducers.Relay, ends_um: Sequence[float]) -> float:
    """How long a part of mean allowance takes to these ends of its stages by the feeds alone, and the delays [s].

    A stage that ends above where it begins takes no time. The wheel is fresh.
    """
    wear, begin, total = transducers.wear_share(grinding), grinding.allowance_um, 0.0
    for stage, end in zip(grinding.stages, ends_um, strict=True):
        total += max(begin - end, 0.0) / transducers.removal_rate_um_per_s(stage.feed_um_per_s, wear) + relay.delay_s
        begin = min(begin, end)
    return total


def _misfits(of_feeds: float, of_thresholds: float, parts: int) -> Iterator[Misfit]:
    """One part, or all, that takes too many steps.

    `of_feeds` are the steps of one part that ends where it is wanted, `of_thresholds` where its thresholds are.
    """
    most = MOST_STEPS_OF_PART
    if max(of_feeds, of_thresholds) > most:
        found = f"{max(of_feeds, of_thresholds):.3g} steps of the calculation for one part"
        where, advice = "key grinding.stages", "give feeds, allowances, filter, noise and turns the right power of ten"
        if of_feeds <= most:
            where = "key thresholds.volts"
            advice = "set them within what is ground, or leave them out: they follow from the sizes wanted"
        yield found, f"at most {most:.0e}", where, advice
    if of_thresholds * parts > MOST_STEPS:
        found = f"{parts} parts of {of_thresholds:.3g} steps of the calculation"
        advice = "grind fewer parts, or give slower noise (noise.rate_per_s)"
        yield found, f"at most {MOST_STEPS:.0e} steps in all", "key run.parts", advice


TABLE = 4096  #: Points of a characteristic, evenly spread, between which the loop goes straight.
_NO_TABLE = np.empty(0), 0.0, 1.0  #: That of a line, and of a voltage without ripple.


def steps_per_filter(setup: GaugedGrinding) -> int:
    """Into how many steps T_Φ is cut so that noise, filter, lag and run-out are resolved."""
    return max(1, math.ceil(setup.gauge.time_constant_s / longest_step_s(setup) - 1e-9))


def steps_per_part(setup: GaugedGrinding, steps: int | None = None) -> float:
    """Steps of a part of mean allowance, `steps` in T_Φ; more where thresholds come later than the sizes wanted."""
    step_s = setup.gauge.time_constant_s / (steps_per_filter(setup) if steps is None else steps)
    return max(_steps_until(setup, step_s, ends) for ends in (_wanted_um(setup), _lowest_um(setup)))


def usual_steps(setup: GaugedGrinding) -> float:
    """Steps of a part that ends where it is wanted."""
    return _steps_until(setup, setup.gauge.time_constant_s / steps_per_filter(setup), _wanted_um(setup))


def part_plan(setup: GaugedGrinding, parts: int, steps: int | None = None) -> Plan:
    """The numbers for the loop; `steps` in T_Φ, None: as many as resolve what happens in it.

    Raises InputError for a wheel that wears too much before it is dressed, or more steps than can be waited for.
    """
    grinding, gauge, surface = setup.grinding, setup.gauge, setup.surface
    most_worn = min(parts, grinding.dress_every) if grinding.dress_every > 0 else parts
    slower = 1.0 + transducers.wear_share(grinding, most_worn - 1)
    step_s = gauge.time_constant_s / (steps_per_filter(setup) if steps is None else steps)
    lowest = _lowest_um(setup)
    of_feeds, of_thresholds = (slower * _steps_until(setup, step_s, ends) for ends in (_wanted_um(setup), lowest))
    refuse(_misfits(of_feeds, max(of_feeds, of_thresholds), parts))
    curve, ripple = setup.characteristic, setup.crest
    table, start, step = _NO_TABLE if curve is None else _tabulated(curve.allowance_um, curve.voltage_at)
    crest, crest_from, crest_step = (
        _NO_TABLE
        if ripple is None
        else _tabulated(ripple.allowance_um, partial(ripple.crest_at, time_constant_s=gauge.time_constant_s))
    )
    turn_s = 60.0 / surface.workpiece_rpm if surface.workpiece_rpm > 0 else 0.0
    # the allowance of the gauge is where its line touches
    of_parts = {
        name: value
        for part in (gauge, setup.relay, surface, setup.noise, grinding)
        for name, value in vars(part).items()
    }
    numbers = {name: value for name, value in of_parts.items() if name in Plan._fields} | {
        "table_from": start,
        "table_step": step,
        "sign": -math.copysign(1.0, gauge.gain_v_per_um),
        "per_s": surface.workpiece_rpm / 60.0,
        "crest_from": crest_from,
        "crest_step": crest_step,
        "step_s": step_s,
        "patience_s": 20.0 * (gauge.time_constant_s + grinding.lag_s) + 5.0 * turn_s,
    }
    # a whole number as an int would be another type, and another compilation
    arrays_and_counts: dict[str, Any] = {
        "feed": np.array([stage.feed_um_per_s for stage in grinding.stages], dtype=np.float64),
        "threshold": np.array(setup.thresholds_v, dtype=np.float64),
        "limit_um": np.array(lowest, dtype=np.float64),
        "table_v": table,
        "crest_v": crest,
        "dress_every": int(grinding.dress_every),
        "grooves": int(surface.grooves) if surface.groove_depth_um > 0 else 0,
    }
    return Plan(**{name: float(value) for name, value in numbers.items()} | arrays_and_counts)


def _tabulated(allowance_um: Vector, values_at: Callable[[Vector], Vector]) -> tuple[Vector, float, float]:
    """Values at even allowances of this range, where they begin, and how far apart they are."""
    at = np.linspace(allowance_um[0], allowance_um[-1], TABLE)
    return np.ascontiguousarray(values_at(at)), float(at[0]), float(at[1] - at[0])


def _steps_until(setup: GaugedGrinding, step_s: float, ends_um: list[float]) -> float:
    """Steps of a part to these ends, with those that edges of grooves and the relay's noise add."""
    surface, per_s = setup.surface, 1.0 / step_s
    if surface.grooves > 0 and surface.groove_depth_um > 0:
        per_s += 2.0 * surface.grooves * surface.workpiece_rpm / 60.0
    if setup.relay.noise_v > 0:
        per_s += 1.0 / setup.relay.noise_hold_s
    return feeds_s(setup.grinding, setup.relay, ends_um) * per_s


def _wanted_um(setup: GaugedGrinding) -> list[float]:
    return [stage.until_um for stage in setup.grinding.stages]


def _lowest_um(setup: GaugedGrinding) -> list[float]:
    """Allowance by which each stage should have ended: the wanted one, or where its threshold is surely met [µm].

    Of a threshold that the characteristic never shows, where that ends.
    """
    gauge, surface, curve = setup.gauge, setup.surface, setup.characteristic
    margin = surface.groove_depth_um + surface.runout_um + 6.0 * setup.noise.sd_um
    if curve is None:
        reached = [(volts - gauge.bias_v) / gauge.gain_v_per_um - margin for volts in setup.thresholds_v]
    else:
        sign, reached = -math.copysign(1.0, gauge.gain_v_per_um), []
        for volts in setup.thresholds_v:
            beyond = np.flatnonzero(sign * (np.asarray(curve.voltage_v) - volts) >= 0)
            reached.append(float(curve.allowance_um[beyond[-1] if len(beyond) else 0]) - margin)
    return [min(wanted, fit) for wanted, fit in zip(_wanted_um(setup), reached, strict=True)]


#: Parts between two looks at Ctrl-C and progress, and about how many steps they may take: a fraction of a second.
_CHUNK, _STEPS_OF_CHUNK = 64, 2_000_000


@dataclass(frozen=True)
class FinishedSizes:
    """What became of the parts, in the order in which they were ground."""

    #: (n_parts,): Allowance that is left when the feed stands and the springs have relaxed [µm]; of a part whose
    #: threshold was never reached, where it was given up
    size_um: Vector
    duration_s: Vector  #: (n_parts,): Until the feed stands [s]
    stage_end_s: Array  #: (n_parts, n_stages): When each feed ended [s]; 0 where it did not
    tripped: Mask  #: (n_parts,): False where a threshold was never reached
    at_once: Mask  #: (n_parts,): True where a threshold was already passed when its stage began
    offset_um: Vector  #: (n_parts,): Size by which thresholds were moved, by what earlier parts were off [µm]

    def __post_init__(self) -> None:
        for values in vars(self).values():
            values.flags.writeable = False

    @property
    def finished_um(self) -> Vector:
        """Sizes of the parts that the gauge has stopped [µm]."""
        return self.size_um[self.tripped]

    @property
    def mean_um(self) -> float:
        """Of the parts that the gauge has stopped; InputError if there are none [µm]."""
        return float(np.mean(self._some()))

    @property
    def sd_um(self) -> float:
        """Standard deviation of those parts, with n − 1; of a single part 0 [µm]."""
        sizes = self._some()
        return float(np.std(sizes, ddof=1)) if len(sizes) > 1 else 0.0

    @property
    def mean_error_um(self) -> float:
        """Standard error of the mean [µm]."""
        return self.sd_um / math.sqrt(worth(self._some()))

    @property
    def sd_error_um(self) -> float:
        """Standard error of the standard deviation [µm]; the sizes need not be normal."""
        return self.sd_um / math.sqrt(2.0 * spread_freedoms(self._some())) if self.sd_um > 0.0 else 0.0

    def findings(self) -> tuple[Finding, ...]:
        """Parts that no threshold stopped, and parts at which a stage had nothing to do."""
        found = []
        for name, concerned, statement in (
            ("threshold-never-reached", ~self.tripped, "never reached a threshold and were given up"),
            ("threshold-reached-at-once", self.at_once, "had passed a threshold already when its stage began"),
        ):
            count = int(concerned.sum())
            if count:
                evidence = {"parts": count, "of": len(self.size_um), "first_part": int(np.argmax(concerned)) + 1}
                text = f"{count} of {len(self.size_um)} parts {statement}."
                found.append(FINDINGS.finding(name, text, evidence=evidence))
        return tuple(found)

    def _some(self) -> Vector:
        sizes = self.finished_um
        if not len(sizes):
            raise InputError(
                f"0 of {len(self.size_um)} parts reached their thresholds",
                expected="at least 1",
                where="thresholds_v",
                advice="set the thresholds within what the gauge shows; without sizes there is no mean or spread",
            )
        return sizes


def finished_sizes(
    setup: GaugedGrinding,
    parts: int,
    *,
    seed: int = 0,
    steps: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> FinishedSizes:
    """Grinds `parts` parts one after the other and tells what became of them.

    The wheel is fresh and the probe unworn at the first. A part depends on seed and number alone, and on earlier parts
    where thresholds follow these, so that more parts change none of them, and `part_course` shows the same. The relay
    compares all the time. Noise and filter go in exact steps, `steps` in T_Φ (None: as many as resolve 1/β, T_Φ, lag
    and run-out), crossings are located within them. `progress(done, parts)` is called now and then.

    Raises InputError for no parts, or more steps than can be waited for.
    """
    plan = part_plan(setup, parts, steps)
    seeds = part_seeds(seed, parts)
    numbers = np.arange(parts)
    size, duration, state = np.empty(parts), np.empty(parts), np.empty(parts, dtype=np.int64)
    ends = np.zeros((parts, len(plan.feed)))
    nothing, correction, offset = np.empty((0, COLUMNS)), setup.correction, np.zeros(parts)
    many = int(min(max(_STEPS_OF_CHUNK / steps_per_part(setup, steps), 1.0), _CHUNK))
    if correction is not None:
        many = 1
        measured = np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0]).standard_normal(parts)
        measured *= correction.gauge_sd_um

    for first in range(0, parts, many):
        own = slice(first, min(first + many, parts))
        if correction is not None and first > 0:
            known = first - 1 - correction.parts_late
            offset[first] = offset[first - 1]
            if known >= 0 and state[known] != NEVER:
                measured[known] += size[known]
                offset[first] -= correction.share * (measured[known] - setup.wanted_um)
        now = plan if correction is None else moved(setup, plan, offset[first])
        grind(now, numbers[own], seeds[own], size[own], duration[own], ends[own], state[own], nothing, 1.0)
        if progress is not None:
            progress(own.stop, parts)
    return FinishedSizes(size, duration, ends, state != NEVER, state == AT_ONCE, offset)


def moved(setup: GaugedGrinding, plan: Plan, offset_um: float) -> Plan:
    """The plan with all thresholds moved by a size, on the line of the gauge."""
    return plan._replace(threshold=plan.threshold + setup.gauge.gain_v_per_um * offset_um)


def part_seeds(seed: int, parts: int) -> NDArray[np.uint32]:
    """A seed for every part; the first ones stay the same however many there are."""
    return np.asarray(np.random.SeedSequence(seed).generate_state(parts, np.uint32), dtype=np.uint32)


_SETTLING, _LAGS, _LEAST_ROWS = 3.0, 7.0, 3


@dataclass(frozen=True)
class PartCourse:
    """One part over time."""

    time_s: Vector  #: (n_samples,): From the start, every sampling period; some time beyond the stop [s]
    allowance_um: Vector  #: (n_samples,): What is still to be ground off [µm]
    seen_um: Vector  #: (n_samples,): The same as the gauge meets it: with noise, grooves, run-out and worn probe [µm]
    voltage_v: Vector  #: (n_samples,): Behind the filter [V]
    feed_um_per_s: Vector  #: (n_samples,): Infeed [µm/s]
    stage: NDArray[np.int64]  #: (n_samples,): 0 for the first; the number of stages once the feed stands
    stage_end_s: tuple[float, ...]  #: When each feed ended [s]
    #: size_um and duration_s: Finished size [µm]; until the feed stood [s]
    size_um: float
    duration_s: float
    tripped: bool  #: As in `FinishedSizes`


def part_course(setup: GaugedGrinding, part: int = 0, *, seed: int = 0, period_s: float) -> PartCourse:
    """The part of this number, the first being 0, as `finished_sizes` with the same seed grinds it.

    Samples are `period_s` apart; how often it is looked at does not change the part. Between two steps
    the noise that the gauge sees goes straight.

    Raises InputError as that does.
    """
    plan = part_plan(setup, part + 1)
    if setup.correction is not None:
        plan = moved(setup, plan, finished_sizes(setup, part + 1, seed=seed).offset_um[part])
    number, seeds = np.array([part]), part_seeds(seed, part + 1)[part:]
    size, duration, state = np.empty(1), np.empty(1), np.empty(1, dtype=np.int64)
    ends = np.zeros((1, len(plan.feed)))
    grind(plan, number, seeds, size, duration, ends, state, np.empty((0, COLUMNS)), period_s)
    tripped = bool(state[0] != NEVER)
    after_s = _SETTLING * plan.time_constant_s + _LAGS * plan.lag_s if tripped else 0.0
    rows = max(int((duration[0] + after_s) / period_s) + 1, _LEAST_ROWS if tripped else 1)
    record = np.empty((rows, COLUMNS))
    grind(plan, number, seeds, size, duration, ends, state, record, period_s)
    stage = record[:, STAGE].astype(np.int64)
    stages_done = int(np.count_nonzero(ends[0])) if not tripped else len(plan.feed)
    columns = [record[:, column].copy() for column in (ALLOWANCE, SEEN, VOLTAGE, FEED)]
    time_s = np.asarray(np.arange(rows) * period_s, dtype=np.float64)
    for values in (time_s, stage, *columns):
        values.flags.writeable = False
    return PartCourse(
        time_s, columns[0], columns[1], columns[2], columns[3], stage, tuple(ends[0][:stages_done].tolist()),
        float(size[0]), float(duration[0]), tripped,
    )  # fmt: skip


PER_SWING = 200
_SETTLING_DECAYS = 10.0
_SETTLING_FILTERS = 6.0
_MOST_SWINGS = 1000  #: For a slow filter, behind which there is no ripple to settle.


def waveform(transducer: transducers.Transducer, course: PartCourse, last_s: float) -> GaugeMotion:
    """The last `last_s` seconds before the feed stood, 200 samples a swing, at most from the start of the part.

    The probe meets what the gauge saw in the course, straight between its samples. Before that it swings until probe
    and filter have settled, the latter from the voltage of the course.
    """
    swing_s = 0.5 / transducer.electromagnet.frequency_hz
    step_s = swing_s / PER_SWING
    stop_s = min(course.duration_s, float(course.time_s[-1]))
    samples = max(int(min(last_s, stop_s) / step_s), 2)
    time_s = stop_s - step_s * np.arange(samples, -1, -1)
    decay_s = 2.0 * transducer.probe.mass_kg / transducer.probe.damping_ns_per_m
    filter_s = min(_SETTLING_FILTERS * transducer.smoothing.time_constant_s, _MOST_SWINGS * swing_s)
    before = math.ceil((_SETTLING_DECAYS * decay_s + filter_s) / step_s)
    settling_s = time_s[0] - step_s * np.arange(before, -1, -1)
    seen = np.interp(settling_s, course.time_s, course.seen_um)
    # at rest, pushed back where the surface is beyond
    start = GaugeState(
        probe_m=min(0.0, transducer.rest_gap_m - 1e-6 * float(seen[0])),
        smoothed_v=float(np.interp(settling_s[0], course.time_s, course.voltage_v)),
    )
    settled = simulate_transducer(transducer, seen, settling_s, start=start).state(-1)
    return simulate_transducer(transducer, np.interp(time_s, course.time_s, course.seen_um), time_s, start=settled)
