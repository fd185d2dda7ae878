"""The temperature field of a machine and its deformation by finite elements: a C-frame machining centre, or a mesh.

::

    geometry, mesh        boxes → hexahedra with parts; where it stands, meets fluids, is heated, is measured
    mesh_file             the same from a mesh file: elements and named groups, checked
    thermoelasticity      materials → capacity, conduction, films, sources, displacements, deformation; their solvers
    machine               all of it for the machining centre; reduced, with its laws and sensors
    candidates            where thermometers could sit, and the lines that draw the machine
"""

from selector.physics.thermal.field.candidates import machine_outline as machine_outline
from selector.physics.thermal.field.machine import field_machine as field_machine
