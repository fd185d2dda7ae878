"""A reduced heat system answers like the full one, keeps its physics, and says how far off it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from selector.errors import InputError
from selector.physics.thermal.network.heat_system import HeatSystem, projected, reduced_basis
from tests.physics.thermal.reductions import reduced, reduction_error
from tests.physics.thermal.voxels import implicit_history, voxel_machine

STILL = {"bed": 8.0, "column": 8.0, "head": 8.0, "nose": 8.0}
FAST = {"bed": 8.0, "column": 8.0, "head": 10.0, "nose": 60.0}
WET = {"bed": 300.0, "column": 8.0, "head": 10.0, "nose": 60.0}
SETS = (STILL, FAST, WET)
STEP_S = 60.0


@pytest.fixture(scope="module")
def machine():
    return voxel_machine(0.08)  # 1512 cubes


@pytest.fixture(scope="module")
def small(machine):
    return reduced(machine, SETS, tolerance=1e-4)


def shift(seed):
    """Eight hours of random speeds, each for 20 minutes; films between the sets, the hall and the coolant move."""
    draw = np.random.RandomState(seed)
    steps = []
    for k in range(480):
        if k % 20 == 0:
            speed, wet = draw.choice([0.0, 0.2, 0.5, 1.0]), draw.rand() < 0.4
        hall = 20.0 + 1.5 * np.sin(k / 100.0)
        films = {"bed": 300.0 if wet else 8.0, "column": 8.0, "head": 8.0 + 2.0 * speed, "nose": 8.0 + 52.0 * speed}
        fluids = {"bed": 18.0 if wet else hall, "column": hall, "head": hall, "nose": hall}
        heat = {"bearing": 200.0 * speed**1.5, "motor": 100.0 * speed, "nut": 30.0 * (speed > 0)}
        steps.append((films, fluids, heat))
    return steps


def shift_errors(machine, small, seed):
    steps = shift(seed)
    full, near = (implicit_history(system, steps, STEP_S) for system in (machine, small))
    return np.abs(near - full).max(axis=0) / np.abs(full - full[0]).max(axis=0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_shift_of_the_reduced_system_is_that_of_the_full_one(machine, small, seed):
    assert small.size < machine.size / 10
    # the promise is 1 % of the peak of every probe and displacement; films lie between the sets of the basis
    # and the probe at the back, far from all heat, is the worst: 0.5 %; displacements have 0.01 %
    errors = shift_errors(machine, small, seed)
    assert errors.max() < 0.01
    assert errors[-3:].max() < 0.0005


def test_more_states_mean_less_error(machine):
    errors, sizes = [], []
    for tolerance in (3e-2, 3e-3, 1e-4):
        system = reduced(machine, SETS, tolerance=tolerance)
        errors.append(np.sqrt(np.mean(shift_errors(machine, system, 1) ** 2)))
        sizes.append(system.size)
    assert sizes == sorted(set(sizes))
    # each of these steps is measured to take the error down by 2 or more
    assert errors[0] > 1.5 * errors[1] > 1.5**2 * errors[2]


def test_steady_states_of_the_sets_are_exact(machine, small):
    at_steady = reduction_error(machine, small, SETS, [np.inf])
    # a displacement is matched from both sides, so its error is the tolerance (1e-4) squared times the number of fields
    assert max(at_steady[name] for name in "XYZ") < 1e-5
    assert max(at_steady.values()) < 1e-3  # probes: the tolerance, times the number of fields left out


def test_error_is_told_for_other_coefficients_and_scales(machine, small):
    between = {"bed": 100.0, "column": 8.0, "head": 9.0, "nose": 30.0}
    told = reduction_error(machine, small, [between], [200.0, 4000.0, np.inf])
    assert set(told) == {*machine.probes, *machine.displacements}
    assert 0 < max(told.values()) < 0.01
    # a system of few states is told to be worse
    coarse = reduced(machine, SETS, max_states=10)
    assert coarse.size == 10
    assert max(reduction_error(machine, coarse, [between], [200.0]).values()) > 10 * max(told.values())


def test_uniform_field_and_totals_are_exact(machine, small):
    uniform = small.uniform
    scale = np.abs(small.conduction).max()
    # round-off of sums over 1500 cubes
    assert np.abs(small.conduction @ uniform).max() < 1e-12 * scale
    for name, load in small.film_loads.items():
        np.testing.assert_allclose(small.films[name] @ uniform, load, atol=1e-12 * np.abs(load).max())
        assert uniform @ load == pytest.approx(machine.film_loads[name].sum(), rel=1e-12)  # the area
    for name, row in small.probes.items():
        assert row @ uniform == pytest.approx(1.0, rel=1e-12), name  # a thermometer reads the temperature
    for name, row in small.displacements.items():
        whole = machine.displacements[name]
        assert row @ uniform == pytest.approx(whole.sum(), abs=1e-12 * np.abs(whole).sum()), name
    for share in small.sources.values():
        assert share @ uniform == pytest.approx(1.0, rel=1e-12)  # all heat arrives
    assert uniform @ small.capacity @ uniform == pytest.approx(machine.capacity.sum(), rel=1e-12)


def test_passive(small):
    for matrix in (small.capacity, small.conduction, *small.films.values()):
        np.testing.assert_array_equal(matrix, matrix.T)
        eigenvalues = np.linalg.eigvalsh(matrix)
        assert eigenvalues[0] > -1e-12 * eigenvalues[-1]  # round-off


def test_reducing_again_changes_nothing(machine, small):
    again = reduced(small, SETS, tolerance=1e-6)
    assert again.size <= small.size
    # the fields of the first basis come back up to the second tolerance; probes feel it most
    assert shift_errors(small, again, 1).max() < 1e-3
    other = projected(small, np.eye(small.size))
    np.testing.assert_allclose(other.conduction, small.conduction, atol=1e-12 * np.abs(small.conduction).max())


def test_basis_is_orthonormal_in_the_heat_capacity(machine):
    basis = reduced_basis(machine, SETS)
    gram = basis.T @ (machine.capacity @ basis)
    np.testing.assert_allclose(gram, np.eye(basis.shape[1]), atol=1e-12)  # round-off of two passes
    first = basis[:, 0]
    np.testing.assert_allclose(first, np.full(machine.size, first[0]), rtol=1e-12)


def random_network(seed, n):
    """A chain with a few cross links, dense."""
    draw = np.random.RandomState(seed)
    links = np.zeros((n, n))
    for i, j in [(k, k + 1) for k in range(n - 1)] + [tuple(draw.choice(n, 2, replace=False)) for _ in range(n)]:
        watts = draw.uniform(0.5, 20.0)
        links[[i, j], [j, i]] -= watts
        links[[i, j], [i, j]] += watts
    area = draw.uniform(0.01, 0.5, n) * (draw.rand(n) < 0.5)
    area[0] = 0.1
    heated = draw.dirichlet(np.ones(n))
    return HeatSystem(
        capacity=np.diag(draw.uniform(1e3, 1e5, n)),
        conduction=links,
        films={"hall": np.diag(area)},
        film_loads={"hall": area},
        sources={"heat": heated},
        probes={"T": np.eye(n)[draw.randint(n)]},
        displacements={"Z": draw.normal(0, 1, n)},
        uniform=np.ones(n),
    )


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000), n=st.integers(3, 12))
def test_any_network_keeps_symmetry_uniform_field_and_steady_state(seed, n):
    whole = random_network(seed, n)
    small = reduced(whole, [{"hall": 10.0}], time_scales_s=(100.0, np.inf), tolerance=1e-6)
    assert small.size <= n
    assert np.linalg.eigvalsh(small.conduction)[0] > -1e-9 * np.abs(small.conduction).max()
    np.testing.assert_allclose(small.films["hall"] @ small.uniform, small.film_loads["hall"], atol=1e-9)
    # the steady state is one of the fields; 1e-4: fields below 1e-6 of their norm were left out
    assert max(reduction_error(whole, small, [{"hall": 10.0}], [np.inf]).values()) < 1e-4


def test_sparse_and_dense_give_the_same():
    whole = random_network(3, 9)
    thin = HeatSystem(
        capacity=sparse.csr_array(whole.capacity),
        conduction=sparse.csr_array(whole.conduction),
        films={"hall": sparse.csr_array(whole.films["hall"])},
        film_loads=whole.film_loads,
        sources=whole.sources,
        probes=whole.probes,
        displacements=whole.displacements,
        uniform=whole.uniform,
    )
    one, other = (reduced(each, [{"hall": 10.0}], max_states=4) for each in (whole, thin))
    # both factorisations round to about 1e-14; the sign of a field is free, its response is not
    errors = [reduction_error(whole, each, [{"hall": 5.0}], [500.0]) for each in (one, other)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-6)


def test_a_steady_state_without_films_is_refused():
    with pytest.raises(InputError, match="steady state"):
        reduced(random_network(1, 5), [{"hall": 0.0}])


def test_without_films_heat_stays_inside():
    whole = random_network(5, 8)
    small = reduced(whole, [{}], time_scales_s=(50.0, 1000.0))
    assert small.uniform @ small.sources["heat"] == pytest.approx(1.0, rel=1e-12)
