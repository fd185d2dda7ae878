"""Is a new model better than the one in use? It learns from later recordings; both are tried on still later ones."""

import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy import stats

from selector.controllers.model_file import read_model
from selector.errors import InputError, StorageError
from selector.findings import Finding
from selector.fleet.machine_study import Answer, Refit, done_of, question_of
from selector.fleet.places import local_recordings, reference_of
from selector.quality import inspect
from selector.readers import Reading, read
from selector.readers.files import recording_files
from selector.recording import Recording
from selector.study.applied import applied
from selector.study.asked import overrides_of
from selector.study.inputs import sha256_of
from selector.study.study_file import Recordings, Study
from selector.types import Vector

Files = Sequence[Path]  #: Of recordings


def by_age(reading: Reading, seen: Collection[str]) -> tuple[dict[str, Path], dict[str, Path]]:
    """Distinct recordings, as SHA-256 → file, oldest first: up to the newest of those seen (SHA-256), and after it."""
    of = {run.name: run for run in reading.runs}
    files: dict[str, Path] = {}
    for name in runs_by_age(reading.recording):
        files.setdefault(of[name].sha256, Path(of[name].file))
    first = 1 + max((number for number, sha256 in enumerate(files) if sha256 in seen), default=-1)
    pairs = list(files.items())
    return dict(pairs[:first]), dict(pairs[first:])


def older_unseen(earlier: Mapping[str, Path], known: Collection[str]) -> str:
    """What is told of recordings that are not new because one that was seen is newer, as by a clock in the future.

    `known` (SHA-256) are those that a model learnt from, and all that were there when it was compared with another.
    """
    older = [path.name for sha256, path in earlier.items() if sha256 not in known]
    if not older:
        return ""
    told = (
        f"{len(older)} that were never used are older than {list(earlier.values())[-1].name}, by clock or else by name"
    )
    return f"{told}, such as {older[-1]}: is one of them wrong?"


def runs_by_age(recording: Recording) -> list[str]:
    """Runs as they were recorded, by their clock where each has one; else as they are named."""
    known = recording.provenance.get("runs", {})
    starts = {name: known.get(name, {}).get("start") for name in recording.runs}
    return list(starts) if None in starts.values() else sorted(starts, key=lambda name: str(starts[name]))


def part_of(reading: Reading, files: Collection[Path]) -> Reading:
    """The runs of some of the files, under the names that they have beside all others."""
    runs = tuple(run for run in reading.runs if Path(run.file) in files)
    names = {run.name for run in runs}
    frame = reading.recording.frame
    recording = reading.recording.with_values(frame[frame.index.get_level_values("run").isin(names)])
    return replace(reading, recording=recording, runs=runs, findings=tuple(_told_of(reading.findings, names)))


def faults_beside(whole: Reading, known: Files, later: Files, channels: Collection[str]) -> Iterator[Finding]:
    """Findings of level error about some channels in later recordings, judged beside those known before.

    What most runs have is taken for usual: of later ones alone, or many beside few, what all of them have is not seen.
    """
    part = part_of(whole, [*known, *later])
    found = inspect(part.recording, [name for name in channels if name in part.recording.names])
    runs = {run.name for run in part.runs if Path(run.file) in later}
    yield from _told_of([one for one in found if one.level == "error"], runs)


def _told_of(findings: Collection[Finding], runs: Collection[str]) -> Iterator[Finding]:
    for one in findings:
        named = [one.where.run] if one.where.run is not None else one.evidence.get("runs")
        if not isinstance(named, list) or any(name in runs for name in named):
            yield one


FEWEST_JUDGED = 4  #: Later runs on which two models are compared, at least.
_LEAST_UM2 = 1e-12  #: Two models without an error are equal.
CONFIDENCE = 0.95  #: Of the one-sided interval beyond which the challenger has to be better.


@dataclass(frozen=True)
class Challenge:
    """What a new model may learn from, and the runs on which it is compared with the one in use."""

    champion: Answer
    study: Study  #: Of the challenger
    recordings: Recordings  #: All of them
    judged: frozenset[str]  #: SHA-256 of the newest, which neither model has seen
    known: frozenset[str]  #: Of those of which the model in use was made
    left_over: frozenset[str]  #: Of those that came after it, and are not for the comparison


