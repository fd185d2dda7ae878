"""Are the models of a fleet still true? Each is applied to the recordings that came after it was made."""

import json
import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator
from scipy.optimize import brentq
from scipy.stats import norm, t

from selector.atomic_file import write_whole
from selector.controllers.application import Accuracy
from selector.controllers.model_file import read_model
from selector.errors import ResultError
from selector.fleet.fleet_file import Fleet
from selector.fleet.machine_study import DONE_FILE, Answer, Document, error_text, known_answer
from selector.fleet.places import local_recordings
from selector.fleet.refitting import by_age, faults_beside, older_unseen, part_of, runs_by_age
from selector.fleet.running import MISSING, has_model, read_answer
from selector.fleet.workers import Workers
from selector.json_text import json_text
from selector.readers import read
from selector.readers.files import recording_files
from selector.study.applied import applied
from selector.study.asked import overrides_of
from selector.study.inputs import sha256_of
from selector.study.study_file import Study
from selector.types import Array

WATCH_FILE = "watch.json"  #: In the results folder: what the last watch found.
#: Of a machine, in the mean, as long as nothing changes: eight years with a recording a day.
RUNS_BETWEEN_ALARMS = 3000.0
FEWEST_KNOWN = 3  #: Fewer errors on unseen runs than these tell nothing of their spread.
SLACK = 0.5  #: Half of the change that is found soonest, in standard deviations from run to run.
#: One run alone is never an alarm, however wild it is: a chip under the probe is no change of the machine.
LARGEST_DEVIATE = 4.0
#: Two runs in a row beyond this deviate tell of a machine that has changed: they are no measure of each other.
WILD = 3.5
#: Among so many runs, the rank of a value counts as much as Student's t: fewer have no tails to rank in.
RANKED_FROM_RUNS = 30.0
#: So many runs of which each is like the one before are believed at first: what later ones show comes beside them.
ALIKE_AT_FIRST = 10.0
UNLIKE = 3.0  #: Two runs in a row beyond this deviate are a change, not likeness: the second counts in full, too.
LARGEST_CORRELATION = 0.95
_UNPROVED = f"the model was proved on fewer than {FEWEST_KNOWN} runs: what its errors usually are is not known"
_UNRECORDED = "no displacement in the new recordings that could be compared: record it in some runs"


@dataclass(frozen=True)
class Chart:
    """What a self-starting CUSUM chart of the errors of one run after the other says of the runs that came later.

    The few runs that a model was proved on say how large its errors are, but not well. So every later run is judged by
    all that came before it, as a standard normal deviate, and a cumulative sum of these deviates finds a small change
    that stays (Hawkins 1987; Siegmund 1985 for the mean number of runs between false alarms). Runs that are like the
    one before them, as in a warm week, count with what is new in them.
    """

    highest: float  #: Cumulative sum at its highest, in standard deviations; of either sign on a two-sided chart
    limit: float  #: Beyond it there is an alarm
    alarm_at: int | None  #: Which new run raised the alarm
    changed_at: int | None  #: From which new run on the values are others, as far as the sum tells
    alike: float = 0.0  #: Correlation of a run with the one before it that was allowed for, if enough runs tell it


def alarm_limit(runs_between_alarms: float) -> float:
    """Limit of a one-sided sum with SLACK so that false alarms are so many runs apart in the mean (Siegmund 1985)."""

    def excess(limit: float) -> float:
        reach = 2.0 * SLACK * (limit + 1.166)
        return float((np.exp(reach) - reach - 1.0) / (2.0 * SLACK**2)) - runs_between_alarms

    return float(brentq(excess, 0.0, 60.0)) if excess(0.0) < 0.0 else 0.0


