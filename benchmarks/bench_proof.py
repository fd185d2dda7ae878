"""The whole blind proof with rivals: scores, page and files; at most two hours on two cores.

    python benchmarks/bench_proof.py [--exam] [--jobs 2] [--seeds 5] [--hours 2] [--no-rivals] [--out DIR]

Every scenario at d′ = 3, 6, 12 and every seed, shuffled, so that a part of the time is a part of every kind. What did
not fit into the hours is said and not scored.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import time
from pathlib import Path

from proving_ground.results import by_answerer, cases_csv, line_of, proof_account, row_texts, score_object
from proving_ground.rivals import rivals
from proving_ground.runner import TOOL, Answerer, Outcome, answer_of_selector, outcomes, questions
from proving_ground.scenarios import scenarios
from proving_ground.scoring import score_table, scores
from selector.atomic_file import folder_written_whole
from selector.cli.shared.showing import json_text
from selector.telling.page import account_page

PORTION = 40


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--exam", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--no-rivals", action="store_true")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    first = 10_000 if options.exam else 0
    asked = list(questions(scenarios(), seeds=range(first, first + options.seeds)))
    random.Random(0).shuffle(asked)
    others = () if options.no_rivals else rivals(("all",))
    answerers = (Answerer(TOOL, answer_of_selector), *others)
    print(f"{len(asked)} cases of {len(scenarios())} scenarios, {len(answerers)} answerers")
    started = time.perf_counter()
    found: list[Outcome] = []
    for at in range(0, len(asked), PORTION):
        if time.perf_counter() - started > 3600.0 * options.hours:
            print(f"time is over: {len(asked) - at} cases were not asked")
            break
        found += outcomes(asked[at : at + PORTION], answerers, n_jobs=options.jobs, progress=say)
    seconds = time.perf_counter() - started
    for name, part in by_answerer(found).items():
        print(f"\n{name}")
        for row in score_table(scores(part)):
            score, measured, interval, n, bar, goal, met = row_texts(row)
            print(f"  {score:66s} {measured:>9s}  {interval:>21s}  n={n:>4s}  {bar:>8s} {goal:>8s}  {met}")
    own = sum(one.answerer == TOOL for one in found)
    peak_mb = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024
    print(f"\n{own} cases in {seconds / 60:.1f} min with {options.jobs} processes; largest process {peak_mb:.0f} MB")
    if options.out is not None:
        with folder_written_whole(options.out) as folder:
            score = json_text(score_object(found, is_exam=options.exam)) + "\n"
            (folder / "score.json").write_text(score, encoding="utf-8")
            (folder / "cases.csv").write_text(cases_csv(found), encoding="utf-8")
            told = proof_account(found, is_exam=options.exam, drawn=True)
            (folder / "report.html").write_text(account_page(told), encoding="utf-8")


def say(done: int, total: int, outcome: Outcome) -> None:
    if outcome.answerer == TOOL:
        sys.stderr.write(f"{line_of(outcome)}\n")


if __name__ == "__main__":
    main()
