"""Whether named effects hold on rows that they were not fitted to, what they gain there, and which faults are new."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import Errors, Fit, NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Quantity
from selector.diagnosis.evidence.moments import plain_fit
from selector.diagnosis.evidence.naming import is_structured, named_effect, noise_floor, part_of
from selector.diagnosis.evidence.response import Bench, bench_of
from selector.diagnosis.evidence.search import (
    MOST_OF_IT,
    TENTH,
    Search,
    is_slow_in_one_run,
    numbers,
    search,
    unseen_rms,
    without,
)
from selector.diagnosis.evidence.size import is_like_parameters
from selector.diagnosis.matching.usable import rms
from selector.diagnosis.mismatch.omnibus import Structure, of_whole_record
from selector.diagnosis.shapes.residual import least_squares
from selector.types import Matrix, Vector

#: Whitened sum of squares of an effect's course in the held-out rows below which nothing is said by no gain there.
#:
#: A true effect gains about that much, with a standard deviation of twice its root. A loss of as much refutes whatever
#: the course: there what is left grows by what was taken for the effect.
_SEEN = 10.0
_SURELY_SEEN = 1e-3  #: Probability of chance below which what unseen rows refute is something all the same.
_OFF, _SURELY = 0.25, 3.0  #: Part by which sizes differ that are another, and standard errors by which they are surely.
HARM = 1.05  #: Times the unseen error: names that leave more are no help there.
TRIFLE = 0.02  #: Of what the largest effect explains; of the mismatch, for a fault that unseen rows do not bear out.
LEAST = 0.005  #: Of the mismatch: what is smaller is not named unless held-out rows bear it out.
SUSPECTED = 0.5  #: What is left of a confidence that another programme does not bear out.
_BORNE_OUT = 0.75  #: Mean square of unseen rows that a name leaves, in parts of that without it.
_PART = 0.6  #: Of what an effect gains.
_MOST_OF_GAP = 0.7  #: On unseen rows.
#: Of the unseen gap between recalibration and noise: names that close less of it, and surely less, are not what is
#: missing if structure is left beside them.
_LEAST_CLOSED, _SURELY_LESS = 0.15, 0.5
_QUARTER = 0.25  #: Of the mismatch.
_CANCELS = 3.0  #: Times the mismatch as it is given. Right names on real recordings are at most 2.1 times as large.
_THE_SAME, _AS_LITTLE = 1.0 - 1e-6, 1.0 + 1e-6  #: Canonical correlation of courses that fitted rows cannot tell; error.
_NEARLY_ALL = 0.9  #: Of what the best shape explains.
_RUINED = 1.5  #: Times the held-out error without an effect from which on it is another thing that was taken for it.


@dataclass(frozen=True)
class Confirmation:
    """How a named effect, fitted elsewhere, stands on the held-out rows."""

    gain: float  #: Fall of the whitened sum of squares
    energy: float  #: Whitened sum of squares of its course there
    fitted_energy: float  #: The same in the rows that it was fitted to

    @property
    def refutes(self) -> bool:
        """Whether it ought to gain there and does not, or is of another size there."""
        return self.gain < -_SEEN or (self.gain <= 0.0 and self.energy > _SEEN) or self.is_of_another_size

    @property
    def bears_out(self) -> bool:
        """Whether it gains there more than chance, and most of what it ought to."""
        return self.gain > max(_SEEN, _PART * self.energy)

    @property
    def is_of_another_size(self) -> bool:
        """Whether its size on the held-out rows is surely and clearly another than on those that it was fitted to."""
        if not (self.energy > 0.0 and self.fitted_energy > 0.0):
            return False
        off = 0.5 * (self.gain + self.energy) / self.energy - 1.0
        error = float(np.sqrt(1.0 / self.energy + 1.0 / self.fitted_energy))
        return abs(off) > max(_OFF, _SURELY * error)


def confirmation(found: Search, id: str) -> Confirmation:  # noqa: A002 - the contract's word
    """Held-out rows without and with an effect, both models fitted to the other rows, all its responses together."""
    gain = energy = fitted_energy = 0.0
    for response, v in found.named[id].items():
        bench = found.benches[response]
        named = numbers(found.named, response)
        without = bench.white(bench.residual([other for other in named if other != v]))
        with_it = bench.white(bench.residual(named))
        course = (with_it - without) ** 2
        energy += float(np.sum(course[bench.unseen]))
        fitted_energy += float(np.sum(course[bench.fitted]))
        gain += float(np.sum(without[bench.unseen] ** 2) - np.sum(with_it[bench.unseen] ** 2))
    return Confirmation(gain, energy, fitted_energy)


def confirmed(comparison: Comparison, found: Search, id_: str) -> NamedEffect:
    """The named effect; suspected only, where it ought to show on held-out rows and gains nothing there.

    A frozen reading is proved by its equal readings.
    """
    told = confirmation(found, id_)
    effect = named_effect(comparison, found, id_, is_borne_out=told.bears_out)
    left = left_unseen(effect, found)
    falls_short = told.gain < _PART * told.energy
    is_lost = effect.acts is None and left >= 1.0 and (effect.share < LEAST or falls_short)
    is_refuted = is_lost or (told.refutes and left > _BORNE_OUT)
    return doubted(effect) if is_refuted and id_ != "data.stuck" else effect


def doubted(effect: NamedEffect) -> NamedEffect:
    """The effect as suspected only."""
    return effect if effect.suspected else replace(effect, suspected=True, confidence=SUSPECTED * effect.confidence)


def surely_refuted(comparison: Comparison, found: Search) -> list[Structure]:
    """What fitted rows surely have beside noise, and another run does not have as the effect that comes nearest."""
    surely = []
    for id_, of in found.named.items() if len(comparison.runs) > 1 else ():
        standing = found.standing[id_]
        is_sure = standing.p_value < _SURELY_SEEN and all(found.misfit[name] == 1.0 for name in of)
        if is_sure and confirmation(found, id_).refutes:
            bench = found.benches[standing.main]
            fall = bench.mean_square([]) - bench.mean_square(numbers(found.named, standing.main))
            size = float(np.sqrt(max(fall, 0.0)))
            surely.append(of_whole_record("refuted", comparison, standing.main, size, standing.p_value))
    return surely


def worth_naming(comparison: Comparison, found: Search) -> Search:
    """Without effects that are a trifle beside the largest, or beside the mismatch if unseen rows do not bear them out.

    In noise that wanders the mean square hardly falls by what is quick and sure: how large its course is counts, too.
    """
    named = {id_: named_effect(comparison, found, id_) for id_ in found.named}
    least = TRIFLE * max((effect.share for effect in named.values()), default=0.0)
    sizes = {id_: max(effect.share, part_of(found, effect)) for id_, effect in named.items()}
    worth = {id_ for id_, size in sizes.items() if size >= least}
    return found.only({id_ for id_ in worth if sizes[id_] >= LEAST or not confirmation(found, id_).refutes})


def only_cancels(effect: NamedEffect, found: Search) -> bool:
    """Whether an effect is far larger than the mismatch: it makes up for a gain or an offset that goes with it.

    What surely closes most of the gap on unseen rows does more: a lag takes the place of the simulated course.
    """
    gap = found.closed.get(effect.id)
    if gap is not None and gap.low is not None and gap.low > _MOST_OF_GAP:
        return False
    bench = found.benches[effect.channel]
    course = effect.courses[effect.channel][bench.fitted]
    return not effect.id.startswith("data.") and float(np.std(course)) > _CANCELS * rms(bench.target[bench.fitted])


def carries_little(comparison: Comparison, found: Search, effect: NamedEffect, *, is_doubted: bool) -> bool:
    """Whether a name carries little to unseen rows, is little and unsure, or a slow fault in an only run.

    What wrong parameters do as well has to make unseen rows better by most of what it explains of the fitted ones,
    unless that is a quarter of them: beside noise both are little.
    """
    if effect.id == "data.stuck":
        return False
    named = found.named.get(effect.id, {}).items()
    is_part = is_doubted and effect.share < TENTH and effect.acts is None and effect.confidence <= SUSPECTED
    if is_part or any(is_slow_in_one_run(found.benches[name], v) for name, v in named):
        return True
    gap = found.closed.get(effect.id)
    if effect.share >= MOST_OF_IT or effect.id not in found.named:
        return False
    least = min(TRIFLE, _PART * effect.share)
    is_idle = effect.share < _QUARTER and left_unseen(effect, found) >= 1.0 - least
    if is_idle and is_like_parameters(comparison, found, effect):
        return True
    if gap is None or gap.high is None:
        # where unseen rows leave no gap to be closed they have to be no worse
        return is_structured(found, effect.channel) and effect.share < TENTH and left_unseen(effect, found) >= 1.0
    return gap.value < _LEAST_CLOSED and gap.high < (_SURELY_LESS if is_doubted else 0.0)


def left_unseen(effect: NamedEffect, found: Search, response: str | None = None) -> float:
    """Mean square that an effect leaves of unseen rows of a response, its main one, in parts of that without it."""
    name = response or effect.channel
    bench, named, own = found.benches[name], numbers(found.named, name), found.named[effect.id]
    before = unseen_rms(bench, [v for v in named if v != own[name]])
    return (unseen_rms(bench, named) / max(before, 1e-300)) ** 2


def only_where_carried(effect: NamedEffect, found: Search) -> NamedEffect:
    """Physics only in its main response and where unseen rows gain by it; a fault may be one of the fitted runs."""
    lost = set[str]()
    for name in () if effect.id.startswith("data.") else effect.courses:
        unseen = found.benches[name].unseen
        if name != effect.channel and unseen.any():
            is_there = bool(np.any(effect.courses[name][unseen]))
            lost |= set() if is_there and left_unseen(effect, found, name) < 1.0 else {name}
    if not lost:
        return effect
    courses = {name: course for name, course in effect.courses.items() if name not in lost}
    return replace(effect, courses=courses, channels=tuple(name for name in effect.channels if name not in lost))


def as_unseen_rows_have_it(found: Search) -> Search:
    """The search with those places of effects that the unseen rows bear out best, of some that fitted rows cannot tell.

    A fault that began in the last fitted run may have ended with it, or have gone on; what one of two runs has is, with
    the other sign, what the other one has.
    """
    for id_, of in found.named.items():
        for response, v in of.items():
            bench, others = found.benches[response], numbers(without(found.named, id_), response)
            own = [k for k, one in enumerate(bench.candidates) if one.effect.id == id_]
            base = None if bench.is_misfit else np.linalg.qr(bench.base(others))[0]
            same = [k for k in own if _is_the_same(bench, base, v, k)]
            if len(same) > 1:
                left = [unseen_rms(bench, [*others, k]) for k in same]
                # of those that are the same there, too, the first
                best = next(k for k, one in zip(same, left, strict=True) if one <= _AS_LITTLE * min(left))
                found = replace(found, named={**found.named, id_: {**found.named[id_], response: best}})
    return found


def _is_the_same(bench: Bench, base: Matrix | None, v: int, k: int) -> bool:
    """Whether fitted rows cannot tell two candidates: their columns are equal, or differ by the `base` alone.

    Without a base, beside a misfit of nobody's, they have to be equal: unseen rows are always nearer to one run.
    """
    if bench.counts[v] != bench.counts[k] or base is None:
        own, other = (bench.candidates[one].variant.columns for one in (v, k))
        return own.shape == other.shape and np.array_equal(own[bench.fitted], other[bench.fitted])
    both = (bench.white_columns[:, bench.candidates[one].columns] for one in (v, k))
    own, other = (np.linalg.qr(columns - base @ (base.T @ columns))[0] for columns in both)
    return float(np.linalg.svd(own.T @ other, compute_uv=False).min()) > _THE_SAME


def not_ruinous(comparison: Comparison, found: Search) -> Search:
    """The search without names in responses whose error on unseen rows they make far larger; the least clear first.

    Physics that explains most of fitted and, at another size, of unseen rows stays: a coolant that works less the more
    of it there is is a coolant. Where only its best shape ruins them, an effect has the next best one.
    """
    while True:
        ruined = [
            (found.standing[id_].tested[response].gain, id_, response)
            for id_, of in found.named.items()
            for response in of
            if _growth(found, id_, response) > _RUINED and not _is_of_its_course(comparison, found, id_, response)
        ]
        if not ruined:
            return found
        _, id_, response = min(ruined)
        if (other := _next_best(found, id_, response)) is not None:
            found = replace(found, named={**found.named, id_: {**found.named[id_], response: other}})
            continue
        rest = {name: v for name, v in found.named[id_].items() if name != response}
        stays = rest and found.standing[id_].shows_in(rest)
        found = replace(found, named={**found.named, id_: rest} if stays else without(found.named, id_))


def _next_best(found: Search, id_: str, response: str) -> int | None:
    """The next shape that explains nearly as much of fitted rows, and some of unseen ones; None without.

    What recalibration puts right of a fault in one run may look like one of the other run: unseen rows know.
    """
    bench, own, is_fault = found.benches[response], found.named[id_][response], id_.startswith("data.")
    if not is_fault and found.misfit[response] == 1.0:
        return None
    others = [other for other in numbers(found.named, response) if other != own]
    least, before = _NEARLY_ALL * bench.share(others, own), unseen_rms(bench, others)
    shares = {v: bench.share(others, v) for v, one in enumerate(bench.candidates) if one.effect.id == id_}
    # no worse than what is no ruin, so that it is not asked for again
    most = min(before, (_RUINED if is_fault else 1.0) * rms(bench.target[bench.unseen]))
    for v in sorted(shares, key=lambda one: -shares[one]):
        if shares[v] < least:
            break
        if unseen_rms(bench, [*others, v]) < most:
            return v
    return None


def _is_of_its_course(comparison: Comparison, found: Search, id_: str, response: str) -> bool:
    """Whether physics explains most of the fitted rows and, at another size above nothing, most of the unseen ones."""
    effect, bench = named_effect(comparison, found, id_), found.benches[response]
    held = bench.unseen
    if id_.startswith("data.") or effect.share < MOST_OF_IT or not np.ptp(effect.courses[response][held]):
        return False
    base, target = bench.nuisance[held], bench.target[held]
    beside = np.column_stack([base, effect.courses[response][held]])
    size = least_squares(beside, target)
    left, without_it = rms(target - beside @ size), rms(target - base @ least_squares(base, target))
    return bool(size[-1] > 0.0 and left**2 <= (1.0 - MOST_OF_IT) * without_it**2)


def _growth(found: Search, id_: str, response: str) -> float:
    """Times by which the held-out error of a response grows with an effect; 0 where it takes less than it gives.

    Compared with the simulation without it, recalibrated or as it was given, whichever is nearer.
    """
    bench, named = found.benches[response], numbers(found.named, response)
    others = [other for other in named if other != found.named[id_][response]]
    as_given = rms(bench.target[bench.unseen])
    after, before = unseen_rms(bench, named) ** 2, min(unseen_rms(bench, others), as_given) ** 2
    given = bench.mean_square(others) - bench.mean_square(named)
    return float(np.sqrt(after / before)) if 0.0 < before < after - given else 0.0


#: What is left in the held-out rows, in units of what is left in the fitted rows, if a fault explains all.
_AS_QUIET = 1.3
_LARGER = 1.05  #: Of the error as given, from which on recalibration is what makes it: an offset of noise is not.


def held_out_faults(
    comparison: Comparison, found: Search, effects: Sequence[Effect], *, false_alarm: float, seed: int
) -> tuple[NamedEffect, ...]:
    """Faults of the data in one held-out run that explain why it is off, and the rest of it as quiet as elsewhere.

    Held-out rows may be off because the model does not carry that far; the end of an only run is no other run.
    """
    if found.named or len(comparison.runs) == 1:
        return ()
    local = [effect for effect in effects if effect.family == "data"]
    named: list[NamedEffect] = []
    for response, bench in found.benches.items():
        left = bench.residual(numbers(found.named, response))
        held = comparison.held_out & np.isfinite(left)
        quiet = rms(left[bench.fitted])
        if held.sum() < 40 or rms(left[held]) < _AS_QUIET * quiet:
            continue
        if rms(left[held]) > _LARGER * rms(bench.target[held]):
            # it is the fit that does not carry so far
            continue
        rest = _rest(comparison, response, left)
        there, _ = bench_of(rest, response, local)
        there = there.with_noise(bench.noise)
        result = search({response: there}, false_alarm=0.1 * false_alarm, seed=seed)
        chosen = numbers(result.named, response)
        after = rms(result.benches[response].residual(chosen)[held])
        if chosen and after < _AS_QUIET * quiet:
            candidates = result.benches[response].candidates
            unseen = {comparison.runs[k] for k in np.unique(comparison.run_index[held])}
            local_names = [id_ for id_, of in result.named.items() if candidates[of[response]].variant.run in unseen]
            # no surer than the part that it closes of what unseen rows are off, beyond noise where only that is left
            noise = 0.0 if is_structured(found, response) else quiet
            closed = 1.0 - max(after**2 - noise**2, 0.0) / (rms(left[held]) ** 2 - noise**2)
            told = [named_effect(rest, result, id_) for id_ in local_names]
            named += [replace(one, is_fitted=False, confidence=min(one.confidence, closed)) for one in told]
    return tuple(named)


def _rest(comparison: Comparison, response: str, left: Vector) -> Comparison:
    """The comparison in which what was fitted is part of the simulation, and held-out rows are fitted as well."""
    recorded = comparison.recorded[response]
    simulated = np.where(np.isfinite(left), recorded - left, comparison.simulated[response])
    return replace(
        comparison,
        simulated={**comparison.simulated, response: simulated},
        held_out=np.zeros_like(comparison.held_out),
        responses=(response,),
    )


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
