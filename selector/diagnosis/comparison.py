"""What is compared: recorded and simulated courses on one clock, run by run, and which rows are kept for the proof."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.findings import Finding
from selector.recording import Channel
from selector.types import Mask, Vector


@dataclass(frozen=True, eq=False)
class Comparison:
    """Recordings and a simulation of the same runs, at the times of the recordings."""

    runs: tuple[str, ...]  #: Names of the runs, in order
    starts: tuple[int, ...]  #: First row of every run, and last of all the number of rows
    time_s: Vector  #: (n_rows,): From the start of the run [s]; increases within a run
    channels: tuple[Channel, ...]  #: The recorded channels
    recorded: Mapping[str, Vector]  #: (n_rows,): Every recorded channel in its canonical unit; NaN = missing
    #: (n_rows,): Every simulated channel at the same rows; NaN where the simulation does not reach. A channel that was
    #: not recorded (a state, a heat flow of the simulation) may stand here too.
    simulated: Mapping[str, Vector]
    responses: tuple[str, ...]  #: What is compared: recorded and simulated
    held_out: Mask  #: (n_rows,): Rows that nothing is fitted to
    #: Smallest step that a channel's readings make [unit of the channel]; 0 = none was seen
    resolution: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()  #: What was noticed while the files were brought together
    #: (n_rows,): Response → parameter, or direction of parameters, that the simulation has → change of the simulated
    #: response with it; empty where the simulation cannot be run again
    tangents: Mapping[str, Mapping[str, Vector]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.time_s)
        lengths = {name: len(values) for part in (self.recorded, self.simulated) for name, values in part.items()}
        if self.starts[-1] != n or len(self.starts) != len(self.runs) + 1 or set(lengths.values()) - {n}:
            raise ValueError(
                f"{n} rows, runs that end at {self.starts[-1]}, channels of {sorted(set(lengths.values()))}"
            )
        for name in self.responses:
            if name not in self.recorded or name not in self.simulated:
                raise InputError(
                    f"no {'recorded' if name not in self.recorded else 'simulated'} channel {name!r}",
                    expected="every response both recorded and simulated",
                    where="comparison",
                    advice="name the channels alike, or choose others with --response",
                )

    def channel(self, name: str) -> Channel:
        """The recorded channel of this name."""
        return next(channel for channel in self.channels if channel.name == name)

    def with_role(self, *roles: str) -> tuple[str, ...]:
        """Names of the recorded channels with one of these roles that are no response."""
        return tuple(c.name for c in self.channels if c.role in roles and c.name not in self.responses)

    def rows_of_runs(self) -> Iterator[tuple[str, slice]]:
        """Every run with its rows."""
        for k, run in enumerate(self.runs):
            yield run, slice(self.starts[k], self.starts[k + 1])

    @cached_property
    def run_index(self) -> NDArray[np.intp]:
        """Number of the run that every row belongs to, shape (n_rows,)."""
        return np.repeat(np.arange(len(self.runs)), np.diff(self.starts))

    @cached_property
    def period_s(self) -> float:
        """Sampling period [s]: the median step."""
        steps = np.diff(self.time_s)
        return float(np.median(steps[np.diff(self.run_index) == 0]))

    @cached_property
    def longest_s(self) -> float:
        """Length of the longest run [s]."""
        return max(float(self.time_s[rows][-1] - self.time_s[rows][0]) for _, rows in self.rows_of_runs())

    def difference(self, response: str) -> Vector:
        """Recorded minus simulated [unit of the response], shape (n_rows,); NaN where one of them is missing."""
        return self.recorded[response] - self.simulated[response]

    def filled(self, values: Vector) -> Vector:
        """The course with missing samples put in from both sides, run by run; 0 in a run that has no sample at all."""
        result = np.array(values, dtype=np.float64)
        for _, rows in self.rows_of_runs():
            part = result[rows]
            seen = np.isfinite(part)
            if not seen.all():
                time = self.time_s[rows]
                result[rows] = np.interp(time, time[seen], part[seen]) if seen.any() else 0.0
        return result

    def simulated_course(self, name: str) -> Vector:
        """The simulated channel without holes."""
        return self.filled(self.simulated[name])

    def only(self, kept: Mask) -> "Comparison":
        """The comparison with some of its rows; runs without any are gone."""
        counts = {run: count for run, rows in self.rows_of_runs() if (count := int(kept[rows].sum()))}
        return replace(
            self,
            runs=tuple(counts),
            starts=(0, *np.cumsum(list(counts.values())).tolist()),
            time_s=read_only(self.time_s[kept]),
            recorded={name: read_only(values[kept]) for name, values in self.recorded.items()},
            simulated={name: read_only(values[kept]) for name, values in self.simulated.items()},
            held_out=self.held_out[kept],
        )


def read_only(values: Vector) -> Vector:
    """The values in one piece, which nobody can change."""
    held = np.ascontiguousarray(values, dtype=np.float64)
    held.setflags(write=False)
    return held
