"""How a simulated course follows a force, by itself, along a chain, with a force that it lacks; moved resonances.

A pair of poles p is exchanged for another one p' by a filter, A(z; p)/A(z; p'), behind the simulated course. What else
the simulation has in it, its zeros and what drives it, stays, and need not be known.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.optimize import minimize
from scipy.signal import cont2discrete, find_peaks, freqz, lfilter

from selector.diagnosis.comparison import Comparison, read_only
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import (
    EvenRun,
    by_movement,
    by_run,
    course,
    even_runs,
    no_vibration,
    of_a_drive,
    on_even_clock,
    rate,
    swept_hz,
)
from selector.diagnosis.shapes.spectral_lines import rotating_forces
from selector.types import Matrix, Vector

#: What may drive a structure, the likeliest first.
INPUT_ROLES = (
    "force", "voltage", "current", "acceleration", "flow", "displacement", "velocity", "position", "position_command"
)  # fmt: skip
_ORDERS = (2, 4, 6)
_STEPS = 6
_ENOUGH = 1e-3
_LINEAR = 0.2
_LEFT = 0.02  #: Misfit above which forces of the spindle are tried beside the recorded inputs.
_TURNED_RUNS = 3  #: So many runs do for them: in every run they begin at another angle, which is fitted.
_MOST_ROWS = 12_000
_STAND_IN_DAMPING = (0.01, 0.04, 0.15)


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """A filter from a force to the response."""

    #: The channel of the force that it was fitted with; None = poles alone, the size of the force is not known
    source: str | None
    #: numerator and denominator: Of the discrete filter, by rising delay; the denominator begins with 1
    numerator: Vector
    denominator: Vector
    #: Root mean square of what it does not explain of the simulated course, over that of the course; NaN-free, 1 where
    #: it only stands in
    misfit: float

    @property
    def static_gain(self) -> float:
        """What a steady force of 1 moves the response by."""
        return float(self.numerator.sum() / self.denominator.sum())

    def passed(self, comparison: Comparison, values: Vector, *, settled: bool = False) -> Vector:
        """What a force of this course (no holes) does to the response, run by run from rest.

        From rest without it, or with `settled` where its first value has moved the response to.
        """

        def moved(part: Vector) -> Vector:
            first = part[0] if settled else 0.0
            late = np.asarray(lfilter(self.numerator, self.denominator, part - first))
            return late + self.static_gain * first if settled else late

        return on_even_clock(comparison, moved, values)


def resonances_of(comparison: Comparison, response: str) -> tuple[tuple[float, float], ...]:
    """(frequency [Hz], damping) of what rings in the filters from a force to the response; none where they stand in."""
    found = []
    for path in linear_responses(comparison, response):
        poles = np.roots(path.denominator).astype(complex) if path.misfit < _LINEAR else np.zeros(0)
        for pole in poles[(np.abs(poles) > 1e-6) & (poles.imag > 0.0)]:
            s = np.log(pole) / comparison.period_s
            found.append((float(np.abs(s) / (2.0 * np.pi)), float(-s.real / np.abs(s))))
    return tuple(found)


def inputs(comparison: Comparison, response: str) -> tuple[str, ...]:
    """Channels that may drive the response, likeliest first: recorded ones, and what only the simulation has."""
    alike = [*map(comparison.with_role, INPUT_ROLES), [n for n in comparison.simulated if n not in comparison.recorded]]
    moving = [name for names in alike for name in by_movement(comparison, names) if name != response]
    return tuple(moving[:4])


def resonator(frequency_hz: float, damping: float, period_s: float) -> tuple[Matrix, Vector]:
    """Discrete filter of ẍ + 2ζωẋ + ω²x = ω²u, exact for a u that is linear between samples.

    Numerators of x, of ẋ/ω and of ẍ/ω², shape (3, 3), and the denominator, shape (3,).
    """
    w = 2.0 * np.pi * frequency_hz
    a = np.array([[0.0, 1.0], [-w * w, -2.0 * damping * w]])
    out = np.array([[1.0, 0.0], [0.0, 1.0 / w], [-1.0, -2.0 * damping / w]])
    system = (a, np.array([[0.0], [w * w]]), out, np.array([[0.0], [0.0], [1.0]]))
    ad, bd, cd, dd, _ = cont2discrete(system, period_s, method="foh")
    denominator = np.asarray(np.poly(ad).real, dtype=np.float64)
    # numerator of c(zI − A)⁻¹b + d is poly(A − b·c) + (d − 1)·poly(A)
    through = zip(cd, dd, strict=True)
    numerators = [np.poly(ad - np.outer(bd[:, 0], c)).real + (d[0] - 1.0) * denominator for c, d in through]
    return np.array(numerators), denominator


def simulated_peaks_hz(comparison: Comparison, response: str) -> tuple[float, ...]:
    """Frequencies of the two highest peaks in the spectrum of the simulated course [Hz], highest first."""
    simulated = comparison.simulated_course(response)
    best: tuple[float, ...] = ()
    longest = max(even_runs(comparison), key=lambda run: len(run.clock_s))
    part = longest.on(simulated)
    if len(part) < 32:
        return best
    window = np.hanning(len(part))
    spectrum = np.abs(np.fft.rfft((part - part.mean()) * window)) ** 2
    smooth = np.convolve(spectrum, np.ones(5) / 5.0, mode="same")
    peaks, told = find_peaks(smooth[3:], height=1e-3 * float(smooth[3:].max()))
    order = np.argsort(told["peak_heights"])[::-1][:2]
    return tuple(float(k + 3) / (len(part) * comparison.period_s) for k in peaks[order])


@lru_cache(maxsize=32)
def linear_responses(comparison: Comparison, response: str) -> tuple[LinearResponse, ...]:
    """The filter from the force to the response, the best known one alone, or some that stand in for it."""
    simulated = comparison.simulated_course(response)
    names = inputs(comparison, response)
    runs = list(_shortened(even_runs(comparison)))
    y = [run.on(simulated) for run in runs]
    u = [np.column_stack([run.on(course(comparison, n)) for n in names]) if names else None for run in runs]
    if names:
        recorded = [v for v in u if v is not None]
        fitted = _fitted(recorded, y, names)
        if fitted is None or fitted.misfit > _LEFT:
            turned = _beside_rotation(comparison, recorded, y, runs, names)
            if turned is not None and (fitted is None or turned.misfit < 0.5 * fitted.misfit):
                fitted = turned
        if fitted is not None:
            return (fitted,)
    elif (turned := _beside_rotation(comparison, [np.zeros((len(v), 0)) for v in y], y, runs, ())) is not None:
        return (turned,)
    decay = _fitted([np.zeros((len(v), 0)) for v in y], y, ())
    if decay is not None and _rings(decay.denominator, comparison.period_s):
        return (decay,)
    stand_in = []
    for frequency_hz in simulated_peaks_hz(comparison, response):
        for damping in _STAND_IN_DAMPING:
            b, a = resonator(frequency_hz, damping, comparison.period_s)
            stand_in.append(LinearResponse(None, b[0], a, 1.0))
    return tuple(stand_in)


def _beside_rotation(
    comparison: Comparison, u: list[Matrix], y: list[Vector], runs: list[EvenRun], names: tuple[str, ...]
) -> LinearResponse | None:
    """The filter of the recorded inputs where forces that turn with the spindle act as well, at any angle."""
    forces = rotating_forces(comparison)
    n = forces.shape[1]
    if n == 0:
        return None
    inputs_ = []
    for k, (run, recorded) in enumerate(zip(runs[:_TURNED_RUNS], u, strict=False)):
        turned = np.zeros((len(recorded), n * min(len(runs), _TURNED_RUNS)))
        turned[:, n * k : n * (k + 1)] = np.column_stack([run.on(force) for force in forces.T])
        inputs_.append(np.column_stack([recorded, turned]))
    return _fitted(inputs_, y[: len(inputs_)], names)


def _shortened(runs: tuple[EvenRun, ...]) -> Iterator[EvenRun]:
    """The runs that are long enough, cut so that all together stay within the rows that a fit needs."""
    usable = [run for run in runs if len(run.clock_s) > 40]
    most = _MOST_ROWS // max(len(usable), 1)
    for run in usable:
        n = min(len(run.time_s), most)
        rows = slice(run.rows.start, run.rows.start + n)
        time = run.time_s[:n]
        clock = time if run.is_even else run.clock_s[run.clock_s <= time[-1]]
        yield EvenRun(rows, time, clock)


def _fitted(u: list[Matrix], y: list[Vector], names: tuple[str, ...]) -> LinearResponse | None:
    """The filter of the lowest order that does, of those that fit; None if the course is not linear in the inputs."""
    best: LinearResponse | None = None
    size = float(np.sqrt(np.mean(np.concatenate([v - v.mean() for v in y]) ** 2))) if y else 0.0
    if size == 0.0:
        return None
    for order in _ORDERS:
        found = _steiglitz_mcbride(u, y, order)
        if found is None:
            continue
        a, b, left = found
        misfit = left / size
        if best is None or misfit < 0.5 * best.misfit:
            source, numerator = _strongest(u, a, b, names) if names else (None, np.eye(1, order + 1, 1)[0])
            best = LinearResponse(source, numerator, a, misfit)
        if best.misfit < _ENOUGH:
            break
    return best if best is not None and best.misfit < _LINEAR else None


def _steiglitz_mcbride(u: list[Matrix], y: list[Vector], order: int) -> tuple[Vector, Matrix, float] | None:
    best: tuple[Vector, Matrix, float] | None = None
    a = np.eye(1, order + 1)[0]
    for _ in range(_STEPS):
        columns, known = _equations(u, y, a, order)
        a = _stable(np.r_[1.0, least_squares(columns, known)[:order]])
        b, left = _numerators(u, y, a, order)
        if np.isfinite(left) and (best is None or left < best[2]):
            best = (a, b, left)
    return best


def _equations(u: list[Matrix], y: list[Vector], a: Vector, order: int) -> tuple[Matrix, Vector]:
    """Filtered by 1/a: y_k + Σ a_i y_{k−i} = Σ b_i u_{k−i} + what the start of every run leaves + a constant."""
    blocks, known = [], []
    for k, (inputs_, output) in enumerate(zip(u, y, strict=True)):
        yf = np.asarray(lfilter([1.0], a, output))
        blocks.append(np.column_stack([-_late(yf, order)[:, 1:], _of_inputs(inputs_, a, order, k, len(y))]))
        known.append(yf)
    return np.vstack(blocks), np.concatenate(known)


def _numerators(u: list[Matrix], y: list[Vector], a: Vector, order: int) -> tuple[Matrix, float]:
    """Numerators with the denominator given, and the root mean square of what the filter leaves of the course."""
    columns = np.vstack([_of_inputs(part, a, order, k, len(y)) for k, part in enumerate(u)])
    known = np.concatenate(y)
    coefficients = least_squares(columns, known)
    n_inputs = u[0].shape[1]
    b = coefficients[: n_inputs * (order + 1)].reshape(n_inputs, order + 1)
    return b, float(np.sqrt(np.mean((known - columns @ coefficients) ** 2)))


def _of_inputs(inputs_: Matrix, a: Vector, order: int, run: int, n_runs: int) -> Matrix:
    n = len(inputs_)
    parts = [_late(np.asarray(lfilter([1.0], a, column)), order) for column in inputs_.T]
    start = np.zeros((n, n_runs * order))
    start[:, run * order : (run + 1) * order] = _late(np.asarray(lfilter([1.0], a, np.eye(1, n)[0])), order - 1)
    return np.column_stack([*parts, start, np.asarray(lfilter([1.0], a, np.ones(n)))])


def _late(values: Vector, most: int) -> Matrix:
    """The course and the same 1 … `most` samples late, from rest."""
    columns = np.zeros((len(values), most + 1))
    for k in range(most + 1):
        columns[k:, k] = values[: len(values) - k]
    return columns


def _stable(a: Vector) -> Vector:
    """The denominator with poles outside the unit circle reflected into it."""
    roots = np.roots(a)
    size = np.abs(roots)
    roots = np.where(size > 1.0, roots / np.maximum(size, 1e-12) ** 2, roots)
    roots = roots * np.minimum(1.0, 0.99999 / np.maximum(np.abs(roots), 1e-12))
    return np.asarray(np.poly(roots).real)


def _strongest(u: list[Matrix], a: Vector, b: Matrix, names: tuple[str, ...]) -> tuple[str, Vector]:
    """The named input that moves the response most, with its numerator; `u` may have more inputs behind those."""
    moved = [
        sum(float(np.sum(np.asarray(lfilter(row, a, part[:, k])) ** 2)) for part in u)
        for k, row in enumerate(b[: len(names)])
    ]
    k = int(np.argmax(moved))
    return names[k], b[k]


def _rings(a: Vector, period_s: float) -> bool:
    """Whether the poles are those of something that rings and decays, not of a steady oscillation."""
    poles = np.roots(a)
    poles = poles[np.abs(poles) > 1e-6]
    s = np.log(poles.astype(complex)) / period_s
    damping = -s.real / np.abs(s)
    return bool(np.any((np.abs(s.imag) > 1e-3 * np.abs(s)) & (damping > 1e-3) & (damping < 0.5)))


Law = Literal["cubic", "stop", "dahl"]

_NUMBER: dict[Law, int] = {"cubic": 0, "stop": 1, "dahl": 2}


def restoring(comparison: Comparison, values: Vector, law: Law, width: float = 1.0) -> Vector:
    """φ of a course, run by run from φ = 0.

    ``cubic``: y³. ``stop``: an elastic element that slips at y = `width` from its last reversal (Prandtl), −1 … 1.
    ``dahl``: dφ/dy = (1 − φ·sgn ẏ)/`width`, the Bouc–Wen law with n = 1, β = γ, −1 … 1.
    """
    return by_run(comparison, lambda y: _force(y, _NUMBER[law], width), np.ascontiguousarray(values))


def linear_part(comparison: Comparison, path: LinearResponse, values: Vector, force: Vector) -> tuple[float, float]:
    """α [force/unit] and β [force·s/unit]: what φ looks like, behind the path, to a model without it."""
    fitted = ~comparison.held_out
    columns = np.column_stack([path.passed(comparison, v) for v in (values, rate(comparison, values))])
    alpha, beta = least_squares(columns[fitted], path.passed(comparison, force)[fitted])
    return float(alpha), float(beta)


def fed_back(
    comparison: Comparison,
    path: LinearResponse,
    simulated: Vector,
    law: Law,
    k: float,
    *,
    width: float = 1.0,
    linear: tuple[float, float] = (0.0, 0.0),
) -> Vector | None:
    """What the force k·(φ(y) − α·y − β·ẏ) moves the response by [its unit], fed back; None if that diverges."""
    result = np.zeros(len(simulated))
    alpha, beta = linear
    for run in even_runs(comparison):
        part = np.ascontiguousarray(run.on(simulated))
        most = 100.0 * float(np.abs(part).max(initial=0.0))
        moved = _loop(
            part, path.numerator, path.denominator, _NUMBER[law], k, width, alpha, beta / comparison.period_s, most
        )
        if not np.all(np.isfinite(moved)):
            return None
        result[run.rows] = run.back(moved)
    return result


@njit(cache=True, nogil=True)
def _next(number, y, before, z, width):  # type: ignore[no-untyped-def]
    if number == 0:
        return y * y * y
    step = (y - before) / width
    if number == 1:
        return min(max(z + step, -1.0), 1.0)
    sign = 1.0 if step > 0.0 else -1.0
    return sign + (z - sign) * np.exp(-abs(step))


@njit(cache=True, nogil=True)
def _force(y, number, width):  # type: ignore[no-untyped-def]
    z = np.zeros(len(y))
    if number == 0:
        return y**3
    for i in range(1, len(y)):
        z[i] = _next(number, y[i], y[i - 1], z[i - 1], width)
    return z


@njit(cache=True, nogil=True)
def _loop(simulated, b, a, number, k, width, alpha, beta, most):  # type: ignore[no-untyped-def]
    n = len(simulated)
    delta = np.zeros(n)
    force = np.zeros(n)
    z = 0.0
    y_before = simulated[0]
    for i in range(n):
        known = 0.0
        for j in range(1, len(a)):
            if i - j >= 0:
                known -= a[j] * delta[i - j]
        for j in range(1, len(b)):
            if i - j >= 0:
                known -= b[j] * force[i - j]
        guess = known - (b[0] * force[i - 1] if i > 0 else 0.0)
        for _ in range(3 if b[0] != 0.0 else 1):
            y = simulated[i] + guess
            if number == 0:
                z_new = y * y * y
            elif i == 0:
                z_new = 0.0
            else:
                z_new = _next(number, y, y_before, z, width)
            force[i] = k * (z_new - alpha * y - beta * (y - y_before))
            guess = known - b[0] * force[i]
        delta[i] = guess
        z = z_new
        y_before = simulated[i] + guess
        if not abs(guess) < most:
            delta[i] = np.inf
            return delta
    return delta


_MOTION = {"displacement": 0, "position": 0, "velocity": 1, "acceleration": 2}
_MOST = 3


def members(comparison: Comparison, response: str) -> tuple[str, ...]:
    """Other channels that are motions of members: responses first."""
    names = by_movement(comparison, (c.name for c in comparison.channels if c.role in _MOTION and c.name != response))
    return tuple(sorted(names, key=lambda name: name not in comparison.responses))[:_MOST]


JOINT_ROLES = ("displacement", "acceleration", "velocity", "position", "voltage")


def no_joint(comparison: Comparison, response: str) -> str | None:
    """Why no force of a joint can be seen in this response, in one clause; None if it can."""
    reason = no_vibration(comparison, response, roles=JOINT_ROLES) or of_a_drive(comparison, response)
    if reason is None and not linear_responses(comparison, response):
        return f"the simulated {response} shows no resonance that a force could pass through"
    return reason


def joints(comparison: Comparison, response: str) -> Iterator[tuple[str, LinearResponse, LinearResponse | None]]:
    """(member, path from a force to it, how the response follows it): the response itself, then simulated members."""
    for path in linear_responses(comparison, response):
        yield response, path, None
    for member in members(comparison, response):
        onward = transfer(comparison, member, response)
        if onward is not None:
            yield from (
                (member, path, onward) for path in linear_responses(comparison, member) if path.source is not None
            )


@lru_cache(maxsize=64)
def transfer(comparison: Comparison, predecessor: str, follower: str) -> LinearResponse | None:
    """How one simulated motion follows another; None if no filter explains it, or one of them is not simulated."""
    if not {predecessor, follower} <= comparison.simulated.keys():
        return None
    runs = list(_shortened(even_runs(comparison)))
    u, y = (comparison.simulated_course(name) for name in (predecessor, follower))
    return _fitted([run.on(u)[:, None] for run in runs], [run.on(y) for run in runs], (predecessor,))


def inertia_force(comparison: Comparison, member: str, origin: str) -> Vector | None:
    """Acceleration of a member [unit of its channel, per s² where it is a displacement]; None if it is not there."""
    courses = comparison.simulated if origin == "simulated" else comparison.recorded
    if member not in courses:
        return None
    motion = comparison.filled(courses[member])
    order = _MOTION[comparison.channel(member).role]
    if order == 2:
        return motion
    return rate(comparison, motion) if order == 1 else curvature(comparison, motion)


def reactions(
    comparison: Comparison, path: LinearResponse, predecessor: str, successor: str
) -> tuple[Callable[[float], Vector], float]:
    """What the inertia m·ẍ of a simulated successor moves its predecessor by, as a function of m; loop gain at m = 1.

    The successor follows what it has moved, where the simulation shows how: δ = −m·G·s²·(x + H·δ), with G the path
    from a force to the predecessor and H from the predecessor to the successor. δ is in the predecessor's unit.
    """
    force = inertia_force(comparison, successor, "simulated")
    onward = transfer(comparison, predecessor, successor)
    if force is None:
        return lambda mass: np.zeros(len(comparison.time_s)), 0.0
    parts = []
    largest = 0.0
    for run in even_runs(comparison):
        part = run.on(force)
        size = next_fast_len(2 * len(part), real=True)
        angle = 2.0 * np.pi * np.arange(size // 2 + 1) / size
        g = _gain(path, angle)
        loop = g * _derivative(comparison, successor, angle)
        largest = max(largest, float(np.abs(loop if onward is None else loop * _gain(onward, angle)).max()))
        loop = loop * _gain(onward, angle) if onward is not None else 0.0 * loop
        parts.append((run, g * np.fft.rfft(part, size), loop, size))

    def moved(mass: float) -> Vector:
        result = np.zeros(len(comparison.time_s))
        for run, driven, loop, size in parts:
            course = np.fft.irfft(-mass * driven / (1.0 + mass * loop), size)
            result[run.rows] = run.back(course[: len(run.clock_s)])
        return result

    return moved, largest


def _gain(path: LinearResponse, angle: Vector) -> NDArray[np.complex128]:
    return np.asarray(freqz(path.numerator, path.denominator, angle)[1], dtype=np.complex128)


def _derivative(comparison: Comparison, member: str, angle: Vector) -> NDArray[np.complex128]:
    """From the channel of a member to its acceleration, by the same differences as `inertia_force`."""
    order = _MOTION[comparison.channel(member).role]
    period = comparison.period_s
    once = 1j * np.sin(angle) / period
    twice = (2.0 * np.cos(angle) - 2.0) / period**2 + 0j
    return np.asarray((twice, once, np.ones(len(angle)))[order], dtype=np.complex128)


def curvature(comparison: Comparison, values: Vector) -> Vector:
    """Second derivative in time of a course [unit/s²], by central differences on the even clock of every run."""

    def second(part: Vector) -> Vector:
        inside = (part[2:] - 2.0 * part[1:-1] + part[:-2]) / comparison.period_s**2
        return np.pad(inside, 1)[: len(part)]

    return on_even_clock(comparison, second, values)


def displacement_of(comparison: Comparison, name: str, values: Vector) -> Vector:
    """A motion as a displacement: velocities and accelerations integrated, slow drift left out."""
    order = _MOTION.get(comparison.channel(name).role, 0)
    if order == 0:
        return values

    def integrated(part: Vector) -> Vector:
        n = len(part)
        spectrum = np.fft.rfft(part - part.mean(), 2 * n)
        omega = 2.0 * np.pi * np.fft.rfftfreq(2 * n, comparison.period_s)
        slow = 2.0 * np.pi * 4.0 / (n * comparison.period_s)
        weight = (1j * omega) ** order / (omega**2 + slow**2) ** order * (-1.0) ** order
        return np.asarray(np.fft.irfft(spectrum * weight, 2 * n)[:n])

    return on_even_clock(comparison, integrated, values)


#: Logarithms by which frequency and damping may be off, beyond which it is physics; steps to begin with.
_MOST_OFF, _FIRST = (0.03, 0.5), (0.01, 0.1)
_TRIED, _NEAR = 120, 1e-4  #: Shapes tried for every resonance; logarithms that each is told to.
_MATTERS = 0.95  #: Of the mean square of fitted rows: less has to be left, and no more of the others.

Resonances = Sequence[tuple[float, float]]


def with_moved_resonances(comparison: Comparison) -> tuple[Comparison, dict[str, Quantity], float] | None:
    """The comparison with what moved resonances change among its tangents, by how much each moves [%], and the gain.

    That is the share of what offset and gain leave of the fitted rows. Frequencies may move by 3 %, damping by a half.
    None where that gains nothing, and if the simulation can be run again, where its own parameters do this.
    """
    tangents: dict[str, dict[str, Vector]] = {}
    quantities: dict[str, Quantity] = {}
    share = 0.0
    for name in comparison.responses if not comparison.tangents else ():
        why_not = no_vibration(comparison, name) or of_a_drive(comparison, name)
        if why_not or swept_hz(comparison, name) is not None or not (own := resonances_of(comparison, name)):
            continue
        by, simulated = _best(comparison, name, own), comparison.simulated_course(name)
        fitted, unseen = _left(comparison, name, simulated)
        now_fitted, now_unseen = _left(comparison, name, _passed(comparison, simulated, own, by))
        if now_fitted >= _MATTERS * fitted or now_unseen > unseen:
            continue
        share, tangents[name] = max(share, 1.0 - now_fitted / fitted), {}
        for one, off in zip(own, by, strict=True):
            words = f"resonance of {one[0]:.4g} Hz moved by"
            tangents[name][words] = read_only(_passed(comparison, simulated, [one], off[None]) - simulated)
            quantities[words] = Quantity(100.0 * float(np.expm1(off[0])), "%")
    return (replace(comparison, tangents=tangents), quantities, share) if tangents else None


def _best(comparison: Comparison, response: str, own: Resonances) -> Matrix:
    """Logarithms by which frequency and damping of every resonance are off, (n, 2), by least squares."""
    simulated = comparison.simulated_course(response)
    before = max(_left(comparison, response, simulated)[0], 1e-300)

    def misfit(values: Vector) -> float:
        by = values.reshape(-1, 2)
        if np.any(np.abs(by) > _MOST_OFF):
            return np.inf
        return _left(comparison, response, _passed(comparison, simulated, own, by))[0] / before

    start = np.zeros(2 * len(own))
    simplex = np.vstack([start, np.diag(np.tile(_FIRST, len(own)))])
    options = {"initial_simplex": simplex, "maxfev": _TRIED * len(own), "xatol": _NEAR, "fatol": _NEAR}
    return np.asarray(minimize(misfit, start, method="Nelder-Mead", options=options).x.reshape(-1, 2))  # type: ignore[call-overload]


def _passed(comparison: Comparison, course: Vector, own: Resonances, by: Matrix) -> Vector:
    """The course with these resonances moved; the answer to a steady force stays."""
    for (frequency_hz, damping), (times_f, times_z) in zip(own, np.exp(by), strict=True):
        here = resonator(frequency_hz, damping, comparison.period_s)[1]
        there = resonator(frequency_hz * times_f, damping * times_z, comparison.period_s)[1]
        course = on_even_clock(comparison, partial(lfilter, here * (there.sum() / here.sum()), there), course)
    return course


def _left(comparison: Comparison, response: str, course: Vector) -> tuple[float, float]:
    """Mean square that offset and gain of a course leave of the fitted rows, and of the others; NaN without any."""
    recorded = comparison.recorded[response]
    seen = np.isfinite(recorded) & np.isfinite(comparison.simulated[response])
    columns = np.column_stack([np.ones(len(course)), course])
    rows, held = seen & ~comparison.held_out, seen & comparison.held_out
    left = recorded - columns @ least_squares(columns[rows], recorded[rows])
    return float(np.mean(left[rows] ** 2)), float(np.mean(left[held] ** 2)) if held.any() else float("nan")
