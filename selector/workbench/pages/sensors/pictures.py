"""The pictures, words and numbers of the Sensors page: drawn whole once, after that only what a move changes."""

import html
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import plotly.graph_objects as go

from selector.figures import proof, style
from selector.figures.grouping import (
    CutShown,
    group_colours,
    machine_changes,
    machine_picture,
    tree_changes,
    tree_picture,
    tree_title,
)
from selector.figures.style import Changes, changed
from selector.number_text import number_text
from selector.selection.exploration import HeldOutPart
from selector.sensors.groups import Dendrogram, dendrogram
from selector.workbench.live import View
from selector.workbench.pages.sensors.machine import Pins

NAMES = ("sets", "runs", "tree", "machine")
NOTES = {
    "sets": "Each point is a set of sensors. Click one, or move the dial above, to take it.",
    "tree": "Dashed: λ. Colours: groups; grey: sensors that are alone.",
    "machine": "Colours as in the tree; rings: the set that is shown. Drag a pin to where its sensor sits.",
    "runs": "Each run predicted by coefficients that were fitted without it; the sensors are fixed.",
}
UNUSED = "#d4d4d4"
_HEIGHT = 300
_TREE = (110, 12, 380)  #: Room of the tree, height of a sensor in it, and least height [px].
_MARGINS = {
    "tree": {"t": 24, "b": 84, "l": 14},
    "machine": {"t": 10, "b": 84, "l": 56, "r": 10},
    "sets": {"t": 10, "b": 96, "l": 60, "r": 14},
    "runs": {"t": 24, "b": 76, "l": 90, "r": 110},
}
#: Width of a letter of a name, bold ones included, and what stands beside a name.
_LETTER_PX, _BESIDE_LETTERS_PX = 6.7, 24
_LONGEST_BESIDE_PIN = 20  #: Two views stand side by side.


def frames(view: View, pins: Pins, photos: Mapping[str, str]) -> dict[str, go.Figure]:
    """Every picture with what it shows now."""
    exploration = view.exploration
    tree = dendrogram(exploration.grouping.similarity.matrix)
    room, each, least = _TREE
    drawn = {
        "tree": tree_picture(tree, "", max(least, room + each * len(tree.leaf_order))),
        "machine": machine_picture(pins.names, pins.points_m, pins.outline_m, "", photos),
        "sets": proof.set_errors_picture(_HEIGHT),
        "runs": proof.run_errors_picture(_runs(view), ""),
    }
    filled = {name: changed(drawn[name], what) for name, what in _changes(view, pins, tree).items()}
    for one in filled.values():
        # the page gives the width; titles are headings
        legend = {"yref": "container", "y": 0.0, "yanchor": "bottom"}
        one.update_layout(title=None, width=None, height=None, autosize=True, legend=legend)
    for name, margin in (_MARGINS | _name_margins(view)).items():
        # margins that follow the labels would lay every picture out twice
        filled[name].update_layout(margin={**_MARGINS[name], **margin})
        filled[name].update_xaxes(automargin=False).update_yaxes(automargin=False)
    return {name: filled[name] for name in NAMES}


def _name_margins(view: View) -> dict[str, dict[str, float]]:
    """Room for the longest name, whichever sensors and runs are shown."""

    def room(names: Iterable[str]) -> float:
        return _BESIDE_LETTERS_PX + _LETTER_PX * max(len(html.unescape(style.label(name))) for name in names)

    runs = max(_MARGINS["runs"]["l"], room(one.name for one in _runs(view)))
    return {"tree": {"r": room(view.exploration.question.sensors)}, "runs": {"l": runs}}


def moved(view: View, pins: Pins) -> dict[str, list[tuple[tuple[str | int, ...], Any]]]:
    """What a move changes in every picture: paths and values."""
    tree = dendrogram(view.exploration.grouping.similarity.matrix)
    return {name: list(what.items()) for name, what in _changes(view, pins, tree).items()}


def titles(view: View) -> dict[str, str]:
    """What every picture says now, as text that is no markup."""
    kind = proof.KINDS[view.exploration.parts]
    left = set(view.exploration.folds.runs.runs) - {one.name for one in _runs(view)} if kind == "runs" else ()
    without = f"; not {style.listed(sorted(left))}, where a sensor is missing" if left else ""
    said = {
        "tree": tree_title(_cut(view)),
        "machine": f"{len(view.fixed.sensors)} of {len(view.exploration.available)} sensors: "
        + style.listed(view.fixed.sensors),
        "sets": f"{style.label(view.response)}: error of sets on left-out {kind}",
        "runs": proof.run_errors_title(view.response, _runs(view), kind) + without,
    }
    return {name: html.unescape(title) for name, title in said.items()}


