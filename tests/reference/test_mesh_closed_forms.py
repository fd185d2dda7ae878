"""Mesh files of tetrahedra against closed forms, coarse and fine: fin, free expansion, bent by a gradient, bimetal."""

from __future__ import annotations

import numpy as np
import pytest

from selector.physics.thermal.field.mesh import MATERIALS, Block
from selector.physics.thermal.field_model import meshed
from selector.physics.thermal.model_file import read_model_file, stated_laws
from selector.physics.thermal.network.heat_system import factorised
from tests.physics.thermal.field.mesh_files import model_text, tetra_mesh, write

IRON = MATERIALS["cast iron"]

#: Held at three points so that it expands without any force.
HELD = """
[supports.corner]
groups = ["corner"]
[supports.along]
groups = ["along"]
stiffness_n_per_m = [0, 1e9, 1e9]
[supports.across]
groups = ["across"]
stiffness_n_per_m = [0, 0, 1e9]
[films.air]
groups = ["sides"]
still_w_per_m2_k = 2.5
"""


def bar(folder, blocks, cell_m, sections, order):
    """The machine of a bar along X from 0, with groups base, tip and sides, and three corners to hold it."""
    length = max(block.high_m[0] for block in blocks)
    width = blocks[0].high_m[1]
    mesh = tetra_mesh(
        blocks,
        cell_m,
        {
            "base": lambda c: np.isclose(c[:, 0], 0.0),
            "tip": lambda c: np.isclose(c[:, 0], length),
            "sides": lambda c: ~np.isclose(c[:, 0], 0.0) & ~np.isclose(c[:, 0], length),
        },
        {"corner": (0, 0, 0), "along": (length, 0, 0), "across": (0, width, 0)},
    )
    write(mesh, folder / "bar.msh")
    model = folder / "bar.toml"
    model.write_text(model_text("bar.msh", HELD + sections, order=order), encoding="utf-8")
    file = read_model_file(model)
    return meshed(file, stated_laws(file))


def box(*size):
    return [Block("body", "", (0, 0, 0), size)]


def errors_of(machine_of, cells, error):
    return np.array([error(machine_of(cell)) for cell in cells])


def orders(errors):
    """Order of convergence from mesh to mesh, each twice as fine as the one before."""
    return np.log2(errors[:-1] / errors[1:])


IRON_PART = '[parts.all]\nmaterial = "cast iron"\n'


def test_a_fin_follows_the_hyperbolic_cosine(tmp_path):
    length, width, film_coefficient, heat_w = 0.4, 0.005, 2.5, 0.3
    k, area, perimeter = IRON.conductivity_w_per_m_k, width**2, 4 * width
    m = np.sqrt(film_coefficient * perimeter / (k * area))
    base = heat_w / (np.sqrt(film_coefficient * perimeter * k * area) * np.tanh(m * length))
    sections = IRON_PART + '[sources.heat]\nshares = { base = 1.0 }\non_w = 0.3\n[displacements.X]\ntool = "tip"\n'

    def error(machine):
        steady = factorised(machine.full, {"air": film_coefficient}, np.inf)
        rise = steady(heat_w * machine.full.sources["heat"])
        exact = base * np.cosh(m * (length - machine.mesh.nodes_m[:, 0])) / np.cosh(m * length)
        return np.abs(rise - exact).max() / base

    linear, quadratic = (
        errors_of(
            lambda cell, order=order: bar(tmp_path, box(length, width, width), (cell, width, width), sections, order),
            [length / count for count in counts],
            error,
        )
        for order, counts in ((1, (4, 8, 16)), (2, (2, 4)))
    )
    # (m·h)² / 12 of a linear element, m·L = 2.6: 3.5 % with four; found 1.8, 0.46 and 0.12 %
    assert linear[0] < 0.035
    assert orders(linear) == pytest.approx([2.0, 2.0], abs=0.1)
    # found 0.16 and 0.02 %; of these 0.01 % are h·w / 2k, the profile across that the formula leaves out
    assert orders(quadratic) > 2.7
    assert quadratic[-1] < 3e-4


