"""What is taken for what: true effects against what was named."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.proof.judging import is_hidden
from selector.proof.runner import Outcome
from selector.proof.stated import FAILED, Named

SET, UNEXPLAINED, NOTHING, CLEAN = "right, in a set", "unexplained", "nothing", "(nothing missing)"
_LAST = (SET, UNEXPLAINED, NOTHING, FAILED)


@dataclass(frozen=True, eq=False)
class Confusion:
    """Counts of answers: a row for each true id, a column for each thing that was said.

    A true effect counts once, under its right name if that was given. Names beside it that are false count in the row
    of the first true effect, so that a row may hold more than there were cases.
    """

    true: tuple[str, ...]
    said: tuple[str, ...]
    counts: NDArray[np.int64]
    cases: tuple[int, ...]


def confusion(outcomes: Iterable[Outcome], *, least_d_prime: float = 0.0) -> Confusion:
    """True effects against what was named, over cases from this strength on; clean cases have a row of their own."""
    counts: Counter[tuple[str, str]] = Counter()
    cases: Counter[str] = Counter()
    for outcome in outcomes:
        if outcome.truth is None or (outcome.d_prime_asked or np.inf) < least_d_prime:
            continue
        for true, said in _pairs(outcome):
            counts[true, said] += 1
        cases.update([effect.id for effect in outcome.truth.effects] or [_clean_name(outcome)])
    rows = sorted(cases, key=lambda name: (name.startswith(("(", "hidden.")), name))
    named = {said for _, said in counts}
    columns = sorted(named - set(_LAST)) + [said for said in _LAST if said in named]
    table = np.array([[counts[true, said] for said in columns] for true in rows], dtype=np.int64)
    return Confusion(
        tuple(rows), tuple(columns), table.reshape(len(rows), len(columns)), tuple(cases[name] for name in rows)
    )


def _clean_name(outcome: Outcome) -> str:
    return CLEAN if outcome.kind != "miscalibrated" else "(miscalibrated)"


def _pairs(outcome: Outcome) -> list[tuple[str, str]]:
    """(true id, what was said) of every true effect and every false name of a case."""
    assert outcome.truth is not None
    effects = outcome.truth.effects
    false = list(dict.fromkeys(outcome.judged.false_names))
    if not effects:
        return [(_clean_name(outcome), said) for said in false or [_silence(outcome)]]
    pairs = []
    for effect in effects:
        said = None if is_hidden(effect) else _right_name(effect.accept, outcome.stated.effects, effect.id)
        if said is not None:
            pairs.append((effect.id, said))
        elif not false:
            pairs.append((effect.id, _silence(outcome)))
    return pairs + [(effects[0].id, said) for said in false]


def _right_name(accept: tuple[str, ...], named: tuple[Named, ...], id: str) -> str | None:  # noqa: A002
    ids = [one.id for one in named if one.id in accept]
    if ids:
        return id if id in ids else ids[0]
    return SET if any(set(accept) & set(one.ids) for one in named) else None


def _silence(outcome: Outcome) -> str:
    verdict = outcome.stated.verdict
    return verdict if verdict in (FAILED, UNEXPLAINED) else NOTHING
