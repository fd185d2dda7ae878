"""How often the true stiffness and ψ lie in the 95 % intervals that a fit to a simulated tap test gives.

    OMP_NUM_THREADS=1 python benchmarks/bench_taps.py [--machines 100] [--seed 0]

Every machine is `fixtures/vibration/small-lathe.toml` with each stiffness and ψ drawn within ±40 %, tool and workpiece
tapped three to five times each, three members measured: `tests/physics/vibration/planted_taps.py` says how blows, noise
and sensors are. UFF files are written and read again, once with records in time (which end while they still ring), once
with the spectra and coherence of an analyser that uses no window.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.physics.vibration.taps import tap_fit
from selector.readers.uff_file import TapOptions, read_taps
from tests.physics.vibration.planted_taps import NODES, drawn, model, records, spectra, write_uff

WAYS = {"records in time": records, "spectra and coherence": spectra}


def outcome(way: str, seed: int, folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of every parameter: whether the truth is inside, half the interval as a share of it, and whether it is a ψ."""
    true, file = drawn(seed), model()
    path = write_uff(folder / "taps.uff", WAYS[way](true, seed, 3 + seed % 3))
    points = {node: name for name, node in NODES.items()}
    responses, _ = read_taps([path], TapOptions(points))
    fitted = tap_fit(file, responses).parameters
    truth = np.array([true.parameters[one.name].value for one in fitted])
    low, high = (np.array([getattr(one, end) for one in fitted], dtype=np.float64) for end in ("low", "high"))
    is_psi = np.array(["dissipation" in one.name for one in fitted])
    return (low <= truth) & (truth <= high), (high - low) / 2 / truth, is_psi


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for way in WAYS:
            found = [outcome(way, asked.seed + k, Path(folder)) for k in range(asked.machines)]
            inside, half, is_psi = (np.array(one) for one in zip(*found, strict=True))
            print(f"{way}, {asked.machines} machines: all numbers inside in {inside.all(axis=1).mean():.0%}")
            for name, mask in (("stiffness", ~is_psi), ("ψ", is_psi)):
                print(
                    f"  {name}: inside {inside[mask].mean():.1%}, half interval {np.nanmedian(half[mask]):.2%} (median)"
                )


if __name__ == "__main__":
    main()
