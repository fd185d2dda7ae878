"""How many of 300 changed model files are refused, told, or pass in silence.

    python benchmarks/bench_mutated_models.py [--files 300]

The file has three sensors, a memory, two outputs, a slope and two fallbacks (tests/controllers/hostile.py); one place
is changed at a time (tests/controllers/mutated.py). Three times: with the digest that it had, without one, and with one
that fits, as only somebody makes it who means to deceive: then the vectors alone decide.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.controllers.self_check import sealed
from tests.controllers import hostile, mutated

WAYS = {"digest as it was": dict, "no digest": mutated.without_digest, "digest made anew": mutated.forged}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=300)
    files = parser.parse_args().files
    model = sealed(hostile.model())
    found: dict[str, dict[str, Counter[str]]] = {way: defaultdict(Counter) for way in WAYS}
    for seed in range(files):
        kind, document = mutated.mutated(model, seed)
        for way, change in WAYS.items():
            found[way][kind][mutated.outcome(change(document))] += 1
    for way, kinds in found.items():
        total = sum(kinds.values(), Counter())
        print(f"{way}: " + ", ".join(f"{total[of]} {of}" for of in ("refused", "told", "silent")) + f" of {files}")
        for kind, counts in kinds.items():
            if counts["silent"]:
                print(f"  {kind}: {dict(counts)}")


if __name__ == "__main__":
    main()
