"""What hammer taps tell of the joints: compliances, their modes, and which stiffness and ψ make them, how surely.

The dynamic stiffness Z = K·(1 + iη) + s²M, s = 1/τ + iω, is linear in the numbers of the model: all slopes are exact,
∂H/∂θ = −hᵀ·(∂Z/∂θ)·g, h and g being the columns of H of the measured and of the tapped member. Fitted are ln k, ln m
and ψ, and the ln of the sensitivity of every sensor. What the taps do not see a normal prior keeps: it is as wide as a
fit may look, and of sensitivities as wide as calibrations are off.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares, linear_sum_assignment
from scipy.signal import find_peaks
from scipy.special import stdtrit

from selector.errors import InputError, Misfit, refuse
from selector.findings import Finding
from selector.physics.vibration.finding_table import FINDINGS
from selector.physics.vibration.structure import joint_ends, structure_modes
from selector.physics.vibration.vibration_model import VibrationModel
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


SENSITIVITY = 0.03  #: Share by which the sensitivity of a hammer or accelerometer may be off, standard deviation.
_LEAST_LINES, _MOST_LINES = 30, 5000  #: Of a response: with fewer nothing is fitted, of more every second or third.
_BEYOND = 2.0  #: Times the highest mode up to which frequencies count.
#: In the search for a start: lines of each response, starts that are drawn, those that are followed, how far ln k goes,
#: and the least ψ.
_THIN, _DRAWS, _FOLLOWED, _FAR, _LEAST_PSI = 160, 200, 4, 0.7, 0.05
_ABSURD = 100.0  #: Times that measured and modelled compliances differ at the median where a unit is wrong.
_UNSEEN = 0.25  #: Share of where a fit may look beyond which half an interval says nothing.
_NOT_REACHED, _FAR_OFF = 0.03, 2.0  #: A model that is right leaves less: as a share, and as times the errors.

_Slopes = list[tuple[Complex, Complex]]  #: Of every response what is left, and how it changes with x.


@dataclass(frozen=True)
class TapParameter:
    """A number of the model that was fitted to taps."""

    name: str  #: As in the model file: joints.3.stiffness_n_per_m
    unit: str
    before: float  #: What the file says
    value: float
    #: low and high: Of the 95 % interval; None where the taps do not see it
    low: float | None
    high: float | None
    unseen: str = ""  #: Why they do not


@dataclass(frozen=True, eq=False)
class TapFit:
    """A model whose joints were fitted to taps."""

    #: before and after: As the file says, and fitted
    before: VibrationModel
    after: VibrationModel
    responses: tuple[TapResponse, ...]
    used: tuple[Mask, ...]  #: Of every response the lines that count
    parameters: tuple[TapParameter, ...]
    computed: tuple[tuple[Complex, ...], ...]  #: Of every response at these lines the compliance of both models [m/N]
    #: Modes as measured, and those of both models beside them; None where a model has too few
    modes: tuple[tuple[TapMode, TapMode | None, TapMode | None], ...]
    #: left_before, left_after and noise: Median amounts of ln(H/H measured), and median error of the measured mean
    left_before: float
    left_after: float
    noise: float
    findings: tuple[Finding, ...]


def tap_fit(
    model: VibrationModel,
    responses: Sequence[TapResponse],
    *,
    free: Sequence[str] = (),
    band_hz: tuple[float, float] | None = None,
) -> TapFit:
    """The model with these parameters fitted to taps; by default stiffness and ψ of all joints.

    By default frequencies count up to twice that of its highest mode: above it has masses alone.

    InputError: no such parameter, too few lines that count, or compliances that no unit explains.
    """
    highest_hz = float(structure_modes(model.structure).frequency_hz[-1])
    problem = _Problem(model, responses, free, band_hz or (0.0, _BEYOND * highest_hz))
    x = problem.nearest()
    half, inner = _half_widths(problem, x)
    parameters, values = tuple(_parameters(problem, x, half, inner)), problem.decoded(x).tolist()
    after = model.with_parameters(dict(zip(problem.names, values, strict=True)))
    curves = [[own for _, own, _ in problem.compliances(one)] for one in (problem.centre, x)]
    seen = [(one.mean[lines], one.variance[lines]) for one, lines in zip(responses, problem.used, strict=True)]
    mean, variance = (np.concatenate(one) for one in zip(*seen, strict=True))
    before_left, after_left = (float(np.median(np.abs(np.log(np.concatenate(one) / mean)))) for one in curves)
    noise = float(np.sqrt(np.median(variance / np.abs(mean) ** 2)))
    found = tuple(_findings(problem, x, parameters, after_left, noise))
    modes, computed = tuple(_modes(model, after, responses, problem.used)), tuple(zip(*curves, strict=True))
    return TapFit(
        model, after, tuple(responses), problem.used, parameters, computed, modes, before_left, after_left, noise, found
    )


class _Problem:
    """Measured compliances as a function of x: ln of stiffnesses and masses, ψ, and ln of sensitivities."""

    def __init__(
        self, model: VibrationModel, responses: Sequence[TapResponse], free: Sequence[str], band: tuple[float, float]
    ) -> None:
        known = {name: one for name, one in model.parameters.items() if name.startswith(("joints.", "members."))}
        for name in free:
            if name not in known:
                raise InputError(
                    f"no number of a joint or member called {name!r}",
                    expected=f"one of {', '.join(list(known)[:8])}, …",
                    where="--free",
                    advice="name it as the model file does; joints count from 1",
                )
        self.model, self.responses = model, responses
        self.used = tuple(one.usable(band) for one in responses)
        for lines in self.used:
            kept = np.flatnonzero(lines)
            lines[np.setdiff1d(kept, kept[:: 1 + len(kept) // _MOST_LINES])] = False
        self.names = [name for name in known if (name in free if free else name.startswith("joints."))]
        #: Sensitivities: of the hammer at every place ("at"), of what measures every motion ("of")
        self.sensors = list(dict.fromkeys((end, getattr(one, end)) for end in ("at", "of") for one in responses))
        off = np.full(len(self.sensors), SENSITIVITY)
        self.is_log = np.array([not name.endswith("dissipation") for name in self.names])
        low, high, value = (
            np.array([getattr(known[name], what) for name in self.names]) for what in ("low", "high", "value")
        )
        low, high, value = (np.where(self.is_log, np.log(np.maximum(one, 1e-9)), one) for one in (low, high, value))
        self.low, self.high = np.append(low, -10.0 * off), np.append(high, 10.0 * off)
        self.centre, self.spread = np.append(value, 0.0 * off), np.append(high - low, off)
        structure, self.ends = model.structure, joint_ends(model.structure)
        numbers = [*(one.mass_kg for one in structure.members), *(one.stiffness_n_per_m for one in structure.joints)]
        self.numbers = np.array([*numbers, *(one.dissipation for one in structure.joints)])
        joints = [(key, k + 1) for key in ("stiffness_n_per_m", "dissipation") for k in range(len(structure.joints))]
        keys = [*(f"members.{name}.mass_kg" for name in structure.names), *(f"joints.{k}.{key}" for key, k in joints)]
        self.places = [keys.index(name) for name in self.names]
        refuse(self._misfits(band))

    def decoded(self, x: Vector) -> Vector:
        """Values of the parameters."""
        x = x[: len(self.names)]
        return np.where(self.is_log, np.exp(np.where(self.is_log, x, 0.0)), x)

    def compliances(self, x: Vector, step: int = 1) -> Iterator[tuple[Complex, Complex, Complex]]:
        """Of every response what was measured, H, and ∂H/∂x, shape (n_lines, n_free), at every so many used lines."""
        numbers, count = self.numbers.copy(), self.ends.shape[1]
        numbers[self.places] = self.decoded(x)
        mass, stiffness, psi = np.split(numbers, [count, count + len(self.ends)])
        complex_stiffness = stiffness * (1.0 + 0.5j * psi / np.pi)
        held = self.ends.T @ (complex_stiffness[:, None] * self.ends)
        for one, lines in zip(self.responses, self.used, strict=True):
            rows = np.flatnonzero(lines)[::step]
            square = one.square_per_s2[rows, None]
            at, of = (self.model.structure.position(name) for name in (one.at, one.of))
            h, g = np.moveaxis(
                np.linalg.solve(held - square[:, None] * np.diag(mass), np.eye(count)[:, [of, at]]), 2, 0
            )
            strained = (h @ self.ends.T) * (g @ self.ends.T)
            slopes = [square * mass * h * g, -complex_stiffness * strained, -0.5j / np.pi * stiffness * strained]
            mine = np.array([getattr(one, end) == name for end, name in self.sensors])
            gain = np.exp(x[len(self.names) :] @ mine)
            own = gain * g[:, of]
            yield one.mean[rows], own, np.hstack([gain * np.hstack(slopes)[:, self.places], own[:, None] * mine])

    def logarithms(self, x: Vector, step: int = 1) -> _Slopes:
        """Of every response ln(H/H measured), and its slopes."""
        return [(np.log(own / seen), slopes / own[:, None]) for seen, own, slopes in self.compliances(x, step)]

    def weighed(self, x: Vector) -> _Slopes:
        """Of every response (H − H measured) in standard deviations of either part, and its slopes."""
        parts = zip(self.compliances(x), self.responses, self.used, strict=True)
        scaled = [(found, np.sqrt(one.variance[lines] / 2.0)) for found, one, lines in parts]
        return [((own - seen) / sd, slopes / sd[:, None]) for (seen, own, slopes), sd in scaled]

    def nearest(self) -> Vector:
        """The x that leaves the least mean square of the compliances.

        Resonances that do not overlap lead nowhere: the way goes through logarithms, from the file and from the best of
        many starts that are drawn.
        """
        step = max(1, *(int(np.count_nonzero(lines)) // _THIN for lines in self.used))
        count = len(self.names)
        start = self.centre.copy()
        start[:count] = np.where(self.is_log, start[:count], np.maximum(start[:count], _LEAST_PSI))
        drawn = np.random.default_rng(0).uniform(-_FAR, _FAR, (_DRAWS, len(start)))
        starts = [start + one * np.append(self.is_log, np.zeros(len(start) - count)) for one in drawn]
        starts.sort(key=lambda x: sum(float(np.abs(one).sum()) for one, _ in self.logarithms(x, step)))
        ways = [self._led(x, lambda x: self.logarithms(x, step), "soft_l1") for x in (start, *starts[:_FOLLOWED])]
        return self._led(min(ways, key=lambda one: float(one.cost)).x, self.weighed, "linear").x

    def _led(self, start: Vector, left: Callable[[Vector], _Slopes], loss: Any) -> Any:
        """Where least squares lead from a start."""

        def rows(x: Vector) -> Vector:
            found = np.concatenate([one for one, _ in left(x)])
            return np.concatenate([found.real, found.imag, (x - self.centre) / self.spread])

        def slopes(x: Vector) -> Matrix:
            found = np.concatenate([one for _, one in left(x)])
            return np.concatenate([found.real, found.imag, np.diag(1.0 / self.spread)])

        inside = np.clip(start, self.low + 1e-6 * self.spread, self.high - 1e-6 * self.spread)
        return least_squares(rows, inside, slopes, bounds=(self.low, self.high), loss=loss, x_scale="jac", max_nfev=200)

    def _misfits(self, band: tuple[float, float]) -> Iterator[Misfit]:
        """Too few lines that count, or compliances that are as large as no unit explains."""
        for one, lines in zip(self.responses, self.used, strict=True):
            if np.count_nonzero(lines) < _LEAST_LINES:
                reach = f"from {one.frequency_hz[0]:.4g} to {one.frequency_hz[-1]:.4g} Hz"
                found = f"{np.count_nonzero(lines)} of {len(lines)} lines that count, {reach}"
                expected = f"{_LEAST_LINES} with a coherence of {LEAST_COHERENCE} from {band[0]:g} to {band[1]:g} Hz"
                yield found, expected, one.called, "widen --band, tap harder, or leave this response out"
        for one, (seen, own, _) in zip(self.responses, self.compliances(self.centre), strict=True):
            times = float(np.median(np.abs(seen)) / np.median(np.abs(own)))
            if not 1.0 / _ABSURD < times < _ABSURD:
                found = f"a compliance that is {times:.2g} times that of the model"
                advice = "give the units with --unit, e.g. --unit m/s^2/N, or correct masses and stiffnesses"
                yield found, f"within a factor of {_ABSURD:g}", one.called, advice


def _half_widths(problem: _Problem, x: Vector) -> tuple[Vector, Matrix]:
    """Half of the 95 % intervals of x, and the inverse of its covariance if all errors were independent.

    The wider one counts of two: by the spread of the taps, each of which is one sample, so that all that a blow does at
    once is in it; and by what is left along the frequency, over as many lines as it goes together (W. K. Newey, K. D.
    West 1987, Econometrica 55, 703-708).
    """
    parts = problem.weighed(x)
    left, slopes = (np.concatenate(one) for one in zip(*parts, strict=True))
    scale = float(np.sum(np.abs(left) ** 2)) / (2 * len(left) - len(x))
    inner = np.real(slopes.conj().T @ slopes) / scale + np.diag(1.0 / problem.spread**2)
    inverse, reach = np.linalg.inv(inner), _lines_together([one for one, _ in parts])
    along, squares, freedom, deciding = np.diag(1.0 / problem.spread**2), [], [], []
    places = [(one.at, len(one.taps), len(one.frequency_hz)) for one in problem.responses]
    for place in dict.fromkeys(places):
        # what the same blows did to several responses goes together
        mine = [k for k, other in enumerate(places) if other == place]
        pull, influence = np.zeros(place[2]), np.zeros((place[2], len(x)))
        scores, blows = np.zeros((place[2] + 2 * reach, len(x))), np.zeros((place[1], len(x)))
        for k in mine:
            one, lines, (own, slope) = problem.responses[k], problem.used[k], parts[k]
            blows += np.real((one.away / np.sqrt(one.variance / 2.0))[:, lines] @ slope.conj()) / scale
            scores[reach:-reach][lines] += np.real(slope.conj() * own[:, None]) / scale
            pull[lines] += np.real(np.sum((slope.conj() @ inverse) * slope, axis=1)) / (2.0 * scale)
            influence[lines] += np.abs(slope @ inverse) ** 2
        # a line that pulls the model to itself leaves less than its error (HC3)
        scores[reach:-reach] /= (1.0 - np.minimum(pull, 0.9))[:, None]
        sums = np.cumsum(scores, axis=0)
        together = sums[reach:] - sums[:-reach]
        along = along + together.T @ together / reach
        deciding.append(influence)
        freedom.append(place[1] - 1)
        squares.append(np.sum((blows @ inverse) ** 2, axis=0))
    # as many degrees of freedom as lines decide
    share = np.concatenate(deciding)
    many = 2.0 * share.sum(axis=0) ** 2 / np.sum(share**2, axis=0) / reach
    half = stdtrit(np.maximum(many, 1.0), 0.975) * np.sqrt(np.diag(inverse @ along @ inverse))
    if min(freedom) > 0:
        # as many degrees of freedom as the places with the most spread have (Welch, Satterthwaite)
        whole, each = np.sum(squares, axis=0), np.array(freedom)[:, None]
        of_taps = stdtrit(whole**2 / np.sum(np.square(squares) / each, axis=0), 0.975) * np.sqrt(whole)
        half = np.maximum(half, of_taps)
    return half, inner


def _lines_together(left: Sequence[Complex]) -> int:
    """Twice the lines over which what is left goes together, by its correlation up to where that vanishes."""
    most = 1.0
    for one in left:
        lags = range(1, len(one) // 10)
        shares = [float(np.real(np.vdot(one[:-lag], one[lag:])) / np.sum(np.abs(one) ** 2)) for lag in lags]
        most = max(most, 1.0 + 2.0 * sum(shares[: next((k for k, share in enumerate(shares) if share <= 0.0), None)]))
    return int(np.ceil(min(2.0 * most, min(len(one) for one in left) / 5)))


def _parameters(problem: _Problem, x: Vector, half: Vector, inner: Matrix) -> Iterator[TapParameter]:
    known, far, inverse = problem.model.parameters, _UNSEEN * problem.spread, np.linalg.inv(inner)
    value, low, high = (problem.decoded(one).tolist() for one in (x, x - half, x + half))
    for k, name in enumerate(problem.names):
        head = (name, known[name].unit, known[name].value, value[k])
        if half[k] <= far[k]:
            yield TapParameter(*head, max(low[k], 0.0), high[k])
            continue
        together = np.abs(inverse[k]) / np.sqrt(np.diag(inverse))
        together[k] = 0.0
        other = problem.names[int(np.argmax(together[: len(problem.names)]))]
        is_alone = 1.96 / np.sqrt(inner[k, k]) > far[k] or other == name
        why = "the compliances hardly depend on it" if is_alone else f"it cannot be told from {other}"
        yield TapParameter(*head, None, None, why)


def _modes(
    before: VibrationModel, after: VibrationModel, responses: Sequence[TapResponse], used: Sequence[Mask]
) -> Iterator[tuple[TapMode, TapMode | None, TapMode | None]]:
    """Modes in the responses that have the lines of the first, and those of both models with most alike them."""
    lines = responses[0].frequency_hz
    same = [k for k, one in enumerate(responses) if np.array_equal(one.frequency_hz, lines)]
    chosen = [responses[k] for k in same]
    measured, seen = measured_modes(chosen, np.all([used[k] for k in same], axis=0))
    beside: list[dict[int, TapMode]] = []
    for model in (before, after) if measured else ():
        modes = structure_modes(model.structure)
        at, of = ([modes.members.index(getattr(one, end)) for one in chosen] for end in ("at", "of"))
        shapes = modes.shapes[at] * modes.shapes[of]
        sizes = np.sum(np.abs(shapes) ** 2, axis=0) * np.sum(np.abs(seen) ** 2, axis=1)[:, None]
        alike = np.abs(seen.conj() @ shapes) ** 2 / np.maximum(sizes, 1e-300)
        apart = np.abs(np.log(modes.frequency_hz / np.array([[one.frequency_hz] for one in measured])))
        beside.append({})
        for row, k in np.transpose(linear_sum_assignment(apart + 0.5 * (1.0 - alike))).tolist():
            mac = float(alike[row, k]) if len(chosen) > 1 else None
            beside[-1][row] = TapMode(float(modes.frequency_hz[k]), float(modes.loss_factor[k]), mac)
    for row, one in enumerate(measured):
        yield one, beside[0].get(row), beside[1].get(row)


def _findings(
    problem: _Problem, x: Vector, parameters: Sequence[TapParameter], left: float, noise: float
) -> Iterator[Finding]:
    near = 1e-3 * problem.spread
    for k, one in enumerate(parameters):
        if one.unseen:
            said = f"The taps do not tell {one.name}: {one.unseen}."
            yield FINDINGS.finding("taps-do-not-see", said, evidence={"parameter": one.name, "because": one.unseen})
        elif not problem.low[k] + near[k] < x[k] < problem.high[k] - near[k]:
            said = f"{one.name} went to {one.value:.4g}, as far as the model file lets it go."
            yield FINDINGS.finding("tap-fit-at-bound", said, evidence={"parameter": one.name, "value": one.value})
    if left > max(_NOT_REACHED, _FAR_OFF * noise):
        said = f"The fitted model is {100 * left:.3g} % off the compliances, their errors are {100 * noise:.3g} %."
        yield FINDINGS.finding("taps-not-reached", said, evidence={"left": left, "noise": noise})
    for response, lines in zip(problem.responses, problem.used, strict=True):
        count, ends = int(np.count_nonzero(lines)), response.frequency_hz[lines][[0, -1]].tolist()
        if count < len(lines):
            said = f"Of {response.called} {count} of {len(lines)} lines count, from {ends[0]:.4g} to {ends[1]:.4g} Hz."
            yield FINDINGS.finding("tap-lines-left-out", said, evidence={"lines": count, "band_hz": ends})
        if len(response.taps) == 1:
            said = f"There is one spectrum of {response.called}: how far taps differ is not known."
            yield FINDINGS.finding("single-tap", said)
