"""The temperature field of a machine and its deformation, by finite elements on a C-frame machining centre.

::

    geometry, mesh        boxes → hexahedra with parts
    materials             what the parts are made of
    surfaces, probes      where it stands, meets fluids, is heated, is measured
    conduction            → capacity, conduction, films, sources
    ordering, solvers     how the large systems are solved
    thermoelasticity      → displacements of the tool, deformation
    machine               all of it for the machining centre
    export                → files for ParaView
    virtual_laws          what heats and cools it
    virtual_machine       → the machine that can be run: reduced, with its laws and sensors
    candidates, outline   → where thermometers could sit, and the lines that draw the machine
"""

from __future__ import annotations

from selector.physics.thermal.field.candidates import ACCESSIBLE, machine_outline, sensor_candidates
from selector.physics.thermal.field.geometry import MachineGeometry, machine_blocks
from selector.physics.thermal.field.machine import FieldMachine, field_machine, write_vtu
from selector.physics.thermal.field.mesh import VOID, Block, BlockMesh, block_mesh, probe_row
from selector.physics.thermal.field.thermoelasticity import (
    MATERIALS,
    Elasticity,
    Material,
    conduction_matrices,
    elasticity,
    film,
    rigid_motion_reading,
    surface_source,
    volume_source,
)
from selector.physics.thermal.field.virtual_machine import (
    SENSORS,
    Sensor,
    VirtualMachine,
    film_sets,
    machine_laws,
    parts_beside,
    virtual_machining_centre,
)

__all__ = [
    "ACCESSIBLE",
    "MATERIALS",
    "SENSORS",
    "VOID",
    "Block",
    "BlockMesh",
    "Elasticity",
    "FieldMachine",
    "MachineGeometry",
    "Material",
    "Sensor",
    "VirtualMachine",
    "block_mesh",
    "conduction_matrices",
    "elasticity",
    "field_machine",
    "film",
    "film_sets",
    "machine_blocks",
    "machine_laws",
    "machine_outline",
    "parts_beside",
    "probe_row",
    "rigid_motion_reading",
    "sensor_candidates",
    "surface_source",
    "virtual_machining_centre",
    "volume_source",
    "write_vtu",
]
