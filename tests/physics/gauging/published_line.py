"""The line of a gauge as its source linearises it, without a simulation of its contact (G eq. 15–20)."""

from __future__ import annotations

import math

from selector.errors import InputError
from selector.physics.gauging.characteristic import steady_swing
from selector.physics.gauging.transducer import Generator, LinearGauge, Transducer


def flux_harmonic_wb(generator: Generator, amplitude_m: float, centre_m: float = 0.0) -> tuple[float, float]:
    """Amplitude B of the flux at the frequency of a swing centre + A·sin, and its slope dB/dA [Wb], [Wb/m].

    Φ·gap/(b − A·sin ψ), b = gap − centre, has the first harmonic B = 2·Φ·gap/A·(b/√(b² − A²) − 1) (G eq. 17).

    Raises InputError if the swing crosses the gap.
    """
    b = generator.gap_m - centre_m
    if not 0.0 < amplitude_m < b:
        raise InputError(
            f"a swing of {1e3 * amplitude_m:g} mm around a position {1e3 * b:g} mm before the core",
            expected="an amplitude above 0 that stays off the core",
            where="generator.gap_m",
            advice="widen the gap, or lower the swing",
        )
    root = math.sqrt(b * b - amplitude_m * amplitude_m)
    # b/root − 1 without cancellation
    rise = amplitude_m * amplitude_m / (root * (b + root))
    scale = 2.0 * generator.flux_wb * generator.gap_m / amplitude_m
    return scale * rise, scale * (b * amplitude_m / root**3 - rise / amplitude_m)


def published_gauge(transducer: Transducer, *, slow_coil: bool = True) -> LinearGauge:
    """K, bias and T_Φ from the free swing alone, by A = A0 − x behind the first touch (G eq. 16–20).

    K = −(2/π)·(W/T_Γ)·dB/dA at A0 and the voltage at the first touch (2/π)·(W/T_Γ)·B(A0); the line touches there. With
    `slow_coil` the coil is taken for a pure integrator, as published; without, its answer at 2ω0 is exact:
    2ω0/√(1 + (2ω0·T_Γ)²) in place of 1/T_Γ.

    Raises InputError if the free swing reaches a core, or the coil is to be slow and has no time constant.
    """
    free = steady_swing(transducer, None)
    generator, pull_rad_per_s = transducer.generator, 4.0 * math.pi * transducer.electromagnet.frequency_hz
    if slow_coil and generator.time_constant_s == 0:
        raise InputError(
            "a coil without a time constant",
            expected="T_Γ large against the period of the swing, as the published linearisation has it",
            where="generator.time_constant_s",
            advice="give the time constant, or do not take the coil for a slow one",
        )
    rate_per_s = (
        1.0 / generator.time_constant_s
        if slow_coil
        else pull_rad_per_s / math.hypot(1.0, pull_rad_per_s * generator.time_constant_s)
    )
    amplitude_um = 0.5 * free.stroke_um
    flux_wb, slope = flux_harmonic_wb(generator, 1e-6 * amplitude_um, 1e-6 * (free.highest_um - amplitude_um))
    rectified = 2.0 / math.pi * generator.turns * rate_per_s
    touch_um = 1e6 * transducer.rest_gap_m - free.highest_um
    gain = -1e-6 * rectified * slope
    return LinearGauge(gain, rectified * flux_wb - gain * touch_um, transducer.smoothing.time_constant_s, touch_um)
