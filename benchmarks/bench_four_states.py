"""The four states of the patent's figures 7 to 10 on the simulated machine: as it is, with an oil cooler, compensated.

    python benchmarks/bench_four_states.py

The curves of the figures are lost; their numbers are beside ours in docs/explanation/thermal-field.md. Models are
fitted to the warming that the patent describes (1500 to 3000 r/min in steps) and judged on another day.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from selector.cli import exit_status

FILE = """
[model]
kind = "field"
name = "four states"
[run]
duration_min = 420
period_s = 60
step_s = 30
seed = {seed}
[conditions]
spindle_speed_rpm = {speed}
ambient_degc = {ambient}
[field]
refinement = 0.2
"""
COOLER = """
[cooled."headstock inside"]
still_w_per_m2_k = {film}
fixed_degc = {degc}
[cooled."spindle inside"]
still_w_per_m2_k = {film}
fixed_degc = {degc}
"""
INSTRUMENTS = "".join(
    f'[[sensors]]\nname = "{name}"\nnoise_k = 0.03\nresolution_k = 0.01\n' for name in ("T01", "T05", "T11")
) + "".join(f'[[gauges]]\nname = "{name}"\nnoise_um = 0.4\n' for name in ("Y_lower", "Y_upper", "Z"))
STEPS = "[[0, 1500], [105, 2000], [210, 2500], [315, 3000]]"
OTHER = "[[0, 2000], [60, 3000], [200, 1500], [260, 3000]]"
DAYS = (
    (STEPS, "{ mean = 21.0, amplitude = 1.5, period_min = 1440, phase_min = 200 }", 1),
    (OTHER, "{ mean = 19.0, amplitude = 2.0, period_min = 1440, phase_min = 500 }", 2),
)
FILM_W_PER_M2_K, OIL_DEGC = 200.0, 20.0
WARM_MIN = 240


def course(day: tuple[str, str, int], *, cooled: bool) -> tuple[np.ndarray, np.ndarray]:
    """Rises (n, 3) of T01, T05, T11 [K] and moves (n, 3) of Y below, Y above and Z [µm]."""
    speed, ambient, seed = day
    text = FILE.format(speed=speed, ambient=ambient, seed=seed) + INSTRUMENTS
    if cooled:
        text += COOLER.format(film=FILM_W_PER_M2_K, degc=OIL_DEGC)
    with tempfile.TemporaryDirectory() as folder:
        model, out = Path(folder) / "model.toml", Path(folder) / "run.csv"
        model.write_text(text, encoding="utf-8")
        assert exit_status(["simulate", "thermal", str(model), "--out", str(out), "--json"]) == 0
        values = pd.read_csv(out)[["T01", "T05", "T11", "Y_lower", "Y_upper", "Z"]].to_numpy()
    moved = values - values[0]
    return moved[:, :3], moved[:, 3:]


def columns(rises: np.ndarray, sensors: int) -> np.ndarray:
    """Those of the patent: two sensors, or three with the products of two."""
    if sensors == 2:
        return np.column_stack([np.ones(len(rises)), rises[:, :2]])
    pairs = [rises[:, i] * rises[:, j] for i, j in itertools.combinations(range(3), 2)]
    return np.column_stack([np.ones(len(rises)), rises, *pairs])


def main() -> None:
    """Prints a Markdown table."""
    with contextlib.redirect_stdout(io.StringIO()):
        learnt, other = course(DAYS[0], cooled=False), course(DAYS[1], cooled=False)
        cooler = course(DAYS[1], cooled=True)
    states = {"no cooler": other[1], "oil cooler": cooler[1]}
    for sensors in (2, 3):
        fit = np.linalg.lstsq(columns(learnt[0], sensors), learnt[1], rcond=None)[0]
        states[f"no cooler, {sensors} sensors"] = other[1] - columns(other[0], sensors) @ fit
    print("| state | Z, largest | Z, mean when warm | Y below, largest | Y, mean when warm |")
    print("|---|---:|---:|---:|---:|")
    for name, left in states.items():
        z, y = np.abs(left[:, 2]), np.abs(left[:, :2].mean(axis=1))
        warm = slice(WARM_MIN, None)
        print(
            f"| {name} | {z.max():.0f} | {z[warm].mean():.1f} | {np.abs(left[:, 0]).max():.0f} | {y[warm].mean():.1f} |"
        )


if __name__ == "__main__":
    main()
