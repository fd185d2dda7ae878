"""Two RC filters in a row behind a converter: random steps of voltage, and the voltage behind them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fourth.common import SILENT, lagging
from benchmarks.real.rigs.third.common import pieces
from selector.recording import Channel

_STEP_S = 0.001
_SPANS = {"first": (0.0, 5.0), "second": (5.0, 10.0), "third": (10.0, 15.0)}
_CHANNELS = (
    Channel("u", "voltage", "V", place="converter"),
    Channel("y", "voltage", "V", place="behind the second filter"),
)


def _model(x: Vector, run: pd.DataFrame) -> Vector:
    """Gain, offset, one time constant [s] or two."""
    course = x[0] * run["u"].to_numpy() + x[1]
    for tau_s in x[2:]:
        course = np.asarray(lagging(course, _STEP_S, abs(tau_s) + 1e-5, float(run["y"].iloc[0])))
    return course


def _filters(folder: Path, *, start: tuple[float, ...]) -> Pair:
    raw = pd.read_csv(folder / "csvs/ls_output_data.csv")
    whole = pd.DataFrame(
        {"u": raw["DAC"].to_numpy(), "y": raw["ADC"].to_numpy()}, index=pd.Index(_STEP_S * np.arange(len(raw)))
    )
    runs = pieces(whole, _SPANS)
    known = list(runs.values())[:2]
    guess = np.array([1.0, 0.01, *start])
    law = minimised(lambda x: np.concatenate([_model(x, run) - run["y"] for run in known]), guess, x_scale=guess).x
    for run in runs.values():
        run["y" + SIMULATED] = _model(law, run)
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="rc_filter/one lag",
        kind="positive",
        build=partial(_filters, start=(0.007,)),
        model="one lag, fitted to two stretches; a third is held out",
        truth="there are two filters, documented; the second makes the voltage 1 to 2 ms later",
        right=("gauging.lag", "drive.delay", "data.clock"),
        tolerated=("thermal.memory", "drive.elasticity", "drive.mass", "vibration.mode"),
        verdicts=("miscalibrated",),
        reading="1 ms, steps of 2 mV",
    ),
    RealCase(
        name="rc_filter/two lags",
        kind="control",
        build=partial(_filters, start=(0.0055, 0.0008)),
        model="two lags, fitted to two stretches; a third is held out",
        truth="9 mV are left of 420, an autoregression leaves 8",
        verdicts=SILENT,
        reading="1 ms, steps of 2 mV",
    ),
)
