"""How large is a motion if nobody knows the phases of its sources: all equal phase shifts of V eq. 10, 11.

Every source is shifted by one of P equal steps of a turn, which makes N = P^n realisations. For P ≥ 2 the ordinate
x = Im Z has the mean 0 over all of them at every instant, because the steps of a turn add up to 0; so the "mean
amplitude" of V must be the mean of an amount. Here it is that of the instantaneous amplitude |Z|, the modulus of the
analytic signal Z(t) = Σ_s e^{iφ_s}·z_s(t), z_s(t) = Σ_k X_k·e^{iω_k·t}: for one source with one line it is the
amplitude of the line, of which the mean |x| would be 2/π. The mean |x| is given beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.vibration.rounding import SAME
from selector.types import ComplexMatrix, Vector

MOST_VALUES = 2_000_000_000
"""Realisations that differ × sections: some fifteen seconds."""
MOST_REALISATIONS = 1 << 22
_BLOCK = 1 << 15
_WAVES, _MOST_WAVES = 512, 1 << 17
_REST = 1e-9
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, eq=False)
class Realisations:
    """Amounts of a motion over all realisations, in the unit of the motion (m)."""

    expected_m: float  #: A_m0: expectation of |Z|, mean over the sections (V eq. 10, 11)
    mean_abs_m: float  #: Expectation of |x|, mean over the sections
    rms_m: float  #: Root of the mean of x² over realisations and sections, in closed form (`mean_square`)
    largest_m: float  #: Largest |Z| of any realisation at any section
    count: int  #: N


def realisation_amounts(
    motion_m: ArrayLike,
    frequency_hz: ArrayLike,
    source: ArrayLike,
    time_s: ArrayLike,
    *,
    n_sources: int,
    phases: int = 4,
) -> Realisations:
    """Amounts of the motion by these lines over all realisations and sections.

    A shift that all sources share leaves |Z| as it is: N/P realisations are added up, and the P common shifts of each
    are taken for |x| only. Sources without motion here change nothing and are left out of the sum, but counted in N.

    `motion_m` is X of every line [m], at `frequency_hz` [Hz] and of `source`, the position of one of all `n_sources`:
    each of shape (n_lines,). `time_s` are the times of the sections [s], see `section_times`; `phases` is P ≥ 1.

    InputError: no section, or too many realisations (`are_countable`); `mean_square` and `any_phase_amplitude` have no
    limit.
    """
    motion = np.asarray(motion_m, dtype=np.complex128)
    frequency, owner = np.asarray(frequency_hz, dtype=np.float64), np.asarray(source, dtype=np.int64)
    time = np.asarray(time_s, dtype=np.float64)
    moving = [motion[rows] for rows in (owner == s for s in range(n_sources))]
    turning = [frequency[owner == s] for s in range(n_sources)]
    active = [s for s in range(n_sources) if np.any(moving[s])]
    _require_countable(n_sources, len(active), len(time), phases)
    different = phases ** max(len(active) - 1, 0)
    step = np.exp(2j * np.pi * np.arange(phases) / phases)
    # all shifts of the later half of the sources beside all of the earlier: two small sums and one outer one
    half = max((len(active) + 1) // 2, 1)
    section = np.empty((3, len(time)))
    square = 0.0
    width = max(1, _BLOCK // different)
    for begin in range(0, len(time), width):
        block = slice(begin, begin + width)
        z = np.zeros((max(len(active), 1), len(time[block])), dtype=np.complex128)
        for row, s in enumerate(active):
            z[row] = _phasors(moving[s], turning[s], time[block])
        one, other = _shifted(z[:half], step, fixed=True), _shifted(z[half:], step, fixed=False)
        # a section a row, so that what is added up lies side by side
        total = (one[:, :, None] + other[:, None, :]).reshape(-1, different)
        size = np.sqrt(total.real**2 + total.imag**2)
        section[0, block] = size.mean(axis=1)
        section[1, block] = _mean_ordinate(total, step)
        section[2, block] = size.max(axis=1)
        square += float(np.sum(mean_square(z, phases=phases)))
    expected, mean_abs = float(section[0].mean()), float(section[1].mean())
    return Realisations(
        expected_m=expected,
        mean_abs_m=mean_abs,
        rms_m=math.sqrt(max(square / len(time), 0.0)),
        largest_m=float(section[2].max()),
        count=phases**n_sources,
    )


def mean_square(z_m: ArrayLike, *, phases: int = 4) -> Vector:
    """E x² over all realisations at every section, in closed form; shape (n_sections,) [m²].

    For P ≥ 3 it is ½·Σ_s |z_s|², for P = 2 Σ_s (Im z_s)²: products of different sources cancel. For P = 1 there is one
    realisation, and nothing cancels: (Im Σ_s z_s)². E|Z|² is Σ_s |z_s|² for P ≥ 2.

    `z_m` is z_s at every section [m], shape (n_sources, n_sections).
    """
    z = np.atleast_2d(np.asarray(z_m, dtype=np.complex128))
    if phases == 1:
        return np.asarray(z.sum(axis=0).imag ** 2)
    if phases == 2:
        return np.asarray((z.imag**2).sum(axis=0))
    return np.asarray(0.5 * (z.real**2 + z.imag**2).sum(axis=0))


def any_phase_amplitude(amplitude_m: ArrayLike) -> float:
    """E|Σ_s a_s·e^{iφ_s}| over phases that are anything, each for itself; the limit of many steps P [m].

    With x the ordinate, E|Z| = π/2·E|x|, and |x| as a Fourier series over −A … A, A = Σ a_s, leaves of every wave its
    mean, a product of Bessel functions: E|Z| = A·(π/4 − (2/π)·Σ_{odd k} Π_s J0(π·k·a_s/A)/k²).

    `amplitude_m` is a_s, not below 0 [m], shape (n_sources,).
    """
    from scipy.special import j0

    amplitude = np.asarray(amplitude_m, dtype=np.float64)
    largest = float(amplitude.max(initial=0.0))
    if largest == 0.0:
        return 0.0
    # shares of the largest first: the sum of the smallest numbers has no digits
    share = amplitude / largest
    whole = float(share.sum())
    share = share[share > 0.0] / whole
    total, begin = 0.0, 1
    while begin < _MOST_WAVES:
        wave = np.arange(begin, begin + _WAVES, 2, dtype=np.float64)
        total += float(np.sum(np.prod(j0(np.pi * np.outer(wave, share)), axis=1) / wave**2))
        begin += _WAVES
        # |J0(u)| is below √(2/πu), and the rest of Σ 1/k² over odd k below 1/2k
        if float(np.prod(np.minimum(np.sqrt(2.0 / (np.pi**2 * begin * share)), 1.0))) / begin < _REST:
            break
    return largest * whole * (math.pi / 4.0 - 2.0 / math.pi * total)


def are_countable(active: int, *, sections: int = 1, phases: int = 4) -> bool:
    """Whether the realisations of so many sources that move, times the sections, are few enough to go through."""
    # logarithms: the powers may have thousands of digits
    different = max(active - 1, 0) * math.log(phases)
    return different <= math.log(MOST_REALISATIONS) + SAME and different + math.log(sections) <= math.log(MOST_VALUES)


def source_motion(
    motion_m: ArrayLike, frequency_hz: ArrayLike, source: ArrayLike, time_s: ArrayLike, *, n_sources: int
) -> ComplexMatrix:
    """z_s(t), the sum of X·e^{iωt} over the lines of each source; complex, shape (n_sources, n_sections) [m]."""
    motion, frequency = np.asarray(motion_m, dtype=np.complex128), np.asarray(frequency_hz, dtype=np.float64)
    owner, time = np.asarray(source), np.asarray(time_s, dtype=np.float64)
    rows = [owner == s for s in range(n_sources)]
    return np.array([_phasors(motion[row], frequency[row], time) for row in rows]).reshape(n_sources, len(time))


def section_times(sections: int, duration_s: float) -> Vector:
    """Times that lie evenly in (0, `duration_s`) without being a grid; ascending, shape (sections,) [s].

    Multiples of the golden ratio: a grid whose step is a multiple of a line's period would meet the line always at
    the same phase. The duration should hold several periods of the smallest difference between lines of one source.
    """
    if sections < 1 or not (math.isfinite(duration_s) and duration_s > 0):
        raise InputError(
            f"{sections} sections of {duration_s:g} s",
            expected="at least 1 section, and a duration above 0",
            where="realisations.sections",
            advice="correct the number of sections or the duration",
        )
    return np.sort(np.mod((np.arange(sections) + 0.5) * _GOLDEN, 1.0)) * duration_s


def _require_countable(sources: int, active: int, sections: int, phases: int) -> None:
    if sections < 1 or sources < 1 or phases < 1:
        raise InputError(
            f"{sources} sources, {sections} sections, {phases} phases",
            expected="at least 1 of each",
            where="realisations",
            advice="give a source, a section and a phase",
        )
    if not are_countable(active, sections=sections, phases=phases):
        raise InputError(
            f"{phases} phases of {active} sources that move it, {sections} sections",
            expected=f"{phases}^{active - 1} up to {MOST_REALISATIONS}, and times the sections up to {MOST_VALUES:.0e}",
            where="realisations.phases",
            advice="take fewer phases or sections; the mean square needs neither (rms in closed form)",
        )


def _phasors(motion: NDArray[np.complex128], frequency: Vector, time: Vector) -> NDArray[np.complex128]:
    return np.asarray(motion @ np.exp(2j * np.pi * np.outer(frequency, time)))


def _shifted(z: ComplexMatrix, step: NDArray[np.complex128], *, fixed: bool) -> ComplexMatrix:
    """Sums of these sources with all shifts, (n_sections, n_combinations); `fixed`: the first is not shifted."""
    sections = z.shape[1]
    total = z[0][:, None] if fixed else np.zeros((sections, 1), dtype=np.complex128)
    for row in z[1:] if fixed else z:
        total = (total[:, :, None] + (row[:, None] * step)[:, None, :]).reshape(sections, -1)
    return total


def _mean_ordinate(total: ComplexMatrix, step: NDArray[np.complex128]) -> Vector:
    """Mean of |Im(Z·e^{iφ})| over realisations and the common shifts φ; opposite shifts have the same amount."""
    phases = len(step)
    used = step[: phases // 2] if phases % 2 == 0 else step
    sums = np.zeros(len(total))
    for shift in used:
        if shift.imag == 0.0:
            sums += np.abs(total.imag).sum(axis=1)
        else:
            sums += np.abs(total.imag * shift.real + total.real * shift.imag).sum(axis=1)
    return np.asarray(sums / (len(used) * total.shape[1]))
