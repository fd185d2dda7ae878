"""Which structure, sources, chains, shafts and cut does a model file describe."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from selector.physics.vibration.chain_values import Chain
from selector.physics.vibration.cutting import Cutting
from selector.physics.vibration.model_schema import ChainSection, ShaftSection, SourceSection, VibrationFile
from selector.physics.vibration.shaft_course import ShaftCourse
from selector.physics.vibration.source import Line, Source
from selector.physics.vibration.structure import Joint, Member, Structure


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


def file_shafts(file: VibrationFile, replaced: Mapping[str, ShaftCourse] | None = None) -> dict[str, ShaftCourse]:
    """Shaft → its course, or what replaces it; one that follows another has that one's course times the ratio."""

    def course(name: str) -> ShaftCourse:
        shaft = file.shafts[name]
        if replaced is not None and name in replaced:
            return replaced[name]
        if shaft.of is None:
            return own_course(shaft)
        return scaled_course(course(shaft.of), 1.0 if shaft.ratio is None else shaft.ratio)

    return {name: course(name) for name in file.shafts}


def own_course(shaft: ShaftSection) -> ShaftCourse:
    """The course of a shaft with a speed of its own."""
    if isinstance(shaft.rpm, tuple):
        time_s, rpm = np.array(shaft.rpm).T
        return ShaftCourse(time_s, rpm)
    return ShaftCourse(np.zeros(1), np.array([shaft.rpm or 0.0]))


def scaled_course(course: ShaftCourse, ratio: float) -> ShaftCourse:
    """The course of what turns `ratio` times as fast."""
    return course if ratio == 1.0 else ShaftCourse(course.time_s, ratio * course.rpm)


def mean_rpm(course: ShaftCourse, from_s: float, to_s: float) -> float:
    """Mean speed of a course from one time to another [r/min]."""
    if course.is_level:
        return float(course.rpm[0])
    first, last = course.turns_at(np.array([from_s, to_s]))
    return float(60.0 * (last - first) / (to_s - from_s))


def file_cutting(file: VibrationFile, workpiece_rpm: float) -> Cutting | None:
    """The cut at this speed of its shaft [r/min]; None without ``[cutting]``."""
    cut = file.cutting
    if cut is None:
        return None
    return Cutting(
        diameter_mm=cut.diameter_mm,
        workpiece_rpm=workpiece_rpm,
        feed_mm_per_rev=cut.feed_mm_per_rev,
        force_coefficient=cut.force_coefficient,
        depth_exponent=cut.depth_exponent,
        feed_exponent=cut.feed_exponent,
        speed_exponent=cut.speed_exponent,
        force_correction=cut.force_correction,
    )
