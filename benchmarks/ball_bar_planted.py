"""Ball-bar: how often every planted cause is found within 10 %, in 100 tests that another simulation made.

`python benchmarks/ball_bar_planted.py`: 4 minutes on one core.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from selector.physics.drive.ball_bar.causes import circle_causes
from selector.readers.ball_bar_file import read_circles
from tests.physics.drive.planted_circles import LEAD_M, PlantedCircles


def worst_share(seed: int) -> tuple[float, str]:
    """Largest error of a planted cause relative to its size, and which one."""
    planted = PlantedCircles(seed)
    with tempfile.TemporaryDirectory() as folder:
        read, _ = read_circles([planted.write(Path(folder) / "test.txt")])
    found = circle_causes([one.trace for one in read], lead_m={"X": LEAD_M, "Y": LEAD_M}).through_feeds
    return max((abs(found[name].value / size - 1.0), name) for name, size in planted.expected().items())


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    worst = [worst_share(seed) for seed in range(count)]
    print(f"all causes within 10 %: {sum(share <= 0.1 for share, _ in worst)} of {count}")
    for share, name in sorted(worst)[-8:]:
        print(f"  {100 * share:.1f} % {name}")
