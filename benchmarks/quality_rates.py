"""How often do the quality checks raise a false alarm on clean recordings, and find planted faults?

    python -m benchmarks.quality_rates [seeds]

A false alarm is a finding that leaves something out of a recording without a fault. A fault counts as found when a
finding of the right kind, more than a mention, names the channel and the run and is right about the time by half; the
column `left out` counts those that also leave it out, `beside` recordings in which something else is left out.
"""

from __future__ import annotations

import sys
import time
from collections import Counter

import numpy as np

from selector.quality import inspect
from tests.quality.faults import KINDS, planted
from tests.quality.workshop import clean_recording, plain_recording, plain_tables


def false_alarms(seeds: range) -> tuple[int, Counter[str], list[str]]:
    """(recordings with at least one, findings by id, where)."""
    hit, kinds, places = 0, Counter[str](), []
    for seed in seeds:
        acting = [finding for finding in inspect(clean_recording(seed)) if finding.action != "none"]
        hit += bool(acting)
        kinds.update(finding.id for finding in acting)
        places += [f"seed {seed}: {finding.id}: {finding.statement}" for finding in acting]
    return hit, kinds, places


def detections(kind: str, seeds: range) -> tuple[int, int, int, int, list[int]]:
    """(found, of these left out, planted, recordings where something without a fault was left out, seeds missed)."""
    found = acted = tried = beside = 0
    missed = []
    for seed in seeds:
        case = planted(clean_recording(seed), kind, np.random.default_rng([seed, 1]))
        if case is None:
            continue
        findings = inspect(case.recording)
        told = [finding for finding in findings if case.is_told_by(finding)]
        tried, found = tried + 1, found + bool(told)
        acted += any(finding.action != "none" for finding in told)
        beside += any(case.is_beside_the_fault(finding) for finding in findings)
        if not told:
            missed.append(seed)
    return found, acted, tried, beside, missed


def cost_s(samples: int) -> float:
    """Best of three: seconds for 38 channels, 10 runs, so many samples a run."""
    tables = plain_tables(10, samples)
    thermal = [name for name in tables["r1"].columns if name.startswith("T")]
    rng = np.random.default_rng(0)
    for table in tables.values():
        for k in range(29):
            table[f"T{k + 10}"] = table[thermal] @ rng.dirichlet(np.ones(len(thermal))) + rng.normal(0, 0.03, samples)
    recording = plain_recording(tables)
    best = np.inf
    for _ in range(3):
        begin = time.perf_counter()
        inspect(recording)
        best = min(best, time.perf_counter() - begin)
    return float(best)


def main(count: int = 200, kinds: tuple[str, ...] = tuple(KINDS)) -> None:
    begin = time.perf_counter()
    base = cost_s(5000)
    print(f"38 channels, 10 runs of 5000 samples: {base:.2f} s; of 10 000: {cost_s(10_000) / base:.2f} times that")
    hit, by_kind, places = false_alarms(range(70_000, 70_000 + count))
    print(f"clean recordings with a false alarm: {hit} of {count} ({hit / count:.1%}); {dict(by_kind)}")
    for place in places:
        print("  ", place)
    print(f"{'planted':24} {'found':>12}       left out  beside   missed seeds")
    for kind in kinds:
        found, acted, tried, beside, missed = detections(kind, range(80_000, 80_000 + count))
        print(
            f"{kind:24} {found:5} of {tried:4} {found / max(tried, 1):5.0%} {acted:9} {beside:7}   {missed[:8]}",
            flush=True,
        )
    print(f"{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200, tuple(sys.argv[2:]) or tuple(KINDS))
