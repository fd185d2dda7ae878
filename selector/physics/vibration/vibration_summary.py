"""What does a simulated vibration amount to: modes, where every line goes, expected amplitudes, errors left behind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from selector.findings import Finding
    from selector.physics.vibration.chain_error import ChainAccuracy
    from selector.physics.vibration.modes import StructureModes
    from selector.physics.vibration.periodic_error import KindHeight, PeriodicError

RELATIVE = "tool_workpiece"
"""Motion of the tool against the workpiece, as a name beside "tool" and "workpiece"."""


@dataclass(frozen=True)
class LineSummary:
    """One line of the excitation, and what comes of it at every final.

    Mappings have the keys "tool", "workpiece" and `RELATIVE`; amplitudes of one sinusoid [µm].

    Attributes
    ----------
    frequency_hz : float
        [Hz].
    source : str
    shaft : str or None
        Shaft that the line follows.
    order : float or None
        Periods per revolution of that shaft.
    force_n : float
        Amplitude of the force [N].
    motion_um : mapping of str to float
        By the method of ``run.method``.
    coupled_um : mapping of str to float
        By the coupled structure.
    chains_um : mapping of str to float or None
        By the chains; None where no chain of the line's range leads from its source to the final (of `RELATIVE`: to
        neither of both), so that the method has nothing to say.
    """

    frequency_hz: float
    source: str
    shaft: str | None
    order: float | None
    force_n: float
    motion_um: Mapping[str, float]
    coupled_um: Mapping[str, float]
    chains_um: Mapping[str, float | None]


@dataclass(frozen=True)
class AmplitudeSummary:
    """Amplitude of one final over all phase shifts of the sources and over time (V eq. 10, 11).

    Attributes
    ----------
    expected_um : float
        Expectation of the instantaneous amplitude, mean over the sections [µm].
    mean_abs_um : float
        Expectation of the ordinate's amount, mean over the sections [µm].
    rms_um : float
        Root of the mean square ordinate, in closed form [µm].
    largest_um : float
        Largest instantaneous amplitude of any realisation at any section [µm].
    realisations, sections : int
        How many of both; 0 where the realisations are too many and only `rms_um` is known (the others are 0 then).
    """

    expected_um: float
    mean_abs_um: float
    rms_um: float
    largest_um: float
    realisations: int
    sections: int


@dataclass(frozen=True)
class VibrationSummary:
    """What a simulation amounts to, at the mean speeds of its shafts.

    Attributes
    ----------
    modes : StructureModes
        Of the coupled structure.
    lines : tuple of LineSummary
        By frequency; lines of different sources stay apart.
    amplitudes : mapping of str to AmplitudeSummary
        "tool", "workpiece" and `RELATIVE`, by the method of ``run.method``.
    errors : tuple of PeriodicError
        What the motion leaves on the surface; empty without ``[cutting]``.
    heights : mapping of str to KindHeight
        Kind of error (roughness, waviness, lobing, runout) → the height of all errors of the kind together.
    accuracy : tuple of ChainAccuracy
        How good every chain is within the structure; empty without ``[[chains]]``.
    split_hz : float or None
        Below it the low chains hold, above it the high ones; None without ``[cutting]``.
    shaft_rpm : mapping of str to float
        Speed that every shaft was taken at [r/min].
    findings : tuple of Finding
        What is odd about the model and about this simulation.
    """

    modes: StructureModes
    lines: tuple[LineSummary, ...]
    amplitudes: Mapping[str, AmplitudeSummary]
    errors: tuple[PeriodicError, ...] = ()
    heights: Mapping[str, KindHeight] = field(default_factory=dict)
    accuracy: tuple[ChainAccuracy, ...] = ()
    split_hz: float | None = None
    shaft_rpm: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
