"""A shaking table on a motor: wanted and limited voltage, position, and the speed that its control works out."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.io import loadmat

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over, simulated
from benchmarks.real.rigs.fourth.common import SILENT, lagging
from benchmarks.real.rigs.seventh.common import rate
from selector.recording import Channel

_STEP_S, _MEANS, _MM, _ROWS = 0.005, 4, 1e-3, 11
_NAME_AT, _NAME, _OUTPUT = 40, b"\x01\x00\x01\x00a\x00\x00\x00", 2
_X = Channel("x", "position", "m", place="table", axis="X")
_V = Channel("v", "velocity", "m/s", place="table", axis="X")
_U = Channel("u", "voltage", "V", place="motor, as wanted", axis="X")
_LIMITED = Channel("u", "voltage", "V", place="motor, as given", axis="X")
_SLOW = ("SineA02F02", "SineA02F06", "SineA05F1_5", "SineA05F03", "SineA03F01")
_QUICK = ("SineA05F1_5", "SineA05F03", "SineA1F1", "SineA2F3", "SineA5F2")
_FULL = ("SineA1F05", "SineA3F08", "SineA20F05", "SineA1F1")
_SMALL = ("SineA03F01", "SineA05F03")


def _logged(path: Path) -> Any:
    """What Simulink logged: its object stands in the file as a workspace without a name, and is read under one."""
    inner = loadmat(path)["__function_workspace__"].tobytes()
    nameless = inner[8:]
    named = b" " * 124 + inner[:4] + nameless[:_NAME_AT] + _NAME + nameless[_NAME_AT + len(_NAME) :]
    (objects,) = np.ravel(loadmat(io.BytesIO(named), squeeze_me=True)["a"]["MCOS"].item()["arr"])
    return objects[_OUTPUT]


def _read(folder: Path, name: str) -> pd.DataFrame:
    """Speed over four rows, and the voltages and the control's speed as means of these."""
    raw = _logged(folder / f"data/{name}.mat")
    logged = {of: np.asarray(raw[of].item(), dtype=np.float64) for of in ("Reference", "Ut", "Velocity", "timepos")}
    rows = (len(logged["Ut"]) - 1) // _MEANS * _MEANS
    means = {of: logged[of][:rows].reshape(-1, _MEANS).mean(axis=1) for of in ("Reference", "Ut", "Velocity")}
    position = _MM * logged["timepos"][: rows + 1 : _MEANS, 1]
    middle = 0.5 * (position[1:] + position[:-1])
    columns = {"v": np.diff(position) / (_MEANS * _STEP_S), "x": middle, "wanted": means["Reference"],
               "given": means["Ut"], "told": means["Velocity"]}  # fmt: skip
    return over(pd.DataFrame(columns), _MEANS * _STEP_S)


def _lag(x: Vector, run: pd.DataFrame) -> Vector:
    course = (x[0] + x[1] * run["u"]).to_numpy()
    return np.asarray(lagging(course, _MEANS * _STEP_S, abs(x[2]) + 1e-3, 0.0))


def _limit(folder: Path) -> Pair:
    names = (*_SMALL, "SineA1F05", "SineA3F08", "SineA1F1")
    runs = {name: _read(folder, name)[["v", "wanted"]].rename(columns={"wanted": "u"}) for name in names}
    simulated(runs, "v", _lag, [-0.002, 0.03, 0.06], len(_SMALL))
    return pair(runs, (_V, _U))


def _bare(x: Vector, run: pd.DataFrame) -> Vector:
    """Voltage by speed and its change, a motor with inertia and viscous friction."""
    return np.asarray(x[0] + x[1] * run["v"] + x[2] * rate(run["v"].to_numpy(), _MEANS * _STEP_S, _ROWS))


def _viscous(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["v"])


def _voltage(folder: Path, names: tuple[str, ...], *, inertia: bool) -> Pair:
    """The given voltage, and position and speed by parabolas or cubics over 0.22 s."""
    runs = {}
    for name in names:
        run = _read(folder, name)
        speed = rate(run["x"].to_numpy(), _MEANS * _STEP_S, _ROWS)
        runs[name] = over(
            pd.DataFrame({"u": run["given"], "x": run["x"], "v": speed}).iloc[_ROWS:-_ROWS], _MEANS * _STEP_S
        )
    if inertia:
        simulated(runs, "u", _bare, [0.05, 30.0, 1.6])
    else:
        simulated(runs, "u", _viscous, [0.05, 30.0])
    return pair(runs, (_LIMITED, _X, _V))