def challenge_of(study: Study, champion: Answer, results: Path) -> Challenge | Answer | str:
    """The challenge of the model in use, or its answer again with the reason why there is none.

    A text says why the machine is studied anew without a comparison. Recordings came after the model when they are
    later than all that it was learnt from or judged on. The newest half of them, four at least, are for the comparison.
    The challenger learns from those before, as many as the model in use had.
    """
    try:
        model = read_model(results / str(champion.key) / "model.json")
    except StorageError:
        raise
    except InputError as error:
        return f"the model in use cannot be read: {error}"
    done = done_of(results / str(champion.key))
    if done is not None and done.question is not None:
        is_other = done.question != question_of(study)
    else:  # of an answer that does not say its question, the responses at least
        responses = () if study.select is None else study.select.responses
        is_other = bool(responses) and {output.name for output in model.outputs} != set(responses)
    if is_other:
        return "what is asked (responses or options) is not what was asked for the model in use"
    learnt = set(model.provenance.data_sha256.values())
    try:
        return _challenge(study, champion, learnt)
    except InputError as error:
        return kept(champion, f"what was recorded since cannot be used: {error}")


def _challenge(study: Study, champion: Answer, learnt: Set[str]) -> Challenge | Answer:
    seen, earlier, later = learnt | set(champion.judged), dict[str, Path](), dict[str, Path]()
    with local_recordings(study.recordings) as (named, machine):
        files = recording_files(list(named))
        machine = machine or files.machine
        if any(sha256_of(file) not in seen for file in files.files):
            reading = read(files.files, machine=machine, overrides=overrides_of(study))
            earlier, later = by_age(reading, seen)
    if len(later) <= FEWEST_JUDGED:
        came = f"{len(later)} recording{'s' * (len(later) != 1)} came after it"
        last = " was last compared" if champion.judged else ""
        older = older_unseen(earlier, seen)
        return kept(champion, f"{came}{last}, and {FEWEST_JUDGED + 1} are needed{'; ' * bool(older)}{older}")
    hashes = list(later)[-max(FEWEST_JUDGED, math.ceil(len(later) / 2)) :]
    before = [sha256 for sha256 in earlier | later if sha256 not in hashes][-len(learnt) :]
    # of some runs another logger wrote a file, too
    files_of = {run.sha256: [run.file, *(one.file for one in run.beside)] for run in reversed(reading.runs)}
    everything = Recordings(
        runs=tuple(reference_of(file, named) for file in files.files),
        machine=study.recordings.machine or (None if machine is None else reference_of(machine, named)),
    )
    some = tuple(reference_of(Path(file), named) for sha256 in before for file in files_of[sha256])
    asked = study.model_copy(update={"recordings": everything.model_copy(update={"runs": some})})
    judged, known = frozenset(hashes), frozenset(learnt & earlier.keys())
    return Challenge(champion, asked, everything, judged, known, frozenset(later) - judged)


