"""Which sharp lines stand in what a simulation leaves: at a fixed frequency, or at an order of a turning shaft."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, gamma

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.leftover import least_squares
from selector.diagnosis.shapes.line_noise import filtered, floor, tapered, white_filter

Vector = NDArray[np.float64]
Pieces = NDArray[np.complex128]
"""What every piece of a run, all of one length, shows of a line."""

CHANCE = 0.02
"""Chance that noise shows one line in a whole spectrum, where nothing else is said."""
_COHERENT = 0.5
_PIECES = 5
_LASTING = 0.35
_UNSTEADY = 0.2
_BESIDE = 0.03
_UNLIKELY = 0.01
"""Chance that a true line is not taken for one because of noise, in one of the looks at its shape."""
_STRAY = 3.0
"""Robust standard deviations of a reading that says no more than a smaller one."""
_FIRST_PART = 0.2
"""Of a run that nothing may be fitted to only this first part tells its phase, as it would an initial state."""


@dataclass(frozen=True)
class Line:
    """A line: cycles per unit of the abscissa (second or turn), and for every run its phase [rad], None = not there.

    `strength` is its power over that of the noise beside it, all runs together.
    """

    cycles: float
    phases: tuple[float | None, ...]
    strength: float

    @property
    def runs(self) -> tuple[int, ...]:
        """Numbers of the runs in which it is."""
        return tuple(k for k, phase in enumerate(self.phases) if phase is not None)


def fitted_parts(comparison: Comparison) -> list[slice]:
    """Of every run the longest stretch of rows that may be fitted to; an empty slice where there is none."""
    parts = []
    for _, rows in comparison.rows_of_runs():
        free = np.r_[False, ~comparison.held_out[rows], False]
        begins, ends = np.flatnonzero(~free[:-1] & free[1:]), np.flatnonzero(free[:-1] & ~free[1:])
        if len(begins) == 0:
            parts.append(slice(rows.start, rows.start))
            continue
        k = int(np.argmax(ends - begins))
        parts.append(slice(rows.start + int(begins[k]), rows.start + int(ends[k])))
    return parts


def lines(
    comparison: Comparison,
    left: Vector,
    abscissa: Vector,
    weight: Vector,
    *,
    near: tuple[float, ...] | None = None,
    width: float = 0.004,
    lowest: float = 0.0,
    most: int = 4,
    chance: float = CHANCE,
) -> tuple[Line, ...]:
    """Lines of `left` over the abscissa, the strongest first.

    Parameters
    ----------
    left : ndarray of shape (n_rows,)
        What is looked through; 0 where missing.
    abscissa : ndarray of shape (n_rows,)
        Grows within each run: time [s], or turns of the shaft.
    weight : ndarray of shape (n_rows,)
        How the line's size goes over the rows, e.g. the square of the speed.
    near : tuple of float or None
        Look only within the share `width` (or a cycle per run) of these; None = everywhere from `lowest` on.
    most : int
        At most so many.
    chance : float
        That noise shows one of them in the whole spectrum; what is no line is not offered to the fit.
    """
    parts = fitted_parts(comparison)
    noise = white_filter([left[p] for p in parts])
    white = np.zeros(len(left))
    for _, rows in comparison.rows_of_runs():
        white[rows] = filtered(left[rows], noise)
    # strays of noise with heavy tails hide a line; even a strong sine stays below
    stray = _STRAY * 1.4826 * float(np.median(np.abs(np.concatenate([white[p] for p in parts]))))
    white = np.clip(white, -stray, stray) if stray > 0.0 else white
    spectra = [_spectrum(white[p], abscissa[p], weight[p]) for p in parts]
    usable = [k for k, s in enumerate(spectra) if s is not None]
    if not usable:
        return ()
    finest = max(usable, key=lambda k: float(np.ptp(abscissa[parts[k]])))
    grid, _ = spectra[finest]  # type: ignore[misc]
    power = np.array([np.interp(grid, *s, left=1.0, right=1.0) for s in spectra if s is not None])
    ends = min(float(s[0][-1]) for s in spectra if s is not None)
    allowed = (grid >= lowest) & (grid <= ends)
    span = float(np.ptp(abscissa[parts[finest]]))
    if near is not None:
        allowed &= np.any([np.abs(grid - o) <= max(width * o, 1.5 / span) for o in near], axis=0)
    tried = max(int(allowed.sum()), 1)
    found: list[Line] = []
    claimed = np.zeros(len(grid), dtype=bool)
    for together in ([*range(len(usable))], *([k] for k in range(len(usable)) if len(usable) > 1)):
        strength = power[together].sum(axis=0)
        share = 1.0 if len(together) == len(usable) else 1.0 / 3.0 / len(usable)
        limit = float(gamma.isf(share * chance / tried, len(together)))
        open_ = np.where(allowed & ~claimed, strength, 0.0)
        while len(found) < 2 * most and float(open_.max()) > limit:
            top = int(np.argmax(open_))
            taken = np.abs(grid - grid[top]) <= 4.0 / span
            open_[taken] = 0.0
            runs = tuple(usable[k] for k in together)
            line = _line(
                comparison,
                white,
                noise,
                abscissa,
                weight,
                parts,
                runs,
                float(grid[top]),
                float(strength[top]),
                _is_lasting if near is not None else _is_steady,
            )
            if line is not None and _sharp(grid, strength, top, span, len(together)):
                claimed |= taken
                found.append(line)
    return tuple(sorted(found, key=lambda line: -line.strength)[:most])


def aligned(comparison: Comparison, left: Vector, cosine: Vector, sine: Vector, line: Line) -> tuple[Vector, float]:
    """A line that passed through a structure, turned in every run by the angle at which that run shows it.

    `cosine` and `sine` are what the line's two quadratures became; phases come from the same rows as those of lines.
    The second value is the chance that noise shows as much.
    """
    parts = fitted_parts(comparison)
    noise = white_filter([left[part] for part in parts])
    result, explained, freedoms = np.zeros(len(left)), 0.0, 0
    for k, (_, rows) in enumerate(comparison.rows_of_runs()):
        if line.phases[k] is None:
            continue
        is_fitted = parts[k].start < parts[k].stop
        part = parts[k] if is_fitted else _first_part(rows)
        columns = np.column_stack([filtered(course[part], noise) for course in (cosine, sine)])
        white = filtered(left[part], noise)
        a, b = least_squares(columns, white)
        if is_fitted:
            rest = float(np.mean((white - columns @ np.array([a, b])) ** 2))
            explained += (float(np.mean(white**2)) / max(rest, 1e-300) - 1.0) * len(white)
            freedoms += 2
        size = float(np.hypot(a, b))
        if size > 0.0:
            result[rows] = (a * cosine[rows] + b * sine[rows]) / size
    return result, float(chi2.sf(explained, freedoms)) if freedoms else 1.0


def course_of(line: Line, comparison: Comparison, abscissa: Vector, weight: Vector) -> Vector:
    """cos(2π·cycles·abscissa + phase of the run)·weight, 0 in runs without the line."""
    result = np.zeros(len(abscissa))
    for k, (_, rows) in enumerate(comparison.rows_of_runs()):
        phase = line.phases[k]
        if phase is not None:
            result[rows] = np.cos(2.0 * np.pi * line.cycles * abscissa[rows] + phase) * weight[rows]
    return result


def _spectrum(left: Vector, abscissa: Vector, weight: Vector) -> tuple[Vector, Vector] | None:
    """Power at rising cycles per unit over that of the neighbours (1 in the mean where there is noise only)."""
    if len(left) < 48 or float(np.ptp(abscissa)) <= 0.0 or not np.any(left):
        return None
    even = np.linspace(abscissa[0], abscissa[-1], len(left))
    part = np.interp(even, abscissa, left * weight)
    n = 2 * len(part)
    power = np.abs(np.fft.rfft((part - part.mean()) * tapered(len(part)), n)) ** 2
    cycles = np.arange(len(power)) / (n * (even[1] - even[0]))
    skip = 5
    return cycles[skip:], power[skip:] / floor(power[skip:])


def _line(
    comparison: Comparison,
    left: Vector,
    noise: Vector,
    abscissa: Vector,
    weight: Vector,
    parts: list[slice],
    runs: tuple[int, ...],
    cycles: float,
    strength: float,
    is_there: Callable[[list[Pieces], float], bool],
) -> Line | None:
    """The line near `cycles`, refined; None if its phase does not last through the runs, as that of noise does not."""
    span = max(float(np.ptp(abscissa[parts[k]])) for k in runs)
    tried = cycles + np.linspace(-0.6, 0.6, 13) / span
    for width in (0.1, 0.02):
        power = [
            sum(abs(_tone(left[p], abscissa[p], weight[p], f)) ** 2 for p in (parts[k] for k in runs)) for f in tried
        ]
        cycles = float(tried[int(np.argmax(power))])
        tried = cycles + np.linspace(-width, width, 9) / span
    pieces = [_pieces(left[p], abscissa[p], weight[p], cycles) for p in (parts[k] for k in runs)]
    if not is_there(pieces, strength):
        return None
    phases: list[float | None] = [None] * len(parts)
    for k, (_, rows) in enumerate(comparison.rows_of_runs()):
        if k in runs:
            part = parts[k]
        elif parts[k].start == parts[k].stop and len(runs) == sum(p.start < p.stop for p in parts):
            part = _first_part(rows)
        else:
            continue
        phases[k] = _phase(left[part], noise, abscissa[part], weight[part], cycles)
    return Line(cycles, tuple(phases), strength)


def _phase(white: Vector, noise: Vector, abscissa: Vector, weight: Vector, cycles: float) -> float:
    """φ of cos(2π·cycles·abscissa + φ)·weight in a stretch that went through the filter, as the line did."""
    turn = 2.0 * np.pi * cycles * abscissa
    columns = np.column_stack([filtered(part * weight, noise) for part in (np.cos(turn), -np.sin(turn))])
    cosine, sine = least_squares(columns, white)
    return float(np.arctan2(sine, cosine))


def _tone(left: Vector, abscissa: Vector, weight: Vector, cycles: float) -> complex:
    return complex(np.sum(left * weight * np.exp(-2j * np.pi * cycles * abscissa)))


def _first_part(rows: slice) -> slice:
    return slice(rows.start, rows.start + max(int(_FIRST_PART * (rows.stop - rows.start)), 1))


def _sharp(grid: Vector, strength: Vector, top: int, span: float, n_runs: int) -> bool:
    """Whether there is hardly more than noise beside the window's own width, as beside a resonance or passing sweep."""
    apart = np.abs(grid - grid[top]) * span
    beside = strength[(apart > 2.5) & (apart < 6.0)]
    # the spectrum has two points for every one that is free
    free = n_runs * max(len(beside) // 2, 1)
    noise = n_runs * float(gamma.isf(_UNLIKELY, free)) / free
    return len(beside) == 0 or float(np.mean(beside)) < _BESIDE * float(strength[top]) + noise


def _is_lasting(pieces: list[Pieces], strength: float) -> bool:
    """Whether a line is there in all pieces of a run but one, in one phase, as a burst or a passing sweep is not."""
    if _coherence(pieces) < _COHERENT:
        return False
    along = [np.sort((piece * np.conj(piece.sum())).real) for piece in pieces]
    return all(bool(part[1] > _LASTING * float(part.mean())) for part in along)


def _coherence(pieces: list[Pieces]) -> float:
    """Power of whole runs over that of their pieces, were each in phase with itself alone; 0 … 1."""
    whole = float(sum(abs(np.sum(piece)) ** 2 for piece in pieces))
    apart = sum(len(piece) * float(np.sum(np.abs(piece) ** 2)) for piece in pieces)
    return whole / apart if apart > 0.0 else 0.0


def _is_steady(pieces: list[Pieces], strength: float) -> bool:
    """Whether size and phase of a line are the same in all pieces of a run, up to noise and a fifth of the size."""
    if _coherence(pieces) < _COHERENT:
        return False
    whole = float(sum(abs(np.sum(piece)) ** 2 for piece in pieces))
    apart = float(sum(np.sum(np.abs(piece - piece.mean()) ** 2) for piece in pieces))
    # of a whole run noise is whole/strength, in both directions together
    free = sum(2 * (len(piece) - 1) for piece in pieces)
    noise = 0.5 * whole / strength / _PIECES * float(chi2.isf(_UNLIKELY, free))
    return apart < noise + _UNSTEADY**2 * whole / _PIECES


def _pieces(left: Vector, abscissa: Vector, weight: Vector, cycles: float) -> Pieces:
    turned = left * weight * np.exp(-2j * np.pi * cycles * abscissa)
    return np.array([piece.sum() for piece in np.array_split(turned, _PIECES)])
