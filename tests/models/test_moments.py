"""From readings to cross-products: rises, lags, gaps, pieces and blocks, against direct numpy."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from selector.models.design import (
    Columns,
    Design,
    Lag,
    Scaling,
    block_bounds,
    datum_of,
    design_matrix,
    polynomial_terms,
    rows_of,
)
from selector.models.moments import centred, coefficients, moments, scaling_of, squared_error
from selector.recording import thinned
from tests.models.runs import InPieces, recording


def source(n: int = 240, gaps: float = 0.03):
    rng = np.random.default_rng(5)
    made = {}
    for r, run in enumerate(["a", "b", "c"]):
        t = np.cumsum(rng.uniform(5.0, 15.0, n + 10 * r))
        warm = 6 * (1 - np.exp(-t / 600)) + rng.normal(0, 0.05, len(t))
        slow = 3 * (1 - np.exp(-t / 1500)) + rng.normal(0, 0.05, len(t))
        z = 8 * warm - 3 * slow + rng.normal(0, 0.3, len(t))
        values = {"T1": 20 + r + warm, "T2": 19 + slow, "Z": z, "Y": -0.5 * z + rng.normal(0, 0.3, len(t))}
        for name in values:
            late = rng.random(len(t)) < gaps
            late[:30] = False
            values[name] = np.where(late, np.nan, values[name])
        made[run] = (t, values)
    return recording(made)


LAG = Lag("T1", 300.0)


def design_on(recorded, lags=(LAG,)):
    datum = datum_of(recorded, ("T1", "T2"), ("Z", "Y"), "rise")
    return Design(("T1", "T2"), ("Z", "Y"), datum, tuple(lags))


def columns_on(recorded, design):
    terms = polynomial_terms(design.variables, 2, interactions=True)
    return Columns(scaling_of(recorded, design), terms)


def test_variables_of_a_design():
    assert design_on(source()).variables == ("T1", "T2", "T1.lag300s")


def test_pieces_hold_rises_and_leave_out_what_is_not_complete():
    recorded = source()
    design = design_on(recorded, lags=())
    piece = next(iter(design.pieces(recorded, "b")))
    raw = recorded.values("b", ["T1", "T2", "Z", "Y"])
    complete = np.isfinite(raw).all(axis=1)
    assert len(piece.time_s) == complete.sum() < len(raw)
    levels = [design.datum.level("b", name) for name in ("T1", "T2", "Z", "Y")]
    assert np.array_equal(np.column_stack([piece.variables, piece.responses]), raw[complete] - levels)
    everything = next(iter(design.pieces(recorded, "b", complete=False)))
    assert len(everything.time_s) == len(raw)


def test_scaling_is_mean_and_standard_deviation_of_complete_samples():
    recorded = source()
    design = design_on(recorded)
    rows = rows_of(recorded, design, recorded.runs)
    scaling = scaling_of(recorded, design)
    assert scaling.centre == pytest.approx(rows.variables.mean(axis=0), rel=1e-12)
    assert scaling.scale == pytest.approx(rows.variables.std(axis=0, ddof=1), rel=1e-12)


def test_scaling_of_a_variable_that_rests_is_one():
    t = np.arange(50.0)
    recorded = recording({"a": (t, {"T1": np.full(50, 21.7), "Z": t})})
    design = Design(("T1",), ("Z",), datum_of(recorded, ("T1",), ("Z",), "absolute"))
    assert scaling_of(recorded, design) == Scaling(("T1",), (21.7,), (1.0,))


@pytest.mark.parametrize("n_blocks", [1, 4])
def test_moments_are_the_cross_products_of_the_rows(n_blocks):
    recorded = source()
    design = design_on(recorded)
    columns = columns_on(recorded, design)
    found = moments(recorded, design, columns, n_blocks=n_blocks)
    assert len(found.folds) == 3 * n_blocks
    rows = rows_of(recorded, design, recorded.runs)
    labels = rows.blocks(n_blocks)
    for fold, product in zip(found.folds, found.products, strict=True):
        mine = (rows.run == recorded.runs.index(fold.runs[0])) & (labels == (fold.block or 0))
        w = np.column_stack([np.ones(mine.sum()), columns.matrix(rows.variables[mine]), rows.responses[mine]])
        # sums of 240 products: 1e-14, and the order of summation may differ
        assert product == pytest.approx(w.T @ w, rel=1e-11, abs=1e-9)
        assert fold.name == (fold.runs[0] if n_blocks == 1 else f"{fold.runs[0]} block {fold.block + 1}")


@pytest.mark.parametrize("size", [1, 7, 64])
@pytest.mark.parametrize("n_blocks", [1, 3])
def test_moments_of_pieces_are_those_of_the_whole(size, n_blocks):
    recorded = source(60)
    design = design_on(recorded)
    columns = columns_on(recorded, design)
    whole = moments(recorded, design, columns, n_blocks=n_blocks)
    pieces = moments(InPieces(recorded, size), design, columns, n_blocks=n_blocks)
    assert pieces.folds == whole.folds
    assert pieces.products == pytest.approx(whole.products, rel=1e-11, abs=1e-9)
    cut = scaling_of(InPieces(recorded, size), design)
    assert cut.centre == pytest.approx(columns.scaling.centre, rel=1e-12)
    assert cut.scale == pytest.approx(columns.scaling.scale, rel=1e-12)


def test_a_bootstrap_counts_a_fold_several_times():
    recorded = source(60)
    design = design_on(recorded)
    found = moments(recorded, design, columns_on(recorded, design))
    twice = found.only([0, 0, 2])
    assert np.array_equal(twice.products.sum(axis=0), found.products[0] * 2 + found.products[2])
    assert [fold.name for fold in twice.folds] == ["a", "a", "c"]
    assert [fold.name for fold in found.only([1]).folds] == ["b"]


def test_centred_cross_products():
    recorded = source()
    design = design_on(recorded)
    columns = columns_on(recorded, design)
    rows = rows_of(recorded, design, recorded.runs)
    w = np.column_stack([columns.matrix(rows.variables), rows.responses])
    w = w - w.mean(axis=0)
    cross, n = centred(moments(recorded, design, columns).whole)
    assert n == len(rows.run)
    assert cross == pytest.approx(w.T @ w, rel=1e-9, abs=1e-7)  # the responses are not centred before summing


def test_coefficients_and_their_error_are_those_of_least_squares():
    recorded = source()
    design = design_on(recorded)
    columns = columns_on(recorded, design)
    products = moments(recorded, design, columns).products
    rows = rows_of(recorded, design, recorded.runs)
    k = len(columns.terms)
    chosen = [0, 1, 4]
    x = np.column_stack([np.ones(len(rows.run)), columns.matrix(rows.variables)[:, chosen]])
    expected, rss, *_ = np.linalg.lstsq(x, rows.responses, rcond=None)
    total = products.sum(axis=0)
    at = [1 + c for c in chosen]
    beta = coefficients(total, at, [1 + k, 2 + k])
    assert beta == pytest.approx(expected, rel=1e-8, abs=1e-9)  # normal equations of condition number 1e4
    assert squared_error(total, at, [1 + k, 2 + k], beta) == pytest.approx(rss, rel=1e-8)
    stacked = coefficients(products, at, [1 + k])
    for r in range(3):
        own = np.linalg.lstsq(x[rows.run == r], rows.responses[rows.run == r, :1], rcond=None)[0]
        assert stacked[r] == pytest.approx(own, rel=1e-6, abs=1e-7)


def test_columns_that_depend_on_each_other_share_the_coefficient():
    rng = np.random.default_rng(0)
    x = rng.normal(size=100)
    y = 3 * x + rng.normal(0, 0.1, 100)
    w = np.column_stack([np.ones(100), x, x, y])
    beta = coefficients(w.T @ w, [1, 2], [3])
    assert beta[1] == pytest.approx(beta[2], rel=1e-6)
    alone = np.linalg.lstsq(w[:, :2], y, rcond=None)[1][0]
    assert squared_error(w.T @ w, [1, 2], [3], beta)[0] == pytest.approx(alone, rel=1e-9)


class TestRows:
    def test_holds_the_runs_one_after_the_other(self):
        recorded = source()
        design = design_on(recorded, lags=())
        rows = rows_of(recorded, design, ["c", "a"])
        assert rows.runs == ("c", "a")
        assert np.all(np.diff(rows.run) >= 0)
        first = next(iter(design.pieces(recorded, "c")))
        assert np.array_equal(rows.variables[rows.run == 0], first.variables)
        assert np.array_equal(rows.time_s[rows.run == 0], first.time_s)

    @pytest.mark.parametrize("size", [None, 1, 7])
    @pytest.mark.parametrize("stride", [1, 3, 1000])
    def test_thinning_takes_every_nth_sample_however_a_run_is_cut(self, size, stride):
        recorded = source()
        few = thinned(InPieces(recorded, size) if size else recorded, stride)
        assert few.runs == recorded.runs
        for run in recorded.runs:
            assert np.array_equal(few.time_s(run), recorded.time_s(run)[::stride])
            assert np.array_equal(
                few.values(run, few.names), recorded.values(run, few.names)[::stride], equal_nan=True
            )  # fmt: skip

    def test_no_complete_sample_gives_empty_rows(self):
        t = np.arange(10.0)
        recorded = recording({"a": (t, {"T1": t, "Z": np.full(10, np.nan)})})
        design = Design(("T1",), ("Z",), datum_of(recorded, ("T1",), ("Z",), "absolute"))
        rows = rows_of(recorded, design, ["a"])
        assert rows.variables.shape == (0, 1)
        assert rows.responses.shape == (0, 1)

    @pytest.mark.parametrize("n", [8, 100, 1001])
    @pytest.mark.parametrize("n_blocks", [1, 2, 5, 8])
    def test_blocks_are_in_order_apart_and_cover_the_ends(self, n, n_blocks):
        bounds = block_bounds(n, n_blocks)
        assert len(bounds) == n_blocks
        assert bounds[0][0] == 0
        assert bounds[-1][1] == n
        for (_, stop), (start, _) in itertools.pairwise(bounds):
            assert stop < start  # a purge of at least one sample on each side

    def test_block_labels_of_rows(self):
        recorded = source(gaps=0.0)
        rows = rows_of(recorded, design_on(recorded), recorded.runs)
        labels = rows.blocks(4)
        for r in range(3):
            mine = labels[rows.run == r]
            for i, (start, stop) in enumerate(block_bounds(len(mine), 4)):
                assert set(mine[start:stop]) == {i}
            assert (mine == -1).sum() == len(mine) - sum(b - a for a, b in block_bounds(len(mine), 4))


def test_design_matrix_of_columns():
    recorded = source(60)
    design = design_on(recorded)
    columns = columns_on(recorded, design)
    x = np.array([[1.0, 2.0, 3.0]])
    assert np.array_equal(
        columns.matrix(x), design_matrix(columns.scaling.scaled(x), design.variables, columns.terms)
    )  # fmt: skip
