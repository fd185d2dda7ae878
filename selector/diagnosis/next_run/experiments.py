"""Which run would tell what this record cannot? Planned runs, emulated, weighed by how far apart effects are there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy import signal, stats

from selector.diagnosis.answer import NamedEffect, NextRun
from selector.diagnosis.comparison import Comparison, read_only
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Effect, Variant
from selector.diagnosis.evidence.noise import NoiseModel, noise_model, stretches, whitened, with_past
from selector.diagnosis.evidence.response import recalibration_columns
from selector.diagnosis.evidence.search import Search, numbers
from selector.diagnosis.next_run.planned_runs import PlannedRun, planned_runs
from selector.diagnosis.shapes.axis import derivatives
from selector.diagnosis.shapes.heating import SHORTEST_S, follows_sensors, heats, sources
from selector.diagnosis.shapes.residual import basis, off
from selector.diagnosis.shapes.signals import SLOWEST_VIBRATION_S, lagged, rise, time_constants
from selector.types import Matrix, Vector

Blocks = list[Matrix]

NEW_RUN = "planned run"
_WEIGHTS = (1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
_AS_WELL = 1.02
_MOST_ROWS = 4000
_LAGS_S = (0.0, 0.004, 0.012, 0.035, 0.1)
_MOVED = ("position_command", "position", "velocity")
#: A simulated course of which less than this share of variance is learnt says nothing about another run.
_LEAST_KNOWN = 0.8


def extended(comparison: Comparison, planned: PlannedRun, response: str) -> Comparison | None:
    """The comparison with the planned run behind the others; None if the response cannot be foretold there.

    What is set is as planned. Other channels and simulated courses are ridge regressions on what is set, with its lags,
    learnt in the recorded runs: of heat on lagged powers of speed, hall, coolant; of a drive on lagged speed,
    acceleration and sense. A simulated vibration is its filter from the recorded forces, and what these do
    not explain once more. Recorded responses are as simulated.
    """
    inputs, n = planned.inputs, len(next(iter(planned.inputs.values())))
    stage = _padded(comparison, inputs, n)
    is_slow = comparison.longest_s >= SHORTEST_S
    moved = [name for name in inputs if comparison.channel(name).role in _MOVED]
    is_shaken = comparison.period_s <= SLOWEST_VIBRATION_S and not moved
    # what a course of this kind of machine is made of, input by input, over all rows of the stage
    if is_slow:
        table = _heat_columns(stage, tuple(inputs), response)
    else:
        table = [_drive_columns(stage, moved[0]) if moved else _lag_columns(stage, tuple(inputs))]
    recorded, simulated = dict(stage.recorded), dict(stage.simulated)
    for channel in comparison.channels:
        if channel.name in inputs or channel.name in comparison.responses:
            continue
        of, is_state = comparison.filled(comparison.recorded[channel.name]), channel.role == "state"
        new = np.full(n, np.median(of)) if is_state else _foretold(comparison, table, of, as_rise=is_slow)[0]
        recorded[channel.name] = np.r_[comparison.recorded[channel.name], new]
    stage = replace(stage, recorded=recorded)
    for name in comparison.simulated:
        if name in inputs:
            continue
        of = comparison.simulated_course(name)
        if is_shaken:
            simulated[name] = np.r_[comparison.simulated[name], _shaken(comparison, inputs, of, n)]
            continue
        is_static = is_slow and name in comparison.responses and follows_sensors(comparison, name)
        part, known = _foretold(comparison, [_sensor_columns(stage, name)] if is_static else table, of, as_rise=is_slow)
        if name == response and known < _LEAST_KNOWN:
            return None
        simulated[name] = np.r_[comparison.simulated[name], part]
    for name in comparison.responses:
        usual = np.nanmedian(comparison.difference(name))
        new = inputs.get(name, simulated[name][-n:])
        recorded[name] = np.r_[comparison.recorded[name], new + usual]
    return replace(stage, recorded=recorded, simulated=simulated)


def _padded(comparison: Comparison, inputs: Mapping[str, Vector], n: int) -> Comparison:
    """The comparison with a new run in which only what is set is known; the rest is 0 until it is learnt."""

    def longer(part: Mapping[str, Vector]) -> dict[str, Vector]:
        return {name: np.r_[values, inputs.get(name, np.zeros(n))] for name, values in part.items()}

    return replace(
        comparison,
        runs=(*comparison.runs, NEW_RUN),
        starts=(*comparison.starts, comparison.starts[-1] + n),
        # read-only as all times are: for others kernels would be compiled once more
        time_s=read_only(np.r_[comparison.time_s, np.arange(n) * comparison.period_s]),
        recorded=longer(comparison.recorded),
        simulated=longer(comparison.simulated),
        held_out=np.r_[comparison.held_out, np.zeros(n, dtype=bool)],
        findings=(),
        tangents={},
    )


def _heat_columns(stage: Comparison, inputs: tuple[str, ...], response: str) -> Blocks:
    taus = (0.0, *time_constants(stage, 6))
    known = sources(stage, response)
    blocks = []
    for name in inputs:
        role = stage.channel(name).role
        if role in ("ambient", "temperature"):
            drivers = [rise(stage, stage.filled(stage.recorded[name]))]
        elif name == known.spindle:
            speed = np.abs(stage.filled(stage.recorded[name]))
            drivers = [(speed / max(float(speed.max()), 1e-300)) ** power for power in (1.0, 2.0)]
        else:
            drivers = [heat for _, heat in heats(stage, name)]
        blocks.append(np.column_stack([lagged(stage, driver, float(tau)) for driver in drivers for tau in taus]))
    return blocks


def _drive_columns(stage: Comparison, name: str) -> Matrix:
    told = stage.filled(stage.simulated[name] if name in stage.simulated else stage.recorded[name])
    if stage.channel(name).role == "velocity":
        speed, acceleration = told, derivatives(stage, told)[0]
        place = np.zeros(len(told))
    else:
        place = told
        speed, acceleration = derivatives(stage, told)
    sense = np.tanh(speed / max(0.01 * float(np.abs(speed).max()), 1e-12))
    moving = [lagged(stage, course, lag) for course in (speed, acceleration, sense) for lag in _LAGS_S]
    return np.column_stack([np.ones(len(told)), place, *moving])


def _lag_columns(stage: Comparison, inputs: tuple[str, ...]) -> Matrix:
    taus = (0.0, *np.geomspace(4.0 * stage.period_s, max(stage.longest_s, 8.0 * stage.period_s), 6))
    drivers = [stage.filled(stage.recorded[name]) for name in inputs]
    columns = [lagged(stage, driver, float(tau), settled=True) for driver in drivers for tau in taus]
    return np.column_stack([np.ones(len(stage.time_s)), *columns])


def _sensor_columns(stage: Comparison, response: str) -> Matrix:
    """Rises of the temperatures and their products: what a static regression is made of."""
    known = sources(stage, response)
    names = dict.fromkeys((*known.machine, *known.hall, *known.coolant_temperatures))
    rises = [rise(stage, stage.filled(stage.recorded[name])) for name in names]
    return np.column_stack([*rises, *(a * b for k, a in enumerate(rises) for b in rises[k:])])


def _shaken(comparison: Comparison, inputs: Mapping[str, Vector], values: Vector, n: int) -> Vector:
    """A vibration in the new run: through the filter (H1 estimate) from the forces, and the rest as it was."""
    rest, result = np.array(values), np.zeros(n)
    longest = max((rows for _, rows in comparison.rows_of_runs()), key=lambda rows: rows.stop - rows.start)
    size = min(1024, (longest.stop - longest.start) // 2)
    for name, new in inputs.items():
        force = comparison.filled(comparison.recorded[name])
        if comparison.channel(name).role == "spindle_speed" or float(np.std(force)) <= 0.0:
            continue
        power = signal.welch(force, nperseg=size)[1]
        crossed = signal.csd(force, rest, nperseg=size)[1]
        impulse = np.fft.irfft(crossed / (power + 1e-3 * power.max()))[: size // 2]
        for _, rows in comparison.rows_of_runs():
            rest[rows] -= signal.lfilter(impulse, [1.0], force[rows])
        result += signal.lfilter(impulse, [1.0], new)
    return np.asarray(result + np.resize(rest[longest], n))


def _foretold(comparison: Comparison, blocks: Blocks, values: Vector, *, as_rise: bool) -> tuple[Vector, float]:
    """The course in the new run, and the share of its variance in the recorded ones that was learnt."""
    old = len(comparison.time_s)
    target = rise(comparison, values) if as_rise else values
    start = float(np.median([values[first] for first in comparison.starts[:-1]])) if as_rise else 0.0
    table = np.column_stack(blocks)
    scale = np.sqrt(np.mean(table[:old] ** 2, axis=0))
    table = table / np.where(scale > 0.0, scale, np.inf)
    block_of = np.repeat(np.arange(len(blocks)), [block.shape[1] for block in blocks])
    beta = _ridge(comparison, table[:old], target, block_of)
    variance = float(np.var(target))
    left = float(np.var(target - table[:old] @ beta))
    known = 1.0 if variance <= 0.0 else 1.0 - left / variance
    return start + table[old:] @ beta, known


def _ridge(comparison: Comparison, table: Matrix, target: Vector, block_of: NDArray[np.intp]) -> Vector:
    """Ridge regression whose weight foretells one run from the others best; of a single run a weight of 1e-4.

    Inputs without which the other runs are foretold as well are left out: the new run may take them further than any.
    """
    stride = max(1, len(target) // _MOST_ROWS)
    parts = [(table[rows][::stride], target[rows][::stride]) for _, rows in comparison.rows_of_runs()]
    grams = np.array([x.T @ x for x, _ in parts])
    scores = np.array([x.T @ y for x, y in parts])
    size = max(float(np.trace(grams.sum(axis=0))) / max(table.shape[1], 1), 1e-300)

    def solution(without: int | None, weight: float, use: NDArray[np.bool_]) -> Vector:
        gram, score = grams.sum(axis=0), scores.sum(axis=0)
        if without is not None:
            gram, score = gram - grams[without], score - scores[without]
        beta = np.zeros(len(score))
        beta[use] = np.linalg.solve(gram[np.ix_(use, use)] + weight * size * np.eye(int(use.sum())), score[use])
        return beta

    def missed(weight: float, use: NDArray[np.bool_]) -> float:
        return float(sum(np.sum((y - x @ solution(k, weight, use)) ** 2) for k, (x, y) in enumerate(parts)))

    def best(use: NDArray[np.bool_]) -> tuple[float, float]:
        return min((missed(weight, use), weight) for weight in _WEIGHTS)

    use = np.ones(len(block_of), dtype=bool)
    if len(parts) < 2:
        return solution(None, 1e-4, use)
    error, weight = best(use)
    for block in np.unique(block_of):
        fewer = use & (block_of != block)
        if fewer.any() and (found := best(fewer))[0] <= _AS_WELL * error:
            (error, weight), use = found, fewer
    return solution(None, weight, use)


_SURE = 0.85  #: Weight that the true effect of a pair is to have after the run.
#: Gain by which an effect must lead so that its weight is enough to tell it.
_CLEAR = 2.0 * float(np.log(_SURE / (1.0 - _SURE)))
_ENOUGH = 0.9
#: Part of its own course by which an effect of the catalogue may miss the truth: a smaller difference tells nothing.
_INEXACT = 0.05
_ENOUGH_ROWS = 4_500
_SETUP_S = 600.0  #: What preparing a run takes, however short it is.
_LIKE_TIME = 1.2  #: Times within this factor are alike: what separates more comes first.
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

    Each run of a menu is emulated (`extended`) and judged as docs/explanation/how-the-evidence-is-weighed.md tells.
    Without a run that can be emulated, the effect's own experiment is named, with no power.
    """
    rivalled = [effect for effect in named if effect.cannot_be_told_from]
    return tuple(run for effect in rivalled for run in _for_effect(comparison, found, effect, named))


