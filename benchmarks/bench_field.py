"""Time and memory of the finite-element machine against the number of nodes, and of a whole shift with it.

    python benchmarks/bench_field.py [--refinements 0.2 0.7 1 1.2 1.5] [--shift] [--step 30] [--no-direct]

Every refinement runs in a process of its own, whose peak of resident memory is what the operating system says; the
imports are 0.15 GB of it. Seconds are of one thread. ``--shift`` adds 8 h of the full model: speed in steps of 2 h,
films 8 W/(m²·K), bearings and motor heated, implicit steps of ``--step`` seconds. The last table shows what the mesh
costs in accuracy: rise at the lower bearing and displacements in the steady state, against the finest mesh.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from selector.physics.thermal.field import field_machine
from selector.physics.thermal.field.geometry import MachineGeometry, machine_blocks
from selector.physics.thermal.field.machine import CELL_M, displacement_readings
from selector.physics.thermal.field.mesh import MATERIALS, block_mesh, conduction_matrices, elastic_matrices, elasticity
from selector.physics.thermal.network.heat_system import Conditions, FilmLaw, HeatLaw, Laws, solver_of
from selector.physics.thermal.network.transient import simulate_heat

HEAT_W = {"lower bearing": 150.0, "upper bearing": 100.0, "motor": 200.0, "gearbox": 100.0}
FILM_W_PER_M2_K = 8.0
BEARING_SEAT = {"lower bearing seat": (0.0, 0.62, 0.98)}


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    start = time.perf_counter()
    return work(), time.perf_counter() - start


def peak_gb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6  # kB on Linux


def costs(refinement: float, direct: bool) -> dict[str, float]:
    """Parts of `field_machine`, one after the other."""
    geometry = MachineGeometry()
    body, mesh_s = timed(lambda: block_mesh(machine_blocks(geometry), CELL_M / refinement))
    _, heat_s = timed(lambda: conduction_matrices(body, MATERIALS))
    _, elastic_s = timed(lambda: elastic_matrices(body, MATERIALS))
    springs = np.where(np.isclose(body.nodes_m[:, 2:], 0.0), 1e7, 0.0) * np.ones(3)
    assembled_gb = peak_gb()
    elastic, solver_s = timed(lambda: elasticity(body, MATERIALS, springs, direct=direct))
    readings = [reading for name, reading in displacement_readings(body, geometry).items() if name != "Y"]
    _, rows_s = timed(lambda: [elastic.row_um_per_k(reading) for reading in readings])
    return {
        "nodes": len(body.nodes_m), "cells": len(body.cells), "mesh_s": mesh_s, "heat_s": heat_s,
        "elastic_s": elastic_s, "assembled_gb": assembled_gb, "solver_s": solver_s - elastic_s,
        "rows_s": rows_s, "peak_gb": peak_gb(),
    }  # fmt: skip


def steady(refinement: float) -> dict[str, float]:
    """The whole machine, and its steady state [K], [µm]."""
    machine, machine_s = timed(lambda: field_machine(refinement=refinement, probes=BEARING_SEAT))
    system = machine.system
    matrix = system.conduction + FILM_W_PER_M2_K * sum(system.films.values())
    solve, factor_s = timed(lambda: solver_of(matrix.tocsr()).solve)
    rise = solve(sum(heat_w * system.sources[name] for name, heat_w in HEAT_W.items()))
    values = {name: float(system.displacements[name] @ rise) for name in ("X", "Y_lower", "Y_upper", "Z")}
    values |= {name: float(row @ rise) for name, row in system.probes.items()}
    return {"nodes": system.size, "machine_s": machine_s, "factor_s": factor_s, "peak_gb": peak_gb(), **values}


def shift(refinement: float, step_s: float) -> dict[str, float]:
    """8 h with the full model."""
    machine = field_machine(refinement=refinement, probes=BEARING_SEAT)
    heat = tuple(HeatLaw(name, speed_w=heat_w, reference_rpm=3000.0) for name, heat_w in HEAT_W.items())
    laws = Laws(heat, tuple(FilmLaw(name, FILM_W_PER_M2_K) for name in machine.system.films))
    hours = np.array([0.0, 2.0, 4.0, 6.0, 8.0])
    speed = np.array([1500.0, 2000.0, 2500.0, 3000.0, 3000.0])
    off, room = np.zeros(5), np.full(5, 20.0)
    conditions = Conditions(3600 * hours, speed, off, room, off, room, np.ones(5))
    grid = np.arange(0.0, 28800.1, 60.0)
    history, seconds = timed(
        lambda: simulate_heat(
            machine.system, laws, conditions, time_s=grid, step_s=step_s, start_degc=20.0, method="implicit"
        )
    )
    end = dict(zip(history.displacements, history.displacement_um[-1], strict=True))
    return {
        "nodes": machine.system.size, "shift_s": seconds, "peak_gb": peak_gb(), "Z_um": float(end["Z"]),
        "missing_share": history.balance.missing_share,
    }  # fmt: skip


def in_a_process(work: str, **options: Any) -> dict[str, float]:
    command = [sys.executable, __file__, "--child", json.dumps({"work": work, **options})]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def table(rows: list[Mapping[str, float]]) -> None:
    print(" | ".join(f"{name:>12}" for name in rows[0]))
    for row in rows:
        print(" | ".join(f"{value:>12.4g}" if isinstance(value, float) else f"{value:>12}" for value in row.values()))
    nodes = np.log([row["nodes"] for row in rows])
    if len(rows) > 2:
        growth = {n: np.polyfit(nodes, np.log([r[n] for r in rows]), 1)[0] for n in rows[0] if n.endswith(("_s", "gb"))}
        print("grows as nodes to the power of", ", ".join(f"{name} {power:.2f}" for name, power in growth.items()))
    print(flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--refinements", type=float, nargs="+", default=[0.2, 0.7, 1.0, 1.2])
    parser.add_argument("--shift", action="store_true")
    parser.add_argument("--step", type=float, default=30.0)
    parser.add_argument("--no-direct", action="store_true", help="multigrid only, where factors would not fit")
    parser.add_argument("--child")
    options = parser.parse_args()
    if options.child:
        call = json.loads(options.child)
        work = {"costs": costs, "steady": steady, "shift": shift}[call.pop("work")]
        print(json.dumps(work(**call)))
        return
    for direct in [False] if options.no_direct else [True, False]:
        print("factors" if direct else "multigrid")
        table([in_a_process("costs", refinement=refinement, direct=direct) for refinement in options.refinements])
    print("whole machine and its steady state [K], [µm]")
    table([in_a_process("steady", refinement=refinement) for refinement in options.refinements])
    if options.shift:
        print(f"8 h with the full model, steps of {options.step:g} s")
        table([in_a_process("shift", refinement=r, step_s=options.step) for r in options.refinements])


if __name__ == "__main__":
    main()
