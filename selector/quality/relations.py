"""How a channel follows its siblings: learned on some runs, applied to another.

Works on means over blocks of samples, so noise and resolution matter little and the cost hardly depends on the length
of the runs. Every run is centred: only movement counts, not the level of the day.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from selector.quality.survey import Floats, Survey

_BLOCKS = 240
_PRESENT = 0.9
"""A channel takes part in a run when so many of its blocks hold a sample; the rest is interpolated."""
_RIDGE = {"degC": 0.05, "um": 0.5}
"""What a block mean may be off without being wrong [K, µm]: keeps weights of near-identical siblings small."""
_SAME = 1e-7
"""1 - correlation below which a sibling is a copy, from which nothing can be learned."""


class Relations:
    """Linear relations between the thermal and displacement channels of a survey."""

    def __init__(self, survey: Survey, predictors: int = 5) -> None:
        self.survey = survey
        self.columns = survey.columns("temperature", "ambient", "displacement")
        self.roles = [survey.channels[c].role for c in self.columns]
        self.runs = survey.runs
        self.most = predictors
        self._blocks = [block_means(survey, run, self.columns) for run in survey.runs]
        self.present: NDArray[np.bool_] = np.array(
            [[bool(np.isfinite(row).any()) for row in b] for b, _ in self._blocks]
        )
        self.present = self.present.reshape(len(self.runs), len(self.columns)).T
        ridge = np.array([_RIDGE[survey.channels[c].unit] ** 2 for c in self.columns])
        self._ridge = ridge
        self._movement = [np.nan_to_num(means) for means, _ in self._blocks]
        self._sums: dict[bytes, tuple[Floats, int]] = {}
        self._everywhere: dict[bytes, NDArray[np.bool_]] = {}
        self._chosen: dict[tuple[int, frozenset[int]], list[int]] = {}

    def movement(self, r: int) -> Floats:
        """Block means of a run, centred, shape (n_channels, n_blocks); 0 where a channel is absent."""
        return self._movement[r]

    def time_s(self, r: int) -> Floats:
        """Start of each block of a run and the end of the last [s], shape (n_blocks + 1,)."""
        return self._blocks[r][1]

    @cached_property
    def _grams(self) -> Floats:
        return np.array([self.movement(r) @ self.movement(r).T for r in range(len(self.runs))])

    @cached_property
    def _counts(self) -> NDArray[np.intp]:
        return np.array([b.shape[1] for b, _ in self._blocks])

    def siblings(self, i: int, without: Sequence[int] = ()) -> list[int]:
        """The channels that together follow channel `i` best, chosen forward on all runs; thermal for thermal.

        Chosen once: leaving out channels that would not have been chosen changes nothing.
        """
        if (i, frozenset()) not in self._chosen:
            self._chosen[i, frozenset()] = self._forward(i, frozenset())
        hit = frozenset(without).intersection(self._chosen[i, frozenset()])
        # two or more left out: the second may come in only when the first is gone
        key = (i, frozenset(without) if hit else hit)
        if key not in self._chosen:
            self._chosen[key] = self._forward(*key)
        return list(self._chosen[key])

    def _forward(self, i: int, without: frozenset[int]) -> list[int]:
        runs = np.flatnonzero(self.present[i])
        thermal = self.roles[i] != "displacement"
        whole = self._present_with(i)
        pool = [
            j
            for j in np.flatnonzero(whole).tolist()
            if j != i and j not in without and not (thermal and self.roles[j] == "displacement")
        ]
        if runs.size == 0 or not pool:
            return []
        gram, count = self._sum_with(i)
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        unlike = 1.0 - np.abs(gram[i] / size / size[i])
        pool = [j for j in pool if unlike[j] > _SAME]
        chosen: list[int] = []
        while pool and len(chosen) < self.most:
            # with what is chosen so far taken out, the next is the one most like the rest
            w = _solved(gram, self._ridge, i, chosen, count)
            rest = gram[i, pool] - (gram[np.ix_(pool, chosen)] @ w if chosen else 0.0)
            gain = np.abs(rest) / size[pool]
            best = int(np.argmax(gain))
            if gain[best] < 1e-3 * size[i]:
                break
            chosen.append(pool.pop(best))
        return chosen

    def weights(self, i: int, siblings: Sequence[int], training: Sequence[int]) -> Floats:
        """Least-squares weights of the siblings for channel `i`, learned on these runs."""
        return self.weights_without(i, siblings, np.setdiff1d(np.arange(len(self.runs)), training).tolist())

    def weights_without(self, i: int, siblings: Sequence[int], apart: Sequence[int]) -> Floats:
        """The same, learned on all runs but these; the cost does not depend on the number of runs."""
        apart = [r for r in apart if self.present[i, r]]
        # the sum over all runs less the few that are left out
        gram, count = self._sum_with(i)
        part = np.ix_([*siblings, i], [*siblings, i])
        inner = gram[part]
        for r in apart:
            inner = inner - self._grams[r][part]
        last = len(siblings)
        ridge = self._ridge[[*siblings, i]]
        count -= int(self._counts[np.asarray(apart, dtype=np.intp)].sum())
        return _solved(inner, ridge, last, list(range(last)), count)

    def weights_on(self, i: int, siblings: Sequence[int], r: int, blocks: NDArray[np.bool_]) -> Floats:
        """The same, learned on some blocks of one run."""
        part = self.movement(r)[:, blocks]
        part = part - part.mean(axis=1, keepdims=True)
        return _solved(part @ part.T, self._ridge, i, list(siblings), int(blocks.sum()))

    def prediction(self, siblings: Sequence[int], weights: Floats, r: int) -> Floats:
        """Course of a channel in run `r` as its siblings have it, centred, shape (n_blocks,)."""
        return np.asarray(weights @ self.movement(r)[list(siblings)], dtype=np.float64)

    def departure(self, i: int, siblings: Sequence[int], weights: Floats, r: int) -> Floats:
        """Channel `i` in run `r` minus what its siblings say, zero at the start, shape (n_blocks,)."""
        off = self.movement(r)[i] - self.prediction(siblings, weights, r)
        return np.asarray(off - np.median(off[: max(3, off.size // 10)]), dtype=np.float64)

    def _present_with(self, i: int) -> NDArray[np.bool_]:
        """Which channels are present wherever channel `i` is."""
        key = self.present[i].tobytes()
        if key not in self._everywhere:
            self._everywhere[key] = np.asarray(self.present[:, self.present[i]].all(axis=1), dtype=np.bool_)
        return self._everywhere[key]

    def _sum_with(self, i: int) -> tuple[Floats, int]:
        """(Gram matrix, number of blocks) over the runs in which channel `i` is present."""
        key = self.present[i].tobytes()
        if key not in self._sums:
            runs = np.flatnonzero(self.present[i])
            self._sums[key] = self._grams[runs].sum(axis=0), int(self._counts[runs].sum())
        return self._sums[key]


def _solved(gram: Floats, ridge: Floats, i: int, siblings: list[int], count: int) -> Floats:
    if not siblings:
        return np.empty(0)
    inner = gram[np.ix_(siblings, siblings)] + np.diag(ridge[siblings] * max(count, 1))
    return np.asarray(np.linalg.solve(inner, gram[siblings, i]), dtype=np.float64)


def block_means(survey: Survey, run: str, columns: Sequence[int]) -> tuple[Floats, Floats]:
    """Centred means over up to 240 blocks of a run, shape (n_columns, n_blocks), and the blocks' borders [s].

    A channel of which too much is missing is NaN throughout.
    """
    time, values = survey.time[run], survey.values[run]
    count = min(_BLOCKS, time.size)
    borders = np.linspace(0, time.size, count + 1).astype(np.intp)
    means = np.full((len(columns), count), np.nan)
    for k, column in enumerate(columns):
        x = values[column]
        present = np.isfinite(x)
        sums = np.add.reduceat(np.where(present, x, 0.0), borders[:-1])
        held = np.add.reduceat(present.astype(np.float64), borders[:-1])
        whole = held > 0
        if whole.mean() < _PRESENT:
            continue
        row = sums[whole] / held[whole]
        if not whole.all():
            row = np.interp(np.arange(count), np.flatnonzero(whole), row)
        means[k] = row - row.mean()
    return means, np.r_[time[borders[:-1]], time[-1]]
