"""What does a mesh file hold: elements of one form and the groups that are called by name, checked before use."""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from selector.errors import ModelFileError
from selector.physics.model_text import unknown_name
from selector.physics.thermal.field.mesh import SolidMesh, film, surface_source, volume_source
from selector.text_file import bytes_of
from selector.types import Array, Indices, Vector

LARGEST_MESH_BYTES = 100_000_000
MOST_MESH_NODES = 60_000  #: Nodes of a body, those in the middle of edges among them.
#: Shortest and longest machine [m]; what is outside has another unit of length.
EXTENT_M = (0.005, 50.0)
FORMATS = {".msh": "gmsh", ".inp": "abaqus", ".vtu": "vtu", ".med": "med"}  #: Ending → reader of meshio.
WHOLE = "all"  #: Group that every mesh has: all of it, or as a part what is in no other part.
_FLAT = 1e-8  #: Volume of an element over its longest extent cubed below which it is flat.
_MOST_VALUES = 1000  # what has more of them is no group but a field
_FORMS = {"tetra": 4, "tetra10": 4, "hexahedron": 8}


@dataclass(frozen=True)
class Group:
    """What a name stands for, as numbers in the mesh."""

    cells: Indices  #: (n_cells,)
    facets: Indices  #: (n_facets,): -1 for faces that belong to no element
    nodes: Indices  #: (n_nodes,)


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """A body and its groups."""

    body: SolidMesh  #: Of one part
    groups: Mapping[str, Group]

    def group(self, name: str) -> Group:
        """The group of a name. Raises ModelFileError: there is none."""
        if name not in self.groups:
            found, expected, _ = unknown_name("group", name, list(self.groups))
            raise refused(found, expected, "correct the name, or name the group in the program that made the mesh")
        return self.groups[name]

    def cells(self, name: str) -> Indices:
        """Elements of a group. Raises ModelFileError: it has none."""
        return self._filled(name, self.group(name).cells, "elements of the body")

    def facets(self, *names: str, outer: bool = False) -> Indices:
        """Faces of groups: their own, else those with all corners among their points, else around their elements.

        Raises ModelFileError: one has none, some that belong to no element, or with `outer` some inside of the body.
        """
        mesh, found = self.body.mesh, []
        surface = np.asarray(mesh.boundary_facets())
        for name in names:
            group = self.group(name)
            of_group = group.facets
            if not len(of_group) and len(group.nodes):
                of_group = surface[np.isin(np.asarray(mesh.facets)[:, surface], group.nodes).all(axis=0)]
            elif not len(of_group):
                of_group = surface[np.isin(np.asarray(mesh.f2t)[0, surface], group.cells)]
            wrong = (of_group < 0) | (outer & ~np.isin(of_group, surface))
            if wrong.any():
                told = f"{wrong.sum()} of {len(wrong)} faces of the group {name!r} that are not on the surface"
                advice = (
                    "mesh the body and its surfaces together, so that they share their nodes; leave inner faces out"
                )
                raise refused(told, "faces of the body's elements", advice)
            found.append(self._filled(name, of_group, "faces of the body"))
        return np.unique(np.concatenate(found))

    def nodes(self, name: str) -> Indices:
        """Points of a group, or those of its faces, also between corners."""
        points = self.group(name).nodes
        return points if len(points) else np.flatnonzero(film(self.body, self.facets(name))[0].diagonal())

    def shares(self, name: str) -> Vector:
        """Shares of the nodes in heat that is spread over a group; the row that reads its mean temperature."""
        cells = self.group(name).cells
        return volume_source(self.body, cells) if len(cells) else self.surface_shares(name)

    def surface_shares(self, name: str) -> Vector:
        """The same for the faces of a group, or for its points."""
        group = self.group(name)
        if len(group.facets) or not len(group.nodes):
            return surface_source(self.body, self.facets(name))
        share = np.zeros(len(self.body.nodes_m))
        share[group.nodes] = 1 / len(group.nodes)
        return share

    @staticmethod
    def _filled(name: str, found: Indices, what: str) -> Indices:
        if not len(found):
            advice = "name a group that has some, or mesh the body and its groups together"
            raise refused(f"a group {name!r} that touches nothing", what, advice)
        return found