def settled(challenge: Challenge, challenger: Answer, results: Path) -> Answer:
    """Which of the two models is in use from now on, and why."""
    champion = challenge.champion
    if challenger.status == "failed":
        return kept(champion, f"the new study failed: {challenger.error}")
    told = json.loads((results / str(challenger.key) / "selection.json").read_bytes())["findings"]
    wrong = [one["statement"] for one in told if one["level"] == "error"]
    if wrong:
        return kept(champion, f"the new study has an error: {wrong[0]}", challenger.key)
    try:
        with local_recordings(challenge.recordings) as (runs, machine):
            whole = read(list(runs), machine=machine, overrides=overrides_of(challenge.study))
        _, files = by_age(whole, ())
        reading = part_of(whole, [files[sha256] for sha256 in files if sha256 in challenge.judged])
    except InputError as error:
        return kept(champion, f"the two models could not be compared: {error}")
    try:
        before, _ = _applied(results / str(champion.key), reading)
    except InputError as error:
        return without_use(
            champion,
            f"the model in use cannot be applied to the newest recordings: {error}; where a sensor was taken away, "
            "put it back, or name it in select.never of this machine, which is then studied anew",
        )
    try:
        after, wrong = _applied(results / str(challenger.key), reading)
    except InputError as error:
        return kept(champion, f"the new model could not be applied to the newest recordings: {error}", challenger.key)
    known, judged = ([files[one] for one in files if one in of] for of in (challenge.known, challenge.judged))
    # the newest are judged beside all, and as a few beside those known before
    some = (judged, judged[-max(1, len(known) // 2) :])
    faults = [one.statement for newest in some for one in faults_beside(whole, known, newest, before)]
    if faults or wrong:
        what = "the displacement" if faults else "the new model"
        return kept(champion, f"in the newest recordings {what} has an error: {[*faults, *wrong][0]}", challenger.key)
    return _compared(challenge, challenger, before, after)


#: Response → run → mean square error [µm²].
_Squares = Mapping[str, Mapping[str, float]]


def _compared(challenge: Challenge, challenger: Answer, before: _Squares, after: _Squares) -> Answer:
    champion = challenge.champion
    lacking = [name for name in before if name not in after]
    if lacking:
        return kept(champion, f"the new model does not predict {', '.join(lacking)}", challenger.key)
    runs = [
        run for run in next(iter(before.values())) if all(run in of[name] for of in (before, after) for name in before)
    ]
    if len(runs) < FEWEST_JUDGED:
        return kept(champion, f"{len(runs)} of the newest runs have the displacement, and {FEWEST_JUDGED} are needed")
    old, new = (np.array([[of[name][run] for run in runs] for name in before]) for of in (before, after))
    worse = [name for name, was, now in zip(before, old, new, strict=True) if least_fall(now, was) > 0.0]
    least = least_fall(old.sum(axis=0), new.sum(axis=0))
    promoted = least > 0.0 and not worse and bool(new.sum() < old.sum())
    how = f"worse in {', '.join(worse)}" if worse else "better" if promoted else "not better beyond chance"
    refit = Refit(
        promoted=promoted,
        because=f"the new model is {how} in {len(runs)} runs that neither has seen",
        challenger=challenger.key,
        runs=tuple(runs),
        champion_rmse_um=dict(zip(before, np.sqrt(old.mean(axis=1)).tolist(), strict=True)),
        challenger_rmse_um=dict(zip(before, np.sqrt(new.mean(axis=1)).tolist(), strict=True)),
        least_fall=least,
    )
    # of a model that was replaced it need only be known that they were there
    earlier = dict.fromkeys((*challenge.known, *champion.judged), "") if promoted else champion.judged
    judged = dict.fromkeys(challenge.left_over, "") | earlier | dict.fromkeys(challenge.judged, str(challenger.key))
    in_use = challenger if promoted else kept(champion, "")
    return in_use.model_copy(update={"refit": refit, "judged": judged})


def least_fall(old: Vector, new: Vector) -> float:
    """Share of the error that falls away at least: the mean over all, less what so few leave open (Student's t).

    `old` and `new` are mean squares, of a run each; their ratio counts, as one wild day is many times a quiet one.
    """
    gain = 0.5 * np.log(np.maximum(old, _LEAST_UM2) / np.maximum(new, _LEAST_UM2))
    margin = stats.t.ppf(CONFIDENCE, len(gain) - 1) * gain.std(ddof=1) / math.sqrt(len(gain))
    return float(-np.expm1(margin - gain.mean()))


def _applied(place: Path, reading: Reading) -> tuple[_Squares, list[str]]:
    """What the model of an answer leaves in the runs, and what is gravely wrong with that."""
    application = applied(model := read_model(place / "model.json"), reading)[0]
    per_run = application.per_run
    told = {output.name: {run: of[output.name].rmse_um for run, of in per_run.items()} for output in model.outputs}
    squares = {name: {run: rmse**2 for run, rmse in of.items() if rmse is not None} for name, of in told.items()}
    return squares, [one.statement for one in application.findings if one.level == "error"]


def kept(champion: Answer, because: str, challenger: str | None = None) -> Answer:
    """The model in use stays, and why."""
    refit = Refit(promoted=False, because=because, challenger=challenger)
    return champion.model_copy(update={"status": "reused", "error": None, "refit": refit})


def without_use(champion: Answer, error: str, status: Literal["failed", "missing"] = "failed") -> Answer:
    """The model in use stays, but something has to be done for this machine."""
    return champion.model_copy(update={"status": status, "error": error, "refit": None})
