"""Which sensors must or must not be used, what they cost, and where they sit: a row each, to be edited."""

from __future__ import annotations

from functools import partial
from typing import Any

import dash
from dash import ALL, Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.pages import wished
from selector.workbench.pages.sensors.machine import ID, sensors_of

_FARTHEST_M = 1e6


def table() -> Component:
    """Where the table is; it stays open when its rows change."""
    shown = [html.Summary("Must, never, cost and place of each sensor"), html.Div(id=f"{ID}-wishes")]
    kept = [dcc.Store(id=f"{ID}-wished", data=None), wished.followed(ID), wished.followed(ID, "place")]
    return html.Details([*shown, parts.table_download("sensors"), *kept], id=f"{ID}-every")


def register(app: dash.Dash, bench: Bench) -> tuple[parts.Form, ...]:
    """The table follows the bench, and the bench the table; its forms."""

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

    wished.register_following(app, ID, lambda: wished.said_of(bench))
    wished.register_following(app, ID, lambda: {name: [text] for name, text in _places(bench).items()}, ["place"])
    forms = (wished.form(bench, ID), _places_form(bench))
    for form in forms:
        form.register(app)
    return forms


def _places_form(bench: Bench) -> parts.Form:
    def take(texts: list[str | None], ids: list[dict[str, str]]) -> None:
        known = _places(bench)
        named = {one["sensor"]: text for one, text in zip(ids, texts, strict=True) if text}
        changed = {name: text for name, text in named.items() if name in known and text != known[name]}
        boxes = [{"type": f"{ID}-place", "sensor": name} for name in changed]
        shown = [*changed.values()]

        def counting() -> list[str]:
            return [_places(bench)[name] for name in changed]

        with parts.typed_over(boxes, shown, counting) as read:
            places_m = {name: read(partial(_coordinates, text, name), None) for name, text in changed.items()}
            if places := {name: place for name, place in places_m.items() if place is not None}:
                bench.place(places)
                parts.tell(bench)

    place = {"type": f"{ID}-place", "sensor": ALL}
    return parts.Form(((place, "value"),), take, ((place, "id"),))


def _places(bench: Bench) -> dict[str, str]:
    """Name → coordinates as they stand in the table."""
    return {
        channel.name: "" if channel.xyz_m is None else ", ".join(f"{v:g}" for v in channel.xyz_m)
        for channel in sensors_of(bench)
    }


def _table(bench: Bench) -> Component:
    places = _places(bench)
    shown = [
        [
            html.Span(channel.name, className="name"),
            channel.place or "",
            *wished.controls(bench.options, ID, channel.name),
            parts.typed_text({"type": f"{ID}-place", "sensor": channel.name}, places[channel.name], className="place"),
        ]
        for channel in sensors_of(bench)
    ]
    return parts.table(["sensor", "place", "use", "cost", "x, y, z [m]"], shown, name="channels sensors")


def _coordinates(text: str, name: str) -> tuple[float, float, float]:
    values = typed.numbers(text, f"x, y, z of {name}", -_FARTHEST_M, _FARTHEST_M, "m")
    if len(values) != 3:
        raise OptionError(
            f"“{text}” was typed", expected="three numbers in metres: x, y, z", where=f"x, y, z of {name}",
            advice="e.g. 0.1, 0.6, 1.2 or 0,1 0,6 1,2",
        )  # fmt: skip
    return values[0], values[1], values[2]
