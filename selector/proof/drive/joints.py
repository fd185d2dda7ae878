"""Axes whose simulation lacks what is between motor and table: play, elasticity, errors of the lead."""

from __future__ import annotations

from selector.proof.drive.recorded import Change, Drive, plan, plus

_ON_MOTOR = {"on_scale": False}


def softer(axis_compliance: float) -> Change:
    """The change that adds a compliance of size × this [m/N] to the screw."""
    return lambda axis, size: axis._replace(
        stiffness_n_per_m=1.0 / (1.0 / axis.stiffness_n_per_m + size * axis_compliance)
    )


DRIVES = (
    Drive(
        plan("drive.backlash/small"),
        "drive.backlash",
        plus("play_m", 1e-6),
        _ON_MOTOR,
        world={"first": 0.1},
        channels=("E",),
        place="screw",
    ),
    Drive(
        plan("drive.backlash/one-way", ("absorbed",), note="One-way strokes that turn once; offset takes most of it."),
        "drive.backlash",
        plus("play_m", 1e-6),
        _ON_MOTOR | {"styles": ("one way", "one way", "strokes"), "colour": "ar"},
        world={"first": 0.2},
        channels=("E",),
        place="screw",
    ),
    Drive(
        plan("drive.backlash/quantised"),
        "drive.backlash",
        plus("play_m", 1e-6),
        _ON_MOTOR | {"styles": ("gentle", "sines", "other"), "colour": "quantised"},
        world={"first": 0.2},
        channels=("E",),
        place="screw",
    ),
    Drive(
        plan("drive.elasticity/ramps", ("absorbed",)),
        "drive.elasticity",
        softer(1e-10),
        _ON_MOTOR,
        world={"first": 1.0},
        channels=("E", "I"),
        place="screw",
    ),
    Drive(
        plan(
            "drive.elasticity/friction",
            ("absorbed",),
            note="Wind-up by friction looks like play where accelerations are small; the ramps tell.",
            tolerated=("drive.backlash",),
        ),
        "drive.elasticity",
        softer(1e-10),
        _ON_MOTOR | {"styles": ("strokes", "sines", "other"), "colour": "heavy-tailed"},
        {"coulomb_n": 150.0},
        world={"first": 1.0},
        place="screw",
    ),
    Drive(
        plan("drive.varying_stiffness/small", tolerated=("drive.elasticity",)),
        "drive.varying_stiffness",
        plus("compliance_per_m"),
        _ON_MOTOR | {"styles": ("strokes", "strokes", "other"), "fastest": 0.2},
        {"stiffness_n_per_m": 0.9e8},
        world={"first": 0.1},
        place="screw",
    ),
    Drive(
        plan(
            "drive.varying_stiffness/sines",
            ("absorbed",),
            tolerated=("drive.elasticity",),
        ),
        "drive.varying_stiffness",
        plus("compliance_per_m"),
        _ON_MOTOR | {"styles": ("sines", "other", "strokes"), "fastest": 0.25, "colour": "ar"},
        {"stiffness_n_per_m": 0.8e8, "coulomb_n": 160.0},
        world={"first": 0.1},
        place="screw",
    ),
    Drive(
        plan("drive.pitch_error/lead", ("small", "ruled out in I")),
        "drive.pitch_error",
        plus("lead_m", 1e-6),
        _ON_MOTOR,
        {"lead_pitch_m": 0.01},
        world={"first": 0.1},
        channels=("E",),
        place="screw",
    ),
    Drive(
        plan(
            "drive.pitch_error/half-lead",
            ("ruled out in I",),
            note="The machine repeats a cycle, and so does half of the noise.",
        ),
        "drive.pitch_error",
        plus("lead_m", 1e-6),
        _ON_MOTOR | {"styles": ("cycles", "cycles", "cycles"), "colour": "cycle-locked"},
        {"lead_pitch_m": 0.008},
        world={"first": 0.1},
        channels=("E",),
        place="screw",
    ),
    Drive(
        plan("drive.pitch_error/cumulative", ("small", "absorbed"), note="A bow over the travel; no wave."),
        "drive.pitch_error",
        plus("lead_bow_per_m", 1e-6),
        _ON_MOTOR | {"fastest": 0.2},
        world={"first": 10.0},
        channels=("E",),
        place="screw",
    ),
)
SCENARIOS = tuple(drive.scenario for drive in DRIVES)
