"""What a force on the axis does to each response: through the loop that the simulation shows, and by compliance.

A simulation has no noise, so its own courses tell the poles of its closed loop: they are those of the answer to
a force as well. With the characteristic polynomial A(s) of third order (position loop, speed loop with integral part) a
force f moves the axis by s·f/A(s), and the drive counters it with f − s³·f/A(s); without an integral part A(s) is of
second order, a force that stays moves the axis for good, f/A(s), and is countered with f − s²·f/A(s).
"""

from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from scipy.signal import lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes import axis as axes
from selector.diagnosis.shapes.signals import by_run, rise
from selector.types import Vector

PLACE_ROLES = ("displacement", "position")
_ORDERS = {"displacement": 0, "position": 0, "velocity": 1, "acceleration": 2}  #: Derivatives of the place.
MOTION_ROLES = tuple(_ORDERS)
#: Natural frequencies of the whole moving mass on what stands between drive and table; softer ones are no guess.
NATURAL_HZ = (70.0, 130.0, 40.0)
USUAL_YIELD_S2 = 1.0 / (2.0 * np.pi * NATURAL_HZ[0]) ** 2
ROUNDS = 7
SLOWEST, FASTEST = 2.0, 2000.0  #: Bounds of the poles [1/s].
PRESLIDING_M = 3e-6
_NO_LOOP = 0.4  #: A simulated error of which more than this is left (rms) follows its command by no such loop.
#: Poles to start the iteration with [1/s]; that which ends nearer to the simulation counts.
STARTS = ((60.0, 100.0, 300.0), (15.0, 30.0, 150.0))
USUAL = ((30.0, 60.0, 150.0), (60.0, 100.0, 300.0))  #: Poles of drives of machine tools [1/s], slow and quick.
STARTS_WITHOUT_INTEGRAL = ((60.0, 100.0), (15.0, 30.0))
#: A loop of second order that leaves less than this of the simulation, and hardly more than one of third, is it.
_EXACT = 0.002
_HARDLY_MORE = 1.3
#: Where mass and friction leave less of a force, or a loop not so much less, it is worked out from the motion.
_OF_MOTION, _BETTER = 0.01, 0.5
_FROM_REST = 0.01  #: Share of the largest speed below which a run starts from rest.


@dataclass(frozen=True)
class ClosedLoop:
    """Characteristic polynomial of a drive's closed loop."""

    #: Coefficients of s³, s², s, 1, or of s², s, 1 where the control has no integral part; the first is 1
    polynomial: tuple[float, ...]
    misfit: float  #: What it leaves of the simulated courses, over these (rms)

    @property
    def order(self) -> int:
        """2 without, 3 with an integral part of the control."""
        return len(self.polynomial) - 1


def responds(comparison: Comparison, response: str) -> str | None:
    """None if a force on an axis shows in this response, else what is lacking, as a clause."""
    channel = comparison.channel(response)
    if channel.role not in axes.FORCE_ROLES + MOTION_ROLES:
        return f"{response} is neither a force, current or voltage nor a motion"
    if axes.motion(comparison, channel.axis) is None:
        return "no recorded position, command or speed of an axis that moves"
    return None


def yields_s2(comparison: Comparison, response: str) -> tuple[float, ...]:
    """Compliances worth trying in a response, times the moving mass [s²]; a stiff axis first.

    Only a displacement or position shows them, and only beside a loop; elsewhere 0.
    """
    channel = comparison.channel(response)
    if channel.role not in PLACE_ROLES or not _has_loop(comparison, channel.axis):
        return (0.0,)
    told = axes.simulated_axis(comparison, channel.axis)
    if told is not None:
        # what acts at the motor bends nothing; a control on the table makes good what bends, if it is as simulated
        return (0.0, told.yield_s2 or USUAL_YIELD_S2)
    return (0.0, *(1.0 / (2.0 * np.pi * natural_hz) ** 2 for natural_hz in NATURAL_HZ))


