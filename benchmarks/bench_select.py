"""Time of the whole selection: 37 sensors, 10 runs × 5 000 samples, everything chosen again inside every fold.

python benchmarks/bench_select.py [--repeat 3]
python benchmarks/bench_select.py --many-runs 1000 [--rows 40] [--sensors 37] [--memory] [--degree 2]

Goals: 20 s with degree 2; 1000 runs of 40 rows in 30 s and 1 GB; 200 sensors × 50 runs in 40 s.
The first call also loads or compiles the kernels and is reported apart.
"""

from __future__ import annotations

import argparse
import contextlib
import resource
import statistics
import time
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from selector.recording import Channel, Recording
from selector.selection import Options, select

N_SENSORS, N_RUNS, N_SAMPLES, PERIOD_S = 37, 10, 5_000, 60.0


def recording(n_runs: int = N_RUNS, n_samples: int = N_SAMPLES, n_sensors: int = N_SENSORS) -> Recording:
    """First-order responses to three switched sources; the displacement listens to three sensors' true rises."""
    rng = np.random.default_rng(3)
    weights = rng.dirichlet(np.ones(3) * 0.6, size=n_sensors) * rng.uniform(3, 14, size=(n_sensors, 1))
    taus_s = np.exp(rng.uniform(np.log(600), np.log(9000), size=n_sensors))
    runs = {}
    for k in range(n_runs):
        sources = np.repeat(rng.integers(0, 3, size=(3, n_samples // 30 + 1)) / 2, 30, axis=1)[:, :n_samples]
        share = PERIOD_S / taus_s
        rise = np.column_stack(
            [lfilter([share[j]], [1.0, share[j] - 1.0], weights[j] @ sources) for j in range(n_sensors)]
        )
        table = pd.DataFrame(
            np.round(21.0 + rise + 0.05 * rng.normal(size=rise.shape), 1),
            columns=[f"T{j + 1}" for j in range(n_sensors)],
            index=np.arange(n_samples) * PERIOD_S,
        )
        table["Z"] = rise[:, [3, 17, 30]] @ [5.0, 2.5, -2.0] + 0.5 * rng.normal(size=n_samples)
        runs[f"r{k + 1}"] = table
    channels = [Channel(f"T{j + 1}", "temperature", "degC") for j in range(n_sensors)]
    return Recording.from_runs(runs, [*channels, Channel("Z", "displacement", "um", axis="Z")])


def many(n_runs: int, n_samples: int, n_sensors: int, options: Options) -> None:
    """Cost of a great many runs, samples or sensors; kernels are loaded before."""
    select(recording(4, 60), options)
    recorded = recording(n_runs, n_samples, n_sensors)
    with contextlib.suppress(OSError):  # elsewhere than on Linux the peak is that since the start
        Path("/proc/self/clear_refs").write_text("5")
    before_mib = resident_mib("VmRSS")
    start, worked = time.perf_counter(), time.process_time()
    error_um = select(recorded, options).proof.rmse_um("Z")
    took, worked = time.perf_counter() - start, time.process_time() - worked
    peak_mib = resident_mib("VmHWM")
    print(
        f"{n_runs} runs of {n_samples} rows, {n_sensors} sensors: {took:.1f} s, {worked:.1f} s of processor time, ",
        end="",
    )
    print(f"{peak_mib:.0f} MiB, of them {peak_mib - before_mib:.0f} by the selection; unseen {error_um:.2f} µm")


def resident_mib(which: str) -> float:
    """Resident memory of this process now (VmRSS), or at its peak (VmHWM) [MiB]."""
    with contextlib.suppress(OSError):
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith(which)) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> None:
    """Time the cases."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--many-runs", type=int, metavar="N", help="only this: N runs")
    parser.add_argument("--rows", type=int, default=40, help="of each of the many runs")
    parser.add_argument("--sensors", type=int, default=N_SENSORS, help="of each of the many runs")
    parser.add_argument("--memory", action="store_true", help="of the many runs: lags of the sensors, too")
    parser.add_argument("--degree", type=int, default=1, help="of the many runs: powers of the sensors, too")
    asked = parser.parse_args()
    repeat = asked.repeat
    if asked.many_runs:
        many(asked.many_runs, asked.rows, asked.sensors, Options(memory=asked.memory, degree=asked.degree))
        return
    recorded = recording()
    start = time.perf_counter()
    select(recorded, Options())
    print(f"first call, kernels included: {time.perf_counter() - start:.1f} s")
    cases = {
        "linear": Options(),
        "degree 2": Options(degree=2),
        "degree 2 with products": Options(degree=2, interactions=True),
        "memory": Options(memory=True),
    }
    for name, options in cases.items():
        seconds = []
        for _ in range(repeat):
            start = time.perf_counter()
            found = select(recorded, options)
            seconds.append(time.perf_counter() - start)
        print(
            f"{name}: median {statistics.median(seconds):.1f} s of {repeat} (min {min(seconds):.1f}); "
            f"{', '.join(found.chosen)}; unseen RMS {found.proof.rmse_um('Z'):.2f} µm"
        )


if __name__ == "__main__":
    main()
