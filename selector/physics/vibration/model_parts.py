"""Which structure, sources, chains, shafts and cut does a model file describe."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

from selector.physics.vibration.chain_values import Chain
from selector.physics.vibration.cutting import Cutting
from selector.physics.vibration.model_schema import ChainSection, SourceSection, VibrationFile
from selector.physics.vibration.source import Line, Source
from selector.physics.vibration.structure import Joint, Member, Structure

Corners = tuple[tuple[float, float], ...]
"""Course of a shaft, straight between corners (time [s], speed [r/min]); level before the first and after the last."""


def file_structure(file: VibrationFile) -> Structure:
    """The members and joints of a file."""
    members = tuple(Member(name, section.mass_kg) for name, section in file.members.items())
    joints = tuple(Joint(one.between, one.stiffness_n_per_m, one.dissipation) for one in file.joints)
    return Structure(members, joints)


def source_of(name: str, section: SourceSection) -> Source:
    """The source that a section describes."""
    lines = tuple(
        Line(one.frequency_hz, one.order, one.force_n, one.unbalance_kg_m, one.phase_rad) for one in section.lines
    )
    return Source(name, section.member, lines, section.against, section.shaft)


def file_sources(file: VibrationFile) -> tuple[Source, ...]:
    """The sources of a file."""
    return tuple(source_of(name, section) for name, section in file.sources.items())


def chain_of(section: ChainSection) -> Chain:
    """The chain that a section describes."""
    return Chain(
        section.name, section.range, section.sources, section.path, section.final, section.branch, section.held
    )


def file_chains(file: VibrationFile) -> tuple[Chain, ...]:
    """The chains of a file."""
    return tuple(chain_of(section) for section in file.chains)


def shaft_corners(file: VibrationFile) -> Mapping[str, Corners]:
    """Shaft → its course; those that follow another one have that one's, times the ratio."""
    found: dict[str, Corners] = {}
    for name in file.shafts:
        ratio, at = 1.0, file.shafts[name]
        while at.of is not None:
            ratio, at = ratio * (1.0 if at.ratio is None else at.ratio), file.shafts[at.of]
        corners = at.rpm if isinstance(at.rpm, tuple) else ((0.0, at.rpm or 0.0),)
        found[name] = tuple((time_s, ratio * rpm) for time_s, rpm in corners)
    return found


def mean_rpm(corners: Corners, duration_s: float) -> float:
    """Mean speed of a course from 0 to `duration_s` [r/min]."""
    times = [0.0, *(time_s for time_s, _ in corners if 0.0 < time_s < duration_s), duration_s]
    speeds = [rpm_at(corners, time_s) for time_s in times]
    areas = [
        (b - a) * (one + other) / 2.0 for (a, b), (one, other) in zip(pairwise(times), pairwise(speeds), strict=True)
    ]
    return sum(areas) / duration_s


def speed_range(corners: Corners, duration_s: float) -> tuple[float, float]:
    """Lowest and highest speed of a course from 0 to `duration_s` [r/min]."""
    inside = [rpm for time_s, rpm in corners if 0.0 < time_s < duration_s]
    speeds = [rpm_at(corners, 0.0), *inside, rpm_at(corners, duration_s)]
    return min(speeds), max(speeds)


def rpm_at(corners: Corners, time_s: float) -> float:
    """Speed of a course at a time [r/min]."""
    if time_s <= corners[0][0]:
        return corners[0][1]
    for (a, one), (b, other) in pairwise(corners):
        if time_s <= b:
            return one + (other - one) * (time_s - a) / (b - a)
    return corners[-1][1]


def file_cutting(file: VibrationFile) -> Cutting | None:
    """The cut, at the mean speed of its shaft; None without ``[cutting]``."""
    cut = file.cutting
    if cut is None:
        return None
    return Cutting(
        diameter_mm=cut.diameter_mm,
        workpiece_rpm=mean_rpm(shaft_corners(file)[cut.shaft], file.run.duration_s),
        feed_mm_per_rev=cut.feed_mm_per_rev,
        force_coefficient=cut.force_coefficient,
        depth_exponent=cut.depth_exponent,
        feed_exponent=cut.feed_exponent,
        speed_exponent=cut.speed_exponent,
        force_correction=cut.force_correction,
    )
