"""Two checkouts of the program, the same commands: what do they tell differently?

python -m tests.frozen OLD NEW            run every command in both and compare
python -m tests.frozen OLD NEW --quick    without the slow ones
python -m tests.frozen --record DIR OLD   keep what OLD tells in DIR
python -m tests.frozen --against DIR NEW  compare NEW with what was kept
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tests.frozen.comparing import differences, drifts
from tests.frozen.running import jobs, record


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.frozen", description=__doc__.splitlines()[0])
    parser.add_argument("checkouts", nargs="+", type=Path, help="folders that hold selector/: OLD NEW, or one of them")
    parser.add_argument("--record", type=Path, metavar="DIR", help="only run the one checkout and keep its output")
    parser.add_argument("--against", type=Path, metavar="DIR", help="compare the one checkout with kept output")
    parser.add_argument("--quick", action="store_true", help="without the slow commands")
    parser.add_argument("--only", default="", metavar="WORD", help="commands whose name contains it")
    parser.add_argument("--workers", type=int, default=2, metavar="N")
    given = parser.parse_args()
    chosen = jobs(given.quick, given.only)
    if given.record:
        record(given.checkouts[0], chosen, given.record, given.workers)
        return 0
    with tempfile.TemporaryDirectory(prefix="frozen-") as scratch:
        old = given.against or Path(scratch, "old")
        if not given.against:
            record(given.checkouts[0], chosen, old, given.workers)
        record(given.checkouts[-1], chosen, Path(scratch, "new"), given.workers)
        ran = {job.name for job in chosen}
        meant = drifts()
        found = [text for text in differences(old, Path(scratch, "new"), meant) if text.split("/")[1] in ran]
    for text in found:
        print(text)
    print(f"{len(chosen)} commands: {len(found) or 'no'} unexpected differences; {len(meant)} drifts are listed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
