"""How far is a simulation that followed recordings from what was recorded; no more is said than the difference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.drive_channels import INPUTS, KINDS

if TYPE_CHECKING:
    from selector.physics.drive.drive_model import DriveModel
    from selector.physics.drive.driving import DrivenSimulation
    from selector.recording import Recording

Vector = NDArray[np.float64]
_MICRO = 1e6
_LEVEL = 1e-9
"""Spread below which a recorded course is level, as a share of its size: nothing that a difference is a share of."""


@dataclass(frozen=True, eq=False)
class Difference:
    """One channel in one run, simulated minus recorded, at the samples at which it was recorded.

    Attributes
    ----------
    run, axis, channel : str
    kind : str
        What it is of the axis, of `drive_channels.KINDS`.
    unit : str
        "um", "urad", "V", "A", "N" or "N·m"; "1" of a number.
    time_s : ndarray of shape (n_samples,)
        From the start of the run [s].
    recorded, simulated : ndarray of shape (n_samples,)
        Both courses [unit].
    """

    run: str
    axis: str
    channel: str
    kind: str
    unit: str
    time_s: Vector
    recorded: Vector
    simulated: Vector

    @property
    def rms(self) -> float:
        """Root mean square of the difference [unit]."""
        return float(np.sqrt(np.mean((self.simulated - self.recorded) ** 2)))

    @property
    def largest(self) -> float:
        """Largest amount of the difference [unit]."""
        return float(np.abs(self.simulated - self.recorded).max())

    @property
    def largest_at_s(self) -> float:
        """When it is the largest, from the start of the run [s]."""
        return float(self.time_s[np.argmax(np.abs(self.simulated - self.recorded))])

    @property
    def relative(self) -> float | None:
        """‖difference‖ / ‖recorded about its mean‖; None of a level course. It does not depend on where zero is."""
        spread = float(np.std(self.recorded))
        return self.rms / spread if spread > _LEVEL * float(np.abs(self.recorded).max()) else None


def recorded_differences(model: DriveModel, driven: DrivenSimulation, recording: Recording) -> tuple[Difference, ...]:
    """Every channel that was both recorded and simulated, run by run; what acts on the axes is left out."""
    simulated = driven.simulation.recording
    acting = (*INPUTS, "output", "total") if driven.opened else INPUTS
    found = []
    for run in recording.runs:
        time_s = recording.time_s(run)
        for axis, channels in driven.matched.items():
            for kind in (one for one in KINDS if one in channels and one not in acting):
                name = channels[kind]
                there = recording.values(run, [name])[:, 0]
                seen = np.isfinite(there)
                if not seen.any():
                    continue
                unit, times = _unit(model, axis, kind, recording.channel(name).unit)
                found.append(
                    Difference(
                        run,
                        axis,
                        name,
                        kind,
                        unit,
                        time_s[seen] - time_s[0],
                        there[seen] * times,
                        simulated.values(run, [name])[seen, 0] * times,
                    )
                )
    return tuple(found)


def main_difference(differences: tuple[Difference, ...]) -> Difference | None:
    """The one to be told first: positions before all else, and of these the worst run and axis."""
    for kinds in (("position", "table"), ("error",), ("total", "output"), ("force",)):
        ones = [one for one in differences if one.kind in kinds]
        if ones:
            return max(ones, key=lambda one: one.rms if math.isfinite(one.rms) else math.inf)
    return None


def _unit(model: DriveModel, axis: str, kind: str, unit: str) -> tuple[str, float]:
    """Unit that differences of a kind are told in, and how many of it are one of the channel's."""
    turns = model.file_axes[axis].rotary
    if kind in ("position", "table"):
        return ("urad" if turns else "um"), _MICRO
    if kind == "error":
        return ("urad" if turns else "um"), 1.0
    return ("N·m" if turns and kind == "force" else unit), 1.0
