from __future__ import annotations

import numpy as np
import pytest

from selector.errors import InputError
from selector.sensors import closure_chain, transitive_closure
from tests.sensors.by_definition import max_min_composition, transitive_closure_by_squaring


def test_composition_by_hand():
    r = [[0.1, 0.9, -0.5], [1.0, 0.2, 0.3]]
    s = [[0.8], [0.4], [-0.2]]
    assert max_min_composition(r, s).tolist() == [[0.4], [0.8]]


def test_closure_of_three_sensors_by_hand():
    r = np.array([[1, 0.9, -0.3], [0.9, 1, 0.5], [-0.3, 0.5, 1]])
    closure = transitive_closure(r)
    assert closure.tolist() == [[1, 0.9, 0.5], [0.9, 1, 0.5], [0.5, 0.5, 1]]
    assert not closure.flags.writeable
    assert r.flags.writeable  # the caller's array stays the caller's


def test_a_chain_of_links_takes_its_weakest():
    n = 9
    r = np.eye(n)
    links = np.linspace(0.9, 0.5, n - 1)
    r[np.arange(n - 1), np.arange(1, n)] = r[np.arange(1, n), np.arange(n - 1)] = links
    closure, squarings = transitive_closure_by_squaring(r)
    assert closure[0].tolist() == [1, *links]
    assert np.array_equal(closure, transitive_closure(r))
    assert squarings == 4  # 8 links need three squarings, and one that changes nothing


@pytest.mark.parametrize("r", [[[1.0]], [[1.0, -1.0], [-1.0, 1.0]], np.ones((4, 4))])
def test_small_and_degenerate(r):
    assert np.array_equal(transitive_closure(r), r)
    assert transitive_closure_by_squaring(r)[1] == 1
    assert len(closure_chain(r).levels) == len(r) - 1


@pytest.mark.parametrize("layout", ["fortran", "strided", "list", "float32", "int"])
def test_any_memory_layout(layout):
    rng = np.random.default_rng(0)
    upper = np.triu(rng.uniform(-1, 1, (130, 130)), 1)
    r = upper + upper.T + np.eye(130)
    variants = {
        "fortran": np.asfortranarray(r),
        "strided": np.repeat(np.repeat(r, 2, 0), 2, 1)[::2, ::2],
        "list": r.tolist(),
        "float32": r.astype(np.float32),
        "int": np.sign(r).astype(int),
    }
    given = variants[layout]
    plain = np.array(given, dtype=np.float64, order="C")
    assert np.array_equal(transitive_closure(given), transitive_closure_by_squaring(plain)[0])


def relation_with(i: int, j: int, value: float, mirrored: bool) -> np.ndarray:
    r = np.full((150, 150), 0.5)
    np.fill_diagonal(r, 1.0)
    r[i, j] = value
    if mirrored:
        r[j, i] = value
    return r


# places above and below the diagonal
@pytest.mark.parametrize(("i", "j"), [(0, 1), (1, 0), (3, 100), (100, 3), (70, 80), (149, 0), (148, 149)])
@pytest.mark.parametrize(
    ("value", "mirrored", "message"),
    [
        (np.nan, True, "finite entries"),
        (np.nan, False, "finite entries"),
        (np.inf, True, "finite entries"),
        (0.25, False, "exactly symmetric"),
        (np.nextafter(0.5, 1), False, "exactly symmetric"),
        (1.5, True, "within"),
        (-1.5, True, "within"),
    ],
)
@pytest.mark.parametrize("function", [transitive_closure, closure_chain])
def test_a_flaw_anywhere_is_refused(function, i, j, value, mirrored, message):
    with pytest.raises(InputError, match=message) as caught:
        function(relation_with(i, j, value, mirrored))
    assert f"({min(i, j)}, {max(i, j)})" in caught.value.found


@pytest.mark.parametrize("place", [0, 77, 149])
@pytest.mark.parametrize("value", [np.nextafter(1, 0), 0.0, np.nan])
def test_diagonal_must_be_one(place, value):
    with pytest.raises(InputError, match="finite" if np.isnan(value) else "diagonal, sensor"):
        transitive_closure(relation_with(place, place, value, False))


@pytest.mark.parametrize("shape", [(), (3,), (0, 0), (2, 3), (2, 2, 2)])
def test_wrong_shapes(shape):
    with pytest.raises(InputError, match="square"):
        transitive_closure(np.ones(shape))
