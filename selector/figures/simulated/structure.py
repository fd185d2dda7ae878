"""Which members does a machine consist of, how do they hang together, and which of them move."""

import cmath
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.number_text import number_text
from selector.physics.vibration.chains import Chain
from selector.physics.vibration.structure.source import Source
from selector.physics.vibration.structure.structure import GROUND, Joint, Structure

_SWEEPS = 12


@dataclass(frozen=True)
class Places:
    """Places of the parts of a network."""

    layers: tuple[tuple[str, ...], ...]  #: Names from the layer next to the root up, each from left to right
    across: Mapping[str, float]  #: Name → place from the left (0) to the right (1)
    height: Mapping[str, int]  #: Name → number of its layer, 1 next to the root


def layered_places(names: Sequence[str], links: Sequence[tuple[str, str]], root: str) -> Places:
    """Layers by the number of links to `root`; within a layer each part near what it is joined with below.

    `names` are all parts but the root, each with a way to it by the `links`.
    """
    beside: dict[str, list[str]] = {name: [] for name in (*names, root)}
    for one, other in links:
        beside[one].append(other)
        beside[other].append(one)
    height, layer, layers = {root: 0}, [root], list[list[str]]()
    while layer:
        layer = [name for name in names if name not in height and any(other in layer for other in beside[name])]
        height |= dict.fromkeys(layer, len(layers) + 1)
        if layer:
            layers.append(layer)
    del height[root]
    gap = 1.0 / max(len(layer) for layer in layers)
    across: dict[str, float] = {}
    # each sweep brings the layers nearer to those above and below
    for sweep in range(_SWEEPS):
        for layer in layers:
            wanted = {name: (k + 0.5) / len(layer) for k, name in enumerate(layer)} if sweep == 0 else across
            near = {name: [across[other] for other in beside[name] if other in across] for name in layer}
            middle = {name: sum(of) / len(of) if of else wanted[name] for name, of in near.items()}
            layer.sort(key=middle.__getitem__)
            across |= dict(zip(layer, style.spaced([middle[name] for name in layer], gap, 1.0), strict=True))
    return Places(tuple(tuple(row) for row in layers), across, height)


MOST_MEMBERS = 40
#: More members than this, or more of them in one layer, are not drawn: names would stand on each other.
MOST_BESIDE = 8
IN_PHASE, AGAINST, PATH, BRANCH, HELD = style.PREDICTED, style.RESIDUAL, style.PREDICTED, style.CHOSEN, style.INK
_PALE = "#d9d9d9"
_BAND = "#f6d55c"
_LAYER_PX, _ROOM_PX = 92, 150
_SMALLEST_PX, _LARGEST_PX, _PLAIN_PX = 7.0, 34.0, 17.0
_NAME_WIDTH, _LONGEST_NAME = 13, 26
_WIDTHS = (1.2, 5.0)
_BEND = 0.3


@dataclass(frozen=True)
class View:
    """What a picture of a structure brings out, as an entry of its menu."""

    name: str  #: Text of the entry
    colours: Mapping[str, str]  #: Member → colour; the others are pale
    sizes: Mapping[str, float] = field(default_factory=dict)  #: Member → diameter [px]; the others have the usual one
    joints: frozenset[int] = frozenset()  #: Joints, by position, that are marked


def can_be_drawn(structure: Structure) -> bool:
    """Whether the picture of a structure stays readable."""
    if len(structure.members) > MOST_MEMBERS:
        return False
    return all(len(layer) <= MOST_BESIDE for layer in _places(structure).layers)


def mode_view(structure: Structure, name: str, shape: NDArray[np.complex128]) -> View:
    """A mode: the size of a member says how far it moves, its colour whether with the largest or against it."""
    largest = shape[int(np.argmax(np.abs(shape)))]
    relative = shape / largest
    return View(
        name,
        {
            member.name: _between(AGAINST, "#e9e3d8", IN_PHASE, float(np.cos(cmath.phase(complex(part)))))
            for member, part in zip(structure.members, relative, strict=True)
        },
        {
            member.name: _SMALLEST_PX + (_LARGEST_PX - _SMALLEST_PX) * float(abs(part))
            for member, part in zip(structure.members, relative, strict=True)
        },
    )


