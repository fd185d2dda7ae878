"""Mesh files of bars and of the fixture's C-frame, in every format that is read, and model files about them."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import meshio
import numpy as np

from selector.physics.thermal.field.mesh import block_mesh

ROOT = Path(__file__).parents[4]


def _made():
    spec = importlib.util.spec_from_file_location("make_thermal_mesh", ROOT / "fixtures" / "make" / "thermal_mesh.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


made = _made()


def tetra_mesh(blocks, cell_m, surfaces, points=()):
    """The blocks as tetrahedra: a group a part; `surfaces` picks faces by their centres, `points` a node each."""
    body = block_mesh(blocks, cell_m)
    cells, box = made.tetrahedra(body)
    faces = made.outer_faces(cells)
    centres = body.nodes_m[faces].mean(axis=1)
    found, sets = [("tetra", cells)], {}
    for k, part in enumerate(body.parts):
        sets[part] = (0, np.flatnonzero(body.kind[box] == k))
    for name, where in surfaces.items():
        sets[name] = (len(found), None)
        found.append(("triangle", faces[where(centres)]))
    for name, at in dict(points).items():
        sets[name] = (len(found), None)
        found.append(("vertex", [[int(np.argmin(np.linalg.norm(body.nodes_m - np.array(at), axis=1)))]]))
    none = np.zeros(0, dtype=int)
    return meshio.Mesh(
        body.nodes_m,
        found,
        cell_sets={
            name: [
                none if k != at else np.arange(len(block[1])) if chosen is None else chosen
                for k, block in enumerate(found)
            ]
            for name, (at, chosen) in sets.items()
        },
    )


def write(mesh, path, version="2.2", *, binary=False):
    """The mesh in the format that the ending says; groups as this format has them."""
    tags = {}
    own = [np.zeros(len(block.data), dtype=int) for block in mesh.cells]
    for number, (name, sets) in enumerate(mesh.cell_sets.items(), 1):
        for block, chosen in enumerate(sets):
            if len(chosen):
                own[block][chosen] = number
                tags[name] = (number, mesh.cells[block].dim)
    if path.suffix == ".inp":
        surfaces = [k for k, block in enumerate(mesh.cells) if block.type != "vertex"]
        kept = [mesh.cells[k] for k in surfaces]
        sets = {
            name: [of[k] for k in surfaces] for name, of in mesh.cell_sets.items() if any(len(of[k]) for k in surfaces)
        }
        points = {name: mesh.cells[k].data[chosen].ravel() for name, of in mesh.cell_sets.items()
                  for k, chosen in enumerate(of) if len(chosen) and k not in surfaces}  # fmt: skip
        meshio.abaqus.write(path, meshio.Mesh(mesh.points, kept, cell_sets=sets, point_sets=points))
    elif path.suffix == ".med":
        whole = meshio.Mesh(*_merged(mesh, own))
        whole.cell_tags = {-number: [name] for name, (number, _) in tags.items()}
        meshio.med.write(path, whole)
    elif path.suffix == ".vtu":
        meshio.vtu.write(path, meshio.Mesh(mesh.points, mesh.cells, cell_data={"group": own}))
    else:
        data = {"gmsh:physical": own, "gmsh:geometrical": own}
        names = {name: np.array(of) for name, of in tags.items()}
        point_data = {}
        if version == "4.1":
            # a block and an entity a group; every node belongs to one of its entities
            pairs = [
                (block.type, block.data[of == n], n)
                for block, of in zip(mesh.cells, own, strict=True)
                for n in np.unique(of)
            ]
            mesh = meshio.Mesh(mesh.points, [(form, cells) for form, cells, _ in pairs])
            own = [np.full(len(cells), n) for _, cells, n in pairs]
            entity = np.zeros((len(mesh.points), 2), dtype=int)
            for block, of in zip(mesh.cells, own, strict=True):
                entity[np.unique(block.data)] = (block.dim, of[0])
            data, point_data = {"gmsh:physical": own, "gmsh:geometrical": own}, {"gmsh:dim_tags": entity}
        told = meshio.Mesh(mesh.points, mesh.cells, point_data=point_data, cell_data=data, field_data=names)
        meshio.gmsh.write(path, told, fmt_version=version, binary=binary)
    return path


def _merged(mesh, own):
    """MED wants one block for each form."""
    blocks, tags = {}, {}
    for block, of in zip(mesh.cells, own, strict=True):
        blocks.setdefault(block.type, []).append(block.data)
        tags.setdefault(block.type, []).append(-of)
    cells = [(form, np.concatenate(data)) for form, data in blocks.items()]
    return mesh.points, cells, {}, {"cell_tags": [np.concatenate(of) for of in tags.values()]}


def model_text(mesh, sections, unit="m", order=2):
    """A model file about a mesh; `sections` are the rest of it."""
    return f"""
[model]
kind = "mesh"
name = "a mesh"
[run]
duration_min = 60
[conditions]
spindle_speed_rpm = 1000
[mesh]
file = "{mesh}"
unit = "{unit}"
order = {order}
{sections}
"""
