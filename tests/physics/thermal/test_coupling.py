"""A field and lumped parts in contact are one body: heat that leaves one arrives in the other."""

from __future__ import annotations

import numpy as np
import pytest

from selector.physics.thermal.network.heat_system import HeatSystem, factorised, joined
from tests.physics.thermal.reductions import reduced, reduction_error
from tests.physics.thermal.voxels import voxel_machine


def shaft(film="air"):
    """Two nodes: the nose of a shaft in the air, and its other end."""
    return HeatSystem(
        capacity=np.diag([2000.0, 8000.0]),
        conduction=np.array([[3.0, -3.0], [-3.0, 3.0]]),
        films={film: np.diag([0.02, 0.0])},
        film_loads={film: np.array([0.02, 0.0])},
        sources={"rotor": np.array([0.0, 1.0])},
        probes={"T_shaft": np.array([0.0, 1.0])},
        displacements={"Z": np.array([1.0, 3.0])},
        uniform=np.ones(2),
        states=("nose", "end"),
    )


@pytest.fixture(scope="module")
def machine():
    return voxel_machine(0.08)


def test_all_heat_of_the_part_leaves_through_the_contact(machine):
    """With no air at the shaft its heat warms the machine: the contact falls by q/G, whatever else there is."""
    whole = joined(machine, shaft(), [("bearing", "nose", 12.0)])
    films = {"bed": 8.0, "head": 8.0}
    state = factorised(whole, films, np.inf)(whole.sources["rotor"])
    surface = machine.sources["bearing"] @ state[: machine.size]
    # closed form: 1 W over 12 W/K in the contact, over 3 W/K in the shaft; 1e-9: round-off of a sparse solution
    assert state[-2] - surface == pytest.approx(1 / 12, rel=1e-9)
    assert state[-1] - state[-2] == pytest.approx(1 / 3, rel=1e-9)
    given = sum(h * (machine.film_loads[name] @ state[: machine.size]) for name, h in films.items())
    assert given == pytest.approx(1.0, rel=1e-9)


def test_a_uniform_body_exchanges_nothing_and_the_matrix_is_symmetric(machine):
    whole = joined(machine, shaft("head"), [("bearing", "nose", 12.0), ("nut", "end", 2.0)])
    scale = abs(whole.conduction).max()
    assert np.abs(whole.conduction @ whole.uniform).max() < 1e-12 * scale  # round-off
    assert abs(whole.conduction - whole.conduction.T).max() == 0
    # a film and a displacement of both are sums
    assert whole.film_loads["head"].sum() == pytest.approx(machine.film_loads["head"].sum() + 0.02)
    assert whole.displacements["Z"].sum() == pytest.approx(machine.displacements["Z"].sum() + 4.0)
    assert list(whole.probes) == [*machine.probes, "T_shaft"]


def test_a_strong_contact_makes_one_temperature(machine):
    whole = joined(machine, shaft(), [("bearing", "nose", 1e7)])
    state = factorised(whole, {"bed": 8.0}, 500.0)(whole.sources["motor"])
    # at most 1 W flows through 1e7 W/K
    assert abs(state[-2] - machine.sources["bearing"] @ state[: machine.size]) < 1e-7


def test_the_joined_body_can_be_reduced(machine):
    whole = joined(machine, shaft(), [("bearing", "nose", 12.0)])
    sets = [{"bed": 8.0, "column": 8.0, "head": 8.0, "nose": 30.0, "air": 20.0}]
    small = reduced(whole, sets)
    assert small.size < 100
    # 1e-3: ten times the tolerance of the fields, at a scale between theirs
    assert max(reduction_error(whole, small, sets, [800.0, np.inf]).values()) < 1e-3