def deviates(values: Array) -> Array:
    """Each value from the third on among all before it, as a standard normal deviate; shape (n - 2,).

    Two deviates are weighed: Student's t of the value, which needs few runs but normal ones, and its rank, which holds
    for any distribution (McDonald 1990) but cannot say how far beyond all others it is. A value that equals others that
    are all alike is 0. Wild values that follow one another are judged by what was before the first of them.
    """
    values = values - values[0]
    wildest = np.asarray(-t.ppf(norm.cdf(-WILD), np.arange(1, len(values))))
    # of the first value, the first two, …: their mean, and the squares about it
    means = np.cumsum(values) / np.arange(1, len(values) + 1)
    squares = np.r_[0.0, np.cumsum((values[1:] - means[:-1]) * (values[1:] - means[1:]))].tolist()
    ratio, before, wild = np.zeros(len(values) - 2), np.arange(2, len(values)), 0
    for i, value in enumerate(values[2:].tolist()):
        for n in dict.fromkeys((i + 2 - wild, i + 2)):
            step, spread = value - float(means[n - 1]), math.sqrt(squares[n - 1] / (n - 1) * (1.0 + 1.0 / n))
            before[i], ratio[i] = n, step / spread if spread > 0.0 else math.copysign(math.inf, step) if step else 0.0
            wild = i + 3 - n if abs(ratio[i]) > wildest[n - 2] else 0
            if wild:
                break
    # the smaller tail keeps its digits
    by_size = -np.sign(ratio) * norm.ppf(t.cdf(-np.abs(ratio), before - 1))
    # those before it that are smaller, and half of those that are equal
    below = (np.arange(len(values)) < before[:, None]) * 0.5 * (np.sign(values[2:, None] - values) + 1.0)
    by_rank = norm.ppf((below.sum(axis=1) + 0.5) / (before + 1.0))
    weight = 1.0 / (1.0 + (before / RANKED_FROM_RUNS) ** 2)
    return np.asarray(weight * np.clip(by_size, -LARGEST_DEVIATE, LARGEST_DEVIATE) + (1.0 - weight) * by_rank)


def charted(known: Array, new: Array, runs_between_alarms: float, *, is_two_sided: bool) -> Chart:
    """The chart of new values, oldest first, after those that are known, two at least.

    An upward sum, and on a two-sided chart a downward one, too, each with the limit of `runs_between_alarms`.
    """
    deviate, limit = deviates(np.concatenate([known, new])), alarm_limit(runs_between_alarms)
    signs = (1.0, -1.0) if is_two_sided else (1.0,)
    alike = _correlations(deviate, is_two_sided=is_two_sided)
    charts = [_one_sided(sign * deviate, alike, len(new), limit) for sign in signs]
    return min(charts, key=lambda one: (len(new) if one.alarm_at is None else one.alarm_at, -one.highest))


def _one_sided(deviate: Array, alike: Array, n_new: int, limit: float) -> Chart:
    """The sum over the last `n_new` deviates."""
    n_known = len(deviate) - n_new
    total, start, highest, share = 0.0, 0, 0.0, 0.0
    for i in range(n_new):
        at = n_known + i
        if total == 0.0:
            # a change that stays looks like correlation: while it is suspected, nothing is learnt from it
            start, share = i, float(alike[at])
        now, before = float(deviate[at]), float(deviate[at - 1]) if at else 0.0
        value = now if min(now, before) > UNLIKE else (now - share * before) / math.sqrt(1.0 - share * share)
        total = max(0.0, total + min(value, LARGEST_DEVIATE) - SLACK)
        highest = max(highest, total)
        if total > limit:
            return Chart(highest, limit, i, start, share * (n_known + start > RANKED_FROM_RUNS))
    return Chart(highest, limit, None, None, share * (n_known + start > RANKED_FROM_RUNS))


def _correlations(deviate: Array, *, is_two_sided: bool) -> Array:
    """Correlation of one run with the next, unless the runs before each speak against it; 0 or more, shape (n,).

    Sizes are not alike to both sides: where a mean comes and goes slowly, a large error is followed by a large one, and
    a small one says little. An upward sum alone takes what runs after high ones show, if that is more.
    """

    def after(first: Array) -> Array:
        both = np.r_[0.0, 0.0, np.cumsum(deviate[1:] * first[:-1])][: len(deviate)]
        square = first * first
        return np.asarray((both + ALIKE_AT_FIRST) / (np.cumsum(square) - square + ALIKE_AT_FIRST))

    found = after(deviate) if is_two_sided else np.maximum(after(deviate), after(np.maximum(deviate, 0.0)))
    return np.clip(found, 0.0, LARGEST_CORRELATION)


class Watched(Document):
    """One response of a machine in the runs that came after its model."""

    runs: int  #: That have the displacement and a prediction
    rmse_um: float | None  #: In these runs
    expected_um: float | None  #: On unseen runs, when the model was made
    alarm: Literal["mean", "spread"] | None = None  #: Whether the mean error of a run, or its size, has changed
    since: str | None = None  #: The run from which on it is so, as far as the errors tell
    mean_um: float | None = None  #: Mean error since then, else of all these runs; recorded minus predicted
    highest: float | None = None  #: The cumulative sum at its highest [standard deviations]; None: too few runs
    limit: float | None = None  #: Beyond which there is an alarm
    alike: float = 0.0  #: Correlation of a run with the one before it; 0 where too few runs tell it


