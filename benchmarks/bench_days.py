"""Leave-one-day-out errors on a recording of many days: the plain regression, ours, and ours with memory.

python benchmarks/bench_days.py --x ACE_X.xlsx --y ACE_Y.xlsx

The workbooks hold one sheet a day, temperatures in one file, the displacement in the other, without time stamps.
The public recording that they are meant for has no licence and is not shipped; it is used in place.

With --honesty four, six and nine days are drawn by chance, ten times each: true ÷ promised error on the other days that
are within the valid range of the model, and whether that is within the factor that is told.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.bench_honesty import told, true_rmse_um
from selector.recording import Channel, Recording
from selector.selection import Options, select

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data" / "ace_thermal"
PERIOD_S = 10.0


def recording_of(x: Path, y: Path) -> Recording:
    """One run a sheet; the first column of the second file is the displacement, "Ambient" the ambient."""
    inputs, outputs = (pd.read_excel(file, sheet_name=None, engine="openpyxl") for file in (x, y))
    runs = {}
    for (name, temperatures), displacement in zip(inputs.items(), outputs.values(), strict=True):
        table = temperatures.assign(Z=displacement.iloc[:, 0].to_numpy())
        table.columns = [str(column).strip().replace(" ", "_") for column in table.columns]
        table.index = np.arange(len(table)) * PERIOD_S
        runs[name] = table
    channels = [
        Channel("Z", "displacement", "um")
        if name == "Z"
        else Channel(name, "ambient" if name == "Ambient" else "temperature", "degC")
        for name in table.columns
    ]
    return Recording.from_runs(runs, channels)


def plain_errors(recording: Recording, *, rise: bool, mean_only: bool = False) -> np.ndarray:
    """Per-day RMS of a linear regression on all sensors (or of the mean), fitted without that day."""
    sensors = recording.with_role("temperature", "ambient")
    tables = {}
    for run in recording.runs:
        values = recording.values(run, [*sensors, "Z"])
        tables[run] = values - values[0] if rise else values
    errors = []
    for run in recording.runs:
        rest = np.vstack([table for name, table in tables.items() if name != run])
        columns = [np.ones(len(rest))] if mean_only else [np.ones(len(rest)), *rest[:, :-1].T]
        beta = np.linalg.lstsq(np.column_stack(columns), rest[:, -1], rcond=None)[0]
        own = tables[run]
        predicted = beta[0] if mean_only else beta[0] + own[:, :-1] @ beta[1:]
        errors.append(own[:, -1] - predicted)
    return np.array([[np.sqrt(np.mean(e**2)), len(e)] for e in errors])


def honesty(recording: Recording, draws: int = 10) -> None:
    """A line for every number of days and way of asking."""
    rng, days = np.random.default_rng(5), np.array(recording.runs)
    asked = {"rise": {}, "rise, memory": {"memory": True}, "absolute": {"reference": "absolute"}}
    print("| days | true ÷ promised: median | factor told | within it | told as known | within its factor | not told |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    found: dict[tuple[int, str], list[tuple[float, float]]] = {(n, way): [] for n in (4, 6, 9) for way in asked}
    for _ in range(draws):
        for n in (4, 6, 9):
            drawn = np.isin(days, rng.choice(days, n, replace=False))
            seen, other = (
                Recording.from_runs({day: recording.frame.loc[day] for day in some}, recording.channels)
                for some in (days[drawn], days[~drawn])
            )
            for way, options in asked.items():
                selection = select(seen, Options(responses=("Z",), max_sensors=3, **options))
                assert selection.known is not None
                ratio = true_rmse_um(selection, other, inside=True)[0] / selection.proof.rmse_um("Z")
                if np.isfinite(ratio):
                    found[n, way].append((ratio, selection.known.factor))
    for (n, way), pairs in found.items():
        ratios, factors = map(np.array, zip(*pairs, strict=True))
        print(f"| {n}, {way} ({len(pairs)}) | {np.median(ratios):.2f} | {told(ratios, factors)} |")
    ratios, factors = (np.concatenate([np.array(pairs)[:, k] for pairs in found.values()]) for k in (0, 1))
    print(f"| all ({len(ratios)}) | {np.median(ratios):.2f} | {told(ratios, factors)} |")


def line(name: str, rmse: np.ndarray, n: np.ndarray) -> None:
    """One line of the table."""
    pooled = np.sqrt((rmse**2 * n).sum() / n.sum())
    print(f"| {name} | {pooled:.1f} | {np.median(rmse):.1f} | {rmse.max():.1f} |")


def main() -> None:
    """Print the table and the findings."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--x", type=Path, default=SHARED / "ACE_X.xlsx")
    parser.add_argument("--y", type=Path, default=SHARED / "ACE_Y.xlsx")
    parser.add_argument("--honesty", action="store_true")
    options = parser.parse_args()
    if not options.x.exists():
        raise SystemExit(f"{options.x} is not there: give the two workbooks with --x and --y")
    recording = recording_of(options.x, options.y)
    if options.honesty:
        honesty(recording)
        return
    for reference in ("absolute", "rise"):
        print(f"\n{reference}\n| way | all days | median day | worst day |\n|---|---|---|---|")
        rise = reference == "rise"
        line("mean predictor", *plain_errors(recording, rise=rise, mean_only=True).T)
        line("plain regression on all six", *plain_errors(recording, rise=rise).T)
        for memory in (False, True):
            found = select(recording, Options(reference=reference, memory=memory, max_sensors=6))
            parts = found.proof.per_response["Z"]
            line(
                f"selector{' --memory' if memory else ''}: {', '.join(found.chosen)}; {found.recipe.shape}",
                np.array([part.rmse_um for part in parts]),
                np.array([part.n_samples for part in parts]),
            )
            for finding in found.findings:
                if finding.id in ("regimes", "terms-that-help", "terms-not-used", "no-better-than-nothing"):
                    print(f"  [{finding.id}] {finding.statement}")


if __name__ == "__main__":
    main()
