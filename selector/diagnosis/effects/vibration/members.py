"""Members of a chain: one that acts back on its predecessor, a resonance that the simulation lacks."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import minimize

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import LARGEST, Fitted, Quantity, Reading, ShapeParameter, Variant, declared
from selector.diagnosis.shapes.linear_response import (
    LinearResponse,
    inertia_force,
    inputs,
    linear_responses,
    members,
    reactions,
    resonances_of,
    resonator,
    transfer,
)
from selector.diagnosis.shapes.residual import Remainder, least_squares, unexplained
from selector.diagnosis.shapes.signals import (
    course,
    even_runs,
    no_vibration,
    of_a_drive,
    rate,
    resonance,
    slope,
    swept_hz,
)
from selector.diagnosis.shapes.spectral_lines import resonances
from selector.types import Matrix, Vector

_WEAK, _HEAVY = 0.01, 30.0  #: Gains of the loop through the successor's inertia that are tried.
_FREE = ((0.0, np.inf),)


def _back_reaction(comparison: Comparison, response: str) -> Iterator[Variant]:
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


def _back_reaction_testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return None
    reason = no_vibration(comparison, response, roles=("displacement", "acceleration", "velocity", "position"))
    alone = None if members(comparison, response) else "no motion of a second member is recorded"
    return reason or of_a_drive(comparison, response) or alone


def _back_reaction_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if not fitted.variant.sources:
        elsewhere = f"lie elsewhere than simulated, by up to {fitted.up_to}, as when the next member acts back"
        shift = {"relative_shift": Quantity(float(-fitted.coefficients[0]), "1")}
        return Reading(f"the resonances of {fitted.response} {elsewhere}", fitted.size | shift)
    seen = fitted.variant.names[0].partition(",")[0].rpartition(" on ")[2]
    text = f"{fitted.variant.sources[0]} acts back on {seen}: its inertia moves {fitted.response} by up to"
    text += f" {fitted.up_to}, which the simulated chain passes on in one direction only"
    return Reading(text, fitted.size)


_MOST_SOURCES = 3
#: Natural logarithm of the range of frequencies that a record shows, and the lowest damping that it tells.
_OCTAVES, _NARROWEST = 5.0, 0.005
#: What a mode pays at a resonance that the simulation has: there a structure rings by itself at every knock.
_RINGS = 25.0
_LEAST_DAMPING, _MOST_DAMPING, _NO_RESONANCE = 0.001, 0.5, 2.0
#: Of resonances by least squares: logarithms that one is told to and may move by, and that two starts are apart; the
#: most starts, and the most shapes tried from each.
_NEAR, _FAR, _APART = 1e-3, 0.3, 0.05
_MOST_STARTS, _MOST_TRIED = 4, 60
#: Samples that tell the start of a run; of the spread, by what they differ of a source that is held, and are from 0.
_FIRST, _STILL, _AWAY = 5, 0.1, 0.5
_NEIGHBOURS = ((1.0, 1.0), (0.985, 1.0), (1.015, 1.0), (1.0, 0.5), (1.0, 2.0))


def _mode(comparison: Comparison, response: str) -> Iterator[Variant]:
    swept = swept_hz(comparison, response)
    if swept is not None:
        yield from _of_a_curve(comparison, response, swept)
        return
    left = np.where(comparison.held_out, 0.0, unexplained(comparison, response))
    sources = {name: course(comparison, name) for name in inputs(comparison, response)[:_MOST_SOURCES]}
    simulated = comparison.simulated_course(response)
    if not sources:
        sources = {f"simulated {response}": simulated}
    accelerations = comparison.channel(response).role == "acceleration"
    own = resonances_of(comparison, response)
    for name, source in sources.items():
        for settled in (False, True) if _is_held(comparison, source) else (False,):
            made = partial(_variant, comparison, name, source, settled=settled)
            for frequency_hz, damping in _resonances(comparison, left, simulated, source, made):
                # a frequency of many, as likely in one octave as in another, told to the width of the resonance
                looked_at = _OCTAVES / max(damping, _NARROWEST) * len(sources)
                looked_at *= _RINGS if any(abs(frequency_hz - f0) < 2.0 * z0 * f0 for f0, z0 in own) else 1.0
                for times_f, times_z in _NEIGHBOURS:
                    if damping * times_z <= _MOST_DAMPING:
                        shape = made(frequency_hz * times_f, damping * times_z, acceleration=accelerations)
                        yield replace(shape, looked_at=looked_at)


def _is_held(comparison: Comparison, source: Vector) -> bool:
    """Whether a run begins with the source held away from 0, so that the machine may have come to rest with it."""
    spread = float(np.std(source))
    first = (source[rows][:_FIRST] for _, rows in comparison.rows_of_runs() if rows.stop > rows.start)
    return any(np.ptp(part) < _STILL * spread and abs(np.mean(part)) > _AWAY * spread for part in first)


def _resonances(
    comparison: Comparison, left: Vector, simulated: Vector, source: Vector, made: Callable[..., Variant]
) -> list[tuple[float, float]]:
    """(frequency [Hz], damping) of what the scans see, and of what is least squares near each."""
    seen = resonances(comparison, left, source, simulated)
    starts: list[tuple[float, float]] = []
    for one in (*resonances(comparison, left, source, simulated, behind_filter=False), *seen):
        if all(_is_apart(one, other, _APART) for other in starts) and len(starts) < _MOST_STARTS:
            starts.append(one)
    beside = np.column_stack([np.ones(len(left)), simulated, rate(comparison, simulated)])
    told = [_of_least_squares(left, beside, made, one) for one in starts]
    # what is damped more is no resonance, but follows late
    late = [one for one in told if one[1] > _MOST_DAMPING]
    return [one for one in (*seen, *told) if all(_is_apart(one, other, _FAR) for other in late)]


def _is_apart(one: tuple[float, float], other: tuple[float, float], logarithms: float) -> bool:
    """Whether the frequencies of two resonances differ by more."""
    return abs(np.log(one[0] / other[0])) > logarithms


def _of_least_squares(
    left: Vector, beside: Matrix, made: Callable[..., Variant], start: tuple[float, float]
) -> tuple[float, float]:
    """Frequency [Hz] and damping that leave the least beside what recalibration may change, from a `start`."""
    rows = left != 0.0

    def misfit(shape: Vector) -> float:
        frequency_hz, damping = np.exp(shape).tolist()
        if abs(np.log(frequency_hz / start[0])) > _FAR or not _LEAST_DAMPING <= damping <= _NO_RESONANCE:
            return np.inf
        columns = np.column_stack([made(frequency_hz, damping, acceleration=False).columns, beside])[rows]
        return float(np.sum((left[rows] - columns @ least_squares(columns, left[rows])) ** 2))

    first = np.log(start)
    simplex = first + np.array([[0.0, 0.0], [start[1], 0.0], [0.0, np.log(0.5)]])
    found = minimize(
        misfit,
        first,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": _NEAR, "fatol": np.inf, "maxfev": _MOST_TRIED},
    )
    return float(np.exp(found.x[0])), float(np.exp(found.x[1]))


def _variant(
    comparison: Comparison,
    name: str,
    source: Vector,
    frequency_hz: float,
    damping: float,
    *,
    acceleration: bool,
    settled: bool,
) -> Variant:
    b, a = resonator(frequency_hz, damping, comparison.period_s)
    ways = (LinearResponse(name, b[k], a, 1.0) for k in ((2, 1) if acceleration else (0, 1)))
    words = f"{name} through a resonance at {frequency_hz:.4g} Hz"
    return Variant(
        np.column_stack([way.passed(comparison, source, settled=settled) for way in ways]),
        (words, "its speed"),
        {"frequency_hz": Quantity(frequency_hz, "Hz"), "damping": Quantity(damping, "1")},
        sources=(name,) if name in comparison.recorded else (),
    )


def _of_a_curve(comparison: Comparison, response: str, swept: Vector) -> Iterator[Variant]:
    low, high = float(np.min(swept[swept > 0.0])), float(np.max(swept))
    steps = max(len(np.unique(np.round(swept, 6))), 2)
    for f0 in np.geomspace(low, high, min(steps, 20)):
        for damping in (0.01, 0.03, 0.1):
            columns = resonance(swept, f0, damping)
            names = (f"resonance at {f0:.4g} Hz, in phase", "the same, a quarter behind")
            yield Variant(columns, names, {"frequency_hz": Quantity(f0, "Hz"), "damping": Quantity(damping, "1")})


def _mode_testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return None
    short = (
        None if any(len(run.clock_s) > 64 for run in even_runs(comparison)) else "every run is shorter than 64 samples"
    )
    return no_vibration(comparison, response) or of_a_drive(comparison, response) or short


def _mode_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    f0, damping = fitted.parameter("frequency_hz"), fitted.variant.shape["damping"]
    name = fitted.variant.sources[0] if fitted.variant.sources else "what drives the simulation"
    text = (
        f"a resonance at {f0.value:.4g} Hz (damping ratio {damping.value:.2g}) that the simulation lacks answers to "
        f"{name}; it moves {fitted.response} by up to {fitted.up_to}"
    )
    return Reading(text, {"frequency_hz": f0, "damping": damping} | fitted.size)


EFFECTS = (
    declared("vibration.back_reaction", _back_reaction, _back_reaction_testable, _back_reaction_reading),
    declared(
        "vibration.mode",
        _mode,
        _mode_testable,
        _mode_reading,
        parameters=(
            ShapeParameter("frequency_hz", "Hz", 0.5, 1e5, "natural frequency of the mode"),
            ShapeParameter("damping", "1", _LEAST_DAMPING, _MOST_DAMPING, "damping ratio"),
            LARGEST,
        ),
    ),
)
