"""Heating and cooling tests: what modes and characteristics are fitted to, as block averages, and their stretches."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

import numpy as np
import pandas as pd

from selector.errors import InputError, OptionError
from selector.physics.thermal.modes.modes import Cyclogram
from selector.recording import Recording
from selector.types import Array, Indices, Mask, Vector


@dataclass(frozen=True)
class ThermalTest:
    """One recorded run with its spindle speed (C: heating and cooling characteristics)."""

    run: str  #: Name of the run
    time_s: Vector  #: (n_samples,): Time [s] from the start of the run, increasing
    #: (n_samples,): Spindle speed [r/min], held from each sample to the next; no sign, nothing missing
    speed_rpm: Vector
    displacement_um: Array  #: (n_samples, n_responses): Displacements [µm]; NaN where missing
    #: (n_samples, n_halls) or (n_samples,): Temperatures around the machine [°C], if they were recorded
    ambient_degc: Vector | None = None
    ambients: tuple[str, ...] = ()  #: (n_halls,): Their names

    def __post_init__(self) -> None:
        if self.ambient_degc is not None:
            object.__setattr__(self, "ambient_degc", np.asarray(self.ambient_degc).reshape(len(self.time_s), -1))


def thermal_tests(recording: Recording, responses: Sequence[str]) -> tuple[ThermalTest, ...]:
    """The tests in a recording.

    Raises OptionError if there is no spindle speed, or a response is no displacement or temperature of the recording.
    """
    speeds = [channel.name for channel in recording.channels if channel.role == "spindle_speed"]
    if len(speeds) != 1:
        raise OptionError(
            f"{len(speeds)} channels with the role spindle_speed" + (f" ({', '.join(speeds)})" if speeds else ""),
            expected="one",
            where="the recording",
            advice="give the channel with the speed of the spindle the role spindle_speed in the machine file",
        )
    known = recording.with_role("displacement", "temperature")
    for response in responses:
        if response not in known:
            raise OptionError(
                f"no displacement or temperature called {response!r}",
                expected="one of " + (", ".join(known) or "the displacements (there are none)"),
                where="--response",
                advice="name a channel with the role displacement or temperature",
            )
    halls = [channel.name for channel in recording.channels if channel.role == "ambient"]
    return tuple(
        ThermalTest(
            run=run,
            time_s=recording.time_s(run),
            speed_rpm=held(np.abs(recording.values(run, speeds)[:, 0])),
            displacement_um=recording.values(run, responses),
            ambient_degc=recording.values(run, halls) if halls else None,
            ambients=tuple(halls),
        )
        for run in recording.runs
    )


def held(values: Vector) -> Vector:
    """Missing values take the one before them, at the beginning the first that is there; all missing means 0."""
    known = pd.Series(values).where(np.isfinite(values))
    return np.asarray(known.ffill().bfill().fillna(0.0), dtype=np.float64)


FINEST = 2.0**-20  #: Step [µm, K] to which readings count: far below what a gauge resolves.
#: Length of a block as a share of the time since the speed last changed. The mean of e^(−t/τ) over a block differs from
#: its value at the mean time by at most 0.54·GROWTH²/24 = 1.4e-4 of the mode's amplitude: far below any noise.
GROWTH = 0.08
#: Longest block as a share of its run, for what moves without the spindle (start not at rest, a wandering gauge).
LONGEST = 1 / 50
LONGEST_WITH_HALL = 1 / 200  #: The same where the hall temperature was recorded, since it is held within a block.
SAME_SPEED = 0.02  #: Speeds that differ by less than this share of the fastest count as one level: jitter.
#: A speed that changes by more than this share of the fastest at every other sample is a duty cycle, not jitter.
MOST_JITTER = 0.1
SHORTEST_LEVEL = 0.02  #: A speed that ran for less than this share of the turning time is part of a ramp, not a level.


@dataclass(frozen=True, eq=False)
class ModeData:
    """Blocks of all runs, one after the other; within a block the speed is constant up to jitter."""

    #: before_s and after_s: (n_blocks,): Time from the block's start to the mean time of its samples, and from there to
    #: the next block [s]
    before_s: Vector
    after_s: Vector
    speed_rpm: Vector  #: (n_blocks,): Mean speed [r/min]
    displacement_um: Vector  #: (n_blocks, n_responses): Mean displacement [µm]; 0 where `counts` is 0
    counts: Vector  #: (n_blocks, n_responses): Samples in each mean
    ambient_k: Vector | None  #: (n_blocks, n_halls): Mean hall temperatures against the start of the run [K]
    ambient_start_degc: Vector | None  #: (n_runs, n_halls): Hall temperatures at the start of the runs [°C]
    bounds: tuple[tuple[int, int], ...]  #: First block, and the one behind the last, of every run
    noise_um: Vector  #: (n_responses,): Standard deviation of a single sample [µm], from differences of neighbours
    levels_rpm: tuple[float, ...]  #: Tested speed levels above 0, increasing [r/min]
    #: period_s and longest_s: Typical time between samples; duration of the longest run
    period_s: float
    longest_s: float

    @property
    def fastest_rpm(self) -> float:
        """The fastest tested level [r/min]."""
        return self.levels_rpm[-1]

    @cached_property
    def first(self) -> Mask:
        """(n_blocks,): Blocks with which a run begins."""
        first = np.zeros(len(self.speed_rpm), dtype=np.bool_)
        first[[begin for begin, _ in self.bounds]] = True
        return first

    @cached_property
    def middle_s(self) -> Vector:
        """(n_blocks,): Mean times of the blocks from the start of their run [s]."""
        length = self.before_s + self.after_s
        ends = np.concatenate([np.cumsum(length[begin:end]) for begin, end in self.bounds])
        return np.asarray(ends - self.after_s)

    def cyclogram(self, run: int) -> Cyclogram:
        """The speeds of a run's blocks, standing where it is near 0."""
        blocks = slice(*self.bounds[run])
        ends = np.cumsum(self.before_s[blocks] + self.after_s[blocks])
        speed = np.where(self.speed_rpm[blocks] < 0.01 * self.fastest_rpm, 0.0, self.speed_rpm[blocks])
        # the last sample counts for as long as the one before it, so this is beyond it
        return Cyclogram(np.r_[0.0, ends[:-1]], speed, float(ends[-1]))


