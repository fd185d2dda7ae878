"""A source of heat that is not in the simulation: feed drives, hydraulics, tank, motor."""

from collections.abc import Iterator

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, Variant, words_of
from selector.diagnosis.effects.thermal._wording import delay_of, late, told, with_place
from selector.diagnosis.shapes.heating import heats, lacking, rise_parts, says_other_source, sources
from selector.diagnosis.shapes.signals import excited, time_constants
from selector.types import Vector

_FREE_SHARE = 0.03
_FREE_SHARE_IF_SAID = 0.015
_OWN_SHARE = 0.5
_MOST_CHANNELS = 12


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    taus = time_constants(comparison, 8)
    for name in sources(comparison, response).other_heat[:_MOST_CHANNELS]:
        for words, heat in heats(comparison, name):
            for tau_s in taus:
                yield late(comparison, name, [(words, heat, tau_s)])
            for pair in ((1, 4), (2, 6), (4, 7)):
                yield late(comparison, name, [(words, heat, taus[k]) for k in pair])
    for name, words, heat in _warm_places(comparison, response):
        for tau_s in (0.0, *taus[1::2]):
            yield late(comparison, name, [(words, heat, tau_s)])
        for slow in taus[2::2]:
            yield late(comparison, name, [(words, heat, 0.0), (words, heat, slow)])


def _warm_places(comparison: Comparison, response: str) -> list[tuple[str, str, Vector]]:
    """Temperatures that the spindle does not account for: whole if hardly, else what it leaves of them."""
    found: list[tuple[float, str, str, Vector]] = []
    for name in sources(comparison, response).machine:
        parts = rise_parts(comparison, response, name)
        free, share = parts.unaccounted, parts.unaccounted_share
        said = says_other_source(comparison.channel(name))
        is_enough = share >= (_FREE_SHARE_IF_SAID if said else _FREE_SHARE)
        if not is_enough or not excited(free, comparison.resolution.get(name, 0.0)):
            continue
        if share > _OWN_SHARE or said:
            found.append((share, name, f"rise of {name}", rise_parts(comparison, response, name).calm))
        if share < 0.95:
            found.append((share, name, f"what spindle and hall leave of {name}", free))
    found.sort(key=lambda one: one[0], reverse=True)
    return [(name, words, heat) for _, name, words, heat in found[:_MOST_CHANNELS]]


def _testable(comparison: Comparison, response: str) -> str | None:
    lack = "no feed, current, power, state or temperature was recorded that shows a source other than the spindle"
    short = lacking(comparison, response)
    return short or (None if sources(comparison, response).other_heat or _warm_places(comparison, response) else lack)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    text = (
        f"{fitted.response} follows {with_place(comparison, name)}, a source of heat that the simulation does not have,"
    )
    return told(fitted, f"{text} {delay_of(fitted)}")


EFFECT = Effect(**words_of("thermal.second_source"), variants=_variants, testable=_testable, reading=_reading)
