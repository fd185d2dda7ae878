"""Labelled, unit-carrying, immutable recordings of one or more runs; a simulation is held in the same type."""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.errors import Misfit, RecordingError, refuse
from selector.types import Array, Mask
from selector.units import CANONICAL_UNITS, ROLES

SENSOR_ROLES = ("temperature", "ambient")  #: Roles that can be inputs of a thermal model without further options.


@dataclass(frozen=True)
class Channel:
    """One recorded quantity."""

    name: str  #: Unique in its recording
    role: str  #: One of `selector.units.ROLES`
    unit: str  #: The canonical unit of the role; values are converted when a file is read
    place: str | None = None  #: Where the sensor sits, in the user's words
    axis: str | None = None  #: Machine axis of a displacement, e.g. ``"Z"``.
    xyz_m: tuple[float, float, float] | None = None  #: Position on the machine [m]

    def __post_init__(self) -> None:
        refuse(self._misfits(), RecordingError)

    def _misfits(self) -> Iterator[Misfit]:
        where = f"channel {self.name!r}"
        if self.role not in ROLES:
            yield f"role {self.role!r}", "one of " + ", ".join(ROLES), where, "correct the role in the machine file"
        if self.unit != CANONICAL_UNITS[self.role]:
            expected = f"{CANONICAL_UNITS[self.role]!r}, the unit in which role {self.role!r} is held"
            advice = "convert the values with selector.units.to_canonical before making the recording"
            yield f"unit {self.unit!r}", expected, where, advice


