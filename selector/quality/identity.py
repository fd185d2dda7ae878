"""Whether runs and channels are themselves: no copies of others, and no channel in another one's place in some run."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.quality.finding_table import DUPLICATE_CHANNEL, FINDINGS, ROWS_IN_TWO_RUNS, SAME_FILE_TWICE
from selector.quality.siblings import Relations
from selector.quality.survey import THERMAL_ROLES, Survey, difference
from selector.text_file import shell_word
from selector.types import Array

_ALIKE = 1.0 - 2e-4  #: Correlation of block means from which two channels are compared sample by sample.
_ROUND_OFF = 1e-10  #: Of a squared correlation.
MOST_PAIRS = 20_000  #: So many pairs of channels are compared sample by sample.
_LEAST = {"degC": 0.6, "um": 4.0}  #: A mismatch below this does not prove a swap [K, µm].
#: By so much the mismatches of both, or of one, exceed what is usual and what is left when the two change places.
_TIMES, _TIMES_ALONE = 2.5, 5.0
_CLEARLY = 1.5  #: By so much channels beside two exchanges that explain each other must prefer the one.
#: Other runs from which it is first judged what mismatch is usual; a pair that passes is judged on all of them.
_REFERENCES = 10

_IN_A_ROW = 20  #: Rows that are the same in two runs, one after the other, and half of them new, are no accident.
_ALL, _SOME = 0.9, 20  #: Share of its rows from which a run is part of another; so many that the two share are told.


def shared_rows(survey: Survey) -> Iterator[Finding]:
    """Findings ``same-file-twice`` and ``rows-in-two-runs``, for rows whose values are the same in all channels.

    Left out in turn, such a run would be predicted from its own rows. O(samples).
    """
    of = [_stretches(survey.values[run]) for run in survey.runs]
    keys, owners = np.concatenate(of), np.repeat(np.arange(len(of)), [len(one) for one in of])
    order = np.argsort(keys, kind="stable")
    keys, owners = keys[order], owners[order]
    again = keys[1:] == keys[:-1]
    pairs = np.column_stack([owners[:-1], owners[1:]])[again].tolist()
    for (i, j), count in sorted(Counter(map(tuple, pairs)).items()):
        part, whole = (i, j) if len(of[i]) < len(of[j]) else (j, i)
        is_part = count >= _ALL * len(of[part])
        if not is_part and count < _SOME:
            continue
        own, other, rows = survey.runs[part], survey.runs[whole], count + _IN_A_ROW - 1
        told = f"Run {own} is run {other}, or a part of it" if is_part else f"Runs {own} and {other} share rows"
        yield FINDINGS.finding(
            SAME_FILE_TWICE if is_part else ROWS_IN_TWO_RUNS,
            f"{told}: some {rows} rows have the same values in all channels.",
            Where(run=own),
            {"original": other, "rows": rows},
            action="leave-out-run" if is_part else "none",
        )


def _stretches(values: Array) -> NDArray[np.uint64]:
    """A number for every `_IN_A_ROW` rows of a run that follow one another, without those that hardly change."""
    draw, mixed = np.random.default_rng(0), np.uint64(32)
    odd, place = (2 * draw.integers(2**63, size=n, dtype=np.uint64) + 1 for n in (len(values), _IN_A_ROW))
    bits = (np.nan_to_num(values) + 0.0).view(np.uint64)
    bits = (bits ^ (bits >> mixed)) * odd[:, None]  # high bits count in low ones, or two signs would cancel each other
    rows = (bits ^ (bits >> mixed)).sum(axis=0)
    if len(rows) < _IN_A_ROW:
        return rows[:0]
    is_new = sliding_window_view(np.diff(rows, prepend=rows[:1]) != 0, _IN_A_ROW).sum(axis=1) >= _IN_A_ROW // 2
    return np.unique((sliding_window_view(rows, _IN_A_ROW) @ place)[is_new])


def duplicates(survey: Survey, relations: Relations) -> Iterator[Finding]:
    """Findings ``duplicate-channel``: two channels that are the same numbers, or one a scaled copy of the other.

    O(channels² · samples) to find the pairs, then O(samples) for each pair.
    """
    alike = np.zeros((len(relations.columns), len(relations.columns)), dtype=np.bool_)
    for r in range(len(relations.runs)):
        movement = relations.movement(r)
        size = np.sqrt(np.maximum((movement * movement).sum(axis=1), 1e-300))
        alike |= np.abs(movement @ movement.T) / np.outer(size, size) > _ALIKE
    differs = _differing(survey, relations)
    pairs = np.argwhere(np.triu(alike & np.isfinite(differs), 1))
    if len(pairs) > MOST_PAIRS:
        yield FINDINGS.finding(
            "copies-not-looked-for",
            f"{len(pairs)} pairs of channels move alike; whether one is a copy of the other was looked at in the "
            f"{MOST_PAIRS} that resemble each other most.",
            None,
            {"pairs": len(pairs), "compared": MOST_PAIRS},
        )
        nearest = np.argpartition(differs[pairs[:, 0], pairs[:, 1]], MOST_PAIRS)[:MOST_PAIRS]
        pairs = pairs[np.sort(nearest)]
    for i, j in pairs.tolist():
        if _kind(relations, i) != _kind(relations, j):
            continue
        both = np.flatnonzero(relations.present[i] & relations.present[j])
        a, b = (survey.channels[relations.columns[k]] for k in (i, j))
        copies = {r: _copy(survey, relations.runs[r], relations.columns[i], relations.columns[j]) for r in both}
        hits = [r for r in both if copies[r] is not None]
        told = [r for r in both if copies[r] is not None or np.ptp(relations.movement(int(r))[i]) > 0]
        if not hits:
            continue
        gain, offset = copies[hits[0]] or (1.0, 0.0)
        same = abs(gain - 1.0) < 1e-9 and abs(offset) < 1e-9
        how = "the same numbers" if same else f"{gain:.6g} times the same numbers plus {offset:.6g}"
        everywhere = len(hits) == len(told)
        if not everywhere and not same:
            continue
        where = "in all runs" if everywhere else "in run " + ", ".join(relations.runs[r] for r in hits)
        yield FINDINGS.finding(
            DUPLICATE_CHANNEL,
            f"{b.name} holds {how} as {a.name} {where}: two channels, one measurement.",
            Where(b.name, None if everywhere else relations.runs[hits[0]]),
            {"other": a.name, "gain": gain, "offset": offset, "runs": [relations.runs[r] for r in hits]},
            f"Check the wiring and the logger; exclude one with --never {shell_word(b.name)}. Nothing is left out.",
        )


@dataclass(frozen=True)
class _Proof:
    """How well channel `own` of one run is replaced by the column of channel `other`.

    `before`, `after`: mismatch with its siblings as recorded and exchanged [unit]; `strength`: by how much the first
    exceeds the second and what is usual, 0 if nothing is proved; `at_once`: so already early in the run; `weak`: the
    strength of the reverse.
    """

    own: int
    other: int
    before: float
    after: float
    strength: float
    at_once: bool
    weak: float = 0.0

    @property
    def both(self) -> set[int]:
        """The two channels."""
        return {self.own, self.other}


@dataclass(frozen=True)
class _Law:
    """What the siblings say of a channel in one run, by the relation of others.

    `known`: the runs it was learned on; `said`: the course, shape (n_blocks,); `before`: mismatch as recorded [unit];
    `usual`: the largest mismatch in the other runs, each by the relation of the rest [unit].
    """

    beside: list[int]
    weights: Array
    known: list[int]
    said: Array
    before: float
    usual: float


class _Laws:
    """The laws of one run, each worked out once; `training`: the other runs, at most `most` of them for `usual`.

    `movement`: of the run, with the exchanges that are known; (n_channels, n_blocks).
    """

    def __init__(
        self, relations: Relations, r: int, training: list[int], movement: Array, most: int = _REFERENCES
    ) -> None:
        self.relations, self.r, self.training, self.movement, self.most = relations, r, training, movement, most
        self._laws: dict[tuple[int, tuple[int, ...]], _Law | None] = {}

    def law(self, own: int, *without: int) -> _Law | None:
        """The law of a channel without other ones among its siblings; None where nothing can be learned."""
        beside = self.relations.siblings(own, without=without)
        key = (own, tuple(beside))
        if key not in self._laws:
            self._laws[key] = self._learned(own, beside)
        return self._laws[key]

    def _learned(self, own: int, beside: list[int]) -> _Law | None:
        relations, r = self.relations, self.r
        known = [o for o in self.training if relations.present[own, o]]
        if len(beside) < 2 or not known:
            return None
        weights = relations.weights_without(own, beside, [r])
        said = weights @ self.movement[beside]
        usual = 0.3 * _least(relations, own)
        for o in known[:: max(1, len(known) // self.most)]:
            fitted = relations.weights_without(own, beside, [r, o]) if len(known) > 1 else weights
            usual = max(usual, _mismatch(relations.movement(o), beside, fitted, own))
        return _Law(beside, weights, known, said, float(np.std(self.movement[own] - said)), usual)


def swapped(relations: Relations) -> Iterator[Finding]:
    """Findings ``swapped-channels``: in one run two channels of a kind stand in each other's place.

    After the exchange both must follow their siblings (the other one aside) as well as in the other runs; before it
    both must clearly not, or one very clearly. Two findings a swap. Only channels that left their siblings' relation
    in that run are tried: O(channels · runs) small systems, and O(blocks) for each pair with such a one.
    """
    count = len(relations.runs)
    if count < 2:
        return
    siblings = [relations.siblings(i) for i in range(len(relations.columns))]
    for r in range(count) if count > 2 else [1]:
        training = [o for o in range(count) if o != r]
        here = [i for i, of in enumerate(siblings) if of and relations.present[i, r] and relations.present[i].sum() > 1]
        laws = _Laws(relations, r, training, relations.movement(r))
        pairs = _proved(laws, here)
        while pairs:
            best = max(pairs, key=lambda pair: pair.strength + pair.weak)
            left = [one.both for one in _proved(_exchanged(laws, best), [i for i in here if i not in best.both])]
            # that exchange explains the near twins of both, too, which then follow their siblings again
            told = [best, *(one for one in pairs if not one.both & best.both and one.both not in left)]
            told = _by_the_rest(laws, told) if len(told) > 1 else told
            for one in told:
                acts = len(training) > (1 if one.weak >= _TIMES else 2)
                yield from _told(relations, r, one, acts=acts, alone=len(told) == 1)
            here = [i for i in here if not any(i in one.both for one in told)]
            laws = _exchanged(laws, told[0]) if len(told) == 1 else laws
            pairs = _proved(laws, here)


def _proved(laws: _Laws, here: list[int]) -> list[_Proof]:
    """Of every pair of these channels that has changed places, the stronger proof."""
    relations, r, training = laws.relations, laws.r, laws.training
    suspects = [i for i in here if relations.off_by_others(i)[0][r] > _least(relations, i)]
    proofs = [_exchange(laws, i, j) for i, j in _candidates(laws, here, suspects)]
    if len(training) >= 2 * _REFERENCES:
        whole = _Laws(relations, r, training, laws.movement, most=len(training))
        proofs = [_exchange(whole, one.own, one.other) for one in proofs if one is not None]
    return [one for one in proofs if one is not None]


def _exchanged(laws: _Laws, pair: _Proof) -> _Laws:
    movement = laws.movement.copy()
    movement[[pair.own, pair.other]] = movement[[pair.other, pair.own]]
    return _Laws(laws.relations, laws.r, laws.training, movement, laws.most)


def _by_the_rest(laws: _Laws, pairs: list[_Proof]) -> list[_Proof]:
    """Of exchanges that explain each other the one that channels of none of them clearly tell; else all of them."""
    doubtful = sorted(set().union(*(one.both for one in pairs)))
    judges = {i: law for i in doubtful if (law := laws.law(i, *(k for k in doubtful if k != i))) is not None}
    off = []
    for pair in pairs:
        movement = _exchanged(laws, pair).movement
        misses = [float(np.std(movement[i] - law.said)) / law.usual for i, law in judges.items()]
        off.append(float(np.hypot.reduce(np.array(misses))) if misses else 1.0)
    first, second = np.argsort(off, kind="stable")[:2]
    return [pairs[first]] if _CLEARLY * off[first] < off[second] else pairs


def _candidates(laws: _Laws, here: list[int], suspects: list[int]) -> list[tuple[int, int]]:
    """Pairs with a suspect that may have changed places: in the other's place the suspect's siblings are followed."""
    relations = laws.relations
    pairs = set()
    for i in suspects:
        law = laws.law(i)
        beside = set(relations.siblings(i))
        fits = np.zeros(len(relations.columns), dtype=np.bool_)
        if law is not None:
            fits = np.std(laws.movement - law.said, axis=1) <= 2.0 * law.usual
        for j in here:
            # a sibling is no judge of its own exchange: without it the law is another one
            if j != i and _kind(relations, i) == _kind(relations, j) and (j in beside or fits[j]):
                pairs.add((min(i, j), max(i, j)))
    return sorted(pairs)


def _exchange(laws: _Laws, i: int, j: int) -> _Proof | None:
    """The stronger proof that two channels have changed places in a run, or None."""
    both = laws.law(i, j), laws.law(j, i)
    # no proof is stronger than this
    if not any(law is not None and law.before >= _TIMES * law.usual for law in both):
        return None
    one = _proof(laws, i, j)
    two = _proof(laws, j, i) if one is not None else None
    if one is None or two is None:
        return None
    strong, weak = (one, two) if one.strength >= two.strength else (two, one)
    # one channel may be too independent of the rest to prove anything, if the other one proves it alone
    alone = strong.strength >= _TIMES_ALONE and strong.at_once
    return replace(strong, weak=weak.strength) if weak.strength >= _TIMES or alone else None


def _proof(laws: _Laws, own: int, other: int) -> _Proof | None:
    """What the exchange does to one channel; None if it then is farther off its siblings than in the other runs."""
    relations, law = laws.relations, laws.law(own, other)
    if law is None:
        return None
    after = float(np.std(laws.movement[other] - law.said))
    if after > 2.0 * law.usual:
        return None
    # a near twin fits in every run: the other column must fit here as it does nowhere else
    cross = [_mismatch(relations.movement(o), law.beside, law.weights, other) for o in law.known]
    proved = law.before > _least(relations, own) and after < 0.4 * float(np.median(cross))
    # one that drifts off later in the run fits at first
    early = [_mismatch(laws.movement, law.beside, law.weights, column, share=0.35) for column in (own, other)]
    strength = law.before / max(after, law.usual) if proved else 0.0
    return _Proof(own, other, law.before, after, strength, early[0] > 1.5 * early[1])


def _told(relations: Relations, r: int, proof: _Proof, *, acts: bool, alone: bool) -> Iterator[Finding]:
    run = relations.runs[r]
    own, other = (relations.survey.channels[relations.columns[k]] for k in (proof.own, proof.other))
    does = "Both channels are left out of this run." if acts else "So few runs do not prove it: nothing is left out."
    repair = f'[runs."{run}"] with swap = [["{own.name}", "{other.name}"]]'
    told = "have changed places" if alone else "or the others that move like them have changed places"
    advice = f"Say it in the machine file: {repair}." if alone else f"Look at the plugs. If it is these two: {repair}."
    for channel, partner in ((own, other), (other, own)):
        yield FINDINGS.finding(
            "swapped-channels",
            f"{own.name} and {other.name} {told} in run {run}: what stands under {own.name} is off by "
            f"{difference(proof.before, own)} from what the siblings of {own.name} say, what stands under "
            f"{other.name} by only {difference(proof.after, own)}.",
            Where(channel.name, run),
            ({"other": partner.name} if alone else {"perhaps": partner.name})
            | {"mismatch": proof.before, "mismatch_after_swap": proof.after},
            f"{advice} If it says so already, take that out. {does}",
            "leave-out-channel" if acts else "none",
            level="error" if acts else "warning",
        )


def _mismatch(movement: Array, siblings: Sequence[int], weights: Array, column: int, share: float = 1.0) -> float:
    """Standard deviation of a column minus what a channel's siblings say, in the first part of a run."""
    off = movement[column] - weights @ movement[list(siblings)]
    return float(np.std(off[: max(1, int(share * off.size))]))


