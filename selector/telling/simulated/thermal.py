"""What is told of a simulated machine that warms: what moved and warmed most, where the heat went, time constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import numpy as np

from selector.errors import OptionError
from selector.number_text import number_text, span_text
from selector.physics.model_text import plain_values
from selector.physics.thermal.drift_quantities import largest_displacement
from selector.physics.thermal.model_file import FieldFile, MeshFile
from selector.physics.thermal.thermal_model import slowest_time_constants
from selector.recording import Recording
from selector.telling import account
from selector.telling.numbers import NONE
from selector.telling.simulated.result import SAID, Origins, SimulationResult, is_said, simulation_account
from selector.types import Array

if TYPE_CHECKING:
    # scikit-fem comes in with it
    from selector.physics.thermal.field_model import FieldMoment

MOST_RUNS = 6


def thermal_account(result: SimulationResult, drawn: bool) -> account.Account:
    """What is told of a machine that warms: what moved and warmed most, where the heat went, time constants."""
    done, runs = result.simulated, result.recording.runs
    shown = runs[:MOST_RUNS]
    drawings = _drawings(result) if drawn else {}
    courses: list[account.Block] = []
    for one in shown:
        name = f"Run {one}" if len(runs) > 1 else "How it warms and moves"
        courses += [account.Heading(name), *drawings.get(f"run {one}", ())]
        balance = done.recording.provenance.get("runs", {}).get(one)
        if balance:
            courses.append(account.Captioned("Heat of the run", balance_table(balance), on_screen=len(runs) == 1))
    if len(runs) > len(shown):
        courses.append(account.Note(f"{len(runs) - len(shown)} more runs were simulated; they are in their files."))
    constants = slowest_time_constants(done.model.machine, done.details(pictured_at(result)[0]))
    return simulation_account(
        result,
        [_first(result)],
        (
            account.section("picture", "The machine at one moment", *drawings.get("picture", ()), link="Picture"),
            account.section("runs", "", *courses, link="Courses"),
            account.section("constants", "Time constants", account.captioned("", constants_table(constants))),
        ),
        drawings=drawings,
        facts={
            "kind of the model": done.model.file.model.kind,
            "noise of the instruments": done.recording.provenance["simulated"]["instruments"],
        },
        data={},
        parameters=_parameters(done.model),
    )


def _parameters(model: Any) -> Origins:
    """The numbers of the file, which of a field machine are those of the shipped one where it leaves them out."""
    values = plain_values(model.file) if isinstance(model.file, FieldFile) else None
    return tuple(
        (name, one.value, one.unit, SAID if values is None or is_said(values, name.split(".")) else "shipped machine")
        for name, one in model.parameters.items()
    )


def largest_of(recording: Recording) -> tuple[str, float]:
    """(run, time [s]) of the largest displacement."""
    run = max(recording.runs, key=lambda one: abs(largest_displacement(recording, one)[2]))
    return run, largest_displacement(recording, run)[1]


def pictured_at(result: SimulationResult) -> tuple[str, float]:
    """(run, time [s]) of which the picture of a field machine is taken: as asked, or at the largest displacement.

    Raises OptionError: the run is over before the minute that was asked for.
    """
    run, at_s = largest_of(result.recording)
    at_min = result.asked.get("picture_at_min")
    return (run, at_s) if at_min is None else (_run_with(result.recording, run, 60.0 * at_min), 60.0 * at_min)


def _run_with(simulated: Recording, first: str, at_s: float) -> str:
    """The first of the runs that lasts until then, `first` before the others."""
    ends = {run: float(simulated.time_s(run)[-1]) for run in (first, *simulated.runs)}
    for run, end in ends.items():
        if at_s <= end * (1.0 + 1e-9):
            return run
    raise OptionError(
        f"{at_s / 60:g} min", expected=f"at most {max(ends.values()) / 60:g} min, when the run ends",
        where="--picture-at-min", advice="choose an earlier time, or leave it out",
    )  # fmt: skip


def _first(result: SimulationResult) -> str:
    recording, inputs = result.recording, result.simulated.inputs
    run, _ = largest_of(recording)
    name, at_s, um = largest_displacement(recording, run)
    several = f" of run {run}" if len(recording.runs) > 1 else ""
    moves = f"{name} moves most, by {number_text(um)} µm after {span_text(at_s)}{several}" if name else "Nothing moves"
    rise = {
        (thermometer, one): recording.values(one, [thermometer])[:, 0] - recording.values(one, [thermometer])[0, 0]
        for thermometer in recording.with_role("temperature")
        if thermometer not in inputs
        for one in recording.runs
    }
    if not rise:
        return f"{moves}."
    (warmest, _), course = max(rise.items(), key=lambda item: float(np.nanmax(np.abs(item[1]))))
    kelvin = float(course[int(np.nanargmax(np.abs(course)))])
    place = recording.channel(warmest).place
    where = f" ({place})" if place and place != warmest else ""
    return f"{moves}; {warmest}{where} {'warms' if kelvin >= 0 else 'cools'} most, by {number_text(abs(kelvin))} K."


def constants_table(constants: Mapping[str, Array]) -> account.Table:
    """The slowest time constants of every state in which the machine is held [min]."""
    said = ([number_text(s / 60) if np.isfinite(s) else "never" for s in of.tolist()] for of in constants.values())
    rows = [(str(number), *values) for number, values in enumerate(zip_longest(*said), start=1)]
    return account.table([">mode", *(f">{name} [min]" for name in constants)], rows, account.legend("thermal.modes"))


def balance_table(balance: Mapping[str, Any]) -> account.Table:
    """Heat by source and surface, and what stays [kJ]."""
    rows = [(name, "source", number_text(j / 1e3, 4)) for name, j in balance["sources_j"].items()]
    rows += [(name, "surface", number_text(-j / 1e3, 4)) for name, j in balance["films_j"].items()]
    rows.append(("stored in the machine", NONE, number_text(-balance["stored_j"] / 1e3, 4)))
    missing = f"{balance['missing_share']:.1e}"
    note = f"Heat into the machine, negative: out of it. The sum misses {missing} of the turnover (rounding)."
    return account.table(["", "", ">heat [kJ]"], rows, note)


def _drawings(result: SimulationResult) -> dict[str, list[account.Block]]:
    """Section of the account, or a run → its drawings."""
    found: dict[str, list[account.Block]] = {"picture": _moment(result)}
    for run in result.recording.runs[:MOST_RUNS]:
        found[f"run {run}"] = _run(result, run)
    return found


def _run(result: SimulationResult, run: str) -> list[account.Block]:
    from selector.figures.simulated.thermal import inputs_and_displacements, temperatures

    recording, inputs = result.recording, result.simulated.inputs
    thermometers = [name for name in recording.with_role("temperature") if name not in inputs]
    drawn: list[account.Block] = [
        account.Drawing(inputs_and_displacements(recording, run, inputs), account.legend("thermal.courses"))
    ]
    if thermometers:
        drawn.append(account.Drawing(temperatures(recording, run, inputs), account.legend("thermal.grouped")))
    return drawn


def _moment(result: SimulationResult) -> list[account.Block]:
    file, inputs, recording = result.simulated.model.file, result.simulated.inputs, result.recording
    if not isinstance(file, FieldFile | MeshFile):
        return []
    from selector.physics.thermal.field_model import field_moment

    at_run, at_s = pictured_at(result)
    moment = field_moment(file, result.simulated.details(at_run), at_s)
    return [moment_drawing(recording, inputs, moment, at_run)]


def moment_drawing(recording: Recording, inputs: Sequence[str], moment: FieldMoment, at_run: str) -> account.Drawing:
    """The machine at one moment of a run, with the thermometers that have a place."""
    from selector.figures.simulated.thermal import machine_field

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
    return account.Drawing(drawn, account.legend("thermal.picture"))
