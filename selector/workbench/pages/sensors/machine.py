"""The machine with its pins: where the sensors sit, moving them, and the user's own photo."""

import base64
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import dash
import numpy as np
from dash import Input, dcc, html
from dash.development.base_component import Component
from pydantic import BaseModel

from selector.errors import OptionError
from selector.physics.thermal.field import machine_outline
from selector.recording import SENSOR_ROLES, Channel
from selector.types import Array
from selector.workbench import parts
from selector.workbench.bench import Bench
from selector.workbench.study_folder import PICTURES, files_in

ID = "sensors"

MOST_PHOTO_BYTES = 8_000_000
_VIEWS = {"front": "front view", "side": "side view"}
_SIGNS = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}
_BESIDE, _EDGE = 0.25, 0.12
#: Sensors without a place that stand in one column, and the height of a row as a share of the machine's.
_MOST_BELOW, _ROW = 10, 0.08


@dataclass(frozen=True)
class Pins:
    """Sensors as they are drawn [m], and the lines of the machine's body.

    Sensors without a place stand below the machine, one beneath the other, one far away at the edge.
    """

    names: tuple[str, ...]
    points_m: Array
    outline_m: Sequence[Array]


class Dragged(BaseModel):
    """A pin that was let go of: its number, and where [m]."""

    number: int
    at: list[float]


def controls() -> Component:
    """The photo's upload and what else belongs to the machine picture."""
    note = "or drop it here: PNG or JPEG, its name begins with front or side for the view that it is of. It fills the "
    note += "view; drag the pins to their places on it."
    area = parts.drop_zone(PICTURES, "Choose a photo", note)
    return html.Details(
        [html.Summary("Your own photo behind the pins"), area, dcc.Store(id=f"{ID}-dragged", data=None)]
    )


def register(app: dash.Dash, bench: Bench) -> None:
    """A pin that was let go of is written into the machine file."""

    @app.callback(Input(f"{ID}-dragged", "data"), prevent_initial_call=True)
    def _dropped(dragged: Dragged | None) -> None:
        if dragged is None:
            raise dash.exceptions.PreventUpdate
        sensors = sensors_of(bench)
        number, at = dragged.number, dragged.at
        if not 0 <= number < len(sensors) or len(at) != 3 or not all(abs(v) < 1e6 for v in at):
            raise OptionError(
                "a pin that is not on the machine", expected="a pin of this picture", where="machine picture",
                advice="load the page again",
            )  # fmt: skip
        bench.place({sensors[number].name: (at[0], at[1], at[2])})
        parts.tell(bench)


def sensors_of(bench: Bench) -> list[Channel]:
    """The thermometers that were read."""
    reading = bench.inspection.reading
    return [] if reading is None else [one for one in reading.recording.channels if one.role in SENSOR_ROLES]


def pins(bench: Bench) -> Pins:
    """The pins of all thermometers."""
    sensors = sensors_of(bench)
    known = [one.xyz_m for one in sensors if one.xyz_m is not None]
    outline = _fitted(np.array(known, dtype=np.float64).reshape(-1, 3))
    body = np.vstack(outline)
    low, high = body.min(axis=0), body.max(axis=0)
    homeless = [one.name for one in sensors if one.xyz_m is None]
    columns = -(-len(homeless) // _MOST_BELOW)
    # one in the hall stands at the edge of the picture, or the machine would be small
    reach = _EDGE * float((high - low).max())
    points: list[tuple[float, float, float]] = []
    for one in sensors:
        if one.xyz_m is not None:
            x, y, z = np.clip(one.xyz_m, low - reach, high + reach).tolist()
            points.append((x, y, z))
            continue
        row, column = divmod(homeless.index(one.name), columns)
        x, y = (float(low[k] + column / columns * (high[k] - low[k])) for k in (0, 1))
        points.append((x, y, float(low[2] - (row + 1) * _ROW * (high[2] - low[2]))))
    return Pins(tuple(one.name for one in sensors), np.array(points, dtype=np.float64).reshape(-1, 3), outline)


def photos(bench: Bench) -> Mapping[str, str]:
    """View → the newest picture in the study folder that is of it, as an address that holds the picture itself."""
    found: dict[str, str] = {}
    for path in sorted(files_in(bench.folder / PICTURES), key=lambda one: one.stat().st_mtime):
        for word, view in _VIEWS.items():
            if path.name.casefold().startswith(word) and (address := _address(path, path.stat().st_mtime)):
                found[view] = address
    return found


@functools.lru_cache(maxsize=4)
def _address(path: Path, _: float) -> str | None:
    """The picture in the address; none for what is no picture, or too large."""
    if path.stat().st_size > MOST_PHOTO_BYTES:
        return None
    content = path.read_bytes()
    kind = next((kind for sign, kind in _SIGNS.items() if content.startswith(sign)), None)
    return None if kind is None else f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


_c_frame = functools.cache(machine_outline)


def _fitted(places_m: Array) -> Sequence[Array]:
    """The edges of a C-frame machine; stretched where the sensors do not fit on it."""
    lines = _c_frame()
    body = np.vstack(lines)
    low, high = body.min(axis=0), body.max(axis=0)
    if not len(places_m):
        return lines
    # one in the hall says nothing about the size of the machine
    away = np.abs(places_m - np.median(places_m, axis=0))
    inside = places_m[(away <= 10 * np.maximum(np.median(away, axis=0), 0.1)).all(axis=1)]
    reach = _BESIDE * float((high - low).max())
    if ((inside >= low - reach) & (inside <= high + reach)).all() and (
        np.ptp(inside, axis=0) >= 0.2 * (high - low)
    ).any():
        return lines
    least, size = inside.min(axis=0), np.maximum(np.ptp(inside, axis=0), 0.2)
    return tuple(least + (line - low) / (high - low) * size for line in lines)