def _copy(survey: Survey, run: str, i: int, j: int) -> tuple[float, float] | None:
    """(gain, offset) when channel j is gain · channel i + offset up to its rounding, else None."""
    x, y = survey.values[run][i], survey.values[run][j]
    both = np.isfinite(x) & np.isfinite(y)
    if both.sum() < 20:
        return None
    x, y = x[both], y[both]
    steps_x, steps_y = survey.scale(run, i).quantum, survey.scale(run, j).quantum
    if min(survey.scale(run, i).distinct, survey.scale(run, j).distinct) < 10:
        return None
    if np.array_equal(x, y):
        return 1.0, 0.0
    dx = x - x.mean()
    gain = float(dx @ y / max(float(dx @ dx), 1e-300))
    offset = float(y.mean() - gain * x.mean())
    rounding = 0.51 * max(steps_y, abs(gain) * steps_x) + 1e-9 * float(np.abs(y).max())
    if abs(gain) < 1e-9 or float(np.abs(y - gain * x - offset).max()) > rounding:
        return None
    # two sensors at one place round differently; a copy changes with its original
    moves = np.corrcoef(np.diff(x), np.diff(y))[0, 1] if min(np.ptp(np.diff(x)), np.ptp(np.diff(y))) > 0 else 0.0
    return (gain, offset) if abs(moves) >= 0.9 else None


