"""The final fit: against statsmodels and scikit-learn, and where their numbers end."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import statsmodels.api as sm
from sklearn.linear_model import Ridge
from statsmodels.stats.diagnostic import acorr_ljungbox
from statsmodels.stats.outliers_influence import OLSInfluence, variance_inflation_factor
from statsmodels.stats.stattools import durbin_watson

from selector.errors import OptionError
from selector.models.best_subsets.results import adjusted_r2
from selector.models.design import Scaling, design_matrix, polynomial_terms
from selector.models.least_squares import fit, variance_inflation


def data(n=200, p=3, seed=0, correlation=0.7):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(n, 1)) * correlation + rng.normal(size=(n, p)) + [25.0, 22.0, 30.0][:p]
    noise = np.zeros(n)
    for i in range(1, n):  # residuals that follow each other, as those of a machine do
        noise[i] = 0.8 * noise[i - 1] + rng.normal()
    return x, x @ [4.0, -2.0, 1.0][:p] + 0.2 * x[:, 0] * x[:, -1] + noise


def fitted(x, y, *, degree=1, interactions=False, centre=None, **options):
    names = tuple(f"T{i + 1}" for i in range(x.shape[1]))
    centre = x.mean(axis=0) if centre is None else np.full(x.shape[1], centre)
    scaling = Scaling(names, tuple(centre), tuple(x.std(axis=0)))
    terms = polynomial_terms(names, degree, interactions=interactions)
    return fit(x, y, scaling=scaling, terms=terms, name="Z", **options)


def design_of(model, x):
    return design_matrix(model.scaling.scaled(x), model.scaling.variables, model.terms)


@pytest.mark.parametrize("degree", [1, 2])
def test_is_ordinary_least_squares(degree):
    x, y = data()
    model = fitted(x, y, degree=degree, interactions=True)
    expected = sm.OLS(y, sm.add_constant(design_of(model, x))).fit()
    assert model.coefficients == pytest.approx(expected.params, rel=1e-10)
    assert model.classical_covariance == pytest.approx(expected.cov_params(), rel=1e-9, abs=1e-14)
    assert model.r2 == pytest.approx(expected.rsquared, rel=1e-12)
    assert model.adjusted_r2 == pytest.approx(expected.rsquared_adj, rel=1e-12)
    assert model.residual_sd_um == pytest.approx(np.sqrt(expected.mse_resid), rel=1e-12)
    assert model.rmse_um == pytest.approx(np.sqrt(np.mean(expected.resid**2)), rel=1e-12)
    assert model.predicted(x) == pytest.approx(expected.fittedvalues, rel=1e-12)


@pytest.mark.parametrize("n_runs", [1, 4])
def test_standard_errors_are_newey_west_within_runs(n_runs):
    x, y = data(200)
    runs = np.repeat(np.arange(n_runs), 200 // n_runs)
    model = fitted(x, y, runs=runs)
    bandwidth = int(np.sqrt(200 / n_runs))
    expected = sm.OLS(y, sm.add_constant(design_of(model, x))).fit(
        cov_type="hac-panel", cov_kwds={"groups": runs, "maxlags": bandwidth, "use_correction": "hac"}
    )
    assert model.covariance == pytest.approx(expected.cov_params(), rel=1e-9, abs=1e-14)


def test_robust_errors_cover_what_classical_ones_do_not():
    """Residuals with a memory of five samples: of 200 fits, how often is the true slope within two errors?"""
    robust, classical = 0, 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        t = np.linspace(0, 6, 300)
        x = (1 - np.exp(-t))[:, None] * 8.0
        noise = sm.tsa.arma_generate_sample([1, -0.9], [1], 300, distrvs=rng.standard_normal)
        model = fitted(x, 3.0 * x[:, 0] + noise)
        for is_robust in (True, False):
            _, beta, error = model.physical(robust=is_robust)
            inside = abs(beta[1] - 3.0) <= 2 * error[1]
            robust, classical = robust + (is_robust and inside), classical + (not is_robust and inside)
    # 95 % would be 190; Newey–West is known to fall short on so few independent stretches
    assert classical < 130
    assert robust > classical + 20


def test_without_an_intercept():
    x, y = data()
    model = fitted(x, y, centre=0.0, intercept=False)
    expected = sm.OLS(y, x / x.std(axis=0)).fit()
    assert model.coefficients[0] == 0.0
    assert model.coefficients[1:] == pytest.approx(expected.params, rel=1e-10)
    assert model.r2 == pytest.approx(expected.rsquared, rel=1e-12)  # about zero: statsmodels' uncentred R²
    assert model.adjusted_r2 == pytest.approx(expected.rsquared_adj, rel=1e-12)
    assert model.classical_covariance[1:, 1:] == pytest.approx(expected.cov_params(), rel=1e-9)
    assert model.covariance[0].tolist() == [0.0] * 4
    others = [sm.OLS(x[:, j], np.delete(x, j, axis=1)).fit().uncentered_tss for j in range(3)]
    rest = [sm.OLS(x[:, j], np.delete(x, j, axis=1)).fit().ssr for j in range(3)]
    assert model.vif == pytest.approx(np.divide(others, rest), rel=1e-9)


def test_physical_form_is_the_same_model():
    x, y = data()
    model = fitted(x, y, degree=2, interactions=True)
    terms, beta, errors = model.physical(robust=False)
    raw = sm.add_constant(design_matrix(x, model.scaling.variables, terms))
    expected = sm.OLS(y, raw).fit()
    # raw columns have a condition number of 1e5: statsmodels itself is right to 1e-9 there
    assert beta == pytest.approx(expected.params, rel=1e-6)
    assert errors == pytest.approx(expected.bse, rel=1e-6)
    assert raw @ beta == pytest.approx(model.predicted(x), rel=1e-11)


def test_vif_is_that_of_statsmodels():
    x, y = data(correlation=3.0)
    model = fitted(x, y, degree=2)
    columns = sm.add_constant(design_of(model, x))
    assert model.vif == pytest.approx([variance_inflation_factor(columns, j) for j in range(1, 7)], rel=1e-8)


def test_vif_of_dependent_constant_and_lonely_columns():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 100))
    alone = variance_inflation(np.column_stack([a]))
    assert alone == pytest.approx([1.0])
    found = variance_inflation(np.column_stack([a, b, 2 * b - 3, np.full(100, 0.1)]))
    assert np.isinf(found[1:]).all()
    assert found[0] == pytest.approx(1 / (1 - np.corrcoef(a, b)[0, 1] ** 2), rel=1e-9)
    assert variance_inflation(np.zeros((10, 0))).shape == (0,)


@pytest.mark.parametrize("penalty", [1e-4, 0.1, 10.0])
def test_ridge_is_that_of_scikit_learn(penalty):
    x, y = data(correlation=3.0)
    model = fitted(x, y, degree=2, ridge=penalty)
    expected = Ridge(alpha=penalty * len(y), solver="cholesky").fit(design_of(model, x), y)
    assert model.coefficients[0] == pytest.approx(expected.intercept_, rel=1e-9)
    assert model.coefficients[1:] == pytest.approx(expected.coef_, rel=1e-8)
    assert model.ridge == penalty


def test_ridge_standard_errors_are_those_of_repeated_noise():
    """Var(b) of a ridge fit is σ² A⁻¹ X'X A⁻¹: smaller than that of least squares, as sampling shows."""
    x, _ = data(100, correlation=3.0)
    rng = np.random.default_rng(1)
    slopes = [fitted(x, x[:, 0] + rng.normal(0, 0.5, 100), ridge=0.3).coefficients[1] for _ in range(400)]
    model = fitted(x, x[:, 0] + rng.normal(0, 0.5, 100), ridge=0.3)
    claimed = np.sqrt(model.classical_covariance[1, 1]) * 0.5 / model.residual_sd_um
    assert claimed == pytest.approx(np.std(slopes), rel=0.12)  # a deviation of 400 is known to 3.5 %