#: suspect: no alarm, but an error among the findings, or recordings that look as if a clock were wrong
_Status = Literal["quiet", "suspect", "alarm", "nothing-new", "not-judged", "no-model", "failed"]


class WatchedMachine(Document):
    """One machine."""

    status: _Status
    error: str | None = None  #: Why it failed, could not be judged, or is suspect where no finding says why
    key: str | None = None  #: Of the answer whose model is watched
    runs: tuple[str, ...] = ()  #: New ones, oldest first
    responses: dict[str, Watched] = Field(default_factory=dict)
    findings: tuple[dict[str, Any], ...] = ()  #: Sensors that look broken, readings beyond the valid range …

    @field_validator("findings")
    @classmethod
    def _are_findings(cls, given: tuple[dict[str, Any], ...]) -> tuple[dict[str, Any], ...]:
        if not all(isinstance(one.get(key), str) for one in given for key in ("level", "statement")):
            raise ValueError("findings without level and statement")
        return given

    @property
    def in_short(self) -> str:
        """For a line of progress."""
        return f"{self.status}: {self.error or f'{len(self.runs)} new runs'}"


class FleetWatch(Document):
    """What `selector fleet watch --json` prints."""

    schema_: Annotated[Literal["selector.fleet-watch/1"], Field(alias="schema")] = "selector.fleet-watch/1"
    alarms: int
    machines: dict[str, WatchedMachine]


@dataclass(frozen=True)
class _Watching:
    """What is asked of one machine."""

    name: str
    study: Study
    answer: Answer | None
    results: Path

    def answered(self) -> WatchedMachine:
        """What is wrong with one machine must not stop the others."""
        if self.answer is None or not has_model(self.answer, self.results):
            return WatchedMachine(status="no-model", error=None if self.answer is None else self.answer.error)
        try:
            return _watched(self.study, self.answer, self.results / str(self.answer.key))
        except Exception as error:
            return WatchedMachine(status="failed", error=error_text(error), key=self.answer.key)


def watch_fleet(
    fleet: Fleet, tell: Callable[[str, WatchedMachine, int, int], None] | None = None, workers: Workers | None = None
) -> FleetWatch:
    """Every machine's model on the recordings that it was not made of; kept in the results folder.

    Raises ResultError: the fleet was never run.
    """
    answers = read_answer(fleet.results).machines
    gone = {name: one for name, one in answers.items() if name not in fleet.studies and one.key is not None}
    found = {name: WatchedMachine(status="failed", error=MISSING, key=one.key) for name, one in gone.items()}
    asked = [_Watching(name, study, answers.get(name), fleet.results) for name, study in fleet.studies.items()]
    each = ((one.name, one.answered()) for one in asked) if workers is None else _by(workers, asked)
    for done, (name, one) in enumerate(each, start=1):
        found[name] = one
        if tell is not None:
            tell(name, one, done, len(fleet.studies))
    machines = {name: found[name] for name in (*gone, *fleet.studies)}
    watch = FleetWatch(alarms=sum(one.status == "alarm" for one in machines.values()), machines=machines)
    write_whole(fleet.results / WATCH_FILE, (json_text(watch.model_dump(by_alias=True)) + "\n").encode("utf-8"))
    return watch


def _by(workers: Workers, asked: Sequence[_Watching]) -> Iterator[tuple[str, WatchedMachine]]:
    """All machines, in the order in which they are done."""
    waiting, n_begun = deque(asked), 0
    try:
        while waiting or n_begun:
            while waiting and workers.free > 0:
                workers.start(waiting.popleft())
                n_begun += 1
            for name, one in workers.finished(1.0):
                n_begun -= 1
                ended = one.error if isinstance(one, Answer) else "its process was ended from outside"
                yield name, one if isinstance(one, WatchedMachine) else WatchedMachine(status="failed", error=ended)
    finally:
        workers.close()