def chain_view(structure: Structure, chain: Chain, name: str) -> View:
    """A chain: its path from the sources on, the branch that hangs on it, and the joints that it goes through."""
    colours = {member: PATH for group in chain.path for member in group}
    colours |= {member: BRANCH for group in chain.branch for member in group}
    if chain.held != GROUND:
        colours[chain.held] = HELD
    groups = (*chain.path, (chain.held,))
    ways = [*pairwise(groups), *pairwise(chain.branch)]
    if chain.branch:
        ways += [(group, chain.branch[0]) for group in chain.path]
    inside = {(a, b) for group in (*chain.path, *chain.branch) for a in group for b in group if a != b}
    taken = {(a, b) for one, other in ways for a in one for b in other} | inside
    joints = frozenset(
        k for k, joint in enumerate(structure.joints) if joint.between in taken or joint.between[::-1] in taken
    )
    return View(name, colours, joints=joints)


def structure_diagram(structure: Structure, sources: Sequence[Source], views: Sequence[View], title: str) -> go.Figure:
    """Members in layers from the ground up, joints as lines that are thicker where they are stiffer.

    Sources are named at the member that they push, with a minus sign at the one they push against. The first view is
    shown, the others are in a menu. `title` is plain text, as `style.label` makes it.
    """
    places = _places(structure)
    at = {name: (places.across[name], float(places.height[name])) for name in places.across}
    drawn = style.figure(title, _ROOM_PX + _LAYER_PX * len(places.layers))
    views = views or [View("", dict.fromkeys(structure.names, PATH))]
    lines = [_course(joint, at, places) for joint in structure.joints]
    style.curve(drawn, **_band(lines, views[0].joints), colour=_BAND, width=11, showlegend=False)
    for line, width in zip(lines, _widths(structure.joints), strict=True):
        style.curve(drawn, *line, style.MUTED, width=width, showlegend=False)
    x, y = [float(np.mean(x)) for x, _ in lines], [float(np.mean(y)) for _, y in lines]
    told = [_told_joint(joint) for joint in structure.joints]
    style.points(drawn, x, y, "rgba(0,0,0,0)", None, "%{text}", size=14, text=told, showlegend=False)
    names = structure.names
    told = [f"{style.label(one.name)}: {number_text(one.mass_kg)} kg" for one in structure.members]
    look = {**_markers(names, views[0]), "opacity": 1.0, "line": {"color": style.INK, "width": 1.2}}
    x, y = [at[name][0] for name in names], [at[name][1] for name in names]
    style.points(drawn, x, y, None, None, "%{text}", marker=look, text=told, showlegend=False)
    below = {"yshift": -20, "yanchor": "top", "bgcolor": "rgba(255,255,255,0.8)", "borderpad": 1}
    for name in names:
        style.words(drawn, _told_member(name, sources), *at[name], size=11, **below)
    style.rule(drawn, 0, style.INK, across=True, dash="solid", width=3)
    style.words(drawn, "ground", 1, 0, xref="paper", xanchor="right", yanchor="top")
    drawn.update_xaxes(visible=False, range=[0, 1], fixedrange=True)
    drawn.update_yaxes(visible=False, range=[-0.3, len(places.layers) + 0.35], fixedrange=True)
    drawn.update_layout(margin={"l": 10, "r": 10, "b": 10})
    if len(views) > 1:
        _add_menu(drawn, names, views, lines)
    return drawn


