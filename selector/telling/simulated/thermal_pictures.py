"""The drawings of a machine that warms: courses, temperatures, heat, and the field at one moment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from selector.figures.simulated.field import machine_field
from selector.figures.simulated.thermal import inputs_and_displacements, temperatures
from selector.number_text import number_text
from selector.physics.thermal.model_file import FieldFile, MeshFile
from selector.recording import Recording
from selector.telling.account import Block, Drawing
from selector.telling.numbers import span_text
from selector.telling.simulated.result import SimulationResult
from selector.telling.simulated.thermal import MOST_RUNS, pictured_at

if TYPE_CHECKING:
    # scikit-fem comes in with it
    from selector.physics.thermal.field_model import FieldMoment


def drawings(result: SimulationResult) -> dict[str, list[Block]]:
    """Section of the account, or a run → its drawings."""
    found: dict[str, list[Block]] = {"picture": _moment(result)}
    for run in result.recording.runs[:MOST_RUNS]:
        found[f"run {run}"] = _run(result, run)
    return found


def _run(result: SimulationResult, run: str) -> list[Block]:
    recording, inputs = result.recording, result.simulated.inputs
    thermometers = [name for name in recording.with_role("temperature") if name not in inputs]
    drawn: list[Block] = [Drawing(inputs_and_displacements(recording, run, inputs), _COURSES)]
    if thermometers:
        drawn.append(Drawing(temperatures(recording, run, inputs), _GROUPED))
    return drawn


def _moment(result: SimulationResult) -> list[Block]:
    file, inputs, recording = result.simulated.model.file, result.simulated.inputs, result.recording
    if not isinstance(file, FieldFile | MeshFile):
        return []
    from selector.physics.thermal.field_model import field_moment

    at_run, at_s = pictured_at(result)
    moment = field_moment(file, result.simulated.details(at_run), at_s)
    return [moment_drawing(recording, inputs, moment, at_run)]


def moment_drawing(recording: Recording, inputs: Sequence[str], moment: FieldMoment, at_run: str) -> Drawing:
    """The machine at one moment of a run, with the thermometers that have a place."""
    places = {
        channel.name: channel.xyz_m
        for channel in recording.channels
        if channel.xyz_m is not None and channel.role == "temperature" and channel.name not in inputs
    }
    k = int(np.argmin(np.abs(recording.time_s(at_run) - moment.at_s)))
    speeds = [name for name in recording.with_role("spindle_speed") if name in inputs]
    speed = f", at {recording.values(at_run, speeds)[k, 0]:g} r/min" if speeds else ""
    run = f" of run {at_run}" if len(recording.runs) > 1 else ""
    hottest = float(moment.temperature_degc[np.unique(moment.triangles)].max())
    title = (
        f"Simulated: after {span_text(moment.at_s)}{run}{speed}, the surface is up to {number_text(hottest)} °C warm"
    )
    drawn = machine_field(
        moment.nodes_m, moment.triangles, moment.temperature_degc, moment.deformation_um, title, places
    )
    return Drawing(drawn, _PICTURE)


_COURSES = "Top: what is done to the machine. Bottom: the tool against the table, as the simulated gauges read it."
_GROUPED = (
    "Thermometers on one part of the machine stand in one panel; where there are very many, some are drawn, from the "
    "one that warms least to the one that warms most. The table of channels says where each of them sits."
)
_PICTURE = (
    "Left: temperature; the dots are thermometers. Right: deformation since the start of the run, drawn larger than it "
    "is. It can be turned with the mouse."
)
