"""Axes whose simulation lacks friction or has the wrong law of it: by sign, direction, speed near rest, position."""

from __future__ import annotations

from functools import partial

from selector.proof.drive.recorded import lacking, plus

OWN_VALUE = ("missing-physics", "miscalibrated")
"""A value of the simulation that is wrong may be called either."""

_guide = partial(lacking, place="guide")
_viscous = partial(_guide, change=plus("viscous_ns_per_m"), verdicts=OWN_VALUE)
_coulomb, _peak = plus("coulomb_n"), plus("break_away_n")
_by_position = partial(_guide, change=plus("viscous_by_position_per_m"), tolerated=("drive.viscous",), first=0.3)
_FORCE = {"names": ("x", "F"), "responses": ("x", "F")}

DRIVES = (
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
        world={"refitted": ("table_kg", "viscous_ns_per_m"), **_FORCE},
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
        hidden=("small", "ruled out in E"),
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
        axis={"feed_forward": 1.0},
        hidden=("small", "ruled out in E"),
        first=30.0,
    ),
    _by_position(
        "drive.varying_damping/small",
        bench={"styles": ("strokes", "gentle", "other"), "fastest": 0.2},
        axis={"viscous_ns_per_m": 900.0},
    ),
    _by_position(
        "drive.varying_damping/ruled-out",
        bench={"friction": False, "styles": ("sines", "strokes", "other"), "fastest": 0.2, "coarse_scale": True},
        axis={"viscous_ns_per_m": 700.0},
        hidden=("small", "ruled out in E"),
    ),
)
SCENARIOS = tuple(drive.scenario for drive in DRIVES)
