"""The visual language of every figure: colours by role, one template, labels, axes, changes."""

import html
import math
import textwrap
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from selector import number_text
from selector.types import Array

# Okabe and Ito's palette (2008): told apart with every common kind of colour blindness, and in grey.
INK = "#1a1a1a"
MUTED = "#8c8c8c"
GRID = "#e4e4e4"
MEASURED = INK
PREDICTED = "#0072B2"
RESIDUAL = "#D55E00"
BEFORE = "#a6a6a6"
CHOSEN = "#009E73"
BASELINES = {"none": "#7f7f7f", "mean": "#E69F00", "all sensors": "#CC79A7"}
OTHER_BASELINE = "#56B4E9"
GROUPS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
LIKENESS_SCALE = ((0.0, "#f7fbff"), (0.35, "#b5d4e9"), (0.7, "#3787c0"), (1.0, "#08306b"))
HARM_SCALE = ((0.0, "#fffaf5"), (0.4, "#f9c08a"), (0.75, "#e0702a"), (1.0, "#8a3600"))

WIDTH = 1000
TITLE_MARGIN = 40  #: Margin above the plot that a figure without its title needs [px]: for a legend.
LONGEST_LABEL = 28
_TITLE_WIDTH = 95
_MOST_NINES = 7.0
_LEVEL_TICKS = (-1, -0.5, 0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 0.9999, 0.99999)
_LEAST_TICKS = 3
_FONT = "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif"


@cache
def template() -> go.layout.Template:
    """The template that every figure is drawn with; colours of traces are given by role, never by order."""
    axis = {
        "automargin": True,
        "gridcolor": GRID,
        "linecolor": MUTED,
        "showline": True,
        "ticks": "outside",
        "tickcolor": MUTED,
        "ticklen": 4,
        "title": {"standoff": 8, "font": {"size": 13}},
        "zeroline": False,
    }
    return go.layout.Template(
        layout={
            "colorway": list(GROUPS),
            "font": {"family": _FONT, "size": 12, "color": INK},
            "hoverlabel": {"font": {"family": _FONT, "size": 12}},
            "hovermode": "closest",
            "legend": {"orientation": "h", "x": 0, "xanchor": "left", "y": 1.0, "yanchor": "bottom"},
            "margin": {"l": 60, "r": 20, "t": 40, "b": 50},
            "paper_bgcolor": "#ffffff",
            "plot_bgcolor": "#ffffff",
            # a comma between thousands is a decimal comma to many readers
            "separators": ".\u202f",
            "title": {"x": 0.01, "xanchor": "left", "yref": "container", "font": {"size": 15}},
            "xaxis": axis,
            "yaxis": axis,
        }
    )


def figure(title: str, height: int) -> go.Figure:
    """An empty figure with this title (plain text, as `label` makes it) and height [px]."""
    lines = textwrap.wrap(title, _TITLE_WIDTH)
    name = {"text": "<br>".join(lines), "y": 1.0, "yanchor": "top", "pad": {"t": 16}}
    look = {"width": WIDTH, "height": height, "title": name, "margin": {"t": TITLE_MARGIN + 8 + 19 * len(lines)}}
    # at once: a figure without a template of its own begins as a copy of Plotly's large one
    return go.Figure(layout={"template": template(), **look})


def rows(title: str, heights_px: Sequence[int], gap_px: int, below_px: int, *, is_shared: bool = True) -> go.Figure:
    """As `figure`, with panels of these heights one below the other; `is_shared`: they have one horizontal axis."""
    inside = sum(heights_px) + gap_px * (len(heights_px) - 1)
    made = figure(title, inside)
    made.set_subplots(
        len(heights_px), 1, row_heights=[*heights_px], vertical_spacing=gap_px / inside, shared_xaxes=is_shared
    )
    made.update_layout(height=int(made.layout.margin.t) + inside + below_px, margin={"b": below_px})
    return made


def spaced(places: Sequence[float], distance: float, end: float) -> list[float]:
    """Places near these, in this order, the `distance` apart at least, from half of it to that before the `end`."""
    placed: list[float] = []
    for place in places:
        placed.append(max(place, placed[-1] + distance if placed else distance / 2))
    ceiling = end - distance / 2
    for k in reversed(range(len(placed))):
        placed[k] = min(placed[k], ceiling)
        ceiling = placed[k] - distance
    return placed


