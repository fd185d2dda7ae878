"""A fleet is done: which study when, what is tried again, and what is kept of it."""

import json
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from operator import not_
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import Field, ValidationError

from selector.atomic_file import write_whole
from selector.errors import OptionError, ResultError, StorageError, StudyError
from selector.fleet.fleet_file import Fleet
from selector.fleet.machine_study import OVERDUE, Answer, Document, Refit, Task, error_text, known_answer
from selector.fleet.refitting import Challenge, challenge_of, settled, without_use
from selector.fleet.workers import Workers
from selector.json_text import json_text
from selector.study.study_file import Study

RESULT_FILE = "fleet.json"
TRIES = 2
GRACE_S = 10.0  #: A study gives itself up at its limit, between two steps; so much later its worker is ended.
_LOOK_S = 0.25
_WRITE_S = 5.0
_LESS = "raise it, offer fewer sensors and terms, or store the recordings as Parquet"
MISSING = "nothing that the fleet file names is this machine any more: look for its folder; its model stays in use"
Kind = TypeVar("Kind")

#: Called after every study: machine, answer, studies that have ended, all studies.
Told = Callable[[str, Answer, int, int], None]


class Shared(Document):
    """Recordings that are the same, byte for byte, at several machines."""

    machines: tuple[str, ...]
    runs: tuple[str, ...]  #: As the first of these machines calls them


class FleetAnswer(Document):
    """What came of a fleet, as `selector fleet run --json` prints it."""

    schema_: Annotated[Literal["selector.fleet/1"], Field(alias="schema")] = "selector.fleet/1"
    done: int
    reused: int
    failed: int
    missing: int = Field(default=0, exclude_if=not_)  #: Were not found, and keep their model; 0 is not in the document
    machines: dict[str, Answer]
    shared: tuple[Shared, ...] = Field(default=(), exclude_if=not_)  #: None is not in the document

    @property
    def copies(self) -> frozenset[str]:
        """Machines whose answer was used again because another machine got the same one in this run."""
        done = {one.key for one in self.machines.values() if one.status == "done"}
        return frozenset(name for name, one in self.machines.items() if one.status == "reused" and one.key in done)

    @classmethod
    def of(cls, answers: dict[str, Answer], shared: tuple[Shared, ...] = ()) -> "FleetAnswer":
        """The answers, counted."""
        counts = {"done": 0, "reused": 0, "failed": 0} | Counter(one.status for one in answers.values())
        return cls.model_validate(counts | {"machines": answers, "shared": shared})


def run_fleet(fleet: Fleet, workers: Workers, tell: Told | None = None, *, refit: bool = False) -> FleetAnswer:
    """The answers of all machines, in the order of the fleet file; those of each are kept as soon as they are there.

    What ends it early (Ctrl-C, a cluster that is gone) leaves all answers so far in the results folder. With `refit` a
    machine that has a model keeps it, unless one that learnt from later recordings is better; see `challenge_of`.

    Raises ResultError: with `refit`, the fleet was never run. Raises StudyError: no study can keep the limit of memory,
    or the results folder is that of another fleet.
    """
    in_use = _in_use(fleet, refit)
    if fleet.memory_limit_gb is not None and fleet.memory_limit_gb < (least_gb := workers.least_gb()):
        workers.close()
        raise StudyError(
            f"{fleet.memory_limit_gb:g} GB",
            expected=f"more than {least_gb:.3f} GB, which the program holds here with next to no recordings",
            where=f"{fleet.place}, key memory_limit_gb",
            advice="raise it, or leave the key out",
        )
    earlier = in_use.items() if refit else ()
    found = {name: one if name in fleet.studies else without_use(one, MISSING, "missing") for name, one in earlier}
    written = time.monotonic()
    try:
        for done, (name, answer) in enumerate(_answers(fleet, workers, in_use, refit=refit), start=1):
            found[name] = answer
            if tell is not None:
                tell(name, answer, done, len(fleet.studies))
            if time.monotonic() - written > _WRITE_S:
                _write(fleet, found)
                written = time.monotonic()
    finally:
        workers.close()
        whole = _write(fleet, found, shared_recordings(fleet.results, found))
    return whole


def read_answer(results: Path) -> FleetAnswer:
    """What the last run left in a results folder. Raises ResultError: there is nothing, or something else."""
    place = results / RESULT_FILE
    try:
        return FleetAnswer.model_validate_json(place.read_bytes())
    except (OSError, ValidationError) as error:
        raise ResultError(
            "no file" if isinstance(error, FileNotFoundError) else f"something else ({str(error).splitlines()[0]})",
            expected="what `selector fleet run` writes",
            where=str(place),
            advice="run the fleet first",
        ) from error


def _in_use(fleet: Fleet, refit: bool) -> dict[str, Answer]:
    """Machines that have a model. Raises StudyError: the results folder is that of another fleet."""
    try:
        machines = read_answer(fleet.results).machines
    except ResultError:
        if refit:
            raise
        return {}
    in_use = {name: one for name, one in machines.items() if has_model(one, fleet.results)}
    if in_use and not in_use.keys() & fleet.studies.keys():
        raise StudyError(
            f"answers of other machines: {', '.join(in_use)}"[:300],
            expected=f"answers of this fleet ({', '.join(fleet.studies)}"[:300] + "), or none",
            where=str(fleet.results),
            advice="name another folder under `results`; if machines were renamed, move fleet.json away: answers stay",
        )
    return in_use


