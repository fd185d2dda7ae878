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

KINDS = ("command", "position", "table", "error", "output", "added", "total", "force", "load")
"""What is recorded of an axis: commanded position, position that the control sees, true position of the table,
commanded minus true, what the control puts out, what is added to that behind it, both together, force of the screw on
the table, force from outside."""

INPUTS = ("command", "added", "load")
"""Those of `KINDS` that act on the axis."""

_UM = 1e6


def axis_channels(name: str, axis: FileAxis, *, loaded: bool, added: bool = False) -> dict[str, Channel]:
    """Kind, of `KINDS`, → channel; ``load`` only of a `loaded` axis, ``added`` and ``total`` only where `added`.

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
        "added": (f"{name}_added", OUTPUT_ROLES[output], "added behind the control"),
        "total": (f"{name}_total", OUTPUT_ROLES[output], "control, and what is added"),
        "force": (f"{name}_force", "state" if turns else "force", f"{pushed} [N·m]" if turns else pushed),
        "load": (f"{name}_load", "state" if turns else "force", "outside [N·m]" if turns else "outside"),
    }
    return {
        kind: Channel(called, role, CANONICAL_UNITS[role], place, axis=name)
        for kind, (called, role, place) in made.items()
        if {"load": loaded, "added": added, "total": added}.get(kind, True)
    }


def axis_courses(motion: Motion, reference: Reference, added: Vector | None = None) -> dict[str, Vector]:
    """Kind, of `KINDS`, → course at the samples of the reference, in the unit of its channel."""
    more = np.zeros(len(motion.time_s)) if added is None else added
    return {
        "command": motion.reference_m,
        "position": motion.measured_m,
        "table": motion.table_m,
        "error": motion.tracking_error_m * _UM,
        "output": motion.command,
        "added": more,
        "total": motion.command + more,
        "force": motion.axial_force_n,
        "load": np.zeros(len(motion.time_s)) if reference.force_n is None else reference.force_n,
    }
