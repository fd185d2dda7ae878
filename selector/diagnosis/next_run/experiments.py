"""Which run would tell what this record cannot? Planned runs, weighed by how far apart the effects would be there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from selector.diagnosis.answer import NamedEffect, NextRun
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Effect, Variant
from selector.diagnosis.evidence.noise import NoiseModel, noise_model, stretches, whitened, with_past
from selector.diagnosis.evidence.response import Bench, recalibration_columns
from selector.diagnosis.evidence.search import Search, numbers
from selector.diagnosis.next_run.emulation import NEW_RUN, extended
from selector.diagnosis.next_run.planned_runs import PlannedRun, planned_runs
from selector.diagnosis.shapes.heating import SHORTEST_S
from selector.types import Matrix, Vector

_SURE = 0.85
"""Weight that the true effect of a pair is to have after the run."""
_CLEAR = 2.0 * float(np.log(_SURE / (1.0 - _SURE)))
"""Gain by which an effect must lead so that its weight is enough to tell it."""
_ENOUGH = 0.9
_INEXACT = 0.05
"""Part of its own course by which an effect of the catalogue may miss the truth: a smaller difference tells nothing."""
_MOST_ROWS = 4_500
_SETUP_S = 600.0
"""What preparing a run takes, however short it is."""
_LIKE_TIME = 1.2
"""Times within this factor are alike: what separates more comes first."""
_MOST_SHOWN = 3
_MOST_RIVALS = 3


@dataclass(frozen=True)
class Separation:
    """How far apart two effects would be [standard deviations], the one being true and the other fitted as well."""

    true: str
    other: str
    d: float

    @property
    def power(self) -> float:
        """Chance that the true one leads clearly: P(d² + 2·d·z > 2·ln odds) of a normal z."""
        return float(stats.norm.cdf((self.d**2 - _CLEAR) / (2.0 * self.d))) if self.d > 0.0 else 0.0


def next_runs(comparison: Comparison, found: Search, named: Sequence[NamedEffect]) -> tuple[NextRun, ...]:
    """Runs that would tell apart what cannot be told, for every effect with rivals; none without any.

    Each run of a menu is emulated (`selector.diagnosis.next_run.emulation`), the fitted effect and its rivals are made
    there anew, each with the shape that it has in the record, and the rival is fitted to the effect on old and new rows
    together, beside recalibration and all else that is named. The first run of an effect is the one that is likely to
    tell the pair that is hardest to tell in the shortest time, repetitions included. Without a run that can be
    emulated, the effect's own experiment is named, with no power.
    """
    result: list[NextRun] = []
    for effect in named:
        if effect.cannot_be_told_from:
            result += _for_effect(comparison, found, effect, effect.cannot_be_told_from[:_MOST_RIVALS], named)
    return tuple(result)


def _for_effect(
    comparison: Comparison,
    found: Search,
    effect: NamedEffect,
    rivals: tuple[str, ...],
    beside: Sequence[NamedEffect],
) -> list[NextRun]:
    weighed = []
    if effect.id in found.named:
        for planned in planned_runs(shortened(comparison), effect.channel):
            apart = separations(comparison, found, effect, rivals, planned, beside)
            if apart:
                weighed.append((planned, min(apart, key=lambda pair: pair.d)))
    weighed = [one for one in weighed if one[1].power > 0.05]
    if not weighed:
        return [NextRun(effect.experiment, (effect.id, *rivals), None, None)]
    shortest = min(_needed_s(*one) for one in weighed)
    weighed.sort(key=lambda one: (round(np.log(_needed_s(*one) / shortest) / np.log(_LIKE_TIME)), -one[1].d))
    return [
        NextRun(planned.description, (worst.true, worst.other), min(worst.power, 0.99), planned.duration_s)
        for planned, worst in weighed[:_MOST_SHOWN]
    ]


def _needed_s(planned: PlannedRun, worst: Separation) -> float:
    """How long it takes to tell, the run repeated if once is not enough [s]: d² grows with every repetition."""
    z = stats.norm.ppf(_ENOUGH)
    enough = float((z + np.sqrt(z**2 + _CLEAR)) ** 2)
    return (planned.duration_s + _SETUP_S) * max(1.0, enough / worst.d**2)


def separations(
    comparison: Comparison,
    found: Search,
    effect: NamedEffect,
    rivals: Sequence[str],
    planned: PlannedRun,
    beside: Sequence[NamedEffect] = (),
) -> tuple[Separation, ...]:
    """Every ordered pair of the effect and its rivals, with the planned run behind the recorded ones.

    `beside` are the other named effects. Nothing if the run cannot be foretold.
    """
    response = effect.channel
    kept, short = kept_rows(comparison), shortened(comparison)
    longer = extended(short, planned, response)
    if longer is None:
        return ()
    bench = found.benches[response]
    is_thinned = short.period_s > 1.5 * comparison.period_s
    noise = _noise(short, bench, numbers(found.named, response), kept) if is_thinned else bench.noise
    tested = {one.effect.id: one.effect for of in found.benches.values() for one in of.candidates}
    scene = _scene(longer, response, noise, bench.fitted[kept], tested)
    base = scene.nuisance
    for id_ in bench.own:
        if id_ not in (effect.id, *rivals) and scene.of(id_):
            base = np.column_stack([base, scene.of(id_)[0][1]])
    for one in beside:
        if one.id != effect.id and response in one.courses:
            shape = _nearest(scene, base, one.id, one.courses[response][kept])
            base = base if shape is None else np.column_stack([base, scene.white(shape.columns)])
    mismatch = np.where(np.isfinite(bench.target), bench.target, 0.0)[kept]
    truths: dict[str, Vector] = {}
    for id_ in (effect.id, *rivals):
        meant = effect.courses[response][kept] if id_ == effect.id else mismatch
        shape = _nearest(scene, base, id_, meant)
        if shape is not None:
            truths[id_] = _like(scene, base, shape, meant)
    # what nothing of is seen in the record may be fitted, but is not taken for true
    seen = {id_ for id_, truth in truths.items() if id_ == effect.id or _seen(scene, base, truth) > 1.0}
    return tuple(
        Separation(true, other, _distance(scene, base, truths[true], other))
        for true, other in permutations(truths, 2)
        if true in seen
    )


@dataclass(frozen=True, eq=False)
class _Scene:
    """The extended comparison behind the noise filter of one response; `old` rows are fitted ones of the record."""

    comparison: Comparison
    response: str
    noise: NoiseModel
    parts: list[slice]
    rows: NDArray[np.intp]
    old: NDArray[np.intp]
    nuisance: Matrix
    tested: Mapping[str, Effect]  #: What was tested in the record: one's own effects stand in no catalogue
    shapes: dict[str, list[tuple[Variant, Matrix]]]

    def white(self, columns: Matrix) -> Matrix:
        """Columns behind the filter, on the rows that count."""
        return whitened(self.noise, columns, self.parts)[self.rows]

    def of(self, id: str) -> list[tuple[Variant, Matrix]]:  # noqa: A002 - the word of the contract
        """Every shape of an effect, and the same behind the filter."""
        if id not in self.shapes:
            self.shapes[id] = list(self._made(self.tested.get(id) or effect_of(id)))
        return self.shapes[id]

    def _made(self, effect: Effect) -> list[tuple[Variant, Matrix]]:
        if effect.testable(self.comparison, self.response) is not None:
            return []
        made = []
        for variant in effect.variants(self.comparison, self.response):
            # what acts in the new run alone is no explanation of the record
            if variant.run == NEW_RUN or not np.isfinite(variant.columns).all():
                continue
            made.append((variant, self.white(variant.columns)))
        return made


def _scene(
    longer: Comparison, response: str, noise: NoiseModel, fitted: NDArray[np.bool_], tested: Mapping[str, Effect]
) -> _Scene:
    target = longer.difference(response)
    n = len(target) - len(fitted)
    counted = np.r_[fitted, np.ones(n, dtype=bool)] & np.isfinite(target)
    parts = stretches(longer, np.isfinite(target))
    rows = np.flatnonzero(counted & with_past(noise, parts, len(target)))
    columns = recalibration_columns(longer, response, counted)[0]
    white = whitened(noise, columns, parts)[rows]
    return _Scene(longer, response, noise, parts, rows, np.flatnonzero(rows < len(fitted)), white, tested, {})


def _nearest(scene: _Scene, base: Matrix, id_: str, course: Vector) -> Variant | None:
    """The shape of an effect that comes nearest to a course on the recorded rows; None if it has none here."""
    shapes = scene.of(id_)
    if not shapes:
        return None
    target = _target(scene, course)
    q = _basis(base[scene.old])
    target = target - q @ (q.T @ target)
    gains = [_gain(q, white[scene.old], target) for _, white in shapes]
    return shapes[int(np.argmax(gains))][0]


def _target(scene: _Scene, course: Vector) -> Vector:
    """A course of the recorded rows behind the filter, on the old rows that count."""
    longer = np.r_[course, np.zeros(len(scene.comparison.time_s) - len(course))]
    return np.asarray(scene.white(longer[:, None])[scene.old, 0])


def _like(scene: _Scene, base: Matrix, shape: Variant, course: Vector) -> Vector:
    """The shape, as large as makes it come nearest to the course on recorded rows; behind the filter, all rows."""
    white = scene.white(shape.columns)
    q = _basis(base[scene.old])
    target, columns = _target(scene, course), white[scene.old]
    target, columns = target - q @ (q.T @ target), columns - q @ (q.T @ columns)
    return np.asarray(white @ np.linalg.lstsq(columns, target, rcond=1e-8)[0])


def _seen(scene: _Scene, base: Matrix, truth: Vector) -> float:
    """Norm of a course on the recorded rows, without what recalibration and the other named effects take of it."""
    q, target = _basis(base[scene.old]), truth[scene.old]
    return float(np.linalg.norm(target - q @ (q.T @ target)))


def _distance(scene: _Scene, base: Matrix, truth: Vector, other: str) -> float:
    """What is left of the true course when the other effect is fitted to it, the shape that does best."""
    q = _basis(base)
    target = truth - q @ (q.T @ truth)
    left = float(target @ target)
    gain = max((_gain(q, white, target) for _, white in scene.of(other)), default=0.0)
    return float(np.sqrt(max(left - gain - _INEXACT**2 * left, 0.0)))


def _gain(q: Matrix, columns: Matrix, target: Vector) -> float:
    """By how much the sum of squares of a projected target falls with these columns beside the basis `q`."""
    carried = q.T @ columns
    size = np.einsum("nk,nk->k", columns, columns)
    scale = 1.0 / np.sqrt(np.maximum(size, 1e-300))
    gram = (columns.T @ columns - carried.T @ carried) * scale[:, None] * scale
    score = (columns.T @ target) * scale
    values, vectors = np.linalg.eigh(gram)
    kept = values > 1e-5
    turned = vectors.T @ score
    return float(np.sum(turned[kept] ** 2 / values[kept]))


def _basis(columns: Matrix) -> Matrix:
    size = np.sqrt(np.einsum("nk,nk->k", columns, columns))
    columns = columns[:, size > 0.0] / size[size > 0.0]
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, values > 1e-8 * values.max(initial=1.0)])


def kept_rows(comparison: Comparison) -> NDArray[np.intp]:
    """Rows of the record that are enough: of slow heat every k-th, of motion and vibration the first fitted ones."""
    is_slow = comparison.longest_s >= SHORTEST_S
    stride = max(1, len(comparison.time_s) // _MOST_ROWS) if is_slow else 1
    found: list[NDArray[np.intp]] = []
    for _, rows in comparison.rows_of_runs():
        room = _MOST_ROWS - sum(len(part) for part in found)
        if room > 0 and (is_slow or not comparison.held_out[rows].all()):
            found.append(np.arange(rows.start, rows.stop, stride)[: None if is_slow else room])
    return np.concatenate(found)


def shortened(comparison: Comparison) -> Comparison:
    """The comparison with its `kept_rows` alone."""
    return replace(comparison.only(np.isin(np.arange(len(comparison.time_s)), kept_rows(comparison))), tangents={})


def _noise(short: Comparison, bench: Bench, named: list[int], kept: NDArray[np.intp]) -> NoiseModel:
    left = np.where(bench.fitted, bench.residual(named), np.nan)[kept]
    return noise_model(left, stretches(short, np.isfinite(left)))
