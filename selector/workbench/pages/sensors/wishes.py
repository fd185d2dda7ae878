"""Which sensors must or must not be used, what they cost, and where they sit: a row each, to be edited."""

from typing import Any

import dash
from dash import Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.selection import Options
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.boxes import Column, Rows
from selector.workbench.pages.sensors.machine import ID, sensors_of
from selector.workbench.typed import FIELDS

USES = ("may be used", FIELDS["--must"], FIELDS["--never"])
COLUMNS = ("sensor", "place", "use", "cost", "x [m]", "y [m]", "z [m]")
_FARTHEST_M = 1e6


def _rows(bench: Bench) -> Rows:
    def place(name: str) -> Any:
        return next((one.xyz_m for one in sensors_of(bench) if one.name == name), None)

    def choose(wished: dict[str, dict[str, Any]]) -> bool:
        uses, costs = wished["use"], wished["cost"]
        moved = {name: at for name, at in wished["place"].items() if at is not None and at != place(name)}
        if moved:
            bench.place(moved)
        is_other = bench.choose(
            must=tuple(name for name, use in uses.items() if use == USES[1]),
            never=tuple(name for name, use in uses.items() if use == USES[2]),
            cost={name: cost for name, cost in costs.items() if cost != 1.0},
        )
        return is_other or bool(moved)

    columns = (
        Column("use", lambda use, _: use, lambda name: _use(bench.options, name)),
        Column(
            "cost", lambda text, name: typed.number(text or "1", f"cost of {name}", 0.0),
            lambda name: bench.options.cost.get(name, 1.0), lambda cost: f"{cost:.12g}",
        ),
        Column("place", lambda text, name: _coordinates(text, name) if text else None, place,
            lambda xyz_m: ", ".join(f"{v:g}" for v in xyz_m or ()),
        ),
    )  # fmt: skip
    return Rows(ID, columns, lambda: [one.name for one in sensors_of(bench)], choose)


def table(bench: Bench) -> Component:
    """Where the table is; it stays open when its rows change. Fields that nobody sees would slow every page down."""
    summary = html.Summary("Must, never, cost and place of each sensor", id=f"{ID}-open")
    shown = [summary, html.Div(id=f"{ID}-wishes")]
    kept = [dcc.Store(id=f"{ID}-wished", data=None), _rows(bench).followed()]
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
        Input(f"{ID}-open", "n_clicks"),
        State(f"{ID}-wished", "data"),
    )
    def _show(_: int, opened: int | None, shown: int | None) -> tuple[Any, int]:
        if not opened or bench.inspection.number == shown:
            raise dash.exceptions.PreventUpdate
        return _table(bench), bench.inspection.number

    return _rows(bench).register(app, bench)


def _use(options: Options, name: str) -> str:
    return USES[1] if name in options.must else USES[2] if name in options.never else USES[0]


def _table(bench: Bench) -> Component:
    shown, rows = [], _rows(bench)
    for channel, (use, cost, place) in zip(sensors_of(bench), rows.counting().values(), strict=True):
        use_box, cost_box, place_box = rows.boxes(channel.name)
        name = html.Span(channel.name, className="name")
        fields = [parts.typed_text(cost_box, cost), parts.typed_text(place_box, place, className="place")]
        shown.append([name, channel.place or "", parts.choice(USES, use_box, use), *fields])
    return parts.table(["sensor", "place", "use", "cost", "x, y, z [m]"], shown, name="channels sensors")


def _coordinates(text: str, name: str) -> tuple[float, float, float]:
    values = typed.numbers(text, f"x, y, z of {name}", -_FARTHEST_M, _FARTHEST_M, "m")
    if len(values) != 3:
        raise OptionError(
            f"“{text}” was typed", expected="three numbers in metres: x, y, z", where=f"x, y, z of {name}",
            advice="e.g. 0.1, 0.6, 1.2 or 0,1 0,6 1,2",
        )  # fmt: skip
    return values[0], values[1], values[2]
