"""Which channels has the recording of a simulated axis, and which courses are in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.mechanics import RigidMechanics
from selector.physics.drive.model_axes import FileAxis
from selector.physics.drive.motion import Motion
from selector.physics.drive.reference import Reference
from selector.recording import Channel
from selector.units import CANONICAL_UNITS

Vector = NDArray[np.float64]

OUTPUT_ROLES = {"current": "current", "voltage": "voltage", "force": "force", "number": "state"}
"""``output`` of an axis in the model file → role of what its control puts out."""

KINDS = ("command", "position", "table", "error", "output", "force", "load")
"""What is recorded of an axis: commanded position, position that the control sees, true position of the table,
commanded minus true, what the control puts out, force of the screw on the table, force from outside."""

_UM = 1e6


def axis_channels(name: str, axis: FileAxis, *, loaded: bool) -> dict[str, Channel]:
    """Kind, of `KINDS`, → channel; ``load`` only of an axis that is `loaded`.

    Positions of a rotary axis have the role ``state``, in rad: recordings have no role for angles; its error in µrad.
    The place of a position says whether it is what the control sees or what is true.
    """
    turns = axis.rotary
    servo = axis.axis.servo
    seen = f"{'scale' if servo is None or servo.feedback == 'table' else 'motor'} (seen by the control)"
    true = "table (true)"
    pushed = "motor" if isinstance(axis.axis.mechanics, RigidMechanics) else "screw"
    output = axis.section.output
    made = {
        "command": (f"{name}_command", "state" if turns else "position_command", "command [rad]" if turns else None),
        "position": (f"{name}_position", "state" if turns else "position", f"{seen} [rad]" if turns else seen),
        "table": (f"{name}_table", "state" if turns else "position", f"{true} [rad]" if turns else true),
        "error": (f"{name}_error", "state" if turns else "displacement", "table [µrad]" if turns else "table"),
        "output": (f"{name}_{'output' if output in ('number', 'force') else output}", OUTPUT_ROLES[output], "control"),
        "force": (f"{name}_force", "state" if turns else "force", f"{pushed} [N·m]" if turns else pushed),
        "load": (f"{name}_load", "state" if turns else "force", "outside [N·m]" if turns else "outside"),
    }
    return {
        kind: Channel(called, role, CANONICAL_UNITS[role], place, axis=name)
        for kind, (called, role, place) in made.items()
        if kind != "load" or loaded
    }


def axis_courses(motion: Motion, reference: Reference) -> dict[str, Vector]:
    """Kind, of `KINDS`, → course at the samples of the reference, in the unit of its channel."""
    return {
        "command": motion.reference_m,
        "position": motion.measured_m,
        "table": motion.table_m,
        "error": motion.tracking_error_m * _UM,
        "output": motion.command,
        "force": motion.axial_force_n,
        "load": np.zeros(len(motion.time_s)) if reference.force_n is None else reference.force_n,
    }
