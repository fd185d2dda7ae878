"""Findings on a page: one entry a kind, with the runs named."""

from __future__ import annotations

from selector.findings import Finding, Where
from selector.workbench import parts


def texts(component) -> list[str]:
    if isinstance(component, str):
        return [component]
    if isinstance(component, (list, tuple)):
        return [text for one in component for text in texts(one)]
    return texts(getattr(component, "children", None) or [])


def test_findings_of_a_kind_are_one_entry_with_the_runs_named():
    gaps = [
        Finding("gap", "warning", f"Run r{k} has a gap of {k} min.", Where(run=f"r{k}"), suggestion="say --time-unit")
        for k in range(1, 9)
    ]
    other = Finding("gap", "info", "A short gap.", Where(run="r2", channel="T1"))
    # the worst stands first, whatever the order
    shown = parts.remarks([other, *gaps]).children
    assert len(shown) == 2
    first = shown[0].children
    assert "Run r1 has a gap of 1 min." in texts(first[0])
    assert texts(first[1]) == ["→ say “Unit of time”"]
    assert texts(first[2])[0] == "7 more like it: r2; r3; r4; r5; r6; r7; r8"
    assert "Run r8 has a gap of 8 min." in texts(first[2])
    assert "more like it" not in " ".join(texts(shown[1]))