def guesses(comparison: Comparison, response: str) -> tuple[ClosedLoop, ...]:
    """Loops of usual drives, for a position of which the simulation does not tell what holds it; else none."""
    channel = comparison.channel(response)
    if channel.role not in PLACE_ROLES or _has_loop(comparison, channel.axis):
        return ()
    return tuple(ClosedLoop(tuple(float(c) for c in np.real(np.poly(-np.array(poles)))), 1.0) for poles in USUAL)


def _has_loop(comparison: Comparison, axis: str | None) -> bool:
    return axes.simulated_axis(comparison, axis) is not None or closed_loop(comparison, axis) is not None


def passed(
    comparison: Comparison, response: str, force: Vector, *, yield_s2: float = 0.0, guess: ClosedLoop | None = None
) -> tuple[Vector, str]:
    """What a force [any unit] against the axis does to a response, shape (n_rows,), and what that is in words.

    In a force-like response what the drive puts against it; in a motion, to the other side, what passes through the
    loop and, times `yield_s2` (compliance between drive and table times the moving mass), the force itself. So what
    is missing has a positive coefficient in all of them. The loop is that of the simulation, with the dry friction that
    it has (`simulated_axis`, else `closed_loop`), or `guess`. Without a loop (a force model on a recorded motion) the
    force itself. As large as the force, in the root mean square.
    """
    channel = comparison.channel(response)
    order = _ORDERS.get(channel.role)
    told = axes.simulated_axis(comparison, channel.axis) if guess is None else None
    loop = guess or closed_loop(comparison, channel.axis)
    if told is not None:
        answer = axes.pushed(comparison, told, force, yield_s2)
        moved = answer.countered if order is None else answer.motion[order]
    elif loop is None:
        return force, "in the drive" if order is None else "by compliance"
    elif order is None:
        moved = force - _through(comparison, loop, loop.order, force)
    else:
        moved = _through(comparison, loop, loop.order - 2 + order, force)
    if order is None:
        return moved, "as the drive counters it"
    back = -_sense_of(comparison, response)
    if order > 0 or yield_s2 == 0.0:
        paces = [] if guess is None else sorted(np.abs(np.roots(guess.polynomial)).tolist())
        usual = f" with poles at {', '.join(f'{p:.0f}' for p in paces)}/s" if paces else ""
        return _as_large(back * moved, force), f"through the loop{usual}"
    bent = 0.0 if told is not None else yield_s2 * force
    return _as_large(back * (moved + bent), force), "through the loop and by compliance"


def felt(comparison: Comparison, response: str, course: Vector) -> Vector:
    """How much a force of every moment has to do with a course of a response: `passed` backwards in time, (n_rows,).

    The product with a force is that of the course with what the force does; but for dry friction, which is left out.
    """
    backwards = by_run(comparison, np.flip, course)
    channel = comparison.channel(response)
    told = axes.simulated_axis(comparison, channel.axis)
    if told is None:
        back = passed(comparison, response, backwards)[0]
    else:
        answer = axes.pushed(comparison, replace(told, dry_m_per_s2=0.0), backwards)
        back = answer.countered if channel.role in axes.FORCE_ROLES else answer.motion[_ORDERS[channel.role]]
    return by_run(comparison, np.flip, back)


def _sense_of(comparison: Comparison, response: str) -> float:
    """-1 of a displacement that is command less position, else 1."""
    channel = comparison.channel(response)
    command, moving = axes.commanded(comparison, channel.axis), axes.motion(comparison, channel.axis)
    if channel.role != "displacement" or command is None or moving is None or response not in comparison.simulated:
        return 1.0
    along = float(comparison.simulated_course(response) @ (moving.position_m - command))
    return -1.0 if along < 0.0 else 1.0


def loop_parts(comparison: Comparison, response: str, course: Vector) -> tuple[Vector, ...]:
    """Course as its second and third derivative pass the loop: what a sudden shift of the table costs the drive."""
    loop = closed_loop(comparison, comparison.channel(response).axis)
    if loop is None:
        return (axes.derivatives(comparison, course)[0],)
    return tuple(_through(comparison, loop, power, course) for power in (loop.order - 1, loop.order))


