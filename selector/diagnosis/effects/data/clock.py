"""A recorded channel whose time base is shifted, jumps, or runs at another rate."""

from collections.abc import Iterator, Sequence

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import Part, everywhere, later_parts, single_runs, whole_runs
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared, equally_likely
from selector.diagnosis.matching.usable import rms
from selector.diagnosis.shapes.input_faults import input_faults
from selector.diagnosis.shapes.signals import by_run, excited, rate
from selector.number_text import span_text
from selector.types import Vector

#: Shifts, in times that the course takes to change, for which its derivative no longer says what a shift does.
_SIZES = (0.1, 0.2, 0.4, 0.75, 1.3, 2.0, 2.8)
_FEW_SIZES = (0.15, 0.5)
_FINE_SIZES = (0.1, 0.15, 0.22, 0.33, 0.5, 0.75, 1.1, 1.6)
_JUMPS, _ALL_JUMPS = 10, 30
_MANY_RUNS = 4
_OF_RUN = 0.3  #: Of the longest run: shifts by more leave too little to compare.
_ZONES = 14
_AROUND_ONE = ((0.6, 1.6),)
_LEAPS = 0.1  #: Of a shift by one sample, that the derivative does not say.
_LATE, _RATE = "derivative, late positive", "time × derivative"


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    course = comparison.simulated_course(response)
    slope = rate(comparison, course)
    yield from equally_likely(
        _shifted(comparison, response, course, slope),
        _jumped(comparison, course, slope),
        _of_another_rate(comparison, course, slope),
    )


def _shifted(comparison: Comparison, response: str, course: Vector, slope: Vector) -> Iterator[Variant]:
    """Late or early in all runs, or in whole runs, by little or by much."""
    parts = list(whole_runs(comparison, lambda rows: _lateness(comparison, response, slope, rows)))
    whole = everywhere(comparison)
    sizes = _FEW_SIZES if len(comparison.runs) > _MANY_RUNS else _SIZES
    yield from equally_likely(
        (_variant(part, -slope, _LATE) for part in (whole, *parts)),
        _by_sizes(comparison, course, slope, parts, sizes),
        _by_samples(comparison, course, slope, parts) if len(comparison.runs) <= _MANY_RUNS else (),
        _by_hours(comparison, course, whole),
        # recalibration takes a delay by few samples only; a thermometer's clock may be off by more
        _by_sizes(comparison, course, slope, [whole], sizes)
        if comparison.channel(response).role == "temperature"
        else (),
    )


def _by_hours(comparison: Comparison, course: Vector, whole: Part) -> Iterator[Variant]:
    """Another time zone, or summer time, in one of the two clocks; a delay by hours is no recalibration."""
    for shift_s in (3600.0 * sign * hours for hours in range(1, _ZONES + 1) for sign in (1, -1)):
        if abs(shift_s) < _OF_RUN * comparison.longest_s:
            yield from _shifted_by(comparison, course, shift_s, [whole])


def _by_samples(comparison: Comparison, course: Vector, slope: Vector, parts: Sequence[Part]) -> Iterator[Variant]:
    """Late or early by one sample or two: of a course that leaps the derivative does not say what that does."""
    by_s = comparison.period_s
    if rms(_late(comparison, course, by_s) - course + by_s * slope) > _LEAPS * by_s * rms(slope):
        for shift_s in (by_s, -by_s, 2.0 * by_s, -2.0 * by_s):
            yield from _shifted_by(comparison, course, shift_s, parts)


def _jumped(comparison: Comparison, course: Vector, slope: Vector) -> Iterator[Variant]:
    """Late or early from a moment of a run on; where the stamps themselves leap, by as much."""
    parts = list(later_parts(comparison, _JUMPS, _ALL_JUMPS, (0.06, 0.9)))
    leaps = []
    for fault in input_faults(comparison):
        if fault.id == "data.clock":
            part = Part(fault.course != 0.0, fault.run, f"run {fault.run}", fault.from_s, fault.to_s)
            leaps += _shifted_by(comparison, course, float(np.abs(fault.course).max()), [part], "leap of the stamps")
    sizes = () if len(comparison.runs) > _MANY_RUNS else _FEW_SIZES
    yield from equally_likely(
        (_variant(part, -slope, _LATE) for part in parts), _by_sizes(comparison, course, slope, parts, sizes), leaps
    )