def _for_effect(
    comparison: Comparison, found: Search, effect: NamedEffect, beside: Sequence[NamedEffect]
) -> list[NextRun]:
    weighed, rivals = [], effect.cannot_be_told_from[:_MOST_RIVALS]
    if effect.id in found.named:
        for planned in planned_runs(shortened(comparison), effect.channel):
            apart = separations(comparison, found, effect, rivals, planned, beside)
            worst = min(apart, key=lambda pair: pair.d, default=None)
            if worst is not None and worst.power > 0.05:
                weighed.append((planned, worst))
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
    noise = bench.noise
    if short.period_s > 1.5 * comparison.period_s:
        left = np.where(bench.fitted, bench.residual(numbers(found.named, response)), np.nan)[kept]
        noise = noise_model(left, stretches(short, np.isfinite(left)))
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
    # what recalibration and the other named effects leave of it on the recorded rows
    own = basis(base[scene.old])
    seen = {
        id_ for id_, truth in truths.items() if id_ == effect.id or np.linalg.norm(off(own, truth[scene.old])) > 1.0
    }
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
            effect = self.tested.get(id) or effect_of(id)
            # what acts in the new run alone is no explanation of the record
            self.shapes[id] = [
                (variant, self.white(variant.columns))
                for variant in effect.variants(self.comparison, self.response)
                if variant.run != NEW_RUN and np.isfinite(variant.columns).all()
            ]
        return self.shapes[id]


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
    shapes, q = scene.of(id_), basis(base[scene.old])
    target = off(q, _target(scene, course))
    gains = [_gain(q, white[scene.old], target) for _, white in shapes]
    return shapes[int(np.argmax(gains))][0] if shapes else None


