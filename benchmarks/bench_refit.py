"""How often a model in use is replaced although nothing changed, and what it helps where the machine did change.

    python benchmarks/bench_refit.py [--machines 40] [--jobs 2] [--seed 8000]

Machines of four thermometers and eight recorded days get a model by `fleet run`. Then come twelve days more, before the
last six of which something has changed for good (or, in the rows *day 9*, before the first of them); then `fleet run
--refit`. Twenty days more, which nobody has seen, show what the model that is in use then leaves of them, beside the
old one and the new one. False: replaced where nothing changed, or by one that is worse in those days.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.controllers.model_file import read_model
from selector.fleet import Processes, read_answer, read_fleet, run_fleet
from selector.readers import read
from selector.study.applied import applied

KNOWN, LATER, UNSEEN, ROWS = 8, 12, 20, 60
HEAD = "t [s],T1 [degC],T2 [degC],T3 [degC],T4 [degC],Z [um]"

CHANGES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "nothing": lambda z: z,
    "5 % more": lambda z: 1.05 * z,
    "10 % more": lambda z: 1.1 * z,
    "30 % more": lambda z: 1.3 * z,
}


def days(folder: Path, seed: int, numbers: range, since: int, change: str) -> None:
    """Recordings of these days; from day `since` on the displacement is another."""
    folder.mkdir(parents=True, exist_ok=True)
    mix = np.random.default_rng(seed).normal(size=(2, 4))
    time_s = 120.0 * np.arange(ROWS)
    for number in numbers:
        rng = np.random.default_rng([seed, number])
        heat = rng.uniform(1, 6, 2) * (1 - np.exp(-time_s[:, None] / [900.0, 3600.0]))
        unseen = 0.4 * rng.normal() * (1 - np.exp(-time_s / 3000.0))
        rises = heat @ mix + rng.normal(0, 0.05, (ROWS, 4))
        true = heat @ [3.0, -2.0] + unseen
        z = (CHANGES[change](true) if number >= since else true) + rng.normal(0, 0.3, ROWS)
        lines = [",".join(f"{value:.4f}" for value in row) for row in np.column_stack([time_s, 20 + rises, z])]
        (folder / f"d{number:02}.csv").write_text("\n".join([HEAD, *lines]) + "\n", encoding="utf-8")


def left_um(model: Path, folder: Path) -> float:
    """Root mean square error of a model in recordings."""
    error = applied(read_model(model), read([folder]))[0].overall["Z"].rmse_um
    assert error is not None
    return error


def main() -> None:
    """Prints a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=40)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=8000)
    asked = parser.parse_args()
    print(
        "| change | replaced | by a worse one | old model [µm] | in use after it [µm] | refitted without asking [µm] |"
    )
    print("|---|---:|---:|---:|---:|---:|")
    for change, since in [("nothing", 99), *((c, s) for c in list(CHANGES)[1:] for s in (9, 15))]:
        with tempfile.TemporaryDirectory() as temporary:
            root = Path(temporary)
            names = [f"m{k}" for k in range(asked.machines)]
            for k, name in enumerate(names):
                days(root / "plant" / name, asked.seed + k, range(1, KNOWN + 1), since, change)
            (root / "FLEET.toml").write_text('folders = ["plant/*"]\n', encoding="utf-8")
            fleet = read_fleet(root / "FLEET.toml")
            run_fleet(fleet, Processes(asked.jobs))
            old = read_answer(fleet.results).machines
            for k, name in enumerate(names):
                days(root / "plant" / name, asked.seed + k, range(KNOWN + 1, KNOWN + LATER + 1), since, change)
                later = range(KNOWN + LATER + 1, KNOWN + LATER + UNSEEN + 1)
                days(root / "unseen" / name, asked.seed + k, later, since, change)
            new = run_fleet(fleet, Processes(asked.jobs), refit=True).machines
            rows = []
            for name in names:
                of = new[name].refit
                assert of is not None
                assert of.challenger is not None, of.because
                keys = old[name].key, of.challenger
                errors = [left_um(fleet.results / str(key) / "model.json", root / "unseen" / name) for key in keys]
                rows.append((of.promoted, *errors))
        taken = np.array([row[0] for row in rows])
        errors = np.array([row[1:] for row in rows])
        in_use = np.where(taken, errors[:, 1], errors[:, 0])
        rms = [f"{np.sqrt(np.mean(one**2)):.3f}" for one in (errors[:, 0], in_use, errors[:, 1])]
        worse = int(np.sum(taken & (errors[:, 1] > errors[:, 0])))
        when = "" if change == "nothing" else f" from day {since} on"
        print(f"| {change}{when} | {taken.sum()} of {len(rows)} | {worse} | {' | '.join(rms)} |", flush=True)


if __name__ == "__main__":
    main()
