"""What would each effect change if the model had it: shapes by finite differences of numbers that are switched off."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant
from selector.diagnosis.open_model.refit_problem import simulated_rows
from selector.diagnosis.open_model.refitting import Refitted, Say
from selector.diagnosis.open_model.runnable import OwnModel
from selector.diagnosis.open_model.switches import Switch, own_effects, switches
from selector.errors import InputError

Vector = NDArray[np.float64]
_SHOWS = 1e-6
"""Share of the difference below which a change is rounding."""


@dataclass(frozen=True, eq=False)
class ThroughModel:
    """Effects as a model shows them.

    Attributes
    ----------
    model : OwnModel
        The refitted one.
    variants : mapping of str to mapping of str to list of Variant
        Response → effect → shapes.
    switch_of : mapping of int to Switch
        `id` of the columns of a shape, which copies of it share → what makes it.
    own : mapping of str to str
        Effects that are parameters which recalibration fits → that parameter.
    """

    model: OwnModel
    variants: Mapping[str, Mapping[str, Sequence[Variant]]]
    switch_of: Mapping[int, Switch]
    own: Mapping[str, str]

    def effects(self, known: Sequence[Effect]) -> tuple[Effect, ...]:
        """The effects to be tested: without those that recalibration fits; those through the model are read from it."""
        return tuple(replace(one, reading=self._reading(one)) for one in known if one.id not in self.own)

    def shapes(self, known: Sequence[Effect], comparison: Comparison) -> dict[str, dict[str, list[Variant]]]:
        """Response → effect → its shapes through the model, and beside them its own where the file has it in part.

        Of friction by direction a file has dry friction, but not viscous friction.
        """
        found = {response: {id_: list(given) for id_, given in of.items()} for response, of in self.variants.items()}
        for response, variants in found.items():
            for effect in known:
                given = [self.switch(one) for one in variants.get(effect.id, ())]
                in_part = any(one is not None and one.is_part for one in given)
                if in_part and effect.testable(comparison, response) is None:
                    variants[effect.id] += effect.variants(comparison, response)
        return found

    def switch(self, variant: Variant) -> Switch | None:
        """What makes this shape; None if it is not of the model."""
        return self.switch_of.get(id(variant.columns))

    def _reading(self, effect: Effect) -> Callable[[Fitted, Comparison], Reading]:
        def reading(fitted: Fitted, comparison: Comparison) -> Reading:
            switch = self.switch(fitted.variant)
            return effect.reading(fitted, comparison) if switch is None else _of_switch(effect, switch, fitted)

        return reading


def through_model(model: OwnModel, fitted: Refitted, *, progress: Say | None = None) -> ThroughModel:
    """Every effect that the model's file can express, at its fitted parameters.

    An effect whose sizes make the simulation run away is left to its own shapes.
    """
    at = model.with_values(fitted.values)
    comparison = fitted.comparison
    responses = comparison.responses
    base = {name: comparison.simulated[name] for name in responses}
    scale = {name: float(np.nanstd(comparison.difference(name))) for name in responses}
    found: dict[str, dict[str, list[Variant]]] = {name: {} for name in responses}
    switch_of: dict[int, Switch] = {}
    known = switches(at)
    for number, switch in enumerate(known):
        if progress is not None:
            progress(number, len(known), f"{switch.id} at {switch.place}")
        try:
            columns = _columns(at, switch, comparison, base)
        except InputError:
            continue
        for name in responses:
            one = columns[name]
            size = np.sqrt(np.nanmean(one**2, axis=0)) * np.array(switch.sizes)
            if not np.isfinite(one).all() or (size <= _SHOWS * scale[name]).any():
                continue
            limits = tuple((0.0, np.inf) for _ in switch.sizes) if switch.is_amount else None
            variant = Variant(one, switch.amounts, switch.shape, switch.place, bounds=limits)
            found[name].setdefault(switch.id, []).append(variant)
            switch_of[id(variant.columns)] = switch
    return ThroughModel(at, found, switch_of, own_effects(model))


def _columns(
    model: OwnModel, switch: Switch, comparison: Comparison, base: Mapping[str, Vector]
) -> dict[str, NDArray[np.float64]]:
    """Response → change with every amount [unit of the response per unit of the amount], shape (n_rows, n_amounts)."""
    moved = []
    for k, size in enumerate(switch.sizes):
        amounts = [size if j == k else 0.0 for j in range(len(switch.sizes))]
        changed = model.with_changes(switch.changes(amounts))
        moved.append((simulated_rows(comparison, changed.simulated({})), size))
    return {
        name: np.nan_to_num(np.column_stack([(courses[name] - base[name]) / size for courses, size in moved]))
        for name in comparison.responses
    }


def _of_switch(effect: Effect, switch: Switch, fitted: Fitted) -> Reading:
    half = 1.96 * fitted.standard_errors
    amounts = {
        key: Quantity(float(value), unit, float(value - error), float(value + error))
        for key, value, error, unit in zip(switch.amounts, fitted.coefficients, half, switch.units, strict=True)
    }
    words = " and ".join(
        f"{key} {one.value:.3g} ({one.low:.3g} to {one.high:.3g}) {'' if one.unit == '1' else one.unit}".rstrip()
        for key, one in amounts.items()
    )
    chosen = ", ".join(f"{key} {one.value:g} {one.unit}" for key, one in switch.shape.items())
    statement = (
        f"{effect.title} at {switch.place} is not in the model: {words}"
        f"{f' ({chosen})' if chosen else ''}; {fitted.rms:.3g} {fitted.unit} rms in {fitted.response}."
    )
    return Reading(statement, {**_keys(switch, amounts), **_with_intervals(switch, fitted)})


def _keys(switch: Switch, amounts: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Amounts under the keys of the file where there is one for each, else under their words."""
    keys = [name.rpartition(".")[2] for name in switch.parameters[: len(amounts)]]
    words = [word.replace(" ", "_").replace(",", "") for word in amounts]
    chosen = keys if len(amounts) == 1 or switch.id == "drive.asymmetric_friction" else words
    return dict(zip(chosen, amounts.values(), strict=True))


def _with_intervals(switch: Switch, fitted: Fitted) -> dict[str, Quantity]:
    return {
        key: replace(one, low=fitted.shape_intervals.get(key, (None, None))[0],
                     high=fitted.shape_intervals.get(key, (None, None))[1])
        for key, one in switch.shape.items()
    }  # fmt: skip
