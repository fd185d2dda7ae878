"""What kind of record a response stands in: a vibration, a response curve, gauged parts, stores, or none of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import course, excited

Vector = NDArray[np.float64]

SLOWEST_VIBRATION_S = 0.05
"""A record with longer steps shows no vibration of a machine, which begin at some hertz."""
FEWEST_ROWS = 60
"""Of fewer rows no spectrum has a floor that a line could stand out of."""
MOTION_ROLES = ("displacement", "acceleration", "velocity", "position", "voltage", "force")
_GAUGE_ROLES = ("displacement", "voltage", "amplitude", "position")
_ROOM_ROLES = ("temperature", "ambient")
_DRIVE_ROLES = ("position_command", "current")


def no_vibration(comparison: Comparison, response: str, *, roles: tuple[str, ...] = MOTION_ROLES) -> str | None:
    """Why the response is no vibration in time, in one clause; None if it is one."""
    role = comparison.channel(response).role
    if role not in roles:
        return f"{response} is of role {role!r}; a vibration is recorded as {', '.join(roles)}"
    if comparison.period_s > SLOWEST_VIBRATION_S:
        return f"a sample every {comparison.period_s:.3g} s is too slow for vibration"
    rows = int(np.sum(np.isfinite(comparison.recorded[response]) & ~comparison.held_out))
    if rows < FEWEST_ROWS:
        return f"{rows} samples to fit to are too few for vibration"
    return None


def of_a_drive(comparison: Comparison, response: str) -> str | None:
    """Why the structural effects are left to those of drives, in one clause; None if this is no feed drive."""
    roles = {c.role for c in comparison.channels}
    if "feed_rate" in roles and not roles & {"force", "acceleration"}:
        return f"{response} belongs to a feed that is recorded with it, not to a structure that is shaken"
    if "position_command" in roles or ("current" in roles and roles & {"velocity", "position"}):
        return f"{response} belongs to a feed drive, whose flexibility and friction are effects drive.*"
    return None


def swept_hz(comparison: Comparison, response: str) -> Vector | None:
    """Frequency of every row of a response curve taken step by step [Hz]; None if the response is no such curve."""
    role = comparison.channel(response).role
    if role != "amplitude" and not (role == "displacement" and comparison.with_role("frequency")):
        return None
    if role == "displacement" and comparison.period_s <= SLOWEST_VIBRATION_S:
        return None
    for name in comparison.with_role("frequency", "spindle_speed"):
        per_hz = 60.0 if comparison.channel(name).role == "spindle_speed" else 1.0
        steps = course(comparison, name) / per_hz
        if excited(steps) and float(np.ptp(steps)) > 0.05 * float(np.abs(steps).max()):
            return steps
    return None


def no_gauging(comparison: Comparison, response: str) -> str | None:
    """Why the response is neither a gauged size nor the reading of a gauge, in one clause; None if it is."""
    role = comparison.channel(response).role
    if role == "size":
        return None
    roles = {c.role for c in comparison.channels}
    if role not in _GAUGE_ROLES:
        return f"{response} is of role {role!r}, not a size and not the reading of a gauge"
    if "size" in roles:
        return None
    if roles & set(_ROOM_ROLES) or roles & set(_DRIVE_ROLES) or "feed_rate" not in roles:
        return "neither a channel of role 'size' nor the feed of a gauged grinding process is recorded"
    return None


def part_by_part(comparison: Comparison, response: str) -> bool:
    """Whether every row is a finished part, and not a sample of a course in time."""
    return comparison.channel(response).role == "size" and comparison.period_s >= 0.5


def no_flow(comparison: Comparison, response: str) -> str | None:
    """Why the response is no level of a store that something flows into, in one clause; None if it is."""
    role = comparison.channel(response).role
    if role not in ("voltage", "displacement", "position", "flow", "state", "size", "amplitude"):
        return f"{response} is of role {role!r}, not a level or a flow"
    roles = {c.role for c in comparison.channels}
    if comparison.period_s < SLOWEST_VIBRATION_S:
        return f"a sample every {comparison.period_s:.3g} s is too quick for a store that fills"
    if "flow" not in roles and role != "voltage":
        return "no flow is recorded"
    if roles & {*_ROOM_ROLES, *_DRIVE_ROLES, "spindle_speed", "feed_rate", "force", "acceleration"}:
        return "the record is one of a machine, not of stores and flows"
    return None
