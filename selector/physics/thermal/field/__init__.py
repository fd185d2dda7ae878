"""The temperature field of a machine and its deformation by finite elements: a C-frame machining centre, or a mesh."""

from selector.physics.thermal.field.machine import field_machine as field_machine
from selector.physics.thermal.field.machine import machine_outline as machine_outline
