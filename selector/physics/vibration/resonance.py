"""Which mode carries a line to tool and workpiece, and how much does its resonance make of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.vibration.coupled import unit_force
from selector.physics.vibration.modes import StructureModes
from selector.physics.vibration.source import Source
from selector.physics.vibration.structure import Structure


@dataclass(frozen=True)
class CarryingMode:
    """The mode that has the largest part in the motion of the tool against the workpiece by one line.

    Attributes
    ----------
    mode : int
        Its position among the modes.
    frequency_hz, loss_factor : float
        Of the mode [Hz], η.
    member : str
        Member that moves most in it.
    amplification : float
        |λ/(λ − ω²)|: its motion at the line over that by a force that does not change.
    """

    mode: int
    frequency_hz: float
    loss_factor: float
    member: str
    amplification: float


def carrying_mode(
    structure: Structure, modes: StructureModes, source: Source, frequency_hz: float, *, tool: str, workpiece: str
) -> CarryingMode | None:
    """The mode whose part in X_tool − X_workpiece is the largest; None where modes do not span all motions.

    Parameters
    ----------
    structure, modes
    source : Source
        Where the force acts.
    frequency_hz : float
        Of the line [Hz].
    tool, workpiece : str
        Members.
    """
    if not modes.complete:
        return None
    parts = np.abs(relative_parts(structure, modes, source, frequency_hz, tool=tool, workpiece=workpiece))
    k = int(np.argmax(parts))
    square, eigenvalue = (2.0 * math.pi * frequency_hz) ** 2, complex(modes.eigenvalues_per_s2[k])
    return CarryingMode(
        mode=k,
        frequency_hz=float(modes.frequency_hz[k]),
        loss_factor=float(modes.loss_factor[k]),
        member=modes.members[int(np.argmax(np.abs(modes.shapes[:, k])))],
        amplification=abs(eigenvalue / (eigenvalue - square)),
    )


def relative_parts(
    structure: Structure, modes: StructureModes, source: Source, frequency_hz: float, *, tool: str, workpiece: str
) -> NDArray[np.complex128]:
    """Part of every mode in (X_tool − X_workpiece)/F of one source [m/N], shape (n_modes,); their sum is all of it."""
    force = unit_force(structure, source.member, source.against)
    relative = modes.shapes[structure.position(tool)] - modes.shapes[structure.position(workpiece)]
    square = (2.0 * math.pi * frequency_hz) ** 2
    return np.asarray(relative * (modes.shapes.T @ force) / (modes.eigenvalues_per_s2 - square))
