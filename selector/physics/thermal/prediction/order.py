"""In which order do the operations of a duty cycle need the fewest corrections."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from selector.errors import InputError
from selector.physics.thermal.modes.cyclogram import Cyclogram
from selector.physics.thermal.prediction.correction_program import correction_program
from selector.types import Vector

#: Operations of which every order is tried; of more, two change places as long as that saves corrections.
MOST_TRIED_ALL = 6
_STEP_S = 60.0


@dataclass(frozen=True)
class BestOrder:
    """The order that needs the fewest corrections; the given one if none needs fewer."""

    operations: tuple[int, ...]  #: Numbers of the operations as they were given, from 1 on
    corrections: int  #: Corrections of all displacements together
    as_given: int  #: Those of the order that was given
    tried: int  #: Orders that were tried
    is_exact: bool  #: Whether they were all orders


def best_order(
    course: Callable[[Cyclogram, Vector], Vector],
    cyclogram: Cyclogram,
    operations_s: Sequence[float],
    tolerances_um: Mapping[int, float | Sequence[float]],
    resolution_s: float | None = None,
) -> BestOrder:
    """The order of operations whose correction programs are the shortest; of equal ones the nearest to the given one.

    Each operation keeps its length, its speeds and its tolerance; what comes after the last stays there, and the hall
    moves by the clock. `course` is duty cycle and times (n_times,) [s] → displacements (n_times, n_responses) [µm],
    `tolerances_um` the position of a response → its tolerance, one for all operations or one for each [µm].
    """
    count = len(operations_s)

    def needed(order: Sequence[int]) -> float:
        lengths = [operations_s[k] for k in order]
        changed = reordered(cyclogram, operations_s, order)
        time = np.union1d(np.arange(0.0, changed.end_s, _STEP_S), np.r_[changed.start_s, np.cumsum(lengths)])
        displacement = course(changed, time)
        total = 0
        for r, tolerance in tolerances_um.items():
            own = [tolerance[k] for k in order] if isinstance(tolerance, Sequence) else tolerance
            try:
                program = correction_program(time, displacement[:, r], lengths, own, resolution_s)
            except InputError:
                # too steep for the resolution in this order
                return np.inf
            total += sum(len(one.times_s) - 1 for one in program.operations)
        return total

    given = tuple(range(count))
    first = best = (needed(given), given)
    tried = 1
    is_exact = count <= MOST_TRIED_ALL
    while True:
        orders: Iterable[tuple[int, ...]] = itertools.permutations(given) if is_exact else _swapped(best[1])
        found = [(needed(order), order) for order in orders if order != best[1]]
        tried += len(found)
        least = min(found, key=lambda one: one[0], default=best)
        is_better = least[0] < best[0]
        best = least if is_better else best
        if is_exact or not is_better:
            break
    return BestOrder(tuple(k + 1 for k in best[1]), int(best[0]), int(first[0]), tried, is_exact)


def _swapped(order: tuple[int, ...]) -> Iterable[tuple[int, ...]]:
    for i, j in itertools.combinations(range(len(order)), 2):
        other = list(order)
        other[i], other[j] = order[j], order[i]
        yield tuple(other)


def reordered(cyclogram: Cyclogram, operations_s: Sequence[float], order: Sequence[int]) -> Cyclogram:
    """The duty cycle with its operations in another order; what comes after them stays there."""
    edges = np.r_[0.0, np.cumsum(operations_s)]
    pieces = [(edges[k], edges[k + 1]) for k in order]
    if edges[-1] < cyclogram.end_s * (1.0 - 1e-12):
        pieces.append((edges[-1], cyclogram.end_s))
    starts, speeds, now = [], [], 0.0
    for begin, end in pieces:
        changes = cyclogram.start_s[(cyclogram.start_s > begin) & (cyclogram.start_s < end)]
        at = np.r_[begin, changes]
        starts.append(now + at - begin)
        speeds.append(cyclogram.speed_at(at))
        now += end - begin
    return Cyclogram(np.concatenate(starts), np.concatenate(speeds), float(now))
