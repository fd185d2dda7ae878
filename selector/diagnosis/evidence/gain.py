"""What the improved model gains: errors on fitted and on held-out rows, beside the noise and beside placebos."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import Errors, Fit
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.moments import plain_fit
from selector.diagnosis.evidence.naming import noise_floor
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.matching.usable import rms
from selector.diagnosis.shapes.residual import least_squares
from selector.types import Vector

_DRAWS = 400
_FAR = 1.2  #: Times the noise: unseen errors from which on there is a way to go.


def fit_of(
    comparison: Comparison, bench: Bench, named: Sequence[int], *, recalibrate: bool, seed: int, is_noise: bool = True,
    most_noise: float = np.inf,
) -> Fit:  # fmt: skip
    """Errors of the simulation as given, recalibrated, and with the named candidates, in one response.

    `is_noise`: whether what is left in the fitted rows is no more than noise, which is `most_noise` at most. With
    `recalibrate` off and nothing named the improved model is the simulation as it was.
    """
    simulated, target = comparison.simulated[bench.response], bench.target
    recalibrated = recalibration(bench)
    explained = bench.explained(named) if named or recalibrate else np.zeros(len(target))
    held = bench.unseen
    before, middle, after = target, target - recalibrated, target - explained
    floor = float(np.fmin(_unseen_floor(comparison, bench, named, after[held], is_noise=is_noise), most_noise))
    return Fit(
        unit=comparison.channel(bench.response).unit,
        train=Errors(rms(before[bench.fitted]), rms(after[bench.fitted])),
        heldout=Errors(rms(before[held]), rms(after[held]), floor),
        recalibrated_heldout=rms(middle[held]),
        gap_closed=_gap(bench, middle, after, floor, held, seed) if named else None,
        placebo_gain=_placebo(comparison, bench, named, middle, floor, held, seed) if named else None,
        before=np.asarray(simulated),
        recalibrated=np.asarray(simulated + recalibrated),
        after=np.asarray(simulated + explained),
    )


def gap_closed(
    comparison: Comparison, bench: Bench, named: Sequence[int], *, seed: int, is_noise: bool
) -> Quantity | None:
    """Share of the way from the recalibrated unseen error to the noise that the named candidates go, with its interval.

    None where the way is short, as noise may differ by as much from one run to another, or too few rows are unseen.
    """
    held = bench.unseen
    middle, after = bench.target - recalibration(bench), bench.target - bench.explained(named)
    floor = _unseen_floor(comparison, bench, named, after[held], is_noise=is_noise)
    return _gap(bench, middle, after, floor, held, seed) if rms(middle[held]) > _FAR * floor else None


def _unseen_floor(comparison: Comparison, bench: Bench, named: Sequence[int], left: Vector, *, is_noise: bool) -> float:
    """The noise floor; an unseen error below it would be a sign of a wrong one."""
    return float(np.nanmin([noise_floor(comparison, bench, named, is_noise=is_noise), rms(left)]))


def recalibration(bench: Bench) -> Vector:
    """What offset, gain and delay alone explain, by plain least squares [unit], all rows."""
    before_own = min((part.start for part in bench.own.values()), default=None)
    plain = bench.nuisance[:, :before_own]
    return np.asarray(plain @ least_squares(plain[bench.fitted], bench.target[bench.fitted]))


def _gap(
    bench: Bench, middle: Vector, after: Vector, floor: float, held: NDArray[np.bool_], seed: int
) -> Quantity | None:
    """Share of the held-out mean square above the noise that is gone, with a block bootstrap interval."""
    rows = np.flatnonzero(held)
    if len(rows) < 20:
        return None
    size = int(max(4.0 * bench.noise.correlation_samples, len(rows) / 20.0, 5.0))
    return share_closed([rows[k : k + size] for k in range(0, len(rows), size)], middle, after, floor, seed)


def share_closed(
    blocks: Sequence[NDArray[np.intp]], before: Vector, after: Vector, noise_floor: float, seed: int
) -> Quantity | None:
    """Share of the way from one error to the noise floor that was gone by another one, with a bootstrap interval."""
    squares = np.array([[np.sum(before[block] ** 2), np.sum(after[block] ** 2), len(block)] for block in blocks])
    picks = np.random.default_rng(seed).integers(len(blocks), size=(_DRAWS, len(blocks)))
    drawn = squares[picks].sum(axis=1)
    shares = [share for share in (_closed(sums, noise_floor) for sums in drawn) if share is not None]
    value = _closed(squares.sum(axis=0), noise_floor)
    if value is None or not shares:
        return None
    return Quantity(value, "1", float(np.quantile(shares, 0.025)), float(np.quantile(shares, 0.975)))


def _closed(sums: Vector, floor: float) -> float | None:
    middle, after, n = (float(value) for value in sums)
    gap = float(np.sqrt(middle / n)) - floor
    return (float(np.sqrt(middle / n)) - float(np.sqrt(after / n))) / gap if gap > 0.02 * floor else None


def _placebo(
    comparison: Comparison, bench: Bench, named: Sequence[int], middle: Vector, floor: float,
    held: NDArray[np.bool_], seed: int,
) -> Quantity | None:  # fmt: skip
    """Share of the gap that the same columns close when they are shifted in time, several shifts of every run.

    Median and range of the shifts: one that hardly shows where it is fitted may do any harm elsewhere.
    """
    gap = rms(middle[held]) - floor
    if gap <= 0.02 * floor or not held.any():
        return None
    generator = np.random.default_rng(seed)
    gains = []
    own = bench.nuisance.shape[1]
    for _ in range(8):
        base = np.array(bench.raw_base(named))
        for _, rows in comparison.rows_of_runs():
            n = rows.stop - rows.start
            by = int(generator.integers(n // 4, max(3 * n // 4, n // 4 + 1)))
            base[rows, own:] = np.roll(base[rows, own:], by, axis=0)
        beta = plain_fit(base[bench.fitted], bench.target[bench.fitted], own, [bench.counts[v] for v in named])
        gains.append((rms(middle[held]) - rms((bench.target - base @ beta)[held])) / gap)
    low, value, high = (float(share) for share in np.quantile(gains, (0.025, 0.5, 0.975)))
    return Quantity(value, "1", low, high)