def curve(
    drawn: go.Figure, x: Any, y: Any, colour: Any, name: Any = None, hover: Any = None, *,
    width: Any = 1.8, dash: Any = "solid", **more: Any,
) -> None:  # fmt: skip
    """Adds a line, arrays in single precision; without a text for hovering it is not hovered over."""
    line = {"color": colour, "width": width, "dash": dash, **more.pop("line", {})}
    drawn.add_scatter(x=_single(x), y=_single(y), mode="lines", name=name, line=line, **hovered(hover), **more)


def _single(values: Any) -> Any:
    return values.astype(np.float32) if isinstance(values, np.ndarray) else values


def points(
    drawn: go.Figure, x: Any, y: Any, colour: Any, name: Any = None, hover: Any = None, *,
    size: Any = 9, **more: Any,
) -> None:  # fmt: skip
    """Adds marks; without a text for hovering they are not hovered over."""
    marker = {"color": colour, "size": size, **more.pop("marker", {})}
    drawn.add_scatter(x=x, y=y, **{"mode": "markers", **more}, name=name, marker=marker, **hovered(hover))


def bars(drawn: go.Figure, x: Any, y: Any, colour: Any, name: Any = None, hover: Any = None, **more: Any) -> None:
    """Adds bars that lie."""
    drawn.add_bar(x=x, y=y, orientation="h", name=name, marker={"color": colour}, **hovered(hover), **more)


def hovered(hover: str | None) -> dict[str, str]:
    """What hovering over a trace shows: this text alone, or nothing."""
    if hover is None:
        return {"hoverinfo": "skip"}
    return {"hovertemplate": hover if "<extra>" in hover else f"{hover}<extra></extra>"}


def rule(
    at: float, colour: Any = MUTED, *, across: Any = False, panel: Any = "", dash: Any = "dot", width: Any = 1.0,
    **more: Any,
) -> dict[str, Any]:  # fmt: skip
    """A straight line through a panel, as a shape: upright at this x, or `across` it at this y."""
    along, through = ("y", "x") if across else ("x", "y")
    place = {f"{along}ref": f"{along}{panel}", f"{along}0": at, f"{along}1": at}
    whole = {f"{through}ref": f"{through}{panel} domain", f"{through}0": 0, f"{through}1": 1}
    look = {"color": colour, "width": width, "dash": dash}
    return {"type": "line", **place, **whole, **more, "line": look}


def zone(
    start: float, stop: float, colour: str, opacity: float, *, across: bool = False, panel: str = ""
) -> dict[str, Any]:
    """A shape that shades a panel between two x, or `across` it between two y."""
    along, through = ("y", "x") if across else ("x", "y")
    place = {f"{along}ref": f"{along}{panel}", f"{along}0": start, f"{along}1": stop}
    whole = {f"{through}ref": f"{through}{panel} domain", f"{through}0": 0, f"{through}1": 1}
    look = {"fillcolor": colour, "opacity": opacity, "line": {"width": 0}, "layer": "below"}
    return {"type": "rect", **place, **whole, **look}


def outline(path: str, colour: str, *, width: float = 1.0, **more: Any) -> dict[str, Any]:
    """Any number of lines as one shape below the traces; the browser draws a trace again line by line."""
    return {"type": "path", "path": path, "line": {"color": colour, "width": width}, "layer": "between", **more}


def words(text: str, x: Any, y: Any, colour: Any = INK, size: Any = 12, **more: Any) -> dict[str, Any]:
    """What is written into the picture, as an annotation."""
    return {"text": text, "x": x, "y": y, "showarrow": False, "font": {"color": colour, "size": size}, **more}


#: Where what is said of a line stands: to the right of the picture.
BESIDE: Mapping[str, Any] = {"x": 1.0, "xref": "paper", "xanchor": "left", "xshift": 6, "yanchor": "middle"}


def title_text(drawn: go.Figure) -> str:
    """The title of a figure as plain text, for captions."""
    return html.unescape((drawn.layout.title.text or "").replace("<br>", " "))


def label(name: str, longest: int = LONGEST_LABEL) -> str:
    """A name as Plotly shows it letter by letter: Plotly reads text as markup, and names may hold anything."""
    return labels([name], longest)[0]


