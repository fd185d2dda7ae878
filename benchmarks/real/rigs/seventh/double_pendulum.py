"""Two links on two motors: angles, speeds and torques of both while they are excited by sines."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, thinned
from benchmarks.real.rigs.fifth.common import over
from benchmarks.real.rigs.fourth.common import SILENT
from benchmarks.real.rigs.seventh.common import rate
from selector.recording import Channel

_DAY = "data/experiment_records/design_A.0/20220815"
_PLACE, _STILL = f"{_DAY}/sys_id/trajectory_{{:02d}}.csv", f"{_DAY}/noise/velocity_measurement/trajectory.csv"
_TORQUES, _SPEEDS = (0, 1, 12, 13, 2), (0, 1, 2, 13, 12)
_STEP_S, _STILL_STEP_S = 0.01, 0.005
_MEANS, _ENDS, _HALF_S, _LATE_S = 10, 5, 0.01, 0.00102
_ELBOW = (
    Channel("torque", "force", "N", place="elbow, 1 N m as 1 N", axis="C"),
    Channel("angle", "position", "m", place="elbow, 1 rad as 1 m", axis="C"),
    Channel("speed", "velocity", "m/s", place="elbow, 1 rad/s as 1 m/s", axis="C"),
)


def _course(folder: Path, number: int) -> tuple[Vector, pd.DataFrame]:
    """Even moments, and what was read at its own."""
    raw = pd.read_csv(folder / _PLACE.format(number))
    times = raw.iloc[:, 0].to_numpy()
    return np.arange(times[0] + 0.1, times[-1] - 0.1, _STEP_S), raw


def _joints(folder: Path, number: int) -> pd.DataFrame:
    grid, raw = _course(folder, number)
    times = raw.iloc[:, 0].to_numpy()
    names = {"q1": "pos_meas1", "angle": "pos_meas2", "torque": "tau_meas2", "speed": "vel_meas2"}
    return over(pd.DataFrame({name: np.interp(grid, times, raw[of]) for name, of in names.items()}), _STEP_S)


def _frictionless(run: pd.DataFrame) -> list[Vector | float]:
    """Regressors of the elbow's torque: inertia, coupling, weight, offset."""
    first, second = run["q1"].to_numpy(), run["angle"].to_numpy()
    a1, a2 = (rate(angle, _STEP_S, 31, 2) for angle in (first, second))
    v1 = rate(first, _STEP_S, 21)
    return [a1 + a2, np.cos(second) * a1 + np.sin(second) * v1**2, np.sin(first + second), 1.0]


def _torque(folder: Path) -> Pair:
    runs = {f"sines {k}": _joints(folder, k) for k in _TORQUES}
    known = list(runs.values())[:-1]
    shapes = [[np.broadcast_to(shape, len(run)) for shape in _frictionless(run)] for run in known]
    target = np.concatenate([run["torque"].to_numpy() for run in known])
    factors = least_squares([np.concatenate(part) for part in zip(*shapes, strict=True)], target)
    for run in runs.values():
        shapes_of = zip(factors, _frictionless(run), strict=True)
        run["torque" + SIMULATED] = sum(factor * shape for factor, shape in shapes_of)
    return pair({name: run.drop(columns="q1") for name, run in runs.items()}, _ELBOW)


def _speed(folder: Path, joint: int, *, late: bool) -> Pair:
    runs = {}
    for number in _SPEEDS:
        raw = pd.read_csv(folder / _PLACE.format(number))
        times, angle = raw.iloc[:, 0].to_numpy(), raw[f"pos_meas{joint}"].to_numpy()
        read = pd.DataFrame({"speed": raw[f"vel_meas{joint}"].to_numpy(), "at": times}, index=times)
        run = thinned(read, _MEANS).iloc[_ENDS:-_ENDS]
        at = run.pop("at").to_numpy() - (_LATE_S if late else 0.0)
        ahead, behind = (np.interp(at + side, times, angle) for side in (_HALF_S, -_HALF_S))
        run["speed" + SIMULATED] = (ahead - behind) / (2.0 * _HALF_S)
        runs[f"sines {number}"] = run.set_axis(pd.Index(run.index - run.index[0], name="time_s"))
    place = {1: "shoulder", 2: "elbow"}[joint]
    return pair(runs, (Channel("speed", "velocity", "m/s", place=f"{place}, 1 rad/s as 1 m/s", axis="C"),))


def _at_rest(folder: Path) -> Pair:
    raw = pd.read_csv(folder / _STILL)["vel_meas1"]
    rows = len(raw) // 2
    parts = {name: raw.iloc[k * rows : (k + 1) * rows].to_numpy() for k, name in enumerate(("first", "second"))}
    runs = {f"{name} half": over(pd.DataFrame({"speed": values, "speed" + SIMULATED: np.zeros(rows)}), _STILL_STEP_S)
            for name, values in parts.items()}  # fmt: skip
    return pair(runs, (Channel("speed", "velocity", "m/s", place="shoulder, 1 rad/s as 1 m/s", axis="C"),))


_READING = "2 ms a row, evened to 10 ms"
_MEANT = "2 ms a row, means of ten"
_SLOW = "speed by the angles 10 ms before and behind; a fifth record is held out"

CASES = (
    RealCase(
        name="double_pendulum/frictionless elbow",
        kind="positive",
        build=_torque,
        model="the elbow's torque by inertia, coupling and weight, fitted to four records; a fifth is held out",
        truth="dry and viscous friction of the drive (the authors identify both)",
        right=("drive.coulomb", "drive.viscous"),
        tolerated=("drive.stribeck", "drive.asymmetric_friction", "drive.varying_damping", "drive.mass", "drive.delay",
                   "gauging.lag", "data.clock"),
        reading=_READING,
    ),
    RealCase(
        name="double_pendulum/late speed",
        kind="positive",
        build=partial(_speed, joint=2, late=False),
        model=f"the elbow's {_SLOW}",
        truth="the drive's speed is 1.0 ms late against its angle, in every record and in both joints (read off)",
        right=("data.clock", "drive.delay", "gauging.lag"),
        tolerated=("drive.mass", "drive.elasticity"),
        verdicts=("miscalibrated",),
        reading=_MEANT,
    ),
    RealCase(
        name="double_pendulum/speed of the shoulder",
        kind="control",
        build=partial(_speed, joint=1, late=True),
        model=f"the shoulder's {_SLOW}, 1.02 ms late",
        truth="nothing is missing: 0.5 % are left that alternate, steps of the angle",
        verdicts=SILENT,
        reading=_MEANT,
    ),
    RealCase(
        name="double_pendulum/speed of the elbow",
        kind="control",
        build=partial(_speed, joint=2, late=True),
        model=f"the elbow's {_SLOW}, 1.02 ms late",
        truth="nothing is missing: 0.4 % are left that alternate, steps of the angle",
        verdicts=SILENT,
        reading=_MEANT,
    ),
    RealCase(
        name="double_pendulum/at rest",
        kind="control",
        build=_at_rest,
        model="the shoulder stands still; the second half of a record of 10 s is held out",
        truth="nothing is missing: white noise in steps, which the authors recorded for its own sake",
        verdicts=SILENT,
        reading="5 ms a row; steps of 0.022 rad/s",
    ),
)  # fmt: skip
