"""What ParaView gets by the recipe of the docs is what the model has."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.thermal.field import field_machine

PAGE = Path(__file__).parents[4] / "docs" / "explanation" / "thermal-field.md"


@pytest.fixture(scope="module")
def machine():
    return field_machine(refinement=0.1)


def test_cells_are_in_the_order_of_vtk(machine):
    (order,) = re.findall(r"machine\.mesh\.cells\[:, (\[[\d, ]+\])\]", PAGE.read_text(encoding="utf-8"))
    cells = machine.mesh.nodes_m[machine.mesh.cells[:, [int(k) for k in re.findall(r"\d", order)]]]
    # the sides along local X, Y and up span a positive volume
    sides = [cells[:, i] - cells[:, 0] for i in (1, 3, 4)]
    np.testing.assert_allclose(np.einsum("ij,ij->i", np.cross(sides[0], sides[1]), sides[2]), machine.mesh.volume_m3)
    np.testing.assert_allclose(cells[:, 2] + cells[:, 4], cells[:, 0] + cells[:, 6])


def test_a_field_of_another_system_is_refused(machine):
    with pytest.raises(InputError, match="unreduced system"):
        machine.deformation(np.ones(7))
    with pytest.raises(InputError, match="no number"):
        machine.deformation(np.full(machine.system.size, np.nan))