def has_model(answer: Answer, results: Path) -> bool:
    """Whether it has a model, which may be one of an earlier run, or one that has been lost since."""
    return answer.key is not None and (answer.status != "failed" or (results / answer.key / "model.json").is_file())


def _answers(
    fleet: Fleet, workers: Workers, in_use: Mapping[str, Answer], *, refit: bool
) -> Iterator[tuple[str, Answer]]:
    challenges: dict[str, Challenge] = {}
    anew: dict[str, str] = {}
    studies = dict(fleet.studies)
    for name in (name for name in fleet.studies if refit and name in in_use):
        asked = _guarded(in_use[name], partial(challenge_of, studies[name], in_use[name], fleet.results))
        if isinstance(asked, str):
            anew[name] = asked
        elif isinstance(asked, Answer):
            del studies[name]
            yield name, _whole(asked, fleet.results)
        else:
            challenges[name], studies[name] = asked, asked.study
    for name, answer in _studied(fleet, studies, workers):
        if name in challenges:
            settle = partial(settled, challenges[name], answer, fleet.results)
            yield name, _whole(_guarded(in_use[name], settle), fleet.results)
        elif answer.status == "failed" and name in in_use:
            yield name, without_use(in_use[name], f"{answer.error}; its model of an earlier run stays in use")
        elif name in anew:
            told = Refit(promoted=False, because=f"without a comparison, {anew[name]}", challenger=answer.key)
            yield name, answer.model_copy(update={"refit": told})
        else:
            yield name, answer


def _guarded(champion: Answer, doing: Callable[[], Kind]) -> Kind | Answer:
    """What one machine brings about must not stop the others."""
    try:
        return doing()
    except StorageError:
        raise  # it stops the others, too
    except Exception as error:
        return without_use(champion, error_text(error))


def _whole(answer: Answer, results: Path) -> Answer:
    """The answer, which says where something else than the model was changed in its folder."""
    if answer.refit is None or known_answer(results / str(answer.key)) is not None:
        return answer
    told = f"{answer.refit.because}; beside its model, files in the folder of its answer are missing or were changed"
    return answer.model_copy(update={"refit": answer.refit.model_copy(update={"because": told})})


def _studied(fleet: Fleet, studies: Mapping[str, Study], workers: Workers) -> Iterator[tuple[str, Answer]]:
    waiting = deque(Task(name, study, fleet.results, fleet.time_limit_s) for name, study in studies.items())
    tries: dict[str, int] = {}
    begun: dict[str, tuple[Task, float]] = {}
    while waiting or begun:
        while waiting and workers.free > 0:
            task = waiting.popleft()
            tries[task.name] = tries.get(task.name, 0) + 1
            begun[task.name] = task, time.monotonic()
            workers.start(task)
        for name, answer in workers.finished(_LOOK_S):
            task, start = begun.pop(name)
            if answer is not None and answer.is_unkept:
                raise _unkept(fleet, f"the answer of {name} cannot be kept: {answer.error}")
            if answer is not None:
                yield name, answer
            elif tries[name] < TRIES:
                waiting.append(task)
            else:
                told = f"its process was ended {TRIES} times from outside, most often because memory ran out"
                yield name, _failed(told, start)
        for name, (_, start) in list(begun.items()):
            why = OVERDUE.format(fleet.time_limit_s) if time.monotonic() - start > fleet.time_limit_s + GRACE_S else ""
            if not why and fleet.memory_limit_gb is not None:
                taken_gb, most_gb = workers.taken_gb(name), fleet.memory_limit_gb
                why = f"it took {taken_gb:.3g} GB, and memory_limit_gb is {most_gb:g}: {_LESS}" * (taken_gb > most_gb)
            if why:
                workers.stop(name)
                del begun[name]
                yield name, _failed(why, start)


def _failed(why: str, start: float) -> Answer:
    return Answer(status="failed", error=why, seconds=round(time.monotonic() - start, 3))


def shared_recordings(results: Path, answers: Mapping[str, Answer]) -> tuple[Shared, ...]:
    """Recordings that the models of several machines were made of; a model that cannot be read has none."""
    runs: dict[str, dict[str, str]] = {}
    for name, answer in answers.items():
        try:
            model = json.loads((results / str(answer.key) / "model.json").read_bytes())
            for run, sha256 in model["provenance"]["data_sha256"].items():
                runs.setdefault(sha256, {}).setdefault(name, run)
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            continue
    found: dict[tuple[str, ...], list[str]] = {}
    for of in runs.values():
        if len(of) > 1:
            found.setdefault(tuple(of), []).append(next(iter(of.values())))
    return tuple(Shared(machines=machines, runs=tuple(of)) for machines, of in found.items())


def _write(fleet: Fleet, found: dict[str, Answer], shared: tuple[Shared, ...] = ()) -> FleetAnswer:
    _in_use(fleet, refit=False)  # another fleet may have begun here at the same time
    order = dict.fromkeys((*fleet.studies, *found))
    answer = FleetAnswer.of({name: found[name] for name in order if name in found}, shared)
    try:
        write_whole(fleet.results / RESULT_FILE, (json_text(answer.model_dump(by_alias=True)) + "\n").encode("utf-8"))
    except (OptionError, StorageError) as error:
        raise _unkept(fleet, f"{RESULT_FILE}: {error.found}") from error
    return answer


def _unkept(fleet: Fleet, found: str) -> OptionError:
    """Ends the fleet: where one answer cannot be kept for want of room or rights, others cannot either."""
    return OptionError(
        found,
        expected="room, and the rights, for the answers",
        where=str(fleet.results),
        advice="free some space, or reach the server again, and give the same command: it goes on from what is done",
    )
