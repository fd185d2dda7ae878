"""Which effect explains most once the model has it: one amount for all responses, parameters free."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.noise import noise_model, stretches
from selector.diagnosis.matching.usable import rounding_of
from selector.diagnosis.open_model.refitting import Refitted
from selector.diagnosis.open_model.switches import Switch, ThroughModel
from selector.types import Mask, Matrix, Vector

#: Of the mismatch that recalibration leaves: what explains less, or carries less to unseen rows, is no name.
LEAST = 0.1
#: Gain by which, and share of its gain within which, a rival may lag behind the best and fits nearly as well.
_CLEAR, _NEARLY = 6.0, 0.7
_AS_WELL = 1.25  #: Times the unseen mean square of the best that a rival may have and is not told from it.
_FAR_BEHIND = 0.2  #: Of the gain of the best: what has less is not tried in its place.
_WEIGHED, _AGAIN = 12, 2  #: How many of the best are weighed by what they leave, and how often.
_IDLE = 0.3  #: Of its size on fitted rows: an effect that is smaller on unseen ones cannot be borne out by them.


@dataclass(frozen=True, eq=False)
class Candidate:
    """One way in which the model can have an effect, fitted together with its parameters, as slopes have it."""

    switch: Switch
    amounts: tuple[float, ...]
    #: courses and left: (n_rows,): Response → what it adds, parameters as they are; what is left with it [unit]
    courses: Mapping[str, Vector]
    left: Mapping[str, Vector]
    gain: float  #: Twice the logarithm of the likelihood gained on fitted rows
    p_value: float  #: Of that gain in noise, for all ways together
    main: str  #: The response that gains most
    share: float  #: Of the mean square of a response on fitted rows that goes with it, where that is most
    carried: float  #: Of the unseen mean squares of all responses, each in parts of what is left of it, that goes
    unseen: float  #: What is left of them
    is_idle: bool  #: Whether it hardly acts on unseen rows


def candidates(fitted: Refitted, through: ThroughModel, of_first: Mapping[str, float] | None = None) -> list[Candidate]:
    """Every way of `through` to change the model, the largest gain first; the best of them weighed by what each leaves.

    Shares are those of what recalibration left, of which `of_first` is still there, response by response.

    At first what changes from sample to sample is the noise: what is left of a response that lacks an effect is none.
    """
    problem = _Problem(fitted, of_first or dict.fromkeys(fitted.comparison.responses, 1.0))
    quick = {name: quick_noise(fitted.comparison, name) for name in problem.names}
    start = _Weighed(problem, quick, {name: float(problem.fit[name].sum()) for name in problem.names})
    ways = through.columns.items()
    found = sorted((start.tried(*way) for way in ways), key=lambda one: -one.gain)[:_WEIGHED]
    refined = []
    for one in found:
        for _ in range(_AGAIN):
            weighed = _Weighed(problem, *problem.noise(one.left))
            one = weighed.tried(one.switch, through.columns[one.switch])
        p_value = min(1.0, len(through.columns) * float(chi2.sf(max(one.gain, 0.0), len(one.amounts))))
        refined.append(replace(one, p_value=p_value))
    return sorted(refined, key=lambda one: -one.gain)


def chosen(
    found: Sequence[Candidate], false_alarm: float, without: Collection[tuple[str, ...]]
) -> list[tuple[Candidate, ...]]:
    """Effects that are large and sure enough to be put in, the best first, each with the rivals that do as well.

    Of those that fit nearly as well the one with the fewest amounts comes first, then that which unseen rows like best.
    Ways with the parameters of one `without` are not asked for.
    """
    ways: dict[str, Candidate] = {}
    for one in found:
        if one.p_value <= false_alarm and one.share >= LEAST and one.switch.parameters not in without:
            ways.setdefault(one.switch.id, one)
    left, ranked = list(ways.values()), list[tuple[Candidate, ...]]()
    least = _FAR_BEHIND * max((one.gain for one in left), default=0.0)
    while left and left[0].gain >= least:
        near = [one for one in left if one.gain >= min(_NEARLY * left[0].gain, left[0].gain - _CLEAR)]
        unseen = min(one.unseen for one in near)
        alike = [one for one in near if one.unseen <= _AS_WELL * unseen]
        alike.sort(key=lambda one: (len(one.amounts), one.unseen))
        ranked.append(tuple(alike))
        left = [one for one in left if one is not alike[0]]
    return ranked


class _Problem:
    """Linear least squares of parameters and one effect: all responses, held by nameplates."""

    def __init__(self, fitted: Refitted, of_first: Mapping[str, float]) -> None:
        self.of_first = of_first
        self.comparison = comparison = fitted.comparison
        self.names = comparison.responses
        self.rest = {name: comparison.difference(name) for name in self.names}
        seen = {name: np.isfinite(self.rest[name]) for name in self.names}
        self.fit = {name: seen[name] & ~comparison.held_out for name in self.names}
        self.unseen = {name: seen[name] & comparison.held_out for name in self.names}
        parameters = list(fitted.values)
        self.slopes = {
            name: np.column_stack([np.zeros((len(comparison.time_s), 0)), *(
                fitted.slopes[name][one] * fitted.spread[one] for one in parameters
            )])
            for name in self.names
        }  # fmt: skip
        held = [one for one in parameters if one in fitted.away]
        self.prior = np.array([[float(one == other) for one in parameters] for other in held])
        self.prior = self.prior.reshape(-1, len(parameters))
        self.away = np.array([-fitted.away[one] for one in held])

    def noise(self, left: Mapping[str, Vector]) -> tuple[dict[str, float], dict[str, float]]:
        """Root mean square of what is left on fitted rows [unit], and how many of these readings say something new."""
        scale, count = {}, {}
        for name in self.names:
            rows = self.fit[name]
            parts = [part for part in stretches(self.comparison, rows) if part.stop - part.start > 8]
            size = float(np.sqrt(_mean_square(left[name][rows])))
            scale[name] = max(size, rounding_of(self.comparison, name), 1e-300)
            seen = np.where(rows, left[name], np.nan)
            correlated = noise_model(seen, parts).correlation_samples if parts else 1.0
            count[name] = max(float(rows.sum()) / correlated, 1.0)
        return scale, count


class _Weighed:
    """The same with the noise of every response, and how many of its readings say something new."""

    def __init__(self, problem: _Problem, scale: Mapping[str, float], count: Mapping[str, float]) -> None:
        self.of, self.scale, self.count = problem, scale, count
        self.base, self.triangle = np.linalg.qr(np.vstack([self._stacked(problem.slopes), problem.prior]))
        self.target = np.r_[self._stacked(problem.rest), problem.away]
        self.without = self._solved(self.target)

    def _stacked(self, columns: Mapping[str, Vector | Matrix]) -> Vector | Matrix:
        """Fitted rows of all responses in units of their noise; readings that repeat each other count once."""
        fit, parts = self.of.fit, []
        for name in self.of.names:
            repeated = np.sqrt(max(int(fit[name].sum()), 1) / self.count[name])
            parts.append(columns[name][fit[name]] / (self.scale[name] * repeated))
        return np.concatenate(parts)

    def _solved(self, target: Vector) -> Vector:
        """Parameters that explain a target best."""
        return np.asarray(np.linalg.lstsq(self.triangle, self.base.T @ target, rcond=1e-10)[0])

    def tried(self, switch: Switch, columns: Mapping[str, Matrix]) -> Candidate:
        """The effect with its best amounts."""
        of = self.of
        own = np.vstack([self._stacked(columns), np.zeros((len(of.prior), len(switch.sizes)))])
        free = own - self.base @ (self.base.T @ own)
        if switch.is_amount:
            amounts = nnls(free, self.target - self.base @ (self.base.T @ self.target))[0]
        else:
            amounts = np.linalg.lstsq(free, self.target, rcond=1e-10)[0]
        with_it = self._solved(self.target - own @ amounts)
        courses = {name: np.asarray(columns[name] @ amounts) for name in of.names}
        was = {name: of.rest[name] - of.slopes[name] @ self.without for name in of.names}
        left = {name: of.rest[name] - of.slopes[name] @ with_it - courses[name] for name in of.names}

        def squares(part: Mapping[str, Vector], rows: Mapping[str, Mask]) -> Vector:
            scaled = [_mean_square(part[name][rows[name]]) / self.scale[name] ** 2 for name in of.names]
            return np.maximum(scaled, 1e-300)

        changed = {name: was[name] - left[name] for name in of.names}
        before, after = squares(was, of.fit), squares(left, of.fit)
        gains = np.array([self.count[name] for name in of.names]) * np.log(before / after)
        main = int(np.argmax(gains))
        unseen = [float(np.sum(squares(part, of.unseen))) for part in (was, left, changed)]
        return Candidate(
            switch=switch,
            amounts=tuple(amounts.tolist()),
            courses=courses,
            left=left,
            gain=float(gains.sum()),
            p_value=1.0,
            main=of.names[main],
            share=float(np.max((1.0 - after / before) * [min(of.of_first[name], 1.0) for name in of.names])),
            carried=1.0 - unseen[1] / unseen[0],
            unseen=unseen[1],
            is_idle=unseen[2] < _IDLE**2 * float(np.sum(squares(changed, of.fit))),
        )


def _mean_square(values: Vector) -> float:
    return float(np.mean(values**2)) if len(values) else 0.0


def quick_noise(comparison: Comparison, name: str) -> float:
    """Noise of a response from the second differences of what is left of it [unit]; no less than its rounding."""
    parts = [comparison.difference(name)[rows] for _, rows in comparison.rows_of_runs()]
    bends = np.concatenate([np.diff(part, 2) for part in parts])
    bends = bends[np.isfinite(bends)]
    return max(float(np.sqrt(_mean_square(bends) / 6.0)), rounding_of(comparison, name))


def unseen_squares(comparison: Comparison, floor: Mapping[str, float]) -> dict[str, float]:
    """Response → mean square of its unseen mismatch in parts of its noise."""
    rest = {name: comparison.difference(name)[comparison.held_out] for name in comparison.responses}
    seen = {name: part[np.isfinite(part)] for name, part in rest.items()}
    return {name: _mean_square(part) / max(floor[name], 1e-300) ** 2 for name, part in seen.items() if len(part)}
