"""Seconds and memory of a diagnosis against samples, responses, input channels and the size of the catalogue.

    python benchmarks/bench_diagnosis.py [--what samples responses inputs catalogue] [--repeat 1]

A spindle warms a machine through two time constants, the simulation has one of them. Every measurement runs in a
process of its own with one thread, so that memory is that of this diagnosis alone; kernels are compiled before.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time

import numpy as np
import pandas as pd

SETTINGS: dict[str, list[dict[str, int]]] = {
    "samples": [{"samples": n} for n in (1_000, 3_000, 10_000, 30_000, 50_000, 100_000)],
    "responses": [{"responses": n} for n in (1, 2, 4, 8)],
    "inputs": [{"inputs": n} for n in (2, 5, 10, 20, 40)],
    "catalogue": [{"effects": n} for n in (5, 10, 20, 40)],
}


def comparison(samples: int, responses: int, inputs: int):
    """Three runs of a warming machine; temperatures near and far, distractors as far as `inputs` goes."""
    from selector.diagnosis.matching.alignment import comparison_of
    from selector.recording import Channel, Recording

    draw = np.random.default_rng(0)
    n = samples // 3
    time_s = 3.0 * 3600.0 * np.arange(n) / n
    step_s = time_s[1]
    temperatures = [f"T{k}" for k in range(1, inputs)]
    channels = [Channel("n", "spindle_speed", "rpm"), *(Channel(name, "temperature", "degC") for name in temperatures)]
    shown = [Channel(f"Z{k}", "displacement", "um", axis="Z") for k in range(1, responses + 1)]
    recorded, simulated = {}, {}
    for run in ("r1", "r2", "r3"):
        speed = np.repeat(draw.choice([0.0, 1500.0, 3000.0, 6000.0], 12), -(-n // 12))[:n]
        fast, slow = (_lagged(speed / 6000.0, tau_s, step_s) for tau_s in (900.0, 5000.0))
        values = {"n": speed}
        for k, name in enumerate(temperatures):
            wander = np.cumsum(draw.normal(0.0, 0.002, n)) if k % 3 == 2 else 0.0
            values[name] = 20.0 + (8.0 / (1 + k % 4)) * _lagged(speed / 6000.0, 600.0 * (1 + k % 5), step_s) + wander
        given = {}
        for k, channel in enumerate(shown):
            given[channel.name] = (20.0 - k) * fast
            values[channel.name] = given[channel.name] + 1.5 * slow + draw.normal(0.0, 0.5, n)
        index = pd.Index(time_s, name="time_s")
        recorded[run] = pd.DataFrame(values, index=index)
        simulated[run] = pd.DataFrame(given, index=index)
    return comparison_of(Recording.from_runs(recorded, [*channels, *shown]), Recording.from_runs(simulated, shown))


def _lagged(values: np.ndarray, tau_s: float, step_s: float) -> np.ndarray:
    from scipy.signal import lfilter

    share = 1.0 - np.exp(-step_s / tau_s)
    return lfilter([share], [1.0, share - 1.0], values)


def measure(samples: int = 9_000, responses: int = 2, inputs: int = 6, effects: int = 0) -> dict[str, float | str]:
    """Time and memory of one diagnosis in this process; `effects` > 0 keeps only so many of the catalogue."""
    from selector.diagnosis.effects.catalogue import catalogue
    from selector.diagnosis.workflow import diagnosis

    diagnosis(comparison(600, 1, 3), seed=0)
    # spread over the families, with the one that is right
    kept = [one for one in catalogue() if one.id == "thermal.memory"]
    kept += [one for one in catalogue() if one.id != "thermal.memory"]
    kept = kept[:1] + kept[1 :: max(1, (len(kept) - 1) // (effects - 1))][: effects - 1] if effects else kept
    case = comparison(samples, responses, inputs)
    before_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    started = time.perf_counter()
    answer = diagnosis(case, seed=0, effects=kept)
    return {
        "seconds": time.perf_counter() - started,
        "more_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before_mb,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "named": ", ".join(effect.id for effect in answer.effects) or answer.verdict,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--what", nargs="+", choices=list(SETTINGS), default=list(SETTINGS))
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(**json.loads(options.one))))
        return
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    for what in options.what:
        print(f"\n{what:>12s}  seconds  more_MB  peak_MB  named")
        for setting in SETTINGS[what]:
            runs = []
            for _ in range(options.repeat):
                command = [sys.executable, __file__, "--one", json.dumps(setting)]
                done = subprocess.run(command, stdout=subprocess.PIPE, text=True, env=environment, check=True)
                runs.append(json.loads(done.stdout))
            best = min(runs, key=lambda run: run["seconds"])
            (number,) = setting.values()
            memory = f"{best['more_mb']:7.0f}  {best['peak_mb']:7.0f}"
            print(f"{number:12d}  {best['seconds']:7.2f}  {memory}  {best['named']}", flush=True)


if __name__ == "__main__":
    main()
