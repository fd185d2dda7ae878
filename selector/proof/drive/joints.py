"""Axes whose simulation lacks what is between motor and table: play, elasticity, errors of the lead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from selector.proof.drive.recorded import Change, Drive, lacking, plus


def softer(axis_compliance: float) -> Change:
    """The change that adds a compliance of size × this [m/N] to the screw."""
    return lambda axis, size: axis._replace(
        stiffness_n_per_m=1.0 / (1.0 / axis.stiffness_n_per_m + size * axis_compliance)
    )


def _screw(
    name: str,
    change: Change,
    bench: Mapping[str, Any],
    axis: Mapping[str, float],
    first: float,
    *hidden: str,
    channels: tuple[str, ...] = ("E",),
    **rest: Any,
) -> Drive:
    """Of a loop that is closed on the motor."""
    on_motor = {"on_scale": False, **bench}
    return lacking(name, change, on_motor, axis, first=first, hidden=hidden, channels=channels, place="screw", **rest)


_PLAY, _SOFTER, _LEAD = plus("play_m", 1e-6), softer(1e-10), plus("lead_m", 1e-6)
_VARYING: Mapping[str, Any] = {"channels": ("E", "I"), "tolerated": ("drive.elasticity",)}

DRIVES = (
    _screw("drive.backlash/small", _PLAY, {}, {}, 0.1, "small"),
    _screw(
        "drive.backlash/one-way",
        _PLAY,
        {"styles": ("one way", "one way", "strokes"), "colour": "ar"},
        {},
        0.2,
        "absorbed",
        note="One-way strokes that turn once; offset takes most of it.",
    ),
    _screw(
        "drive.backlash/quantised",
        _PLAY,
        {"styles": ("gentle", "sines", "other"), "colour": "quantised"},
        {},
        0.2,
        "small",
    ),
    _screw("drive.elasticity/ramps", _SOFTER, {}, {}, 1.0, "absorbed", channels=("E", "I")),
    _screw(
        "drive.elasticity/friction",
        _SOFTER,
        {"styles": ("strokes", "sines", "other"), "colour": "heavy-tailed"},
        {"coulomb_n": 150.0},
        1.0,
        "absorbed",
        channels=("E", "I"),
        note="Wind-up by friction looks like play where accelerations are small; the ramps tell.",
        tolerated=("drive.backlash",),
    ),
    _screw(
        "drive.varying_stiffness/small",
        plus("compliance_per_m"),
        {"styles": ("strokes", "strokes", "other"), "fastest": 0.2},
        {"stiffness_n_per_m": 0.9e8},
        0.1,
        "small",
        **_VARYING,
    ),
    _screw(
        "drive.varying_stiffness/sines",
        plus("compliance_per_m"),
        {"styles": ("sines", "other", "strokes"), "fastest": 0.25, "colour": "ar"},
        {"stiffness_n_per_m": 0.8e8, "coulomb_n": 160.0},
        0.1,
        "absorbed",
        **_VARYING,
    ),
    _screw("drive.pitch_error/lead", _LEAD, {}, {"lead_pitch_m": 0.01}, 0.1, "small", "ruled out in I"),
    _screw(
        "drive.pitch_error/half-lead",
        _LEAD,
        {"styles": ("cycles", "cycles", "cycles"), "colour": "cycle-locked"},
        {"lead_pitch_m": 0.008},
        0.1,
        "ruled out in I",
        note="The machine repeats a cycle, and so does half of the noise.",
    ),
    _screw(
        "drive.pitch_error/cumulative",
        plus("lead_bow_per_m", 1e-6),
        {"fastest": 0.2},
        {},
        10.0,
        "small",
        "absorbed",
        note="A bow over the travel; no wave.",
    ),
)
SCENARIOS = tuple(drive.scenario for drive in DRIVES)
