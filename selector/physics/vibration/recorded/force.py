"""How tool and workpiece answer to a recorded force, on an even grid or at the stamps of a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft
from scipy.signal import windows

from selector.physics.vibration.motion.final_motion import ChainMethod, source_curve
from selector.physics.vibration.recorded.clock import Stretch, bridged, continued
from selector.physics.vibration.structure.modes import structure_modes
from selector.physics.vibration.structure.source import Source
from selector.physics.vibration.structure.structure import Structure
from selector.types import Matrix, Vector

MOST_SILENT = 1 << 21
"""Samples of the silence behind the force."""

FADED = 1e-3
"""Share of a free vibration that counts as none."""

_LEVEL = 16384
"""Samples at either end whose weighted mean is the level of the force there; no more than a quarter of all."""

_OUTLIER = 4.0
"""Standard deviations from which on a value is no part of the level."""


@dataclass(frozen=True, eq=False)
class ForceAnswer:
    """Motion of the finals by one recorded force."""

    motion_m: Matrix  #: (n_finals, n_samples): [m]
    #: begin_m and end_m: (n_finals,): By how much the motion may differ in the time `ring_s` after the first sample,
    #: and at the last one, because it is not known what acted before and what acts then [m]
    begin_m: Vector
    end_m: Vector
    ring_s: float  #: Time in which a free vibration fades to `FADED` [s]; infinite if nothing damps it
    #: Share of a free vibration that is left where the calculation begins anew: what laps over from its end
    left: float


def ring_time_s(structure: Structure) -> float:
    """Time in which every free vibration fades to `FADED` [s]; infinite if nothing damps one."""
    decay = _decay_per_s(structure)
    return -math.log(FADED) / decay if decay > 0 else math.inf


def force_answer(
    structure: Structure,
    source: Source,
    force_n: Vector,
    step_s: float,
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> ForceAnswer:
    """Motion by a force [N] of shape (n_samples,), one every `step_s` [s], that acts where the source does.

    For `finals` and `chains` see `final_motions`.

    InputError: a resonance that nothing damps, or the errors of `final_motions`.
    """
    ring_s = ring_time_s(structure)
    ring = math.ceil(min(ring_s / step_s, MOST_SILENT / 5))
    line = _static_n(force_n)
    moving = force_n - line
    # twice the ring: half of it steady, half of it to come up from nothing
    outside = 2 * ring
    rising = 0.5 - 0.5 * np.cos(np.pi * np.minimum(np.arange(1, outside + 1) / max(outside / 2, 1.0), 1.0))
    proved = max(ring // 4, 16)  # longer than a blow, short enough for a course that slowly changes
    before = rising * continued(moving[::-1], outside, proved)[::-1]
    behind = rising[::-1] * continued(moving, outside, proved)
    padded = fft.next_fast_len(len(moving) + 2 * outside + ring, real=True)
    curve = source_curve(structure, source, 0.0, 0.5 / step_s, finals, chains)
    spectrum = curve.at(fft.rfftfreq(padded, step_s))
    # of what lasts, the part in step with the force counts: irfft takes the real part there
    static = np.outer(spectrum[:, 0].real, line)
    here = slice(outside, outside + len(moving))
    courses = np.zeros((2, padded))
    courses[0, here] = moving
    courses[1, :outside], courses[1, here.stop : here.stop + outside] = before, behind
    own, others = (fft.irfft(spectrum * fft.rfft(course), padded) for course in courses)
    near = min(ring, len(moving))
    # by what was added outside, and by what this force would leave behind itself, or sends ahead
    begin = np.maximum(_largest(others[:, here][:, :near]), _largest(own[:, here.stop : here.stop + outside]))
    end = np.maximum(_largest(others[:, here][:, -1:]), _largest(own[:, here.start - 1 : here.start]))
    silent = padded - len(moving) - 2 * outside
    left = math.exp(-_decay_per_s(structure) * silent * step_s)
    return ForceAnswer(static + (own + others)[:, here], begin, end, ring_s, left)


def _static_n(force_n: Vector) -> Vector:
    """The straight line through the levels at both ends: of a step that from what was before to what is behind it."""
    count = len(force_n)
    near = min(_LEVEL, count // 4)
    if near < 1:
        return np.full(count, force_n.mean())
    begin, end = _level_n(force_n[:near]), _level_n(force_n[-near:])
    slope = (end - begin) / (count - near)
    return np.asarray(begin + slope * (np.arange(count) - 0.5 * (near - 1)))


def _level_n(force_n: Vector) -> float:
    """Mean with weights that fade to both sides: parts of a period count for nothing, and single blows little."""
    middle = float(np.median(force_n))
    usual = 1.4826 * float(np.median(np.abs(force_n - middle)))  # of noise: its standard deviation
    weight = windows.hann(len(force_n) + 2)[1:-1]
    clipped = np.clip(force_n, middle - _OUTLIER * usual, middle + _OUTLIER * usual)
    return float(weight @ clipped / weight.sum())


def _largest(motion: Matrix) -> Vector:
    return np.asarray(np.abs(motion).max(axis=1, initial=0.0))


def _decay_per_s(structure: Structure) -> float:
    return float(np.sqrt(structure_modes(structure).eigenvalues_per_s2).imag.min())


@dataclass(frozen=True, eq=False)
class StampedAnswer:
    """Motion of the finals by one recorded force, at the stamps of the recording."""

    motion_m: Matrix  #: (n_finals, n_rows): [m]
    force_n: Vector  #: (n_rows,): The force as it acted, without what lacked [N]
    #: begin_m and end_m: (n_stretches, n_finals): See `ForceAnswer`, for every stretch [m]
    begin_m: Matrix
    end_m: Matrix
    left: float  #: See `ForceAnswer`; the largest


def stamped_answer(
    structure: Structure,
    source: Source,
    force_n: Vector,
    parts: Sequence[Stretch],
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> StampedAnswer:
    """Motion by a force [N] of shape (n_rows,), NaN where it lacks; each stretch for itself, see `force_answer`.

    `parts` are the `stretches` of the stamps; for `finals` and `chains` see `final_motions`.

    InputError: those of `force_answer`.
    """
    motion, acted = np.zeros((len(finals), len(force_n))), np.zeros(len(force_n))
    begin, end, left = [], [], 0.0
    for part in parts:
        rows = slice(part.first, part.end)
        grid, known = part.on_grid(force_n[rows])
        # a stretch of which nothing is known has the mean of the others
        even = bridged(grid, known) if known.any() else np.full(part.count, np.nanmean(force_n))
        found = force_answer(structure, source, even, part.step_s, finals, chains)
        motion[:, rows] = part.at_rows(found.motion_m)
        acted[rows] = np.where(np.isfinite(force_n[rows]), force_n[rows], part.at_rows(even))
        begin.append(found.begin_m)
        end.append(found.end_m)
        left = max(left, found.left)
    return StampedAnswer(motion, acted, np.array(begin), np.array(end), left)
