"""Recorded runs through the generated program and through the reference, and how far they are apart."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selector.controllers.application import Accuracy, displacement_of, position_channels, require_channels, zero_of
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.replay.rows import Answers, Array, Rows, reference_answers
from selector.recording import Recording


class Executor(Protocol):
    """Runs the exported program of a model."""

    def __call__(self, model: ModelFile, rows: Rows, *, files: Mapping[str, str]) -> Answers:
        """What the program in these files (name → text) gives, row by row."""


@dataclass(frozen=True, eq=False)
class ReplayedRun:
    """One run.

    Attributes
    ----------
    run : str
    time_s : ndarray of shape (n_samples,)
    correction_um, reference_um : ndarray of shape (n_samples, n_outputs)
        Of the generated program, and of `GuardedModel` in float64.
    recorded_um : ndarray of shape (n_samples, n_outputs)
        Recorded displacement from its own zero; NaN where there is none.
    accuracy : dict of str to Accuracy
        Per output, recorded displacement with and without this correction.
    faulty_share : float
        Share of the samples in which the program did not follow the whole model.
    """

    run: str
    time_s: Array
    correction_um: Array
    reference_um: Array
    recorded_um: Array
    accuracy: dict[str, Accuracy]
    faulty_share: float

    @property
    def max_abs_difference_um(self) -> float:
        """Largest difference between program and reference [µm]; infinite if the program gave no number."""
        difference = np.abs(self.correction_um - self.reference_um)
        return float(np.max(np.where(np.isfinite(difference), difference, np.inf), initial=0.0))


@dataclass(frozen=True, eq=False)
class Replay:
    """All runs, and what executed the program."""

    runs: tuple[ReplayedRun, ...]
    executed_by: str

    @property
    def rows(self) -> int:
        """Samples in all."""
        return sum(len(run.time_s) for run in self.runs)

    @property
    def max_abs_difference_um(self) -> float:
        """Largest difference of all runs [µm]."""
        return max((run.max_abs_difference_um for run in self.runs), default=0.0)

    def as_dict(self) -> dict[str, object]:
        """The part of `selector.export/1`."""
        return {
            "rows": self.rows,
            "max_abs_difference_um": self.max_abs_difference_um,
            "executed_by": self.executed_by,
        }


def replayed(
    model: ModelFile,
    files: Mapping[str, str],
    recording: Recording,
    execute: Executor,
    executed_by: str,
    progress: Callable[[str], None] | None = None,
) -> Replay:
    """Every run of a recording from its own start through a generated program.

    Raises
    ------
    RecordingError
        An input, or an axis position that the model needs, is missing in every run.
    OptionError
        The program cannot be executed on this machine.
    """
    require_channels(model, recording)
    found = []
    for run in recording.runs:
        if progress is not None:
            progress(run)
        rows = rows_of_run(model, recording, run)
        answers, reference = execute(model, rows, files=files), reference_answers(model, rows)
        recorded = np.column_stack(
            [displacement_of(of, recording, run) - zero_of(of, recording, run, None) for of in model.outputs]
        )
        accuracy = {
            output.name: Accuracy.of(-answers.correction_um[:, k], recorded[:, k])
            for k, output in enumerate(model.outputs)
        }
        faulty = float(np.mean(reference.mode != 1)) if len(rows) else 0.0
        correction, expected = answers.correction_um, reference.correction_um
        found.append(ReplayedRun(run, recording.time_s(run), correction, expected, recorded, accuracy, faulty))
    return Replay(tuple(found), executed_by)


def rows_of_run(model: ModelFile, recording: Recording, run: str) -> Rows:
    """The calls that a control would have made in a recorded run: ready and wanted throughout."""
    time_s = recording.time_s(run)
    n = len(time_s)
    channels = position_channels(model, recording)
    readings = recording.values(run, [item.name for item in model.inputs])
    positions = recording.values(run, [channels[axis] for axis in axes_of(model)]) if channels else np.zeros((n, 0))
    always, never = np.ones(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    return Rows(np.diff(time_s, prepend=time_s[:1]), readings, positions, always, always, never, np.zeros(n))
