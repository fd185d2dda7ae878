"""Which parts of the tests are continuous heating from rest, and which are cooling."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.mode_data import SAME_SPEED, ModeData

Vector = NDArray[np.float64]

BLIP = 0.01
"""A piece shorter than this share of its run, between two at one speed, is a blip of the speed signal."""
FEWEST_BLOCKS = 6
"""Block averages (they grow with the time since the speed changed) that a curve needs at least."""


@dataclass(frozen=True)
class Stretch:
    """A part of a run at one speed.

    Attributes
    ----------
    run : int
        Position of the run.
    speed_rpm, before_rpm : float
        Speed [r/min], 0 for cooling; the speed before it, for cooling.
    time_s : ndarray of shape (n_blocks,)
        Mean times of the blocks from the beginning of the stretch [s].
    blocks : ndarray of shape (n_blocks,)
        Positions in the `ModeData`.
    duration_s : float
        Length [s].
    """

    run: int
    speed_rpm: float
    before_rpm: float
    time_s: Vector
    blocks: NDArray[np.int64]
    duration_s: float


def heating_from_rest(data: ModeData) -> list[Stretch]:
    """The first turning stretch of every run that starts cold: those that are characteristics of one speed."""
    found = []
    for run in range(len(data.bounds)):
        pieces = list(_pieces(data, run))
        first = next((k for k, piece in enumerate(pieces) if piece.speed_rpm > 0), None)
        if first is None or len(pieces[first].blocks) < FEWEST_BLOCKS:
            continue
        if all(_is_still(data, piece) for piece in pieces[:first]):
            found.append(pieces[first])
    return found


def coolings(data: ModeData) -> list[Stretch]:
    """Stretches at rest after running, and whole runs at rest in which something moves."""
    found = []
    for run in range(len(data.bounds)):
        pieces = list(_pieces(data, run))
        turned = False
        for piece in pieces:
            alone = len(pieces) == 1 and not _is_still(data, piece)
            if piece.speed_rpm == 0 and (turned or alone) and len(piece.blocks) >= FEWEST_BLOCKS:
                found.append(piece)
            turned = turned or piece.speed_rpm > 0
    return found


def _pieces(data: ModeData, run: int) -> Iterator[Stretch]:
    first, last = data.bounds[run]
    blocks = np.arange(first, last)
    length = data.before_s[blocks] + data.after_s[blocks]
    ends = np.cumsum(length)
    levels = np.array([0.0, *data.levels_rpm])
    distance = np.abs(data.speed_rpm[blocks][:, None] - levels)
    label = np.where(distance.min(axis=1) <= 1.5 * SAME_SPEED * data.fastest_rpm, distance.argmin(axis=1), -1)
    runs = [[key, [i for i, _ in group]] for key, group in groupby(enumerate(label.tolist()), key=lambda item: item[1])]
    merged: list[tuple[int, list[int]]] = []
    for k, (key, members) in enumerate(runs):
        short = length[members].sum() < BLIP * ends[-1]
        if short and merged and k + 1 < len(runs) and runs[k + 1][0] == merged[-1][0]:
            continue  # a blip: the blocks are dropped, the stretch goes on
        if merged and merged[-1][0] == key:
            merged[-1][1].extend(members)
        elif key == -1 and short:
            continue  # a ramp up or down
        else:
            merged.append((key, list(members)))
    before = 0.0
    for key, members in merged:
        begin = ends[members[0]] - length[members[0]]
        if members[0] and all(label[i] == -1 for i in range(members[0])):
            begin = 0.0  # the run starts within a ramp
        position = np.array(members)
        with_values = position[data.counts[blocks[position]].max(axis=1) > 0]
        middle = ends[with_values] - data.after_s[blocks[with_values]]
        speed = float(levels[key]) if key >= 0 else float(data.speed_rpm[blocks[position]].mean())
        yield Stretch(run, speed, before, middle - begin, blocks[with_values], float(ends[position[-1]] - begin))
        before = speed


def _is_still(data: ModeData, piece: Stretch) -> bool:
    """Whether no displacement moves by more than its noise and 2 % of what the tests show."""
    if piece.speed_rpm > 0 or len(piece.blocks) < 2:
        return piece.speed_rpm == 0
    counts = data.counts[piece.blocks]
    for r in range(counts.shape[1]):
        there = counts[:, r] > 0
        values = data.displacement_um[piece.blocks, r][there]
        largest = np.ptp(data.displacement_um[data.counts[:, r] > 0, r])
        if len(values) and np.ptp(values) > 6.0 * data.noise_um[r] + 0.02 * largest:
            return False
    return True
