"""What most of the good sets predict, and how near a set comes to it."""

import numpy as np
import pytest

from selector.selection.candidates import LINEAR
from selector.selection.choice import Agreement
from selector.selection.exploration import Exploration
from selector.selection.library import ROUNDING
from tests.selection.machines import machine

ONE, TWO, OTHER = (("T1",), LINEAR), (("T2",), LINEAR), (("T5",), LINEAR)
NOTHING = np.sqrt(ROUNDING)  # distances below are rounding of the cross-products


@pytest.fixture(scope="module")
def bench():
    return Exploration.of(machine(n_runs=4, n=120)).bench


def test_sets_that_do_alike_count_alike(bench):
    agreed = Agreement.of(bench, [ONE, TWO], np.array([0.2, 0.2]))
    # the mean of both lies halfway: a set with both sensors is there, one with either is not
    assert agreed.distance(("T1", "T2"), LINEAR) == pytest.approx(NOTHING, rel=0.5)
    assert min(agreed.distance(*ONE), agreed.distance(*TWO)) > 10 * NOTHING
    alone = Agreement.of(bench, [ONE], np.array([0.2]))
    assert agreed.distance(*TWO) < alone.distance(*TWO)


def test_a_set_with_a_larger_error_counts_less_and_soon_nothing(bench):
    far = [Agreement.of(bench, [ONE, OTHER], np.array([0.2, error])).distance(*ONE) for error in (0.2, 0.22, 0.25, 0.4)]
    assert far == sorted(far, reverse=True)
    assert far[0] > 10 * far[-1]
    assert far[-1] == pytest.approx(NOTHING, rel=0.5)
