"""The report of a simulated feed drive: how far it was off and why, what varied, its loop, how round it goes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector import __version__
from selector.atomic_file import write_whole
from selector.figures import style
from selector.figures.drive import (
    LINEAR,
    Measures,
    axis_course,
    frequency_response,
    friction_over_speed,
    stiffness_and_damping,
    varying_against_constant,
)
from selector.findings import Finding
from selector.physics.drive.axis import Axis
from selector.physics.drive.axis_summary import AxisSummary, LoopSummary
from selector.physics.drive.comparison import Difference
from selector.physics.drive.course import ParameterCourse
from selector.physics.drive.mechanics import ThreeMassMechanics
from selector.physics.drive.motion import Motion
from selector.recording import Recording
from selector.report import origin
from selector.report.ball_bar_part import BallBarOnPage, ball_bar_part, ball_bar_sentences
from selector.report.comparison_part import comparison_part, comparison_sentences
from selector.report.drive_wording import (
    cause_sentence,
    loop_tables,
    off_sentence,
    parts_table,
    stick_slip_sentence,
)
from selector.report.numbers import NONE, given_text, number_text
from selector.report.page import Picture, Pictures, rendered
from selector.report.simulation_report import channels_table
from selector.report.tables import Table, remarks_of, table

Vector = NDArray[np.float64]
MOST_RUNS = 4
MOST_PARAMETERS = 200


@dataclass(frozen=True)
class Response:
    """Frequency response of a loop: frequencies [Hz], table over reference by its name, and its instants [s]."""

    frequency_hz: Vector
    table_over_reference: Mapping[str, NDArray[np.complex128]]
    instants_s: tuple[float, ...] = ()


@dataclass(frozen=True)
class AxisOnPage:
    """An axis in one run.

    Attributes
    ----------
    name : str
    axis : Axis
    motion : Motion
    summary : AxisSummary
    limited : ndarray of shape (n_samples,)
        Where a limit was reached.
    course : ParameterCourse or None
        Stiffness and damping that it had.
    constant_error_m : ndarray of shape (n_samples,) or None
        Tracking error of the same axis with constant stiffness and damping.
    output_unit : str
        Of what the control puts out.
    measures : Measures
        Units in which it is read.
    """

    name: str
    axis: Axis
    motion: Motion
    summary: AxisSummary
    limited: NDArray[np.bool_]
    course: ParameterCourse | None = None
    constant_error_m: Vector | None = None
    output_unit: str = "A"
    measures: Measures = LINEAR


@dataclass(frozen=True)
class DrivePage:
    """What the report of a feed drive shows.

    Attributes
    ----------
    recording : Recording
        What was simulated.
    model : str
        Name of the model.
    runs : mapping of str to tuple of AxisOnPage
        Run → its axes.
    inputs : tuple of str
        Channels that act on the axes.
    loops : mapping of str to LoopSummary
        Axis → its loop.
    responses : mapping of str to Response
        Axis → its frequency response.
    ball_bar : BallBarOnPage or None
        What a ball-bar shows, if the axes went in circles.
    differences : tuple of Difference
        From the recordings that drove it, if any did.
    findings : tuple of Finding
    parameters : tuple of (name, value, unit, origin)
    told : mapping
        Facts about the origin: model file, its hash, seed.
    """

    recording: Recording
    model: str
    runs: Mapping[str, tuple[AxisOnPage, ...]]
    inputs: tuple[str, ...] = ()
    loops: Mapping[str, LoopSummary] = field(default_factory=dict)
    responses: Mapping[str, Response] = field(default_factory=dict)
    ball_bar: BallBarOnPage | None = None
    differences: tuple[Difference, ...] = ()
    findings: tuple[Finding, ...] = ()
    parameters: tuple[tuple[str, float, str, str], ...] = ()
    told: Mapping[str, Any] = field(default_factory=dict)


def write_drive_report(page: DrivePage, path: str | Path) -> Path:
    """Write the report of a feed drive as one HTML file that needs no network; whole or not at all.

    Raises
    ------
    OptionError
        The file cannot be written; an old file of that name is untouched.
    """
    target = Path(path)
    # a lone surrogate in a name must not end the report
    write_whole(target, drive_html(page).encode("utf-8", "replace"))
    return target


def drive_html(page: DrivePage) -> str:
    """The report as text, see `write_drive_report`."""
    pictures = Pictures()
    own, others = _sentences(page)
    sentences = [*comparison_sentences(page.differences), own, *others]
    # circles are drawn as circles
    shown = () if page.ball_bar is not None else tuple(page.runs)[:MOST_RUNS]
    values: dict[str, Any] = {
        "title": f"Simulation: {page.model}",
        "version": __version__,
        "first": sentences[0],
        "more": sentences[1:],
        "ball_bar": None if page.ball_bar is None else ball_bar_part(pictures, page.ball_bar),
        "comparison": comparison_part(pictures, page.differences) if page.differences else None,
        "runs": [_run(pictures, page, run) for run in shown],
        "more_runs": 0 if page.ball_bar is not None else len(page.runs) - len(shown),
        "loops": [_loop(pictures, page, name) for name in page.loops],
        "channels": channels_table(page.recording, page.inputs),
        "remarks": remarks_of(page.findings),
        "parameters": _parameters(page),
        "origin": origin.remaining_table(page.told),
    }
    return rendered("drive.html", values)


def _sentences(page: DrivePage) -> tuple[str, list[str]]:
    """What matters most, and what it comes from."""
    if page.ball_bar is not None:
        first, *more = ball_bar_sentences(page.ball_bar)
        return first, more
    run, one = max(
        ((run, one) for run, axes in page.runs.items() for one in axes), key=lambda pair: pair[1].summary.max_m
    )
    name = one.name if len({axis.name for axes in page.runs.values() for axis in axes}) > 1 else ""
    more = [cause_sentence(one.summary.parts, one.axis, one.measures)]
    if one.summary.limited_share > 0:
        share = number_text(100 * one.summary.limited_share, 2)
        more.append(f"A limit of current or speed was reached {share} % of the time.")
    if one.summary.stick_slip is not None:
        more.insert(0, stick_slip_sentence(one.summary.stick_slip, name))
    unstable = [name for name, loop in page.loops.items() if not loop.stability.stable]
    if unstable:
        more.insert(0, f"The control loop of {', '.join(unstable)} is unstable.")
    return off_sentence(name, one.motion, one.measures, run if len(page.runs) > 1 else ""), more


def _run(pictures: Pictures, page: DrivePage, run: str) -> dict[str, Any]:
    axes = page.runs[run]
    drawn, tables = [], None
    for one in axes:
        name = one.name if len(axes) > 1 else ""
        limited = one.limited if one.limited.any() else None
        course = axis_course(one.motion, name, one.output_unit, limited=limited, measures=one.measures)
        drawn.append(pictures.add(course, _COURSE + (_LIMITED if limited is not None else "")))
        drawn += _varying(pictures, page, one)
        if np.ptp(one.motion.friction_n) > 0:
            near = _stribeck(one.axis)
            picture = friction_over_speed(one.motion, name, near_m_per_s=near, measures=one.measures)
            drawn.append(pictures.add(picture, _FRICTION))
        tables = parts_table(one.summary.parts, one.measures)
    named = f"Run {run}" if len(page.runs) > 1 else "How it moves"
    return {"name": named, "pictures": drawn, "table": tables if len(axes) == 1 else None}


def _varying(pictures: Pictures, page: DrivePage, one: AxisOnPage) -> list[Picture]:
    course = one.course
    drawn: list[Picture] = []
    if course is None:
        return drawn
    time_s, mechanics = one.motion.time_s, one.axis.mechanics
    stiffness, damping = course.axial_stiffness_n_per_m, course.guide_damping_ns_per_m
    if stiffness is None and isinstance(mechanics, ThreeMassMechanics):
        stiffness = np.full(len(time_s), mechanics.axial_stiffness_n_per_m)
    if stiffness is not None:
        if damping is None:
            damping = np.full(len(time_s), mechanics.guide_damping_ns_per_m)
        response = page.responses.get(one.name)
        marks = () if response is None else response.instants_s
        drawn.append(pictures.add(stiffness_and_damping(time_s, stiffness, damping, marks), _VARYING))
    if one.constant_error_m is not None:
        compared = varying_against_constant(time_s, one.motion.tracking_error_m, one.constant_error_m, one.measures)
        drawn.append(pictures.add(compared, _COMPARED))
    return drawn


def _loop(pictures: Pictures, page: DrivePage, name: str) -> dict[str, Any]:
    loop, response = page.loops[name], page.responses.get(name)
    axis = next(one.axis for axes in page.runs.values() for one in axes if one.name == name)
    several = len(page.loops) > 1
    drawn = []
    if response is not None:
        figures = loop.figures
        who = f"{style.label(name, 12)} " if several else "the table "
        title = f"Computed: {who}follows up to {style.number(figures.bandwidth_hz)} Hz (−3 dB)"
        if not loop.stability.stable:
            title = f"Computed: the loop of {who}is unstable; this is no answer that could be measured"
        over = response.table_over_reference
        picture = frequency_response(
            response.frequency_hz,
            {key: np.abs(values) for key, values in over.items()},
            {key: np.degrees(np.unwrap(np.angle(values))) for key, values in over.items()},
            title,
        )
        drawn.append(pictures.add(picture, _RESPONSE))
    tables = [(f"{caption} of {name}" if several else caption, one) for caption, one in loop_tables(loop, axis)]
    return {"pictures": drawn, "tables": tables}


def _parameters(page: DrivePage) -> Table | None:
    if not page.parameters:
        return None
    rows = [
        (name, given_text(value), NONE if unit in ("", "1") else unit, said)
        for name, value, unit, said in page.parameters
    ]
    more = f"{len(rows) - MOST_PARAMETERS} more are in the model file." if len(rows) > MOST_PARAMETERS else ""
    return table(["parameter", ">value", "unit", "from"], rows[:MOST_PARAMETERS], more)


def _stribeck(axis: Axis) -> float | None:
    """Speed around a reversal worth a closer look [m/s]."""
    friction = axis.friction
    rises = friction.static_n is not None and friction.static_n != friction.coulomb_n
    return 4.0 * friction.stribeck_speed_m_per_s if rises or friction.lugre is not None else None


_THINNED = "Long courses are drawn with the lowest and highest sample of each of 300 stretches; the file has them all."
_COURSE = f"Error: commanded minus true position of the table. Output: what the control puts out. {_THINNED}"
_LIMITED = " Shaded: a limit of current or speed is reached."
_VARYING = "Stiffness changes with load and position, damping with speed. Dotted: instants of the frequency response."
_COMPARED = "Constant: the stiffness at position 0 without load, and the damping of viscous friction alone."
_FRICTION = (
    "Dry friction against the speed of the table, positive against the positive direction. Viscous friction is apart."
)
_RESPONSE = (
    "From commanded to true position, for small motions without dry friction, backlash and limits. Dotted: −3 dB."
)
