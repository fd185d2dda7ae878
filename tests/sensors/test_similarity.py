from __future__ import annotations

import numpy as np
import pytest

from selector.errors import InputError
from selector.sensors import (
    constant_limit,
    correlation_similarity,
    sensor_names,
    similarity_findings,
    similarity_from_cross_products,
)


@pytest.fixture
def warming():
    """Six hours of a warming machine: bearing, motor, column, oil cooler that falls, and a dead channel."""
    t = np.linspace(0, 6, 361)
    rng = np.random.default_rng(1)
    bearing = 20 + 9 * (1 - np.exp(-t / 1.0))
    motor = 20 + 14 * (1 - np.exp(-t / 0.7))
    column = 20 + 3 * (1 - np.exp(-t / 3.0))
    cooler = 25 - 4 * (1 - np.exp(-t / 1.1))
    noisy = np.column_stack([bearing, motor, column, cooler]) + 0.01 * rng.standard_normal((361, 4))
    return np.column_stack([noisy, np.full(361, 23.4)])


def test_is_pearsons_correlation(warming):
    live = warming[:, :4]
    similarity = correlation_similarity(live)
    # both round sums of 361 products: a few hundred ulp at most
    assert similarity.matrix == pytest.approx(np.corrcoef(live, rowvar=False), abs=1e-13)
    assert (similarity.rows_used, similarity.rows_left_out) == (361, 0)
    assert not similarity.matrix.flags.writeable


def test_is_exactly_symmetric_with_unit_diagonal_and_bounded():
    rng = np.random.default_rng(0)
    samples = rng.standard_normal((5, 40)) @ rng.standard_normal((40, 40)) * 10.0 ** rng.uniform(-8, 8, 40)
    r = correlation_similarity(samples).matrix
    assert np.array_equal(r, r.T)
    assert (np.diag(r) == 1).all()
    assert np.abs(r).max() <= 1


def test_cross_products_give_the_same_as_rows(warming):
    centred = warming - warming.mean(axis=0)
    limit = constant_limit(np.abs(warming).max(axis=0), len(warming))
    from_rows = correlation_similarity(warming)
    from_products = similarity_from_cross_products(centred.T @ centred, constant_at=limit)
    # scaled before summing in one case only: rounding of 361 products
    assert from_products.matrix == pytest.approx(from_rows.matrix, abs=1e-13)
    assert from_products.constant == from_rows.constant == (4,)
    assert similarity_from_cross_products(np.cov(warming, rowvar=False)).constant == (4,)


def test_unit_of_a_sensor_does_not_matter(warming):
    live = warming[:, :4]
    fahrenheit = live * [1.8, 1, 1, 1] + [32, 0, 0, 0]
    # the conversion rounds readings near 70 to 1e-14, against a spread of several kelvin
    assert correlation_similarity(fahrenheit).matrix == pytest.approx(correlation_similarity(live).matrix, abs=1e-12)


def test_constant_sensor_is_like_nothing_but_itself(warming):
    similarity = correlation_similarity(warming)
    assert similarity.constant == (4,)
    assert similarity.matrix[4].tolist() == [0, 0, 0, 0, 1]
    assert similarity.matrix[:, 4].tolist() == [0, 0, 0, 0, 1]


@pytest.mark.parametrize(("spread", "constant"), [(3e-10, (0,)), (3e-9, ()), (0.0, (0,))])
def test_constant_is_relative_to_the_magnitude(spread, constant):
    wave = np.sin(np.arange(1000.0))  # standard deviation 0.707
    other = np.cos(np.arange(1000.0))
    for magnitude in (1e-6, 1.0, 3e5):
        samples = np.column_stack([magnitude * (1 + spread * wave), other])
        similarity = correlation_similarity(samples)
        assert similarity.constant == constant
        if constant:
            # its rounding noise may correlate with anything; none of that is passed on
            assert np.array_equal(similarity.matrix, np.eye(2))


def test_all_constant_sensors():
    similarity = correlation_similarity(np.full((10, 3), [0.0, 21.5, -4.0]))
    assert similarity.constant == (0, 1, 2)
    assert np.array_equal(similarity.matrix, np.eye(3))
    assert similarity.duplicates == ()
    assert similarity_from_cross_products(np.zeros((2, 2))).constant == (0, 1)


def test_constant_by_a_given_limit_hides_even_a_perfect_correlation():
    cross = [[4.0, 2e-10], [2e-10, 1e-20]]
    assert similarity_from_cross_products(cross, constant_at=0.0).duplicates == ((0, 1),)
    hidden = similarity_from_cross_products(cross, constant_at=constant_limit([20.0, 20.0], 100))
    assert hidden.constant == (1,)
    assert np.array_equal(hidden.matrix, np.eye(2))