def _by_sizes(
    comparison: Comparison, course: Vector, slope: Vector, parts: Sequence[Part], sizes: tuple[float, ...]
) -> Iterator[Variant]:
    for shift_s in _tried(comparison, course, slope, sizes):
        yield from _shifted_by(comparison, course, shift_s, parts)


def _shifted_by(
    comparison: Comparison, course: Vector, shift_s: float, parts: Sequence[Part], words: str = ""
) -> list[Variant]:
    change, words = _late(comparison, course, shift_s) - course, words or f"late by {span_text(shift_s)}"
    return [_variant(part, change, words, "shift_s", Quantity(shift_s, "s")) for part in parts]


def _of_another_rate(comparison: Comparison, course: Vector, slope: Vector) -> Iterator[Variant]:
    """Right at the start of a run and off by more and more."""
    parts = [everywhere(comparison), *single_runs(comparison)]
    few = _FEW_SIZES if len(comparison.runs) > _MANY_RUNS else _SIZES
    large = []
    for part in parts:
        for shift_s in _tried(comparison, course, slope, _FINE_SIZES if part.run is None else few):
            error = shift_s / comparison.longest_s
            change = _late(comparison, course, error * comparison.time_s) - course
            words = f"late by {100 * error:.2f} % of the time"
            large.append(_variant(part, change, words, "rate_error", Quantity(error, "1")))
    yield from equally_likely((_variant(part, -comparison.time_s * slope, _RATE) for part in parts), large)


def _tried(comparison: Comparison, course: Vector, slope: Vector, sizes: tuple[float, ...]) -> list[float]:
    """Shifts to be tried [s], both ways; none within what the derivative says, or beyond three tenths of a run."""
    moving_s = float(np.std(course) / max(rms(slope), 1e-300))
    amounts = [size * moving_s for size in sizes]
    kept = [shift_s for shift_s in amounts if 2.0 * comparison.period_s < shift_s < _OF_RUN * comparison.longest_s]
    return [sign * shift_s for shift_s in kept for sign in (1.0, -1.0)]


def _variant(part: Part, values: Vector, name: str, key: str = "", by: Quantity | None = None) -> Variant:
    shape, bounds = ({}, None) if by is None else ({key: by}, _AROUND_ONE)
    return part.variant(values, name, "time base", shape, bounds=bounds)


def _late(comparison: Comparison, course: Vector, by_s: float | Vector) -> Vector:
    """The course as a clock shows it that is late by so much; before its start and after its end it stands."""
    return by_run(comparison, np.interp, comparison.time_s - by_s, comparison.time_s, course)


def _lateness(comparison: Comparison, response: str, slope: Vector, rows: slice) -> float:
    """By how much a run seems late by itself [s]."""
    left = comparison.difference(response)[rows]
    seen = np.isfinite(left)
    y, x = left[seen] - np.mean(left[seen]), -slope[rows][seen] + np.mean(slope[rows][seen])
    return float(x @ y / max(float(x @ x), 1e-300)) if len(y) else 0.0


def _testable(comparison: Comparison, response: str) -> str | None:
    moves = excited(rate(comparison, comparison.simulated_course(response)))
    return None if moves else "the simulated course does not move, so that a shift of time would not show"


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    variant, channel = fitted.variant, fitted.response
    if variant.names == (_RATE,) or "rate_error" in variant.shape:
        off = fitted.coefficient("1", factor=_tried_value(variant, "rate_error"))
        gap_s = off.value * comparison.longest_s
        return Reading(
            f"The clock of {channel} runs {100 * abs(off.value):.3f} % too {'slow' if off.value < 0 else 'fast'}"
            f"{fitted.where}: {span_text(abs(gap_s))} at the end of the longest run.",
            {"rate_error": off},
        )
    late = fitted.coefficient("s", factor=_tried_value(variant, "shift_s"))
    return Reading(
        f"{channel} is recorded {span_text(abs(late.value))} too {'late' if late.value > 0 else 'early'}"
        f"{fitted.where}.",
        {"shift_s": late} | {name: variant.shape[name] for name in ("from_s",) if name in variant.shape},
    )


def _tried_value(variant: Variant, name: str) -> float:
    """The shift that a column stands for; 1 of a derivative, whose coefficient is the shift."""
    return variant.shape[name].value if name in variant.shape else 1.0


EFFECTS = (declared("data.clock", _variants, _testable, _reading),)
