"""Machines from meshes: the shipped C-frame read back, what a model file asks of groups, and from the command line."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace

import meshio
import numpy as np
import pytest
from scipy.spatial import KDTree

from selector.cli import exit_status
from selector.errors import ModelFileError
from selector.physics.model_fields import model_file_text
from selector.physics.model_text import plain_values
from selector.physics.thermal import field_model
from selector.physics.thermal.field import field_machine
from selector.physics.thermal.field.geometry import feet, heated_parts, heated_surfaces, surfaces
from selector.physics.thermal.field.machine import FOOT_N_PER_M, film_sets
from selector.physics.thermal.field.mesh import Block, elasticity
from selector.physics.thermal.field_model import field_moment, mesh_of, meshed, with_candidates
from selector.physics.thermal.model_file import read_model_file, stated_laws
from selector.physics.thermal.network.heat_system import Conditions, factorised
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.thermal.thermal_model import thermal_model
from selector.text_file import toml_key, toml_value
from tests.physics.thermal.field.mesh_files import ROOT, model_text, tetra_mesh, write

EXAMPLE = ROOT / "fixtures" / "thermal" / "c-frame.toml"


def toml_sections(sections):
    lines = []
    for kind, entries in sections.items():
        for name, values in entries.items():
            lines.append(f"[{kind}.{toml_key(name)}]")
            lines += [f"{key} = {toml_value(value)}" for key, value in values.items()]
    return "\n".join(lines)


def c_frame_files(machine, folder):
    """The shipped C-frame as a mesh of hexahedra with groups, and the model file that makes a machine of it again."""
    body, geometry = machine.mesh, machine.geometry
    rings = dict(surfaces(body, geometry))
    rings |= heated_surfaces(body, geometry)
    rings |= {f"foot {name}": facets for name, facets in feet(body, geometry).items()}
    rings["nose"] = body.surface_of(["spindle"], lambda c: np.isclose(c[:, 2], geometry.nose_z_m))
    rings["work"] = body.surface_of(["table"], lambda c: np.isclose(c[:, 2], geometry.table_top_m))
    cells = [("hexahedron", body.cells[:, [7, 4, 1, 5, 6, 2, 0, 3]])]
    whole = body.triangles().reshape(-1, 2, 3)
    for facets in rings.values():
        pairs = whole[np.searchsorted(body.mesh.boundary_facets(), facets)]
        cells.append(("quad", np.column_stack([pairs[:, 0], pairs[:, 1, 2]])))
    none = [np.zeros(0, dtype=int)] * len(cells)
    sets = {f"part {part}": [body.cells_of(part), *none[1:]] for part in body.parts}
    for number, name in enumerate(rings, 1):
        sets[name] = [np.arange(len(cells[number][1])) if k == number else none[k] for k in range(len(cells))]
    meshio.Mesh(body.nodes_m, cells, cell_sets=sets).write(folder / "c-frame.inp")
    tool_m = [0.0, geometry.spindle_y_m, geometry.nose_z_m]

    def reading(below_m, direction):
        at = [*tool_m[:2], tool_m[2] - below_m]
        return {"tool": "nose", "tool_xyz": at, "work": "work", "direction": direction}

    materials = dict(zip(body.parts, body.materials, strict=True))
    sources = {name: {"shares": {f"part {parts[0]}": 1.0}} for name, parts in heated_parts().items()}
    sources["hydraulic line"] = {"shares": {"hydraulic line": 1.0}}
    sections = {
        "parts": {f"part {part}": {"material": material} for part, material in materials.items()},
        "sources": sources,
        "films": {name: {"groups": [name], "still_w_per_m2_k": 8.0} for name in surfaces(body, geometry)},
        "supports": {
            name: {"groups": [f"foot {name}"], "stiffness_n_per_m": list(FOOT_N_PER_M)} for name in feet(body, geometry)
        },
        "displacements": {
            "X": reading(0.0, [1.0, 0.0, 0.0]),
            "Z": reading(0.0, [0.0, 0.0, -1.0]),
            "Y_lower": reading(0.30, [0.0, 1.0, 0.0]),
            "Y_upper": reading(0.05, [0.0, 1.0, 0.0]),
        },
    }
    sensor = '\n[[sensors]]\nname = "T01"\nxyz = [0.0, 0.62, 0.98]\n'
    (folder / "c-frame.toml").write_text(model_text("c-frame.inp", toml_sections(sections) + sensor), encoding="utf-8")
    return folder / "c-frame.toml"


def test_the_shipped_c_frame_read_back_is_the_same_machine(tmp_path):
    shipped = field_machine(refinement=0.1, probes={"T01": (0.0, 0.62, 0.98)})
    file = read_model_file(c_frame_files(shipped, tmp_path))
    again = meshed(file, stated_laws(file))
    away, same = KDTree(again.mesh.nodes_m).query(shipped.mesh.nodes_m)
    assert away.max() < 1e-12  # written with 16 digits
    hot = {"lower bearing": 150.0, "motor": 200.0, "Z nut": 20.0, "hydraulic line": 30.0}
    films = dict.fromkeys(shipped.system.films, 8.0)
    for tau_s in (60.0, np.inf):
        first, second = (
            factorised(one, films, tau_s)(sum(watts * one.sources[name] for name, watts in hot.items()))
            for one in (shipped.system, again.full)
        )
        # round-off of one factorisation
        np.testing.assert_allclose(second[same], first, rtol=1e-9, atol=1e-9)
        assert again.full.probes["T01"] @ second == pytest.approx(shipped.system.probes["T01"] @ first, rel=1e-9)
        for name in again.full.displacements:
            z_um = shipped.system.displacements[name] @ first
            assert again.full.displacements[name] @ second == pytest.approx(z_um, rel=1e-7, abs=1e-7)
    assert abs(shipped.system.displacements["Z"] @ first) > 50.0
    # and node by node
    moved = shipped.deformation(20.0 + first)
    held = again.elastic or elasticity(again.mesh, again.materials, again.springs_n_per_m)
    np.testing.assert_allclose(held.displacement_um(second)[same], moved, rtol=0, atol=1e-6 * np.abs(moved).max())


@pytest.fixture(scope="module")
def example():
    return thermal_model(read_model_file(EXAMPLE))


def test_the_example_reduced_is_the_example_in_full(example):
    file = example.file
    laws = stated_laws(file)
    whole = meshed(file, laws)
    assert whole.full.size > 1000 > 150 > whole.system.size
    hours = Conditions(
        np.array([0.0, 3600.0, 7200.0, 10800.0]),
        spindle_speed=np.array([3000.0, 0.0, 1500.0, 1500.0]),
        coolant_on=np.array([0.0, 1.0, 1.0, 1.0]),
        ambient_degc=np.array([20.0, 21.0, 22.0, 22.0]),
    )
    full, reduced = (
        simulate_heat(system, laws, hours, time_s=np.arange(0.0, 10800.0, 600.0), step_s=60.0, start_degc=20.0)
        for system in (whole.full, whole.system)
    )
    # the basis leaves out 3e-4 of a response; found 1 mK of 9 K, 0.02 µm of 25 µm
    np.testing.assert_allclose(reduced.probe_degc, full.probe_degc, atol=0.01)
    np.testing.assert_allclose(reduced.displacement_um, full.displacement_um, atol=0.05)
    assert np.ptp(full.probe_degc) > 5.0
    assert np.ptp(full.displacement_um) > 10.0


def test_thermometers_gauges_and_the_moment_read_one_field(example):
    hours = Conditions(np.array([0.0, 7200.0]), spindle_speed=3000.0)
    recording = example.simulate(hours, instruments=False, time_s=np.array([0.0, 7000.0]))
    moment = field_moment(example.file, hours, 7000.0)
    mesh = mesh_of(example.file)
    hot = mesh.shares("front bearing") @ moment.temperature_degc
    assert recording.frame["front bearing"].iloc[-1] == pytest.approx(hot, abs=1e-6)
    # the nose against the table, both even: shares of their surfaces, Z counted towards the table
    nose, table = mesh.shares("nose"), mesh.shares("table top")
    there = (nose @ mesh.body.nodes_m)[:2] - (table @ mesh.body.nodes_m)[:2]
    z = moment.deformation_um[:, 2]
    tilt = [np.polyfit(mesh.body.nodes_m[table > 1e-12, k], z[table > 1e-12], 1)[0] for k in (0, 1)]
    # the fit above weighs nodes alike, which the table, almost a plane, hardly tells
    assert recording.frame["Z"].iloc[-1] == pytest.approx(-(nose @ z - table @ z - there @ tilt), abs=0.3)
    assert moment.triangles.max() < len(moment.nodes_m)


def test_its_laws_are_parameters_and_change_without_another_mesh(example):
    told = example.parameters
    assert told["films.air.still_w_per_m2_k"].value == 8.0
    assert told["sources.friction.speed_w"].value == 220.0
    assert not [name for name in told if name.startswith(("parts", "mesh", "supports"))]
    hours = Conditions(np.array([0.0, 14400.0]), spindle_speed=3000.0)
    cooler = example.with_parameters({"films.air.still_w_per_m2_k": 24.0})
    assert cooler.machine.system is example.machine.system
    warm, cool = (one.simulate(hours, instruments=False).frame["head"].iloc[-1] for one in (example, cooler))
    assert cool < warm - 1.0


def test_a_machine_is_made_again_only_where_the_file_says_another(example):
    file, laws = example.file, stated_laws(example.file)
    whole = meshed(file, laws)
    other_run = file.model_copy(update={"run": file.run.model_copy(update={"duration_min": 7.0}), "gauges": ()})
    assert meshed(other_run, laws) is whole
    moved = tuple(one.model_copy(update={"xyz": (0.0, 0.10, 0.7), "at": None}) for one in file.sensors[:1])
    asked, elasticity = [], field_model.elasticity
    with pytest.MonkeyPatch.context() as patch:
        # a machine that another process has made comes without its own
        patch.setattr(field_model, "elasticity", lambda *of: asked.append(1) or whole.elastic or elasticity(*of))
        patch.setattr(field_model, "reduced_basis", lambda *_: whole.basis)
        again = meshed(file.model_copy(update={"sensors": (*moved, *file.sensors[1:])}), laws)
        assert asked == [1]
        assert (again.full.probes[file.sensors[0].name] != 0).any()
        meshed(file, laws)


def test_a_model_file_written_anew_names_the_mesh_beside_it(tmp_path):
    file = read_model_file(EXAMPLE)
    (tmp_path / "again.toml").write_text(model_file_text(plain_values(file)), encoding="utf-8")
    shutil.copy(file.mesh.file, tmp_path)
    again = read_model_file(tmp_path / "again.toml")
    assert again.mesh.file == str(tmp_path.resolve() / "c-frame.msh")
    assert again.model_copy(update={"mesh": file.mesh}) == file


def test_candidates_are_spread_over_groups(example):
    file = example.file.model_copy(update={"candidates": None})
    wanted = type(file).model_validate(file.model_dump() | {"candidates": {"spacing_m": 0.2, "surfaces": ["outside"]}})
    written = with_candidates(wanted)
    spread = written.sensors[len(file.sensors) :]
    places = np.array([sensor.xyz for sensor in spread])
    assert spread[0].name == "P01"
    assert 40 < len(spread) < 200
    nearest = KDTree(places).query(places, k=2)[0][:, 1]
    assert nearest.min() >= 0.2 - 2e-4  # places are rounded to 0.1 mm
    # they cover it: no face is farther from one than two spacings
    mesh = mesh_of(file)
    centres = mesh.body.facet_centres_m(mesh.facets("outside", outer=True))
    assert KDTree(places).query(centres)[0].max() < 0.4
    for place in places[::10]:
        point, _ = mesh.body.nearest(place)
        np.testing.assert_allclose(point, place, atol=1e-4)


def plate(folder, sections, blocks=None):
    blocks = blocks or [Block("plate", "", (0.0, 0.0, 0.0), (0.4, 0.2, 0.1))]
    surfaces_of = {
        "foot": lambda c: np.isclose(c[:, 0], 0.0),
        "end": lambda c: np.isclose(c[:, 0], 0.4),
        "top": lambda c: np.isclose(c[:, 2], c[:, 2].max()),
    }
    write(tetra_mesh(blocks, 0.1, surfaces_of, {"tip": (0.4, 0.2, 0.1)}), folder / "plate.msh")
    (folder / "plate.toml").write_text(model_text("plate.msh", sections), encoding="utf-8")
    return folder / "plate.toml"


FILM = '[films.air]\ngroups = ["all"]\nstill_w_per_m2_k = 8.0'
FOOT = '[supports.foot]\ngroups = ["foot"]'
PLATE = {
    "parts": '[parts.plate]\nmaterial = "steel"',
    "films": FILM,
    "supports": FOOT,
    "displacements": '[displacements.X]\ntool = "end"',
    "sources": "[sources.heat]\nshares = { end = 1.0 }\nspeed_w = 50.0",
}


def with_part(**changed):
    return "\n".join((PLATE | changed).values())


def test_a_machine_is_held_heated_and_read_at_points_too(tmp_path):
    sections = with_part(
        sources="[sources.heat]\nshares = { tip = 0.5, top = 0.5 }\nspeed_w = 50.0",
        displacements='[displacements.X]\ntool = "tip"\n'
        "[displacements.at]\ntool_xyz = [0.4, 0.2, 0.1]\ndirection = [2, 0, 0]",
    )
    model = thermal_model(read_model_file(plate(tmp_path, sections)))
    hour = Conditions(np.array([0.0, 3600.0]), spindle_speed=1000.0)
    recording = model.simulate(hour, time_s=np.array([0.0, 3599.0]))
    # the same node by its name and by its place
    assert recording.frame["X"].iloc[-1] == pytest.approx(recording.frame["at"].iloc[-1], rel=1e-9)
    assert recording.frame["X"].iloc[-1] > 5.0


@pytest.mark.parametrize(
    ("changed", "where", "found"),
    [
        ({"parts": '[parts.plate]\nmaterial = "iron"'}, "parts.plate.material", "'iron'"),
        ({"parts": "[parts.plate]\nyoung_pa = 1e11"}, "parts.plate", "no conductivity_w_per_m_k"),
        ({"parts": '[parts.top]\nmaterial = "steel"'}, "mesh.file", "'top' that touches nothing"),
        ({"parts": '[parts.plat]\nmaterial = "steel"'}, "mesh.file", "no group called 'plat'"),
        ({"films": FILM.replace("all", "side")}, "mesh.file", "no group called 'side'"),
        ({"films": FILM.replace("all", "end") + "\nwhile_coolant = true"}, "mesh.file", "no film cools"),
        ({"supports": '[supports.foot]\ngroups = ["tip"]'}, "mesh.file", "that floats"),
        ({"supports": FOOT + "\nstiffness_n_per_m = [0, 1e8, 1e8]"}, "mesh.file", "that floats"),
        ({"displacements": "[displacements.X]\n"}, "displacements.X", "without a tool"),
        ({"displacements": '[displacements.tip]\ntool = "end"'}, "displacements.tip.direction", "no direction"),
        ({"displacements": '[displacements.X]\ntool = "end"\nwork = "tip"'}, "mesh.file", "points on a line"),
        ({"displacements": "[displacements.X]\ntool_xyz = [0, 3, 0]"}, "displacements.X.tool_xyz", "2800 mm away"),
        ({"sources": "[sources.heat]\nshares = { end = 0.9 }"}, "sources.heat.shares", "add up to 0.9"),
        ({"sources": '[[sensors]]\nname = "T1"'}, "mesh.file", "no group called 'T1'"),
        ({"sources": '[[sensors]]\nname = "T1"\nxyz = [400, 0, 0]'}, "sensors[1].xyz", "mm away"),
        ({"sources": '[[sensors]]\nname = "end"\nxyz = [0, 0, 0]\n[[sensors]]\nname = "T2"\nat = "end"'},
         "sensors[1].name", "called as the group 'end'"),
        ({"sources": '[candidates]\nsurfaces = ["head"]'}, "mesh.file", "no group called 'head'"),
    ],
)  # fmt: skip
def test_what_does_not_fit_the_mesh_is_one_message(tmp_path, changed, where, found):
    with pytest.raises(ModelFileError) as caught:
        thermal_model(read_model_file(plate(tmp_path, with_part(**changed))))
    assert caught.value.where.endswith(f"key {where}")
    assert found in caught.value.found
    assert caught.value.expected
    assert caught.value.advice


def test_two_bodies_that_share_no_nodes(tmp_path):
    apart = [Block("plate", "", (0.0, 0.0, 0.0), (0.4, 0.2, 0.1)), Block("plate", "", (0.0, 0.0, 0.2), (0.4, 0.2, 0.3))]
    with pytest.raises(
        ModelFileError, match=r"a piece of \d+ of \d+ elements around .*, which no faces join .* floats"
    ):
        thermal_model(read_model_file(plate(tmp_path, with_part(supports='[supports.tip]\ngroups = ["tip"]'), apart)))
    # each held and cooled: two machines in one file are no fault
    assert thermal_model(read_model_file(plate(tmp_path, with_part(), apart))).name == "a mesh"


def test_a_body_that_lies_on_another_without_common_nodes(tmp_path):
    # blocks that touch share their nodes here; a micrometre apart they do not
    upper = Block("plate", "", (0.1, 0.05, 0.100001), (0.3, 0.2, 0.200001))
    both = [Block("plate", "", (0.0, 0.0, 0.0), (0.4, 0.2, 0.1)), upper]
    with pytest.raises(ModelFileError, match=r"faces that lie on faces of another piece .* near \(.*, 0\.1\) m"):
        thermal_model(read_model_file(plate(tmp_path, with_part(), both)))


class TestFromTheCommandLine:
    @pytest.fixture
    def folder(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        for name in ("c-frame.toml", "c-frame.msh"):
            shutil.copy(EXAMPLE.parent / name, tmp_path / name)
        return tmp_path

    def refusal(self, capfd):
        capfd.readouterr()
        code = exit_status(["simulate", "thermal", "c-frame.toml", "--out", "a.csv"])
        out, err = capfd.readouterr()
        assert code == 2
        assert out == ""
        assert "Traceback" not in err
        assert "Expected" in err
        assert "What to do" in err
        return " ".join(err.split())

    @pytest.mark.parametrize("name", ["../c-frame.msh", "/etc/hostname", "link.msh"])
    def test_a_mesh_elsewhere(self, folder, capfd, name):
        (folder / "link.msh").symlink_to(EXAMPLE.parent / "c-frame.msh")
        model = folder / "c-frame.toml"
        model.write_text(model.read_text(encoding="utf-8").replace('c-frame.msh"', f'{name}"'), encoding="utf-8")
        said = self.refusal(capfd)
        assert "outside the folder of the model file" in said
        assert "c-frame.toml, key mesh.file" in said

    def test_a_mesh_that_ends_too_early(self, folder, capfd):
        content = (folder / "c-frame.msh").read_bytes()
        (folder / "c-frame.msh").write_bytes(content[: len(content) // 2])
        said = self.refusal(capfd)
        assert "a file without $EndElements at c-frame.msh Where: c-frame.toml, key mesh.file" in said

    def test_a_tool_point_in_millimetres(self, folder, capfd):
        path = folder / "c-frame.toml"
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("[0.0, 0.43, 0.52]", "[0.0, 430, 520]"), encoding="utf-8")
        assert exit_status(["simulate", "thermal", str(path), "--out", str(folder / "out.csv")]) == 2
        said = capfd.readouterr().err
        assert "673 m away" in said
        assert "tool_xyz" in said

    def test_metres_that_are_millimetres(self, folder, capfd):
        model = folder / "c-frame.toml"
        model.write_text(model.read_text(encoding="utf-8").replace('"mm"', '"m"'), encoding="utf-8")
        assert "a machine of 1200 m" in self.refusal(capfd)

    def test_without_the_extra(self, folder, capfd, monkeypatch):
        # another mesh than that of a machine which has been made
        with (folder / "c-frame.msh").open("ab") as mesh:
            mesh.write(b"\n")
        monkeypatch.setitem(sys.modules, "meshio", None)
        assert "this needs the package meshio" in self.refusal(capfd)
        assert '".[field]"' in self.refusal(capfd)


def test_film_sets_reach_the_speed_that_films_are_stated_for(example):
    laws = stated_laws(example.file)
    fast = [replace(law, reference_rpm=8000.0) if law.speed_w_per_m2_k else law for law in laws.films]
    # 9 at rest and 30 more at 8000 r/min
    assert {one["air at the nose"] for one in film_sets(replace(laws, films=tuple(fast)))} == {9.0, 39.0}