def refused(found: str, expected: str, advice: str) -> ModelFileError:
    """The error about a mesh."""
    return ModelFileError(found, expected=expected, where="key mesh.file", advice=advice)


def named_mesh(path: Path, unit_m: float, order: int = 2) -> NamedMesh:
    """The body and the groups of a mesh file whose coordinates are in `unit_m` [m].

    `order` is that of the shape functions in tetrahedra, whatever the file has; edges are taken straight.

    Raises ModelFileError: the file cannot be read, or holds no sound body: other elements, flat, twofold or folded
    ones, nodes that are no numbers, too many of them, or a size that no machine has.
    """
    read = _read(path)
    solid = [block for block in read.cells if block.dim == 3]
    forms = {block.type: sum(len(one.data) for one in solid if one.type == block.type) for block in solid}
    if len(forms) != 1 or not forms.keys() <= _FORMS.keys():
        told = " and ".join(f"{count} of the form {form}" for form, count in forms.items()) or "none of a volume"
        advice = "mesh the volumes with tetrahedra and write all of them"
        raise refused(f"elements: {told}", "tetrahedra (or boxes) and nothing else", advice)
    (form,) = forms
    cells = np.concatenate([np.asarray(block.data) for block in solid])
    corners = cells[:, : _FORMS[form]]
    places = np.asarray(read.points, dtype=np.float64)
    if corners.min() < 0 or corners.max() >= len(places) or places.shape[1] != 3 or not np.isfinite(places).all():
        found, advice = (
            "elements at nodes that do not exist or have no place",
            "write the file again; it may be incomplete",
        )
        raise refused(found, "three finite coordinates for each node", advice)
    used, corners = np.unique(corners, return_inverse=True)
    corners = corners.reshape(len(cells), -1)
    nodes_m = places[used] * unit_m
    extent_m = float(np.ptp(nodes_m, axis=0).max())
    if not EXTENT_M[0] <= extent_m <= EXTENT_M[1]:
        expected = f"{EXTENT_M[0]:g} m to {EXTENT_M[1]:g} m"
        raise refused(f"a machine of {extent_m:.4g} m", expected, "correct mesh.unit, the unit of length of the file")
    body = _boxes(nodes_m, corners) if form == "hexahedron" else _of_one_part(nodes_m, corners)
    _require_sound(body)
    if order == 2 and form != "hexahedron":
        from skfem import Basis, ElementTetP2

        basis = Basis(body.mesh, ElementTetP2(), intorder=1)
        body = _of_one_part(basis.doflocs.T.copy(), basis.element_dofs.T.astype(np.int64))
    if len(body.nodes_m) > MOST_MESH_NODES:
        found = f"{len(body.nodes_m)} nodes, those in the middle of edges among them"
        raise refused(found, f"at most {MOST_MESH_NODES}", "mesh more coarsely, or set mesh.order = 1")
    return NamedMesh(body, _groups(read, body, used, path))


