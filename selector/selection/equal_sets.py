"""Every set of sensors that is about as good as the best of its size: for whoever has to mount them."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from selector.models.moments import WORTH_OF_A_SENSOR, LeaveOneOut
from selector.selection.choice import unit_um
from selector.selection.library import Bench, Shape
from selector.selection.options import Question
from selector.types import Array, Indices, Mask

MOST_SETS = 500_000  #: Sets that are looked at, one by one; a second for 37 sensors by four, six for more.
MOST_LISTED = 500
CHUNK = 20_000
ROUNDING = 1e-6


@dataclass(frozen=True)
class EqualSet:
    """A set of sensors with its coefficients refitted without each run."""

    sensors: tuple[str, ...]
    heldout_rmse_um: tuple[float, ...]  #: One per response
    largest_vif: float
    #: Largest share of a displacement's spread that one sensor moves when it is wrong by its own spread
    worst_fault: float


@dataclass(frozen=True)
class EqualSets:
    """The sets of one size whose errors on unseen parts are all within a margin of the best one's, the best first."""

    sets: tuple[EqualSet, ...]
    n_equal: int  #: Sets within the margin; only the best `MOST_LISTED` of them are in `sets`
    n_compared: int  #: All sets of this size that there are
    within_um: float | None  #: Margin for every response [µm]; None = a share of the error, `WORTH_OF_A_SENSOR`

    def as_dict(self, responses: Sequence[str]) -> dict[str, Any]:
        """JSON form."""
        sets = [
            {**vars(one), "heldout_rmse_um": dict(zip(responses, one.heldout_rmse_um, strict=True))}
            for one in self.sets
        ]
        return {**vars(self), "sets": sets}


def equal_sets(
    question: Question, bench_of: Callable[[Shape], Bench], known: tuple[str, ...], shape: Shape
) -> EqualSets | None:
    """All sets as large as a known one that are about as good as the best; None where they are too many to look at.

    For every response, and the best in the units in which sets are chosen (`unit_um`). `bench_of` a shape holds the
    terms of all sensors. Nothing is missed: to leave a part out never lowers its error, so a set that errs more than
    the margin allows where it was fitted needs no second look.
    """
    sensors, must, size = question.sensors, question.options.must, len(known)
    others = [name for name in sensors if name not in must]
    n_sets = math.comb(len(others), max(size - len(must), 0))
    if n_sets > MOST_SETS or size < len(must):
        return None
    bench = bench_of(shape)
    brought = [bench.library.columns((name,), shape) for name in sensors]
    shared = set(bench.library.columns((), shape))
    own = np.array([[column for column in columns if column not in shared] for columns in brought])
    always = np.array(sorted(shared), dtype=np.int64)
    apart, n_responses = bench.leave_one_out, len(question.responses)
    total, n = apart.total, apart.left_out(0, 0).sum()
    # what is predicted is in the training, too
    in_sample = LeaveOneOut(total, ((0,),), 2.0 * total, apart.n_columns)
    margin, best = question.options.within, bench.held_out(known, shape).rmse_um ** 2
    power = unit_um(question, np.sqrt(best), np.sqrt(bench.power)) ** 2

    def is_equal(errors: Array, best: Array) -> Mask:
        """Whether a set errs about as little in every response; what rounding leaves of exact fits is alike."""
        best = np.maximum(best, ROUNDING**2 * bench.power)
        most = (1.0 + WORTH_OF_A_SENSOR) ** 2 * best if margin is None else (np.sqrt(best) + margin) ** 2
        return np.asarray((errors <= most).all(axis=1))

    near: list[tuple[Indices, Array]] = [(np.empty((0, size), dtype=np.int64), np.empty((0, n_responses)))]
    for chosen in _chunks(sensors, must, others, size):
        at = np.concatenate([own[chosen].reshape(len(chosen), -1), np.tile(always, (len(chosen), 1))], axis=1)
        seen = in_sample.errors_of(at, n_responses)[0] / total[0, 0, 0] * (1.0 - ROUNDING)
        # all that a better one may leave of a response, if it leaves nothing of the others
        promising = is_equal(seen, (best / power).sum() * power)
        at, chosen = at[promising], chosen[promising]
        if len(chosen):
            unseen = apart.errors_of(at, n_responses).sum(axis=0) / n
            near.append((chosen, unseen))
            best = min(unseen[(unseen / power).sum(axis=1).argmin()], best, key=lambda one: float((one / power).sum()))
    chosen, unseen = (np.concatenate(part) for part in zip(*near, strict=True))
    good = is_equal(unseen, best)
    chosen, unseen = chosen[good], unseen[good]
    order = np.argsort((unseen / power).mean(axis=1), kind="stable")[:MOST_LISTED]
    found = []
    for names, error in zip(chosen[order], unseen[order], strict=True):
        of_set = tuple(sensors[i] for i in sorted(names))
        fault, vif = bench.faults(of_set, shape)[0], bench.largest_vif(of_set, shape)
        found.append(EqualSet(of_set, tuple(map(float, np.sqrt(error))), vif, fault))
    return EqualSets(tuple(found), len(chosen), n_sets, margin)


def _chunks(sensors: Sequence[str], must: Sequence[str], others: Sequence[str], size: int) -> Iterator[Indices]:
    """Positions of the sensors of all sets of a size, (n_sets, size) at a time."""
    position = {name: i for i, name in enumerate(sensors)}
    fixed = [position[name] for name in must]
    sets = itertools.combinations([position[name] for name in others], size - len(must))
    while some := list(itertools.islice(sets, CHUNK)):
        yield np.array([[*fixed, *one] for one in some], dtype=np.int64)
