"""What an axis does, and what a push does to it beside its simulated motion."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import by_run, lagged, rate
from selector.types import Vector

NOISE_SHARE = 0.02  #: Noise that smoothing may leave in an acceleration, as a share of its root mean square.
LONGEST_SMOOTHING_S = 0.06
MOVING_SHARE = 0.002  #: Below this share of the largest speed an axis counts as standing, unless noise asks for more.
_FAR = 5.0  #: Times a displacement by which a position is behind its command, where that is not the following error.
_AGREES = 0.5  #: Correlation of the ways from sample to sample by a position and by a speed.
UM = 1e-6


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of one axis at the rows of a comparison; arrays of shape (n_rows,)."""

    #: position_m, velocity_m_per_s and acceleration_m_per_s2: Where the table is [m], [m/s], [m/s²]; made of a speed
    #: only, the position counts from the start of each run
    position_m: Vector
    velocity_m_per_s: Vector
    acceleration_m_per_s2: Vector
    sense: Vector  #: +1, −1, and 0 while the axis stands
    rest_speed_m_per_s: float  #: Below this the axis counts as standing [m/s]
    sources: tuple[str, ...]  #: Channels that it was made of
    starts: tuple[int, ...]

    def friction_state(self, presliding_m: float) -> Vector:
        """Share of the dry friction that acts, −1…1, shape (n_rows,): it turns over within a short way.

        z' = v − |v|·z per presliding distance, exact between samples. P. Dahl (1968), A solid friction model.
        """
        return np.asarray(_bristle(self.position_m, np.asarray(self.starts), presliding_m))


@lru_cache(maxsize=8)
def motion(comparison: Comparison, axis: str | None = None) -> Motion | None:
    """What the axis does, or None if no channel tells or nothing moves.

    The table is where its command and the simulated error of that axis put it, which has no noise; without such an
    error it is behind the command by what the recorded position or speed say. Without a command: the recorded
    position (of a compared channel what was simulated), or the way of the recorded speed where there is none, or one
    that goes another way. Channels of another axis are left out if this one has any.
    """
    command = _named(comparison, "position_command", axis)
    # beside a command a simulated position tells without noise how it is followed
    position = _named(comparison, "position", axis, compared_first=command is not None)
    velocity = _named(comparison, "velocity", axis)
    if command is not None:
        place, by = _followed(comparison, _values(comparison, command), position, velocity, axis)
        sources = (command, *by)
    elif position is not None:
        place, sources = _placed(comparison, position, velocity)
    elif velocity is not None:
        place, sources = _summed(comparison, _values(comparison, velocity)), (velocity,)
    else:
        return None
    speed, acceleration = derivatives(comparison, place)
    return _described(comparison, place, speed, acceleration, sources)


def commanded(comparison: Comparison, axis: str | None = None) -> Vector | None:
    """Commanded position [m], shape (n_rows,); None if it was not recorded."""
    name = _named(comparison, "position_command", axis)
    return None if name is None else _values(comparison, name)


def derivatives(comparison: Comparison, place: Vector) -> tuple[Vector, Vector]:
    """Speed and acceleration of a position, smoothed no more than its noise asks for."""
    n = _window(comparison, place)
    speed, acceleration = np.zeros(len(place)), np.zeros(len(place))
    for _, rows in comparison.rows_of_runs():
        part, time = place[rows], comparison.time_s[rows]
        if len(part) < 9:
            continue
        step = float(np.median(np.diff(time)))
        even = np.arange(time[0], time[-1] + 0.5 * step, step)
        uneven = np.ptp(np.diff(time)) > 0.05 * step
        values = np.interp(even, time, part) if uneven else part
        window = min(n, (len(values) - 1) | 1, len(values) - 1 + len(values) % 2)
        first = savgol_filter(values, window, 3, deriv=1, delta=step)
        second = savgol_filter(values, window, 3, deriv=2, delta=step)
        speed[rows] = np.interp(time, even, first) if uneven else first
        acceleration[rows] = np.interp(time, even, second) if uneven else second
    return speed, acceleration


def _named(comparison: Comparison, role: str, axis: str | None, *, compared_first: bool = False) -> str | None:
    seen = [c for c in comparison.channels if c.role == role and np.isfinite(comparison.recorded[c.name]).any()]
    of_axis = [c for c in seen if axis is not None and c.axis == axis]
    of_none = [c for c in seen if axis is None or c.axis is None]
    # a channel that is itself compared is the last choice
    chosen = sorted(
        of_axis or of_none or seen, key=lambda channel: (channel.name in comparison.responses) != compared_first
    )
    return chosen[0].name if chosen else None


def _values(comparison: Comparison, name: str) -> Vector:
    simulated = comparison.simulated.get(name)
    return comparison.filled(comparison.recorded[name] if simulated is None else simulated)


