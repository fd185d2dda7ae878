"""How a vibrating-contact gauge moves in time: from the supply of its magnet to the smoothed voltage (G fig. 2).

z points from the probe at rest towards the workpiece, and towards both cores. The workpiece's surface is at
rest_gap_m − allowance: more allowance brings it nearer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.checks import require_finite
from selector.physics.gauging import _swing as at
from selector.physics.gauging._packed import STEPS_PER_KNOT, STEPS_PER_ROUND, packed, refusal, round_s, widen_scales
from selector.physics.gauging.transducer import Contact, Transducer

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class GaugeState:
    """Where everything in a gauge is at one time.

    Attributes
    ----------
    probe_m, probe_m_per_s : float
        z, z' [m], [m/s].
    current_a : float or None
        i of the electromagnet [A]; None: that of a coil that was switched on long ago.
    generator_v, smoothed_v : float
        u, S [V]; u does not matter where the generator has no time constant.
    """

    probe_m: float = 0.0
    probe_m_per_s: float = 0.0
    current_a: float | None = None
    generator_v: float = 0.0
    smoothed_v: float = 0.0

    def __post_init__(self) -> None:
        require_finite(self, "probe_m", "probe_m_per_s", "generator_v", "smoothed_v")
        if self.current_a is not None:
            require_finite(self, "current_a")


@dataclass(frozen=True, eq=False)
class GaugeMotion:
    """What goes on in a gauge, each an ndarray of shape (n_samples,).

    Attributes
    ----------
    time_s, allowance_um : ndarray
        [s], [µm].
    current_a : ndarray
        i of the electromagnet [A].
    probe_m, probe_m_per_s : ndarray
        z, z' [m], [m/s].
    contact_n : ndarray
        Force of the workpiece on the tip, 0 or more [N].
    generator_v : ndarray
        u, before the rectifier [V].
    smoothed_v : ndarray
        S, behind the filter [V].
    """

    time_s: Vector
    allowance_um: Vector
    current_a: Vector
    probe_m: Vector
    probe_m_per_s: Vector
    contact_n: Vector
    generator_v: Vector
    smoothed_v: Vector

    def state(self, sample: int) -> GaugeState:
        """Where everything is at a sample: a start for what follows."""
        return GaugeState(
            *(
                float(course[sample])
                for course in (self.probe_m, self.probe_m_per_s, self.current_a, self.generator_v, self.smoothed_v)
            )
        )


def simulate_transducer(
    transducer: Transducer,
    allowance_um: ArrayLike,
    time_s: ArrayLike,
    *,
    start: GaugeState | None = None,
    relative_tolerance: float = 1e-8,
) -> GaugeMotion:
    """What goes on in a gauge while the allowance changes; see docs/explanation/vibrating-contact-gauge.md.

    Steps are as long as the tolerance allows; touches are located in time. The supply is V0·sin(ω0·time_s). Relay and
    its noise are left to what compares the smoothed voltage.

    Parameters
    ----------
    allowance_um : array-like of shape (n_samples,), or one number
        At the samples; straight between them [µm].
    time_s : array-like of shape (n_samples,)
        Increasing [s].
    start
        None: at rest, or pushed back to the surface; the coil is switched on at the first sample.
    relative_tolerance
        Error of a step as a share of the free swing.

    Raises
    ------
    InputError
        If shapes do not fit, the probe reaches a core, or nothing can follow contact or generator.
    """
    time, allowance = _checked(time_s, allowance_um)
    plane = transducer.rest_gap_m - 1e-6 * allowance
    p = packed(transducer, relative_tolerance)
    p[at.PHASE] = math.fmod(p[at.PHASE] - p[at.MAINS] * time[0], 2.0 * math.pi)
    begin = start or GaugeState(probe_m=min(0.0, float(plane[0])), current_a=0.0)
    if begin.current_a is not None and transducer.electromagnet.inductance_h > 0:
        p[at.SWITCHED] = begin.current_a - p[at.CURRENT] * math.sin(-p[at.PHASE])
        p[at.SWITCHED_RATE] = transducer.electromagnet.resistance_ohm / transducer.electromagnet.inductance_h
    for core, ended in ((at.MAGNET, at.MAGNET_REACHED), (at.CORE, at.CORE_REACHED)):
        if begin.probe_m * p[core] > 1.0 - at.CLOSED:
            raise refusal(ended, transducer)
    widen_scales(p, begin.probe_m, begin.probe_m_per_s, float(plane.min()))
    since = time - time[0]
    slope = np.diff(plane) / np.diff(time)
    bends = np.flatnonzero(np.abs(np.diff(slope)) > 1e-9 * np.abs(slope).max(initial=0.0)) + 1
    knots = np.concatenate([[0], bends, [len(time) - 1]])
    y = np.array([begin.probe_m, begin.probe_m_per_s, begin.generator_v, begin.smoothed_v])
    if p[at.COIL_S] == 0:
        y[at.U] = -p[at.INDUCED] * y[at.V] / (1.0 - y[at.Z] * p[at.CORE]) ** 2
    out = np.empty((len(time), 4))
    most = STEPS_PER_ROUND * math.ceil(since[-1] / round_s(transducer)) + STEPS_PER_KNOT * len(knots)
    ended, _ = at.course(
        y, p, np.array([0, 0, most, 0]), np.array([p[at.LONGEST] / 8, 0.0, 0.0]), since, plane, knots, out
    )
    if ended != at.DONE:
        raise refusal(ended, transducer)
    current = p[at.CURRENT] * np.sin(p[at.MAINS] * since - p[at.PHASE])
    current += p[at.SWITCHED] * np.exp(-p[at.SWITCHED_RATE] * since)
    away = np.concatenate([slope[:1], slope])
    force = contact_force_n(transducer.contact, out[:, at.Z] - plane, out[:, at.V] - away)
    return GaugeMotion(time, allowance, current, out[:, at.Z], out[:, at.V], force, out[:, at.U], out[:, at.S])


def contact_force_n(contact: Contact, overlap_m: Vector, overlap_m_per_s: Vector) -> Vector:
    """Force of a contact at overlaps and their rates: k·δ^p·(1 + λ·δ'), 0 or more [N]."""
    elastic = contact.stiffness * np.maximum(overlap_m, 0.0) ** contact.exponent
    return elastic * np.maximum(1.0 + contact.damping_s_per_m * overlap_m_per_s, 0.0)


def _checked(time_s: ArrayLike, allowance_um: ArrayLike) -> tuple[Vector, Vector]:
    time, allowance = np.array(time_s, dtype=np.float64), np.array(allowance_um, dtype=np.float64)
    if time.ndim != 1 or len(time) < 2 or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise InputError(
            "times that do not increase, or fewer than two",
            expected="at least two times, each after the one before",
            where="time_s",
            advice="sort the times and keep one sample a time",
        )
    if allowance.ndim == 0:
        allowance = np.full(len(time), float(allowance))
    if allowance.shape != time.shape or not np.isfinite(allowance).all():
        raise InputError(
            f"allowances of shape {allowance.shape}" + ("" if np.isfinite(allowance).all() else " with missing values"),
            expected=f"one finite number, or {len(time)}, one a sample",
            where="allowance_um",
            advice="give the allowance at the times",
        )
    return time, allowance
