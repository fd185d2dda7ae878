"""What a push does to an axis beside its simulated motion: control with its lag, and dry friction that holds it.

A simulation has no noise, so its courses tell the equations that made them. Its force per mass is that of the inertia,
of viscous and of dry friction; the control makes it, with a lag τ, of the table's error e against the command r:
u + τu' = −c₂e' − c₁e − c₀∫e + k₁r' + k₀r, whatever the friction is. Beside that motion (speed v, friction state z) a
push f per mass moves the axis by x, with x'' = f − bx' + u − φδ, u + τu' = −c₂x' − c₁x − c₀∫x, and the friction,
which holds like a spring until it has turned over within the presliding distance d,
δ' = (1 − z·sgn v)·x'/d − |v|·δ/d (P. Dahl 1968, A solid friction model, linearised).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.motion import Motion, commanded, motion
from selector.diagnosis.shapes.signals import filled, rate

Vector = NDArray[np.float64]

FORCE_ROLES = ("current", "force", "voltage")
PRESLIDING_M = (1e-6, 2e-6, 4e-6, 8e-6, 1.6e-5, 3.2e-5)
_STEP_PER_POLE = 0.4
MOST_SUBSTEPS = 100
"""Steps within a period. What is so quick that it would need more is over before the next sample, and none shows it."""
_QUICK_LAG = 1.0 / MOST_SUBSTEPS
"""Part of a period below which a lag is none: the force is where it settles."""
_PIECE_ROWS = 100_000
_MOST_LEFT = 0.06
"""A simulated force of which control and mechanics leave more than this (rms) is made in another way."""
_NO_INTEGRAL = 1e-3
"""A reset that takes so much longer than the position loop is none."""
_LONGEST_LAG_PERIODS = 5.0
_AT_REST_S = 0.05
"""What takes longer than this to go the presliding distance may be pushed either way."""


@dataclass(frozen=True, eq=False)
class SimulatedAxis:
    """Equations of a simulated axis, all forces per mass.

    Attributes
    ----------
    control : tuple of float
        c₂ [1/s], c₁ [1/s²], c₀ [1/s³].
    lag_s : float
        Of the force behind the control [s].
    yield_s2 : float
        Yield between motor and table per force, of a control on the motor [s²]; 0 if it is on the table.
    viscous_per_s : float
        Viscous friction [1/s].
    dry_m_per_s2 : float
        Dry friction [m/s²].
    presliding_m : float
        Way within which it turns over [m].
    stiffens_per_m, forgets_per_s : ndarray of shape (n_rows,)
        (1 − z·sgn v)/d and |v|/d at the rows.
    """

    control: tuple[float, float, float]
    lag_s: float
    yield_s2: float
    viscous_per_s: float
    dry_m_per_s2: float
    presliding_m: float
    stiffens_per_m: Vector
    forgets_per_s: Vector

    @property
    def poles_per_s(self) -> NDArray[np.complex128]:
        """Poles of the loop while the axis slides."""
        viscous, lag = self.viscous_per_s, self.lag_s
        c2, c1, c0 = self.control
        # a pole at 0, and that of a lag that is none, are no poles of the loop
        polynomial = np.trim_zeros(np.array([lag, 1.0 + lag * viscous, viscous + c2, c1, c0]))
        return np.asarray(np.roots(polynomial), dtype=np.complex128)

    def substeps(self, period_s: float) -> int:
        """Steps within a period that follow its poles, and the spring that friction is; no more than MOST_SUBSTEPS.

        A stiffer spring is taken at the end of the step, so that it holds as if it did not give way.
        """
        holds = float(np.sqrt(self.dry_m_per_s2 * self.stiffens_per_m.max()))
        fastest = max(self.fastest_per_s, holds)
        return int(np.clip(np.ceil(fastest * period_s / _STEP_PER_POLE), 1, MOST_SUBSTEPS))

    @property
    def fastest_per_s(self) -> float:
        """Pace of its fastest pole, but for the lag behind a control with an integral part, which needs no steps."""
        return float(np.sort(np.abs(self.poles_per_s))[:3].max())

    def is_shown(self, period_s: float) -> bool:
        """Whether samples a period apart can have told it: it comes to rest, and not long before the next sample."""
        poles = self.poles_per_s
        return (
            len(poles) > 0
            and float(poles.real.max()) < 0.0
            and self.fastest_per_s * period_s <= _STEP_PER_POLE * MOST_SUBSTEPS
        )


@dataclass(frozen=True, eq=False)
class Pushed:
    """What a push per mass makes of an axis, beside its simulated motion.

    Attributes
    ----------
    motion : tuple of ndarray of shape (n_rows,)
        Way, speed, acceleration.
    countered : ndarray of shape (n_rows,)
        What the drive puts against the push, per mass.
    """

    motion: tuple[Vector, Vector, Vector]
    countered: Vector


def simulated_drive_force(comparison: Comparison, axis: str | None) -> tuple[str, Vector] | None:
    """Simulated current, force or voltage of the axis, which has no noise; None if none is simulated."""
    for channel in comparison.channels:
        of_axis = axis is None or channel.axis in (None, axis)
        if channel.role in FORCE_ROLES and channel.name in comparison.simulated and of_axis:
            return channel.name, filled(comparison, comparison.simulated[channel.name])
    return None


@lru_cache(maxsize=8)
def simulated_axis(comparison: Comparison, axis: str | None) -> SimulatedAxis | None:
    """The equations that a simulated force and error of an axis obey; None without these, or if they obey others."""
    moving, command = motion(comparison, axis), commanded(comparison, axis)
    drive = simulated_drive_force(comparison, axis)
    if moving is None or command is None or drive is None or float(np.std(drive[1])) == 0.0:
        return None
    if not np.any(moving.position_m - command) or not any(name in comparison.simulated for name in moving.sources):
        return None
    found = (_of_rows(comparison, moving, command, drive[1], rows) for rows in telling_rows(comparison))
    return next((one for one in found if one is not None), None)


def telling_rows(comparison: Comparison) -> list[slice]:
    """All rows, then those of every run by itself: a push from outside in one run hides the control in all."""
    runs = [rows for _, rows in comparison.rows_of_runs()]
    return [slice(0, len(comparison.time_s)), *(runs if len(runs) > 1 else [])]


def _of_rows(
    comparison: Comparison, moving: Motion, command: Vector, force: Vector, rows: slice
) -> SimulatedAxis | None:
    _, distance, mass, viscous, dry = min(_of_mechanics(moving, force, distance, rows) for distance in PRESLIDING_M)
    if mass == 0.0 or float(np.std(force[rows])) == 0.0:
        return None
    told = _of_control(comparison, moving, command, force / mass, rows)
    if told is None:
        return None
    stiffens, forgets = _linearised(moving, distance)
    found = SimulatedAxis(*told, viscous / mass, max(dry / mass, 0.0), distance, stiffens, forgets)
    return found if found.is_shown(comparison.period_s) else None


def _of_mechanics(
    moving: Motion, force: Vector, distance: float, rows: slice
) -> tuple[float, float, float, float, float]:
    """What is left of a force, for which presliding distance, and its parts by acceleration, speed, dry friction."""
    columns = np.column_stack([
        moving.acceleration_m_per_s2, moving.velocity_m_per_s, moving.friction_state(distance), np.ones(len(force))
    ])[rows]  # fmt: skip
    fit = np.linalg.lstsq(columns, force[rows], rcond=None)[0]
    left = float(np.mean((force[rows] - columns @ fit) ** 2))
    return left, distance, float(fit[0]), float(fit[1]), float(fit[2])


def _of_control(
    comparison: Comparison, moving: Motion, command: Vector, force: Vector, rows: slice
) -> tuple[tuple[float, float, float], float, float] | None:
    """c₂, c₁, c₀, τ and y by least squares; None where they leave too much.

    First of a control on the table. Of one on the motor the error is e + y·(u − μx''), with the yield y of what is in
    between and the motor's share μ of the mass: how ∫u and x'' count beside ∫e and e tells these two.
    """
    error, acceleration = moving.position_m - command, moving.acceleration_m_per_s2
    of_table, left = _fit([*_controlled(comparison, error, command), rate(comparison, force)], force, rows)
    enough = _MOST_LEFT * float(np.std(force[rows]))
    if left < enough:
        return _checked(comparison, of_table, 0.0)
    columns = _controlled(comparison, error, command)
    more = [_summed(comparison, force), acceleration, moving.velocity_m_per_s, rate(comparison, acceleration)]
    free, _ = _fit([*columns, *more, rate(comparison, force)], force, rows)
    if not (free[1] < 0.0 and free[2] < 0.0):
        return None
    # all count 1/(1 + c₁y) times, u being on both sides
    yields = float(free[len(columns)] / free[2])
    if not 0.0 < -free[1] * yields < 1.0:
        return None
    share = float(np.clip(-free[len(columns) + 1] / (free[1] * yields), 0.0, 1.0))
    of_motor, left = _fit(
        [*_controlled(comparison, error + yields * (force - share * acceleration), command), rate(comparison, force)],
        force,
        rows,
    )
    return _checked(comparison, of_motor, yields) if left < enough else None


def _controlled(comparison: Comparison, error: Vector, command: Vector) -> list[Vector]:
    """What a control makes its force of: rate, amount and sum of the error, the command, a zero of every run."""
    begun = command - command[[rows.start for _, rows in comparison.rows_of_runs()]][comparison.run_index]
    return [
        rate(comparison, error), error, _summed(comparison, error), rate(comparison, command, over_samples=5), begun,
        *(np.equal(comparison.run_index, k).astype(np.float64) for k in range(len(comparison.runs))),
    ]  # fmt: skip


def _checked(comparison: Comparison, fit: Vector, yields: float) -> tuple[tuple[float, float, float], float, float]:
    lag = -float(fit[-1])
    possible = _QUICK_LAG <= lag / comparison.period_s <= _LONGEST_LAG_PERIODS
    c2, c1, c0 = (-float(value) for value in fit[:3])
    has_integral = abs(c0 * c2) > _NO_INTEGRAL * c1**2
    return (c2, c1, c0 if has_integral else 0.0), lag if possible else 0.0, yields


def _summed(comparison: Comparison, course: Vector) -> Vector:
    result = np.zeros(len(course))
    for _, rows in comparison.rows_of_runs():
        part, time = course[rows], comparison.time_s[rows]
        result[rows] = np.r_[0.0, np.cumsum(0.5 * (part[1:] + part[:-1]) * np.diff(time))]
    return result


def _fit(columns: list[Vector], target: Vector, rows: slice) -> tuple[Vector, float]:
    """Coefficients of columns of any size in some rows, 0 of those that are 0, and the root mean square left there."""
    matrix, target = np.column_stack(columns)[rows], target[rows]
    size = np.sqrt(np.mean(matrix**2, axis=0))
    size = np.where(size > 0.0, size, 1.0)
    fit = np.linalg.lstsq(matrix / size, target, rcond=None)[0]
    return fit / size, float(np.sqrt(np.mean((target - matrix / size @ fit) ** 2)))


def _linearised(moving: Motion, distance: float) -> tuple[Vector, Vector]:
    speed, state = moving.velocity_m_per_s, moving.friction_state(distance)
    sense = speed / (np.abs(speed) + distance / _AT_REST_S)
    return np.maximum(1.0 - state * sense, 0.0) / distance, np.abs(speed) / distance


def pushed(comparison: Comparison, axis: SimulatedAxis, push: Vector, yield_s2: float = 0.0) -> Pushed:
    """The answer of a simulated axis to a push per mass, shape (n_rows,), from rest at the first row of each run.

    With `yield_s2` the push and the dry friction act on a table that yields by so much per force against the motor;
    the way is that of the table.
    """
    way, speed, acceleration, countered = np.zeros((4, len(push)))
    for _, rows in comparison.rows_of_runs():
        state = np.zeros(5)
        for piece in pieces(rows):
            _stepped(
                push[piece], comparison.time_s[piece], np.array(axis.control), axis.lag_s, axis.viscous_per_s,
                axis.dry_m_per_s2, axis.stiffens_per_m[piece], axis.forgets_per_s[piece], yield_s2,
                axis.substeps(comparison.period_s), state, way[piece], speed[piece], acceleration[piece],
                countered[piece],
            )  # fmt: skip
    return Pushed((way, speed, acceleration), countered)


def pieces(rows: slice) -> Iterator[slice]:
    """The rows of a run in pieces of which each begins with the last row of the one before.

    Compiled code does not hear Ctrl-C.
    """
    for start in range(rows.start, max(rows.stop - 1, rows.start + 1), _PIECE_ROWS):
        yield slice(start, min(start + _PIECE_ROWS + 1, rows.stop))


@njit(cache=True, nogil=True)
def _stepped(  # type: ignore[no-untyped-def]
    push, time_s, control, lag, viscous, dry, stiffens, forgets, yields, substeps, state,
    way, speed, acceleration, countered,
):  # fmt: skip
    x, v, integral, bent, given = state
    for k in range(1, len(push)):
        h = (time_s[k] - time_s[k - 1]) / substeps
        half = 0.5 * h
        quick = half / (lag + half)
        # what the control asks for in the middle of a step, per speed there
        asks = control[0] + half * (control[1] + half * control[2])
        more = (push[k] - push[k - 1]) / substeps
        for j in range(substeps):
            share = (j + 0.5) / substeps
            force = push[k - 1] + (push[k] - push[k - 1]) * share
            stiff = stiffens[k - 1] + (stiffens[k] - stiffens[k - 1]) * share
            forgotten = h * (forgets[k - 1] + (forgets[k] - forgets[k - 1]) * share)
            # the yield goes with the friction's own spring in series
            series = stiff * yields * dry
            soft = 1.0 / (1.0 + forgotten + series)
            stays = soft * ((1.0 + series) * bent + stiff * yields * more)
            turns = soft * stiff * h
            # midpoint of all but the friction, which forgets fast: that is taken at the end of the step
            asked = control[1] * x + control[2] * (integral + half * x)
            held = (1.0 - quick) * given + quick * asked + dry * stays
            middle = (v + half * (force - held)) / (1.0 + half * (viscous + quick * asks + dry * turns))
            given += 2.0 * quick * (asked + asks * middle - given)
            bent = stays + turns * middle
            integral += h * (x + half * middle)
            x += h * middle
            v = 2.0 * middle - v
        way[k], speed[k], countered[k] = x + yields * (push[k] - dry * bent), v, given
        acceleration[k] = push[k] - given - viscous * v - dry * bent
    state[:] = x, v, integral, bent, given