def _placed(comparison: Comparison, position: str, velocity: str | None) -> tuple[Vector, tuple[str, ...]]:
    """A position, and the channels that tell it: the recorded speed of its axis where that says another way.

    A position that goes by steps, or is read at other times, does not tell the speed. It tells the level of a run.
    """
    place = _values(comparison, position)
    if velocity is None or comparison.channel(position).axis != comparison.channel(velocity).axis:
        return place, (position,)
    way = _summed(comparison, _values(comparison, velocity))
    inside = np.diff(comparison.run_index) == 0
    gone, said = np.diff(place)[inside], np.diff(way)[inside]
    # counted the other way round, it still goes that way
    if abs(float(gone @ said)) >= _AGREES * float(np.linalg.norm(gone) * np.linalg.norm(said)):
        return place, (position,)
    for _, rows in comparison.rows_of_runs():
        way[rows] += np.mean(place[rows] - way[rows])
    return way, (position, velocity)


def _followed(
    comparison: Comparison, command: Vector, position: str | None, velocity: str | None, axis: str | None
) -> tuple[Vector, tuple[str, ...]]:
    """Where the table is while it follows its command, and the channels that tell."""
    speed, acceleration = derivatives(comparison, command)
    errors = [c for c in comparison.channels if c.role == "displacement" and c.name in comparison.simulated]
    errors = [c for c in errors if axis is None or c.axis in (axis, None)]
    error = UM * comparison.simulated_course(errors[0].name) if errors else None
    behind = None if position is None else command - _values(comparison, position)
    # of a position that is much further behind its command a displacement is no following error, but a wind-up, say
    if error is not None and (behind is None or float(np.std(behind)) < _FAR * float(np.std(error))):
        # a command is followed, not led: that tells which sign the error has
        sign = -1.0 if float(error @ speed) > 0.0 else 1.0
        return command + sign * error, (errors[0].name,)
    if position is not None and behind is not None:
        place = _values(comparison, position)
        if position in comparison.simulated or _window(comparison, place) < _longest_window(comparison, place):
            return place, (position,)
        course, by = speed, position
    elif velocity is not None:
        behind, course, by = speed - _values(comparison, velocity), acceleration, velocity
    else:
        return command, ()
    power = float(course @ course)
    lag_s = min(float(course @ behind) / power, 0.2) if power > 0.0 else 0.0
    if lag_s < 0.5 * comparison.period_s:
        return command, ()
    return lagged(comparison, command, lag_s, settled=True), (by,)


def _window(comparison: Comparison, place: Vector) -> int:
    """Odd number of samples of the shortest cubic whose second derivative is quiet enough."""
    step = comparison.period_s
    third = np.diff(place, 3)[comparison.run_index[3:] == comparison.run_index[:-3]]
    longest = _longest_window(comparison, place)
    if longest <= 7:
        return 7
    # third differences of white noise have √20 times its spread; a smooth course hardly shows in their median
    noise = float(np.median(np.abs(third))) / (0.6745 * np.sqrt(20.0))
    for window in range(7, longest, 2):
        curve = savgol_filter(place, window, 3, deriv=2, delta=step)
        # the second derivative of a cubic through n points has a spread of about √720·n^(−5/2)·σ/T²
        left = noise * np.sqrt(720.0) * window**-2.5 / step**2
        if left < NOISE_SHARE * float(np.sqrt(np.median(curve**2) + np.mean(curve**2))):
            return window
    return longest


def _longest_window(comparison: Comparison, place: Vector) -> int:
    longest = max(7, round(LONGEST_SMOOTHING_S / comparison.period_s) | 1)
    return min(longest, (len(place) - 2) | 1)


def _described(
    comparison: Comparison, place: Vector, speed: Vector, acceleration: Vector, sources: tuple[str, ...]
) -> Motion | None:
    top = float(np.quantile(np.abs(speed), 0.995))
    if top <= 1e-12 or not np.isfinite(place).all():
        return None
    slow = np.abs(speed) < 0.05 * top
    # speed while standing is noise: three of its spreads are no motion
    noise = 1.4826 * float(np.median(np.abs(speed[slow]))) if slow.any() else 0.0
    rest = max(MOVING_SHARE * top, min(3.0 * noise, 0.02 * top))
    sense = np.where(np.abs(speed) > rest, np.sign(speed), 0.0)
    return Motion(place, speed, acceleration, sense, rest, sources, comparison.starts)


@njit(cache=True, nogil=True)
def _bristle(place, starts, distance):  # type: ignore[no-untyped-def]
    z = np.zeros(len(place))
    for run in range(len(starts) - 1):
        for k in range(starts[run] + 1, starts[run + 1]):
            way = (place[k] - place[k - 1]) / distance
            towards = 1.0 if way > 0.0 else -1.0
            z[k] = towards + (z[k - 1] - towards) * np.exp(-abs(way))
    return z