def _add_menu(
    drawn: go.Figure, names: Sequence[str], views: Sequence[View], lines: Sequence[tuple[list[float], list[float]]]
) -> None:
    band, nodes = 0, len(drawn.data) - 1
    buttons = []
    for view in views:
        marked, markers = _band(lines, view.joints), _markers(names, view)
        at = {"x": list(drawn.data[nodes].x), "y": list(drawn.data[nodes].y)}
        change = {
            "x": [marked["x"], at["x"]],
            "y": [marked["y"], at["y"]],
            "marker.color": [None, markers["color"]],
            "marker.size": [None, markers["size"]],
        }
        buttons.append({"label": style.label(view.name, 48), "method": "restyle", "args": [change, [band, nodes]]})
    style.add_menu(drawn, buttons)


Line = list[float | None]


def _band(lines: Sequence[tuple[list[float], list[float]]], joints: frozenset[int]) -> dict[str, Line]:
    """Marked joints as one line with gaps; at least one point, so that a menu can change it."""
    x: Line = [None]
    y: Line = [None]
    for k in sorted(joints):
        x += [*lines[k][0], None]
        y += [*lines[k][1], None]
    return {"x": x, "y": y}


def _markers(names: Sequence[str], view: View) -> dict[str, list[float] | list[str]]:
    return {
        "color": [view.colours.get(name, _PALE) for name in names],
        "size": [view.sizes.get(name, _PLAIN_PX) for name in names],
    }


def _places(structure: Structure) -> Places:
    return layered_places(structure.names, [joint.between for joint in structure.joints], GROUND)


def _course(joint: Joint, at: Mapping[str, tuple[float, float]], places: Places) -> tuple[list[float], list[float]]:
    """The line of a joint: straight down to the ground, straight between layers, bent past what stands between."""
    one, other = joint.between
    if GROUND in joint.between:
        x, y = at[other if one == GROUND else one]
        return [x, x], [y, 0.0]
    (x0, y0), (x1, y1) = at[one], at[other]
    if y0 != y1:
        return [x0, x1], [y0, y1]
    layer = places.layers[places.height[one] - 1]
    if abs(layer.index(one) - layer.index(other)) == 1:
        return [x0, x1], [y0, y1]
    along = np.linspace(0.0, 1.0, 15)
    bent = y0 + _BEND * 4.0 * along * (1.0 - along)
    return (x0 + (x1 - x0) * along).tolist(), bent.tolist()


def _widths(joints: Sequence[Joint]) -> list[float]:
    """Widths of lines [px], growing with the logarithm of the stiffness."""
    powers = np.log10([joint.stiffness_n_per_m for joint in joints])
    span = max(float(np.ptp(powers)), 1e-9)
    thin, thick = _WIDTHS
    return (thin + (thick - thin) * (powers - powers.min()) / span).tolist()


def _told_joint(joint: Joint) -> str:
    names = " – ".join(style.label(name) for name in joint.between)
    stiffness = number_text(joint.stiffness_n_per_m * 1e-6)
    return f"{names}: {stiffness} N/µm, ψ = {number_text(joint.dissipation)}"


def _told_member(name: str, sources: Sequence[Source]) -> str:
    text = "<br>".join(textwrap.wrap(style.label(name, _LONGEST_NAME), _NAME_WIDTH)[:2])
    pushing = [style.label(one.name, 10) for one in sources if one.member == name]
    pushing += [f"−{style.label(one.name, 10)}" for one in sources if one.against == name]
    return text + (f"<br><b>{', '.join(pushing[:3])}{' …' if len(pushing) > 3 else ''}</b>" if pushing else "")


def _between(low: str, middle: str, high: str, at: float) -> str:
    """A colour between `low` (−1), `middle` (0) and `high` (1)."""
    end, share = (high, at) if at >= 0 else (low, -at)
    parts = [(int(middle[k : k + 2], 16), int(end[k : k + 2], 16)) for k in (1, 3, 5)]
    return "#" + "".join(f"{round(a + (b - a) * share):02x}" for a, b in parts)