def mode_data(tests: Sequence[ThermalTest]) -> ModeData:
    """Block averages of the tests, with their speed levels.

    Raises InputError if there is no test, or none in which the spindle turns.
    """
    fastest = max((float(np.max(test.speed_rpm, initial=0.0)) for test in tests), default=0.0)
    if not np.isfinite(fastest) or fastest <= 0.0:
        raise InputError(
            "no test in which the spindle turns",
            expected="at least one heating test",
            where="the tests",
            advice="record heating and cooling",
        )
    jitter = max(_roughness(test.speed_rpm) for test in tests)
    same_rpm = float(np.clip(6.0 * jitter, SAME_SPEED * fastest, MOST_JITTER * fastest))
    pieces = [_blocks(test, same_rpm) for test in tests]
    ends = np.cumsum([len(piece["speed"]) for piece in pieces]).tolist()
    joined = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    halls = all(test.ambient_degc is not None and np.isfinite(test.ambient_degc).any(axis=0).all() for test in tests)
    return ModeData(
        before_s=joined["before"],
        after_s=joined["after"],
        speed_rpm=joined["speed"],
        displacement_um=joined["displacement"],
        counts=joined["counts"],
        ambient_k=joined["ambient"] if halls else None,
        ambient_start_degc=np.array([piece["ambient_start"] for piece in pieces]) if halls else None,
        bounds=tuple(zip([0, *ends[:-1]], ends, strict=True)),
        noise_um=_noise(tests),
        levels_rpm=_levels(joined["speed"], joined["before"] + joined["after"], same_rpm),
        period_s=float(np.median(np.concatenate([np.diff(test.time_s) for test in tests]))),
        longest_s=max(float(test.time_s[-1] - test.time_s[0]) for test in tests),
    )


def _first(values: Vector) -> Vector:
    """The first reading of every column; NaN where there is none."""
    return np.asarray(values[np.isfinite(values).argmax(axis=0), np.arange(values.shape[1])])


