"""At which frequencies what a simulation leaves follows an input like a resonance: scanned in the spectrum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.even_clock import EvenRun, even_runs
from selector.diagnosis.shapes.line_noise import filtered, floor, tapered, white_filter

Vector = NDArray[np.float64]

DAMPING = (0.005, 0.015, 0.04, 0.1)
CHANCE = 0.02
"""Chance that noise shows one resonance in a whole scan."""
_PER_HALF_WIDTH = 1.2
_SHARED = 1.12
"""By the ends of the window neighbouring frequencies share so much of their noise."""


def resonances(comparison: Comparison, left: Vector, source: Vector, most: int = 4) -> tuple[tuple[float, float], ...]:
    """(frequency [Hz], damping) of resonances that pass the source on into what is left, the clearest first.

    `left` is 0 where it is missing and in rows that may not be fitted to. Each pair explains more of the power, in
    two real coefficients (motion and its speed), than noise would anywhere in the scan with probability `CHANCE`.
    """
    runs = even_runs(comparison)
    noise = white_filter([part for run in runs for part in _stretch(run, comparison, left)[:1]])
    spectra = [s for s in (_spectra(run, comparison, left, source, noise) for run in runs) if s is not None]
    if not spectra:
        return ()
    hz, u, e = (np.concatenate([s[k] for s in spectra]) for k in range(3))
    longest = max(1.0 / float(s[0][1] - s[0][0]) for s in spectra)
    low, high = 8.0 / longest, 0.45 / comparison.period_s
    if high <= low:
        return ()
    order = np.argsort(hz)
    hz, u, e = hz[order], u[order], e[order]
    grids = [np.exp(np.arange(np.log(low), np.log(high), damping / _PER_HALF_WIDTH)) for damping in DAMPING]
    gains = [
        np.array([_explained(hz, u, e, float(f), z) for f in grid]) for grid, z in zip(grids, DAMPING, strict=True)
    ]
    limit = float(chi2.isf(CHANCE / len(hz), 2))
    found: list[tuple[float, float]] = []
    while len(found) < most:
        k = int(np.argmax([gain.max() for gain in gains]))
        top = int(np.argmax(gains[k]))
        if gains[k][top] <= limit:
            break
        f0 = float(grids[k][top])
        found.append(_refined(hz, u, e, f0, DAMPING[k]))
        for grid, gain in zip(grids, gains, strict=True):
            gain[np.abs(np.log(grid / f0)) < 0.1] = 0.0
    return tuple(found)


def _stretch(run: EvenRun, comparison: Comparison, *courses: Vector) -> list[Vector]:
    """The courses between the first and the last row of a run that may be fitted to."""
    free = ~comparison.held_out[run.rows]
    if free.sum() < 64:
        return [np.zeros(0) for _ in courses]
    first = 0 if free[0] else int(np.searchsorted(run.clock_s, run.time_s[free][0]))
    last = len(run.clock_s) if free[-1] else int(np.searchsorted(run.clock_s, run.time_s[free][-1])) + 1
    return [run.on(course)[first:last] for course in courses]


def _spectra(
    run: EvenRun, comparison: Comparison, left: Vector, source: Vector, noise: Vector
) -> tuple[Vector, Vector, Vector] | None:
    """Frequencies [Hz], source and what is left, both behind the filter and over the strength of the noise there."""
    e, u = _stretch(run, comparison, left, source)
    if len(e) < 64 or not np.any(e):
        return None
    window = tapered(len(e))
    hz = np.fft.rfftfreq(len(e), comparison.period_s)[3:]
    es, us = (np.fft.rfft(filtered(v - v.mean(), noise) * window)[3:] for v in (e, u))
    strength = np.sqrt(floor(np.abs(es) ** 2))
    return np.asarray(hz, dtype=np.float64), np.asarray(us / strength), np.asarray(es / strength)


def _explained(hz: Vector, u: Vector, e: Vector, frequency_hz: float, damping: float) -> float:
    """Twice the whitened power explained near the resonance; of noise it is chi-square with two degrees of freedom."""
    reach = min(max(12.0 * damping, 0.06), 0.8)
    a, b = np.searchsorted(hz, [frequency_hz * (1.0 - reach), frequency_hz * (1.0 + reach)])
    if b - a < 6:
        return 0.0
    r = hz[a:b] / frequency_hz
    h = u[a:b] / (1.0 - r * r + 2j * damping * r)
    g = 1j * r * h
    e = e[a:b]
    hh, gg, hg = float(np.vdot(h, h).real), float(np.vdot(g, g).real), float(np.vdot(h, g).real)
    he, ge = float(np.vdot(h, e).real), float(np.vdot(g, e).real)
    det = hh * gg - hg * hg
    if det <= 1e-12 * hh * gg:
        return 0.0
    return 2.0 * (gg * he * he - 2.0 * hg * he * ge + hh * ge * ge) / det / _SHARED


def _refined(hz: Vector, u: Vector, e: Vector, frequency_hz: float, damping: float) -> tuple[float, float]:
    step_f, step_z = damping / _PER_HALF_WIDTH, 1.6
    for _ in range(3):
        tried = [
            (frequency_hz * float(np.exp(df)), damping * dz)
            for df in (-step_f, -step_f / 2, 0.0, step_f / 2, step_f)
            for dz in (1.0 / step_z, 1.0, step_z)
        ]
        frequency_hz, damping = max(tried, key=lambda pair: _explained(hz, u, e, *pair))
        step_f, step_z = step_f / 3.0, step_z**0.6
    return frequency_hz, float(min(max(damping, 0.001), 0.5))
