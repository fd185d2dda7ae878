"""How forces on an axis become the shapes of a drive effect: leads, limits, fits in newtons."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numba import njit
from scipy.ndimage import median_filter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Variant
from selector.diagnosis.shapes.axis import (
    FORCE_ROLES,
    MOST_SUBSTEPS,
    STEP_PER_POLE,
    Motion,
    SimulatedAxis,
    commanded,
    derivatives,
    motion,
    pieces,
    simulated_axis,
)
from selector.diagnosis.shapes.force_response import PLACE_ROLES, ClosedLoop, felt, guesses, passed, responds, yields_s2
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import excited
from selector.types import Vector

_USUAL_PRESLIDING_M = 4e-6

#: Of some hundreds of leads that can be told apart, what is left to chance when the highest few are offered.
LEADS_LOOKED_AT = 30.0


def motion_of(comparison: Comparison, response: str) -> Motion:
    """The motion of the axis that the response belongs to; without a command a compared speed is as simulated in it.

    Recorded elsewhere it is the response itself, which would explain all that it is off.
    """
    channel = comparison.channel(response)
    found = motion(comparison, channel.axis)
    if found is None:
        raise ValueError(f"asked for shapes in {response!r}, which no motion was recorded for")
    if channel.role != "velocity" or response in found.sources or commanded(comparison, channel.axis) is not None:
        return found
    speed = comparison.simulated_course(response)
    return replace(found, velocity_m_per_s=speed, acceleration_m_per_s2=derivatives(comparison, speed)[0])


def of_forces(
    comparison: Comparison,
    response: str,
    forces: Mapping[str, Vector],
    shape: Mapping[str, Quantity] | None = None,
    *,
    of_motor: bool = False,
    most: int | None = None,
) -> Iterator[Variant]:
    """Forces [any unit], by what they are, as shapes in the response, one for each compliance that it may have.

    The compliance is not free beside the loop: a course that only bends and moves nothing is no force. Those of the
    motor bend nothing. `most` limits how many compliances are tried.
    """
    sources = motion_of(comparison, response).sources
    looked_at = _looked_at(shape)
    for guess in (None, *guesses(comparison, response)):
        for yield_s2 in (0.0,) if of_motor else yields_s2(comparison, response)[:most]:
            parts = {
                what: passed(comparison, response, force, yield_s2=yield_s2, guess=guess)
                for what, force in forces.items()
            }
            columns = np.column_stack([course for course, _ in parts.values()])
            names = tuple(f"{what}, {how}" for what, (_, how) in parts.items())
            own = {"yield_s2": Quantity(yield_s2, "s^2")} if yield_s2 > 0.0 else {}
            yield Variant(columns, names, dict(shape or {}) | own, sources=sources, looked_at=looked_at)


def direct(
    comparison: Comparison, response: str, columns: Mapping[str, Vector], shape: Mapping[str, Quantity] | None = None
) -> Variant:
    """Courses that stand in the response as they are."""
    sources = motion_of(comparison, response).sources
    stacked = np.column_stack(list(columns.values()))
    return Variant(stacked, tuple(columns), dict(shape or {}), sources=sources, looked_at=_looked_at(shape))


def _looked_at(shape: Mapping[str, Quantity] | None) -> float:
    return LEADS_LOOKED_AT if shape and "lead_mm" in shape else 1.0


def reverses(comparison: Comparison, response: str) -> str | None:
    """None if a force can be seen here and the axis goes both ways."""
    lacking = responds(comparison, response)
    if lacking is None and np.ptp(motion_of(comparison, response).sense) < 2.0:
        return "the axis moves one way only, where dry friction is a constant"
    return lacking


def place_only(comparison: Comparison, response: str) -> str | None:
    """None if the response is a displacement or position of an axis that moves."""
    lacking = responds(comparison, response)
    if lacking is None and comparison.channel(response).role not in PLACE_ROLES:
        return f"{response} is no displacement or position, and it does not show elsewhere"
    return lacking


def stays(comparison: Comparison, response: str) -> str | None:
    """None if the axis is at more than one place."""
    return None if np.ptp(motion_of(comparison, response).position_m) > 0.0 else "the axis stays in one place"


def presliding_m(comparison: Comparison, response: str) -> float:
    """Way within which dry friction turns over: that of the simulation's own, else a usual one [m]."""
    told = simulated_axis(comparison, comparison.channel(response).axis)
    return told.presliding_m if told is not None and told.dry_m_per_s2 > 0.0 else _USUAL_PRESLIDING_M


def centred_place(moving: Motion) -> Vector:
    """Position from the middle of the way that was travelled, −1…1 over it; 0 if there is none."""
    low, high = float(moving.position_m.min()), float(moving.position_m.max())
    if high <= low:
        return np.zeros(len(moving.position_m))
    return np.asarray((2.0 * moving.position_m - low - high) / (high - low))


