"""What any set of sensors gives as it stands: a linear model, its doubts, and its errors on parts it has not seen.

Everything comes from cross-products, so that a set costs as little on ten million samples as on a thousand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import OptionError
from selector.models.batches import Batches
from selector.models.faults import FaultGain
from selector.models.moments import centred, coefficients, squared_error
from selector.models.subset_scores import adjusted_r2
from selector.models.terms import Scaling, Term, physical_transform

NORMAL_95 = 1.96
_DEPENDENT = 1e-12
"""Of the largest eigenvalue of a correlation matrix: what is smaller is the rounding of sums of squares."""


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of a linear model.

    Attributes
    ----------
    sensor : str
    per_kelvin_um, standard_error : float
        [µm/K]; the error allows for autocorrelation within runs.
    per_deviation_um : float
        Change of the displacement per standard deviation of the reading [µm].
    vif : float
        Variance inflation; infinite if the other sensors make this one up.
    """

    sensor: str
    per_kelvin_um: float
    standard_error: float
    per_deviation_um: float
    vif: float

    @property
    def is_unsure(self) -> bool:
        """Whether zero is within the 95 % interval."""
        return abs(self.per_kelvin_um) <= NORMAL_95 * self.standard_error

    @property
    def per_deviation_error_um(self) -> float:
        """Standard error of `per_deviation_um`."""
        return self.standard_error * abs(self.per_deviation_um / self.per_kelvin_um) if self.per_kelvin_um else 0.0


@dataclass(frozen=True)
class HeldOutPart:
    """A run (condition, block) predicted by coefficients that were fitted without it; the sensors were fixed before.

    `before_rmse_um` is the error without compensation, `mean_um` the mean of measured minus predicted.
    """

    name: str
    n_samples: int
    rmse_um: float
    mean_um: float
    before_rmse_um: float


@dataclass(frozen=True)
class FixedModel:
    """A linear model of one response on a set of sensors that was fixed beforehand.

    Attributes
    ----------
    response : str
    intercept_um : float
    coefficients : tuple of Coefficient
    r2, adjusted_r2 : float
    rmse_um : float
        In sample.
    parts : tuple of HeldOutPart
    heldout_rmse_um : float
        Pooled over the samples of all parts. **With this set fixed**: the choice of the set has seen the parts, so
        that this is smaller than what a procedure reaches that chooses anew without each part (`Proof.rmse_um`).
    """

    response: str
    intercept_um: float
    coefficients: tuple[Coefficient, ...]
    r2: float
    adjusted_r2: float
    rmse_um: float
    parts: tuple[HeldOutPart, ...]
    heldout_rmse_um: float


@dataclass(frozen=True)
class FixedSet:
    """A set of sensors, its models by response, and what a fault of a sensor does to them."""

    sensors: tuple[str, ...]
    models: Mapping[str, FixedModel]
    faults: tuple[FaultGain, ...]
    n_samples: int

    @property
    def largest_vif(self) -> float:
        """Of all sensors; 1 when there is only one."""
        model = next(iter(self.models.values()))
        return max((one.vif for one in model.coefficients), default=1.0)


@dataclass(frozen=True)
class LeftOut:
    """Cross-products of what is left out in turn, and of what is learnt from meanwhile.

    Attributes
    ----------
    names : tuple of str
    unseen, training : ndarray of shape (n_parts, k, k)
        W'W of [1, scaled sensors, responses about their means], as in `Batches`.
    """

    names: tuple[str, ...]
    unseen: NDArray[np.float64]
    training: NDArray[np.float64]


