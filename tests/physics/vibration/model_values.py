"""A model file of three masses with a cut, chains of both ranges and two shafts, as plain values."""

from __future__ import annotations

import copy
from typing import Any

SMALL: dict[str, Any] = {
    "model": {"kind": "vibration", "name": "small"},
    "run": {"period_s": 0.001, "duration_s": 0.5},
    "members": {"workpiece": {"mass_kg": 20.0}, "tool": {"mass_kg": 5.0}, "bed": {"mass_kg": 800.0}},
    "joints": [
        {"between": ["workpiece", "bed"], "stiffness_n_per_m": 2e8, "dissipation": 0.3},
        {"between": ["tool", "bed"], "stiffness_n_per_m": 1e8, "dissipation": 0.25},
        {"between": ["bed", "ground"], "stiffness_n_per_m": 5e8, "dissipation": 0.4},
    ],
    "chains": [
        {"name": "low", "range": "low", "sources": ["spindle"], "path": ["workpiece", "bed"], "final": "workpiece"},
        {"name": "high", "range": "high", "sources": ["spindle"], "path": ["workpiece"], "final": "workpiece",
         "held": "bed"},
        {"name": "side", "range": "low", "sources": ["motor"], "path": [["bed"]], "branch": ["tool"], "final": "tool"},
    ],
    "sources": {
        "spindle": {
            "member": "workpiece", "against": "tool", "shaft": "spindle",
            "lines": [{"order": 1.0, "unbalance_kg_m": 1e-4}, {"order": 9.3, "force_n": 20.0, "phase_rad": 0.7}],
        },
        "motor": {
            "member": "bed", "shaft": "motor",
            "lines": [{"frequency_hz": 50.0, "force_n": 10.0}, {"order": 1.0, "force_n": 5.0}],
        },
    },
    "shafts": {"spindle": {"rpm": 1200.0}, "motor": {"of": "spindle", "ratio": 1.5}},
    "cutting": {
        "shaft": "spindle", "diameter_mm": 60.0, "feed_mm_per_rev": 0.2, "force_coefficient": 300.0,
        "depth_exponent": 1.0, "feed_exponent": 0.75, "speed_exponent": -0.15,
    },
}  # fmt: skip


def changed(*changes: tuple[str, Any]) -> dict[str, Any]:
    """`SMALL` with some keys set, or left out where the new value is ``...``; arrays count from 0."""
    new = copy.deepcopy(SMALL)
    for key, value in changes:
        inside: Any = new
        *path, last = [int(part) if part.isdigit() else part for part in key.split(".")]
        for part in path:
            inside = inside[part] if isinstance(part, int) else inside.setdefault(part, {})
        if value is ...:
            del inside[last]
        else:
            inside[last] = value
    return new
