"""Simulated machines whose truth is known: which sensors matter, how, and with what memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from selector.recording import Recording
from tests.models.runs import recording

PERIOD_S = 30.0
SENSORS = ("T1", "T2", "T3", "T4", "T5", "T6", "T7")
"""T1 to T3 near the spindle, T4 and T5 on the column, T6 and T7 in the air; T1, T4 and T6 are the least noisy."""

Law = Callable[[Mapping[str, NDArray[np.float64]]], NDArray[np.float64]]
"""True displacement [µm] from the true rises [K] `spindle`, `column`, `air`, `hidden`, and `speed` [rpm]."""


def linear(truth: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Spindle and column, each with a sensor of its own."""
    return np.asarray(6.0 * truth["spindle"] - 4.0 * truth["column"])


def rises(rng: np.random.Generator, n: int, tau_hidden_s: float) -> dict[str, NDArray[np.float64]]:
    """True rises of one run with a duty cycle of its own."""
    speed = np.repeat(rng.choice([0.0, 1500.0, 3000.0, 6000.0], size=n // 20 + 1), 20)[:n]
    heat = speed / 1000.0

    def first_order(drive: NDArray[np.float64], tau_s: float) -> NDArray[np.float64]:
        out = np.zeros(n)
        for k in range(1, n):
            out[k] = out[k - 1] + PERIOD_S / (tau_s + PERIOD_S) * (drive[k] - out[k - 1])
        return out

    spindle = first_order(1.6 * heat, 900.0)
    air = np.cumsum(rng.normal(0, 0.03, n)) + rng.uniform(-1, 1) * np.linspace(0, 2, n)
    column = first_order(0.8 * heat, 3000.0) + 0.5 * first_order(air, 2000.0)
    hidden = first_order(spindle, tau_hidden_s)
    return {"spindle": spindle, "column": column, "air": air - air[0], "hidden": hidden, "speed": speed}


def machine(
    law: Law = linear,
    *,
    n_runs: int = 5,
    n: int = 240,
    seed: int = 0,
    noise_um: float = 0.5,
    tau_hidden_s: float = 1800.0,
    speed: bool = False,
    second: Law | None = None,
    names: Callable[[int], str] = lambda r: f"day{r + 1}",
) -> Recording:
    """Runs of a machine; Z follows the law, Y the second one if there is one."""
    rng = np.random.default_rng(seed)
    runs = {}
    t = np.arange(n) * PERIOD_S
    for r in range(n_runs):
        truth = rises(rng, n, tau_hidden_s)
        displacements = [one(truth) for one in (law, second) if one is not None]
        base = rng.uniform(18, 26)
        gain = {"T1": ("spindle", 1.0, 0.01), "T2": ("spindle", 0.8, 0.15), "T3": ("spindle", 0.6, 0.15)}
        gain |= {"T4": ("column", 1.0, 0.01), "T5": ("column", 0.7, 0.15)}
        gain |= {"T6": ("air", 1.0, 0.01), "T7": ("air", 1.1, 0.15)}
        values = {name: base + k * truth[of] + rng.normal(0, sd, n) for name, (of, k, sd) in gain.items()}
        for name, true_um in zip("ZY", displacements, strict=False):
            values[name] = true_um + rng.normal(0, noise_um, n)
        if speed:
            values["n"] = truth["speed"]
        runs[names(r)] = (t, values)
    return recording(runs)


def found_ids(selection) -> set[str]:
    """Ids of all findings."""
    return {finding.id for finding in selection.findings}


def one_finding(selection, kind: str):
    """The only finding of this kind."""
    (finding,) = [finding for finding in selection.findings if finding.id == kind]
    return finding