def test_duplicates_up_to_scale_stand_once_with_the_first(warming):
    live = warming[:, :4]
    samples = np.column_stack([live, live[:, 0], 1.8 * live[:, 0] + 32, live[:, 2] + 1e-4 * warming[::-1, 1]])
    similarity = correlation_similarity(samples)
    assert similarity.duplicates == ((0, 4), (0, 5))
    mirrored = correlation_similarity(np.column_stack([live[:, 0], 50 - live[:, 0]]))
    assert mirrored.duplicates == ((0, 1),)
    assert [(i, j) for i, j, _ in mirrored.anticorrelated] == [(0, 1)]


def test_anticorrelated_sensors_and_the_absolute_option(warming):
    signed = correlation_similarity(warming)
    absolute = correlation_similarity(warming, absolute=True)
    assert signed.matrix[0, 3] < -0.99
    assert np.array_equal(absolute.matrix, np.abs(signed.matrix))
    assert signed.anticorrelated == absolute.anticorrelated
    assert (0, 3, signed.matrix[0, 3]) in signed.anticorrelated
    assert all(i < j and r <= -0.9 for i, j, r in signed.anticorrelated)


def test_incomplete_rows_are_left_out_for_all_sensors_and_counted(warming):
    damaged = warming[:, :4].copy()
    damaged[10:20, 1] = np.nan
    damaged[15:30, 2] = np.nan
    similarity = correlation_similarity(damaged)
    assert (similarity.rows_used, similarity.rows_left_out) == (341, 20)
    complete = np.delete(warming[:, :4], np.s_[10:30], axis=0)
    assert np.array_equal(similarity.matrix, correlation_similarity(complete).matrix)


def test_extreme_magnitudes_neither_overflow_nor_underflow():
    rng = np.random.default_rng(3)
    base = rng.standard_normal((50, 3))
    expected = correlation_similarity(base).matrix
    # scaling by powers of two changes no digit; the rest rounds
    assert correlation_similarity(base * [1e300, 1e-300, 1.0]).matrix == pytest.approx(expected, abs=1e-12)
    # squares of 1e-160 are below the smallest float with full digits, so cross-products themselves are limited
    centred = (base - base.mean(axis=0)) * [1e150, 1e-150, 1.0]
    similarity = similarity_from_cross_products(centred.T @ centred, constant_at=0.0)
    assert similarity.matrix == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (np.empty((5, 0)), "at least one sensor"),
        (np.arange(5.0), "one column per sensor"),
        (np.empty((0, 3)), "0 of 0 rows"),
        (np.ones((2, 3)), "2 of 2 rows are complete"),
        (np.column_stack([np.arange(9.0), np.full(9, np.nan)]), "column 1 lacks 9"),
        ([[1.0, 2.0], [2.0, np.inf], [3.0, 1.0]], "infinite values in column 1"),
    ],
)
def test_unusable_samples(samples, message):
    with pytest.raises(InputError, match=message):
        correlation_similarity(samples)


@pytest.mark.parametrize(
    ("cross", "message"),
    [
        (np.empty((0, 0)), "at least one sensor"),
        (np.ones((2, 3)), "square"),
        ([[1.0, np.nan], [np.nan, 1.0]], r"nan at \(0, 1\)"),
        ([[1.0, 0.5], [0.2, 1.0]], "symmetric"),
        ([[1.0, 2.0], [2.0, 1.0]], r"\|r\| = 2 for sensors 0 and 1"),
        ([[-1.0, 0.0], [0.0, 1.0]], "negative sum of squares for sensor 0"),
    ],
)
def test_unusable_cross_products(cross, message):
    with pytest.raises(InputError, match=message):
        similarity_from_cross_products(cross)


def test_findings_name_the_sensors_and_say_what_is_done(warming):
    samples = np.column_stack([warming, warming[:, 0]])
    samples[0, 1] = np.nan
    names = ["bearing", "motor", "column", "cooler", "dead", "again"]
    findings = similarity_findings(correlation_similarity(samples), names)
    by_id = {}
    for finding in findings:
        by_id.setdefault(finding.id, []).append(finding)
    assert [f.where.channel for f in by_id["constant-sensor"]] == ["dead"]
    assert [(f.where.channel, f.evidence["duplicate_of"]) for f in by_id["duplicate-sensors"]] == [("again", "bearing")]
    pairs = {(f.evidence["other"], f.where.channel) for f in by_id["anticorrelated-sensors"]}
    assert ("bearing", "cooler") in pairs
    assert by_id["incomplete-rows"][0].evidence == {"left_out": 1, "used": 360}
    assert similarity_findings(correlation_similarity(warming[:, :2])) == ()


def test_names_must_fit():
    assert sensor_names((), 3) == ("x0", "x1", "x2")
    for names in (["a"], ["a", "a"]):
        with pytest.raises(InputError, match="2 sensors"):
            sensor_names(names, 2)
