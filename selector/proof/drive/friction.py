"""Axes whose simulation lacks friction or has the wrong law of it: by sign, direction, speed near rest, position."""

from __future__ import annotations

from selector.proof.drive.recorded import Drive, plan, plus

_OWN_VALUE = ("missing-physics", "miscalibrated")
"""A value of the simulation that is wrong may be called either."""

DRIVES = (
    Drive(
        plan("drive.coulomb/small"),
        "drive.coulomb",
        plus("coulomb_n"),
        {"friction": False, "slips": True},
        place="guide",
    ),
    Drive(
        plan(
            "drive.coulomb/absorbed",
            ("small", "absorbed"),
            tolerated=("drive.viscous",),
            note="The viscous coefficient was fitted until the current agreed at one speed; the last run has others.",
        ),
        "drive.coulomb",
        plus("coulomb_n"),
        {"friction": False, "styles": ("one speed", "strokes", "other"), "colour": "ar"},
        world={"refitted": ("viscous_ns_per_m",)},
        place="guide",
    ),
    Drive(
        plan(
            "drive.coulomb/mass",
            ("small", "absorbed"),
            tolerated=("drive.mass", "drive.viscous"),
            note="Mass and viscous coefficient were fitted without it and took in what they could.",
        ),
        "drive.coulomb",
        plus("coulomb_n"),
        {"friction": False, "styles": ("strokes", "gentle", "other"), "jitter_s": 0.0},
        world={"refitted": ("table_kg", "viscous_ns_per_m"), "names": ("x", "F"), "responses": ("x", "F")},
        channels=("x", "F"),
        place="guide",
    ),
    Drive(
        plan("drive.coulomb/one-way", ("small", "absorbed"), note="One-way runs hide it in the offset."),
        "drive.coulomb",
        plus("coulomb_n"),
        {"friction": False, "styles": ("one way", "one way", "other")},
        place="guide",
    ),
    Drive(
        plan("drive.asymmetric_friction/small"),
        "drive.asymmetric_friction",
        lambda axis, size: axis._replace(
            coulomb_by_direction=size, viscous_by_direction=size * axis.coulomb_n / axis.viscous_ns_per_m / 0.1
        ),
        {"styles": ("strokes", "sines", "other")},
        world={"first": 0.02},
        place="guide",
    ),
    Drive(
        plan("drive.asymmetric_friction/viscous", ("small", "ruled out in E")),
        "drive.asymmetric_friction",
        plus("viscous_by_direction"),
        {"friction": False, "styles": ("strokes", "strokes", "sines"), "colour": "heavy-tailed", "coarse_scale": True},
        {"viscous_ns_per_m": 700.0},
        world={"first": 0.02},
        place="guide",
    ),
    Drive(
        plan(
            "drive.stribeck/creeping",
            ("small",),
            note="Friction that falls with speed below some mm/s; the simulation has the level of higher speeds.",
        ),
        "drive.stribeck",
        plus("break_away_n"),
        {"styles": ("creeping", "creeping", "other")},
        {"stribeck_m_per_s": 0.006},
        world={"first": 5.0},
        place="guide",
    ),
    Drive(
        plan("drive.stribeck/rare", ("rare",), tolerated=("drive.coulomb",)),
        "drive.stribeck",
        plus("break_away_n"),
        {"styles": ("strokes", "strokes", "other")},
        {"stribeck_m_per_s": 0.006},
        world={"first": 20.0},
        place="guide",
    ),
    Drive(
        plan("drive.viscous/small", verdicts=_OWN_VALUE),
        "drive.viscous",
        plus("viscous_ns_per_m"),
        {"styles": ("strokes", "sines", "other"), "colour": "ar"},
        world={"first": 30.0},
        place="guide",
    ),
    Drive(
        plan(
            "drive.viscous/absorbed",
            ("small", "absorbed"),
            tolerated=("drive.coulomb",),
            verdicts=_OWN_VALUE,
            note="The Coulomb level was fitted until the current agreed at one speed.",
        ),
        "drive.viscous",
        plus("viscous_ns_per_m"),
        {"styles": ("one speed", "strokes", "sines")},
        world={"first": 60.0, "refitted": ("coulomb_n",)},
        place="guide",
    ),
    Drive(
        plan("drive.viscous/ruled-out", ("small", "ruled out in E"), verdicts=_OWN_VALUE),
        "drive.viscous",
        plus("viscous_ns_per_m"),
        {"styles": ("sines", "strokes", "gentle"), "colour": "quantised", "coarse_scale": True},
        {"feed_forward": 1.0},
        world={"first": 30.0},
        place="guide",
    ),
    Drive(
        plan("drive.varying_damping/small", tolerated=("drive.viscous",)),
        "drive.varying_damping",
        plus("viscous_by_position_per_m"),
        {"styles": ("strokes", "gentle", "other"), "fastest": 0.2},
        {"viscous_ns_per_m": 900.0},
        world={"first": 0.3},
        place="guide",
    ),
    Drive(
        plan("drive.varying_damping/ruled-out", ("small", "ruled out in E"), tolerated=("drive.viscous",)),
        "drive.varying_damping",
        plus("viscous_by_position_per_m"),
        {"friction": False, "styles": ("sines", "strokes", "other"), "fastest": 0.2, "coarse_scale": True},
        {"viscous_ns_per_m": 700.0},
        world={"first": 0.3},
        place="guide",
    ),
)
SCENARIOS = tuple(drive.scenario for drive in DRIVES)
