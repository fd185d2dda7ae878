"""The report of a simulation: what was done to the machine, how it warmed and moved, and where its heat went."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from selector import __version__
from selector.atomic_file import write_whole
from selector.figures.field import machine_field
from selector.figures.simulation import heat_balance, inputs_and_displacements, largest_displacement, temperatures
from selector.findings import Finding
from selector.physics.thermal.parameters import Parameter
from selector.recording import Recording
from selector.report import origin
from selector.report.numbers import NONE, beside_text, given_text, number_text, span_text
from selector.report.page import Picture, Pictures, rendered
from selector.report.tables import Table, remarks_of, table

if TYPE_CHECKING:
    # scikit-fem comes in with it
    from selector.physics.thermal.field_moment import FieldMoment

MOST_RUNS = 6
MOST_ROWS = 200
_UNITS = {"degC": "°C", "um": "µm", "rpm": "r/min", "1": NONE}


@dataclass(frozen=True)
class SimulationPage:
    """What the report of a simulation shows.

    Attributes
    ----------
    recording : Recording
        What was simulated.
    model : str
        Name of the model.
    inputs : tuple of str
        Channels that act on the machine; the others are its answer.
    findings : tuple of Finding
    time_constants : mapping of str to ndarray
        What is held → the slowest time constants [s].
    parameters : mapping of str to Parameter
        The model's physics.
    moment, moment_run
        Picture of the field machine and the run that it belongs to, if there is one.
    told : mapping
        Facts about the origin: model file, its hash, seed.
    """

    recording: Recording
    model: str
    inputs: tuple[str, ...]
    findings: tuple[Finding, ...] = ()
    time_constants: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    moment: FieldMoment | None = None
    moment_run: str = ""
    told: Mapping[str, Any] = field(default_factory=dict)


def write_simulation_report(page: SimulationPage, path: str | Path) -> Path:
    """Write the report of a simulation as one HTML file that needs no network; whole or not at all.

    Raises
    ------
    OptionError
        The file cannot be written; an old file of that name is untouched.
    """
    target = Path(path)
    # a lone surrogate in a name must not end the report
    write_whole(target, simulation_html(page).encode("utf-8", "replace"))
    return target


def simulation_html(page: SimulationPage) -> str:
    """The report as text, see `write_simulation_report`."""
    pictures = Pictures()
    recording = page.recording
    runs = recording.runs[:MOST_RUNS]
    values: dict[str, Any] = {
        "title": f"Simulation: {page.model}",
        "version": __version__,
        "first": _first(page),
        "picture": _moment(pictures, page),
        "runs": [_run(pictures, page, run) for run in runs],
        "more_runs": len(recording.runs) - len(runs),
        "channels": channels_table(page.recording, page.inputs),
        "constants": _constants_table(page.time_constants),
        "remarks": remarks_of(page.findings),
        "parameters": _parameters_table(page.parameters),
        "origin": origin.remaining_table(page.told),
    }
    return rendered("simulation.html", values)


def largest_of(recording: Recording) -> tuple[str, float]:
    """(run, time [s]) of the largest displacement."""
    run = max(recording.runs, key=lambda one: abs(largest_displacement(recording, one)[2]))
    return run, largest_displacement(recording, run)[1]


def _first(page: SimulationPage) -> str:
    """What moved and warmed most, in one sentence."""
    recording = page.recording
    run, _ = largest_of(recording)
    name, at_s, um = largest_displacement(recording, run)
    several = f" of run {run}" if len(recording.runs) > 1 else ""
    moves = f"{name} moves most, by {number_text(um)} µm after {span_text(at_s)}{several}" if name else "Nothing moves"
    rise = {
        (thermometer, one): recording.values(one, [thermometer])[:, 0] - recording.values(one, [thermometer])[0, 0]
        for thermometer in recording.with_role("temperature")
        if thermometer not in page.inputs
        for one in recording.runs
    }
    if not rise:
        return f"{moves}."
    (warmest, _), course = max(rise.items(), key=lambda item: float(np.nanmax(np.abs(item[1]))))
    kelvin = float(course[int(np.nanargmax(np.abs(course)))])
    place = recording.channel(warmest).place
    where = f" ({place})" if place and place != warmest else ""
    return f"{moves}; {warmest}{where} {'warms' if kelvin >= 0 else 'cools'} most, by {number_text(abs(kelvin))} K."


def _run(pictures: Pictures, page: SimulationPage, run: str) -> dict[str, Any]:
    recording = page.recording
    thermometers = [name for name in recording.with_role("temperature") if name not in page.inputs]
    balance = recording.provenance.get("runs", {}).get(run) or None
    drawn = [pictures.add(inputs_and_displacements(recording, run, page.inputs), _COURSES)]
    if thermometers:
        drawn.append(pictures.add(temperatures(recording, run, page.inputs), _GROUPED))
    if balance:
        drawn.append(pictures.add(heat_balance(balance), _BALANCE))
    return {"name": run, "pictures": drawn, "balance": _balance_table(balance) if balance else None}


def _moment(pictures: Pictures, page: SimulationPage) -> Picture | None:
    moment = page.moment
    if moment is None:
        return None
    recording = page.recording
    places = {
        channel.name: channel.xyz_m
        for channel in recording.channels
        if channel.xyz_m is not None and channel.role == "temperature" and channel.name not in page.inputs
    }
    k = int(np.argmin(np.abs(recording.time_s(page.moment_run) - moment.at_s)))
    speeds = [name for name in recording.with_role("spindle_speed") if name in page.inputs]
    speed = f", at {recording.values(page.moment_run, speeds)[k, 0]:g} r/min" if speeds else ""
    run = f" of run {page.moment_run}" if len(recording.runs) > 1 else ""
    hottest = float(moment.temperature_degc[np.unique(moment.triangles)].max())
    title = (
        f"Simulated: after {span_text(moment.at_s)}{run}{speed}, the surface is up to {number_text(hottest)} °C warm"
    )
    drawn = machine_field(
        moment.nodes_m, moment.triangles, moment.temperature_degc, moment.deformation_um, title, places
    )
    return pictures.add(drawn, _PICTURE)


def channels_table(recording: Recording, inputs: Sequence[str]) -> Table:
    """The channels of a simulated recording with their ranges; `inputs` names those that act."""
    rows = []
    for channel in recording.channels:
        values = recording.frame[channel.name]
        low, high = float(values.min()), float(values.max())
        rows.append(
            (
                channel.name,
                "input" if channel.name in inputs else "output",
                channel.role.replace("_", " "),
                channel.place or channel.axis or NONE,
                beside_text(low, high - low),
                beside_text(high, high - low),
                _UNITS.get(channel.unit, channel.unit),
            )
        )
    return table(["channel", "", "role", "place or axis", ">lowest", ">highest", "unit"], rows)


def _constants_table(constants: Mapping[str, NDArray[np.float64]]) -> Table | None:
    if not constants:
        return None
    count = max(len(values) for values in constants.values())
    rows = [
        (str(k + 1), *(_minutes(values[k]) if k < len(values) else NONE for values in constants.values()))
        for k in range(count)
    ]
    note = "Slowest first. After one time constant 63 % of the way to the steady state is done, after three 95 %."
    return table([">mode", *(f">{name} [min]" for name in constants)], rows, note)


def _minutes(seconds: float) -> str:
    return number_text(float(seconds) / 60) if np.isfinite(seconds) else "never"


def _balance_table(balance: Mapping[str, Any]) -> Table:
    rows = [(name, "source", number_text(j / 1e3, 4)) for name, j in balance["sources_j"].items()]
    rows += [(name, "surface", number_text(-j / 1e3, 4)) for name, j in balance["films_j"].items()]
    rows.append(("stored in the machine", NONE, number_text(-balance["stored_j"] / 1e3, 4)))
    missing = f"{balance['missing_share']:.1e}"
    note = f"Heat into the machine, negative: out of it. The sum misses {missing} of the turnover (rounding)."
    return table(["", "", ">heat [kJ]"], rows, note)


def _parameters_table(parameters: Mapping[str, Parameter]) -> Table | None:
    if not parameters:
        return None
    rows = [(name, given_text(one.value), one.unit or NONE) for name, one in parameters.items()]
    more = f"{len(rows) - MOST_ROWS} more are in the model file." if len(rows) > MOST_ROWS else ""
    return table(["parameter", ">value", "unit"], rows[:MOST_ROWS], more)


_COURSES = "Top: what is done to the machine. Bottom: the tool against the table, as the simulated gauges read it."
_GROUPED = (
    "Thermometers on one part of the machine stand in one panel; where there are very many, some are drawn, from the "
    "one that warms least to the one that warms most. The table of channels says where each of them sits."
)
_BALANCE = "From the start to the end of the run. What comes in leaves through surfaces, or stays."
_PICTURE = (
    "Left: temperature; the dots are thermometers. Right: deformation since the start of the run, drawn larger than it "
    "is. It can be turned with the mouse."
)