def test_a_free_bar_expands_by_the_integral_of_its_temperature(tmp_path):
    length, width = 0.4, 0.02
    sections = IRON_PART + '[displacements.X]\ntool = "tip"\nwork = "base"\n'
    # ∫ α θ dx of θ = 10 K·(x/L)²
    exact_um = 1e6 * IRON.expansion_per_k * 10.0 * length / 3

    def error(machine):
        rise = 10.0 * (machine.mesh.nodes_m[:, 0] / length) ** 2
        return abs(machine.full.displacements["X"] @ rise / exact_um - 1)

    linear, quadratic = (
        errors_of(
            lambda cell, order=order: bar(tmp_path, box(length, width, width), (cell, width, width), sections, order),
            [length / count for count in (4, 8)],
            error,
        )
        for order in (1, 2)
    )
    # a polygon for the parabola: (h/L)² / 2
    assert linear == pytest.approx([1 / 32, 1 / 128], rel=1e-6)
    # round-off: the supports take no force
    assert quadratic.max() < 1e-10


def test_a_gradient_bends_a_cantilever(tmp_path):
    length, high = 0.2, 0.02
    sections = IRON_PART + '[displacements.Z]\ntool = "tip"\nwork = "base"\n'
    exact_um = -1e6 * IRON.expansion_per_k * 10.0 * length**2 / (2 * high)

    def error(machine):
        rise = 10.0 * (machine.mesh.nodes_m[:, 2] / high - 0.5)
        return abs(machine.full.displacements["Z"] @ rise / exact_um - 1)

    linear, quadratic = (
        errors_of(
            lambda cell, order=order: bar(tmp_path, box(length, high, high), cell, sections, order),
            [high / through for through in counts],
            error,
        )
        for order, counts in ((1, (1, 2, 4)), (2, (1, 2)))
    )
    # linear tetrahedra are too stiff: 60 % of it is missing with one through the thickness, 33 with two, 12 with four
    assert linear == pytest.approx([0.60, 0.33, 0.12], abs=0.01)
    assert 0.8 < orders(linear)[0] < orders(linear)[1] < 2.0
    # αΔT L² / 2h is a parabola: round-off with one quadratic element
    assert quadratic.max() < 1e-9


def test_a_bimetal_strip_curves_as_timoshenko_says(tmp_path):
    thick, thin, length, width = 0.006, 0.004, 0.1, 0.006
    numbers = "conductivity_w_per_m_k = 50\nspecific_heat_j_per_kg_k = 500\ndensity_kg_per_m3 = 7000\npoisson = 0.3\n"
    sections = f"[parts.low]\nexpansion_per_k = 10e-6\nyoung_pa = 110e9\n{numbers}"
    sections += f"[parts.high]\nexpansion_per_k = 19e-6\nyoung_pa = 70e9\n{numbers}"
    sections += '[displacements.Z]\ntool = "tip"\nwork = "base"\n'
    low = Block("low", "", (0, 0, 0), (length, width, thick))
    high = Block("high", "", (0, 0, thick), (length, width, thick + thin))
    m, n, total = thick / thin, 110e9 / 70e9, thick + thin
    curvature = 6 * 9e-6 * 50 * (1 + m) ** 2 / (total * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))))
    exact_um = -1e6 * curvature * length**2 / 2

    def error(machine):
        return abs(machine.full.displacements["Z"] @ np.full(len(machine.mesh.nodes_m), 50.0) / exact_um - 1)

    linear, quadratic = (
        errors_of(lambda cell, order=order: bar(tmp_path, [low, high], cell, sections, order), cells, error)
        for order, cells in ((1, (0.006, 0.003, 0.0015)), (2, (0.006, 0.003)))
    )
    # found 46, 20 and 6 %
    assert 1.0 < orders(linear)[0] < orders(linear)[1] < 2.0
    # both meshes 0.40 %: the ends of the strip, 10 mm of 100, where the stress fades that the formula has throughout
    assert quadratic == pytest.approx([0.004, 0.004], abs=2e-4)
