"""Axes whose simulation lacks friction, or what is between motor and table: play, elasticity, errors of the lead."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from proving_ground.concealment import Measure, ruled_out
from proving_ground.drive.recorded import FORCE, Drive
from proving_ground.world import Change, plus, scenarios_of

OWN_VALUE = ("missing-physics", "miscalibrated")
"""A value of the simulation that is wrong may be called either."""

_guide = partial(Drive.of, place="guide")
_viscous = partial(_guide, change=plus("viscous_ns_per_m"), verdicts=OWN_VALUE)
_coulomb, _peak = plus("coulomb_n"), plus("break_away_n")
_by_position = partial(_guide, change=plus("viscous_by_position_per_m"), tolerated=("drive.viscous",), first=0.3)

_FRICTION = (
    _guide("drive.coulomb/small", _coulomb, {"friction": False, "slips": True}),
    _guide(
        "drive.coulomb/absorbed",
        _coulomb,
        {"friction": False, "styles": ("one speed", "strokes", "other"), "colour": "ar"},
        hidden=("small", "absorbed"),
        tolerated=("drive.viscous",),
        note="The viscous coefficient was fitted until the current agreed at one speed; the last run has others.",
        world={"refitted": ("viscous_ns_per_m",)},
    ),
    _guide(
        "drive.coulomb/mass",
        _coulomb,
        {"friction": False, "styles": ("strokes", "gentle", "other"), "jitter_s": 0.0},
        hidden=("small", "absorbed"),
        tolerated=("drive.mass", "drive.viscous"),
        note="Mass and viscous coefficient were fitted without it and took in what they could.",
        world={"refitted": ("table_kg", "viscous_ns_per_m"), **FORCE},
        channels=("x", "F"),
    ),
    _guide(
        "drive.coulomb/one-way",
        _coulomb,
        {"friction": False, "styles": ("one way", "one way", "other")},
        hidden=("small", "absorbed"),
        note="One-way runs hide it in the offset.",
    ),
    _guide(
        "drive.asymmetric_friction/small",
        lambda axis, size: axis._replace(
            coulomb_by_direction=size, viscous_by_direction=size * axis.coulomb_n / axis.viscous_ns_per_m / 0.1
        ),
        {"styles": ("strokes", "sines", "other")},
        first=0.02,
    ),
    _guide(
        "drive.asymmetric_friction/viscous",
        plus("viscous_by_direction"),
        {"friction": False, "styles": ("strokes", "strokes", "sines"), "colour": "heavy-tailed", "coarse_scale": True},
        {"viscous_ns_per_m": 700.0},
        hidden=("small", ruled_out("E")),
        first=0.02,
    ),
    _guide(
        "drive.stribeck/creeping",
        _peak,
        {"styles": ("creeping", "creeping", "other")},
        {"stribeck_m_per_s": 0.006},
        note="Friction that falls with speed below some mm/s; the simulation has the level of higher speeds.",
        first=5.0,
    ),
    _guide(
        "drive.stribeck/rare",
        _peak,
        {"styles": ("strokes", "strokes", "other")},
        {"stribeck_m_per_s": 0.006},
        hidden=("rare",),
        tolerated=("drive.coulomb",),
        first=20.0,
    ),
    _viscous("drive.viscous/small", bench={"styles": ("strokes", "sines", "other"), "colour": "ar"}, first=30.0),
    _viscous(
        "drive.viscous/absorbed",
        bench={"styles": ("one speed", "strokes", "sines")},
        hidden=("small", "absorbed"),
        tolerated=("drive.coulomb",),
        note="The Coulomb level was fitted until the current agreed at one speed.",
        first=60.0,
        world={"refitted": ("coulomb_n",)},
    ),
    _viscous(
        "drive.viscous/ruled-out",
        bench={"styles": ("sines", "strokes", "gentle"), "colour": "quantised", "coarse_scale": True},
        start={"feed_forward": 1.0},
        hidden=("small", ruled_out("E")),
        first=30.0,
    ),
    _by_position(
        "drive.varying_damping/small",
        bench={"styles": ("strokes", "gentle", "other"), "fastest": 0.2},
        start={"viscous_ns_per_m": 900.0},
    ),
    _by_position(
        "drive.varying_damping/ruled-out",
        bench={"friction": False, "styles": ("sines", "strokes", "other"), "fastest": 0.2, "coarse_scale": True},
        start={"viscous_ns_per_m": 700.0},
        hidden=("small", ruled_out("E")),
    ),
)


def softer(axis_compliance: float) -> Change:
    """The change that adds a compliance of size × this [m/N] to the screw."""
    return lambda axis, size: axis._replace(
        stiffness_n_per_m=1.0 / (1.0 / axis.stiffness_n_per_m + size * axis_compliance)
    )


def _screw(
    name: str,
    change: Change,
    bench: Mapping[str, Any],
    start: Mapping[str, float],
    first: float,
    *hidden: str | Measure,
    **rest: Any,
) -> Drive:
    """Of a loop that is closed on the motor."""
    told: dict[str, Any] = {"channels": ("E",), "place": "screw", **rest}
    return Drive.of(name, change, {"on_scale": False, **bench}, start, first=first, hidden=hidden, **told)


_PLAY, _SOFTER, _LEAD = plus("play_m", 1e-6), softer(1e-10), plus("lead_m", 1e-6)
_VARYING: Mapping[str, Any] = {"channels": ("E", "I"), "tolerated": ("drive.elasticity",)}

_JOINTS = (
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
    _screw("drive.pitch_error/lead", _LEAD, {}, {"lead_pitch_m": 0.01}, 0.1, "small", ruled_out("I")),
    _screw(
        "drive.pitch_error/half-lead",
        _LEAD,
        {"styles": ("cycles", "cycles", "cycles"), "colour": "cycle-locked"},
        {"lead_pitch_m": 0.008},
        0.1,
        ruled_out("I"),
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
DRIVES = (*_FRICTION, *_JOINTS)
SCENARIOS = scenarios_of(drive.case for drive in DRIVES)
