"""Responses that show one shape of an effect together, and shapes that are not equally likely."""

from typing import Literal

import numpy as np
import pytest
from scipy.special import logsumexp

from selector.diagnosis.effects.effect import Quantity, Variant, equally_likely
from selector.diagnosis.evidence import testing
from selector.diagnosis.evidence.testing import of_all, together

COURSE = np.ones((4, 1))


def shape(tau_s: float) -> Variant:
    return Variant(COURSE, ("lag",), {"tau_s": Quantity(tau_s, "s")})


def weighed(evidence: list[float], shapes: list[Variant]) -> testing.Tested:
    of = np.array(evidence)
    alone = float(2.0 * np.log(np.mean(np.exp(0.5 * of))))
    return testing.Tested(0, 9.0, alone, np.full(5, alone), 0.0, 0, 9.0, tuple(shapes), of, np.tile(of, (5, 1)))


def test_the_same_shape_in_both_responses_pays_for_its_choice_once() -> None:
    shapes = [shape(10.0 * k) for k in range(1, 21)]
    clear = [15.0 if k == 3 else -2.0 for k in range(20)]
    elsewhere = [15.0 if k == 8 else -2.0 for k in range(20)]
    same, _ = of_all([weighed(clear, shapes), weighed(clear, shapes)])
    other, noise = of_all([weighed(clear, shapes), weighed(elsewhere, shapes)])
    one = weighed(clear, shapes)
    apart = float(together([one.evidence, one.evidence]))
    # a choice among 20 costs 2·ln 20 = 6.0, less the ln 4 for which either may be
    assert same - apart == pytest.approx(2.0 * np.log(20.0) - 2.0 * np.log(2.0), abs=0.2)
    assert other == pytest.approx(apart - 2.0 * np.log(2.0), abs=0.1)
    assert noise == pytest.approx(np.full(5, other))


def test_responses_without_a_common_shape_are_weighed_apart() -> None:
    one, two = weighed([9.0, 1.0], [shape(1.0), shape(2.0)]), weighed([8.0], [shape(3.0)])
    assert of_all([one, two])[0] == pytest.approx(float(together([one.evidence, two.evidence])))
    assert of_all([one])[0] == pytest.approx(float(together([one.evidence])))


def test_kinds_share_what_is_likely_however_many_shapes_they_have() -> None:
    few, many = [shape(1.0)], [shape(10.0 + k) for k in range(9)]
    weights = [variant.weight for variant in equally_likely(few, many)]
    assert weights[0] == pytest.approx(sum(weights[1:]))


@pytest.mark.parametrize("order", ["C", "F"])
def test_sums_of_exponentials_are_those_of_scipy_to_the_last_bit(order: Literal["C", "F"]) -> None:
    draws = np.random.default_rng(1).gumbel(2.0, 2.0, (400, 60))
    for evidence in (draws, 300.0 * draws, np.maximum(draws, 2.0), draws[:, :1], np.where(draws < 0.0, -np.inf, draws)):
        ordered = np.array(evidence, order=order)
        np.testing.assert_array_equal(testing._log_sum(ordered), logsumexp(ordered, axis=-1))
    assert testing._log_sum(draws[0]) == logsumexp(draws[0])
