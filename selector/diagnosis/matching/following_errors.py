"""Positions that are none: what an axis is behind its command is declared as a position in many a machine file."""

import itertools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison, read_only
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.matching.runs import rms
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import by_run, rate
from selector.findings import Where
from selector.types import Vector
from selector.units import CANONICAL_UNITS

_SMALL, _UNLIKE = 0.2, 0.5  #: Of the spread of the command; correlation with it: a position has 1 of both.
_BY_MOTION = 0.3  #: Part of its variance that the motion of the command explains: more than an axis that stands has.
_ROLE, _UM = "displacement", 1e6


def with_following_errors(comparison: Comparison) -> Comparison:
    """The comparison with these channels as displacements [µm], which are errors; each is told as a finding.

    Such a channel hardly moves beside the command of its axis and does not go with it, but with its speed, acceleration
    and sense.
    """
    names = {
        channel.name
        for channel, one in itertools.product(comparison.channels, comparison.channels)
        if (channel.role, one.role) == ("position", "position_command")
        and channel.axis in (None, one.axis)
        and _goes_with_motion(comparison, channel.name, one.name)
    }
    if not names:
        return comparison
    said = (
        "{} is taken for what the axis is behind its command, and not for a position: its standard deviation is {:.3g} "
        "µm, and it goes with its speed."
    )
    spread_um = {name: _UM * float(np.nanstd(comparison.recorded[name])) for name in sorted(names)}
    told = (
        FINDINGS.finding("following-error", said.format(name, size), Where(channel=name), {})
        for name, size in spread_um.items()
    )

    def in_um(of: Mapping[str, Vector]) -> dict[str, Vector]:
        return {name: read_only(_UM * values) if name in names else values for name, values in of.items()}

    return replace(
        comparison,
        channels=tuple(
            replace(channel, role=_ROLE, unit=CANONICAL_UNITS[_ROLE]) if channel.name in names else channel
            for channel in comparison.channels
        ),
        recorded=in_um(comparison.recorded),
        simulated=in_um(comparison.simulated),
        findings=(*comparison.findings, *told),
    )


def _goes_with_motion(comparison: Comparison, name: str, command: str) -> bool:
    """Whether a channel goes with the motion of a command and not with the command."""
    place, asked = (
        by_run(comparison, lambda part: part - part.mean(), comparison.filled(comparison.recorded[one]))
        for one in (name, command)
    )
    spread, way = float(np.std(place)), float(np.std(asked))
    if not 0.0 < spread < _SMALL * way or abs(float(np.mean(place * asked))) > _UNLIKE * spread * way:
        return False
    speed = rate(comparison, asked)
    motion = np.column_stack([speed, rate(comparison, speed), np.sign(speed)])
    return rms(place - motion @ least_squares(motion, place)) < np.sqrt(1.0 - _BY_MOTION) * spread
