"""The scikit-learn side: its own conformance checks, and the same numbers as the functions underneath."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from selector.estimators import BestSubsetRegressor, FuzzyClusterSelector, ThermalRegressor
from selector.sensors import lambda_cut, transitive_closure

ESTIMATORS = [
    FuzzyClusterSelector(),
    FuzzyClusterSelector(level=0.9, absolute=True),
    BestSubsetRegressor(),
    BestSubsetRegressor(max_size=2, criterion="bic", fit_intercept=False),
    ThermalRegressor(),
]


@parametrize_with_checks(ESTIMATORS)
def test_scikit_learn_conformance(estimator, check):
    check(estimator)


def warming(n: int = 300, seed: int = 0) -> tuple[pd.DataFrame, pd.Series]:
    """Two groups of sensors on a warming machine, and a displacement that needs one of each [°C, µm]."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 5.0, n)
    spindle, column = 8.0 * (1 - np.exp(-t)), 4.0 * np.sin(1.3 * t) + t
    sensors = {"T1": spindle, "T2": 0.9 * spindle, "T3": column, "T4": 1.1 * column, "T5": 0.5 * column}
    noise = {"T1": 0.02, "T2": 0.2, "T3": 0.02, "T4": 0.2, "T5": 0.1}
    frame = pd.DataFrame({name: values + rng.normal(0, noise[name], n) for name, values in sensors.items()})
    return frame, pd.Series(6.0 * spindle + 2.5 * column + rng.normal(0, 0.3, n), name="Z")


class TestFuzzyClusterSelector:
    def test_keeps_the_most_relevant_of_each_group(self):
        X, y = warming()
        found = FuzzyClusterSelector(level=0.98).fit(X, y)
        assert found.partition_.groups == (("T1", "T2"), ("T3", "T4", "T5"))
        relevance = X.corrwith(y).abs()
        best = [max(group, key=relevance.get) for group in found.partition_.groups]
        assert list(found.get_feature_names_out()) == best
        assert found.get_support().tolist() == [name in best for name in X.columns]
        assert found.transform(X).shape == (300, 2)

    def test_attributes_are_those_of_the_functions(self):
        X, y = warming()
        found = FuzzyClusterSelector(level=0.97).fit(X, y)
        assert found.similarity_ == pytest.approx(np.corrcoef(X.T), abs=1e-12)  # rounding of two summation orders
        assert np.array_equal(found.closure_, transitive_closure(found.similarity_))
        assert found.partition_ == lambda_cut(found.similarity_, 0.97, X.columns)
        assert found.level_ == (0.97,)

    def test_auto_finds_the_groups_that_stand_out(self):
        X, y = warming()
        assert FuzzyClusterSelector().fit(X, y).partition_.groups == (("T1", "T2"), ("T3", "T4", "T5"))

    def test_auto_keeps_everything_when_nothing_stands_out(self):
        rng = np.random.default_rng(1)
        found = FuzzyClusterSelector().fit(rng.normal(size=(500, 4)), rng.normal(size=500))
        assert found.get_support().all()

    def test_rounds_at_falling_levels_keep_fewer(self):
        X, y = warming()
        first = FuzzyClusterSelector(level=0.995).fit(X, y)
        second = FuzzyClusterSelector(level=(0.995, 0.5), rounds=2).fit(X, y)
        assert len(second.rounds_) == 2
        assert set(second.representatives_) < set(first.representatives_)

    def test_mirror_images_stand_together_only_when_absolute(self):
        X, y = warming()
        X = X.assign(M=-X["T1"])
        assert ("M",) in FuzzyClusterSelector(level=0.98).fit(X, y).partition_.groups
        assert ("T1", "T2", "M") in FuzzyClusterSelector(level=0.98, absolute=True).fit(X, y).partition_.groups

    def test_a_sensor_that_never_moves_is_not_kept(self):
        X, y = warming()
        kept = FuzzyClusterSelector(level=0.98).fit(X.assign(C=20.0), y).get_feature_names_out()
        assert "C" not in kept

    def test_pandas_out(self):
        X, y = warming()
        selector = FuzzyClusterSelector(level=0.98).set_output(transform="pandas").fit(X, y)
        pd.testing.assert_frame_equal(selector.transform(X), X.loc[:, selector.get_support()])

    def test_keeps_the_dtype(self):
        X, y = warming()
        assert FuzzyClusterSelector().fit_transform(X.astype(np.float32), y).dtype == np.float32

    @pytest.mark.parametrize(
        ("parameters", "message"),
        [
            ({"level": 1.5}, r"λ = 1\.5"),
            ({"level": "high"}, "auto"),
            ({"level": ()}, "empty"),
            ({"rounds": 0}, "rounds must be a whole number"),
        ],
    )
    def test_refuses(self, parameters, message):
        with pytest.raises(ValueError, match=message):
            FuzzyClusterSelector(**parameters).fit(*warming())

    def test_refuses_columns_that_all_rest(self):
        with pytest.raises(ValueError, match="No feature moves"):
            FuzzyClusterSelector().fit(np.ones((10, 2)), np.arange(10.0))


