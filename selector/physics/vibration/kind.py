"""Vibration as a kind of simulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from selector.physics.simulation_kind import Columns, Progress, RunSettings, Simulated, SimulationKind

if TYPE_CHECKING:
    from selector.recording import Recording


class VibrationKind(SimulationKind):
    """Members, joints and sources of vibration."""

    name = "vibration"
    file_kinds = ("vibration",)
    family_module = "selector.physics.vibration.model_file"
    about = """Simulates how sources outside of the cut shake tool and workpiece, and writes a recording of it.

    Told are the modes of the structure, where each line of the sources goes, the periodic errors that it leaves on the
    part, and where the published chains are off the coupled structure. Beside RUN.csv stands RUN.machine.toml, for
    --machine of the other commands. With --inputs recorded speeds and forces drive the model, run by run, at their time
    stamps; --out is a folder then, which receives one file a run and machine.toml.
    """
    model_help = "Model file of members, joints and sources of vibration."
    report_help = "Also write a page: what the part keeps and where it comes from, modes, response, chains."
    seed_help = "Of phases and noise. Default: that of the model file; with --inputs its phases, and no noise."

    def model(self, file: Any, columns: Columns) -> Any:
        """The structure and its sources."""
        from selector.physics.vibration.vibration_model import vibration_model

        return vibration_model(file)

    def sections(self, file: Any) -> Sequence[str]:
        """All of the file."""
        return tuple(type(file).model_fields)

    def planned(self, model: Any, run: str, how: RunSettings) -> Simulated:
        """The run that the file describes."""
        done = model.simulation(run=run, seed=how.seed, progress=how.progress)
        return self._simulated(model, done)

    def driven(self, model: Any, recording: Recording, how: RunSettings) -> Simulated:
        """The structure in every recorded run."""
        from selector.physics.channel_differences import channel_differences
        from selector.physics.vibration.vibration_driving import driven_runs

        done = driven_runs(model, recording, seed=how.seed, progress=how.progress)
        differences = channel_differences(done.recording, recording, done.inputs)
        return self._simulated(model, done, differences)

    def _simulated(self, model: Any, done: Any, differences: Any = None) -> Simulated:
        recording = done.recording
        acting = tuple(one.name for one in recording.channels if one.role in ("force", "spindle_speed"))
        return Simulated(model, recording, done.findings, done, acting, differences)

    def summary(self, done: Simulated, progress: Progress) -> Any:
        """Modes, lines, errors and chains."""
        from selector.physics.vibration.vibration_summary import vibration_summary

        progress(0, 1, "modes, lines and errors")
        return vibration_summary(done.model, done.details)
