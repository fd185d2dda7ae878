"""What taps on one member measured at another: its compliance, how sure that is, and the modes that stand in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from selector.types import Complex, Mask, Matrix, Vector

LEAST_COHERENCE = 0.8  #: Lines with less are left out: there the taps do not agree.
_FLOOR = 0.01  #: Share of a compliance to which no hammer test is better.
_ALONE = 0.05  #: The same where one spectrum stands alone, without coherence.
_ENDS_AT = float(np.log(100.0))  #: Of an exponential window over records: where it ends.
_NEIGHBOURS = 15  #: Lines over which the spread of the taps is averaged.
#: What counts as a peak of ln|H|; share of its neighbourhood that one mode must explain; largest loss factor.
_PROMINENT, _EXPLAINED, _MOST_LOSS = 0.35, 0.9, 0.5
_LEAST_REACH, _ROUNDS = 4, 4  #: Lines to either side of a peak; how often its pole is sought.


@dataclass(frozen=True, eq=False)
class TapResponse:
    """Motion of one member per force on another, one spectrum a tap."""

    of: str  #: Member whose motion was measured
    at: str  #: Member that was tapped
    frequency_hz: Vector  #: (n_lines,): Above 0 [Hz]
    taps: Complex  #: (n_taps, n_lines): Compliance by every tap [m/N]
    weight: Matrix  #: (n_taps, n_lines): Share of every tap in the mean, by the square of its force
    coherence: Vector | None = None  #: (n_lines,): γ² as the file says it; None where it does not
    decay_per_s: float = 0.0  #: 1/τ of the exponential window e^(−t/τ) that lies over force and motion [1/s]

    @property
    def called(self) -> str:
        """What it is, in words."""
        return f"{self.of} per force on {self.at}"

    @property
    def mean(self) -> Complex:
        """Compliance by all taps, shape (n_lines,); of time records H1 [m/N]."""
        return np.asarray(np.sum(self.weight * self.taps, axis=0))

    @property
    def away(self) -> Complex:
        """What each of several taps moved the mean by, shape (n_taps, n_lines); the squares add up to its variance."""
        moved = self.weight * (self.taps - self.mean)
        return np.asarray(moved / np.sqrt(np.maximum(1.0 - np.sum(self.weight**2, axis=0), 1e-9)))

    @property
    def square_per_s2(self) -> Complex:
        """−(1/τ + iω)², which is ω² without a window, shape (n_lines,) [1/s²]."""
        return np.asarray(-((self.decay_per_s + 2j * np.pi * self.frequency_hz) ** 2))

    @property
    def variance(self) -> Vector:
        """Mean square of the error of the mean, averaged over neighbouring lines, shape (n_lines,) [m²/N²]."""
        size = np.abs(self.mean) ** 2
        if len(self.taps) > 1:
            own = np.sum(np.abs(self.away) ** 2, axis=0)
        elif self.coherence is not None:
            known = np.clip(self.coherence, 1e-6, 1.0)
            own = size * (1.0 - known) / known
        else:
            own = _ALONE**2 * size
        return np.asarray(uniform_filter1d(own, _NEIGHBOURS, mode="nearest") + _FLOOR**2 * size)

    def usable(self, band_hz: tuple[float, float]) -> Mask:
        """Lines in this band whose coherence is good: that of the file, or what the spread of the taps makes of it."""
        size = uniform_filter1d(np.abs(self.mean) ** 2, _NEIGHBOURS, mode="nearest")
        known = np.ones(len(size)) if self.coherence is None else self.coherence
        if len(self.taps) > 1:
            known = np.minimum(known, size / (size + len(self.taps) * self.variance))
        inside = (self.frequency_hz >= band_hz[0]) & (self.frequency_hz <= band_hz[1])
        return np.asarray(inside & (known >= LEAST_COHERENCE) & (self.mean != 0.0))


@dataclass(frozen=True)
class TapMode:
    """A mode that stands in measured compliances, or that of a model that is nearest to it."""

    frequency_hz: float  #: Re √λ / 2π [Hz]
    loss_factor: float  #: η = Im λ / Re λ
    mac: float | None = None  #: Likeness of a model's shape to the measured one, 0 to 1


def measured_modes(responses: Sequence[TapResponse], used: Mask) -> tuple[tuple[TapMode, ...], Complex]:
    """Modes in compliances with the same lines, of which those `used` count, and residues φ_of·φ_at [1/kg].

    About a peak every compliance is (a + b·ω²)/(λ − ω²), b being the rest of the structure; λ is found by linear least
    squares, and again with the errors weighed as they stand in the compliance.
    """
    lines = np.flatnonzero(used)
    if len(lines) < _NEIGHBOURS:
        return (), np.zeros((0, len(responses)), dtype=np.complex128)
    values = np.array([one.mean[lines] for one in responses])
    square, frequency = responses[0].square_per_s2[lines], responses[0].frequency_hz[lines]
    height = np.mean(np.log(np.abs(values)), axis=0)
    peaks, _ = find_peaks(height, prominence=_PROMINENT)
    found, shapes = [], []
    for peak in peaks.tolist():
        # about as wide as half of the energy is left
        low = np.flatnonzero(height < height[peak] - 0.5 * np.log(2.0)) - peak
        reach = max(_LEAST_REACH, int(np.min(np.abs(low), initial=len(height))))
        part = slice(max(peak - reach, 0), peak + reach + 1)
        pole, residues, explained = _pole_in(values[:, part], square[part])
        loss, frequency_hz = pole.imag / pole.real, np.sqrt(pole).real / (2.0 * np.pi)
        if (
            explained >= _EXPLAINED
            and 0.0 < loss < _MOST_LOSS
            and frequency[part][0] < frequency_hz < frequency[part][-1]
        ):
            found.append(TapMode(float(frequency_hz), float(loss)))
            shapes.append(residues)
    return tuple(found), np.array(shapes, dtype=np.complex128).reshape(len(found), len(responses))


def _pole_in(values: Complex, square: Complex) -> tuple[complex, Complex, float]:
    """λ, the residues a + bλ, and the share of the mean squares that (a + b·ω²)/(λ − ω²) explains."""
    count, lines = values.shape
    centre = square[lines // 2]
    away = square / centre - 1.0  # of order one, so that the columns are alike
    columns = np.zeros((count, lines, 1 + 2 * count), dtype=np.complex128)
    columns[:, :, 0] = values
    for k in range(count):
        columns[k, :, 1 + 2 * k], columns[k, :, 2 + 2 * k] = -1.0, -away
    pole, found = 0.0j, np.zeros(1 + 2 * count, dtype=np.complex128)
    for _ in range(_ROUNDS):
        # weighed by what the equation was multiplied with in the round before
        by = 1.0 / np.abs(pole - away) if pole else np.ones(lines)
        rows, right = columns * by[:, None], values * away * by
        found = np.linalg.lstsq(rows.reshape(-1, len(found)), right.ravel())[0]
        pole = complex(found[0])
    a, b = found[1::2], found[2::2]
    left = values - (a[:, None] + b[:, None] * away) / (pole - away)
    size = np.sum(np.abs(values - values.mean(axis=1, keepdims=True)) ** 2)
    return complex(centre * (1.0 + pole)), centre * (a + b * pole), float(1.0 - np.sum(np.abs(left) ** 2) / size)


def response_of_records(
    of: str, at: str, forces: Matrix, motions: Matrix, period_s: float, derivative: int
) -> TapResponse:
    """Compliance from records of force [N] and motion [m, m/s, m/s²], shapes (n_taps, n_samples), one row a tap.

    Over both lies an exponential window that ends at 1 %: what still rings at the end does not leak, and the damping
    that the window adds is known. `derivative` is 0, 1 or 2 for displacement, velocity or acceleration.
    """
    decay = _ENDS_AT / (forces.shape[1] * period_s)
    window = np.exp(-decay * period_s * np.arange(forces.shape[1]))
    force, motion = (
        np.fft.rfft((one - np.median(one, axis=1, keepdims=True)) * window)[:, 1:-1] for one in (forces, motions)
    )
    frequency = np.asarray(np.fft.rfftfreq(forces.shape[1], period_s)[1:-1], dtype=np.float64)
    square = np.abs(force) ** 2
    taps = motion / force / (decay + 2j * np.pi * frequency) ** derivative
    return TapResponse(of, at, frequency, taps, square / square.sum(axis=0), None, decay)