class RunSource(Protocol):
    """What a study needs of recordings, be they whole in memory or read piece by piece."""

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels."""

    def chunks(self, run: str, names: Iterable[str]) -> Iterator[tuple[Array, Array]]:
        """(time_s, values) pieces of a run, in order; values of shape (n_samples, n_names)."""


def no_channel(name: str, names: Iterable[str]) -> RecordingError:
    """That there is no channel of this name; the message lists those that there are."""
    advice = "correct the name, or list the channels with `selector describe`"
    expected = "one of " + ", ".join(names)
    return RecordingError(f"no channel {name!r}", expected=expected, where="recording", advice=advice)


def of_axis(name: str, channels: Sequence[Channel]) -> str:
    """The name itself; if no channel is called so, that of the one displacement along the axis of this name."""
    along = {one.name: one.axis for one in channels if one.role == "displacement"}
    return name if any(one.name == name for one in channels) else named_by_axis(name, along)


def named_by_axis(name: str, axes: Mapping[str, str | None]) -> str:
    """The name itself; if nothing is called so, the only one of these names that lies along the axis of this name."""
    along = [one for one, axis in axes.items() if (axis or "").upper() == name.upper()]
    return along[0] if len(along) == 1 and name not in axes else name


@dataclass(frozen=True)
class Recording:
    """One or more runs on a common set of channels.

    Raises RecordingError if the frame and the channels do not make a recording.
    """

    #: (n_samples, n_channels): Index (`run`, `time_s`): the rows of a run stand together, time [s] from the start of
    #: the run increases strictly. Columns are float64 in canonical units; NaN = missing. Sampling may be irregular.
    frame: pd.DataFrame
    channels: tuple[Channel, ...]  #: One per column, in column order
    #: Where the data came from: per run the file name, its SHA-256, the absolute start if known, what was inferred
    provenance: Mapping[str, Any] = field(default_factory=dict)
    #: Run → what was read before it, in the frame and none of the runs, and how much later it starts [s]
    follows: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [channel.name for channel in self.channels]
        _require(len(set(names)) == len(names), f"channels {names}", "unique channel names")
        _require(
            list(self.frame.columns) == names,
            f"columns {list(self.frame.columns)}",
            f"one column per channel, in this order: {names}",
        )
        _require(
            list(self.frame.index.names) == ["run", "time_s"],
            f"index {list(self.frame.index.names)}",
            "a MultiIndex (run, time_s)",
        )
        _require(len(self.frame) > 0, "no rows", "at least one sample")
        values = self.frame.to_numpy(dtype=np.float64, copy=True)
        values.setflags(write=False)
        runs = self.frame.index.get_level_values("run").to_numpy()
        time = self.frame.index.get_level_values("time_s").to_numpy(dtype=np.float64, copy=True)
        time.setflags(write=False)
        starts = np.flatnonzero(np.r_[True, runs[1:] != runs[:-1]])
        order = [str(runs[start]) for start in starts]
        _require(len(set(order)) == len(order), f"runs in the order {order}", "the rows of each run together")
        stops = np.r_[starts[1:], len(runs)]
        slices = {name: slice(int(a), int(b)) for name, a, b in zip(order, starts, stops, strict=True)}
        for name, part in slices.items():
            _require(
                bool(np.all(np.diff(time[part]) > 0)) and bool(np.all(np.isfinite(time[part]))),
                f"time stamps of run {name!r} that repeat, run backwards or are missing",
                "strictly increasing time",
            )
        frame = pd.DataFrame(values, index=self.frame.index, columns=names, copy=False)
        object.__setattr__(self, "frame", frame)
        object.__setattr__(self, "_values", values)
        object.__setattr__(self, "_time", time)
        object.__setattr__(self, "_slices", slices)

    @classmethod
    def from_runs(
        cls, runs: Mapping[str, pd.DataFrame], channels: Iterable[Channel], provenance: Mapping[str, Any] | None = None
    ) -> "Recording":
        """A recording from one table per run, each indexed by time [s]; a channel that a run lacks becomes NaN."""
        channels = tuple(channels)
        names = [channel.name for channel in channels]
        parts = {name: table.reindex(columns=names).astype(np.float64) for name, table in runs.items()}
        frame = pd.concat(parts, names=["run", "time_s"])
        return cls(frame, channels, dict(provenance or {}))

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs, in the order in which they were read."""
        before = {name for name, _ in self.follows.values()}
        return tuple(run for run in self._run_slices if run not in before)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(channel.name for channel in self.channels)

    @property
    def _run_slices(self) -> dict[str, slice]:
        slices: dict[str, slice] = self.__dict__["_slices"]
        return slices

    @cached_property
    def _column(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.names)}

    def channel(self, name: str) -> Channel:
        """The channel of this name. Raises RecordingError: there is none; the message lists those that there are."""
        if name not in self._column:
            raise no_channel(name, self.names)
        return self.channels[self._column[name]]

    def with_role(self, *roles: str) -> tuple[str, ...]:
        """Names of the channels that have one of these roles."""
        return tuple(channel.name for channel in self.channels if channel.role in roles)

    def time_s(self, run: str) -> Array:
        """Time stamps of a run [s], shape (n_samples,), read-only."""
        time: Array = self.__dict__["_time"]
        return time[self._run_slices[run]]

    def values(self, run: str, names: Iterable[str]) -> Array:
        """Samples of some channels in a run, shape (n_samples, n_names), canonical units, NaN = missing."""
        values: Array = self.__dict__["_values"]
        return values[self._run_slices[run]][:, [self._column[name] for name in names]]

    def chunks(self, run: str, names: Iterable[str]) -> Iterator[tuple[Array, Array]]:
        """(time_s, values) pieces of a run in order; here always one piece. `readers.ParquetSource` has many."""
        yield self.time_s(run), self.values(run, names)

    def with_values(self, frame: pd.DataFrame) -> "Recording":
        """The same channels and provenance with another frame."""
        return dataclasses.replace(self, frame=frame)


#: Part of the time since a record was last cut, and seconds, that a rest lasts which cuts it.
LEAST_REST, SHORTEST_REST_S = 0.25, 1800.0


def restarts(rests: Mask, length_s: Array) -> list[int]:
    """Positions of the stretches with which tests begin: the first, and every rest worth the name before a warming.

    The breaks of an intermittent duty cycle do not cut it; a record of days is cut at every warming after a cooling.
    """
    edges = np.r_[0.0, np.cumsum(length_s)]
    begins, rested_s, turned = [0], 0.0, False
    for i, is_rest in enumerate(rests):
        if is_rest:
            rested_s += edges[i + 1] - edges[i]
            continue
        if turned and rested_s >= max(LEAST_REST * (edges[i] - edges[begins[-1]]), SHORTEST_REST_S):
            begins.append(i - 1)
        rested_s, turned = 0.0, True
    return begins


#: A step of the clock is a pause, in which the machine was left and its gauge perhaps set to zero, if it is longer than
#: this [s] and than so many usual ones.
PAUSE_S, LONG_PERIODS = 3600.0, 20
PARTS = "parts"  #: In the provenance of a recording that was cut: part → (its run, where it begins there [s]).


def pauses(time_s: Array) -> NDArray[np.intp]:
    """Positions of the samples that come after a pause."""
    steps = np.diff(time_s, prepend=time_s[:1])
    return np.flatnonzero(steps > max(PAUSE_S, LONG_PERIODS * float(np.median(steps))))


