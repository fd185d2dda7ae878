"""A feed drive that runs: its file in, recordings of its axes out, its parameters open to be fitted again."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd

from selector.errors import InputError
from selector.findings import Finding
from selector.physics.checks import errors_name
from selector.physics.drive.ball_bar.circle import LONGEST_PERIOD_S, BallBarTrace, Circle, PairGeometry, ball_bar_run
from selector.physics.drive.model_file import FAMILY, columns_needed, file_circles, file_reference, moved_axes
from selector.physics.drive.model_schema import MOST_STEPS, CircleMotion, DriveFile, FileAxis, file_axis
from selector.physics.drive.parts.axis import Axis, AxisState, RigidMechanics
from selector.physics.drive.parts.catalogue import Parts
from selector.physics.drive.simulation import AxisRun, advised_step_s, circle_step_s, simulate_axis, steps_per_period
from selector.physics.drive.trajectory import Motion, Reference
from selector.physics.model_fields import ModelOfFile, value_of
from selector.physics.simulation_kind import Columns
from selector.recording import Channel, Recording
from selector.types import Vector
from selector.units import CANONICAL_UNITS

#: ``output`` of an axis in the model file → role of what its control puts out.
OUTPUT_ROLES = {"current": "current", "voltage": "voltage", "force": "force", "number": "state"}
#: What is recorded of an axis: commanded position, position that the control sees, true position of the table,
#: commanded minus true, what the control puts out, what is added to that behind it, both together, force of the screw
#: on the table, force from outside.
KINDS = ("command", "position", "table", "error", "output", "added", "total", "force", "load")
INPUTS = ("command", "added", "load")  #: Those of `KINDS` that act on the axis.
_UM = 1e6


def axis_channels(name: str, axis: FileAxis, *, loaded: bool, added: bool = False) -> dict[str, Channel]:
    """Kind, of `KINDS`, → channel; ``load`` only of a `loaded` axis, ``added`` and ``total`` only where `added`.

    Positions of a rotary axis have the role ``state``, in rad: recordings have no role for angles; its error in µrad.
    The place of a position says whether it is what the control sees or what is true.
    """
    turns = axis.rotary
    servo = axis.axis.servo
    seen = f"{'scale' if servo is None or servo.feedback == 'table' else 'motor'} (seen by the control)"
    true = "table (true)"
    pushed = "motor" if isinstance(axis.axis.mechanics, RigidMechanics) else "screw"
    output = axis.section.output
    made = {
        "command": (f"{name}_command", "state" if turns else "position_command", "command [rad]" if turns else None),
        "position": (f"{name}_position", "state" if turns else "position", f"{seen} [rad]" if turns else seen),
        "table": (f"{name}_table", "state" if turns else "position", f"{true} [rad]" if turns else true),
        "error": (f"{name}_error", "state" if turns else "displacement", "table [µrad]" if turns else "table"),
        "output": (f"{name}_{'output' if output in ('number', 'force') else output}", OUTPUT_ROLES[output], "control"),
        "added": (f"{name}_added", OUTPUT_ROLES[output], "added behind the control"),
        "total": (f"{name}_total", OUTPUT_ROLES[output], "control, and what is added"),
        "force": (f"{name}_force", "state" if turns else "force", f"{pushed} [N·m]" if turns else pushed),
        "load": (f"{name}_load", "state" if turns else "force", "outside [N·m]" if turns else "outside"),
    }
    return {
        kind: Channel(called, role, CANONICAL_UNITS[role], place, axis=name)
        for kind, (called, role, place) in made.items()
        if {"load": loaded, "added": added, "total": added}.get(kind, True)
    }


def axis_courses(motion: Motion, reference: Reference, added: Vector | None = None) -> dict[str, Vector]:
    """Kind, of `KINDS`, → course at the samples of the reference, in the unit of its channel."""
    more = np.zeros(len(motion.time_s)) if added is None else added
    return {
        "command": motion.reference_m,
        "position": motion.measured_m,
        "table": motion.table_m,
        "error": motion.tracking_error_m * _UM,
        "output": motion.command,
        "added": more,
        "total": motion.command + more,
        "force": motion.axial_force_n,
        "load": np.zeros(len(motion.time_s)) if reference.force_n is None else reference.force_n,
    }


def require_few_steps(
    name: str, axis: Axis, duration_s: float, step_s: float, *, period_s: float | None = None
) -> None:
    """Refuses a run of an axis with too many steps, as they are laid: control and samples make them shorter.

    `duration_s` and `step_s` are the length of its motion and the largest step [s]; `period_s` is the distance of the
    samples [s], None where it is not known yet but no shorter than the steps.

    InputError: there are more than `MOST_STEPS`; or the periods of samples and control do not fit together.
    """
    sample_s = axis.servo.sample_s if axis.servo is not None else 0.0
    count = duration_s / (min(step_s, sample_s) if sample_s > 0 else step_s)
    if count <= MOST_STEPS and period_s is not None:
        count = duration_s / period_s * steps_per_period(axis, period_s, step_s)
    if count <= MOST_STEPS:
        return
    by_step = duration_s / step_s > 0.5 * count
    raise InputError(
        f"{count:.3g} steps of {duration_s / count:.3g} s in a motion of {duration_s:.6g} s of axis {name}",
        expected=f"at most {MOST_STEPS}",
        where="key run.step_s" if by_step else f"key axes.{name}.servo.sample_s",
        advice="simulate a shorter motion or a faster feed (mm/min), or give a larger "
        + ("run.step_s" if by_step else "sample_s, and a run.period_s that is a multiple of it"),
    )


DEVIATION = Channel("deviation", "displacement", "um", "ball-bar")
ANGLE = Channel("angle", "state", "1", "ball-bar [rad]")


@dataclass(frozen=True)
class DriveSimulation:
    """A simulation of one or more runs."""

    recording: Recording  #: What a measurement would hold, see `drive_channels`
    axes: Mapping[str, Mapping[str, AxisRun]]  #: Run → axis → what it did
    #: Run → what a ball-bar shows of it; empty unless the axes went in circles
    traces: Mapping[str, BallBarTrace] = field(default_factory=dict)
    #: Axis → kind, of `KINDS` → name of the recorded channel; for axes that recorded runs drove
    matched: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()  #: What is to be said about recorded clocks, and what could not be compared
    opened: bool = False  #: Whether the recorded output of the control acted, so that it is no result

    def runs_of(self, name: str) -> list[AxisRun]:
        """What an axis did in every run that it takes part in."""
        return [axes[name] for axes in self.axes.values() if name in axes]


@dataclass(frozen=True)
class DriveModel(ModelOfFile[DriveFile]):
    """The feed drive that a model file describes; made by `drive_model`."""

    family = FAMILY
    #: Values of the columns that it refers to, see `model_file.columns_needed`; empty without such
    columns: Columns = field(default_factory=dict)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what acts on it: the command of every axis that moves."""
        return tuple(axis_channels(name, axis, loaded=False)["command"].name for name, axis in self.axes.items())

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Channels that it gives: what every axis does, then what a ball-bar shows."""
        shown = (ANGLE, DEVIATION) if isinstance(self.file.motion, CircleMotion) else ()
        return (*self._axis_outputs(tuple(self.axes)), *shown)

    @cached_property
    def axes(self) -> Mapping[str, FileAxis]:
        """Axis → its values, for the axes that the motion moves."""
        return {name: self.file_axes[name] for name in moved_axes(self.file)}

    @cached_property
    def file_axes(self) -> Mapping[str, FileAxis]:
        """Axis → its values, for all axes of the file."""
        return {name: file_axis(section) for name, section in self.file.axes.items()}

    @property
    def parts(self) -> Mapping[str, Parts]:
        """Axis → its catalogue parts, for the axes that are described by parts."""
        return {name: axis.parts for name, axis in self.axes.items() if axis.parts is not None}

    @cached_property
    def runs(self) -> Mapping[str, Circle | None]:
        """Run of `simulation` → its circle; a motion of one axis is one run with an empty name, for any name."""
        if not isinstance(self.file.motion, CircleMotion):
            return {"": None}
        turns = {1: "ccw", -1: "cw"}
        return {f"F{one.feed_mm_per_min:g} {turns[one.direction]}": one for one in file_circles(self.file)}

    def simulation(self, *, run: str = "simulation", seed: int | None = None) -> DriveSimulation:
        """What the axes do in the motion of the file.

        Runs of circles are called after feed and direction, such as ``"F1000 ccw"``. Without a `seed` of the noise,
        that of the file counts.

        InputError: an axis runs away, or the steps of the calculation are too many.
        """
        noise = self.file.run.seed if seed is None else seed
        if isinstance(self.file.motion, CircleMotion):
            return self._circles(noise)
        reference = file_reference(self.file, self.columns)
        name = next(iter(self.axes))
        done = self.axis_run(name, reference, seed=noise)
        return self.gathered({run: {name: done}}, {run: reference.time_s}, noise)

    def axis_run(
        self,
        name: str,
        reference: Reference,
        *,
        commands: Vector | None = None,
        start: AxisState | None = None,
        seed: int = 0,
    ) -> AxisRun:
        """What one axis does along a reference, or, with `commands`, when its control is replaced by them.

        `commands`, shape (n_samples,), is what the control would put out [actuator unit], each held until the next.
        Without a `start` it begins at rest at the first position of the reference.

        InputError: it runs away, or the steps are too many.
        """
        axis, file = self.file_axes[name].axis, self.file
        step_s = file.run.step_s or advised_step_s(axis, reference.period_s)
        duration_s = (len(reference.position_m) - 1) * reference.period_s
        with errors_name(f"axis {name}"):
            require_few_steps(name, axis, duration_s, step_s, period_s=reference.period_s)
            course = self.file_axes[name].course(reference)
            motion = simulate_axis(
                axis, reference, step_s=step_s, course=course, start=start, commands=commands, seed=seed
            )
        return AxisRun(axis, reference, motion, course, step_s)

    def gathered(
        self,
        axes: Mapping[str, Mapping[str, AxisRun]],
        times_s: Mapping[str, Vector],
        seed: int,
        traces: Mapping[str, BallBarTrace] | None = None,
    ) -> DriveSimulation:
        """Runs of axes as one recording whose samples stand at `times_s` of each run, and what a ball-bar shows."""
        names = tuple(dict.fromkeys(name for done in axes.values() for name in done))
        loaded = {name for done in axes.values() for name, one in done.items() if one.reference.force_n is not None}
        added = {name for done in axes.values() for name, one in done.items() if one.added is not None}
        tables, told = {}, {}
        for run, done in axes.items():
            columns: dict[str, Vector] = {}
            for name, one in ((name, one.recorded) for name, one in done.items()):
                channels = axis_channels(name, self.file_axes[name], loaded=name in loaded, added=name in added)
                courses = axis_courses(one.motion, one.reference, one.added)
                for kind, channel in channels.items():
                    columns[channel.name] = _at(times_s[run] - times_s[run][0], one.motion.time_s, courses[kind])
            if traces:
                columns |= {ANGLE.name: traces[run].angle_rad, DEVIATION.name: traces[run].deviation_um}
            tables[run] = pd.DataFrame(columns, index=pd.Index(times_s[run], name="time_s"))
            told[run] = {"step_s": {name: one.step_s for name, one in done.items()}}
        provenance = {
            "simulated": {"model": self.name, "kind": self.file.model.kind, "seed": seed, "instruments": True},
            "runs": told,
        }
        outputs = (*self._axis_outputs(names, loaded, added), *((ANGLE, DEVIATION) if traces else ()))
        return DriveSimulation(Recording.from_runs(tables, outputs, provenance), axes, traces or {})

    def _circles(self, seed: int) -> DriveSimulation:
        errors = self.file.ball_bar
        geometry = PairGeometry() if errors is None else value_of(PairGeometry, errors)
        noise_um = float(getattr(errors, "noise_um", 0.0))
        axes = {name: axis.axis for name, axis in self.axes.items()}
        said, period_s = self.file.run.step_s, self.file.run.period_s
        along = {name: axis.course for name, axis in self.axes.items()}
        runs: dict[str, dict[str, AxisRun]] = {}
        traces: dict[str, BallBarTrace] = {}
        times_s: dict[str, Vector] = {}
        for number, (run, circle) in enumerate(self.runs.items()):
            if circle is None:
                continue
            for name, axis in axes.items():
                step_s = said or circle_step_s(axis, LONGEST_PERIOD_S)
                require_few_steps(name, axis, circle.duration_s, step_s, period_s=period_s)
            with errors_name(f"run {run}"):
                traces[run], runs[run] = ball_bar_run(
                    axes,
                    circle,
                    geometry,
                    period_s=period_s,
                    noise_um=noise_um,
                    courses=along,
                    step_s=said,
                    seed=seed,
                    number=number,
                )
            times_s[run] = next(iter(runs[run].values())).recorded.motion.time_s
        return self.gathered(runs, times_s, seed, traces)

    def _axis_outputs(
        self, names: tuple[str, ...], loaded: Collection[str] = (), added: Collection[str] = ()
    ) -> tuple[Channel, ...]:
        return tuple(
            channel
            for name in names
            for channel in axis_channels(
                name, self.file_axes[name], loaded=name in loaded, added=name in added
            ).values()
        )


def drive_model(file: DriveFile, columns: Columns | None = None) -> DriveModel:
    """The feed drive that a model file describes, ready to run.

    `columns` are the values that it refers to, see `model_file.columns_needed`.

    Raises InputError: a column lacks. Raises ModelFileError: ``[bounds]`` names what is no parameter, or excludes the
    value of one.
    """
    lacking = [key for key in columns_needed(file) if key not in (columns or {})]
    if lacking:
        raise InputError(
            "a column that was not read",
            expected="values of every column that the model file refers to",
            where=f"key {lacking[0]}",
            advice="read the file beside the model and give its values",
        )
    model = DriveModel(file, columns or {})
    _ = model.parameters  # the bounds are checked here, not when a fit asks for them
    return model


def _at(time_s: Vector, grid_s: Vector, values: Vector) -> Vector:
    """A course at other times; itself where they are its own up to a millionth of a period."""
    if len(time_s) == len(grid_s) and np.allclose(time_s, grid_s, rtol=0.0, atol=1e-6 * (grid_s[1] - grid_s[0])):
        return values
    return np.interp(time_s, grid_s, values)
