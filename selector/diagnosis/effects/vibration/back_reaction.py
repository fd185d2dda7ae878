"""`vibration.back_reaction`: a member acts back on its predecessor."""

from collections.abc import Callable, Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.linear_response import (
    LinearResponse,
    inertia_force,
    linear_responses,
    members,
    reactions,
    transfer,
)
from selector.diagnosis.shapes.residual import Remainder, least_squares
from selector.diagnosis.shapes.signals import no_vibration, of_a_drive, rate, slope, swept_hz
from selector.types import Vector

_WEAK, _HEAVY = 0.01, 30.0  #: Gains of the loop through the successor's inertia that are tried.
_FREE = ((0.0, np.inf),)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    swept = swept_hz(comparison, response)
    if swept is not None:
        yield Variant(slope(comparison, response, swept)[:, None], ("all resonances of the simulated curve shifted",))
        return
    others = members(comparison, response)
    for predecessor in (response, *others):
        for successor in others if predecessor == response else (response, *others):
            if successor == predecessor or predecessor not in comparison.simulated:
                continue
            for path in linear_responses(comparison, predecessor):
                yield from _of_pair(comparison, response, predecessor, successor, path)


def _of_pair(
    comparison: Comparison, response: str, predecessor: str, successor: str, path: LinearResponse
) -> Iterator[Variant]:
    """The successor's inertia on its predecessor, seen by the predecessor or by who follows it."""
    onward = None if response == predecessor else transfer(comparison, predecessor, response)
    if response != predecessor and onward is None:
        return
    place = comparison.channel(predecessor).place
    words = f"inertia of {successor} on {predecessor}"
    if path.source is not None and successor in comparison.simulated:
        reaction, unit = reactions(comparison, path, predecessor, successor)
        if unit <= 0.0:
            return

        known = _known_to_a_fit(comparison, path, predecessor)
        masses = np.geomspace(_WEAK, _HEAVY, 8) / unit
        for is_fitted in (False, True):

            def moved(mass: float, is_fitted: bool = is_fitted) -> Vector:
                first = reaction(mass) / mass
                first = first - known(first) if is_fitted else first
                return first if onward is None else onward.passed(comparison, first)

            best = Remainder(comparison, response).best(moved, masses)
            # what was chosen from what is left pays for it
            tried = {float(masses[0]): 1.0, float(masses[3] if best is None else best): float(len(masses))}
            name = f"{words}, stiffness fitted with it" if is_fitted else words
            for mass, looked_at in tried.items():
                shape, columns = {"loop_gain": Quantity(mass * unit, "1")}, moved(mass)[:, None]
                if np.any(columns):
                    yield Variant(columns, (name,), shape, place, (successor,), bounds=_FREE, looked_at=looked_at)
        return
    force = inertia_force(comparison, successor, "simulated" if successor in comparison.simulated else "recorded")
    if force is None:
        return
    parts = [path.passed(comparison, force)]
    if path.source is None:
        parts.append(rate(comparison, parts[0]) * comparison.period_s)
    if onward is not None:
        parts = [onward.passed(comparison, part) for part in parts]
    if np.any(parts[0]):
        names = (words, "the same, a quarter on")[: len(parts)]
        s = np.log(np.roots(path.denominator).astype(complex)) / comparison.period_s
        shape = {"resonance_hz": Quantity(float(np.abs(s).max() / (2.0 * np.pi)), "Hz")}
        yield Variant(np.column_stack(parts), names, shape, place=place, sources=(successor,))


def _known_to_a_fit(comparison: Comparison, path: LinearResponse, predecessor: str) -> Callable[[Vector], Vector]:
    """What of a course of the predecessor its stiffness and damping took in, if they were fitted to the real machine.

    They were fitted to all responses in the predecessor's unit that follow it, as far as the simulation shows how.
    """
    simulated = comparison.simulated_course(predecessor)
    unit = comparison.channel(predecessor).unit
    ways: list[LinearResponse | None] = [None] if predecessor in comparison.responses else []
    followers = (n for n in comparison.responses if n != predecessor and comparison.channel(n).unit == unit)
    ways += [way for way in (transfer(comparison, predecessor, name) for name in followers) if way is not None]
    changes = np.column_stack([path.passed(comparison, v) for v in (simulated, rate(comparison, simulated))])
    fitted = ~comparison.held_out

    def seen(course: Vector) -> Vector:
        return np.concatenate([(course if way is None else way.passed(comparison, course))[fitted] for way in ways])

    seen_changes = np.column_stack([seen(change) for change in changes.T]) if ways else None

    def known(course: Vector) -> Vector:
        if seen_changes is None:
            return np.zeros(len(course))
        return np.asarray(changes @ least_squares(seen_changes, seen(course)))

    return known


def _testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return None
    reason = no_vibration(comparison, response, roles=("displacement", "acceleration", "velocity", "position"))
    alone = None if members(comparison, response) else "no motion of a second member is recorded"
    return reason or of_a_drive(comparison, response) or alone


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if not fitted.variant.sources:
        elsewhere = f"lie elsewhere than simulated, by up to {fitted.up_to}, as when the next member acts back"
        shift = {"relative_shift": Quantity(float(-fitted.coefficients[0]), "1")}
        return Reading(f"the resonances of {fitted.response} {elsewhere}", fitted.size | shift)
    seen = fitted.variant.names[0].partition(",")[0].rpartition(" on ")[2]
    text = f"{fitted.variant.sources[0]} acts back on {seen}: its inertia moves {fitted.response} by up to"
    text += f" {fitted.up_to}, which the simulated chain passes on in one direction only"
    return Reading(text, fitted.size)


EFFECT = Effect(**words_of("vibration.back_reaction"), variants=_variants, testable=_testable, reading=_reading)