def is_force(fitted: Fitted, comparison: Comparison) -> bool:
    """Whether the fitted response is a force, current or voltage: its first coefficient then is a force in its unit."""
    return comparison.channel(fitted.response).role in FORCE_ROLES


def force_key(fitted: Fitted, comparison: Comparison) -> str:
    """Name of a parameter that is a force in the unit of the response; empty where it is none."""
    key = {"N": "force_n", "A": "current_a", "V": "voltage_v"}.get(fitted.unit, "amount")
    return key if is_force(fitted, comparison) else ""


def waved(fitted: Fitted) -> Quantity:
    """Amplitude of a sine and a cosine, the first two columns."""
    amount, error = (float(np.hypot(*of[:2])) for of in (fitted.coefficients, fitted.standard_errors))
    return Quantity(amount, fitted.unit, max(amount - 1.96 * error, 0.0), amount + 1.96 * error)


SHORTEST_M = 5e-5
FEWEST_TURNS = 3.0
N_PEAKS = 6
N_LONG = 3  #: Of leads with few turns on the way: they stand beside what is slow, not beside noise.
_FEW_TURNS = 12.0
_FINER = 6
_BACKGROUND_LINES = 60  #: Strokes that overlap little make one line as wide as several.
_BINS, _BINS_OF_TURNS = 2**13, 2**16  #: Of a way that is limited, and where a speed is compared, which may go on.


@lru_cache(maxsize=16)
def leads(comparison: Comparison, axis: str | None, *, of_force: bool) -> tuple[float, ...]:
    """Leads [m] that the residuals of an axis repeat with over its position, longest first; fitted rows only.

    Of a position itself (in displacements and positions), or `of_force`: of a force, by all responses together, each
    passed back through what it does to them, so that a ripple that the loop turns with speed adds up.
    """
    moving = motion(comparison, axis)
    if moving is None:
        return ()
    used = (moving.sense != 0.0) & ~comparison.held_out
    place = moving.position_m[used]
    if len(place) < 50 or np.ptp(place) < FEWEST_TURNS * SHORTEST_M:
        return ()
    courses, bins = [], _BINS
    for name in comparison.responses:
        channel = comparison.channel(name)
        seen = (*FORCE_ROLES, *PLACE_ROLES, "velocity") if of_force else PLACE_ROLES
        if channel.role not in seen or (axis is not None and channel.axis not in (None, axis)):
            continue
        left = _left(comparison, motion_of(comparison, name) if channel.role == "velocity" else moving, name)
        if excited(left):
            courses.append((felt(comparison, name, left) if of_force else left)[used])
            bins = _BINS_OF_TURNS if channel.role == "velocity" else bins
    return _highest(place, courses, bins, comparison, np.abs(moving.velocity_m_per_s[used]))


def _left(comparison: Comparison, moving: Motion, name: str) -> Vector:
    """What motion, place and the simulated course do not explain of a residual in the fitted rows; 0 in the others."""
    own = np.column_stack([
        moving.velocity_m_per_s, moving.acceleration_m_per_s2, moving.sense, moving.position_m, moving.position_m**2,
        *(np.equal(comparison.run_index, k) for k in range(len(comparison.runs))),
        comparison.simulated_course(name),
    ])[~comparison.held_out]  # fmt: skip
    residual = comparison.filled(comparison.difference(name))[~comparison.held_out]
    left = np.zeros(len(comparison.time_s))
    left[~comparison.held_out] = residual - own @ least_squares(own, residual)
    return left


def _highest(
    place: Vector, courses: list[Vector], bins: int, comparison: Comparison, speed: Vector
) -> tuple[float, ...]:
    way = float(np.ptp(place))
    width = way * _FINER / bins
    number = np.minimum(((place - place.min()) / way * _FINER**-1 * bins).astype(np.intp), bins - 1)
    frequency = np.fft.rfftfreq(bins, width)
    # at least four samples a turn at the usual speed
    travel = float(np.median(speed)) * comparison.period_s
    shortest = max(SHORTEST_M, 4.0 * travel, 4.0 * width)
    inside = (frequency >= FEWEST_TURNS / way) & (frequency <= 1.0 / shortest)
    if inside.sum() < 5 or not courses:
        return ()
    height = np.zeros(int(inside.sum()))
    for course in courses:
        sums = np.bincount(number, weights=course, minlength=bins)
        power = np.abs(np.fft.rfft(sums)[inside]) ** 2
        background = median_filter(power, min(_BACKGROUND_LINES * _FINER, len(power)), mode="reflect")
        height += power / np.maximum(background, 1e-300 + 1e-6 * float(power.max()))
    is_long = frequency[inside] * way < _FEW_TURNS
    taken = [*_apart(np.where(is_long, 0.0, height), N_PEAKS), *_apart(np.where(is_long, height, 0.0), N_LONG)]
    # of few turns a line stands on the foot of what drifts along the way
    tops = [frequency[inside][k] + (0.0 if is_long[k] else frequency[1] * _beside(height, k)) for k in taken]
    return tuple(sorted({float(1.0 / top) for top in tops}, reverse=True))