FORCE_ROLES = ("current", "force", "voltage")
PRESLIDING_M = (1e-6, 2e-6, 4e-6, 8e-6, 1.6e-5, 3.2e-5)
STEP_PER_POLE = 0.4
#: Steps within a period. What is so quick that it would need more is over before the next sample, and none shows it.
MOST_SUBSTEPS = 100
_QUICK_LAG = 1.0 / MOST_SUBSTEPS  #: Part of a period below which a lag is none: the force is where it settles.
_PIECE_ROWS = 100_000
#: A simulated force of which control and mechanics leave more than this (rms) is made in another way.
_MOST_LEFT = 0.06
_NO_INTEGRAL = 1e-3  #: A reset that takes so much longer than the position loop is none.
_LONGEST_LAG_PERIODS = 5.0
_AT_REST_S = 0.05  #: What takes longer than this to go the presliding distance may be pushed either way.


@dataclass(frozen=True, eq=False)
class SimulatedAxis:
    """Equations of a simulated axis, all forces per mass."""

    control: tuple[float, float, float]  #: c₂ [1/s], c₁ [1/s²], c₀ [1/s³]
    lag_s: float  #: Of the force behind the control [s]
    yield_s2: float  #: Yield between motor and table per force, of a control on the motor [s²]; 0 if it is on the table
    viscous_per_s: float  #: Viscous friction [1/s]
    dry_m_per_s2: float  #: Dry friction [m/s²]
    presliding_m: float  #: Way within which it turns over [m]
    #: stiffens_per_m and forgets_per_s: (n_rows,): (1 − z·sgn v)/d and |v|/d at the rows
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
        return int(np.clip(np.ceil(fastest * period_s / STEP_PER_POLE), 1, MOST_SUBSTEPS))

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
            and self.fastest_per_s * period_s <= STEP_PER_POLE * MOST_SUBSTEPS
        )


@dataclass(frozen=True, eq=False)
class Pushed:
    """What a push per mass makes of an axis, beside its simulated motion."""

    motion: tuple[Vector, Vector, Vector]  #: (n_rows,): Way, speed, acceleration
    countered: Vector  #: (n_rows,): What the drive puts against the push, per mass


def simulated_drive_force(comparison: Comparison, axis: str | None) -> tuple[str, Vector] | None:
    """Simulated current, force or voltage of the axis, which has no noise; None if none is simulated."""
    for channel in comparison.channels:
        of_axis = axis is None or channel.axis in (None, axis)
        if channel.role in FORCE_ROLES and channel.name in comparison.simulated and of_axis:
            return channel.name, comparison.simulated_course(channel.name)
    return None


def simulated_forces(comparison: Comparison, axis: str | None) -> dict[str, Vector]:
    """What inertia, friction by speed and dry friction make of the simulated force, by effect, (n_rows,) each."""
    moving, drive = motion(comparison, axis), simulated_drive_force(comparison, axis)
    if moving is None or drive is None:
        return {}
    _, distance, mass, viscous, dry = min(_of_mechanics(moving, drive[1], one, slice(None)) for one in PRESLIDING_M)
    return {
        "drive.mass": mass * moving.acceleration_m_per_s2,
        "drive.viscous": viscous * moving.velocity_m_per_s,
        "drive.coulomb": dry * moving.friction_state(distance),
    }


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
    """From the start of every run on, by trapezia."""
    return by_run(comparison, lambda x, time: np.r_[0.0, np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(time))],
                  course, comparison.time_s)  # fmt: skip


def _fit(columns: list[Vector], target: Vector, rows: slice) -> tuple[Vector, float]:
    """Coefficients of columns of any size in some rows, 0 of those that are 0, and the root mean square left there."""
    matrix, target = np.column_stack(columns)[rows], target[rows]
    fit = least_squares(matrix, target)
    return fit, float(np.sqrt(np.mean((target - matrix @ fit) ** 2)))


def _linearised(moving: Motion, distance: float) -> tuple[Vector, Vector]:
    speed, state = moving.velocity_m_per_s, moving.friction_state(distance)
    sense = speed / (np.abs(speed) + distance / _AT_REST_S)
    return np.maximum(1.0 - state * sense, 0.0) / distance, np.abs(speed) / distance


def pushed(comparison: Comparison, axis: SimulatedAxis, push: Vector, yield_s2: float = 0.0) -> Pushed:
    """The answer of a simulated axis to a push per mass, shape (n_rows,), from rest at the first row of each run.

    With `yield_s2` push and dry friction act on a table, whose way it is, that yields so much per force of the motor.
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
    state[0], state[1], state[2], state[3], state[4] = x, v, integral, bent, given
