"""Does a name stand beside a misfit that is nobody's? Its evidence with a smooth function of the state beside it.

A simulation that is a little wrong in a way that no effect describes is off by a function of its own state: of where a
response is, and of how it got there. Where such a misfit has the size of the noise it leaves nothing that would show by
itself, and the nearest shape of the catalogue passes for an effect. So that function is a rival of every name: a random
one with a Gaussian prior (M. C. Kennedy, A. O'Hagan, Bayesian calibration of computer models, JRSS B 63, 2001), made of
waves over the simulated response and its memories (A. Rahimi, B. Recht, NIPS 20, 2007), of unknown size. As likely as
how a response has moved of late counts where it was: of what vibrates the one says nothing of a slow memory.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
from scipy.special import logsumexp

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.evidence.search import MOST_OF_IT, Search, numbers, unseen_rms, without
from selector.diagnosis.evidence.testing import members_of, prices_of
from selector.diagnosis.shapes.residual import least_squares, off
from selector.diagnosis.shapes.signals import lagged
from selector.types import Matrix

_Misfits = tuple[Matrix, ...]  #: Random functions of each kind of state.
_WAVES = 96
_MEMORIES = (0.01, 0.05, 0.25)  #: Time constants of what the misfit remembers, in parts of the longest run.
#: The same beside effects of heat: a misfit that remembers for long is what `thermal.memory` means.
_BRIEFLY = _MEMORIES[:1]
_WHERE_IT_WAS = 2  #: Of the memories, the briefest, that are a state by themselves.
_LENGTHS = 0.7  #: Half the logarithm by which the lengths of the waves differ, in standard deviations of the state.
#: Root mean square of the misfit in parts of that of the mismatch; as likely as not there is none.
_SIZES = np.geomspace(1e-3, 2.0, 14)
_KEPT = 0.4  #: Of its evidence: a name that keeps less says little more than that something is wrong.
_KEPT_BESIDE = 0.8  #: The same where another name was no more than that.
#: Logarithm of how much likelier a name makes the record, a misfit beside it, from which it stands whatever share it
#: keeps, if a response needs no misfit beside it: what is a function of the state, as memory is, keeps little of much.
_DECISIVE = 20.0
#: Mean square of unseen rows that a name leaves at most to be no guess, and weights of the prior of a misfit that is
#: fitted to the others, in parts of its largest singular value's square.
_CARRIED, _WEIGHTS = 0.75, np.geomspace(1e-6, 1.0, 7)
#: Size of the likeliest misfit beside a name, in parts of the mismatch, from which something else is wrong, too.
_LEFT = 0.1


def beside_discrepancy(comparison: Comparison, found: Search) -> Search:
    """The search without names that a misfit of nobody's makes as likely; the least clear first, others in doubt.

    Where more is left than noise that is known already: there physics has borne other marks, and is doubted only. In
    the responses of a name that is gone something is wrong that is no effect: there the others have to keep more.
    """

    @cache
    def waves(memories: Sequence[float]) -> dict[str, _Misfits]:
        return {name: waves_of(comparison, name, memories) for name in comparison.responses}

    while True:
        kept = {
            id_: _kept(found, id_, waves(_BRIEFLY if id_.startswith("thermal.") else _MEMORIES))
            for id_ in found.named
            if id_ != "data.stuck"
        }
        short = {
            id_: share - (_KEPT_BESIDE if found.wrong & set(found.named[id_]) else _KEPT)
            for id_, (share, _) in kept.items()
            if id_.startswith("data.") or all(found.misfit[name] == 1.0 for name in found.named[id_])
        }
        if min(short.values(), default=0.0) >= 0.0:
            doubted = {id_ for id_, (share, size) in kept.items() if share < _KEPT or size >= _LEFT}
            return replace(found, doubted=frozenset(doubted))
        least = min(short, key=lambda id_: short[id_])
        wrong = found.wrong | set(found.named[least])
        found = replace(found.only(set(found.named) - {least}), wrong=wrong)


def waves_of(comparison: Comparison, response: str, memories: Sequence[float] = _MEMORIES) -> _Misfits:
    """Waves over where a response is and how it moved of late; of a longer memory also over where it is and was."""
    course = comparison.simulated_course(response)
    was = [lagged(comparison, course, part * comparison.longest_s, settled=True) for part in memories]
    moved = np.column_stack([course, *(course - one for one in was)])
    kinds = (moved,) if len(was) < _WHERE_IT_WAS else (moved, np.column_stack([course, *was[:_WHERE_IT_WAS]]))
    return tuple(_waves(state) for state in kinds)


def _waves(state: Matrix) -> Matrix:
    """(n_rows, n_waves): Waves of random direction, length and phase over a state."""
    spread = state.std(axis=0)
    moving = spread > 1e-9 * spread.max(initial=1e-300)
    state = (state - state.mean(axis=0))[:, moving] / spread[moving]
    draw = np.random.default_rng(_WAVES)
    steepness = np.exp(draw.uniform(-_LENGTHS, _LENGTHS, _WAVES))
    directions = draw.normal(size=(state.shape[1], _WAVES)) * steepness
    return np.asarray(np.sqrt(2.0) * np.cos(state @ directions + draw.uniform(0.0, 2.0 * np.pi, _WAVES)))


def _kept(found: Search, id_: str, waves: dict[str, _Misfits]) -> tuple[float, float]:
    """Share of a name's evidence that is left with a misfit beside it, and how large that is where it is smallest.

    What explains much of unseen rows, too, and no less than a misfit that is fitted to the others, is no guess among
    shapes of the noise's size: it keeps all. So does a fault that explains most of the mismatch, and what is decisive
    beside a misfit, where none is known.
    """
    others, of = without(found.named, id_), found.named[id_]
    is_sure = all(_is_carried(found.benches[name], numbers(others, name), v, waves[name]) for name, v in of.items())
    if id_.startswith("data."):
        is_sure |= any(found.benches[name].share(numbers(others, name), v) >= MOST_OF_IT for name, v in of.items())
    if is_sure:
        return 1.0, 0.0
    told = np.array([_evidence(found.benches[name], numbers(others, name), id_, waves[name]) for name in of])
    alone, beside, size = told[:, 0].sum(), told[:, 1].sum(), float(told[:, 2].min())
    is_known = any(found.misfit[name] > 1.0 for name in of)
    if alone <= 0.0 or (beside >= _DECISIVE and size < _LEFT and not is_known):
        return 1.0, size
    return float(beside / alone), size


def _is_carried(bench: Bench, others: Sequence[int], v: int, waves: _Misfits) -> bool:
    """Whether a name explains a quarter of unseen rows, and as much as a misfit of the size that is best there."""
    left, fitted, held = bench.residual(others), bench.fitted, bench.unseen
    after = unseen_rms(bench, [*others, v]) ** 2
    if not held.any() or after > _CARRIED * unseen_rms(bench, others) ** 2:
        return False
    for one in waves:
        own, values, directions = np.linalg.svd(one[fitted], full_matrices=False)
        along, unseen = own.T @ left[fitted], one[held] @ directions.T
        misfits = (unseen @ (along * values / (values**2 + weight)) for weight in _WEIGHTS * values[0] ** 2)
        if after > min(float(np.mean((left[held] - misfit) ** 2)) for misfit in misfits):
            return False
    return True


def _evidence(bench: Bench, others: Sequence[int], id_: str, waves: _Misfits) -> tuple[float, float, float]:
    """Logarithm of how much more likely a name makes the record, without a misfit and with one beside it.

    The last is the likeliest size of the misfit beside the name, in parts of the mismatch.
    """
    rest = partial(off, np.linalg.qr(bench.base(others))[0])
    target, own = rest(bench.white_target), members_of(bench)[id_]
    prices = prices_of(bench)[own]
    columns = [rest(bench.white_columns[:, bench.candidates[v].columns]) for v in own]
    powers = (_SIZES * np.sqrt(bench.mean_square(others) / _WAVES)) ** 2
    without_it, with_it = [], []
    for number, misfit in enumerate(waves):
        left, values, _ = np.linalg.svd(rest(bench.behind_filter(misfit)), full_matrices=False)
        inside = [left.T @ one for one in columns]
        of_target = left.T @ target
        # none at all is the same of each
        for power in powers if number else (0.0, *powers):
            more = power * values**2
            shrunk = more / (1.0 + more)
            without_it.append(0.5 * np.sum(shrunk * of_target**2) - 0.5 * np.sum(np.log1p(more)))
            gains = []
            for one, part in zip(columns, inside, strict=True):
                score = one.T @ target - part.T @ (shrunk * of_target)
                gains.append(float(score @ least_squares(one.T @ one - part.T @ (shrunk[:, None] * part), score)))
            with_it.append(without_it[-1] + logsumexp(0.5 * (np.array(gains) - prices)) - np.log(len(gains)))
    sizes = np.r_[0.0, np.tile(_SIZES, len(waves))]
    odds = np.log(np.where(sizes > 0.0, 0.5 / (len(sizes) - 1), 0.5))
    likeliest = float(sizes[int(np.argmax(with_it + odds))])
    return with_it[0] - without_it[0], float(logsumexp(with_it + odds) - logsumexp(without_it + odds)), likeliest