def fixed_set(
    sensors: Sequence[str], responses: Sequence[str], sums: Batches, left_out: LeftOut, *, rise: bool
) -> FixedSet:
    """The linear models of a set of sensors.

    Parameters
    ----------
    sums : Batches
        Its variables are all sensors that there are.
    rise : bool
        Whether a stuck sensor reads zero (rises) or its mean (absolute readings have no natural start).

    Raises
    ------
    OptionError
        Fewer complete samples than coefficients.
    """
    total = sums.whole
    n, k = round(float(total[0, 0])), 1 + len(sensors)
    if n <= k:
        raise OptionError(
            f"{n} complete samples for {k} coefficients",
            expected=f"more than {k} samples at which nothing is missing",
            where="fixed set " + ", ".join(sensors),
            advice="record longer, or take fewer sensors",
        )
    position = {name: j for j, name in enumerate(sums.scaling.variables)}
    own = [position[name] for name in sensors]
    at = [1 + j for j in own]
    first = 1 + len(sums.scaling.variables)
    at_responses = list(range(first, first + len(responses)))
    scaling = sums.scaling.only(sensors)
    cross, _ = centred(total)
    within = cross[np.ix_(own, own)]
    deviation = np.sqrt(np.maximum(np.diag(within), 0.0) / n)
    inverse, vif = _inverse(within)
    slopes = inverse @ cross[np.ix_(own, [one - 1 for one in at_responses])]
    mean = total[0, at] / n
    bread = np.zeros((k, k))
    bread[1:, 1:] = inverse
    bread[0, 1:] = bread[1:, 0] = -inverse @ mean
    bread[0, 0] = 1.0 / n + mean @ inverse @ mean
    beta_unseen = coefficients(left_out.training, at, at_responses)
    sse = squared_error(left_out.unseen, at, at_responses, beta_unseen)
    models, faults = {}, []
    for j, name in enumerate(responses):
        y = at_responses[j]
        beta = np.r_[total[0, y] / n - mean @ slopes[:, j], slopes[:, j]]
        rss = float(squared_error(total, at, [y], beta[:, None])[0])
        sst = float(cross[y - 1, y - 1])
        r2 = 1.0 - rss / sst if sst > 0 else float("nan")
        covariance = bread @ sums.meat([0, *at], y, beta) @ bread * n / max(n - k, 1)
        intercept, found = _coefficients(sensors, scaling, beta, covariance, deviation, vif)
        parts = _parts(left_out, at, y, beta_unseen[..., j], sse[:, j], float(sums.responses_at_um[j]))
        seen = sum(part.n_samples for part in parts)
        pooled = float(np.sqrt(sse[:, j].sum() / seen)) if seen else float("nan")
        models[name] = FixedModel(
            name,
            intercept + float(sums.responses_at_um[j]),
            found,
            r2,
            adjusted_r2(r2, n, len(sensors)),
            float(np.sqrt(rss / n)),
            parts,
            pooled,
        )
        centre = np.asarray(scaling.centre) + np.asarray(scaling.scale) * mean
        rest = np.zeros(len(own)) if rise else centre
        faults += [
            _fault(one, name, float(sums.low[c]), float(sums.high[c]), float(zero))
            for one, c, zero in zip(found, own, rest, strict=True)
        ]
    return FixedSet(tuple(sensors), models, tuple(faults), n)


def _inverse(within: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(inverse, variance inflation) of centred cross-products; minimum norm where sensors make each other up."""
    spread = np.sqrt(np.maximum(np.diag(within), 0.0))
    rests = spread <= 0.0
    scale = np.where(rests, 1.0, spread)
    eigenvalues, axes = np.linalg.eigh(within / scale[:, None] / scale)
    independent = eigenvalues > _DEPENDENT * eigenvalues.max(initial=0.0)
    kept = axes[:, independent]
    inverse = (kept / eigenvalues[independent]) @ kept.T
    made_up = 1.0 - (kept**2).sum(axis=1) > 1e-8
    vif = np.where(made_up | rests, np.inf, np.maximum(np.diag(inverse), 1.0))
    return inverse / scale[:, None] / scale, vif


def _coefficients(
    sensors: Sequence[str],
    scaling: Scaling,
    beta: NDArray[np.float64],
    covariance: NDArray[np.float64],
    deviation: NDArray[np.float64],
    vif: NDArray[np.float64],
) -> tuple[float, tuple[Coefficient, ...]]:
    """(intercept, coefficients) in the units of the readings."""
    _, matrix = physical_transform([Term(((name, 1),)) for name in sensors], scaling)
    physical = matrix @ beta
    errors = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", matrix, covariance, matrix), 0.0))
    return float(physical[0]), tuple(
        Coefficient(
            name, float(physical[1 + i]), float(errors[1 + i]), float(beta[1 + i] * deviation[i]), float(vif[i])
        )
        for i, name in enumerate(sensors)
    )


def _parts(
    left_out: LeftOut,
    at: Sequence[int],
    response: int,
    beta: NDArray[np.float64],
    sse: NDArray[np.float64],
    response_at_um: float,
) -> tuple[HeldOutPart, ...]:
    unseen = left_out.unseen
    n = unseen[:, 0, 0]
    mean = (unseen[:, 0, response] - (unseen[:, 0, [0, *at]] * beta).sum(axis=1)) / np.maximum(n, 1.0)
    # the error without compensation counts from the gauge's zero, not from the mean
    power = unseen[:, response, response] + response_at_um * (2.0 * unseen[:, 0, response] + n * response_at_um)
    return tuple(
        HeldOutPart(
            name,
            round(float(n[i])),
            *(float(v) for v in (np.sqrt(sse[i] / n[i]), mean[i], np.sqrt(max(power[i], 0.0) / n[i]))),
        )
        for i, name in enumerate(left_out.names)
        if n[i] > 0
    )


def _fault(one: Coefficient, response: str, low: float, high: float, rest: float) -> FaultGain:
    """What `selector.models.faults.fault_gains` finds over all samples; of a straight line the ends are enough."""
    slope = abs(one.per_kelvin_um)
    return FaultGain(one.sensor, response, slope, slope * max(abs(high - rest), abs(low - rest)), slope * (high - low))
