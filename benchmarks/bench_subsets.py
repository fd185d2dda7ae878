"""Exact best subsets and sensor sets: our seconds, the goals, and R's leaps and lmSubsets on the same data.

    OMP_NUM_THREADS=1 python benchmarks/bench_subsets.py [--data subset_data.py] [--leaps 37 40] [--many] [--quick]

`--many` adds the gap against time with 60, 100 and 1000 columns: some minutes.

The problems come from a module with ``easy(n, p, seed)`` and ``thermal(n, p, seed)``, each returning (X, y): the file
given by ``--data``, or by the environment variable SELECTOR_BENCH_DATA, or ../shared/bench/subset_data.py beside this
repository. Without it our own generator of the same kind is used, and the printed goals do not apply. leaps is run
when Rscript is found (Debian: r-base-core, r-cran-leaps); its time at 40 columns is half a minute. lmSubsets is run
where R finds it (built from its sources).
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import itertools
import math
import os
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

from selector.models.best_subsets.problem import cross_products
from selector.models.best_subsets.results import SubsetSearch
from selector.models.best_subsets.subsets import best_sensor_sets, best_subsets

HERE = Path(__file__).resolve().parent
N_SAMPLES = 500
PROBLEMS = (("thermal", 37, 0.03), ("thermal", 40, 0.07), ("thermal", 50, 1.0), ("easy", 60, 40.0))


def easy(n: int, p: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Independent columns; the response follows five of them."""
    rng = np.random.default_rng([seed, p])
    columns = rng.standard_normal((n, p))
    return columns, columns[:, :5] @ np.linspace(0.4, 0.9, 5) + rng.standard_normal(n)


