"""Readers of meshes: the same groups from four formats, and one message for each thing that is wrong with a file."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

from selector.errors import ModelFileError
from selector.physics.thermal.field.mesh import Block, block_mesh
from selector.physics.thermal.field.mesh_file import named_mesh
from tests.physics.thermal.field.mesh_files import made, tetra_mesh, write

BLOCKS = [Block("low", "", (0.0, 0.0, 0.0), (0.4, 0.2, 0.1)), Block("high part", "", (0.0, 0.0, 0.1), (0.4, 0.2, 0.2))]
SURFACES = {"top": lambda c: np.isclose(c[:, 2], 0.2), "end": lambda c: np.isclose(c[:, 0], 0.4)}


def plate(name="high part"):
    blocks = [BLOCKS[0], Block(name, "", BLOCKS[1].low_m, BLOCKS[1].high_m)]
    return tetra_mesh(blocks, 0.1, SURFACES, {"tip": (0.4, 0.2, 0.2)})


@pytest.mark.parametrize(
    ("name", "version", "binary"),
    [
        ("plate.msh", "2.2", False),
        ("plate.msh", "2.2", True),
        ("plate.msh", "4.1", False),
        ("plate.msh", "4.1", True),
        ("plate.inp", "", False),
        ("plate.med", "", False),
    ],
)
def test_groups_are_those_of_the_mesh_in_every_format(tmp_path, name, version, binary):
    if name.endswith(".med"):
        pytest.importorskip("h5py")
    part = "high_part" if name.endswith(".inp") else "high part"
    read = named_mesh(write(plate(part), tmp_path / name, version, binary=binary), 1.0, order=1)
    body = read.body
    assert {part, "low", "top", "end", "tip"} <= read.groups.keys()
    assert body.volume_m3[read.cells(part)].sum() == pytest.approx(0.4 * 0.2 * 0.1, rel=1e-12)
    assert body.volume_m3.sum() == pytest.approx(0.4 * 0.2 * 0.2, rel=1e-12)
    np.testing.assert_allclose(body.facet_centres_m(read.facets("top", outer=True))[:, 2], 0.2, rtol=0, atol=1e-15)
    assert len(read.facets("top", outer=True)) == 2 * 4 * 2
    np.testing.assert_allclose(body.nodes_m[read.nodes("tip")], [[0.4, 0.2, 0.2]])
    # the surface of a volume group where it has no faces of its own; inner faces are none of it
    assert len(read.facets(part, outer=True)) == 2 * (4 * 2 + 2 * 4 + 2 * 2)


def test_numbers_of_a_vtu_are_groups_and_millimetres_are_converted(tmp_path):
    mesh = plate()
    mesh.points *= 1000
    read = named_mesh(write(mesh, tmp_path / "plate.vtu"), 1e-3, order=2)
    numbers = dict(enumerate(mesh.cell_sets, 1))
    name = next(f"group {number}" for number, said in numbers.items() if said == "low")
    assert read.body.cells.shape[1] == 10
    assert read.body.volume_m3[read.cells(name)].sum() == pytest.approx(0.4 * 0.2 * 0.1, rel=1e-12)


def test_second_order_files_and_files_of_the_first_order_are_the_same_body(tmp_path):
    mesh = plate()
    linear = named_mesh(write(mesh, tmp_path / "linear.msh"), 1.0)
    cells = mesh.cells[0].data
    pairs = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    middles = np.concatenate([mesh.points[cells[:, list(pair)]].mean(axis=1) for pair in pairs])
    edges = len(mesh.points) + np.arange(len(middles)).reshape(6, -1).T
    quadratic = meshio.Mesh(np.vstack([mesh.points, middles]), [("tetra10", np.hstack([cells, edges]))])
    read = named_mesh(write(quadratic, tmp_path / "quadratic.msh"), 1.0)
    np.testing.assert_array_equal(read.body.cells, linear.body.cells)
    np.testing.assert_array_equal(read.body.nodes_m, linear.body.nodes_m)


def test_a_set_in_the_header_of_an_abaqus_block_stays_with_its_block(tmp_path):
    # meshio alone gives the set of the second block to the first one
    text = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n5,1,1,1\n*ELEMENT, TYPE=C3D4\n1,1,2,3,4\n"
    text += "*ELEMENT, TYPE=C3D4, ELSET=SECOND\n2,2,3,4,5\n"
    path = tmp_path / "two.inp"
    path.write_text(text, encoding="utf-8")
    read = named_mesh(path, 1.0, order=1)
    np.testing.assert_allclose(read.body.cell_centres_m(read.cells("SECOND")), [[0.5, 0.5, 0.5]])


def test_points_of_a_surface_stand_for_its_faces(tmp_path):
    mesh = plate()
    top = np.flatnonzero(np.isclose(mesh.points[:, 2], 0.2))
    path = tmp_path / "points.inp"
    meshio.abaqus.write(path, meshio.Mesh(mesh.points, mesh.cells[:1], point_sets={"top": top}))
    read = named_mesh(path, 1.0)
    assert len(read.facets("top", outer=True)) == 2 * 4 * 2


def refusal(path, unit_m=1.0):
    with pytest.raises(ModelFileError) as caught:
        named_mesh(path, unit_m)
    error = caught.value
    assert error.where == "key mesh.file"
    assert error.expected
    assert error.advice
    return error.found


def with_cells(points, cells, path):
    return write(meshio.Mesh(np.array(points, dtype=float), cells), path)


UNIT = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [0.2, 0.2, 0.2], [3, 3, 0], [4, 4, 0]]


class TestUnsoundBodies:
    def test_no_tetrahedra(self, tmp_path):
        found = refusal(with_cells(UNIT, [("triangle", [[0, 1, 2]])], tmp_path / "m.msh"))
        assert "none of a volume" in found

    def test_other_elements(self, tmp_path):
        found = refusal(
            with_cells(UNIT, [("tetra", [[0, 1, 2, 3]]), ("pyramid", [[0, 1, 2, 3, 4]])], tmp_path / "m.msh")
        )
        assert found == "elements: 1 of the form tetra and 1 of the form pyramid"

    def test_hexahedra_that_are_no_boxes(self, tmp_path):
        points = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
        assert (
            named_mesh(with_cells(points, [("hexahedron", [range(8)])], tmp_path / "box.msh"), 1.0).body.volume_m3 == 1
        )
        points[6] += 0.1
        assert "no boxes" in refusal(with_cells(points, [("hexahedron", [range(8)])], tmp_path / "m.msh"))

    def test_inverted(self, tmp_path):
        # the second one lies inside of the first, on the same side of their face
        found = refusal(with_cells(UNIT, [("tetra", [[0, 1, 2, 3], [0, 1, 2, 5]])], tmp_path / "m.msh"))
        assert found.startswith("1 faces with both elements on one side")

    def test_numbered_the_other_way_round_is_no_fault(self, tmp_path):
        path = with_cells(UNIT, [("tetra", [[0, 1, 2, 3], [2, 1, 3, 4]])], tmp_path / "m.msh")
        assert named_mesh(path, 1.0).body.volume_m3.sum() == pytest.approx(1 / 6 + 1 / 3)

    def test_flat(self, tmp_path):
        found = refusal(with_cells(UNIT, [("tetra", [[0, 1, 2, 3], [0, 1, 2, 6]])], tmp_path / "m.msh"))
        assert found.startswith("1 flat elements")

    def test_twice(self, tmp_path):
        found = refusal(with_cells(UNIT, [("tetra", [[0, 1, 2, 3], [1, 0, 2, 3]])], tmp_path / "m.msh"))
        assert found.startswith("1 elements that are there twice")

    @pytest.mark.parametrize(("unit_m", "size"), [(1.0, "4000"), (1e-9, "4e-06")])
    def test_absurd_unit(self, tmp_path, unit_m, size):
        mesh = plate()
        mesh.points *= 1e4
        assert refusal(write(mesh, tmp_path / "m.msh"), unit_m) == f"a machine of {size} m"

    def test_no_number(self, tmp_path):
        mesh = plate()
        mesh.points[3, 1] = np.nan
        assert "no place" in refusal(write(mesh, tmp_path / "m.msh"))

    def test_faces_of_another_mesh(self, tmp_path):
        mesh = plate()
        where = next(k for k, block in enumerate(mesh.cells) if block.type == "triangle")
        mesh.cells[where].data[0] = [0, 1, len(mesh.points) - 1]
        read = named_mesh(write(mesh, tmp_path / "m.msh"), 1.0)
        # other groups can be used
        assert len(read.facets("end")) == 8
        with pytest.raises(ModelFileError, match="1 of 16 faces of the group 'top' that are not on the surface"):
            read.facets("top")

    def test_too_many_nodes(self, tmp_path, monkeypatch):
        monkeypatch.setattr("selector.physics.thermal.field.mesh_file.MOST_MESH_NODES", 50)
        assert "those in the middle of edges" in refusal(write(plate(), tmp_path / "m.msh"))


class TestGroups:
    @pytest.fixture
    def read(self, tmp_path_factory):
        return named_mesh(write(plate(), tmp_path_factory.mktemp("groups") / "m.msh"), 1.0)

    def test_a_missing_group_names_those_that_are_there(self, read):
        with pytest.raises(
            ModelFileError, match=r"no group called 'topp'.*'top' perhaps.*low, high part, top, end, tip"
        ):
            read.group("topp")

    def test_a_surface_is_no_volume(self, read):
        with pytest.raises(ModelFileError, match=r"'top' that touches nothing.*elements of the body"):
            read.cells("top")

    def test_a_point_is_no_surface(self, read):
        with pytest.raises(ModelFileError, match=r"'tip' that touches nothing.*faces of the body"):
            read.facets("tip", outer=True)

    def test_shares_sum_to_one_and_read_the_mean(self, read):
        for name in ("all", "low", "top", "tip"):
            shares = read.shares(name)
            assert shares.sum() == pytest.approx(1.0, rel=1e-12)
        assert read.shares("top") @ read.body.nodes_m[:, 0] == pytest.approx(0.2, rel=1e-12)
        assert read.shares("low") @ read.body.nodes_m[:, 2] == pytest.approx(0.05, rel=1e-12)

    def test_a_film_cannot_be_inside(self, tmp_path):
        mesh = tetra_mesh(BLOCKS, 0.1, SURFACES)
        between = {
            tuple(sorted(face)) for face in _faces(mesh.cells[0].data) if np.isclose(mesh.points[face, 2], 0.1).all()
        }
        inner = meshio.CellBlock("triangle", np.array(sorted(between)))
        mesh.cells.append(inner)
        for sets in mesh.cell_sets.values():
            sets.append(np.zeros(0, dtype=int))
        mesh.cell_sets["between"] = [np.zeros(0, dtype=int)] * (len(mesh.cells) - 1) + [np.arange(len(inner.data))]
        read = named_mesh(write(mesh, tmp_path / "m.msh"), 1.0)
        assert len(read.facets("between")) == len(inner.data)
        with pytest.raises(ModelFileError, match="16 of 16 faces of the group 'between' that are not on the surface"):
            read.facets("between", outer=True)


def _faces(cells):
    return np.concatenate([np.delete(cells, k, axis=1) for k in range(4)])


class TestHostileFiles:
    def test_other_endings_folders_and_files_that_are_not_there(self, tmp_path):
        assert "ending '.stp'" in refusal(_written(tmp_path / "m.stp", b"ISO-10303-21;"))
        assert "cannot be opened" in refusal(tmp_path / "none.msh")
        (tmp_path / "folder.msh").mkdir()
        assert "a folder" in refusal(tmp_path / "folder.msh")

    @pytest.mark.parametrize("name", ["m.msh", "m.inp", "m.vtu", "m.med"])
    def test_text_in_place_of_a_mesh_and_nothing(self, tmp_path, name):
        for content in (b"", b"a letter to the editor\n" * 40, b"\x00\xff" * 500):
            assert name in refusal(_written(tmp_path / name, content)) or name == "m.inp"

    @pytest.mark.parametrize(
        ("name", "version", "binary"),
        [("m.msh", "2.2", False), ("m.msh", "4.1", True), ("m.vtu", "", False), ("m.med", "", False)],
    )
    def test_files_that_end_too_early(self, tmp_path, name, version, binary):
        if name.endswith(".med"):
            pytest.importorskip("h5py")
        content = write(plate(), tmp_path / name, version, binary=binary).read_bytes()
        for share in (0.1, 0.5, 0.9):
            refusal(_written(tmp_path / name, content[: int(share * len(content))]))

    def test_an_abaqus_file_that_ends_in_an_element(self, tmp_path):
        content = write(plate("high_part"), tmp_path / "m.inp").read_bytes()
        end = content.index(b"*ELEMENT") + 60
        end = content.rindex(b",", 0, end)
        refusal(_written(tmp_path / "m.inp", content[:end]))

    @pytest.mark.parametrize("count", ["999999999999999", "-5", "many"])
    def test_counts_that_the_file_does_not_hold(self, tmp_path, count):
        text = write(plate(), tmp_path / "m.msh").read_text(encoding="utf-8")
        nodes = text.split("$Nodes\n")[1].split("\n")[0]
        refusal(_written(tmp_path / "m.msh", text.replace(f"$Nodes\n{nodes}", f"$Nodes\n{count}").encode()))
        assert nodes.isdigit()

    @pytest.mark.parametrize(
        "word", ["*INCLUDE, INPUT=other.inp", "*include,input=/etc/hostname", "include, input=x", " **INC*LUDE,INPUT=x"]
    )
    def test_an_abaqus_file_that_has_another_read(self, tmp_path, word):
        path = write(plate("high_part"), tmp_path / "m.inp")
        assert "another file" in refusal(_written(path, path.read_bytes() + word.encode() + b"\n"))

    def test_a_med_file_that_links_to_another(self, tmp_path):
        h5py = pytest.importorskip("h5py")
        path = write(plate(), tmp_path / "m.med")
        with h5py.File(path, "a") as file:
            file["ENS_MAA/other"] = h5py.ExternalLink("/etc/hostname", "/")
        assert "a link to another file" in refusal(path)

    def test_a_vtu_file_with_entities(self, tmp_path):
        path = write(plate(), tmp_path / "m.vtu")
        head = b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "b">]>'
        assert "document type" in refusal(
            _written(path, head + path.read_bytes().removeprefix(b'<?xml version="1.0"?>'))
        )

    def test_a_file_that_is_too_long(self, tmp_path, monkeypatch):
        monkeypatch.setattr("selector.physics.thermal.field.mesh_file.LARGEST_MESH_BYTES", 2_000_000)
        assert refusal(_written(tmp_path / "m.msh", b" " * 2_000_001)).startswith("a file of more than 2 MB")


def _written(path, content):
    path.write_bytes(content)
    return path


def test_the_fixture_is_what_its_program_makes(tmp_path):
    made.main(tmp_path)
    shipped = made.Path(made.__file__).parents[1] / "thermal" / "c-frame.msh"
    assert (tmp_path / "c-frame.msh").read_bytes() == shipped.read_bytes()


def test_the_nearest_point_of_a_tetrahedron_is_on_it():
    body = block_mesh([Block("body", "", (0, 0, 0), (0.4, 0.2, 0.2))], 0.2)
    cells, _ = made.tetrahedra(body)
    tetra = type(body)(body.nodes_m, cells, ("all",), ("all",), np.zeros(len(cells), dtype=int))
    random = np.random.default_rng(4)
    for place in random.uniform([-0.1, -0.1, -0.1], [0.5, 0.3, 0.3], size=(60, 3)):
        point, row = tetra.nearest(place)
        # a box has the nearest point of all
        np.testing.assert_allclose(point, np.clip(place, 0, [0.4, 0.2, 0.2]), atol=1e-9)
        np.testing.assert_allclose(row @ tetra.nodes_m, point, atol=1e-12)
