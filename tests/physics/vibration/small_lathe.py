"""A lathe of three masses, its sources and its cut, for tests."""

from __future__ import annotations

from selector.physics.vibration.chains import Chain
from selector.physics.vibration.periodic_error import Cutting
from selector.physics.vibration.structure import GROUND, Joint, Line, Member, Source, Structure

STRUCTURE = Structure(
    (Member("workpiece", 20.0), Member("tool", 5.0), Member("bed", 800.0)),
    (Joint(("workpiece", "bed"), 2e8, 0.3), Joint(("tool", "bed"), 1e8, 0.25), Joint(("bed", GROUND), 5e8, 0.4)),
)
FINALS = {"tool": "tool", "workpiece": "workpiece"}
SPINDLE = Source(
    "spindle",
    "workpiece",
    (Line(order=1.0, unbalance_kg_m=1e-4), Line(order=9.3, force_n=20.0, phase_rad=0.7)),
    against="bed",
    shaft="spindle",
)
MOTOR = Source("motor", "bed", (Line(frequency_hz=50.0, force_n=10.0), Line(order=1.0, force_n=5.0)), shaft="spindle")
SOURCES = (SPINDLE, MOTOR)
CUTTING = Cutting(60.0, 1200.0, 0.2, 300.0, 1.0, 0.75, -0.15)
LOW = Chain("low", "low", ("spindle",), (("workpiece",), ("bed",)), "workpiece")
HIGH = Chain("high", "high", ("spindle",), (("workpiece",),), "workpiece", held="bed")
BRANCH = Chain("branch", "low", ("motor",), (("bed",),), "tool", branch=(("tool",),))