def since_first(values: Vector) -> Vector:
    """Values (n_samples, n_columns) against their first readings, as multiples of `FINEST`.

    Where a gauge stood at first says nothing. The multiples take off what it leaves in the last digit, by which a
    search with several equal ends would choose among them.
    """
    return np.asarray(np.round((values - _first(values)) / FINEST) * FINEST)


def _blocks(test: ThermalTest, same_rpm: float) -> dict[str, Vector]:
    time, speed = test.time_s - test.time_s[0], test.speed_rpm
    halls = np.zeros((len(time), 0)) if test.ambient_degc is None else test.ambient_degc
    longest = (LONGEST_WITH_HALL if np.isfinite(halls).any() else LONGEST) * time[-1]
    starts, changed_s, level, begun_s = [0], 0.0, speed[0], 0.0
    for i in range(1, len(time)):
        if abs(speed[i] - level) > same_rpm:
            starts.append(i)
            changed_s, level, begun_s = time[i], speed[i], time[i]
        elif time[i] - begun_s >= min(GROWTH * (begun_s - changed_s), longest):
            starts.append(i)
            begun_s = time[i]
    first = np.array(starts)
    held_s = np.diff(time, append=2 * time[-1] - time[-2])
    length_s = np.add.reduceat(held_s, first)
    there = np.isfinite(test.displacement_um)
    counts = np.add.reduceat(there.astype(np.float64), first)
    sums = np.add.reduceat(np.where(there, test.displacement_um, 0.0), first)
    # a block's mean time is that of its readings, which matters where some are missing
    weight = there.any(axis=1).astype(np.float64)
    total = np.add.reduceat(weight, first)
    middle = np.where(total > 0, np.add.reduceat(time * weight, first) / np.maximum(total, 1.0), time[first])
    rise = since_first(halls)
    filled = np.column_stack([_filled(time, one) for one in rise.T]) if halls.shape[1] else halls
    at_start = np.array([_at_start(time, one) for one in filled.T])
    return {
        "before": middle - time[first],
        "after": length_s - (middle - time[first]),
        "speed": np.add.reduceat(speed * held_s, first) / length_s,
        "displacement": sums / np.maximum(counts, 1.0),
        "counts": counts,
        "ambient": np.add.reduceat(filled * held_s[:, None], first) / length_s[:, None] - at_start,
        "ambient_start": at_start + _first(halls),
    }


def _filled(time: Vector, values: Vector) -> Vector:
    """A temperature with a straight line over what is missing; 0 if nothing was read."""
    known = np.isfinite(values)
    return np.interp(time, time[known], values[known]) if known.any() else np.zeros(len(time))


def _at_start(time: Vector, values: Vector) -> float:
    """The first value, without the noise of a single reading."""
    early = time <= max(0.02 * time[-1], time[min(10, len(time) - 1)])
    return float(np.polyfit(time[early], values[early], 1)[1]) if early.sum() > 3 else float(values[0])


def _roughness(values: Vector) -> float:
    """Robust standard deviation of white noise upon something smooth: from second differences."""
    return 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6.0)


def _noise(tests: Sequence[ThermalTest]) -> Vector:
    """Noise of each response; never 0, so that it can divide (a course without noise, or quantised)."""
    noise = []
    for r in range(tests[0].displacement_um.shape[1]):
        values = [test.displacement_um[np.isfinite(test.displacement_um[:, r]), r] for test in tests]
        spread = max(float(np.ptp(one)) for one in values)
        noise.append(max(float(np.median([_roughness(one) for one in values])), 1e-4 * spread, 1e-9))
    return np.array(noise)


def _levels(speed: Vector, length_s: Vector, same_rpm: float) -> tuple[float, ...]:
    turning = speed > same_rpm
    order = np.argsort(speed[turning])
    value, weight = speed[turning][order], length_s[turning][order]
    groups = np.cumsum(np.diff(value, prepend=value[0]) > same_rpm)
    total = np.bincount(groups, weight)
    mean = np.bincount(groups, weight * value) / total
    kept = mean[total >= SHORTEST_LEVEL * total.sum()]
    if not len(kept):  # the speed never rests: knots where it spent most of its time
        kept = np.unique(np.quantile(np.repeat(value, np.ceil(9 * weight / weight.max()).astype(int)), [0.2, 0.6, 1.0]))
    return tuple(float(level) for level in kept)


