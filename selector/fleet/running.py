"""A fleet is done: which study when, what is tried again, and what is kept of it."""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from selector.atomic_file import write_whole
from selector.errors import InputError, ResultError
from selector.fleet.fleet_file import Fleet
from selector.fleet.machine_study import Answer, Task, known_answer, overdue_words
from selector.fleet.refitting import Challenge, challenge_of, kept, settled
from selector.fleet.workers import Workers
from selector.json_text import json_text
from selector.study.study_file import Study

RESULT_FILE = "fleet.json"
TRIES = 2
GRACE_S = 10.0  #: A study gives itself up at its limit, between two steps; so much later its worker is ended.
_LOOK_S = 0.25
_WRITE_S = 5.0

#: Called after every study: machine, answer, studies that have ended, all studies.
Told = Callable[[str, Answer, int, int], None]


class FleetAnswer(BaseModel):
    """What came of a fleet, as `selector fleet run --json` prints it."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    schema_: Annotated[Literal["selector.fleet/1"], Field(alias="schema")] = "selector.fleet/1"
    done: int
    reused: int
    failed: int
    machines: dict[str, Answer]

    @classmethod
    def of(cls, answers: dict[str, Answer]) -> "FleetAnswer":
        """The answers, counted."""
        counts = Counter(one.status for one in answers.values())
        return cls(done=counts["done"], reused=counts["reused"], failed=counts["failed"], machines=answers)


def run_fleet(fleet: Fleet, workers: Workers, tell: Told | None = None, *, refit: bool = False) -> FleetAnswer:
    """The answers of all machines, in the order of the fleet file; those of each are kept as soon as they are there.

    What ends it early (Ctrl-C, a cluster that is gone) leaves all answers so far in the results folder. With `refit` a
    machine that has a model keeps it, unless one that learnt from later recordings is better; see `challenge_of`.

    Raises ResultError: with `refit`, the fleet was never run.
    """
    found: dict[str, Answer] = read_answer(fleet.results).machines if refit else {}
    fleet.results.mkdir(parents=True, exist_ok=True)
    champions = {name: one for name, one in found.items() if one.status != "failed" and name in fleet.studies}
    written = time.monotonic()
    try:
        for done, (name, answer) in enumerate(_answers(fleet, workers, champions), start=1):
            found[name] = answer
            if tell is not None:
                tell(name, answer, done, len(fleet.studies))
            if time.monotonic() - written > _WRITE_S:
                _write(fleet, found)
                written = time.monotonic()
    finally:
        workers.close()
        _write(fleet, found)
    return _in_order(fleet, found)


def read_answer(results: Path) -> FleetAnswer:
    """What the last run left in a results folder.

    Raises ResultError: there is nothing, or something else.
    """
    place = results / RESULT_FILE
    try:
        return FleetAnswer.model_validate_json(place.read_bytes())
    except (OSError, ValidationError) as error:
        raise ResultError(
            "no file" if isinstance(error, OSError) else f"something else ({str(error).splitlines()[0]})",
            expected="what `selector fleet run` writes",
            where=str(place),
            advice="run the fleet first",
        ) from error


def _answers(fleet: Fleet, workers: Workers, champions: Mapping[str, Answer]) -> Iterator[tuple[str, Answer]]:
    challenges: dict[str, Challenge] = {}
    studies = dict(fleet.studies)
    for name, champion in champions.items():
        if champion.key is None or known_answer(fleet.results / champion.key) is None:
            continue
        challenge = _challenge(studies.pop(name), champion, fleet)
        if isinstance(challenge, Answer):
            yield name, challenge
        else:
            challenges[name], studies[name] = challenge, challenge.study
    for name, answer in _studied(fleet, studies, workers):
        yield name, settled(challenges[name], answer, fleet.results) if name in challenges else answer


def _challenge(study: Study, champion: Answer, fleet: Fleet) -> Challenge | Answer:
    try:
        return challenge_of(study, champion, fleet.results)
    except InputError as error:
        return kept(champion, f"what was recorded since cannot be used: {error}")


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
            if answer is not None:
                yield name, answer
            elif tries[name] < TRIES:
                waiting.append(task)
            else:
                told = f"its process was ended {TRIES} times from outside, most often because memory ran out"
                yield name, _failed(told, start)
        for name, (_, start) in list(begun.items()):
            if time.monotonic() - start > fleet.time_limit_s + GRACE_S:
                workers.stop(name)
                del begun[name]
                yield name, _failed(overdue_words(fleet.time_limit_s), start)


def _failed(why: str, start: float) -> Answer:
    return Answer(status="failed", error=why, seconds=round(time.monotonic() - start, 3))


def _in_order(fleet: Fleet, found: dict[str, Answer]) -> FleetAnswer:
    return FleetAnswer.of({name: found[name] for name in fleet.studies if name in found})


def _write(fleet: Fleet, found: dict[str, Answer]) -> None:
    text = json_text(_in_order(fleet, found).model_dump(by_alias=True)) + "\n"
    write_whole(fleet.results / RESULT_FILE, text.encode("utf-8"))
