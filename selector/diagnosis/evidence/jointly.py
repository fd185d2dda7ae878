"""How much several responses together ask for one effect: each for a shape of its own, or all for the same one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from selector.diagnosis.effects.effect import Variant
from selector.diagnosis.evidence.testing import Tested

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
_HALF = float(np.log(0.5))
Key = tuple[object, ...]


def together(evidence: Sequence[Vector | float]) -> Vector:
    """Evidence of responses in each of which the effect is as likely to show as not."""
    return np.asarray(np.sum([2.0 * _shown_or_not(0.5 * np.asarray(one)) for one in evidence], axis=0))


def of_all(tested: Sequence[Tested]) -> tuple[float, Vector]:
    """Evidence of an effect in several responses, and that of noise in every draw.

    As likely as not the shape is one and the same wherever it shows: a clock that is late is late in all that it
    stamps, and a lead is as long for the force as for the way. Then the responses share what choosing the shape costs.
    """
    apart = together([one.evidence for one in tested])
    apart_noise = together([one.noise for one in tested])
    places = _places_of_shared(tested) if len(tested) > 1 else []
    if not places or not places[0]:
        return float(apart), apart_noise
    same = _of_one_shape([one.of_shapes[at] for one, at in zip(tested, places, strict=True)])
    same_noise = _of_one_shape([one.noise_of_shapes[:, at] for one, at in zip(tested, places, strict=True)])
    return float(_either(apart, same)), _either(apart_noise, same_noise)


def _either(apart: Vector, same: Vector) -> Vector:
    return np.asarray(2.0 * (_HALF + np.logaddexp(0.5 * apart, 0.5 * same)))


def _of_one_shape(evidence: Sequence[Matrix | Vector]) -> Vector:
    """The same averaged over shapes, which are in one order in all responses, along the last axis."""
    total = np.sum([_shown_or_not(0.5 * of) for of in evidence], axis=0)
    return np.asarray(2.0 * (logsumexp(total, axis=-1) - np.log(total.shape[-1])))


def _shown_or_not(half: Vector) -> Vector:
    return np.asarray(_HALF + np.logaddexp(0.0, half))


def _places_of_shared(tested: Sequence[Tested]) -> list[list[int]]:
    """For every response, where among its shapes those stand that all responses have, and have once."""
    keys = [[_key_of(variant) for variant in one.shapes] for one in tested]
    counts = [Counter(of) for of in keys]
    shared = [key for key in keys[0] if all(count[key] == 1 for count in counts)]
    where = [{key: k for k, key in enumerate(of)} for of in keys]
    return [[places[key] for key in shared] for places in where]


def _key_of(variant: Variant) -> Key:
    """What makes a shape the same in another response: run, sources and shape parameters."""
    parameters = tuple(sorted((name, float(f"{one.value:.4g}")) for name, one in variant.shape.items()))
    return (variant.run, variant.regime, tuple(sorted(variant.sources)), len(variant.names), parameters)
