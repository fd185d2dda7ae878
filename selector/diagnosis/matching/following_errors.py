"""Positions that are none: what an axis is behind its command is declared as a position in many a machine file."""

from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison, read_only
from selector.diagnosis.finding_table import FINDINGS
from selector.findings import Where
from selector.recording import Channel
from selector.types import Vector
from selector.units import CANONICAL_UNITS

_SMALL, _UNLIKE = 0.2, 0.5  #: Of the spread of the command; correlation with it: a position has 1 of both.
_BY_MOTION = 0.3  #: Part of its variance that the motion of the command explains: more than an axis that stands has.
_MOST_ROWS = 20_000
_ROLE = "displacement"


def with_following_errors(comparison: Comparison) -> Comparison:
    """The comparison with these channels as displacements [µm], which are errors; each is told as a finding.

    Such a channel hardly moves beside the command of its axis and does not go with it, but with its speed, acceleration
    and sense.
    """
    found = [channel for channel in comparison.channels if _is_error(comparison, channel)]
    if not found:
        return comparison
    names = {channel.name for channel in found}
    um = 1e6

    def in_um(of: str, values: Vector) -> Vector:
        return read_only(um * values) if of in names else values

    told = (
        FINDINGS.finding(
            "following-error",
            f"{channel.name} is taken for what the axis is behind its command, and not for a position: its standard "
            f"deviation is {um * float(np.nanstd(comparison.recorded[channel.name])):.3g} µm, and it goes with the "
            "speed of the command.",
            Where(channel=channel.name),
            {},
        )
        for channel in found
    )
    return replace(
        comparison,
        channels=tuple(
            replace(channel, role=_ROLE, unit=CANONICAL_UNITS[_ROLE]) if channel.name in names else channel
            for channel in comparison.channels
        ),
        recorded={name: in_um(name, values) for name, values in comparison.recorded.items()},
        simulated={name: in_um(name, values) for name, values in comparison.simulated.items()},
        findings=(*comparison.findings, *told),
    )


def _is_error(comparison: Comparison, channel: Channel) -> bool:
    if channel.role != "position":
        return False
    commands = [one for one in comparison.channels if one.role == "position_command"]
    return any(
        _goes_with_motion(comparison, channel.name, one.name) for one in commands if channel.axis in (None, one.axis)
    )


def _goes_with_motion(comparison: Comparison, name: str, command: str) -> bool:
    """Whether a channel goes with the motion of a command and not with the command."""
    place, asked = comparison.recorded[name].copy(), comparison.recorded[command].copy()
    speed, acceleration = np.full(len(asked), np.nan), np.full(len(asked), np.nan)
    for _, rows in comparison.rows_of_runs():
        if np.isfinite(asked[rows]).any() and np.isfinite(place[rows]).any() and rows.stop - rows.start > 2:
            place[rows] -= np.nanmean(place[rows])
            asked[rows] -= np.nanmean(asked[rows])
            speed[rows] = np.gradient(asked[rows], comparison.time_s[rows])
            acceleration[rows] = np.gradient(speed[rows], comparison.time_s[rows])
    motion = np.column_stack([speed, acceleration, np.sign(speed)])
    seen = np.flatnonzero(np.isfinite(place) & np.isfinite(asked) & np.isfinite(motion).all(axis=1))
    seen = seen[:: -(-len(seen) // _MOST_ROWS) or 1]
    if len(seen) < 10 * motion.shape[1]:
        return False
    place, asked, motion = place[seen], asked[seen], motion[seen]
    spread, way = float(np.std(place)), float(np.std(asked))
    if not 0.0 < spread < _SMALL * way or abs(float(np.mean(place * asked))) > _UNLIKE * spread * way:
        return False
    left = place - motion @ np.linalg.lstsq(motion, place, rcond=None)[0]
    return float(np.var(left)) < (1.0 - _BY_MOTION) * spread**2