def _changes(view: View, pins: Pins, tree: Dendrogram) -> dict[str, Changes]:
    exploration = view.exploration
    sensors = exploration.question.sensors
    cut = _cut(view)
    colour_of = {sensors[i]: colour for i, colour in group_colours(tree, cut.groups).items()}
    usable = {name: colour_of.get(name, style.MUTED) for name in sensors}
    colours = [usable.get(name, UNUSED) for name in pins.names]
    return {
        "tree": tree_changes(tree, sensors, cut, is_live=True),
        "machine": machine_changes(pins.names, pins.points_m, colours, view.fixed.sensors, _LONGEST_BESIDE_PIN),
        "sets": _set_changes(view),
        "runs": proof.run_error_changes(view.response, _runs(view)),
    }


def _set_changes(view: View) -> Changes:
    def errors(sets: Mapping[int, tuple[str, ...]]) -> list[proof.SetError]:
        models = {sets[size]: view.exploration.fixed(sets[size]).models[view.response] for size in sorted(sets)}
        return [proof.SetError(sensors, model.heldout_rmse_um) for sensors, model in models.items()]

    model = view.fixed.models[view.response]
    n = sum(part.n_samples for part in model.parts)
    before_um = (sum(part.n_samples * part.before_rmse_um**2 for part in model.parts) / n) ** 0.5 if n else 0.0
    taken = proof.SetError(view.fixed.sensors, model.heldout_rmse_um)
    everywhere, of_cut = errors(view.exploration.best_sets), errors(view.cut.best_sets)
    return proof.set_error_changes(view.response, everywhere, of_cut, taken, before_um, view.target_um)


def _runs(view: View) -> Sequence[HeldOutPart]:
    return view.fixed.models[view.response].parts


def _cut(view: View) -> CutShown:
    position = {name: i for i, name in enumerate(view.exploration.question.sensors)}
    step = view.cut.step
    representatives = frozenset(position[name] for name in view.cut.representatives)
    shown = frozenset(position[name] for name in view.fixed.sensors if name in position)
    return CutShown(view.level, step.low, step.high, step.partition.members, representatives, shown)


_INFINITE_VIF = 1e12
GROUP_COLUMNS = ("group", "sensor", "represents", "shown", "because")


def facts(view: View) -> list[tuple[str, str]]:
    """The set that is shown and its numbers: what, value."""
    model = view.fixed.models[view.response]
    kind = proof.KINDS[view.exploration.parts]
    worst = max(view.faults, key=lambda one: one.worst_um)
    n = len(view.cut.groups)
    reached = "" if view.target_um is None else ", within the target"
    if view.target_um is not None and not model.heldout_rmse_um <= view.target_um:
        reached = ", above the target"
    return [
        ("sensors shown", ", ".join(view.fixed.sensors)),
        (f"{view.response} on left-out {kind}, set fixed", f"{number_text(model.heldout_rmse_um)} µm{reached}"),
        ("taken by hand" if view.is_taken else f"λ = {view.level:.6g}", f"{n} group{'s' * (n != 1)}"),
        ("in sample", f"{number_text(model.rmse_um)} µm"),
        ("R², adjusted R²", f"{model.r2:.4f}, {model.adjusted_r2:.4f}"),
        ("largest VIF", number_text(view.fixed.largest_vif) if view.fixed.largest_vif < _INFINITE_VIF else "∞"),
        ("worst fault", f"{number_text(worst.worst_um)} µm"),
    ]


def groups(view: View) -> list[dict[str, Any]]:
    """Groups with who stands for them and why, in the colours of the pictures."""
    tree = dendrogram(view.exploration.grouping.similarity.matrix)
    members = view.cut.step.partition.members
    colours = group_colours(tree, members)
    shown = set(view.fixed.sensors)
    told = ("sensors", "representatives", "because")
    return [
        {name: getattr(group, name) for name in told}
        | {"colour": colours.get(own[0], style.MUTED), "shown": [name for name in group.sensors if name in shown]}
        for own, group in zip(members, view.cut.groups, strict=True)
    ]


def group_rows(view: View | None) -> list[list[object]]:
    """A row for each sensor under `GROUP_COLUMNS`; none where nothing is seen."""
    return [
        [number, name, name in group["representatives"], name in group["shown"], group["because"]]
        for number, group in enumerate(groups(view) if view else (), start=1)
        for name in group["sensors"]
    ]