def slowest_s(comparison: Comparison, response: str) -> float:
    """Time constant of the slowest pole of the loop; of a usual one, where the simulation shows none [s]."""
    loop = closed_loop(comparison, comparison.channel(response).axis)
    return 0.05 if loop is None else 1.0 / float(np.min(np.abs(np.roots(loop.polynomial))))


@lru_cache(maxsize=8)
def closed_loop(comparison: Comparison, axis: str | None = None) -> ClosedLoop | None:
    """The loop that the simulation shows; None without a command or without a simulated error or position.

    Iterated least squares with prefilters: K. Steiglitz, L. E. McBride (1965), IEEE Trans. Automatic Control 10,
    461–464.
    """
    command = axes.commanded(comparison, axis)
    state = axes.motion(comparison, axis)
    if command is None or state is None:
        return None
    speed, _ = axes.derivatives(comparison, command)
    top = float(np.abs(speed).max())
    friction = state.friction_state(PRESLIDING_M)
    inputs = [speed / top, friction]
    courses = [_loop_course(comparison, command, c.name, axis) for c in comparison.channels]
    outputs = [course for course in courses if course is not None]
    force, by_motion = ([], 0.0) if outputs else _of_drive(comparison, axis)
    outputs = outputs or force
    if not outputs:
        return None
    for k, first in enumerate(comparison.starts[:-1]):
        if abs(float(speed[first] / top)) > _FROM_REST:
            # ones over a run that starts in motion: passed through the loop, what was before its first sample fades
            inputs.append((comparison.run_index == k).astype(np.float64))
    found = (
        _of_rows(comparison, outputs, inputs, by_motion if force else None, rows)
        for rows in axes.telling_rows(comparison)
    )
    return next((loop for loop in found if loop is not None), None)


def _of_rows(
    comparison: Comparison, outputs: list[Vector], inputs: list[Vector], by_motion: float | None, rows: slice
) -> ClosedLoop | None:
    """The loop that some rows show; of a force alone with what mass and friction leave of it (`by_motion`)."""
    if any(float(np.std(course[rows])) == 0.0 for course in outputs):
        return None
    with_integral, without = (
        min((_iterated(comparison, outputs, inputs, start, rows) for start in starts), key=lambda loop: loop.misfit)
        for starts in (STARTS, STARTS_WITHOUT_INTEGRAL)
    )
    if with_integral.misfit >= _NO_LOOP:
        return None
    # a force hardly tells a slow reset
    if by_motion is not None and (by_motion < _OF_MOTION or with_integral.misfit > _BETTER * by_motion):
        return None
    exact, hardly_more = (_EXACT, _HARDLY_MORE) if by_motion is None else (np.inf, 1.1)
    if without.misfit < min(exact, hardly_more * with_integral.misfit):
        return without
    # where a pole was held at its bound, what drives the error is not the command (a force from outside)
    slowest = float(np.min(np.abs(np.roots(with_integral.polynomial))))
    return with_integral if slowest > 1.01 * SLOWEST else None


def _of_drive(comparison: Comparison, axis: str | None) -> tuple[list[Vector], float]:
    """The simulated force of the drive, of unit variance, and what mass and friction of the motion leave of it."""
    drive = axes.simulated_drive_force(comparison, axis)
    if drive is None or float(np.std(drive[1])) == 0.0:
        return [], 0.0
    left = drive[1] - np.sum(list(axes.simulated_forces(comparison, axis).values()), axis=0)
    left = by_run(comparison, lambda part: part - part.mean(), left)
    size = float(np.std(drive[1]))
    return [drive[1] / size], float(np.sqrt(np.mean(left**2))) / size


def _loop_course(comparison: Comparison, command: Vector, name: str, axis: str | None) -> Vector | None:
    """A simulated error, current… that shows the loop, of unit variance; None if the channel is no such thing."""
    channel = comparison.channel(name)
    if name not in comparison.simulated or (axis is not None and channel.axis not in (None, axis)):
        return None
    if channel.role not in ("displacement", "position"):
        return None
    course = comparison.simulated_course(name)
    if channel.role == "position":
        course = course - command
    course = rise(comparison, course, over_samples=1)
    spread = float(np.std(course))
    return course / spread if spread > 0.0 else None


