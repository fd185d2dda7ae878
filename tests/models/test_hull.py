"""Inside or outside the recorded inputs, and how far: against geometry and against SciPy."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial import Delaunay

from selector.models.least_squares import validity_hull


def square():
    """The unit square's corners and inside, with known standard deviation."""
    g = np.linspace(0, 1, 11)
    return np.array([(a, b) for a in g for b in g])


def test_inside_is_zero():
    hull = validity_hull(square())
    rng = np.random.default_rng(0)
    assert hull.distance(rng.uniform(0, 1, (50, 2))).tolist() == [0.0] * 50


@pytest.mark.parametrize(
    ("point", "distance"), [((1.5, 0.5), 0.5), ((0.5, -2.0), 2.0), ((2.0, 2.0), np.sqrt(2)), ((-3.0, 1.0), 3.0)]
)
def test_distances_to_a_square(point, distance):
    inputs = square()
    hull = validity_hull(inputs)
    # in standard deviations, which are equal here; the weights' sum is met to 1e-8
    assert hull.distance(np.array([point]))[0] == pytest.approx(distance / inputs.std(axis=0)[0], rel=1e-6)


def test_distance_counts_each_input_in_its_own_standard_deviation():
    inputs = square() * [1.0, 1000.0]
    hull = validity_hull(inputs)
    assert hull.distance(np.array([[0.5, 1500.0]]))[0] == pytest.approx(0.5 / square().std(axis=0)[0], rel=1e-6)


def test_the_box():
    hull = validity_hull(square() * [1.0, 3.0] + 5.0)
    assert (hull.low.tolist(), hull.high.tolist()) == ([5.0, 5.0], [6.0, 8.0])


def test_between_two_ways_of_warming_lies_outside():
    """Each input within its range and yet no recorded combination: what a range check does not see."""
    t = np.linspace(0, 1, 200)
    inputs = np.column_stack([10 * t, 10 * t]) + np.random.default_rng(0).normal(0, 0.1, (200, 2))
    hull = validity_hull(inputs)
    point = np.array([[9.0, 1.0]])
    assert np.all((hull.low < point) & (point < hull.high))
    assert hull.distance(point)[0] > 1.0


@pytest.mark.parametrize("dimensions", [1, 2, 3, 5])
def test_membership_agrees_with_scipy(dimensions):
    rng = np.random.default_rng(dimensions)
    shear = rng.normal(size=(dimensions, dimensions))
    inputs = rng.uniform(-1, 1, (60, dimensions)) @ shear
    points = rng.uniform(-1.3, 1.3, (80, dimensions)) @ shear
    distance = validity_hull(inputs).distance(points)
    if dimensions == 1:
        inside = (points[:, 0] >= inputs.min()) & (points[:, 0] <= inputs.max())
    else:
        inside = Delaunay(inputs).find_simplex(points) >= 0
    assert 0 < inside.sum() < 80
    assert np.all(distance[~inside] > 0)
    # a vertex that sticks out of few directions may have been left out, with the sliver under it
    assert np.mean(distance[inside] == 0.0) > 0.8
    assert distance[inside].max() < 0.05


def test_a_needle_is_seen_in_its_width_too():
    """Temperatures that rise together: the width of the cloud is 1 % of its length, and still no sample is outside."""
    rng = np.random.default_rng(0)
    inputs = rng.uniform(0, 10, (500, 1)) + rng.uniform(-0.05, 0.05, (500, 4))
    hull = validity_hull(inputs)
    assert np.mean(hull.distance(inputs) == 0.0) > 0.6
    assert hull.distance(inputs).max() < 0.01
    whole = dataclasses.replace(hull, points=inputs / hull.scale)
    off = inputs[::50] + rng.normal(0, 0.3, (10, 4))
    assert whole.distance(off).min() > 0.02
    assert hull.distance(off) == pytest.approx(whole.distance(off), abs=0.01)


def test_many_samples_are_thinned_and_slivers_only_are_lost():
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=(20_000, 3))
    hull = validity_hull(inputs)
    assert len(hull.points) < 1000
    # of the samples themselves, those in slivers lie outside by less than the spacing of the outermost points
    distance = hull.distance(inputs[::40])
    assert np.mean(distance == 0.0) > 0.95
    assert distance.max() < 0.8
    assert hull.distance(np.array([[6.0, 0.0, 0.0]]))[0] > 1.0


def test_an_input_at_rest_has_scale_one():
    inputs = np.column_stack([np.linspace(0, 1, 50), np.full(50, 20.0)])
    hull = validity_hull(inputs)
    assert hull.distance(np.array([[0.5, 20.0]]))[0] == 0.0
    assert hull.distance(np.array([[0.5, 22.0]]))[0] == pytest.approx(2.0, rel=1e-6)


def test_one_sample_is_a_hull_of_one_point():
    hull = validity_hull(np.array([[1.0, 2.0]]))
    assert hull.distance(np.array([[1.0, 2.0], [4.0, 6.0]])) == pytest.approx([0.0, 5.0], rel=1e-6)
