"""What `select` promises and what unseen runs bear out, on simulated machines whose truth is known.

    python benchmarks/bench_honesty.py [--machines 15] [--seed 1] [--rows cold,warm]

A machine is five bodies in a row (spindle, housing, column, bed, and one that no thermometer touches) in a hall with
its day and night; thermometers sit between bodies, with noise, steps of 0.1 K and a lag of their own. Every row of the
table asks `select` of 15 machines and then applies the model to 40 further runs: true ÷ reported error, whether it is
within the factor that is told, how many are told without a warning (`PROMISED_FACTOR`) and of how many it is said that
nothing can be told (`MOST_TOLD_FACTOR`), whether what was proposed is worse than no compensation, and the error over
that of the best four sensors, which only the further runs can tell (linear models of all sets of four, fitted on the
same runs), with that of four sensors by plain forward choice beside it. `--within` is that of `select`: by default it
gives up sensors that gain less than the noise of the gauge. Further runs that leave the valid range, of which `apply`
warns, count; `--inside` leaves them out.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pandas as pd

from selector.controllers.application import apply_model
from selector.controllers.from_selection import model_file_of
from selector.models.design import Design, datum_of, rows_of
from selector.recording import Channel, Recording
from selector.selection import Options, Selection, select
from selector.selection.doubts import PROMISED_FACTOR
from selector.selection.result import MOST_TOLD_FACTOR
from selector.telling.selected.advice import useless_responses

PERIOD_S, N_SENSORS, N_FURTHER = 60.0, 12, 40
SENSORS = tuple(f"T{j + 1}" for j in range(N_SENSORS))
Samples = np.ndarray


class Machine:
    """A chain of bodies with random conductances, a hidden one at its end."""

    def __init__(self, rng: np.random.Generator, hidden: float) -> None:
        self.rng = rng
        self.taus_s = np.exp(rng.uniform(np.log([300, 900, 2400, 6000, 4000]), np.log([900, 2400, 6000, 20000, 15000])))
        self.coupled = rng.uniform(0.3, 0.9, 5)
        self.heat = rng.uniform(6.0, 14.0)
        self.weights = rng.normal(0, 1, 5) * [3.0, 4.0, 5.0, 4.0, 6.0 * hidden]
        # a thermometer sits between two bodies that one can reach
        place = rng.uniform(0, 3, N_SENSORS)
        self.places = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(4)))
        self.lags_s = rng.uniform(30, 200, N_SENSORS)
        self.noise_k = np.exp(rng.uniform(np.log(0.02), np.log(0.15), N_SENSORS))

    def run(self, hours: float, *, warm: bool) -> pd.DataFrame:
        """A run; a warm one begins after some hours of other work and a pause that is seldom long enough."""
        rng, n = self.rng, round(hours * 60)
        before = round(rng.uniform(120, 600)) if warm else 0
        total = before + n
        length = rng.integers(20, 90)
        speed = np.repeat(rng.choice([0, 1500, 3000, 4500, 6000], total // length + 1), length)[:total].astype(float)
        if before:
            speed[before - round(rng.uniform(5, 60)) : before] = 0.0
        day = rng.uniform(0, 2 * np.pi)
        hall = rng.uniform(16, 27) + rng.uniform(0.5, 2.5) * np.sin(np.arange(total) * 2 * np.pi / 1440 + day)
        bodies, seen = np.full(5, hall[0]), np.empty((total, 5))
        source = np.zeros(5)
        share = PERIOD_S / (self.taus_s + PERIOD_S)
        for k in range(total):
            source[0] = self.heat * (speed[k] / 6000.0) ** 1.3
            ends = np.r_[bodies[0], bodies, bodies[-1]]
            pulled = hall[k] + self.coupled * (0.5 * (ends[:-2] + ends[2:]) - hall[k])
            bodies = bodies + share * (pulled + source - bodies)
            seen[k] = bodies
        read = seen[:, :4] @ self.places.T
        read[:, -1] = hall
        slow = PERIOD_S / (self.lags_s + PERIOD_S)
        for k in range(1, total):
            read[k] = read[k - 1] + slow * (read[k] - read[k - 1])
        table = pd.DataFrame(
            np.round((read + self.noise_k * rng.normal(size=read.shape))[before:], 1),
            columns=list(SENSORS),
            index=np.arange(n) * PERIOD_S,
        )
        rise = seen[before:] - seen[before]
        table["n"] = speed[before:]
        table["Z"] = rise @ self.weights + rng.normal(0, 0.4, n)
        return table


CHANNELS = (
    *(Channel(name, "temperature", "degC") for name in SENSORS),
    Channel("n", "spindle_speed", "rpm"),
    Channel("Z", "displacement", "um", axis="Z"),
)


Warm = Callable[[int], bool] | None


def recording(machine: Machine, n_runs: int, warm: Warm) -> Recording:
    """Runs of four to eight hours; None: one after the other, as their clocks say, the first from cold."""
    hours = machine.rng.uniform(4, 8, n_runs)
    if warm is not None:
        runs = {f"r{k + 1}": machine.run(hours[k], warm=warm(k)) for k in range(n_runs)}
        return Recording.from_runs(runs, CHANNELS)
    whole, ends = machine.run(float(hours.sum()) + 1.0, warm=False), np.round(np.cumsum(hours) * 60).astype(int)
    runs, starts = {}, {}
    for k, (start, stop) in enumerate(itertools.pairwise([0, *ends])):
        part = whole.iloc[start:stop].copy()
        starts[f"r{k + 1}"] = {"start": (datetime(2026, 3, 2) + timedelta(minutes=int(start))).isoformat()}
        part.index = part.index - part.index[0]
        part["Z"] -= part["Z"].iloc[:3].mean()
        runs[f"r{k + 1}"] = part
    return Recording.from_runs(runs, CHANNELS, {"runs": starts})


def true_rmse_um(selection: Selection, further: Recording, *, inside: bool = False) -> tuple[float, float]:
    """(error with the model, error without compensation) on further runs; `inside`: of those within the valid range.

    NaN where no three are.
    """
    model = model_file_of(selection, further.channels)
    # the start is what a curve through the first samples says, as in the fit and in the best four
    starts = {
        run: dict(levels)
        for run, levels in datum_of(further, selection.chosen, (), selection.options.reference).levels.items()
    }
    found = apply_model(model, further, starts)
    left = [one for one in found.findings if one.id == "outside-valid-range" and one.level == "warning"]
    outside = {one.where.run for one in left if inside}
    kept = [errors["Z"] for run, errors in found.per_run.items() if run not in outside]
    if not outside:
        return found.overall["Z"].rmse_um, found.overall["Z"].before_rmse_um
    squares = np.array([(one.rmse_um**2, one.before_rmse_um**2) for one in kept])
    both = np.sqrt(squares.mean(axis=0)) if len(kept) >= 3 else (np.nan, np.nan)
    return float(both[0]), float(both[1])


def fours_um(seen: Recording, further: Recording) -> tuple[float, float]:
    """Errors on the further runs of linear models with four sensors that were fitted to the runs seen.

    That of the set which only the further runs can tell, and that of a plain forward choice by runs left out.
    """

    def moments(runs: Recording) -> list[Samples]:
        datum = datum_of(runs, SENSORS, ("Z",), "rise")
        found = rows_of(runs, Design(SENSORS, ("Z",), datum), runs.runs)
        rows = np.column_stack([np.ones(len(found.run)), found.variables, found.responses])
        return [rows[found.run == k].T @ rows[found.run == k] for k in range(len(runs.runs))]

    def left(fitted: Samples, asked: Samples, sets: Samples) -> Samples:
        """Squares that models of these sets, (n_sets, n_columns), leave of what is asked."""
        pairs = sets[:, :, None], sets[:, None, :]
        beta = np.linalg.solve(fitted[pairs], fitted[sets, -1][:, :, None])[:, :, 0]
        crossed = (beta * asked[sets, -1]).sum(axis=1)
        return np.asarray(asked[-1, -1] - 2 * crossed + np.einsum("si,sij,sj->s", beta, asked[pairs], beta))

    runs = moments(seen)
    ours, theirs = np.sum(runs, axis=0), np.sum(moments(further), axis=0)
    forward = [0]
    while len(forward) <= 4:
        longer = np.array([[*forward, j] for j in range(1, N_SENSORS + 1) if j not in forward])
        unseen = np.sum([left(ours - run, run, longer) for run in runs], axis=0)
        forward = longer[np.argmin(unseen)].tolist()
    fours = np.array([[0, *(1 + np.array(four))] for four in itertools.combinations(range(N_SENSORS), 4)])
    best, chosen = left(ours, theirs, fours).min(), left(ours, theirs, np.array([forward]))[0]
    return float(np.sqrt(best / theirs[0, 0])), float(np.sqrt(chosen / theirs[0, 0]))


ROWS: dict[str, tuple[int, Warm, Options, float]] = {
    "cold, 6 runs": (6, lambda _: False, Options(max_sensors=4), 0.0),
    "warm, 6 runs": (6, lambda _: True, Options(max_sensors=4), 0.0),
    "cold, 6 runs, hidden body, memory": (6, lambda _: False, Options(max_sensors=4, memory=True), 1.0),
    "warm, 6 runs, hidden body, memory": (6, lambda _: True, Options(max_sensors=4, memory=True), 1.0),
    "one after the other, 6 runs": (6, None, Options(max_sensors=4), 0.0),
    "one after the other, 6 runs, hidden body, memory": (6, None, Options(max_sensors=4, memory=True), 1.0),
    "warm, 3 runs, hidden body, memory": (3, lambda _: True, Options(max_sensors=4, memory=True), 1.0),
    "every second warm, 4 runs, hidden body, memory": (4, lambda k: k % 2 == 1, Options(memory=True), 1.0),
}


def told(ratios: Samples, factors: Samples) -> str:
    """Cells: factor told, share within it; share told as known, of these within their factor; share not told."""
    held, known = np.abs(np.log(ratios)) <= np.log(factors), np.asarray(factors) <= PROMISED_FACTOR
    of_known = f"{held[known].mean():.0%}" if known.any() else "–"
    untold = np.mean(np.asarray(factors) > MOST_TOLD_FACTOR)
    return f"{np.median(factors):.2g} | {held.mean():.0%} | {known.mean():.0%} | {of_known} | {untold:.0%}"


def main() -> None:
    """Prints a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=15)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rows", default="", help="only rows whose names have one of these words, e.g. memory,3")
    parser.add_argument("--within", type=float, help="µm by which the error of equal sets may differ")
    parser.add_argument("--inside", action="store_true", help="only further runs within the valid range")
    arguments = parser.parse_args()
    print(
        "| row | true ÷ reported: median | 5 % to 95 % | within 0.67–1.5 | factor told | within it | told as known "
        "| within its factor | not told | proposed | worse than none | ÷ best four | forward ÷ best four |"
    )
    print("|---|" + "---:|" * 12)
    every: list[tuple[float, float]] = []
    for name, (n_runs, warm, options, hidden) in ROWS.items():
        if not any(word in name for word in arguments.rows.split(",")):
            continue
        options = replace(options, within=arguments.within)
        ratios, factors, worse, proposed, over_best, forwards = [], [], 0, 0, [], []
        for m in range(arguments.machines):
            machine = Machine(np.random.default_rng([arguments.seed, m]), hidden)
            seen = recording(machine, n_runs, warm)
            further = recording(machine, N_FURTHER, warm)
            selection = select(seen, options)
            true, before = true_rmse_um(selection, further, inside=arguments.inside)
            if np.isnan(true):
                continue
            ratios.append(true / selection.proof.rmse_um("Z"))
            factors.append(selection.known.factor if selection.known else PROMISED_FACTOR)
            best, forward = fours_um(seen, further)
            over_best.append(true / best)
            forwards.append(forward / best)
            if not useless_responses(selection):
                proposed += 1
                worse += true > before
        ratio = np.array(ratios)
        within = float(np.mean((ratio >= 0.67) & (ratio <= 1.5)))
        every += zip(ratio, factors, strict=True)
        low, high = np.quantile(ratio, [0.05, 0.95])
        print(
            f"| {name} | {np.median(ratio):.2f} | {low:.2f} to {high:.2f} | {within:.0%} | {told(ratio, factors)} "
            f"| {proposed} of {len(ratio)} | {worse} | {np.median(over_best):.2f} | {np.median(forwards):.2f} |",
            flush=True,
        )
    print(f"| all | | | | {told(*map(np.array, zip(*every, strict=True)))} | | | | |")


if __name__ == "__main__":
    main()
