"""`effects`: which physics and faults of the data a diagnosis knows, and what each of them is."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any

from selector.cli.shared import showing
from selector.cli.shared.option_table import argument
from selector.cli.shared.showing import AsJson

if TYPE_CHECKING:
    from rich.console import Console

    from selector.diagnosis.effects.effect import Effect


def effects(
    id: Annotated[str | None, argument("effects [ID]")] = None,  # noqa: A002 - the word of the contract
    as_json: AsJson = False,
) -> None:
    """Lists what a diagnosis can name, by family with a line each, or explains one effect: its physics, where it
    enters, what it needs, what resembles it, what would refute it, and the run that shows it.

    Effects that other packages bring by an entry point are listed too.
    """
    from selector.diagnosis.effects.catalogue import catalogue, effect_of

    chosen = (effect_of(id),) if id is not None else catalogue()
    if as_json:
        showing.print_json({"schema": "selector.effects/1", "effects": [described(effect) for effect in chosen]})
        return
    console = showing.screen()
    if id is not None:
        _explain(console, chosen[0])
        return
    for family, members in groupby(chosen, key=lambda effect: effect.family):
        rows = [(effect.id, effect.title[:1].upper() + effect.title[1:], effect.acts_at) for effect in members]
        console.print(showing.table(family, ["effect", "what it is", "where it acts"], rows, whole=["effect"]))
    console.print("`selector effects ID` explains one of them.", markup=False)


def described(effect: Effect) -> dict[str, Any]:
    """An effect as JSON."""
    plain = ("id", "family", "title", "physics", "enters", "acts_at", "needs", "refuted_by", "experiment", "reference")
    return {name: getattr(effect, name) for name in plain} | {
        "confounders": list(effect.confounders),
        "parameters": [dict(vars(parameter)) for parameter in effect.parameters],
    }


def _explain(console: Console, effect: Effect) -> None:
    console.print(f"{effect.id}: {effect.title}", style="bold", markup=False)
    console.print(effect.physics, markup=False)
    for heading, text in (
        ("enters", f"{effect.enters}, at: {effect.acts_at}"),
        ("needs", effect.needs),
        ("resembles", ", ".join(effect.confounders) or "nothing in the catalogue"),
        ("refuted by", effect.refuted_by),
        ("shown by", effect.experiment),
        ("source", effect.reference),
    ):
        console.print(f"\n{heading}: {text}", markup=False)
    if effect.parameters:
        rows = [
            (one.name, showing.cell_text(float(one.low)), showing.cell_text(float(one.high)), one.unit, one.meaning)
            for one in effect.parameters
        ]
        columns = ["parameter", "from", "to", "unit", "meaning"]
        console.print(showing.table("", columns, rows, numeric=("from", "to")))
