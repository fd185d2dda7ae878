"""How do tool and workpiece answer to a force that was recorded: its spectrum times the response of the structure.

The force is 0 before its first sample and after its last. Hysteretic joints, whose loss factor is the same at every
frequency, are not causal: a trace of the answer comes before its force, the smaller the lighter the damping. It shows
where a recorded force breaks off: 3 % of the motion at the last sample with the joints of a lathe, 0.5 % 50 ms before.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from selector.physics.vibration.chain_values import Chain
from selector.physics.vibration.final_motion import Method, final_receptance
from selector.physics.vibration.modes import structure_modes
from selector.physics.vibration.response_curve import response_curve
from selector.physics.vibration.source import Source
from selector.physics.vibration.structure import Structure

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Complex = NDArray[np.complex128]

MOST_SILENT = 1 << 21
"""Samples of the silence behind the force."""

FADED = 1e-3
"""Share of a free vibration that counts as none."""


@dataclass(frozen=True, eq=False)
class ForceAnswer:
    """Motion of the finals by one recorded force.

    Attributes
    ----------
    motion_m : ndarray of shape (n_finals, n_samples)
        [m].
    ring_s : float
        Time in which a free vibration fades to `FADED` [s]; infinite if nothing damps it.
    left : float
        Share of a free vibration that is left where the calculation begins anew: what laps over from its end.
    """

    motion_m: Matrix
    ring_s: float
    left: float


def force_answer(
    structure: Structure,
    source: Source,
    force_n: Vector,
    step_s: float,
    finals: Mapping[str, str],
    *,
    method: Method = "coupled",
    chains: Sequence[Chain] = (),
    split_hz: float | None = None,
) -> ForceAnswer:
    """Motion by a force [N] of shape (n_samples,), one every `step_s` [s], that acts where the source does.

    Real Fourier transform, with silence behind the force until a free vibration has faded.

    Parameters
    ----------
    finals : mapping of str to str
        Name of a final → its member.
    method, chains, split_hz
        See `final_motions`.

    Raises
    ------
    InputError
        A resonance that nothing damps, or the errors of `final_motions`.
    """
    decay = float(np.sqrt(structure_modes(structure).eigenvalues_per_s2).imag.min())
    ring_s = -math.log(FADED) / decay if decay > 0 else math.inf
    silence = len(force_n) + math.ceil(min(ring_s / step_s, MOST_SILENT))
    padded = fft.next_fast_len(len(force_n) + silence, real=True)
    frequency = fft.rfftfreq(padded, step_s)

    def solved(frequency_hz: Vector) -> Complex:
        return final_receptance(
            structure, source, frequency_hz, finals, method=method, chains=chains, split_hz=split_hz
        ).motion_m_per_n

    least = min(joint.loss_factor for joint in structure.joints)
    jump_hz = split_hz if method == "chains" else None
    curve = response_curve(solved, 0.0, float(frequency[-1]), loss_factor=least, jump_hz=jump_hz)
    # of a mean that lasts, the part in step with the force counts: irfft takes the real part there
    motion = fft.irfft(curve.at(frequency) * fft.rfft(force_n, padded), padded)[:, : len(force_n)]
    return ForceAnswer(motion, ring_s, math.exp(-decay * (padded - len(force_n)) * step_s))