def _iterated(
    comparison: Comparison, outputs: list[Vector], inputs: list[Vector], start: tuple[float, ...], rows: slice
) -> ClosedLoop:
    order = len(start)
    polynomial = np.real(np.poly(-np.array(start)))
    best = ClosedLoop((), np.inf)
    for _ in range(ROUNDS):
        driven = np.stack([b[rows] for u in inputs for b in _branches(comparison, polynomial, u)])
        size = np.sqrt(np.mean(driven**2, axis=1))
        basis, _ = np.linalg.qr((driven[size > 0.0] / size[size > 0.0, None]).T)
        left_over = float(np.mean([1.0 - np.sum((basis.T @ y[rows]) ** 2) / (y[rows] @ y[rows]) for y in outputs]))
        misfit = float(np.sqrt(max(left_over, 0.0)))
        if misfit < best.misfit:
            best = ClosedLoop(tuple(float(c) for c in polynomial), misfit)
        left, right = [], []
        for y in outputs:
            own = np.stack(_branches(comparison, polynomial, y))[:, rows]
            own = own - (own @ basis) @ basis.T
            left.append(own[:order].T)
            right.append(own[order])
        matrix, target = np.vstack(left), np.hstack(right)
        size = np.sqrt(np.mean(matrix**2, axis=0))
        if not np.all(size > 0.0):
            break
        solution = np.linalg.lstsq(matrix / size, target, rcond=None)[0] / size
        pace = polynomial[-1] ** (1.0 / order)
        # branch j is (s/pace)^j·pace^order/A, so its factor belongs to pace^(order − j)
        poles = np.roots(np.r_[1.0, (-solution * pace ** (order - np.arange(order)))[::-1]])
        poles = np.where(poles.real > 0.0, -np.conj(poles), poles)
        poles = poles * np.clip(np.abs(poles), SLOWEST, FASTEST) / np.maximum(np.abs(poles), 1e-12)
        polynomial = np.real(np.poly(poles))
    return best


def _branches(comparison: Comparison, polynomial: Vector, course: Vector) -> list[Vector]:
    order = len(polynomial) - 1
    pace = float(polynomial[-1]) ** (1.0 / order)
    return [_filtered(comparison, polynomial, j, course) * pace ** (order - j) for j in range(order + 1)]


def _through(comparison: Comparison, loop: ClosedLoop, power: int, course: Vector) -> Vector:
    return _filtered(comparison, np.array(loop.polynomial), power, course)


def _filtered(comparison: Comparison, polynomial: Vector, power: int, course: Vector) -> Vector:
    """s^power·x/A(s), run by run, from rest at the first sample (Tustin)."""
    b, a = _tustin(power, tuple(float(c) for c in polynomial), comparison.period_s)
    return by_run(comparison, partial(lfilter, b, a), course)


@lru_cache(maxsize=4096)
def _tustin(power: int, polynomial: tuple[float, ...], step_s: float) -> tuple[Vector, Vector]:
    """Numerator and denominator in z of s^power/A(s): s^k (of degree n) is (2/Δ)^k·(z − 1)^k·(z + 1)^(n − k).

    `scipy.signal.bilinear` gives the same in 8 ms; hundreds of filters are asked for.
    """
    order = len(polynomial) - 1
    terms = [
        (2.0 / step_s) ** k * np.real(np.poly([1.0] * k + [-1.0] * (order - k))) for k in range(order + 1)
    ]  # fmt: skip
    denominator = sum((c * terms[order - i] for i, c in enumerate(polynomial)), np.zeros(order + 1))
    return terms[power] / denominator[0], denominator / denominator[0]


def _as_large(course: Vector, as_this: Vector) -> Vector:
    rms = float(np.sqrt(np.mean(course**2)))
    return np.asarray(course * (float(np.sqrt(np.mean(as_this**2))) / rms)) if rms > 0.0 else course
