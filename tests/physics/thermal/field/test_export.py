"""What ParaView gets is what the model has."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.thermal.field import field_machine, write_vtu


@pytest.fixture(scope="module")
def machine():
    return field_machine(refinement=0.2)


def test_the_file_holds_field_and_deformation(machine, tmp_path):
    field = 20.0 + 10.0 * machine.mesh.nodes_m[:, 2]
    write_vtu(machine, field, tmp_path / "machine.vtu")
    read = meshio.read(tmp_path / "machine.vtu")
    np.testing.assert_array_equal(read.points, machine.mesh.nodes_m)
    np.testing.assert_array_equal(read.point_data["temperature"], field)
    np.testing.assert_array_equal(read.point_data["displacement"], machine.deformation(field))
    cells = read.points[read.cells_dict["hexahedron"]]
    # VTK's order: the sides along local X, Y and up span a positive volume
    sides = [cells[:, i] - cells[:, 0] for i in (1, 3, 4)]
    np.testing.assert_allclose(np.einsum("ij,ij->i", np.cross(sides[0], sides[1]), sides[2]), machine.mesh.volume_m3)
    np.testing.assert_allclose(cells[:, 2] + cells[:, 4], cells[:, 0] + cells[:, 6])
    assert len(np.unique(read.cell_data["part"][0])) == len(set(machine.mesh.parts))


def test_a_field_of_another_system_is_refused(machine, tmp_path):
    with pytest.raises(InputError, match="unreduced system"):
        write_vtu(machine, np.ones(7), tmp_path / "machine.vtu")
    with pytest.raises(InputError, match="no number"):
        write_vtu(machine, np.full(machine.system.size, np.nan), tmp_path / "machine.vtu")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there_is_named(machine, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_vtu(machine, np.ones(machine.system.size), tmp_path / "nowhere" / "machine.vtu")
