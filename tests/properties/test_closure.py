"""What holds of closure and cuts for every similarity relation; independent programs as oracles."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import skfuzzy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.cluster.hierarchy import cophenet, fcluster, is_valid_linkage, leaves_list, linkage
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import squareform

from selector.errors import InputError
from selector.sensors import (
    Partition,
    closure_chain,
    dendrogram,
    lambda_axis,
    lambda_cut,
    similarity_from_cross_products,
    transitive_closure,
)
from tests.sensors.by_definition import f_statistic, max_min_composition, transitive_closure_by_squaring

MANY = settings(max_examples=125)


@st.composite
def relations(draw, largest: int = 16):
    """Symmetric, unit diagonal: few levels (ties), any levels, low levels, or correlations of few samples."""
    n = draw(st.integers(1, largest))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    kind = draw(st.sampled_from(["ties", "signed", "low", "high", "correlation"]))
    if kind == "correlation":
        samples = rng.standard_normal((n, draw(st.integers(1, 5))))
        return similarity_from_cross_products(samples @ samples.T).matrix.copy()
    if kind == "ties":
        levels = draw(st.lists(st.floats(-1, 1), min_size=1, max_size=4))
        entries = rng.choice(np.array(levels) + 0.0, (n, n))
    else:
        low, high = {"signed": (-1, 1), "low": (0, 0.1), "high": (0.99, 1)}[kind]
        entries = rng.uniform(low, high, (n, n))
    upper = np.triu(entries, 1)
    return upper + upper.T + np.eye(n) + 0.0


def grouping(labels) -> frozenset[frozenset[int]]:
    return frozenset(frozenset(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels))


def is_nested(fine: Partition, coarse: Partition) -> bool:
    """Whether every group of the fine one lies within one group of the coarse one."""
    return len(set(zip(fine.labels, coarse.labels, strict=True))) == len(fine.members)


def components(r, level) -> frozenset[frozenset[int]]:
    return grouping(connected_components(r >= level, directed=False)[1])


def ranks_from_the_top(r):
    """1 for the greatest similarity, 2 for the next …: small whole numbers, so that SciPy cannot lose bits."""
    values = np.unique(r)[::-1]
    ranks = np.searchsorted(-values, -r) + 1.0
    np.fill_diagonal(ranks, 0)
    return values, ranks


@MANY
@given(relations())
def test_equals_squaring_bit_for_bit(r):
    slow, squarings = transitive_closure_by_squaring(r)
    assert np.array_equal(transitive_closure(r), slow)
    # paths have at most n − 1 links and every squaring doubles their length; the last only confirms
    assert squarings <= max(int(np.ceil(np.log2(max(len(r) - 1, 1)))), 0) + 1


@MANY
@given(relations())
def test_contains_its_relation_is_transitive_and_symmetric(r):
    t = transitive_closure(r)
    assert (t >= r).all()
    assert np.array_equal(transitive_closure(t), t)
    assert np.array_equal(max_min_composition(t, t), t)
    assert np.array_equal(t, t.T)
    assert np.isin(t, r).all()


@MANY
@given(relations())
def test_is_the_smallest(r):
    """Lowering any one level of the closure loses an entry of the relation or the transitivity."""
    t = transitive_closure(r)
    for level in np.unique(t[t < 1]):
        smaller = np.where(t == level, np.nextafter(level, -2), t)
        transitive = np.array_equal(max_min_composition(smaller, smaller), smaller)
        assert not ((smaller >= r).all() and transitive)


@MANY
@given(relations(), st.integers(0, 2**32 - 1))
def test_permuting_sensors_permutes_everything(r, seed):
    order = np.random.default_rng(seed).permutation(len(r))
    permuted = r[np.ix_(order, order)]
    assert np.array_equal(transitive_closure(permuted), transitive_closure(r)[np.ix_(order, order)])
    for step in lambda_axis(r):
        expected = Partition(tuple(step.partition.labels[i] for i in order), step.high)
        assert lambda_cut(permuted, step.high) == expected


@MANY
@given(relations())
def test_equals_scikit_fuzzy(r):
    # scikit-fuzzy starts its maxima from nothing but the compared entries, so negative entries are right there too
    assert np.array_equal(max_min_composition(r, r), skfuzzy.maxmin_composition(r, r))
    power = r
    for _ in range(len(r).bit_length()):
        power = skfuzzy.maxmin_composition(power, power)
    assert np.array_equal(transitive_closure(r), power)


@MANY
@given(relations())
def test_cuts_equal_single_linkage_on_ranks_and_connected_components(r):
    n = len(r)
    values, ranks = ranks_from_the_top(r)
    tree = linkage(squareform(ranks), "single") if n > 1 else None
    if tree is not None:
        height = squareform(cophenet(tree)).astype(int)
        closure = np.where(np.eye(n, dtype=bool), 1.0, values[height - 1])
        assert np.array_equal(transitive_closure(r), closure)
    between = (values[1:] + values[:-1]) / 2
    for level in np.concatenate([values, between, [-1.0, 1.0]]):
        ours = grouping(np.array(lambda_cut(r, level).labels))
        assert ours == components(r, level)
        if tree is not None:
            reached = np.searchsorted(-values, -level, side="right")  # ranks 1 … reached are ≥ level
            assert ours == grouping(fcluster(tree, reached + 0.5, "distance"))


@MANY
@given(relations())
def test_axis_lists_every_partition_once_nested_and_with_its_interval(r):
    axis = lambda_axis(r)
    steps = list(axis)
    levels = np.unique(transitive_closure(r))
    assert {lambda_cut(r, level) for level in levels} == {step.partition for step in steps}
    assert len({step.partition for step in steps}) == len(steps) == len(axis)
    assert (steps[0].high, steps[-1].low) == (1.0, -1.0)
    assert len(steps[-1].partition.members) == 1
    for fine, coarse in itertools.pairwise(steps):
        assert fine.low == coarse.high
        assert is_nested(fine.partition, coarse.partition)
        assert not is_nested(coarse.partition, fine.partition)
    for step in steps:
        assert lambda_cut(r, step.high) == step.partition == axis.at(step.high).partition
        # the last step is closed below; it is a single point when some similarity is −1
        assert lambda_cut(r, min(step.high, np.nextafter(step.low, 2))) == step.partition
        alone = f_statistic(r, step.partition)
        assert (alone is None) == (step.f is None)
        if alone is not None and np.isfinite(alone.value) and np.isfinite(step.f.value):
            # the axis adds up merge by merge: the scatter within may lose a few ulp of n to cancellation
            assert step.f.value == pytest.approx(alone.value, rel=1e-6, abs=1e-9)


@MANY
@given(relations(), st.floats(-1, 1), st.floats(-1, 1))
def test_cuts_are_nested_in_the_level(r, one, other):
    assert is_nested(lambda_cut(r, max(one, other)), lambda_cut(r, min(one, other)))


@MANY
@given(relations())
def test_dendrogram_is_scipys_tree(r):
    tree, n = dendrogram(r), len(r)
    assert sorted(tree.leaf_order) == list(range(n))
    if n == 1:
        assert tree.linkage.shape == (0, 4)
        return
    assert is_valid_linkage(tree.linkage)
    assert np.array_equal(leaves_list(tree.linkage), tree.leaf_order)
    # the same heights as on distances, bit for bit: both only compare
    assert np.array_equal(cophenet(tree.linkage), cophenet(linkage(squareform(1 - r, checks=False), "single")))
    # the exact levels give back the closure itself, with ranks as heights
    values = np.unique(r)[::-1]
    heights = np.searchsorted(-values, -tree.levels) + 1.0
    merged = squareform(cophenet(np.column_stack([tree.linkage[:, :2], heights, tree.linkage[:, 3]]))).astype(int)
    assert np.array_equal(
        np.where(np.eye(n, dtype=bool), 1.0, values[merged - 1]), transitive_closure_by_squaring(r)[0]
    )


@MANY
@given(relations())
def test_chain_has_the_minimum_property(r):
    chain, t, n = closure_chain(r), transitive_closure_by_squaring(r)[0], len(r)
    assert sorted(chain.order.tolist()) == list(range(n))
    for a in range(n):
        for b in range(a + 1, n):
            assert t[chain.order[a], chain.order[b]] == chain.levels[a:b].min()


def test_naive_route_over_distances_loses_groups_where_ours_does_not():
    """1 − cophenet of 1 − S, cut at its own closure levels: subtraction rounds, so similarities near 0 change bits."""
    rng = np.random.default_rng(0)
    naive_wrong = ours_wrong = 0
    for _ in range(200):
        upper = np.triu(rng.uniform(0, 0.1, (8, 8)), 1)
        s = upper + upper.T + np.eye(8)
        naive = 1 - squareform(cophenet(linkage(squareform(1 - s, checks=False), "single")))
        levels = np.unique(transitive_closure(s))
        truth = [components(s, level) for level in levels]
        naive_wrong += [components(naive, level) for level in levels] != truth
        ours_wrong += [grouping(np.array(lambda_cut(s, level).labels)) for level in levels] != truth
    assert ours_wrong == 0
    assert naive_wrong > 100  # the rule, not a rare accident


def test_traps_of_scikit_fuzzy_as_an_oracle():
    r = np.array([[1.0, 0.5, 0.2], [0.5, 1.0, 0.3], [0.2, 0.3, 1.0]])
    # its λ-cut is strict: a similarity exactly at the level is not linked …
    assert skfuzzy.lambda_cut(r, 0.5)[0, 1] == 0
    assert lambda_cut(r, 0.5).labels == (0, 0, 1)
    # … and a similarity that is not known becomes certainty, because fmin passes over NaN
    unknown = r.copy()
    unknown[0, 2] = unknown[2, 0] = np.nan
    assert skfuzzy.maxmin_composition(unknown, unknown)[0, 2] == 1.0
    with pytest.raises(InputError, match=r"nan at \(0, 2\)"):
        transitive_closure(unknown)