def thermal(n: int, p: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Sensors on a machine with a few heat sources that switch: lagged mixtures of them, with 0.05 K of noise."""
    rng = np.random.default_rng([seed, p])
    on = np.repeat(rng.random((n // 30 + 1, 4)) < 0.5, 30, axis=0)[:n]
    columns = np.zeros((n, p))
    lag = rng.uniform(15.0, 80.0, p)
    steady = (on * rng.uniform(0.5, 1.5, 4)) @ (rng.dirichlet(np.full(4, 0.5), p) * rng.uniform(3.0, 12.0, (p, 1))).T
    for i in range(1, n):
        columns[i] = columns[i - 1] + (steady[i] - columns[i - 1]) / lag
    columns += np.outer(np.sin(np.arange(n) / 25.0), rng.uniform(0.5, 2.0, p)) + 0.05 * rng.standard_normal((n, p))
    weights = np.zeros(p)
    weights[rng.permutation(p)[:5]] = rng.uniform(1.0, 4.0, 5)
    return columns, columns @ weights + rng.standard_normal(n)


def problems_from(path: Path) -> ModuleType | None:
    if not path.is_file():
        return None
    spec = importlib.util.spec_from_file_location("subset_data", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def timed(repeat: int, work: Callable[[], object]) -> tuple[float, float, object]:
    """Best and median seconds, and the last result."""
    seconds = []
    for _ in range(repeat):
        started = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - started)
    return min(seconds), statistics.median(seconds), result


def of_r(
    program: str, columns: np.ndarray, response: np.ndarray, repeat: int
) -> tuple[float, dict[int, tuple[float, tuple]]]:
    """Seconds of leaps or lmSubsets, and for each size its RSS and columns."""
    with tempfile.TemporaryDirectory() as folder:
        data, result = Path(folder, "data.csv"), Path(folder, "result.csv")
        table = np.column_stack([columns, response])
        header = ",".join(f"x{j}" for j in range(table.shape[1]))
        np.savetxt(data, table, delimiter=",", header=header, comments="", fmt="%.17g")
        script = str(HERE / "leaps.R")
        subprocess.run(["Rscript", script, str(data), str(repeat), str(result), program], check=True)
        with result.open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    found = {int(row["size"]): (float(row["rss"]), tuple(map(int, row["columns"].split()))) for row in rows}
    return float(rows[0]["seconds"]), found


def compared(ours: SubsetSearch, theirs: dict[int, tuple[float, tuple]], x: np.ndarray, y: np.ndarray) -> str:
    """Agreement with the sets of R; its printed RSS carry its own rounding, so they are recomputed by QR."""
    apart, printed, same = 0.0, 0.0, 0
    for size, (rss, columns) in theirs.items():
        basis = np.linalg.qr(x[:, columns] - x[:, columns].mean(axis=0))[0]
        rest = y - y.mean()
        for _ in range(2):
            rest = rest - basis @ (basis.T @ rest)
        apart = max(apart, abs(ours.by_size[size][0].rss / float(rest @ rest) - 1.0))
        printed = max(printed, abs(rss / float(rest @ rest) - 1.0))
        same += ours.by_size[size][0].columns == columns
    verdict = "agree" if apart < 1e-8 else "DISAGREE"
    return (
        f"same sets {same}/{len(theirs)}; our RSS and those of its sets from the samples {verdict} to {apart:.0e}"
        f" (the RSS that it prints, to {printed:.0e})"
    )


def run_columns(source: object, repeat: int, with_leaps: list[int]) -> None:
    print(f"{'problem':>12} {'best s':>9} {'median s':>9} {'goal s':>7} {'nodes':>7}  proved")
    for name, p, goal in PROBLEMS:
        columns, response = getattr(source, name)(N_SAMPLES, p, 0)
        best, median, found = timed(repeat, lambda c=columns, y=response: best_subsets(cross_products(c, y), N_SAMPLES))
        print(f"{name:>8} {p:3d} {best:9.4f} {median:9.4f} {goal:7.2f} {found.nodes:7d}  {found.proved}", flush=True)
        if name == "thermal" and p in with_leaps:
            for program in installed():
                seconds, theirs = of_r(program, columns, response, 1 if p > 37 else 3)
                verdict = compared(found, theirs, columns, response)
                print(f"{'':13}{program} {seconds:.2f} s = {seconds / best:.0f} times ours; {verdict}", flush=True)


def installed() -> list[str]:
    """The programs that R has."""
    asked = "for (p in c('leaps', 'lmSubsets')) if (requireNamespace(p, quietly = TRUE)) cat(p, '')"
    return subprocess.run(["Rscript", "-e", asked], check=True, capture_output=True, text=True).stdout.split()


def run_trajectory(
    source: object, p: int, limits: tuple[float | None, ...], n_samples: int = N_SAMPLES, max_size: int | None = None
) -> None:
    """The gap against time; a limit of None is the end."""
    columns, response = source.thermal(n_samples, p, 0)
    cross = cross_products(columns, response)
    for limit in limits:
        started = time.process_time()
        found = best_subsets(cross, n_samples, time_limit_s=limit, max_size=max_size)
        spent = time.process_time() - started
        gaps = list(found.gap.values())
        print(
            f" thermal {p} columns, {n_samples} samples, after {found.seconds:6.3f} s ({spent:.3f} s of CPU): "
            f"{sum(gap == 0.0 for gap in gaps)} of {len(gaps)} sizes proved, largest gap {max(gaps):.2%} of the RSS, "
            f"that of the last size {gaps[-1]:.2%}, {found.nodes} nodes{'' if limit else ' (to the end)'}",
            flush=True,
        )


def run_sensors(source: object, repeat: int) -> None:
    columns, response = source.thermal(N_SAMPLES, 37, 0)
    rises = (columns - columns.mean(axis=0)) / columns.std(axis=0)
    pairs = list(itertools.combinations(range(37), 2))
    terms = np.column_stack([rises, rises**2, *[rises[:, a] * rises[:, b] for a, b in pairs]])
    owners = [(i,) for i in range(37)] * 2 + pairs
    for most, goal in ((4, 2.0), (5, 15.0)):
        best, median, found = timed(
            repeat,
            lambda most=most: best_sensor_sets(
                cross_products(terms, response), N_SAMPLES, owners, n_sensors=37, max_sensors=most
            ),
        )
        covered = found.coverage[most]
        total = math.comb(37, most)
        assert sum(vars(covered).values()) == total
        assert covered.left == 0
        print(
            f"sensors <= {most} of 37, {terms.shape[1]} terms: best {best:.3f} s, median {median:.3f} s, "
            f"goal {goal} s; {covered.evaluated} evaluated + {covered.bounded} excluded by a bound = {total}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    sibling = HERE.parent.parent / "shared" / "bench" / "subset_data.py"
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("SELECTOR_BENCH_DATA", sibling)))
    parser.add_argument("--leaps", type=int, nargs="*", default=[37], help="numbers of thermal columns to run leaps on")
    parser.add_argument("--many", action="store_true", help="the gap against time with 100 and 1000 columns")
    parser.add_argument("--repeat", type=int, default=7)
    parser.add_argument("--quick", action="store_true", help="one repetition, no leaps")
    options = parser.parse_args()
    source: object = problems_from(options.data)
    if source is None:
        print(f"{options.data} is not there: own problems of the same kind (give others with --data).")
        source = type("own", (), {"easy": staticmethod(easy), "thermal": staticmethod(thermal)})
    if shutil.which("Rscript") is None:
        print("Rscript is not there: no comparison (Debian packages r-base-core and r-cran-leaps).")
    repeat = 1 if options.quick else options.repeat
    started = time.perf_counter()
    best_subsets(cross_products(*easy(50, 8, 0)), 50)
    print(f"first call, compilation or its cache included: {time.perf_counter() - started:.1f} s")
    run_columns(source, repeat, [] if options.quick or shutil.which("Rscript") is None else options.leaps)
    run_trajectory(source, 60, (0.05, 0.1, 0.2, 0.4, 0.8, None))
    if options.many:
        run_trajectory(source, 100, (1.0, 3.0, 10.0, 30.0, None))
        for n_samples in (2_000, 10_000):
            run_trajectory(source, 1000, (10.0, 60.0), n_samples, 10)
    run_sensors(source, min(repeat, 3))


if __name__ == "__main__":
    main()
