"""A feed drive as a kind of simulation."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from selector.errors import OptionError
from selector.physics.simulation_kind import Columns, Option, Progress, RunSettings, Simulated, SimulationKind

if TYPE_CHECKING:
    from selector.findings import Finding
    from selector.recording import Recording


class DriveKind(SimulationKind):
    """The axes of a feed drive."""

    name = "drive"
    file_kinds = ("drive",)
    family_module = "selector.physics.drive.model_file"
    about = """Simulates how the axes of a feed drive follow their command, and writes a recording of it.

    Beside RUN.csv stands RUN.machine.toml, for --machine of the other commands. With --inputs the axes follow recorded
    commands, run by run, at their time stamps. --out is a folder then, and for a ball-bar test, whose circles are one
    run for each feed and direction; it receives one file a run and machine.toml.
    """
    model_help = "Model file of a feed drive."
    report_help = "Also write a page: courses, errors and their causes, the control loop."
    out_help = "Recording to write; with --inputs and of a ball-bar test a folder."
    why_folder = "a ball-bar test has one run for each feed and direction"
    options = (
        Option("open_loop", bool, "", "With --inputs: the recorded output of the control acts, not the model's."),
    )

    def model(self, file: Any, columns: Columns) -> Any:
        """The axes."""
        from selector.physics.drive.drive_model import drive_model

        return drive_model(file, columns)

    def require_options(self, file: Any, asked: Mapping[str, Any], *, driven: bool, report: bool) -> None:
        """An open loop needs a recorded output."""
        if asked.get("open_loop") and not driven:
            raise OptionError(
                "--open-loop without --inputs",
                expected="recordings whose output of the control acts on the axes",
                where="--open-loop",
                advice="add --inputs RUN, or leave --open-loop out",
            )

    def findings_before(self, model: Any) -> tuple[Finding, ...]:
        """Loops that are unstable, periods that are too long, and the like."""
        from selector.physics.drive.drive_summary import model_findings

        return tuple(model_findings(model))

    def findings_after(self, done: Simulated, summary: Any) -> tuple[Finding, ...]:
        """Axes that stick, reach limits, or swing; circles whose causes cannot be told."""
        from selector.physics.drive.drive_summary import simulation_findings

        caused = () if summary.causes is None else summary.causes.findings
        return (
            *simulation_findings(done.model, done.details, summary.loops, driven=done.differences is not None),
            *caused,
        )

    def planned(self, model: Any, run: str, how: RunSettings) -> Simulated:
        """The motion that the file describes."""
        return self._simulated(model, model.simulation(run=run, seed=how.seed))

    def driven(self, model: Any, recording: Recording, how: RunSettings) -> Simulated:
        """The axes on every recorded run."""
        from selector.physics.drive.driving import driven_runs, recorded_differences

        opened = bool(how.asked.get("open_loop"))
        done = driven_runs(model, recording, opened=opened, seed=how.seed, progress=how.progress)
        differences = recorded_differences(model, done, recording)
        return self._simulated(model, done, differences)

    def _simulated(self, model: Any, done: Any, differences: Any = None) -> Simulated:
        recording = done.recording
        acting = tuple(
            one.name for one in recording.channels if one.role == "position_command" or one.name in model.inputs
        )
        return Simulated(model, recording, done.findings, done, acting, differences)

    def summary(self, done: Simulated, progress: Progress) -> Any:
        """Errors and their causes, loops, and the circle."""
        from selector.physics.drive.drive_summary import drive_summary

        return drive_summary(done.model, done.details)

    def quiet(self, file: Any) -> Any:
        """The file with sensors that neither round nor rustle."""
        from selector.physics.model_text import plain_values

        plain = copy.deepcopy(plain_values(file))
        for axis in plain["axes"].values():
            sensing = axis.get("sensing", {})
            for key in ("motor_resolution", "scale_resolution_m", "current_noise"):
                if key in sensing:
                    sensing[key] = 0.0
        return self.checked(plain, where=f"model {file.model.name!r}")
