"""A ball on a beam, held by a control whose output ends at ten volts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair, thinned
from selector.recording import Channel

_FILES = {
    "multisine": "05_multisine_01",
    "swept sine": "04_swept_sine",
    "steps 2": "03_random_steps_02",
    "steps 4": "03_random_steps_04",
}
_MEAN_OF = 60
_CHANNELS = (
    Channel("wanted", "position_command", "m", place="wanted place of the ball, volts as metres", axis="B"),
    Channel("place", "position", "m", place="place of the ball, filtered, volts as metres", axis="B"),
    Channel("u", "voltage", "V", place="output of the control", axis="B"),
)


def _unlimited(folder: Path) -> Pair:
    runs = {}
    for run, name in _FILES.items():
        read = {
            key: np.ravel(value).astype(float)
            for key, value in loadmat(folder / "data" / f"{name}.mat").items()
            if key[0] != "_"
        }
        columns = {"wanted": read["ref"], "place": read["yf"], "u": read["u"]}
        runs[run] = thinned(pd.DataFrame(columns).set_axis(pd.Index(read["time"], name="time_s")), _MEAN_OF)
    fitted = runs["multisine"]
    (gain,) = least_squares([(fitted["wanted"] - fitted["place"]).to_numpy()], fitted["u"].to_numpy())
    for frame in runs.values():
        frame["u" + SIMULATED] = gain * (frame["wanted"] - frame["place"])
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="ball_beam/unlimited",
        kind="positive",
        build=_unlimited,
        model="output = gain x (wanted - place), fitted to the multisine; the last steps are held out",
        truth="the output stands at exactly 10 V for 7, 3 and 5.8 % of steps 2, steps 4 and swept sine (read off)",
        right=("drive.saturation",),
        tolerated=("drive.delay",),
        reading="means of 60 rows (1 ms)",
    ),
)
