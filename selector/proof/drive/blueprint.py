"""How is a drive scenario put together: a change of the true axis by size, its bench, what hides it, what is right."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.proof.case import Scenario, TrueEffect
from selector.proof.drive.machine import Bench, bench
from selector.proof.drive.recorded import Disturbance, axis_world
from selector.proof.drive.true_axis import TrueAxis
from selector.proof.world import Plan, World, scenario, twin

Vector = NDArray[np.float64]
Change = Callable[[TrueAxis, float], TrueAxis]


@dataclass(frozen=True)
class Drive:
    """A drive scenario.

    Attributes
    ----------
    plan : Plan
    id : str
        Of the effect; empty = none.
    change : callable (axis, size) -> axis
        The true axis with the effect; called with size > 0 only.
    bench : mapping
        Arguments of `selector.proof.drive.machine.bench`.
    axis : mapping
        Parameters of the axis that are set whatever was drawn.
    world : mapping
        Arguments of `selector.proof.drive.recorded.axis_world`.
    accept, channels, place
        Of the true effect; the id alone is right unless told.
    rival : (change, first size) or None
        Another effect that this record does not tell from it.
    prepared : callable (bench, generator) -> mapping, or None
        Further arguments of `axis_world` that depend on the machine; `true` among them replaces `change`. Of several
        effects ``"lacking"`` has the arguments that are otherwise where the first one is lacking, the second one, …
    """

    plan: Plan
    id: str
    change: Change | None = None
    bench: Mapping[str, Any] = field(default_factory=dict)
    axis: Mapping[str, float] = field(default_factory=dict)
    world: Mapping[str, Any] = field(default_factory=dict)
    accept: tuple[str, ...] = ()
    channels: tuple[str, ...] = ("E", "I")
    place: str | None = None
    rival: tuple[Change, float] | None = None
    prepared: Callable[[Bench, np.random.Generator], Mapping[str, Any]] | None = None

    def made(self, generator: np.random.Generator) -> World:
        """The world of this scenario with what the generator draws."""
        drawn = bench(generator, **self.bench)
        start = drawn.axis._replace(**self.axis)
        change = self.change
        arguments: dict[str, Any] = {
            "true": lambda size: change(start, size) if change is not None and size else start,
            "effects": self.shown,
        }
        arguments |= self.world
        if self.prepared is not None:
            arguments |= self.prepared(Bench(**{**vars(drawn), "axis": start}), generator)
        if self.rival is not None:
            other, first = self.rival
            theirs = {"true": lambda size: other(start, size) if size else start, "first": first}
            arguments["rival"] = axis_world(drawn, **(arguments | theirs))
        lacking = arguments.pop("lacking", ())
        world = axis_world(drawn, **arguments)
        return replace(world, lacking=tuple(axis_world(drawn, **(arguments | other)) for other in lacking))

    def shown(self, size: float) -> tuple[TrueEffect, ...]:
        """The true effect, acting always."""
        if not self.id:
            return ()
        return (TrueEffect(self.id, self.accept or (self.id,), self.channels, self.place),)

    @property
    def scenario(self) -> Scenario:
        """Cases of any strength."""
        return scenario(self.plan, self.made, has_strength=bool(self.id) and not self.plan.size)

    @property
    def twin(self) -> Scenario:
        """The same with the effect off."""
        return twin(self.plan, self.made)


def plan(name: str, hidden: Sequence[str] = ("small",), **rest: Any) -> Plan:
    """A plan of the drive family in which one effect is missing, unless told otherwise."""
    return Plan(name, **{"family": "drive", "kind": "single", "hidden": tuple(hidden)} | rest)


def plus(name: str, factor: float = 1.0) -> Change:
    """The change that adds `factor` × size to a parameter of the axis."""
    return lambda axis, size: axis._replace(**{name: getattr(axis, name) + factor * size})


__all__ = ["Disturbance", "Drive", "plan", "plus"]