def _read(path: Path) -> Any:
    """What meshio reads; every way in which that fails is one message."""

    def unreadable(found: str) -> ModelFileError:
        expected = "a mesh of Gmsh (.msh), Abaqus (.inp), VTK (.vtu) or Salome (.med)"
        return refused(f"{found} at {path.name}", expected, "check the path, or write the mesh again")

    content = bytes_of(path, LARGEST_MESH_BYTES, unreadable)
    form = FORMATS.get(path.suffix.lower())
    if form is None:
        raise unreadable(f"the ending {path.suffix!r}")
    if form == "gmsh" and b"$EndElements" not in content:
        raise unreadable("a file without $EndElements")
    if form == "vtu" and (b"</VTKFile>" not in content or b"<!DOCTYPE" in content):
        raise unreadable("a file without </VTKFile>, or with a document type")
    if form == "abaqus" and re.search(rb"(?im)^[ \t*]*i\**n\**c\**l\**u\**d\**e", content.replace(b"\r", b"\n")):
        raise unreadable("*INCLUDE of another file")
    import meshio

    try:
        if form == "med" and _has_external_link(path):
            raise unreadable("a link to another file")
        return getattr(meshio, form).read(path)
    except (ModuleNotFoundError, ModelFileError):
        raise
    except (Exception, SystemExit) as error:
        said = " ".join(str(error).split())[:120] or type(error).__name__
        raise unreadable(f"no mesh that meshio can read as {form} ({said})") from None


def _has_external_link(path: Path) -> bool:
    import h5py

    with h5py.File(path, "r") as file:
        return bool(file.visititems_links(lambda _, link: isinstance(link, h5py.ExternalLink) or None))


def _of_one_part(nodes_m: Array, cells: Indices) -> SolidMesh:
    return SolidMesh(nodes_m, cells, (WHOLE,), (WHOLE,), np.zeros(len(cells), dtype=np.int64))


def _boxes(nodes_m: Array, corners: Indices) -> SolidMesh:
    """Hexahedra with edges along the axes, their corners in scikit-fem's order."""
    from skfem import ElementHex1

    places = nodes_m[corners]
    low, high = places.min(axis=1)[:, None], places.max(axis=1)[:, None]
    upper = np.abs(places - high) < np.abs(places - low)
    place = np.where(upper, high, low)
    number = upper @ np.array([4, 2, 1])
    wanted = ElementHex1.doflocs.astype(np.int64) @ np.array([4, 2, 1])
    if np.abs(places - place).max() > 1e-6 * (high - low).max() or (np.sort(number, axis=1) != np.arange(8)).any():
        raise refused("hexahedra that are no boxes", "tetrahedra, or boxes along X, Y and Z", "mesh with tetrahedra")
    cells = np.take_along_axis(corners, np.argsort(number, axis=1)[:, wanted], axis=1)
    return _of_one_part(nodes_m, cells)


def _require_sound(body: SolidMesh) -> None:
    """Refuses elements that are flat, there twice, or that lie on the same side of a face in common."""
    mesh = body.mesh
    flat = np.flatnonzero(body.volume_m3 < _FLAT * (body.high_m - body.low_m).max(axis=1) ** 3)
    twice = len(body.cells) - len(np.unique(np.sort(np.asarray(mesh.t), axis=0), axis=1).T)
    shared = np.flatnonzero(np.asarray(mesh.f2t)[1] >= 0)
    a, b, c = body.nodes_m[np.asarray(mesh.facets)[:3, shared]]
    normal = np.cross(b - a, c - a)
    sides = [((body.cell_centres_m(owner) - a) * normal).sum(axis=1) for owner in np.asarray(mesh.f2t)[:, shared]]
    folded = shared[sides[0] * sides[1] > 0]
    for count, what, at in (
        (len(flat), "flat elements, without a volume", body.cell_centres_m(flat)),
        (twice, "elements that are there twice", body.nodes_m),
        (len(folded), "faces with both elements on one side: inverted elements", body.facet_centres_m(folded)),
    ):
        if count:
            found = f"{count} {what}, near ({', '.join(f'{x:.4g}' for x in at[0])}) m"
            raise refused(found, "elements side by side", "repair or refine the mesh there")


