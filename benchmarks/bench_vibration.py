"""All phase shifts of all sources: ours beside plain NumPy, time and memory, in one run.

python -m benchmarks.bench_vibration [--repeats 5] [--lines 20]

*plain*: the array of shape (N, sections, sources) and its sum over the sources, as the definition says. *matrix*: the
same sum as one product of the shifts with the motions. Both begin at the motions of the sources, which *ours* makes
from the lines as well: its time is everything from lines to results. One thread (set OMP_NUM_THREADS=1).
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections.abc import Callable
from itertools import product

import numpy as np

from selector.physics.vibration.periodic_error import realisation_amounts, section_times

Amounts = tuple[float, float, float]


def amounts(every: np.ndarray) -> Amounts:
    """Mean |Z|, mean |x| and the largest |Z|."""
    size = np.abs(every)
    return float(size.mean()), float(np.abs(every.imag).mean()), float(size.max())


def plain(z: np.ndarray, shifts: np.ndarray) -> Amounts:
    return amounts((shifts[:, None, :] * z.T[None, :, :]).sum(axis=2))


def matrix(z: np.ndarray, shifts: np.ndarray) -> Amounts:
    return amounts(shifts @ z)


def measured(work: Callable[[], Amounts], repeats: int) -> tuple[float, float, Amounts]:
    """Quickest of some runs [s], largest memory of another one [MB], and what comes of it."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        found = work()
        times.append(time.perf_counter() - begin)
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return min(times), peak, found


def case(n_sources: int, phases: int, n_sections: int, n_lines: int, repeats: int) -> None:
    rng = np.random.default_rng(1)
    count = n_sources * n_lines
    motion = rng.normal(size=count) + 1j * rng.normal(size=count)
    frequency, source = rng.uniform(10.0, 2000.0, count), np.arange(count) % n_sources
    times = section_times(n_sections, 1.0)
    lines = motion[:, None] * np.exp(2j * np.pi * np.outer(frequency, times))
    z = np.array([lines[source == s].sum(axis=0) for s in range(n_sources)])

    def ours() -> Amounts:
        found = realisation_amounts(motion, frequency, source, times, n_sources=n_sources, phases=phases)
        return found.expected_m, found.mean_abs_m, found.largest_m

    print(f"\n{phases}^{n_sources} = {phases**n_sources} realisations, {n_sections} sections, {n_lines} lines a source")
    best, peak, found = measured(ours, repeats)
    print(f"  ours     {1e3 * best:8.1f} ms  {peak:8.1f} MB")
    if phases**n_sources * n_sections * n_sources > 60_000_000:
        return
    shifts = np.array(list(product(np.exp(2j * np.pi * np.arange(phases) / phases), repeat=n_sources)))
    for name, way in (("plain", plain), ("matrix", matrix)):
        took, memory, other = measured(lambda way=way: way(z, shifts), min(repeats, 2))
        apart = max(abs(a / b - 1.0) for a, b in zip(found, other, strict=True))
        ratio = f"{took / best:.1f} times the time of ours, {apart:.0e} apart"
        print(f"  {name:8s} {1e3 * took:8.1f} ms  {memory:8.1f} MB  {ratio}")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--lines", type=int, default=20)
    options = parser.parse_args()
    case(5, 4, 10_000, options.lines, options.repeats)
    case(5, 8, 1_000, options.lines, options.repeats)
    case(8, 4, 10_000, options.lines, 1)


if __name__ == "__main__":
    main()
