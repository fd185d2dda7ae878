"""Real recordings of published rigs beside simulations that lack something: what does the diagnosis say?

python -m benchmarks.real_diagnosis --recordings FOLDER --out RESULTS [--half development] [--case rosa/ ...] [--jobs 1]

FOLDER has a folder for every rig, as `python -m benchmarks.real.collect FOLDER CLONES` writes them; where a rig's files
are published is said for those that are missing. RESULTS receives a file a case, and the table as table.txt and
table.json; what is there already is not asked again (`--again` does). `--check` builds the cases and shows what was
read, without asking anything, `--list` shows what is declared of them. The half that is set apart by lot (`--lot` shows
it) is asked once, when the method stands: with `--final`; so are the third set and the halves of the fourth,
fifth, sixth, seventh and eighth.
`--seeds 5` asks the chosen cases five times more, with white noise of their own size on the compared channels, and
tells where names or verdict change (seeds.txt).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, get_args

import numpy as np

from benchmarks.real.case import RealCase, noisy
from benchmarks.real.rigs import CASES
from benchmarks.real.score import judged, sums, text_of
from benchmarks.real.sources import EVERY, SENTENCE, SHIPPED, Half, halves

SEED = 0
_ONCE: tuple[Half, ...] = (
    "apart", "third", "fourth", "fourth-apart", "fifth", "fifth-apart", "sixth", "sixth-apart",
    "seventh", "seventh-apart", "eighth", "eighth-apart",
)  # fmt: skip


def main() -> None:
    options = _options()
    half_of = halves()
    if options.lot:
        print(SENTENCE)
        for rig, half in half_of.items():
            print(f"  {rig:18s} {half}")
        return
    if options.one:
        print(json.dumps(answered(_named(options.one), options.recordings, options.noise_seed)))
        return
    if options.half in _ONCE and not (options.final or options.check or options.list):
        sys.exit(f"the half {options.half} is asked once, when the method stands: --final")
    chosen = [case for case in CASES if half_of[case.rig] == options.half and _asked(case, options.case)]
    if options.list:
        print("\n\n".join(declared(case) for case in chosen))
        return
    there = [case for case in chosen if case.rig in SHIPPED or (options.recordings / case.rig).is_dir()]
    _tell_missing({case.rig for case in chosen} - {case.rig for case in there})
    if options.check:
        for case in there:
            print(read_in(case, options.recordings), flush=True)
        return
    if options.out is None:
        sys.exit("where do the answers go? Name a folder with --out")
    options.out.mkdir(parents=True, exist_ok=True)
    if options.seeds:
        lines = [line for case in there for line in _printed(shaken(case, options))]
        (options.out / "seeds.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return
    with ThreadPoolExecutor(options.jobs) as workers:
        rows = list(workers.map(lambda case: _row(case, options), there))
    summed = sums(rows)
    table = text_of(rows, summed)
    (options.out / "table.txt").write_text(table, encoding="utf-8")
    whole = {"half": options.half, "commit": _commit(), "sums": summed, "cases": rows}
    (options.out / "table.json").write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
    print(table)


def declared(case: RealCase) -> str:
    """What is said of a case before it is asked."""
    source = next((source for source in EVERY if source.rig == case.rig), None)
    origin = "see docs/reference/sources.md" if source is None else f"{source.published}; licence: {source.licence}"
    told = {
        "from": origin,
        "read": case.reading or "as it is",
        "simulation": case.model,
        "truth": case.truth,
        "right": ", ".join((*case.right, *(f"verdict {verdict}" for verdict in case.verdicts))),
        "tolerated": ", ".join(case.tolerated) or "nothing",
    }
    return "\n".join([f"{case.name} ({case.kind})", *(f"  {name:11s} {words}" for name, words in told.items())])


def answered(case: RealCase, recordings: Path, noise_seed: int | None = None) -> dict[str, Any]:
    """What the tool says of a case, with the seconds that it took; with a seed, with its own noise added."""
    from selector.diagnosis.matching.alignment import comparison_of
    from selector.diagnosis.workflow import diagnosis

    given = case.build(recordings / case.rig)
    recording, simulation, holdout = given if noise_seed is None else noisy(given, noise_seed)
    started = time.perf_counter()
    comparison = comparison_of(recording, simulation, holdout=holdout)
    found = diagnosis(comparison, seed=SEED)
    seconds = round(time.perf_counter() - started, 1)
    looked = [vars(one) for one in found.evidence if one.id in case.right]
    return {"rows": len(comparison.time_s), "seconds": seconds, "answer": found.as_dict(), "evidence": looked}


def read_in(case: RealCase, recordings: Path) -> str:
    """Runs, rows and sizes of a case, to see whether the files were read as they are meant."""
    recording, simulation, holdout = case.build(recordings / case.rig)
    lines = [f"{case.name}: {len(recording.frame)} rows; held out: {holdout}"]
    for run in recording.runs:
        time_s = recording.time_s(run)
        parts = [f"{len(time_s)} rows of {np.median(np.diff(time_s)):.4g} s"]
        for name in simulation.names:
            seen, given = (one.values(run, (name,))[:, 0] for one in (recording, simulation))
            parts.append(
                f"{name} {np.nanmin(seen):.4g} to {np.nanmax(seen):.4g}, scatter {np.nanstd(seen):.4g}, simulated "
                f"{np.nanstd(given):.4g}, difference {np.nanmean(seen - given):.3g} ± {np.nanstd(seen - given):.4g}"
            )
        lines.append(f"  {run}: " + "; ".join(parts))
    return "\n".join(lines)


def told(case: RealCase, options: argparse.Namespace, noise_seed: int | None = None) -> dict[str, Any]:
    """The answer to a case, from its file if it was asked before."""
    ending = "" if noise_seed is None else f"__noise_{noise_seed}"
    path: Path = options.out / (case.name.replace("/", "__").replace(" ", "_") + ending + ".json")
    if options.again or not path.is_file():
        path.write_text(json.dumps(_in_own_process(case, options, noise_seed), indent=1) + "\n", encoding="utf-8")
    return dict(json.loads(path.read_text(encoding="utf-8")))


def shaken(case: RealCase, options: argparse.Namespace) -> list[str]:
    """A line for every seed whose noise changes names or verdict of a case, and one of how many do."""

    def said(noise_seed: int | None) -> tuple[str, str]:
        answer = told(case, options, noise_seed).get("answer")
        if answer is None:
            return "failed", ""
        return answer["verdict"], ", ".join(sorted({effect["id"] for effect in answer["effects"]}))

    plain = said(None)
    others = {seed: said(seed) for seed in range(options.seeds)}
    changed = {seed: one for seed, one in others.items() if one != plain}
    lines = [f"{case.name:32s} {len(changed)} of {options.seeds} changed: {plain[0]} {plain[1]}"]
    return lines + [f"{'':34s}seed {seed}: {verdict} {names}" for seed, (verdict, names) in changed.items()]


def _row(case: RealCase, options: argparse.Namespace) -> dict[str, Any]:
    row = judged(case, told(case, options))
    print(f"{case.name:26s} {row['credit']:16s} {row['verdict']:18s} {row['names']}", file=sys.stderr, flush=True)
    return row


def _in_own_process(case: RealCase, options: argparse.Namespace, noise_seed: int | None) -> dict[str, Any]:
    command = [sys.executable, "-m", "benchmarks.real_diagnosis", "--one", case.name]
    command += ["--recordings", str(options.recordings)]
    if noise_seed is not None:
        command += ["--noise-seed", str(noise_seed)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    try:
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=options.limit)
    except subprocess.TimeoutExpired:
        return {"error": f"no answer in {options.limit} s"}
    if done.returncode:
        return {"error": done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"code {done.returncode}"}
    return dict(json.loads(done.stdout.splitlines()[-1]))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=Path, default=Path())
    parser.add_argument("--out", type=Path)
    parser.add_argument("--half", choices=get_args(Half), default="development")
    parser.add_argument("--case", nargs="+", default=[], help="cases whose name holds one of these")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seeds", type=int, default=0, help="ask with noise of so many seeds: does the answer hold?")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds a case")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--lot", action="store_true")
    parser.add_argument("--final", action="store_true")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    parser.add_argument("--noise-seed", type=int, help=argparse.SUPPRESS)
    return parser.parse_args()


def _printed(lines: list[str]) -> list[str]:
    print("\n".join(lines), flush=True)
    return lines


def _asked(case: RealCase, parts: Sequence[str]) -> bool:
    return not parts or any(part in case.name for part in parts)


def _named(name: str) -> RealCase:
    return next(case for case in CASES if case.name == name)


def _tell_missing(rigs: set[str]) -> None:
    published = {source.rig: source.published for source in EVERY}
    for rig in sorted(rigs):
        print(f"no folder {rig}: {published.get(rig, 'see docs/reference/sources.md')}", file=sys.stderr)


def _commit() -> str:
    done = subprocess.run(
        ["git", "describe", "--always", "--dirty"], capture_output=True, text=True, cwd=Path(__file__).parent
    )
    return done.stdout.strip()


if __name__ == "__main__":
    main()
