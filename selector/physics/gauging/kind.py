"""Gauging as a kind of simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from selector.physics.simulation_kind import Columns, Progress, RunSettings, Simulated, SimulationKind

if TYPE_CHECKING:
    from selector.recording import Recording


class GaugingKind(SimulationKind):
    """A gauge and the grinding that it stops."""

    name = "gauging"
    file_kinds = ("gauging",)
    family_module = "selector.physics.gauging.model_file"
    about = """Simulates how a gauge stops grinding when the part is to size, and writes a recording of it.

    Told are the thresholds, the distribution of finished sizes by formula and by Monte Carlo, the capability, which
    filter and threshold would be best, and what thresholds gain that follow measured parts. Beside RUN.csv stands
    RUN.machine.toml, for --machine of the other commands. Several parts are one run each, so --out is a folder then,
    which receives one file a run and machine.toml; so it is with --inputs, where recorded allowances drive the gauge,
    run by run, at their time stamps.
    """
    model_help = "Model file of a gauge and the grinding that it stops."
    report_help = "Also write a page: finished sizes, what filter and threshold are best, parts in time, the gauge."
    out_help = "Recording to write; with --inputs and of several parts a folder."
    seed_help = "Of noise and spread. Default: that of the model file."
    why_folder = "every part that is ground is a run of its own"

    def model(self, file: Any, columns: Columns) -> Any:
        """The gauge and its grinding."""
        from selector.physics.gauging.gauging_model import gauging_model

        return gauging_model(file)

    def planned(self, model: Any, run: str, how: RunSettings) -> Simulated:
        """The parts that the file describes."""
        done = model.simulation(run=run, seed=how.seed, progress=how.progress)
        return Simulated(model, done.recording, done.findings, done)

    def driven(self, model: Any, recording: Recording, how: RunSettings) -> Simulated:
        """The gauge on every recorded run."""
        from selector.physics.channel_differences import channel_differences
        from selector.physics.gauging.gauging_driving import driven_runs

        done = driven_runs(model, recording, seed=how.seed, progress=how.progress)
        differences = channel_differences(done.recording, recording, done.inputs)
        return Simulated(model, done.recording, done.findings, done, done.inputs, differences)

    def roles_asked(self, file: Any, recording: Recording, unread: Sequence[str]) -> Mapping[str, str]:
        """Columns that the file names, and unread ones that are called as in a simulation."""
        from selector.physics.gauging.gauging_model import roles_asked

        return roles_asked(file, recording, unread)

    def summary(self, done: Simulated, progress: Progress) -> Any:
        """Finished sizes, capability, filters and thresholds."""
        from selector.physics.gauging.gauging_summary import gauging_summary

        progress(0, 1, "sizes and filters")
        return gauging_summary(done.model, done.details, progress=progress)