def _full(folder: Path) -> Pair:
    runs = {name: _read(folder, name)[["v", "given"]].rename(columns={"given": "u"}) for name in _FULL}
    simulated(runs, "v", _lag, [-0.002, 0.04, 0.05])
    return pair(runs, (_V, _LIMITED))


def _told(folder: Path) -> Pair:
    """The control's speed, which it takes in 1 m as 1000, beside that over four rows."""
    runs = {}
    for name in ("SineA1F1", "SineA2F3", "SineA05F1_5", "SineA8F4", "SineA5F2"):
        run = _read(folder, name)
        runs[name] = pd.DataFrame({"v": run["told"], "v" + SIMULATED: run["v"]})
    return pair(runs, (Channel("v", "velocity", "m/s", place="table, as its control works it out", axis="X"),))


def _again(folder: Path) -> Pair:
    runs = {}
    for name, (of, by) in {"5 Hz": ("SquareA1F5", "SquareA50F5"), "0.8 Hz": ("SquareA2F08", "SquareA5F08")}.items():
        run, other = _read(folder, of), _read(folder, by)
        runs[name] = pd.DataFrame({"v": run["v"], "u": run["given"], "v" + SIMULATED: other["v"]})
    return pair(runs, (_V, _LIMITED))


_READING = "5 ms a row, means of four; position in steps of 0.005 mm"

CASES = (
    RealCase(
        name="shaking_table/without limit",
        kind="positive",
        build=_limit,
        model="speed by the wanted voltage behind a lag, fitted to two runs of 0.3 and 0.5 V; a run of 1 V is held out",
        truth="the voltage is limited to 0.5 V (the authors' record of it)",
        right=("drive.saturation",),
        tolerated=("drive.coulomb", "drive.viscous", "drive.stribeck", "drive.varying_damping"),
        reading=_READING,
    ),
    RealCase(
        name="shaking_table/frictionless",
        kind="positive",
        build=partial(_voltage, names=_SLOW, inertia=True),
        model="the voltage by speed and acceleration, fitted to four runs of 0.2 and 0.5 V; a fifth, of 0.3 V, is held "
        "out",
        truth="dry friction worth 0.1 V (read off: the speed a volt falls from 33 to 17 mm/s as the voltage falls)",
        right=("drive.coulomb",),
        tolerated=("drive.stribeck", "drive.viscous", "drive.asymmetric_friction", "drive.varying_damping",
                   "drive.offset_force", "drive.mass", "drive.delay", "gauging.lag", "data.clock"),
        reading=_READING,
    ),
    RealCase(
        name="shaking_table/massless",
        kind="positive",
        build=partial(_voltage, names=_QUICK, inertia=False),
        model="the voltage by speed alone, fitted to four runs of 0.3 to 3 Hz; a fifth, of 2 Hz, is held out",
        truth="motor and table have inertia, a time constant of some 70 ms (read off)",
        right=("drive.mass",),
        tolerated=("drive.delay", "gauging.lag", "data.clock", "drive.elasticity", "drive.coulomb", "drive.stribeck"),
        reading=_READING,
    ),
    RealCase(
        name="shaking_table/late speed",
        kind="positive",
        build=_told,
        model="the control's speed is that of the position, in four runs; a fifth is held out",
        truth="the control filters it, by some 50 ms (read off)",
        right=("gauging.lag", "drive.delay", "data.clock"),
        tolerated=("drive.mass", "drive.elasticity"),
        verdicts=("miscalibrated",),
        reading=_READING,
    ),
    RealCase(
        name="shaking_table/again",
        kind="control",
        build=_again,
        model="a run of squares by another under the same voltage, at 5 Hz; a pair at 0.8 Hz is held out",
        truth="nothing is missing: the voltages are the same, and what is left is noise, larger where it moves quickly "
        "(rows are read at moments that jitter)",
        tolerated=("data.clock",),
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="shaking_table/at full voltage",
        kind="control",
        build=_full,
        model="speed by the given voltage behind a lag, fitted to three sines beyond the limit; a fourth is held out",
        truth="nothing is missing: what is left is white, and no more than two runs under one voltage differ by",
        tolerated=("data.clock",),
        verdicts=SILENT,
        reading=_READING,
    ),
)  # fmt: skip
