"""What the Sensors page says in words and numbers: the facts of what is shown, and the groups."""

from __future__ import annotations

from typing import Any

from selector.figures import style
from selector.figures.run_errors import KINDS
from selector.figures.sensor_tree import group_colours
from selector.sensors.groups import dendrogram
from selector.workbench.live import View

_INFINITE_VIF = 1e12
GROUP_COLUMNS = ("group", "sensor", "represents", "shown", "because")


def facts(view: View) -> list[tuple[str, str]]:
    """The set that is shown and its numbers: what, value."""
    model = view.fixed.models[view.response]
    kind = KINDS[view.exploration.parts]
    worst = max(view.faults, key=lambda one: one.worst_um)
    n = len(view.cut.groups)
    return [
        ("taken by hand" if view.is_taken else f"λ = {view.level:.6g}", f"{n} group{'s' * (n != 1)}"),
        ("sensors shown", ", ".join(view.fixed.sensors)),
        (f"{view.response} on left-out {kind}, set fixed", f"{style.number(model.heldout_rmse_um)} µm"),
        ("in sample", f"{style.number(model.rmse_um)} µm"),
        ("R², adjusted R²", f"{model.r2:.4f}, {model.adjusted_r2:.4f}"),
        ("largest VIF", style.number(view.fixed.largest_vif) if view.fixed.largest_vif < _INFINITE_VIF else "∞"),
        ("worst fault", f"{style.number(worst.worst_um)} µm"),
    ]


def groups(view: View) -> list[dict[str, Any]]:
    """Groups with who stands for them and why, in the colours of the pictures."""
    tree = dendrogram(view.exploration.grouping.similarity.matrix)
    members = view.cut.step.partition.members
    colours = group_colours(tree, members)
    shown = set(view.fixed.sensors)
    return [
        {
            "colour": colours.get(own[0], style.MUTED),
            "sensors": group.sensors,
            "representatives": group.representatives,
            "shown": [name for name in group.sensors if name in shown],
            "because": group.because,
        }
        for own, group in zip(members, view.cut.groups, strict=True)
    ]


def group_rows(view: View) -> list[list[object]]:
    """A row for each sensor under `GROUP_COLUMNS`."""
    return [
        [number, name, name in group["representatives"], name in group["shown"], group["because"]]
        for number, group in enumerate(groups(view), start=1)
        for name in group["sensors"]
    ]