def at_pauses(recording: Recording) -> Recording:
    """The recording, cut at pauses: a part is called after its run, with a number, and counts from its own start."""
    cut = parted(recording)
    return recording if cut.runs == recording.runs else thinned(cut, 1)


class Windows:
    """Stretches of a source's runs as runs: each of one run, from when to when, and when it counts from [s].

    Those of a run that are asked for one after the other cost one pass over it.
    """

    def __init__(self, source: RunSource, spans: Mapping[str, tuple[str, float, float, float]]) -> None:
        self.runs, self.channels, self._source, self._spans = tuple(spans), tuple(source.channels), source, spans
        self.provenance: Mapping[str, Any] = getattr(source, "provenance", {})
        self._going: tuple[tuple[str, Sequence[str], float], Iterator[Any]] | None = None

    def chunks(self, run: str, names: Iterable[str]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """(time_s, values) pieces of a stretch, in order; values of shape (n_samples, n_names)."""
        (whole, begin_s, end_s, zero_s), wanted = self._spans[run], list(names)
        going, self._going = self._going, None
        is_next = going is not None and going[0] == (whole, wanted, begin_s)
        pieces = going[1] if going and is_next else self._source.chunks(whole, wanted)
        for time_s, values in pieces:
            of = slice(*np.searchsorted(time_s, (begin_s, end_s)))
            if len(time_s[of]):
                yield time_s[of] - zero_s, values[of]
            if of.stop < len(time_s):
                self._going = (whole, wanted, end_s), itertools.chain([(time_s, values)], pieces)
                return


def parted(source: RunSource, begins_s: Mapping[str, Sequence[float]] | None = None, **told: bool) -> Windows:
    """A source with its runs cut where parts begin [s], by default at pauses; provenance holds `told` besides."""
    begins_s = {run: _begins_s(source, run) for run in source.runs} if begins_s is None else begins_s
    of_source: Mapping[str, Any] = getattr(source, "provenance", {})
    known, parts = (dict(of_source.get(key, {})) for key in ("runs", PARTS))
    spans: dict[str, tuple[str, float, float, float]] = {}
    for run in source.runs:
        begins, of_run = begins_s.get(run, ()), known.get(run, {})
        if len(begins) < 2:
            spans[run] = run, -np.inf, np.inf, 0.0
            continue
        for k, (begin_s, end_s) in enumerate(itertools.pairwise([*begins, np.inf]), 1):
            name = f"{run} {k}"
            while name in source.runs or name in spans:
                name += "'"
            start = of_run.get("start") and datetime.fromisoformat(of_run["start"]) + timedelta(seconds=begin_s)
            parts[name], known[name] = (run, begin_s), of_run | {"start": start and start.isoformat()}
            spans[name] = run, begin_s, end_s, begin_s
    cut = Windows(source, spans)
    cut.provenance = {**of_source, "runs": known, PARTS: parts, **told}
    return cut


def _begins_s(source: RunSource, run: str) -> list[float]:
    """When the parts of a run begin that pauses cut it into [s]."""
    begins: list[float] = []
    last = np.empty(0)
    for time_s, _ in source.chunks(run, ()):
        stamps = np.r_[last, time_s]
        begins += stamps[[*([] if begins else [0]), *pauses(stamps)]].tolist()
        last = time_s[-1:]
    return begins


def thinned(source: RunSource, stride: int) -> Recording:
    """Every `stride`-th sample of a source, in memory; one pass over the runs, one piece at a time."""
    follows: Mapping[str, tuple[str, float]] = getattr(source, "follows", {})
    names = [channel.name for channel in source.channels]
    parts: dict[str, pd.DataFrame] = {}
    for run in (*source.runs, *(before for before, _ in follows.values())):
        first = 0
        pieces: list[pd.DataFrame] = []
        for time_s, values in source.chunks(run, names):
            take = slice((-first) % stride, None, stride)
            first += len(time_s)
            # a copy, or the slice would keep the whole piece alive
            pieces.append(pd.DataFrame(values[take].copy(), time_s[take].copy(), names))
        if any(map(len, pieces)):
            parts[run] = pd.concat(pieces)
    frame = pd.concat(parts, names=["run", "time_s"])
    return Recording(frame, tuple(source.channels), dict(getattr(source, "provenance", {})), follows)


def _require(holds: bool, found: str, expected: str) -> None:
    if not holds:
        raise RecordingError(
            found, expected=expected, where="recording", advice="correct the table before making a Recording from it"
        )
