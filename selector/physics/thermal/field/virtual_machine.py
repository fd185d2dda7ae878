"""The virtual machining centre: the finite-element field with its laws, reduced so that a shift takes seconds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.physics.thermal.coupling import joined
from selector.physics.thermal.field.geometry import MachineGeometry
from selector.physics.thermal.field.machine import FieldMachine, field_machine
from selector.physics.thermal.field.mesh import Point
from selector.physics.thermal.field.virtual_laws import LUBRICATED, MAX_RPM, Physics, machine_laws, parts_beside
from selector.physics.thermal.heat_system import HeatSystem
from selector.physics.thermal.law_values import film_coefficients
from selector.physics.thermal.laws import Conditions, Laws
from selector.physics.thermal.reduction import TOLERANCE, projected, reduced_basis
from selector.physics.thermal.transient import HeatHistory, simulate_heat

Vector = NDArray[np.float64]

STEP_S = 20.0
"""Longest step of a simulation [s]: bearings need minutes to warm."""


@dataclass(frozen=True)
class Sensor:
    """A thermometer: where it sits in words, and its place [m]."""

    place: str
    xyz_m: Point


# fmt: off
SENSORS: Mapping[str, Sensor] = {
    "T01": Sensor("headstock, lower bearing seat, front", (0.00, 0.62, 0.98)),
    "T02": Sensor("headstock, lower bearing seat, left", (-0.12, 0.55, 0.98)),
    "T03": Sensor("headstock, lower bearing seat, right", (0.12, 0.55, 0.98)),
    "T04": Sensor("headstock, between the bearings, front", (0.00, 0.62, 1.15)),
    "T05": Sensor("headstock, upper bearing seat, front", (0.00, 0.62, 1.32)),
    "T06": Sensor("headstock, upper bearing seat, left", (-0.12, 0.55, 1.32)),
    "T07": Sensor("headstock, upper bearing seat, right", (0.12, 0.55, 1.32)),
    "T08": Sensor("headstock, rear wall, low", (0.00, 0.30, 1.02)),
    "T09": Sensor("headstock, rear wall, high", (0.00, 0.30, 1.30)),
    "T10": Sensor("headstock, top cover", (0.00, 0.45, 1.46)),
    "T11": Sensor("gearbox, casing", (0.00, 0.42, 1.40)),
    "T12": Sensor("intermediate gear, bearing", (0.08, 0.45, 1.36)),
    "T13": Sensor("main motor, casing", (0.00, 0.35, 1.70)),
    "T14": Sensor("main motor, flange", (0.00, 0.40, 1.52)),
    "T15": Sensor("hydraulic unit, oil", (-0.55, 0.10, 0.60)),
    "T16": Sensor("hydraulic line at the headstock", (-0.15, 0.35, 1.20)),
    "T17": Sensor("column, front wall, low", (0.00, 0.05, 0.45)),
    "T18": Sensor("column, rear wall, low", (0.00, -0.35, 0.45)),
    "T19": Sensor("column, front wall, middle", (0.00, 0.05, 0.90)),
    "T20": Sensor("column, rear wall, middle", (0.00, -0.35, 0.90)),
    "T21": Sensor("column, front wall, high", (0.00, 0.05, 1.35)),
    "T22": Sensor("column, rear wall, high", (0.00, -0.35, 1.35)),
    "T23": Sensor("column, left wall", (-0.30, -0.15, 0.90)),
    "T24": Sensor("column, right wall", (0.30, -0.15, 0.90)),
    "T25": Sensor("column guideway, left", (-0.22, 0.12, 1.10)),
    "T26": Sensor("column guideway, right", (0.22, 0.12, 1.10)),
    "T27": Sensor("Z ball screw, nut", (0.00, 0.15, 1.15)),
    "T28": Sensor("Z ball screw, upper bearing", (0.00, 0.10, 1.75)),
    "T29": Sensor("Y ball screw, nut", (0.00, 0.55, 0.42)),
    "T30": Sensor("X ball screw, nut", (0.00, 0.55, 0.58)),
    "T31": Sensor("bed, front", (0.00, 1.00, 0.20)),
    "T32": Sensor("bed, under the column", (0.00, -0.10, 0.20)),
    "T33": Sensor("bed, left", (-0.40, 0.50, 0.20)),
    "T34": Sensor("bed, right", (0.40, 0.50, 0.20)),
    "T35": Sensor("saddle", (0.00, 0.60, 0.50)),
    "T36": Sensor("table", (0.00, 0.60, 0.68)),
    "T37": Sensor("coolant tank", (0.70, 0.90, 0.25)),
}
"""The 37 thermometers of the recording `fixtures/vmc37`."""
# fmt: on

_IN_PARTS = {"T15": "hydraulic unit", "T37": "coolant tank"}


@dataclass(frozen=True)
class VirtualMachine:
    """A machine that can be run.

    Attributes
    ----------
    system : HeatSystem
        Reduced field: displacements X, Y, Z, Y_lower, Y_upper; probes: the sensors and the `LUBRICATED` parts.
    laws : Laws
        What heats and cools it.
    field : FieldMachine
        The whole field, for pictures and for sensors anywhere.
    full : HeatSystem
        The field joined with the parts beside it, before the reduction.
    basis : ndarray of shape (n_full, n_reduced)
        Temperatures of the states of `full` are ``basis @ state``; the first are the nodes of the mesh.
    """

    system: HeatSystem
    laws: Laws
    field: FieldMachine
    full: HeatSystem
    basis: Vector

    def simulate(
        self,
        conditions: Conditions,
        *,
        time_s: ArrayLike,
        step_s: float = STEP_S,
        start_degc: float | None = None,
        start_state: ArrayLike | None = None,
        keep_states_at_s: ArrayLike = (),
    ) -> HeatHistory:
        """Temperatures and displacements; see `simulate_heat`. It starts at the hall's temperature if not told."""
        if start_degc is None and start_state is None:
            start_degc = float(conditions.ambient_degc[0])
        return simulate_heat(
            self.system,
            self.laws,
            conditions,
            time_s=time_s,
            step_s=step_s,
            start_degc=start_degc,
            start_state=start_state,
            keep_states_at_s=keep_states_at_s,
        )

    def node_degc(self, states: Vector) -> Vector:
        """Temperatures [°C] of the nodes of the mesh for states of the reduced system, shape (..., n_nodes)."""
        return np.asarray(states @ self.basis[: self.field.system.size].T)


