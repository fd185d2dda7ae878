"""Which effects are supported: forward, one by one, all tested again after each, so that proxies fall."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from selector.diagnosis.bench import Bench
from selector.diagnosis.testing import Tested, tail_probability, tests_of

Vector = NDArray[np.float64]
Benches = Mapping[str, Bench]
Named = dict[str, dict[str, int]]
"""Effect id → response → number of the candidate."""
_SHOWS = 0.05
"""A response shows a supported effect if noise alone would show it there as clearly in fewer than this share."""
_MOST = 5


@dataclass(frozen=True, eq=False)
class Standing:
    """How one effect stands in all responses together, beside what is named already."""

    id: str
    p_value: float
    cv_gain: float
    run_gain: float | None
    responses: tuple[str, ...]
    tested: Mapping[str, Tested]

    def block_gains(self, benches: Benches) -> Vector:
        """Cross-validated gain block by block, responses behind each other."""
        return np.concatenate([
            self.tested[name].block_gains if name in self.responses else np.zeros(len(bench.blocks))
            for name, bench in benches.items()
        ])  # fmt: skip


@dataclass(frozen=True, eq=False)
class Search:
    """Where the search ended.

    Attributes
    ----------
    benches : mapping of str to Bench
        With the noise filter of the last fit.
    named : dict
        Effect id → response → number of the candidate, in the order in which they were found.
    standing : mapping of str to Standing
        Of a named effect, how it stood beside the other named ones; of the others, beside all named ones.
    rivals : mapping of str to tuple of str
        Named effect → effects that explain what it explains about as well.
    """

    benches: Benches
    named: Named
    standing: Mapping[str, Standing]
    rivals: Mapping[str, tuple[str, ...]]


def numbers(named: Named, response: str) -> list[int]:
    """Candidates of a response among those named."""
    return [by_response[response] for by_response in named.values() if response in by_response]


def without(named: Named, id: str) -> Named:  # noqa: A002 - the word of the contract
    """All but one effect."""
    return {name: dict(of) for name, of in named.items() if name != id}


def standings(benches: Benches, named: Named, noise: Mapping[str, Vector], *, seed: int) -> dict[str, Standing]:
    """Every effect that is not named, beside those that are."""
    tested = {
        name: tests_of(bench, numbers(named, name), noise[name], seed=seed + 7919 * k)
        for k, (name, bench) in enumerate(benches.items())
    }
    ids = dict.fromkeys(id for of in tested.values() for id in of)
    return {
        id: _standing(id, {name: of[id] for name, of in tested.items() if id in of}) for id in ids if id not in named
    }


def _standing(id: str, tested: Mapping[str, Tested]) -> Standing:  # noqa: A002 - the word of the contract
    single = {name: one.p_value for name, one in tested.items()}
    together = tail_probability(
        sum(one.gain for one in tested.values()), np.sum([one.noise for one in tested.values()], axis=0)
    )
    p_value = (
        min(*single.values(), together) * (2.0 if len(single) > 1 else 1.0) if len(single) > 1 else min(single.values())
    )
    shown = tuple(name for name, p in single.items() if p <= _SHOWS and tested[name].cv_gain > 0.0)
    shown = shown or (min(single, key=lambda name: single[name]),)
    run_gains = [tested[name].run_gain for name in shown]
    return Standing(
        id=id,
        p_value=min(1.0, p_value),
        cv_gain=sum(tested[name].cv_gain for name in shown),
        run_gain=None
        if any(gain is None for gain in run_gains)
        else sum(gain for gain in run_gains if gain is not None),
        responses=shown,
        tested=tested,
    )


def search(benches: Benches, *, false_alarm: float, seed: int, rounds: int = 3) -> Search:
    """Effects that the residuals support with family-wise `false_alarm`, noise and effects estimated in turn.

    The first noise model holds all that is missing, so it is too large and too slow: nothing false is named with it.
    What is found with it sharpens the next one.
    """
    named: Named = {}
    for turn in range(rounds):
        loose = _selected(benches, _residual_noise(benches, named), false_alarm=max(0.1, false_alarm), seed=seed)
        benches = {name: bench.refitted_noise(numbers(loose, name)) for name, bench in benches.items()}
        if turn and loose == named:
            break
        named = loose
    noise = _residual_noise(benches, named)
    named = _selected(benches, noise, false_alarm=false_alarm, seed=seed)
    return _told(benches, named, noise, seed=seed)


def _residual_noise(benches: Benches, named: Named) -> dict[str, Vector]:
    """Whitened residual beside the named candidates, per response, made as large as it was before the fit."""
    found = {}
    for name, bench in benches.items():
        base = bench.base(numbers(named, name))
        left = bench.white_target - base @ np.linalg.lstsq(base, bench.white_target, rcond=None)[0]
        found[name] = left * np.sqrt(len(left) / max(len(left) - base.shape[1], 1))
    return found


def _selected(benches: Benches, noise: Mapping[str, Vector], *, false_alarm: float, seed: int) -> Named:
    named: Named = {}
    for _ in range(_MOST):
        standing = standings(benches, named, noise, seed=seed)
        live = len(standing) + len(named)
        supported = [one for one in standing.values() if is_supported(one, false_alarm / max(live, 1))]
        if not supported:
            break
        best = max(supported, key=lambda one: one.cv_gain)
        named[best.id] = {name: best.tested[name].best for name in best.responses}
        named = _retested(benches, named, noise, false_alarm=false_alarm / max(live, 1), seed=seed)
        if best.id not in named:
            break
    return named


def is_supported(one: Standing, level: float) -> bool:
    """Beyond what noise does, on rows that were not fitted, and in runs that were not."""
    return one.p_value <= level and one.cv_gain > 4.0 and (one.run_gain is None or one.run_gain > 0.0)


def _retested(benches: Benches, named: Named, noise: Mapping[str, Vector], *, false_alarm: float, seed: int) -> Named:
    """Every named effect tested beside the others: shapes chosen anew, proxies exchanged for what is better."""
    for name in list(named):
        if len(named) < 2:
            break
        others = without(named, name)
        standing = standings(benches, others, noise, seed=seed)
        best = max(standing.values(), key=lambda one: one.cv_gain if is_supported(one, false_alarm) else -np.inf)
        if not is_supported(best, false_alarm):
            named = others
            continue
        own = standing[name]
        chosen = own if is_supported(own, false_alarm) and own.cv_gain > best.cv_gain - 2.0 else best
        named = others | {chosen.id: {key: chosen.tested[key].best for key in chosen.responses}}
    return named


def _told(benches: Benches, named: Named, noise: Mapping[str, Vector], *, seed: int) -> Search:
    standing = standings(benches, named, noise, seed=seed)
    rivals: dict[str, tuple[str, ...]] = {}
    for name in named:
        beside = standings(benches, without(named, name), noise, seed=seed)
        standing[name] = beside[name]
        rivals[name] = _rivals(benches, beside, name)
    return Search(benches, named, standing, rivals)


def _rivals(benches: Benches, beside: Mapping[str, Standing], id: str) -> tuple[str, ...]:  # noqa: A002
    """Effects whose cross-validated gain is not clearly below that of `id`, largest first."""
    own = beside[id].block_gains(benches)
    found = []
    for other, one in beside.items():
        if other == id or one.p_value > 1e-3 or one.cv_gain <= 0.0:
            continue
        difference = own - one.block_gains(benches)
        spread = float(np.sqrt((difference**2).sum()))
        if difference.sum() <= stats.norm.ppf(0.9) * spread and one.cv_gain > 0.8 * beside[id].cv_gain:
            found.append((one.cv_gain, other))
    return tuple(name for _, name in sorted(found, reverse=True))