class TestInStatsmodels:
    @pytest.mark.parametrize("robust", [True, False])
    @pytest.mark.parametrize("n_runs", [1, 4])
    def test_is_the_same_model(self, robust, n_runs):
        x, y = data()
        runs = np.repeat(np.arange(n_runs), 200 // n_runs)
        model = fitted(x, y, degree=2, interactions=True, runs=runs)
        results = model.statsmodels_results(x, y, runs, robust=robust)
        terms, coefficients, errors = model.physical(robust=robust)
        assert list(results.params.index) == ["Intercept", *map(str, terms)]
        assert results.params.to_numpy() == pytest.approx(coefficients, rel=1e-6)
        assert results.bse.to_numpy() == pytest.approx(errors, rel=1e-6)
        assert np.all((results.pvalues >= 0) & (results.pvalues <= 1))
        assert results.rsquared == pytest.approx(model.r2, rel=1e-9)
        assert results.rsquared_adj == pytest.approx(model.adjusted_r2, rel=1e-9)
        cooks = results.get_influence().cooks_distance[0]
        assert cooks.max() == pytest.approx(model.diagnostics.max_cooks_distance, rel=1e-6)
        assert "Dep. Variable:                      Z" in results.summary().as_text()

    def test_without_an_intercept(self):
        x, y = data()
        model = fitted(x, y, centre=0.0, intercept=False)
        results = model.statsmodels_results(x, y)
        assert list(results.params.index) == ["T1", "T2", "T3"]
        assert results.bse.to_numpy() == pytest.approx(model.physical()[2][1:], rel=1e-9)
        assert results.rsquared == pytest.approx(model.r2, rel=1e-12)

    def test_what_ordinary_least_squares_does_not_give_is_refused(self):
        x, y = data()
        for model in (fitted(x, y, ridge=0.1), fitted(x, y, intercept=False)):
            with pytest.raises(OptionError, match="a model of Z with"):
                model.statsmodels_results(x, y)


class TestColumnsThatDependOnEachOther:
    def test_a_copy_shares_the_coefficient(self):
        x, y = data(p=1)
        alone = fitted(x, y)
        both = fitted(np.column_stack([x, x]), y)
        assert both.predicted(np.column_stack([x, x])) == pytest.approx(alone.predicted(x), rel=1e-10)
        assert both.coefficients[1] == pytest.approx(both.coefficients[2], rel=1e-8)
        assert np.isinf(both.vif).all()
        assert np.isfinite(both.covariance).all()

    def test_a_copy_in_fahrenheit_too(self):
        x, y = data(p=1)
        both = np.column_stack([x, x * 1.8 + 32.0])
        model = fitted(both, y)
        assert np.abs(model.coefficients).max() < 1e3  # no huge coefficients that cancel
        assert model.predicted(both) == pytest.approx(fitted(x, y).predicted(x), rel=1e-9)

    def test_a_column_at_rest(self):
        x, y = data(p=1)
        with_rest = np.column_stack([x, np.full(len(x), 20.0)])
        scaling = Scaling(("a", "b"), (float(x.mean()), 20.0), (1.0, 1.0))
        model = fit(with_rest, y, scaling=scaling, terms=polynomial_terms(("a", "b"), 1), name="Z")
        assert model.coefficients[2] == 0.0
        assert np.isinf(model.vif[1])
        assert model.vif[0] == pytest.approx(1.0)


class TestEdges:
    def test_an_exact_fit(self):
        x = np.linspace(0, 1, 30)[:, None]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            model = fitted(x, 3 * x[:, 0] + 1)
        assert model.r2 == pytest.approx(1.0, abs=1e-14)
        assert model.rmse_um < 1e-14
        assert np.isfinite(model.covariance).all()
        assert model.diagnostics.max_cooks_distance >= 0

    def test_a_response_at_rest_has_no_r2(self):
        x, _ = data()
        model = fitted(x, np.full(200, 5.0))
        assert model.coefficients[0] == pytest.approx(5.0)
        assert np.isnan(model.r2) or model.r2 <= 1.0

    @pytest.mark.parametrize("n", [1, 3, 4])
    def test_too_few_samples_are_refused(self, n):
        x, y = data()
        with pytest.raises(OptionError, match=rf"\b{n} complete samples .*\b4 coefficients of Z"):
            fitted(x[:n], y[:n])

    def test_one_more_sample_than_coefficients_will_do(self):
        x, y = data()
        model = fitted(x[:5], y[:5])
        assert np.isfinite(model.coefficients).all()
        assert np.isfinite(model.adjusted_r2)

    def test_arrays_are_read_only(self):
        model = fitted(*data())
        for array in (model.coefficients, model.covariance, model.classical_covariance, model.vif):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0.0

    def test_adjusted_r2(self):
        # P: printed pairs are consistent with m ≥ 19 only; 0.9989 with p = 2, m = 19 gives 0.9988
        assert adjusted_r2(0.9989, 19, 2) == pytest.approx(0.99876, abs=5e-6)
        assert np.isnan(adjusted_r2(0.9, 3, 2))
        assert adjusted_r2(0.9, 10, 2, intercept=False) == pytest.approx(1 - 10 / 8 * 0.1)


class TestDiagnostics:
    def test_durbin_watson_within_runs(self):
        x, y = data()
        whole = fitted(x, y)
        residuals = y - whole.predicted(x)
        assert whole.diagnostics.durbin_watson == pytest.approx(durbin_watson(residuals), rel=1e-9)
        cut = fitted(x, y, runs=np.repeat([0, 1], 100)).diagnostics.durbin_watson
        step = (residuals[100] - residuals[99]) ** 2 / (residuals**2).sum()
        assert cut == pytest.approx(durbin_watson(residuals) - step, rel=1e-9)

    def test_cooks_distance_is_that_of_statsmodels(self):
        x, y = data()
        y[17] += 40.0
        model = fitted(x, y)
        cooks = OLSInfluence(sm.OLS(y, sm.add_constant(x)).fit()).cooks_distance[0]
        assert model.diagnostics.max_cooks_distance == pytest.approx(cooks.max(), rel=1e-8)
        assert model.diagnostics.most_influential == 17 == cooks.argmax()

    def test_ljung_box_is_that_of_statsmodels_and_the_worst_of_the_runs(self):
        x, y = data()
        y = x[:, 0] + np.random.default_rng(4).normal(size=200)
        model = fitted(x, y, runs=np.repeat([0, 1], 100))
        residuals = y - model.predicted(x)
        each = [acorr_ljungbox(part, lags=[10])["lb_pvalue"].iloc[0] for part in np.split(residuals, 2)]
        assert model.diagnostics.ljung_box_p == pytest.approx(min(each), rel=1e-9)

    def test_ljung_box_tells_noise_from_memory(self):
        rng = np.random.default_rng(0)
        x, y = data()
        assert fitted(x, y).diagnostics.ljung_box_p < 1e-6
        assert fitted(x, x[:, 0] + rng.normal(size=200)).diagnostics.ljung_box_p > 0.01

    def test_condition_number_of_unit_columns(self):
        rng = np.random.default_rng(0)
        a = rng.normal(size=500)
        x = np.column_stack([a, a + 0.1 * rng.normal(size=500)])
        r = np.corrcoef(x.T)[0, 1]
        found = fitted(x, a).diagnostics.condition_number
        assert found == pytest.approx(np.sqrt((1 + r) / (1 - r)), rel=1e-9)
