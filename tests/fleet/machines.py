"""Small machines of a fleet as folders of recordings, and ways in which one is broken."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from selector.fleet.machine_study import Answer
from selector.fleet.workers import Work


class Here:
    """Workers without a process: a study is done where it is begun. For tests that ask what is done, not where."""

    def __init__(self) -> None:
        self._done: list[tuple[str, Answer | None]] = []

    @property
    def free(self) -> int:
        return 1 - len(self._done)

    def start(self, task: Work) -> None:
        self._done.append((task.name, task.answered()))

    def finished(self, timeout_s: float) -> list[tuple[str, Answer | None]]:
        done, self._done = self._done, []
        return done

    def stop(self, name: str) -> None:
        raise AssertionError("a study that is done cannot be given up")

    def close(self) -> None:
        self._done = []


def machine(folder: Path, seed: int, *, n_runs: int = 4, rows: int = 40) -> Path:
    """Four thermometers that follow two sources of heat, and the displacement that these make."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    mix = rng.normal(size=(2, 4))
    time_s = 60.0 * np.arange(rows)
    for run in range(n_runs):
        heat = rng.uniform(1, 6, 2) * (1 - np.exp(-time_s[:, None] / [600.0, 2400.0]))
        rises = heat @ mix + rng.normal(0, 0.05, (rows, 4))
        table = np.column_stack([time_s, 20 + rises, heat @ [3.0, -2.0] + rng.normal(0, 0.2, rows)])
        head = "t [s],T1 [degC],T2 [degC],T3 [degC],T4 [degC],Z [um]"
        lines = [",".join(f"{value:.4f}" for value in row) for row in table]
        (folder / f"r{run + 1}.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return folder


def fleet_file(folder: Path, text: str) -> Path:
    """FLEET.toml of this text."""
    path = folder / "FLEET.toml"
    path.write_text(text, encoding="utf-8")
    return path


def changed(folder: Path, runs: range, change: Callable[[pd.DataFrame], None]) -> None:
    """These recordings of a machine, changed."""
    for number in runs:
        path = folder / f"r{number}.csv"
        table = pd.read_csv(path)
        change(table)
        table.to_csv(path, index=False)


def sister(
    folder: Path, number: int, *, n_runs: int = 4, gain: tuple[float, float] = (3.0, -2.0), rows: int = 40
) -> Path:
    """A machine of one type: where its four thermometers sit, and what two sources of heat do, differs by a little."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([number, 5])
    mix = np.array([[1.0, 0.2, 0.6, 0.4], [0.1, 0.9, 0.5, -0.5]]) * (1.0 + 0.02 * rng.normal(size=(2, 4)))
    own = np.array(gain) * (1.0 + 0.05 * rng.normal(size=2))
    time_s = 60.0 * np.arange(rows)
    for run in range(n_runs):
        heat = rng.uniform(1, 6, 2) * (1 - np.exp(-time_s[:, None] / [600.0, 2400.0]))
        unseen = 0.8 * rng.normal() * (1 - np.exp(-time_s / 1500.0))
        table = [
            time_s,
            20 + heat @ mix + rng.normal(0, 0.05, (rows, 4)),
            heat @ own + unseen + rng.normal(0, 0.2, rows),
        ]
        head = "t [s],T1 [degC],T2 [degC],T3 [degC],T4 [degC],Z [um]"
        lines = [",".join(f"{value:.4f}" for value in row) for row in np.column_stack(table)]
        (folder / f"r{run + 1}.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return folder
