"""A machine that warms as a kind of simulation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from selector.errors import Misfit, ModelFileError, OptionError, refuse
from selector.physics.simulation_kind import Columns, DutyCycle, Option, RunSettings, Simulated, SimulationKind

if TYPE_CHECKING:
    from selector.findings import Finding
    from selector.recording import Recording


class ThermalKind(SimulationKind):
    """A network, thermal modes, the field machine, or one from a mesh."""

    name = "thermal"
    file_kinds = ("network", "modes", "field", "mesh")
    family_module = "selector.physics.thermal.model_file"
    about = """Simulates how a machine warms and moves, and writes a recording of it.

    Beside RUN.csv stands RUN.machine.toml, for --machine of the other commands. With --inputs the model is driven by
    recorded runs at their own time stamps; --out is a folder then, which receives one file a run and machine.toml and
    can be compared with the recordings. Without --seed such simulations have no noise.
    """
    model_help = "Model file of a network, of thermal modes, of the field machine, or of a mesh."
    report_help = "Also write a page: courses, heat balance, the field machine's picture."
    seed_help = "Of the instruments' noise. Default: that of the model file; none with --inputs."
    options = (
        Option(
            "cycle",
            DutyCycle,
            "CYCLE.csv",
            "Duty cycle (time_s, spindle_speed) instead of the speeds of the model file; its last row is the end.",
        ),
        Option(
            "picture_at_min",
            float,
            "MIN",
            "When the picture of a field machine is taken. Default: at the largest displacement.",
        ),
    )
    column_section = "conditions."

    def model(self, file: Any, columns: Columns) -> Any:
        """The machine."""
        from selector.physics.thermal.thermal_model import thermal_model

        return thermal_model(file)

    def require_options(self, file: Any, asked: Mapping[str, Any], *, driven: bool, report: bool) -> None:
        """Pictures are of field machines, in a report; a duty cycle and recordings both say the speed."""
        refuse(_misfits(file.model.kind, asked, driven, report), OptionError)

    def findings_before(self, model: Any) -> tuple[Finding, ...]:
        """Numbers that no machine has."""
        from selector.physics.thermal.thermal_model import model_findings

        return tuple(model_findings(model.file))

    def planned(self, model: Any, run: str, how: RunSettings) -> Simulated:
        """The conditions that the file describes, or a duty cycle."""
        from selector.physics.model_text import MOST_SAMPLES
        from selector.physics.thermal.modes.modes import Cyclogram
        from selector.physics.thermal.schedule import scheduled
        from selector.physics.thermal.thermal_model import simulation_findings

        settings, cycle, cyclogram = model.file.run, how.asked.get("cycle"), None
        duration_s = settings.duration_min * 60.0
        if cycle is not None:
            # a single row holds for the duration of the file
            ends = len(cycle.time_s) - 1 or None
            last_s = duration_s if ends is None else float(cycle.time_s[-1])
            cyclogram = Cyclogram(cycle.time_s[:ends], cycle.speed_rpm[:ends], last_s)
            duration_s = cyclogram.end_s
            if (count := duration_s / min(settings.period_s, settings.step_s)) > MOST_SAMPLES:
                raise ModelFileError(
                    f"{duration_s / 3600:.6g} h, which make {count:.3g} samples or steps",
                    expected=f"at most {MOST_SAMPLES}",
                    where=f"the duty cycle {cycle.path}",
                    advice="make run.period_s and run.step_s of the model file larger, or simulate a shorter time",
                )
        if duration_s < settings.period_s:
            raise ModelFileError(
                f"a run of {duration_s:g} s with a sample every {settings.period_s:g} s",
                expected="a run of one period or more",
                where="key run.duration_min" if cycle is None else f"{cycle.path}, with key run.period_s",
                advice="make run.duration_min larger or run.period_s smaller",
            )
        conditions = scheduled(
            model.file.conditions, how.columns, duration_s=duration_s, period_s=settings.period_s, cyclogram=cyclogram
        )
        made = model.simulate(conditions, run=run, seed=how.seed)
        return self._simulated(model, made, tuple(simulation_findings(made)), lambda _: conditions)

    def driven(self, model: Any, recording: Recording, how: RunSettings) -> Simulated:
        """The machine under recorded conditions; what was not recorded is as the file says."""
        from selector.physics.thermal.schedule import driven, scheduled
        from selector.physics.thermal.thermal_model import driven_runs

        file = model.file
        longest_s = max(float(recording.time_s(run)[-1]) for run in recording.runs)
        otherwise = scheduled(
            file.conditions,
            how.columns,
            duration_s=max(file.run.duration_min * 60.0, longest_s),
            period_s=file.run.period_s,
        )
        made, findings = driven_runs(
            model, recording, inputs=file.inputs, otherwise=otherwise, seed=how.seed, progress=how.progress
        )
        return self._simulated(
            model, made, tuple(findings), lambda run: driven(recording, run, file.inputs, otherwise).conditions, ()
        )

    def _simulated(
        self, model: Any, made: Recording, findings: Any, conditions: Any, differences: Any = None
    ) -> Simulated:
        """`details` gives the conditions of a run."""
        balances = made.provenance["runs"]
        return Simulated(
            model,
            made,
            findings,
            conditions,
            # the outputs of the model stand last
            made.names[: len(made.names) - len(model.outputs)],
            differences,
            {run: {"balance": balances.get(run) or None} for run in made.runs},
        )


def _misfits(kind: str, asked: Mapping[str, Any], driven: bool, report: bool) -> Iterator[Misfit]:
    at_min, where = asked.get("picture_at_min"), "--picture-at-min"
    if at_min is not None and (not report or kind not in ("field", "mesh")):
        found = f"--picture-at-min {f'for a model of the kind {kind}' if report else 'without --report'}"
        advice = "leave --picture-at-min out" if report else "add --report REPORT.html"
        yield found, "a field machine and a report that shows it", where, advice
    if at_min is not None and not (math.isfinite(at_min) and at_min >= 0):
        yield f"{at_min:g}", "minutes from the start of the run, 0 or more", where, "e.g. --picture-at-min 120"
    if asked.get("cycle") is not None and driven:
        expected = "one of them: both say the spindle speed"
        yield "--cycle and --inputs together", expected, "command line", "leave one out"
