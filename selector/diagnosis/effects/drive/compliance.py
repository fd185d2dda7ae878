"""What stands between motor and table: lost motion, wind-up, and the error of screw or scale."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

import numpy as np
from numba import njit
from scipy.signal import bilinear, lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive import _forces as axis_forces
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.shapes.axis import FORCE_ROLES, Motion, simulated_drive_force, simulated_forces
from selector.diagnosis.shapes.force_response import PLACE_ROLES, loop_parts, responds
from selector.diagnosis.shapes.signals import by_run, rate, scaled
from selector.diagnosis.shown_units import displayed
from selector.types import Vector

#: Way on which the lost motion is crossed; the finest stands for all that the sampling shows as a step.
_CROSSED_UM = (1.0, 10.0, 100.0)
_WIDER = 10.0**0.5
_OF_WAY = 0.25  #: Of the usual way between reversals: what a machine says nothing of may have play that wide.
#: Of the moving mass, behind the play: where inertia exceeds friction, flanks change while the axis slows down.
_INERTIA_SHARES = (1.0, 0.6)
_STARTS = (1.0, 0.0, -1.0)  #: Flank before a run's first motion: that which it touches then, in between, the other one.
_LOADED = 0.01  #: Share of the largest load below which the flanks stay as they are.


def _backlash(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    starts = np.asarray(moving.starts)
    seen: list[Vector] = []
    for crossed_um in _widths(moving):
        for start in _STARTS:
            side = _begun(_side, moving.position_m, starts, 1e-6 * crossed_um, start)
            # within one sample a short way is a step, and one step is like another
            if any(float(np.max(np.abs(side - other))) < 0.05 for other in seen):
                continue
            seen.append(side)
            shape = {"crossed_um": Quantity(crossed_um, "um"), "start": Quantity(start, "1")}
            yield _of_side(comparison, response, side, shape)
    for share, load in _loads(comparison, response, moving):
        for start in _STARTS:
            side = _begun(_loaded_side, load, starts, _LOADED * float(np.abs(load).max()), start)
            shape = {"inertia_share": Quantity(share, "1"), "start": Quantity(start, "1")}
            yield _of_side(comparison, response, side, shape)


def _widths(moving: Motion) -> Iterator[float]:
    yield from _CROSSED_UM
    wider_um = _CROSSED_UM[-1] * _WIDER
    while 1e-6 * wider_um < _OF_WAY * _stroke_m(moving):
        yield wider_um
        wider_um *= _WIDER


def _stroke_m(moving: Motion) -> float:
    """Usual way from one reversal to the next, or to the end of the run."""
    goes = np.flatnonzero(moving.sense)
    turns = goes[np.flatnonzero(np.diff(moving.sense[goes]))]
    at = np.unique([*moving.starts[:-1], *turns, *(stop - 1 for stop in moving.starts[1:])])
    # from the end of one run to the start of the next nothing moves
    ways = np.abs(np.diff(moving.position_m[at]))[~np.isin(at[1:], moving.starts)]
    return float(np.median(ways)) if len(ways) else 0.0


def _begun(sides: Callable[..., Vector], course: Vector, starts: Vector, least: float, start: float) -> Vector:
    """Side that touches, if before the first touch of every run it was `start` times that which touches first."""
    side = sides(course, starts, least, np.zeros(len(starts) - 1))
    first = np.zeros(len(starts) - 1)
    for run, (begin, stop) in enumerate(pairwise(starts)):
        touched = np.flatnonzero(np.abs(side[begin:stop]) > 0.99)
        first[run] = np.sign(side[begin + touched[0]]) if len(touched) else 0.0
    return side if start == 0.0 else sides(course, starts, least, start * first)


def _of_side(comparison: Comparison, response: str, side: Vector, shape: dict[str, Quantity]) -> Variant:
    """Position: half of the play on either side; force: what crossing it costs the drive."""
    if comparison.channel(response).role in PLACE_ROLES:
        return axis_forces.direct(comparison, response, {"side that the flanks touch on": -side}, shape)
    impulses = loop_parts(comparison, response, side)
    columns = {f"impulse at reversal, {k + 1}": scaled(part) for k, part in enumerate(impulses)}
    return axis_forces.direct(comparison, response, columns, shape)


def _loads(comparison: Comparison, response: str, moving: Motion) -> Iterator[tuple[float, Vector]]:
    """Shares of the moving mass behind the play, and simulated force that passes it; or the wind-up by that force."""
    channel = comparison.channel(response)
    if channel.role == "displacement" and response not in moving.sources:
        yield 1.0, comparison.simulated_course(response)
    drive = simulated_drive_force(comparison, channel.axis)
    if drive is None:
        return
    inertia = simulated_forces(comparison, channel.axis)["drive.mass"]
    for share in _INERTIA_SHARES:
        yield share, np.asarray(drive[1] - (1.0 - share) * inertia)


@njit(cache=True, nogil=True)
def _side(place, starts, crossed, begun):  # type: ignore[no-untyped-def]
    side = np.zeros(len(place))
    for run in range(len(starts) - 1):
        side[starts[run]] = begun[run]
        for k in range(starts[run] + 1, starts[run + 1]):
            side[k] = min(max(side[k - 1] + 2.0 * (place[k] - place[k - 1]) / crossed, -1.0), 1.0)
    return side


@njit(cache=True, nogil=True)
def _loaded_side(load, starts, least, begun):  # type: ignore[no-untyped-def]
    side = np.zeros(len(load))
    for run in range(len(starts) - 1):
        side[starts[run]] = begun[run]
        for k in range(starts[run] + 1, starts[run + 1]):
            side[k] = side[k - 1] if abs(load[k]) < least else (1.0 if load[k] > 0.0 else -1.0)
    return side


def _backlash_testable(comparison: Comparison, response: str) -> str | None:
    lacking = axis_forces.reverses(comparison, response)
    if lacking is None and comparison.channel(response).role not in PLACE_ROLES + FORCE_ROLES:
        return f"{response} is no displacement, position, force or current"
    return lacking


def _backlash_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if comparison.channel(fitted.response).role in PLACE_ROLES:
        lost = fitted.coefficient(factor=2.0)
        return Reading(
            f"At each reversal {lost.words(amount=True)} of motion are lost, whatever speed and force.",
            {"lost_motion": Quantity(abs(lost.value), lost.unit)},
        )
    return Reading(f"At each reversal the drive crosses a play: impulses of {fitted.size_words}.", fitted.size)


_DAMPING = 0.04
_N_FREQUENCIES = 12
_LOWEST_HZ = 8.0
_HIGHEST_SHARE = 0.8


def _elasticity(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    acceleration = moving.acceleration_m_per_s2
    inertia = {"wind-up by inertia": acceleration}
    is_place = comparison.channel(response).role in PLACE_ROLES
    if is_place:
        yield axis_forces.direct(comparison, response, inertia, _at(0.0))
        drive = simulated_drive_force(comparison, comparison.channel(response).axis)
        if drive is not None:
            of_drive = {f"wind-up by {drive[0]}": drive[1]}
            yield axis_forces.direct(comparison, response, of_drive, _at(0.0))
            yield axis_forces.direct(comparison, response, of_drive | inertia, _at(0.0))
        else:
            friction = {"wind-up by friction": moving.friction_state(axis_forces.presliding_m(comparison, response))}
            yield axis_forces.direct(comparison, response, inertia | friction, _at(0.0))
    else:
        # the control of a motor that runs ahead of its table by the wind-up feels the rate of it
        jerk = {"rate of the wind-up by inertia": rate(comparison, acceleration, over_samples=5)}
        yield from axis_forces.of_forces(comparison, response, jerk, _at(0.0), of_motor=True)
    top = _HIGHEST_SHARE * 0.5 / comparison.period_s
    if top <= _LOWEST_HZ:
        return
    for frequency in np.geomspace(_LOWEST_HZ, min(top, 40.0 * _LOWEST_HZ), _N_FREQUENCIES):
        ringing = _mode(comparison, acceleration, float(frequency), _DAMPING) - acceleration
        forces = {"mode rung by acceleration": ringing}
        shape = _at(float(frequency)) | {"damping_ratio": Quantity(_DAMPING, "1")}
        if is_place:
            yield axis_forces.direct(comparison, response, forces | inertia, shape)
        else:
            yield from axis_forces.of_forces(comparison, response, forces, shape, of_motor=True)


def _at(frequency_hz: float) -> dict[str, Quantity]:
    """0: without a mode that the sampling shows."""
    return {"frequency_hz": Quantity(frequency_hz, "Hz")}


def _mode(comparison: Comparison, course: Vector, frequency_hz: float, damping: float) -> Vector:
    """ω²·x/(s² + 2ζωs + ω²), run by run (Tustin, true at ω)."""
    omega = 2.0 * np.pi * frequency_hz
    rate = omega / (2.0 * np.tan(0.5 * omega * comparison.period_s))
    b, a = bilinear([omega**2], [1.0, 2.0 * damping * omega, omega**2], rate)
    return by_run(comparison, partial(lfilter, b, a), course)


def _elasticity_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    frequency = fitted.parameter("frequency_hz")
    if frequency.value > 0.0:
        text = f"A flexible mode near {frequency.value:.3g} Hz rings when the axis changes its acceleration"
        return Reading(f"{text}: {fitted.size_words}.", fitted.size | {"frequency_hz": frequency})
    per = fitted.coefficient(f"{fitted.unit}*s^2/m" if "inertia" in fitted.variant.names[0] else fitted.unit)
    text = f"The axis winds up between drive and table, by {per.words(amount=True)} per unit of the"
    return Reading(f"{text} {fitted.variant.names[0]}: {fitted.size_words}.", fitted.size | {"compliance": per})


_INERTIA, _FRICTION = "inertia", "friction"


def _varying_stiffness(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    place = axis_forces.centred_place(moving)
    speed = np.abs(moving.velocity_m_per_s) / float(np.abs(moving.velocity_m_per_s).max())
    friction = moving.friction_state(axis_forces.presliding_m(comparison, response))
    loads = [(_INERTIA, moving.acceleration_m_per_s2), (_FRICTION, friction)]
    drive = simulated_drive_force(comparison, comparison.channel(response).axis)
    for number, (name, load) in enumerate([drive, *loads] if drive is not None else loads):
        # contacts stiffen with their load: the stiffness of Hertz goes with its cube root
        most = max(float(np.abs(load).max()), 1e-300)
        linear, square = {f"{name} × position": load * place}, {f"{name} × position²": load * place**2}
        laws = [linear, linear | square, {f"{name} × its amount": load * np.abs(load) / most}]
        if name == _FRICTION:
            # friction times its amount is friction, and times speed a lag: nothing that varies
            laws = laws[:2]
        elif name == _INERTIA:
            laws.append({f"{name} × speed": load * speed})
        for law, columns in enumerate(laws):
            shape = {"load": Quantity(float(number), "1"), "law": Quantity(float(law), "1")}
            yield axis_forces.direct(comparison, response, columns, shape)


_BY = ("position", "position and its square", "load", "speed")


def _varying_stiffness_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    what = _BY[int(fitted.variant.shape["law"].value)]
    return Reading(f"The wind-up of the axis per load changes with {what}: {fitted.size_words}.", fitted.size)


def _pitch_error(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    place = axis_forces.centred_place(moving)
    powers = {"position": place, "position²": place**2, "position³": place**3}
    for n in (1, 2, 3):
        columns = dict(list(powers.items())[:n])
        yield axis_forces.direct(comparison, response, columns, {"power": Quantity(float(n), "1")})
    starts = [rows.start for _, rows in comparison.rows_of_runs()]
    for lead in axis_forces.leads(comparison, comparison.channel(response).axis, of_force=False):
        turn = 2.0 * np.pi * moving.position_m / lead
        shape = {"lead_mm": Quantity(1e3 * lead, "mm")}
        once = {"sine of the lead": np.sin(turn), "cosine of the lead": np.cos(turn)}
        twice = {"sine of half the lead": np.sin(2.0 * turn), "cosine of half the lead": np.cos(2.0 * turn)}
        growing = once | {"position": place}
        for harmonics, waves, power in ((1.0, once, 0.0), (2.0, once | twice, 0.0), (1.0, growing, 1.0)):
            of_waves = shape | {"harmonics": Quantity(harmonics, "1"), "power": Quantity(power, "1")}
            yield axis_forces.direct(comparison, response, waves, of_waves)
            if len(starts) > 1:
                # a reading that is set to zero where a run begins lacks the error of that place
                from_start = {what: wave - wave[starts][comparison.run_index] for what, wave in waves.items()}
                yield axis_forces.direct(
                    comparison, response, from_start, of_waves | {"from_start": Quantity(1.0, "1")}
                )


def _pitch_error_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if "lead_mm" not in fitted.variant.shape:
        text = "A position error grows along the way, whatever speed and direction"
        return Reading(f"{text}: {fitted.size_words}.", fitted.size)
    lead, amplitude = fitted.parameter("lead_mm"), axis_forces.waved(fitted)
    factor, unit = displayed(fitted.unit, amplitude.value)
    grows = "grows along the way and " if fitted.parameter("power").value else ""
    text = f"repeats every {lead.value:.4g} mm with an amplitude of {factor * amplitude.value:.3g} {unit}"
    return Reading(
        f"The position error {grows}{text}, whatever the speed: {fitted.size_words}.",
        {"lead_mm": lead, "amplitude": amplitude},
    )


EFFECTS = (
    declared("drive.backlash", _backlash, _backlash_testable, _backlash_reading),
    declared("drive.elasticity", _elasticity, responds, _elasticity_reading),
    declared(
        "drive.varying_stiffness",
        _varying_stiffness,
        lambda comparison, response: (
            axis_forces.place_only(comparison, response) or axis_forces.stays(comparison, response)
        ),
        _varying_stiffness_reading,
    ),
    declared("drive.pitch_error", _pitch_error, axis_forces.place_only, _pitch_error_reading),
)
