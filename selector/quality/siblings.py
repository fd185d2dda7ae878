"""How a channel follows its siblings, learned on some runs and applied to another; and channels that part from them.

Works on means over blocks of samples, so noise and resolution matter little and the cost hardly depends on the length
of the runs. Every run is centred: only movement counts, not the level of the day.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.number_text import span_text
from selector.quality.broken_sensors import longest_still, still_stretches
from selector.quality.finding_table import FINDINGS
from selector.quality.survey import Survey, difference, moment, present_median, reading, stretch
from selector.types import Array, Mask

_BLOCKS = 240
_PRESENT = 0.9  #: A channel takes part in a run when so many of its blocks hold a sample; the rest is interpolated.
#: What a block mean may be off without being wrong [K, µm]: keeps weights of near-identical siblings small.
_RIDGE = {"degC": 0.05, "um": 0.5}
_SAME = 1e-7  #: 1 - correlation below which a sibling is a copy, from which nothing can be learned.


class Relations:
    """Linear relations between the thermal and displacement channels of a survey."""

    def __init__(self, survey: Survey, predictors: int = 5) -> None:
        self.survey = survey
        self.columns = survey.columns("temperature", "ambient", "displacement")
        self.roles = [survey.channels[c].role for c in self.columns]
        self.runs = survey.runs
        self.most = predictors
        self._blocks = [block_means(survey, run, self.columns) for run in survey.runs]
        self.present: Mask = np.array([[bool(np.isfinite(row).any()) for row in b] for b, _ in self._blocks])
        self.present = self.present.reshape(len(self.runs), len(self.columns)).T
        ridge = np.array([_RIDGE[survey.channels[c].unit] ** 2 for c in self.columns])
        self._ridge = ridge
        self._movement = [np.nan_to_num(means) for means, _ in self._blocks]
        self._sums: dict[bytes, tuple[Array, int, Mask]] = {}
        self._chosen: dict[tuple[int, frozenset[int]], list[int]] = {}
        self._off: dict[int, tuple[Array, Array]] = {}

    def movement(self, r: int) -> Array:
        """Block means of a run, centred, shape (n_channels, n_blocks); 0 where a channel is absent."""
        return self._movement[r]

    def time_s(self, r: int) -> Array:
        """Start of each block of a run and the end of the last [s], shape (n_blocks + 1,)."""
        return self._blocks[r][1]

    def others(self, i: int, r: int) -> list[int]:
        """The other runs in which a channel is present."""
        return [o for o in range(len(self.runs)) if o != r and self.present[i, o]]

    @cached_property
    def _grams(self) -> Array:
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
        thermal = self.roles[i] != "displacement"
        gram, count, whole = self._sum_with(i)
        pool = [
            j
            for j in np.flatnonzero(whole).tolist()
            if j != i and j not in without and not (thermal and self.roles[j] == "displacement")
        ]
        if not self.present[i].any() or not pool:
            return []
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

    def weights_without(self, i: int, siblings: Sequence[int], apart: Sequence[int]) -> Array:
        """Least-squares weights of the siblings for channel `i`, learned on all runs but these.

        The cost does not depend on the number of runs.
        """
        apart = [r for r in apart if self.present[i, r]]
        # the sum over all runs less the few that are left out
        gram, count, _ = self._sum_with(i)
        part = np.ix_([*siblings, i], [*siblings, i])
        inner = gram[part]
        for r in apart:
            inner = inner - self._grams[r][part]
        last = len(siblings)
        ridge = self._ridge[[*siblings, i]]
        count -= int(self._counts[np.asarray(apart, dtype=np.intp)].sum())
        return _solved(inner, ridge, last, list(range(last)), count)

    def off_by_others(self, i: int) -> tuple[Array, Array]:
        """How far a channel is off its siblings in each run, by the relation of all the other runs; NaN where absent.

        The standard deviation, and the size of the `departure` [unit]; (n_runs,) each. Many runs go together.
        """
        if i not in self._off:
            found = np.full((2, len(self.runs)), np.nan)
            siblings, last = self.siblings(i), len(self.siblings(i))
            gram, count, _ = self._sum_with(i)
            part, ridge = np.array([*siblings, i]), np.diag(self._ridge[siblings])
            for length in np.unique(self._counts[self.present[i]]):
                runs = np.flatnonzero(self.present[i] & (self._counts == length))
                inner = gram[np.ix_(part, part)] - self._grams[np.ix_(runs, part, part)]
                system = inner[:, :last, :last] + ridge * max(count - length, 1)
                weights = np.linalg.solve(system, inner[:, :last, last:])
                course = np.array([self.movement(r)[part] for r in runs.tolist()])
                off = course[:, last] - (weights.transpose(0, 2, 1) @ course[:, :last])[:, 0]
                found[0, runs] = off.std(axis=1)
                off -= np.median(off[:, : max(3, length // 10)], axis=1, keepdims=True)
                found[1, runs] = np.quantile(np.abs(off), 0.95, axis=1)
            self._off[i] = found[0], found[1]
        return self._off[i]

    def weights_on(self, i: int, siblings: Sequence[int], r: int, blocks: Mask) -> Array:
        """The same, learned on some blocks of one run."""
        part = self.movement(r)[:, blocks]
        part = part - part.mean(axis=1, keepdims=True)
        return _solved(part @ part.T, self._ridge, i, list(siblings), int(blocks.sum()))

    def prediction(self, siblings: Sequence[int], weights: Array, r: int) -> Array:
        """Course of a channel in run `r` as its siblings have it, centred, shape (n_blocks,)."""
        return np.asarray(weights @ self.movement(r)[list(siblings)], dtype=np.float64)

    def departure(self, i: int, siblings: Sequence[int], weights: Array, r: int) -> Array:
        """Channel `i` in run `r` minus what its siblings say, zero at the start, shape (n_blocks,)."""
        off = self.movement(r)[i] - self.prediction(siblings, weights, r)
        return np.asarray(off - np.median(off[: max(3, off.size // 10)]), dtype=np.float64)

    def _sum_with(self, i: int) -> tuple[Array, int, Mask]:
        """(Gram matrix, number of blocks, channels present) over the runs in which channel `i` is present."""
        key = self.present[i].tobytes()
        if key not in self._sums:
            runs = np.flatnonzero(self.present[i])
            whole = np.asarray(self.present[:, runs].all(axis=1), dtype=np.bool_)
            self._sums[key] = self._grams[runs].sum(axis=0), int(self._counts[runs].sum()), whole
        return self._sums[key]


def relations_of(survey: Survey) -> Relations:
    """The relations of a survey as it is now."""
    if "relations" not in survey.kept:
        survey.kept["relations"] = Relations(survey)
    relations: Relations = survey.kept["relations"]
    return relations


def _solved(gram: Array, ridge: Array, i: int, siblings: list[int], count: int) -> Array:
    if not siblings:
        return np.empty(0)
    inner = gram[np.ix_(siblings, siblings)] + np.diag(ridge[siblings] * max(count, 1))
    return np.asarray(np.linalg.solve(inner, gram[siblings, i]), dtype=np.float64)


def block_means(survey: Survey, run: str, columns: Sequence[int]) -> tuple[Array, Array]:
    """Centred means over up to 240 blocks of a run, shape (n_columns, n_blocks), and the blocks' borders [s].

    A channel of which too much is missing is NaN throughout.
    """
    time, values, whole = survey.time[run], survey.values[run], survey.whole(run)
    count = min(_BLOCKS, time.size)
    borders = np.linspace(0, time.size, count + 1).astype(np.intp)
    means = np.full((len(columns), count), np.nan)
    for k, column in enumerate(columns):
        if column in whole:
            means[k] = np.add.reduceat(values[column], borders[:-1]) / np.diff(borders)
            continue
        present = np.isfinite(values[column])
        held = np.add.reduceat(present.astype(np.float64), borders[:-1])
        if (held > 0).mean() >= _PRESENT:
            at = np.flatnonzero(held)
            sums = np.add.reduceat(np.where(present, values[column], 0.0), borders[:-1])
            means[k] = np.interp(np.arange(count), at, sums[at] / held[at])
    return means - means.mean(axis=1, keepdims=True), np.r_[time[borders[:-1]], time[-1]]


#: The siblings may go beyond their range in the other runs by this share of it: further, the relation is a guess.
_BEYOND = 0.25
#: When another channel is off by more than so many times what is usual for it, the run is one of another kind.
_OTHERS_QUIET = 1.5
_TESTED = 0.5  #: The channel must have followed its siblings over a movement of this share of the departure at least.
#: A run in which a channel starts so far from its place among the others does not start like the other runs [K].
_WARM_K = 2.0
#: A place with a source of heat of its own, a tank or a pump, may leave the others by as much when it is used [K].
_OWN_SOURCE_K = 3.0
_SHARE = 0.1  #: A switch or flow may be on for this share of the run more or less than in any of the other runs.


def other_cause(
    relations: Relations, i: int, siblings: Sequence[int], r: int, departure: Array, off_elsewhere: float
) -> str | None:
    """What could explain that channel `i` leaves its siblings in run `r` although its sensor is sound; None if nothing.

    `departure` is what the channel is off by [K], shape (n_blocks,); `off_elsewhere` the largest departure of any other
    channel in this run over what is usual for that channel.
    """
    others = relations.others(i, r)
    size = float(np.quantile(np.abs(departure), 0.95))
    warm = _starting_elsewhere(relations, r, others)
    if warm is not None:
        return f"the run does not start like the others ({_name(relations, warm)})"
    switch = _switched_otherwise(relations.survey, r, others)
    if switch is not None:
        return f"{switch} is on for longer or shorter than in the other runs"
    for j in siblings:
        here = _rise(relations, j, r)
        seen = np.concatenate([_rise(relations, j, o) for o in others])
        margin = _BEYOND * float(np.ptp(seen))
        if here.max() > seen.max() + margin or here.min() < seen.min() - margin:
            return f"{_name(relations, j)} is beyond what the other runs cover"
    if size < _OWN_SOURCE_K:
        return "a source of heat at its place could do as much"
    if max(float(np.ptp(relations.movement(o)[i])) for o in others) < _TESTED * size:
        return "in the other runs it moved too little to know how it follows"
    return "other channels are off more than usual too" if off_elsewhere > _OTHERS_QUIET else None


def _rise(relations: Relations, i: int, r: int) -> Array:
    course = relations.movement(r)[i]
    return np.asarray(course - np.median(course[: max(3, course.size // 10)]), dtype=np.float64)


def _starting_elsewhere(relations: Relations, r: int, others: Sequence[int]) -> int | None:
    """The thermal channel whose start, seen from the room or else the middle of all, is not that of the other runs."""
    survey = relations.survey
    thermal = [i for i, role in enumerate(relations.roles) if role != "displacement"]
    room = [i for i in thermal if relations.roles[i] == "ambient"]
    level = np.array([[survey.scale(run, column).start for run in relations.runs] for column in relations.columns])
    level = level - np.array([present_median(row) for row in level[room or thermal].T])
    off = np.abs(level[:, r] - np.array([present_median(row) for row in level[:, list(others)]]))
    off = np.where(np.isfinite(off) & np.isin(np.arange(off.size), thermal), off, 0.0)
    return int(np.argmax(off)) if off.max() > _WARM_K else None


def _switched_otherwise(survey: Survey, r: int, others: Sequence[int]) -> str | None:
    """The state or flow whose mean over the run lies outside that of the other runs."""
    for column in survey.columns("state", "flow"):
        means = [survey.values[run][column] for run in survey.runs]
        mean = np.array([float(np.mean(x[np.isfinite(x)])) if np.isfinite(x).any() else np.nan for x in means])
        seen = mean[list(others)]
        seen = seen[np.isfinite(seen)]
        every = np.concatenate([x[np.isfinite(x)] for x in means])
        margin = _SHARE * float(np.ptp(every)) if every.size else 0.0
        if seen.size and not seen.min() - margin <= mean[r] <= seen.max() + margin:
            return survey.channels[column].name
    return None


def _name(relations: Relations, i: int) -> str:
    return relations.survey.channels[relations.columns[i]].name


_LEAST_K = 1.5  #: A departure below this is within what lags and duty do to a linear relation [K].
#: A departure is a fault when it exceeds so many times the largest one of the channel in the other runs, ...
_TIMES_USUAL = 3.5
#: ... and this excess is so many times that of every other channel in the same run, none of which is beyond this
#: limit when measured without the suspect: a new regime parts many.
_TIMES_OTHERS, _OTHERS_USUAL = 1.8, 2.2
_LEAST_OTHERS = 3  #: Other runs from which it can be known what is usual, well enough to leave something out.
_SUSPECTS = 6
_WELL_KNOWN = 0.3  #: The relation must have held in the other runs to within this share of the channel's movement.
_REFERENCES = 10
_FLOOR_K = 0.15


def leaving_group(relations: Relations) -> Iterator[Finding]:
    """Findings ``drifts-from-group``: a temperature that from some time on no longer follows its siblings.

    Learnt on the other runs, of which there are two at least. The stretch is left out only with three of them and where
    nothing but the sensor explains it (`other_cause`); else the finding is a warning. O(samples).
    """
    if len(relations.runs) < 3:
        return
    temperatures = [i for i, role in enumerate(relations.roles) if role == "temperature"]
    siblings = {i: relations.siblings(i) for i in temperatures}
    departed = {i: relations.off_by_others(i)[1] for i in temperatures if len(siblings[i]) >= 2}
    for r in range(len(relations.runs)):
        suspects = []
        for i, sizes in departed.items():
            others = np.delete(sizes, r)
            others = others[np.isfinite(others)]
            if others.size >= 2 and sizes[r] > max(0.8 * _LEAST_K, 0.5 * float(np.median(others))):
                suspects.append(i)
        # one that leaves drags those along that are measured against it: only the clearest one is told
        suspects.sort(key=lambda i: -departed[i][r])
        judged = [verdict for i in suspects[:_SUSPECTS] if (verdict := _judged(relations, i, siblings, r)) is not None]
        if judged:
            yield max(judged, key=lambda verdict: verdict[0])[1]


def stuck_beside_siblings(survey: Survey, relations: Relations) -> Iterator[Finding]:
    """Findings ``stuck`` of channels whose resolution hides their noise: still while the siblings move. O(samples).

    A fault when the siblings say that it must have moved by several steps of its resolution, and in other stretches in
    which they said so it did. Where that was only in runs in which it never stands still as long, it is a warning: the
    others may be at fault, too.
    """
    quanta = [survey.quantum(column) for column in relations.columns]
    longest = [longest_still(survey, run, relations.columns, quanta) for run in relations.runs]
    for i, (column, quantum) in enumerate(zip(relations.columns, quanta, strict=True)):
        if relations.roles[i] == "ambient" or quantum == 0.0:
            continue
        extremes: tuple[float, float] | None = None
        for r, run in enumerate(relations.runs):
            least = max(20.0, 5.0 * survey.time[run].size / relations.movement(r).shape[1])
            series = survey.series(run, column)
            if longest[r][i] < least or not relations.present[i, r] or series.x.size < 40:
                continue
            if extremes is None:
                siblings = relations.siblings(i)
                scales = [survey.scale(one, column) for one in relations.runs]
                extremes = (min(s.low for s in scales if s.count), max(s.high for s in scales if s.count))
                longest_s = [_longest_still_s(survey, one, column, quantum) for one in relations.runs]
            still = still_stretches(series.x, quantum)
            for k in np.flatnonzero(still.length >= least):
                begin, end = float(series.time_s[still.first[k]]), float(series.time_s[still.last[k]])
                railed = float(still.value[k]) in extremes
                others = relations.others(i, r)
                due = _due(relations, i, siblings, r, others, (begin, end), quantum, railed=railed)
                moving = [o for o in others if longest_s[o] < 0.5 * (end - begin)]
                unsure = due is None and bool(moving)
                if unsure:
                    due = _due(relations, i, siblings, r, moving, (begin, end), quantum, railed=railed)
                if due is None:
                    continue
                channel = series.channel
                to_end = bool(still.last[k] == series.x.size - 1)
                rail = ", the end of its range," if railed else ""
                yield FINDINGS.finding(
                    "saturated" if railed else "stuck",
                    f"{channel.name} in run {run} is frozen at {reading(float(still.value[k]), channel)}{rail} for "
                    f"{span_text(end - begin)}, {stretch(begin, end)}{', the end of the run' if to_end else ''}, while "
                    f"its siblings say that it moved by {difference(due, channel)}"
                    + ("; but it stands still in other runs, too." if unsure else "."),
                    Where(channel.name, run, begin, end),
                    {"samples": int(still.length[k]), "value": float(still.value[k]), "expected_movement": due}
                    | {"resolution": quantum, "siblings": [_name(relations, j) for j in siblings]},
                    "Check the sensor, its cable and the logger. "
                    + ("Nothing is left out." if unsure else "The stretch is left out."),
                    "none" if unsure else "leave-out-stretch",
                    level="warning" if unsure else "error",
                )


def _excess(relations: Relations, i: int, siblings: Sequence[int], r: int) -> tuple[Array, float]:
    """(departure in run r, largest departure in the other runs, each learned without run r and itself)."""
    others = relations.others(i, r)
    departure = relations.departure(i, siblings, relations.weights_without(i, siblings, [r]), r)
    usual = [_FLOOR_K]
    for o in others[:: max(1, len(others) // _REFERENCES)]:
        weights = relations.weights_without(i, siblings, [r, o])
        usual.append(_size(relations.departure(i, siblings, weights, o)))
    return departure, max(usual)


def _judged(relations: Relations, i: int, siblings: dict[int, list[int]], r: int) -> tuple[float, Finding] | None:
    """(how many times the usual departure, the finding) if a channel left its group in a run, and only it."""
    departure, usual = _excess(relations, i, siblings[i], r)
    others = relations.others(i, r)
    movement = float(np.median([np.ptp(relations.movement(o)[i]) for o in others]))
    excess = _size(departure) / usual
    if _size(departure) < _LEAST_K or excess < _TIMES_USUAL or usual > _WELL_KNOWN * max(movement, _size(departure)):
        return None
    elsewhere = []
    for j in siblings:
        if j != i and relations.present[j, r]:
            kept = relations.siblings(j, without=(i,))
            if len(kept) >= 2:
                off, common = _excess(relations, j, kept, r)
                elsewhere.append(_size(off) / common)
    if len(elsewhere) < 2 or max(elsewhere) > min(_OTHERS_USUAL, excess / _TIMES_OTHERS):
        return None
    onset = _onset(departure, 1.2 * usual)
    if onset is None:
        return None
    # off at once, or off before and back again: more like something on the machine than a sensor that comes off
    size = _size(departure)
    rising = departure[onset : onset + 3]
    gradual = float(np.abs(rising).max()) < 0.6 * size and float(np.abs(departure[:onset]).max()) < 0.5 * size
    doubt: str | None
    if len(others) < _LEAST_OTHERS:
        doubt = "there are too few other runs to know"
    elif not gradual:
        doubt = "it does not come on as when a sensor comes off"
    else:
        doubt = other_cause(relations, i, siblings[i], r, departure, max(elsewhere))
    return excess, _drift_finding(relations, i, siblings[i], r, departure, usual, onset, doubt)


def _drift_finding(
    relations: Relations,
    i: int,
    siblings: Sequence[int],
    r: int,
    departure: Array,
    usual: float,
    onset: int,
    doubt: str | None,
) -> Finding:
    survey = relations.survey
    channel, run = survey.channels[relations.columns[i]], relations.runs[r]
    begin, end = float(relations.time_s(r)[onset]), float(relations.time_s(r)[-1])
    last = float(np.median(departure[-max(3, departure.size // 20) :]))
    return FINDINGS.finding(
        "drifts-from-group",
        f"{channel.name} in run {run} leaves its group for good from {moment(begin)}: at the end it is off by "
        f"{difference(last, channel)} from what its siblings say by the relation of the other runs, where it was never "
        f"off by more than {difference(usual, channel)}.",
        Where(channel.name, run, begin, end),
        {"departure_at_end": last, "largest_departure": _size(departure), "usual_departure": usual}
        | {"siblings": [_name(relations, j) for j in siblings]},
        "Check whether the sensor came off or ages. "
        + ("The stretch is left out." if doubt is None else f"It may be real ({doubt}): nothing is left out."),
        "leave-out-stretch" if doubt is None else "none",
        level="error" if doubt is None else "warning",
    )


def _onset(departure: Array, limit: float) -> int | None:
    """First block of the last uninterrupted stretch beyond the limit; None unless it lasts, to the end."""
    within = np.flatnonzero(np.abs(departure) <= limit)
    onset = int(within[-1]) + 1 if within.size else 0
    tail = departure[-max(3, departure.size // 20) :]
    # what is off from the start may be a warm start
    lasting = departure.size - onset >= max(5, departure.size // 6) and onset >= max(3, departure.size // 15)
    return onset if lasting and abs(float(np.median(tail))) > 0.6 * _size(departure) else None


def _size(departure: Array) -> float:
    return float(np.quantile(np.abs(departure), 0.95)) if departure.size else 0.0


def _longest_still_s(survey: Survey, run: str, column: int, quantum: float) -> float:
    """Duration of the longest stretch of equal samples of a channel in a run [s]."""
    series = survey.series(run, column)
    if series.x.size < 2:
        return 0.0
    still = still_stretches(series.x, quantum)
    return float(np.max(series.time_s[still.last] - series.time_s[still.first]))


def _due(
    relations: Relations,
    i: int,
    siblings: Sequence[int],
    r: int,
    others: Sequence[int],
    window: tuple[float, float],
    quantum: float,
    *,
    railed: bool,
) -> float | None:
    """By how much a channel must have moved in a window in which it stood still; None if it may have done so.

    `others` are the runs to learn from.
    """
    if len(siblings) < 1:
        return None
    borders = relations.time_s(r)
    inside = (borders[:-1] >= window[0]) & (borders[1:] <= window[1])
    count = int(inside.sum())
    if count < 4:
        return None
    if others:
        apart = np.setdiff1d(np.arange(len(relations.runs)), others).tolist()
        weights = relations.weights_without(i, siblings, apart)
    elif (~inside).sum() >= 20:
        weights = relations.weights_on(i, siblings, r, ~inside)
    else:
        return None
    due = _range(relations.prediction(siblings, weights, r)[inside])
    unit = relations.survey.channels[relations.columns[i]].unit
    if due < (2.0 if railed else 1.0) * max(4.0 * quantum, 0.8 if unit == "degC" else 4.0):
        return None
    compared = lawful = 0
    for o in [*others, r]:
        told, own = relations.prediction(siblings, weights, o), relations.movement(o)[i]
        free = ~inside if o == r else np.ones(told.size, dtype=np.bool_)
        for begin in range(0, told.size - min(count, told.size) + 1, max(1, count // 3)):
            part = slice(begin, begin + count)
            # at a rail, standing still there again proves nothing
            if railed and _range(own[part]) < 1e-6 * due:
                continue
            if free[part].all() and _range(told[part]) >= 0.6 * due:
                compared += 1
                lawful += bool(_range(own[part]) < 0.3 * _range(told[part]))
    return due if compared >= 2 and lawful == 0 else None


def _range(course: Array) -> float:
    return float(np.ptp(course)) if course.size else 0.0
