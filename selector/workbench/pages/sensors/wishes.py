"""Which sensors must or must not be used, what they cost, and where they sit: a row each, to be edited."""

from __future__ import annotations

from typing import Any

import dash
from dash import ALL, Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.workbench import parts
from selector.workbench.bench import Bench
from selector.workbench.pages.sensors.machine import sensors_of
from selector.workbench.pages.sensors.names import ID
from selector.workbench.wished import USES, cost_of, use_of, wishes


def table() -> Component:
    """Where the table is; it stays open when its rows change."""
    return html.Details(
        [html.Summary("Must, never, cost and place of each sensor"), html.Div(id=f"{ID}-wishes")], id=f"{ID}-every"
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
        known = [one.name for one in sensors_of(bench)]
        if bench.choose(**wishes([one["sensor"] for one in ids], uses, costs, known)):
            parts.tell(bench)

    @app.callback(
        Input({"type": f"{ID}-place", "sensor": ALL}, "value"),
        prevent_initial_call=True,
    )
    def _place(texts: list[str | None]) -> None:
        asked = dash.ctx.triggered_id
        if asked is None or len(dash.ctx.triggered) != 1 or not (text := dash.ctx.triggered[0]["value"]):
            raise dash.exceptions.PreventUpdate
        name = asked["sensor"]
        if text == {row[0]: row[4] for row in _rows(bench)}.get(name):
            raise dash.exceptions.PreventUpdate
        bench.place({name: _coordinates(text, name)})
        parts.tell(bench)


def _rows(bench: Bench) -> list[list[str]]:
    """Name, words for the place, use, cost and coordinates of every sensor."""
    asked = bench.options
    return [
        [
            channel.name,
            channel.place or "",
            use_of(asked, channel.name),
            cost_of(asked, channel.name),
            "" if channel.xyz_m is None else ", ".join(f"{v:g}" for v in channel.xyz_m),
        ]
        for channel in sensors_of(bench)
    ]


def _table(rows: list[list[str]]) -> Component:
    shown = [
        [
            html.Span(name, className="name"),
            words,
            parts.choice({"type": f"{ID}-use", "sensor": name}, USES, use),
            dcc.Input(id={"type": f"{ID}-cost", "sensor": name}, value=cost, type="text", debounce=True),
            dcc.Input(
                id={"type": f"{ID}-place", "sensor": name}, value=place, type="text", debounce=True, className="place"
            ),
        ]
        for name, words, use, cost, place in rows
    ]
    return parts.table(["sensor", "place", "use", "cost", "x, y, z [m]"], shown, name="channels sensors")


def _coordinates(text: str, name: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(word) for word in text.replace(";", ",").split(","))
        if all(abs(v) < 1e6 for v in (x, y, z)):
            return x, y, z
    except ValueError:
        pass
    raise OptionError(
        repr(text), expected="three numbers in metres, x, y, z", where=f"place of {name}", advice="e.g. 0.1, 0.6, 1.2"
    )