def _beside(height: Vector, k: int) -> float:
    """Where between its neighbours the top of a peak is, by the parabola through them [steps of the grid]."""
    if not 0 < k < len(height) - 1:
        return 0.0
    before, top, after = height[k - 1 : k + 2]
    return float(np.clip(0.5 * (before - after) / min(before - 2.0 * top + after, -1e-300), -0.5, 0.5))


def _apart(height: Vector, most: int) -> list[int]:
    """The highest peaks, no two nearer than a line is wide."""
    padded = np.r_[0.0, height, 0.0]
    order = [k for k in range(len(height)) if height[k] > 0.0 and height[k] >= max(padded[k], padded[k + 2])]
    taken: list[int] = []
    for k in sorted(order, key=lambda k: -height[k]):
        if all(abs(k - other) > _FINER for other in taken):
            taken.append(k)
        if len(taken) == most:
            break
    return taken


def held_back(
    comparison: Comparison, loop: SimulatedAxis | ClosedLoop, asked: Vector, limit: float, *, winds_up: bool
) -> tuple[Vector, Vector]:
    """Force that lacks [unit of the force] and way behind [the same · s²], shape (n_rows,), from rest in every run.

    What the control asks for (`asked`) cannot exceed a limit; with `winds_up` its integral part runs on, else it waits.
    """
    axis = loop if isinstance(loop, SimulatedAxis) else _sliding(comparison, loop)
    c2, c1, c0 = axis.control
    # position gain p and reset r: c₁ = c₂·(p + r), c₀ = c₂·p·r; the position loop is the slower one
    half = 0.5 * c1 / c2
    reset = half + float(np.sqrt(max(half**2 - c0 / c2, 0.0))) if c0 else 0.0
    control = np.array([c2, c1, c0, reset, axis.lag_s, axis.viscous_per_s, axis.dry_m_per_s2])
    lacking, behind = np.zeros(len(asked)), np.zeros(len(asked))
    for _, rows in comparison.rows_of_runs():
        state = np.zeros(5)
        for part in pieces(rows):
            _held(
                asked[part], comparison.time_s[part], control, axis.stiffens_per_m[part], axis.forgets_per_s[part],
                limit, winds_up, axis.substeps(comparison.period_s), state, lacking[part], behind[part],
            )  # fmt: skip
    return lacking, behind


def _sliding(comparison: Comparison, loop: ClosedLoop) -> SimulatedAxis:
    """A loop as an axis without friction and lag."""
    # what is over long before the next sample may as well take a part of that time
    quickest = MOST_SUBSTEPS * STEP_PER_POLE / comparison.period_s
    poles = np.roots(loop.polynomial)
    poles = poles * np.minimum(1.0, quickest / np.maximum(np.abs(poles), 1e-300))
    c2, c1, c0 = [*np.real(np.poly(poles))[1:].tolist(), 0.0][:3]
    nothing = np.zeros(len(comparison.time_s))
    return SimulatedAxis((c2, c1, c0), 0.0, 0.0, 0.0, 0.0, 0.0, nothing, nothing)


@njit(cache=True, nogil=True)
def _held(  # type: ignore[no-untyped-def]
    asked, time_s, control, stiffens, forgets, limit, winds_up, substeps, state, lacking, behind
):
    c2, c1, c0, reset, lag, viscous, dry = control
    way, speed, integral, given, bent = state
    for k in range(1, len(asked)):
        step = (time_s[k] - time_s[k - 1]) / substeps
        quick = step / (lag + step)
        for j in range(substeps):
            share = (j + 1.0) / substeps
            simulated = asked[k - 1] + (asked[k] - asked[k - 1]) * share
            wanted = simulated - c2 * speed - c1 * way - integral
            let = min(max(wanted, -limit), limit)
            integral += c0 * step * way
            if not winds_up:
                integral -= reset * step * (let - wanted)
            # what is given beyond the simulation
            given += quick * (let - simulated - given)
            # the friction may be stiffer than the steps can follow: taken at the end of the step, where it holds
            soft = 1.0 / (1.0 + step * forgets[k])
            pushed = speed + step * (given - viscous * speed - dry * soft * bent)
            speed = pushed / (1.0 + soft * dry * stiffens[k] * step**2)
            bent = soft * (bent + step * stiffens[k] * speed)
            way += step * speed
        lacking[k] = given
        behind[k] = way
    state[:] = way, speed, integral, given, bent
