"""A fifth kind of simulation in one file: a mass on a spring and a damper that a force pushes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from pydantic import Field
from scipy.signal import cont2discrete

from selector.errors import InputError
from selector.number_text import number_text
from selector.physics.channel_differences import channel_differences
from selector.physics.model_fields import Fit, Unit, Usual, file_with, numbers_of, parameters_of, unlikely_values
from selector.physics.model_text import Bounds, Entry, ModelFamily, Name, Note, limited
from selector.physics.simulation_kind import Simulated, SimulationKind
from selector.recording import Channel, Recording
from selector.telling.account import Captioned, Drawing, section, table
from selector.telling.simulated.result import simulation_account

FORCE, MOTION = Channel("force", "force", "N"), Channel("motion", "displacement", "um", place="mass")


class Model(Entry):
    kind: Literal["spring-mass"]
    name: Name
    note: Note = ""


class Run(Entry):
    period_s: Annotated[float, limited(1e-6, 10), Unit("s"), Field(description="time between samples")] = 1e-3
    duration_s: Annotated[float, limited(1e-3, 1e4), Unit("s"), Field(description="length of the run")] = 1.0
    force_n: Annotated[float, limited(-1e6, 1e6), Unit("N"), Field(description="from a tenth of the run on")] = 100.0
    seed: int = 0


class Oscillator(Entry):
    mass_kg: Annotated[
        float, limited(1e-6, 1e6), Unit("kg"), Fit(), Usual(0.01, 1e5, {"g": 1e-3}), Field(description="what moves")
    ]
    stiffness_n_per_m: Annotated[float, limited(1e-3, 1e12), Unit("N/m"), Fit(), Field(description="of the spring")]
    damping_ns_per_m: Annotated[float, limited(0, 1e9), Unit("N·s/m"), Fit(up_to=1e3), Field(description="0: none")] = (
        0.0
    )


class File(Entry):
    model: Model
    run: Run = Run()
    oscillator: Oscillator
    bounds: Bounds = Field(default_factory=dict)


FAMILY = ModelFamily[File]("spring-mass", {"spring-mass": File}, lambda _: (), "the page", "the examples")


@dataclass(frozen=True)
class SpringMass:
    file: File

    @property
    def name(self) -> str:
        return self.file.model.name

    @property
    def parameters(self) -> dict[str, Any]:
        return parameters_of(self.file, numbers_of(self.file))

    def with_parameters(self, values: dict[str, float]) -> SpringMass:
        return replace(self, file=file_with(self.file, values, numbers_of(self.file), FAMILY.checked))

    def motion_um(self, force_n: np.ndarray, period_s: float) -> np.ndarray:
        """m·x″ + c·x′ + k·x = F, exact for a force that is held between samples."""
        one = self.file.oscillator
        a = np.array([[0.0, 1.0], [-one.stiffness_n_per_m / one.mass_kg, -one.damping_ns_per_m / one.mass_kg]])
        discrete = cont2discrete((a, np.array([[0.0], [1.0 / one.mass_kg]]), np.eye(2), np.zeros((2, 1))), period_s)
        state, found = np.zeros(2), np.empty(len(force_n))
        for k, force in enumerate(force_n):
            found[k] = 1e6 * state[0]
            state = discrete[0] @ state + discrete[1][:, 0] * force
        return found


class SpringMassKind(SimulationKind):
    name = "spring-mass"
    file_kinds = ("spring-mass",)
    about = "Simulates a mass on a spring, and writes a recording of it."
    model_help = "Model file of a mass on a spring."
    report_help = "Also write a page: how far it moves."

    def family(self):
        return FAMILY

    def model(self, file, columns):
        return SpringMass(file)

    def planned(self, model, run, how):
        settings = model.file.run
        time_s = np.arange(0.0, settings.duration_s, settings.period_s)
        force = np.where(time_s >= 0.1 * settings.duration_s, settings.force_n, 0.0)
        return self._simulated(model, {run: (time_s, force)}, settings.seed if how.seed is None else how.seed)

    def driven(self, model, recording, how):
        if FORCE.name not in recording.names:
            raise InputError("no channel 'force'", expected="the force", where="recording", advice="record it")
        runs = {run: (recording.time_s(run), recording.values(run, [FORCE.name])[:, 0]) for run in recording.runs}
        done = self._simulated(model, runs, how.seed)
        return replace(done, differences=channel_differences(done.recording, recording, done.inputs))

    def _simulated(self, model, runs, seed):
        tables = {
            run: pd.DataFrame(
                {FORCE.name: force, MOTION.name: model.motion_um(force, float(np.median(np.diff(time_s))))},
                index=pd.Index(time_s, name="time_s"),
            )
            for run, (time_s, force) in runs.items()
        }
        told = {"simulated": {"model": model.name, "kind": self.name, "seed": seed}, "runs": {run: {} for run in runs}}
        recording = Recording.from_runs(tables, (FORCE, MOTION), told)
        return Simulated(model, recording, (), None, (FORCE.name,))

    def findings_before(self, model):
        return tuple(unlikely_values(model.file))

    def summary(self, done, progress):
        return {run: float(np.abs(done.recording.values(run, [MOTION.name])).max()) for run in done.recording.runs}


def account(result, drawn):
    """How far it moves, in every run."""
    run, most = max(result.summary.items(), key=lambda item: item[1])
    rows = [(name, number_text(um)) for name, um in result.summary.items()]
    course = result.recording.values(run, [MOTION.name])[:, 0]
    figure = [Drawing(go.Figure(go.Scatter(y=course), {"title": "Motion", "margin": {"t": 60}, "height": 300}))]
    own = section(
        "motion", "Motion", *(figure if drawn else []), Captioned("Largest motion", table(["run", ">µm"], rows))
    )
    drawings = {"motion": figure} if drawn else {}
    said = [f"The mass moves by up to {number_text(most)} µm."]
    return simulation_account(result, said, (own,), drawings=drawings, facts={}, data={"largest_um": result.summary})
