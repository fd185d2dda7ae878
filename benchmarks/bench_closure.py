"""Transitive closure of a similarity relation, side by side with other programs on the same matrices, in one run.

    python benchmarks/bench_closure.py [--sensors 5000] [--peer-sensors 500] [--repeat 5]

Prints seconds (best of the repetitions) and ratios. SciPy and scikit-fuzzy run on one thread, as
we do; results of all programs are compared before anything is printed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
import skfuzzy
from scipy.cluster.hierarchy import cophenet, linkage
from scipy.spatial.distance import squareform

from selector.sensors import lambda_axis, lambda_cut, similarity_from_cross_products, transitive_closure
from tests.sensors.by_definition import max_min_composition, transitive_closure_by_squaring


def random_correlation(n_sensors: int, seed: int = 0) -> np.ndarray:
    """Correlations of sensors that follow a few heat sources, 400 samples."""
    rng = np.random.default_rng(seed)
    sources = rng.standard_normal((12, 400)).cumsum(axis=1)
    series = rng.uniform(0, 1, (n_sensors, 12)) ** 3 @ sources + rng.standard_normal((n_sensors, 400))
    series -= series.mean(axis=1, keepdims=True)
    return similarity_from_cross_products(series @ series.T).matrix


def best_seconds(repeat: int, work: Callable[[], object]) -> float:
    seconds = []
    for _ in range(repeat):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def scipy_tree(r: np.ndarray) -> np.ndarray:
    return linkage(squareform(1 - r, checks=False), "single")


def scipy_closure(r: np.ndarray) -> np.ndarray:
    return 1 - squareform(cophenet(scipy_tree(r)))


def scikit_fuzzy_closure(r: np.ndarray) -> np.ndarray:
    while True:
        square = skfuzzy.maxmin_composition(r, r)
        if np.array_equal(square, r):
            return square
        r = square


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sensors", type=int, default=5000)
    parser.add_argument("--peer-sensors", type=int, default=500)
    parser.add_argument("--repeat", type=int, default=5)
    arguments = parser.parse_args()
    large, small = random_correlation(arguments.sensors), random_correlation(arguments.peer_sensors)

    ours = transitive_closure(small)
    assert np.array_equal(ours, transitive_closure_by_squaring(small)[0])
    assert np.array_equal(max_min_composition(small, small), skfuzzy.maxmin_composition(small, small))
    # SciPy works on 1 − S and loses the last bits of S there
    assert np.abs(ours - scipy_closure(small)).max() < 1e-15

    rows: list[tuple[str, int, float, float]] = []

    def timed(n: int, programs: list[tuple[str, int, Callable[[], object]]]) -> None:
        base = None
        for name, repeat, work in programs:
            seconds = best_seconds(repeat, work)
            base = base or seconds
            rows.append((name, n, seconds, seconds / base))

    many = arguments.repeat
    timed(
        arguments.sensors,
        [
            ("ours: closure", many, lambda: transitive_closure(large)),
            ("SciPy: linkage + cophenet (rounded)", many, lambda: scipy_closure(large)),
            ("SciPy: linkage alone, no closure", many, lambda: scipy_tree(large)),
            ("ours: one λ-cut", many, lambda: lambda_cut(large, 0.995)),
            ("ours: whole λ-axis with F", 1, lambda: lambda_axis(large)),
        ],
    )
    timed(
        arguments.peer_sensors,
        [
            ("ours: closure", many * 10, lambda: transitive_closure(small)),
            ("SciPy: linkage + cophenet (rounded)", many, lambda: scipy_closure(small)),
            ("ours: one composition", many, lambda: max_min_composition(small, small)),
            ("ours: closure by squaring", 1, lambda: transitive_closure_by_squaring(small)),
            ("scikit-fuzzy: one composition", 2, lambda: skfuzzy.maxmin_composition(small, small)),
            ("scikit-fuzzy: closure by squaring", 1, lambda: scikit_fuzzy_closure(small)),
        ],
    )
    print(f"{'program':38} {'sensors':>8} {'seconds':>10} {'× closure':>10}")
    for name, n, seconds, ratio in rows:
        print(f"{name:38} {n:8d} {seconds:10.4f} {ratio:10.1f}")


if __name__ == "__main__":
    main()
