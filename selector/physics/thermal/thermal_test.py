"""Heating and cooling tests: what the modes and the characteristics are fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import OptionError
from selector.recording import Recording

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class ThermalTest:
    """One recorded run with its spindle speed (C: heating and cooling characteristics).

    Attributes
    ----------
    run : str
        Name of the run.
    time_s : ndarray of shape (n_samples,)
        Time [s] from the start of the run, increasing.
    speed_rpm : ndarray of shape (n_samples,)
        Spindle speed [r/min], held from each sample to the next; no sign, nothing missing.
    displacement_um : ndarray of shape (n_samples, n_responses)
        Displacements [µm]; NaN where missing.
    ambient_degc : ndarray of shape (n_samples,) or None
        Hall temperature [°C], if it was recorded.
    """

    run: str
    time_s: Vector
    speed_rpm: Vector
    displacement_um: NDArray[np.float64]
    ambient_degc: Vector | None = None


def thermal_tests(recording: Recording, responses: Sequence[str]) -> tuple[ThermalTest, ...]:
    """The tests in a recording.

    Raises
    ------
    OptionError
        If there is no spindle speed, or a response is no displacement of the recording.
    """
    speeds = [channel.name for channel in recording.channels if channel.role == "spindle_speed"]
    if len(speeds) != 1:
        raise OptionError(
            f"{len(speeds)} channels with the role spindle_speed" + (f" ({', '.join(speeds)})" if speeds else ""),
            expected="one",
            where="the recording",
            advice="give the channel with the speed of the spindle the role spindle_speed in the machine file",
        )
    displacements = [channel.name for channel in recording.channels if channel.role == "displacement"]
    for response in responses:
        if response not in displacements:
            raise OptionError(
                f"no displacement called {response!r}",
                expected="one of " + (", ".join(displacements) or "the displacements (there are none)"),
                where="--response",
                advice="name a channel with the role displacement",
            )
    halls = [channel.name for channel in recording.channels if channel.role == "ambient"]
    return tuple(
        ThermalTest(
            run=run,
            time_s=recording.time_s(run),
            speed_rpm=_held(np.abs(recording.values(run, speeds)[:, 0])),
            displacement_um=recording.values(run, responses),
            ambient_degc=recording.values(run, halls[:1])[:, 0] if halls else None,
        )
        for run in recording.runs
    )


def _held(values: Vector) -> Vector:
    """Missing values take the one before them, at the beginning the first that is there; all missing means 0."""
    there = np.isfinite(values)
    if there.all() or not there.any():
        return np.nan_to_num(values)
    last = np.maximum.accumulate(np.where(there, np.arange(len(values)), -1))
    return values[np.where(last < 0, int(np.argmax(there)), last)]
