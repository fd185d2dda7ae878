"""Does the run that is proposed settle what a record leaves open? It is made on the true machine, and asked again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from proving_ground.case import Case
from proving_ground.judging import Judged, judged, stated
from proving_ground.runner import blind, spans
from selector.diagnosis.answer import Diagnosis
from selector.diagnosis.next_run.experiments import shortened
from selector.diagnosis.next_run.planned_runs import PlannedRun, planned_runs
from selector.diagnosis.workflow import diagnosis


@dataclass(frozen=True)
class Settled:
    """An effect that could not be told from others, and what was said once the proposed run was there."""

    description: str  #: Of the run
    separates: tuple[str, ...]
    power: float
    before: Judged
    after: Judged
    named_before: tuple[tuple[str, ...], ...]  #: Every named effect with what it is not told from
    named_after: tuple[tuple[str, ...], ...]


def settled(case: Case, seed: int) -> Settled | None:
    """The case asked, the first run that is proposed made, and the longer case asked again.

    None where the answer leaves nothing open, or proposes no run that this machine can make.
    """
    first = diagnosis(blind(case), seed=seed)
    for planned, separates, power in _proposed(first):
        longer = _made(case, planned, seed)
        if longer is not None:
            second = diagnosis(blind(longer), seed=seed)
            answers = first, second
            before, after = (_judged(case, one) for one in answers)
            named = [tuple((e.id, *e.cannot_be_told_from) for e in one.effects) for one in answers]
            return Settled(planned.description, separates, power, before, after, named[0], named[1])
    return None


def _proposed(answer: Diagnosis) -> Iterator[tuple[PlannedRun, tuple[str, ...], float]]:
    """Runs in the order of the answer, with what is set in them."""
    menu: dict[str, PlannedRun] = {}
    for effect in answer.effects:
        if effect.cannot_be_told_from:
            menu |= {one.description: one for one in planned_runs(shortened(answer.comparison), effect.channel)}
    for run in answer.next_runs:
        if run.power is not None and run.description in menu:
            yield menu[run.description], run.separates, run.power


def _made(case: Case, planned: PlannedRun, seed: int) -> Case | None:
    if case.with_run is None:
        return None
    n = len(next(iter(planned.inputs.values())))
    try:
        return case.with_run(planned.inputs, planned.duration_s / n, seed)
    except ValueError:
        return None


def _judged(case: Case, answer: Diagnosis) -> Judged:
    return judged(stated(answer.as_dict()), case.truth, spans(case.recording))
