"""A sensor that freezes: its reading stands while what it measures goes on."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import erf

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import amount, window
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.shapes.input_faults import fault_variants, or_of_input
from selector.diagnosis.shapes.signals import of_a_drive
from selector.diagnosis.shown_units import unit_words
from selector.quality.survey import block_noise
from selector.types import Vector

_LEAST = 6  #: Equal readings below which nothing is a stretch.
#: Probability, over the whole recording, of so many equal readings in a row below which they are no chance.
_SURE = 1e-9
#: Noise over resolution, above which it is noise; a trend that is rounded looks like at most 0.62.
_ABOVE_ROUNDING = 0.75
_MOST = 12
_USUAL = 2
#: Steps of the resolution that the simulation must move while the reading stands, where noise alone proves nothing.
_STEPS = 6.0
_OF_SPAN = 0.05  #: And the part of all its movement.
_AT_REST = 0.5  #: Part of all its movement that the simulation may go on by while an axis rests.
#: Part of the movement of the simulation that a reading has to miss where every run has its silent stretch.
_DEAD = 0.2
_LEAST_DEAD = 40  #: Samples of such a stretch.
_BESIDE = 20  #: Samples on each side of a stretch from which its level is taken.
LEAP = 4.0  #: Usual steps from one reading to the next by which a reading that wakes up differs from where it stood.
_AROUND_ONE = ((0.7, 1.4),)
_MOST_OF_IT = (0.1, 0.9)  #: Quantiles of the simulation in a stretch that it has to move between.
_RESTING = ("velocity", "acceleration")  #: Of what reads 0 at rest.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    simulated = comparison.simulated_course(response)
    for run, first, last in frozen_stretches(comparison, response):
        part = window(comparison, run, first, last)
        reading = float(comparison.recorded[response][first])
        expected = simulated + _level_beside(comparison, response, first, last)
        shape = {"reading": Quantity(reading, comparison.channel(response).unit)}
        words = "reading less what it should be"
        yield part.variant(reading - expected, words, "sensor", shape, bounds=_AROUND_ONE)
    yield from fault_variants(comparison, response, "data.stuck")


def _level_beside(comparison: Comparison, response: str, first: int, last: int) -> float:
    """By how much the simulation is too low just before and after a stretch."""
    rows = dict(comparison.rows_of_runs())[comparison.runs[int(comparison.run_index[first])]]
    beside = np.r_[max(rows.start, first - _BESIDE) : first, last + 1 : min(rows.stop, last + 1 + _BESIDE)]
    left = comparison.difference(response)[beside]
    left = left[np.isfinite(left)]
    return float(np.mean(left)) if len(left) else 0.0


def frozen_stretches(comparison: Comparison, response: str, *, surely: bool = False) -> list[tuple[str, int, int]]:
    """(run, first row, last row) of equal readings that are no chance, longest first.

    `surely`: only where noise that is always there is gone, and the simulation goes on.

    Either noise that is always there is gone, or the simulation goes on by more than the resolution explains. Readings
    that come back to the same end of the range are a limit, not a frozen sensor; a speed near 0 is rest, unless the
    simulation goes most of its range meanwhile; of a channel that stands more than twice a run, dwells are the nature.
    """
    recorded, simulated = comparison.recorded[response], comparison.simulated[response]
    resolution = comparison.resolution.get(response, 0.0)
    still = list(_equal(comparison, recorded))
    if not still:
        return []
    chance = _chance_of_equal(comparison, recorded, resolution, max(still, key=lambda one: one[2] - one[1]))
    dead: list[tuple[str, int, int]] = []
    if chance == 1.0 and of_a_drive(comparison, response) is None:
        dead = _dead_in_runs(comparison, recorded, resolution, still)
    low, high = float(np.nanmin(recorded)), float(np.nanmax(recorded))
    at_ends = [recorded[first] for _, first, _ in still if recorded[first] in (low, high)]
    span = float(np.nanmax(simulated) - np.nanmin(simulated))
    found = []
    for run, first, last in still:
        length = last - first + 1
        part = simulated[first : last + 1]
        moved = mostly = 0.0
        if np.isfinite(part).any():
            # what it does in the last rows alone may be a start that comes a little early
            moved, mostly = float(np.nanmax(part) - np.nanmin(part)), float(np.ptp(np.nanquantile(part, _MOST_OF_IT)))
        rests = comparison.channel(response).role in _RESTING and abs(recorded[first]) < _OF_SPAN * span
        if at_ends.count(recorded[first]) > 1 or (rests and mostly < _AT_REST * span):
            continue
        silent = len(recorded) * chance ** (length - 1) < _SURE
        silent |= (run, first, last) in dead and moved > max(_STEPS * resolution, _DEAD * span)
        if surely and not (silent and moved > max(_STEPS * resolution, _OF_SPAN * span)):
            continue
        least = max(_STEPS * resolution, _OF_SPAN * span, 1e-12 * max(abs(low), abs(high)))
        if silent or moved > least:
            found.append((length, run, first, last, silent or mostly > least))
    if len(found) > _USUAL * len(comparison.runs):
        # a coarse reading dwells by nature
        return []
    found.sort(key=lambda stretch: (-stretch[0], stretch[2]))
    return [stretch[1:4] for stretch in found[:_MOST] if stretch[4]]


def _dead_in_runs(
    comparison: Comparison, recorded: Vector, resolution: float, still: Sequence[tuple[str, int, int]]
) -> list[tuple[str, int, int]]:
    """The longest stretch of every run, where the channel is never silent outside of these, if it is no rest.

    What rests by nature moves on from where it rested; a dead reading stands to the end of the run or leaps.
    """
    longest = [
        max((one for one in still if one[0] == run), key=lambda one: one[2] - one[1])
        for run in dict.fromkeys(run for run, _, _ in still)
    ]
    longest = [one for one in longest if one[2] - one[1] + 1 >= _LEAST_DEAD]
    if not longest:
        return []
    chance = _chance_of_equal(comparison, recorded, resolution, *longest)
    return [
        (run, first, last)
        for run, first, last in longest
        if len(recorded) * chance ** (last - first) < _SURE
        and not leap_after(comparison, recorded, last, resolution) <= LEAP
    ]


def leap_after(comparison: Comparison, values: Vector, last: int, resolution: float) -> float:
    """From where values stood to the first one after row `last`, in usual steps of what follows; NaN at a run's end."""
    rows = dict(comparison.rows_of_runs())[comparison.runs[int(comparison.run_index[last])]]
    after = values[last + 1 : rows.stop]
    after = after[np.isfinite(after)]
    if len(after) == 0:
        return float("nan")
    usual = float(np.nanmedian(np.abs(np.diff(after)))) if len(after) > 1 else 0.0
    return float(abs(after[0] - values[last])) / max(usual, resolution, 1e-300)


