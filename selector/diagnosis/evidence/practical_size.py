"""What is large enough to be called left out, and below what nothing can be said: the noise floor."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from selector.diagnosis.answer import NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.naming import named_effect
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.evidence.search import Search, numbers, unseen_rms
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.matching.repeats import pure_error, rms
from selector.diagnosis.shapes.force_response import PLACE_ROLES
from selector.findings import Finding, Where

_MOST = 0.4
_LITTLE = 0.015
"""Of the movement of what is recorded: a mismatch that is practically none, however significant it is."""
_LISTED = 0.01
_SEEN_ONLY = 0.5
"""Confidence of what is only seen, too, at most."""
_AS_REPEATED = 1.2
"""Times the pure error of repeats: a simulation that leaves no more is as good as a recording of the machine itself."""


def of_practical_size(comparison: Comparison, found: Search) -> tuple[Search, tuple[NamedEffect, ...]]:
    """The search with names that matter alone, and those that are only seen, too.

    Where what is left is not noise alone, everything is significant. If all names together explain less than two fifths
    of what is above the noise, or a mismatch that does not matter, the mismatch is something else. A frozen reading is
    proved by its equal readings. What explains less than a hundredth is not told of.
    """
    doubted = {
        id_
        for id_, of in found.named.items()
        if id_ != "data.stuck"
        and all(found.misfit[name] > 1.0 for name in of)
        and (max(_explained(comparison, found)) < _MOST or all(_is_trifle(comparison, found, name) for name in of))
    }
    also = {id_: of for id_, of in {**found.named, **found.small}.items() if id_ in doubted or id_ not in found.named}
    rest = replace(found, named={id_: of for id_, of in found.named.items() if id_ not in doubted})
    return rest, seen_only(_beside(comparison, found, id_, of) for id_, of in also.items())


def seen_only(effects: Iterable[NamedEffect]) -> tuple[NamedEffect, ...]:
    """Effects that are seen, too, without being called missing; without those that are too little to be told of."""
    return tuple(
        replace(effect, suspected=True, confidence=min(_SEEN_ONLY, effect.confidence), is_fitted=False)
        for effect in effects
        if effect.share >= _LISTED
    )


def _beside(comparison: Comparison, found: Search, id_: str, of: Mapping[str, int]) -> NamedEffect:
    """An effect as it stands beside the named ones."""
    beside = replace(
        found,
        named={**found.named, id_: dict(of)},
        rivals={id_: (), **found.rivals},
        weights={id_: {id_: _SEEN_ONLY}, **found.weights},
    )
    return named_effect(comparison, beside, id_)


def is_small(comparison: Comparison, found: Search, response: str) -> bool:
    """Whether what recalibration leaves of a response is no noise, and too little to matter.

    That is what repeats of a programme differ by as well, unseen rows too, or a trifle of what was recorded; of a
    position in a control loop no share of its way says what matters.
    """
    repeated = pure_error(comparison, response)
    unseen = unseen_rms(found.benches[response], [])
    if repeated is not None and max(_left_alone(found, response), unseen) < _AS_REPEATED * repeated:
        return True
    return _is_trifle(comparison, found, response)


def _is_trifle(comparison: Comparison, found: Search, response: str) -> bool:
    if found.misfit[response] == 1.0 or comparison.channel(response).role in PLACE_ROLES:
        return False
    return _of_movement(comparison, found, response) < _LITTLE


def told_of_small(comparison: Comparison, found: Search) -> tuple[Finding, ...]:
    """A finding for every response in which more is left than noise, but too little to matter."""
    return tuple(
        FINDINGS.finding(
            "small-misfit",
            f"What the simulation leaves of {name} is no noise, but only {share:.2g} of its movement (rms), or no more "
            "than repeats of a programme differ by: too little to be called missing physics.",
            Where(channel=name),
            {"share_of_movement": share, "times_noise": found.misfit[name]},
        )
        for name in found.benches
        if is_small(comparison, found, name)
        for share in [_of_movement(comparison, found, name)]
    )


def _of_movement(comparison: Comparison, found: Search, response: str) -> float:
    whole = float(np.nanstd(comparison.recorded[response][found.benches[response].fitted]))
    return _left_alone(found, response) / whole if whole > 0.0 else np.inf


def _left_alone(found: Search, response: str) -> float:
    bench = found.benches[response]
    return rms(bench.residual([])[bench.fitted])


def _explained(comparison: Comparison, found: Search) -> Iterator[float]:
    """Share of the mean square above the noise that the named effects explain, of every response that has one."""
    for name, bench in found.benches.items():
        named = numbers(found.named, name)
        if not named:
            continue
        alone, left = bench.mean_square([]), bench.mean_square(named)
        above = alone - noise_floor(comparison, bench, named, is_noise=found.misfit[name] == 1.0) ** 2
        yield (alone - left) / above if above > 0.0 else 1.0


def noise_floor(comparison: Comparison, bench: Bench, named: Sequence[int], *, is_noise: bool) -> float:
    """Standard deviation of the noise of a response [unit]: from repeats, else from what is left.

    What is left counts as noise only where it `is_noise`; otherwise its third differences from sample to sample do,
    which slow structure hardly has. It is never above what is left, and never below the rounding.
    """
    left = bench.residual(named)
    n, p = int(np.sum(bench.fitted)), bench.raw_base(named).shape[1]
    floor = rms(left[bench.fitted]) * float(np.sqrt(n / max(n - p, 1)))
    repeated = pure_error(comparison, bench.response)
    if repeated is not None:
        floor = min(floor, repeated)
    elif not is_noise:
        floor = float(np.nanmin([floor, bench.quick(left)]))
    return max(floor, bench.rounding)
