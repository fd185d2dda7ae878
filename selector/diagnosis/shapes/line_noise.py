"""How to make what a simulation leaves white without taking sharp lines and bursts for noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.ndimage import median_filter
from scipy.signal import lfilter

Vector = NDArray[np.float64]

_ORDER = 12
_SEGMENT = 512
_LINE_BINS = 7
_EULER = 0.5772156649015329
_BESIDE = 80


def white_filter(parts: list[Vector]) -> Vector:
    """Coefficients (1, a1 … ap) of the filter that whitens the smooth part of the spectrum of these stretches.

    The spectrum is the median over half-overlapping segments and over neighbouring frequencies, so that lines and
    bursts hardly count; the filter is the autoregression of that spectrum (Yule–Walker).
    """
    usable = [part for part in parts if len(part) >= 32 and np.any(part)]
    if not usable:
        return np.ones(1)
    size = min(_SEGMENT, max(len(part) for part in usable))
    window = np.hanning(size)
    segments = [
        np.abs(np.fft.rfft((part[k : k + size] - part[k : k + size].mean()) * window)) ** 2
        for part in usable
        for k in range(0, len(part) - size + 1, max(size // 2, 1))
    ]
    spectrum = median_filter(np.median(segments, axis=0), _LINE_BINS, mode="nearest")
    spectrum = np.maximum(spectrum, 1e-10 * float(spectrum.max()))
    covariance = np.fft.irfft(spectrum)
    order = min(_ORDER, size // 8)
    return np.asarray(np.r_[1.0, solve_toeplitz(covariance[:order], -covariance[1 : order + 1])], dtype=np.float64)


def filtered(values: Vector, whitening: Vector) -> Vector:
    """A stretch behind the filter; where the filter has no past yet, 0."""
    white: Vector = np.asarray(lfilter(whitening, [1.0], values), dtype=np.float64)
    white[: len(whitening) - 1] = 0.0
    return white


def tapered(n: int) -> Vector:
    """A window with cosine ends over a tenth of its length each, mean square 1."""
    ramp = max(n // 10, 1)
    window = np.ones(n)
    window[:ramp] = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp)
    window[n - ramp :] = window[:ramp][::-1]
    return np.asarray(window / np.sqrt(np.mean(window**2)))


def floor(power: Vector) -> Vector:
    """Mean power of the noise at every frequency, from the logarithms of the neighbours: one line hardly lifts it."""
    log = np.log(np.maximum(power, 1e-12 * float(power.max(initial=1e-300))))
    width = min(_BESIDE, max(len(log) // 4, 1))
    kernel = np.ones(2 * width + 1)
    sums = np.convolve(log, kernel, mode="same") / np.convolve(np.ones(len(log)), kernel, mode="same")
    return np.asarray(np.exp(sums + _EULER))
