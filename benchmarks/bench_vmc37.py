"""Are the shipped runs of fixtures/vmc37 what their generator makes, to a step of the instruments?

python -m benchmarks.bench_vmc37

Makes all of them again with the machine of 20 000 nodes, which takes half a minute; ends with exit code 1 where one is
another. Tests ask the same of three runs with a coarser mesh, within what the mesh does.
"""

from __future__ import annotations

import csv
import runpy
import sys
from pathlib import Path

import numpy as np

from selector.physics.thermal.field.machine import virtual_machining_centre
from selector.shipped import shipped

GENERATOR = Path(__file__).parents[1] / "fixtures" / "make" / "vmc37.py"
#: Other linear algebra may tip a value to the next step of its instrument, at most 0.1, and rarely.
LARGEST, SHARE = 0.101, 0.02


def main() -> int:
    make = runpy.run_path(str(GENERATOR))
    machine, is_other = virtual_machining_centre(), False
    for number, run in enumerate(make["runs"](), 1):
        with (shipped("vmc37") / f"r{number}.csv").open(encoding="utf-8", newline="") as stream:
            header, *rows = csv.reader(stream)
        made = make["recorded"](run, number, machine)
        gaps = np.abs(np.array(rows, float) - np.array(list(made.values()), float).T)
        is_other |= list(made) != header or gaps.max() >= LARGEST or (gaps > 0).mean(axis=0).max() >= SHARE
        print(f"r{number}: {len(rows)} rows, {gaps.max():.3g} at most, {100 * (gaps > 0).mean():.3g} % differ")
    return int(is_other)


if __name__ == "__main__":
    sys.exit(main())
