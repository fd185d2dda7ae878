"""Names of what a parameter of the simulation that is a few per cent off does as well."""

from dataclasses import replace

import numpy as np

from selector.diagnosis.answer import NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.naming import HALF
from selector.diagnosis.evidence.search import Search
from selector.diagnosis.matching.runs import rms
from selector.diagnosis.shapes.axis import FORCE_ROLES, simulated_forces
from selector.diagnosis.shapes.force_response import passed

#: What parameters of a simulation of heat that are a few per cent off look like, and the part of the movement below
#: which it is no surer than they are likely: on 16 machines with values 2 and 5 % off it was 2 to 20 %.
_OF_HEAT = ("thermal.memory", "thermal.convection", "thermal.interaction", "thermal.speed_heating")
_OF_MOVEMENT = 0.25
_OF_FORCE = 0.05  #: Of the force that the simulation has of the same kind.


def or_parameters(comparison: Comparison, found: Search, effect: NamedEffect) -> NamedEffect:
    """The effect no surer than half where wrong parameters do the same, and told so."""
    if effect.id in _OF_HEAT:
        is_like = _is_little_heat(comparison, found, effect)
    else:
        is_like = _is_little_force(comparison, found, effect)
    if not is_like:
        return effect
    also = ", as parameters of the simulation that are a few per cent off would do, too."
    statement = effect.statement.removesuffix(".") + also
    return replace(effect, statement=statement, confidence=min(effect.confidence, HALF))


def _is_little_heat(comparison: Comparison, found: Search, effect: NamedEffect) -> bool:
    fitted = found.benches[effect.channel].fitted
    moved = float(np.nanstd(comparison.recorded[effect.channel][fitted]))
    return float(np.std(effect.courses[effect.channel][fitted])) < _OF_MOVEMENT * moved


def _is_little_force(comparison: Comparison, found: Search, effect: NamedEffect) -> bool:
    """Whether an inertia or a friction is little beside that of the simulation, in a force that is compared."""
    for name, v in found.named.get(effect.id, {}).items():
        channel = comparison.channel(name)
        if found.benches[name].candidates[v].variant.regime is not None:
            # no parameter is right in some runs
            return False
        own = simulated_forces(comparison, channel.axis).get(effect.id) if channel.role in FORCE_ROLES else None
        if own is not None:
            fitted = found.benches[name].fitted
            given = passed(comparison, name, own)[0]
            return rms(effect.courses[name][fitted]) < _OF_FORCE * rms(given[fitted])
    return False
