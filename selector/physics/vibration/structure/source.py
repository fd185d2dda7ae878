"""What shakes the machine: sources with their spectra, fixed or following shafts whose speed may change."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import Misfit
from selector.physics.checks import ABOVE_0, FINITE, FROM_0, Checked, keep_arrays
from selector.types import Complex, Indices, Vector


@dataclass(frozen=True)
class Line(Checked):
    """One line of a spectrum: amplitude·sin(ωt + phase)."""

    frequency_hz: Annotated[float, ABOVE_0] | None = None  #: Where the frequency is fixed [Hz]
    order: Annotated[float, ABOVE_0] | None = None  #: Where it follows a shaft: periods per revolution
    force_n: Annotated[float, FROM_0] = 0.0  #: Amplitude of the force, the same at every speed [N]
    #: Mass times eccentricity of what turns [kg·m]: a force of unbalance·ω² beside `force_n`
    unbalance_kg_m: Annotated[float, FROM_0] = 0.0
    phase_rad: Annotated[float, FINITE] = 0.0  #: Phase against the other lines of its source [rad]

    def _misfits(self) -> Iterator[Misfit]:
        if (self.frequency_hz is None) == (self.order is None):
            found = "both frequency_hz and order" if self.order is not None else "neither frequency_hz nor order"
            advice = "give the frequency where it is fixed, the order where it follows a shaft"
            yield found, "one of them", "frequency_hz", advice
        if self.force_n == 0 and self.unbalance_kg_m == 0:
            expected, advice = "force_n or unbalance_kg_m above 0", "give its size, or leave the line out"
            yield "a line without force", expected, "force_n", advice


@dataclass(frozen=True)
class Source(Checked):
    """A source of vibration: it pushes a member, and with the same force the other way what it pushes against."""

    name: str  #: IK1 cutting, IK2 spindle unit, IK3 main motor, IK4 cross-feed motor, IK5 longitudinal-feed motor in V
    member: str  #: Member on which the force acts
    lines: tuple[Line, ...]  #: Its spectrum
    against: str | None = None  #: Member on which the opposite force acts; None: the ground
    shaft: str | None = None  #: Shaft whose speed the orders belong to

    def _misfits(self) -> Iterator[Misfit]:
        expected = "lines of a spectrum, a shaft for those that follow one, and two sides of the force"
        advice = f"correct the source {self.name!r}"
        if not self.lines:
            yield "no lines", expected, "lines", advice
        if self.shaft is None and any(line.order is not None for line in self.lines):
            yield "orders without a shaft", expected, "shaft", advice
        if self.against == self.member:
            yield f"{self.member!r} pushing against itself", expected, "against", advice


@dataclass(frozen=True, eq=False)
class Excitation:
    """The lines of all sources, one row a line; lines of different sources at one frequency stay apart.

    A force is Im(F·e^{iωt}): amplitude·sin(ωt + phase).
    """

    sources: tuple[str, ...]  #: Names of all sources, also of those without a row
    frequency_hz: Vector  #: (n_lines,): Above 0 [Hz]
    force_n: Complex  #: (n_lines,): F, what the source does to its member [N]
    #: source and line: (n_lines,): Position of the source, and of the line among the lines of its source
    source: Indices
    line: Indices
    #: order and shaft: Periods per revolution and the shaft that the line follows; None where the frequency is fixed
    order: tuple[float | None, ...]
    shaft: tuple[str | None, ...]

    def __post_init__(self) -> None:
        for values in (self.frequency_hz, self.force_n, self.source, self.line):
            values.setflags(write=False)

    def only(self, rows: Indices) -> "Excitation":
        """The excitation by these rows alone."""
        order, shaft = tuple(self.order[row] for row in rows), tuple(self.shaft[row] for row in rows)
        picked = self.frequency_hz[rows], self.force_n[rows], self.source[rows], self.line[rows]
        return Excitation(self.sources, *picked, order, shaft)


def excitation(sources: Sequence[Source], shaft_rpm: Mapping[str, float]) -> Excitation:
    """Lines of all sources while the shafts turn at constant speeds.

    A line that follows a shaft that stands still is a force that does not change: it has no row.

    `shaft_rpm` is shaft → speed [r/min], 0 or more, of every shaft that a source follows.
    """
    rows: list[tuple[int, int, Line, str | None, float]] = []
    for position, source in enumerate(sources):
        for number, line in enumerate(source.lines):
            if line.order is None:
                rows.append((position, number, line, None, line.frequency_hz or 0.0))
                continue
            speed = shaft_rpm[source.shaft or ""]
            if speed > 0:
                rows.append((position, number, line, source.shaft, line.order * speed / 60.0))
    frequency = np.array([row[4] for row in rows], dtype=np.float64)
    made = [line_force_n(row[2], frequency[place : place + 1])[0] for place, row in enumerate(rows)]
    force = np.array(made, dtype=np.complex128)
    return Excitation(
        sources=tuple(source.name for source in sources),
        frequency_hz=frequency,
        force_n=force,
        source=np.array([row[0] for row in rows], dtype=np.int64),
        line=np.array([row[1] for row in rows], dtype=np.int64),
        order=tuple(row[2].order for row in rows),
        shaft=tuple(row[3] for row in rows),
    )


def line_force_n(line: Line, frequency_hz: Vector) -> Complex:
    """F = (force + unbalance·ω²)·e^{i·phase} [N] of one line at frequencies of shape (n,)."""
    amplitude = line.force_n + line.unbalance_kg_m * (2.0 * np.pi * frequency_hz) ** 2
    return np.asarray(amplitude * np.exp(1j * line.phase_rad))


@dataclass(frozen=True, eq=False)
class ShaftCourse(Checked):
    """Speed of a shaft over time: straight between corners, level before the first and after the last.

    InputError: no corner, times that do not increase, or a speed that is missing or below 0.
    """

    #: time_s and rpm: (n_corners,): Corners: increasing times [s], and speeds of 0 or more [r/min]
    time_s: Vector
    rpm: Vector

    def __post_init__(self) -> None:
        keep_arrays(self, "time_s", "rpm")
        super().__post_init__()

    def _misfits(self) -> Iterator[Misfit]:
        time, rpm = self.time_s, self.rpm
        expected = "one speed a time, each time after the one before"
        advice = "give the corners in the order of their times; make a jump a short slope"
        if time.ndim != 1 or time.shape != rpm.shape or len(time) == 0:
            yield f"times of shape {time.shape} and speeds of shape {rpm.shape}", expected, "shaft_rpm", advice
        if not np.isfinite(time).all() or (np.diff(time) <= 0).any():
            yield "times that do not increase", expected, "shaft_rpm", advice
        if not (np.isfinite(rpm) & (rpm >= 0)).all():
            first = int(np.flatnonzero(~(np.isfinite(rpm) & (rpm >= 0)))[0])
            expected = "speeds of 0 or more; orders are the same in both directions"
            advice = "fill what is missing; split a run where the shaft turns back"
            yield f"{rpm[first]:g} r/min at {time[first]:g} s", expected, "shaft_rpm", advice

    @property
    def is_level(self) -> bool:
        """Whether the speed never changes."""
        return bool((self.rpm == self.rpm[0]).all())

    def rpm_at(self, time_s: ArrayLike) -> Vector:
        """Speed at these times [r/min], shape (n_times,)."""
        return np.asarray(np.interp(np.asarray(time_s, dtype=np.float64), self.time_s, self.rpm))

    def turns_at(self, time_s: ArrayLike) -> Vector:
        """Turns since time 0, the exact integral of the speed, shape (n_times,)."""
        time = np.asarray(time_s, dtype=np.float64)
        return self._turns(time) - self._turns(np.zeros(1))

    def range_rpm(self, from_s: float, to_s: float) -> tuple[float, float]:
        """Lowest and highest speed from one time to another [r/min]."""
        inside = self.rpm[(self.time_s > from_s) & (self.time_s < to_s)]
        speeds = np.concatenate((inside, self.rpm_at([from_s, to_s])))
        return float(speeds.min()), float(speeds.max())

    def _turns(self, time: Vector) -> Vector:
        """Turns since the first corner."""
        whole = np.concatenate(([0.0], np.cumsum(np.diff(self.time_s) * (self.rpm[1:] + self.rpm[:-1]) / 2.0)))
        corner = np.clip(np.searchsorted(self.time_s, time, side="right") - 1, 0, len(self.time_s) - 1)
        since = time - self.time_s[corner]
        return (whole[corner] + since * (self.rpm[corner] + self.rpm_at(time)) / 2.0) / 60.0
