"""What does a gauge show of an allowance that was recorded: its characteristic and its filter, behind the surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from selector.errors import InputError
from selector.physics.gauging.process import Noise, Surface
from selector.types import Vector

MOST_POINTS = 20_000_000


@dataclass(frozen=True)
class SeenSurface:
    """What the gauge meets besides the allowance."""

    surface: Surface  #: At angle 0 when the course begins
    noise: Noise
    random: np.random.Generator | None = None  #: Draws the noise; None: there is none


def voltage_course(
    voltage_at: Callable[[Vector], Vector],
    filter_s: float,
    time_s: Vector,
    allowance_um: Vector,
    seen: SeenSurface,
    finest_s: float,
) -> Vector:
    """Smoothed voltage at the samples of an allowance that goes straight from one to the next [V].

    It begins as if the first allowance had stood for long. What the filter is fed goes straight between points of an
    even grid, which is the samples and others between them, at most `finest_s` [s] apart; grooves count by the part of
    the way around each of them that they take.

    `voltage_at` is the characteristic, `filter_s` T_Φ [s].

    Raises InputError: the grid would have more than 20 million points.
    """
    span_s, intervals = float(time_s[-1] - time_s[0]), len(time_s) - 1
    finer = max(1, math.ceil(span_s / intervals / finest_s))
    if finer * intervals > MOST_POINTS:
        raise InputError(
            f"{span_s:.3g} s of which every {finest_s:.3g} s counts",
            expected=f"at most {MOST_POINTS} steps of the calculation",
            where="recorded course",
            advice="cut the recording to the parts that were ground",
        )
    grid_s = time_s[0] + span_s * np.arange(finer * intervals + 1) / (finer * intervals)
    allowance = np.interp(grid_s, time_s, allowance_um)
    surface, step_s = seen.surface, span_s / (finer * intervals)
    turn = (grid_s - time_s[0]) * surface.workpiece_rpm / 60.0
    met = allowance + surface.runout_um * np.sin(2 * math.pi * turn)
    if seen.random is not None and seen.noise.sd_um > 0:
        met += _noise_um(seen.noise, step_s, len(grid_s), seen.random)
    fed, began = voltage_at(met), float(voltage_at(allowance[:1])[0])
    if surface.grooves > 0:
        share, deep = _groove_share(surface, turn), voltage_at(met - surface.groove_depth_um)
        fed = fed + share * (deep - fed)
        began += surface.groove_share * (float(voltage_at(allowance[:1] - surface.groove_depth_um)[0]) - began)
    return np.interp(time_s, grid_s, _smoothed(fed, step_s / filter_s, began))


def _groove_share(surface: Surface, turn: Vector) -> Vector:
    """Which part of the way around each point of an even grid, half a step to either side, lies in grooves."""
    half = 0.5 * (turn[1] - turn[0])
    edges = surface.grooves * np.append(turn - half, turn[-1] + half)
    passed = np.floor(edges) * surface.groove_share + np.minimum(np.mod(edges, 1.0), surface.groove_share)
    return np.diff(passed) / (2.0 * half * surface.grooves)


def _smoothed(fed: Vector, share: float, began: float) -> Vector:
    """The filter on an input that goes straight over steps of so many of its time constants; exact."""
    keep = math.exp(-share)
    late = 1.0 + math.expm1(-share) / share if share > 1e-5 else 0.5 * share
    early = 1.0 - keep - late
    pushed = early * fed[:-1] + late * fed[1:]
    rest, _ = lfilter([1.0], [1.0, -keep], pushed, zi=[keep * began])
    return np.concatenate([[began], rest])


def _noise_um(noise: Noise, step_s: float, points: int, random: np.random.Generator) -> Vector:
    """Noise of R(τ) = D·exp(−β·|τ|) at even times; exact."""
    keep = math.exp(-noise.rate_per_s * step_s)
    drawn = random.standard_normal(points) * noise.sd_um
    drawn[1:] *= math.sqrt(-math.expm1(-2.0 * noise.rate_per_s * step_s))
    return np.asarray(lfilter([1.0], [1.0, -keep], drawn), dtype=np.float64)
