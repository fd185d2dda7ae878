"""Where does each part of a network stand in a picture: in layers from one part up, with few lines that cross."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

_SWEEPS = 12


@dataclass(frozen=True)
class Places:
    """Places of the parts of a network.

    Attributes
    ----------
    layers : tuple of tuple of str
        Names from the layer next to the root up, each from left to right.
    across : mapping of str to float
        Name → place from the left (0) to the right (1).
    height : mapping of str to int
        Name → number of its layer, 1 next to the root.
    """

    layers: tuple[tuple[str, ...], ...]
    across: Mapping[str, float]
    height: Mapping[str, int]


def layered_places(names: Sequence[str], links: Sequence[tuple[str, str]], root: str) -> Places:
    """Layers by the number of links to `root`; within a layer in the order that lets the fewest links cross.

    Parameters
    ----------
    names : sequence of str
        All parts but the root; each has a way to it.
    links : sequence of (str, str)
        What is joined with what.
    root : str
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
    best, fewest = layers, _crossings(layers, links)
    for sweep in range(_SWEEPS):
        upwards = sweep % 2 == 0
        layers = _sorted(layers, beside, upwards)
        crossed = _crossings(layers, links)
        if crossed < fewest:
            best, fewest = layers, crossed
    del height[root]
    return Places(tuple(tuple(row) for row in best), _across(best, beside), height)


def _sorted(layers: list[list[str]], beside: Mapping[str, list[str]], upwards: bool) -> list[list[str]]:
    """Each layer in the order of the middles of what its parts are joined with, in the layers done before."""
    place = {name: (k + 0.5) / len(layer) for layer in layers for k, name in enumerate(layer)}
    made: dict[int, list[str]] = {}
    order = range(len(layers)) if upwards else reversed(range(len(layers)))
    done: set[str] = set()
    for number in order:
        middle = {}
        for name in layers[number]:
            near = [place[other] for other in beside[name] if other in done]
            middle[name] = sum(near) / len(near) if near else place[name]
        made[number] = [name for *_, name in sorted((middle[name], place[name], name) for name in layers[number])]
        place |= {name: (k + 0.5) / len(made[number]) for k, name in enumerate(made[number])}
        done |= set(layers[number])
    return [made[number] for number in range(len(layers))]


def _crossings(layers: list[list[str]], links: Sequence[tuple[str, str]]) -> int:
    """Links that cross, and parts that a link within a layer passes by."""
    at = {name: (number, k) for number, layer in enumerate(layers) for k, name in enumerate(layer)}
    known = [tuple(sorted((at[a], at[b]))) for a, b in links if a in at and b in at]
    passed = sum(abs(a[1] - b[1]) - 1 for a, b in known if a[0] == b[0])
    between = [(a, b) for a, b in known if a[0] != b[0]]
    return passed + sum(
        (a[1] - c[1]) * (b[1] - d[1]) < 0 for (a, b), (c, d) in combinations(between, 2) if a[0] == c[0]
    )


def _across(layers: list[list[str]], beside: Mapping[str, list[str]]) -> dict[str, float]:
    """Places across: near what a part is joined with, but no closer together than the fullest layer allows."""
    widest = max(len(layer) for layer in layers)
    gap = 1.0 / widest
    place = {name: (k + 0.5) / len(layer) for layer in layers for k, name in enumerate(layer)}
    for _ in range(_SWEEPS):
        for layer in layers:
            wanted = [
                sum(near) / len(near) if (near := [place[o] for o in beside[name] if o in place]) else place[name]
                for name in layer
            ]
            place |= dict(zip(layer, _apart(wanted, gap), strict=True))
    return place


def _apart(wanted: Sequence[float], gap: float) -> list[float]:
    """Places near the wanted ones, in this order, `gap` apart at least, between half a gap from both edges."""
    placed: list[float] = []
    for k, want in enumerate(wanted):
        least = gap / 2 if k == 0 else placed[-1] + gap
        placed.append(max(want, least))
    most = 1.0 - gap / 2
    for k in reversed(range(len(placed))):
        placed[k] = min(placed[k], most)
        most = placed[k] - gap
    return placed
