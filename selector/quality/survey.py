"""What the channels of a recording look like, run by run: level, resolution, noise; and how a finding says it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding
from selector.number_text import span_text
from selector.quality.leave_out import left_out_rows
from selector.recording import Channel, Recording
from selector.types import Array

Ints = NDArray[np.intp]

THERMAL_ROLES = ("temperature", "ambient")
MEASURED_ROLES = ("temperature", "ambient", "displacement")
_COMMANDS = "spindle_speed feed_rate position_command position velocity acceleration flow state force current"
COMMAND_ROLES = tuple(_COMMANDS.split())  #: Roles whose change is a reason for a measured channel to jump.

IMPLAUSIBLE = 1e12  #: No role has values of this size in its canonical unit; larger ones would only overflow.

_TOGETHER = 1 << 16  #: Samples that are looked at in one go: short series cost a call each, long ones memory.

#: Samples per block in which the noise is estimated: enough for a mean, short enough for changing conditions.
_NOISE_BLOCK = 48


@dataclass(frozen=True)
class Series:
    """One channel in one run with the missing samples taken out; `rows` are positions in the run."""

    channel: Channel
    column: int
    run: str
    time_s: Array
    x: Array
    rows: Ints


@dataclass(frozen=True)
class Scale:
    """Level, resolution and noise of one channel in one run [unit of the channel]."""

    #: count and distinct: Samples, and different values among them
    count: int
    distinct: int
    #: low and high: Smallest and largest value
    low: float
    high: float
    start: float  #: Median of the first two-hundredth of the run (at least five samples)
    span: float  #: Distance of the 2nd and the 98th percentile
    quantum: float  #: Step of the resolution; far below the noise when the values are not on a grid
    #: Robust standard deviation of the white part of the noise, from second differences; holds the rounding to the
    #: resolution, up to 0.62 of it when a trend crosses one step in two samples
    noise: float
    block_noise: Array  #: The same, block by block

    @property
    def floor(self) -> float:
        """The smallest difference that means anything: noise or resolution."""
        return max(self.noise, 0.3 * self.quantum)


class Survey:
    """A working copy of a recording, channel by channel, with what is known of each channel's scale."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.channels = recording.channels
        self.runs = recording.runs
        self.time = {run: recording.time_s(run) for run in self.runs}
        # channels as rows: every check walks along time
        self.values = {run: np.array(recording.values(run, recording.names).T, order="C") for run in self.runs}
        self._scales: dict[tuple[str, int], Scale] = {}
        self._quanta: dict[int, float] = {}
        self._columns: dict[tuple[str, ...], list[int]] = {}
        self._whole: dict[str, set[int]] = {}
        self._rows = {run: np.arange(time.size) for run, time in self.time.items()}
        self.kept: dict[str, Any] = {}  #: What checks keep for later ones, until something is left out

    def columns(self, *roles: str) -> list[int]:
        """Positions of the channels that have one of these roles."""
        if roles not in self._columns:
            self._columns[roles] = [i for i, channel in enumerate(self.channels) if channel.role in roles]
        return list(self._columns[roles])

    def whole(self, run: str) -> set[int]:
        """Positions of the channels without a missing sample in a run."""
        if run not in self._whole:
            self._whole[run] = set(np.flatnonzero(np.isfinite(self.values[run]).all(axis=1)).tolist())
        return self._whole[run]

    def series(self, run: str, column: int) -> Series:
        """One channel in one run without its missing samples."""
        x, time, rows = self.values[run][column], self.time[run], self._rows[run]
        if column not in self.whole(run):
            rows = np.flatnonzero(np.isfinite(x))
            x, time = x[rows], time[rows]
        return Series(self.channels[column], column, run, time, x, rows)

    def together(self, run: str, columns: Iterable[int]) -> Iterator[tuple[Sequence[int], Array]]:
        """Channels of a run without their missing samples, those of one length side by side: (columns, rows of x)."""
        whole, columns = self.whole(run), list(columns)
        alike, most = [c for c in columns if c in whole], max(1, _TOGETHER // max(1, self.time[run].size))
        for k in range(0, len(alike), most):
            some = alike[k : k + most]
            yield some, self.values[run][some if len(some) > 1 else slice(some[0], some[0] + 1)]
        for column in columns:
            if column not in whole:
                yield [column], self.series(run, column).x[None]

    def scale(self, run: str, column: int) -> Scale:
        """Level, resolution and noise of one channel in one run, of what has not been left out so far."""
        if (run, column) not in self._scales:
            missing = [c for c in range(len(self.channels)) if (run, c) not in self._scales]
            for columns, x in self.together(run, missing):
                self._scales.update(zip(((run, c) for c in columns), scales_of(x), strict=True))
        return self._scales[run, column]

    def quantum(self, column: int, run: str | None = None) -> float:
        """Resolution of a channel: in a run, or the median over its runs when it hardly moves there [unit]."""
        if run is not None and self.scale(run, column).distinct > 5:
            return self.scale(run, column).quantum
        if column not in self._quanta:
            steps = [s.quantum for s in (self.scale(run, column) for run in self.runs) if s.distinct > 1]
            self._quanta[column] = float(np.median(steps)) if steps else 0.0
        return self._quanta[column]

    def found_by(self, checks: Iterable[Callable[["Survey"], Iterable[Finding]]]) -> list[Finding]:
        """What checks find, one after the other; what one leaves out is blank for the next."""
        found: list[Finding] = []
        with np.errstate(all="ignore"):
            for check in checks:
                new = list(check(self))
                self.leave_out(new)
                found += new
        return found

    def leave_out(self, findings: Iterable[Finding]) -> None:
        """Blank what these findings leave out."""
        for finding in findings:
            if finding.action == "none":
                continue
            self.kept.clear()
            for run in self.runs if finding.where.run is None else (finding.where.run,):
                rows = left_out_rows(finding, self.time[run])
                self._whole.pop(run, None)
                for column, channel in enumerate(self.channels):
                    if finding.where.channel in (None, channel.name):
                        self.values[run][column, rows] = np.nan
                        self._scales.pop((run, column), None)
                        self._quanta.pop(column, None)


def scales_of(x: Array) -> list[Scale]:
    """Level, resolution and noise of series without missing values, one a row; O(n log n) for one sort."""
    n = x.shape[1]
    if n == 0:
        return [Scale(0, 0, np.nan, np.nan, np.nan, 0.0, 0.0, 0.0, np.empty(0))] * len(x)
    ordered = np.sort(x, axis=1)
    low, high = ordered[:, 0], ordered[:, -1]
    steps = np.full(x.shape, np.inf)
    np.subtract(ordered[:, 1:], ordered[:, :-1], out=steps[:, :-1])
    steps[~(steps > 1e-9 * np.maximum(np.abs(low), np.abs(high))[:, None])] = np.inf
    count = np.isfinite(steps).sum(axis=1)
    # not the smallest: one value off the grid (a mean, an interpolated sample) must not define the grid
    quantum = [float(np.partition(of, k // 10)[k // 10]) if k else 0.0 for of, k in zip(steps, count, strict=True)]
    blocks = block_noise(x)
    start = np.median(x[:, : max(5, n // 200)], axis=1)
    span = ordered[:, int(0.98 * (n - 1))] - ordered[:, int(0.02 * (n - 1))]
    noise = np.median(blocks, axis=1) if blocks.size else np.zeros(len(x))
    columns = (of.tolist() for of in (count + 1, low, high, start, span))
    return [Scale(n, *of) for of in zip(*columns, quantum, noise.tolist(), blocks, strict=True)]


def block_noise(x: Array) -> Array:
    """Robust standard deviation of white noise per block of samples; second differences cancel level and trend.

    Series run along the last axis, and so do the blocks.
    """
    if x.shape[-1] < 6:
        return np.empty((*x.shape[:-1], 0))
    second = np.abs(x[..., 2:] - 2.0 * x[..., 1:-1] + x[..., :-2])
    size = second.shape[-1]
    width = min(_NOISE_BLOCK, max(12, size // 8), size)
    whole = second[..., : size // width * width].reshape(*x.shape[:-1], -1, width)
    # the lower nine tenths, so that a spike does not count; their mean is 0.657 standard deviations for normal noise,
    # and var(second difference) = 6 sigma^2
    kept = int(np.ceil(0.9 * width))
    lower = np.partition(whole, kept - 1, axis=-1)[..., :kept]
    return np.asarray(lower.mean(axis=-1) / (0.657 * np.sqrt(6.0)), dtype=np.float64)


def present_median(values: Array) -> float:
    """Median of the values that are there; NaN if none is."""
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else float("nan")


def medians_of_others(values: Array) -> Array:
    """Of each value the `present_median` of all others."""
    is_present = np.isfinite(values)
    ordered = np.sort(values[is_present])
    n, found = ordered.size, np.full(values.size, present_median(values))
    # of those that are left when one of rank k is gone, the middle one or two
    k = np.searchsorted(ordered, values[is_present])
    low, high = (n - 2) // 2, (n - 1) // 2
    found[is_present] = 0.5 * (ordered[low + (low >= k)] + ordered[high + (high >= k)]) if n > 1 else np.nan
    return found


_UNITS = {"degC": "°C", "um": "µm", "1": ""}


def moment(seconds: float) -> str:
    """A time from the start of the run: seconds, and a larger unit where it helps."""
    plain = f"{seconds:.7g} s"
    return plain if seconds < 120 else f"{plain} ({span_text(seconds)})"


def stretch(from_s: float, to_s: float) -> str:
    """A stretch of time from the start of the run."""
    if from_s == to_s:
        return f"at {moment(from_s)}"
    return f"from {moment(from_s)} to {moment(to_s)}"


def reading(value: float, channel: Channel) -> str:
    """A value with its unit; a temperature to 0.01 °C, as no thermometer on a machine tells more."""
    shown = f"{value if channel.unit != 'degC' else round(value, 2) + 0.0:.6g}"
    return _true_minus(f"{shown} {_UNITS.get(channel.unit, channel.unit)}".rstrip())


def difference(value: float, channel: Channel) -> str:
    """A difference of two values with its unit: of temperatures in K."""
    unit = "K" if channel.unit == "degC" else _UNITS.get(channel.unit, channel.unit)
    return _true_minus(f"{value:.3g} {unit}".rstrip())


def _true_minus(text: str) -> str:
    return f"−{text[1:]}" if text.startswith("-") else text
