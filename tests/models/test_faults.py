"""What a broken sensor does to a prediction, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from selector.models.design import Scaling, Term
from selector.models.least_squares import fault_gains, fit

X = np.column_stack([np.linspace(0, 10, 101), 5 * np.sin(np.linspace(0, 9, 101))])
T1, T2 = Term((("T1", 1),)), Term((("T2", 1),))


def model_of(y, terms=(T1, T2), variables=("T1", "T2"), x=X):
    scaling = Scaling(variables, tuple(x.mean(axis=0)), tuple(x.std(axis=0)))
    return fit(x, y, scaling=scaling, terms=terms, name="Z")


def test_linear_model_by_hand():
    model = model_of(3 * X[:, 0] - 2 * X[:, 1] + 7)
    first, second = fault_gains(model, X, ["T1", "T2"], {}, rise=True)
    assert (first.sensor, first.response) == ("T1", "Z")
    assert first.per_kelvin_um == pytest.approx(3.0)
    assert first.stuck_um == pytest.approx(30.0)  # frozen at 0, the true rise goes to 10
    assert first.open_um == pytest.approx(30.0)  # held at an edge, 0 or 10, while the truth is at the other
    assert second.per_kelvin_um == pytest.approx(2.0)
    low, high = X[:, 1].min(), X[:, 1].max()
    assert second.stuck_um == pytest.approx(2 * max(high, -low))
    assert second.open_um == pytest.approx(2 * (high - low))
    assert second.worst_um == max(second.stuck_um, second.open_um)


def test_absolute_readings_freeze_at_their_mean():
    model = model_of(3 * X[:, 0] - 2 * X[:, 1])
    first, _ = fault_gains(model, X, ["T1", "T2"], {}, rise=False)
    assert first.stuck_um == pytest.approx(3 * 5.0)


def test_a_square_has_its_steepest_slope_at_the_end():
    model = model_of(X[:, 0] ** 2, terms=(T1, Term((("T1", 2),))), variables=("T1",), x=X[:, :1])
    (gain,) = fault_gains(model, X[:, :1], ["T1"], {}, rise=True)
    assert gain.per_kelvin_um == pytest.approx(11**2 - 10**2)


def test_a_fault_that_lasts_reaches_the_lag_too():
    lagged = np.column_stack([X[:, 0], 0.6 * X[:, 0]])
    names = ("T1", "T1.lag600s")
    model = model_of(2 * lagged[:, 0] + 5 * np.cos(X[:, 0]), (T1, Term((("T1.lag600s", 1),))), names, X)
    (gain,) = fault_gains(model, X, ["T1"], {"T1.lag600s": "T1"}, rise=True)
    slope = (model.coefficients[1:] / np.array(model.scaling.scale)).sum()
    assert gain.per_kelvin_um == pytest.approx(abs(slope))


def test_the_samples_are_not_changed():
    before = X.copy()
    fault_gains(model_of(X[:, 0]), X, ["T1", "T2"], {}, rise=True)
    assert np.array_equal(before, X)