class TestBestSubsetRegressor:
    @pytest.mark.parametrize("intercept", [True, False])
    def test_is_the_best_of_all_subsets(self, intercept):
        rng = np.random.default_rng(2)
        X = rng.normal(size=(40, 6)) @ rng.normal(size=(6, 6)) + 3.0
        y = X @ [1.0, 0.0, -2.0, 0.0, 0.5, 0.0] + rng.normal(size=40)
        found = BestSubsetRegressor(fit_intercept=intercept).fit(X, y)

        def adjusted(columns: tuple[int, ...]) -> float:
            design = np.column_stack([np.ones(40), X[:, columns]]) if intercept else X[:, columns]
            rss = float(np.linalg.lstsq(design, y, rcond=None)[1][0])
            total = float(((y - y.mean() * intercept) ** 2).sum())
            return 1 - rss / total * (40 - intercept) / (40 - intercept - len(columns))

        every = (c for size in range(1, 7) for c in itertools.combinations(range(6), size))
        assert tuple(np.flatnonzero(found.support_)) == max(every, key=adjusted)
        assert found.search_.proved

    def test_coefficients_are_least_squares(self):
        X, y = warming()
        found = BestSubsetRegressor(max_size=2).fit(X, y)
        columns = np.flatnonzero(found.support_)
        design = np.column_stack([np.ones(len(X)), X.to_numpy()[:, columns]])
        beta = np.linalg.lstsq(design, y.to_numpy(), rcond=None)[0]
        assert found.intercept_ == pytest.approx(beta[0], rel=1e-9)  # condition number 20: 1e-14 and slack
        assert found.coef_[columns] == pytest.approx(beta[1:], rel=1e-9)
        assert found.predict(X) == pytest.approx(design @ beta, abs=1e-9)

    @pytest.mark.parametrize("criterion", ["adjusted_r2", "aicc", "bic", "cp"])
    def test_the_criterion_chooses_the_size(self, criterion):
        X, y = warming()
        found = BestSubsetRegressor(criterion=criterion).fit(X, y)
        assert tuple(np.flatnonzero(found.support_)) == found.search_.best(criterion).columns

    def test_refuses(self):
        X, y = warming()
        with pytest.raises(ValueError, match="criterion"):
            BestSubsetRegressor(criterion="r2").fit(X, y)
        with pytest.raises(ValueError, match="max_size"):
            BestSubsetRegressor(max_size=0).fit(X, y)
        with pytest.raises(ValueError, match="does not vary"):
            BestSubsetRegressor().fit(X, np.full(len(X), 2.0))


