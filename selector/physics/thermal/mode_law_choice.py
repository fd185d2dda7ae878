"""Which law carries the gains to speeds that were not tested: the one that predicts left-out speeds best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.mode_data import ModeData
from selector.physics.thermal.mode_fit import USUAL_EXPONENT, Fit, Law, solved
from selector.physics.thermal.mode_heldout import held_out_um, run_folds, time_folds
from selector.physics.thermal.mode_search import searched

Vector = NDArray[np.float64]
Rows = NDArray[np.bool_]


@dataclass(frozen=True)
class SpeedFold:
    """Runs that are left out together: those that mainly ran at this level.

    Attributes
    ----------
    level_rpm : float
        The level [r/min].
    fold : ndarray of shape (n_blocks,)
        Blocks of these runs.
    """

    level_rpm: float
    fold: Rows


def speed_folds(data: ModeData) -> list[SpeedFold]:
    """Left-out levels below the fastest (nobody asks beyond it), as far as other runs remain that turn."""
    levels = np.array(data.levels_rpm)
    length_s = data.before_s + data.after_s
    main: dict[int, list[int]] = {}
    for run, (begin, end) in enumerate(data.bounds):
        turning = data.speed_rpm[begin:end] > 0.01 * data.fastest_rpm
        if turning.any():
            nearest = np.abs(data.speed_rpm[begin:end, None] - levels).argmin(axis=1)[turning]
            time_s = np.bincount(nearest, length_s[begin:end][turning], minlength=len(levels))
            main.setdefault(int(np.argmax(time_s)), []).append(run)
    if len(main) < 2:
        return []
    return [
        SpeedFold(float(levels[level]), run_folds(data, [runs])[0])
        for level, runs in sorted(main.items())
        if level < len(levels) - 1
    ]


def law_errors(fit: Fit, data: ModeData, folds: list[SpeedFold]) -> Vector:
    """Root mean square error [µm] at left-out speeds, shape (n_folds, n_responses)."""
    if fit.spec.law_kind != "levels":
        return held_out_um(fit, data, [one.fold for one in folds], own_zeros=True)
    errors = np.zeros((len(folds), fit.weights.shape[1]))
    for i, one in enumerate(folds):
        # the factor at a left-out level is unknown: it must come from the levels beside it
        kept = tuple(level for level in data.levels_rpm if level != one.level_rpm)
        without = replace(data, levels_rpm=kept)
        there = fit.weights * ~one.fold[:, None]
        left_out = solved(fit.spec, without, fit.theta, there).left_out_um
        for r in range(errors.shape[1]):
            total = samples = 0.0
            for begin, end in data.bounds:
                if one.fold[begin]:
                    count = np.where(fit.weights[begin:end, r] > 0, data.counts[begin:end, r], 0.0)
                    own = left_out[begin:end, r]
                    own = own - (own @ count) / max(count.sum(), 1.0)
                    total, samples = total + float(count @ own**2), samples + float(count.sum())
            errors[i, r] = np.sqrt(total / max(samples, 1.0))
    return errors


def with_law(fit: Fit, data: ModeData, law_kind: Law) -> Fit:
    """The fit with another law, searched from its time constants and film."""
    modes, old = fit.spec.n_modes, fit.spec
    exponent = float(fit.theta[modes]) if old.n_powers else USUAL_EXPONENT[0]
    spec = replace(old, law_kind=law_kind, level_exponent=exponent if law_kind == "levels" else old.level_exponent)
    powers = np.full(spec.n_powers, exponent)
    start = np.r_[fit.theta[:modes], powers, fit.theta[modes + old.n_powers :]]
    return searched(spec, data, start, fit.weights)


def law_candidates(fit: Fit, data: ModeData) -> list[tuple[Fit, Vector]]:
    """Fits with every law that the tests can tell apart, simplest first, with their errors at left-out speeds.

    With tests at two levels, or none that can be left out, the errors are those of left-out stretches of time.
    """
    folds = speed_folds(data)
    several = len(data.levels_rpm) > 2
    turning = fit.spec.law_kind in ("turning", "turning-powers")
    kinds: list[Law] = ["power"]
    if len(data.levels_rpm) > 1:
        kinds.append("powers")
    if several and turning:
        kinds += ["turning", "turning-powers"]
    if several and not turning and fit.spec.film == "none" and fit.spec.n_modes > 1:
        kinds.append("mode-powers")
    if several:
        kinds.append("levels")
    found = []
    for kind in kinds:
        one = fit if kind == fit.spec.law_kind else with_law(fit, data, kind)
        errors = law_errors(one, data, folds) if folds else held_out_um(one, data, time_folds(data), own_zeros=False)
        found.append((one, errors))
    return found
