"""What sisters are worth to a new machine: error with one, two and three runs, against own runs and one model of all.

    python benchmarks/bench_sisters.py [--seeds 5] [--machines 20] [--new 3] [--proved 20] [--kinds alike,two-types]

Fleets of machines with eight runs of four hours, twelve thermometers that are mixtures of three sources of heat, and a
displacement that follows these, a gauge (0.2 µm) and in every run a slow drift that no thermometer sees (0.6 µm). The
sources move the displacement by coefficients that machines have in common up to 5 % (alike), up to 35 % (scattered),
up to 5 % in two hidden types, or not at all (strangers). Thermometers sit a little elsewhere on each machine (5 %).

New machines are of the same kind, but for three fleets of alike ones, where they are of another type: the sources move
them by 20 or 40 % more or less (other-gains-20, other-gains-40), or all thermometers sit elsewhere (other-places).
Errors are those against the displacement without the gauge's noise in ten runs that
nobody has seen. Alone: what `select` makes of the known runs. Best: the sensors that the fleet shares, with
coefficients from twenty runs more of the new machine. Told: the error that the proof, on so many of the sisters, has
told before.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.errors import OptionError
from selector.fleet import sisters
from selector.fleet.sisters import Pool, Sisters
from selector.models.design import rows_of
from selector.recording import Channel, Recording
from selector.selection import Options, select
from selector.selection.survey import RunsOf

SAMPLES, PERIOD_S, SENSORS = 120, 120.0, 12
RUNS, LEARNT, UNSEEN = 8, 20, 10
TAU_S = np.array([900.0, 3600.0, 7200.0])
CHANNELS = (
    *(Channel(f"T{i + 1}", "temperature", "degC") for i in range(SENSORS)),
    Channel("Z", "displacement", "um", axis="Z"),
)
SCATTER = {"alike": 0.05, "scattered": 0.35, "two-types": 0.05, "strangers": 0.05}
OTHERS = ("other-gains-20", "other-gains-40", "other-places")  #: Kinds with new machines of another type


class Machine:
    """One machine of a fleet: where its thermometers sit, and what heat does to it."""

    def __init__(self, kind: str, seed: int, number: int, *, is_new: bool = False) -> None:
        fleet, self.rng = np.random.default_rng([seed, 1]), np.random.default_rng([seed, number, 2])
        own = self.rng if kind == "strangers" or (kind == "other-places" and is_new) else fleet
        mix = np.abs(own.normal(size=(3, SENSORS))) * np.array([[1.0], [0.8], [0.6]])
        gain = own.normal(0.0, 2.5, 3) if kind == "strangers" else np.array([3.0, -2.0, 1.5])
        if kind == "two-types" and self.rng.integers(2):
            gain = np.array([1.2, -3.2, 2.5])
        if kind.startswith("other-gains") and is_new:
            gain = gain * (1.0 + float(kind[-2:]) / 100.0 * self.rng.choice([-1.0, 1.0], 3))
        self.gain = gain * (1.0 + SCATTER.get(kind, 0.05) * self.rng.normal(size=3))
        self.mix = mix * (1.0 + 0.05 * self.rng.normal(size=mix.shape))

    def run(self) -> tuple[np.ndarray, np.ndarray]:
        """Readings with the displacement as recorded, and the true displacement."""
        rng, heat = self.rng, np.zeros((SAMPLES, 3))
        spindle, motor = (np.repeat(rng.uniform(0.0, 1.0, n), SAMPLES // n) for n in (8, 4))
        hall = 6.0 * rng.normal() * np.linspace(0.0, 1.0, SAMPLES)
        drive = np.column_stack([8.0 * spindle, 5.0 * motor + 2.0 * spindle, hall])
        for k in range(1, SAMPLES):
            heat[k] = heat[k - 1] + PERIOD_S / (TAU_S + PERIOD_S) * (drive[k] - heat[k - 1])
        drift = 0.6 * rng.normal() * (1.0 - np.exp(-PERIOD_S * np.arange(SAMPLES) / 5000.0))
        readings = 20.0 + 2.0 * rng.normal() + heat @ self.mix + rng.normal(0.0, 0.05, (SAMPLES, SENSORS))
        true = heat @ self.gain + drift
        return np.column_stack([readings, true + rng.normal(0.0, 0.2, SAMPLES)]), true

    def recording(self, n_runs: int) -> tuple[Recording, list[np.ndarray]]:
        """So many runs, and the true displacement in each."""
        tables, truths = {}, []
        for k in range(n_runs):
            table, true = self.run()
            index = pd.Index(PERIOD_S * np.arange(SAMPLES), name="time_s")
            tables[f"r{k + 1}"] = pd.DataFrame(table, index=index, columns=[one.name for one in CHANNELS])
            truths.append(true)
        return Recording.from_runs(tables, CHANNELS), truths


def fleet(kind: str, seed: int, machines: int, new: int) -> list[dict[str, float]]:
    """A row for every new machine and number of its runs."""
    recordings: dict[str, Recording] = {}
    truths: dict[str, list[np.ndarray]] = {}
    for k in range(machines + new):
        n_runs = RUNS if k < machines else 3 + LEARNT + UNSEEN
        recordings[f"m{k + 1}"], truths[f"m{k + 1}"] = Machine(kind, seed, k, is_new=k >= machines).recording(n_runs)
    names = list(recordings)[machines:]
    pool = Pool.of(recordings, names[0], Options())
    rows = []
    for count in (1, 2, 3):
        found = Sisters.of(pool, names, count, lambda _doing, _share: None)
        rows += [row(pool, found, name, np.concatenate(truths[name][3 + LEARNT :])) for name in names]
    return rows


def row(pool: Pool, found: Sisters, name: str, true: np.ndarray) -> dict[str, float]:
    """Squares of the errors of a new machine in its unseen runs, and what was told of it."""
    shared, runs, answer = found.shared, pool.runs[name], found.answer(name, {})
    assert shared is not None
    known, unseen, z = runs[: found.count], runs[3 + LEARNT :], answer.responses["Z"]
    seen = rows_of(pool.source, shared.recipe.design, unseen).variables
    best = shared.evidence(runs[3 : 3 + LEARNT], "Z")
    columns = np.column_stack([np.ones(len(seen)), shared.columns.matrix(seen)])
    ways = {way: of[:, 0] for way, of in shared.predicted(known, seen).items()}
    ways |= {"none": np.zeros(len(true)), "best": columns @ np.linalg.solve(best.normal, best.right)}
    ways["alone"] = alone(pool, known, unseen, len(true))
    return {
        "runs": found.count,
        **{way: float(np.mean((of - true) ** 2)) for way, of in ways.items()},
        "told": z.errors.get("sisters_um", float("nan")) ** 2,
        "helps": float(answer.verdict == "sisters"),
        "two": float(len(z.types) > 1),
        "unlike": float(z.distance > z.limit),
    }


def alone(pool: Pool, known: tuple[str, ...], unseen: tuple[str, ...], n: int) -> np.ndarray:
    """What `select` makes of the known runs; nothing where it makes nothing of them."""
    try:
        own = select(RunsOf(pool.source, known), pool.question.options)
    except OptionError:
        return np.zeros(n)
    design = own.recipe.design
    variables = rows_of(pool.source, type(design)(design.inputs, design.responses, pool.datum, design.lags), unseen)
    return own.models["Z"].predicted(variables.variables)


def main() -> None:
    """Makes the fleets, and keeps the rows of those that are done where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--machines", type=int, default=20)
    parser.add_argument("--new", type=int, default=3)
    parser.add_argument("--proved", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first fleet")
    parser.add_argument("--rows", type=Path, help="table of all new machines")
    parser.add_argument("--kinds", default=",".join((*SCATTER, *OTHERS)))
    asked = parser.parse_args()
    sisters.MOST_PROVED = asked.proved
    rows: list[dict[str, float | str]] = []
    for seed in range(asked.first, asked.first + asked.seeds):
        for kind in asked.kinds.split(","):
            rows += [{"kind": kind, **row} for row in fleet(kind, seed, asked.machines, asked.new)]
            if asked.rows is not None:
                pd.DataFrame(rows).to_csv(asked.rows, index=False)
    tell(pd.DataFrame(rows))


def tell(rows: pd.DataFrame) -> None:
    """Prints a Markdown table."""
    ways = ("none", "alone", "pooled", "sisters", "best", "told")
    print(f"| fleet | runs | {' | '.join(ways)} | helps | two groups | unlike |")
    print("|---|---:|" + "---:|" * (len(ways) + 3))
    for (kind, count), of in rows.groupby(["kind", "runs"], sort=False):
        errors = " | ".join(f"{np.sqrt(of[way].mean()):.2f}" for way in ways)
        told = " | ".join(f"{int(of[one].sum())} of {len(of)}" for one in ("helps", "two", "unlike"))
        print(f"| {kind} | {count:.0f} | {errors} | {told} |", flush=True)


if __name__ == "__main__":
    main()