BLIP = 0.01  #: A piece shorter than this share of its run, between two at one speed, is a blip of the speed signal.
FEWEST_BLOCKS = 6  #: Block averages (they grow with the time since the speed changed) that a curve needs at least.


@dataclass(frozen=True)
class Stretch:
    """A part of a run at one speed."""

    run: int  #: Position of the run
    speed_rpm: float  #: Speed [r/min], 0 for cooling
    time_s: Vector  #: (n_blocks,): Mean times of the blocks from the beginning of the stretch [s]
    blocks: Indices  #: (n_blocks,): Positions in the `ModeData`
    duration_s: float  #: Length [s]


def heating_from_rest(data: ModeData) -> list[Stretch]:
    """The first turning stretch of every run that starts cold: those that are characteristics of one speed."""
    found = []
    for run in range(len(data.bounds)):
        pieces = list(_pieces(data, run))
        first = next((k for k, piece in enumerate(pieces) if piece.speed_rpm > 0), None)
        if first is None or len(pieces[first].blocks) < FEWEST_BLOCKS:
            continue
        if all(_is_still(data, piece) for piece in pieces[:first]):
            found.append(pieces[first])
    return found


def coolings(data: ModeData) -> list[Stretch]:
    """Stretches at rest after running, and whole runs at rest in which something moves."""
    found = []
    for run in range(len(data.bounds)):
        pieces = list(_pieces(data, run))
        turned = False
        for piece in pieces:
            alone = len(pieces) == 1 and not _is_still(data, piece)
            if piece.speed_rpm == 0 and (turned or alone) and len(piece.blocks) >= FEWEST_BLOCKS:
                found.append(piece)
            turned = turned or piece.speed_rpm > 0
    return found


def _pieces(data: ModeData, run: int) -> Iterator[Stretch]:
    first, last = data.bounds[run]
    blocks = np.arange(first, last)
    length = data.before_s[blocks] + data.after_s[blocks]
    ends = np.cumsum(length)
    levels = np.array([0.0, *data.levels_rpm])
    distance = np.abs(data.speed_rpm[blocks][:, None] - levels)
    label = np.where(distance.min(axis=1) <= 1.5 * SAME_SPEED * data.fastest_rpm, distance.argmin(axis=1), -1)
    runs = [[key, [i for i, _ in group]] for key, group in groupby(enumerate(label.tolist()), key=lambda item: item[1])]
    merged: list[tuple[int, list[int]]] = []
    for k, (key, members) in enumerate(runs):
        short = length[members].sum() < BLIP * ends[-1]
        if short and merged and k + 1 < len(runs) and runs[k + 1][0] == merged[-1][0]:
            continue  # a blip: the blocks are dropped, the stretch goes on
        if merged and merged[-1][0] == key:
            merged[-1][1].extend(members)
        elif key == -1 and short:
            continue  # a ramp up or down
        else:
            merged.append((key, list(members)))
    for key, members in merged:
        begin = ends[members[0]] - length[members[0]]
        if members[0] and all(label[i] == -1 for i in range(members[0])):
            begin = 0.0  # the run starts within a ramp
        position = np.array(members)
        with_values = position[data.counts[blocks[position]].max(axis=1) > 0]
        middle = ends[with_values] - data.after_s[blocks[with_values]]
        speed = float(levels[key]) if key >= 0 else float(data.speed_rpm[blocks[position]].mean())
        yield Stretch(run, speed, middle - begin, blocks[with_values], float(ends[position[-1]] - begin))


def _is_still(data: ModeData, piece: Stretch) -> bool:
    """Whether no displacement moves by more than its noise and 2 % of what the tests show."""
    if piece.speed_rpm > 0 or len(piece.blocks) < 2:
        return piece.speed_rpm == 0
    counts = data.counts[piece.blocks]
    for r in range(counts.shape[1]):
        there = counts[:, r] > 0
        values = data.displacement_um[piece.blocks, r][there]
        largest = np.ptp(data.displacement_um[data.counts[:, r] > 0, r])
        if len(values) and np.ptp(values) > 6.0 * data.noise_um[r] + 0.02 * largest:
            return False
    return True
