"""How often does the next run settle what a record leaves open?

    python benchmarks/bench_next_run.py [--families thermal drive] [--seeds 700:702] [--strengths 6] [--jobs 2]

Every case of the proving ground whose diagnosis has an effect that it cannot tell from others, and proposes a run that
the machine can make: the run is made on the true machine, with noise of its own, put in front of the held-out one, and
the longer record is diagnosed again by the same program. Counted is what the second answer says.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1]))

from proving_ground.judging import Judged
from proving_ground.runner import Question, questions
from proving_ground.scenarios import scenarios
from proving_ground.settling import Settled, settled

KINDS = ("single", "several", "undecidable", "decoy")


def answer(judged: Judged) -> str:
    """What an answer is, by its weakest true effect."""
    if judged.false_names:
        return "a wrong name"
    return next((word for word in ("missed", "set", "first") if word in judged.credits), "exact")


def asked(question: Question) -> Settled | None:
    """The case of a question, before and after its next run."""
    warnings.simplefilter("ignore")
    with threadpool_limits(1):
        return settled(question.scenario.build(question.seed, question.d_prime), question.seed)


def table(done: Sequence[tuple[Question, Settled]]) -> str:
    """Second answers by first ones, and every case."""
    lines = []
    for question, one in done:
        before, after = (
            " + ".join("|".join(ids) for ids in named) or "no name" for named in (one.named_before, one.named_after)
        )
        lines.append(
            f"{question.scenario.name:45s} d′ {question.d_prime} seed {question.seed}  power {one.power:.2f}\n"
            f"    {one.description}\n"
            f"    {answer(one.before)}: {before}\n    {answer(one.after)}: {after}"
        )
    counted = Counter((answer(one.before), answer(one.after)) for _, one in done)
    lines += ["", "first answer → second answer: cases"]
    lines += [f"{first} → {second}: {number}" for (first, second), number in sorted(counted.items())]
    held = [one for _, one in done if answer(one.before) in ("first", "set")]
    right = sum(answer(one.after) == "exact" for one in held)
    lines.append(f"the set held the truth in {len(held)} of {len(done)}; of these the run settles {right}")
    return "\n".join(lines)


def main() -> None:
    """Ask every scenario and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--families", nargs="+", default=["thermal", "drive"])
    parser.add_argument("--seeds", default="700:702")
    parser.add_argument("--strengths", type=float, nargs="+", default=[6.0])
    parser.add_argument("--jobs", type=int, default=2)
    told = parser.parse_args()
    first, stop = (int(part) for part in told.seeds.split(":"))
    kinds = [one for one in scenarios(told.families) if one.kind in KINDS]
    all_asked = questions(kinds, told.strengths, range(first, stop))
    work = Parallel(n_jobs=told.jobs, return_as="generator", batch_size=1)
    done = []
    for number, (question, one) in enumerate(
        zip(all_asked, work(delayed(asked)(one) for one in all_asked), strict=True)
    ):
        print(f"\r{number + 1} of {len(all_asked)}", end="", file=sys.stderr, flush=True)
        if one is not None:
            done.append((question, one))
    print(f"\n{len(all_asked)} cases asked, {len(done)} left open with a run that can be made\n")
    print(table(done))


if __name__ == "__main__":
    main()
