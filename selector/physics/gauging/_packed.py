"""The numbers of a transducer as the compiled swing takes them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.gauging import _swing as at
from selector.physics.gauging.transducer import Transducer

Vector = NDArray[np.float64]

FAR_M = 1.0
"""A workpiece at this distance is out of reach."""
STEPS_PER_ROUND, STEPS_PER_KNOT = 50_000, 1000


def packed(transducer: Transducer, relative_tolerance: float) -> Vector:
    """Parameters of the compiled swing; the filter is the transducer's own, time 0 a zero crossing of the supply."""
    if not 0.0 < relative_tolerance <= 1e-2:
        raise InputError(
            f"{relative_tolerance:g}",
            expected="a number above 0, at most 0.01",
            where="relative_tolerance",
            advice="leave it out",
        )
    magnet, probe, generator = transducer.electromagnet, transducer.probe, transducer.generator
    p = np.zeros(at.PARAMETERS)
    mains = 2.0 * math.pi * magnet.frequency_hz
    reactance = mains * magnet.inductance_h
    p[at.MAINS], p[at.PHASE] = mains, math.atan2(reactance, magnet.resistance_ohm)
    p[at.CURRENT] = magnet.voltage_v / math.hypot(magnet.resistance_ohm, reactance)
    p[at.PULL], p[at.MAGNET] = magnet.force_n_per_a2, 1.0 / magnet.gap_m if magnet.gap_m is not None else 0.0
    p[at.MASS], p[at.DAMPING], p[at.STIFFNESS] = probe.mass_kg, probe.damping_ns_per_m, probe.stiffness_n_per_m
    p[at.CONTACT], p[at.EXPONENT] = transducer.contact.stiffness, transducer.contact.exponent
    p[at.CONTACT_DAMPING] = transducer.contact.damping_s_per_m
    p[at.INDUCED], p[at.CORE] = generator.turns * generator.flux_wb / generator.gap_m, 1.0 / generator.gap_m
    p[at.COIL_S] = generator.time_constant_s
    p[at.RATE], p[at.LEAK] = 1.0 / transducer.smoothing.time_constant_s, 1.0
    p[at.LONGEST], p[at.ERROR] = round_s(transducer) / 12.0, relative_tolerance
    push = 0.5 * p[at.PULL] * p[at.CURRENT] ** 2
    dynamic = math.hypot(p[at.STIFFNESS] - p[at.MASS] * (2 * mains) ** 2, 2 * mains * p[at.DAMPING])
    swing = push / min(dynamic, p[at.STIFFNESS])
    volts = p[at.INDUCED] * 2 * mains * swing / math.hypot(1.0, 2 * mains * p[at.COIL_S])
    p[at.SCALES :] = swing, 2 * mains * swing, volts, volts
    return p


def widen_scales(p: Vector, probe_m: float, probe_m_per_s: float, plane_m: float) -> None:
    """Errors count against what a start or a workpiece makes of the swing, where that is more than the pull does."""
    frequency = max(math.sqrt(p[at.STIFFNESS] / p[at.MASS]), 2.0 * p[at.MAINS])
    swing = max(abs(probe_m), abs(probe_m_per_s) / frequency, -plane_m)
    p[at.SCALES :] *= max(1.0, swing / p[at.SCALES])


def round_s(transducer: Transducer) -> float:
    """Period of the pull, half of one of the supply [s]."""
    return 0.5 / transducer.electromagnet.frequency_hz


def refusal(ended: int, transducer: Transducer) -> InputError:
    """Why a swing could not go on."""
    if ended == at.MAGNET_REACHED:
        return InputError(
            "the probe swings across the air gap of the electromagnet"
            f" ({1e3 * (transducer.electromagnet.gap_m or 0.0):g} mm)",
            expected="a swing that stays off the core",
            where="electromagnet.gap_m",
            advice="widen the gap, stiffen the probe, or lower voltage_v or force_n_per_a2",
        )
    if ended == at.CORE_REACHED:
        return InputError(
            f"the probe swings across the air gap of the generator ({1e3 * transducer.generator.gap_m:g} mm)",
            expected="a swing that stays off the core",
            where="generator.gap_m",
            advice="widen the gap, stiffen the probe, or lower voltage_v or force_n_per_a2",
        )
    return InputError(
        f"more than {STEPS_PER_ROUND} steps in half a period of the supply",
        expected="a contact and a generator that a simulation can follow",
        where="transducer",
        advice="correct contact.stiffness; give generator.time_constant_s = 0 in place of less than a microsecond",
    )