def _target(scene: _Scene, course: Vector) -> Vector:
    """A course of the recorded rows behind the filter, on the old rows that count."""
    longer = np.r_[course, np.zeros(len(scene.comparison.time_s) - len(course))]
    return np.asarray(scene.white(longer[:, None])[scene.old, 0])


def _like(scene: _Scene, base: Matrix, shape: Variant, course: Vector) -> Vector:
    """The shape, as large as makes it come nearest to the course on recorded rows; behind the filter, all rows."""
    white = scene.white(shape.columns)
    q = basis(base[scene.old])
    fit = np.linalg.lstsq(off(q, white[scene.old]), off(q, _target(scene, course)), rcond=1e-8)[0]
    return np.asarray(white @ fit)


def _distance(scene: _Scene, base: Matrix, truth: Vector, other: str) -> float:
    """What is left of the true course when the other effect is fitted to it, the shape that does best."""
    q = basis(base)
    target = off(q, truth)
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


def kept_rows(comparison: Comparison) -> NDArray[np.intp]:
    """Rows of the record that are enough: of slow heat every k-th, of motion and vibration the first fitted ones."""
    is_slow = comparison.longest_s >= SHORTEST_S
    stride = max(1, len(comparison.time_s) // _ENOUGH_ROWS) if is_slow else 1
    found: list[NDArray[np.intp]] = []
    for _, rows in comparison.rows_of_runs():
        room = _ENOUGH_ROWS - sum(len(part) for part in found)
        if room > 0 and (is_slow or not comparison.held_out[rows].all()):
            found.append(np.arange(rows.start, rows.stop, stride)[: None if is_slow else room])
    return np.concatenate(found)


def shortened(comparison: Comparison) -> Comparison:
    """The comparison with its `kept_rows` alone."""
    return replace(comparison.only(np.isin(np.arange(len(comparison.time_s)), kept_rows(comparison))), tangents={})
