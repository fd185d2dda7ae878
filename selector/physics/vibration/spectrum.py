"""At which frequencies do the sources shake, and how strongly: their spectra at given speeds of the shafts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.vibration.source import Line, Source

Vector = NDArray[np.float64]
ComplexVector = NDArray[np.complex128]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Excitation:
    """The lines of all sources, one row a line; lines of different sources at one frequency stay apart.

    A force is Im(F·e^{iωt}): amplitude·sin(ωt + phase).

    Attributes
    ----------
    sources : tuple of str
        Names of all sources, also of those without a row.
    frequency_hz : ndarray of shape (n_lines,)
        Above 0 [Hz].
    force_n : complex ndarray of shape (n_lines,)
        F, what the source does to its member [N].
    source, line : int ndarrays of shape (n_lines,)
        Position of the source, and of the line among the lines of its source.
    order, shaft : tuple of length n_lines
        Periods per revolution and the shaft that the line follows; None where the frequency is fixed.
    """

    sources: tuple[str, ...]
    frequency_hz: Vector
    force_n: ComplexVector
    source: Indices
    line: Indices
    order: tuple[float | None, ...]
    shaft: tuple[str | None, ...]

    def __post_init__(self) -> None:
        for values in (self.frequency_hz, self.force_n, self.source, self.line):
            values.setflags(write=False)

    def only(self, rows: Indices) -> Excitation:
        """The excitation by these rows alone."""
        return Excitation(
            self.sources,
            self.frequency_hz[rows],
            self.force_n[rows],
            self.source[rows],
            self.line[rows],
            tuple(self.order[row] for row in rows),
            tuple(self.shaft[row] for row in rows),
        )


def excitation(sources: Sequence[Source], shaft_rpm: Mapping[str, float]) -> Excitation:
    """Lines of all sources while the shafts turn at constant speeds.

    A line that follows a shaft that stands still is a force that does not change: it has no row.

    Parameters
    ----------
    sources : sequence of Source
    shaft_rpm : mapping of str to float
        Shaft → speed [r/min], 0 or more.

    Raises
    ------
    InputError
        A name stands twice, a shaft is missing or turns with an impossible speed, or a number overflows.
    """
    require_names(sources)
    rows: list[tuple[int, int, Line, str | None, float]] = []
    for position, source in enumerate(sources):
        for number, line in enumerate(source.lines):
            if line.order is None:
                rows.append((position, number, line, None, line.frequency_hz or 0.0))
                continue
            speed = shaft_speed(source, shaft_rpm)
            if speed > 0:
                rows.append((position, number, line, source.shaft, line.order * speed / 60.0))
    frequency = np.array([row[4] for row in rows], dtype=np.float64)
    made = [line_force_n(row[2], frequency[place : place + 1])[0] for place, row in enumerate(rows)]
    force = np.array(made, dtype=np.complex128)
    for (position, number, *_), f, value in zip(rows, frequency, force, strict=True):
        if not (math.isfinite(f) and np.isfinite(value)):
            raise InputError(
                f"a force beyond all numbers, at {f:g} Hz",
                expected="finite numbers",
                where=f"sources.{sources[position].name}.lines[{number + 1}]",
                advice="correct the speed of the shaft, the order, or the unbalance [kg·m]",
            )
    return Excitation(
        sources=tuple(source.name for source in sources),
        frequency_hz=frequency,
        force_n=force,
        source=np.array([row[0] for row in rows], dtype=np.int64),
        line=np.array([row[1] for row in rows], dtype=np.int64),
        order=tuple(row[2].order for row in rows),
        shaft=tuple(row[3] for row in rows),
    )


def line_force_n(line: Line, frequency_hz: Vector) -> ComplexVector:
    """F = (force + unbalance·ω²)·e^{i·phase} [N] of one line at frequencies of shape (n,)."""
    # too large is the caller's to tell
    with np.errstate(over="ignore", invalid="ignore"):
        amplitude = line.force_n + line.unbalance_kg_m * (2.0 * np.pi * frequency_hz) ** 2
        return np.asarray(amplitude * np.exp(1j * line.phase_rad))


def shaft_speed(source: Source, shaft_rpm: Mapping[str, float]) -> float:
    """Speed of a source's shaft [r/min]; InputError if there is none or it cannot be."""
    speed = shaft_rpm.get(source.shaft or "")
    if speed is None or not (math.isfinite(speed) and speed >= 0):
        raise InputError(
            f"no shaft {source.shaft!r}" if speed is None else f"{speed:g} r/min",
            expected=f"one of {', '.join(shaft_rpm) or 'some shafts'}"
            if speed is None
            else "0 or more; orders are the same in both directions",
            where=f"sources.{source.name}.shaft" if speed is None else f"shafts.{source.shaft}",
            advice="give the speed of every shaft that a source follows",
        )
    return speed


def require_names(sources: Sequence[Source]) -> None:
    """Raises InputError if two sources have one name."""
    names = [source.name for source in sources]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(
            f"two sources called {twice!r}",
            expected="sources, each with its own name",
            where="sources",
            advice="put all lines of a source into one, or name the second one otherwise",
        )
