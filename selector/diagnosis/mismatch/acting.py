"""Where and when what an answer tells acts."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from selector.diagnosis.answer import NamedEffect, Place
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.mismatch.location import active_windows
from selector.diagnosis.mismatch.omnibus import Structure
from selector.diagnosis.mismatch.switching import Switched
from selector.types import Vector


def places(
    comparison: Comparison,
    named: Sequence[NamedEffect],
    structures: Sequence[Structure],
    switches: Mapping[str, Switched],
    residuals: Mapping[str, Vector],
) -> tuple[Place, ...]:
    """Windows in which the named effects act, or in which what nothing explains is large.

    `switches` and `residuals` (n_rows,) are by response: what nobody recorded does there, and what is left.
    """
    found: list[Place] = []
    for effect in named:
        if effect.acts is not None:
            run, first, last = effect.acts
            rows = comparison.time_s[comparison.run_index == comparison.runs.index(run)]
            window = float(rows[0] if first is None else first), float(rows[-1] if last is None else last)
            found += [Place(name, effect.place, run, *window, None, effect.share) for name in effect.channels]
            continue
        for channel in effect.channels:
            windows = active_windows(comparison, channel, effect.courses[channel])
            found += [replace(place, place=effect.place, share=place.share * effect.share) for place in windows]
    if not named and structures:
        surest = structures[0]
        regime = surest.regime or surest.band_words
        for channel in switches or [surest.channel]:
            acts = switches[channel].course if switches else residuals[channel]
            windows = active_windows(comparison, channel, acts)
            found += [replace(place, regime=place.regime or regime, p_value=surest.p_value) for place in windows]
    return tuple(found)
