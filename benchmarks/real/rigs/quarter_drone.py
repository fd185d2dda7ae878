"""One arm of a drone on a hinge, lifted by its propeller in closed loop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as fitted_to
from scipy.signal import cont2discrete, lfilter

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from selector.recording import Channel

_DATA = "data/quarter_drone"
_FILES = {
    "steps": "sinal2_degraus_malha_fechada.csv",
    "swept sine": "sinal3_swept_sine_malha_fechada.csv",
    "multisine": "sinal4_multiseno_malha_fechada.csv",
    "slow": "sinal1_semi_estatica_malha_fechada.csv",
}
_MEAN_OF = 4
_SKIPPED_S = 10.0
_PER_VOLT = 0.1
_CHANNELS = (
    Channel("u", "voltage", "V", place="control output, percent as volts"),
    Channel("angle", "position", "m", place="arm, angle as travel at a lever of 1 m", axis="A"),
)


def _linear(folder: Path) -> Pair:
    runs = {}
    for name, file in _FILES.items():
        raw = pd.read_csv(folder / _DATA / file)
        columns = {"u": raw["Controle_u"], "angle": np.deg2rad(raw["Saida_y"])}
        runs[name] = thinned(pd.DataFrame(columns).set_axis(pd.Index(raw["Tempo_s"], name="time_s")), _MEAN_OF)
    step_s = float(np.median(np.diff(runs["steps"].index)))
    fitted = [runs[name] for name in ("steps", "swept sine", "multisine")]

    def left(x: Vector) -> Vector:
        return np.concatenate([(_swing(x, frame, step_s) - frame["angle"].to_numpy())[60:] for frame in fitted])

    x = fitted_to(left, np.array([np.log(10.0), np.log(2.0), np.log(0.4), 0.0]), x_scale="jac").x
    skipped = round(_SKIPPED_S / step_s)
    for name, frame in runs.items():
        frame["angle" + SIMULATED] = _swing(x, frame, step_s)
        kept = frame.iloc[skipped:]
        runs[name] = kept.set_axis(kept.index - kept.index[0])
    return pair(runs, _CHANNELS, "slow")


def _swing(x: Vector, frame: pd.DataFrame, step_s: float) -> Vector:
    """Free run of y'' + d y' + w² y = w² (g u + o), from the rest that the first output would hold."""
    (stiffness, damping, gain), offset, u = np.exp(x[:3]), x[3], frame["u"].to_numpy()
    b, a, _ = cont2discrete(([_PER_VOLT * gain * stiffness], [1.0, damping, stiffness]), step_s)
    return np.asarray(lfilter(np.ravel(b), a, u - u[0]) + _PER_VOLT * gain * u[0] + offset)


CASES = (
    RealCase(
        name="quarter_drone/linear",
        kind="positive",
        build=_linear,
        model="linear oscillator of second order driven by the control output, fitted to steps, swept sine and "
        "multisine in free run; the slow ramp is held out",
        truth="the notebook lagrange_quarter_drone.ipynb there derives gravity by the sine of the angle and viscous "
        "friction; angles go from 0 to 94 degrees (read off)",
        right=("vibration.hardening", "drive.varying_stiffness"),
        tolerated=("drive.delay", "drive.varying_damping"),
        reading="means of four rows (10 ms); the first 10 s, before the simulation has settled, are left out",
    ),
)
