"""Dry and viscous friction: by sign of motion, by speed, near standstill, by direction, by place."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive import _forces as axis_forces
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.shapes.axis import FORCE_ROLES
from selector.diagnosis.shapes.force_response import responds

_PRESLIDING_UM = (1.0, 4.0, 15.0, 50.0)
_TURNED_BY = (0.02, 0.06, 0.15)  #: Parts of the top speed at which friction has turned over, where the speed tells.


def _coulomb(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    for presliding_um in _PRESLIDING_UM:
        friction = moving.friction_state(1e-6 * presliding_um)
        shape = {"presliding_um": Quantity(presliding_um, "um")}
        yield from axis_forces.of_forces(comparison, response, {"friction by sign of motion": friction}, shape)
    if comparison.channel(response).role not in FORCE_ROLES:
        return
    top = float(np.abs(moving.velocity_m_per_s).max())
    for part in _TURNED_BY:
        # a current that was filtered, or a speed of coarse samples, turns with the speed and not with the way
        friction = np.tanh(moving.velocity_m_per_s / (part * top))
        yield from axis_forces.of_forces(
            comparison, response, {f"friction by sign of motion, beyond {1e3 * part * top:.2g} mm/s": friction}
        )


def _coulomb_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    shape = {name: fitted.parameter(name) for name in fitted.variant.shape if name == "presliding_um"}
    key, force = axis_forces.force_key(fitted, comparison), fitted.coefficient()
    turned = " against the sense that friction has" if force.value < 0.0 else ""
    text = "At each reversal a force that turns with the sense of motion, whatever the speed, pushes the axis aside"
    if key:
        text = (
            f"Dry friction of {force.words(amount=True)} by sign of motion{turned}, whatever the speed, acts on the "
            "axis and is not in the simulation"
        )
    return Reading(f"{text} ({fitted.size_words}).", ({key: force} if key else fitted.size) | shape)


_EXPONENTS = (1.0, 0.67, 1.5, 2.0)


def _viscous(comparison: Comparison, response: str) -> Iterator[Variant]:
    speed = axis_forces.motion_of(comparison, response).velocity_m_per_s
    top = float(np.abs(speed).max())
    for exponent in _EXPONENTS:
        force = np.sign(speed) * top * (np.abs(speed) / top) ** exponent
        shape = {"exponent": Quantity(exponent, "1")}
        yield from axis_forces.of_forces(comparison, response, {"friction that grows with speed": force}, shape)


def _viscous_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    exponent = fitted.variant.shape["exponent"]
    law = "in proportion to speed" if exponent.value == 1.0 else f"with speed to the power {exponent.value:g}"
    parameters, text = fitted.size, f"A friction that grows {law} and is not in the simulation shifts the axis"
    if axis_forces.is_force(fitted, comparison):
        slope = fitted.coefficient(f"{fitted.unit}*s/m")
        less = f"{slope.words(amount=True)} {'more' if slope.value > 0.0 else 'less'}"
        parameters, text = {"coefficient": slope}, f"Friction that grows {law} is {less} than in the simulation"
    return Reading(f"{text} ({fitted.size_words}).", parameters | {"exponent": exponent})


_N_SPEEDS = 6
_SMALLEST_SHARE, _LARGEST_SHARE = 0.006, 0.12
_FALLS = (1.0, 2.0)


def _stribeck(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    speed = np.abs(moving.velocity_m_per_s)
    friction = moving.friction_state(axis_forces.presliding_m(comparison, response))
    top = float(speed.max())
    for stribeck in np.geomspace(_SMALLEST_SHARE * top, _LARGEST_SHARE * top, _N_SPEEDS):
        for exponent in _FALLS:
            force = friction * np.exp(-((speed / stribeck) ** exponent))
            shape = {"stribeck_speed_m_per_s": Quantity(float(stribeck), "m/s"), "exponent": Quantity(exponent, "1")}
            yield from axis_forces.of_forces(comparison, response, {"friction near standstill": force}, shape)


def _stribeck_testable(comparison: Comparison, response: str) -> str | None:
    lacking = axis_forces.reverses(comparison, response)
    if lacking is not None:
        return lacking
    moving = axis_forces.motion_of(comparison, response)
    speed = np.abs(moving.velocity_m_per_s)
    slow = (speed > moving.rest_speed_m_per_s) & (speed < 0.3 * float(speed.max()))
    return None if int(slow.sum()) >= 10 else "the axis is hardly ever slow without standing"


def _stribeck_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    speed = fitted.parameter("stribeck_speed_m_per_s")
    below = f"below about {1e3 * speed.value:.3g} mm/s"
    key, force = axis_forces.force_key(fitted, comparison), fitted.coefficient()
    text = f"A friction that falls with speed, felt {below}, pushes the axis aside where it starts and turns"
    if key:
        more = f"{force.words(amount=True)} {'more' if force.value > 0.0 else 'less'}"
        text = f"Friction is {more} near standstill than at speed; it has changed {below}"
    parameters = {key: force} if key else fitted.size
    return Reading(f"{text} ({fitted.size_words}).", parameters | {"stribeck_speed_m_per_s": speed})


_ALL = "friction that both directions differ by"
_GROWING = "the same, growing with speed"


def _asymmetric_friction(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    # a constant in both directions and at rest is no friction: only what starts and stops with the motion counts
    moved = np.abs(moving.friction_state(axis_forces.presliding_m(comparison, response)))
    share = moving.velocity_m_per_s / float(np.abs(moving.velocity_m_per_s).max())
    fast = np.abs(share)
    for growth, forces in ((0.0, {_ALL: moved}), (1.0, {_GROWING: fast}), (0.5, {_ALL: moved, _GROWING: fast})):
        yield from axis_forces.of_forces(comparison, response, forces, {"growth": Quantity(growth, "1")})
    for sense, words in ((1.0, "forwards"), (-1.0, "backwards")):
        one_way = np.maximum(sense * share, 0.0) * sense
        shape = {"growth": Quantity(1.0, "1"), "direction": Quantity(sense, "1")}
        yield from axis_forces.of_forces(
            comparison, response, {f"friction growing with speed, {words} only": one_way}, shape
        )


def _asymmetric_friction_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    growing = fitted.variant.shape["growth"].value > 0.0
    one_way = fitted.variant.shape.get("direction")
    how = "" if one_way is None else (" forwards" if one_way.value > 0.0 else " backwards") + " only"
    law = " and grows with speed" if growing else ""
    key = axis_forces.force_key(fitted, comparison)
    if key:
        force = fitted.coefficient()
        at = " at the largest speed" if growing and len(fitted.coefficients) == 1 else ""
        text = f"has another law{how}, by {force.words(amount=True)} at the largest speed"
        if one_way is None:
            differ = Quantity(2.0 * abs(force.value), force.unit)
            text = f"differs by {differ.words()} between the two directions{at or law}"
        return Reading(f"Friction {text}: {fitted.size_words}.", {key: force})
    return Reading(f"Friction differs between the two directions{how}{law}: {fitted.size_words}.", fitted.size)


_WITH = ("position", "position to the second power", "acceleration")


def _varying_damping(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = axis_forces.motion_of(comparison, response)
    speed, place = moving.velocity_m_per_s, axis_forces.centred_place(moving)
    pull = np.abs(moving.acceleration_m_per_s2)
    pull = pull / max(float(pull.max()), 1e-12)
    linear = {"viscous friction times position": speed * place}
    square = {"viscous friction times position²": speed * place**2}
    laws = (linear, linear | square, {"viscous friction times acceleration": speed * pull})
    for number, forces in enumerate(laws):
        yield from axis_forces.of_forces(comparison, response, forces, {"law": Quantity(float(number), "1")})


def _varying_damping_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    what = _WITH[int(fitted.variant.shape["law"].value)]
    parameters, text = fitted.size, f"A friction per speed that changes with {what} shifts the axis"
    if axis_forces.is_force(fitted, comparison):
        parameters = {"change": fitted.coefficient(f"{fitted.unit}*s/m")}
        where = "from the middle of the way to its end" if "position" in what else "up to the largest acceleration"
        text = f"Friction per speed changes with {what}, by {parameters['change'].words()} {where}"
    return Reading(f"{text} ({fitted.size_words}).", parameters)


EFFECTS = (
    declared("drive.coulomb", _coulomb, axis_forces.reverses, _coulomb_reading),
    declared("drive.viscous", _viscous, responds, _viscous_reading, absorbs=True),
    declared("drive.stribeck", _stribeck, _stribeck_testable, _stribeck_reading),
    declared("drive.asymmetric_friction", _asymmetric_friction, axis_forces.reverses, _asymmetric_friction_reading),
    declared(
        "drive.varying_damping",
        _varying_damping,
        lambda comparison, response: responds(comparison, response) or axis_forces.stays(comparison, response),
        _varying_damping_reading,
    ),
)