def _groups(read: Any, body: SolidMesh, used: Indices, path: Path) -> dict[str, Group]:
    """Name → group, in the numbers of the body."""
    number = np.full(len(read.points), -1)
    number[used] = np.arange(len(used))
    firsts = np.cumsum([0, *(len(block.data) if block.dim == 3 else 0 for block in read.cells)])
    # three corners tell a face from all others
    key = np.array([len(used) ** 2, len(used), 1], dtype=np.int64)
    faces = key @ np.sort(np.asarray(body.mesh.facets), axis=0)[:3]
    order = np.argsort(faces)
    empty = np.zeros(0, dtype=np.int64)
    collected: dict[str, list[list[Indices]]] = defaultdict(lambda: [[empty], [empty], [empty]])
    for name, block, chosen in _named_cells(read, path):
        members = read.cells[block]
        if members.dim == 3:
            collected[name][0].append(firsts[block] + chosen)
            continue
        nodes = number[np.asarray(members.data)[chosen]]
        if members.dim < 2:
            collected[name][2].append(nodes.ravel())
            continue
        wanted = np.sort(nodes[:, : 4 if members.type.startswith("quad") else 3], axis=1)[:, :3] @ key
        at = order[np.minimum(np.searchsorted(faces, wanted, sorter=order), len(faces) - 1)]
        collected[name][1].append(np.where((faces[at] == wanted) & (nodes.min(axis=1) >= 0), at, -1))
    families = (getattr(read, "point_tags", None) or {}).items()
    tagged = [(name, np.flatnonzero(read.point_data["point_tags"] == tag)) for tag, names in families for name in names]
    for name, points in (*read.point_sets.items(), *tagged):
        collected[name][2].append(number[np.asarray(points, dtype=np.int64)])
    groups = {WHOLE: Group(np.arange(len(body.cells)), empty, empty)}
    for name, parts in collected.items():
        cells, own, nodes = (np.unique(np.concatenate(part)).astype(np.int64) for part in parts)
        groups[name] = Group(cells, own, nodes[nodes >= 0])
    return groups


def _named_cells(read: Any, path: Path) -> Iterator[tuple[str, int, Indices]]:
    """(name, block, numbers in it) of all groups of elements, faces and points, whatever the format calls them.

    Whole numbers at the elements are groups too, such as "material 3"; in Gmsh and MED files these numbers have names.
    """
    headers = _abaqus_headers(path) if path.suffix.lower() == ".inp" else []
    for name, sets in read.cell_sets.items():
        if not name.startswith("gmsh:") and name not in headers:
            for block, chosen in enumerate(sets):
                if np.ndim(chosen) == 1 and len(chosen):
                    yield name, block, np.asarray(chosen, dtype=np.int64)
    for block, name in enumerate(headers):
        if name:
            yield name, block, np.arange(len(read.cells[block].data))
    names: dict[tuple[str, int, int | None], list[str]] = defaultdict(list)
    for name, of in read.field_data.items():
        if np.shape(of) == (2,):
            names["gmsh:physical", int(of[0]), int(of[1])].append(name)
    for tag, families in (getattr(read, "cell_tags", None) or {}).items():
        names["cell_tags", int(tag), None] += families
    for label, blocks in read.cell_data.items():
        for block, tags in enumerate(blocks):
            whole = np.ndim(tags) == 1 and np.asarray(tags).dtype.kind in "iu"
            values = np.unique(tags) if whole else np.zeros(0)
            for tag in map(int, values[:_MOST_VALUES]):
                named = names.get((label, tag, read.cells[block].dim)) or names.get((label, tag, None))
                for name in named or [f"{label} {tag}"]:
                    yield name, block, np.flatnonzero(tags == tag)


def _abaqus_headers(path: Path) -> list[str]:
    """Names of the sets in the headers of all blocks of elements, empty for none: meshio gives them to other blocks."""
    found = re.findall(r"(?im)^\*element[ \t]*,(.*)$", path.read_text(encoding="utf-8", errors="replace"))
    return [next(iter(re.findall(r"(?i)\belset\s*=\s*([^,\s]+)", header)), "") for header in found]
