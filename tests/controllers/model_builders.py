"""Models for the tests of this folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.model_file import Guard, Input, ModelFile, Output, OutputLimits, PositionPart, State, Term
from selector.recording import Channel, Recording

PATENT = Path(__file__).parents[2] / "fixtures" / "models" / "patent-two-sensors.json"


def rise_model(**changes: Any) -> ModelFile:
    """Z = 1 + 3·z1 − 2·z3 + 0.5·z1·z3 with centred, scaled rises of T1 and T3."""
    fields: dict[str, Any] = {
        "name": "two rises",
        "inputs": (
            Input(name="T1", centre=4.0, scale=2.0, valid_min=0.0, valid_max=10.0),
            Input(name="T3", centre=3.0, scale=1.5, valid_min=-1.0, valid_max=8.0),
        ),
        "outputs": (
            Output(
                name="Z",
                axis="Z",
                intercept=1.0,
                terms=(
                    Term(powers={"T1": 1}, coefficient=3.0),
                    Term(powers={"T3": 1}, coefficient=-2.0),
                    Term(powers={"T1": 1, "T3": 1}, coefficient=0.5),
                ),
            ),
        ),
    }
    return ModelFile(**(fields | changes))


def rich_model() -> ModelFile:
    """Everything at once: rise and absolute, speed, memory, cubes, two outputs, a position-dependent part."""
    return ModelFile(
        name="всё, 全部",
        inputs=(
            Input(name="T1", centre=4.1, scale=2.3, valid_min=0.0, valid_max=10.0, rate_limit_per_min=5.0),
            Input(
                name="T амб", role="ambient", reference="absolute", centre=21.7, scale=1.1, valid_min=18.0,
                valid_max=26.0,
            ),
            Input(
                name="n", role="spindle_speed", unit="rpm", reference="absolute", centre=1500.0, scale=900.0,
                valid_min=0.0, valid_max=3000.0,
            ),
        ),
        states=(
            State(name="T1.lag1800s", source="T1", tau_s=1800.0, centre=2.2, scale=1.7),
            State(name="n.lag300s", source="n", tau_s=300.0, centre=1400.0, scale=700.0),
        ),
        outputs=(
            Output(
                name="Z",
                axis="Z",
                intercept=-1.871,
                terms=(
                    Term(powers={"T1": 3}, coefficient=0.137, standard_error=0.01),
                    Term(powers={"T1": 1, "T амб": 2}, coefficient=-0.731),
                    Term(powers={"T1.lag1800s": 1}, coefficient=11.3),
                    Term(powers={"n.lag300s": 2, "T1": 1}, coefficient=0.2),
                ),
            ),
            Output(
                name="Y lower",
                axis="Y",
                intercept=0.1,
                terms=(Term(powers={"n": 1}, coefficient=2.0 / 3.0),),
                position=PositionPart(
                    axis="Y", reference_m=0.25, valid_min_m=-0.1, valid_max_m=0.6, intercept=3.0,
                    terms=(Term(powers={"T1": 1}, coefficient=7.7),),
                ),
            ),
        ),
        guard=Guard(stuck_after_s=3600.0),
    )  # fmt: skip


def warm_up(n: int = 200, step_s: float = 60.0, start_degc: float = 20.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time [s] and readings of T1 and T3 inside the valid ranges of `rise_model`."""
    time_s = np.arange(n) * step_s
    share = 1.0 - np.exp(-time_s / 3600.0)
    return time_s, {"T1": start_degc + 9.0 * share, "T3": start_degc + 7.0 * share**2}


def recording_of(runs: dict[str, pd.DataFrame], roles: dict[str, str] | None = None) -> Recording:
    """A recording; names that begin with T are temperatures, the others displacements, unless said."""
    units = {"temperature": "degC", "displacement": "um", "spindle_speed": "rpm", "position": "m", "ambient": "degC"}
    names = list(dict.fromkeys(name for table in runs.values() for name in table.columns))
    guessed = {
        name: (roles or {}).get(name, "temperature" if name.startswith("T") else "displacement") for name in names
    }
    return Recording.from_runs(
        runs, [Channel(name, guessed[name], units[guessed[name]], axis=name[0]) for name in names]
    )


def run_table(time_s: np.ndarray, columns: dict[str, np.ndarray]) -> pd.DataFrame:
    """One run as `Recording.from_runs` takes it."""
    return pd.DataFrame(columns, index=pd.Index(time_s, name="time_s"))


def guarded(
    *,
    rate: float | None = None,
    slew: float = 1.0,
    clamp: float = 100.0,
    dead: float = 0.0,
    part: PositionPart | None = None,
    number: Any = float,
    **guard: Any,
) -> GuardedModel:
    """`rise_model` behind a guard with these limits of Z, and what its model file says besides."""
    limits = OutputLimits(output="Z", clamp_um=clamp, slew_um_per_s=slew, dead_band_um=dead)
    first, second = rise_model().inputs
    output = rise_model().outputs[0].model_copy(update={"position": part})
    model = rise_model(
        inputs=(first.model_copy(update={"rate_limit_per_min": rate}), second),
        outputs=(output,),
        guard=Guard.model_validate({"limits": (limits,), **guard}),
    )
    return GuardedModel(model, number)


def frame_model(**changes: Any) -> ModelFile:
    """Z = 10 µm/K of the rise of T1."""
    fields_of_it: dict[str, Any] = {
        "name": "frame",
        "inputs": (Input(name="T1", valid_min=-20.0, valid_max=20.0),),
        "outputs": (Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=10.0),)),),
    }
    return rise_model(**(fields_of_it | changes))


def starts_of(guard: GuardedModel) -> list[float]:
    """Start readings that a guard has, in the order of its inputs."""
    kept = guard.retained
    return [value for name, value in kept.items() if name.startswith("start_") and kept[f"has_{name}"]]
