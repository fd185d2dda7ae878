"""Is a new model better than the one in use? It learns from later recordings; both are tried on still later ones."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import stats

from selector.controllers.model_file import ModelFile, read_model
from selector.errors import InputError
from selector.fleet.machine_study import Answer, Refit
from selector.fleet.places import is_url, local_paths
from selector.readers import Reading, read
from selector.readers.files import recording_files
from selector.study.applied import applied
from selector.study.asked import overrides_of
from selector.study.inputs import sha256_of
from selector.study.study_file import Recordings, Study
from selector.types import Vector

FEWEST_JUDGED = 4  #: Later runs on which two models are compared, at least.
_LEAST_UM2 = 1e-12  #: Two models without an error are equal.
CONFIDENCE = 0.95  #: Of the one-sided interval beyond which the challenger has to be better.


@dataclass(frozen=True)
class Challenge:
    """What a new model may learn from, and the runs on which it is compared with the one in use."""

    champion: Answer
    study: Study  #: Of the challenger
    judged: tuple[Path, ...]  #: The newest recordings, which neither model has seen


def challenge_of(study: Study, champion: Answer, results: Path) -> Challenge | Answer:
    """The challenge of the model in use, or its answer again, with the reason why there is none.

    The newest half of the recordings that came after the model, four at least, are for the comparison. The challenger
    learns from those before, as many as the model in use had.

    Raises InputError: the recordings or the model cannot be read.
    """
    references = (*study.recordings.runs, *([study.recordings.machine] if study.recordings.machine else ()))
    if any(map(is_url, references)):
        return kept(champion, "recordings behind URLs are not refitted: bring them into a folder")
    files = recording_files(local_paths(study.recordings.runs, Path()))
    machine = files.machine if study.recordings.machine is None else Path(study.recordings.machine)
    used = set(_model(results, champion).provenance.data_sha256.values())
    is_new = {file: sha256_of(file) not in used for file in files.files}
    new, old = ([file for file in files.files if is_new[file] is wanted] for wanted in (True, False))
    ordered = _oldest_first(new, machine, study) if len(new) > FEWEST_JUDGED else new
    if len(ordered) <= FEWEST_JUDGED:
        return kept(champion, f"{len(ordered)} recordings came after it, and {FEWEST_JUDGED + 1} are needed")
    n_judged = max(FEWEST_JUDGED, math.ceil(len(ordered) / 2))
    learnt = [*old, *ordered[:-n_judged]][-len(used) :]
    recordings = Recordings(runs=tuple(map(str, learnt)), machine=None if machine is None else str(machine))
    return Challenge(champion, study.model_copy(update={"recordings": recordings}), tuple(ordered[-n_judged:]))


def settled(challenge: Challenge, challenger: Answer, results: Path) -> Answer:
    """Which of the two models is in use from now on, and why."""
    champion = challenge.champion
    if challenger.status == "failed":
        return kept(champion, f"the new study failed: {challenger.error}")
    study = challenge.study
    machine = None if study.recordings.machine is None else Path(study.recordings.machine)
    try:
        reading = read(challenge.judged, machine=machine, overrides=overrides_of(study))
        before, after = (_squares_um2(_model(results, one), reading) for one in (champion, challenger))
    except InputError as error:
        return kept(champion, f"the two models could not be compared: {error}")
    return _compared(champion, challenger, before, after)


#: Response → run → mean square error [µm²].
_Squares = Mapping[str, Mapping[str, float]]


def _compared(champion: Answer, challenger: Answer, before: _Squares, after: _Squares) -> Answer:
    runs = [run for run in next(iter(before.values())) if all(run in of for of in (*before.values(), *after.values()))]
    if len(runs) < FEWEST_JUDGED:
        return kept(champion, f"{len(runs)} of the newest runs have the displacement, and {FEWEST_JUDGED} are needed")
    old, new = (np.array([[of[name][run] for run in runs] for name in before]) for of in (before, after))
    worse = [name for name, was, now in zip(before, old, new, strict=True) if _least_fall(now, was) > 0.0]
    least = _least_fall(old.sum(axis=0), new.sum(axis=0))
    promoted = least > 0.0 and not worse and bool(new.sum() < old.sum())
    how = f"worse in {', '.join(worse)}" if worse else "better" if promoted else "not better beyond chance"
    refit = Refit(
        promoted=promoted,
        because=f"the new model is {how} in {len(runs)} runs that neither has seen",
        challenger=challenger.key,
        runs=tuple(runs),
        champion_rmse_um=_rms_um(before, runs),
        challenger_rmse_um=_rms_um(after, runs),
        least_fall=least,
    )
    in_use = challenger if promoted else champion.model_copy(update={"status": "reused"})
    return in_use.model_copy(update={"refit": refit})


def _least_fall(old: Vector, new: Vector) -> float:
    """Share of the error that falls away at least: the mean over runs, less what so few leave open (Student's t).

    `old` and `new` are mean squares of the runs; their ratio counts, as one wild day is many times a quiet one.
    """
    gain = 0.5 * np.log(np.maximum(old, _LEAST_UM2) / np.maximum(new, _LEAST_UM2))
    margin = stats.t.ppf(CONFIDENCE, len(gain) - 1) * gain.std(ddof=1) / math.sqrt(len(gain))
    return float(-np.expm1(margin - gain.mean()))


def _rms_um(squares: _Squares, runs: Sequence[str]) -> dict[str, float]:
    return {name: math.sqrt(float(np.mean([of[run] for run in runs]))) for name, of in squares.items()}


def _model(results: Path, answer: Answer) -> ModelFile:
    return read_model(results / str(answer.key) / "model.json")


def _squares_um2(model: ModelFile, reading: Reading) -> _Squares:
    per_run = applied(model, reading)[0].per_run
    told = {output.name: {run: of[output.name].rmse_um for run, of in per_run.items()} for output in model.outputs}
    return {name: {run: rmse**2 for run, rmse in of.items() if rmse is not None} for name, of in told.items()}


def _oldest_first(files: Sequence[Path], machine: Path | None, study: Study) -> list[Path]:
    """Without those of which a repair or the window of the study leaves nothing."""
    reading = read(files, machine=machine, overrides=overrides_of(study))
    place = {run.name: Path(run.file) for run in reading.runs}
    return list(dict.fromkeys(place[name] for name in by_age(reading)))


def by_age(reading: Reading) -> list[str]:
    """Runs as they were recorded, by their clock where each has one; else as they are named."""
    starts = {run.name: run.start for run in reading.runs}
    names = list(reading.recording.runs)
    if any(starts.get(name) is None for name in names):
        return names
    return sorted(names, key=lambda name: str(starts[name]))


def kept(champion: Answer, because: str) -> Answer:
    """The model in use stays, and why."""
    return champion.model_copy(update={"status": "reused", "refit": Refit(promoted=False, because=because)})
