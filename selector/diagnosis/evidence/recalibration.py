"""What the simulation's own offset, gain and delay explain, and whether the recording or the simulation is at fault."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data.readings import known_factor
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.response import OF_MODEL, Bench
from selector.diagnosis.evidence.testing import tail_probability
from selector.diagnosis.matching.usable import rms
from selector.types import Vector

_DRAWS = 400
_ADDS_NOTHING = 1.05  #: Times the mean square that is left: a parameter without which it is less is not needed.
_FLOOR = 0.02  #: Share of the mean square that recalibration has to take away to be worth a word.


@dataclass(frozen=True)
class Recalibrated:
    """Recalibration of one response."""

    p_value: float  #: Probability that noise gains as much
    gain: float  #: Fall of the whitened sum of squares
    share: float  #: Share of the mean square of the mismatch, over the fitted rows, that recalibration takes away
    quantities: Mapping[str, Quantity]  #: ``offset`` [unit], ``gain`` (1 = none), ``delay`` [s], with 95 % intervals

    @property
    def matters(self) -> bool:
        """Whether it is more than noise and more than a trifle."""
        return self.p_value < 1e-3 and self.share > _FLOOR


def recalibrated(bench: Bench, named: list[int], noise: Vector, unit: str, *, seed: int) -> Recalibrated:
    """How the simulation would have to be recalibrated beside the candidates `named`, and how sure that is.

    Told without an own parameter that adds nothing: friction by speed beside a delay would be exchanged for it.
    """
    for id_ in bench.own:
        fewer = bench.without_own(id_)
        if fewer.mean_square(named) < _ADDS_NOTHING * bench.mean_square(named):
            bench = fewer
    columns, target = bench.base(named), bench.white_target
    own = bench.white_nuisance.shape[1]
    effects = columns[:, own:]
    kept = np.eye(len(target), 0) if effects.shape[1] == 0 else np.linalg.qr(effects)[0]
    nuisance = columns[:, :own] - kept @ (kept.T @ columns[:, :own])
    size = np.maximum(np.linalg.norm(nuisance, axis=0), 1e-300)
    left, singular, _ = np.linalg.svd(nuisance / size, full_matrices=False)
    left = left[:, singular > 1e-6 * singular.max(initial=0.0)]
    gain = float(((left.T @ target) ** 2).sum())
    scores = np.array([left[rows].T @ noise[rows] for rows in bench.blocks])
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(_DRAWS, len(scores)))
    drawn = ((signs @ scores) ** 2).sum(axis=1)
    beta, covariance = bench.coefficients(named)
    rows = bench.fitted
    raw = bench.target[rows] - bench.raw_base(named)[rows][:, own:] @ beta[own:]
    after = raw - bench.nuisance[rows] @ beta[:own]
    before = float(np.mean(raw**2))
    quantities = {}
    for k, name in enumerate(bench.nuisance_names):
        if not name.startswith(OF_MODEL):
            value, half = _NEUTRAL.get(name, 0.0) + beta[k], 1.96 * float(np.sqrt(covariance[k, k]))
            if size[k] < 1e-6 * np.linalg.norm(bench.nuisance[bench.rows, k]) / bench.noise.sd:
                half = np.inf
            quantities[name] = Quantity(value, {"gain": "1", "delay": "s"}.get(name, unit), value - half, value + half)
    return Recalibrated(
        p_value=tail_probability(gain, drawn),
        gain=gain,
        share=max(0.0, 1.0 - float(np.mean(after**2)) / before) if before > 0.0 else 0.0,
        quantities=quantities,
    )


#: Times that an unseen error grows by recalibration, and is as large as the fitted one, where runs contradict each
#: other; how sure the recalibration of the fitted ones has to be.
_UNLIKE, _SURELY_OTHER = 3.0, 1e-6
_FAR = 5.0  #: Times what is left of the fitted rows: what unseen rows are off by that is no noise.
#: Times the changes from sample to sample: an unseen error that is no noise; share of it that has to go, of whatever
#: takes half of the fitted mismatch.
_NO_NOISE, _LEAST_FALL = 4.0, 0.1


def contradicted(bench: Bench, again: Recalibrated) -> float:
    """By how much unseen rows are off that are far more so than fitted ones, as they are and as these calibrate them.

    Or that were right and are far off once they are calibrated, or that are far off by what is no noise and gain
    nothing by a calibration that most of the fitted mismatch asks for; 0 of others.
    """
    left, held = bench.residual([]), bench.unseen
    if not held.any():
        return 0.0
    after, before, fitted = rms(left[held]), rms(bench.given[held]), rms(left[bench.fitted])
    is_other = after > _UNLIKE * max(before, fitted)
    is_other |= again.share > 0.5 and after > max((1.0 - _LEAST_FALL) * before, _NO_NOISE * bench.quick(left))
    return after if (is_other and again.p_value < _SURELY_OTHER) or min(after, before) > _FAR * fitted else 0.0


_FORCES = ("force", "current", "voltage")
_HELD = ("position_command", "position", "velocity")  #: Roles that tell of an axis under control.
_NEUTRAL = {"gain": 1.0, "offset": 0.0, "delay": 0.0}
#: Standard errors from which a quantity is off, up to which it is right, and from which two of them differ.
_OFF, _RIGHT, _APART = 6.0, 3.0, 4.0


def whole_record_names(comparison: Comparison, again: Mapping[str, Recalibrated]) -> dict[str, dict[str, str]]:
    """Effect → response → the quantity of the recalibration that shows it, where it is no mere miscalibration.

    A wrong parameter of the simulation rarely moves one response of several and leaves the others exactly right; a
    wrong scale, zero or clock of one channel does just that. But the force of an axis, whose position a control holds,
    takes all that is wrong: its scale is a parameter. A factor that separates two units is the unit. A constant
    force where the axis stands as well is a force (a cable, a weight), if not the zero of its amplifier; beside a wrong
    scale it is what that makes of a force that is never 0.
    """
    off = {
        word: {name: one.quantities[word] for name, one in again.items() if one.matters and _is_off(one, word)}
        for word in _NEUTRAL
    }
    found: dict[str, dict[str, str]] = {}
    alone = {word: _alone(word, values, again) for word, values in off.items()}
    forces = {name for name in again if comparison.channel(name).role in _FORCES}
    is_fault = alone["gain"] and (forces.isdisjoint(off["gain"]) or not comparison.with_role(*_HELD))
    scales = {name: value for name, value in off["gain"].items() if is_fault or known_factor(value)}
    if scales:
        found["data.gain"] = dict.fromkeys(scales, "gain")
    if weights := [name for name in off["offset"] if name in forces and name not in off["gain"]]:
        found["drive.offset_force"] = dict.fromkeys(weights, "offset")
    elif alone["offset"]:
        found["data.zero"] = dict.fromkeys(off["offset"], "offset")
    if alone["delay"]:
        found["data.clock"] = dict.fromkeys(off["delay"], "delay")
    return found


def _alone(word: str, off: Mapping[str, Quantity], again: Mapping[str, Recalibrated]) -> bool:
    """Whether one of several responses is off, and the others are known to be right, and not as far off as it.

    Others that are off as well, by less than is sure, or not known well enough to say, speak of the simulation.
    """
    if len(off) != 1 or len(again) == 1:
        return False
    ((name, value),) = off.items()
    others = [one.quantities.get(word) for key, one in again.items() if key != name]
    return all(
        other is not None
        and abs(other.value - _NEUTRAL[word]) <= _RIGHT * _error(other)
        and abs(other.value - value.value) >= _APART * np.hypot(_error(other), _error(value))
        for other in others
    )


def _is_off(one: Recalibrated, word: str) -> bool:
    value = one.quantities.get(word)
    return value is not None and _OFF * _error(value) < abs(value.value - _NEUTRAL[word]) < np.inf


def _error(value: Quantity) -> float:
    """Standard error by the interval; infinite without one."""
    if value.low is None or value.high is None:
        return np.inf
    return max((value.high - value.low) / 3.92, 1e-300)
