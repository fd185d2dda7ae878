"""What unseen rows bear out where the likelihood of the fitted ones names nothing.

The filter of the noise takes for noise what is slow or rings: what a record repeats of itself is in it. In plain
squares a shape counts that explains a good part of the fitted rows and, at the size that it has there, of the unseen
ones, too. How much of both shapes explain that are certainly wrong is seen by those of the whole catalogue at another
time, as for `misfit`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.evidence.misfit import elsewhere
from selector.diagnosis.evidence.noise import NoiseModel
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.evidence.search import Search, numbers, unseen_rms
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.matching.usable import rms
from selector.findings import Finding, Where
from selector.types import Matrix, Vector

_SHIFTS, _MOST_ROWS = 60, 8_000
_WIDEST = 3  #: Coefficients of a shape, at most.
_LEAST = 0.2  #: Of the mean square of fitted and of unseen rows. Of names that explain less, few are right.
_BEYOND, _MORE = 1.25, 0.03  #: Times the most that a shape at a wrong time explains, and so much more.
_LEAVES = 0.4  #: Of what that leaves: enough where it explains most, as of all that rings.
#: Of the spread of the readings: what recalibration leaves, below which any wrong course explains a part of it.
_MATTERS = 0.12
_AS_GOOD, _MOST_ALIKE = 0.6, 3
_FAR_LESS = 0.5  #: Of what the names of a search leave.
_STANDS = 0.1  #: Of the spread of a shape: what differs by less within every run.
_AT_ANY_TIME = ("vibration.line", "vibration.imbalance")  #: Waves of any phase, which are the same at a wrong time.


def borne_out(comparison: Comparison, found: Search, *, seed: int) -> Search:
    """The search with the effect that unseen rows bear out, in the response where that is most; else as it is."""
    best: tuple[float, str, str] = (0.0, "", "")
    told = {}
    for name, bench in found.benches.items():
        left = bench.residual([])
        size = float(np.nanstd(comparison.recorded[name][bench.fitted]))
        # unseen rows that are simulated exactly, or are none, bear nothing out
        if rms(left[bench.fitted]) < _MATTERS * size or not bench.target[bench.unseen].any():
            continue
        shares, by_chance = _shares(bench, seed=seed)
        # what recalibration takes, as viscous friction, is not tested
        shares = {id_: one for id_, one in shares.items() if id_ in found.standing and id_ not in bench.own}
        told[name] = (shares, by_chance, left)
        most = float(by_chance.max())
        beyond = min(_BEYOND * most + _MORE, 1.0 - _LEAVES * (1.0 - most))
        for id_, (share, _) in shares.items():
            if share > max(_LEAST, 0.0 if id_ in _AT_ANY_TIME else beyond, best[0]):
                best = (share, id_, name)
    share, id_, name = best
    if not id_:
        return found
    shares, by_chance, left = told[name]
    alike = [
        one for one, (other, _) in shares.items() if one != id_ and other >= max(_AS_GOOD * share, by_chance.max())
    ]
    alike = sorted(alike, key=lambda one: -shares[one][0])[:_MOST_ALIKE]
    bench = found.benches[name]
    plain = replace(bench, pseudo_target=None, is_misfit=True)
    plain = plain.with_noise(NoiseModel(np.zeros(0), rms(left[bench.fitted])))
    return replace(
        found,
        benches={**found.benches, name: plain},
        named={id_: {name: shares[id_][1]}},
        rivals={id_: tuple(alike)},
        weights={id_: dict.fromkeys((id_, *alike), 1.0 / (1 + len(alike)))},
        misfit={**found.misfit, name: max(found.misfit[name], 2.0)},
        ahead={id_: 1.0},
        carried={id_: (share, by_chance)},
        doubted=frozenset({id_}),
    )


def leaves_far_less(carried: Search, found: Search) -> bool:
    """Whether what unseen rows bear out leaves half of what all names of a search do, or less, fitted or unseen.

    Names of other responses do not give way to what says nothing of these.
    """
    ((id_, (name,)),) = carried.named.items()
    bench, named = found.benches[name], numbers(found.named, name)
    left = bench.mean_square(named) / bench.mean_square([]), (unseen_rms(bench, named) / unseen_rms(bench, [])) ** 2
    is_alone = all(set(of) == {name} for of in found.named.values())
    return is_alone and 1.0 - carried.carried[id_][0] < _FAR_LESS * min(left)


def told_of_carried(effects: Sequence[NamedEffect], found: Search) -> tuple[Finding, ...]:
    """That unseen rows have chosen a name: what the error on them falls by is then no proof."""
    told = []
    for effect in effects:
        if effect.id in found.carried:
            share, by_chance = found.carried[effect.id]
            title = effect_of(effect.id).title
            text = (
                f"{title[0].upper()}{title[1:]} is named for what it explains of {effect.channel}: {100 * share:.0f} % "
                "of the mean square of fitted and unseen rows alike, where shapes at a wrong time explain "
                f"{100 * by_chance.max():.0f} % at most. So these rows have chosen it: the error on them is no proof."
            )
            evidence = {"share": share, "by_chance": float(by_chance.max())}
            told.append(FINDINGS.finding("chosen-by-unseen-rows", text, Where(channel=effect.channel), evidence))
    return tuple(told)


def _shares(bench: Bench, *, seed: int) -> tuple[dict[str, tuple[float, int]], Vector]:
    """Effect → share of fitted and of unseen rows alike that its best shape explains, and that shape.

    The last is the most that any shape at a wrong time does, shape (n_shifts,).
    """
    shapes = _Shapes(bench)
    best: dict[str, tuple[float, int]] = {}
    for v, share in zip(shapes.numbers, shapes.shares(np.arange(len(shapes.runs))), strict=True):
        id_ = bench.candidates[v].effect.id
        best[id_] = max(best.get(id_, (0.0, v)), (float(share), v))
    draw = np.random.default_rng(seed)
    by_chance = [float(np.max(shapes.shares(elsewhere(shapes.runs, draw)), initial=0.0)) for _ in range(_SHIFTS)]
    return best, np.array(by_chance)


class _Shapes:
    """All shapes of physics, and what is to be explained, of which any row can lie beside any row of the shapes."""

    def __init__(self, bench: Bench) -> None:
        some = slice(None, None, -(-len(bench.target) // _MOST_ROWS))
        self.runs = bench.runs[some]
        sizes = {v: len(one.variant.names) for v, one in enumerate(bench.candidates) if one.effect.family != "data"}
        parts = [self.runs == run for run in np.unique(self.runs)]

        def moves(columns: Matrix) -> bool:
            within = np.max([np.std(columns[of], axis=0) for of in parts], axis=0)
            return bool(np.any(within > _STANDS * np.std(columns, axis=0)))

        # what stands in every run is the same at any time
        self.numbers = [v for v, size in sizes.items() if size <= _WIDEST and moves(bench.raw(v)[some])]
        self._x = np.column_stack([np.empty((len(self.runs), 0)), *(bench.raw(v)[some] for v in self.numbers)])
        self._limits = np.vstack([np.empty((0, 2)), *(bench.bounds[bench.candidates[v].columns] for v in self.numbers)])
        widths = np.array([sizes[v] for v in self.numbers], dtype=np.intp)
        starts = np.cumsum(widths) - widths
        #: shapes of as many columns: which they are, their columns (n, size), and products of these (n_rows, n × size²)
        self._alike: list[tuple[NDArray[np.intp], NDArray[np.intp], Matrix]] = []
        for size in np.unique(widths).tolist():
            shapes = np.flatnonzero(widths == size)
            at = starts[shapes, None] + np.arange(size)
            products = (self._x[:, at, None] * self._x[:, at][:, :, None]).reshape(len(self._x), -1)
            self._alike.append((shapes, at, products))
        seen = np.isfinite(bench.target[some])
        fitted = bench.fitted[some]
        target = np.where(seen, bench.target[some], 0.0)
        own = bench.nuisance[some] @ np.linalg.pinv(np.linalg.qr(bench.nuisance[some][fitted])[1])
        left = target - own @ (own[fitted].T @ target[fitted])
        self._rows = np.column_stack([fitted, seen & ~fitted]).astype(np.float64)
        here, there = self._rows.T
        #: what recalibration is made of, and what it leaves, in fitted and in unseen rows
        self._of_fitted = np.column_stack([own, left]) * here[:, None]
        self._of_unseen = np.column_stack([own, left]) * there[:, None]
        self._own_unseen = self._of_unseen.T @ self._of_unseen
        self._before = float(here @ left**2)
        # as it was given, or recalibrated, whichever is nearer
        self._before_unseen = min(float(there @ left**2), float(there @ target**2))

    def shares(self, rows: NDArray[np.intp]) -> Vector:
        """Of every shape, the smaller of the shares of the fitted and of the unseen mean square that it explains.

        Row `rows`[k] of what is to be explained lies beside row k of the shapes.
        """
        here, there = self._x.T @ self._of_fitted[rows], self._x.T @ self._of_unseen[rows]
        own, with_left = self._own_unseen[:-1, :-1], self._own_unseen[:-1, -1]
        found = np.empty(len(self.numbers))
        for shapes, at, products in self._alike:
            gram, gram_unseen = (products.T @ self._rows[rows]).T.reshape(2, *at.shape, at.shape[1])
            z, aim = here[at, :-1], here[at, -1]
            across = z.swapaxes(1, 2)
            gram = gram - z @ across
            beta = (np.linalg.pinv(gram, rcond=1e-8, hermitian=True) @ aim[:, :, None])[:, :, 0]
            beta = np.clip(beta, self._limits[at, 0], self._limits[at, 1])
            cross = there[at, :-1] @ across
            gram_unseen = gram_unseen - cross - cross.swapaxes(1, 2) + z @ own @ across
            gained = 2.0 * np.sum(beta * (there[at, -1] - z @ with_left), axis=1)
            after = self._own_unseen[-1, -1] - gained + np.einsum("ki,kij,kj->k", beta, gram_unseen, beta)
            explained = (2.0 * np.sum(beta * aim, axis=1) - np.einsum("ki,kij,kj->k", beta, gram, beta)) / self._before
            found[shapes] = np.minimum(explained, 1.0 - after / self._before_unseen)
        return found
