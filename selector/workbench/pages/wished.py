"""What is wished of each sensor, as two pages ask it: whether it may, must or must never be used, and its cost."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any

import dash
from dash import ALL, Input, Output, State, dcc
from dash.development.base_component import Component

from selector.recording import SENSOR_ROLES
from selector.selection import Options
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.typed import FIELDS

USES = ("may be used", FIELDS["--must"], FIELDS["--never"])
COLUMNS = ("sensor", "place", "use", "cost", "x [m]", "y [m]", "z [m]")


def use_of(options: Options, name: str) -> str:
    """One of `USES`."""
    return USES[1] if name in options.must else USES[2] if name in options.never else USES[0]


def cost_of(options: Options, name: str) -> str:
    """The cost as it stands in a field."""
    return f"{options.cost.get(name, 1.0):.12g}"


def controls(options: Options, page: str, name: str) -> list[Component]:
    """The fields for use and cost of a sensor in a page's table."""
    return [
        parts.choice({"type": f"{page}-use", "sensor": name}, USES, use_of(options, name)),
        parts.typed_text({"type": f"{page}-cost", "sensor": name}, cost_of(options, name)),
    ]


def _wishes(
    names: Sequence[str],
    uses: Sequence[str],
    costs: Sequence[str | None],
    known: Collection[str],
    read: Callable[[Callable[[], float], float], float],
    before: Mapping[str, float],
) -> dict[str, Any]:
    """Options ``must``, ``never`` and ``cost`` from what stands beside the names; unknown names are left out."""
    rows = [row for row in zip(names, uses, costs, strict=True) if row[0] in known]
    asked = {
        name: read(partial(typed.number, text or "1", f"cost of {name}", 0.0), before.get(name, 1.0))
        for name, _, text in rows
    }
    return {
        "must": tuple(name for name, use, _ in rows if use == USES[1]),
        "never": tuple(name for name, use, _ in rows if use == USES[2]),
        "cost": {name: cost for name, cost in asked.items() if cost != 1.0},
    }


def choose(
    bench: Bench, page: str, ids: Sequence[dict[str, str]], uses: Sequence[str], costs: Sequence[str | None]
) -> None:
    """Takes over the rows of a page's table, if there are any; the ids of its fields begin with `page`. No cost is 1.

    Raises OptionError: a cost is no number of 0 or more, or more sensors must be kept than a set may have.
    """
    reading = bench.material.reading
    if reading is None or not ids:
        return
    known = reading.recording.names
    names = [one["sensor"] for one in ids]
    boxes = [{"type": f"{page}-{kind}", "sensor": name} for kind in ("use", "cost") for name in names]

    def counting() -> list[str]:
        return [said(bench.options, name) for said in (use_of, cost_of) for name in names]

    with parts.typed_over(boxes, [*uses, *costs], counting) as read:
        if bench.choose(**_wishes(names, uses, costs, known, read, bench.options.cost)):
            parts.tell(bench)


def form(bench: Bench, page: str) -> parts.Form:
    """The fields for use and cost of a page's table."""

    def take(uses: list[str], costs: list[str | None], ids: list[dict[str, str]]) -> None:
        choose(bench, page, ids, uses, costs)

    fields = tuple(({"type": f"{page}-{kind}", "sensor": ALL}, "value") for kind in ("use", "cost"))
    return parts.Form(fields, take, (({"type": f"{page}-use", "sensor": ALL}, "id"),))


def said_of(bench: Bench) -> dict[str, list[str]]:
    """Sensor → its use and its cost, as they stand in fields."""
    reading = bench.material.reading
    names = () if reading is None else reading.recording.names
    return {name: [use_of(bench.options, name), cost_of(bench.options, name)] for name in names}


def followed(page: str, kind: str = "use") -> Component:
    """Where the page keeps what `register_following` showed the last time."""
    return dcc.Store(id=f"{page}-followed-{kind}", data={})


def register_following(
    app: dash.Dash, page: str, counting: Callable[[], Mapping[str, list[str]]], kinds: Sequence[str] = ("use", "cost")
) -> None:
    """Fields of a table, ``{"type": f"{page}-{kind}", "sensor": name}``, show what other pages chose.

    `counting` gives for each sensor what is to stand in its fields of these kinds.
    """
    store = f"{page}-followed-{kinds[0]}"

    @app.callback(
        Output(store, "data"),
        Input(parts.REVISION, "data"),
        State(store, "data"),
        State({"type": f"{page}-{kinds[0]}", "sensor": ALL}, "id"),
        *(State({"type": f"{page}-{kind}", "sensor": ALL}, "value") for kind in kinds),
    )
    def _follow(_: int, before: dict[str, list[str]], ids: list[dict[str, str]], *columns: Any) -> dict[str, list[str]]:
        now = dict(counting())
        for one, *shown in zip(ids, *columns, strict=True):
            # a sensor that is new is about to be shown
            if (name := one["sensor"]) in now and name in before:
                boxes = [{"type": f"{page}-{kind}", "sensor": name} for kind in kinds]
                parts.follow(boxes, shown, before[name], now[name])
        return now


def rows(bench: Bench) -> list[list[object]]:
    """A row for each sensor under `COLUMNS`: what is wished of it, and where it sits."""
    reading, asked = bench.material.reading, bench.options
    return [
        [one.name, one.place or "", use_of(asked, one.name), asked.cost.get(one.name, 1.0), *(one.xyz_m or ())]
        for one in (() if reading is None else reading.recording.channels)
        if one.role in SENSOR_ROLES
    ]