def _chance_of_equal(
    comparison: Comparison, recorded: Vector, resolution: float, *longest: tuple[str, int, int]
) -> float:
    """Largest probability of a reading to equal the one before it; 1 where the channel is quiet now and then.

    From the noise of the quietest fifth of all blocks of samples, the longest stretches aside.
    """
    index = np.arange(len(recorded))
    aside = np.any([(index >= first) & (index <= last) for _, first, last in longest], axis=0)
    parts = [recorded[rows][np.isfinite(recorded[rows]) & ~aside[rows]] for _, rows in comparison.rows_of_runs()]
    blocks = np.concatenate([block_noise(part) for part in parts])
    quiet = float(np.quantile(blocks, 0.2)) if len(blocks) else 0.0
    if quiet <= max(_ABOVE_ROUNDING * resolution, 1e-9 * float(np.nanmax(np.abs(recorded)))):
        return 1.0
    return max(1e-3, float(erf(resolution / (2.0 * np.sqrt(2.0) * quiet))))


def _equal(comparison: Comparison, recorded: Vector) -> Iterator[tuple[str, int, int]]:
    """Stretches of equal readings within a run; missing samples do not end one."""
    for run, rows in comparison.rows_of_runs():
        seen = rows.start + np.flatnonzero(np.isfinite(recorded[rows]))
        if len(seen) < _LEAST:
            continue
        cuts = np.flatnonzero(np.diff(recorded[seen]) != 0.0) + 1
        for part in np.split(seen, cuts):
            if len(part) >= _LEAST:
                yield run, int(part[0]), int(part[-1])


def _testable(comparison: Comparison, response: str) -> str | None:
    if frozen_stretches(comparison, response) or any(fault_variants(comparison, response, "data.stuck")):
        return None
    return "its reading stands nowhere longer than it should"


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    shape = fitted.variant.shape
    return Reading(
        f"{fitted.response} stands at {shape['reading'].value:.6g} {unit_words(shape['reading'].unit)} in "
        f"{fitted.variant.regime} while it should go on; it is off by up to {amount(fitted.largest, fitted.unit)}.",
        {name: shape[name] for name in ("from_s", "to_s", "reading")},
    )


EFFECTS = (declared("data.stuck", _variants, _testable, or_of_input(_reading)),)
