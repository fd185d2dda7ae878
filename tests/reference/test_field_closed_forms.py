"""The finite elements against closed forms: rod, fin, lumped body, bimetal strip, free and bent bodies; their order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm
from scipy.sparse.linalg import spsolve

from selector.physics.thermal.field.mesh import (
    MATERIALS,
    Block,
    block_mesh,
    conduction_matrices,
    elastic_matrices,
    elasticity,
    film,
    rigid_motions,
    surface_source,
)
from selector.physics.thermal.network.heat_system import solver_of

IRON = MATERIALS["cast iron"]


def box(*size, cell, material="cast iron"):
    return block_mesh([Block("body", material, (0.0, 0.0, 0.0), size)], cell)


def at(axis, place):
    return lambda centres: np.isclose(centres[:, axis], place)


def history(capacity, conduction, load, start, time_s):
    """Exact in time: T' = C⁻¹(load − K T) in a matrix exponential with the load as one more state."""
    rate = np.linalg.solve(capacity.toarray(), np.c_[-conduction.toarray(), load])
    augmented = np.zeros((len(start) + 1, len(start) + 1))
    augmented[:-1] = rate
    return (expm(augmented * time_s) @ np.r_[start, 1.0])[:-1]


class TestHeat:
    def test_rod_with_a_step_of_heat_at_one_end_follows_the_series(self):
        # Carslaw and Jaeger (1959) § 3.8: flux into one end, the rest insulated
        length, width, heat_w = 0.3, 0.02, 10.0
        body = box(length, width, width, cell=(length / 60, width, width))
        capacity, conduction = conduction_matrices(body, MATERIALS)
        load = heat_w * surface_source(body, body.surface_of(["body"], at(0, length)))
        xi = body.nodes_m[:, 0] / length
        k, rho_c = IRON.conductivity_w_per_m_k, IRON.density_kg_per_m3 * IRON.specific_heat_j_per_kg_k
        n = np.arange(1, 200)[:, None]
        for time_s in (60.0, 600.0, 3600.0):
            fourier = k * time_s / rho_c / length**2
            series = ((-1.0) ** n / n**2 * np.exp(-(n**2) * np.pi**2 * fourier) * np.cos(n * np.pi * xi)).sum(axis=0)
            scale = heat_w / width**2 * length / k
            exact = scale * (fourier + (3 * xi**2 - 1) / 6 - 2 / np.pi**2 * series)
            found = history(capacity, conduction, load, np.zeros(len(xi)), time_s)
            # linear elements: h² / 12 times the curvature, which is largest at the heated end
            curvature = scale / length * (1 / np.sqrt(np.pi * k / rho_c * time_s) + 1 / length)
            assert np.abs(found - exact).max() < (length / 60) ** 2 / 12 * curvature

    def test_fin_follows_the_hyperbolic_cosine(self):
        length, width, film_coefficient, heat_w = 0.4, 0.02, 10.0, 5.0
        body = box(length, width, width, cell=(length / 80, width / 2, width / 2))
        _, conduction = conduction_matrices(body, MATERIALS)
        sides = body.surface_of(["body"], lambda c: (c[:, 0] > 1e-9) & (c[:, 0] < length - 1e-9))
        cooled = conduction + film_coefficient * film(body, sides)[0]
        base = surface_source(body, body.surface_of(["body"], at(0, 0.0)))
        found = spsolve(cooled.tocsc(), heat_w * base)
        k, area, perimeter = IRON.conductivity_w_per_m_k, width**2, 4 * width
        m = np.sqrt(film_coefficient * perimeter / (k * area))
        root = np.sqrt(film_coefficient * perimeter * k * area) * np.tanh(m * length)
        exact = heat_w / root * np.cosh(m * (length - body.nodes_m[:, 0])) / np.cosh(m * length)
        # the fin formula has no profile across: h·w / 2k = 0.2 % of the local excess; the mesh adds (m h)² / 12 ~ 1e-5
        assert np.abs(found / exact - 1).max() < 0.0022

    def test_small_biot_number_leaves_one_exponential(self):
        side, film_coefficient = 0.1, 2.0
        body = box(side, side, side, cell=side / 4)
        capacity, conduction = conduction_matrices(body, MATERIALS)
        cooled = conduction + film_coefficient * film(body, body.surface_of(["body"]))[0]
        tau_s = IRON.density_kg_per_m3 * IRON.specific_heat_j_per_kg_k * side**3 / (film_coefficient * 6 * side**2)
        found = history(capacity, cooled, np.zeros(len(body.nodes_m)), np.ones(len(body.nodes_m)), tau_s)
        # Biot number h·(V/S)/k = 7e-4; the slowest time constant is longer by about Bi, surface and centre differ by Bi
        biot = film_coefficient * side / 6 / IRON.conductivity_w_per_m_k
        assert np.abs(found - np.exp(-1)).max() < 2 * biot

    def test_temperature_converges_with_order_two(self):
        errors = []
        unit = replace(IRON, conductivity_w_per_m_k=1.0, density_kg_per_m3=1.0, specific_heat_j_per_kg_k=1.0)

        def wave(x):
            return np.cos(np.pi * x[0]) * np.cos(np.pi * x[1]) * np.cos(np.pi * x[2])

        for cells in (5, 10, 20):
            body = box(1.0, 1.0, 1.0, cell=1 / cells)
            capacity, conduction = conduction_matrices(body, {"cast iron": unit})
            load = capacity @ (wave(body.nodes_m.T) * (3 * np.pi**2 + 1))
            errors.append(l2_error(body, solver_of(sparse.csr_array(conduction + capacity)).solve(load), wave))
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        # trilinear: p + 1 = 2; 5 cells a half wave are still rough: 1.93
        assert orders == pytest.approx([2.0, 2.0], abs=0.1)


