"""Which sensors must or must not be used, what they cost, and where they sit: a row each, to be edited."""

from __future__ import annotations

from typing import Any

import dash
from dash import ALL, Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.workbench import parts, typed, wished
from selector.workbench.bench import Bench
from selector.workbench.pages.sensors.machine import sensors_of
from selector.workbench.pages.sensors.names import ID

_FARTHEST_M = 1e6


def table() -> Component:
    """Where the table is; it stays open when its rows change."""
    return html.Details(
        [
            html.Summary("Must, never, cost and place of each sensor"),
            html.Div(id=f"{ID}-wishes"),
            parts.table_download("sensors"),
        ],
        id=f"{ID}-every",
    )


def register(app: dash.Dash, bench: Bench) -> None:
    """The table follows the bench, and the bench the table."""

    @app.callback(
        Output(f"{ID}-wishes", "children"),
        Input(parts.REVISION, "data"),
        State({"type": f"{ID}-use", "sensor": ALL}, "id"),
        State({"type": f"{ID}-use", "sensor": ALL}, "value"),
        State({"type": f"{ID}-cost", "sensor": ALL}, "value"),
        State({"type": f"{ID}-place", "sensor": ALL}, "value"),
    )
    def _show(
        _: int, ids: list[dict[str, str]], uses: list[str], costs: list[str | None], places: list[str | None]
    ) -> Any:
        rows = _rows(bench)
        names = [one["sensor"] for one in ids]
        if [list(row) for row in zip(names, uses, costs, places, strict=True)] == [row[:1] + row[2:] for row in rows]:
            raise dash.exceptions.PreventUpdate
        return _table(rows)

    @app.callback(
        Input({"type": f"{ID}-use", "sensor": ALL}, "value"),
        Input({"type": f"{ID}-cost", "sensor": ALL}, "value"),
        State({"type": f"{ID}-use", "sensor": ALL}, "id"),
        prevent_initial_call=True,
    )
    def _wish(uses: list[str], costs: list[str | None], ids: list[dict[str, str]]) -> None:
        wished.choose(bench, ID, ids, uses, costs)

    @app.callback(
        Input({"type": f"{ID}-place", "sensor": ALL}, "value"),
        prevent_initial_call=True,
    )
    def _place(texts: list[str | None]) -> None:
        asked = dash.ctx.triggered_id
        if asked is None or len(dash.ctx.triggered) != 1 or not (text := dash.ctx.triggered[0]["value"]):
            raise dash.exceptions.PreventUpdate
        name = asked["sensor"]
        if text == _places(bench).get(name):
            raise dash.exceptions.PreventUpdate
        with parts.showing_what_counts([asked], [text], lambda: [_places(bench).get(name, "")]):
            bench.place({name: _coordinates(text, name)})
            parts.tell(bench)


def _places(bench: Bench) -> dict[str, str]:
    """Name → coordinates as they stand in the table."""
    return {row[0]: row[4] for row in _rows(bench)}


def _rows(bench: Bench) -> list[list[str]]:
    """Name, words for the place, use, cost and coordinates of every sensor."""
    return [
        [
            channel.name,
            channel.place or "",
            wished.use_of(bench.options, channel.name),
            wished.cost_of(bench.options, channel.name),
            "" if channel.xyz_m is None else ", ".join(f"{v:g}" for v in channel.xyz_m),
        ]
        for channel in sensors_of(bench)
    ]


def _table(rows: list[list[str]]) -> Component:
    shown = [
        [
            html.Span(name, className="name"),
            words,
            parts.choice({"type": f"{ID}-use", "sensor": name}, wished.USES, use),
            dcc.Input(id={"type": f"{ID}-cost", "sensor": name}, value=cost, type="text", debounce=True),
            dcc.Input(
                id={"type": f"{ID}-place", "sensor": name}, value=place, type="text", debounce=True, className="place"
            ),
        ]
        for name, words, use, cost, place in rows
    ]
    return parts.table(["sensor", "place", "use", "cost", "x, y, z [m]"], shown, name="channels sensors")


def _coordinates(text: str, name: str) -> tuple[float, float, float]:
    values = typed.numbers(text, f"x, y, z of {name}", -_FARTHEST_M, _FARTHEST_M)
    if len(values) != 3:
        raise OptionError(
            f"“{text}” was typed", expected="three numbers in metres: x, y, z", where=f"x, y, z of {name}",
            advice="e.g. 0.1, 0.6, 1.2 or 0,1 0,6 1,2",
        )  # fmt: skip
    return values[0], values[1], values[2]
