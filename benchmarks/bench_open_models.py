"""Two cases of `selector prove --families open_model` whose answers were wrong once, in full.

python -m benchmarks.bench_open_models

Heat from two sources is put into the model, both of them; bristles beside an axis of one mass are friction alone, which
looks like break-away, play and friction by direction at once. Prints what was answered; ends with exit code 1 where it
is another. Half a minute.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

from proving_ground.scenarios import scenarios
from selector.diagnosis.open_model.modelled import diagnosis_of_model


class Right(NamedTuple):
    """What must be named, how many sections that adds to the model file, and what must be among `also_seen`."""

    seed: int
    names: frozenset[str]
    added: int | None = None
    also_seen: frozenset[str] = frozenset()


RIGHT = {
    "two: pump and coolant/heated": Right(0, frozenset({"thermal.second_source", "thermal.coolant"}), added=2),
    "drive.coulomb/axis": Right(
        50, frozenset({"drive.coulomb"}), also_seen=frozenset({"drive.stribeck", "drive.backlash"})
    ),
}


def main() -> int:
    wrong = 0
    for one in scenarios(("open_model",)):
        if one.name not in RIGHT:
            continue
        right = RIGHT[one.name]
        case = one.build(right.seed, None)
        found = diagnosis_of_model(case.model, case.recording, responses=case.responses, seed=right.seed)
        names = {effect.id for effect in found.answer.effects}
        added = None if found.improved is None else len(found.improved.added)
        holds = (
            names == right.names
            and right.added in (None, added)
            and right.also_seen <= {effect.id for effect in found.answer.also_seen}
        )
        wrong += not holds
        print(f"{'right' if holds else 'WRONG'}  {one.name}: {', '.join(sorted(names))}; {added} put in", flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
