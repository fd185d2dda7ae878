"""How do tool and workpiece answer to a force whose samples have the stamps of a recording, with all that lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.vibration.chain_values import Chain
from selector.physics.vibration.final_motion import Method
from selector.physics.vibration.lost_samples import bridged
from selector.physics.vibration.recorded_clock import Stretch
from selector.physics.vibration.recorded_force import force_answer
from selector.physics.vibration.source import Source
from selector.physics.vibration.structure import Structure

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StampedAnswer:
    """Motion of the finals by one recorded force, at the stamps of the recording.

    Attributes
    ----------
    motion_m : ndarray of shape (n_finals, n_rows)
        [m].
    force_n : ndarray of shape (n_rows,)
        The force as it acted, without what lacked [N].
    begin_m, end_m : ndarray of shape (n_stretches, n_finals)
        See `ForceAnswer`, for every stretch [m].
    left : float
        See `ForceAnswer`; the largest.
    """

    motion_m: Matrix
    force_n: Vector
    begin_m: Matrix
    end_m: Matrix
    left: float


def stamped_answer(
    structure: Structure,
    source: Source,
    force_n: Vector,
    parts: Sequence[Stretch],
    finals: Mapping[str, str],
    *,
    method: Method = "coupled",
    chains: Sequence[Chain] = (),
    split_hz: float | None = None,
) -> StampedAnswer:
    """Motion by a force [N] of shape (n_rows,), NaN where it lacks; each stretch for itself, see `force_answer`.

    Parameters
    ----------
    parts : sequence of Stretch
        `stretches` of the stamps.
    finals : mapping of str to str
        Name of a final → its member.
    method, chains, split_hz
        See `final_motions`.

    Raises
    ------
    InputError
        Those of `force_answer`.
    """
    motion, acted = np.zeros((len(finals), len(force_n))), np.zeros(len(force_n))
    begin, end, left = [], [], 0.0
    for part in parts:
        rows = slice(part.first, part.end)
        grid, known = part.on_grid(force_n[rows])
        # a stretch of which nothing is known has the mean of the others
        even = bridged(grid, known) if known.any() else np.full(part.count, np.nanmean(force_n))
        found = force_answer(
            structure, source, even, part.step_s, finals, method=method, chains=chains, split_hz=split_hz
        )
        motion[:, rows] = part.at_rows(found.motion_m)
        acted[rows] = np.where(np.isfinite(force_n[rows]), force_n[rows], part.at_rows(even))
        begin.append(found.begin_m)
        end.append(found.end_m)
        left = max(left, found.left)
    return StampedAnswer(motion, acted, np.array(begin), np.array(end), left)