def _differing(survey: Survey, relations: Relations) -> Array:
    """1 − squared correlation of pairs that may be copies in some run, else infinite; (n_columns, n_columns).

    What a copy leaves beside gain · x + offset is within the rounding of both, so its root mean square is, too.
    Channels with missing samples may be anything.
    """
    found = np.full((len(relations.columns), len(relations.columns)), np.inf)
    for run in relations.runs:
        values = survey.values[run][relations.columns]
        is_whole = np.asarray(np.isfinite(values).all(axis=1))
        moved = np.where(is_whole[:, None], values - values.mean(axis=1, keepdims=True), 0.0)
        size = np.sqrt((moved * moved).sum(axis=1))
        differs = 1.0 - (moved @ moved.T / np.maximum(np.outer(size, size), 1e-300)) ** 2
        spread = np.maximum(size / np.sqrt(values.shape[1]), 1e-300)
        quantum = np.array([survey.scale(run, column).quantum for column in relations.columns])
        rounding = np.maximum.outer(quantum / spread, quantum / spread)
        ends = np.where(is_whole, np.maximum(-values.min(axis=1), values.max(axis=1)) / spread, 0.0)
        left = 0.51 * rounding + 1e-9 * np.maximum.outer(ends, ends)
        differs[differs > left**2 + _ROUND_OFF] = np.inf
        differs[~np.logical_and.outer(is_whole, is_whole)] = 0.0
        found = np.minimum(found, differs)
    return found


def _kind(relations: Relations, i: int) -> bool:
    return relations.roles[i] in THERMAL_ROLES


def _least(relations: Relations, i: int) -> float:
    return _LEAST[relations.survey.channels[relations.columns[i]].unit]