def l2_error(body, nodal, exact):
    from skfem import Basis, ElementHex1

    basis = Basis(body.mesh, ElementHex1(), intorder=5)
    there = np.asarray(basis.interpolate(nodal))
    return float(np.sqrt((((there - exact(np.asarray(basis.global_coordinates()))) ** 2) * basis.dx).sum()))


def three_two_one(body):
    """Springs that hold a body without any force on a free expansion: three at a corner, two, one."""
    springs = np.zeros((len(body.nodes_m), 3))
    low, high = body.nodes_m.min(axis=0), body.nodes_m.max(axis=0)

    def node(*place):
        return int(np.argmin(np.linalg.norm(body.nodes_m - np.array(place), axis=1)))

    springs[node(*low)] = 1e9
    springs[node(high[0], low[1], low[2]), 1:] = 1e9
    springs[node(low[0], high[1], low[2]), 2] = 1e9
    return springs


class TestDeformation:
    def test_a_free_block_expands_exactly(self):
        body = box(0.3, 0.2, 0.5, cell=(0.05, 0.07, 0.11))
        elastic = elasticity(body, MATERIALS, three_two_one(body))
        moved = elastic.displacement_um(np.full(len(body.nodes_m), 10.0))
        # no approximation: round-off of a solve with condition number about 1e6
        np.testing.assert_allclose(moved, 1e6 * IRON.expansion_per_k * 10.0 * body.nodes_m, atol=1e-8)

    def test_a_free_block_with_a_temperature_gradient_bends_exactly(self):
        # stress-free: u = α G (x z, y z, (z² − x² − y²) / 2) for T = G z; linear elements alone would lock
        body = box(1.0, 0.2, 0.1, cell=(0.25, 0.2, 0.1))
        elastic = elasticity(body, MATERIALS, three_two_one(body))
        x, y, z = body.nodes_m.T
        moved = elastic.displacement_um(20.0 * z)
        exact = 1e6 * IRON.expansion_per_k * 20.0 * np.stack([x * z, y * z, (z**2 - x**2 - y**2) / 2], axis=1)
        # the closed form is held elsewhere: leave out the rigid motion between the two
        motions = rigid_motions(body.nodes_m)
        difference = (moved - exact).ravel()
        rest = difference - motions @ np.linalg.lstsq(motions, difference, rcond=None)[0]
        # one cell through the thickness and round-off only
        assert np.abs(rest).max() < 1e-8 * np.abs(exact).max()

    def test_a_slender_beam_of_one_cell_through_the_thickness_does_not_lock(self):
        length, width, height, cells = 1.0, 0.05, 0.05, 10
        body = box(length, width, height, cell=(length / cells, width, height))
        springs = np.where(np.isclose(body.nodes_m[:, :1], 0.0), 1e15, 0.0) * np.ones(3)
        elastic = elasticity(body, MATERIALS, springs)
        force = np.zeros((len(body.nodes_m), 3))
        force[:, 2] = 1000.0 * surface_source(body, body.surface_of(["body"], at(0, length)))
        tip = np.asarray(elastic.solve(force.ravel())).reshape(-1, 3)[np.isclose(body.nodes_m[:, 0], length), 2].mean()
        bending = 1000.0 * length**3 / (3 * IRON.young_pa * width * height**3 / 12)
        # cubic deflection in 10 parabolas: 1/(4·10²) too stiff; clamp without side contraction 0.5 %; shear adds 0.2 %
        assert tip == pytest.approx(bending, rel=0.01)

    @pytest.mark.parametrize("poisson", [0.0, 0.3])
    def test_bimetal_strip_curves_as_timoshenko_says(self, poisson):
        # Timoshenko 1925: equal Poisson numbers, so that bending across changes nothing
        thick, thin, length, width = 0.006, 0.004, 0.4, 0.02
        warm = {
            "low": replace(IRON, expansion_per_k=10e-6, young_pa=110e9, poisson=poisson),
            "high": replace(IRON, expansion_per_k=19e-6, young_pa=70e9, poisson=poisson),
        }
        blocks = [
            Block("low", "low", (0.0, 0.0, 0.0), (length, width, thick)),
            Block("high", "high", (0.0, 0.0, thick), (length, width, thick + thin)),
        ]
        body = block_mesh(blocks, (0.01, 0.01, 0.003))
        elastic = elasticity(body, warm, three_two_one(body))
        moved = elastic.displacement_um(np.full(len(body.nodes_m), 50.0)) * 1e-6
        middle = (abs(body.nodes_m[:, 0] - length / 2) < 0.1) & np.isclose(body.nodes_m[:, 2], thick)
        middle &= np.isclose(body.nodes_m[:, 1], width / 2)
        curvature = -2 * np.polyfit(body.nodes_m[middle, 0], moved[middle, 2], 2)[0]
        m, n, total = thick / thin, 110e9 / 70e9, thick + thin
        bent = 6 * 9e-6 * 50 * (1 + m) ** 2 / (total * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))))
        # the cells bend exactly; round-off of the solve of a thin strip, and its ends
        assert curvature == pytest.approx(bent, rel=1e-6)

    def test_displacement_converges_with_order_two(self):
        # thermoelastic potential: u = ∇Φ, T = (1 − ν) / ((1 + ν) α) ∇²Φ needs no body force; u is given at the boundary
        material = replace(IRON, young_pa=1.0, expansion_per_k=1.0)
        factor = (1 - material.poisson) / (1 + material.poisson)
        errors = []

        def wave(x):
            return np.sin(2 * x[0]) * np.sin(3 * x[1]) * np.sin(2 * x[2])

        def exact(x):
            sines, cosines = np.sin([2 * x[0], 3 * x[1], 2 * x[2]]), np.cos([2 * x[0], 3 * x[1], 2 * x[2]])
            return np.stack(
                [
                    2 * cosines[0] * sines[1] * sines[2],
                    3 * sines[0] * cosines[1] * sines[2],
                    2 * sines[0] * sines[1] * cosines[2],
                ]
            )

        for cells in (4, 8, 16):
            body = box(1.0, 1.0, 1.0, cell=1 / cells)
            stiffness, expansion = elastic_matrices(body, {"cast iron": material})
            force = expansion @ (-17 * factor * wave(body.nodes_m.T))
            moved = exact(body.nodes_m.T).T.copy()
            rim = ((body.nodes_m < 1e-9) | (body.nodes_m > 1 - 1e-9)).any(axis=1)
            free, given = np.flatnonzero(np.repeat(~rim, 3)), np.flatnonzero(np.repeat(rim, 3))
            flat = moved.ravel()
            right = force[free] - stiffness[free][:, given] @ flat[given]
            flat[free] = spsolve(sparse.csc_array(stiffness[free][:, free]), right)
            solved = flat.reshape(-1, 3)
            parts = [l2_error(body, solved[:, i], lambda x, i=i: exact(x)[i]) for i in range(3)]
            errors.append(np.linalg.norm(parts))
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert orders == pytest.approx([2.0, 2.0], abs=0.1)  # p + 1; 4 cells are still rough: 1.94