def labels(names: Sequence[str], longest: int = LONGEST_LABEL) -> list[str]:
    """As `label`, of several names that stay different."""
    visible = ["".join(letter if letter.isprintable() else " " for letter in name) for name in names]
    return [html.escape(text, quote=False) for text in number_text.told_apart(visible, longest)]


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names in a sentence; from `most` on the rest is counted."""
    return number_text.listed([*labels(names[:most]), *[f"{len(names) - most} more"] * (len(names) > most)])


def level_text(level: float) -> str:
    """λ with six digits: levels on one machine often part in the fifth."""
    return f"{level:.6g}"


def nines(level: ArrayLike) -> Array:
    """−log₁₀(1 − level): 0.9, 0.99 and 0.999 are equally far apart, which is where sensors of a machine part.

    Levels closer to 1 than 10⁻⁷ are held there.
    """
    distance = np.maximum(1.0 - np.asarray(level, dtype=np.float64), 10.0**-_MOST_NINES)
    return np.asarray(-np.log10(distance))


def level_axis(low: float, high: float, *, end: float | None = None, room: float = 0.07) -> dict[str, object]:
    """Ticks for an axis in `nines` from level `low` to level `high`; `end` is where λ = 1 is drawn.

    `room` is the least distance of two ticks, as a share of the axis.
    """
    first, last = float(nines(low)), float(nines(high))
    stop = last if end is None else end
    least = room * max(stop - first, 1e-9)
    taken = {stop: "1"} if end is not None else {}
    # round levels first, those between them where there is room
    rounds = sorted(_LEVEL_TICKS, key=lambda tick: (f"{1 - tick:.6g}".strip("0.") != "1", tick))
    inside = [tick for tick in rounds if first <= float(nines(tick)) <= last]
    for level in inside if len(inside) >= _LEAST_TICKS else _evenly_rounded(low, high):
        place = float(nines(level))
        if all(abs(place - other) >= least for other in taken):
            taken[place] = f"{level:.9g}"
    return {"tickvals": list(taken), "ticktext": list(taken.values())}


def _evenly_rounded(low: float, high: float) -> list[float]:
    """Levels at a step of 1, 2 or 5 times a power of ten, for a span without round levels."""
    span = max(high - low, 1e-9)
    power = 10.0 ** math.floor(math.log10(span / 4))
    step = next(factor * power for factor in (1, 2, 5, 10) if span / (factor * power) <= 5)
    return [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def time_unit(longest_s: float) -> tuple[str, float]:
    """(unit, seconds in it) in which a time axis up to `longest_s` is read easily."""
    if longest_s >= 2 * 3600:
        return "h", 3600.0
    return ("min", 60.0) if longest_s >= 120 else ("s", 1.0)


#: Path in the figure, e.g. ("data", 0, "x") → the value that stands there now.
Changes = Mapping[tuple[str | int, ...], Any]


def changed(drawn: go.Figure, changes: Changes) -> go.Figure:
    """The same figure, with the changes made in it."""
    for path, value in changes.items():
        place: Any = drawn
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
    return drawn


def rows_of(names: Sequence[str]) -> dict[str, Any]:
    """An axis with a row for each of these labels, from top to bottom, without marks of its own."""
    n = len(names)
    return {"range": [n - 0.5, -0.5], "tickvals": [*range(n)], "ticktext": [*names], "showgrid": False, "ticks": ""}


_MOST_DECADES = 3.7  #: Above so many powers of ten there is room for these alone.

_POWERS = range(-9, 10)
_STEPS = (1, 2, 5)


def log_ticks(low: float, high: float) -> dict[str, Any]:
    """Ticks of an axis from 10^low to 10^high: 1, 2, 5 of each power of ten, or these alone; more fit a zoomed axis."""
    steps = _STEPS if high - low < _MOST_DECADES else (1,)
    values = [step * 10.0**power for power in _POWERS for step in steps]
    return {"tickvals": values, "ticktext": [f"{value:.10g}" for value in values]}


def log_axis(low: float, high: float) -> dict[str, Any]:
    """A logarithmic axis over these values, with `log_ticks`."""
    ends = [math.log10(low), math.log10(high)]
    return {"type": "log", "range": ends, **log_ticks(*ends)}
