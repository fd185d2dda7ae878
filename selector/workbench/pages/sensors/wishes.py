"""Which sensors must or must not be used, what they cost, and where they sit: a row each, to be edited."""

from __future__ import annotations

from functools import partial
from typing import Any

import dash
from dash import ALL, Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.selection import Options
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.pages.sensors.machine import ID, sensors_of
from selector.workbench.typed import FIELDS

USES = ("may be used", FIELDS["--must"], FIELDS["--never"])
COLUMNS = ("sensor", "place", "use", "cost", "x [m]", "y [m]", "z [m]")
_KINDS = ("use", "cost", "place")
_FARTHEST_M = 1e6


def table() -> Component:
    """Where the table is; it stays open when its rows change."""
    shown = [html.Summary("Must, never, cost and place of each sensor"), html.Div(id=f"{ID}-wishes")]
    kept = [dcc.Store(id=f"{ID}-wished", data=None), dcc.Store(id=f"{ID}-followed", data={})]
    return html.Details([*shown, parts.table_download("sensors"), *kept], id=f"{ID}-every")


def rows(bench: Bench) -> list[list[object]]:
    """A row for each sensor under `COLUMNS`: what is wished of it, and where it sits."""
    asked = bench.options
    return [
        [one.name, one.place or "", _use(asked, one.name), asked.cost.get(one.name, 1.0), *(one.xyz_m or ())]
        for one in sensors_of(bench)
    ]


def register(app: dash.Dash, bench: Bench) -> parts.Form:
    """The table follows the bench, and the bench the table; its form."""
    parts.register_table(app, "sensors", COLUMNS, lambda: rows(bench))

    @app.callback(
        Output(f"{ID}-wishes", "children"),
        Output(f"{ID}-wished", "data"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-wished", "data"),
    )
    def _show(_: int, shown: int | None) -> tuple[Any, int]:
        if bench.material.number == shown:
            raise dash.exceptions.PreventUpdate
        return _table(bench), bench.material.number

    @app.callback(
        Output(f"{ID}-followed", "data"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-followed", "data"),
        State({"type": f"{ID}-use", "sensor": ALL}, "id"),
        *(State({"type": f"{ID}-{kind}", "sensor": ALL}, "value") for kind in _KINDS),
    )
    def _follow(_: int, before: dict[str, list[str]], ids: list[dict[str, str]], *columns: Any) -> dict[str, list[str]]:
        """Fields show what counts where it is other than before, e.g. after a pin was dragged."""
        now = _counting(bench)
        for one, *shown in zip(ids, *columns, strict=True):
            # a sensor that is new is about to be shown
            if (name := one["sensor"]) in now and name in before:
                parts.follow(_boxes([name]), shown, before[name], now[name])
        return now

    def take(uses: list[str], costs: list[str | None], places: list[str | None], ids: list[dict[str, str]]) -> None:
        known = _counting(bench)
        named = [
            (one["sensor"], *fields)
            for one, *fields in zip(ids, uses, costs, places, strict=True)
            if one["sensor"] in known
        ]
        if not named:
            return
        names, *columns = zip(*named, strict=True)
        sent = [text for column in columns for text in column]

        def counting() -> list[str]:
            now = _counting(bench)
            return [now[name][k] for k in range(len(_KINDS)) for name in names]

        boxes = [box for kind in _KINDS for box in _boxes(names, [kind])]
        with parts.typed_over(boxes, sent, counting) as read:
            asked = {
                name: read(
                    partial(typed.number, cost or "1", f"cost of {name}", 0.0), bench.options.cost.get(name, 1.0)
                )
                for name, _, cost, _ in named
            }
            places_m = {
                name: read(partial(_coordinates, place, name), None)
                for name, _, _, place in named
                if place and place != known[name][2]
            }
            if moved := {name: place for name, place in places_m.items() if place is not None}:
                bench.place(moved)
            is_other = bench.choose(
                must=tuple(name for name, use, *_ in named if use == USES[1]),
                never=tuple(name for name, use, *_ in named if use == USES[2]),
                cost={name: cost for name, cost in asked.items() if cost != 1.0},
            )
            if is_other or moved:
                parts.tell(bench)

    fields = tuple(({"type": f"{ID}-{kind}", "sensor": ALL}, "value") for kind in _KINDS)
    form = parts.Form(fields, take, (({"type": f"{ID}-use", "sensor": ALL}, "id"),))
    form.register(app)
    return form


def _boxes(names: Any, kinds: Any = _KINDS) -> list[dict[str, str]]:
    return [{"type": f"{ID}-{kind}", "sensor": name} for name in names for kind in kinds]


def _use(options: Options, name: str) -> str:
    """One of `USES`."""
    return USES[1] if name in options.must else USES[2] if name in options.never else USES[0]


def _counting(bench: Bench) -> dict[str, list[str]]:
    """Sensor → what stands in its fields when they say what counts."""
    asked = bench.options
    return {
        one.name: [_use(asked, one.name), f"{asked.cost.get(one.name, 1.0):.12g}", _place_text(one.xyz_m)]
        for one in sensors_of(bench)
    }


def _place_text(xyz_m: tuple[float, float, float] | None) -> str:
    return "" if xyz_m is None else ", ".join(f"{v:g}" for v in xyz_m)


def _table(bench: Bench) -> Component:
    shown = []
    for channel, (use, cost, place) in zip(sensors_of(bench), _counting(bench).values(), strict=True):
        use_box, cost_box, place_box = _boxes([channel.name])
        name = html.Span(channel.name, className="name")
        fields = [parts.typed_text(cost_box, cost), parts.typed_text(place_box, place, className="place")]
        shown.append([name, channel.place or "", parts.choice(use_box, USES, use), *fields])
    return parts.table(["sensor", "place", "use", "cost", "x, y, z [m]"], shown, name="channels sensors")


def _coordinates(text: str, name: str) -> tuple[float, float, float]:
    values = typed.numbers(text, f"x, y, z of {name}", -_FARTHEST_M, _FARTHEST_M, "m")
    if len(values) != 3:
        raise OptionError(
            f"“{text}” was typed", expected="three numbers in metres: x, y, z", where=f"x, y, z of {name}",
            advice="e.g. 0.1, 0.6, 1.2 or 0,1 0,6 1,2",
        )  # fmt: skip
    return values[0], values[1], values[2]