def _watched(study: Study, answer: Answer, place: Path) -> WatchedMachine:
    model = read_model(place / "model.json")
    if known_answer(place) is None:
        raise ResultError(
            "files that are missing or were changed since the study",
            expected=f"selection.json, model.json and {DONE_FILE} as the study wrote them",
            where=str(place),
            advice="bring them back; `selector fleet run` studies the machine anew",
        )
    # what it was chosen on is flattering; where it stayed in use it was only compared
    seen = {*model.provenance.data_sha256.values(), *(one for one, key in answer.judged.items() if key == answer.key)}
    with local_recordings(study.recordings) as (runs_at, machine):
        files = recording_files(list(runs_at))
        if all(sha256_of(file) in seen for file in files.files):
            return WatchedMachine(status="nothing-new", key=answer.key)
        whole = read(files.files, machine=machine or files.machine, overrides=overrides_of(study))
        earlier, later = by_age(whole, seen)
        error = older_unseen(earlier, seen | answer.judged.keys()) or None
        if not later:
            return WatchedMachine(status="suspect" if error else "nothing-new", error=error, key=answer.key)
        application, compared = applied(model, part_of(whole, later.values()))
        few = list(later.values())[-max(1, len(earlier) // 2) :]
        channels = [one.name for one in model.inputs] + [one.name for one in model.outputs]
        told = {(one.id, one.where.channel, one.where.run) for one in application.findings if one.level == "error"}
        beside = faults_beside(whole, list(earlier.values()), few, channels)
        faults = [one for one in beside if (one.id, one.where.channel, one.where.run) not in told]
    runs = runs_by_age(compared)
    chosen = json.loads((place / "selection.json").read_bytes())
    # stretches of one run say nothing of another
    less: dict[str, Any] = {"per_run": {}} if chosen["proof"]["left_out"] == "block" else {}
    responses = {}
    for output in model.outputs:
        accuracies = [(run, application.per_run[run][output.name]) for run in runs]
        responses[output.name] = _response(chosen["models"].get(output.name, {}) | less, accuracies, len(model.outputs))
    findings = [one for one in (*application.findings, *faults) if one.level != "info"]
    status: _Status = "quiet"
    if any(one.alarm for one in responses.values()):
        status = "alarm"
    elif error or any(one.level == "error" for one in findings):
        status = "suspect"
    elif all(one.highest is None for one in responses.values()):
        status, error = "not-judged", _UNPROVED if any(one.runs for one in responses.values()) else _UNRECORDED
    return WatchedMachine(
        status=status,
        error=error,
        key=answer.key,
        runs=tuple(runs),
        responses=responses,
        findings=tuple(one.as_dict() for one in findings),
    )


def _response(proved: Mapping[str, Any], runs: Sequence[tuple[str, Accuracy]], n_responses: int) -> Watched:
    seen = [(run, one) for run, one in runs if one.rmse_um is not None and one.mean_um is not None]
    of_proof = [
        one
        for one in proved.get("per_run", {}).values()
        if one.get("heldout_rmse_um") and one.get("heldout_mean_um") is not None
    ]
    weights = [one.n_samples for _, one in seen]
    sizes, means = np.array([one.rmse_um for _, one in seen]), [one.mean_um or 0.0 for _, one in seen]
    plain = Watched(
        runs=len(seen),
        rmse_um=math.sqrt(np.average(sizes**2, weights=weights)) if seen else None,
        expected_um=proved.get("heldout_rmse_um"),
        mean_um=float(np.average(means, weights=weights)) if seen else None,
    )
    if len(of_proof) < FEWEST_KNOWN or not seen:
        return plain
    # three sums for every response: mean up, mean down, size up
    apart = 3.0 * n_responses * RUNS_BETWEEN_ALARMS
    mean = charted(np.array([one["heldout_mean_um"] for one in of_proof]), np.array(means), apart, is_two_sided=True)
    size = charted(
        np.log([one["heldout_rmse_um"] for one in of_proof]),
        np.log(np.maximum(sizes, np.finfo(float).tiny)),
        apart,
        is_two_sided=False,
    )
    return plain.model_copy(update=_told(mean, size, [run for run, _ in seen], means, weights))


def _told(
    mean: Chart, size: Chart, runs: Sequence[str], means: Sequence[float], weights: Sequence[int]
) -> dict[str, Any]:
    """The chart that tells: a shift makes errors larger, too, so that of the mean goes first."""
    goes_first = mean.alarm_at is not None or (size.alarm_at is None and mean.highest >= size.highest)
    first, kind = (mean, "mean") if goes_first else (size, "spread")
    told: dict[str, Any] = {"highest": first.highest, "limit": first.limit, "alike": max(mean.alike, size.alike)}
    if first.changed_at is not None:
        at = first.changed_at
        told |= {"alarm": kind, "since": runs[at], "mean_um": float(np.average(means[at:], weights=weights[at:]))}
    return told
