"""What does a simulated feed drive amount to: every axis in every run, every loop, and how round its circles are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from selector.physics.drive.axis_summary import (
    AxisSummary,
    LoopSummary,
    axis_summary,
    loop_summary,
    parameters_along,
)
from selector.physics.drive.circle_causes import CircleCauses, circle_causes
from selector.physics.drive.circle_quantities import CircleQuantities, circle_quantities
from selector.physics.drive.course import ParameterCourse
from selector.physics.drive.drive_model import AxisRun, DriveModel, DriveSimulation
from selector.physics.drive.mechanics import ThreeMassMechanics
from selector.physics.drive.wind_up import wind_up_m


@dataclass(frozen=True)
class DriveSummary:
    """What a simulation amounts to.

    Attributes
    ----------
    axes : mapping of str to mapping of str to AxisSummary
        Run → axis → its errors.
    loops : mapping of str to LoopSummary
        Axis → its loop, for those with a control.
    quantities : tuple of CircleQuantities
        Of circles, slowest feed first.
    causes : CircleCauses or None
        Of circles.
    wind_up_m : mapping of str to float
        Axis → how much of its lost motion its own friction and springs make, see `wind_up.wind_up_m`.
    """

    axes: Mapping[str, Mapping[str, AxisSummary]]
    loops: Mapping[str, LoopSummary]
    quantities: tuple[CircleQuantities, ...] = ()
    causes: CircleCauses | None = None
    wind_up_m: Mapping[str, float] = field(default_factory=dict)


def drive_summary(model: DriveModel, simulation: DriveSimulation) -> DriveSummary:
    """The summary of a simulation of this model: of what is recorded, so of circles without run-in and run-out."""
    axes = {
        run: {name: _of_recorded(model, name, one.recorded) for name, one in done.items()}
        for run, done in simulation.axes.items()
    }
    known = {name: one.axis for done in simulation.axes.values() for name, one in done.items()}
    loops = {name: loop_summary(axis) for name, axis in known.items()}
    traces = tuple(simulation.traces.values())
    wound = {name: wind_up_m(axis) for name, axis in known.items()} if traces else {}
    return DriveSummary(
        axes,
        {name: loop for name, loop in loops.items() if loop is not None},
        circle_quantities(traces) if traces else (),
        circle_causes(traces, lead_m=_leads(model)) if traces else None,
        {name: size for name, size in wound.items() if size is not None},
    )


def course_of(model: DriveModel, name: str, run: AxisRun) -> ParameterCourse | None:
    """Stiffness and damping that an axis had in a run, given or from its own position and load; None if constant."""
    return run.course or parameters_along(model.parts.get(name), run.axis, run.motion)


def _of_recorded(model: DriveModel, name: str, run: AxisRun) -> AxisSummary:
    return axis_summary(run.axis, run.reference, run.motion, course_of(model, name, run))


def _leads(model: DriveModel) -> dict[str, float]:
    return {
        name: axis.axis.mechanics.lead_m
        for name, axis in model.axes.items()
        if isinstance(axis.axis.mechanics, ThreeMassMechanics)
    }