class TestThermalRegressor:
    def test_finds_one_sensor_of_each_group(self):
        X, y = warming()
        found = ThermalRegressor().fit(X, y)
        assert set(found.sensors_) == {"T1", "T3"}
        assert X.columns[found.support_].tolist() == ["T1", "T3"]
        assert found.selection_.proof.left_out == "block"
        # the noise of the displacement is 0.3; sensor noise 0.02 K times 6 µm/K adds a tenth, eight blocks the rest
        assert 0.25 < found.heldout_rmse_ < 0.45

    def test_runs_are_left_out_whole_and_may_be_interleaved(self):
        parts = [warming(120, seed) for seed in range(4)]
        X = pd.concat([part[0] for part in parts], ignore_index=True)
        y = pd.concat([part[1] for part in parts], ignore_index=True)
        runs = np.repeat(["mon", "tue", "wed", "thu"], 120)
        together = ThermalRegressor().fit(X, y, runs=runs)
        assert together.selection_.proof.left_out == "run"
        names = [part.name for part in together.selection_.proof.per_response["y"]]
        assert names == ["mon", "tue", "wed", "thu"]
        mixed = np.arange(480).reshape(4, 120).T.ravel()
        apart = ThermalRegressor().fit(X.iloc[mixed], y.iloc[mixed], runs=runs[mixed])
        assert np.array_equal(apart.predict(X), together.predict(X))

    def test_squares_and_products_are_offered_on_request(self):
        rng = np.random.default_rng(3)
        X = rng.uniform(0, 10, (240, 3))
        y = X[:, 0] + 0.4 * X[:, 0] * X[:, 1] + rng.normal(0, 0.1, 240)
        runs = np.repeat(np.arange(4), 60)
        plain = ThermalRegressor().fit(X, y, runs=runs)
        rich = ThermalRegressor(degree=2, interactions=True).fit(X, y, runs=runs)
        assert plain.heldout_rmse_ > 1.0
        assert rich.heldout_rmse_ == pytest.approx(0.1, rel=0.15)  # standard deviation of 240 samples: 5 %
        assert "x0·x1" in [str(term) for term in rich.model_.terms]

    def test_a_column_named_like_the_response_does_no_harm(self):
        X, y = warming()
        found = ThermalRegressor().fit(X.rename(columns={"T1": "y", "T2": "yy"}), y)
        assert set(found.sensors_) == {"y", "T3"}

    @pytest.mark.parametrize(
        ("parameters", "message"),
        [({"degree": 4}, "degree 4"), ({"max_sensors": 0}, "max_sensors"), ({"level": 2.0}, "λ = 2")],
    )
    def test_refuses(self, parameters, message):
        with pytest.raises(ValueError, match=message):
            ThermalRegressor(**parameters).fit(*warming(60))

    def test_refuses_runs_of_another_length(self):
        X, y = warming(60)
        with pytest.raises(ValueError, match="inconsistent numbers of samples"):
            ThermalRegressor().fit(X, y, runs=np.zeros(59))


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=repr)
class TestEveryEstimator:
    def test_refuses_missing_values_in_scikit_learns_words(self, estimator):
        X, y = warming(60)
        X.iloc[5, 1] = np.nan
        with pytest.raises(ValueError, match="Input X contains NaN"):
            clone(estimator).fit(X, y)

    def test_knows_its_columns(self, estimator):
        X, y = warming(60)
        found = clone(estimator).fit(X, y)
        assert list(found.feature_names_in_) == list(X.columns)
        assert found.n_features_in_ == 5
        with pytest.raises(ValueError, match="feature names should match"):
            (found.predict if hasattr(found, "predict") else found.transform)(X[X.columns[::-1]])

    def test_survives_pickling(self, estimator):
        X, y = warming(60)
        found = clone(estimator).fit(X, y)
        again = pickle.loads(pickle.dumps(found))
        use = "predict" if hasattr(found, "predict") else "transform"
        assert np.array_equal(getattr(again, use)(X), getattr(found, use)(X))

    def test_says_when_it_is_not_fitted(self, estimator):
        X, _ = warming(60)
        with pytest.raises(NotFittedError):
            (estimator.predict if hasattr(estimator, "predict") else estimator.transform)(X.to_numpy())


def test_pipeline_and_grid_search():
    X, y = warming()
    pipeline = make_pipeline(FuzzyClusterSelector(), StandardScaler(), BestSubsetRegressor())
    grid = {"fuzzyclusterselector__level": [-0.5, 0.98], "bestsubsetregressor__criterion": ["bic", "adjusted_r2"]}
    found = GridSearchCV(pipeline, grid, cv=GroupKFold(5)).fit(X, y, groups=np.arange(300) // 15)
    # at -0.5 there is one group: its one sensor cannot follow two motions
    assert found.best_params_["fuzzyclusterselector__level"] == 0.98
    one_group = found.cv_results_["param_fuzzyclusterselector__level"] == -0.5
    assert found.best_score_ > 0.99 > 0.95 > found.cv_results_["mean_test_score"][one_group].max()


def test_thermal_regressor_in_cross_validation():
    X, y = warming(200)
    scores = cross_val_score(ThermalRegressor(max_sensors=2), X, y, cv=GroupKFold(2), groups=np.arange(200) // 50 % 2)
    assert scores.min() > 0.99