def virtual_machining_centre(
    physics: Physics = "everything",
    *,
    geometry: MachineGeometry | None = None,
    refinement: float = 1.0,
    sensors: Mapping[str, Point] | None = None,
    tolerance: float = TOLERANCE,
) -> VirtualMachine:
    """The machine meshed, assembled, joined with the parts beside it and reduced; takes some ten seconds.

    Parameters
    ----------
    physics : {"linear", "convection", "everything"}
        Constant films and lubricants, films that grow with the speed, or lubricants that soften as well.
    geometry, refinement
        See `field_machine`.
    sensors : mapping of str to three floats, optional
        Virtual sensors [m]; left out: the 37 of `SENSORS`.
    tolerance : float
        See `reduced_basis`.

    Raises
    ------
    InputError
        If an option has no meaning or a sensor is not on the machine.
    """
    laws = machine_laws(physics)
    places = {name: sensor.xyz_m for name, sensor in SENSORS.items()} if sensors is None else dict(sensors)
    beside = _IN_PARTS if sensors is None else {}
    machine = field_machine(geometry, refinement, {name: at for name, at in places.items() if name not in beside})
    network, contacts = parts_beside()
    parts = network.heat_system()
    rows = {name: parts.probes[node] for name, node in beside.items()}
    full = joined(machine.system, replace(parts, probes=rows), contacts)
    lubricants = {part: full.sources[part] for part in LUBRICATED}
    in_order = {name: full.probes[name] for name in places}
    full = replace(full, probes=in_order | lubricants)
    basis = reduced_basis(full, film_sets(laws), tolerance=tolerance)
    return VirtualMachine(projected(full, basis), laws, machine, full, basis)


def film_sets(laws: Laws) -> tuple[dict[str, float], ...]:
    """Film coefficients [W/(m²·K)] at rest and at full speed, each dry and with coolant."""
    corners = Conditions.held(np.arange(4.0), spindle_speed=[0.0, MAX_RPM] * 2, coolant_on=[0.0, 0.0, 1.0, 1.0])
    sets = []
    for row in film_coefficients(laws, corners):
        total: dict[str, float] = {}
        for law, value in zip(laws.films, row, strict=True):
            total[law.film] = total.get(law.film, 0.0) + float(value)
        if total not in sets:
            sets.append(total)
    return tuple(sets)
