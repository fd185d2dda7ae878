"""Time and peak memory of a study of one month in a lake: 40 thermometers at 1 Hz, 31 days, 107 million samples.

python benchmarks/bench_lake.py [--days 31] [--sensors 40] [--keep FOLDER]

The days are put into the lake as `convert --lake` puts them (1.1 GB of Parquet), with days of the months before and
after beside them, which must not be opened. Then `selector select LAKE --since … --until … --mean-s 60` runs in a
process of its own, of which the operating system's peak of resident memory is read. Goals: 30 s, 1 GiB.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.live.lake import Lake
from selector.readers.machine_file import ChannelSection

FIRST, DAY_S = datetime(2026, 3, 1, tzinfo=UTC), 86_400


def day(seed: int, n_sensors: int) -> np.ndarray:
    """A day of thermometers [°C] and, as the last column, the displacement [µm]; shape (86 400, n_sensors + 1)."""
    rng = np.random.default_rng(seed)
    sources = np.repeat(rng.integers(0, 3, size=(3, DAY_S // 3600)) / 2, 3600, axis=1)
    machine = np.random.default_rng(1)
    weights = machine.dirichlet(np.ones(3) * 0.6, size=n_sensors) * machine.uniform(3, 14, size=(n_sensors, 1))
    shares = 1.0 / np.exp(machine.uniform(np.log(600), np.log(9000), size=n_sensors))
    rise = np.column_stack(
        [lfilter([share], [1.0, share - 1.0], one @ sources) for share, one in zip(shares, weights, strict=True)]
    )
    gauge = rise[:, [3, 17, 30]] @ [5.0, 2.5, -2.0] + 0.5 * rng.normal(size=DAY_S)
    return np.column_stack([21.0 + rise + 0.05 * rng.normal(size=rise.shape), gauge])


def main() -> None:
    """Write, ask, print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--days", type=int, default=31)
    parser.add_argument("--sensors", type=int, default=40)
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args()
    channels = {f"T{j + 1}": ChannelSection(role="temperature", unit="degC") for j in range(asked.sensors)}
    channels["Z"] = ChannelSection(role="displacement", unit="um", axis="Z")
    with tempfile.TemporaryDirectory() as scratch:
        folder = asked.keep or Path(scratch)
        lake = Lake(folder, "mill-3", channels, lambda event, **said: sys.exit(f"{event}: {said}"))
        start = time.process_time()
        for number in (-2, -1, *range(asked.days), asked.days):
            begin_s = (FIRST + timedelta(days=number)).timestamp()
            lake.put(begin_s + np.arange(DAY_S, dtype=float), day(number + 100, asked.sensors))
        size = sum(path.stat().st_size for path in folder.rglob("*.parquet")) / 1e9
        print(f"{asked.days + 3} days, {size:.2f} GB, written in {time.process_time() - start:.0f} s of processor time")
        ends = [f"{FIRST + timedelta(days=number):%Y-%m-%d}" for number in (0, asked.days)]
        program = (
            "import re, sys; from selector.cli import exit_status; code = exit_status(sys.argv[1:]);"
            "peak = re.search('VmHWM:[^0-9]*([0-9]+)', open('/proc/self/status').read());"
            "print(peak.group(1), file=sys.stderr); sys.exit(code)"
        )
        line = ["select", str(folder), "--since", ends[0], "--until", ends[1], "--mean-s", "60", "--json"]
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.perf_counter()
        done = subprocess.run([sys.executable, "-c", program, *line], capture_output=True, text=True, check=False)
        took, worked = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        if done.returncode:
            sys.exit(done.stderr)
        answer, peak_mib = json.loads(done.stdout), int(done.stderr.split()[-1]) / 1024
        print(
            f"{asked.days * DAY_S * (asked.sensors + 1):.3g} samples: {took:.1f} s, {worked:.1f} s of processor time,"
        )
        print(f"peak {peak_mib:.0f} MiB (goals 30 s, 1024 MiB); {len(answer['models']['Z']['per_run'])} runs, chosen")
        print(f"{answer['chosen']['sensors']}, unseen RMS {answer['models']['Z']['heldout_rmse_um']:.2f} µm")


if __name__ == "__main__":
    main()
